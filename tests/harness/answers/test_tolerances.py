"""The loosest tolerance at which a method meets an error, against references of another method."""

import numpy as np
import pytest

from polhode import solve
from polhode.harness.answers import pace as paces
from polhode.harness.answers.pick import pick
from polhode.harness.answers.questions import questions
from polhode.harness.answers.rules import Method
from polhode.harness.answers.runs import Runner
from polhode.harness.answers.statement import difference
from polhode.harness.answers.tolerances import loosest
from polhode.models.catalogue import form
from polhode.models.scenes import named_scene
from polhode.solvers.catalogue import solver
from polhode.solvers.contract import UNLIMITED

PAIRS = [("quaternion", "cyrk-vern8"), ("spheroid-axis", "splitting"), ("quaternion", "taylor")]


def runner(scene):
    return Runner(scene, np.array([0.0, scene.time]))


def true_error(scene, run, want):
    """The largest difference from a run of another method at the tightest tolerance."""
    method = Method(form("quaternion"), solver("cyrk-dop853"))
    exact = runner(scene).run(method, 1e-14)
    return difference(scene.ellipsoid, run.observables, exact.observables).largest[want]


@pytest.mark.parametrize("first", [1e-4, 1e-6, 1e-10])
@pytest.mark.parametrize("want", ["slow", "orientation"])
@pytest.mark.parametrize(("form_name", "solver_name"), PAIRS)
def test_the_run_meets_the_error_by_little(form_name, solver_name, want, first):
    scene = named_scene("spheroid")
    method = Method(form(form_name), solver(solver_name))
    found = loosest(runner(scene), method, first, 1e-6, want, UNLIMITED)
    assert found is not None
    # The run may not have been made: one tighter and one looser tell of it.
    run = runner(scene).run(method, found.tolerance)
    made = true_error(scene, run, want)
    assert made <= 1e-6
    # The order of a Taylor run follows its tolerance, which comes in powers of ten.
    assert made >= 1e-8 or solver_name == "taylor"
    assert found.error / 10 < made < 4 * found.error
    assert found.steps == pytest.approx(run.steps, rel=0.1)
    assert found.tightest.run.tolerance <= found.tolerance


def test_runs_of_equal_steps_are_compared_with_a_far_tighter_one():
    """A sphere by splitting: rotations alone set the steps, and equal runs differ by nothing."""
    scene = questions(9402, 7)[6].scene
    method = Method(form("spheroid-axis"), solver("splitting"))
    found = loosest(runner(scene), method, 4e-6, 1e-9, "slow", UNLIMITED)
    assert found is not None
    assert found.tolerance == 1e-2
    # Each rotation of a sphere by splitting is exact: rounding alone is left.
    assert found.error < 1e-13


def test_runs_that_reach_the_limit_of_steps_tell_nothing():
    scene = named_scene("spheroid")
    method = Method(form("quaternion"), solver("cyrk-vern8"))
    assert loosest(runner(scene), method, 1e-8, 2e-6, "slow", 10) is None


def test_an_error_below_rounding_is_not_met():
    scene = named_scene("spheroid")
    method = Method(form("quaternion"), solver("cyrk-vern8"))
    found = loosest(runner(scene), method, 1e-10, 1e-18, "slow", UNLIMITED)
    assert found is not None
    assert found.error > 1e-18


class Counting(Runner):
    """A runner that keeps the tolerances of its runs."""

    def run(self, method, tolerance, *limits):
        self.tolerances = [*getattr(self, "tolerances", []), tolerance]
        return super().run(method, tolerance, *limits)


def test_two_runs_tell_of_one_between_them():
    scene = named_scene("spheroid")
    method = Method(form("quaternion"), solver("cyrk-vern8"))
    counting = Counting(scene, np.array([0.0, scene.time]))
    # The first run errs by 1e-7, the second, 30 times as loose, by 6e-6.
    found = loosest(counting, method, 1e-8, 2e-6, "slow", UNLIMITED)
    assert found is not None
    assert counting.tolerances == [1e-8, 3e-7]
    assert 1e-8 < found.tolerance < 3e-7
    assert not found.made


def test_where_steps_hardly_change_a_far_tighter_run_is_the_next():
    """Rotations set the steps of this run by splitting down to 1e-6."""
    question = questions(9502, 26)[25]
    method = Method(form("spheroid-axis"), solver("splitting"))
    scene = question.scene
    counting = Counting(scene, np.array([0.0, scene.time]))
    found = loosest(counting, method, 5e-4, question.error, "slow", UNLIMITED)
    assert found is not None
    assert found.error <= question.error
    assert len(counting.tolerances) <= 4


def test_hybrid_is_not_run_where_its_plan_is_a_full_run(monkeypatch):
    ran = []
    made = Runner.run

    def run(self, method, *options):
        ran.append(method.form.name)
        return made(self, method, *options)

    monkeypatch.setattr(Runner, "run", run)
    question = questions(9502, 6)[5]
    found = pick(question.scene, question.error, question.want, question.samples)
    (reason,) = [
        row.reason for row in found.excluded if (row.form, row.solver) == ("hybrid", "cyrk-dop853")
    ]
    assert "by the full equations" in reason
    assert "hybrid" not in ran


def test_a_forecast_is_put_right_by_a_run_of_the_scene():
    """The forecast of this scene is 140 times the error, so the tolerance was 200 times too tight."""
    question = questions(9402, 44)[43]
    found = pick(question.scene, question.error, question.want, question.samples)
    # `hybrid` may be as quick.
    first = next(row for row in found.ranking if row.reason.startswith("its run at"))
    method = Method(form(first.form), solver(first.solver))
    run = runner(question.scene).run(method, first.tolerance)
    made = true_error(question.scene, run, question.want)
    assert 0.02 * question.error < made <= question.error


def test_averaged_forms_are_measured_against_splitting():
    """What second order states of itself here is more than the error requested, and its error is less."""
    question = questions(9402, 57)[56]
    named = [("averaged-second-order", "cyrk-tsit5")]
    # A little above what the difference from splitting states.
    error = 1.3 * question.error
    found = pick(question.scene, error, question.want, question.samples, names=named)
    rows = found.ranking
    (row,) = [row for row in rows if row.form == "averaged-second-order"]
    assert "differs from spheroid-axis by splitting" in row.reason
    assert row.error.high <= error
    itself = solve(
        question.scene, form="averaged-second-order", solver="cyrk-tsit5", tolerance=row.tolerance
    )
    assert itself.error.slow.high > error


def test_steps_are_timed_in_runs_that_they_take_most_of(monkeypatch):
    """A run starts in 0.2 ms, and two steps in each unit of time take 0.1 µs each."""

    def quickest(_method, _tolerance, scene, rows):
        longest.append(scene.time)
        return 2e-4 + 2e-7 * scene.time + 1e-7 * rows, int(2 * scene.time)

    longest = []
    monkeypatch.setattr(paces, "_quickest", quickest)
    paces.forget()
    found = paces.pace(Method(form("spheroid-axis"), solver("splitting")), 1e-8)
    paces.forget()
    assert max(longest) == pytest.approx(8000)
    assert found.step == pytest.approx(1e-7, rel=1e-3)
    assert found.row == pytest.approx(1e-7, rel=1e-3)
