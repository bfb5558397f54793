"""Why a method will not do: the real reason, in numbers that bear it out; and what could be asked for instead."""

import re
from dataclasses import replace

import pytest

from polhode.harness.picking import trials
from polhode.harness.picking.laws import load_laws
from polhode.harness.picking.model_error import model_errors
from polhode.harness.picking.pilot import pilot
from polhode.harness.picking.ranking import NotAttainableError, pick
from polhode.harness.picking.refusals import (
    Refusal,
    Stage,
    apart,
    one_digit,
    one_digit_up,
    too_far_off,
    why_nothing,
)
from polhode.harness.references.errors import attainable
from polhode.models.catalogue import form
from polhode.models.scene import Scene, SlowStart
from polhode.models.scenes import named_scene

NUMBER = r"\d(?:\.\d+)?(?:e-?\d+)?"


def refusal(scene: Scene, error: float, want: str = "slow", **options) -> str:
    with pytest.raises(NotAttainableError) as refused:
        pick(scene, error, want, **options)
    return str(refused.value)


def from_l_and_e() -> Scene:
    """The paper's scene at a large St, its orientation forgotten: averaged forms alone take it."""
    scene = replace(named_scene("paper"), stokes=1e5, time=5e3)
    lx, ly, lz = scene.initial.angular_momentum[0].tolist()
    return replace(scene, start=SlowStart((lx, ly, lz), float(scene.initial.energy[0])))


@pytest.mark.parametrize(
    ("scene", "error", "want", "why"),
    [
        (named_scene("spheroid"), 1e-14, "orientation", "rounding along the run"),
        pytest.param(
            named_scene("needle"), 1e-14, "slow", "rounding along the run", marks=pytest.mark.slow
        ),
        (from_l_and_e(), 1e-7, "slow", "model error"),
    ],
    ids=["spheroid", "needle", "averaged alone"],
)
def test_an_error_that_is_refused_comes_with_one_that_is_not(scene, error, want, why, monkeypatch):
    """Below which laws promise nothing, whatever trials show."""
    text = refusal(scene, error, want)
    assert text.startswith(f"error: got {error!r}, not attainable: expected at least ")
    assert why in text
    least = re.search(rf"at least ({NUMBER})", text)
    assert least
    assert float(least[1]) > error
    assert pick(scene, float(least[1]), want).ranking
    monkeypatch.setattr(trials, "WAYS", 0)
    refusal(scene, 0.81 * float(least[1]), want)


def test_without_laws_rounding_is_not_blamed():
    text = refusal(named_scene("paper"), 1e-6, laws=replace(load_laws(), methods={}))
    assert "no law" in text
    assert "`polhode calibrate` measures" in text
    assert "rounding" not in text


def test_without_libraries_they_are_named(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("polhode.solvers.contract.installed", lambda library: False)
    text = refusal(named_scene("paper"), 1.7e-6)
    assert "is not installed: pip install" in text
    assert "rounding" not in text


def test_where_some_libraries_are_missing_both_are_told():
    told = [
        Refusal(
            "quaternion", "taylor", "heyoka is not installed: pip install heyoka", Stage.LIBRARY
        ),
        Refusal(
            "quaternion",
            "dop853",
            "rounding along the run leaves errors up to 2e-9, above 1e-9",
            Stage.ERROR,
            2e-9,
        ),
        Refusal(
            "quaternion",
            "rk45",
            "rounding along the run leaves errors up to 3e-9, above 1e-9",
            Stage.ERROR,
            3e-9,
        ),
        Refusal("averaged", "taylor", "St is too small", Stage.AVERAGING),
    ]
    expected = (
        "expected at least 2e-9 (quaternion by dop853): "
        "rounding along the run leaves errors up to 2e-9, above 1e-9"
    )
    assert why_nothing(told) == f"{expected}; heyoka is not installed: pip install heyoka"


def test_chaos_is_the_reason_where_it_is():
    text = refusal(named_scene("jeffery-chaotic"), 1e-3, "orientation")
    assert "chaotic" in text
    assert "rounding" not in text


def test_where_no_form_takes_the_start_that_is_the_reason():
    scene = replace(from_l_and_e(), stokes=0.01, time=1.0)
    assert "St is too small to average over rotations" in refusal(scene, 1e-3)


@pytest.mark.parametrize(
    ("time", "want", "why"),
    [
        (
            1e12,
            "orientation",
            "errors grow as large as the motion itself: rounding along the run leaves errors up to",
        ),
        (1e300, "slow", "the run of 1e300 inverse shear rates is too long"),
    ],
)
def test_absurd_durations_are_refused_in_words(time: float, want: str, why: str):
    text = refusal(replace(named_scene("top"), time=time), 1e-3, want)
    assert f"not attainable: {why}" in text
    assert "expected at least" not in text


def test_the_least_error_told_is_one_that_can_be_asked_for():
    """Of the ends of what double precision can hold, rounded to be printed, the one above is told."""
    scene = named_scene("fast-spin")
    least = re.search(rf"in double precision, expected at least ({NUMBER})$", refusal(scene, 1e-17))
    assert least
    exact = attainable(scene.ellipsoid, scene.initial)
    assert exact <= float(least[1]) <= 1.1 * exact
    assert "in double precision" not in refusal(scene, float(least[1]))


@pytest.mark.parametrize("name", ["stiff", "thin-plate"])
def test_small_st_is_told_before_what_else_is_wrong(name: str):
    scene = replace(named_scene(name), stokes=1e-3, time=1.0)
    reasons = {
        each.reason for each in pick(scene, 1e-3).excluded if each.form == "averaged-second-order"
    }
    (reason,) = reasons
    found = pilot(scene)
    share = f"{found.rotations / found.damping_times:.2g}"
    told = re.match(
        rf"St is too small to average over rotations: ({NUMBER}) of them per damping time", reason
    )
    assert told
    assert float(told[1]) == float(share) < 0.3


@pytest.mark.parametrize("factor", [1 - 1e-6, 1 - 1e-3, 1 + 1e-6, 1.03])
def test_a_model_error_and_what_it_exceeds_are_not_the_same_number(factor: float):
    scene = named_scene("spheroid")
    made = model_errors(form("averaged-spheroid"), pilot(scene))["slow"]
    assert made
    asked = made.high * factor
    way = "averaged-spheroid", "taylor"
    (reason,) = {
        each.reason for each in pick(scene, asked).excluded if (each.form, each.solver) == way
    }
    numbers = re.match(
        rf"model error up to ({NUMBER}) (exceeds|leaves the solver less than 5 % of) ({NUMBER})",
        reason,
    )
    assert numbers
    first, second = float(numbers[1]), float(numbers[3])
    assert (first > second) is (factor < 1)
    assert (numbers[2] == "exceeds") is (factor < 1)
    assert first == pytest.approx(made.high, rel=0.05)
    assert second == pytest.approx(asked, rel=0.05)


def test_equal_numbers_stay_equal():
    assert (
        str(too_far_off(1e-6, 1e-6, 0.05, ["why"]))
        == "model error up to 1e-6 leaves the solver less than 5 % of 1e-6: why"
    )


@pytest.mark.parametrize(
    ("one", "other", "texts"),
    [
        (1.04e-6, 1e-6, ("1.04e-6", "1e-6")),
        (2.14e-2, 1e-3, ("0.021", "0.001")),
        (1.0000004e-6, 1e-6, ("1.0000004e-6", "1e-6")),
        (12345.0, 1.0, ("12000", "1")),
    ],
)
def test_numbers_are_told_apart(one: float, other: float, texts: tuple[str, str]):
    assert apart(one, other) == texts
    assert apart(other, one) == texts[::-1]


@pytest.mark.parametrize("tolerance", [1e-15, 3.2e-13, 9.5e-12, 2e-8, 4.0000000000000003e-13])
def test_tolerances_of_one_digit_enclose_a_tolerance(tolerance: float):
    below, above = one_digit(tolerance), one_digit_up(tolerance)
    assert below <= tolerance * (1 + 1e-9)
    assert tolerance <= above * (1 + 1e-9)
    assert one_digit(above) == pytest.approx(above, rel=1e-12)
    assert above / below <= 2 + 1e-9
