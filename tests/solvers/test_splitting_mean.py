"""The derivation of splitting's mean of compositions, against brute force and the coefficients in use."""

from pathlib import Path
from runpy import run_path
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.polynomial.legendre import leggauss, legvander
from scipy.integrate import solve_ivp

from polhode.solvers.parts.schemes import ABA, PARALLEL


@pytest.fixture(scope="module")
def derivation() -> SimpleNamespace:
    path = Path(__file__).parents[2] / "docs" / "derivations" / "splitting_mean.py"
    return SimpleNamespace(**run_path(str(path)))


def test_moments_are_those_of_products_of_exponentials(derivation):
    """Over matrices whose products of four vanish; places (0, 1), (0, 2), (0, 3) hold products of one, two, three."""
    random, h = np.random.default_rng(3), 0.3
    entries = random.normal(size=(5, 3))
    nodes, shares, weights = (
        random.uniform(-1, 1, (3, 4)),
        random.normal(size=(3, 4)),
        random.normal(size=3),
    )
    weights /= weights.sum()

    def part(x):
        """Oscillations of up to two per turn."""
        angle = h * np.asarray(x) / 2
        waves = [
            np.ones_like(angle),
            np.cos(angle),
            np.sin(angle),
            np.cos(2 * angle),
            np.sin(2 * angle),
        ]
        return np.stack(waves, axis=-1) @ entries

    def rate(x, u):
        return (u.reshape(4, 4) @ np.diag(h / 2 * part(x), 1)).ravel()

    exact = (
        solve_ivp(rate, (-1, 1), np.eye(4).ravel(), "DOP853", rtol=1e-13, atol=1e-15)
        .y[:, -1]
        .reshape(4, 4)
    )
    composed = np.zeros((4, 4))
    for weight, *flows in zip(weights, nodes, shares, strict=True):
        product = np.eye(4)
        for node, share in zip(*flows, strict=True):
            e = np.diag(h * share * part(node), 1)
            product = product @ (np.eye(4) + e + e @ e / 2 + e @ e @ e / 6)
        composed += weight * product

    x, w = leggauss(20)
    size, pairs, triples = derivation.SIZES
    series = h * (np.arange(size) + 0.5)[:, None] * (legvander(x, size - 1).T * w) @ part(x)
    one, two, three = np.split(derivation.off(nodes, shares, weights), np.cumsum([size, pairs**2]))
    first, second, third = series.T
    expected = [
        one @ first,
        first[:pairs] @ two.reshape(pairs, pairs) @ second[:pairs],
        np.einsum(
            "klm,k,l,m",
            three.reshape((triples,) * 3),
            first[:triples],
            second[:triples],
            third[:triples],
        ),
    ]
    found = (composed - exact)[0, 1:]
    # To where their polynomials end: of degree 12, 7 and 2.
    assert found[:2] == pytest.approx(expected[:2], abs=1e-10)
    assert found[2] == pytest.approx(expected[2], rel=0.02)


@pytest.mark.parametrize("h", [0.4, 3.8])
def test_moments_count_as_the_quickest_oscillation_has_them(derivation, h: float):
    x, w = leggauss(40)
    k = np.arange(1, derivation.SIZES[0])
    waves = (k + 0.5) * np.abs((w * np.exp(1j * h * x)) @ legvander(x, k[-1])[:, 1:])
    assert derivation.counts(h)[k] == pytest.approx(waves, abs=1e-12)


def test_the_mean_in_use_errs_less_than_one_composition(derivation):
    """As `schemes` claims; what symmetric products are off by is kept below a hundredth of the commutators'."""
    for h in np.linspace(0.4, 3.8, 35):
        (_, symmetric, commutators, _), single = (
            derivation.residuals(PARALLEL, h),
            derivation.residuals(ABA, h),
        )
        assert np.linalg.norm(derivation.residuals(PARALLEL, h)) < 0.1 * np.linalg.norm(single)
        assert 0 < symmetric < 0.01 * commutators


def test_the_mean_in_use_is_where_least_squares_leads(derivation):
    count, used = derivation.objective(), derivation.IN_USE

    def residual(x):
        return np.linalg.norm(count * derivation.off(*derivation.mean(x)), axis=-1)

    better = derivation.improved(used, count, 20)
    assert 0.99 * residual(used) < np.sqrt(2 * better.cost) <= residual(used) < 0.11
    for own, other in zip(derivation.mean(used), derivation.mean(better.x), strict=True):
        assert other == pytest.approx(own, abs=1e-3)
    assert residual(used + 1e-6 * np.eye(len(used))).min() > 1.3 * residual(used)
