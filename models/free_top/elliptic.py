"""Elliptic integrals, Jacobi functions and theta phases in long double, for any m in [0, 1].

SciPy's are double precision and take m, which loses 1−m near a separatrix; here 1−m (``m1``) is
what is handed over. Scalars are ``np.longdouble`` throughout; where that type is no wider than
double, only accuracy is lost.
"""

from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

Long = np.longdouble
LongArray = NDArray[np.longdouble]

PI = Long("3.14159265358979323846264338327950288")
# Rounding of one long double, relative.
LONG_EPSILON = np.finfo(Long).eps
# The means below converge quadratically: two numbers this close have a mean that is good to the
# last bit.
_CLOSE = np.sqrt(LONG_EPSILON) / 8
# Stands for a sine of 0: its reciprocal and products with it do not overflow.
_TINY = np.finfo(Long).tiny ** Long(0.25)
# exp(−_NEGLIGIBLE) adds nothing to a sum of order one.
_NEGLIGIBLE = 5 - np.log(LONG_EPSILON)


def exact(value: float | np.floating) -> Fraction:
    """Rational number equal to a finite floating-point number of any width."""
    return Fraction(*value.as_integer_ratio())


def rounded(value: Fraction) -> Long:
    """Long double nearest to a rational number, of whatever magnitude."""
    if value == 0:
        return Long(0)
    # Some bits more than the type holds, so that truncating them does not show.
    shift = (
        np.finfo(Long).nmant + 10 - value.numerator.bit_length() + value.denominator.bit_length()
    )
    return np.ldexp(Long(int(value * Fraction(2) ** shift)), -shift)


def carlson_rf(x: Long, y: Long, z: Long) -> Long:
    """Carlson's R_F(x, y, z), x, y, z ≥ 0, infinite if two of them are zero (DLMF §19.36(i))."""
    if sorted((x, y, z))[1] == 0:
        return Long(np.inf)
    spread = max(abs(x - z), abs(y - z), abs(x - y)) / (3 * LONG_EPSILON / 8) ** (Long(1) / 8)
    while spread > abs(x + y + z) / 3:
        step = np.sqrt(x) * np.sqrt(y) + np.sqrt(y) * np.sqrt(z) + np.sqrt(z) * np.sqrt(x)
        x = (x + step) / 4
        y = (y + step) / 4
        z = (z + step) / 4
        spread = spread / 4
    mean = (x + y + z) / 3
    x = 1 - x / mean
    y = 1 - y / mean
    z = -x - y
    e2 = x * y - z * z
    e3 = x * y * z
    # DLMF (19.36.1), whose first neglected terms have degree 8.
    low = 1 - e2 / 10 + e3 / 14 + e2 * e2 / 24 - 3 * e2 * e3 / 44
    series = low - 5 * e2**3 / 208 + 3 * e3 * e3 / 104 + e2 * e2 * e3 / 16
    return series / np.sqrt(mean)


def complete_k(m1: Long) -> Long:
    """Complete elliptic integral K(m), given m1 = 1−m in [0, 1].

    Infinite at m1 = 0 (DLMF §19.2(ii)).
    """
    return Long(np.inf) if m1 == 0 else complete_cel(np.sqrt(m1), Long(1), Long(1), Long(1))


def complete_cel(kc: Long, p: Long, a: Long, b: Long) -> Long:
    """Bulirsch's complete integral cel(kc, p, a, b) for kc, p > 0, a, b ≥ 0, without subtraction."""
    # ∫₀^{π/2} (a cos²θ + b sin²θ) / ((cos²θ + p sin²θ) √(cos²θ + kc² sin²θ)) dθ (Bulirsch 1969;
    # DLMF §19.2(iii)).
    product = kc
    mean = Long(1)
    p = np.sqrt(p)
    b = b / p
    while True:
        ratio = product / p
        a_before = a
        a = a + b / p
        b = 2 * (b + a_before * ratio)
        p = p + ratio
        before = mean
        mean = mean + kc
        if abs(before - kc) <= before * _CLOSE:
            return PI / 2 * (b + a * mean) / (mean * (mean + p))
        kc = 2 * np.sqrt(product)
        product = kc * mean


def jacobi(u: LongArray, m1: Long) -> tuple[LongArray, LongArray, LongArray]:
    """Jacobi functions sn, cn, dn, each shape (n,), of u, shape (n,), given m1 = 1−m in [0, 1]."""
    # Descending Landen transformation in ratios (Bulirsch 1965, `sncndn`), so that cn and dn keep
    # their relative accuracy where they are small; hyperbolic functions at m1 = 0 (DLMF §22.5(ii)).
    if m1 == 0:
        decay = np.exp(-np.abs(u))
        sech: LongArray = (2 * decay / (1 + decay * decay)).astype(Long)
        return np.tanh(u), sech, sech
    mean = Long(1)
    geometric = np.sqrt(m1)
    ladder = []
    while True:
        ladder.append((mean, geometric))
        arithmetic = (mean + geometric) / 2
        if abs(mean - geometric) <= mean * _CLOSE:
            mean = arithmetic
            break
        geometric = np.sqrt(mean * geometric)
        mean = arithmetic
    sine = np.sin(mean * u)
    cosine = np.cos(mean * u)
    # cs(0) is infinite; a sine this small stands for it without overflow.
    sine[sine == 0] = _TINY
    ratio = cosine / sine
    cs = mean * ratio
    dn = np.ones_like(u)
    for upper, lower in reversed(ladder):
        ratio = ratio * cs
        cs = cs * dn
        dn = (lower + ratio) / (upper + ratio)
        ratio = cs / upper
    sn = np.copysign(1 / np.hypot(cs, Long(1)), sine)
    return sn, cs * sn, dn


def theta4_phase(u: LongArray, m: Long, m1: Long, n: Long) -> LongArray:
    """Phase arg ϑ₄(πu/2K + iη, q), shape (n,), for u in [−K, K].

    It is the periodic part of the precession (`eq:prec1`).
    """
    # The imaginary part is given by the characteristic −n ≤ 0 of the integral of the third kind
    # whose periodic part this is: η = π(K'−w)/2K with cs(w | m1) = √n. The factors of the product
    # (DLMF §20.5(i)) each contribute one arctangent. Above m = 1/2 the factors of ϑ₂ in the
    # complementary nome serve instead (DLMF §20.7(viii)): a few factors are enough at any m. At
    # m1 = 0 this is arctan(√n tanh u). Both m and m1 are given to full relative accuracy; n is zero
    # only where m is, and the phase with it.
    if n == 0:
        return np.zeros_like(u)
    w = carlson_rf(n, n + m, n + 1)
    if m > Long(0.5):
        return _phase_theta2(u, w, complete_k(m), complete_k(m1))
    return _phase_theta4(u, w, complete_k(m1), complete_k(m))


def _phase_theta4(u: LongArray, w: Long, k: Long, k_prime: Long) -> LongArray:
    sine = np.sin(PI * u / (2 * k))
    sine2 = np.sin(PI * u / k)
    phase = np.zeros_like(u)
    for sign, distance in ((1, w), (-1, 2 * k_prime - w)):
        while distance < _NEGLIGIBLE * k / PI:
            radius = np.exp(-PI * distance / k)
            # 1 − r cos 2z, written so that it keeps its relative accuracy where r is close to 1.
            cosine_part = -np.expm1(-PI * distance / k) + 2 * radius * sine**2
            phase = phase + sign * np.arctan2(radius * sine2, cosine_part)
            distance = distance + 2 * k_prime
    return phase


def _phase_theta2(u: LongArray, w: Long, k_prime: Long, k: Long) -> LongArray:
    angle = PI * w / (2 * k_prime)
    stretched = PI * u / (2 * k_prime)
    phase = np.arctan2(np.cos(angle) * np.tanh(stretched), np.sin(angle)) - PI * u / (2 * k) * (
        1 - w / k_prime
    )
    for sign in (1, -1):
        exponent = 2 * sign * stretched - 2 * PI * k / k_prime
        while np.any(exponent > -_NEGLIGIBLE):
            radius = np.exp(exponent)
            phase = phase + sign * np.arctan2(
                radius * np.sin(2 * angle), 1 - radius * np.cos(2 * angle)
            )
            exponent = exponent - 2 * PI * k / k_prime
    return phase
