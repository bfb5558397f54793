"""Fixed points and the singular point of the slow manifold, against the averaged equations in 50 digits.

The averaged equations know nothing of either: eigenvalues are compared with Jacobians by
differences, and the local solution with rates close to the singular point and with an integration
right into it.
"""

import mpmath
import numpy as np
import pytest

from polhode.models.forms.averaged import coefficients, field
from polhode.models.operations import Operations
from polhode.models.shape import Ellipsoid
from polhode.models.theory.fixed_points import eigenvalues, fixed_points
from polhode.models.theory.separatrix import Separatrix

TRIAXIAL = [(1.0, 0.8, 0.5), (0.3, 1.0, 0.55), (0.95, 0.3, 1.0), (0.1, 1.0, 0.15)]
PHASES = 16


@pytest.fixture(autouse=True)
def _digits():
    with mpmath.workdps(50):
        yield


def averaged(ellipsoid):
    """The field of the averaged form, taken out of its units of the largest moment of inertia."""
    operations = Operations(mpmath.sin, mpmath.cos, mpmath.sqrt, lambda x, a, b: a if x > 0 else b)
    rhs, parameters = field(operations), [mpmath.mpf(value) for value in coefficients(ellipsoid)]
    unit = mpmath.mpf(max(ellipsoid.inertia))
    return lambda state: [
        unit * rate for rate in rhs([mpmath.mpf(value) / unit for value in state], parameters)
    ]


def averaged_over_the_cone(ellipsoid):
    """Rates of (L_x, L_y, L_z, η) of a spheroid from the torque on it, averaged over its precession about L."""
    axis = ellipsoid.symmetry_axis or 0
    other = (axis + 1) % 3
    kappa = mpmath.mpf(ellipsoid.semi_axes[axis]) / ellipsoid.semi_axes[other]
    ia, ie = ellipsoid.inertia[axis], ellipsoid.inertia[other]
    xc, yc = ellipsoid.resistance[axis], ellipsoid.resistance[other]
    bretherton = (kappa**2 - 1) / (kappa**2 + 1)

    def dot(u, v):
        return sum(a * b for a, b in zip(u, v, strict=True))

    def cross(u, v):
        return [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]]

    def rates(state):
        momentum, eta = state[:3], state[3]
        size = mpmath.sqrt(dot(momentum, momentum))
        along = [value / size for value in momentum]
        first = cross(along, [1, 0, 0])
        length = mpmath.sqrt(dot(first, first))
        first = [value / length for value in first]
        second = cross(along, first)
        h = ia * eta / size
        radius = mpmath.sqrt(1 - h * h)
        total = [mpmath.mpf(0)] * 4
        for phase in range(PHASES):
            c, s = (
                mpmath.cos(2 * mpmath.pi * phase / PHASES),
                mpmath.sin(2 * mpmath.pi * phase / PHASES),
            )
            p = [
                h * a + radius * (c * u + s * v)
                for a, u, v in zip(along, first, second, strict=True)
            ]
            strain = [p[1] / 2, p[0] / 2, mpmath.mpf(0)]
            turn = cross(p, strain)
            slip = [
                m / ie
                + (1 / mpmath.mpf(ia) - 1 / mpmath.mpf(ie)) * dot(momentum, p) * q
                - (w + bretherton * t)
                for m, q, w, t in zip(momentum, p, [0, 0, mpmath.mpf(-1) / 2], turn, strict=True)
            ]
            axial = dot(slip, p)
            torque = [
                -8 * mpmath.pi * (yc * (w - axial * q) + xc * axial * q)
                for w, q in zip(slip, p, strict=True)
            ]
            for i in range(3):
                total[i] += torque[i] / PHASES
            total[3] += -8 * mpmath.pi * xc * axial / ia / PHASES
        return [mpmath.re(value) for value in total]

    return rates


def jacobian(rates, point, size):
    step = mpmath.mpf(10) ** -12
    matrix = np.zeros((size, size))
    for j in range(size):
        moved = [
            [mpmath.mpf(x) + (sign * step if i == j else 0) for i, x in enumerate(point)]
            for sign in (1, -1)
        ]
        high, low = rates(moved[0]), rates(moved[1])
        matrix[:, j] = [float((high[i] - low[i]) / (2 * step)) for i in range(size)]
    return matrix


def assert_eigenvalues(point, rates, size=4):
    state = [*map(mpmath.mpf, point.state), *([mpmath.mpf(0)] * (4 - len(point.state)))]
    assert max(abs(value) for value in rates(state)) < 1e-13
    matrix = jacobian(rates, state, size)
    found = [*np.diag(matrix)[:2], *sorted(np.linalg.eigvals(matrix[2:, 2:]).real)]
    expected = [*point.eigenvalues[:2], *sorted(point.eigenvalues[2:])]
    assert np.count_nonzero(np.abs(matrix[:2]) > 1e-9) == 2
    np.testing.assert_allclose(found, expected, rtol=1e-10)


@pytest.mark.parametrize("which", [0, 2])
@pytest.mark.parametrize("semi_axes", TRIAXIAL)
def test_longest_and_shortest_axis(semi_axes, which):
    ellipsoid = Ellipsoid(semi_axes)
    point = fixed_points(ellipsoid)[which]
    assert_eigenvalues(point, averaged(ellipsoid))
    assert point.stability == ("saddle" if which == 0 else "stable node")


@pytest.mark.parametrize("kappa", [0.1, 0.3, 2.0, 3.33])
@pytest.mark.parametrize("axis", [0, 2])
def test_spheroids(kappa, axis):
    semi_axes = [1.0, 1.0, 1.0]
    semi_axes[axis] = kappa
    ellipsoid = Ellipsoid((semi_axes[0], semi_axes[1], semi_axes[2]))
    points = fixed_points(ellipsoid)
    for point in points:
        assert_eigenvalues(point, averaged_over_the_cone(ellipsoid))
    spinning, tumbling = {point.stability for point in points[:2]}, points[2].stability
    assert spinning == {"saddle" if kappa > 1 else "stable node"}
    assert tumbling == ("stable node" if kappa > 1 else "saddle")


def test_sphere():
    ellipsoid = Ellipsoid((2.0, 2.0, 2.0))
    (point,) = fixed_points(ellipsoid)
    assert_eigenvalues(point, averaged_over_the_cone(ellipsoid), size=3)
    assert point.stability == "stable node"


@pytest.mark.parametrize("side", ["long", "short"])
@pytest.mark.parametrize("semi_axes", TRIAXIAL)
def test_two_eigenvalues_of_the_middle_axis_are_limits(semi_axes, side):
    """The rates of L_x and L_y are linear in 1/ln(16/y), up to powers of y: two values of y give the limit."""
    ellipsoid = Ellipsoid(semi_axes)
    point = fixed_points(ellipsoid)[1]
    assert point.stability == "singular"
    local, rates, tiny = Separatrix(ellipsoid, side), averaged(ellipsoid), mpmath.mpf(10) ** -25
    complements = [mpmath.mpf(10) ** -12, mpmath.mpf(10) ** -16]
    weights = [1 / mpmath.log(16 / y) for y in complements]
    values = []
    for y in complements:
        _, _, lz, energy = slow_state(local, y)
        values.append(
            [rates([tiny, 0, lz, energy])[0] / tiny, rates([0, tiny, lz, energy])[1] / tiny]
        )
    for i in range(2):
        limit = (values[0][i] * weights[1] - values[1][i] * weights[0]) / (weights[1] - weights[0])
        assert float(limit) == pytest.approx(point.eigenvalues[i], rel=1e-8)
        assert abs(float(values[0][i]) / point.eigenvalues[i] - 1) < 5 * float(weights[0])
    assert point.eigenvalues == eigenvalues(ellipsoid, ellipsoid.order[1])[:2]


def slow_state(local, y, shift=0):
    """(L_x, L_y, L_z, E) at y and L_z', in high precision, for the very moments of inertia that the field has."""
    i2, near, far = moments(local)
    momentum2 = (shift - i2 / 2) ** 2
    # y (I_near - I₂)(L² - 2E I_far) = (I_near - I_far)(L² - 2E I₂)
    share = y * (near - i2) / (near - far)
    return 0, 0, shift - i2 / 2, momentum2 * (1 - share) / (2 * (i2 - share * far))


def moments(local):
    unit = mpmath.mpf(max(local.ellipsoid.inertia))
    i1, i2, i3 = (unit * mpmath.mpf(value) for value in coefficients(local.ellipsoid)[:3])
    return (i2, i3, i1) if local.side == "short" else (i2, i1, i3)


def averaged_local_rates(local):
    """Rates of y = (I_near - I_far)(L² - 2EI₂)/((I_near - I₂)(L² - 2EI_far)) and of L_z', from those of L_z and E."""
    rates, (i2, near, far) = averaged(local.ellipsoid), moments(local)

    def of(y, shift):
        _, _, lz, energy = state = slow_state(local, y, shift)
        _, _, d_lz, d_energy = rates(state)
        top, bottom = lz * lz - 2 * energy * i2, lz * lz - 2 * energy * far
        d_top, d_bottom = 2 * (lz * d_lz - d_energy * i2), 2 * (lz * d_lz - d_energy * far)
        return (near - far) / (near - i2) * (d_top / bottom - top * d_bottom / bottom**2), d_lz

    return of


SIDES = pytest.mark.parametrize("side", ["long", "short"])
SHAPES = pytest.mark.parametrize("semi_axes", TRIAXIAL[:3])


@SIDES
@SHAPES
@pytest.mark.parametrize("slope", [-0.3, 0.0, 0.3])
def test_local_rates_are_good_to_powers_of_y(semi_axes, side, slope):
    """The relative error of `muasymp` and `lzasymp` falls like y ln(16/y), not like a logarithm."""
    local = Separatrix(Ellipsoid(semi_axes), side)
    exact_rates = averaged_local_rates(local)
    for y in (1e-4, 1e-7, 1e-10):
        shift = slope * y * sum(local.ellipsoid.inertia)
        exact = [float(rate) for rate in exact_rates(mpmath.mpf(y), mpmath.mpf(shift))]
        np.testing.assert_allclose(
            local.rates(y, shift), exact, rtol=20 * y * np.log(16 / y) + 1e-13
        )


@SIDES
@SHAPES
def test_critical_trajectory_meets_the_singular_point_in_finite_time(semi_axes, side):
    """The averaged equations, integrated in √y from the critical trajectory to the point, hit L_z' = 0 at that time."""
    start = 1e-5
    local = Separatrix(Ellipsoid(semi_axes), side)
    rates = averaged_local_rates(local)

    def slope(root, shift):
        d_y, d_shift = rates(root * root, shift)
        return 2 * root / d_y, 2 * root * d_shift / d_y

    root, end, steps = mpmath.sqrt(start), mpmath.mpf(10) ** -7, 60
    time, shift = mpmath.mpf(0), mpmath.mpf(local.critical(start))
    ratio = (end / root) ** (mpmath.mpf(1) / steps)
    for _ in range(steps):
        h = root * (ratio - 1)
        k1 = slope(root, shift)
        k2 = slope(root + h / 2, shift + h / 2 * k1[1])
        k3 = slope(root + h / 2, shift + h / 2 * k2[1])
        k4 = slope(root + h, shift + h * k3[1])
        time += h / 6 * (k1[0] + 2 * k2[0] + 2 * k3[0] + k4[0])
        shift += h / 6 * (k1[1] + 2 * k2[1] + 2 * k3[1] + k4[1])
        root += h
    assert float(-time) == pytest.approx(local.time(start) - local.time(1e-14), rel=1e-3)
    assert abs(float(shift)) < 1e-3 * abs(local.critical(start))
    assert local.time(start) * {"long": -1, "short": 1}[side] > 0
    leading_order_alone = start * np.log(16 / start) / local.growth
    assert abs(float(-time) / leading_order_alone - 1) > 0.05


@SIDES
def test_solution_satisfies_the_local_equations(side):
    local = Separatrix(Ellipsoid((1.0, 0.8, 0.5)), side)
    y, step, start = 3e-3, 1e-6, (1e-3, 0.02)
    d_y, d_shift = local.rates(y, local.shift(y, *start))
    assert (local.time(y + step) - local.time(y - step)) / (2 * step) == pytest.approx(
        1 / d_y, rel=1e-6
    )
    slope = (local.shift(y + step, *start) - local.shift(y - step, *start)) / (2 * step)
    assert slope == pytest.approx(d_shift / d_y, rel=1e-6)
    assert local.shift(1e-3, *start) == pytest.approx(0.02, rel=1e-14)
    for value in (1e-300, 1e-12, 0.1, 0.99):
        assert local.complement(local.time(value)) == pytest.approx(value, rel=1e-12)
    assert local.complement(0.0) == local.critical(0.0) == 0.0


@SIDES
def test_slow_state_has_the_y_asked_for(side):
    local = Separatrix(Ellipsoid((0.5, 1.0, 0.8)), side)
    _, _, lz, energy = local.slow_state(0.3, 0.01)
    _, _, lz_exact, energy_exact = slow_state(local, mpmath.mpf("0.3"), mpmath.mpf("0.01"))
    assert (lz, energy) == pytest.approx((float(lz_exact), float(energy_exact)), rel=1e-14)


def test_separatrix_refuses_times_of_the_other_side():
    with pytest.raises(ValueError, match="on the short side"):
        Separatrix(Ellipsoid((1.0, 0.8, 0.5)), "short").complement(-0.01)
