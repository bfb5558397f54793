"""What Python users call, and the command `solve` with them: a scene, a plan, a solution."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import inf
from operator import is_
from os import PathLike, fspath
from typing import Any

import numpy as np

from polhode.harness import DEFAULT_SAMPLES
from polhode.harness.events import Event, EventLike, as_events, with_events
from polhode.harness.ivp import check_samples, increasing
from polhode.harness.picking.choice import choose
from polhode.harness.picking.ranking import pick as recommend
from polhode.harness.picking.recommendation import Recommendation
from polhode.harness.picking.second_look import run_error
from polhode.harness.picking.stated_error import doubt
from polhode.harness.solution import SceneSolution
from polhode.models.catalogue import FORMS, form as find_form
from polhode.models.form import Form
from polhode.models.problem import Problem
from polhode.models.scene import Scene
from polhode.models.scenes import find_scene
from polhode.models.spent import spent_on
from polhode.solvers.catalogue import SOLVERS, solver as find_solver
from polhode.solvers.compile import check_field
from polhode.solvers.contract import Record, Solver, Status, Work
from polhode.solvers.solve import Interrupted, Solution, solve as run

SceneLike = Scene | str | PathLike[str]
FormLike = str | Form | None
SolverLike = str | Solver | None


@dataclass(frozen=True)
class Plan:
    """A run with nothing left open and nothing against it: what `solve` does, here and on the command line."""

    scene: Scene
    form: Form
    solver: Solver
    tolerance: float
    problem: Problem
    times: np.ndarray  # Of the output, in units of the inverse shear rate.
    note: str  # Why the error asked for may not be met; empty where it will be.
    long: str  # How long the run will take, if long.
    asked: tuple[float, str] | None = (
        None  # Error and what it is of, where they chose the tolerance.
    )
    estimate: bool = True  # Whether a second look estimates the error.
    max_seconds: float = inf  # Limit of the run itself, without the second look.

    @property
    def _times(self) -> np.ndarray:
        """Those of the run: of the output, after the start."""
        return self.times if self.times[0] == 0 else np.concatenate([[0.0], self.times])

    def run(
        self, watch: Callable[[Record], None] | None = None, events: Sequence[Event] = ()
    ) -> SceneSolution:
        """Solve the problem, and look for events; raises `polhode.solvers.solve.Interrupted` on Ctrl-C."""
        times = self._times / self.scene.time * self.problem.end
        if events:
            # A mistake in one is found before the run, not at its end.
            head = self.problem, self.solver, self.solver.settings(self.tolerance), times[:1]
            start = Solution(
                *head, np.array([self.problem.start]), Status.REACHED_END, "", Work(), 0.0
            )
            seen = self.observed(start)
            for event in events:
                event.values(seen)
        with spent_on("integration"):
            found = run(
                self.problem,
                self.solver,
                self.tolerance,
                times,
                watch=watch,
                max_seconds=self.max_seconds,
            )
        try:
            return self._judged(found, events)
        except KeyboardInterrupt:
            # Not what a second look had of a run of its own.
            raise Interrupted(found) from None

    def _judged(self, found: Solution, events: Sequence[Event]) -> SceneSolution:
        """The solution with its error and what happened."""
        solution = self.observed(found)
        if self.estimate:
            with spent_on("error"):
                seen = run_error(self.scene, self.form, self.solver, found, solution.observables)
            if words := doubt(self.scene, self.form, found, solution.observables, seen):
                solution = self.observed(replace(found, status=Status.FALSE_SUCCESS, message=words))
            if self.asked:
                seen = seen.asked(*self.asked, self.form, self.scene, self.tolerance)
            solution = replace(solution, error=seen)
        # Before the first time of the output, too.
        solution = with_events(solution, events) if events else solution
        return (
            solution
            if self.times[0] == 0 or len(solution.times) == 1
            else solution.rows(slice(1, None))
        )

    def observed(self, found: Solution) -> SceneSolution:
        """The motion of the scene that a solution of the problem stands for."""
        observables = self.form.observe(self.scene, found.states)
        return SceneSolution(
            self.scene, self.form, found, self._times[: len(found.times)], observables
        )


def plan(
    scene: SceneLike,
    form: FormLike,
    solver: SolverLike,
    tolerance: float | None,
    error: float,
    want: str,
    samples: int,
    estimate: bool = True,
    times: Sequence[float] | np.ndarray | None = None,
) -> Plan:
    """What `solve` will run; arguments and refusals as there, in one place for Python and the command line."""
    what = as_scene(scene)
    check_samples(samples)
    if times is not None and samples != DEFAULT_SAMPLES:
        raise ValueError(f"samples: got {samples} beside times, expected one of them")
    wanted = (
        np.linspace(0.0, what.time, samples)
        if times is None
        else increasing("times", times, 0.0, what.time)
    )
    if not wanted[-1]:
        raise ValueError(f"times: got {times!r:.60}, expected one after the start")
    what = replace(what, time=float(wanted[-1]))
    # What is plainly wrong is refused before anything is tried.
    if form is not None:
        find_form(form).check(what)
    if solver is not None:
        find_solver(solver)
    with spent_on("pilots"):
        # Trials begin at the start.
        rows = max(2, len(wanted))
        choice = choose(
            what, FORMS.name_of(form), SOLVERS.name_of(solver), tolerance, error, want, rows
        )
    equations, method = find_form(form or choice.form), find_solver(solver or choice.solver)
    problem = equations.problem(what)
    if not method.available:
        raise ValueError(f"solver: {method.why_not}")
    method.check(problem)
    check_field(problem)
    asked = None if tolerance else (error, want)
    return Plan(
        what,
        equations,
        method,
        choice.tolerance,
        problem,
        wanted,
        choice.note,
        choice.long,
        asked,
        estimate,
    )


def solve(
    scene: SceneLike,
    *,
    form: FormLike = None,
    solver: SolverLike = None,
    tolerance: float | None = None,
    error: float = 1e-6,
    want: str = "slow",
    samples: int = DEFAULT_SAMPLES,
    estimate: bool = True,
    times: Sequence[float] | np.ndarray | None = None,
    events: Sequence[EventLike] | EventLike = (),
) -> SceneSolution:
    """Solve a scene.

    Parameters
    ----------
    scene : Scene, str or path
        A scene, a scene file, or the name of a built-in scene.
    form, solver : str, Form or Solver, optional
        Catalogue names, ``"module:class"``, or objects of one's own; by default what fits the
        scene, as `polhode solve` chooses.
    tolerance : float, optional
        The solver's; by default what meets `error`.
    error : float
        Error wanted where no tolerance is given.
    want : {"slow", "orientation"}
        Whether that error is of L and E over I_max, or of the orientation in rad.
    samples : int
        Equispaced times of the output, start and end included.
    estimate : bool
        Whether a second look estimates the error of the run, in less time than it took or in 5 ms.
    times : sequence of float, optional
        Times of the output instead, increasing, in units of the inverse shear rate; the run ends at
        the last one.
    events : str, Event, callable, or a sequence of them
        What to look for: ``"separatrix"`` (L² = 2EI₂), ``"lz"`` (L_z = 0), ``"settled"`` (arrival
        at the settled state), or a function ``f(solution) -> (n,)`` of L, E and rotation that
        passes zero; `harness.events.Event` gives it direction and end. The solution's
        ``events["lz"]`` is the motion at these times.

    Returns
    -------
    SceneSolution
        Failure is a status, never an exception.

    Raises
    ------
    ValueError
        In one line, the value and what was expected; also if form or solver do not accept the
        scene, or the solver's library is not installed.
    polhode.solvers.solve.Interrupted
        On Ctrl-C; its `solution` is what is finished, in the form's own states and time.

    Examples
    --------
    >>> from polhode import solve
    >>> solve("paper", form="quaternion", solver="taylor", tolerance=1e-10).status
    <Status.REACHED_END: 'reached_end'>
    """
    wanted = as_events(events)
    return plan(scene, form, solver, tolerance, error, want, samples, estimate, times).run(
        events=wanted
    )


def pick(
    scene: SceneLike, error: float = 1e-6, want: str = "slow", samples: int = DEFAULT_SAMPLES
) -> Recommendation:
    """What to run for a scene, and what it will cost.

    Parameters
    ----------
    scene : Scene, str or path
        A scene, a scene file, or the name of a built-in scene.
    error : float
        Largest error allowed along the run.
    want : {"slow", "orientation"}
    samples : int
        Equispaced times of the output.

    Returns
    -------
    Recommendation
        Its `ranking` goes from the cheapest way to the dearest, and is not empty.

    Raises
    ------
    ValueError
        In one line, the value and what was expected;
        `polhode.harness.picking.ranking.NotAttainableError` if the error is below what double
        precision, or every method, can hold.

    Examples
    --------
    >>> from polhode import pick
    >>> best = pick("paper", error=1e-6).ranking[0]
    """
    check_samples(samples)
    return recommend(as_scene(scene), error, want, samples)


def as_scene(scene: SceneLike) -> Scene:
    """The scene itself, that of a file, or the built-in one of that name; ValueError if there is none."""
    if isinstance(scene, Scene):
        return _in_doubles(scene)
    if isinstance(scene, str | PathLike):
        return find_scene(fspath(scene))
    raise ValueError(f"scene: got {scene!r}, expected a Scene, a file or a built-in scene's name")


def _in_doubles(given: Any) -> Any:
    """A scene, or a part of it, in Python numbers: NumPy's may be of single precision, its arrays have no hash."""
    if hasattr(given, "__dataclass_fields__"):
        parts = {name: getattr(given, name) for name in given.__dataclass_fields__}
        others = {
            name: own for name, part in parts.items() if (own := _in_doubles(part)) is not part
        }
        return replace(given, **others) if others else given
    if np.ndim(given):
        own = tuple(map(_in_doubles, given))
        return given if given.__class__ is tuple and all(map(is_, own, given)) else own
    return given if isinstance(given, float | int) else float(given)
