"""Runs of one scene, at the rows that a user asks for and at the times at which runs are compared."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from math import pi
from typing import NamedTuple

import numpy as np

from polhode.harness.answers.rules import Method
from polhode.harness.answers.statement import INNER
from polhode.models.form import Form
from polhode.models.observables import Observables
from polhode.models.problem import Problem
from polhode.models.scene import Scene
from polhode.models.spent import spent_on
from polhode.solvers.contract import UNLIMITED, Record
from polhode.solvers.solve import Interrupted, Solution, solve

Watch = Callable[[Record], None] | None

# Steps that a full run beside an averaged one, and a run in a race, may take. A second run may take as many, and
# `STEP_RATIO` times the steps of the first one more. Both are estimates that bound what a confirmation costs: a run
# that takes more is not confirmed.
MAX_STEPS = 300_000
STEP_RATIO = 30
# Ratio of the tolerances of a tighter run and of a run: a third more steps at order 8, and a tenth of
# the error, so that two runs differ by nine tenths of it. Factors are fitted for it (`fitted.json`).
TIGHTER = 0.1
# Times closer than this share of the run count as one: a step between them would be so small that
# solvers refuse it. An estimate.
_CLOSE = 1e-9


class Run(NamedTuple):
    """A run that has ended: its method, its tolerance, and its observables at the compared times."""

    method: Method
    tolerance: float
    solution: Solution
    observables: Observables

    @property
    def success(self) -> bool:
        """Whether it reached its end."""
        return self.solution.success

    @property
    def steps(self) -> int:
        """Steps, 0 where they are not reported."""
        return self.solution.work.steps or 0

    @property
    def limit(self) -> int:
        """Steps that a second run may take."""
        return MAX_STEPS + STEP_RATIO * self.steps if self.steps else UNLIMITED

    @property
    def averaged(self) -> bool:
        """Whether it averages, in part at least."""
        return self.method.form.averaged or any(
            segment.averaged for segment in self.solution.segments
        )

    @property
    def words(self) -> str:
        """Form, solver and tolerance."""
        return f"{self.method.form.name} by {self.method.solver.name} at {self.tolerance:.0e}"


class Runner:
    """Runs a scene by any method; raises `polhode.solvers.solve.Interrupted` on Ctrl-C, with the rows alone.

    A run is solved at the user's rows and at the compared times, `INNER` times the scene's duration.

    Parameters
    ----------
    scene : Scene
    times : ndarray, shape (n,)
        Rows, in units of the inverse shear rate, the first one 0 and the last one the scene's time.
    problems : mapping of Form to Problem
        Problems of the scene that are made already.
    """

    def __init__(
        self, scene: Scene, times: np.ndarray, problems: Mapping[Form, Problem] | None = None
    ) -> None:
        self.scene = scene
        self.times = times
        end = float(times[-1])
        inner = INNER * end
        # A row that lies next to a compared time takes its place.
        nearest_rows = np.minimum(times.searchsorted(inner - _CLOSE * end), len(times) - 1)
        inner = np.where(
            np.abs(times[nearest_rows] - inner) <= _CLOSE * end, times[nearest_rows], inner
        )
        # A run is asked for all times at once; the indices pick the user's rows and the compared times.
        self.inner = inner
        # Shapes: `inner` and `_at_inner` (137,), `every` (m,), `times` and `_at_rows` (n,).
        self.every = np.union1d(times, inner)
        self._at_rows = self.every.searchsorted(times)
        self._at_inner = self.every.searchsorted(inner)
        self._problems = dict(problems or {})

    def problem(self, form: Form) -> Problem:
        """The scene's problem in a form."""
        if form not in self._problems:
            self._problems[form] = form.problem(self.scene)
        return self._problems[form]

    def run(
        self,
        method: Method,
        tolerance: float,
        max_steps: int = UNLIMITED,
        watch: Watch = None,
    ) -> Run:
        """Run a method; failure is the solution's status."""
        problem = self.problem(method.form)
        # Averaged forms have a slow time T/St of their own, so their problem ends at another time.
        times = self.every * (problem.end / self.scene.time)
        try:
            with spent_on("integration"):
                solution = solve(
                    problem, method.solver, tolerance, times, watch=watch, max_steps=max_steps
                )
        except Interrupted as interruption:
            raise Interrupted(self.rows(interruption.solution)) from None
        # A run that failed has its first rows alone.
        inner = self._at_inner[: np.searchsorted(self._at_inner, len(solution.times))]
        observables = method.form.observe(self.scene, solution.states[inner])
        return Run(method, tolerance, solution, observables)

    def rows(self, solution: Solution) -> Solution:
        """A solution at the rows alone."""
        rows = self._at_rows[: np.searchsorted(self._at_rows, len(solution.times))]
        return replace(solution, times=solution.times[rows], states=solution.states[rows])


def turns(scene: Scene, observables: Observables) -> float:
    """Rotations ∫|ω|dt/2π of a run, about: |ω| is 2E/|L| and somewhat more, since 2E = ω·L ≤ |ω||L|.

    The observables are those at the compared times `INNER`. A run that ended early has fewer of them,
    and its rotations count until then.
    """
    momentum = observables.angular_momentum
    size = np.sqrt(np.einsum("ij,ij->i", momentum, momentum))
    speed = np.divide(2 * observables.energy, size, out=np.zeros_like(size), where=size > 0)
    mean = float(np.trapezoid(speed, INNER[: len(speed)]))
    return mean * scene.time / (2 * pi) if np.isfinite(mean) else 0.0
