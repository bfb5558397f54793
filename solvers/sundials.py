"""SUNDIALS' CVODE and IDA through scikit-sundae.

Tolerance: `rtol` = `atol` = tolerance, for the error of a step in the weighted root-mean-square norm. Rows come from
the library's own interpolation. Steps are told only by a run of their own, made when the settings ask for counts.
"""

from collections.abc import Callable
from typing import Any, ClassVar

import numpy as np

from polhode.models.problem import Problem
from polhode.solvers.compile import (
    exact_jacobian,
    numba_callback,
    numba_residual,
    parameter_array,
    plain_field,
)
from polhode.solvers.contract import Integrator, Outcome, Record, Settings, Solver, SolverNotValidError, Status

# SUNDIALS return values (cvode.h, ida.h; both libraries share these).
_STATUS = {
    -1: Status.STEP_LIMIT,
    -2: Status.TOLERANCE_UNATTAINABLE,
    -3: Status.STEP_UNDERFLOW,
    -4: Status.STEP_UNDERFLOW,
}


class _Expired(Exception):  # noqa: N818 - it signals, it is no error
    """The deadline passed inside a callback."""


class _Sundials(Solver):
    """What CVODE and IDA share: stepping from output to output, deadlines, counting."""

    library = "sksundae"
    package = "scikit-sundae"

    def prepare(self, problem: Problem, settings: Settings) -> Integrator:
        """Bind the callbacks; numba compiles them once per field."""
        calls, limit = [0], [np.inf]

        def watched(function: Callable[..., None]) -> Callable[..., None]:
            from time import perf_counter

            def watch(*arguments: Any) -> None:
                calls[0] += 1
                if perf_counter() > limit[0]:
                    raise _Expired
                function(*arguments)

            return watch

        def integrate(record: Record) -> Outcome:
            calls[0], limit[0] = 0, record.deadline
            watch = watched if settings.count or record.deadline < np.inf else _unwatched
            library, start = self.bind(problem, settings, watch)
            outcome, result = _step_through(library, start, record)
            if result is not None:
                record.work.jacobians = result.njev if self.implicit else None
            if settings.count:
                record.work.rhs_calls = calls[0]
                if outcome[0].success:
                    record.work.steps = len(library.solve(record.times[[0, -1]], *start(record)).t) - 1
            return outcome

        return integrate

    def bind(self, problem: Problem, settings: Settings, watch: Callable) -> tuple[Any, Callable[[Record], tuple]]:
        """The library's solver object, and what it starts from."""
        raise NotImplementedError


def _unwatched(function: Callable[..., None]) -> Callable[..., None]:
    return function


def _step_through(library: Any, start: Callable[[Record], tuple], record: Record) -> tuple[Outcome, Any]:
    times, result = record.times, None
    end = float(times[-1])
    try:
        result = library.init_step(times[0], *start(record))
        record.rows[0] = result.y
        for time in times[1:].tolist():
            result = library.step(time, tstop=end)
            if result.status < 0:
                status = _STATUS.get(result.status, Status.NON_FINITE)
                return (status, result.message), result
            record.put(result.y[None])
    except _Expired:
        return (Status.TIME_LIMIT, "stopped inside a right-hand side"), result
    return (Status.REACHED_END, result.message), result


class _Cvode(_Sundials):
    accepts = "every form with an explicit vector field"
    method: ClassVar[str]

    def bind(self, problem: Problem, settings: Settings, watch: Callable) -> tuple[Any, Callable[[Record], tuple]]:
        """CVODE or IDA with its callbacks bound, and what it starts from."""
        from sksundae.cvode import CVODE

        parameters = parameter_array(problem)
        options: dict[str, Any] = {}
        if settings.backend == "python":
            field, values = plain_field(problem.field), parameters.tolist()

            def rhs(t: float, y: np.ndarray, out: np.ndarray) -> None:
                out[:] = field(y.tolist(), values)
        else:
            callback = numba_callback(problem.field, problem.dimension)

            def rhs(t: float, y: np.ndarray, out: np.ndarray) -> None:
                callback(y, parameters, out)

        if settings.jacobian == "exact":
            jacobian = exact_jacobian(problem.field, problem.dimension, len(parameters))

            def jacfn(t: float, y: np.ndarray, rates: np.ndarray, matrix: np.ndarray) -> None:
                matrix[:] = jacobian(y, parameters)

            options["jacfn"] = jacfn
        library = CVODE(
            _three(watch(rhs)),
            method=self.method,
            rtol=settings.tolerance,
            atol=settings.tolerance,
            max_num_steps=settings.max_steps,
            **options,
        )
        return library, lambda record: (record.start,)


def _three(function: Callable[..., None]) -> Callable[..., None]:
    """Give a callback the plain signature that scikit-sundae insists on."""
    return lambda t, y, out: function(t, y, out)


class CvodeAdams(_Cvode):
    """Adams-Moulton methods of order 1 to 12, Newton corrector; for problems that are not stiff.

    Source: Hindmarsh et al., ACM Trans. Math. Software 31 (2005) 363.
    """

    name = "cvode-adams"
    summary = "Adams methods of order 1 to 12 (SUNDIALS CVODE)"
    jacobians = ("exact", "difference")
    implicit = True
    method = "Adams"


class CvodeBdf(_Cvode):
    """Backward differentiation formulas of order 1 to 5 with variable coefficients; for stiff problems.

    Source: Hindmarsh et al., ACM Trans. Math. Software 31 (2005) 363.
    """

    name = "cvode-bdf"
    summary = "backward differentiation formulas of order 1 to 5 (SUNDIALS CVODE)"
    jacobians = ("exact", "difference")
    implicit = True
    method = "BDF"


class Ida(_Sundials):
    """Backward differentiation formulas of order 1 to 5 for the mass form, which stays valid down to St = 0.

    At St = 0 the angular velocity is algebraic; the library computes consistent initial values. For St > 0 the
    initial rates are the field's own.
    Source: Brown, Hindmarsh, Petzold, SIAM J. Sci. Comput. 19 (1998) 1495.
    """

    name = "ida"
    summary = "backward differentiation formulas for implicit equations (SUNDIALS IDA)"
    accepts = "every form; the full forms with body angular velocity also at St = 0"
    backends = ("numba",)
    jacobians = ("exact", "difference")
    implicit = True

    def check(self, problem: Problem) -> None:
        """Refuse a problem without any vector field."""
        if problem.parameters is None and problem.mass_form is None:
            raise SolverNotValidError(f"solver 'ida': {problem.name!r} has no vector field; use solver 'exact'")

    def bind(self, problem: Problem, settings: Settings, watch: Callable) -> tuple[Any, Callable[[Record], tuple]]:
        """CVODE or IDA with its callbacks bound, and what it starts from."""
        from sksundae.ida import IDA

        form, dimension = problem.mass_form, problem.dimension
        mass = np.array(form.mass) if form else np.ones(dimension)
        parameters = np.array(form.parameters) if form else parameter_array(problem)
        residual = numba_residual(problem.field, dimension)

        def resfn(t: float, y: np.ndarray, rates: np.ndarray, out: np.ndarray) -> None:
            residual(y, rates, mass, parameters, out)

        options: dict[str, Any] = {}
        if settings.jacobian == "exact":
            jacobian, matrix = exact_jacobian(problem.field, dimension, len(parameters)), np.diag(mass)

            def jacfn(t: float, y: np.ndarray, rates: np.ndarray, res: np.ndarray, cj: float, out: np.ndarray) -> None:
                out[:] = cj * matrix - jacobian(y, parameters)

            options["jacfn"] = jacfn
        algebraic = np.flatnonzero(mass == 0)
        if len(algebraic):
            options |= {"algebraic_idx": algebraic.tolist(), "calc_initcond": "yp0"}
        watched = watch(resfn)
        library = IDA(
            lambda t, y, rates, out: watched(t, y, rates, out),
            rtol=settings.tolerance,
            atol=settings.tolerance,
            max_num_steps=settings.max_steps,
            **options,
        )

        def start(record: Record) -> tuple[np.ndarray, np.ndarray]:
            rates = np.empty(dimension)
            numba_callback(problem.field, dimension)(record.start, parameters, rates)
            return record.start, np.divide(rates, mass, out=np.zeros(dimension), where=mass > 0)

        return library, start
