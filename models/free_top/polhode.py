"""Constants of the torque-free rotation: the axis that the polhode encircles, the modulus, the frequencies."""

from dataclasses import dataclass
from fractions import Fraction
from typing import Self

import numpy as np

from polhode.models.free_top.elliptic import PI, Long, complete_cel, complete_k, exact, rounded

Triple = tuple[float, float, float]


@dataclass(frozen=True)
class Polhode:
    """Constants of one polhode, named for axes a, b, c: c the axis it encircles, b that of the middle inertia.

    On the side L² > 2EI_b axis c has the greatest inertia, on the other the least (the exchange 1 ↔ 3 of `eq:omg1`);
    on the separatrix either would do and the greatest is taken.

    Attributes
    ----------
    order : tuple of int
        Indices of the axes a, b, c.
    sense : int
        1 if c is the axis of greatest inertia, −1 if it is that of least inertia.
    momentum, rate, precession : long double
        L, dτ/dt ≥ 0 and the mean precession rate φ_LO,2 / t (`eq:prec2`).
    m, m1, n : long double
        Parameter k², 1−k² and the characteristic −n of the integral of the third kind, which is I_c (I_b−I_a) /
        (I_a (I_c−I_b)). Where axis c is undetermined (`of`), m = 0, m1 = 1, n = 0.
    amplitudes : tuple of long double
        Factors of cn, sn, dn in ω_a, ω_b, ω_c (`eq:omg1`–`eq:omg3`).
    quarter : long double
        K(m), infinite on the separatrix.
    """

    order: tuple[int, int, int]
    sense: int
    momentum: Long
    rate: Long
    precession: Long
    m: Long
    m1: Long
    n: Long
    amplitudes: tuple[Long, Long, Long]
    quarter: Long

    @classmethod
    def of(cls, inertia: tuple[Fraction, ...], momentum_squared: Fraction, twice_energy: Fraction) -> Self:
        """Polhode of exact inertia, L² and 2E, which satisfy 2E min(I) ≤ L² ≤ 2E max(I).

        At rest, for a sphere, and for rotation about an axis of two equal inertias, axis c is undetermined, ω constant
        and the rate zero.
        """
        least, middle, greatest = sorted(range(3), key=lambda axis: inertia[axis])
        side = momentum_squared - twice_energy * inertia[middle]
        order = (least, middle, greatest) if side >= 0 else (greatest, middle, least)
        a, b, c = (inertia[axis] for axis in order)
        momentum = np.sqrt(rounded(momentum_squared))
        sense = 1 if side >= 0 else -1
        if side == 0 and (a == b or b == c or momentum_squared == 0):
            zero, one = Long(0), Long(1)
            return cls(order, sense, momentum, zero, momentum / rounded(b), zero, one, zero, (zero, zero, zero), PI / 2)
        wobble = twice_energy * c - momentum_squared
        spin = momentum_squared - twice_energy * a
        n = rounded(c * (b - a) / (a * (c - b)))
        m1 = rounded((c - a) * side / ((c - b) * spin))
        return cls(
            order,
            sense,
            momentum,
            np.sqrt(rounded((c - b) * spin / (a * b * c))),
            momentum * _mean_inverse_inertia(rounded(a), rounded(b), n, m1),
            rounded((b - a) * wobble / ((c - b) * spin)),
            m1,
            n,
            (
                np.sqrt(rounded(wobble / (a * (c - a)))),
                np.sqrt(rounded(wobble / (b * (c - b)))),
                np.sqrt(rounded(spin / (c * (c - a)))),
            ),
            complete_k(m1),
        )

    @property
    def periods(self) -> tuple[float, float]:
        """Periods T of the body angular velocity and T' of the precession, in t; see `periods`."""
        period = 4 * self.quarter / self.rate if self.rate > 0 else Long(np.inf)
        precession = 2 * PI / self.precession if self.precession > 0 else Long(np.inf)
        return float(period), float(precession)


def _mean_inverse_inertia(a: Long, b: Long, n: Long, m1: Long) -> Long:
    """Mean precession rate over L: 1/I_a and 1/I_b weighted by the means of cn² and (1+n)sn², over cn² + (1+n)sn².

    Both weights are integrals of the third kind with positive integrands: unlike in `eq:prec2`, nothing is subtracted.
    """
    if m1 == 0:
        return 1 / b
    kc, p = np.sqrt(m1), 1 + n
    return (complete_cel(kc, p, Long(1), Long(0)) / a + complete_cel(kc, p, Long(0), p) / b) / complete_k(m1)


def periods(inertia: Triple, momentum: float, energy: float) -> tuple[float, float]:
    """Periods T and T' of the torque-free rotation of given L and E (T as below `eq:omg3`; `eq:prec2`, corrected).

    Near the separatrix T is as sensitive to L and E as it must be; from a start, `TorqueFree.period` is better.

    Parameters
    ----------
    inertia : (I₁, I₂, I₃), in any order
    momentum, energy : L and E, both without St

    Returns
    -------
    period : float
        T, of the body angular velocity, in t; infinite on the separatrix, at rest, for a sphere, and for rotation
        about an axis of two equal inertias. At a permanent rotation about the axis of greatest or least inertia it is
        that of an infinitesimal wobble.
    precession_period : float
        T', in which the axis encircled by the polhode precesses once about L on average: 2π / (φ_LO,2 / t), where
        φ_LO,2 is linear in t. It is 2πI₂/L on the separatrix, infinite at rest, and at a permanent rotation that of an
        infinitesimal wobble.

    Raises
    ------
    ValueError
        Unless 2E min(I) ≤ L² ≤ 2E max(I), up to rounding of L and E.
    """
    rational = positive_inertia(inertia)
    if not (np.isfinite(momentum) and np.isfinite(energy) and momentum >= 0 and energy >= 0):
        raise ValueError(f"momentum, energy: got {momentum}, {energy}, expected finite numbers that are not negative")
    squared, twice = exact(float(momentum)) ** 2, 2 * exact(float(energy))
    allowed = min(max(twice, squared / max(rational)), squared / min(rational))
    if abs(allowed - twice) > twice * Fraction(1, 2**50):
        raise ValueError(f"momentum, energy: got {momentum}, {energy}, expected 2E min(I) ≤ L² ≤ 2E max(I)")
    return Polhode.of(rational, squared, allowed).periods


def positive_inertia(inertia: Triple) -> tuple[Fraction, ...]:
    """Exact moments of inertia.

    Raises
    ------
    ValueError
        Unless there are three, finite and positive.
    """
    if len(inertia) != 3 or not all(np.isfinite(moment) and moment > 0 for moment in inertia):
        raise ValueError(f"inertia: got {inertia}, expected three finite positive numbers")
    return tuple(exact(Long(moment)) for moment in inertia)
