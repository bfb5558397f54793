"""Solver `exact`: rows from a closed form, without an error that grows with time."""

from collections.abc import Mapping
from typing import ClassVar

from polhode.models.problem import Problem
from polhode.solvers.contract import (
    Integrator,
    Outcome,
    Record,
    Settings,
    Solver,
    SolverNotValidError,
    Status,
)


class Exact(Solver):
    """The solution in closed form, of forms of the equations that have one.

    Tolerance: ignored, so that `error_constant` is 0. Cost grows with the number of requested
    times, not with where they lie.
    """

    name = "exact"
    summary = "closed-form solution"
    accepts = "forms with a closed form: euler-top, jeffery of a spheroid"
    family = "closed form"
    closed_form = True
    # NumPy evaluates the formulas at all times at once: no Python runs for a row, and no compiler
    # is needed.
    backends = ("compiled",)
    choices_need: ClassVar[Mapping[str, str]] = {}
    error_constant = 0.0

    def check(self, problem: Problem) -> None:
        """Refuse a problem without a closed form.

        The other refusals of `Solver.check` do not matter here, as the formulas never call the field.
        """
        if problem.closed_form is None:
            raise SolverNotValidError(
                f"{problem.name!r} has no closed form here; use solver 'taylor'", self.name
            )

    def prepare(self, problem: Problem, settings: Settings) -> Integrator:
        """Return an integrator that fills all rows behind the start at once."""
        closed_form = problem.closed_form
        assert closed_form is not None

        def integrate(record: Record) -> Outcome:
            # The record has its first row, the start, already.
            record.put(closed_form(record.times)[1:])
            return Status.REACHED_END, ""

        return integrate
