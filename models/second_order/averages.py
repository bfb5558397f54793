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

from collections.abc import Iterable, Sequence

import numpy as np

from polhode.models.second_order.polhodes import Polhodes, SidedBody
from polhode.models.second_order.torus import Mask, Torus, skew, torque

Array = np.ndarray

FIRST = ("f0", "f2", "g0", "g2", "r1", "r2", "ea", "eb")
SECOND = ("a1", "a2", "b1", "b2", "p1", "p2", "p3", "p4", "p5", "p6")
NAMES = (*FIRST, *SECOND, "nu1", "nu2")
# Polhode phases per ln(1/nome) that resolve second-order averages to 1e-9, and at least so many.
PHASES, LEAST_PHASES = 90.0, 24
# Flow directions, as rows, and |L| at which the averages are taken, so that their parts can be separated.
_TURNS = np.array([[[2, -1, 2], [2, 2, -1], [-1, 2, 2]], [[6, 2, 3], [-3, 6, 2], [-2, -3, 6]]]) / np.array(
    [[[3]], [[7]]]
)
FRAMES = np.concatenate([_TURNS, np.swapaxes(_TURNS, 1, 2)])
EVERY_FRAME, SIZES = np.repeat(FRAMES, 2, axis=0), np.tile([1.0, 2.0], len(FRAMES))


def averages(side: SidedBody, y: Array, masks: tuple[Mask, ...] = ()) -> tuple[dict[str, Array], float]:
    """Coefficients by name, each shape (m,), at y, shape (m,), and the largest relative residual of their fit."""
    numbers, residuals = zip(*(_at(side, float(value), masks) for value in y), strict=True)
    return dict(zip(NAMES, np.array(numbers).T, strict=True)), max(residuals)


def phases(side: SidedBody, y: float) -> int:
    """Even number of polhode phases that resolves a polhode."""
    from scipy.special import ellipk, ellipkm1

    _, _, complement = Polhodes(side, np.array([y]), np.zeros(1), 2).moduli
    nome = np.pi * ellipk(complement[0]) / ellipkm1(complement[0])
    return max(LEAST_PHASES, 2 * int(np.ceil(PHASES / nome / 2)))


def every_pose(
    side: SidedBody, y: float, nodes: int, masks: tuple[Mask, ...] = (), *, averaging: bool = False
) -> Torus:
    """The perturbation at y for `EVERY_FRAME` and `SIZES`."""
    zero = np.zeros(len(SIZES))
    polhode = Polhodes(side, y + zero, zero, nodes)
    return Torus(polhode, SIZES, zero, EVERY_FRAME[:, 0], EVERY_FRAME[:, 1], masks, averaging)


def _at(side: SidedBody, level: float, masks: tuple[Mask, ...]) -> tuple[list[float], float]:
    torus = every_pose(side, level, phases(side, level), masks, averaging=True)
    mean = np.real(torus.spectrum[:, 0, 0])
    second = second_order(torus)
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
    return [*first, *higher, float(torus.polhode.rate[0]), float(torus.polhode.precession[0])], max(left, right)


def second_order(torus: Torus) -> Array:
    """F₂ of (L in its frame, y), shape (m, 4): the mean of U·∂P, P along the flow of U being a polynomial.

    The torus must be one for averaging.
    """
    p = torus.polhode
    change, turn = torus.ambient
    size = torus.size[:, None, None]
    scale = 1 / (1 + np.sqrt(np.sum(change**2, axis=-1) / size**2 + np.sum(turn**2, axis=-1)))[..., None]
    spin = scale[..., None] * skew(turn)
    n = np.array([0.0, 0.0, 1.0])
    wide = (slice(None), None, None)

    def pull(step: int) -> tuple[Array, Array, Array]:
        rotation = torus.rotation + step * spin @ torus.rotation
        momentum = np.einsum("mabij,mabi->mabj", rotation, size[..., None] * n + step * scale * change)
        tau = torque(p.side, rotation, momentum, torus.flow[wide], torus.gradient[wide])
        space = np.einsum("mabij,mabj->mabi", rotation, tau)
        return space, np.sum(p.side.inverse_inertia * momentum * tau, axis=-1), np.sum(momentum * tau, axis=-1)

    steps = {step: pull(step) for step in (-2, -1, 1, 2)}
    space, power, pulled = (
        (8 * (steps[1][k] - steps[-1][k]) - (steps[2][k] - steps[-2][k])) / 12 / (scale if k == 0 else scale[..., 0])
        for k in range(3)
    )
    # dh/dt₂ = 2(ω·τ - h L·τ)/l²
    _, power0, pulled0 = pull(0)
    u = np.fft.ifft2(torus.generator_spectrum[..., 3], axes=(1, 2), norm="forward").real
    h, slope = p.h[:, None, None], p.slope[:, None, None]
    rate_h = 2 * (power0 - h * pulled0) / size**2
    change_h = 2 * (power - h * pulled - slope * u * pulled0) / size**2 - 2 * rate_h * change[..., 2] / size
    return np.concatenate([space.mean(axis=(1, 2)), (change_h.mean(axis=(1, 2)) / p.slope)[:, None]], axis=1)


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
