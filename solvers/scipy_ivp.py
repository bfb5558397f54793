"""SciPy's `solve_ivp` methods, stepped one by one, so that every finished row is kept and deadlines are met.

Tolerance: `rtol` = `atol` = tolerance, for the error of a step in the root-mean-square norm. SciPy raises `rtol` to
100 eps where it is smaller. Rows come from each method's own dense output.
"""

import warnings
from collections.abc import Callable
from typing import Any, ClassVar

import numpy as np

from polhode.models.problem import Problem
from polhode.solvers.compile import exact_jacobian, numba_callback, parameter_array, plain_field
from polhode.solvers.contract import Integrator, Outcome, Record, Settings, Solver, Status

RightHandSide = Callable[[float, np.ndarray], Any]


def right_hand_side(problem: Problem, settings: Settings, calls: list[int]) -> RightHandSide:
    """The field as ``fun(t, y)``; counts into ``calls[0]`` if the settings ask for it."""
    parameters = parameter_array(problem)
    if settings.backend == "python":
        field, values = plain_field(problem.field), parameters.tolist()

        def fun(t: float, y: np.ndarray) -> Any:
            return field(y.tolist(), values)
    else:
        callback, dimension = numba_callback(problem.field, problem.dimension), problem.dimension

        def fun(t: float, y: np.ndarray) -> Any:
            out = np.empty(dimension)
            callback(y, parameters, out)
            return out

    if not settings.count:
        return fun

    def counted(t: float, y: np.ndarray) -> Any:
        calls[0] += 1
        return fun(t, y)

    return counted


class _ScipySolver(Solver):
    """One of SciPy's `OdeSolver` classes."""

    accepts = "every form with an explicit vector field"
    library = "scipy"
    package = "scipy"
    method: ClassVar[str]

    def prepare(self, problem: Problem, settings: Settings) -> Integrator:
        """Bind the callbacks; numba compiles them once per field."""
        import scipy.integrate

        method = getattr(scipy.integrate, self.method)
        calls = [0]
        fun = right_hand_side(problem, settings, calls)
        options: dict[str, Any] = {"rtol": settings.tolerance, "atol": settings.tolerance}
        if self.implicit and settings.jacobian == "exact":
            parameters = parameter_array(problem)
            jacobian = exact_jacobian(problem.field, problem.dimension, len(parameters))
            options["jac"] = lambda t, y: jacobian(y, parameters)

        def integrate(record: Record) -> Outcome:
            calls[0] = 0
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                stepper = method(fun, record.times[0], record.start.copy(), record.times[-1], **options)
                outcome = _step_through(stepper, record, settings.max_steps)
            record.work.rhs_calls = calls[0] if settings.count else None
            if self.implicit:
                record.work.jacobians, record.work.factorizations = int(stepper.njev), int(stepper.nlu)
            return outcome

        return integrate


def _step_through(stepper: Any, record: Record, max_steps: int) -> Outcome:
    times, work = record.times, record.work
    work.steps = 0
    while stepper.status == "running":
        try:
            message = stepper.step()
        except (ArithmeticError, np.linalg.LinAlgError) as error:
            return Status.NON_FINITE, str(error)
        except ValueError as error:
            if "infs or NaNs" not in str(error):
                raise
            return Status.NON_FINITE, str(error)
        if stepper.status == "failed":
            status = Status.STEP_UNDERFLOW if np.all(np.isfinite(stepper.y)) else Status.NON_FINITE
            return status, message or ""
        work.steps += 1
        last = int(np.searchsorted(times, stepper.t, side="right"))
        if last > record.filled:
            record.put(stepper.dense_output()(times[record.filled : last]).T)
        if stepper.status == "running" and work.steps >= max_steps:
            return Status.STEP_LIMIT, f"{max_steps} steps"
        if stepper.status == "running" and record.expired:
            return Status.TIME_LIMIT, f"after {work.steps} steps"
    return Status.REACHED_END, ""


class Rk45(_ScipySolver):
    """Dormand and Prince's explicit Runge-Kutta pair of order 5(4); not for stiff problems.

    Source: Dormand and Prince, J. Comput. Appl. Math. 6 (1980) 19.
    """

    name = "rk45"
    summary = "explicit Runge-Kutta 5(4) (SciPy)"
    method = "RK45"


class Dop853(_ScipySolver):
    """Explicit Runge-Kutta of order 8(5,3); not for stiff problems.

    Source: Hairer, Nørsett, Wanner, Solving Ordinary Differential Equations I, section II.5.
    """

    name = "dop853"
    summary = "explicit Runge-Kutta 8(5,3) (SciPy)"
    method = "DOP853"


class Radau(_ScipySolver):
    """Implicit Runge-Kutta of Radau IIA type, order 5, L-stable; its dense output is of order 3.

    Source: Hairer and Wanner, Solving Ordinary Differential Equations II, section IV.8.
    """

    name = "radau"
    summary = "implicit Runge-Kutta Radau IIA of order 5 (SciPy)"
    implicit = True
    jacobians = ("exact", "difference")
    method = "Radau"


class Bdf(_ScipySolver):
    """Backward differentiation formulas of order 1 to 5 with quasi-constant steps; for stiff problems.

    Source: Shampine and Reichelt, SIAM J. Sci. Comput. 18 (1997) 1.
    """

    name = "bdf"
    summary = "backward differentiation formulas of order 1 to 5 (SciPy)"
    implicit = True
    jacobians = ("exact", "difference")
    method = "BDF"


class Lsoda(_ScipySolver):
    """Adams methods or backward differentiation, chosen as stiffness comes and goes (ODEPACK).

    Source: Petzold, SIAM J. Sci. Stat. Comput. 4 (1983) 136.
    """

    name = "lsoda"
    summary = "Adams or BDF, switching by itself (ODEPACK through SciPy)"
    implicit = True
    jacobians = ("exact", "difference")
    method = "LSODA"
