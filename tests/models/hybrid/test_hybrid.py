"""Form `hybrid`: segments meet, errors stay below the requested one, no full equations where none are needed."""

from dataclasses import replace
from itertools import pairwise
from math import pi
from time import process_time

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from polhode.harness.averaging.hybrid import random_scenes
from polhode.harness.references.errors import errors
from polhode.models.catalogue import form, full_form
from polhode.models.form import FormNotValidError
from polhode.models.hybrid import plan
from polhode.models.hybrid.form import Hybrid
from polhode.models.hybrid.plan import (
    ERROR_PER_TOLERANCE,
    FULL_SHARE,
    PER_RADIAN,
    full_tolerance,
    second_order,
)
from polhode.models.scene import BodyStart, EulerStart, Scene
from polhode.models.second_order.outline import Ahead, PlannedSegment
from polhode.models.second_order.path import path_of
from polhode.models.second_order.run import NotAveragedError
from polhode.models.shape import Ellipsoid
from polhode.solvers.catalogue import solver as find_solver
from polhode.solvers.contract import Status
from polhode.solvers.solve import Solution, solve

pytestmark = pytest.mark.usefixtures("quickly_compiled")

SOLVER = "cyrk-vern8"
PAPER = EulerStart((pi / 3, pi / 6, 0.0), (1.0, 1.0, -1.0))
REST = EulerStart((1.0, 0.3, 0.2))
TRIAXIAL, PROLATE = (1.0, 0.8, 0.5), (1.0, 1.0, 2.0)
# A crossing of L² = 2EI₂ and resonances; a pinch point, L falling along z; a start from rest.
CROSSING = Scene(Ellipsoid(TRIAXIAL), 1e5, PAPER, 4e4)
PINCHED = Scene(Ellipsoid(PROLATE), 1e5, BodyStart((1.0, 0.0, 0.2, 0.1), (0.1, 0.2, 0.9)), 2e4)
RESTING = Scene(Ellipsoid(PROLATE), 1e5, REST, 2e4)
RESTING_TRIAXIAL = replace(RESTING, ellipsoid=Ellipsoid(TRIAXIAL))
SCENES = pytest.mark.parametrize("scene", [CROSSING, PINCHED, RESTING, RESTING_TRIAXIAL])


def run(scene: Scene, error: float, **options) -> Solution:
    times = np.linspace(0.0, scene.time, 101)
    return solve(Hybrid().problem(scene), SOLVER, error / ERROR_PER_TOLERANCE, times, **options)


def full_run(scene: Scene) -> Solution:
    return solve(
        form(full_form(scene)).problem(scene), SOLVER, 1e-13, np.linspace(0.0, scene.time, 101)
    )


def kinds(solution: Solution) -> list[bool]:
    """Which segments were averaged."""
    return [segment.averaged for segment in solution.segments]


def test_a_full_segment_goes_on_at_a_looser_tolerance_where_less_is_to_amplify_its_errors():
    scene = replace(CROSSING, start=EulerStart((pi / 3, pi / 6, 0.0), (1.0, -1.0, 1.0)))
    first, second, *_ = plan.foreseen(scene, 1e-6)
    assert not first.second_order
    assert not second.second_order
    assert (
        second.turned / first.turned < 0.2 < (second.end - second.start) / (first.end - first.start)
    )
    solution = run(scene, 1e-6)
    assert solution.segments[1].tolerance > solution.segments[0].tolerance
    true = form(full_form(scene)).observe(scene, full_run(scene).states)
    found = errors(scene.ellipsoid, Hybrid().observe(scene, solution.states), true).slow
    assert found < sum(segment.error for segment in solution.segments) < 1e-6


@pytest.mark.parametrize("solver", ["taylor", "cyrk-dop853", "cyrk-lsoda", "cvode-adams"])
def test_what_segments_state_holds_for_every_solver(solver: str):
    """LSODA errs by 1.2 times as much at its own tolerance as segments counted with, CVODE by three times."""
    *_, scene = random_scenes(17)
    true = form(full_form(scene)).observe(scene, full_run(scene).states)
    solution = solve(Hybrid().problem(scene), solver, 1e-8, np.linspace(0.0, scene.time, 101))
    found = errors(scene.ellipsoid, Hybrid().observe(scene, solution.states), true).slow
    assert found < sum(segment.error for segment in solution.segments) < 1e-6
    assert [segment.tolerance for segment in solution.segments] == [
        1e-8 / find_solver(solver).error_amplification
    ]


@SCENES
def test_the_error_along_the_run_is_below_the_one_asked_for(scene: Scene):
    true = form(full_form(scene)).observe(scene, full_run(scene).states)
    for error in (1e-4, 1e-5):
        solution = run(scene, error)
        assert solution.status is Status.REACHED_END
        found = errors(scene.ellipsoid, Hybrid().observe(scene, solution.states), true)
        assert found.slow < error
        assert {*kinds(solution)} == {True, False}
        segments = solution.segments
        assert segments[0].begin == 0
        assert segments[-1].end == scene.time
        assert all(one.end == other.begin for one, other in pairwise(segments))


@pytest.mark.parametrize("scene", [CROSSING, replace(PINCHED, start=REST)])
def test_hand_over_there_and_back_is_exact_to_rounding(scene: Scene):
    solution = run(scene, 1e-4)
    reached = [segment.begin for segment in solution.segments if segment.averaged]
    times = np.unique([0.0, *reached, scene.time])
    states = solve(Hybrid().problem(scene), SOLVER, 1e-6, times).states
    next_segment = Hybrid().problem(scene).next_segment
    assert next_segment
    for begin in reached:
        state, unit = (
            states[np.searchsorted(times, begin)].copy(),
            slice(0, 4) if scene is CROSSING else slice(3, 6),
        )
        # Solvers let the norm drift.
        state[unit] /= np.linalg.norm(state[unit])
        problem, back = second_order(scene, state)  # pyright: ignore
        returned = back(np.array([problem.start]))[0]
        sign = np.sign(returned[:4] @ state[:4]) if scene is CROSSING else 1
        assert np.abs(np.r_[sign * returned[:4], returned[4:]] - state).max() < 1e-12


def test_a_body_that_settles_errs_by_what_its_damping_does():
    """Rates of second order fade faster than those of third; the error was five times the requested one."""
    pose, spin = (-0.722, -0.676, -0.049, 0.136), (-0.22, -0.10, -0.43)
    scene = Scene(Ellipsoid((0.193, 0.865, 0.865)), 1e4, BodyStart(pose, spin), 2e4)
    true = Hybrid().observe(scene, full_run(scene).states)
    found = Hybrid().observe(scene, run(scene, 1e-8).states)
    assert errors(scene.ellipsoid, found, true).slow < 1e-8


def test_nothing_is_integrated_in_full_where_averaging_holds():
    gentle = Scene(Ellipsoid((1.0, 1.0, 0.5)), 1e6, PAPER, 1e5)
    assert kinds(run(gentle, 1e-6)) == [True]


@SCENES
def test_everything_is_where_the_stokes_number_is_small(scene: Scene):
    small = replace(scene, stokes=10.0, time=5.0)
    solution = run(small, 1e-6)
    assert not any(kinds(solution))
    true = form(full_form(small)).observe(small, full_run(small).states)
    assert errors(small.ellipsoid, Hybrid().observe(small, solution.states), true).slow < 1e-6


def test_the_full_equations_take_over_where_no_slow_state_is_found(monkeypatch: pytest.MonkeyPatch):
    def refused(scene: Scene, state: np.ndarray) -> None:
        raise NotAveragedError("nothing slow here")

    monkeypatch.setattr(plan, "second_order", refused)
    gentle = Hybrid().problem(Scene(Ellipsoid((1.0, 1.0, 0.5)), 1e6, PAPER, 1e5))
    assert gentle.next_segment
    segment = gentle.next_segment(0.0, np.array(gentle.start), 1e-8)
    assert (segment.averaged, segment.reason) == (False, "nothing slow here")
    assert 0 < segment.end < 1e3


def test_full_segments_shorten_as_the_stokes_number_grows():
    shares = []
    for stokes in (1e5, 1e6, 1e7):
        solution = run(replace(CROSSING, stokes=stokes, time=0.2 * stokes), 1e-4)
        pairs = zip(solution.segments, kinds(solution), strict=True)
        shares.append(
            sum(segment.end - segment.begin for segment, averaged in pairs if not averaged)
            / solution.times[-1]
        )
    # Like 1/√St, their time like √St.
    assert shares[2] < shares[0] / 4


def test_errors_count_as_often_as_they_come_out_of_resonances():
    """Starts 1e-8 away from one another, through the kicks of several strong resonances."""
    axes, pose, spin = (0.5, 0.7, 0.3), (-0.6, 0.2, 0.3, 0.7), (1.2, 0.9, -0.5)
    scene = Scene(Ellipsoid(axes), 1e6, BodyStart(pose, spin), 6e4)
    base, grown = form("quaternion").observe(scene, full_run(scene).states).slow, []
    for nudge in 1e-8 * np.eye(3):
        other = replace(scene, start=BodyStart(pose, tuple((np.array(spin) + nudge).tolist())))
        apart = np.abs(form("quaternion").observe(other, full_run(other).states).slow - base).max(
            axis=1
        )
        grown.append(apart.max() / apart[0])
    (weight,) = Ahead.of(path_of(scene), 1e-6).weight(np.zeros(1))
    typical = np.sqrt(np.mean(np.square(grown)))
    assert 50 < typical < weight < 20 * typical


@pytest.mark.parametrize("rate", [1.0, 40.0])
def test_the_error_of_the_full_equations_is_bounded_however_fast_a_body_spins(rate: float):
    spin = (0.5 * rate, -0.3 * rate, 0.8 * rate)
    scene = Scene(
        Ellipsoid((1.0, 1.0, 0.3)), 1e6, BodyStart((0.8, 0.3, -0.4, 0.2), spin), 2e3 / rate
    )
    solution = run(scene, 1e-5)
    found, true = (Hybrid().observe(scene, each.states) for each in (solution, full_run(scene)))
    (segment,) = solution.segments
    assert not segment.averaged
    assert errors(scene.ellipsoid, found, true).slow < segment.error < 1e-5


def test_the_triaxial_limit_meets_the_spheroid():
    spheroid = run(replace(RESTING, start=PAPER), 1e-6)
    apart = []
    for close in (1e-4, 1e-5):
        near = replace(RESTING, start=PAPER, ellipsoid=Ellipsoid((1.0, 1.0 - close, 2.0)))
        found = Hybrid().observe(near, run(near, 1e-6).states)
        true = Hybrid().observe(RESTING, spheroid.states)
        apart.append(np.abs(found.slow - true.slow).max())
    assert apart[1] < apart[0] / 5
    assert apart[0] < 1e-2


@pytest.mark.parametrize("scene", [CROSSING, RESTING])
def test_a_run_that_is_stopped_keeps_its_rows(scene: Scene):
    whole = run(scene, 1e-5)
    ends = np.cumsum([segment.steps or 0 for segment in whole.segments])
    for steps in {1, *(int(end) - 1 for end in ends)}:
        cut = run(scene, 1e-5, max_steps=steps)
        assert cut.status is Status.STEP_LIMIT
        # Rows that are computed together decide which faint terms are left out.
        assert np.abs(cut.states - whole.states[: len(cut.times)]).max() < 1e-12
        begun = cut.segments[-1].begin if cut.segments else 0.0
        assert len(cut.times) >= np.searchsorted(whole.times, begun)


def test_it_refuses_what_it_does_not_describe():
    sphere, massless, torqueless = (
        replace(CROSSING, **change)
        for change in (
            {"ellipsoid": Ellipsoid((1.0, 1.0, 1.0))},
            {"stokes": 0.0},
            {"stokes": np.inf},
        )
    )
    for scene, instead in (
        (sphere, "spheroid-axis"),
        (massless, "jeffery"),
        (torqueless, "euler-top"),
    ):
        with pytest.raises(FormNotValidError, match=instead):
            Hybrid().check(scene)


@pytest.mark.parametrize("time", [1e16, 1e300])
def test_runs_whose_segments_times_cannot_tell_apart_are_refused(time: float):
    """Such a run would not end: its segments would not even begin to move."""
    with pytest.raises(
        FormNotValidError,
        match=r"^form 'hybrid': the run of 1e\+\d+ inverse shear rates is too long, ",
    ):
        Hybrid().problem(replace(CROSSING, time=time))


LENGTH = st.floats(0.15, 1.0)
REAL = st.floats(-3.0, 3.0)


@settings(max_examples=15, deadline=None)
@given(
    st.tuples(LENGTH, LENGTH, LENGTH),
    st.floats(-3.0, 8.0),
    st.floats(-3.0, 0.3),
    st.tuples(REAL, REAL, REAL),
    st.tuples(REAL, REAL, REAL),
    st.sampled_from([1e-3, 1e-6, 1e-9]),
)
def test_any_scene_runs_or_is_refused_at_once(axes, stokes, slow, angles, rates, error):
    scene = Scene(Ellipsoid(axes), 10**stokes, EulerStart(angles, rates), 10 ** (slow + stokes))
    began = process_time()
    if scene.ellipsoid.kind == "sphere":
        with pytest.raises(FormNotValidError):
            Hybrid().check(scene)
        return
    solution = run(scene, error, max_seconds=0.2)
    assert solution.status in (Status.REACHED_END, Status.TIME_LIMIT), solution.message
    assert process_time() - began < 5.0


@given(st.lists(st.tuples(st.floats(1e-4, 1e-1), st.floats(1.0, 1e3)), min_size=1, max_size=8))
def test_full_segments_take_their_share_of_the_error_together(lengths: list[tuple[float, float]]):
    ahead = [PlannedSegment(0.0, lasts, False, turned=lasts * weight) for lasts, weight in lengths]
    spent_full = 0.0
    for i, each in enumerate(ahead):
        own, cost = full_tolerance(ahead[i:], 1e5, 1e-8, spent_full)
        assert cost == pytest.approx(PER_RADIAN * own * each.turned * 1e5)
        # The next looser tolerance would have taken more than is due to it.
        assert own == 1e-8 or 10 * cost * sum(w.end for w in ahead[i:]) > (
            FULL_SHARE * 1e-6 - spent_full
        ) * each.end * (1 - 1e-9)
        spent_full += cost
    assert spent_full <= FULL_SHARE * 1e-6


def test_angles_stay_unknown_behind_a_segment_that_an_error_of_averaging_enters():
    """What averaging leaves out where the second segment begins turns the angles by many rad until its end.

    The whole run's error of angles had been taken before that, so that the segment stated nothing.
    """
    start = BodyStart(
        (-0.42994665674095855, 0.625600468815805, 0.6363008819160579, 0.1374449469699203),
        (0.732764881619866, 0.4269383518844498, -0.5815565035746542),
    )
    ellipsoid = Ellipsoid((1.0, 0.2436996495396903, 0.5377992336886624))
    scene = Scene(ellipsoid, 29466.698597661438, start, 25107.534696823066)
    full, averaged = plan.foreseen(scene, 4e-3)
    assert (full.second_order, averaged.second_order) == (False, True)
    assert averaged.phase > pi
    assert averaged.phase > full.phase > 0


@pytest.mark.parametrize("carried", [0.0, 3e-6, 1e-5])
def test_turns_before_an_averaged_segment_count_all_errors_spent(carried: float):
    """Errors by full segments and by averaged ones alike turn the angles while no slow state is found."""
    full = form(full_form(CROSSING)).problem(CROSSING)
    spent = plan.HybridPlan(CROSSING, full, spent=1e-5, carried=carried)
    planned = PlannedSegment(0.0, 0.1, True)
    segment = spent._until_averaged(planned, 0.0, np.array(full.start), 1e-8, "none found")
    all_carried = replace(spent, carried=1e-5)
    same = all_carried._until_averaged(planned, 0.0, np.array(full.start), 1e-8, "none found")
    assert segment.angle == pytest.approx(same.angle)
    assert segment.angle > 1e-5
