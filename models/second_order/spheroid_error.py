"""Size of what the second-order averaged spheroid leaves out: the third-order average, found along its solution.

The transformation of second order is put into the exact equations. What they then say of the slow variables, averaged
over the fast angle, less what the form says, is the next term; what is left with zero mean is the next correction of
the transformation. The linearised slow equations carry the first along, the second is added where it stands.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import inf, pi

import numpy as np

from polhode.models.forms.spheroid import Spheroid
from polhode.models.operations import FLOAT, numpy_operations
from polhode.models.second_order import spheroid as spheroidal
from polhode.models.second_order.slow_path import slow_path

Array = np.ndarray

ANGLES = 2 * pi * np.arange(12) / 12
# The next term is found at 1/St no smaller than this and scaled as (1/St)², lest it drown in rounding.
LEAST_TORQUE_FACTOR = 1e-4
# Relative step of differences of fourth order: truncation and rounding are both near 1e-12.
STEP = 1e-3


@dataclass(frozen=True)
class Estimate:
    """Estimated model errors of a run: `slow`, of L and E over I_max, and `orientation`, in rad and π at most."""

    slow: float
    orientation: float


@dataclass(frozen=True)
class NextTerm:
    """What comes after second order, at m states."""

    drift: Array  # rates in slow time of L, h and the angle s + arg q that the form does not have, shape (m, 5)
    swing: Array  # changes of L, h, the angle and t₂ that the transformation does not have, at k angles s, (m, k, 6)
    ripple: Array  # largest change per rad of s of the swing of L and h that the transformation has, shape (m, 4)


def estimate(spheroid: Spheroid, torque_factor: float, start: tuple[float, ...], end: float) -> Estimate:
    """Errors of a run from the slow state `start` = (L, q, …) over 0 <= t₂ <= end.

    They are those of the asymptotic expansion's next term: once they come near 1, the expansion has lost its meaning
    and they only say so.
    """
    p = spheroidal.parameters(spheroid, torque_factor)
    rhs = spheroidal.field(FLOAT)
    rates, tidy = lambda y: np.array(rhs((*y, 0.0), p)[:6]), lambda y: np.append(y[:3], spheroidal.unit(y[3:]))
    times, states = slow_path(rates, np.array(start[:6]), end, tidy)
    if times[-1] < end:
        return Estimate(inf, pi)
    factor = max(torque_factor, LEAST_TORQUE_FACTOR)
    term = next_term(spheroid, factor, states)
    shrink = torque_factor / factor
    drift, swing = shrink**2 * term.drift, shrink**2 * term.swing
    drift[:, 4] = shrink * term.drift[:, 4]
    error, angle = _carry(p, torque_factor, times, states, drift, swing[0, 0])

    momentum, axis = states[:, :3], states[:, 3:]
    size = np.linalg.norm(momentum, axis=1)
    h = np.sum(momentum * axis, axis=1) / size
    # A wrong clock shifts the fast angle, and with it the swing that the form puts back.
    delay = np.ptp(swing[:, :, 5], axis=1) + np.abs(swing[:, 0, 5] - swing[0, 0, 5])
    shift = np.minimum(np.abs(angle) + delay * size / torque_factor, pi)
    beside = np.abs(swing[:, :, :4]).max(axis=1) + shift[:, None] * shrink * term.ripple
    beside[:, :3] += delay[:, None] * np.abs(_rates(p, states)[:, :3])
    loss = np.abs(error[:, :3]) + beside[:, :3]

    # E/I_e = L²/2 + (I_e/I_a - 1)(L·p)²/2, L in units of I_e.
    spin = np.abs(np.sum(error * np.concatenate([axis, momentum], axis=1), axis=1)) + size * beside[:, 3]
    growth = np.abs(np.sum(momentum * error[:, :3], axis=1)) + np.sum(np.abs(momentum) * beside[:, :3], axis=1)
    energy = growth + abs(1 / spheroid.inertia_ratio - 1) * size * np.abs(h) * spin
    slow = max(float(loss.max()), float(energy.max())) / max(1.0, spheroid.inertia_ratio)
    turned = np.sqrt(np.clip(1 - h * h, 0, 1)) * shift
    return Estimate(slow, float(turned.max()))


def next_term(spheroid: Spheroid, torque_factor: float, states: Array) -> NextTerm:
    """Third-order averages and swings at slow states (L, q), shape (m, 6), for 1/St = `torque_factor`."""
    coefficients = spheroidal.torque_coefficients(spheroid)
    p = spheroidal.parameters(spheroid, torque_factor)
    m, k = len(states), len(ANGLES)
    momentum = np.repeat(states[:, :3], k, axis=0)
    axis = spheroidal.turned(momentum, np.repeat(states[:, 3:], k, axis=0), np.tile(ANGLES, m))
    slow = np.concatenate([momentum, axis], axis=1)
    size = np.linalg.norm(momentum, axis=1)[:, None]

    def transform(x: Array) -> Array:
        # Homogeneous in p, so that its derivative has an inverse.
        length = np.linalg.norm(x[:, 3:], axis=1)[:, None]
        change, turn = spheroidal.generator(spheroid, x[:, :3], x[:, 3:] / length)
        exact = x[:, 3:] / length + torque_factor * turn
        exact *= length / np.linalg.norm(exact, axis=1)[:, None]
        return np.concatenate([x[:, :3] + torque_factor * change, exact], axis=1)

    exact = transform(slow)
    exact_size = np.linalg.norm(exact[:, :3], axis=1)[:, None]
    clock = torque_factor / exact_size
    pull = clock * spheroidal.torque(coefficients, exact[:, :3], exact[:, 3:])
    rate = np.concatenate([pull, np.cross(exact[:, :3], exact[:, 3:]) / exact_size], axis=1)
    derivative = _derivative(transform, slow, np.repeat([1.0, 0.0], 3) * size + np.repeat([0.0, 1.0], 3))
    per_turn = _reduced(slow, np.linalg.solve(derivative, rate[:, :, None])[:, :, 0])
    rates = np.concatenate([per_turn, clock], axis=1).reshape(m, k, 6)

    mean = rates.mean(axis=1)
    harmonics = np.fft.fftfreq(k, 1 / k)[1:, None]
    spectrum = np.fft.fft(rates, axis=1)
    spectrum[:, 1:] /= 1j * harmonics
    spectrum[:, 0] = 0
    known = _reduced(states, _rates(p, states)[:, :6])
    known[:, 4] += np.linalg.norm(states[:, :3], axis=1) / torque_factor
    pull = torque_factor / size * spheroidal.torque(coefficients, momentum, axis)
    pull = _reduced(slow, np.concatenate([pull, np.zeros_like(pull)], axis=1))[:, :4].reshape(m, k, 4)
    ripple = np.abs(pull - pull.mean(axis=1, keepdims=True)).max(axis=1)
    return NextTerm(mean[:, :5] / mean[:, 5:] - known, np.fft.ifft(spectrum, axis=1).real, ripple)


def _carry(
    p: tuple[float, ...], torque_factor: float, times: Array, states: Array, drift: Array, swing: Array
) -> tuple[Array, Array]:
    """Errors of (L, q), shape (m, 6), and of the angle, shape (m,), by backward Euler steps of the linear equations."""
    n = states[:, :3] / np.linalg.norm(states[:, :3], axis=1)[:, None]
    jacobian = _derivative(lambda y: _rates(p, y), states, np.ones_like(states))
    source = _expanded(states, drift)
    error, angle = np.empty_like(states), np.empty(len(times))
    error[0], angle[0] = _expanded(states[:1], swing[None])[0], swing[4]
    for i, step in enumerate(np.diff(times)):
        error[i + 1] = np.linalg.solve(np.eye(6) - step * jacobian[i + 1], error[i] - step * source[i + 1])
        faster = n[i + 1] @ error[i + 1, :3] / torque_factor
        angle[i + 1] = angle[i] + step * (faster - drift[i + 1, 4])
    return error, angle


def _reduced(states: Array, rates: Array) -> Array:
    """Rates of L, h and the angle of p about n, shape (m, 5), from those of (L, p), shape (m, 6)."""
    size = np.linalg.norm(states[:, :3], axis=1)[:, None]
    n, axis = states[:, :3] / size, states[:, 3:]
    h = np.sum(n * axis, axis=1)
    tilt = (rates[:, :3] - n * np.sum(n * rates[:, :3], axis=1)[:, None]) / size
    lean = np.sum(tilt * axis, axis=1)
    carried = h[:, None] * tilt - lean[:, None] * n
    turn = np.sum(np.cross(n, axis) * (rates[:, 3:] - carried), axis=1) / _sine2(h)
    return np.column_stack([rates[:, :3], lean + np.sum(n * rates[:, 3:], axis=1), turn])


def _expanded(states: Array, changes: Array) -> Array:
    """Changes of (L, q), shape (m, 6), with those of L and h, shape (m, 4 or more), and no turn about n."""
    size = np.linalg.norm(states[:, :3], axis=1)[:, None]
    n, axis = states[:, :3] / size, states[:, 3:]
    h = np.sum(n * axis, axis=1)
    tilt = (changes[:, :3] - n * np.sum(n * changes[:, :3], axis=1)[:, None]) / size
    carried = h[:, None] * tilt - np.sum(tilt * axis, axis=1)[:, None] * n
    fallen = (n - h[:, None] * axis) * (changes[:, 3] / _sine2(h))[:, None]
    return np.concatenate([changes[:, :3], carried + fallen], axis=1)


def _sine2(h: Array) -> Array:
    """1 - h², kept off zero: at h = ±1 every term that it divides vanishes."""
    return np.maximum(1 - h * h, 1e-9)


def _rates(p: tuple[float, ...], states: Array) -> Array:
    """Rates of (L, q), shape (m, 6)."""
    rows = spheroidal.field(numpy_operations())((*states.T, np.zeros(len(states))), p)
    return np.stack(rows[:6], axis=1)


def _derivative(function: Callable[[Array], Array], x: Array, scale: Array) -> Array:
    """Derivatives, shape (m, d, d), of a function of rows, shape (m, d), by differences of fourth order."""
    columns = []
    for i in range(x.shape[1]):
        step = np.zeros_like(x)
        step[:, i] = STEP * scale[:, i]
        near = function(x + step) - function(x - step)
        far = function(x + 2 * step) - function(x - 2 * step)
        columns.append((8 * near - far) / (12 * step[:, i : i + 1]))
    return np.stack(columns, axis=-1)
