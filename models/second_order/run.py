"""Stretches of triaxial runs on one side of L² = 2EI₂ that averaging to second order follows, from pose to pose."""

from dataclasses import dataclass
from functools import lru_cache
from math import sqrt

import numpy as np

from polhode.models.observables import Observables
from polhode.models.scene import Scene
from polhode.models.second_order import tables
from polhode.models.second_order.polhodes import SidedBody
from polhode.models.second_order.swing import Series, Swing, frame, frame_of, series_for, swing_at
from polhode.models.second_order.tables import Pose
from polhode.models.shape import Ellipsoid

Array = np.ndarray

START_PASSES, START_CLOSE = 60, 1e-14
# Times whose tori are held in memory together.
CHUNK = 104


class NotAveragedError(ValueError):
    """Second-order averaging does not hold; the message is the condition."""


@dataclass(frozen=True)
class Entry:
    """What follows a body from an exact pose on: an initial value problem of `field` in slow time since then."""

    ellipsoid: Ellipsoid
    torque_factor: float
    side: SidedBody
    parameters: tuple[float, ...]  # what the field receives
    state: tuple[float, ...]  # slow start in the field's coordinates
    phases: tuple[float, float]  # α and β of the slow start
    series: Series

    def observe(self, states: Array) -> Observables:
        """Observables with the complete rotation of states, shape (n, 9): fast phases and O(1/St) swing put back."""
        pieces = [self._exact(states[i : i + CHUNK]) for i in range(0, len(states), CHUNK)]
        momentum = np.concatenate([piece.momentum for piece in pieces])
        rotation = np.swapaxes(np.concatenate([piece.rotation for piece in pieces]) @ self.side.axes, 1, 2)
        body = np.einsum("mij,mj->mi", rotation, momentum)
        return Observables(momentum, 0.5 * np.sum(body**2 / np.array(self.ellipsoid.inertia), axis=1), rotation)

    def _exact(self, states: Array) -> Pose:
        alpha, beta = (phase + states[:, 7 + i] / self.torque_factor for i, phase in enumerate(self.phases))
        momentum = states[:, :3] * max(self.ellipsoid.inertia)
        q = frame(momentum, states[:, 4:7])
        a2 = np.maximum(states[:, 3] ** 2, tables.FLOOR)
        return _swung(swing_at(self.series, momentum, q, a2, alpha, beta, self.torque_factor), q)


def entered(ellipsoid: Ellipsoid, torque_factor: float, rotation: Array, momentum: Array) -> Entry:
    """Entry from a pose on: rows of `rotation`, shape (3, 3), are the body axes in space, L has shape (3,).

    Raises NotAveragedError where no slow state belongs to the pose: |L| is too small, or L² = 2EI₂ too near.
    """
    side = SidedBody.of(ellipsoid, rotation @ momentum)
    longest = abs(side.axes[2, ellipsoid.order[0]]) == 1
    exact, series = Pose(momentum[None], (rotation.T @ side.axes.T)[None]), series_for(ellipsoid, longest)
    slow, a2, alpha, beta = _slow_start(series, torque_factor, exact)
    unit = max(ellipsoid.inertia)
    state = (*(slow.momentum[0] / unit).tolist(), sqrt(a2), *frame_of(slow.momentum)[0, :, 0].tolist(), 0.0, 0.0)
    p = tables.parameters(ellipsoid, torque_factor, tables.table(ellipsoid, longest))
    return Entry(ellipsoid, torque_factor, side, p, state, (alpha, beta), series)


@lru_cache(maxsize=64)
def started(scene: Scene) -> Entry:
    """Entry from a scene's start on."""
    return entered(scene.ellipsoid, scene.torque_factor, scene.initial_rotation, scene.initial.angular_momentum[0])


def _slow_start(series: Series, torque_factor: float, exact: Pose) -> tuple[Pose, float, float, float]:
    """Slow pose whose image is the exact one, with its a², α and β in the frame of `frame_of`."""
    slow, left, close = exact, 1.0, False
    for _ in range(START_PASSES):
        q = frame_of(slow.momentum)
        a2, alpha, beta = tables.coordinates(series, slow, q)
        if not np.all(np.isfinite([a2, alpha, beta])):
            break
        if a2[0] > tables.MOST:
            raise NotAveragedError("L² = 2EI₂ is too near")
        if close:
            return slow, float(a2[0]), float(alpha[0]), float(beta[0])
        image = _swung(swing_at(series, slow.momentum, q, a2, alpha, beta, torque_factor), q)
        excess = image.momentum - exact.momentum
        turn = image.rotation @ np.swapaxes(exact.rotation, 1, 2)
        vector = 0.5 * (turn - np.swapaxes(turn, 1, 2))[:, [2, 0, 1], [1, 2, 0]]
        before, left = left, max(np.abs(excess).max() / np.linalg.norm(exact.momentum), np.abs(vector).max())
        # Each pass gains the same factor.
        close = left * min(1, left / before) < START_CLOSE
        slow = Pose(slow.momentum - excess, tables.rotation_by(-vector) @ slow.rotation)
    raise NotAveragedError(f"St = {1 / torque_factor:g} is too small for this start")


def _swung(swing: Swing, q: Array) -> Pose:
    """Exact poses of slow ones in frames Q: the generator's flow over 1/St."""
    change, turn = (swing.torque_factor * each for each in swing.generator)
    change[:, 2] += swing.size
    return Pose(np.einsum("mij,mj->mi", q, change), q @ tables.rotation_by(turn) @ swing.body[0])
