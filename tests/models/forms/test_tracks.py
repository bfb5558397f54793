"""Gradients along a track: the spline, forms and solvers along it, and what is refused."""

from dataclasses import replace

import numpy as np
import pytest

from polhode.harness.flows import space_frame
from polhode.models.catalogue import FORMS, form
from polhode.models.flow import Flow, flow_numbers
from polhode.models.scene import EulerStart, Scene
from polhode.models.shape import Ellipsoid
from polhode.solvers.contract import SolverNotValidError
from polhode.solvers.solve import solve

pytestmark = pytest.mark.usefixtures("quickly_compiled")

START = EulerStart((1.0, 0.5, 0.2), (1.0, 1.0, -1.0))
ALONG_TRACKS = [name for name in FORMS if form(name).any_flow and name != "euler-top"]
STEADY = np.array([[0.0, 1.0, 0.0], [0.2, 0.0, 0.0], [0.0, 0.0, 0.0]])
WAVE = np.array([[0.15, 0.05, -0.2], [0.1, -0.25, 0.15], [0.05, 0.1, 0.1]])


def source(time):
    """A gradient that changes smoothly, shape (..., 3, 3)."""
    phase = np.asarray(time)[..., None, None]
    return STEADY + np.sin(1.3 * phase + 0.2) * WAVE + np.cos(0.7 * phase) * WAVE.T


def along(count, time=20.0, **changes):
    """A scene along so many equal intervals of the source."""
    times = np.linspace(0.0, time, count + 1)
    scene = Scene(Ellipsoid((1.0, 0.8, 0.5)), 10.0, START, time, Flow.track(times, source(times)))
    return replace(scene, **changes)


def fitting(name):
    """Changes of the scene that a form takes."""
    shape = Ellipsoid((1.0, 1.0, 0.4)) if "spheroid" in name else Ellipsoid((1.0, 0.8, 0.5))
    return {"ellipsoid": shape, "stokes": 0.0 if name == "jeffery" else 10.0}


def end(name, scene, solver="cyrk-vern8", tolerance=1e-13):
    """Observables at the end of a run."""
    found = solve(form(name).problem(scene), solver, tolerance)
    assert found.success, found.message
    return form(name).observe(scene, found.states[-1:])


@pytest.mark.parametrize("name", ALONG_TRACKS)
def test_errors_fall_with_the_fourth_power_of_the_spacing(name):
    """Against the source itself, by an independent integration in long double."""
    counts = (20, 40, 80, 160)
    scene = along(20, 10.0, **fitting(name))
    if name == "jeffery":
        runs = [end(name, along(n, 10.0, **fitting(name))) for n in (*counts, 2560)]
        ends = [run.rotation[0] for run in runs]
        errors = [np.max(np.abs(each - ends[-1])) for each in ends[:-1]]
    else:
        shape = scene.ellipsoid
        bodies = space_frame.Bodies(
            [shape.scaled_axes], [shape.inertia], [shape.resistance], [scene.stokes]
        )
        given = [scene.initial_rotation], [scene.angular_velocity]

        def gradient(time, step):
            return source(time)

        _, momentum = space_frame.run(bodies, *given, gradient, [10.0], 100)
        ends = [end(name, along(n, 10.0, **fitting(name))) for n in counts]
        errors = [float(np.max(np.abs(each.angular_momentum - momentum[-1]))) for each in ends]
    assert errors[-1] > 1e-11
    order = -np.polyfit(np.log2(counts), np.log2(errors), 1)[0]
    assert 3.5 < order < 5.0, errors


@pytest.mark.parametrize(
    "solver", ["cyrk-vern8", "cyrk-lsoda", "cyrk-radau", "taylor", "cvode-bdf", "dop853", "lsoda"]
)
@pytest.mark.parametrize("name", ALONG_TRACKS)
def test_a_track_of_a_constant_gradient_is_that_flow(name, solver):
    times = np.sort(np.random.default_rng(1).uniform(0.0, 10.0, 15))
    knots = [0.0, *times, 10.0]
    steady = Scene(start=START, time=10.0, flow=Flow(STEADY), **fitting(name))
    track = replace(steady, flow=Flow.track(knots, [STEADY] * len(knots)))
    first, second = (end(name, each, solver, 1e-9) for each in (steady, track))
    assert np.max(np.abs(first.slow - second.slow)) < 1e-7
    assert np.nanmax(np.abs(first.rotation - second.rotation)) < 1e-6


@pytest.mark.parametrize("solver", ["ida", "cvode-adams", "radau", "bdf", "cyrk-tsit5", "rk45"])
def test_solvers_agree_along_a_track(solver):
    scene = along(30)
    found = solve(form("quaternion").problem(scene), solver, 1e-8, np.linspace(0.0, 20.0, 7))
    known = solve(form("quaternion").problem(scene), "taylor", 1e-14, np.linspace(0.0, 20.0, 7))
    assert found.success
    np.testing.assert_allclose(found.states, known.states, atol=1e-4)


@pytest.mark.parametrize("backend", ["numba", "python"])
@pytest.mark.parametrize("solver", ["dop853", "cvode-bdf", "ida"])
def test_back_ends_agree_along_a_track(solver, backend):
    problem = form("quaternion").problem(along(10, 5.0))
    found = solve(problem, solver, 1e-8, backend=backend)
    known = solve(problem, "taylor", 1e-14)
    np.testing.assert_allclose(found.states[-1], known.states[-1], atol=1e-5)


def test_counts_and_limits_hold_over_all_intervals():
    problem = form("quaternion").problem(along(50))
    found = solve(problem, "cyrk-vern8", 1e-8, count=True)
    assert found.success
    assert found.work.steps >= 50
    assert found.work.rhs_calls > 10 * found.work.steps
    counted = solve(problem, "cyrk-vern8", 1e-8)
    assert counted.work.steps == found.work.steps
    np.testing.assert_array_equal(counted.states, found.states)
    short = solve(problem, "cyrk-vern8", 1e-8, np.linspace(0.0, 20.0, 101), max_steps=20)
    assert str(short.status) == "step_limit"
    assert 1 < len(short.times) < 101


def test_rows_lie_where_they_are_requested():
    """At knots, a rounding error beside them, and in between."""
    problem = form("quaternion").problem(along(40))
    knots = np.linspace(0.0, 20.0, 41)
    beside = np.nextafter(knots[1:-1], np.inf)
    times = np.sort(np.concatenate([knots, beside, np.random.default_rng(2).uniform(0, 20, 100)]))
    for solver in ("cyrk-vern8", "taylor", "dop853"):
        found = solve(problem, solver, 1e-12, times)
        assert found.success, (solver, found.message)
        one_by_one = [solve(problem, solver, 1e-12, np.array([0.0, t])) for t in times[70:75]]
        ends = np.array([run.states[-1] for run in one_by_one])
        np.testing.assert_allclose(found.states[70:75], ends, atol=1e-10)
        np.testing.assert_allclose(found.states[:, -1], times, atol=1e-13)


def test_a_run_does_not_depend_on_others_of_the_same_problem():
    problem = form("quaternion").problem(along(40))
    first = solve(problem, "taylor", 1e-12)
    solve(form("quaternion").problem(along(7)), "taylor", 1e-12)
    np.testing.assert_array_equal(first.states, solve(problem, "taylor", 1e-12).states)


def test_the_spline_goes_through_the_gradients():
    times = np.array([-1.0, 0.0, 0.3, 1.0, 2.5, 4.0])
    flow = Flow.track(times, source(times))
    np.testing.assert_allclose(
        np.array(flow.numbers_at(times)).T, flow_numbers(source(times)), atol=1e-14
    )
    later = flow.after(0.4)
    np.testing.assert_allclose(
        np.array(later.numbers_at(times - 0.4)), np.array(flow.numbers_at(times)), atol=1e-13
    )
    np.testing.assert_allclose(flow.numbers, flow_numbers(source(0.0)), atol=1e-15)


@pytest.mark.parametrize(
    ("times", "count", "words"),
    [
        ((0.0, 1.0, 1.0 + 1e-13, 2.0), 4, "got the gaps 1 and 9.99e-14 on both sides of t = 1.0"),
        ([0.0, 1.0, 1.0], 3, "got t = 1.0 after 1.0, expected finite times that increase"),
        ([0.0, float("nan")], 2, "expected finite times that increase"),
        ([0.0], 1, "got 1 times, expected two at least"),
        ([0.0, 1.0], 3, "got 3 gradients at 2 times, expected one at each"),
        ([0.0, "x"], 2, "got 'x', expected a number"),
    ],
)
def test_tracks_that_are_none_are_refused(times, count, words):
    with pytest.raises(ValueError, match=r"flow\.track") as refusal:
        Flow.track(times, [STEADY] * count)
    assert words in str(refusal.value)


def test_a_track_that_does_not_cover_the_run_is_refused():
    flow = Flow.track([0.0, 5.0], [STEADY, STEADY])
    words = r"flow\.track: got times from 0 to 5, expected the run, 0 to 6"
    with pytest.raises(ValueError, match=words):
        Scene(Ellipsoid((1.0, 0.8, 0.5)), 10.0, START, 6.0, flow)
    with pytest.raises(ValueError, match="expected the run"):
        Scene(Ellipsoid((1.0, 0.8, 0.5)), 10.0, START, 3.0, Flow.track([1, 5], [STEADY] * 2))


@pytest.mark.parametrize("solver", ["splitting", "stroboscopic", "splitting-extended", "exact"])
def test_solvers_of_constant_flows_refuse_tracks(solver):
    scene = along(10, ellipsoid=Ellipsoid((1.0, 1.0, 0.4)))
    with pytest.raises(SolverNotValidError, match="use solver"):
        solve(form("spheroid-axis").problem(scene), solver, 1e-8)


def test_without_torque_a_track_is_as_good_as_none():
    scene = along(10, stokes=float("inf"))
    closed, run = (end(*each) for each in (("euler-top", scene, "exact"), ("quaternion", scene)))
    np.testing.assert_allclose(closed.slow, run.slow, atol=1e-11)


@pytest.mark.parametrize("solver", ["cyrk-dop853", "cyrk-radau", "taylor", "cvode-bdf", "dop853"])
def test_two_knots_at_one_row_leave_the_run_as_it_is(solver):
    knots = np.array([0.0, 0.5, 1.0, 2.0, 3.0])
    scene = along(4, 3.0)
    one = replace(scene, flow=Flow.track(knots, source(knots)))
    problem = form("quaternion").problem(one)
    times = np.array([0.0, 1.0, 2.0, 3.0])
    right = solve(problem, solver, 1e-9, times)
    table = problem.parameter_table
    # A second change just behind the row at t = 1, with nothing new.
    doubled = replace(
        table,
        times=np.insert(table.times, 3, 1.0 + 1e-13),
        values=np.insert(table.values, 2, table.values[2], axis=0),
    )
    found = solve(replace(problem, parameter_table=doubled), solver, 1e-9, times)
    assert found.success, found.message
    np.testing.assert_allclose(found.states, right.states, rtol=0, atol=1e-9)


def test_a_run_along_a_track_tells_how_far_it_is_and_keeps_rows_when_interrupted():
    scene = along(3, 3e5)
    scene = replace(scene, flow=Flow.track((0.0, 2e5, 4e5), [STEADY] * 3))
    records = []
    found = solve(
        form("quaternion").problem(scene),
        "cyrk-dop853",
        1e-12,
        np.linspace(0.0, 3e5, 3001),
        watch=records.append,
        max_seconds=0.2,
    )
    assert not found.success
    (record,) = records
    assert 0 < record.reached < 3e5
    assert 1 < len(found.times) < 3001
    assert found.work.steps > 0


def test_a_first_step_is_refused_along_a_track():
    with pytest.raises(SolverNotValidError, match=r"first_step: got 0\.5, expected none"):
        solve(form("quaternion").problem(along(20)), "dop853", 1e-8, first_step=0.5)
