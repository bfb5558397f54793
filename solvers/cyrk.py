"""CyRK's C++ solvers, fed with a numba ``cfunc``: no Python in the loop.

Tolerance: `rtol` = `atol` = tolerance, for the error of a step in the root-mean-square norm. Rows come from each
method's own dense output. Implicit methods use finite differences: the library's C entry takes no Jacobian.

The library's C entry is called through ctypes, as its own numba bridge does; compiling that bridge anew in every
process would take six seconds. It cannot be interrupted, so that a long run goes in pieces of a bounded number of
steps, each starting from the step at which the last one stopped.
"""

import ctypes
from typing import Any, ClassVar

import numpy as np

from polhode.models.problem import Problem
from polhode.solvers.compile import c_callback, parameter_array
from polhode.solvers.contract import Integrator, Outcome, Record, Settings, Solver, Status

# Deadline and Ctrl-C are looked at once per this many steps.
CHUNK = 200_000
MAX_RAM_MB = 2000
DOUBLE = 8

_RIGHT_HAND_SIDE = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_double, ctypes.c_void_p, ctypes.c_void_p)
# CyrkErrorCodes of the library's c_common.hpp.
_STEPS_EXCEEDED = (-52, -53)
_STATUS = {
    -54: Status.STEP_UNDERFLOW,
    -55: Status.STEP_UNDERFLOW,
    -80: Status.STEP_UNDERFLOW,
    -90: Status.STEP_UNDERFLOW,
    -91: Status.STEP_UNDERFLOW,
    -92: Status.STEP_UNDERFLOW,
}


class _Cyrk(Solver):
    accepts = "every form with an explicit vector field"
    library = "CyRK"
    package = "cyrk"
    backends = ("compiled",)
    method: ClassVar[str]

    def prepare(self, problem: Problem, settings: Settings) -> Integrator:
        """Compile the callback, once per field."""
        from CyRK.cy.pyhelpers import find_ode_method_int

        parameters = parameter_array(problem)
        compiled = c_callback(problem.field, problem.dimension, len(parameters))
        method = find_ode_method_int(self.method)
        calls = [0]
        address, keep = compiled.address, None
        if settings.count:
            keep = _counted(address, calls)
            address = ctypes.cast(keep, ctypes.c_void_p).value

        def integrate(record: Record) -> Outcome:
            calls[0] = 0
            outcome = _run(address, method, parameters, settings, record)
            record.work.rhs_calls = calls[0] if keep else None
            return outcome

        return integrate


def _counted(address: int, calls: list[int]) -> Any:
    call = _RIGHT_HAND_SIDE(address)

    @_RIGHT_HAND_SIDE
    def counted(dy: Any, t: float, y: Any, p: Any) -> None:
        calls[0] += 1
        call(dy, t, y, p)

    return counted


def _run(address: int | None, method: int, parameters: np.ndarray, settings: Settings, record: Record) -> Outcome:
    from CyRK.nb import numba_solver as library

    end, dimension = float(record.times[-1]), len(record.start)
    tolerance = np.array([settings.tolerance])
    time, state = float(record.times[0]), record.start.copy()
    steps = 0
    while True:
        wanted = np.ascontiguousarray(record.times[record.filled :])
        result = library.c_numba_cysolve_ivp(
            address,
            time,
            end,
            state.ctypes.data,
            dimension,
            method,
            0,
            0,
            parameters.ctypes.data,
            parameters.size * DOUBLE,
            min(CHUNK, settings.max_steps - steps),
            MAX_RAM_MB,
            False,
            wanted.ctypes.data,
            wanted.size,
            None,
            None,
            0,
            tolerance.ctypes.data,
            1,
            tolerance.ctypes.data,
            1,
            np.inf,
            0.0,
            True,
        )
        try:
            size, code = library.c_get_size(result), library.c_get_status(result)
            steps += library.c_get_steps(result)
            record.work.steps = steps
            if size:
                rows = np.ctypeslib.as_array(library.c_get_y_ptr(result), (size, dimension))
                record.put(rows[: len(wanted)])
            reached = library.c_get_t_now(result)
            state = np.ctypeslib.as_array(library.c_get_y_now(result), (dimension,)).copy()
        finally:
            library.c_free(result)
        if code > 0:
            return Status.REACHED_END, f"code {code}"
        if not np.all(np.isfinite(state)):
            return Status.NON_FINITE, f"code {code}"
        if code not in _STEPS_EXCEEDED:
            return _STATUS.get(code, Status.NON_FINITE), f"code {code}"
        if steps >= settings.max_steps:
            return Status.STEP_LIMIT, f"{settings.max_steps} steps"
        if record.expired:
            return Status.TIME_LIMIT, f"after {steps} steps"
        time = float(reached)


class Vern8(_Cyrk):
    """Verner's explicit Runge-Kutta pair of order 8(7), the "efficient" one; not for stiff problems.

    Source: Verner, Numerical Algorithms 53 (2010) 383.
    """

    name = "cyrk-vern8"
    summary = "Verner's explicit Runge-Kutta 8(7), compiled (CyRK)"
    method = "Vern8"


class Vern7(_Cyrk):
    """Verner's explicit Runge-Kutta pair of order 7(6), the "efficient" one; not for stiff problems.

    Source: Verner, Numerical Algorithms 53 (2010) 383.
    """

    name = "cyrk-vern7"
    summary = "Verner's explicit Runge-Kutta 7(6), compiled (CyRK)"
    method = "Vern7"


class Dop853(_Cyrk):
    """Explicit Runge-Kutta of order 8(5,3), compiled; not for stiff problems.

    Source: Hairer, Nørsett, Wanner, Solving Ordinary Differential Equations I, section II.5.
    """

    name = "cyrk-dop853"
    summary = "explicit Runge-Kutta 8(5,3), compiled (CyRK)"
    method = "DOP853"


class Tsit5(_Cyrk):
    """Tsitouras' explicit Runge-Kutta pair of order 5(4), compiled; not for stiff problems.

    Source: Tsitouras, Comput. Math. Appl. 62 (2011) 770.
    """

    name = "cyrk-tsit5"
    summary = "Tsitouras' explicit Runge-Kutta 5(4), compiled (CyRK)"
    method = "Tsit5"


class Lsoda(_Cyrk):
    """Adams methods or backward differentiation, chosen as stiffness comes and goes, compiled.

    Source: Petzold, SIAM J. Sci. Stat. Comput. 4 (1983) 136.
    """

    name = "cyrk-lsoda"
    summary = "Adams or BDF, switching by itself, compiled (CyRK)"
    implicit = True
    jacobians = ("difference",)
    method = "LSODA"


class Bdf(_Cyrk):
    """Backward differentiation formulas of order 1 to 5 with quasi-constant steps, compiled; for stiff problems.

    Source: Shampine and Reichelt, SIAM J. Sci. Comput. 18 (1997) 1.
    """

    name = "cyrk-bdf"
    summary = "backward differentiation formulas of order 1 to 5, compiled (CyRK)"
    implicit = True
    jacobians = ("difference",)
    method = "BDF"


class Radau(_Cyrk):
    """Implicit Runge-Kutta of Radau IIA type, order 5, L-stable, compiled; its dense output is of order 3.

    Source: Hairer and Wanner, Solving Ordinary Differential Equations II, section IV.8.
    """

    name = "cyrk-radau"
    summary = "implicit Runge-Kutta Radau IIA of order 5, compiled (CyRK)"
    implicit = True
    jacobians = ("difference",)
    method = "RADAU"
