"""References: solutions in extended precision with a stated uncertainty, never a contestant's own."""

import hashlib
import json
from dataclasses import dataclass, replace
from importlib.metadata import version

import numpy as np

from polhode.harness import cache
from polhode.harness.errors import errors
from polhode.models.catalogue import form as find_form
from polhode.models.form import Form
from polhode.models.observables import Observables
from polhode.models.problem import Problem
from polhode.models.scene import Scene
from polhode.solvers.contract import Record
from polhode.solvers.taylor import propagate, taylor_integrator

# Two tolerances of the long double run; their difference, times the safety factor, is its own uncertainty.
TOLERANCES = (1e-19, 1e-17)
SAFETY = 10.0
# Seeds of the perturbations by half an ulp in the start, and in the parameters, that double precision cannot tell.
ROUNDING_SEEDS = (1, 2)
SCHEMA = 2


class ReferenceFailedError(RuntimeError):
    """The reference run did not reach its end; the message says why."""


@dataclass(frozen=True)
class Reference:
    """Observables of a form's exact solution, and how well they are known.

    Parameters
    ----------
    form : str
    times : ndarray, shape (n,)
        In the form's own time.
    observables : Observables
    slow_uncertainty : float
        Over I_max; not less than the spread from half an ulp in start and parameters.
    orientation_uncertainty : float or None
        In rad.
    """

    form: str
    times: np.ndarray
    observables: Observables
    slow_uncertainty: float
    orientation_uncertainty: float | None


def reference(scene: Scene, form: str | Form, samples: int) -> Reference:
    """Reference solution of a scene by a form's own equations, from the cache or computed.

    Long double Taylor runs at two tolerances, from the very parameters in double precision that the contestants
    receive, and runs with start and parameters moved by half an ulp.

    Parameters
    ----------
    scene : Scene
    form : str or Form
        A full form gives the reference of all full forms; an averaged one its own exact solution.
    samples : int
        Equispaced times from 0 to the end, both included.

    Raises
    ------
    ReferenceFailedError
        If a run does not reach its end.
    """
    shape = find_form(form) if isinstance(form, str) else form
    problem = shape.problem(scene)
    key = _key(problem, samples)
    arrays = cache.load(key)
    if arrays is None:
        arrays = _compute(scene, shape, problem, samples)
        cache.keep(key, arrays)
    orientation = float(arrays["orientation_uncertainty"])
    return Reference(
        shape.name,
        arrays["times"],
        Observables(arrays["angular_momentum"], arrays["energy"], arrays["rotation"]),
        float(arrays["slow_uncertainty"]),
        None if np.isnan(orientation) else orientation,
    )


def _compute(scene: Scene, form: Form, problem: Problem, samples: int) -> dict[str, np.ndarray]:
    times = np.linspace(0.0, problem.end, samples)
    tight, loose = (form.observe(scene, _long_double_run(problem, times, tolerance)) for tolerance in TOLERANCES)
    own = errors(scene.ellipsoid, loose, tight)
    slow, orientation = SAFETY * own.slow, None if own.orientation is None else SAFETY * own.orientation
    for seed in ROUNDING_SEEDS:
        moved = form.observe(scene, _long_double_run(_rounded_otherwise(problem, seed), times, TOLERANCES[1]))
        spread = errors(scene.ellipsoid, moved, tight)
        slow = max(slow, spread.slow)
        if orientation is not None and spread.orientation is not None:
            orientation = max(orientation, spread.orientation)
    return {
        "times": times,
        "angular_momentum": tight.angular_momentum.astype(float),
        "energy": tight.energy.astype(float),
        "rotation": tight.rotation.astype(float),
        "slow_uncertainty": np.array(slow),
        "orientation_uncertainty": np.array(np.nan if orientation is None else orientation),
    }


def _long_double_run(problem: Problem, times: np.ndarray, tolerance: float) -> np.ndarray:
    start = np.array(problem.start, dtype=np.longdouble)
    parameters = np.array(problem.parameters, dtype=np.longdouble)
    integrator = taylor_integrator(problem.field, problem.dimension, len(parameters), tolerance, "long double")
    integrator.time, integrator.state[:], integrator.pars[:] = np.longdouble(0), start, parameters
    rows = np.empty((len(times), len(start)), dtype=np.longdouble)
    rows[0] = start
    status, message = propagate(integrator, Record(times, rows))
    if not status.success:
        raise ReferenceFailedError(f"the reference of form {problem.name!r} ended with {status}: {message}")
    return rows


def _rounded_otherwise(problem: Problem, seed: int) -> Problem:
    """The problem with each number of start and parameters moved by half an ulp, up or down."""
    generator = np.random.default_rng(seed)

    def moved(values: tuple[float, ...]) -> tuple[np.longdouble, ...]:
        exact = np.array(values, dtype=np.longdouble)
        ulp = np.spacing(np.abs(np.array(values)))
        signs = generator.choice([-0.5, 0.5], len(values))
        return tuple(np.where(exact == 0, exact, exact + signs * ulp))

    mass, *others = problem.parameters or (0.0,)
    return replace(problem, start=moved(problem.start), parameters=(mass, *moved(tuple(others))))


def _key(problem: Problem, samples: int) -> str:
    content = {
        "schema": SCHEMA,
        "form": problem.name,
        "start": [value.hex() for value in problem.start],
        "parameters": [value.hex() for value in problem.parameters or ()],
        "end": problem.end.hex(),
        "samples": samples,
        "tolerances": TOLERANCES,
        "seeds": ROUNDING_SEEDS,
        "heyoka": version("heyoka"),
    }
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()
