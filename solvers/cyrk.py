"""CyRK's C++ solvers, fed with a field in machine code: no Python in the loop.

Tolerance: `rtol` = `atol` = tolerance, for the error of a step in the root-mean-square norm. Rows come from each
method's own dense output. Implicit methods use finite differences: the library's C entry takes no Jacobian. It reports
nothing but steps.

The library's C entry is called through ctypes, as its own numba bridge does; compiling that bridge anew in every
process would take six seconds. It cannot be interrupted, so that a long run goes in pieces of a bounded number of
steps, each starting from the step at which the last one stopped. While it runs, numbers below 2e-308 count as zero.
"""

import ctypes
from collections.abc import Callable
from typing import Any, ClassVar

import numpy as np

from polhode.models.problem import Problem
from polhode.solvers.compile import c_callback, parameter_array
from polhode.solvers.contract import Integrator, Outcome, Record, Settings, Solver, Status
from polhode.solvers.cyrk_library import load_cyrk
from polhode.solvers.machine_code.underflow import FlushedToZero

# Deadline and Ctrl-C are looked at once per this many steps: a tenth of a second at most.
CHUNK = 20_000
MAX_RAM_MB = 2000

# CyrkErrorCodes of the library's c_common.hpp.
_STEPS_EXCEEDED = (-52, -53)
_UNDERFLOW = (-54, -55, -80, -90, -91, -92)


class CyrkSolver(Solver):
    """A method of CyRK: one call of machine code, and counting."""

    accepts = "every form with an explicit vector field"
    library = "CyRK"
    package = "cyrk"
    family = "CyRK"
    backends = ("compiled",)
    method: ClassVar[str]

    def load(self) -> None:
        """Import the library's C functions."""
        load_cyrk()

    def prepare(self, problem: Problem, settings: Settings) -> Integrator:
        """Compile the callback, once per field."""
        parameters, method = parameter_array(problem), method_number(self.method)
        address = c_callback(problem.field, problem.dimension, len(parameters), count=settings.count).address
        if not settings.count:
            call = Call(address, method, parameters, settings.tolerance)
            return lambda record: _run(call, record)
        calls = np.zeros(1, dtype=np.int64)
        counted = np.append(parameters, np.array([calls.ctypes.data]).view(float))
        call = Call(address, method, counted, settings.tolerance)

        def integrate(record: Record) -> Outcome:
            calls[0] = 0
            outcome = _run(call, record)
            record.work.rhs_calls = int(calls[0])
            return outcome

        return integrate

    def bare_call(self, problem: Problem, settings: Settings, times: np.ndarray) -> Callable[[], object] | None:
        """CyRK's C entry with these times; its rows stay there."""
        parameters = parameter_array(problem)
        address = c_callback(problem.field, problem.dimension, len(parameters)).address
        call = Call(address, method_number(self.method), parameters, settings.tolerance)
        start, end, wanted = np.array(problem.start), float(times[-1]), times[1:]
        return lambda: call.library.c_free(call(0.0, end, start, wanted, 10**9))


class ImplicitCyrkSolver(CyrkSolver):
    """An implicit method of CyRK."""

    implicit = True
    jacobians = ("difference",)


def method_number(name: str) -> int:
    """The library's number of a method."""
    load_cyrk()
    from CyRK.cy.pyhelpers import find_ode_method_int

    return find_ode_method_int(name)


class Call:
    """The library's C entry with everything bound but the piece to run.

    Parameters
    ----------
    address : int
        Of the right-hand side, ``void(double *dy, double t, double *y, double *p)``.
    method : int
        The library's number of the method.
    parameters : ndarray
    tolerance : float
    """

    def __init__(self, address: int, method: int, parameters: np.ndarray, tolerance: float) -> None:
        self.library = load_cyrk()
        self.address, self.method = address, method
        self.parameters, self.tolerance = parameters, np.array([tolerance])

    def __call__(self, start: float, end: float, state: np.ndarray, times: np.ndarray, max_steps: int) -> Any:
        """Run; the pointer returned is to be freed by ``library.c_free``."""
        tolerance = self.tolerance.ctypes.data
        return self.library.c_numba_cysolve_ivp(
            self.address,
            start,
            end,
            state.ctypes.data,
            state.size,
            self.method,
            0,  # expected size: the library's guess
            0,  # extra outputs
            self.parameters.ctypes.data,
            self.parameters.nbytes,
            max_steps,
            MAX_RAM_MB,
            False,  # dense output is used, not kept
            times.ctypes.data,
            times.size,
            None,  # no function before the right-hand side
            None,  # no events
            0,
            tolerance,
            1,
            tolerance,
            1,
            np.inf,  # largest step
            0.0,  # first step: the library's guess
            True,  # keep what `c_get_y_now` reads
        )


def _run(call: Call, record: Record) -> Outcome:
    library, dimension, work = call.library, len(record.start), record.work
    end, time, state = float(record.times[-1]), float(record.times[0]), record.start
    steps = 0
    while True:
        wanted = record.times[record.filled :]
        with FlushedToZero():
            result = call(time, end, state, wanted, min(CHUNK, record.max_steps - steps))
        try:
            size, code = library.c_get_size(result), library.c_get_status(result)
            steps += library.c_get_steps(result)
            work.steps = steps
            if size:
                record.put(_array(library.c_get_y_ptr(result), size * dimension).reshape(size, dimension))
            time = record.now = library.c_get_t_now(result)
            state = _array(library.c_get_y_now(result), dimension)
        finally:
            library.c_free(result)
        if code > 0:
            return Status.REACHED_END, ""
        if not np.isfinite(state).all():
            return Status.NON_FINITE, f"code {code}"
        if code not in _STEPS_EXCEEDED:
            return Status.STEP_UNDERFLOW if code in _UNDERFLOW else Status.NON_FINITE, f"code {code}"
        if steps >= record.max_steps:
            return Status.STEP_LIMIT, f"{steps} steps"
        if record.expired:
            return Status.TIME_LIMIT, f"after {steps} steps"


def _array(pointer: Any, size: int) -> np.ndarray:
    """Copy of the library's memory, which lives no longer than its result."""
    return np.array((ctypes.c_double * size).from_address(ctypes.addressof(pointer.contents)))


class Vern8(CyrkSolver):
    """Verner's explicit Runge-Kutta pair of order 8(7), the "efficient" one; not for stiff problems.

    A step with a row inside costs more right-hand sides; where the field has kinks, it notices late.
    Source: Verner, Numerical Algorithms 53 (2010) 383.
    """

    name = "cyrk-vern8"
    summary = "Verner's explicit Runge-Kutta 8(7), compiled (CyRK)"
    method = "Vern8"
    error_constant = 600.0  # 193 measured


class Vern7(CyrkSolver):
    """Verner's explicit Runge-Kutta pair of order 7(6), otherwise as `Vern8`."""

    name = "cyrk-vern7"
    summary = "Verner's explicit Runge-Kutta 7(6), compiled (CyRK)"
    method = "Vern7"
    error_constant = 200.0  # 65 measured


class Tsit5(CyrkSolver):
    """Explicit Runge-Kutta pair of order 5(4), low for tolerances below 1e-6; not for stiff problems.

    Source: Tsitouras, Comput. Math. Appl. 62 (2011) 770.
    """

    name = "cyrk-tsit5"
    summary = "Tsitouras' explicit Runge-Kutta 5(4), compiled (CyRK)"
    method = "Tsit5"
    low_order = True
    error_constant = 400.0  # 106 measured


class Dop853(CyrkSolver):
    """The compiled twin of `polhode.solvers.scipy_ivp.Dop853`."""

    name = "cyrk-dop853"
    summary = "explicit Runge-Kutta 8(5,3), compiled (CyRK)"
    method = "DOP853"
    error_constant = 150.0  # 59 measured


class Lsoda(ImplicitCyrkSolver):
    """The compiled twin of `polhode.solvers.scipy_ivp.Lsoda`; starts anew, at order 1, after every piece of a run."""

    name = "cyrk-lsoda"
    summary = "Adams or BDF, switching by itself, compiled (CyRK)"
    method = "LSODA"
    switching = True
    error_constant = 300.0  # 86 measured


class Bdf(ImplicitCyrkSolver):
    """The compiled twin of `polhode.solvers.scipy_ivp.Bdf`; starts anew, at order 1, after every piece of a run."""

    name = "cyrk-bdf"
    summary = "backward differentiation formulas of order 1 to 5, compiled (CyRK)"
    method = "BDF"
    low_order = True
    error_constant = 2500.0  # 833 measured


class Radau(ImplicitCyrkSolver):
    """The compiled twin of `polhode.solvers.scipy_ivp.Radau`; a Jacobian costs one right-hand side per component."""

    name = "cyrk-radau"
    summary = "implicit Runge-Kutta Radau IIA of order 5, compiled (CyRK)"
    method = "RADAU"
    low_order = True
    error_constant = 10.0  # 2 measured
