"""Runs through parameters that change at given times: each step ends there, and keeps its order."""

from dataclasses import dataclass, field
from math import isfinite

import numpy as np

from polhode.models.problem import ParameterTable, Problem
from polhode.solvers.contract import Integrator, Outcome, Record, Status

# A change closer to a row's time than this share of the run is at that time: no step fits between.
_CLOSE = 1e-12


def with_parameter_table(integrate: Integrator, problem: Problem) -> Integrator:
    """An integrator of whole runs, from one of single intervals that takes the parameters of its record."""
    table = problem.parameter_table
    assert table is not None, "parameters that change"
    return lambda record: _through(integrate, table, record)


@dataclass
class _Cut:
    """The intervals of a record: their ends on its clock, the rows up to each, and their parameters."""

    ends: np.ndarray
    rows: list[int]
    values: np.ndarray
    # Time of the state on the clock of the record.
    offset: float = field(default=0.0)


def _cut(table: ParameterTable, record: Record) -> _Cut:
    """The intervals of a record, in the direction of its times, which may go back."""
    times = record.times
    begin = float(times[0])
    end = float(times[-1])
    offset = float(record.start[-1]) - begin
    knots = table.times - offset
    values = table.values
    sign = 1.0 if end > begin else -1.0
    if sign < 0:
        # From each interval's end to its beginning.
        knots = -knots[::-1]
        values = values[::-1]
        begin = -begin
        end = -end
    close = _CLOSE * (end - begin)
    # The outer intervals go on beyond the table, whose ends may be rounded.
    first = int(
        np.clip(np.searchsorted(knots, begin + close, side="right") - 1, 0, len(values) - 1)
    )
    last = int(np.clip(np.searchsorted(knots, end - close, side="left"), first + 1, len(values)))
    ends = np.append(knots[first + 1 : last], end)
    requested = sign * times
    after = np.clip(np.searchsorted(requested, ends - close), 0, len(requested) - 1)
    ends = np.where(np.abs(requested[after] - ends) <= close, requested[after], ends)
    # Two changes at one row's time leave nothing between them.
    longer = np.diff(ends, prepend=begin) > 0
    ends = ends[longer]
    rows = np.searchsorted(requested, ends, side="right").tolist()
    return _Cut(sign * ends, rows, values[first:last][longer], offset)


def _through(integrate: Integrator, table: ParameterTable, record: Record) -> Outcome:
    """Fill a record's rows, interval by interval."""
    cut = _cut(table, record)
    now = float(record.times[0])
    room = np.empty((2, record.rows.shape[1]), record.rows.dtype)
    state = record.start.copy()
    status = Status.REACHED_END
    message = ""
    for end, upto, values in zip(cut.ends.tolist(), cut.rows, cut.values, strict=True):
        goes_on = record.inner is not None
        if goes_on and (stopped := record.stopped):
            return stopped
        times = np.array((now, end))
        rows = room
        count = upto - record.filled
        if count:
            inner = record.times[record.filled : upto]
            times = np.concatenate([[now], inner, [] if inner[-1] == end else [end]])
            rows = np.empty((len(times), len(state)), state.dtype)
        # The clock in the state is exact at each change.
        state[-1] = state.dtype.type(cut.offset + now)
        rows[0] = state
        interval = Record(times, rows, record.deadline, record.max_steps - (record.work.steps or 0))
        interval.unit = record.unit
        interval.events = record.events
        interval.taken = record.taken
        interval.changed = values
        interval.goes_on = goes_on
        record.inner = interval
        try:
            status, message = integrate(interval)
        finally:
            # Ctrl-C keeps what is finished.
            if goes_on:
                record.work.add(interval.work)
            else:
                record.work = interval.work
            if count:
                record.put(rows[1 : 1 + min(count, interval.filled - 1)])
        record.shrunk = record.shrunk or interval.shrunk
        ended = record.events is not None and record.events.ended is not None
        if not status.success or ended:
            return status, message
        if interval.filled < len(times):
            reached = float(times[interval.filled - 1])
            return (
                Status.FALSE_SUCCESS,
                f"the library stopped at t = {reached!r}, expected {end!r}",
            )
        state = rows[-1].copy()
        # A third of the time that NumPy's own function takes for so few numbers.
        if not all(map(isfinite, state.astype(float).tolist())):
            return Status.NON_FINITE, f"a state is not finite at t = {end!r}"
        now = end
    return status, message
