"""Closed forms: no integration, no error that grows with time, any times in any number."""

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
    """The solution in closed form, where the form knows one.

    Tolerance: ignored. Cost grows with the number of requested times, not with where they lie.
    """

    name = "exact"
    summary = "closed-form solution"
    accepts = "forms with a closed form: euler-top, jeffery of a spheroid"
    family = "closed form"
    closed_form = True
    backends = ("compiled",)
    choices_need: ClassVar[Mapping[str, str]] = {}  # NumPy evaluates the formulas
    error_constant = 0.0

    def check(self, problem: Problem) -> None:
        if problem.closed_form is None:
            raise SolverNotValidError(
                f"{problem.name!r} has no closed form here; use solver 'taylor'", self.name
            )

    def prepare(self, problem: Problem, settings: Settings) -> Integrator:
        closed_form = problem.closed_form
        assert closed_form is not None

        def integrate(record: Record) -> Outcome:
            record.put(closed_form(record.times)[1:])
            return Status.REACHED_END, ""

        return integrate
