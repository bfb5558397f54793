"""Splitting: exact flows of a problem's fast and slow parts in turns."""

from collections.abc import Sequence
from functools import cached_property
from math import inf, pi, sqrt
from typing import Any, ClassVar

import numpy as np

from polhode.models import long_double
from polhode.models.operations import ARRAYS, FLOAT
from polhode.models.problem import Parts, Problem
from polhode.solvers.compile import parameter_array
from polhode.solvers.contract import (
    Integrator,
    Outcome,
    Record,
    Settings,
    Solver,
    SolverNotValidError,
    Status,
)
from polhode.solvers.machine_code.underflow import FlushedToZero
from polhode.solvers.parts.kernels import ClockAt, Code, Kernels, clock, kernels
from polhode.solvers.parts.planning import Planner
from polhode.solvers.parts.schemes import ABA, PARALLEL

# A call checks deadline and Ctrl-C once per this many steps, some 20 ms.
_MAX_STEPS_PER_CALL = 120_000
# Rate at which simple shear turns a body that follows it, in shear rates. A body at rest relaxes
# towards it: times the rate of relaxation it is the growth of the fast angle's rate. The square of
# the least rate that counts is that product: from rest, a body reaches this rate after half a
# radian. The kernels take that square for half the rate of relaxation too (`kernels._advance`),
# which holds for this number alone.
_SHEAR = 0.5
# From this rate of relaxation on no means over compositions are taken: for what relaxes in far less
# than a step they diverge. An estimate.
_STRONG = 10.0
# Share of the reach of a fast flow that steps make use of; an estimate. If relaxation is strong, a row
# may lie a whole step away: `ABA` leads there, by flows of up to a tenth beyond the reach.
_WIDEST = 0.99
# Plans are made anew after these shares of a run, as motion settles. These and the next three are
# estimates: new plans cost checks, old ones may be too fine or too coarse for what the motion has become.
_AGAIN = (0.1, 0.4)
# Least turns before a plan is made anew.
_LEAST_BETWEEN = 120.0
# A plan is also made anew where the rate has changed by this factor.
_WIDTH = 2.4
# That factor grows by this one with each plan, so that an oscillating rate needs few plans.
_WIDER = 1.15

_FAILED: dict[int, Status] = {
    Code.NOT_FINITE: Status.NON_FINITE,
    Code.NO_STEP: Status.STEP_UNDERFLOW,
}


class Split:
    """A problem with parts, bound to machine code over float or `numpy.longdouble`."""

    def __init__(self, problem: Problem, tolerance: float, number: type = float) -> None:
        assert problem.parts is not None
        self.parts: Parts = problem.parts
        p = parameter_array(problem)
        self.number = number
        self.epsilon = float(np.finfo(number).eps)
        self.p = p.astype(number)
        self.address = self.p.ctypes.data
        self.dimension = problem.dimension
        # Rates of relaxation, the largest one and the least one of the averaged motion.
        self.strength = self.parts.strength(p.tolist())
        self.forgetting = self.parts.forgetting(p.tolist())
        # The square of the least rate that counts.
        self.floor = _SHEAR * self.strength
        self.speed = self.parts.rate(FLOAT)
        means = number is float and self.parts.restored and self.strength < _STRONG
        self.scheme = PARALLEL if means else ABA
        # The angle of a step, in rad, whose widest fast flow is still within its reach.
        self.widest = _WIDEST * self.parts.reach / self.scheme.widest
        self.planner = Planner(self, tolerance)

    @cached_property
    def kernels(self) -> Kernels:
        """The machine code, compiled at first use."""
        return kernels(self.parts, self.dimension, self.number, self.scheme.chains)

    def rate(self, state: np.ndarray) -> float:
        """Rate of the fast angle, no less than the least one that counts."""
        speed = self.speed(state.tolist(), self.p)
        return sqrt(speed * speed + self.floor)

    def numbers(self, values: Any) -> np.ndarray:
        """Numbers as machine code takes them; the same array if it is one already."""
        if values.dtype.type is np.dtype(self.number).type and values.flags.c_contiguous:
            return values
        # Rows that are not filled yet may hold what looks like signalling NaNs.
        with np.errstate(invalid="ignore"):
            return np.ascontiguousarray(values, self.number)

    def marks(self, record: Record) -> list[float]:
        """Times at which the plan is made anew in any case."""
        begin = float(record.times[0])
        length = float(record.times[-1] - record.times[0])
        # A body that starts from rest will turn as the shear makes it.
        rate = max(self.rate(record.start), _SHEAR * min(1.0, self.strength * length))
        least = _LEAST_BETWEEN * 2 * pi / rate
        return [begin + share * length for share in _AGAIN if share * length > least]

    def run(self, record: Record) -> Outcome:
        """Fill the record's rows."""
        if not self.strength > 0:
            return self.free(record)
        work = record.work
        marks = self.marks(record)
        width = _WIDTH if marks else inf
        state = record.start.astype(self.number)
        run_clock = clock(float(record.times[0]), self.number)
        times = self.numbers(record.times)
        rows = self.numbers(record.rows)
        plan = None
        law = ()
        # As if a pause had just ended: the first plan is made.
        code = Code.PAUSED
        while code != Code.FINISHED:
            if code in (Code.PAUSED, Code.OUTSIDE):
                now = now_of(run_clock)
                rate = self.rate(state)
                before = plan
                plan = self.planner.plan(plan, state, float(now), record)
                if plan is not before:
                    run_clock[: ClockAt.FILLED] = clock(now, self.number)[: ClockAt.FILLED]
                run_clock[ClockAt.UNTIL] = next((mark for mark in marks if mark > now), inf)
                law = plan.law((rate / width, rate * width))
                width = width * _WIDER
            limit = min(
                record.chunk(_MAX_STEPS_PER_CALL), record.max_steps - int(run_clock[ClockAt.STEPS])
            )
            code = self.advance(law, state, run_clock, times, rows, limit=limit)
            record.put(rows[record.filled : int(run_clock[ClockAt.FILLED])])
            work.steps = int(run_clock[ClockAt.STEPS])
            record.now = float(now_of(run_clock))
            if code == Code.STEPS_DONE and (stopped := record.stopped):
                return stopped
            if code in _FAILED:
                return _FAILED[code], f"after {work.steps} steps"
        return Status.REACHED_END, ""

    def advance(self, law: Sequence[float], *arrays: np.ndarray, limit: int) -> int:
        """Advance state and clock until rows at times are filled, or a limit is met; the `Code`.

        The arrays are state, clock, times and rows, as in `Kernels.advance`.
        """
        state, run_clock, times, rows = arrays
        run_clock[ClockAt.LIMIT] = limit
        run_clock[ClockAt.ROWS] = len(times)
        law_numbers = np.array(law, self.number)
        rests = np.empty_like(times)
        scheme = self.scheme.addresses[self.number]
        self.kernels.advance(
            scheme, law_numbers, self.address, state, run_clock, times, rests, rows
        )
        return int(run_clock[ClockAt.CODE])

    def free(self, record: Record) -> Outcome:
        """Fill the record's rows by the fast flow alone, modulo whole turns, all rows at once."""
        state = record.start.astype(self.number)
        times = record.times.astype(self.number)
        rate = self.parts.rate(ARRAYS)(state, self.p)
        # 2π of the type of number.
        turn = 8 * np.arctan(self.number(1))
        left = times[1:] - times[0]
        left -= np.floor(left * rate / turn) * (turn / rate) if rate > 0 else 0.0
        # Equal flows, each within the reach of one, lead over what is left of a turn.
        substeps = int(turn / self.parts.reach) + 1
        fast = self.parts.fast
        flow = fast.flow(ARRAYS)
        constants = fast.constants(self.p, left / substeps, ARRAYS)
        for _ in range(substeps):
            state = flow(state, constants)
        record.put(np.stack(np.broadcast_arrays(*state), axis=1))
        record.work.steps = 1
        return Status.REACHED_END, ""


def now_of(run_clock: np.ndarray) -> Any:
    """The time on a clock."""
    return run_clock[ClockAt.BEGIN] + run_clock[ClockAt.SINCE] * run_clock[ClockAt.STEP]


class Splitting(Solver):
    """Exact rotation and exact relaxation in turns, by a mean of eight compositions of four relaxations each.

    Where relaxation is fast, one composition serves. Class: compositions for nearly integrable
    systems, each in a SIMD lane; torque-free motion is exact at any step. The step follows from the
    tolerance by a law, and from checks by two step sizes: at the beginning and, on longer runs,
    where the rate has changed and at shares of the run. Stability: unconditional in the relaxation
    but for short backward ones. The angle bounds the step: at small St, where relaxation outpaces
    the rotation, steps are as short as an explicit method's. Tolerance: error of L/I_e over the
    whole run, however long; orientation errs by that times the angle turned. Caveat: what
    lingers at a saddle amplifies errors after the check; L of a body that tumbles for ever sways
    with its orientation, and errs with that. Error per rotation over tolerance: at most 10; 2
    measured. Source: for one composition, Blanes, Casas, Farrés, Laskar, Makazaga and Murua, Appl.
    Numer. Math. 68 (2013) 58.
    """

    name = "splitting"
    summary = "exact rotation and exact relaxation in turns, for nearly torque-free spheroids"
    accepts = "forms that state their parts: spheroid-axis"
    library = "llvmlite"
    package = "llvmlite"
    family = "polhode"
    many_periods = True
    backends = ("compiled",)
    error_constant = 10.0
    number: ClassVar[type] = float

    def check(self, problem: Problem) -> None:
        """Refuse a problem that states no parts."""
        super().check(problem)
        if problem.parts is None:
            condition = f"{problem.name!r} states no parts with exact flows"
            raise SolverNotValidError(
                f"{condition}; use form 'spheroid-axis' or solver 'taylor'", self.name
            )

    def bound(self, problem: Problem, tolerance: float) -> Any:
        """The problem bound to machine code, whose `run` fills a record."""
        split = Split(problem, tolerance, self.number)
        _ = split.kernels
        return split

    def prepare(self, problem: Problem, settings: Settings) -> Integrator:
        """Compile the kernels, once per parts."""
        bound = self.bound(problem, settings.tolerance)

        def integrate(record: Record) -> Outcome:
            with FlushedToZero():
                return bound.run(record)

        return integrate


class SplittingExtended(Splitting):
    """`Splitting` in x86's long double: for orientations of long runs, tighter than rounding to double lets them be.

    By one composition, of order (10, 6, 4), each of whose flows takes some four times as long. Rows
    are rounded to double, which is how exactly the start is known.
    """

    name = "splitting-extended"
    summary = "splitting in long double, for tight orientations after many turns"
    number = np.longdouble

    @property
    def why_not(self) -> str | None:
        """The missing part, NumPy's long double of x86 processors or the library.

        None if none is missing.
        """
        if not long_double.IS_X86:
            return "x86's long double of 80 bits is missing, on this machine or in NumPy"
        return super().why_not
