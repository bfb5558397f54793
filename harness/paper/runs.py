"""Runs for several items: full and averaged solutions, and runs to the pinch point L = 0.

Full forms run in time t, in inverse shear rates, averaged ones in slow time t₂ = t/St. Slow
variables are (L_x, L_y, L_z, E) over the largest moment of inertia.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from polhode.models.catalogue import averaged_form, form as find_form, full_form
from polhode.models.form import Form
from polhode.models.observables import Observables
from polhode.models.scene import Scene, SlowStart
from polhode.models.shape import Ellipsoid
from polhode.solvers.catalogue import available_like
from polhode.solvers.solve import solve

# Tolerance of runs unless an item gives another. Runs at 1e-15 differ from those at 1e-12 by less than
# 1e-12 in the slow variables: measured from the paper's first starts at St = 1e3 and 5e4, t₂ = 0.5.
# Tables keep eight digits.
RUN_TOLERANCE = 1e-12
# Limit of a run. It takes seconds, but a machine that sleeps or does other work may hold it up for
# minutes. An estimate: a larger one only delays the failure of a run that hangs.
_MAX_SECONDS = 1000.0
# heyoka's Taylor method: quick at this tolerance, and as precise between its steps as at them.
_RUN_SOLVER = "taylor"


@dataclass(frozen=True)
class Run:
    """A solution at n times, in the form's own time: slow time for averaged forms."""

    form: Form
    scene: Scene
    times: np.ndarray  # Shape (n,).
    states: np.ndarray  # The form's own states, shape (n, d).

    @cached_property
    def observables(self) -> Observables:
        """L, E and the rotation matrices, in units of `Ellipsoid.inertia` and the shear rate."""
        return self.form.observe(self.scene, self.states)

    @property
    def slow(self) -> np.ndarray:
        """Slow variables (L_x, L_y, L_z, E) over the largest moment of inertia, shape (n, 4)."""
        return self.observables.slow / max(self.scene.ellipsoid.inertia)


def run_form(
    form: Form,
    scene: Scene,
    times: np.ndarray,
    tolerance: float = RUN_TOLERANCE,
    *,
    solver: str = _RUN_SOLVER,
    partial: bool = False,
) -> Run:
    """Solution of a form at times that increase from 0, in the form's own time.

    If the solver's library is missing, a solver of the same kind runs it. With `partial` a run that
    ends early has fewer rows. Without it, it raises RuntimeError.
    """
    solution = solve(
        form.problem(scene), available_like(solver), tolerance, times, max_seconds=_MAX_SECONDS
    )
    if not (solution.success or partial):
        raise RuntimeError(
            f"form {form.name!r} ended with {solution.status} at t = {solution.times[-1]:g}"
        )
    return Run(form, scene, solution.times, solution.states)


def full_run(
    scene: Scene, times: np.ndarray, tolerance: float = RUN_TOLERANCE, *, solver: str = _RUN_SOLVER
) -> Run:
    """Solution of the full equations at times in units of the inverse shear rate."""
    return run_form(find_form(full_form(scene)), scene, times, tolerance, solver=solver)


def averaged_run(scene: Scene, slow_times: np.ndarray, *, solver: str = _RUN_SOLVER) -> Run:
    """Solution of the averaged equations at slow times that increase from 0."""
    return run_form(find_form(averaged_form(scene)), scene, slow_times, solver=solver)


def slow_run(
    ellipsoid: Ellipsoid,
    slow: Sequence[float],
    slow_times: np.ndarray,
    *,
    solver: str = _RUN_SOLVER,
) -> Run:
    """`averaged_run` from slow variables (L_x, L_y, L_z, E) over the largest moment of inertia."""
    return averaged_run(slow_scene(ellipsoid, slow, slow_times[-1]), slow_times, solver=solver)


def slow_run_to_pinch(
    ellipsoid: Ellipsoid, slow: Sequence[float], slow_times: np.ndarray
) -> tuple[Run, float]:
    """`slow_run` from L_z > 0, L_x = L_y = 0, up to the pinch point L = 0, where the equations end.

    Returns the rows before it, at least two, and the slow time at which it is met, NaN if it is not.
    That time is extrapolated from the last two rows, as the speed there is finite.
    """
    # A Taylor step may jump over the singularity: this solver fails at it.
    scene = slow_scene(ellipsoid, slow, slow_times[-1])
    run = run_form(
        find_form(averaged_form(scene)), scene, slow_times, solver="cyrk-vern8", partial=True
    )
    gone = run.slow[:, 2] <= 0
    rows = int(np.argmax(gone)) if gone.any() else len(run.times)
    kept = Run(run.form, scene, run.times[:rows], run.states[:rows])
    # The last two rows: slow times, and L_z over the largest moment of inertia.
    t1, t2 = kept.times[-2:]
    z1, z2 = kept.slow[-2:, 2]
    return kept, float(t2 + z2 * (t2 - t1) / (z1 - z2)) if rows < len(slow_times) else np.nan


def slow_scene(ellipsoid: Ellipsoid, slow: Sequence[float], slow_time: float) -> Scene:
    """Scene from slow variables over the largest moment of inertia, for averaged forms alone.

    St does not matter to them: at St = 1 the scene's time is its slow time.
    """
    x, y, z, energy = (float(value) * max(ellipsoid.inertia) for value in slow)
    return Scene(ellipsoid, 1.0, SlowStart((x, y, z), energy), float(slow_time))


def spheroid(kappa: float) -> Ellipsoid:
    """Spheroid with symmetry axis z', `kappa` times as long as the other ones."""
    return Ellipsoid((1.0, 1.0, kappa))


def axes_of(ellipsoid: Ellipsoid) -> str:
    """Semi-axes as the captions write them, to four digits: (1, 0.8, 0.5)."""
    return f"({', '.join(f'{length:.4g}' for length in ellipsoid.semi_axes)})"


def graded(end: float, points: int) -> np.ndarray:
    """Times from 0 to the end, shape (points,), dense at first, where slow motion is fastest."""
    # The power is an estimate: it only sets how smooth the start and the end of a path look.
    return end * np.linspace(0.0, 1.0, points) ** 2.5


def bisected(holds: Callable[[float], bool], low: float, high: float, halvings: int) -> float:
    """The place between `low` and `high` at which a property that holds at `low` is lost.

    The error is at most (high - low)/2^(halvings + 1).
    """
    for _ in range(halvings):
        middle = (low + high) / 2
        low, high = (middle, high) if holds(middle) else (low, middle)
    return (low + high) / 2
