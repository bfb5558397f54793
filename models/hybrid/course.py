"""How a hybrid run goes on from where it stands: averaged to second order, or by the full equations."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import floor, log10

import numpy as np

from polhode.models.catalogue import form as find_form
from polhode.models.catalogue import full_form
from polhode.models.forms.spheroid import Spheroid
from polhode.models.observables import Observables
from polhode.models.problem import Piece, Problem
from polhode.models.rotation import quaternion_from_matrix
from polhode.models.scene import Scene, Start, start_from
from polhode.models.second_order import field as triaxial
from polhode.models.second_order import spheroid as spheroidal
from polhode.models.second_order.form import SecondOrder, slow_start
from polhode.models.second_order.outline import Stretch, outline
from polhode.models.second_order.run import NotAveragedError, entered

Array = np.ndarray

# The error of L and E that a tolerance stands for.
ERROR_PER_TOLERANCE = 100.0
# How fast angles go wrong, over St and the error of L over I_max.
RATE = 5.0
# A run of so few turns costs less than to look ahead; the shear turns any body about so fast.
SHORT, LEAST_SPEED = 1000, 0.5
# Turns by which a window is lengthened where no slow state belongs to its end.
MORE = 50


@dataclass(frozen=True)
class HybridCourse:
    """The course of a scene's run; its states are those of the form of the full equations.

    `stretches` are those foreseen at the time `since` from the run's state then, errors allowed being smaller than the
    one asked for by a factor: what is wrong before a resonance comes out of it larger.
    """

    scene: Scene
    since: float = 0.0
    stretches: tuple[Stretch, ...] = ()
    factor: float = 1.0

    def __call__(self, time: float, state: Array, tolerance: float) -> Piece:
        """Return the next piece."""
        scene, stokes = self.scene, self.scene.stokes
        here = replace(scene, start=self.start(state), time=scene.time - time)
        if not self.stretches:
            found, factor = foreseen(here, ERROR_PER_TOLERANCE * tolerance)
            return replace(self, since=time, stretches=found, factor=factor)(time, state, tolerance)
        stretch, *rest = self.stretches
        end, reason, later = self.since + stretch.end * stokes, stretch.reason, replace(self, stretches=tuple(rest))
        if stretch.second_order:
            try:
                problem, states = second_order(here)
            except NotAveragedError as refusal:
                size = float(np.linalg.norm(here.initial.angular_momentum)) / max(scene.ellipsoid.inertia)
                end, reason, later = time + 2 * np.pi * MORE / max(size, 0.1), str(refusal), HybridCourse(scene)
            else:
                own = min(tolerance / self.factor / 10, 1e-2 / stokes)
                return Piece(problem, end, states, "second order", stretch.error, _rounded(own), later)
        elif self.factor > 2 or stretch.decisive:
            later = HybridCourse(scene)
        full = find_form(full_form(scene)).problem(scene)
        own = _rounded(tolerance / self.factor / 10)
        return Piece(replace(full, start=tuple(state.tolist())), end, None, reason, 0.0, own, later)

    def start(self, state: Array) -> Start:
        """The start of a scene from a state of the full equations."""
        return start_from(self.scene.ellipsoid, find_form(full_form(self.scene)).observe(self.scene, state[None]))


def foreseen(scene: Scene, error: float) -> tuple[tuple[Stretch, ...], float]:
    """Stretches of a run, and the factor by which the kicks of its resonances make errors before them larger."""
    speed = max(LEAST_SPEED, float(np.linalg.norm(scene.angular_velocity)))
    if speed * scene.time < 2 * np.pi * SHORT:
        return (Stretch(0.0, scene.slow_time, False, "the run is short"),), 1.0
    found, factor = outline(scene, error), 1.0
    for _ in range(2):
        last, amplified = 0.0, 1.0
        for kick in sorted(found.kicks, key=lambda each: each.time):
            amplified *= 1 + RATE * kick.size * scene.stokes * (kick.time - last)
            last = kick.time
        if amplified < 2 * factor:
            break
        factor = min(amplified, 1e6)
        found = outline(scene, error / factor)
    return found.stretches, factor


def second_order(scene: Scene) -> tuple[Problem, Callable[[Array], Array]]:
    """The averaged problem of a scene, and states of the full equations of its states.

    Raises NotAveragedError where no slow state belongs to the start.
    """
    ellipsoid, factor = scene.ellipsoid, scene.torque_factor
    name, end, unit = SecondOrder.name, scene.slow_time, scene.stokes
    if ellipsoid.kind == "triaxial":
        entry = entered(ellipsoid, factor, scene.initial_rotation, scene.initial.angular_momentum[0])
        problem = Problem(name, triaxial.field, entry.state, end, entry.parameters, time_unit=unit)
        return problem, lambda states: states_of(scene, entry.observe(states))
    slow = slow_start(scene)
    if slow is None:
        raise NotAveragedError("St is too small for |L|")
    parameters = spheroidal.parameters(Spheroid.of(ellipsoid), factor)
    problem = Problem(name, spheroidal.field, (*slow, 0.0), end, parameters, time_unit=unit)
    return problem, lambda states: states_of(scene, SecondOrder().observe(scene, states))


def states_of(scene: Scene, seen: Observables) -> Array:
    """States of the form of the full equations, shape (n, d), that have these observables."""
    if scene.ellipsoid.kind == "triaxial":
        spin = np.einsum("nij,nj->ni", seen.rotation, seen.angular_momentum) / np.array(scene.ellipsoid.inertia)
        return np.column_stack([quaternion_from_matrix(seen.rotation), spin])
    spheroid = Spheroid.of(scene.ellipsoid)
    return np.column_stack([seen.angular_momentum / spheroid.equatorial_inertia, seen.rotation[:, spheroid.axis]])


def _rounded(tolerance: float) -> float:
    """Down to a power of ten: some solvers compile for each tolerance anew."""
    return max(1e-14, 10.0 ** floor(log10(tolerance) + 1e-9))
