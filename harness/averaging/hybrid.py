"""Errors and cost of `hybrid` on random starts, against the full equations."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from polhode.harness.common import cache
from polhode.harness.common.plain_json import digest
from polhode.harness.references.errors import errors
from polhode.harness.references.extended import extended_run
from polhode.models.catalogue import form as find_form
from polhode.models.catalogue import full_form
from polhode.models.observables import Observables
from polhode.models.scene import BodyStart, Scene
from polhode.models.shape import Ellipsoid
from polhode.solvers.solve import solve

SEED, RANDOM, SAMPLES = 15, 200, 201
LEAST_AXIS = 0.15
STOKES, SLOW_TIMES = (1e4, 1e5, 1e6, 1e7), (0.05, 0.2, 0.5, 1.0, 2.0)
ERRORS = (1e-4, 1e-6, 1e-8)
# Duration up to which the truth is a run in long double, of which a tighter one tells the error; beyond it two
# unrelated methods in double, whose difference is the truth's uncertainty.
LONG_DOUBLE_UP_TO = 1.2e5
LONG_DOUBLE = (1e-18, 1e-16)
DOUBLE = (("taylor", 1e-16), ("cyrk-vern8", 1e-14))


@dataclass(frozen=True)
class Truth:
    """Observables of the full equations, and how well they are known."""

    observables: Observables
    slow_uncertainty: float
    orientation_uncertainty: float


def random_scenes(count: int = RANDOM, seed: int = SEED) -> Iterator[Scene]:
    """Random starts, every other one triaxial, over all St and slow times.

    Axes are log-uniform, orientations isotropic, angular velocities of three standard normals.
    """
    draw = np.random.default_rng(seed)
    for i in range(count):
        axes = np.exp(draw.uniform(np.log(LEAST_AXIS), 0.0, 3))
        quaternion, spin = draw.normal(size=4), draw.normal(size=3)
        if i % 2:
            axes[(i // 2 % 3 + 1) % 3] = axes[(i // 2 % 3 + 2) % 3]
        stokes = STOKES[i // 2 % len(STOKES)]
        time = SLOW_TIMES[i // (2 * len(STOKES)) % len(SLOW_TIMES)] * stokes
        yield Scene(
            Ellipsoid(tuple(axes.tolist())), stokes, BodyStart(tuple(quaternion.tolist()), tuple(spin.tolist())), time
        )


def truth(scene: Scene, samples: int = SAMPLES) -> Truth:
    """The full equations' solution at equispaced times, from the cache or computed."""
    form = find_form(full_form(scene))
    problem = form.problem(scene)
    values = (*problem.start, *(problem.parameters or ()), problem.end)
    key = digest(["hybrid", problem.name, [value.hex() for value in values], samples, LONG_DOUBLE, DOUBLE])
    found = cache.load(key)
    if found is None:
        times = np.linspace(0.0, problem.end, samples)
        if problem.end <= LONG_DOUBLE_UP_TO:
            runs = [extended_run(problem, times, "long double", tolerance) for tolerance in LONG_DOUBLE]
        else:
            runs = [solve(problem, solver, tolerance, times).states for solver, tolerance in DOUBLE]
        tight, other = (form.observe(scene, states) for states in runs)
        apart = errors(scene.ellipsoid, other, tight)
        found = {
            "angular_momentum": tight.angular_momentum.astype(float),
            "energy": tight.energy.astype(float),
            "rotation": tight.rotation.astype(float),
            "uncertainty": np.array([apart.slow, apart.orientation]),
        }
        cache.keep(key, found)
    observables = Observables(found["angular_momentum"], found["energy"], found["rotation"])
    return Truth(observables, *found["uncertainty"].tolist())
