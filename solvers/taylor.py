"""Taylor's method by heyoka: machine code, arbitrary order, dense output from the steps' own series."""

from collections.abc import Callable, Mapping
from copy import deepcopy
from math import inf, log10
from typing import Any, ClassVar, Literal

import numpy as np

from polhode.models import long_double
from polhode.models.libraries import installed
from polhode.models.once import OncePerThread, once
from polhode.models.operations import FLOAT
from polhode.models.problem import Factory, Problem
from polhode.solvers.compile import (
    ParameterPlaces,
    load_heyoka,
    parameter_array,
    system_in_units,
    traced_system,
)
from polhode.solvers.contract import Integrator, Outcome, Record, Settings, Solver, Status, change
from polhode.solvers.event_search import LOOK_GROWTH, looks

Precision = Literal["double", "long double", "quadruple"]

# Places in the results of heyoka's propagation: how it ended; the number of steps; the series of all
# steps if it is asked for; the states at the times of a grid that it reached, the first included.
_ENDED = 0
_STEPS = 3
_SERIES = 4
_STATES = -1
# Deadline and Ctrl-C are looked at once per this many steps. An estimate: they are some 0.02 to 0.1 s
# (`contract._NEAR`).
_CHUNK = 10_000
# Components up to which every operation is compiled in place. An estimate: beyond, compilation takes up to
# half a minute.
_MAX_UNROLLED = 50
# Decimal exponent of the n-th power of a time, n the order, beyond which coefficients might leave
# the range of double precision, which ends at 308. The rest is for rates that are faster or slower than
# the time says, at n = 20 by 5 decades. An estimate.
_MAX_EXPONENT = 200.0
# Steps of a chunk in `propagate_paced`, which share one unit of time. If rates fall in them by more
# than `_MAX_EXPONENT` allows, the chunk is run again by one step. An estimate.
_PACED_STEPS = 16
# A paced run is given up if its chunks have not doubled in length over this many chunks,
_PACED_CHUNKS = 40
# and more than this many of the same length are still ahead. Estimates: of 16 steps each, these take an
# hour or so.
_MAX_CHUNKS_AHEAD = 1e8
# Steps before the first look for events; from look to look there are more of them, up to `_CHUNK`. An
# estimate: a terminal event soon after the start costs as many steps.
_FIRST_LOOK = 64


def extends_precision() -> bool:
    """Whether there are runs in extended precision: by heyoka, in x86's long double."""
    return installed("heyoka") and long_double.IS_X86


@once()
def _compiled(
    factory: Factory,
    dimension: int,
    parameters: int,
    tolerance: float,
    precision: Precision = "double",
    in_units: bool = False,
    timed: bool = False,
    paced: bool = False,
) -> Any:
    """heyoka's integrator of a field, of which every thread has a copy.

    `dimension` and `parameters` are the numbers of the state's components and of the parameters.
    `in_units`, `timed` and `paced`: it has the units of the state, the clock's offset and the unit
    of time as further parameters, for `Bound`; `ParameterPlaces` says where.
    """
    # Extended precisions and large systems are compiled in compact mode, which costs speed but saves
    # up to half a minute of compilation.
    heyoka = load_heyoka()
    number: Any = float
    if precision == "long double":
        number = np.longdouble
    elif precision == "quadruple":
        # heyoka has no such type where the compiler has none.
        number = heyoka.real128
    if in_units:
        system = system_in_units(factory, dimension, parameters, timed=timed, paced=paced)
    else:
        system = traced_system(factory, dimension, parameters)
    start = np.zeros(len(system), number)
    compact = precision != "double" or dimension > _MAX_UNROLLED
    options = {"fp_type": number, "tol": number(tolerance), "compact_mode": compact}
    return heyoka.taylor_adaptive(system, start, **options)


@OncePerThread
def taylor_integrator(*key: Any) -> Any:
    """An integrator for this thread, arguments as of `_compiled`; a run sets its state, time and parameters."""
    return deepcopy(_compiled(*key))


def forget_integrators() -> None:
    """Forget compiled integrators: the next runs of this thread compile theirs anew.

    Other threads go on with the copies that they have. The place of code in memory changes its
    speed by some per cent: a study that times it several times does so over several compilations.
    """
    _compiled.cache_clear()
    taylor_integrator.cache_clear()


def propagate(
    integrator: Any,
    record: Record,
    states: Callable[[np.ndarray, np.ndarray], np.ndarray] | None = None,
    max_step: float = np.inf,
) -> Outcome:
    """Propagate a heyoka integrator over the record's times, in chunks, which change none of its steps.

    The caller has set its state, time and parameters to the record's start.
    ``states(rows, times)`` are the states that its rows mean, if these are not the rows themselves;
    `times` may go on beyond the rows. `max_step` is the largest step, in the integrator's time.
    """
    outcome = load_heyoka().taylor_outcome
    number = integrator.state.dtype
    work = record.work
    steps = 0
    grid = record.times.astype(number, copy=False)
    while True:
        result = integrator.propagate_grid(
            grid,
            max_steps=min(record.chunk(_CHUNK), record.max_steps - steps),
            max_delta_t=number.type(max_step),
        )
        reason = result[_ENDED]
        steps = steps + result[_STEPS]
        work.steps = steps
        rows = result[_STATES][1:]
        if states is not None:
            rows = states(rows, grid[1:])
        # Rows go in order of time: those behind one that is not finite are not finite either.
        record.put(rows if reason != outcome.err_nf_state else rows[np.isfinite(rows).all(axis=1)])
        if reason == outcome.time_limit or record.filled == len(record.times):
            return Status.REACHED_END, ""
        if reason != outcome.step_limit:
            return (
                Status.NON_FINITE if reason == outcome.err_nf_state else Status.STEP_UNDERFLOW,
                str(reason),
            )
        record.now = float(integrator.time)
        if not result[_STEPS]:
            # Steps are left, yet it takes none: they would not advance the time.
            return Status.STEP_UNDERFLOW, f"stalled at t = {record.now!r}"
        if stopped := record.stopped or record.crawls(steps, record.now):
            return stopped
        grid = np.concatenate([[integrator.time], record.times[record.filled :].astype(number)])


def propagate_with_events(
    integrator: Any,
    record: Record,
    states: Callable[[np.ndarray, np.ndarray], np.ndarray],
    max_step: float = np.inf,
) -> Outcome:
    """As `propagate`, with the record's events looked for on the series of every step."""
    outcome = load_heyoka().taylor_outcome
    steps = 0
    look = _FIRST_LOOK
    end = float(record.times[-1])
    while True:
        result = integrator.propagate_until(
            end,
            max_steps=min(record.chunk(look), record.max_steps - steps),
            max_delta_t=max_step,
            c_output=True,
        )
        reason = result[_ENDED]
        series = result[_SERIES]
        steps = steps + result[_STEPS]
        record.now = float(integrator.time)
        record.work.steps = steps
        look = min(_CHUNK, look * LOOK_GROWTH)
        if series is not None:

            def between(times: np.ndarray, series: Any = series) -> np.ndarray:
                return states(np.array(series(times)), times)

            reached = float(series.times[-1])
            record.filled_between(looks(series.times), reached, between)
        if reason == outcome.time_limit or (record.events and record.events.ended is not None):
            return Status.REACHED_END, ""
        if reason != outcome.step_limit:
            non_finite = reason == outcome.err_nf_state
            return (Status.NON_FINITE if non_finite else Status.STEP_UNDERFLOW), str(reason)
        if not result[_STEPS]:
            return Status.STEP_UNDERFLOW, f"stalled at t = {record.now!r}"
        if stopped := record.stopped or record.crawls(steps, record.now):
            return stopped


class Bound:
    """A problem bound to heyoka's integrator, components in units of their own where tolerances ask for that.

    heyoka's tolerance is relative to the largest component, and absolute below one: in units of
    atol / rtol it is the requested one. `units` has them, shape () or (d,); each becomes the nearest
    power of two, by which no state is rounded, so that atol is met within a factor of √2.
    `tolerance` is heyoka's, and `max_step` the largest step in the problem's time.

    `timed` says that the last component of the problem's state is the time; the integrator has it
    as its own time plus `offset`. `paced` lets the integrator's time have a unit, `pace`.
    """

    def __init__(
        self,
        problem: Problem,
        tolerance: float,
        precision: Precision = "double",
        units: np.ndarray | None = None,
        max_step: float = np.inf,
        *,
        paced: bool = False,
    ) -> None:
        self.timed = problem.timed
        self.max_step = max_step
        self.variables = problem.dimension - self.timed
        self.units = units
        if units is not None:
            units = np.broadcast_to(units, problem.dimension)[: self.variables]
            self.units = np.exp2(np.round(np.log2(units)))
        if self.timed or paced:
            self.units = np.ones(self.variables) if self.units is None else self.units
        elif units is not None and (self.units == 1).all():
            self.units = None
        self.pace = 1.0 if paced else None
        self.parameters = parameter_array(problem)
        self.places = ParameterPlaces(len(self.parameters), self.variables, self.timed)
        self.integrator = taylor_integrator(
            *(problem.field, problem.dimension, len(self.parameters), tolerance, precision),
            *(self.units is not None, self.timed, paced),
        )
        self.offset = 0.0

    def begin(self, time: float, start: np.ndarray) -> None:
        """Set time, state and parameters; the start has any precision up to the integrator's own."""
        integrator = self.integrator
        number = integrator.state.dtype
        integrator.time = number.type(time)
        if self.units is None:
            integrator.state[:] = start
            integrator.pars[:] = self.parameters
            return
        start = start.astype(number)
        integrator.state[:] = start[: self.variables] / self.units.astype(number)
        integrator.pars[: len(self.parameters)] = self.parameters
        integrator.pars[self.places.units] = self.units
        if self.timed:
            self.offset = start[-1] - number.type(time)
            integrator.pars[self.places.offset] = self.offset
        if self.pace is not None:
            integrator.pars[self.places.pace] = self.pace

    def states(self, rows: np.ndarray, times: np.ndarray) -> np.ndarray:
        """States of the problem that the integrator's rows stand for, shape (n, d)."""
        if self.units is None:
            return rows
        rows = rows * self.units.astype(rows.dtype)
        if not self.timed:
            return rows
        whole = np.empty((len(rows), rows.shape[1] + 1), rows.dtype)
        whole[:, :-1] = rows
        whole[:, -1] = times[: len(rows)] + self.offset
        return whole

    def propagate(self, record: Record) -> Outcome:
        """Run from the record's start over its times."""
        change(self.parameters, len(self.parameters), record)
        self.begin(record.times[0], record.start)
        if record.events:
            return propagate_with_events(self.integrator, record, self.states, self.max_step)
        states = None if self.units is None else self.states
        return propagate(self.integrator, record, states, self.max_step)


def _own_units(
    problem: Problem, state: np.ndarray, units: np.ndarray, most: float
) -> tuple[float, float]:
    """The state's size in its units, and the time in which it changes by that size, `most` at most: powers of two.

    A state of zeros has the size 1.
    """
    variables = len(units)
    size = float(np.max(np.abs(state[:variables] / units))) or 1.0
    # Rates that overflow give no unit of time: the most is taken, and the run ends by a state that is
    # not finite.
    try:
        rates = problem.field(FLOAT)(state.tolist(), problem.parameters)
    except (ArithmeticError, ValueError):
        rates = np.zeros(variables)
    with np.errstate(all="ignore"):
        rate = float(np.max(np.abs(np.array(rates, dtype=float)[:variables] / units))) / size
        time = min(most, 1 / rate) if rate > 0 else most
        size, time = np.exp2(np.floor(np.log2([size, time]))).tolist()
    return size, time


def propagate_paced(problem: Problem, bound: Bound, record: Record) -> Outcome:
    """Go on from the last row filled, in units of state and time that follow the run.

    The n-th coefficient of a Taylor series is about the state times the n-th power of its rate. At
    n = 20, the order at the tightest tolerances of double precision, it leaves the range of that
    precision where rates are very large or small. In units of the state's own size and of the time
    in which it changes, none does. Each chunk of steps has its units. The tolerance is relative
    where the state is below its units: an absolute one would let a step leave the series' radius
    there.
    """
    outcome = load_heyoka().taylor_outcome
    integrator = bound.integrator
    work = record.work
    units = bound.units
    assert units is not None, "bound in units"
    steps = work.steps or 0
    time = float(record.times[record.filled - 1])
    end = float(record.times[-1])
    state = record.rows[record.filled - 1].astype(float)
    chunk_times: list[float] = []
    length = _PACED_STEPS
    while record.filled < len(record.times):
        if stopped := record.stopped:
            return stopped
        size, bound.pace = _own_units(problem, state, units, end - time)
        bound.units = units * min(1.0, size)
        bound.begin(0.0, state)
        grid = np.concatenate([[0.0], (record.times[record.filled :] - time) / bound.pace])
        result = integrator.propagate_grid(
            grid,
            max_steps=min(record.chunk(length), record.max_steps - steps),
            max_delta_t=bound.max_step / bound.pace,
        )
        reason = result[_ENDED]
        steps = steps + result[_STEPS]
        work.steps = steps
        reached = bound.pace * float(integrator.time)
        after = bound.states(integrator.state.copy()[None], np.array([reached]))[0]
        if reason in (outcome.time_limit, outcome.step_limit) and result[_STEPS] > 1:
            slower = _own_units(problem, after, units, inf)[1] / bound.pace
            if integrator.order * log10(max(slower, 1.0)) > _MAX_EXPONENT:
                # Rates fell so far in this chunk that coefficients may have vanished: the chunk is run
                # again, one step only.
                length = 1
                continue
        length = _PACED_STEPS
        rows = bound.states(result[_STATES][1:], bound.pace * grid[1:])
        finite = np.isfinite(rows).all(axis=1)
        record.put(rows if finite.all() else rows[: int(np.argmin(finite))])
        if reason == outcome.time_limit:
            if not finite.all():
                return Status.NON_FINITE, "a state is not finite"
            continue
        if reason != outcome.step_limit:
            return (
                Status.NON_FINITE if reason == outcome.err_nf_state else Status.STEP_UNDERFLOW,
                str(reason),
            )
        before = time
        time = time + reached
        state = after
        if time == before:
            return Status.STEP_UNDERFLOW, f"stalled at t = {time!r}"
        record.now = time
        chunk_times = [*chunk_times[-_PACED_CHUNKS:], time - before]
        grown = len(chunk_times) <= _PACED_CHUNKS or chunk_times[-1] > 2 * chunk_times[0]
        if not grown and end - time > _MAX_CHUNKS_AHEAD * chunk_times[-1]:
            step = chunk_times[-1] / max(1, result[_STEPS])
            return Status.STEP_UNDERFLOW, f"steps of {step:.1e} at t = {time!r}"
        if crawling := record.crawls(steps, time):
            return crawling
    return Status.REACHED_END, ""


class Taylor(Solver):
    """Taylor's method of adaptive step; order about -ln(tolerance)/2 + 1, A-stable at no order.

    Tolerance: heyoka's `tol`, relative to the largest entry of the state and absolute where that is
    below one, for truncation of the Taylor series in each step. If `atol` differs from `rtol`, the
    state is integrated in units of atol / rtol, one per component. On stiff problems the step is
    bound by stability. Source: Jorba and Zou, Experimental Mathematics 14 (2005) 99; Biscani and
    Izzo, MNRAS 504 (2021) 2614.
    """

    name = "taylor"
    summary = "Taylor's method of adaptive order and step (heyoka)"
    accepts = "every form with an explicit vector field"
    library = "heyoka"
    package = "heyoka"
    family = "heyoka"
    backends = ("compiled",)
    choices_need: ClassVar[Mapping[str, str]] = {}  # heyoka compiles by itself
    order_by_tolerance = True
    error_amplification = 1.0  # The least that the contract allows.
    error_constant = 20.0  # 6 measured

    tolerances = ("atol",)
    limits = ("max_step",)
    seeks_events = True
    takes_parameter_table = True

    def prepare(self, problem: Problem, settings: Settings) -> Integrator:
        bound = self._bound(problem, settings)
        order = bound.integrator.order

        def integrate(record: Record) -> Outcome:
            duration = float(record.times[-1]) - float(record.times[0])
            # First in the problem's own units; in units that follow the run if that fails, or may. If
            # rates are slow beside the unit of time, coefficients of high order vanish, and with them the
            # error that they show. If rates are fast, coefficients overflow, as does a state that becomes
            # infinite.
            outcome = None
            # Parameters that change along a track do so at times in the problem's own unit, and events are
            # looked for in it: `propagate_paced` knows neither.
            as_it_is = bool(record.events) or record.changed is not None
            in_range = order * log10(duration) < _MAX_EXPONENT
            if as_it_is and not in_range:
                words = (
                    f"a time of {duration:.1e} with events, or along a track, needs another solver"
                )
                return Status.TOLERANCE_UNATTAINABLE, words
            if in_range:
                outcome = bound.propagate(record)
                if as_it_is or outcome[0] is not Status.NON_FINITE:
                    return outcome
            paced = self._bound(problem, settings, paced=True)
            again = propagate_paced(problem, paced, record)
            # If both fail, the first failure tells more, unless the second one is a limit of the user's.
            limited = again[0] in (Status.TIME_LIMIT, Status.STEP_LIMIT)
            return outcome if outcome and not again[0].success and not limited else again

        return integrate

    def _bound(self, problem: Problem, settings: Settings, *, paced: bool = False) -> Bound:
        units = None if settings.atol == settings.rtol else settings.atols() / settings.tolerance
        return Bound(
            problem, settings.tolerance, units=units, max_step=settings.max_step, paced=paced
        )

    def bare_call(
        self, problem: Problem, settings: Settings, times: np.ndarray
    ) -> Callable[[], object] | None:
        bound = self._bound(problem, settings)
        start = np.array(problem.start)

        def call() -> object:
            bound.begin(0.0, start)
            return bound.integrator.propagate_grid(times)

        return call
