"""The paper's table of Euler-top averages of the ellipsoid against brute-force averages (docs/misprints.md)."""

from itertools import permutations, product

import numpy as np
import pytest
from scipy.special import ellipk

from oracle.first_principles import LEVI_CIVITA, aligned_frame, body, euler_top_ensemble, polhode
from oracle.printed import Ellipsoid
from oracle.verdict import assert_misprint, assert_right, deviation

AXES = (1.0, 0.8, 0.5)
# L in space, along no axis and in no plane of axes, so that no average vanishes by symmetry.
MOMENTUM = np.array([0.21, -0.34, -0.27])
SIDES = pytest.mark.parametrize("toward_longest", [False, True], ids=["L2>2EI2", "L2<2EI2"])
# The orders of three different rows.
DISTINCT = list(permutations(range(3)))


def energy_on_side(toward_longest):
    moments = body(AXES).inertia
    # 2E/L² between 1/I of the axis that the polhode circles and 1/I₂, where the sides meet.
    mixed = 0.6 / moments[0 if toward_longest else 2] + 0.4 / moments[1]
    return MOMENTUM @ MOMENTUM / 2 * mixed


class Averages:
    """Brute-force means over the Euler top; t: space axes, s: L-aligned axes, α: between them, z²: ⟨t_i3,LO²⟩."""

    def __init__(self, toward_longest):
        self.t, self.s, _, self.weights = euler_top_ensemble(
            body(AXES).inertia, MOMENTUM, energy_on_side(toward_longest)
        )
        self.alpha = aligned_frame(MOMENTUM)
        self.z2 = self.weights @ self.s[:, :, 2] ** 2

    def mean(self, *factors):
        return self.weights @ np.prod(factors, axis=0)


@SIDES
def test_right_mean_squares(toward_longest):
    """`pz` with the printed argument μδ read as the parameter m = k²."""
    average = Averages(toward_longest)
    body_ = Ellipsoid(AXES)
    momentum2 = MOMENTUM @ MOMENTUM
    printed = body_.mean_squares(momentum2, energy_on_side(toward_longest))
    assert_right(printed, average.z2, tolerance=1e-12)


@SIDES
def test_misprint_argument_of_the_complete_integrals(toward_longest):
    """K(μδ) is not K of the modulus μδ, the notation of the Euler-top section."""
    body_ = Ellipsoid(AXES)
    arguments = MOMENTUM @ MOMENTUM, energy_on_side(toward_longest)
    as_modulus = body_.mean_squares(*arguments, reading=np.square)
    assert_misprint(
        as_modulus, body_.mean_squares(*arguments), Averages(toward_longest).z2, tolerance=1e-12
    )


@SIDES
def test_right_second_moments_in_aligned_axes(toward_longest):
    average = Averages(toward_longest)
    for k, i, j in product(range(3), repeat=3):
        diagonal = average.z2[k] if i == 2 else (1 - average.z2[k]) / 2
        assert_right(
            diagonal * (i == j),
            average.mean(average.s[:, k, i], average.s[:, k, j]),
            tolerance=1e-13,
        )


@SIDES
def test_right_second_moments_in_space_axes(toward_longest):
    average = Averages(toward_longest)
    for i, j, m in product(range(3), repeat=3):
        along = average.alpha[j, 2] * average.alpha[m, 2] * (3 * average.z2[i] - 1) / 2
        printed = along + (j == m) * (1 - average.z2[i]) / 2
        assert_right(printed, average.mean(average.t[:, i, j], average.t[:, i, m]), tolerance=1e-13)


@SIDES
def test_misprint_third_moments_in_aligned_axes(toward_longest):
    """⟨t_il t_jm t_kn⟩: the Kronecker deltas belong to the column indices l, m, n, not to i, j, k."""
    average = Averages(toward_longest)
    z2 = average.z2
    cases = [(rows, columns) for rows in DISTINCT for columns in product(range(3), repeat=3)]
    printed, corrected, truth = np.array(
        [
            [
                LEVI_CIVITA[rows] * LEVI_CIVITA[columns] * sum(z2[r] for r in rows if r == 2) / 2,
                LEVI_CIVITA[rows]
                * LEVI_CIVITA[columns]
                * sum(z2[r] for r, c in zip(rows, columns, strict=True) if c == 2)
                / 2,
                average.mean(*(average.s[:, r, c] for r, c in zip(rows, columns, strict=True))),
            ]
            for rows, columns in cases
        ]
    ).T
    assert_misprint(printed, corrected, truth, tolerance=1e-13)


@SIDES
def test_misprint_third_moments_of_repeated_rows(toward_longest):
    """The formula holds for three different rows only: ⟨z³⟩ of the enclosed axis does not vanish."""
    average = Averages(toward_longest)
    axis = 0 if toward_longest else 2
    assert (
        abs(average.mean(average.s[:, axis, 2], average.s[:, axis, 2], average.s[:, axis, 2])) > 0.1
    )


@SIDES
def test_misprint_mixed_third_moments(toward_longest):
    """⟨t_i3,LO t_j1 t_k2⟩, the last two in space axes, carries a factor α₃₃/2 (α₃₃ when summed over both orders)."""
    average = Averages(toward_longest)
    for i, j, k in DISTINCT:
        truth = LEVI_CIVITA[i, j, k] * average.mean(
            average.s[:, i, 2], average.t[:, j, 0], average.t[:, k, 1]
        )
        printed = average.z2[i]
        assert_misprint(printed, average.alpha[2, 2] / 2 * printed, truth, tolerance=1e-13)


@SIDES
def test_misprint_third_moments_in_space_axes(toward_longest):
    """General formula: α₁₃, α₂₃, α₃₃ in the case l = 3 are squares, as in the entries below it, which are right."""
    average = Averages(toward_longest)
    z2, last = average.z2, average.alpha[:, 2]
    for i, j, k in DISTINCT:
        means = [
            average.mean(average.t[:, i, m], average.t[:, j, 0], average.t[:, k, 1])
            for m in range(3)
        ]
        truth = LEVI_CIVITA[i, j, k] * np.array(means)
        along_x = last[0] * last[2] * (z2[i] - z2[j]) / 2
        along_y = last[1] * last[2] * (z2[i] - z2[k]) / 2
        assert_right([along_x, along_y], truth[:2], tolerance=1e-13)
        printed = last @ z2[[j, k, i]] / 2
        assert_misprint(printed, last**2 @ z2[[j, k, i]] / 2, truth[2], tolerance=1e-13)


@SIDES
def test_right_period_from_two_routes(toward_longest):
    """The quadrature over the polhode gives the period of the printed solution, 4K/(dτ/dt)."""
    moments = body(AXES).inertia[::-1] if toward_longest else body(AXES).inertia
    i1, i2, i3 = moments
    energy, momentum2 = energy_on_side(toward_longest), MOMENTUM @ MOMENTUM
    excess, deficit = 2 * energy * i3 - momentum2, momentum2 - 2 * energy * i1
    rate = np.sqrt((i3 - i2) * deficit / (i1 * i2 * i3))
    printed = 4 * ellipk((i2 - i1) * excess / ((i3 - i2) * deficit)) / rate
    period = polhode(body(AXES).inertia, np.sqrt(momentum2), energy).period
    assert deviation(printed, period) < 1e-12
