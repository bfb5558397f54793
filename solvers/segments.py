"""A run on its way, segment by segment: what is solved next, where its rows go, what remains of a segment cut short."""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from math import pi
from time import perf_counter
from typing import Any

import numpy as np

from polhode.models.libraries import how_to_install, missing_library
from polhode.models.operations import ARRAYS, FLOAT
from polhode.models.own_function import place_of
from polhode.models.problem import ROUNDING, NextSegment, Problem, Segment
from polhode.models.spent import spent_on
from polhode.solvers.contract import (
    NO_RATES,
    Integrator,
    Outcome,
    Record,
    Settings,
    Solver,
    Status,
    Work,
)
from polhode.solvers.event_search import EventFailedError, EventSearch
from polhode.solvers.parameter_table import with_parameter_table

# Growth of an angle, in rad, after which it is wrapped: 50 turns. An estimate: a tolerance is relative to
# the angle too, so that with more turns angles err more; with fewer, the starts of segments cost more
# steps.
_WRAP_AFTER = 100 * pi
# Times closer than this share of the run count as the same one: thousands of roundings of a time, by
# estimate, as in `solvers.parameter_table`.
_CLOSE = 1e-12


@dataclass(frozen=True)
class SolvedSegment:
    """A segment of a run that was run."""

    begin: float  # in the run's time
    end: float
    reason: str  # why these equations
    error: float  # expected, of L and E, over I_max
    steps: int | None
    angle: float = 0.0  # expected error of the orientation, in rad
    averaged: bool = False  # whether its equations are averaged ones
    tolerance: float = 0.0  # of the solver


class Run:
    """A run on its way, segment by segment.

    `times` are the requested ones, shape (n,), the start's included. After `through`, the run has
    finished the first `done` of `times` and `rows`; `status` and `message` say how it ended. It took
    the reading of `perf_counter` less `began`, in seconds. `solve` sets `events` and `every_step`
    before.
    """

    def __init__(
        self, problem: Problem, method: Solver, settings: Settings, times: np.ndarray
    ) -> None:
        self.problem = problem
        self.method = method
        self.settings = settings
        self.times = times
        self.rows = np.empty((len(times), problem.dimension))
        self.rows[0] = self.state = np.array(problem.start)
        self.now = float(times[0])
        self.end = float(times[-1])
        self.done = 1  # rows that are filled, the start included
        self.segments_run = 0
        # Listed for a problem of several segments alone.
        self.segments: list[SolvedSegment] = []
        self.work = Work()
        self.status = Status.REACHED_END
        self.message = ""
        # The last segment's problem and tolerance, and the integrator made for them.
        self.prepared: tuple[Problem, float, Integrator] | None = None
        self.shrunk = False  # whether steps became much shorter on the way
        self.events: EventSearch | None = None
        self.every_step = False  # whether rows are to lie at the solver's own steps
        self.began = perf_counter()

    def through(
        self,
        next_segment: NextSegment,
        seconds: float,
        max_steps: int,
        watch: Callable[[Record], None] | None,
    ) -> None:
        """Run to the last requested time, or until a segment fails.

        Parameters
        ----------
        next_segment : callable
            Gives the first segment. A segment names in `Segment.then` what gives those behind it.
        seconds, max_steps : float and int
            Limits of the whole run, compilation left out of the time. A run that meets one ends with
            the rows finished so far.
        watch : callable, optional
            Is given each segment's record before the solver is.

        Raises
        ------
        ValueError
            If the solver refuses the first segment.
        EventFailedError
            If an event's function fails.
        """
        while self.status is Status.REACHED_END and self.now < self.end:
            steps_left = max_steps - (self.work.steps or 0)
            if self._stopped_by_limit(steps_left, seconds):
                return
            following = self._next_with_integrator(next_segment)
            if following is None:
                return
            segment, integrate = following
            next_segment = segment.then or next_segment
            end = self._aligned(segment.end)
            record = self._record(segment, end, self.began + seconds, steps_left)
            record.events = self.events if self.method.seeks_events else None
            if self.every_step:
                record.taken = []
            if watch:
                watch(record)
            message = self._integrated(integrate, segment, end, record)
            if self.events and self.events.ended is not None:
                # The run ends at an event, however the solver was stopped there.
                self.status = Status.REACHED_END
                self.message = ""
                return
            if self.status is not Status.REACHED_END:
                self._explain_failure(message, segment, record)
            if self._breaks_off(end, record):
                return

    def _stopped_by_limit(self, steps_left: int, seconds: float) -> bool:
        """Whether a limit of the run lets no further segment begin; status and message then say so."""
        if steps_left < 1:
            self.status = Status.STEP_LIMIT
            self.message = f"{self.work.steps or 0} steps"
            return True
        # The first segment meets its deadline by itself, so that a run has a row at least.
        if self.segments_run and perf_counter() > self.began + seconds:
            self.status = Status.TIME_LIMIT
            self.message = f"stopped at t = {self.now!r}"
            return True
        return False

    def _next_with_integrator(self, next_segment: NextSegment) -> tuple[Segment, Integrator] | None:
        """The next segment and its integrator; None with a status and a message if that crashes.

        Raises ValueError if the solver refuses the run's first segment: the fault is the caller's.
        """
        segment = None
        try:
            segment = next_segment(self.now, self.state, self.settings.tolerance)
            return segment, self._integrator(segment)
        except Exception as error:
            if segment and isinstance(error, ValueError) and not self.segments_run:
                # Problem or setting are refused.
                raise
            self.status, self.message = _crash(error, self.method.name)
            return None

    def _integrated(
        self, integrate: Integrator, segment: Segment, end: float, record: Record
    ) -> str:
        """Run the solver over a segment and take over what it has finished; returns its message.

        Finished rows are taken over on Ctrl-C too.
        """
        try:
            self.status, message = _outcome(integrate, record, self.method.name)
        finally:
            self._take_over(segment, end, record)
            if record.taken:
                self._take_over_steps(record.taken)
        return message

    def _explain_failure(self, message: str, segment: Segment, record: Record) -> None:
        """Make the solver's message of a failed segment the message of the run."""
        if record.filled == 1 and not _has_rates(segment.problem, record.start):
            self.status, message = NO_RATES
        # The solver knows the steps of its own segment alone.
        self.message = message.replace(f"{record.work.steps} steps", f"{self.work.steps} steps")

    def _breaks_off(self, end: float, record: Record) -> bool:
        """Whether no segment can follow: rows are missing, or the state to go on from is not finite."""
        if record.filled < len(record.times):
            return True
        return end < self.end and not np.isfinite(self.state).all()

    def _aligned(self, end: float) -> float:
        """The end of a segment: a requested time, if it lies so near one that a solver could not step between them."""
        if end >= self.end:
            return self.end
        close = _CLOSE * self.end
        near = float(self.times[self.times.searchsorted(end - close)])
        return near if near <= end + close else end

    def _count_until(self, time: float) -> int:
        """Number of requested times up to a time, that one included."""
        if time >= self.end:
            # A search takes 0.3 µs.
            return len(self.times)
        return int(self.times.searchsorted(time, side="right"))

    def _integrator(self, segment: Segment) -> Integrator:
        """The solver, ready for a segment; compilation is not the run's time."""
        tolerance = self._tolerance(segment)[0]
        before = perf_counter()
        if self.prepared and self.prepared[0] is segment.problem and self.prepared[1] == tolerance:
            return self.prepared[2]
        same = tolerance == self.settings.tolerance
        settings = self.settings if same else self.settings.at(tolerance)
        with spent_on("compilation"):
            integrate = self.method.prepare(segment.problem, settings)
        if segment.problem.parameter_table is not None:
            integrate = with_parameter_table(integrate, segment.problem)
        self.prepared = segment.problem, tolerance, integrate
        self.began += perf_counter() - before
        return integrate

    def _tolerance(self, segment: Segment) -> tuple[float, float]:
        """The solver's tolerance in a segment, and its error over the one that the segment states.

        The tolerance is tighter than the segment's by the solver's error amplification, but not tighter
        than `ROUNDING`: there the error is larger than stated. The amplification was measured for the
        full equations: averaged segments, those that state no error, and solvers of unknown
        amplification run at the tolerance requested.
        """
        requested = segment.tolerance or self.settings.tolerance
        if segment.averaged or not (segment.error and self.method.error_amplification):
            return requested, 1.0
        tolerance = min(requested, max(requested / self.method.error_amplification, ROUNDING))
        return tolerance, max(self.method.error_amplification * tolerance, ROUNDING) / max(
            requested, ROUNDING
        )

    def _record(self, segment: Segment, end: float, deadline: float, steps: int) -> Record:
        """The record for the solver: the run's own rows where the segment has these, else rows of its own."""
        first = self.done - 1
        last = self._count_until(end) - 1
        unit = segment.problem.time_unit / self.problem.time_unit
        if (
            segment.problem is self.problem
            and self.now == self.times[first]
            and end == self.times[last]
        ):
            return Record(
                self.times[first : last + 1], self.rows[first : last + 1], deadline, steps
            )
        beyond = [end] if self.times[last] < end < self.end else []
        times = np.concatenate([[self.now], self.times[first + 1 : last + 1], beyond]) / unit
        rows = np.empty((len(times), segment.problem.dimension))
        rows[0] = segment.problem.start
        return Record(times, rows, deadline, steps, unit=unit)

    def _take_over(self, segment: Segment, end: float, record: Record) -> None:
        """Take over what a segment has finished, whether it reached its end or not."""
        states = record.rows[: record.filled]
        if segment.states:
            states = segment.states(states)
        # Its end need not be among the requested times.
        count = self._count_until(end) - self.done
        new = states[1 : count + 1]
        if segment.states or record.rows.base is not self.rows:
            self.rows[self.done : self.done + len(new)] = new
        self.done = self.done + len(new)
        self.state = states[-1]
        self.shrunk = self.shrunk or record.shrunk
        if self.segments_run:
            self.work.add(record.work)
        else:
            self.work = record.work
        self.segments_run += 1
        begin = self.now
        self.now = min(record.reached, end) if record.filled < len(record.times) else end
        if self.problem.next_segment is None:
            return
        tolerance, error_ratio = self._tolerance(segment)
        solved = SolvedSegment(
            begin=begin,
            end=self.now,
            reason=segment.reason,
            error=error_ratio * segment.error,
            steps=record.work.steps,
            angle=min(pi, error_ratio * segment.angle),
            averaged=segment.averaged,
            tolerance=tolerance,
        )
        self.segments.append(solved)

    def _take_over_steps(self, taken: list[tuple[float, np.ndarray]]) -> None:
        """Make rows of the steps taken; a run that fell short still has its end among its times."""
        times = np.array([self.times[0], *[time for time, _ in taken]])
        # Several times as quick as an array of arrays.
        states = np.concatenate([self.rows[0], *[state for _, state in taken]])
        self.rows = states.reshape(len(times), -1)
        self.done = len(times)
        self.times = times if times[-1] == self.end else np.append(times, self.end)


def _crash(error: Exception, solver: str) -> Outcome:
    """The outcome of an exception: the library that is missing, or a crash with the user's line if any."""
    if library := missing_library(error):
        return Status.ADAPTER_MISSING, f"solver {solver!r}: {how_to_install(library)}"
    words = " ".join(str(error).split())
    return (
        Status.CRASHED,
        f"solver {solver!r} raised {type(error).__name__}: {words}{place_of(error, __file__)}",
    )


def _outcome(integrate: Integrator, record: Record, solver: str) -> Outcome:
    """Status and message of an integrator; an exception, missing rows, or another result are a crash."""
    try:
        outcome: Any = integrate(record)
    except EventFailedError:
        raise
    except Exception as error:
        outcome = _crash(error, solver)
    if not 1 <= record.filled <= len(record.times):
        filled = record.filled
        record.filled = 1
        return (
            Status.CRASHED,
            f"solver {solver!r} filled {filled} rows, expected 1 to {len(record.times)}",
        )
    if isinstance(outcome, tuple) and len(outcome) == 2:
        status, message = outcome
        if isinstance(status, Status) and type(message) is str:
            return outcome
    return (
        Status.CRASHED,
        f"solver {solver!r} returned {outcome!r}, expected a tuple (Status, message)",
    )


def _has_rates(problem: Problem, state: np.ndarray) -> bool:
    """Whether a state and its rates are finite; also True of a field that raises an error of its own."""
    parameters = np.array((problem.mass_form or problem).parameters)
    # NumPy's operations raise nothing where a quotient or a root has no value.
    with np.errstate(all="ignore"), suppress(Exception):
        return bool(np.isfinite([*state, *problem.field(ARRAYS)(state, parameters)]).all())
    return True


def wrapped_start(problem: Problem) -> Problem:
    """The problem with its angles at the start within a turn of 0: a tolerance is relative to them too.

    A problem of several segments makes the starts of these itself, and stays as it is.
    """
    far = [i for i in problem.periodic if abs(problem.start[i]) > 2 * pi]
    if not far or problem.next_segment:
        return problem
    start = list(problem.start)
    for i in far:
        start[i] %= 2 * pi
    return replace(problem, start=tuple(start))


def wrapped(problem: Problem, times: np.ndarray) -> NextSegment:
    """The segments of a run of one problem, between which its angles are wrapped.

    It is one segment if the problem has no angles. It is one, too, without parameters: no explicit
    rates say how fast the angles grow.
    """
    if not problem.periodic or problem.parameters is None:
        whole = Segment(problem, float(times[-1]))
        return lambda time, state, tolerance: whole
    columns = list(problem.periodic)
    # Longest time of a segment, by the fastest angle at the start, or one of rate 1.
    longest = _WRAP_AFTER
    with suppress(ArithmeticError, ValueError):
        rates = problem.field(FLOAT)(problem.start, problem.parameters)
        longest = _WRAP_AFTER / max(1.0, *(abs(rates[i]) for i in columns))

    def wrap(states: np.ndarray) -> np.ndarray:
        # In place. The first row is the segment's start, which the run has already.
        states[1:, columns] %= 2 * pi
        return states

    def next_segment(time: float, state: np.ndarray, tolerance: float) -> Segment:
        # It ends at a requested time, the next one at least.
        after = int(times.searchsorted(time, side="right"))
        last = max(after, int(times.searchsorted(time + longest)))
        return Segment(problem, float(times[min(last, len(times) - 1)]), wrap)

    return next_segment
