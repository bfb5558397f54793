"""Scenes, references and runs that the study of second-order averaging measures."""

from dataclasses import dataclass
from math import pi
from time import perf_counter

import numpy as np

from polhode.harness.references.errors import Errors, errors
from polhode.models.catalogue import form as find_form
from polhode.models.observables import Observables
from polhode.models.scene import EulerStart, Scene, Start
from polhode.models.shape import Ellipsoid
from polhode.solvers.contract import Record
from polhode.solvers.solve import Solution, solve
from polhode.solvers.taylor import propagate, taylor_integrator

SAMPLES = 2001
REFERENCE_TOLERANCES = (1e-18, 1e-16)
TOLERANCE = 1e-14

PAPER = EulerStart((pi / 3, pi / 6, 0.0), (1.0, 1.0, 1.0))
BACKWARD = EulerStart((pi / 3, pi / 6, 0.0), (1.0, 1.0, -1.0))
AGAINST = EulerStart((1.0, 0.3, 0.2), (-1.0, 0.5, -2.0))
GENTLE = EulerStart((1.5, 2.0, 0.2), (0.6, 0.4, -0.3))
TILTED = (0.8, 0.3, -0.4, 0.2)


@dataclass(frozen=True)
class Case:
    """A shape and a start, followed to one slow time at a range of Stokes numbers."""

    axes: tuple[float, float, float]
    start: Start
    slow_time: float
    exponents: tuple[float, ...] = (4.0, 4.5, 5.0, 5.5, 6.0)

    def scene(self, stokes: float) -> Scene:
        """The scene at one Stokes number."""
        return Scene(Ellipsoid(self.axes), stokes, self.start, self.slow_time * stokes)

    @property
    def names(self) -> tuple[str, str]:
        """Shape and start in words."""
        names: dict[Start, str] = {PAPER: "paper", AGAINST: "against", GENTLE: "gentle", BACKWARD: "paper, ψ̇ = -1"}
        spin = ", ".join(f"{rate:g}" for rate in getattr(self.start, "angular_velocity", ()))
        return ":".join(f"{axis:g}" for axis in self.axes), names.get(self.start, f"ω = ({spin})")


def true_observables(scene: Scene) -> tuple[Observables, Errors]:
    """Observables of the full form in long double, and what a hundredfold tolerance changes in them."""
    form = find_form("quaternion" if scene.ellipsoid.kind == "triaxial" else "spheroid-axis")
    problem = form.problem(scene)
    times = np.linspace(0.0, problem.end, SAMPLES)
    number = np.longdouble
    start, parameters = np.array(problem.start, number), np.array(problem.parameters, number)
    runs = []
    for tolerance in REFERENCE_TOLERANCES:
        integrator = taylor_integrator(problem.field, problem.dimension, len(parameters), tolerance, "long double")
        integrator.time, integrator.state[:], integrator.pars[:] = number(0), start, parameters
        rows = np.empty((len(times), len(start)), number)
        rows[0] = start
        status, message = propagate(integrator, Record(times, rows))
        if not status.success:
            raise RuntimeError(f"the full form ended with {status}: {message}")
        runs.append(form.observe(scene, rows))
    return runs[0], errors(scene.ellipsoid, runs[1], runs[0])


@dataclass(frozen=True)
class Timed:
    """What a run gave and how long it took: wall times in s, preparation and compilation left out.

    Parameters
    ----------
    observables : Observables
    integration : float
        Of the integrator alone.
    seconds : float
        Of the integration and of the observables at all times asked for.
    """

    observables: Observables
    integration: float
    seconds: float


def timed_run(scene: Scene, name: str, tolerance: float, samples: int, solver: str = "taylor") -> Timed:
    """Run a form over equispaced times.

    Raises
    ------
    RuntimeError
        If the run does not reach its end.
    """
    form = find_form(name)
    problem = form.problem(scene)
    solution: Solution = solve(problem, solver, tolerance, np.linspace(0.0, problem.end, samples))
    if not solution.success:
        raise RuntimeError(f"form {name!r} ended with {solution.status}: {solution.message}")
    began = perf_counter()
    observables = form.observe(scene, solution.states)
    return Timed(observables, solution.seconds, solution.seconds + perf_counter() - began)


def fastest(repeats: int, scene: Scene, name: str, tolerance: float, samples: int, solver: str = "taylor") -> Timed:
    """The fastest of several equal runs, each as `timed_run` makes it."""
    runs = (timed_run(scene, name, tolerance, samples, solver) for _ in range(repeats))
    return min(runs, key=lambda run: run.seconds)
