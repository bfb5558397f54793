"""References of runs too long for extended precision: two unrelated methods in double precision, known to their gap."""

from math import nan
from time import perf_counter

import numpy as np

from polhode.harness.references.errors import errors, statistics_distance
from polhode.harness.references.extended import ReferenceFailedError
from polhode.models.catalogue import form as find_form, full_form
from polhode.models.observables import Observables
from polhode.models.scene import Scene
from polhode.solvers.solve import solve

# Rotations: up to the first number extended precision is used, beyond the second one not even this.
EXTENDED_UP_TO, MOST = 2e4, 2e5
# The methods: the reference's own for spheroids and for other shapes, and the one that it is held against.
SPHEROIDS, OTHERS = ("splitting-extended", 1e-13), ("taylor", 1e-15)
AGAINST = ("cyrk-vern8", 1e-14)
# Slow error, over I_max, from which on the two do not confirm each other.
APART = 1e-4


def compared(scene: Scene, samples: int, seconds: float) -> dict[str, np.ndarray]:
    """Reference of a scene's full equations, as `reference` keeps it; raises ReferenceFailedError if there is none."""
    until, method = perf_counter() + seconds, OTHERS if scene.ellipsoid.kind == "triaxial" else SPHEROIDS

    def run(form: str, solver: str, tolerance: float) -> Observables:
        equations = find_form(form)
        problem = equations.problem(scene)
        left = until - perf_counter()
        found = solve(problem, solver, tolerance, np.linspace(0.0, problem.end, samples), max_seconds=left)
        if not found.success:
            raise ReferenceFailedError(f"the reference by {solver} ended with {found.status}", found.status)
        return equations.observe(scene, found.states)

    exact, other = run(full_form(scene), *method), run("quaternion", *AGAINST)
    apart = errors(scene.ellipsoid, other, exact)
    if not apart.slow < APART:
        raise ReferenceFailedError(f"two methods are {apart.slow:.1g} apart")
    orientation = nan if apart.orientation is None else apart.orientation
    return {
        "times": np.linspace(0.0, scene.time, samples),
        "angular_momentum": exact.angular_momentum,
        "energy": exact.energy,
        "rotation": exact.rotation,
        "slow_uncertainty": np.array(apart.slow),
        "orientation_uncertainty": np.array(orientation),
        "certificate_by": np.array(["quaternion", AGAINST[0]]),
        "certificate": np.array([1, 0, 1.0, apart.slow, orientation]),
        "precision": np.array("double"),
        "growth_times": np.array([]),
        "growth": np.array([]),
        "meaningful": np.array(samples),
        "statistics_uncertainty": np.array(statistics_distance(scene.ellipsoid, other, exact)),
    }
