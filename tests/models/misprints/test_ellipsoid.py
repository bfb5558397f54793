"""The paper's slow dynamics of the triaxial ellipsoid against first principles (docs/misprints.md)."""

from math import cos, pi

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from oracle.first_principles import (
    CYCLIC,
    LEVI_CIVITA,
    averaged_rates,
    body_rates,
    euler_top_ensemble,
    jeffery,
    momentum_and_energy,
    rotation_from_euler,
    slow_rates,
)
from oracle.printed import Ellipsoid, jacobian
from oracle.verdict import assert_misprint, assert_right

ELLIPSOID = Ellipsoid((1.0, 0.8, 0.5))
INERTIA, RESISTANCE, AXES = (
    ELLIPSOID.shape.inertia,
    ELLIPSOID.shape.resistance,
    ELLIPSOID.shape.semi_axes,
)
MOMENTUM = np.array([0.21, -0.34, -0.27])
SIZE2 = MOMENTUM @ MOMENTUM
ENERGIES = pytest.mark.parametrize(
    "energy",
    [SIZE2 / 2 * (0.6 / INERTIA[m] + 0.4 / INERTIA[1]) for m in (2, 0)],
    ids=["L2>2EI2", "L2<2EI2"],
)
ROTATION, OMEGA = rotation_from_euler(0.7, 0.4, 1.1), body_rates((0.7, 0.4, 1.1), (0.6, -0.8, 0.5))
START_MOMENTUM, START_ENERGY = momentum_and_energy(ELLIPSOID.shape, ROTATION, OMEGA)


def shear_part(rotation):
    """ε_ijk X_i/(l_j² + l_k²) l_k² t_j1 t_k2 for each i, shape (..., 3): the shear in `lgen` and `egen`."""
    square = AXES**2
    weight = LEVI_CIVITA * RESISTANCE[:, None, None] * square / (square[:, None] + square)
    return np.einsum("ijk,...j,...k->...i", weight, rotation[..., 0], rotation[..., 1])


def test_right_compact_rates():
    """`levo` and `vispow`."""
    torque = RESISTANCE * (OMEGA - jeffery(AXES, ROTATION))
    rate, power = slow_rates(ELLIPSOID.shape, ROTATION, OMEGA)
    assert_right(-8 * pi * torque @ ROTATION, rate)
    assert_right(-8 * pi * torque @ OMEGA, power)


def test_misprint_body_components_of_momentum():
    assert_misprint(
        START_MOMENTUM @ ROTATION, ROTATION @ START_MOMENTUM, INERTIA * OMEGA, tolerance=1e-13
    )


def test_right_expanded_momentum_rate():
    """`lgen`, whose average is `l0`."""
    printed = (RESISTANCE / INERTIA * (ROTATION @ START_MOMENTUM) + shear_part(ROTATION)) @ ROTATION
    assert_right(-8 * pi * printed, slow_rates(ELLIPSOID.shape, ROTATION, OMEGA)[0])


def energy_rate(rotation, momentum, dissipation):
    shear = np.einsum("...i,...il,l->...", shear_part(rotation) / INERTIA, rotation, momentum)
    return -8 * pi * (np.einsum("i,...i->...", RESISTANCE / INERTIA**2, dissipation) + shear)


def test_misprint_energy_rate_squares():
    """`egen`: (L_l t_il)², the square of the sum, not the sum of the squares L_l² t_il²."""
    truth = slow_rates(ELLIPSOID.shape, ROTATION, OMEGA)[1]
    printed = energy_rate(ROTATION, START_MOMENTUM, ROTATION**2 @ START_MOMENTUM**2)
    corrected = energy_rate(ROTATION, START_MOMENTUM, (ROTATION @ START_MOMENTUM) ** 2)
    assert_misprint(printed, corrected, truth)


@ENERGIES
def test_misprint_averaged_energy_rate_squares(energy):
    """`e0` repeats it: L_l² ⟨t_il²⟩ for ⟨(L_l t_il)²⟩ = L²⟨z_i²⟩."""
    rotation, _, _, weights = euler_top_ensemble(INERTIA, MOMENTUM, energy)
    truth = averaged_rates(ELLIPSOID.shape, MOMENTUM, energy)[1]
    printed = weights @ energy_rate(rotation, MOMENTUM, rotation**2 @ MOMENTUM**2)
    corrected = weights @ energy_rate(rotation, MOMENTUM, (rotation @ MOMENTUM) ** 2)
    assert_misprint(printed, corrected, truth)


@ENERGIES
def test_right_slow_ellipsoid_equations(energy):
    """`lxmain`–`emain`, and `lxm`, `lym`, which are the same."""
    rates = averaged_rates(ELLIPSOID.shape, MOMENTUM, energy)
    assert_right(ELLIPSOID.slow([*MOMENTUM, energy]), [*rates[0], rates[1]], tolerance=1e-12)


@ENERGIES
def test_misprint_vorticity_momentum_rate(energy):
    """`lzm`: ε_ijk where C and D have its square."""
    x, y, z = MOMENTUM
    squares = ELLIPSOID.mean_squares(SIZE2, energy)

    def rate(symbol):
        total = (RESISTANCE / INERTIA) @ squares * z
        for i, j, k in [*CYCLIC, *((i, k, j) for i, j, k in CYCLIC)]:
            weight = (
                RESISTANCE[i]
                * symbol(LEVI_CIVITA[i, j, k])
                / (2 * (AXES[j] ** 2 + AXES[k] ** 2) * SIZE2)
            )
            total += (
                weight
                * AXES[k] ** 2
                * (squares[i] * z * z + squares[j] * x * x + squares[k] * y * y)
            )
        return -8 * pi * total

    truth = averaged_rates(ELLIPSOID.shape, MOMENTUM, energy)[0][2]
    assert_misprint(rate(lambda value: value), rate(np.square), truth)


@ENERGIES
def test_misprint_energy_rate_factor(energy):
    """`em`: the second term is half of what is printed, as in `emain`."""
    squares = ELLIPSOID.mean_squares(SIZE2, energy)

    def rate(factor):
        return (
            -8
            * pi
            * (RESISTANCE / INERTIA**2 * SIZE2 + factor * MOMENTUM[2] * RESISTANCE / INERTIA)
            @ squares
        )

    assert_misprint(rate(1), rate(0.5), averaged_rates(ELLIPSOID.shape, MOMENTUM, energy)[1])


def test_misprint_equilibrium_condition():
    """A² − BF is the printed sum only with the factor X_i X_j in each term (and a minus sign)."""
    squares = np.array([0.5, 0.2, 0.3])
    a, b, _, _, f = ELLIPSOID.coefficients(squares)
    pairs = [(0, 1), (2, 0), (1, 2)]
    terms = np.array(
        [(1 / INERTIA[i] - 1 / INERTIA[j]) ** 2 * squares[i] * squares[j] for i, j in pairs]
    )
    drag = np.array([RESISTANCE[i] * RESISTANCE[j] for i, j in pairs])
    assert_misprint(terms.sum(), terms @ drag, b * f - a**2, tolerance=1e-13, gap=0.1)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_right_equilibrium_momentum(axis):
    """L_z = −B/(2A) = −A/(2F) = −I/2 at the principal rotations."""
    a, b, _, _, f = ELLIPSOID.coefficients(np.eye(3)[axis])
    assert_right([-b / (2 * a), -a / (2 * f)], np.full(2, -INERTIA[axis] / 2), tolerance=1e-14)


def test_right_start_near_the_saddle():
    angles, rates = (1.57, 0.0, pi / 2), (0.0, -0.61, 0.0003)
    momentum, energy = momentum_and_energy(
        ELLIPSOID.shape, rotation_from_euler(*angles), body_rates(angles, rates)
    )
    assert momentum @ momentum == pytest.approx(2 * energy * INERTIA[0], rel=1e-5)


@pytest.mark.parametrize("axis", [0, 2], ids=["longest", "shortest"])
def test_right_ellipsoid_fixed_points_and_eigenvalues(axis):
    x, i, (a2, b2, c2) = RESISTANCE, INERTIA, AXES**2
    if axis == 0:
        printed = (
            x[1] * c2 / (a2 + c2) + x[2] * b2 / (a2 + b2),
            x[1] * a2 / (a2 + c2) + x[2] * a2 / (a2 + b2),
            x[0],
            x[2] * (i[0] - i[2]) / i[2] + x[1] * (i[0] - i[1]) / i[1],
        )
    else:
        printed = (
            x[1] * a2 / (a2 + c2) + x[0] * b2 / (c2 + b2),
            x[0] * c2 / (b2 + c2) + x[1] * c2 / (a2 + c2),
            x[2],
            x[0] * (i[2] - i[0]) / i[0] + x[1] * (i[2] - i[1]) / i[1],
        )
    printed = -8 * pi / i[axis] * np.array(printed)
    point = np.array([0, 0, -i[axis] / 2, i[axis] / 8])
    assert_right(ELLIPSOID.slow(np.add(point, [0, 0, 0, 1e-13])), np.zeros(4), tolerance=1e-9)
    matrix = jacobian(lambda y: ELLIPSOID.slow(point + y), np.full(4, 1e-13), step=2e-4)
    assert_right(printed[:2], np.diag(matrix)[:2], tolerance=1e-7)
    assert_right(np.sort(printed[2:]), np.sort(np.linalg.eigvals(matrix[2:, 2:])), tolerance=1e-7)
    assert (printed[3] > 0) == (axis == 0)


def test_right_intermediate_transverse_eigenvalues():
    x, i, (a2, b2, c2) = RESISTANCE, INERTIA, AXES**2
    printed = (
        -8
        * pi
        / i[1]
        * np.array(
            [
                x[0] * c2 / (b2 + c2) + x[2] * a2 / (a2 + b2),
                x[0] * b2 / (b2 + c2) + x[2] * b2 / (a2 + b2),
            ]
        )
    )
    a, b, c, d, _ = ELLIPSOID.coefficients(np.array([0.0, 1.0, 0.0]))
    assert_right(printed, -8 * pi * (a - np.array([b - c, b - d]) / i[1]), tolerance=1e-13)


@pytest.mark.parametrize("kappa", [0.5, 2.0])
def test_right_spheroid_limit_of_mu(kappa):
    moments = np.array([1 + kappa**2, 1 + kappa**2, 2.0])
    axial, equatorial = moments[2], moments[0]
    h2, momentum2 = 0.36, 1.7
    energy = momentum2 * (h2 / axial + (1 - h2) / equatorial) / 2
    mu = (2 * energy * axial - momentum2) / (momentum2 - 2 * energy * equatorial)
    assert mu == pytest.approx(axial * (1 - h2) / (equatorial * h2), rel=1e-12)


@pytest.mark.parametrize(
    ("psi", "precession_axis"), [(0.0, 1), (pi / 2, 0)], ids=["psi=0", "psi=pi/2"]
)
def test_misprint_ellipsoid_start_with_aligned_momentum(psi, precession_axis):
    """The rates L_z/I₁ and L_z cosθ (1/I₃ − 1/I₁) of the caption belong to ψ₀ = π/2; at ψ₀ = 0, I₂ stands for I₁."""
    theta, momentum = 0.8, 0.6

    def aligned(axis):
        rates = (
            0.0,
            momentum / INERTIA[axis],
            momentum * cos(theta) * (1 / INERTIA[2] - 1 / INERTIA[axis]),
        )
        angles = (theta, 0.0, psi)
        return momentum_and_energy(
            ELLIPSOID.shape, rotation_from_euler(*angles), body_rates(angles, rates)
        )[0]

    assert_misprint(
        aligned(1 - precession_axis), aligned(precession_axis), [0, 0, momentum], tolerance=1e-14
    )


def test_misprint_upper_parabola_holds_one_manifold():
    """At the saddle the stable direction is tangent to L_z² = 2EI₁, the unstable one is not."""
    i1 = INERTIA[0]
    point = np.array([0, 0, -i1 / 2, i1 / 8])
    matrix = jacobian(lambda y: ELLIPSOID.slow(point + y), np.full(4, 1e-13), step=2e-4)[2:, 2:]
    values, vectors = np.linalg.eig(matrix)
    slopes = vectors[1] / vectors[0]
    assert slopes[np.argmin(values)] == pytest.approx(-0.5, abs=1e-6)
    assert abs(slopes[np.argmax(values)] + 0.5) > 0.1


def test_misprint_pinch_point_in_infinite_time():
    """From L_z > 0 the slow solution reaches (0, 0) within L_z/(4π min X) of slow time."""
    start = [0, 0, 0.6, 0.18 * (0.5 / INERTIA[2] + 0.5 / INERTIA[1])]
    speed = 4 * pi * RESISTANCE.min()

    def near_pinch(_, state):
        return state[2] - 1e-3

    near_pinch.terminal = True
    limit = 0.6 / speed
    run = solve_ivp(
        lambda _, y: ELLIPSOID.slow(y), (0, limit), start, "DOP853", rtol=1e-9, events=near_pinch
    )
    assert run.status == 1
    assert ELLIPSOID.slow(run.y[:, -1])[2] < -speed


def test_misprint_inset_centre():
    """The inset shows the singular point, (I₂/I₃)(−1/2, 1/8) with μδ = 1; at the printed I₁ lies the saddle."""

    def parameter(axis):
        momentum2, energy = INERTIA[axis] ** 2 / 4, INERTIA[axis] / 8
        i1, i2, i3 = INERTIA if axis == 1 else INERTIA[::-1]
        return (2 * energy * i3 - momentum2) / (momentum2 - 2 * energy * i1) * (i2 - i1) / (i3 - i2)

    assert_misprint(parameter(0), parameter(1), 1.0, tolerance=1e-13)


@pytest.mark.parametrize("zero", [0, 1], ids=["Lx", "Ly"])
def test_misprint_confining_subspace(zero):
    """A start with L_x = 0 stays in the (L_y, L_z, E) space, not in (L_x, L_z, E), and the other way round."""
    momentum = np.where(np.arange(3) == zero, 0.0, MOMENTUM)
    rate = ELLIPSOID.slow([*momentum, SIZE2 / 2 * (0.6 / INERTIA[2] + 0.4 / INERTIA[1])])
    assert rate[zero] == 0
    assert abs(rate[1 - zero]) > 1
