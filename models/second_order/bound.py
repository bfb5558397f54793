"""How wrong a triaxial run averaged to second order is expected to be."""

from functools import lru_cache
from math import inf, pi

import numpy as np

from polhode.models.operations import FLOAT
from polhode.models.scene import Scene
from polhode.models.second_order import tables as triaxial
from polhode.models.second_order.field import SlowField
from polhode.models.second_order.run import ESTIMATES, prepared
from polhode.models.second_order.slow_path import slow_path
from polhode.models.second_order.spheroid_error import Estimate

Array = np.ndarray


@lru_cache(maxsize=64)
def estimated(scene: Scene) -> Estimate:
    """Model errors: the second-order term along the path, times the size of the transformation that it rests on."""
    run, factor, unit = prepared(scene), scene.torque_factor, max(scene.ellipsoid.inertia)
    rhs = SlowField(run.table.series.shape[1])(FLOAT)
    both, without = (triaxial.parameters(scene.ellipsoid, each, run.table) for each in (factor, 0.0))

    def rates(y: Array) -> Array:
        return np.array(rhs((*y.tolist(), 0.0, 0.0), both)[:7])

    times, states = slow_path(rates, np.array(run.state[:7]), scene.slow_time)
    inside = (run.table.low <= states[:, 3] ** 2) & (states[:, 3] ** 2 <= run.table.high)
    if times[-1] < scene.slow_time or not inside.all():
        return Estimate(inf, pi)
    gained = np.array([np.array(rhs((*y, 0.0, 0.0), without)[:3]) for y in states.tolist()])
    gained = np.abs(np.array([rates(y)[:3] for y in states]) - gained)
    second = np.concatenate([[0.0], np.cumsum(np.diff(times) * 0.5 * (gained[1:] + gained[:-1]).max(axis=1))])

    few = np.unique(np.linspace(0, len(times) - 1, ESTIMATES).astype(int))
    times, states, second = times[few], states[few], second[few]
    momentum = states[:, :3] * unit
    level = triaxial.level(states[:, 3] ** 2)
    relative, torus = triaxial.relative_swing(
        run.side, momentum, triaxial.frame(momentum, states[:, 4:7]), level, run.masks
    )
    swing = factor * relative
    slow = (second + swing * torus.size / unit) * swing
    speed = torus.polhode.precession * unit
    phase = _integral(slow / factor * speed, times) + swing
    # Errors of L accumulate angles, a speed per error over I_max; a kick is as wrong as the phase at which it comes.
    for each in (*run.treated, *run.dropped):
        i = int(np.searchsorted(times[:-1], each.slow_time))
        wrong = min(1.0, phase[i] + swing[i]) if each in run.treated else 1.0
        slow[i:] += each.kick * wrong
    phase = _integral(slow / factor * speed, times) + swing.max()
    return Estimate(float(slow.max()), min(float(phase[-1]), pi))


def _integral(values: Array, times: Array) -> Array:
    """From the first time to each, by trapezia; SciPy would take longer to import than to integrate."""
    return np.concatenate([[0.0], np.cumsum(np.diff(times) * (values[1:] + values[:-1]) / 2)])
