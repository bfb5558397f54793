"""A scene seen through a form and a solver."""

import numpy as np

from polhode.models.catalogue import form as find_form
from polhode.models.form import Form
from polhode.models.observables import Observables
from polhode.models.scene import Scene
from polhode.solvers.solve import solve


def observed(
    form: str | Form,
    scene: Scene,
    *,
    solver: str = "cyrk-dop853",
    tolerance: float = 1e-15,
    samples: int = 101,
) -> Observables:
    """Observables of a run that must succeed, at equispaced times from the start to the end, `samples` of them.

    The default tolerance asks for all that double precision gives.
    """
    equations = find_form(form) if isinstance(form, str) else form
    problem = equations.problem(scene)
    solution = solve(problem, solver, tolerance, np.linspace(0, problem.end, samples))
    assert solution.success, f"{problem.name} {solver}: {solution.status} {solution.message}"
    return equations.observe(scene, solution.states)


def slow_difference(scene: Scene, one: Observables, other: Observables) -> float:
    """Largest difference of L and E, over I_max."""
    return float(np.max(np.abs(one.slow - other.slow))) / max(scene.ellipsoid.inertia)


def orientation_difference(one: Observables, other: Observables) -> float:
    """Largest difference of the entries of the rotation matrices that both know.

    At each time both must know at least one entry in common: a form may know the symmetry axis alone.
    """
    difference = np.abs(one.rotation - other.rotation)
    assert np.isfinite(difference).any(axis=(1, 2)).all()
    return float(np.nanmax(difference))
