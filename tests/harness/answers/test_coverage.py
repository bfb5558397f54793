"""What `polhode validate --errors N --fit` fits: rows of known laws give these laws back."""

import json

import numpy as np
import pytest

from polhode.harness.answers import coverage, fitted

TURNS = np.geomspace(10.0, 3000.0, 60)


def row(solver="cyrk-vern8", tolerance=1e-8, turns=100.0, slow=1e-7, **more):
    """A run of the full equations, as the study records it."""
    return {
        "form": "quaternion",
        "solver": solver,
        "sort": "ordinary",
        "index": 0,
        "kind": "tighter",
        "family": "explicit",
        "tolerance": tolerance,
        "turns": turns,
        "steps": round(10 * turns),
        "slow": slow,
        "slow_uncertainty": 0.0,
        "slow_stated": [0.0, 1e-7, 1e-6],
        "slow_apart": 1e-6,
        **more,
    }


def test_the_growth_of_errors_is_read_from_runs_of_many_rotations():
    rows = [row(turns=turns, slow=3e-8 * (1 + turns) ** 0.5) for turns in TURNS]
    assert coverage.fitted(rows)["growth"]["explicit"] == {"slow": [3.0, 0.5]}


def test_errors_that_do_not_follow_the_tolerance_fit_no_growth():
    """Rounding, and errors that the reference does not resolve."""
    rows = [row(tolerance=1e-14, turns=turns) for turns in TURNS]
    rows += [row(slow_uncertainty=1e-7, turns=turns) for turns in TURNS]
    assert coverage.fitted(rows)["growth"]["explicit"] == {}


def test_steps_of_a_rotation_are_those_at_one_tolerance():
    order = fitted.steps_per_turn("explicit").order
    rows = [row(turns=turns, tolerance=tol) for turns in TURNS for tol in (1e-8, 1e-4)]
    for member in rows:
        share = (fitted.PACED_TOLERANCE / member["tolerance"]) ** (1 / order)
        member["steps"] = 14 * member["turns"] * share
    # A run that came to no end has no steps, and says nothing.
    rows.append({"form": "quaternion", "solver": "cyrk-vern8", "left_out": "max_steps"})
    assert coverage.fitted(rows)["steps"] == {"explicit": [14.0, order], "splitting": []}


def test_a_factor_stands_above_nearly_all_runs():
    factor = fitted.factors()["tighter"]["explicit"]["slow"].high
    stated = [0.0, 1e-7, factor * 1e-6]
    rows = [
        row(turns=10 + share, slow=1e-8 * share, slow_stated=stated)
        for share in np.linspace(1, 100, 200)
    ]
    low, middle, high = coverage.fitted(rows)["factors"]["tighter"]["explicit"]["slow"]
    assert (low, middle) == (pytest.approx(0.035, rel=0.1), pytest.approx(0.5, rel=0.1))
    assert 1.2 < high < 1.4


@pytest.mark.parametrize(("slow", "expected"), [(1.25e-6, 1.3), (3e-6, 3.0), (1e-6, 1.3)])
def test_the_margin_makes_no_end_larger_than_13_times_the_error_in_the_median(
    slow: float, expected: float
):
    factor = fitted.factors()["tighter"]["explicit"]["slow"].high
    stated = [0.0, 1e-7, factor * 1e-6]
    rows = [row(turns=10 + i, slow=1e-7, slow_stated=stated) for i in range(196)]
    rows += [row(turns=10 + i, slow=slow, slow_stated=stated) for i in range(4)]
    _, _, high = coverage.fitted(rows)["factors"]["tighter"]["explicit"]["slow"]
    assert high == pytest.approx(expected, rel=0.01)


def test_a_sort_of_few_scenes_is_not_outvoted():
    factor = fitted.factors()["tighter"]["explicit"]["slow"].high
    stated = [0.0, 1e-7, factor * 1e-6]
    rows = [row(turns=10 + i, slow=1e-7, slow_stated=stated) for i in range(4000)]
    rows += [row(sort="settled", slow=9e-7, slow_stated=stated, index=i) for i in range(50)]
    _, _, high = coverage.fitted(rows)["factors"]["tighter"]["explicit"]["slow"]
    assert high == pytest.approx(0.9, rel=0.01)


def test_an_estimate_counts_once_a_scene():
    factor = fitted.factors()["estimate"]["second order"]["slow"].high
    words = {"kind": "estimate", "family": "second order", "slow_stated": [0, 0, factor * 1e-6]}
    rows = [row(turns=10 + i, slow=1e-6 if i < 2 else 1e-7, index=i, **words) for i in range(200)]
    # Two scenes in two hundred err more; one of them is run often.
    rows += [row(turns=10 + i, slow=1e-6, index=0, **words) for i in range(100)]
    _, _, high = coverage.fitted(rows)["factors"]["estimate"]["second order"]["slow"]
    assert high == pytest.approx(0.13, rel=0.01)


def test_a_fit_replaces_what_it_has_and_leaves_the_rest(tmp_path, monkeypatch):
    path = tmp_path / "fitted.json"
    path.write_text(fitted.FITTED_FILE.read_text(encoding="utf-8"), encoding="utf-8")
    monkeypatch.setattr(coverage, "FITTED_FILE", path)
    before = json.loads(path.read_text(encoding="utf-8"))
    numbers = {
        "factors": {"tighter": {"explicit": {"slow": [0.1, 0.2, 0.3]}}},
        "growth": {"explicit": {}},
        "steps": {"explicit": [11.0, 8.0], "splitting": []},
    }
    coverage.save(numbers, "a command")
    after = json.loads(path.read_text(encoding="utf-8"))
    assert after["command"] == "a command"
    assert after["factors"]["tighter"]["explicit"]["slow"] == [0.1, 0.2, 0.3]
    kept = before["factors"]["tighter"]["explicit"]["orientation"]
    assert after["factors"]["tighter"]["explicit"]["orientation"] == kept
    assert after["growth"] == before["growth"]
    assert after["steps"] == {**before["steps"], "explicit": [11.0, 8.0]}


@pytest.mark.parametrize("sort", ["ordinary", "stiff", "spheroids", "exact"])
def test_runs_of_every_group_state_what_they_err_by(sort):
    rows = coverage.measured(sort, seed=77, index=0)
    judged = [found for found in rows if "left_out" not in found]
    assert judged
    assert all(found["slow"] <= 3 * found["slow_stated"][2] for found in judged)
    assert all(found["steps"] > 0 for found in judged if found["kind"] != "closed form")
