"""The page of the stiff side, from records made up."""

from pathlib import Path

import pytest
from PIL import Image

from polhode.harness.pages import stiff
from polhode.harness.studies.study import read_study
from polhode.models.catalogue import form as find_form
from polhode.solvers.catalogue import solver as find_solver

FILE = Path(stiff.__file__).parents[1] / "studies" / "stiff.toml"


def record(solver, times, *, error=1e-7, backend="compiled", jacobian="exact", **more):
    return {
        "key": f"{solver} {backend} {jacobian} {more}",
        "scene_name": "paper",
        "scene": {"stokes": 1e-4},
        "form": "quaternion",
        "solver": solver,
        "backend": backend,
        "jacobian": jacobian,
        "tolerance": 1e-8,
        "status": "reached_end",
        "message": "",
        "slow_error": error,
        "seconds_runs": times,
        **more,
    }


def runs(*records):
    return [stiff.Run.of(each) for each in records]


FASTEST = record("cyrk-bdf", [1e-3, 1.2e-3, 1.4e-3])


@pytest.mark.parametrize(("seconds", "tied"), [(1.1e-3, True), (1.3e-3, False)])
def test_a_lead_counts_beyond_the_runs_own_spread(seconds, tied):
    found = stiff.winners(runs(FASTEST, record("cyrk-radau", [seconds, 2e-3])))
    assert [winner.error for winner in found] == [1e-4, 1e-6]
    assert all(winner.run.solver == "cyrk-bdf" for winner in found)
    assert all(winner.tied is tied for winner in found)
    assert found[0].lead == pytest.approx(seconds / 1e-3)


def test_another_way_of_the_same_solver_is_no_rival():
    (winner, _) = stiff.winners(runs(FASTEST, record("cyrk-bdf", [2e-3], jacobian="difference")))
    assert winner.other is None


def test_gains_compare_runs_that_differ_in_nothing_else():
    difference = {"jacobian": "difference"}
    found = stiff.gains(
        runs(
            FASTEST,
            record("cyrk-bdf", [3e-3], **difference),
            record("cyrk-bdf", [1.0], tolerance=1e-5),
            record("cyrk-bdf", [9.0], tolerance=1e-6, **difference),
            record("ida", [1e-3], **difference),
            record("ida", [], status="step_underflow"),
        ),
        "jacobian",
        ("exact", "difference"),
    )
    assert {pair.solver: (pair.ratios, pair.only_first, pair.only_second) for pair in found} == {
        "cyrk-bdf": ([pytest.approx(3.0)], 0, 0),
        "ida": ([], 0, 1),
    }


def test_who_is_stopped_where_another_gets_through():
    stuck = {"status": "step_underflow", "message": "at t = 1", "slow_error": None}
    found = stiff.stopped(
        runs(
            FASTEST,
            record("ida", [], backend="numba", **stuck),
            record("radau", [], jacobian="difference", **stuck),
            record("bdf", [], form="euler-angles", **stuck),
        ),
        1e-8,
    )
    assert found == [
        "ida, called back: paper in quaternion at St = 1e-4 (step underflow: at t = 1)"
    ]


def test_the_page_begins_with_the_answer_and_has_a_figure_of_838_pixels(tmp_path):
    records = [
        FASTEST,
        record("cyrk-radau", [2e-3]),
        record("cyrk-bdf", [2e-3], jacobian="difference"),
        record("cvode-bdf", [1e-2]),
        record("cvode-bdf", [5e-2], backend="numba"),
    ]
    page = stiff.write_page(read_study(FILE), records, tmp_path, "polhode bench").read_text("utf-8")
    lines = [line for line in page.splitlines() if line]
    assert lines[0].startswith("# The stiff side")
    assert lines[1].startswith("**cyrk-bdf is the fastest in 2 of 2 cells**, at St = 1e-4")
    assert "× 5 as long in the median" in page
    with Image.open(tmp_path / "stiff.png") as picture:
        assert picture.width == 838


def test_runs_that_meet_no_error_have_a_page_too(tmp_path):
    records = [record("cyrk-bdf", [1e-3], error=1e-2), {**FASTEST, "scene_name": "spheroid"}]
    for chosen in (records, records[:1]):
        path = stiff.write_page(read_study(FILE), chosen, tmp_path, "polhode bench")
        assert "| paper | 1e-4 | – " in " ".join(path.read_text("utf-8").split())


def test_the_study_asks_every_implicit_solver_of_every_kind():
    study = read_study(FILE)
    assert all(find_solver(name).implicit for name in study.solvers)
    assert set(study.jacobians or ()) == {"exact", "difference"}
    stokes = {scene.stokes for _, scene in study.scenes}
    assert (min(stokes), max(stokes)) == (1e-6, 10.0)
    assert not any(find_form(name).averaged for name in study.forms)
