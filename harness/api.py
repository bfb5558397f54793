"""What Python users call, and the command `solve` with them: a scene, a plan, a solution."""

from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from math import nan
from os import PathLike, fspath
from typing import TYPE_CHECKING, Any

import numpy as np

from polhode.harness.common.machine import versions
from polhode.harness.common.observables_csv import COLUMNS
from polhode.harness.common.text import short
from polhode.harness.picking.choice import check_tolerance, choose
from polhode.harness.picking.ranking import Recommendation
from polhode.harness.picking.ranking import pick as recommend
from polhode.harness.picking.second_look import UNKNOWN, RunError, run_error
from polhode.harness.studies.scenes import find_scene
from polhode.models.catalogue import form as find_form
from polhode.models.files.scene_file import scene_table
from polhode.models.form import Form
from polhode.models.observables import Observables
from polhode.models.problem import Problem
from polhode.models.scene import Scene
from polhode.models.spent import spent_on
from polhode.solvers.catalogue import solver as find_solver
from polhode.solvers.compile import check_field
from polhode.solvers.contract import Record, Solver, Status, Work
from polhode.solvers.solve import Solution, described
from polhode.solvers.solve import solve as run

if TYPE_CHECKING:
    import pandas as pd

SceneLike = Scene | str | PathLike[str]
FormLike = str | Form | None
SolverLike = str | Solver | None
# A table of more rows would hold gigabytes.
MOST_SAMPLES = 10_000_000


@dataclass(frozen=True)
class SceneSolution:
    """The motion of a scene, finished or not; it pickles.

    Parameters
    ----------
    scene : Scene
    form, solver : str
        What it was computed by.
    tolerance : float
    status : Status
        Failure is a status, with the rows finished before it.
    message : str
        The library's own words.
    times : ndarray, shape (n,)
        In units of the inverse shear rate.
    observables : Observables
        L, E and the rotation matrix at these times.
    work : Work
    seconds : float
        Wall time of the integrator alone, compilation left out.
    error : RunError
        Estimated error of this very run, `slow` and `orientation`.
    """

    scene: Scene
    form: str
    solver: str
    tolerance: float
    status: Status
    message: str
    times: np.ndarray
    observables: Observables
    work: Work
    seconds: float
    error: RunError = UNKNOWN

    def __repr__(self) -> str:
        """One fact a line, without the arrays."""
        problem = f"{self.form}, St = {short(self.scene.stokes)}, to t = {short(self.scene.time)}"
        lines = [described(self, problem, f"tolerance {short(self.tolerance)}")]
        if self.error is not UNKNOWN:
            lines.append(f"  error: {self.error.words(self.scene.ellipsoid, self.observables)}")
        return "\n".join([*lines, *[f"  advice: {self.error.advice}"] * bool(self.error.advice)])

    @property
    def success(self) -> bool:
        """Whether the run reached its end."""
        return self.status.success

    @property
    def slow_times(self) -> np.ndarray:
        """t₂ = t/St, shape (n,): NaN at St = 0, 0 at St = inf."""
        stokes = self.scene.stokes
        return np.full_like(self.times, nan if stokes == 0 else 0.0) if stokes in (0, np.inf) else self.times / stokes

    @property
    def angular_momentum(self) -> np.ndarray:
        """L in space axes, shape (n, 3), without St."""
        return self.observables.angular_momentum

    @property
    def energy(self) -> np.ndarray:
        """E, shape (n,), without St."""
        return self.observables.energy

    @property
    def rotation(self) -> np.ndarray:
        """t_ij, shape (n, 3, 3): row i is body axis i in space components; NaN where the form does not know it."""
        return self.observables.rotation

    def table(self) -> np.ndarray:
        """`frame` as an array, shape (n, 15)."""
        rotation = self.rotation.reshape(len(self.times), 9)
        return np.column_stack([self.times, self.slow_times, self.observables.slow, rotation])

    def frame(self) -> "pd.DataFrame":
        """One row per time, with the columns of `polhode solve`'s CSV: t, t2, Lx, Ly, Lz, E, R11 … R33.

        Its `attrs` are `provenance`.
        """
        import pandas as pd

        table = pd.DataFrame(self.table(), columns=COLUMNS)
        table.attrs.update(self.provenance())
        return table

    def provenance(self) -> dict[str, Any]:
        """Where the numbers come from, as plain data: scene, form, solver, tolerance, error, versions."""
        names = ("form", "solver", "tolerance", "seconds")
        return {
            "scene": scene_table(self.scene),
            **{name: getattr(self, name) for name in names},
            "status": str(self.status),
            "error": asdict(self.error),
            "versions": versions(),
        }


@dataclass(frozen=True)
class Plan:
    """A run with nothing left open and nothing against it: what `solve` does, here and on the command line."""

    scene: Scene
    form: Form
    solver: Solver
    tolerance: float
    problem: Problem
    samples: int
    note: str  # Why the error asked for may not be met; empty where it will be.
    asked: tuple[float, str] | None = None  # Error and what it is of, where they chose the tolerance.
    estimate: bool = True  # Whether a second look estimates the error.

    def run(self, watch: Callable[[Record], None] | None = None) -> SceneSolution:
        """Solve the problem; raises `polhode.solvers.solve.Interrupted` on Ctrl-C."""
        times = np.linspace(0.0, self.problem.end, self.samples)
        with spent_on("integration"):
            found = run(self.problem, self.solver, self.tolerance, times, watch=watch)
        solution = self.observed(found)
        if not self.estimate:
            return solution
        with spent_on("error"):
            seen = run_error(self.scene, self.form, self.solver, found, solution.observables)
        if self.asked:
            seen = seen.asked(*self.asked, self.form, self.scene, self.tolerance)
        return replace(solution, error=seen)

    def observed(self, found: Solution) -> SceneSolution:
        """The motion of the scene that a solution of the problem stands for."""
        return SceneSolution(
            scene=self.scene,
            form=self.form.name,
            solver=self.solver.name,
            tolerance=self.tolerance,
            status=found.status,
            message=found.message,
            times=found.times * self.problem.time_unit,
            observables=self.form.observe(self.scene, found.states),
            work=found.work,
            seconds=found.seconds,
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
) -> Plan:
    """What `solve` will run; arguments and refusals as there, in one place for Python and the command line."""
    what = as_scene(scene)
    _check_samples(samples)
    if tolerance is not None:
        check_tolerance(tolerance)
    # What is plainly wrong is refused before anything is tried.
    if form is not None:
        _form(form).check(what)
    if solver is not None:
        _solver(solver)
    with spent_on("pilots"):
        choice = choose(what, _name(form), _name(solver), tolerance, error, want, samples)
    equations, method = _form(form or choice.form), _solver(solver or choice.solver)
    problem = equations.problem(what)
    if not method.available:
        raise ValueError(f"solver: {method.why_not}")
    method.check(problem)
    check_field(problem)
    asked = None if tolerance else (error, want)
    return Plan(what, equations, method, choice.tolerance, problem, samples, choice.note, asked, estimate)


def solve(
    scene: SceneLike,
    *,
    form: FormLike = None,
    solver: SolverLike = None,
    tolerance: float | None = None,
    error: float = 1e-6,
    want: str = "slow",
    samples: int = 201,
    estimate: bool = True,
) -> SceneSolution:
    """Solve a scene.

    Parameters
    ----------
    scene : Scene, str or path
        A scene, a scene file, or the name of a built-in scene.
    form, solver : str, Form or Solver, optional
        Catalogue names, ``"module:class"``, or objects of one's own; by default what fits the scene, as
        `polhode solve` chooses.
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

    Returns
    -------
    SceneSolution
        Failure is a status, never an exception.

    Raises
    ------
    ValueError
        In one line, the value and what was expected; also if form or solver do not accept the scene, or the solver's
        library is not installed.
    polhode.solvers.solve.Interrupted
        On Ctrl-C.

    Examples
    --------
    >>> from polhode import solve
    >>> solve("paper", form="quaternion", solver="taylor", tolerance=1e-10).status
    <Status.REACHED_END: 'reached_end'>
    """
    return plan(scene, form, solver, tolerance, error, want, samples, estimate).run()


def pick(scene: SceneLike, error: float = 1e-6, want: str = "slow", samples: int = 201) -> Recommendation:
    """What to run for a scene, and what it will cost (`polhode.harness.picking.ranking.pick`).

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
        Its `ranking` goes from the cheapest way to the dearest.

    Examples
    --------
    >>> from polhode import pick
    >>> best = pick("paper", error=1e-6).ranking[0]
    """
    _check_samples(samples)
    return recommend(as_scene(scene), error, want, samples)


def as_scene(scene: SceneLike) -> Scene:
    """The scene itself, that of a file, or the built-in one of that name.

    Raises
    ------
    ValueError
        If there is neither, or the file is no scene.
    """
    return scene if isinstance(scene, Scene) else find_scene(fspath(scene))


def _check_samples(samples: int) -> None:
    if not 2 <= samples <= MOST_SAMPLES:
        raise ValueError(f"samples: got {samples}, expected a number from 2 to {MOST_SAMPLES}")


def _form(what: str | Form) -> Form:
    return what if isinstance(what, Form) else find_form(what)


def _solver(what: str | Solver) -> Solver:
    return what if isinstance(what, Solver) else find_solver(what)


def _name(thing: str | Form | Solver | None) -> str | None:
    """A catalogue name, or ``"module:class"`` for an object."""
    if thing is None or isinstance(thing, str):
        return thing
    return f"{type(thing).__module__}:{type(thing).__qualname__}"
