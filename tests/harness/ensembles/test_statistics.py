"""Statistics against brute force, intervals against binomial tests, ensembles against theory."""

from collections import Counter
from dataclasses import replace
from math import sqrt

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.linalg import expm
from scipy.special import ellipe
from scipy.stats import binomtest

from polhode.harness.ensembles.ensemble import Ensemble
from polhode.harness.ensembles.starts import Starts
from polhode.harness.ensembles.statistics import (
    FOURTH,
    FOURTH_OF_VOIGT,
    RATES,
    SECOND,
    SLOW_NAMES,
    VOIGT,
    Layout,
    Statistics,
    squared_rates,
)
from polhode.harness.ensembles.summary import arrived, fraction, means, transient_quantile
from polhode.models.catalogue import form as find_form
from polhode.models.files.toml_file import checked
from polhode.models.observables import angular_velocity
from polhode.models.rotation import matrix_from_quaternion
from polhode.models.scene import BodyStart, Scene
from polhode.models.shape import Ellipsoid
from polhode.solvers.solve import solve

LAYOUT = Layout((0, 2), 2, 5, 2, 7, 1.5, 2.0)
PROLATE = Ellipsoid((1.0, 1.0, 2.0))
OBLATE = Ellipsoid((0.4, 1.0, 1.0))


def filled(seed: int, particles: int) -> tuple[Statistics, np.ndarray, np.ndarray]:
    random = np.random.default_rng(seed)
    directions = random.standard_normal((2, particles, 2, 3))
    directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
    slow = random.normal(0, 0.8, (2, particles, 4))
    statistics = Statistics.empty(LAYOUT)
    statistics.add_statuses(np.array(["reached_end"] * particles, dtype=object), "reached_end")
    statistics.add_orientations(directions)
    statistics.add_slow(LAYOUT, slow)
    return statistics, directions, slow


def test_moments_against_numpy():
    statistics, directions, slow = filled(1, 400)
    for order, (mean, error) in (
        (SECOND, means(statistics, "second")),
        (FOURTH, means(statistics, "fourth")),
    ):
        products = np.stack(
            [np.prod(directions[..., list(index)], axis=-1) for index in order], axis=-1
        )
        assert mean == pytest.approx(products.mean(axis=1), abs=1e-14)
        assert error == pytest.approx(products.std(axis=1, ddof=1) / sqrt(400), rel=1e-9)
    voigt, errors = (each[..., FOURTH_OF_VOIGT] for each in means(statistics, "fourth"))
    for i, j in ((0, 0), (0, 1), (5, 5), (3, 2), (4, 5)):
        products = np.prod(directions[..., [*VOIGT[i], *VOIGT[j]]], axis=-1)
        assert voigt[..., i, j] == pytest.approx(products.mean(axis=1), abs=1e-14)
        assert errors[..., j, i] == pytest.approx(
            products.std(axis=1, ddof=1) / sqrt(400), rel=1e-9
        )
    # A unit vector's trace is 1.
    assert voigt[..., :3, :3].sum(axis=(-2, -1)) == pytest.approx(1.0)
    mean, error = means(statistics, "slow")
    columns = np.concatenate(
        [slow[..., :3], np.linalg.norm(slow[..., :3], axis=-1)[..., None], slow[..., 3:]], axis=-1
    )
    assert mean == pytest.approx(columns.mean(axis=1), abs=1e-14)
    assert error == pytest.approx(columns.std(axis=1, ddof=1) / sqrt(400), rel=1e-9)


def test_histograms_against_numpy():
    statistics, _, slow = filled(2, 500)
    columns = [
        slow[..., 0],
        slow[..., 1],
        slow[..., 2],
        np.linalg.norm(slow[..., :3], axis=-1),
        slow[..., 3],
    ]
    for k, (name, values) in enumerate(zip(SLOW_NAMES, columns, strict=True)):
        for snapshot in range(2):
            edges = [-np.inf, *LAYOUT.edges(name), np.inf]
            assert (
                statistics.histograms[snapshot, k].tolist()
                == np.histogram(values[snapshot], edges)[0].tolist()
            )
    assert statistics.histograms[:, :, [0, -1]].sum() > 0


def test_arrivals_against_brute_force():
    random = np.random.default_rng(3)
    close = random.random((5, 300)) < 0.7
    statistics = Statistics.empty(LAYOUT)
    statistics.add_arrivals(1, close)
    expected = Counter(
        next(first for first in range(5) if column[first:].all())
        for column in close.T
        if column[-1]
    )
    assert statistics.arrivals[1].tolist() == [expected[first] for first in range(5)]
    assert not statistics.arrivals[0].any()


def test_merging_is_adding_and_records_lose_nothing():
    parts = [filled(seed, particles)[0] for seed, particles in ((1, 30), (2, 50), (3, 20))]
    parts[1].add_statuses(np.array(["step_limit", "non_finite"], dtype=object), "reached_end")
    copies = [Statistics.from_record(part.as_record(), LAYOUT) for part in parts]
    total, again = Statistics.empty(LAYOUT), Statistics.empty(LAYOUT)
    for part, copy in zip(parts, copies, strict=True):
        total.merge(part)
        again.merge(copy)
    assert total.as_record() == again.as_record()
    assert (total.particles, total.finished) == (102, 100)
    assert total.failures == {"step_limit": 1, "non_finite": 1}
    assert total.second == pytest.approx(sum(part.second for part in parts))
    assert total.histograms.sum() == 100 * 2 * len(SLOW_NAMES)


@pytest.mark.parametrize(("count", "of"), [(0, 20), (1, 20), (10, 20), (20, 20), (997, 1000)])
def test_fractions_have_wilsons_interval(count: int, of: int):
    found, expected = fraction(count, of), binomtest(count, of).proportion_ci(method="wilson")
    assert (found.value, found.low, found.high) == pytest.approx(
        (count / of, expected.low, expected.high), abs=1e-12
    )


def test_no_particles_no_fraction():
    assert vars(fraction(0, 0)) == {"value": None, "low": 0.0, "high": 1.0}


def test_the_median_of_the_transient_time_is_covered_as_often_as_stated():
    ensemble = Ensemble(PROLATE, 1e4, 100.0, particles=60, samples=101)
    random = np.random.default_rng(4)
    exact, covered = 30.0, 0
    for _ in range(400):
        times = random.exponential(exact / np.log(2), 60)
        statistics = Statistics.empty(ensemble.layout)
        statistics.particles = 60
        seen = np.ceil(times[times <= 100]).astype(int)
        statistics.arrivals[0] += np.bincount(seen, minlength=101)
        found = transient_quantile(ensemble, statistics, 0.5)
        assert found.low is not None
        low, high = found.low, np.inf if found.high is None else found.high
        assert low <= (found.value or np.inf) <= high
        covered += low <= exact <= high
    # At least 95 %, and not all: with 400 trials, 0.95 has a standard deviation of 0.011.
    assert 0.92 < covered / 400 < 1.0


def test_times_beyond_the_end_are_later():
    ensemble = Ensemble(PROLATE, 1e4, 100.0, particles=60, samples=101)
    statistics = Statistics.empty(ensemble.layout)
    statistics.particles, statistics.arrivals[0, 7] = 100, 40
    assert transient_quantile(ensemble, statistics, 0.1).value == 7.0
    assert vars(transient_quantile(ensemble, statistics, 0.9)) == {
        "value": None,
        "low": None,
        "high": None,
    }
    assert [interval.value for interval in arrived(statistics, 0)][6:8] == [0.0, 0.4]


# -- Jeffery ensembles ------------------------------------------------------------------------------------------------


def inverse_deformation(kappa: float, time: float) -> np.ndarray:
    """B = F⁻ᵀF⁻¹ with F = exp(t(W + ΛE)): an axis that starts at p̂₀ is at F p̂₀/|F p̂₀| (Jeffery 1922, section 4)."""
    anisotropy = (kappa**2 - 1) / (kappa**2 + 1)
    gradient = np.array([[0, 0.5 + anisotropy / 2, 0], [-0.5 + anisotropy / 2, 0, 0], [0, 0, 0.0]])
    inverse = expm(-time * gradient)
    return inverse.T @ inverse


def exact_moments(b: np.ndarray) -> tuple[list[float], list[float]]:
    """Second and fourth moments of an ensemble that was isotropic at t = 0.

    ½∫(B+s)⁻¹ds/√|B+s| and ¾∫ s S[(B+s)⁻¹⊗(B+s)⁻¹]ds/√|B+s|, where S is the mean over the three
    pairings of indices: Montgomery-Smith, Jack and Smith, Exact tensor closures for the three
    dimensional Jeffery's equation, arXiv:2106.10805, equations for A and 𝔸 in terms of B.
    """
    values, axes = np.linalg.eigh(b)

    def integral(integrand) -> float:
        # s = u/(1-u) maps to (0, 1).
        def over(u: float) -> float:
            s = u / (1 - u)
            resolvent = (axes / (values + s)) @ axes.T
            return integrand(resolvent, s) / sqrt(np.prod(values + s)) / (1 - u) ** 2

        return quad(over, 0, 1, epsabs=1e-10, limit=200)[0]

    def fourth(r: np.ndarray, s: float, i: int, j: int, k: int, m: int) -> float:
        return s * (r[i, j] * r[k, m] + r[i, k] * r[j, m] + r[i, m] * r[j, k]) / 3

    second = [0.5 * integral(lambda r, s, i=i, j=j: r[i, j]) for i, j in SECOND]
    return second, [
        0.75 * integral(lambda r, s, index=index: fourth(r, s, *index)) for index in FOURTH
    ]


@pytest.mark.parametrize("form", ["quaternion", "spheroid-axis"])
def test_rates_are_those_of_the_motion(form: str):
    """|dp/dt|² by differences, (ω·p)² as what is left of ω² by energy and momentum alone."""
    shape = Ellipsoid((0.8, 1.0, 0.5)) if form == "quaternion" else PROLATE
    scene = Scene(shape, 50.0, BodyStart((0.3, -0.5, 0.7, 0.4), (0.4, -0.7, 0.9)), 1e-4)
    problem = find_form(form).problem(scene)
    seen = find_form(form).observe(
        scene, solve(problem, "cyrk-vern8", 1e-15, np.array([0.0, 5e-5, 1e-4])).states
    )
    for axis in (0, 1, 2) if form == "quaternion" else (2,):
        found = squared_rates(angular_velocity(shape, seen), seen.rotation[:, [axis]])[1, 0]
        moved = (seen.rotation[2, axis] - seen.rotation[0, axis]) / 1e-4
        assert found[1] == pytest.approx(moved @ moved, rel=1e-6)
        spin = seen.rotation[1, axis] @ seen.angular_momentum[1] / shape.inertia[axis]
        assert found[0] == pytest.approx(spin**2, rel=1e-12)
        if form == "quaternion":
            continue
        assert shape.inertia[2] * found[0] + shape.inertia[0] * found[1] == pytest.approx(
            2 * seen.energy[1], rel=1e-12
        )


@pytest.mark.parametrize(("ellipsoid", "anisotropy"), [(PROLATE, 0.6), (OBLATE, -21 / 29)])
def test_isotropic_spheroids_without_inertia_spin_and_tumble_as_they_must(
    ellipsoid: Ellipsoid, anisotropy: float
):
    """⟨(ω·p)²⟩ = 1/12 and ⟨|dp/dt|²⟩ = 1/6 + Λ²/10 over all directions of p in a shear of unit rate, by Jeffery's p."""
    ensemble = Ensemble(ellipsoid, 0.0, 1.0, particles=20_000, block=20_000, samples=2, snapshots=2)
    mean, error = means(ensemble.run(0), "rates")
    assert mean.shape == (2, 1, len(RATES))
    assert np.abs((mean[0, 0] - [1 / 12, 1 / 6 + anisotropy**2 / 10]) / error[0, 0]).max() < 4
    assert error.max() < 0.002


@pytest.mark.parametrize(
    ("semi_axes", "axes"),
    [
        ((1.0, 1.0, 2.0), (2,)),
        ((2.0, 1.0, 1.0), (0,)),
        ((0.5, 1.0, 0.8), (1, 2, 0)),
        ((1.0, 1.0, 1.0), (2,)),
    ],
)
def test_p_is_a_row_of_the_rotation_matrix(
    semi_axes: tuple[float, float, float], axes: tuple[int, ...]
):
    q = [0.8, 0.4, 0.2, 0.4]
    starts = checked(Starts, {"orientation": q, "motion": "fluid"})
    ensemble = Ensemble(Ellipsoid(semi_axes), 1.0, 1e-3, starts, particles=2, block=2)
    assert ensemble.layout.axes == axes
    second = ensemble.run(0).second[0] / 2
    rotation = BodyStart((0.8, 0.4, 0.2, 0.4)).quaternion
    for found, axis in zip(second, axes, strict=True):
        p = matrix_from_quaternion(np.array(rotation))[axis]
        np.testing.assert_allclose(found, [p[i] * p[j] for i, j in SECOND], atol=1e-12)


@pytest.mark.parametrize(("ellipsoid", "kappa", "axis"), [(PROLATE, 2.0, 2), (OBLATE, 0.4, 0)])
def test_jeffery_ensembles_have_the_exact_moments(ellipsoid: Ellipsoid, kappa: float, axis: int):
    ensemble = Ensemble(
        ellipsoid, 0.0, 9.0, particles=20_000, block=20_000, samples=4, snapshots=4, tolerance=1e-8
    )
    assert ensemble.layout.axes == (axis,)
    statistics = ensemble.run(0)
    assert statistics.finished == 20_000
    for snapshot, time in enumerate((0.0, 3.0, 6.0, 9.0)):
        exact = exact_moments(inverse_deformation(kappa, time))
        for truth, (mean, error) in zip(
            exact, (means(statistics, "second"), means(statistics, "fourth")), strict=True
        ):
            assert np.abs((mean[snapshot, 0] - truth) / error[snapshot, 0]).max() < 4
            assert error[snapshot, 0].max() < 0.003


@pytest.mark.parametrize(("ellipsoid", "kappa"), [(PROLATE, 2.0), (OBLATE, 0.4)])
def test_jeffery_ensembles_have_the_exact_mean_over_a_period(ellipsoid: Ellipsoid, kappa: float):
    """⟨p_z²⟩ over orbits and phases.

    On an orbit, p̂ ∝ (-κ sin Θ sin τ, -sin Θ cos τ, cos Θ) with τ uniform in time and tan Θ the
    orbit constant (Jeffery 1922; Leal and Hinch, J. Fluid Mech. 46 (1971) 685), so that the mean of
    p_z² over the period is cos²Θ/√(cos²Θ + κ² sin²Θ). Isotropic starts lie at Θ, τ with density
    (κ/4π) sin Θ (1 + b sin²τ)^(-3/2) where b = (κ² - 1) sin²Θ, the Jacobian of the map to p̂; its
    integral over τ is a complete elliptic one.
    """

    def density(theta: float) -> float:
        b = (kappa**2 - 1) * np.sin(theta) ** 2
        return kappa * np.sin(theta) / np.pi * ellipe(b / (1 + b)) / sqrt(1 + b)

    def mean_square(theta: float) -> float:
        return np.cos(theta) ** 2 / sqrt(np.cos(theta) ** 2 + (kappa * np.sin(theta)) ** 2)

    assert quad(density, 0, np.pi)[0] == pytest.approx(1, abs=1e-9)
    exact = quad(lambda theta: density(theta) * mean_square(theta), 0, np.pi)[0]
    # Half a period: all moments repeat after it.
    period = np.pi * (kappa + 1 / kappa)
    ensemble = Ensemble(
        ellipsoid, 0.0, period, particles=8000, block=8000, samples=33, snapshots=33, tolerance=1e-8
    )
    mean, error = means(ensemble.run(0), "second")
    zz = mean[:, 0, SECOND.index((2, 2))]
    assert zz[-1] == pytest.approx(zz[0], abs=1e-6)
    assert zz[:-1].mean() == pytest.approx(exact, abs=3.5 * error[:, 0, SECOND.index((2, 2))].max())


def test_full_hybrid_and_averaged_equations_have_the_same_statistics():
    starts = Starts(motion="momentum-isotropic", angular_momentum=[0.0, 0.0, -0.7])
    full = Ensemble(
        PROLATE, 2e4, 2000.0, starts, particles=10, tolerance=1e-5, samples=5, snapshots=5
    )
    by_full, by_hybrid, by_averaged = (
        replace(full, equations=equations).run(0) for equations in ("full", "hybrid", "averaged")
    )
    assert by_full.finished == by_hybrid.finished == by_averaged.finished == 10
    # The same starts: what differs is the error, a hundredth of averaging's own for hybrid ones.
    (mean, _), (hybrid, _), (averaged, error) = (
        means(each, "slow") for each in (by_full, by_hybrid, by_averaged)
    )
    assert np.abs(hybrid - mean).max() < 1e-5
    assert np.abs(averaged - mean).max() < 133 / 2e4
    assert (np.abs(averaged - mean) <= np.maximum(error, 1e-9)).all()
    assert means(by_hybrid, "second")[0] == pytest.approx(means(by_full, "second")[0], abs=0.01)


@pytest.mark.parametrize("ellipsoid", [PROLATE, OBLATE])
@pytest.mark.parametrize(
    ("equations", "stokes", "particles"), [("averaged", 1e4, 4000), ("full", 1e3, 100)]
)
def test_every_spheroid_ends_about_its_shortest_axis_at_large_stokes(
    ellipsoid, equations, stokes, particles
):
    starts = Starts(motion="momentum-isotropic", angular_momentum=[0.0, 0.0, -0.7])
    ensemble = Ensemble(
        ellipsoid,
        stokes,
        0.5 * stokes,
        starts,
        particles=particles,
        equations=equations,
        tolerance=1e-6,
        samples=51,
        snapshots=2,
    )
    statistics = ensemble.run(0)
    (attractor,) = ensemble.attractors
    assert attractor.rotation == ("equatorial axis" if ellipsoid is PROLATE else "symmetry axis")
    shares = [interval.value or 0.0 for interval in arrived(statistics, 0)]
    assert shares[0] == 0
    assert shares == sorted(shares)
    assert shares[25] > 0.5
    assert shares[-1] > 0.99
