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
    """Observables at equispaced times of a run that must succeed."""
    equations = find_form(form) if isinstance(form, str) else form
    problem = equations.problem(scene)
    solution = solve(problem, solver, tolerance, np.linspace(0, problem.end, samples))
    assert solution.success, f"{problem.name} {solver}: {solution.status} {solution.message}"
    return equations.observe(scene, solution.states)


def slow_difference(scene: Scene, one: Observables, other: Observables) -> float:
    """Largest difference of L and E, over I_max."""
    return float(np.max(np.abs(one.slow - other.slow))) / max(scene.ellipsoid.inertia)


def orientation_difference(one: Observables, other: Observables) -> float:
    """Largest difference of the entries of t_ij that both know; at least one row each."""
    difference = np.abs(one.rotation - other.rotation)
    assert np.isfinite(difference).any(axis=(1, 2)).all()
    return float(np.nanmax(difference))
