"""Constants of the torque-free rotation: the polhode's axis, modulus, frequencies, mean speed."""

from dataclasses import dataclass
from fractions import Fraction
from typing import Self

import numpy as np

from polhode.models.free_top.elliptic import PI, Long, complete_cel, complete_k, exact, rounded
from polhode.models.libraries import IMPORTS
from polhode.models.rotation import Triple
from polhode.models.shape import Ellipsoid

Rationals = tuple[Fraction, Fraction, Fraction]

# Nodes of the midpoint rule over a quarter of a polhode: 1e-6 relative off the separatrix, as
# tests/models/free_top/test_polhode.py checks.
_QUARTER_NODES = 32
# Least square that is divided by, where a body is at rest: keeps 0/0 away.
_TINY = 1e-300
# Largest parameter m of SciPy's elliptic functions, for K(m) is infinite at 1. It is a few ulps below: a mean
# over the separatrix itself is less accurate.
_LARGEST_PARAMETER = 1 - 1e-15


@dataclass(frozen=True)
class Polhode:
    """Constants of one polhode with axes a, b, c: it encircles c, and b has the middle inertia.

    On the side L² > 2EI_b axis c has the greatest inertia, on the other the least (the exchange 1 ↔
    3 of `eq:omg1`). On the separatrix either would do and the greatest is taken. If axis c is
    undetermined (`of`), m = 0, m1 = 1, n = 0.
    """

    order: tuple[int, int, int]  # indices of the axes a, b, c
    sense: int  # 1 if c is the axis of greatest inertia, −1 if it is that of least inertia
    momentum: Long  # |L|, in the units of inertia and ω
    rate: Long  # dτ/dt ≥ 0 of the Jacobi functions' argument τ
    precession: Long  # mean rate φ_LO,2 / t (`eq:prec2`), in rad per unit of time
    m: Long  # k²
    m1: Long  # 1−k²
    # −n is the characteristic of the integral of the third kind: n = I_c (I_b−I_a) / (I_a (I_c−I_b)).
    n: Long
    # Factors of cn, sn, dn in ω_a, ω_b, ω_c (`eq:omg1`–`eq:omg3`).
    amplitudes: tuple[Long, Long, Long]
    quarter: Long  # K(m), infinite on the separatrix

    @classmethod
    def of(
        cls, inertia: tuple[Fraction, ...], momentum_squared: Fraction, twice_energy: Fraction
    ) -> Self:
        """Polhode of exact inertia, L² and 2E, which satisfy 2E min(I) ≤ L² ≤ 2E max(I)."""
        # At rest, for a sphere, and for rotation about an axis of two equal inertias, axis c is
        # undetermined, ω constant and the rate zero.
        least, middle, greatest = sorted(range(3), key=lambda axis: inertia[axis])
        side = momentum_squared - twice_energy * inertia[middle]
        order = (least, middle, greatest) if side >= 0 else (greatest, middle, least)
        a, b, c = (inertia[axis] for axis in order)
        momentum = np.sqrt(rounded(momentum_squared))
        sense = 1 if side >= 0 else -1
        if side == 0 and (a == b or b == c or momentum_squared == 0):
            zero = Long(0)
            one = Long(1)
            return cls(
                order=order,
                sense=sense,
                momentum=momentum,
                rate=zero,
                precession=momentum / rounded(b),
                m=zero,
                m1=one,
                n=zero,
                amplitudes=(zero, zero, zero),
                quarter=PI / 2,
            )
        # With `side`, the distances from where the motion changes its kind. Each has the sign of
        # c - a: `side` is 0 on the separatrix, `wobble` at rotation about c. `spin` is never 0.
        wobble = twice_energy * c - momentum_squared
        spin = momentum_squared - twice_energy * a
        n = rounded(c * (b - a) / (a * (c - b)))
        m1 = rounded((c - a) * side / ((c - b) * spin))
        m = rounded((b - a) * wobble / ((c - b) * spin))
        rate = np.sqrt(rounded((c - b) * spin / (a * b * c)))
        precession = momentum * _mean_inverse_inertia(rounded(a), rounded(b), n, m1)
        squares = wobble / (a * (c - a)), wobble / (b * (c - b)), spin / (c * (c - a))
        cn, sn, dn = (np.sqrt(rounded(square)) for square in squares)
        return cls(
            order=order,
            sense=sense,
            momentum=momentum,
            rate=rate,
            precession=precession,
            m=m,
            m1=m1,
            n=n,
            amplitudes=(cn, sn, dn),
            quarter=complete_k(m1),
        )

    @property
    def periods(self) -> tuple[float, float]:
        """Periods T of the angular velocity and T' = 2π / (φ_LO,2 / t) of the precession, in t."""
        # T (below `eq:omg3`) is infinite on the separatrix and where axis c is undetermined; T'
        # (`eq:prec2`, corrected) is 2πI₂/L on the separatrix and infinite at rest. A permanent
        # rotation about the axis of greatest or least inertia has the two periods of an
        # infinitesimal wobble.
        period = 4 * self.quarter / self.rate if self.rate > 0 else Long(np.inf)
        precession = 2 * PI / self.precession if self.precession > 0 else Long(np.inf)
        return float(period), float(precession)


def _mean_inverse_inertia(a: Long, b: Long, n: Long, m1: Long) -> Long:
    """Mean precession rate over L.

    It is a mean of 1/I_a and 1/I_b. Their weights are the means of cn² and (1+n)sn², each over
    cn² + (1+n)sn².
    """
    # Both weights are integrals of the third kind with positive integrands: unlike in `eq:prec2`,
    # nothing is subtracted.
    if m1 == 0:
        return 1 / b
    kc = np.sqrt(m1)
    p = 1 + n
    return (
        complete_cel(kc, p, Long(1), Long(0)) / a + complete_cel(kc, p, Long(0), p) / b
    ) / complete_k(m1)


def exactly(numbers: Triple | Rationals) -> tuple[Fraction, ...]:
    """The rational numbers that floating-point numbers are; rational ones stay."""
    return tuple(map(exact, numbers))


def mean_speed(ellipsoid: Ellipsoid, slow: np.ndarray) -> np.ndarray:
    """Mean of |ω| over the torque-free motion, in shear rates, shape (n,), at (L_x, L_y, L_z, E), shape (n, 4)."""
    # By quadrature over a quarter of the polhode (`eq:omg1`–`eq:omg3`), within about 1e-6 relative,
    # less on the separatrix itself.
    with IMPORTS:
        from scipy.special import ellipj, ellipk

    momentum2 = np.sum(slow[:, :3] ** 2, axis=1)
    energy2 = 2 * slow[:, 3]
    i1, i2, i3 = sorted(ellipsoid.inertia)
    if i1 == i3:
        return np.sqrt(momentum2) / i1
    # Axis c, encircled by the polhode, and a, opposite to it, as in `Polhode`; a spheroid's polhodes
    # all encircle its symmetry axis.
    greatest = np.full(len(slow), i1 == i2) if i1 == i2 or i2 == i3 else momentum2 > energy2 * i2
    encircled = np.where(greatest, i3, i1)
    opposite = np.where(greatest, i1, i3)
    # I_a ω_a² at its largest, where cn = 1, and I_c ω_c² at its largest, where dn = 1. They are zero
    # up to rounding at the permanent rotations and at rest.
    short = np.maximum((energy2 * encircled - momentum2) / (encircled - opposite), 0)
    long = np.maximum((momentum2 - energy2 * opposite) / (encircled - opposite), 0)
    parameter = (opposite - i2) / (i2 - encircled) * short / np.maximum(long, _TINY)
    parameter = np.clip(parameter, 0, _LARGEST_PARAMETER)[:, None]
    quarter = (np.arange(_QUARTER_NODES) + 0.5) / _QUARTER_NODES
    sn, cn, dn, _ = ellipj(quarter * ellipk(parameter), parameter)
    # ω_a² + ω_b² + ω_c² at the nodes, shape (n, nodes).
    squares = (
        (short / opposite)[:, None] * cn**2
        + (short * (encircled - opposite) / (i2 * (encircled - i2)))[:, None] * sn**2
        + (long / encircled)[:, None] * dn**2
    )
    return np.mean(np.sqrt(squares), axis=1)
