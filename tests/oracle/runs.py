"""Ordinary scenes, every form that accepts them, and references in long double for the tests of solvers."""

from dataclasses import dataclass
from functools import cache
from math import inf, pi

import numpy as np

from polhode.models.catalogue import FORMS, form
from polhode.models.form import FormNotValidError
from polhode.models.observables import Observables
from polhode.models.problem import Problem
from polhode.models.scene import BodyStart, EulerStart, Scene
from polhode.models.shape import Ellipsoid
from polhode.solvers.compile import parameter_array
from polhode.solvers.contract import Record
from polhode.solvers.solve import solve
from polhode.solvers.taylor import propagate, taylor_integrator

_PAPER = EulerStart((pi / 3, pi / 6, 0.0), (1.0, 1.0, -1.0))
_SPINNING = EulerStart((1.1, 0.4, 0.2), (0.2, 0.3, -1.0))

# Shapes of all kinds, St from 0 to infinity, some tens of shear times: numbers are made up. None is stiff,
# which is asked of the classical problems. No averaged one meets L² = 2EI₂: its field is continuous there,
# but not Lipschitz, so that no method keeps to its tolerance.
SCENES = {
    "triaxial": Scene(Ellipsoid((1.0, 0.8, 0.5)), 3e3, _PAPER, 80.0),
    "triaxial-damped": Scene(Ellipsoid((0.6, 1.0, 0.8)), 30.0, _SPINNING, 30.0),
    "prolate": Scene(Ellipsoid((1.0, 1.0, 2.0)), 200.0, _PAPER, 40.0),
    "oblate": Scene(Ellipsoid((0.5, 1.0, 1.0)), 50.0, _SPINNING, 40.0),
    "planar": Scene(
        Ellipsoid((1.0, 0.5, 0.8)), 20.0, BodyStart((1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.8)), 30.0
    ),
    "torque-free": Scene(Ellipsoid((1.0, 0.8, 0.5)), inf, _PAPER, 20.0),
    "no-inertia": Scene(Ellipsoid((1.0, 0.8, 0.5)), 0.0, EulerStart((1.1, 0.4, 0.2)), 40.0),
}
SAMPLES = 41  # Times at which a run is compared with its reference.
# Tolerance of the references in long double, some ten times its rounding error; and in double precision, of the
# form for whose series heyoka needs many seconds at each tolerance. Few steps take that form to its end, so
# that doubles will do.
TOLERANCE = 1e-18
DOUBLE_TOLERANCE = 1e-15
SLOW_TO_COMPILE = "averaged-second-order"


@dataclass(frozen=True)
class Run:
    """One form of one scene, with its reference."""

    scene: str
    form: str

    def __str__(self) -> str:
        return f"{self.scene}-{self.form}"

    @property
    def problem(self) -> Problem:
        return _problem(self.scene, self.form)

    @property
    def times(self) -> np.ndarray:
        return np.linspace(0.0, self.problem.end, SAMPLES)

    @property
    def rotations(self) -> float:
        """∫|ω|dt / 2π, one at least, with half the shear rate without inertia; one for forms without orientation."""
        return 1.0 if form(self.form).orientation == "none" else _rotations(self.scene)

    def error(self, states: np.ndarray) -> float:
        """Largest error of L and E over I_max, and of the entries of the rotation matrix."""
        scene = SCENES[self.scene]
        observed = form(self.form).observe(scene, states)
        expected = _reference(self.scene, self.form)
        slow = np.max(np.abs(observed.slow - expected.slow)) / max(scene.ellipsoid.inertia)
        turned = np.abs(observed.rotation - expected.rotation)
        known = ~np.isnan(expected.rotation)
        return float(max(slow, np.max(turned[known], initial=0.0)))


def runs(*, closed: bool = False) -> list[Run]:
    """Every scene in every form that accepts it, has a vector field and runs in one segment.

    Only those with a closed form, if asked.
    """
    problems = (
        (Run(scene, name), _problem_or_none(scene, name)) for scene in SCENES for name in FORMS
    )
    return [
        run
        for run, problem in problems
        if problem is not None
        and problem.parameters is not None
        and (problem.closed_form or not closed)
        # The equations of a run of several segments follow the tolerance, so that its error does in
        # steps.
        and problem.next_segment is None
    ]


@cache
def _problem(scene: str, name: str) -> Problem:
    return form(name).problem(SCENES[scene])


def _problem_or_none(scene: str, name: str) -> Problem | None:
    try:
        return _problem(scene, name)
    except FormNotValidError:
        return None


@cache
def _states(scene: str, name: str) -> np.ndarray:
    """States of the reference of a scene in a form, shape (samples, dimension), as doubles."""
    problem = _problem(scene, name)
    times = np.linspace(0.0, problem.end, SAMPLES)
    if name == SLOW_TO_COMPILE:
        solution = solve(problem, "cyrk-vern8", DOUBLE_TOLERANCE, times)
        assert solution.success, solution.message
        return solution.states
    parameters = parameter_array(problem)
    integrator = taylor_integrator(
        problem.field, problem.dimension, len(parameters), TOLERANCE, "long double"
    )
    rows = np.empty((len(times), problem.dimension), np.longdouble)
    rows[0] = problem.start
    integrator.time = np.longdouble(0)
    integrator.state[:] = rows[0]
    integrator.pars[:] = parameters
    status, message = propagate(integrator, Record(times, rows))
    assert status.success, message
    return rows.astype(float)


@cache
def _reference(scene: str, name: str) -> Observables:
    return form(name).observe(SCENES[scene], _states(scene, name))


@cache
def _rotations(scene: str) -> float:
    """Rotations of a scene in its full form, one at least; the body's angular velocity follows the quaternion."""
    if SCENES[scene].stokes == 0:
        return SCENES[scene].time / (4 * pi)
    speed = np.linalg.norm(_states(scene, "quaternion")[:, 4:], axis=1)
    return max(1.0, float(np.mean(speed)) * SCENES[scene].time / (2 * pi))
