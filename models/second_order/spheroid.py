"""Second-order averaged spheroid in slow time: L and E to O(1/St²), orientation to O(1/St).

The state is y = (L, q, σ), L in units of I_e. In the angle s = St σ, ds/dt = |L|, a torque-free
spheroid turns its symmetry axis p about n = L/|L| at unit rate in any state. Hence p = Φ^s(q) with
a slow q. Averaging over s to second order leaves functions of n and h = n·q alone (Sanders,
Verhulst & Murdock, Averaging Methods in Nonlinear Dynamical Systems, 2nd ed., §2.9). Their
coefficients are polynomials in h², which ``docs/derivations/spheroid_second_order.py`` derives.

The rate of strain along n is S = ½(n_y, n_x, 0), its part across n is S'. With l = |L|,
W = ½(n_y, -n_x, 0), s₀ = n_x n_y and w₀ = n_z/2 the rates are:

- n·L' = l f₀ + f₂w₀ + (a₁ + a₂w₀/l) s₀/(l St);
- L'⊥ = n×(r₁S + r₂W) + [p₁S' + p₂W + n×(p₃S + p₄W) s₀/l + (p₅S' + p₆W) w₀/l]/(l St);
- h' = h(1-h²) [g₀ + g₂w₀/l + (b₁ + b₂w₀/l) s₀/(l² St)];
- n carries q along, and q turns about n besides at the rate e s₀/l (its next term would not show in
  the orders above).
"""

from collections.abc import Callable, Sequence
from math import pi
from typing import Any

import numpy as np

from polhode.models.forms.spheroid import Spheroid
from polhode.models.operations import ARRAYS, Field, Operations
from polhode.models.second_order.field import averaged_rates

Polynomial = tuple[float, ...]

# The components of a vector, numbers or arrays.
Triple = Sequence[Any]
# Up to this many rows Python's floats are faster than arrays, by trial. The rows are the same either way, up to
# rounding.
_FEW = 6
# How many of the parameters are of first order; they stand first.
_FIRST = 12
# Turns about L, in rad, at which the size of the transformation is taken, shape (6, 1): the torque has
# harmonics up to 2, of which six turns miss no extreme by much.
_SAMPLED_TURNS = pi / 3 * np.arange(6)[:, None]
# Keeps 0/0 away where p is along L.
_TINY = 1e-300


def torque_coefficients(spheroid: Spheroid) -> dict[str, float]:
    """Coefficients of the torque T = -D L - d p(p·L) + D Ω + c p(p·Ω) + k p×(E p), over I_e."""
    # L in units of I_e; D = 8πY_c/I_e, D + d = 8πX_c/I_a, D + c = 8πX_c/I_e, k = DΛ.
    equatorial = spheroid.equatorial_damping
    axial = spheroid.axial_damping
    return {
        "D": equatorial,
        "d": axial - equatorial,
        "c": axial * spheroid.inertia_ratio - equatorial,
        "k": equatorial * spheroid.anisotropy,
    }


def coefficient_polynomials(torque: dict[str, float]) -> dict[str, Polynomial]:
    """Coefficients of the averaged equations as polynomials in h², lowest power first."""
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
    """Parameters p of `field`: the polynomials' coefficients, second-order ones over St."""
    polynomials = coefficient_polynomials(torque_coefficients(spheroid))
    # Those of second order are a1 to b2 and p1 to p6.
    factors = {name: torque_factor if name[0] in "abp" else 1.0 for name in polynomials}
    numbers = list[float]()
    for name, row in polynomials.items():
        numbers += [factors[name] * value for value in row]
    return tuple(numbers)


def slow_rates(ops: Operations) -> Callable[..., Any]:
    """Rates l'/l, h'/(h(1-h²)) and L'⊥ from l = |L|, n and h²; p as for `field`."""
    # Index in p at which each polynomial of `coefficient_polynomials` begins, x being h²:
    #
    #     f0  f2  g0  g2  e  r1  r2   a1  a2  b1  b2  p1  p2  p3  p4  p5  p6
    #      0   2   4   5  6   8  10   12  15  18  20  22  25  28  31  34  37
    averaged = ops.use(averaged_rates)

    def rates(size, n, x, p):
        f = (
            p[0] + p[1] * x,
            p[2] + p[3] * x,
            p[12] + x * (p[13] + x * p[14]),
            p[15] + x * (p[16] + x * p[17]),
        )
        g = p[4], p[5], p[18] + x * p[19], p[20] + x * p[21]
        r = p[8] + p[9] * x, p[10] + p[11] * x
        p1 = p[22] + x * (p[23] + x * p[24])
        p2 = p[25] + x * (p[26] + x * p[27])
        p3 = p[28] + x * (p[29] + x * p[30])
        p4 = p[31] + x * (p[32] + x * p[33])
        p5 = p[34] + x * (p[35] + x * p[36])
        p6 = p[37] + x * (p[38] + x * p[39])
        return averaged(size, n, f, g, r, (p1, p2, p3, p4, p5, p6))

    return rates


def field(ops: Operations) -> Field:
    """Rates of (L, q, σ) in slow time t₂ = t/St; p as from `parameters`."""
    sqrt = ops.sqrt
    rates = ops.use(slow_rates)

    def rhs(y, p):
        lx = y[0]
        ly = y[1]
        lz = y[2]
        qx = y[3]
        qy = y[4]
        qz = y[5]
        size = sqrt(lx * lx + ly * ly + lz * lz)
        over = 1 / size
        nx = lx * over
        ny = ly * over
        nz = lz * over
        h = nx * qx + ny * qy + nz * qz
        x = h * h
        growth, rise, tx, ty, tz = rates(size, (nx, ny, nz), x, p)

        # n' carries q along: (n × n') × q = n'(n·q) - n(n'·q).
        carry = h * over
        lost = (tx * qx + ty * qy + tz * qz) * over
        fall = h * rise
        turn = nx * ny * over * (p[6] + p[7] * x)
        return (
            growth * lx + tx,
            growth * ly + ty,
            growth * lz + tz,
            carry * tx - lost * nx + fall * (nx - h * qx) + turn * (ny * qz - nz * qy),
            carry * ty - lost * ny + fall * (ny - h * qy) + turn * (nz * qx - nx * qz),
            carry * tz - lost * nz + fall * (nz - h * qz) + turn * (nx * qy - ny * qx),
            size,
        )

    return rhs


def generator(
    spheroid: Spheroid, momentum: Triple, axis: Triple, cos: Any = 1.0, sin: Any = 0.0
) -> tuple[Triple, ...]:
    """Generator u of the near-identity transformation, and p.

    The exact (L, p) is the slow one plus u of the slow one, over St.

    L is in units of I_e; p is first turned about L by an angle; the part of u for p is normal to p.
    As Φ^s(p) is hn + e cos s + f sin s, the torque has harmonics of s up to 2. The part of u for L
    holds their antiderivatives of zero mean at s = 0. The part for p holds the antiderivatives of
    the turn of n less the turn of q seen from n.
    """
    over = 1 / dot(momentum, momentum) ** 0.5
    n = over * momentum[0], over * momentum[1], over * momentum[2]
    nx, ny, _ = n
    h = dot(n, axis)
    # e and f before the turn, then behind it: e is p across n, of length r, and f is n × e. As p
    # turns with s, de/ds = f and df/ds = -e.
    fx, fy, fz = cross(n, axis)
    ex, ey, ez = plus(axis, -h, n)
    e = cos * ex + sin * fx, cos * ey + sin * fy, cos * ez + sin * fz
    f = cross(n, e)
    ex, ey, _ = e
    fx, fy, _ = f
    # r² = 1 - h².
    r2 = dot(e, e) + _TINY
    # Twice the components of the rate of strain E: n·En, n·Ee, n·Ef, then e·Ee and e·Ef over r².
    nn = 2 * nx * ny
    ne = nx * ey + ny * ex
    nf = nx * fy + ny * fx
    ee = 2 * ex * ey / r2
    ef = (ex * fy + ey * fx) / r2
    torque = torque_coefficients(spheroid)
    frame = over, n, e, f, h, r2
    strain = nn, ne, nf, ee, ef
    change = _change_of_momentum(torque, frame, strain)
    tilt = _tilt(torque, frame, strain)
    axis = plus(e, h, n)
    # The turn of p is about n × tilt, and (n × tilt) × p = p × (tilt × n).
    return change, cross(axis, cross(tilt, n)), axis


# `generator` names them 1/|L|, n, e, f, h and r²; and nn, ne, nf, ee and ef.
_Frame = tuple[Any, Triple, Triple, Triple, Any, Any]
_Strain = tuple[Any, Any, Any, Any, Any]


def _change_of_momentum(torque: dict[str, float], frame: _Frame, strain: _Strain) -> Triple:
    """The part of u for L."""
    # Integrals over s of what oscillates in the torque over l, by its terms and by directions:
    #
    #     torque        along n                        along e                    along f
    #     -d p(p·L)                                                               d h
    #     c p(p·Ω)      c/8l 4h f_z                    c/8l f_z                   c/8l (4h n_z + e_z)
    #     k p×(E p)     k/8l (4h ne + r² (2ee + nn))   -k/8l (ne + 4h (2nn + ee)) k/8l (nf - 4h ef)
    over, n, e, f, h, r2 = frame
    nn, ne, nf, ee, ef = strain
    d = torque["d"]
    c8 = torque["c"] / 8
    k8 = torque["k"] / 8
    h4 = 4 * h
    nx, ny, nz = n
    ez = e[2]
    fz = f[2]
    along_n = over * (h4 * (c8 * fz + k8 * ne) + k8 * r2 * (2 * ee + nn))
    along_e = over * (c8 * fz - k8 * ne - k8 * h4 * (2 * nn + ee))
    along_f = d * h + over * (h4 * (c8 * nz - k8 * ef) + c8 * ez + k8 * nf)
    return plus(plus((along_n * nx, along_n * ny, along_n * nz), along_e, e), along_f, f)


def _tilt(torque: dict[str, float], frame: _Frame, strain: _Strain) -> Triple:
    """The vector t of the part of u for p, which is a turn of p about n × t."""
    # With W and S as at the top of this module, by the terms of the torque:
    #
    #     torque        of its own                 along e                            along f
    #     -d p(p·L)                                                                   d h/l
    #     D Ω           D/l² W
    #     c p(p·Ω)                                 -c/8l² 3 f_z                       c/8l² (e_z + 4h n_z)
    #     k p×(E p)     k/3l² (4h² - 1) S          k/8l² (ne/3 - h (2ee + 7nn))       -k/8l² (5/3 nf + 2h ef)
    over, n, e, f, h, _ = frame
    nn, ne, nf, ee, ef = strain
    d = torque["d"]
    k = torque["k"]
    c8 = torque["c"] / 8
    k8 = k / 8
    h4 = 4 * h
    nx, ny, nz = n
    ez = e[2]
    fz = f[2]
    over2 = over * over
    # W is ½(n_y, -n_x, 0) and S is ½(n_y, n_x, 0).
    of_w = torque["D"] / 2 * over2
    of_s = k / 6 * over2 * (h4 * h - 1)
    along_e = over2 * (k8 * (ne / 3 - h * (2 * ee + 7 * nn)) - 3 * c8 * fz)
    along_f = over * d * h + over2 * (c8 * (ez + h4 * nz) - k8 * (5 / 3 * nf + 2 * h * ef))
    steady = (of_s + of_w) * ny, (of_s - of_w) * nx, 0 * nz
    return plus(plus(steady, along_e, e), along_f, f)


def swung(
    spheroid: Spheroid, torque_factor: float, momentum: Triple, axis: Triple, *turn: Any
) -> tuple[Any, ...]:
    """Exact L over I_e and p, of unit length, from slow ones: six components.

    First the slow p is turned about L.
    """
    change, tilt, axis = generator(spheroid, momentum, axis, *turn)
    return *plus(momentum, torque_factor, change), *unit(plus(axis, torque_factor, tilt))


def exact(spheroid: Spheroid, torque_factor: float, states: np.ndarray) -> np.ndarray:
    """Exact L over I_e and p, shape (n, 6), of states of `field`, shape (n, 7)."""
    turns = states[:, 6] / torque_factor
    cos = np.cos(turns)
    sin = np.sin(turns)
    if 0 < len(states) <= _FEW:
        rows = zip(states.tolist(), cos.tolist(), sin.tolist(), strict=True)
        return np.array(
            [swung(spheroid, torque_factor, row[:3], unit(row[3:6]), *turn) for row, *turn in rows]
        )
    columns = list(states.T.copy())
    return np.array(swung(spheroid, torque_factor, columns[:3], unit(columns[3:6]), cos, sin)).T


def unit(v: Triple) -> Triple:
    """A vector at unit length."""
    over = 1 / dot(v, v) ** 0.5
    return over * v[0], over * v[1], over * v[2]


def plus(u: Triple, a: Any, v: Triple) -> Triple:
    """Return u + av."""
    return u[0] + a * v[0], u[1] + a * v[1], u[2] + a * v[2]


def dot(u: Triple, v: Triple) -> Any:
    """u·v."""
    return u[0] * v[0] + u[1] * v[1] + u[2] * v[2]


def cross(u: Triple, v: Triple) -> Triple:
    """u × v."""
    return u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]


def orders(
    spheroid: Spheroid, torque_factor: float, slow: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Size of the transformation, and the larger one of |L'| and |E'| of second order over I_max, shape (m,) each.

    `slow` is (L, E) as `Observables` has them, shape (m, 4). The size is the largest change of L over |L| plus
    the change of p.
    """
    # Here l is |L| over I_e, and E is over I_e, too.
    *momentum, energy = (slow / spheroid.equatorial_inertia).T.copy()
    square = dot(momentum, momentum)
    flattening = 1 / spheroid.inertia_ratio - 1
    n = unit(momentum)
    # 2E/l² = 1 + (I_e/I_a - 1) h², as h = n·p.
    h2 = np.minimum(np.maximum((2 * energy / square - 1) / flattening, 0), 1)
    # Some p of this h: `beside` is normal to n, by the space axis that is farthest from n.
    beside = cross(n, [*np.eye(3)[:, np.argmin(np.abs(n), axis=0)]])
    axis = plus(
        [np.sqrt(h2) * component for component in n],
        np.sqrt((1 - h2) / dot(beside, beside)),
        beside,
    )
    change, tilt, _ = generator(
        spheroid, momentum, axis, np.cos(_SAMPLED_TURNS), np.sin(_SAMPLED_TURNS)
    )
    relative = np.sqrt(dot(change, change) / square) + np.sqrt(dot(tilt, tilt))
    # Rates of second order alone.
    second = (0.0,) * _FIRST + parameters(spheroid, torque_factor)[_FIRST:]
    growth, rise, *across = slow_rates(ARRAYS)(np.sqrt(square), n, h2, second)
    moved = np.sqrt(square * growth * growth + dot(across, across))
    # E' of E = ½ l² (1 + (I_e/I_a - 1) h²).
    powered = square * np.abs(growth * (1 + flattening * h2) + flattening * h2 * (1 - h2) * rise)
    largest_inertia = max(1.0, spheroid.inertia_ratio)  # I_max/I_e
    return torque_factor * relative.max(axis=0), np.maximum(moved, powered) / largest_inertia
