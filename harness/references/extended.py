"""Runs in extended precision, from the problem's own doubles; where these take too long, two methods in double."""

from math import inf, nan
from time import perf_counter

import numpy as np

from polhode.harness.references.errors import errors, statistics_distance
from polhode.models.catalogue import form as find_form, full_form
from polhode.models.observables import Observables
from polhode.models.problem import Problem
from polhode.models.scene import Scene
from polhode.solvers.contract import Record
from polhode.solvers.solve import solve
from polhode.solvers.taylor import Precision, propagate, taylor_integrator

# Steps after which a run is given up, of equations in slow time and of all others: minutes of work.
MOST_SLOW_STEPS, MOST_STEPS = 200_000, 50_000_000
# Rotations: up to the first number extended precision is used, beyond the second one not even this.
EXTENDED_UP_TO, MOST_ROTATIONS = 2e4, 2e5
# The methods: the reference's own for spheroids and for other shapes, and the one that it is held against.
SPHEROIDS, OTHERS = ("splitting-extended", 1e-13), ("taylor", 1e-15)
AGAINST = ("cyrk-vern8", 1e-14)
# Slow error, over I_max, from which on the two do not confirm each other.
APART = 1e-4


class ReferenceFailedError(RuntimeError):
    """There is no reference; `status` is that of the run that failed, empty if none did."""

    def __init__(self, message: str, status: str = "") -> None:
        super().__init__(message)
        self.status = status


def extended_run(
    problem: Problem, times: np.ndarray, precision: Precision, tolerance: float, deadline: float = inf
) -> np.ndarray:
    """States in long double, shape (n, d), of a Taylor run in a precision that holds at least as much."""
    # Given up at a deadline, as `time.perf_counter` reads.
    count = len(problem.parameters or ())
    integrator = taylor_integrator(problem.field, problem.dimension, count, tolerance, precision)
    number = integrator.state.dtype
    integrator.time = number.type(0)
    integrator.state[:] = np.array(problem.start).astype(number)
    integrator.pars[:] = np.array(problem.parameters).astype(number)
    rows = np.empty((len(times), problem.dimension), dtype=number)
    rows[0] = integrator.state
    most = MOST_STEPS if problem.time_unit == 1 else MOST_SLOW_STEPS
    status, message = propagate(integrator, Record(times, rows, deadline, most))
    if not status.success:
        raise ReferenceFailedError(f"the reference of form {problem.name!r} ended with {status}: {message}", status)
    if rows.dtype == np.longdouble:
        return rows
    # NumPy knows no cast from quadruple: it goes by two doubles.
    high = rows.astype(float)
    return high.astype(np.longdouble) + (rows - high.astype(rows.dtype)).astype(float)


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
