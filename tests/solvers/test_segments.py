"""A run of several segments, each a problem of its own: it gives what one segment gives, whatever stops it where."""

import re
import tracemalloc
from collections.abc import Callable
from dataclasses import replace
from math import inf

import numpy as np
import pytest

from oracle.accepting import accepting
from polhode.models.forms.euler_angles import EulerAngles
from polhode.models.operations import Field, Operations
from polhode.models.problem import Problem, Segment
from polhode.models.scenes import named_scene
from polhode.solvers import contract
from polhode.solvers.contract import Record, Status
from polhode.solvers.solve import Interrupted, Solution, solve


def circle_field(ops: Operations) -> Field:
    def rhs(y, p):
        return -p[0] * y[1], p[0] * y[0]

    return rhs


def angle_field(ops: Operations) -> Field:
    sin, cos = ops.sin, ops.cos

    def rhs(y, p):
        return (p[0] * (sin(y[0]) ** 2 + cos(y[0]) ** 2),)

    return rhs


# Segments end at multiples of this time: turning of a point, by turns as itself and as an angle in a
# slower clock.
LENGTH, UNIT, TURNS = 0.7, 5.0, (2.0,)


def point(angles: np.ndarray) -> np.ndarray:
    return np.column_stack([np.cos(angles[:, 0]), np.sin(angles[:, 0])])


def next_segment(time: float, state: np.ndarray, tolerance: float) -> Segment:
    number = int(np.rint(time / LENGTH))
    end = (number + 1) * LENGTH
    if number % 2:
        angle = float(np.arctan2(state[1], state[0]))
        slow = Problem("angle", angle_field, (angle,), 9.0, (TURNS[0] * UNIT,), time_unit=UNIT)
        return Segment(slow, end, point, "odd", 1e-3)
    return Segment(
        Problem("point", circle_field, tuple(state.tolist()), 9.0, TURNS),
        end,
        reason="even",
        error=2e-3,
    )


SEVERAL = Problem("several", circle_field, (1.0, 0.0), 9.0, TURNS, next_segment=next_segment)
# Few times, many, and among them the ends of segments.
EVERY = np.sort(np.concatenate([np.linspace(0.0, 9.0, 32), LENGTH * np.arange(1, 7)]))


def assert_right(solution: Solution, tolerance: float) -> None:
    exact = point(2.0 * solution.times[:, None])
    assert np.abs(solution.states - exact).max() < tolerance


@pytest.mark.parametrize("name", accepting(SEVERAL))
def test_every_solver_runs_the_segments(name: str):
    # 3 LENGTH is 2.1 but for rounding, which leaves no room for a step.
    for times in (EVERY, np.array([0.0, 2.1, 9.0])):
        solution = solve(SEVERAL, name, 1e-7, times)
        assert solution.status is Status.REACHED_END, solution.message
        assert len(solution.times) == len(times)
        assert_right(solution, 2e-4)
        assert [segment.reason for segment in solution.segments] == ["even", "odd"] * 6 + ["even"]
        assert solution.segments[3].begin == solution.segments[2].end == pytest.approx(3 * LENGTH)
        assert solution.work.steps in (
            None,
            sum(segment.steps or 0 for segment in solution.segments),
        )


def test_segments_are_made_as_they_are_needed():
    """However many turns there are: all of them at once took 7.5 GB."""
    scene = replace(named_scene("paper"), stokes=inf, time=3e11)
    problem = EulerAngles().problem(scene)
    tracemalloc.start()
    solution = solve(problem, "cyrk-dop853", 1e-6, max_steps=20_000)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert not solution.success
    assert peak < 2e7


@pytest.mark.parametrize("stopped", [1, 2])
def test_a_deadline_in_each_kind_of_piece_keeps_the_rows(
    stopped: int, monkeypatch: pytest.MonkeyPatch
):
    now = [0.0]

    def watch(record: Record) -> None:
        # The clock jumps in the segment number `stopped`, before its third call of the field.
        now[0] = 1e6 if record.reached > (stopped - 0.5) * LENGTH else 0.0

    monkeypatch.setattr(contract, "perf_counter", lambda: now[0])
    solution = solve(SEVERAL, "dop853", 1e-6, EVERY, max_seconds=1e3, watch=watch, backend="python")
    assert solution.status is Status.TIME_LIMIT
    assert len(solution.segments) == stopped + 1
    assert stopped * LENGTH <= solution.times[-1] < (stopped + 1) * LENGTH
    assert len(solution.times) == np.searchsorted(EVERY, solution.times[-1], side="right")
    assert_right(solution, 1e-4)


def test_limits_of_steps_hold_for_the_whole_run():
    whole = solve(SEVERAL, "dop853", 1e-8, EVERY)
    assert whole.work.steps
    cut = solve(SEVERAL, "dop853", 1e-8, EVERY, max_steps=whole.work.steps // 2)
    assert cut.status is Status.STEP_LIMIT
    assert cut.message == f"{whole.work.steps // 2} steps"
    assert 0 < len(cut.times) < len(EVERY)


@pytest.mark.parametrize(
    ("limit", "words"),
    [("max_steps", "step_limit: 0 steps"), ("max_seconds", "time_limit: stopped at t = 0.0")],
)
def test_limits_between_segments_need_no_count_of_steps(limit: str, words: str):
    solution = solve(SEVERAL, "cvode-bdf", 1e-4, backend="python", **{limit: 0})
    assert f"{solution.status}: {solution.message}" == words


def no_way_on(segment: Segment) -> Segment:
    raise ValueError("no way on")


def refused(segment: Segment) -> Segment:
    return replace(
        segment, problem=replace(segment.problem, field=lambda ops: lambda y, p: (y[0] > 0.0,))
    )


@pytest.mark.parametrize(
    ("breaks", "change"), [(0.0, no_way_on), (3 * LENGTH, no_way_on), (3 * LENGTH, refused)]
)
def test_segments_that_go_wrong_keep_the_rows(breaks: float, change: Callable[[Segment], Segment]):
    def broken(time: float, state: np.ndarray, tolerance: float) -> Segment:
        segment = next_segment(time, state, tolerance)
        return segment if time < breaks else change(segment)

    solution = solve(replace(SEVERAL, next_segment=broken), "dop853", 1e-8, EVERY)
    assert solution.status is Status.CRASHED
    assert re.match("solver 'dop853' raised (ValueError: no way on|FieldError: )", solution.message)
    assert solution.times[-1] == pytest.approx(breaks)
    assert_right(solution, 1e-6)


def test_no_segment_is_requested_beyond_the_end():
    with pytest.raises(
        ValueError, match=r"^times: got 9.5, expected none beyond the run's end, 9.0$"
    ):
        solve(SEVERAL, "dop853", 1e-6, np.array([0.0, 9.5]))


def test_an_observer_reads_the_time_of_the_run():
    records: list[tuple[Record, float]] = []
    solve(
        SEVERAL,
        "dop853",
        1e-8,
        EVERY,
        watch=lambda record: records.append((record, record.reached)),
    )
    assert [begin for _, begin in records] == pytest.approx(LENGTH * np.arange(13))
    assert [record.reached for record, _ in records] == pytest.approx(
        [*(LENGTH * np.arange(1, 13)), 9.0]
    )


def test_an_interrupted_run_keeps_what_was_finished():
    def watch(record: Record) -> None:
        if record.reached > 3 * LENGTH:
            raise KeyboardInterrupt

    with pytest.raises(Interrupted) as caught:
        solve(SEVERAL, "dop853", 1e-8, EVERY, watch=watch)
    kept = caught.value.solution
    assert kept.times[-1] == pytest.approx(4 * LENGTH)
    assert_right(kept, 1e-6)


def test_a_piece_may_ask_for_a_tolerance_of_its_own():
    def tight(time: float, state: np.ndarray, tolerance: float) -> Segment:
        return Segment(
            Problem("point", circle_field, tuple(state.tolist()), 9.0, TURNS),
            9.0,
            tolerance=tolerance**2,
        )

    loose, own = (
        solve(SEVERAL, "dop853", 1e-4, EVERY),
        Problem("tight", circle_field, (1.0, 0.0), 9.0, TURNS, next_segment=tight),
    )
    assert np.abs(solve(own, "dop853", 1e-4, EVERY).states - point(2 * EVERY[:, None])).max() < 1e-6
    assert np.abs(loose.states - point(2 * EVERY[:, None])).max() > 1e-6


def test_a_field_without_rates_at_the_start_is_a_failed_run():
    singular = Problem("singular", lambda ops: lambda y, p: (1 / y[0],), (0.0,), 1.0, periodic=(0,))
    assert solve(singular, "cyrk-vern8", 1e-8).status == "non_finite"


def test_tolerances_of_single_precision_are_doubles():
    assert solve(SEVERAL, "cyrk-vern8", np.float32(1e-6), EVERY).states == pytest.approx(
        solve(SEVERAL, "cyrk-vern8", float(np.float32(1e-6)), EVERY).states, abs=0
    )
