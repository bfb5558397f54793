"""Runs through parameters that change at given times, as the flow does at the knots of a track.

The parameters, such as the coefficients of a track's spline, are constant in each interval from one
change to the next. An integrator runs each interval by itself, so that its steps end at the changes
and keep their order.
"""

from dataclasses import dataclass, field
from math import isfinite

import numpy as np

from polhode.models.problem import ParameterTable, Problem
from polhode.solvers.contract import Integrator, Outcome, Record, Status

# A change closer to a requested time than this share of the run counts as at that time: no step
# fits between the two. It is thousands of roundings of a time in double precision, 1e-16 each, by
# estimate, as in `solvers.segments`.
_CLOSE = 1e-12


def with_parameter_table(integrate: Integrator, problem: Problem) -> Integrator:
    """An integrator of whole runs, from one of single intervals that takes the parameters of its record.

    `integrate` reads them from `Record.changed`. The problem must have a `parameter_table`.
    """
    table = problem.parameter_table
    assert table is not None, "parameters that change"
    return lambda record: _through(integrate, table, record)


@dataclass
class _Cut:
    """The n intervals of a record, in the order in which they are run."""

    ends: np.ndarray  # shape (n,), on the record's clock; the last one is the record's last time
    # Number of the record's rows, its start among them, up to each end, that end included.
    rows: list[int]
    values: np.ndarray  # shape (n, k), the last k parameters of the field in each interval
    # The last component of a state less the record's time. The table counts time as the
    # state does; a record may begin at any time.
    offset: float = field(default=0.0)


def _cut(table: ParameterTable, record: Record) -> _Cut:
    """The intervals of a record, in the direction of its times, which may go back.

    The last component of the record's start is the table's time at the record's first time.
    """
    times = record.times
    begin = float(times[0])
    end = float(times[-1])
    offset = float(record.start[-1]) - begin
    knots = table.times - offset
    values = table.values
    sign = 1.0 if end > begin else -1.0
    if sign < 0:
        # Backwards, an interval is entered at its end. With the sign of all times changed, and the
        # intervals in the reverse order, times increase again.
        knots = -knots[::-1]
        values = values[::-1]
        begin = -begin
        end = -end
    close = _CLOSE * (end - begin)
    # `first` is the interval that the run begins in, `last` the one behind the one that it ends in.
    # The outer intervals go on beyond the table, whose ends may be rounded.
    first = int(
        np.clip(np.searchsorted(knots, begin + close, side="right") - 1, 0, len(values) - 1)
    )
    last = int(np.clip(np.searchsorted(knots, end - close, side="left"), first + 1, len(values)))
    ends = np.append(knots[first + 1 : last], end)
    requested = sign * times
    # If the first requested time from `ends - close` on lies within `close` of an end, the end
    # moves there.
    after = np.clip(np.searchsorted(requested, ends - close), 0, len(requested) - 1)
    ends = np.where(np.abs(requested[after] - ends) <= close, requested[after], ends)
    # Two changes at one row's time leave nothing between them.
    longer = np.diff(ends, prepend=begin) > 0
    ends = ends[longer]
    rows = np.searchsorted(requested, ends, side="right").tolist()
    return _Cut(sign * ends, rows, values[first:last][longer], offset)


def _through(integrate: Integrator, table: ParameterTable, record: Record) -> Outcome:
    """Fill a record's rows, interval by interval; the outcome comes from the last interval begun.

    This function itself reports a failure in three cases: the limit of steps or time is reached at a
    change; the library stops short of an end and claims success; a state is not finite.
    """
    cut = _cut(table, record)
    now = float(record.times[0])
    # Most intervals have no row, only their start and end: these share one array.
    room = np.empty((2, record.rows.shape[1]), record.rows.dtype)
    state = record.start.copy()
    status = Status.REACHED_END
    message = ""
    for end, upto, values in zip(cut.ends.tolist(), cut.rows, cut.values, strict=True):
        # The last interval may have reached a limit just at its end: then no further one is begun.
        goes_on = record.inner is not None
        if goes_on and (stopped := record.stopped):
            return stopped
        # Times and rows of the interval: its start, the requested times in it, and its end.
        times = np.array((now, end))
        rows = room
        count = upto - record.filled
        if count:
            inner = record.times[record.filled : upto]
            times = np.concatenate([[now], inner, [] if inner[-1] == end else [end]])
            rows = np.empty((len(times), len(state)), state.dtype)
        # The last component of the state is time, which the integrator rounds at each step. At each
        # change the exact time replaces it.
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
            # Work and rows are taken over here, so that Ctrl-C keeps what is finished. The interval's
            # own start, and its end if no row was requested there, are no rows of the record.
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
        # For so few numbers `math.isfinite` takes a third of the time of NumPy's function.
        if not all(map(isfinite, state.astype(float).tolist())):
            return Status.NON_FINITE, f"a state is not finite at t = {end!r}"
        now = end
    return status, message
