"""Keys of cases: equal for equal questions, different for different ones."""

from dataclasses import replace
from math import inf

import pytest

from polhode.harness.references.extended import ReferenceFailedError
from polhode.harness.references.reference import reference
from polhode.harness.studies import case as module
from polhode.harness.studies.case import Case, attempt, judge, missing, time_once
from polhode.harness.studies.runner import _too_slow
from polhode.models.scene import EulerStart, Scene
from polhode.models.shape import Ellipsoid

SCENE = Scene(Ellipsoid((1.0, 0.8, 0.5)), 1000.0, EulerStart((1.0, 0.0, 2.0), (0.0, 0.0, 1.0)), 5.0)
CASE = Case("some", SCENE, "quaternion", "taylor", 1e-6, 11, 5.0)
WHOLE = Scene(Ellipsoid((1, 0.8, 0.5)), 1000, EulerStart((1, 0, 2), (0, -0.0, 1)), 5)


def test_equal_numbers_of_other_types_give_the_same_key():
    assert replace(CASE, scene=WHOLE, max_seconds=5).key == CASE.key
    assert replace(CASE, tolerance=1).key == replace(CASE, tolerance=1.0).key


def test_the_key_outlives_the_process(monkeypatch: pytest.MonkeyPatch):
    """Stores of before are resumed: the key of given versions stays what it was."""
    monkeypatch.setattr(module, "version_of", lambda package: "0")
    assert CASE.key == "3383ba4ed62688c6f42cce53058e146b06817699be0dda51ffd108a1fafbdfcb"


@pytest.mark.parametrize(
    "other",
    [
        replace(CASE, scene_name="other"),
        replace(CASE, form="euler-angles"),
        replace(CASE, solver="dop853"),
        replace(CASE, tolerance=1.0000000000000002e-6),
        replace(CASE, samples=12),
        replace(CASE, max_seconds=6.0),
        replace(CASE, backend="compiled"),
        replace(CASE, scene=replace(SCENE, stokes=1000.0000000000001)),
        replace(CASE, scene=replace(SCENE, time=6.0)),
        replace(CASE, scene=replace(SCENE, ellipsoid=Ellipsoid((1.0, 0.5, 0.8)))),
        replace(CASE, scene=replace(SCENE, start=EulerStart((1.0, 0.0, 2.0), (0.0, 0.0, 2.0)))),
    ],
)
def test_another_question_has_another_key(other: Case):
    assert other.key != CASE.key


def test_versions_belong_to_the_case(monkeypatch):
    before = CASE.key
    monkeypatch.setattr("polhode.harness.studies.case.version_of", lambda package: "0")
    assert CASE.key != before


def test_a_missing_library_is_a_record(monkeypatch):
    monkeypatch.setattr("polhode.solvers.contract.installed", lambda library: False)
    record = missing(CASE)
    assert record["status"] == "adapter_missing"
    assert record["message"] == "heyoka is not installed: pip install heyoka"


def test_the_whole_error_is_told_without_the_averaged_forms_own_reference(monkeypatch):
    scene = Scene(
        Ellipsoid((1.0, 1.0, 2.0)), 300.0, EulerStart((1.0, 0.5, 0.0), (1.0, 1.0, 1.0)), 30.0
    )
    case = Case("spheroid", scene, "averaged-spheroid", "cyrk-vern8", 1e-8, 51, 10.0)
    tried = attempt(case)
    known = judge(case, *tried)

    def refuse(scene, form, samples, seconds):
        if str(getattr(form, "name", form)) == "averaged-spheroid":
            raise ReferenceFailedError("no agreement")
        return reference(scene, form, samples, seconds)

    monkeypatch.setattr(module, "reference", refuse)
    found = judge(case, *tried)
    assert found["slow_error"] == known["slow_error"] > 1e-4
    assert found["solver_slow_error"] is found["model_slow_error"] is None
    assert found["reference_failed"] == "no agreement"


@pytest.mark.parametrize(("had", "disturbed"), [(0.0, True), (inf, False)])
def test_a_run_stopped_for_want_of_the_processor_is_marked_and_says_nothing_of_tighter_ones(
    had, disturbed, monkeypatch
):
    monkeypatch.setattr(
        "polhode.harness.common.timing.with_processor", lambda run: (run(), 0.01, had)
    )
    record = attempt(
        replace(CASE, scene=replace(SCENE, time=1e5), solver="rk45", max_seconds=0.01)
    )[0]
    assert record["status"] == "time_limit"
    assert record.get("disturbed", False) == disturbed
    assert _too_slow(record) != disturbed


def test_runs_that_average_may_take_few_steps():
    long = replace(SCENE, stokes=1e6, time=1e4)
    assert replace(CASE, scene=long).problem.least_steps > 10
    assert replace(CASE, scene=long, form="hybrid").problem.least_steps == 1
    assert replace(CASE, scene=long, solver="stroboscopic").problem.least_steps == 1


def test_a_timed_run_is_not_cut_by_the_limit_of_the_first(monkeypatch):
    case, runs = replace(CASE, solver="dop853", max_seconds=1e-9), []
    assert not case.solve().success
    solve = module.solve
    monkeypatch.setattr(
        module, "solve", lambda *args, **kw: runs.append(solve(*args, **kw)) or runs[-1]
    )
    assert time_once(case)[0] > 0
    assert runs[-1].success
