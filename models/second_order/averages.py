"""Second-order averages of a triaxial ellipsoid: functions of h alone per shape and side of L² = 2EI₂.

With l = |L|, n = L/l, S_n = ½(e_x n_y + e_y n_x), W_n = ½(e_x n_y - e_y n_x), ⊥ the part across n, s₀ = n_x n_y and
w₀ = n_z/2:

========  =========================  ==================================================================================
rate      first order                second order, over St
========  =========================  ==================================================================================
l         l f₀ + f₂w₀                (a₁ + a₂w₀/l) s₀/l
y         g₀ + g₂w₀/l                (b₁ + b₂w₀/l) s₀/l²
L⊥        n×(r₁S_n + r₂W_n)          [p₁S_n⊥ + p₂W_n + n×(p₃S_n + p₄W_n) s₀/l + (p₅S_n⊥ + p₆W_n) w₀/l]/l
α, β      e_α s₀/l, e_β s₀/l
========  =========================  ==================================================================================
"""

from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from polhode.models.second_order.field import NAMES
from polhode.models.second_order.polhodes import Polhodes, SidedBody
from polhode.models.second_order.torus import Torus, turning

Array = np.ndarray

# Polhode phases per ln(1/nome) that resolve second-order averages to 1e-9; at least so many, in steps of so many.
PHASES, LEAST_PHASES, STEP_OF_PHASES = 90.0, 24, 8
# Flow directions, as rows, and |L| at which the averages are taken, so that their parts can be separated.
_TURNS = np.array([[[2, -1, 2], [2, 2, -1], [-1, 2, 2]], [[6, 2, 3], [-3, 6, 2], [-2, -3, 6]]])
_TURNS = _TURNS / np.array([[[3]], [[7]]])
EVERY_FRAME, SIZES = np.repeat(_TURNS, 2, axis=0), np.tile([1.0, 2.0], len(_TURNS))
# Modes (-k₁, k₂), k₂ = 1, 2, 3 and k₁ up to this, whose strength is kept.
MODES = 24


def averages(side: SidedBody, y: Array) -> tuple[dict[str, Array], float, Array]:
    """Coefficients by name, each shape (m,), at y, shape (m,), and the largest relative residual of their fit.

    Beside them the strength of modes in L', shape (m, k₁, k₂, 3), the largest of several orientations of L: at l = 0,
    what it gains per l, and that of all modes at l = 1.
    """
    counts, found = phases(side, y), {}
    for count in np.unique(counts).tolist():
        here = np.flatnonzero(counts == count)
        found |= dict(zip(here.tolist(), _at(side, y[here], count), strict=True))
    numbers, residuals, strengths = zip(*(found[i] for i in range(len(y))), strict=True)
    return dict(zip(NAMES, np.array(numbers).T, strict=True)), max(residuals), np.array(strengths)


def phases(side: SidedBody, y: Array) -> Array:
    """Numbers of polhode phases that resolve polhodes, of few kinds, so that many polhodes are averaged at once."""
    from scipy.special import ellipk, ellipkm1

    _, _, complement = Polhodes(side, y, np.zeros_like(y), 2).moduli
    needed = PHASES * ellipkm1(complement) / (np.pi * ellipk(complement))
    return LEAST_PHASES + STEP_OF_PHASES * np.ceil(np.maximum(needed - LEAST_PHASES, 0) / STEP_OF_PHASES).astype(int)


def _at(side: SidedBody, levels: Array, count: int) -> Iterator[tuple[list[float], float, Array]]:
    """What is found at each of several levels, with so many polhode phases."""
    poses, m = len(SIZES), len(levels)
    size, frames, zero = np.tile(SIZES, m), np.tile(EVERY_FRAME, (m, 1, 1)), np.zeros(m * poses)
    polhode = Polhodes(side, np.repeat(levels, poses), zero, count)
    torus = Torus(polhode, size, zero, frames[:, 0], frames[:, 1])
    mean, second = np.real(torus.spectrum[:, 0, 0]), second_order(torus)
    strengths = np.linalg.norm(torus.spectrum[..., :3], axis=-1)
    for i in range(m):
        own = slice(poses * i, poses * (i + 1))
        numbers, residual = _coefficients(mean[own], second[own])
        numbers += [float(polhode.rate[own][0]), float(polhode.precession[own][0])]
        yield numbers, residual, _strengths(strengths[own])


def _coefficients(mean: Array, second: Array) -> tuple[list[float], float]:
    """Coefficients of first and second order from the means in all poses, and the misfit."""
    x, y, z = (EVERY_FRAME[:, i] for i in range(3))
    over, s0, w0 = 1 / SIZES, x[:, 2] * y[:, 2], z[:, 2] / 2
    s, w = s0 * over, w0 * over
    flow = [0.5 * (x * y[:, 2:] + sign * y * x[:, 2:])[:, :2] for sign in (1, -1)]
    turned = [np.stack([-part[:, 1], part[:, 0]], axis=1) for part in flow]
    across = [(part.T * over).T for part in flow]
    steep = [*((part.T * s * over).T for part in turned), *((part.T * w).T for part in across)]
    parts = [((SIZES, w0), mean[:, 2]), ((over**0, w), mean[:, 3]), (turned, mean[:, :2])]
    first, left = fitted([*parts, ((s,), mean[:, 4]), ((s,), mean[:, 5])])
    parts = [((s, s * w), second[:, 2]), ((s * over, s * w * over), second[:, 3])]
    higher, right = fitted([*parts, ([*across, *steep], second[:, :2])])
    return [*first, *higher], max(left, right)


def _strengths(spectrum: Array) -> Array:
    """Strengths, shape (MODES, 3, 3), from the moduli of Fourier coefficients, shape (poses, a, b)."""
    found = np.zeros((2, MODES, 3))
    most = min(MODES, spectrum.shape[1] // 2 - 1)
    for i in (0, 1):
        found[i, :most] = spectrum[i::2, : -most - 1 : -1, 1:4].max(axis=0)
    gain = np.maximum(found[1] - found[0], 0)
    return np.stack([np.maximum(found[0] - gain, 0), gain, np.full_like(gain, spectrum[::2].max())], axis=-1)


def second_order(torus: Torus) -> Array:
    """F₂ of (L in its frame, y), shape (m, 4): the mean of the torque's derivative along the generator, U·∂P."""
    p, size = torus.polhode, torus.size[:, None, None]
    change, turn = torus.ambient
    i, wide = p.side.inverse_inertia, (slice(None), None, None)
    x, y = torus.flow[wide], torus.gradient[wide]
    back = np.swapaxes(torus.rotation, -1, -2)
    n = np.broadcast_to([0.0, 0.0, 1.0], turn.shape)
    tilted = change - size[..., None] * np.cross(turn, n)
    arms = size[..., None] * n, x, y, tilted, np.cross(x, turn), np.cross(y, turn)
    body = np.moveaxis(back @ np.stack(np.broadcast_arrays(*arms), axis=-1), -1, 0)
    (m, x, y), (dm, dx, dy) = body[:3], body[3:]
    tau = p.side.drag * (turning(p.side, x, y) - i * m)
    change_tau = p.side.drag * (turning(p.side, dx, y) + turning(p.side, x, dy) - i * dm)
    space, change_space = np.moveaxis(torus.rotation @ np.stack([tau, change_tau], axis=-1), -1, 0)
    change_space = change_space + np.cross(turn, space)
    # dh/dt₂ = 2(ω·τ - h L·τ)/l²
    h, slope = p.h[:, None, None], p.slope[:, None, None]
    u = np.fft.ifft2(torus.generator_spectrum[..., 3], axes=(1, 2), norm="forward").real
    spare = (i - h[..., None]) * m
    rate_h = 2 * np.sum(spare * tau, axis=-1) / size**2
    driven, changed = np.sum(m * tau, axis=-1), (i - h[..., None]) * dm * tau + spare * change_tau
    change_h = np.sum(changed, axis=-1) - slope * u * driven
    change_h = 2 * change_h / size**2 - 2 * rate_h * change[..., 2] / size
    return np.concatenate([change_space.mean(axis=(1, 2)), (change_h.mean(axis=(1, 2)) / p.slope)[:, None]], axis=1)


def fitted(parts: Iterable[tuple[Sequence[Array], Array]]) -> tuple[list[float], float]:
    """Real factors by which the arrays of every part give its values, and the largest misfit over the largest value."""
    factors, misfit, largest = [], 0.0, 0.0
    for columns, values in parts:
        found = np.stack([each.ravel() for each in (*columns, values)], axis=1)
        rows = np.concatenate([np.real(found), np.imag(found)])
        solution = np.linalg.lstsq(rows[:, :-1], rows[:, -1], rcond=1e-10)[0]
        factors += solution.tolist()
        misfit = max(misfit, float(np.abs(rows[:, :-1] @ solution - rows[:, -1]).max()))
        largest = max(largest, float(np.abs(values).max()))
    return factors, misfit / largest
