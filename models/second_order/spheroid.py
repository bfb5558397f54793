"""Second-order averaged spheroid: slow variables to O(1/St²) and orientation to O(1/St), in slow time.

State y = (L, q, σ), L in units of I_e. In the angle s = St σ, ds/dt = |L|, the torque-free spheroid turns its symmetry
axis p about n = L/|L| at unit rate whatever the state, so that p = Φ^s(q) with q slow. Averaging over s to second order
(Sanders, Verhulst & Murdock, Averaging Methods in Nonlinear Dynamical Systems, 2nd ed., §2.9) leaves functions of n and
h = n·q alone, whose coefficients are polynomials in h²: ``docs/derivations/spheroid_second_order.py`` derives them.

With l = |L|, S = ½(n_y, n_x, 0) the rate of strain along n, S' its part across n, W = ½(n_y, -n_x, 0), s₀ = n_x n_y and
w₀ = n_z/2:

- n·L' = l f₀ + f₂w₀ + (a₁ + a₂w₀/l) s₀/(l St)
- L'⊥ = n×(r₁S + r₂W) + [p₁S' + p₂W + n×(p₃S + p₄W) s₀/l + (p₅S' + p₆W) w₀/l]/(l St)
- h' = h(1-h²) [g₀ + g₂w₀/l + (b₁ + b₂w₀/l) s₀/(l² St)]
- n carries q along, and q turns about n besides at the rate e s₀/l (its next term would not show in the orders above).
"""

from math import pi

import numpy as np

from polhode.models.forms.spheroid import Spheroid
from polhode.models.operations import Field, Operations, numpy_operations
from polhode.models.rotation import cross
from polhode.models.second_order.field import averaged_rates

Polynomial = tuple[float, ...]

# The torque has harmonics of s up to 2, which five nodes resolve exactly.
NODES = 2 * pi / 5 * np.arange(5)
# Antiderivative over s of zero mean, taken at s = 0.
INTEGRAL = -0.4 * (np.sin(NODES) + np.sin(2 * NODES) / 2)
# Antiderivative of the turn of n, less that of the turn of q seen from n, taken at s = 0: part of n × (turn), of turn.
TURN_ACROSS = 0.2 * (-1 - np.cos(NODES) / 2 + np.cos(2 * NODES) * 2 / 3)
TURN_ALONG = -0.2 * (np.sin(NODES) * 3 / 2 - np.sin(2 * NODES) / 3)


def torque_coefficients(spheroid: Spheroid) -> dict[str, float]:
    """Coefficients of the torque over I_e, T = -D L - d p(p·L) + D Ω + c p(p·Ω) + k p×(E p), L in units of I_e.

    D = 8πY_c/I_e, D + d = 8πX_c/I_a, D + c = 8πX_c/I_e, k = DΛ.
    """
    equatorial, axial = spheroid.equatorial_damping, spheroid.axial_damping
    return {
        "D": equatorial,
        "d": axial - equatorial,
        "c": axial * spheroid.inertia_ratio - equatorial,
        "k": equatorial * spheroid.anisotropy,
    }


def coefficient_polynomials(torque: dict[str, float]) -> dict[str, Polynomial]:
    """Coefficients of the averaged equations as polynomials in h², lowest power first, from `torque_coefficients`."""
    D, d, c, k = (torque[name] for name in "Ddck")
    return {
        "f0": (-D, -d),
        "f2": (-D, -c),
        "g0": (-d,),
        "g2": (-c,),
        "e": (0.0, 3 / 2 * k),
        "r1": (-k / 2, 3 / 2 * k),
        "r2": (c / 2 + D, -c / 2),
        "a1": (0.0, -3 / 2 * d * k, 3 / 2 * d * k),
        "a2": (-k * (c / 4 + D / 2), k * (-3 * c + 3 / 2 * D), 17 / 4 * c * k),
        "b1": (0.0, 3 / 2 * d * k),
        "b2": (-k * (9 / 4 * c + 2 * D), 17 / 4 * c * k),
        "p1": (0.0, d * k, -2 * d * k),
        "p2": (d * (c + D) / 2, -3 / 2 * d * (c + D), d * c),
        "p3": (-5 / 16 * k * k, 63 / 8 * k * k, -153 / 16 * k * k),
        "p4": (k * (11 / 16 * c + D), -k * (41 / 8 * c + 3 * D), 71 / 16 * c * k),
        "p5": (k * (c / 8 + D / 2), -k * (c / 4 + 3 / 2 * D), -7 / 8 * c * k),
        "p6": (
            -k * k / 4 + 3 / 8 * c * c + D * c / 2,
            3 / 2 * k * k - 7 / 4 * c * c - 3 / 2 * D * c,
            -9 / 4 * k * k + 11 / 8 * c * c,
        ),
    }


def parameters(spheroid: Spheroid, torque_factor: float) -> tuple[float, ...]:
    """Parameters p of `field`: the coefficients of the polynomials one after another, those of second order over St."""
    polynomials = coefficient_polynomials(torque_coefficients(spheroid))
    factors = {name: torque_factor if name[0] in "abp" else 1.0 for name in polynomials}
    return tuple(factors[name] * value for name, row in polynomials.items() for value in row)


def field(ops: Operations) -> Field:
    """Rates of (L, q, σ) in slow time t₂ = t/St; p as from `parameters`."""
    sqrt, averaged = ops.sqrt, ops.use(averaged_rates)

    def rhs(y, p):
        lx, ly, lz, qx, qy, qz = y[0], y[1], y[2], y[3], y[4], y[5]
        size = sqrt(lx * lx + ly * ly + lz * lz)
        over = 1 / size
        nx, ny, nz = lx * over, ly * over, lz * over
        h = nx * qx + ny * qy + nz * qz
        x = h * h

        f = p[0] + p[1] * x, p[2] + p[3] * x, p[12] + x * (p[13] + x * p[14]), p[15] + x * (p[16] + x * p[17])
        g = p[4], p[5], p[18] + x * p[19], p[20] + x * p[21]
        r = p[8] + p[9] * x, p[10] + p[11] * x
        p1, p2 = p[22] + x * (p[23] + x * p[24]), p[25] + x * (p[26] + x * p[27])
        p3, p4 = p[28] + x * (p[29] + x * p[30]), p[31] + x * (p[32] + x * p[33])
        p5, p6 = p[34] + x * (p[35] + x * p[36]), p[37] + x * (p[38] + x * p[39])
        growth, rise, tx, ty, tz = averaged(size, (nx, ny, nz), f, g, r, (p1, p2, p3, p4, p5, p6))

        # n' carries q along: (n × n') × q = n'(n·q) - n(n'·q).
        kept, lost = h * over, (tx * qx + ty * qy + tz * qz) * over
        fall, turn = h * rise, nx * ny * over * (p[6] + p[7] * x)
        return (
            growth * lx + tx,
            growth * ly + ty,
            growth * lz + tz,
            kept * tx - lost * nx + fall * (nx - h * qx) + turn * (ny * qz - nz * qy),
            kept * ty - lost * ny + fall * (ny - h * qy) + turn * (nz * qx - nx * qz),
            kept * tz - lost * nz + fall * (nz - h * qz) + turn * (nx * qy - ny * qx),
            size,
        )

    return rhs


def generator(spheroid: Spheroid, momentum: np.ndarray, axis: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Generator u of the near-identity transformation: (L, p) is the slow (L, p) plus u of the slow one over St.

    L is in units of I_e, p the unit symmetry axis, shape (n, 3) each; so are the parts of u, that of p normal to p.
    """
    size = np.linalg.norm(momentum, axis=1)
    n = momentum / size[:, None]
    h = np.sum(n * axis, axis=1)
    level = h[:, None] * n
    across, beside = axis - level, cross(n, axis)
    poses = level + np.cos(NODES)[:, None, None] * across + np.sin(NODES)[:, None, None] * beside
    rates = torque(torque_coefficients(spheroid), momentum, poses) / size[:, None]
    change = np.einsum("j,jni->ni", INTEGRAL, rates)
    tilt = (rates - np.sum(rates * n, axis=2)[..., None] * n) / size[:, None]
    turn = cross(n, np.einsum("j,jni->ni", TURN_ACROSS, tilt)) + np.einsum("j,jni->ni", TURN_ALONG, tilt)
    return change, h[:, None] * turn - np.sum(turn * axis, axis=1)[:, None] * n


def torque(coefficients: dict[str, float], momentum: np.ndarray, axis: np.ndarray) -> np.ndarray:
    """Rate in slow time of L over I_e for the symmetry axis p, shape (..., 3) each (`ultima`, `jw1`–`jw3`)."""
    px, py, pz = np.moveaxis(axis, -1, 0)
    strain = 0.5 * np.stack([-px * pz, py * pz, px * px - py * py], axis=-1)
    along = -coefficients["d"] * np.sum(axis * momentum, axis=-1) - 0.5 * coefficients["c"] * pz
    steady = -coefficients["D"] * (momentum + np.array([0.0, 0.0, 0.5]))
    return steady + along[..., None] * axis + coefficients["k"] * strain


def turned(momentum: np.ndarray, axis: np.ndarray, turns: np.ndarray) -> np.ndarray:
    """Symmetry axes Φ^s(p), shape (n, 3), turned about L by one angle s, or by angles of shape (n,), in rad."""
    n = momentum / np.linalg.norm(momentum, axis=1)[:, None]
    level = np.sum(n * axis, axis=1)[:, None] * n
    cos, sin = np.cos(turns)[..., None], np.sin(turns)[..., None]
    return level + cos * (axis - level) + sin * cross(n, axis)


def swung(
    spheroid: Spheroid, torque_factor: float, momentum: np.ndarray, axis: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Exact L over I_e and p, shape (n, 3) each, of slow ones: the near-identity transformation, p of unit length."""
    change, turn = generator(spheroid, momentum, axis)
    return momentum + torque_factor * change, unit(axis + torque_factor * turn)


def unit(vectors: np.ndarray) -> np.ndarray:
    """Vectors, shape (..., 3), at unit length."""
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def orders(spheroid: Spheroid, torque_factor: float, slow: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Largest change of L over |L| and of p by the transformation, and |L'| or |E'| of second order over I_max."""
    momentum = slow[:, :3] / spheroid.equatorial_inertia
    size = np.linalg.norm(momentum, axis=1)
    n = momentum / size[:, None]
    # 2E/(I_e l²) = 1 + (I_e/I_a - 1)(n·p)²
    excess = 2 * slow[:, 3] / (spheroid.equatorial_inertia * size**2) - 1
    h2 = np.clip(excess / (1 / spheroid.inertia_ratio - 1), 0, 1)[:, None]
    beside = cross(n, np.eye(3)[np.argmin(np.abs(n), axis=1)])
    axis = np.sqrt(h2) * n + np.sqrt(1 - h2) * unit(beside)
    every = np.tile(momentum, (6, 1))
    axes = turned(every, np.tile(axis, (6, 1)), np.repeat(np.pi / 3 * np.arange(6), len(size)))
    change, tilt = generator(spheroid, every, axes)
    relative = np.linalg.norm(change, axis=1) / np.tile(size, 6) + np.linalg.norm(tilt, axis=1)
    state = (*momentum.T, *axis.T, 0 * size)
    both, first = (
        np.array(field(numpy_operations())(state, parameters(spheroid, factor))[:6]) for factor in (torque_factor, 0.0)
    )
    moved, tilted = (both - first).reshape(2, 3, -1).swapaxes(1, 2)
    along = np.sum(moved * axis + momentum * tilted, axis=1) * np.sum(momentum * axis, axis=1)
    energy = np.sum(momentum * moved, axis=1) + (1 / spheroid.inertia_ratio - 1) * along
    largest = max(1.0, spheroid.inertia_ratio)
    second = np.maximum(np.linalg.norm(moved, axis=1), np.abs(energy)) / largest
    return torque_factor * relative.reshape(6, -1).max(axis=0), second
