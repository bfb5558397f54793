"""SUNDIALS' CVODE and IDA, in machine code alone or through scikit-sundae.

Tolerance: `rtol` = `atol` = tolerance, for the error of a step in the weighted root-mean-square norm. Rows come from
the library's own interpolation, of the order of the step; of the requested times the first alone has a say in the
steps, the first one being at most a tenth of it (CVODE). The order and the step change seldom and by large factors
(a step grows by half or not at all), so that the error falls with the tolerance on the average only: by a factor of
ten up or down between neighbours, whatever the Jacobian or the corrector.

Through scikit-sundae the library hands back its rows when it fails, but not when a callback raises. Past the deadline,
or after Ctrl-C, the right-hand side therefore turns NaN, and the library gives up by itself. It reports steps only
where it is called step by step, at 5 µs each: so it runs when counts or a limit of steps are asked for, over the very
same steps.
"""

import io
import os
from collections.abc import Callable
from contextlib import redirect_stdout
from typing import Any, ClassVar

import numpy as np

from polhode.models.problem import Problem
from polhode.solvers.compile import array_callback, array_residual, exact_jacobian, parameter_array
from polhode.solvers.contract import (
    UNLIMITED,
    Integrator,
    Outcome,
    Record,
    Settings,
    Solver,
    SolverNotValidError,
    Status,
)
from polhode.solvers.sundials.compiled import FAILURES, Memory, integrator
from polhode.solvers.sundials.guard import Guard, deferred_interrupt, guarded, guarded_residual
from polhode.solvers.sundials.library import load_sundials


class SundialsSolver(Solver):
    """CVODE or IDA, with deadlines, Ctrl-C and counting."""

    library = "sksundae"
    package = "scikit-sundae"
    family = "SUNDIALS"
    implicit = True
    backends = ("compiled", "numba", "python")
    jacobians = ("exact", "difference")
    # How the names of the C library's functions begin, and the arguments of its constructor.
    prefix: ClassVar[str]
    number: ClassVar[tuple[int, ...]] = ()

    def lacks(self, choice: str) -> str | None:
        """What a back end or Jacobian needs that is not there: of ``compiled``, SUNDIALS' C libraries."""
        found = choice != "compiled" or load_sundials(self.prefix)
        return super().lacks(choice) or (None if found else "SUNDIALS' C libraries, which its wheels bring")

    @property
    def note(self) -> str | None:
        """Whether Python is in the loop."""
        return (
            "available, in Python's loop: no C libraries found" if self.available and self.lacks("compiled") else None
        )

    def load(self) -> None:
        """Open the C library, or import the package."""
        if self.lacks("compiled"):
            super().load()

    def prepare(self, problem: Problem, settings: Settings) -> Integrator:
        """Bind the callbacks, compiled once per field."""
        # The library prints its warnings on standard output, where tables go.
        os.environ.setdefault("SUNLOGGER_WARNING_FILENAME", os.devnull)
        if settings.backend == "compiled":
            return integrator(self._memory(problem, settings), settings.count)
        guard = Guard()
        library, start = self.bind(problem, settings, guard)

        def integrate(record: Record) -> Outcome:
            guard.open(record)
            run = _step_by_step if settings.count or record.max_steps < UNLIMITED else _at_once
            # The wrapper prints the library's errors.
            with deferred_interrupt(guard.close), redirect_stdout(io.StringIO()):
                try:
                    outcome = run(library, start(record), record)
                except RuntimeError as error:
                    outcome = Status.STEP_UNDERFLOW, f"no consistent initial values: {error}"
            record.work.rhs_calls = guard.calls if settings.count else None
            if not outcome[0].success and guard.stalled:
                return Status.STEP_UNDERFLOW, f"stalled at t = {guard.time!r}"
            if not outcome[0].success and record.expired:
                return Status.TIME_LIMIT, f"stopped at t = {guard.time!r}"
            return outcome

        return integrate

    def _memory(self, problem: Problem, settings: Settings) -> Memory:
        library = load_sundials(self.prefix)
        assert library is not None, "the settings have been asked"
        return Memory(library, problem, settings, self.number)

    def bind(self, problem: Problem, settings: Settings, guard: Guard | None) -> tuple[Any, Callable[[Record], tuple]]:
        """The library's solver object, and what it starts from; without a guard nothing stops it."""
        raise NotImplementedError

    def bare_call(self, problem: Problem, settings: Settings, times: np.ndarray) -> Callable[[], object] | None:
        """The solver object's `solve` with these times, or SUNDIALS' own calls; the rows."""
        record = Record(times, np.array([problem.start] * len(times)))
        if settings.backend == "compiled":
            memory = self._memory(problem, settings)

            def call() -> np.ndarray:
                record.filled = 1
                memory.begin(record)
                memory.advance(record, UNLIMITED)
                return record.rows

            return call
        library, start = self.bind(problem, settings, None)
        begin = start(record)
        return lambda: library.solve(times, *begin).y


def _at_once(library: Any, start: tuple, record: Record) -> Outcome:
    if len(record.times) == 2:
        # Two times would mean "every step" to the library.
        record.rows[0] = library.init_step(record.times[0], *start).y
        result = library.step(record.times[1], tstop=record.times[1])
        rows = result.y[None]
    else:
        result = library.solve(record.times, *start)
        # IDA may have computed consistent initial values.
        record.rows[0], rows = result.y[0], result.y[1:]
    # The row at which it failed comes with the others.
    record.put(rows if result.success else rows[:-1])
    record.work.jacobians = result.njev
    return _outcome(result)


def _step_by_step(library: Any, start: tuple, record: Record) -> Outcome:
    times, work = record.times, record.work
    end, reached = float(times[-1]), float(times[0])
    work.steps = 0
    record.rows[0] = library.init_step(times[0], *start).y
    while True:
        # The first step is guessed from the first time wanted.
        result = library.step(end if work.steps else times[1], method="onestep", tstop=end)
        work.jacobians = result.njev
        if not result.success:
            return _outcome(result)
        # After an interpolation the library first hands back the step it has.
        if result.t > reached:
            work.steps += 1
            reached = result.t
        last = int(np.searchsorted(times, reached, side="right"))
        for time in times[record.filled : last].tolist():
            record.put(library.step(time, tstop=end).y[None])
        if reached >= end:
            return _outcome(result)
        if work.steps >= record.max_steps:
            return Status.STEP_LIMIT, f"{work.steps} steps"


def _outcome(result: Any) -> Outcome:
    if result.success:
        return Status.REACHED_END, ""
    return FAILURES.get(result.status, (Status.NON_FINITE,))[0], result.message


class _Cvode(SundialsSolver):
    accepts = "every form with an explicit vector field"
    prefix = "CVode"
    method: ClassVar[str]

    def bind(self, problem: Problem, settings: Settings, guard: Guard | None) -> tuple[Any, Callable[[Record], tuple]]:
        """CVODE with its callbacks bound, and what it starts from."""
        from sksundae.cvode import CVODE

        values = parameter_array(problem)
        callback, parameters = array_callback(problem, settings.backend, values)

        def rhs(t: float, y: np.ndarray, out: np.ndarray) -> None:
            callback(y, parameters, out)

        if guard is not None:
            rhs = guarded(callback, parameters, guard, settings.count)

        options: dict[str, Any] = {}
        if settings.jacobian == "exact":
            jacobian = exact_jacobian(problem.field, problem.dimension, len(values))

            def jacfn(t: float, y: np.ndarray, rates: np.ndarray, matrix: np.ndarray) -> None:
                matrix[:] = jacobian(y, values)

            options["jacfn"] = jacfn
        library = CVODE(
            rhs,
            method=self.method,
            rtol=settings.tolerance,
            atol=settings.tolerance,
            max_num_steps=UNLIMITED,
            **options,
        )
        return library, lambda record: (record.start,)


class CvodeAdams(_Cvode):
    """Adams-Moulton methods of order 1 to 12; for problems that are not stiff.

    The corrector is Newton's. Functional iteration, the cheaper one where there is no stiffness, is not offered by
    scikit-sundae; a Jacobian of zeros, which amounts to it, takes as many steps and scatters as much.

    Source: Hindmarsh et al., ACM Trans. Math. Software 31 (2005) 363.
    """

    name = "cvode-adams"
    summary = "Adams methods of order 1 to 12 (SUNDIALS CVODE)"
    method = "Adams"
    number = (1,)
    error_constant = 2000.0  # 439 measured


class CvodeBdf(_Cvode):
    """Backward differentiation formulas of order 1 to 5 with variable coefficients; for stiff problems.

    Orders 3 to 5 are stable in a wedge about the negative axis alone: a fast undamped rotation costs order and steps.
    Source: Hindmarsh et al., ACM Trans. Math. Software 31 (2005) 363.
    """

    name = "cvode-bdf"
    summary = "backward differentiation formulas of order 1 to 5 (SUNDIALS CVODE)"
    method = "BDF"
    number = (2,)
    error_constant = 6000.0  # 1862 measured


class Ida(SundialsSolver):
    """Backward differentiation formulas of order 1 to 5 for the mass form, which stays valid down to St = 0.

    At St = 0 the angular velocity is algebraic; the library computes consistent initial values. For St > 0 the
    initial rates are the field's own. Fixed leading coefficients: the step doubles or stays, so that the error and the
    number of steps scatter more than CVODE's.
    Source: Brown, Hindmarsh, Petzold, SIAM J. Sci. Comput. 15 (1994) 1467 and 19 (1998) 1495.
    """

    name = "ida"
    summary = "backward differentiation formulas for implicit equations (SUNDIALS IDA)"
    prefix = "IDA"
    accepts = "every form; the full forms with body angular velocity also at St = 0"
    error_constant = 2500.0  # 667 measured

    def check(self, problem: Problem) -> None:
        """Refuse a problem without any vector field."""
        if problem.parameters is None and problem.mass_form is None:
            raise SolverNotValidError(f"{problem.name!r} has no vector field; use solver 'exact'", self.name)

    def bind(self, problem: Problem, settings: Settings, guard: Guard | None) -> tuple[Any, Callable[[Record], tuple]]:
        """IDA with its callbacks bound, and what it starts from."""
        from sksundae.ida import IDA

        form = problem.mass_form
        mass = np.array(form.mass) if form else np.ones(problem.dimension)
        values = np.array(form.parameters) if form else parameter_array(problem)
        residual, callback, parameters = array_residual(problem, settings.backend, values)

        def resfn(t: float, y: np.ndarray, rates: np.ndarray, out: np.ndarray) -> None:
            residual(y, rates, mass, parameters, out)

        if guard is not None:
            resfn = guarded_residual(residual, mass, parameters, guard, settings.count)

        options: dict[str, Any] = {}
        if settings.jacobian == "exact":
            jacobian, matrix = exact_jacobian(problem.field, problem.dimension, len(values)), np.diag(mass)

            def jacfn(t: float, y: np.ndarray, rates: np.ndarray, res: np.ndarray, cj: float, out: np.ndarray) -> None:
                out[:] = cj * matrix - jacobian(y, values)

            options["jacfn"] = jacfn
        algebraic = np.flatnonzero(mass == 0)
        if len(algebraic):
            options |= {"algebraic_idx": algebraic.tolist(), "calc_initcond": "yp0"}
        library = IDA(
            resfn,
            rtol=settings.tolerance,
            atol=settings.tolerance,
            max_num_steps=UNLIMITED,
            **options,
        )

        def start(record: Record) -> tuple[np.ndarray, np.ndarray]:
            rates = np.empty(problem.dimension)
            callback(record.start, parameters, rates)
            return record.start, np.divide(rates, mass, out=np.zeros(problem.dimension), where=mass > 0)

        return library, start
