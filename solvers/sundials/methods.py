"""SUNDIALS' CVODE and IDA, in machine code alone or through scikit-sundae.

Machine code calls the C libraries of scikit-sundae or, where it is not installed, of sundials4py;
events and full mass matrices need scikit-sundae.

Tolerance: `rtol` and `atol`, one number for both unless told otherwise, for the error of a step in
the weighted root-mean-square norm; `atol` may have one number per component. Rows come from the
library's own interpolation, of the order of the step. Requested times do not change the steps, but
for CVODE's first step, which is at most a tenth of the first time. The order and the step change
seldom and by large factors: a step of CVODE grows by half or more or not at all, one of IDA doubles or
stays. So the error falls with the tolerance on the average only: between neighbouring tolerances it
jumps by up to a factor of ten either way (an estimate).

Through scikit-sundae Python is in the loop. It reports steps only where it is called step by step,
which takes several times as long: so it is called when counts, events or a limit of steps are
requested, over the very same steps.
"""

import os
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from importlib import import_module
from typing import ClassVar

import numpy as np

from polhode.models.libraries import IMPORTS, installed, need
from polhode.models.once import once
from polhode.models.own_function import OwnField
from polhode.models.problem import Problem
from polhode.solvers.catalogue import methods
from polhode.solvers.contract import (
    UNLIMITED,
    Integrator,
    Outcome,
    Record,
    Settings,
    Solver,
    SolverNotValidError,
)
from polhode.solvers.sundials.callbacks import Callbacks, rates_of
from polhode.solvers.sundials.compiled import Memory, integrator
from polhode.solvers.sundials.consistent import IndexAboveOneError, consistent
from polhode.solvers.sundials.library import load_sundials, posed

# Components up to which the index is looked at, which takes a singular value decomposition; by
# estimate. The run of a larger problem itself fails if the index is above 1.
_MAX_CHECKED = 200


@once()
def _silence() -> None:
    """Send the library's warnings nowhere: they would go to standard output, where tables go."""
    # Once, and before any run: a run in another thread may read the environment.
    os.environ.setdefault("SUNLOGGER_WARNING_FILENAME", os.devnull)


def _check_index(problem: Problem, name: str) -> None:
    """Refuse algebraic equations of a user's that do not fix the algebraic variables."""
    if problem.dimension > _MAX_CHECKED:
        return
    mass, values = posed(problem, True)
    # Only the back end is read; the tolerance may be any number.
    rates = rates_of(problem, Settings(1.0, "python"), values)
    # A start that is not consistent is another matter: the run says so.
    with suppress(RuntimeError, ArithmeticError, np.linalg.LinAlgError):
        try:
            consistent(rates, mass, 0.0, np.array(problem.start))
        except IndexAboveOneError:
            condition = (
                f"{problem.name!r}: the algebraic equations do not fix the algebraic variables "
                f"(index above 1), expected index 1: differentiate them"
            )
            raise SolverNotValidError(condition, name) from None


class SundialsSolver(Solver):
    """CVODE or IDA, with deadlines, Ctrl-C and counting."""

    accepts = "every form with an explicit vector field"
    library = "sksundae"
    package = "scikit-sundae"
    family = "SUNDIALS"
    implicit = True
    tolerances = ("atol", "atol 0")
    limits = ("max_step", "first_step")
    seeks_events = True
    takes_parameter_table = True
    backends = ("compiled", "numba", "python")
    jacobians = ("exact", "difference")
    # The prefix of the C library's functions: "CVode" or "IDA".
    prefix: ClassVar[str] = "CVode"
    # Arguments of its constructor: CVODE's number of Adams' method (1) or of BDF (2), none of IDA.
    number: ClassVar[tuple[int, ...]] = ()
    # Options of scikit-sundae's class, the name of the same method.
    options: ClassVar[dict[str, str]] = {}

    @property
    def why_not(self) -> str | None:
        """The missing package: scikit-sundae, unless sundials4py brings the C libraries and llvmlite is there."""
        alone = not installed(self.library) and self.lacks("compiled") is None
        return None if alone else super().why_not

    def lacks(self, choice: str) -> str | None:
        if choice in ("numba", "python") and not installed(self.library):
            return f"{self.library!r} installed: pip install {self.package}"
        found = choice != "compiled" or load_sundials(self.prefix)
        return super().lacks(choice) or (
            None
            if found
            else "SUNDIALS' C libraries, which the wheels of scikit-sundae and sundials4py bring"
        )

    @property
    def note(self) -> str | None:
        """Whether Python is in the loop, or the C libraries come from sundials4py."""
        if not self.available:
            return None
        if self.lacks("compiled"):
            return "available, in Python's loop: no C libraries found"
        if not installed(self.library):
            return "available, by sundials4py: without events and full mass matrices"
        return None

    def check(self, problem: Problem) -> None:
        if self.prefix != "IDA":
            super().check(problem)
        elif problem.parameters is None and problem.mass_form is None:
            raise SolverNotValidError(
                f"{problem.name!r} has no vector field; use solver 'exact'", self.name
            )

    def load(self) -> None:
        if self.lacks("compiled"):
            super().load()

    def prepare(self, problem: Problem, settings: Settings) -> Integrator:
        _silence()
        if self.prefix == "IDA" and isinstance(problem.field, OwnField) and problem.mass_form:
            _check_index(problem, self.name)
        form = problem.mass_form if self.prefix == "IDA" else None
        if form and np.ndim(form.mass) == 2 and settings.backend == "compiled":
            # Machine code knows diagonal masses alone.
            need(f"a full mass matrix by solver {self.name!r}", self.library)
            settings = replace(settings, backend="numba")
        if settings.backend == "compiled":
            compiled = integrator(self._memory(problem, settings), settings.count)

            def integrate_compiled(record: Record) -> Outcome:
                if record.events is None:
                    return compiled(record)
                # Events are Python's: so is the loop that looks for them.
                need(f"events by solver {self.name!r}", self.library)
                return self.prepare(problem, replace(settings, backend="numba"))(record)

            return integrate_compiled
        callbacks = self._callbacks(problem, settings)

        def integrate(record: Record) -> Outcome:
            every = settings.count or record.max_steps < UNLIMITED or record.events is not None
            outcome = callbacks.run(record, every)
            # A plain function is Python's at every call, so its calls are counted anyway.
            known = settings.count or problem.plain
            record.work.rhs_calls = callbacks.calls if known else None
            return outcome

        return integrate

    def _memory(self, problem: Problem, settings: Settings) -> Memory:
        library = load_sundials(self.prefix)
        assert library is not None, "the settings have been checked"
        return Memory(library, problem, settings, self.number)

    def _callbacks(self, problem: Problem, settings: Settings) -> Callbacks:
        with IMPORTS:
            module = import_module(f"{self.library}.{self.prefix.lower()}")
        return Callbacks(getattr(module, self.prefix.upper()), problem, settings, **self.options)

    def bare_call(
        self, problem: Problem, settings: Settings, times: np.ndarray
    ) -> Callable[[], object] | None:
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
        callbacks = self._callbacks(problem, settings)
        begin = callbacks.start(record)
        return lambda: callbacks.library.solve(times, *begin).y


CvodeAdams, CvodeBdf, Ida = methods(SundialsSolver)
