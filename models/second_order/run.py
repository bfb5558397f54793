"""Segments of triaxial runs that averaging to second order follows, from pose to pose.

A pose is the exact L and rotation of the body at a time. From it a slow start is found, and from
slow states the poses at later times. `docs/second-order.md`, section 6, has the mathematics.
"""

from dataclasses import dataclass
from math import atan2, copysign, log1p, pi, sqrt

import numpy as np

from polhode.models.libraries import IMPORTS
from polhode.models.observables import Observables
from polhode.models.once import once
from polhode.models.scene import Scene
from polhode.models.second_order import tables
from polhode.models.second_order.polhodes import SidedBody
from polhode.models.second_order.swing import Place, Series, frame, series_for
from polhode.models.shape import Ellipsoid

Array = np.ndarray

# Passes after which no slow state is said to belong to a pose: enough where each pass gains a factor of
# 1.7 or more.
_START_PASSES = 60
# Error of a slow start, relative and in rad, at which passes end: rounding.
_START_CLOSE = 1e-14
# States whose places are held in memory together: some that a processor's cache holds, by trial. Another
# number changes the time alone.
_MAX_STATES = 208
# Columns of states, in the order of `field.STATE`.
_MOMENTUM = slice(0, 3)  # L over I_max
_DEPTH = 3  # a
_FIRST_AXIS = slice(4, 7)  # e₁
_SIGMAS = (7, 8)  # σ_α and σ_β
# Keeps 0/0 away where nothing turns.
_TINY = 1e-300
# Matrices of the cross products with the three unit vectors, each in a row of nine: a vector times
# this is the matrix, of nine entries, of the cross product with the vector.
_CROSS = np.array(
    [[0, 0, 0, 0, 0, -1, 0, 1, 0], [0, 0, 1, 0, 0, 0, -1, 0, 0], [0, -1, 0, 1, 0, 0, 0, 0, 0]],
    float,
)


class NotAveragedError(ValueError):
    """Second-order averaging does not hold; the message is the condition."""


@dataclass(frozen=True)
class Entry:
    """An initial value problem of `field` that follows a body from an exact pose on.

    Its slow time begins there.
    """

    ellipsoid: Ellipsoid
    torque_factor: float
    side: SidedBody
    parameters: tuple[float, ...]  # what the field receives
    state: tuple[float, ...]  # slow start in the field's coordinates
    phases: tuple[float, float]  # α and β of the slow start
    series: Series

    def observe(self, states: Array) -> Observables:
        """Observables with the complete rotation of states, shape (n, 9).

        Fast phases and the O(1/St) swing are put back.
        """
        if not len(states):
            return Observables(np.empty((0, 3)), np.empty(0), np.empty((0, 3, 3)))
        segments = [
            self._exact(states[i : i + _MAX_STATES]) for i in range(0, len(states), _MAX_STATES)
        ]
        momentum, rotation = (np.concatenate(arrays) for arrays in zip(*segments, strict=True))
        rotation = np.swapaxes(rotation @ self.side.axes, 1, 2)
        body = np.einsum("mij,mj->mi", rotation, momentum)
        return Observables(
            momentum, 0.5 * np.sum(body**2 / np.array(self.ellipsoid.inertia), axis=1), rotation
        )

    def _exact(self, states: Array) -> tuple[Array, Array]:
        """L and R of the exact poses; the columns of R are the permuted body axes in space."""
        alpha, beta = (
            phase + states[:, sigma] / self.torque_factor
            for sigma, phase in zip(_SIGMAS, self.phases, strict=True)
        )
        momentum = states[:, _MOMENTUM] * max(self.ellipsoid.inertia)
        a2 = np.maximum(states[:, _DEPTH] ** 2, tables.FLOOR)
        place = Place(self.series, a2, alpha, self.side.normal(-np.expm1(-a2), np.exp(-a2), alpha))
        size = np.linalg.norm(momentum, axis=1)
        q = frame(momentum / size[:, None], states[:, _FIRST_AXIS], beta + place.shape[:, 0])
        change, turn = place.swing(q, size, self.torque_factor)
        return momentum + change, rotation_by(turn) @ q @ place.body


def entered(ellipsoid: Ellipsoid, torque_factor: float, rotation: Array, momentum: Array) -> Entry:
    """Entry from a pose on.

    Rows of `rotation`, shape (3, 3), are the body axes in space; L has shape (3,).

    Raises NotAveragedError where no slow state belongs to the pose: |L| is too small, or L² = 2EI₂
    too near.
    """
    side = SidedBody.of(ellipsoid, rotation @ momentum)
    # Whether axis 3 of the side, which the polhode circles, is the longest one.
    longest = abs(side.axes[2, ellipsoid.order[0]]) == 1
    series = series_for(ellipsoid, longest)
    slow, e1, place = _slow_start(series, torque_factor, momentum, rotation.T @ side.axes.T)
    state = (*(slow / max(ellipsoid.inertia)).tolist(), sqrt(place.a2[0]), *e1.tolist(), 0.0, 0.0)
    # S is the least rotation in this frame: β = -χ.
    phases = float(place.alpha[0]), -float(place.shape[0, 0])
    p = tables.parameters(ellipsoid, torque_factor, longest)
    return Entry(ellipsoid, torque_factor, side, p, state, phases, series)


@once()
def started(scene: Scene) -> Entry:
    """Entry from a scene's start on."""
    return entered(
        scene.ellipsoid,
        scene.torque_factor,
        scene.initial_rotation,
        scene.initial.angular_momentum[0],
    )


def _slow_start(
    series: Series, torque_factor: float, exact: Array, pose: Array
) -> tuple[Array, Array, Place]:
    """Slow L, the e₁ of its frame and its place on the torus; their image is the exact L and pose.

    L has shape (3,). The columns of `pose`, shape (3, 3), are the permuted body axes in space.
    """
    momentum = exact
    rotation = pose
    moved = np.zeros((2, 3))
    left = 1.0
    close = False
    for _ in range(_START_PASSES):
        size = sqrt(momentum @ momentum)
        place = _place(series, momentum @ rotation / size)
        if place is None:
            break
        if place.a2[0] > tables.MAX_A2:
            raise NotAveragedError("L² = 2EI₂ is too near")
        q = rotation @ place.body[0].T
        if close:
            return momentum, q[:, 0], place
        last = moved
        moved = np.concatenate(place.swing(q[None], np.array([size]), torque_factor))
        change, turn = np.abs(moved - last).max(axis=1).tolist()
        before = left
        left = max(change / size, turn)
        # Each pass gains the same factor.
        close = left * min(1, left / before) < _START_CLOSE
        momentum = exact - moved[0]
        rotation = rotation_by(-moved[1:])[0] @ pose
    raise NotAveragedError(f"St = {1 / torque_factor:g} is too small for this start")


def _place(series: Series, z: Array) -> Place | None:
    """Place on the torus of a body in which n has the components z, shape (3,).

    None on L² = 2EI₂ and beyond.
    """
    with IMPORTS:
        from scipy.special import ellipkinc, ellipkm1

    z1, z2, z3 = z.tolist()
    i1, i2, i3 = series.side.inverse_inertia.tolist()
    below = (i1 - i3) * z1 * z1 + (i2 - i3) * z2 * z2
    above = (i2 - i3) * z3 * z3 - (i1 - i2) * z1 * z1
    if above == 0 or not below / above >= 0:
        return None
    # `below` is h - i₃ and `above` is i₂ - h, without cancellation: `share` is x/(1 - x).
    share = max(below / above, tables.FLOOR)
    x = share / (1 + share)
    # Here a2 is the squared amplitude A² of z₁, not a² = -ln(1 - x), which is ln(1 + share).
    a2, _, complement = series.side.moduli(x, 1 / (1 + share))
    # The amplitude is the angle whose sine is sn and whose cosine is cn, as `SidedBody.normal` has them:
    # z₂ has the sign of sn or, around the axis of least inertia, the other one.
    amplitude = atan2(copysign(z2, (i2 - i3) * z2) / sqrt(x), z1 / sqrt(a2))
    alpha = pi / 2 * ellipkinc(amplitude, 1 - complement) / ellipkm1(complement)
    return Place(series, np.array([log1p(share)]), np.array([alpha]), z[None])


def rotation_by(vectors: Array) -> Array:
    """Rotations, shape (m, 3, 3), by vectors, shape (m, 3), in rad (Rodrigues)."""
    # 1 + sin θ K + (1 - cos θ) K² with the matrix K of the unit vector: here `cross` is θK, and `share`
    # is sin(θ/2)/(θ/2).
    half = np.linalg.norm(vectors, axis=1)[:, None, None] / 2 + _TINY
    cross = (vectors @ _CROSS).reshape(-1, 3, 3)
    share = np.sin(half) / half
    return np.eye(3) + share * np.cos(half) * cross + 0.5 * share * share * (cross @ cross)
