"""Second-order averages of a triaxial ellipsoid, per shape and side of L² = 2EI₂: functions of h.

`docs/second-order.md`, section 4, derives them; section 3 derives the torque that is averaged. A rate
of either order is a sum of known functions of L; the functions of h are its factors. A pose is an
orientation of the flow in the frame of L and a size of L.

S_n and W_n are the flow's rate of strain and its rotation, applied to n; e_x and e_y are the
directions of the flow and of its gradient. With l = |L|, n = L/l, S_n = ½(e_x n_y + e_y n_x) and
W_n = ½(e_x n_y - e_y n_x), ⊥ marks the part across n; s₀ = n_x n_y and w₀ = n_z/2. L is in units of
`Ellipsoid.inertia` times the shear rate, y the variable of `polhodes.py` for h = 2E/L². All rates are in
slow time t/St. Rates of first order:

- of l: l f₀ + f₂w₀;
- of y: g₀ + g₂w₀/l;
- of L⊥: n×(r₁S_n + r₂W_n);
- of α and β: e_α s₀/l and e_β s₀/l.

Rates of second order, over St:

- of l: (a₁ + a₂w₀/l) s₀/l;
- of y: (b₁ + b₂w₀/l) s₀/l²;
- of L⊥: [p₁S_n⊥ + p₂W_n + n×(p₃S_n + p₄W_n) s₀/l + (p₅S_n⊥ + p₆W_n) w₀/l]/l.
"""

from collections.abc import Iterable, Sequence

import numpy as np

from polhode.models.libraries import IMPORTS
from polhode.models.second_order.field import COEFFICIENTS
from polhode.models.second_order.polhodes import Polhodes, SidedBody
from polhode.models.second_order.spheroid import Triple, cross, dot, plus
from polhode.models.second_order.torus import Torus, over_phases, times, turning

Array = np.ndarray

# Number of polhode phases times ln(1/nome) that resolves second-order averages to 1e-9: the k-th Fourier
# coefficient of a polhode is about nome^(k/2), with the nome of its elliptic functions. At the last one
# that n phases tell, k = n/2, this is e^(-90/4) = 2e-10.
_PHASES = 90.0
# Least number of phases of a polhode. An estimate: fewer cost accuracy near a principal axis, which
# tests/models/second_order/test_triaxial.py checks; more cost time.
_LEAST_PHASES = 24
# Numbers of phases differ by multiples of this, so that many polhodes share one. An estimate; it is
# even, as numbers of phases are.
_STEP_OF_PHASES = 8
# Rotations, shape (2, 3, 3), whose first two rows are the flow's x and y in the frame of L: several
# orientations separate the parts of a rate. No entry is 0: neither s₀ nor w₀ vanishes.
_ROTATIONS = np.array([[[2, -1, 2], [2, 2, -1], [-1, 2, 2]], [[6, 2, 3], [-3, 6, 2], [-2, -3, 6]]])
_ROTATIONS = _ROTATIONS / np.array([[[3]], [[7]]])
# Each rotation at either |L| of `_SIZES`, shape (poses, 3, 3).
_EVERY_FRAME = np.repeat(_ROTATIONS, 2, axis=0)
# |L| of the poses, shape (poses,).
_SIZES = np.tile([1.0, 2.0], len(_ROTATIONS))
# Singular values below this share of the largest one count as 0 in `fitted`. A column that depends on the
# others would have one of some 1e-16. In the poses of `_EVERY_FRAME` none is below 0.009.
_DEPENDENT = 1e-10
# Largest k₁ of modes (-k₁, k₂), k₂ = 1, 2, 3, whose strength is returned. An estimate: resonances of
# higher ones are passed over.
MODES = 24


def averages(side: SidedBody, y: Array) -> tuple[dict[str, Array], float, Array]:
    """Coefficients by name, at y, each shape (m,), the largest relative residual, and strengths.

    The names are `COEFFICIENTS`: the functions of this module's head, then ν₁ and ν₂. The residual is
    what the coefficients leave of the averages in all poses, over the largest average of that order:
    rounding, and what too few phases cost.

    The last are the strengths of modes in L', shape (m, MODES, 3, 3), the largest of several
    orientations of L. The second and third index are -k₁ - 1 and k₂ - 1. The last index selects the
    strength at l = 0, its gain per l, or the largest amplitude at l = 1 of all modes and the mean.
    """
    counts = phases(side, y)
    poses = len(_SIZES)
    mean = np.empty((6, poses, len(y)))
    second = np.empty((4, poses, len(y)))
    rates = np.empty((2, len(y)))
    strengths = np.empty((len(y), MODES, 3, 3))
    flow = _EVERY_FRAME[:, None, 0]
    gradient = _EVERY_FRAME[:, None, 1]
    for count in np.unique(counts).tolist():
        members = np.flatnonzero(counts == count)
        polhode = Polhodes(side, y[members], np.zeros(len(members)), count)
        torus = Torus(polhode, _SIZES[:, None], np.zeros(len(members)), flow, gradient)
        mean[..., members] = np.real(torus.spectrum[..., 0, 0])
        second[..., members] = second_order(torus)
        rates[:, members] = (polhode.rate, polhode.precession)
        strengths[members] = _strengths(torus.spectrum[:3])
    numbers, residual = _coefficients(mean, second)
    return dict(zip(COEFFICIENTS, (*numbers, *rates), strict=True)), residual, strengths


def phases(side: SidedBody, y: Array) -> Array:
    """Numbers of phases that resolve polhodes, shape (m,): whole and even.

    Many polhodes share one and are averaged at once.
    """
    with IMPORTS:
        from scipy.special import ellipk, ellipkm1

    # ln(1/nome) is π times the quotient of the quarter periods of 1 - m and of m. Moduli need no phases.
    _, _, complement = Polhodes(side, y, np.zeros_like(y), 2).moduli
    needed = _PHASES * ellipkm1(complement) / (np.pi * ellipk(complement))
    return _LEAST_PHASES + _STEP_OF_PHASES * np.ceil(
        np.maximum(needed - _LEAST_PHASES, 0) / _STEP_OF_PHASES
    ).astype(int)


def _coefficients(mean: Array, second: Array) -> tuple[list[Array], float]:
    """Coefficients, shape (m,) each, from the means in all poses, and the largest misfit."""
    # Rows of `mean` are the rates of L₁, L₂, L₃, y, α, β; `second` has rows for L₁, L₂, L₃, y alone.
    x, y, z = (_EVERY_FRAME[:, i] for i in range(3))
    over = 1 / _SIZES
    s0 = x[:, 2] * y[:, 2]
    w0 = z[:, 2] / 2
    s = s0 * over
    w = w0 * over
    # S_n⊥ and W_n, then their products with n×, each of shape (2, poses): n is e₃ in this frame.
    flow = [0.5 * (x * y[:, 2:] + sign * y * x[:, 2:])[:, :2].T for sign in (1, -1)]
    turned = [np.stack([-part[1], part[0]]) for part in flow]
    # Columns of p₁ and p₂, then columns of p₃ to p₆.
    across = [part * over for part in flow]
    steep = [*(part * s * over for part in turned), *(part * w for part in across)]
    # Each part has what the functions are factors of, and the rate. As n is e₃, l' is the rate of L₃.
    first, misfit_of_first = fitted(
        [
            ((_SIZES, w0), mean[2]),  # f₀, f₂
            ((over**0, w), mean[3]),  # g₀, g₂
            (turned, mean[:2]),  # r₁, r₂
            ((s,), mean[4]),  # e_α
            ((s,), mean[5]),  # e_β
        ]
    )
    higher, misfit_of_second = fitted(
        [
            ((s, s * w), second[2]),  # a₁, a₂
            ((s * over, s * w * over), second[3]),  # b₁, b₂
            ([*across, *steep], second[:2]),  # p₁ to p₆
        ]
    )
    return [*first, *higher], max(misfit_of_first, misfit_of_second)


def _strengths(spectrum: Array) -> Array:
    """Strengths, shape (m, MODES, 3, 3), from the spectrum of L', shape (3, poses, m, a, b)."""
    # The poses of `_SIZES` are split by rotation and by size: shape (rotations, 2, m, a, b).
    size = np.linalg.norm(spectrum, axis=0).reshape(-1, 2, *spectrum.shape[2:])
    # Largest of the rotations: per size, state, -k₁ - 1 and k₂ - 1.
    amplitudes = np.zeros((2, spectrum.shape[2], MODES, 3))
    most = min(MODES, spectrum.shape[3] // 2 - 1)
    # A spectrum has k₁ = 0, 1, ..., -2, -1 and k₂ = 0, 1, 2, 3, ...: from its end on, k₁ = -1, -2, ...
    amplitudes[:, :, :most] = size[..., : -most - 1 : -1, 1:4].max(axis=0)
    # A strength is taken to grow evenly with l: amplitudes at l = 1 and l = 2 give that at 0 and its gain.
    gain = np.maximum(amplitudes[1] - amplitudes[0], 0)
    whole = np.broadcast_to(size[:, 0].max(axis=(0, 2, 3))[:, None, None], gain.shape)
    return np.stack([np.maximum(amplitudes[0] - gain, 0), gain, whole], axis=-1)


def second_order(torus: Torus) -> Array:
    """F₂ of (L in its frame, y), shape (4, ..., m): the mean U·∂P over all phases.

    U·∂P is the derivative of the torque's rates along the generator U. It follows from what U
    changes in body axes, where the torque is linear in L and in x⊗y, of the flow's directions x and
    y.
    """
    p = torus.polhode
    x, y, tau = torus.driven
    _, turn = torus.ambient
    dm, dx, dy = _changes_in_body(torus)
    changed = torus.torque(dm, plus(turning(p.side, dx, y), 1, turning(p.side, x, dy)))
    # L' = Sτ: the change of τ in the body, and the turn of the body with it.
    change_of_rate = plus(times(torus.rows, changed), 1, cross(turn, times(torus.rows, tau)))
    change_of_h_rate = _change_of_h_rate(torus, dm, changed)
    # y' = h'/(dh/dy). The change of dh/dy has no part in the mean: it goes with U P of y, whose mean
    # is 0, as U of a mode is a quarter of a turn behind P.
    means = [rate.mean(axis=(-2, -1)) for rate in (*change_of_rate, change_of_h_rate)]
    return np.stack([*means[:3], means[3] / p.slope])


def _changes_in_body(torus: Torus) -> tuple[Triple, Triple, Triple]:
    """Changes along the generator of L and the flow's x and y, as the body sees them, in body axes.

    A vector that is fixed in space turns backwards for a body that turns.
    """
    size = torus.size[..., None, None]
    change, turn = torus.ambient
    # The change of L less turn × L, with L = l e₃ in its frame.
    tilted = change[0] - size * turn[1], change[1] + size * turn[0], change[2]
    flows = (cross(over_phases(direction), turn) for direction in (torus.flow, torus.gradient))
    # The columns of S: Sᵀ carries to body axes.
    back = torus.rows.swapaxes(0, 1)
    dm, dx, dy = (times(back, vector) for vector in (tilted, *flows))
    return dm, dx, dy


def _change_of_h_rate(torus: Torus, dm: Triple, changed: Triple) -> Array:
    """Change of h' = 2(ω - hL)·τ/l² along the generator, for changes `dm` of L and `changed` of τ in body axes."""
    p = torus.polhode
    size = torus.size[..., None, None]
    *_, tau = torus.driven
    change, _ = torus.ambient
    m = torus.momentum
    # ω - hL has the components (1/I - h) L; its change is that at fixed h, then that by h alone.
    excess = [factor[..., None, None] for factor in p.excess.T]
    relative = [factor * part for factor, part in zip(excess, m, strict=True)]
    relative_change = [factor * part for factor, part in zip(excess, dm, strict=True)]
    change_of_y = torus.generator[3]
    rate_h = 2 * dot(relative, tau) / size**2
    change_h = (
        dot(relative_change, tau)
        + dot(relative, changed)
        - p.slope[:, None, None] * change_of_y * dot(m, tau)
    )
    # The last summand comes from 1/l²: the generator changes l by its change of L along e₃.
    return 2 * change_h / size**2 - 2 * rate_h * change[2] / size


def fitted(parts: Iterable[tuple[Sequence[Array], Array]]) -> tuple[list[Array], float]:
    """Real factors by which the columns of every part give its values, and the largest misfit.

    A part is its columns and its values. The misfit is over the largest value of all parts.
    Values have shape (..., m) where the columns have (...); factors have shape (m,).
    """
    factors = list[Array]()
    misfit = 0.0
    largest = 0.0
    for columns, values in parts:
        matrix = np.stack([column.ravel() for column in columns], axis=1)
        right_side = values.reshape(columns[0].size, -1)
        solution = np.linalg.lstsq(matrix, right_side, rcond=_DEPENDENT)[0]
        factors += list(solution)
        misfit = max(misfit, float(np.abs(matrix @ solution - right_side).max()))
        largest = max(largest, float(np.abs(values).max()))
    return factors, misfit / largest
