"""Long-double elliptic functions against mpmath."""

import mpmath as mp
import numpy as np
import pytest

from polhode.models.free_top.elliptic import (
    LONG_EPSILON,
    PI,
    Long,
    carlson_rf,
    complete_cel,
    complete_k,
    exact,
    jacobi,
    rounded,
    theta4_phase,
)

COMPLEMENTARY = [Long(1), Long(0.9), Long(0.5), Long(0.1), Long(1e-3), Long("1e-14"), Long("1e-40")]
CLOSE = float(40 * LONG_EPSILON)
EPS_MP = mp.mpf(float(LONG_EPSILON))


@pytest.fixture(autouse=True)
def digits():
    with mp.workdps(80):
        yield


def precise(value):
    numerator, denominator = value.as_integer_ratio()
    return mp.mpf(numerator) / denominator


def relative(value, truth):
    return abs(float((precise(value) - truth) / truth))


def grid(m1):
    return np.linspace(-complete_k(m1), complete_k(m1), 31, dtype=Long)


@pytest.mark.parametrize("text", ["0", "-3", "0.1", "1e-320", "-123456789.123456789e200"])
def test_rational_numbers_go_both_ways_without_loss(text):
    assert rounded(exact(Long(text))) == Long(text)


def test_constants_and_complete_integrals():
    assert relative(PI, mp.pi) < LONG_EPSILON
    for m1 in COMPLEMENTARY:
        m = 1 - precise(m1)
        assert relative(complete_k(m1), mp.ellipk(m)) < CLOSE
        for p in (Long(1), Long(1.5), Long(1e9)):
            third = complete_cel(np.sqrt(m1), p, Long(1), Long(1))
            assert relative(third, mp.ellippi(1 - precise(p), m)) < CLOSE
    assert complete_k(Long(0)) == np.inf


def test_complete_integral_of_the_third_kind_splits_into_positive_parts():
    kc, p = Long(0.3), Long(7)
    parts = complete_cel(kc, p, Long(1), Long(0)), complete_cel(kc, p, Long(0), p)
    assert min(parts) > 0
    assert abs(sum(parts) - complete_k(kc**2)) < CLOSE


@pytest.mark.parametrize(
    "arguments", [(0, 1, 2), (1, 1, 1), (1e-30, 1e-28, 1), (3, 0, 1e9), (0.5, 0.25, 1)]
)
def test_carlson_rf(arguments):
    value = carlson_rf(*map(Long, arguments))
    assert relative(value, mp.elliprf(*map(mp.mpf, arguments))) < CLOSE


def test_carlson_rf_is_infinite_with_two_zeros():
    assert carlson_rf(Long(0), Long(2), Long(0)) == np.inf


@pytest.mark.parametrize("m1", COMPLEMENTARY)
def test_jacobi_functions_keep_their_relative_accuracy(m1):
    """Error at most some units of rounding in the value, and in the argument, which counts where cn is small."""
    u, m = grid(m1)[1:-1], 1 - precise(m1)
    for argument, *values in zip(u, *jacobi(u, m1), strict=True):
        sn, cn, dn = truths = [
            mp.ellipfun(name, precise(argument), m=m) for name in ("sn", "cn", "dn")
        ]
        slopes = [cn * dn, sn * dn, m * sn * cn]
        for value, truth, slope in zip(values, truths, slopes, strict=True):
            allowed = 40 * EPS_MP * abs(truth) + 4 * EPS_MP * abs(precise(argument) * slope)
            assert abs(precise(value) - truth) <= allowed + mp.mpf(10) ** -70


def test_jacobi_functions_on_the_separatrix_do_not_overflow():
    sn, cn, dn = jacobi(np.array([-20000, 0, 20000], dtype=Long), Long(0))
    assert sn.tolist() == [-1, 0, 1]
    assert cn[1] == dn[1] == 1
    assert np.all(cn == dn)


@pytest.mark.parametrize("m1", COMPLEMENTARY)
@pytest.mark.parametrize("n", [Long(1e-9), Long(0.7), Long(1e6)])
def test_theta_phase_is_the_periodic_part_of_the_third_kind(m1, n):
    """√((1+n)(n+m)/n) (Π(−n; u) − Π(−n) u/K) is what the phase differs by from zero (DLMF §19.7, §20.5)."""
    m, exact_n = 1 - precise(m1), precise(n)
    k, third = mp.ellipk(m), mp.ellippi(-exact_n, m)
    factor = mp.sqrt((1 + exact_n) * (exact_n + m) / exact_n)
    u = grid(m1)[1:-1:4]
    values = theta4_phase(u, rounded(1 - exact(m1)), m1, n)
    for argument, value in zip(u, values, strict=True):
        sn, cn = (mp.ellipfun(name, precise(argument), m=m) for name in ("sn", "cn"))
        truth = factor * (mp.ellippi(-exact_n, mp.atan2(sn, cn), m) - third * precise(argument) / k)
        assert abs(float(precise(value) - truth)) < 10 * CLOSE * max(1, float(abs(u[0])))


def test_theta_phase_on_the_separatrix():
    u, n = np.linspace(-50, 50, 21, dtype=Long), Long(0.4)
    assert (
        np.max(np.abs(theta4_phase(u, Long(1), Long(0), n) - np.arctan(np.sqrt(n) * np.tanh(u))))
        < CLOSE
    )


def test_theta_phase_of_a_symmetric_top_is_zero():
    assert not np.any(theta4_phase(grid(Long(1)), Long(0), Long(1), Long(0)))
