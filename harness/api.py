"""The functions for Python users and the command `solve`: a scene, a plan, a solution."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from operator import is_
from os import PathLike, fspath
from typing import Any

import numpy as np

from polhode.harness import DEFAULT_ERROR, DEFAULT_SAMPLES
from polhode.harness.answers.confirmed import advised, confirm, meet
from polhode.harness.answers.pick import pick as recommend
from polhode.harness.answers.recommendation import Recommendation
from polhode.harness.answers.request import check_answerable, check_request, check_tolerance
from polhode.harness.answers.rules import Method, first_tolerance, method_for, methods_for
from polhode.harness.answers.runs import Runner
from polhode.harness.common.scene_words import scene_named
from polhode.harness.events import Event, EventLike, as_events, with_events
from polhode.harness.ivp import check_samples, increasing
from polhode.harness.solution import SceneSolution
from polhode.models.catalogue import FORMS, form as find_form
from polhode.models.flow import Flow
from polhode.models.form import Form
from polhode.models.problem import Problem
from polhode.models.scene import Scene
from polhode.solvers.catalogue import SOLVERS, solver as find_solver
from polhode.solvers.compile import check_field
from polhode.solvers.contract import Record, Solver, Status, Work
from polhode.solvers.solve import Interrupted, Solution

SceneLike = Scene | str | PathLike[str]
FormLike = str | Form | None
SolverLike = str | Solver | None


@dataclass(frozen=True)
class Plan:
    """A run whose arguments are checked: what `solve` does, here and on the command line."""

    scene: Scene
    methods: tuple[Method, ...]  # One, or those tried in turn until one meets the error.
    tolerance: float  # The one given, or the first one that is tried.
    times: np.ndarray  # Of the output, shape (n,), in units of the inverse shear rate.
    # The error and what it is of, "slow" or "orientation"; None where a tolerance was given.
    requested: tuple[float, str] | None
    estimate: bool = True  # Whether a second run confirms the run.
    problems: Mapping[Form, Problem] = field(default_factory=dict)  # Made while it was checked.

    @property
    def form(self) -> Form:
        """Form of the equations, the first one."""
        return self.methods[0].form

    @property
    def solver(self) -> Solver:
        """Solver, the first one."""
        return self.methods[0].solver

    @property
    def _times(self) -> np.ndarray:
        """Times of the run: the start, and the times of the output."""
        return self.times if self.times[0] == 0 else np.concatenate([[0.0], self.times])

    def run(
        self, watch: Callable[[Record], None] | None = None, events: Sequence[Event] = ()
    ) -> SceneSolution:
        """Solve the problem, and look for events.

        `watch` gets the record of each segment before it is integrated. Raises ValueError for a mistake in an
        event, NotAttainableError for an error below the rounding of the run, and
        `polhode.solvers.solve.Interrupted` on Ctrl-C. Where no method meets the error, the solution is that of the
        best one, and with `estimate` its `error.advice` says so.
        """
        runner = Runner(self.scene, self._times, self.problems)
        self._check(runner, events)
        if self.requested:
            error, want = self.requested
            answer = meet(runner, self.methods, error, want, self.estimate, watch)
            stated = answer.error
            if self.estimate:
                # If the error is not confirmed, the statement says what to do instead.
                stated = advised(answer, self.scene, error, want)
        else:
            answer = confirm(runner, self.methods[0], self.tolerance, self.estimate, watch)
            stated = answer.error
        solution = self.observed(answer.solution, answer.method.form)
        solution = replace(solution, error=stated.at(solution.times / self.scene.time))
        # Events are looked for from the start on, which the requested times may leave out.
        try:
            solution = with_events(solution, events) if events else solution
        except KeyboardInterrupt:
            raise Interrupted(answer.solution) from None
        if self.times[0] == 0 or len(solution.times) == 1:
            return solution
        # The row of the start was not requested. A run that failed at once has no other, and keeps it.
        return solution.rows(slice(1, None))

    def _check(self, runner: Runner, events: Sequence[Event]) -> None:
        """Raise ValueError for a mistake in an event, before the run and not at its end."""
        if not events:
            return
        form, solver = self.methods[0]
        problem = runner.problem(form)
        start = Solution(
            problem,
            solver,
            solver.settings(self.tolerance),
            times=np.zeros(1),
            states=np.array([problem.start]),
            status=Status.REACHED_END,
            message="",
            work=Work(),
            seconds=0.0,
        )
        start_solution = self.observed(start, form)
        for event in events:
            event.values(start_solution)

    def observed(self, solution: Solution, form: Form | None = None) -> SceneSolution:
        """The motion of the scene that a solution of the problem of a form stands for.

        Without `form`, the problem's name tells the form.
        """
        names = {method.form.name: method.form for method in self.methods}
        form = form or names.get(solution.problem.name, self.form)
        observables = form.observe(self.scene, solution.states)
        return SceneSolution(
            self.scene, form, solution, self._times[: len(solution.times)], observables
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
    """The runs that `solve` will make; arguments, and the ValueErrors that refuse them, as there."""
    checked_scene = as_scene(scene)
    check_samples(samples)
    if times is not None and samples != DEFAULT_SAMPLES:
        raise ValueError(f"samples: got {samples} beside times, expected one of them")
    end = checked_scene.time
    output_times = (
        np.linspace(0.0, end, samples) if times is None else increasing("times", times, 0.0, end)
    )
    if not output_times[-1]:
        # The message shows the beginning of a long sequence.
        raise ValueError(f"times: got {times!r:.60}, expected one after the start")
    if output_times[-1] != checked_scene.time:
        checked_scene = replace(checked_scene, time=float(output_times[-1]))
    check_request(error, want)
    error = float(error)
    if tolerance is not None:
        check_tolerance(tolerance)
    methods = _methods(checked_scene, form, solver, error, want, tolerance)
    problem = _checked(checked_scene, methods[0])
    requested = None if tolerance else (error, want)
    first = tolerance or first_tolerance(checked_scene, methods[0], error, want)
    return Plan(
        checked_scene,
        methods,
        float(first),
        output_times,
        requested,
        estimate,
        {methods[0].form: problem},
    )


def _methods(
    scene: Scene,
    form: FormLike,
    solver: SolverLike,
    error: float,
    want: str,
    tolerance: float | None,
) -> tuple[Method, ...]:
    """Methods to try in turn.

    Raises ValueError where the form given refuses the scene, or cannot tell what is wanted. Whether the
    solver takes the form's problem is seen later (`_checked`).
    """
    equations = find_form(form) if form is not None else None
    given_solver = find_solver(solver) if solver is not None else None
    if equations:
        equations.require_flow(scene)
        equations.check(scene)
        if want == "orientation" and equations.orientation_of(scene) == "none":
            got = f"got 'orientation' for form {FORMS.name_of(equations)!r}, which gives none"
            raise ValueError(f"want: {got}, expected 'slow' or another form")
    if not tolerance:
        check_answerable(scene, error, want)
    if equations or given_solver or tolerance:
        methods = [method_for(scene, equations, given_solver)]
    else:
        methods = methods_for(scene, error, want)
    return tuple(methods)


def _checked(scene: Scene, method: Method) -> Problem:
    """The problem of a scene that a method takes; raises ValueError if form or solver refuse it."""
    form, solver = method
    if not solver.available:
        raise ValueError(f"solver: {solver.why_not}")
    problem = form.problem(scene)
    solver.check(problem)
    check_field(problem)
    return problem


def solve(
    scene: SceneLike,
    *,
    form: FormLike = None,
    solver: SolverLike = None,
    tolerance: float | None = None,
    error: float = DEFAULT_ERROR,
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
        Requested error, where no tolerance is given.
    want : {"slow", "orientation"}
        Whether that error is of L and E over I_max, or of the orientation in rad.
    samples : int
        Equispaced times of the output, start and end included.
    estimate : bool
        Whether a second run confirms the run and states its error.
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
    checked_events = as_events(events)
    return plan(scene, form, solver, tolerance, error, want, samples, estimate, times).run(
        events=checked_events
    )


def pick(
    scene: SceneLike,
    error: float = DEFAULT_ERROR,
    want: str = "slow",
    samples: int = DEFAULT_SAMPLES,
    *,
    form: FormLike = None,
    solver: SolverLike = None,
    everything: bool = False,
) -> Recommendation:
    """Recommend a run for a scene, and predict its cost.

    Parameters
    ----------
    scene : Scene, str or path
        A scene, a scene file, or the name of a built-in scene.
    error : float
        Largest error allowed along the run.
    want : {"slow", "orientation"}
        Whether that error is of L and E over I_max, or of the orientation in rad.
    samples : int
        Equispaced times of the output.
    form, solver : str, Form or Solver, optional
        What is raced besides the usual methods, as `solve` takes it: this form by every solver, this
        solver on every form, or the one method of both.
    everything : bool
        Whether every form is raced by every solver.

    Returns
    -------
    Recommendation
        Its `ranking` goes from the cheapest run to the dearest, and is not empty.

    Raises
    ------
    ValueError
        In one line, the value and what was expected;
        `polhode.harness.answers.request.NotAttainableError` if the error is below what double
        precision, or every method, can hold.

    Examples
    --------
    >>> from polhode import pick
    >>> best = pick("paper", error=1e-6).ranking[0]
    """
    check_samples(samples)
    # The race looks methods up by name: objects of one's own have "module:class".
    forms = [FORMS.name_of(find_form(form)) or ""] if form else list(FORMS)
    solvers = [SOLVERS.name_of(find_solver(solver)) or ""] if solver else list(SOLVERS)
    names = list(product(forms, solvers)) if form or solver else []
    return recommend(as_scene(scene), error, want, samples, everything, names)


def as_scene(scene: SceneLike) -> Scene:
    """A scene as it is, from a file, or the built-in one of that name; ValueError if none."""
    if isinstance(scene, Scene):
        return _in_doubles(scene)
    if isinstance(scene, str | PathLike):
        return scene_named(fspath(scene))
    raise ValueError(f"scene: got {scene!r}, expected a Scene, a file or a built-in scene's name")


def _in_doubles(value: Any) -> Any:
    """A scene, or a part of it, in doubles and tuples.

    NumPy's numbers may be of single precision, and its arrays have no hash.
    """
    if value is None or isinstance(value, Flow):
        # A flow holds Python numbers, and may hold many.
        return value
    if hasattr(value, "__dataclass_fields__"):
        parts = {name: getattr(value, name) for name in value.__dataclass_fields__}
        changed = {
            name: plain for name, part in parts.items() if (plain := _in_doubles(part)) is not part
        }
        return replace(value, **changed) if changed else value
    if np.ndim(value):
        plain = tuple(map(_in_doubles, value))
        return value if value.__class__ is tuple and all(map(is_, plain, value)) else plain
    return value if isinstance(value, float | int) else float(value)
