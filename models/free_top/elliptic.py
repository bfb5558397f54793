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
# The arithmetic-geometric means below converge quadratically: from a relative difference d the next one
# is d²/8. Two numbers that differ by this share have a mean that is good to the last bit.
_CLOSE = np.sqrt(LONG_EPSILON) / 8
# Stands for a sine of 0 in `jacobi`: even the square of its reciprocal does not overflow.
_TINY = np.finfo(Long).tiny ** Long(0.25)
# exp(−_NEGLIGIBLE), a 148th of the rounding, adds nothing to a sum of order one.
_NEGLIGIBLE = 5 - np.log(LONG_EPSILON)


def exact(value: float | np.floating | Fraction) -> Fraction:
    """Rational number equal to a finite floating-point number of any width, or to a rational one."""
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
    # Each step divides the differences of the three by 4 and keeps R_F. The series at the end is
    # good to rounding once the largest difference is below (3ε/8)^⅛ of the mean, as it leaves out
    # terms of degree 8.
    spread = max(abs(x - z), abs(y - z), abs(x - y)) / (3 * LONG_EPSILON / 8) ** (Long(1) / 8)
    while spread > abs(x + y + z) / 3:
        step = np.sqrt(x) * np.sqrt(y) + np.sqrt(y) * np.sqrt(z) + np.sqrt(z) * np.sqrt(x)
        x = (x + step) / 4
        y = (y + step) / 4
        z = (z + step) / 4
        spread = spread / 4
    mean = (x + y + z) / 3
    return _rf_series(1 - x / mean, 1 - y / mean) / np.sqrt(mean)


def _rf_series(x: Long, y: Long) -> Long:
    """R_F of 1−x, 1−y and 1−z, where z = −x−y, up to terms of degree 7 (DLMF (19.36.1))."""
    z = -x - y
    # Elementary symmetric functions of x, y and z; the first one is 0.
    e2 = x * y - z * z
    e3 = x * y * z
    low = 1 - e2 / 10 + e3 / 14 + e2 * e2 / 24 - 3 * e2 * e3 / 44
    return low - 5 * e2**3 / 208 + 3 * e3 * e3 / 104 + e2 * e2 * e3 / 16


def complete_k(m1: Long) -> Long:
    """Complete elliptic integral K(m), given m1 = 1−m in [0, 1].

    Infinite at m1 = 0 (DLMF §19.2(ii)).
    """
    return Long(np.inf) if m1 == 0 else complete_cel(np.sqrt(m1), Long(1), Long(1), Long(1))


def complete_cel(kc: Long, p: Long, a: Long, b: Long) -> Long:
    """Bulirsch's complete integral cel(kc, p, a, b) for kc, p > 0, a, b ≥ 0, without subtraction."""
    # ∫₀^{π/2} (a cos²θ + b sin²θ) / ((cos²θ + p sin²θ) √(cos²θ + kc² sin²θ)) dθ (Bulirsch 1969;
    # DLMF §19.2(iii)). Each step replaces kc, p, a and b by others with the same integral but for a
    # factor. Its means are sums, not halved: after n steps `mean` and kc are 2ⁿ times the numbers of
    # the arithmetic-geometric mean. `product` is the product of the last two.
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
    # `ladder` holds the pairs of the arithmetic-geometric mean of 1 and √m1. At its limit M the Jacobi
    # functions are circular ones: cs = M cot Mu and dn = 1. The way back up the ladder turns
    # these into cs = cn/sn and dn of m; `ratio` is what each step makes the next ones of.
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
    # cs at u = 0 is infinite; a sine this small stands for it without overflow.
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
    # This is the periodic part of an integral of the third kind. Its characteristic −n ≤ 0 gives the
    # imaginary part: η = π(K'−w)/2K with cs(w | m1) = √n. The factors of the product
    # (DLMF §20.5(i)) each contribute one arctangent. Above m = 1/2 the factors of ϑ₂ in the
    # complementary nome serve instead (DLMF §20.7(viii)): a few factors are enough at any m. At
    # m1 = 0 this is arctan(√n tanh u). Both m and m1 are given to full relative accuracy; n is zero
    # only where m is, and the phase with it.
    if n == 0:
        return np.zeros_like(u)
    w = carlson_rf(n, n + m, n + 1)
    phase = _phase_theta2 if m > Long(0.5) else _phase_theta4
    return phase(u, w, complete_k(m1), complete_k(m))


def _phase_theta4(u: LongArray, w: Long, k: Long, k_prime: Long) -> LongArray:
    """The phase by the product of ϑ₄ in the nome q = exp(−πK'/K), for m ≤ 1/2."""
    # With z = πu/2K, ϑ₄(z + iη) is a product of factors, for j = 0, 1, …, but for one that is real:
    #
    #     (1 − r e^(−2iz)), r = exp(−π (w + 2jK')/K)           of phase  arctan(r sin 2z/(1 − r cos 2z));
    #     (1 − r e^(+2iz)), r = exp(−π (2K' − w + 2jK')/K)     of phase −arctan(r sin 2z/(1 − r cos 2z)).
    #
    # `decay` is the exponent's (…) here. Factors of negligible r are left out.
    sine_z = np.sin(PI * u / (2 * k))
    sine_2z = np.sin(PI * u / k)
    phase = np.zeros_like(u)
    for sign, first_decay in ((1, w), (-1, 2 * k_prime - w)):
        decay = first_decay
        while decay < _NEGLIGIBLE * k / PI:
            radius = np.exp(-PI * decay / k)
            # 1 − r cos 2z, written so that it keeps its relative accuracy where r is close to 1.
            real_part = -np.expm1(-PI * decay / k) + 2 * radius * sine_z**2
            phase = phase + sign * np.arctan2(radius * sine_2z, real_part)
            decay = decay + 2 * k_prime
    return phase


def _phase_theta2(u: LongArray, w: Long, k: Long, k_prime: Long) -> LongArray:
    """The phase by the product of ϑ₂ in the complementary nome q' = exp(−πK/K'), for m > 1/2."""
    # Jacobi's imaginary transformation takes z + iη to i(z + iη)K/K' = a − π/2 + is with a = πw/2K'
    # and s = πu/2K'. Then ϑ₄(z + iη | q) is, but for a real factor, a product of these factors, the
    # last two for j = 1, 2, …:
    #
    #     exp(−(z + iη)² K/(πK'))                       of phase −(πu/2K)(1 − w/K');
    #     cos(a − π/2 + is) = sin(a + is)               of phase  arctan(tanh s/tan a);
    #     (1 − r e^(−2ia)), r = exp(2s − 2jπK/K')       of phase  arctan(r sin 2a/(1 − r cos 2a));
    #     (1 − r e^(+2ia)), r = exp(−2s − 2jπK/K')      of phase −arctan(r sin 2a/(1 − r cos 2a)).
    #
    # Factors of negligible r are left out.
    a = PI * w / (2 * k_prime)
    s = PI * u / (2 * k_prime)
    of_exponential = PI * u / (2 * k) * (1 - w / k_prime)
    phase = np.arctan2(np.cos(a) * np.tanh(s), np.sin(a)) - of_exponential
    for sign in (1, -1):
        exponent = 2 * sign * s - 2 * PI * k / k_prime
        while np.any(exponent > -_NEGLIGIBLE):
            radius = np.exp(exponent)
            phase = phase + sign * np.arctan2(radius * np.sin(2 * a), 1 - radius * np.cos(2 * a))
            exponent = exponent - 2 * PI * k / k_prime
    return phase
