"""The solver contract: what a solver receives, what it returns, who counts what."""

import tomllib
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from functools import cache
from importlib import import_module
from math import inf
from numbers import Real
from pathlib import Path
from time import perf_counter
from typing import Any, ClassVar, Literal

import numpy as np

from polhode.models.former import Former, rename_former
from polhode.models.libraries import IMPORTS, how_to_install, installed
from polhode.models.own_function import OwnField
from polhode.models.problem import Problem
from polhode.solvers.event_search import Between, EventFailedError, EventSearch

Backend = Literal["compiled", "numba", "python"]
Jacobian = Literal["exact", "difference"]

# More steps than any run takes.
UNLIMITED = 10**9
# Seconds before its deadline from which on a run looks at the clock more often. A solver's usual
# chunk of steps takes some 0.02 to 0.1 s, so that a short time limit would pass within one.
_NEAR = 0.05
# By this factor chunks are shorter then: some 1 to 6 ms. An estimate: a run passes its limit by as much.
_OFTEN = 16

# A run crawls if its steps are shorter than this share of the longest before, and if more than
# `_MAX_STEPS_AHEAD` are left: minutes of compiled code. Relaxation oscillations shrink their steps
# as far, for a few steps. The share is an estimate: with the other bound beside it, no run is stopped
# that would end within minutes.
_CRAWLING = 1e-3
_MAX_STEPS_AHEAD = 1e8
# Steps count as shrunk below this share of the longest before, by estimate. A run of a user's
# function with such steps is examined: it may have stepped over a singularity
# (`solvers.singularity.jumped`). A larger share costs more runs that time.
_SHRUNK = 0.1

# Library that a choice of back end or Jacobian needs besides the solver's own: llvmlite, which compiles.
_NEEDS = {"compiled": "llvmlite", "numba": "llvmlite", "exact": "llvmlite"}


class Status(StrEnum):
    """How a run ended. Only `REACHED_END` counts as success; every other value keeps its row in every table."""

    REACHED_END = "reached_end"
    STEP_LIMIT = "step_limit"
    TIME_LIMIT = "time_limit"
    STEP_UNDERFLOW = "step_underflow"
    NON_FINITE = "non_finite"
    TOLERANCE_UNATTAINABLE = "tolerance_unattainable"
    ADAPTER_MISSING = "adapter_missing"
    FALSE_SUCCESS = "false_success"
    CRASHED = "crashed"
    INTERRUPTED = "interrupted"

    @property
    def success(self) -> bool:
        """Whether the run counts."""
        return self is Status.REACHED_END

    @property
    def meaning(self) -> str:
        """Its meaning and usual causes."""
        return _meanings()[self]


@cache
def _meanings() -> dict[str, str]:
    return tomllib.loads(Path(__file__).with_name("statuses.toml").read_text(encoding="utf-8"))


class SolverNotValidError(ValueError):
    """A problem or a setting lies outside what a solver accepts; the reason names it and what was expected."""

    def __init__(self, reason: str, solver: str = "") -> None:
        super().__init__(reason, solver)
        self.reason = reason
        self.solver = solver

    def __str__(self) -> str:
        """The message: solver and reason."""
        return (f"solver {self.solver!r}: " if self.solver else "") + self.reason


@dataclass
class Work:
    """Work done; counts that the library does not report stay None."""

    rhs_calls: int | None = None  # those for finite-difference Jacobians included
    steps: int | None = None
    rejected: int | None = None  # steps; by splitting and stroboscopic those of check runs too
    jacobians: int | None = None
    factorizations: int | None = None  # of the iteration matrix
    # Micro-steps of a method whose steps are made of them (stroboscopic averaging).
    inner: int | None = None

    def add(self, other: "Work") -> None:
        """Add the work of a further segment of the run; a count that is None in one of them stays None."""
        for name in vars(self):
            mine = getattr(self, name)
            more = getattr(other, name)
            setattr(self, name, None if mine is None or more is None else mine + more)


@dataclass(frozen=True)
class Settings:
    """Settings of a run by a solver, besides the problem."""

    # Relative tolerance: a number, or one per component where the solver takes that ("rtol vector"
    # in `Solver.tolerances`).
    rtol: float | tuple[float, ...]
    # How the right-hand side is evaluated: by machine code in a loop without Python ("compiled"),
    # machine code that a loop in Python calls ("numba", after the library that once made it), or
    # plain Python.
    backend: Backend
    # How implicit solvers get the Jacobian: "exact" by automatic differentiation of the vector
    # field, "difference" by the library's finite differences.
    jacobian: Jacobian = "exact"
    # Whether right-hand sides are counted. It costs time, so that timed runs leave it off.
    count: bool = False
    # Absolute tolerance: a number, or one per component; by default `rtol`.
    atol: float | tuple[float, ...] | None = None
    max_step: float = inf  # largest step, in the problem's time
    first_step: float | None = None  # by default the library's guess
    # The one tolerance of a run whose relative and absolute ones are equal; else the least relative
    # one. It is computed once, as a run reads it several times.
    tolerance: float = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        least = min(self.rtol) if isinstance(self.rtol, tuple) else self.rtol
        object.__setattr__(self, "tolerance", least)
        if self.atol is None:
            object.__setattr__(self, "atol", self.rtol)

    def at(self, tolerance: float) -> "Settings":
        """The same with one tolerance for both."""
        return replace(self, rtol=tolerance, atol=tolerance)

    def rtols(self) -> np.ndarray:
        """Relative tolerances, shape () or (d,)."""
        return np.array(self.rtol, dtype=float)

    def atols(self) -> np.ndarray:
        """Absolute tolerances, shape () or (d,)."""
        return np.array(self.atol, dtype=float)


@dataclass
class Record:
    """The rows of a segment of a run, which a solver fills one by one, so that finished ones are never lost."""

    # Requested times, shape (n,), increasing.
    times: np.ndarray
    # States at these times, shape (n, d): the first row is the start, the solver fills the others.
    rows: np.ndarray
    deadline: float = inf  # reading of `time.perf_counter` after which the solver stops
    max_steps: int = UNLIMITED  # for this segment
    filled: int = 1  # number of rows filled so far, the start included
    work: Work = field(default_factory=Work)
    # Time that the solver has reached, for observers; it may lie beyond the last row filled.
    now: float = -inf
    # One unit of these times in units of the run's time: segments may have a unit of their own.
    unit: float = 1.0
    looked: tuple[int, float] | None = None  # steps and time at the last call of `crawls`
    # Largest mean step, from the start up to one of the calls of `crawls`.
    longest: float = 0.0
    shrunk: bool = False  # whether steps became much shorter than `longest`
    events: EventSearch | None = None  # what to look for at every step
    # Times and states of the solver's own steps, if they are requested; `Solver.shows_steps` says
    # which solvers note them.
    taken: list[tuple[float, np.ndarray]] | None = None
    # Values of the last parameters in this interval, where they change on the way
    # (`polhode.models.problem.ParameterTable`).
    changed: np.ndarray | None = None
    # Whether the start is the end of an interval before, so that CyRK need not examine its rates.
    goes_on: bool = False
    # The record of the last interval begun, where a parameter table cuts this one into intervals.
    inner: "Record | None" = None

    @property
    def reached(self) -> float:
        """Time reached so far, in the run's unit: of the last row, or of the solver if later."""
        if self.inner is not None:
            return self.inner.reached
        return self.unit * max(self.now, float(self.times[self.filled - 1]))

    @property
    def start(self) -> np.ndarray:
        """State at the first time."""
        return self.rows[0]

    def chunk(self, usual: int) -> int:
        """Steps until the deadline is looked at again: fewer if it is near."""
        return usual if self.deadline - perf_counter() > _NEAR else max(1, usual // _OFTEN)

    @property
    def expired(self) -> bool:
        """Whether the time limit has passed."""
        return perf_counter() > self.deadline

    @property
    def stopped(self) -> "Outcome | None":
        """How the segment ends if its steps or the time have reached their limit."""
        steps = self.work.steps or 0
        if steps >= self.max_steps:
            return Status.STEP_LIMIT, f"{steps} steps"
        return (Status.TIME_LIMIT, f"after {steps} steps") if self.expired else None

    def crawls(self, steps: int, time: float) -> "Outcome | None":
        """How the segment ends if steps shrank so far that it would hardly ever end, else None.

        Solvers call it once a chunk, with their steps and time so far. The mean step since the last
        call is compared with the largest mean step from the start up to a call before. A solver
        that chatters about a singularity takes steps of the square of its tolerance.
        """
        begin = float(self.times[0])
        end = float(self.times[-1])
        before = self.looked
        self.looked = (steps, time)
        if before is None:
            return None
        steps_before, time_before = before
        if steps <= steps_before or time < time_before:
            return None
        self.longest = max(self.longest, (time_before - begin) / steps_before)
        step = (time - time_before) / (steps - steps_before)
        self.shrunk = self.shrunk or step < _SHRUNK * self.longest
        if step < _CRAWLING * self.longest and end - time > step * _MAX_STEPS_AHEAD:
            return Status.STEP_UNDERFLOW, f"steps of {step:.1e} at t = {float(time)!r}"
        return None

    def looked_through(self, times: Sequence[float], states: Any, between: Between) -> bool:
        """Look for events at states accepted since the last look; say whether one ends the run."""
        if self.events is None:
            return False
        try:
            return self.events.through(times, states, between)
        except ValueError as error:
            # An error of its own kind: it reaches the caller, where a solver's error is a crash.
            raise EventFailedError(str(error)) from error

    def filled_between(
        self, looks: np.ndarray, reached: float, between: Callable[[np.ndarray], np.ndarray]
    ) -> None:
        """Look for events at times since the last look, and fill the rows up to the time reached.

        `between` interpolates: it gives the states, shape (k, d), at k times.
        """
        self.looked_through(
            looks.tolist(), between(looks), lambda time: between(np.array([time]))[0]
        )
        behind = int(np.searchsorted(self.times, reached, side="right"))
        last = min(self.last_requested, behind)
        if last > self.filled:
            self.put(between(self.times[self.filled : last]))

    @property
    def last_requested(self) -> int:
        """Number of rows to fill: all, or those up to the event that ended the run."""
        ended = self.events.ended if self.events else None
        if ended is None:
            return len(self.times)
        return int(np.searchsorted(self.times, ended, side="right"))

    def put(self, states: np.ndarray) -> None:
        """Add the states, shape (k, d), of the next k times."""
        self.rows[self.filled : self.filled + len(states)] = states
        self.filled += len(states)


# Some of the solvers that call Python, for messages. They stand in one string, as an item of the
# paper depends on each solver whose name alone is a string in code that it uses.
_CALL_PYTHON = "dop853, rk45, radau, bdf, lsoda, cvode-bdf"
# The family of solvers that are not in the catalogue.
OWN = "own"

# How a segment ended, and the reason of a failure.
Outcome = tuple[Status, str]
Integrator = Callable[[Record], Outcome]
NO_RATES: Outcome = Status.NON_FINITE, "rates at the start are no numbers"


def change(parameters: Any, count: int, record: Record) -> None:
    """Set the last of `count` parameters, an array or a list, to `record.changed` if any."""
    if record.changed is not None:
        parameters[count - len(record.changed) : count] = record.changed


def _tolerance(
    name: str, given: float | Sequence[float], *, zero: bool = False
) -> float | tuple[float, ...]:
    """A tolerance as a number or a tuple; `zero` says whether it may be 0.

    A SolverNotValidError names one that is out of range.
    """
    if isinstance(given, float) and 0 < given < inf:
        # The usual one; arrays would cost as much as some steps of a short run.
        return float(given)
    numbers = np.array(given, dtype=float)
    least = numbers >= 0 if zero else numbers > 0
    if not (numbers.ndim < 2 and numbers.size and (np.isfinite(numbers) & least).all()):
        kind = "a finite positive number" if np.ndim(given) == 0 else "finite positive numbers"
        raise SolverNotValidError(f"{name}: got {given!r}, expected {kind}")
    return tuple(numbers.tolist()) if numbers.ndim else float(numbers)


class Solver(ABC):
    """One algorithm of one library.

    1. `prepare` receives the problem and the settings and returns an integrator. It compiles, if need
       be, and caches what it compiled (in `polhode.solvers.compile`), so that a second call is cheap.
    2. The integrator receives a record (start, times, deadline), fills its rows in order, adds its
       work, and returns a status with the reason of a failure. It never raises for a failed
       integration: what it raises is a crash.
    3. It stops by itself soon after the record's deadline and leaves the rows finished so far.
    4. Rows lie on the requested times by the library's own interpolation wherever it has one,
       without changing steps.
    5. The solver counts steps, Jacobians and factorizations as its library reports them; the
       callbacks count right-hand sides, if the settings say so. Counts that the library does not
       report stay None.
    6. A solver has no data of its own; its class says what it is: the import name of its library, the
       package that brings it, the family that it is drawn with; whether it is implicit, switches
       between stiff and non-stiff methods, is of so low an order that tight tolerances take forever,
       or evaluates a closed form.
    7. `error_constant` bounds error / (rotations × tolerance) over ordinary scenes that are not stiff,
       at tolerances from 1e-4 to 1e-10. The error is the largest of L and E, over I_max, and of the
       rotation matrix's entries. The constant is about three times what `tests/solvers/test_tolerance.py`
       measured. A tolerance is each library's own, so that constants differ widely.
    """

    # Attributes that a solver from a plug-in must have.
    required: ClassVar[tuple[str, ...]] = ("name",)
    name: ClassVar[str]
    # For the list of solvers, in a few words: what it is, and which forms it takes if not all.
    summary: ClassVar[str] = ""
    accepts: ClassVar[str] = ""
    library: ClassVar[str] = "numpy"
    package: ClassVar[str] = "numpy"
    also_needs: ClassVar[tuple[str, ...]] = ()  # import names of further libraries
    family: ClassVar[str] = OWN
    implicit: ClassVar[bool] = False
    switching: ClassVar[bool] = False
    low_order: ClassVar[bool] = False
    closed_form: ClassVar[bool] = False
    # Chooses its step over many periods, so that a run of less than a few is not what it is for.
    many_periods: ClassVar[bool] = False
    # Chooses its order by the tolerance: errors of looser runs say little of its own, and steps
    # differ in cost.
    order_by_tolerance: ClassVar[bool] = False
    # Its error of L and E in segments of the full equations, over the error that `hybrid` expects
    # at the same tolerance: 97.5 % of random triaxial bodies stay below this ratio over 2,000
    # turns. It is 1 at least, as later segments may amplify the error; 0 where it is not known.
    error_amplification: ClassVar[float] = 0.0
    backends: ClassVar[tuple[Backend, ...]] = ("numba", "python")
    jacobians: ClassVar[tuple[Jacobian, ...]] = ()
    # Library that each back end and Jacobian needs besides its own, which may bring a compiler.
    choices_need: ClassVar[Mapping[str, str]] = _NEEDS
    error_constant: ClassVar[float]
    # Which tolerances may differ: "atol" from rtol, "rtol vector" by components; "atol 0" where the
    # absolute one may be 0.
    tolerances: ClassVar[tuple[str, ...]] = ()
    # Which of `max_step` and `first_step` the library has.
    limits: ClassVar[tuple[str, ...]] = ()
    # Whether it takes `Record.changed`, parameters that change on the way.
    takes_parameter_table: ClassVar[bool] = False
    # Whether it looks for the record's events at every step; for other solvers, events are sought
    # between rows after the run.
    seeks_events: ClassVar[bool] = False
    # Whether it notes its own steps where the record asks for them.
    shows_steps: ClassVar[bool] = False

    wears = Former("error_amplification")
    takes_segments = Former("takes_parameter_table")

    def __init_subclass__(cls, **keywords: Any) -> None:
        super().__init_subclass__(**keywords)
        rename_former(cls, wears="error_amplification", takes_segments="takes_parameter_table")

    @property
    def available(self) -> bool:
        """Whether it can run here."""
        return self.why_not is None

    @property
    def why_not(self) -> str | None:
        """The library that is missing and how to install it; None if none is."""
        if not installed(self.library):
            return f"{self.package} is not installed: pip install {self.package}"
        for library in self.also_needs:
            if not installed(library):
                return how_to_install(library)
        for backend in self.backends:
            if self.lacks(backend) is None:
                return None
        needed = self.choices_need.get(self.backends[0])
        return how_to_install(needed) if needed else self.lacks(self.backends[0])

    @property
    def note(self) -> str | None:
        """A remark for the list of solvers, although it is installed; None without one."""
        return None

    def load(self) -> None:
        """Import the library, as a run does."""
        with IMPORTS:
            import_module(self.library)

    def settings(
        self,
        tolerance: float | Sequence[float],
        backend: Backend | None = None,
        jacobian: Jacobian | None = None,
        count: bool = False,
        *,
        atol: float | Sequence[float] | None = None,
        max_step: float = inf,
        first_step: float | None = None,
    ) -> Settings:
        """Settings for this solver; a backend or Jacobian not named is the first one installed, or the last offered.

        A SolverNotValidError names a tolerance or limit out of range, a choice not offered, or what
        a choice needs.
        """
        rtol = _tolerance("tolerance", tolerance)
        if isinstance(rtol, tuple) and "rtol vector" not in self.tolerances:
            raise SolverNotValidError(
                f"rtol: got {rtol!r}, expected one number for solver {self.name!r}"
            )
        absolute = (
            rtol if atol is None else _tolerance("atol", atol, zero="atol 0" in self.tolerances)
        )
        if absolute != rtol and "atol" not in self.tolerances:
            raise SolverNotValidError(
                f"atol: got {absolute!r}, expected rtol, {rtol!r}: solver {self.name!r} has one tolerance"
            )
        if max_step != inf:
            self._check_limit("max_step", max_step)
        if first_step is not None:
            self._check_limit("first_step", first_step)
        chosen = (
            self._choose("jacobian", jacobian, self.jacobians)
            if self.jacobians or jacobian
            else "difference"
        )
        offered = self._choose("backend", backend, self.backends)
        return Settings(rtol, offered, chosen, count, absolute, max_step, first_step)

    def _check_limit(self, name: str, limit: float) -> None:
        if not (isinstance(limit, Real) and limit > 0):
            raise SolverNotValidError(f"{name}: got {limit!r}, expected a positive number")
        if name not in self.limits:
            raise SolverNotValidError(
                f"{name}: got {limit!r}, expected none: solver {self.name!r} has no such limit"
            )

    def lacks(self, choice: str) -> str | None:
        """How to install what a back end or Jacobian lacks; None if nothing."""
        needed = self.choices_need.get(choice)
        return (
            f"{needed!r} installed: pip install {needed}"
            if needed and not installed(needed)
            else None
        )

    def _choose(self, kind: str, choice: Any, offered: tuple[Any, ...]) -> Any:
        if choice is None:
            for offer in offered:
                if not self.lacks(offer):
                    return offer
            return offered[-1]
        if choice not in offered:
            expected = ", ".join(offered) or "none"
            raise SolverNotValidError(
                f"{kind}: got {choice!r}, expected one of {expected} for solver {self.name!r}"
            )
        if lacking := self.lacks(choice):
            raise SolverNotValidError(f"{kind}: got {choice!r}, expected {lacking}")
        return choice

    def check(self, problem: Problem) -> None:
        """Refuse what this solver cannot solve: a SolverNotValidError names the condition and what to use instead."""
        if problem.plain and "python" not in self.backends:
            reason = getattr(problem.field, "plain_reason", "")
            condition = f"{reason}; or a solver that calls Python: {_CALL_PYTHON}"
            raise SolverNotValidError(condition, self.name)
        if problem.parameter_table is not None and not self.takes_parameter_table:
            condition = f"{problem.name!r} has a flow that changes in time; use solver 'cyrk-vern8'"
            raise SolverNotValidError(condition, self.name)
        if problem.parameters is None:
            condition = f"{problem.name!r} has no explicit form at St = 0; use solver 'ida' or form 'jeffery'"
            if isinstance(problem.field, OwnField):
                condition = (
                    f"{problem.name!r} has algebraic equations (mass is singular); use solver 'ida'"
                )
            raise SolverNotValidError(condition, self.name)

    def takes(self, problem: Problem) -> bool:
        """Whether this solver can solve a problem."""
        try:
            self.check(problem)
        except SolverNotValidError:
            return False
        return True

    @abstractmethod
    def prepare(self, problem: Problem, settings: Settings) -> Integrator:
        """Compile what is needed for a problem and return the integrator."""

    def bare_call(
        self, problem: Problem, settings: Settings, times: np.ndarray
    ) -> Callable[[], object] | None:
        """The shortest call of the library for the same rows, all else prepared, to compare with; None if not known."""
        return None
