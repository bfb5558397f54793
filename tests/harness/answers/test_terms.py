"""Each term and margin of a stated error: without it the error of one of these runs would be stated too small."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from polhode import BodyStart, Ellipsoid, EulerStart, Scene, solve
from polhode.harness.answers import averaging, confirmed, rules
from polhode.harness.answers.confirmed import Answer, advised
from polhode.harness.answers.fitted import factors
from polhode.harness.answers.interval import Interval
from polhode.harness.answers.rules import Method, full_method
from polhode.harness.answers.runs import Runner
from polhode.harness.answers.statement import INNER, Difference, RunError, stated
from polhode.harness.references.errors import errors
from polhode.models.catalogue import form
from polhode.models.scenes import named_scene
from polhode.solvers.catalogue import solver as find_solver

PAPER = named_scene("paper")
FLAT = np.ones(len(INNER))


def statement(apart: Difference, turns: float = 0.0, least: float = 0.0) -> RunError:
    """What a looser run says that differs so."""
    observables = PAPER.initial
    many = type(observables)(
        np.repeat(observables.angular_momentum, len(INNER), axis=0),
        np.repeat(observables.energy, len(INNER)),
        np.repeat(observables.rotation, len(INNER), axis=0),
    )
    return stated(PAPER.ellipsoid, "looser", "explicit", apart, many, turns, least, "")


def off(scene: Scene, method: Method, tolerance: float) -> tuple[Runner, float, float]:
    """A runner of a scene, and the true errors of a run."""
    runner = Runner(scene, np.array([0.0, scene.time]))
    run = runner.run(method, tolerance)
    true = runner.run(Method(form("quaternion"), find_solver("taylor")), 1e-16)
    found = errors(scene.ellipsoid, run.observables, true.observables)
    return runner, found.slow, found.orientation or 0.0


def test_the_upper_end_is_the_difference_times_the_factor_of_its_kind():
    found = statement(Difference(1e-6 * FLAT, 1e-5 * FLAT))
    factor = factors()["looser"]["explicit"]
    assert found.slow.high == pytest.approx(1e-6 * factor["slow"].high, rel=1e-6)
    assert found.slow.predicted == pytest.approx(1e-6 * factor["slow"].middle)
    assert found.orientation.high == pytest.approx(1e-5 * factor["orientation"].high, rel=1e-6)


def test_runs_that_agree_to_the_last_bit_state_rounding_that_grows_along_the_run():
    few = statement(Difference(0 * FLAT, 0 * FLAT), turns=1.0)
    many = statement(Difference(0 * FLAT, 0 * FLAT), turns=1e5)
    assert 1e-16 < few.slow.high < 1e-14
    assert many.slow.high > 1e3 * few.slow.high
    assert many.orientation.high > 1e7 * few.orientation.high


@pytest.mark.parametrize("solver", ["cyrk-vern8", "cyrk-dop853"])
def test_rounding_is_stated_of_a_long_run_at_the_tightest_tolerance(solver: str):
    """All its runs round in the same direction, so that their difference alone is no bound."""
    scene = replace(PAPER, stokes=1e5, time=3e4)
    method = full_method(scene)._replace(solver=find_solver(solver))
    runner, slow, angle = off(scene, method, 1e-15)
    run = runner.run(method, 1e-15)
    found = confirmed.confirmation(runner, run)
    assert slow <= found.slow.high
    assert angle <= found.orientation.high


def test_two_runs_that_agree_by_luck_are_not_credited_with_it():
    lucky = statement(Difference(1e-20 * FLAT, 1e-20 * FLAT), least=1e-11)
    assert lucky.slow.high >= 1e-11 * factors()["looser"]["explicit"]["slow"].high


def test_orientations_that_agree_better_than_l_and_e_do_so_by_chance():
    """In a hundredth of a turn two stiff runs differ by 7e-10 rad, and the better one errs by 9e-9 rad."""
    axis = 0.15371891332062773
    start = BodyStart(
        (0.22161855999803232, 0.23725662909592263, 0.5239205538336238, 0.7874654018336978),
        (0.7115948416002509, 0.26214058300701903, 0.49877028468443807),
    )
    scene = Scene(Ellipsoid((axis, 1.0, axis)), 0.0009863674618379842, start, 0.11827978963850902)
    method = Method(form("spheroid-axis"), find_solver("cyrk-radau"))
    runner = Runner(scene, np.array([0.0, scene.time]))
    run = runner.run(method, 4e-8)
    found = confirmed.confirmation(runner, run)
    assert found.kind == "looser"
    assert found.difference.orientation.max() < 1e-2 * found.difference.slow.max()
    true = runner.run(Method(form("quaternion"), find_solver("cyrk-lsoda")), 1e-14)
    made = errors(scene.ellipsoid, run.observables, true.observables).orientation
    assert made > 10 * found.difference.orientation.max()
    assert made <= found.orientation.high


def test_a_difference_that_passes_zero_does_not_make_the_error_zero_there():
    times = np.linspace(0.0, 1.0, 2001)
    crossing = 1e-6 * np.abs(np.cos(8 * np.pi * INNER))
    along = statement(Difference(crossing, crossing)).at(times).along
    assert along.slow.min() > 0.5 * along.slow.max()


def test_no_time_is_stated_to_be_exact():
    """What the second run says of the end of a run that settles is less than fits reach."""
    settled = 1e-6 * np.exp(-100 * INNER)
    found = statement(Difference(settled, settled)).at(np.array([0.0, 1.0]))
    assert found.along.slow[-1] == pytest.approx(0.1 * found.slow.high)


def test_errors_that_damping_forgets_at_once_are_seen():
    """L and E relax in the first ten-thousandth of this run: equispaced times alone would miss it."""
    start = BodyStart((1.0, 0.0, 0.0, 0.0), (30.0, -20.0, 10.0))
    scene = Scene(Ellipsoid((1.0, 0.7, 0.4)), 0.05, start, 20.0)
    times = np.linspace(0.0, scene.time, 20_001)
    way = {"form": "quaternion", "solver": "cyrk-radau", "times": times}
    found = solve(scene, **way, tolerance=1e-5)
    true = solve(scene, **{**way, "solver": "cyrk-lsoda"}, tolerance=1e-13, estimate=False)
    off = errors(scene.ellipsoid, found.observables, true.observables)
    assert off.worst_sample < 200
    assert off.slow <= found.error.slow.high


SPLITTING_SCENES = (
    (
        (1.0, 1.0, 0.328599673827212),
        343934.6949573545,
        (-0.1308161764802589, 0.21373950942858788, -0.5470575611178191, 0.7987055620841361),
        (1.5158408430764398, -0.46176863024913856, 1.1767721425931519),
        4667.892770812013,
        1e-8,
    ),
    (
        (1.0, 0.23991786470984072, 1.0),
        32584.85048913344,
        (-0.5177891863068855, -0.7457998804329873, -0.4104053931629392, -0.0851135133370052),
        (-1.371745467350836, 0.28550081162576163, 2.2867027913745517),
        1472.635275512378,
        1e-8,
    ),
)


@pytest.mark.parametrize(("axes", "stokes", "quaternion", "spin", "time", "tol"), SPLITTING_SCENES)
def test_runs_by_splitting_of_nearly_the_same_steps_are_too_alike(
    axes, stokes, quaternion, spin, time, tol, monkeypatch: pytest.MonkeyPatch
):
    scene = Scene(Ellipsoid(axes), stokes, BodyStart(quaternion, spin), time)
    method = Method(form("spheroid-axis"), find_solver("splitting"))
    runner, _, angle = off(scene, method, tol)
    run = runner.run(method, tol)
    found = confirmed.confirmation(runner, run)
    assert found.kind == "sharper"
    assert angle <= found.orientation.high
    monkeypatch.setattr(confirmed, "LEAST_STEP_RATIO_SPLITTING", 1.0)
    alike = confirmed.confirmation(runner, run)
    assert alike.kind == "looser"
    # The two differ by less than the better one errs.
    assert angle > alike.difference.largest["orientation"]


def test_stroboscopic_runs_are_confirmed_by_splitting():
    """What it takes for granted between its turns does not follow its tolerance."""
    scene = Scene(
        Ellipsoid((1.0, 0.4, 0.4)), 5e3, BodyStart((1.0, 0.0, 0.0, 0.0), (0.9, -0.7, 1.1)), 4e3
    )
    found = solve(scene, form="spheroid-axis", solver="stroboscopic", tolerance=1e-10)
    assert (found.error.kind, found.error.family) == ("unlike", "stroboscopic")
    assert "by splitting" in found.error.note


def test_a_run_as_far_off_as_the_motion_goes_is_not_confirmed_by_a_looser_one():
    """Both are anywhere on the orbit: their difference is no measure of either."""
    scene = named_scene("jeffery-chaotic")
    method = full_method(scene)
    runner = Runner(scene, np.array([0.0, scene.time]))
    found = confirmed.confirmation(runner, runner.run(method, 1e-7))
    assert found.kind != "looser"


def test_a_closed_form_confirms_at_any_tolerance():
    """It states no error constant by which a tolerance could be divided."""
    run = SimpleNamespace(tolerance=1e-7, method=full_method(PAPER))
    partner = Method(form("jeffery"), find_solver("exact"))
    assert confirmed._equal_error_tolerance(run, partner) == 1e-7


@pytest.mark.parametrize(("turns", "power"), [(0.2, 1.0), (1.0, 0.5)])
def test_the_model_error_falls_like_st_and_like_its_root_after_a_crossing(turns, power):
    """The surrogate is the same at both St, so that the ratio is that of the powers alone."""
    start = EulerStart((1.0, 0.5, 0.0), (1.0, 1.0, -1.0) if power == 0.5 else (0.3, 0.3, 2.0))
    found = []
    for stokes in (1e6, 1e8):
        scene = Scene(Ellipsoid((1.0, 0.8, 0.5)), stokes, start, turns * stokes)
        runner = Runner(scene, np.array([0.0, scene.time]))
        exact = runner.run(Method(form("averaged"), find_solver("cyrk-vern8")), 1e-12)
        assert averaging.crosses(scene, exact.observables) == (power == 0.5)
        model, _ = averaging._surrogate_difference(runner, exact, rules.rotations(scene))
        found.append(model.max())
    assert np.log10(found[0] / found[1]) / 2 == pytest.approx(power, abs=0.02)


def test_segments_add_what_they_state_from_their_beginning_on():
    scene = replace(PAPER, time=100.0)
    runner = Runner(scene, np.array([0.0, scene.time]))
    run = runner.run(full_method(scene), 1e-8)
    segments = tuple(
        SimpleNamespace(begin=begin, error=error, angle=10 * error, averaged=True)
        for begin, error in ((0.0, 1e-3), (50.0, 1e-2))
    )
    run = run._replace(solution=replace(run.solution, segments=segments))
    apart = averaging.with_estimate(runner, run, run)
    later = runner.inner > 50.0
    assert apart.slow[later] == pytest.approx(1.1e-2)
    assert apart.slow[~later][1:] == pytest.approx(1e-3)
    assert apart.orientation[later] == pytest.approx(0.11)


def test_second_order_adds_what_its_solver_errs_by():
    scene = Scene(
        Ellipsoid((1.0, 0.5, 0.5)), 1e6, BodyStart((1.0, 0.0, 0.0, 0.0), (0.9, -0.7, 1.1)), 1e5
    )
    way = {"form": "averaged-second-order", "solver": "cyrk-tsit5"}
    loose, tight = (solve(scene, **way, tolerance=tolerance) for tolerance in (1e-3, 1e-10))
    assert loose.error.slow.high > 10 * tight.error.slow.high


@pytest.mark.parametrize(
    ("interval", "words"),
    [
        (Interval(2e-6, 1e-8, 4e-6), "was probably missed"),
        (Interval(5e-7, 1e-8, 4e-6), "may have been missed"),
        (Interval(5e-7, 1e-8, 9e-7), ""),
    ],
)
def test_what_is_said_of_an_error_that_was_requested(interval, words):
    run = solve(PAPER, error=1e-6)
    answer = Answer(full_method(PAPER), 1e-8, run.run, replace(run.error, slow=interval))
    advice = advised(answer, PAPER, 1e-6, "slow").advice
    assert words in advice
    assert bool(advice) == bool(words)


def test_an_averaged_run_at_a_loose_tolerance_is_not_thought_lucky():
    """Its segments go at a tolerance of their own: a loose one costs no accuracy, and states none away."""
    start = BodyStart((1.0, 0.0, 0.0, 0.0), (0.9, -0.7, 1.1))
    scene = Scene(Ellipsoid((1.0, 0.5, 0.5)), 1e8, start, 3e4)
    found = solve(scene, form="hybrid", solver="cyrk-vern8", tolerance=1e-4)
    true = solve(scene, form="quaternion", solver="taylor", tolerance=1e-16, estimate=False)
    off = errors(scene.ellipsoid, found.observables, true.observables).slow
    assert found.run.segments[0].averaged
    assert off <= found.error.slow.high <= 1e-7


def test_the_largest_stokes_numbers_have_a_rule():
    start = BodyStart((1.0, 0.0, 0.0, 0.0), (1e-150, 0.0, 0.0))
    scene = Scene(Ellipsoid((1.0, 0.8, 0.5)), 1e300, start, 1e-6)
    assert rules.methods_for(scene, 1e-6, "slow")
