"""The pieces of a hybrid run: averaged to second order, or by the full equations."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from polhode.models.catalogue import form as find_form, full_form
from polhode.models.forms.spheroid import Spheroid
from polhode.models.observables import Observables
from polhode.models.problem import ROUNDING, Piece, Problem
from polhode.models.rotation import quaternion_from_matrix
from polhode.models.scene import Scene, start_from
from polhode.models.second_order import field as triaxial, spheroid as spheroidal
from polhode.models.second_order.form import SecondOrder, slow_start
from polhode.models.second_order.outline import Stretch, outline
from polhode.models.second_order.path import LEAST_SPEED
from polhode.models.second_order.run import NotAveragedError, entered
from polhode.models.shape import Ellipsoid

Array = np.ndarray

# Error of L and E over the tolerance that stands for it; chosen by trial.
ERROR_PER_TOLERANCE = 100.0
# Share of that error that windows may take; chosen by trial.
WINDOWS = 0.5
# Error of L and E over the tolerance of the full equations, per radian that a body turns with
# |L||ω| below I_max, by trial; solvers that err by more are run at tighter tolerances.
PER_RADIAN = 2e-2
# Tolerance of averaged pieces, which cost next to nothing.
_AVERAGED_TOLERANCE = 1e-12
# Tolerances of windows: a short list, as some solvers compile for each tolerance anew.
_WINDOW_TOLERANCES = 1e-8, 3e-9, 1e-9, 3e-10, 1e-10, 3e-11, 1e-11, 3e-12, 1e-12, 3e-13, ROUNDING
# A run of fewer turns costs less than to look ahead.
_SHORT = 1000
# Turns by which a window is lengthened where no slow state belongs to its end, chosen by trial.
_MORE = 50


@dataclass(frozen=True)
class HybridCourse:
    """The course of a scene's run; its states belong to the form of the full equations.

    `full` are the full equations. `stretches` were foreseen at the time `since` from the run's
    state then. The pieces before have taken `spent` of the requested error, the windows among them
    `worn`.
    """

    scene: Scene
    full: Problem
    since: float = 0.0
    stretches: tuple[Stretch, ...] = ()
    spent: float = 0.0
    worn: float = 0.0

    def __call__(self, time: float, state: Array, tolerance: float) -> Piece:
        """Return the next piece."""
        stokes = self.scene.stokes
        if not self.stretches:
            error = ERROR_PER_TOLERANCE * tolerance
            left = max(error - self.spent, error / 10)
            stretches = foreseen(self.remaining(time, state), left)
            return replace(self, since=time, stretches=stretches)(time, state, tolerance)
        stretch, *later_stretches = self.stretches
        end = self.since + stretch.end * stokes
        reason = stretch.reason
        later = replace(self, stretches=tuple(later_stretches))
        if stretch.second_order:
            try:
                problem, states = second_order(self.scene, state)
            except NotAveragedError as refusal:
                more = 2 * np.pi * _MORE / speed(self.remaining(time, state))
                end = time + more
                reason = str(refusal)
                later = replace(self, stretches=())
                turned = more * wear(self.remaining(time, state)) / stokes
                stretch = replace(
                    stretch, end=stretch.start + more / stokes, second_order=False, turned=turned
                )
            else:
                angle = self.angle(end - time, stretch.error) + stretch.swing
                later = replace(later, spent=self.spent + stretch.error)
                return Piece(
                    problem,
                    end,
                    states,
                    "second order",
                    stretch.error,
                    angle,
                    _AVERAGED_TOLERANCE,
                    later,
                    averaged=True,
                )
        elif stretch.decisive:
            later = replace(self, stretches=())
        ahead = (stretch, *later_stretches)
        piece_tolerance, cost = full_tolerance(ahead, stokes, tolerance, self.worn)
        angle = self.angle(end - time, cost)
        later = replace(later, spent=self.spent + cost, worn=self.worn + cost)
        return Piece(
            replace(self.full, start=tuple(state.tolist())),
            end,
            None,
            reason,
            cost,
            angle,
            piece_tolerance,
            later,
        )

    def angle(self, duration: float, error: float) -> float:
        """Error in rad that angles gain in a duration from the error of L so far and a new one."""
        _, middle, high = sorted(self.scene.ellipsoid.inertia)
        return min(np.pi, (self.spent + error) * duration * high / middle)

    def remaining(self, time: float, state: Array) -> Scene:
        """The scene from a state of the full equations on, for the time that is left."""
        if time == 0 and tuple(state.tolist()) == self.full.start:
            return self.scene
        start = start_from(self.scene.ellipsoid, observed(self.scene, state))
        return replace(self.scene, start=start, time=self.scene.time - time)


def observed(scene: Scene, state: Array) -> Observables:
    """Observables of a state of the full equations."""
    return find_form(full_form(scene)).observe(scene, state[None])


def speed(scene: Scene) -> float:
    """Approximate rate of turning, in rad per unit of time, no less than by the shear."""
    return max(LEAST_SPEED, float(np.linalg.norm(scene.angular_velocity)))


def wear(scene: Scene) -> float:
    """`Path.wear` where a scene starts."""
    size = float(np.linalg.norm(scene.initial.angular_momentum)) / max(scene.ellipsoid.inertia)
    return speed(scene) * max(1.0, size * speed(scene))


def full_tolerance(
    ahead: Sequence[Stretch], stokes: float, tolerance: float, worn: float
) -> tuple[float, float]:
    """Tolerance of the full equations in the first stretch ahead, and its share of the error.

    Windows share their error by how long they last, which costs least; those behind have taken
    `worn` of it.
    """
    first = ahead[0]
    error = WINDOWS * ERROR_PER_TOLERANCE * tolerance
    lasting = sum(window.end - window.start for window in ahead if not window.second_order)
    share = (error - worn if worn < error else error / 10) * (first.end - first.start) / lasting
    tolerances = tolerance, *(tighter for tighter in _WINDOW_TOLERANCES if tighter < tolerance)
    grows = PER_RADIAN * first.turned * stokes
    chosen = next((loose for loose in tolerances if loose * grows <= share), tolerances[-1])
    return chosen, max(chosen, ROUNDING) * grows


def foreseen(scene: Scene, error: float) -> tuple[Stretch, ...]:
    """Stretches of a run for a requested error."""
    if speed(scene) * scene.time < 2 * np.pi * _SHORT:
        return (
            Stretch(
                0.0,
                scene.slow_time,
                False,
                "the run is short",
                turned=wear(scene) * scene.slow_time,
            ),
        )
    return outline(scene, error).stretches


def second_order(scene: Scene, state: Array) -> tuple[Problem, Callable[[Array], Array]]:
    """The averaged problem of a scene from a full state on, and a map of its states to full ones.

    Raises NotAveragedError where no slow state belongs to the start.
    """
    ellipsoid = scene.ellipsoid
    factor = scene.torque_factor
    form = SecondOrder()
    if ellipsoid.kind == "triaxial":
        start = observed(scene, state)
        entry = entered(ellipsoid, factor, start.rotation[0], start.angular_momentum[0])
        problem = form.slow_problem(scene, triaxial.field, entry.state, entry.parameters)
        return problem, lambda states: states_of(ellipsoid, entry.observe(states))
    spheroid = Spheroid.of(ellipsoid)
    *momentum, px, py, pz = state.tolist()
    slow = slow_start(spheroid, factor, (*momentum, *spheroidal.unit((px, py, pz))))
    if slow is None:
        raise NotAveragedError("St is too small for |L|")
    problem = form.slow_problem(
        scene, spheroidal.field, (*slow, 0.0), spheroidal.parameters(spheroid, factor)
    )
    return problem, partial(spheroidal.exact, spheroid, factor)


def states_of(ellipsoid: Ellipsoid, observables: Observables) -> Array:
    """States of the form `quaternion`, shape (n, 7), that have these observables."""
    spin = np.einsum("nij,nj->ni", observables.rotation, observables.angular_momentum) / np.array(
        ellipsoid.inertia
    )
    return np.column_stack([quaternion_from_matrix(observables.rotation), spin])
