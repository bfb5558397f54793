"""CyRK's C++ solvers, fed with a field in machine code: no Python in the loop.

Tolerance: `rtol` and `atol`, one number for both unless told otherwise, for the error of a step in
the root-mean-square norm; both may have one number per component. Rows come from each method's own
dense output. Implicit methods take the exact Jacobian through the library's C++ entry, where that is
found (Linux on x86-64, versions 0.20). The C entry takes none: with it the library differences the
field. The library counts steps and nothing else.

The library's C entry is called through ctypes, as its own numba bridge does; compiling that bridge
anew in every process would take six seconds. A call cannot be interrupted. So a long run is made of
calls of at most `_CHUNK` steps; each goes on where the one before stopped. While a call runs, numbers
below 2e-308 count as zero.
"""

import ctypes
import importlib.util
import platform
import sys
import tomllib
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from enum import IntEnum
from importlib.metadata import version
from itertools import cycle
from math import hypot, inf, nan
from pathlib import Path
from types import SimpleNamespace
from typing import Any, ClassVar

import numpy as np

from polhode.models.libraries import IMPORTS, installed
from polhode.models.once import once
from polhode.models.problem import Problem
from polhode.models.spent import spent_on
from polhode.solvers.catalogue import methods
from polhode.solvers.compile import c_callback, c_jacobian, parameter_array
from polhode.solvers.contract import (
    UNLIMITED,
    Integrator,
    Outcome,
    Record,
    Settings,
    Solver,
    Status,
    change,
)
from polhode.solvers.event_search import LOOK_GROWTH, looks
from polhode.solvers.machine_code.address import address_of
from polhode.solvers.machine_code.llvm import MachineCode
from polhode.solvers.machine_code.underflow import FlushedToZero

# Steps after which deadline and Ctrl-C are looked at. An estimate: they take some 0.02 to 0.1 s with the
# forms of the equations, longer with a field that costs more.
_CHUNK = 20_000
# Steps before the first look for events; from look to look there are more of them, up to `_CHUNK`. An
# estimate: a terminal event soon after the start costs as many steps.
_FIRST_LOOK = 256
# Where events are sought, a call that was cut short is run again, up to the first of these shares of its steps that
# succeeds. Estimates: behind that share, events are placed on straight lines.
_SHARES = (1.0, 0.98, 0.9, 0.5)
# Steps after which the path in `followed` ends. An estimate: averaged equations take far fewer, and where
# they do not, averaging breaks down.
_MOST_STEPS = 2000
# Memory that a call may take, in MB: the library's own default. A call that would take more ends
# (`MAX_STEPS_SYSARCH_EXCEEDED`), and the next call goes on.
_MAX_RAM_MB = 2000
# Norm of the rates over the tolerated errors up to which its square is finite, below 1.8e308.
_LARGEST_NORM = 1.3e154


class _Code(IntEnum):
    """Codes by which the library says why an integration stopped early (CyrkErrorCodes, c_common.hpp).

    Positive codes are success. A failure not listed, such as one of set-up or memory, is reported as
    `NON_FINITE`, with the code.
    """

    MAX_STEPS_USER_EXCEEDED = -52
    MAX_STEPS_SYSARCH_EXCEEDED = -53
    STEP_SIZE_ERROR_SPACING = -54
    STEP_SIZE_ERROR_ACCEPTANCE = -55
    BAD_INITIAL_STEP_SIZE = -80
    JACOBIAN_IS_SINGULAR = -90
    NEWTON_CONVERGENCE_ERROR = -91
    LSODA_INTERNAL_ERROR = -92


_STEPS_EXCEEDED = (_Code.MAX_STEPS_USER_EXCEEDED, _Code.MAX_STEPS_SYSARCH_EXCEEDED)
# Steps become too small, or none can be taken: all other codes of `_Code`.
_UNDERFLOW = tuple(code for code in _Code if code not in _STEPS_EXCEEDED)
# Versions whose C functions have the signatures stated here; of others the package itself is
# imported.
_KNOWN = ("0.20.",)

# The C++ function `baseline_cysolve_ivp` under the name that compilers for Linux give it, with the
# types of its arguments; another version's, with others, has another name and is not found.
_WITH_JACOBIAN = (
    "_Z20baseline_cysolve_ivpPFvPddS_PcPFvS0_dS_S0_EEddRSt6vectorIdSaIdEE9ODEMethodmm"
    "RS5_IcSaIcEEmmbS8_S2_RS5_I5EventSaISD_EES8_S8_ddbS4_"
)

# A vector of C++ on x86-64: three addresses of 8 bytes, as `_vector` has them.
_ADDRESS_BYTES = 8
_VECTOR_BYTES = 3 * _ADDRESS_BYTES
# Types that ctypes has no name for, by their names in cyrk.toml.
_TYPES = {"nothing": None, "doubles": ctypes.POINTER(ctypes.c_double)}
# The function that the library calls: rates, time, state and parameters.
_FIELD = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_double, ctypes.c_void_p, ctypes.c_void_p)


@once()
@spent_on("import")
def load_cyrk() -> Any:
    """The library's C functions, as its bridge to numba names them, without the 0.3 s that numba takes to import."""
    if version("CyRK").startswith(_KNOWN):
        with suppress(ImportError, AttributeError):
            return SimpleNamespace(**_functions())
    with IMPORTS:
        from CyRK.nb import numba_solver

    return numba_solver


def _functions() -> dict[str, Any]:
    _announce()
    with IMPORTS:
        from CyRK._cpu_check import check_cpu

    check_cpu()
    with IMPORTS:
        import CyRK.nb.numba_c_api as addresses

    def function(address: str, *types: str) -> Any:
        known = [_TYPES[name] if name in _TYPES else getattr(ctypes, name) for name in types]
        return ctypes.CFUNCTYPE(*known)(getattr(addresses, f"{address}_func_ptr")())

    table = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))
    return {name: function(*signature) for name, signature in table.items()}


@once()
def entry_with_jacobian() -> Callable[..., None] | None:
    """The library's C++ entry that takes a Jacobian; None where it is not found.

    Its first argument is where it writes the pointer to its result, as C++ on x86-64 returns one
    that frees itself. Arrays are vectors of C++, which it copies.
    """
    if sys.platform != "linux" or platform.machine() != "x86_64":
        return None
    spec = importlib.util.find_spec("CyRK")
    if spec is None or spec.origin is None or not version("CyRK").startswith(_KNOWN):
        return None
    # The module that `load_cyrk` imports, without importing it: a list of solvers asks, too.
    modules = list(Path(spec.origin).with_name("nb").glob("numba_c_api*.so"))
    try:
        entry = ctypes.CDLL(str(modules[0]))[_WITH_JACOBIAN]
    except (IndexError, OSError, AttributeError):
        return None
    pointer = ctypes.c_void_p
    number = ctypes.c_double
    size = ctypes.c_size_t
    entry.restype = None
    entry.argtypes = [
        # Result, field, start, end, state.
        *(pointer, pointer, number, number, pointer),
        # Method, expected size, extra outputs, parameters.
        *(ctypes.c_int, size, size, pointer),
        # Limits of steps and memory, dense output, times.
        *(size, size, ctypes.c_bool, pointer),
        # Function before the field, events, relative and absolute tolerances.
        *(pointer, pointer, pointer, pointer),
        # Largest and first step, keep the solver, Jacobian.
        *(number, number, ctypes.c_bool, pointer),
    ]
    return entry


def _vector(array: np.ndarray) -> tuple[int, int, int]:
    """A vector of C++ that shows an array: where it begins, where it ends, where its room ends."""
    begin = address_of(array)
    end = begin + array.nbytes
    return begin, end, end


def _announce() -> None:
    """Enter the package in `sys.modules` without running it, so that single modules of it can be imported.

    The package's own `__init__` imports numba. It runs when something else of the package is used.
    """
    if "CyRK" in sys.modules:
        return
    spec = importlib.util.find_spec("CyRK")
    if spec is None or spec.loader is None:
        raise ModuleNotFoundError("No module named 'CyRK'", name="CyRK")
    package = importlib.util.module_from_spec(spec)
    loader = spec.loader

    def complete(name: str) -> Any:
        vars(package).pop("__getattr__", None)
        loader.exec_module(package)
        return getattr(package, name)

    vars(package)["__getattr__"] = complete
    sys.modules["CyRK"] = package


class CyrkSolver(Solver):
    """A method of CyRK: one call of machine code, and counting."""

    accepts = "every form with an explicit vector field"
    library = "CyRK"
    package = "cyrk"
    family = "CyRK"
    backends = ("compiled",)
    tolerances = ("atol", "atol 0", "rtol vector")
    limits = ("max_step", "first_step")
    seeks_events = True
    takes_parameter_table = True
    method: ClassVar[str]

    def load(self) -> None:
        load_cyrk()

    def lacks(self, choice: str) -> str | None:
        found = choice != "exact" or not installed(self.library) or entry_with_jacobian()
        return super().lacks(choice) or (None if found else "CyRK's C++ entry, of versions 0.20")

    @property
    def note(self) -> str | None:
        """Which way an implicit method gets its Jacobian."""
        if not self.available or "exact" not in self.jacobians:
            return None
        if self.lacks("exact"):
            return "available, Jacobian by finite differences: no C++ entry found"
        return "available, exact Jacobian through the C++ entry"

    def prepare(self, problem: Problem, settings: Settings) -> Integrator:
        calls = np.zeros(1, dtype=np.int64)
        call = self._call(problem, settings, calls)
        count = len(problem.parameters or ())

        def integrate(record: Record) -> Outcome:
            change(call.parameters, count, record)
            if not (record.goes_on or call.begins(record.start, self.switching)):
                return Status.NON_FINITE, "rates at the start are too large beside the tolerance"
            calls[0] = 0
            outcome = _run(call, record)
            record.work.rhs_calls = int(calls[0]) if settings.count else None
            return outcome

        return integrate

    def _call(self, problem: Problem, settings: Settings, calls: np.ndarray) -> "Call":
        parameters = parameter_array(problem)
        code = c_callback(problem.field, problem.dimension, len(parameters), count=settings.count)
        jacobian = None
        if self.implicit and settings.jacobian == "exact":
            jacobian = c_jacobian(problem.field, problem.dimension, len(parameters))
        if settings.count:
            # The address of the counter stands behind the parameters, in the bits of a double.
            parameters = np.append(parameters, np.array([address_of(calls)]).view(float))
        return Call(code, method_number(self.method), parameters, settings, calls, jacobian)

    def bare_call(
        self, problem: Problem, settings: Settings, times: np.ndarray
    ) -> Callable[[], object] | None:
        """One call of CyRK's entry with these times; its rows stay there."""
        call = self._call(problem, replace(settings, count=False), np.empty(0))
        start = np.array(problem.start)
        end = float(times[-1])
        requested = times[1:]
        return lambda: call.library.c_free(call(0.0, end, start, requested, UNLIMITED))


@once()
def method_number(name: str) -> int:
    """The library's number of a method."""
    load_cyrk()
    with IMPORTS:
        from CyRK.cy.pyhelpers import find_ode_method_int

    return find_ode_method_int(name)


class Call:
    """The library's entry with everything bound but the segment to run: field, number of the method, parameters.

    It is the C entry, or with a Jacobian the C++ one.
    """

    def __init__(
        self,
        code: MachineCode,
        method: int,
        parameters: np.ndarray,
        settings: Settings,
        calls: np.ndarray | None = None,
        jacobian: MachineCode | None = None,
    ) -> None:
        self.library = load_cyrk()
        self.flushed_to_zero = FlushedToZero()
        # Number of right-hand sides, shape (1,), which the code counts if it is compiled to.
        self.calls = np.zeros(1, dtype=np.int64) if calls is None else calls
        # The code lives as long as this call, whatever caches do.
        self.code = code
        self.jacobian = jacobian
        self.method = method
        self.parameters = parameters
        self.max_step = settings.max_step
        self.first_step = settings.first_step or 0.0  # 0: the library's guess
        self.rtol = np.array(settings.rtol, dtype=float, ndmin=1)
        same = settings.atol == settings.rtol
        self.atol = self.rtol if same else np.array(settings.atol, dtype=float, ndmin=1)
        # As the library takes them.
        rtol_address = address_of(self.rtol)
        atol_address = rtol_address if same else address_of(self.atol)
        self.tolerances = rtol_address, self.rtol.size, atol_address, self.atol.size
        self.parameters_address = address_of(parameters)

    def begins(self, state: np.ndarray, switching: bool = False) -> bool:
        """Whether rates at a state, shape (d,), have a norm; else the library would look for a step without end.

        LSODA, the method that is `switching`, would not: it needs rates that are finite beside the tolerance.
        """
        rates = np.empty_like(state)
        with self.flushed_to_zero:
            _FIELD(self.code.address)(
                address_of(rates), 0.0, address_of(state), self.parameters_address
            )
        # Tolerances are repeated as one alone counts for all components. In NumPy it would take
        # twice as long.
        rtols = cycle(self.rtol.tolist())
        atols = cycle(self.atol.tolist())
        scaled = []
        for rate, y in zip(rates.tolist(), state.tolist(), strict=True):
            scale = next(atols) + next(rtols) * abs(y)
            scaled.append(rate / scale if scale else inf)
        return hypot(*scaled) < (inf if switching else _LARGEST_NORM)

    def __call__(
        self,
        start: float,
        end: float,
        state: np.ndarray,
        times: np.ndarray,
        max_steps: int,
        first_step: float = 0.0,
        dense: bool = False,
    ) -> Any:
        """Integrate from a state, shape (d,); return a pointer that is to be freed by ``library.c_free``.

        The result has rows at `times`, or at the ends of all steps if there are no times. A
        `first_step` of 0 is the library's guess. `dense` keeps what `c_call_vec` interpolates by.
        """
        if self.jacobian is None:
            return self.library.c_numba_cysolve_ivp(
                *(self.code.address, start, end, address_of(state), state.size),
                # Expected size: the library's guess; extra outputs.
                *(self.method, 0, 0, self.parameters_address, self.parameters.nbytes),
                # Dense output is used, and kept where a run is to be looked through.
                *(max_steps, _MAX_RAM_MB, dense, address_of(times), times.size),
                # No function before the right-hand side, no events.
                *(None, None, 0),
                *self.tolerances,
                # Largest step, first step; keep what `c_get_y_now` reads.
                *(self.max_step, first_step, True),
            )
        # The same through the entry that takes a Jacobian.
        entry = entry_with_jacobian()
        assert entry is not None, "the settings have been checked"
        # The pointer to the result, which the library writes, then six vectors, the one for events
        # empty. One array of numbers costs less than objects of ctypes: 4 µs of the 50 that the
        # shortest runs take.
        passed = np.array(
            [
                0,
                *_vector(state),
                *_vector(self.parameters),
                *_vector(times),
                *_vector(self.rtol),
                *_vector(self.atol),
                *(0, 0, 0),
            ]
        )
        result = address_of(passed)
        first = result + _ADDRESS_BYTES
        vectors = range(first, first + 6 * _VECTOR_BYTES, _VECTOR_BYTES)
        states, parameters, requested, rtols, atols, no_events = vectors
        # The zeros and None are the same as for the C entry above.
        entry(
            *(result, self.code.address, start, end, states, self.method, 0, 0, parameters),
            *(max_steps, _MAX_RAM_MB, dense, requested, None, no_events, rtols, atols),
            *(self.max_step, first_step, True, self.jacobian.address),
        )
        return int(passed[0])


def _run(call: Call, record: Record) -> Outcome:
    """Fill the record's rows, by calls of at most `_CHUNK` steps.

    The first call begins with the `first_step` of the settings. If events are sought, a call gives all its
    steps, and the next one begins with the length of the last step. Otherwise it gives the rows alone, and
    the library guesses the first step of the next call.
    """
    library = call.library
    dimension = len(record.start)
    work = record.work
    end = float(record.times[-1])
    time = float(record.times[0])
    state = record.start
    steps = 0
    # First step of the next call; 0 is the library's guess.
    last_step = call.first_step
    # Steps until the next look.
    look = _CHUNK
    if record.events:
        look = _FIRST_LOOK
    while True:
        requested = np.empty(0) if record.events else record.times[record.filled :]
        chunk = min(record.chunk(look), record.max_steps - steps)
        with call.flushed_to_zero:
            result = call(time, end, state, requested, chunk, last_step, bool(record.events))
        try:
            size = library.c_get_size(result)
            code = library.c_get_status(result)
            steps += library.c_get_steps(result)
            work.steps = steps
            if record.events:
                last_step = _look_through(call, record, result, time, state, last_step)
                look = min(_CHUNK, look * LOOK_GROWTH)
                if record.events.ended is not None:
                    return Status.REACHED_END, ""
            else:
                last_step = 0.0
                if size:
                    rows = _array(library.c_get_y_ptr(result), size * dimension)
                    record.put(rows.reshape(size, dimension))
            time = record.now = library.c_get_t_now(result)
            if code > 0:
                return Status.REACHED_END, ""
            state = _array(library.c_get_y_now(result), dimension)
        finally:
            library.c_free(result)
        if not np.isfinite(state).all():
            return Status.NON_FINITE, f"code {code}"
        if code not in _STEPS_EXCEEDED:
            return (
                Status.STEP_UNDERFLOW if code in _UNDERFLOW else Status.NON_FINITE,
                f"code {code}",
            )
        if stopped := record.stopped or record.crawls(steps, time):
            return stopped


def _look_through(
    call: Call, record: Record, result: Any, time: float, state: np.ndarray, first_step: float
) -> float:
    """Look for events in the steps of a call and fill its rows; return the length of its last step.

    The call has begun at `time` and `state` with `first_step`, which is returned if it took no step.
    """
    library = call.library
    dimension = len(record.start)
    steps = _array(library.c_get_t_ptr(result), library.c_get_size(result))
    if len(steps) < 2:
        return first_step
    size = len(steps) * dimension
    ends = _array(library.c_get_y_ptr(result), size).reshape(len(steps), dimension)
    whole, count = _interpolated(call, result, steps, time, state, first_step)

    # By the library's interpolation as far as that goes, and on straight lines from there on.
    def between(times: np.ndarray) -> np.ndarray:
        times = np.ascontiguousarray(times, dtype=float)
        states = np.full((len(times), dimension), nan)
        library.c_call_vec(whole, address_of(times), len(times), address_of(states))
        for i in np.flatnonzero(times > steps[count - 1]).tolist():
            after = int(np.searchsorted(steps, times[i]))
            share = (times[i] - steps[after - 1]) / (steps[after] - steps[after - 1])
            states[i] = (1 - share) * ends[after - 1] + share * ends[after]
        return states

    try:
        times = np.append(looks(steps[:count]), steps[count:])
        record.filled_between(times, float(steps[-1]), between)
    finally:
        if whole is not result:
            library.c_free(whole)
    return float(steps[-1] - steps[-2])


def _interpolated(
    call: Call, result: Any, steps: np.ndarray, time: float, state: np.ndarray, first_step: float
) -> tuple[Any, int]:
    """A result that interpolates a call, and how many of the call's times, `steps`, it covers.

    The first time is the start; a count of 1 means that nothing can be interpolated. The library
    interpolates only runs that have reached their end. So the steps of a call that was cut short are
    taken again up to where it stopped, or near a singularity up to somewhat before.
    """
    library = call.library
    if library.c_get_status(result) > 0:
        return result, len(steps)
    # The work of steps that are run again is not counted.
    counted = call.calls.copy()
    again = None
    count = 1
    for share in _SHARES:
        count = max(2, int(share * len(steps)))
        with call.flushed_to_zero:
            again = call(time, steps[count - 1], state, np.empty(0), UNLIMITED, first_step, True)
        if library.c_get_status(again) > 0:
            break
        library.c_free(again)
        again = None
    call.calls[:] = counted
    return (again, count) if again else (result, 1)


def followed(problem: Problem, tolerance: float, points: int) -> tuple[np.ndarray, np.ndarray]:
    """About `points` times of a solution, and the states there, shapes (n,) and (n, d).

    Times are dense where the solver's steps are, as `spread_over` says. They end where the solution
    does, or after `_MOST_STEPS` steps. A solution that cannot begin has its start alone.
    """
    call = Vern7()._call(problem, Settings(tolerance, "compiled"), np.empty(0))
    start = np.array(problem.start)
    library = call.library
    if not call.begins(start):
        return np.zeros(1), start[None]

    def run(end: float, requested: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        with call.flushed_to_zero:
            result = call(0.0, end, start, requested, _MOST_STEPS)
        try:
            size = library.c_get_size(result)
            d = start.size
            times = library.c_get_t_ptr(result)
            states = library.c_get_y_ptr(result)
            return _array(times, size), _array(states, size * d).reshape(size, d)
        finally:
            library.c_free(result)

    # Without requested times the library gives the ends of its steps.
    steps, _ = run(problem.end, np.empty(0))
    if len(steps) < 2:
        return np.zeros(1), start[None]
    times, states = run(steps[-1], spread_over(steps, points))
    # The second run may fail, as its last step ends elsewhere: then the start alone is given.
    return (times, states) if len(times) else (np.zeros(1), start[None])


def _array(pointer: Any, size: int) -> np.ndarray:
    """Copy of the library's memory, which lives no longer than its result."""
    return np.array((ctypes.c_double * size).from_address(ctypes.addressof(pointer.contents)))


Vern8, Vern7, Dop853, Tsit5, Lsoda, Bdf, Radau = methods(CyrkSolver)


def spread_over(steps: np.ndarray, points: int) -> np.ndarray:
    """Times with as many in each step as in any other, shape (n,); the last one is the last step's end.

    `steps` holds the start and the ends of k - 1 steps, shape (k,). There are about
    ``points (1 - 1/k)`` times, or k if that is more.
    """
    # Numbers of steps, with fractions where there are fewer steps than points.
    places = np.arange(0, len(steps) - 1, min(1, len(steps) / points))
    return np.append(np.interp(places, np.arange(len(steps)), steps), steps[-1])
