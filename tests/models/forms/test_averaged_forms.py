"""The averaged forms against brute-force averages, 40-digit elliptic integrals, and the full forms."""

from dataclasses import replace
from math import cos, pi

import mpmath
import numpy as np
import pytest
from hypothesis import assume, given, settings, strategies as st
from observed import observed, slow_difference

from oracle.first_principles import averaged_rates, body
from polhode.models.catalogue import form
from polhode.models.forms.averaged import Averaged, mean_squares
from polhode.models.forms.spheroid import Spheroid
from polhode.models.operations import FLOAT
from polhode.models.scene import BodyStart, EulerStart, Scene, SlowStart
from polhode.models.scenes import named_scene
from polhode.models.shape import Ellipsoid
from polhode.models.theory.spheroid_correction import CorrectedSpheroid
from polhode.solvers.contract import Record, Status
from polhode.solvers.solve import solve
from polhode.solvers.taylor import propagate, taylor_integrator

pytestmark = pytest.mark.usefixtures("quickly_compiled")

TRIAXIAL = (1.0, 0.8, 0.5)
lengths = st.floats(0.2, 1.0)
components = st.floats(-1.0, 1.0)


def rates_of(name, scene):
    """Rates of L (3,) and E in slow time; central differences are exact, for L and E are quadratic in the state."""
    problem, equations = form(name).problem(scene), form(name)
    start = np.array(problem.start)
    rates = np.array(problem.field(FLOAT)(problem.start, problem.parameters))
    step = np.linalg.norm(start) / np.linalg.norm(rates)
    before, after = equations.observe(
        scene, np.array([start - step * rates, start + step * rates])
    ).slow
    return (after - before) / (2 * step)


def brute_force(scene, nodes):
    momentum, energy = averaged_rates(
        body(scene.ellipsoid.semi_axes),
        scene.initial.angular_momentum[0],
        float(scene.initial.energy[0]),
        nodes,
    )
    return np.array([*momentum, energy])


@settings(max_examples=20, deadline=None, derandomize=True)
@given(
    shape=st.tuples(lengths, lengths),
    order=st.permutations([0, 1, 2]),
    omega=st.tuples(*[components] * 3),
    angles=st.tuples(components, components, components),
    outer=st.booleans(),
)
def test_averaged_rates_are_brute_force_averages_on_both_sides(shape, order, omega, angles, outer):
    axes = [1.0, *shape]
    axes = tuple(axes[i] for i in order)
    assume(min(abs(axes[i] - axes[j]) for i, j in ((0, 1), (1, 2), (2, 0))) > 0.02)
    ellipsoid = Ellipsoid(axes)
    omega, favoured = np.array(omega), ellipsoid.order[2 if outer else 0]
    omega[favoured] += 1.5
    assume(np.sum(np.square(np.delete(omega, favoured))) > 0.01)
    scene = body_scene(ellipsoid, angles, tuple(omega.tolist()))
    momentum2, energy2 = np.sum(scene.initial.angular_momentum**2), 2 * scene.initial.energy[0]
    middle = sorted(ellipsoid.inertia)[1]
    assume(abs(momentum2 / energy2 / middle - 1) > 0.02)
    truth = brute_force(scene, 2048)
    assert np.max(np.abs(rates_of("averaged", scene) - truth)) < 1e-12 * np.max(np.abs(truth))


def body_scene(ellipsoid, angles, omega):
    return Scene(ellipsoid, 10.0, BodyStart(EulerStart(angles).quaternion, omega), 1.0)


@settings(max_examples=20, deadline=None, derandomize=True)
@given(
    kappa=st.floats(0.2, 5.0),
    axis=st.integers(0, 2),
    omega=st.tuples(*[components] * 3),
    angles=st.tuples(components, components, components),
)
def test_averaged_spheroid_rates_are_brute_force_averages(kappa, axis, omega, angles):
    assume(abs(kappa - 1) > 0.02)
    assume(abs(omega[axis]) > 0.05)
    axes = [1.0, 1.0, 1.0]
    axes[axis] = kappa
    scene = body_scene(Ellipsoid(tuple(axes)), angles, omega)
    assume(np.sum(np.square(np.delete(omega, axis))) > 0.01)
    truth = brute_force(scene, 64)
    assert np.max(np.abs(rates_of("averaged-spheroid", scene) - truth)) < 1e-12 * np.max(
        np.abs(truth)
    )


INERTIA = (0.3, 0.41, 0.6)


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize("exponent", [0, 1, 2, 4, 6, 8, 10, 12, 14, 15])
def test_mean_squares_through_the_separatrix(side, exponent):
    edge = INERTIA[2 if side > 0 else 0] / INERTIA[1] - 1
    momentum2 = INERTIA[1] * (1 + 0.9 * abs(edge) * side * 10.0**-exponent)
    ours = mean_squares(FLOAT)(momentum2, 1.0, *INERTIA)
    assert np.allclose(ours, precise_mean_squares(momentum2, 1.0), rtol=0, atol=1e-15)
    assert sum(ours) == pytest.approx(1, abs=1e-15)


@pytest.mark.parametrize("end", [0, 2])
@pytest.mark.parametrize("distance", [1e-3, 1e-6, 1e-9, 1e-12, 1e-15])
def test_mean_squares_near_permanent_rotations(end, distance):
    momentum2 = INERTIA[end] * (1 + (distance if end == 0 else -distance))
    ours = mean_squares(FLOAT)(momentum2, 1.0, *INERTIA)
    assert np.allclose(ours, precise_mean_squares(momentum2, 1.0), rtol=1e-14, atol=1e-30)


def precise_mean_squares(momentum2, energy2):
    """`pz`, in 40 digits, with the exchange of 1 and 3 beyond L² = 2EI₂."""
    with mpmath.workdps(40):
        square, twice = mpmath.mpf(momentum2), mpmath.mpf(energy2)
        low, middle, high = (mpmath.mpf(i) for i in INERTIA)
        outer = square > twice * middle
        one, three = (low, high) if outer else (high, low)
        m = (middle - one) * (twice * three - square) / ((three - middle) * (square - twice * one))
        sn2 = (1 - mpmath.ellipe(m) / mpmath.ellipk(m)) / m
        z1 = one * (twice * three - square) / ((three - one) * square) * (1 - sn2)
        z2 = middle * (twice * three - square) / ((three - middle) * square) * sn2
        z3 = three * (square - twice * one) / ((three - one) * square) * (1 - m * sn2)
        return [float(z) for z in ((z1, z2, z3) if outer else (z3, z2, z1))]


PAPER = Scene(Ellipsoid(TRIAXIAL), 1e3, EulerStart((pi / 3, pi / 6, 0.0), (1.0, 1.0, -1.0)), 500.0)


def test_averaged_solution_converges_through_the_separatrix():
    """The field is continuous but not Lipschitz at L² = 2EI₂, which the paper's start crosses."""
    problem, equations = form("averaged").problem(PAPER), Averaged()
    precise = equations.observe(PAPER, long_double(problem, 101, 1e-19)).slow.astype(float)
    check = equations.observe(PAPER, long_double(problem, 101, 1e-17)).slow.astype(float)
    uncertainty = np.max(np.abs(precise - check))
    middle = sorted(PAPER.ellipsoid.inertia)[1]
    side = np.sum(precise[:, :3] ** 2, axis=1) - 2 * precise[:, 3] * middle
    assert side[0] < 0 < side[-1]
    errors = []
    for tolerance in (1e-4, 1e-6, 1e-8, 1e-10, 1e-12):
        slow = observed("averaged", PAPER, tolerance=tolerance).slow
        errors.append(np.max(np.abs(slow - precise)) / max(PAPER.ellipsoid.inertia))
    assert uncertainty < 1e-12
    assert errors[-1] < 1e-10
    assert np.polyfit(np.log10([1e-4, 1e-6, 1e-8]), np.log10(errors[:3]), 1)[0] > 0.6, errors


def long_double(problem, samples, tolerance):
    times = np.linspace(0, problem.end, samples)
    integrator = taylor_integrator(
        problem.field, problem.dimension, len(problem.parameters), tolerance, "long double"
    )
    integrator.time, integrator.state[:] = (
        np.longdouble(0),
        np.array(problem.start, dtype=np.longdouble),
    )
    integrator.pars[:] = np.array(problem.parameters, dtype=np.longdouble)
    rows = np.empty((samples, problem.dimension), dtype=np.longdouble)
    rows[0] = problem.start
    status, message = propagate(integrator, Record(times, rows))
    assert status.success, message
    return rows


@pytest.mark.parametrize(
    ("name", "full", "axes"),
    [
        ("averaged", "quaternion", (1.0, 0.6, 0.5)),
        ("averaged-spheroid", "spheroid-axis", (1, 2, 1)),
        ("averaged-spheroid", "spheroid-axis", (1, 1, 0.5)),
    ],
)
def test_error_of_averaging_falls_like_the_inverse_stokes_number(name, full, axes):
    errors = []
    for stokes in (1e3, 1e4):
        scene = Scene(
            Ellipsoid(axes), stokes, EulerStart((1.1, 0.4, 0.2), (0.2, 0.3, -1.0)), 0.2 * stokes
        )
        errors.append(
            slow_difference(scene, observed(name, scene), observed(full, scene, tolerance=1e-12))
        )
    assert 5 < errors[0] / errors[1] < 20, errors


def test_correction_of_the_aligned_spheroid_is_of_second_order():
    """St² × error of L_z and E stays put, St × error of the averaged form does too."""
    corrected, averaged = [], []
    for stokes in (1e3, 1e4):
        scene = aligned(stokes)
        full = observed("spheroid-axis", scene, tolerance=1e-14, samples=301).slow[:, 2:]
        scale = max(scene.ellipsoid.inertia)
        for errors, equations in (
            (corrected, CorrectedSpheroid()),
            (averaged, "averaged-spheroid"),
        ):
            slow = observed(equations, scene, samples=301).slow[:, 2:]
            errors.append(np.max(np.abs(slow - full)) / scale)
    assert errors_ratio(averaged) == pytest.approx(10, rel=0.1)
    assert errors_ratio(corrected) == pytest.approx(100, rel=0.1)


def errors_ratio(errors):
    return errors[0] / errors[1]


def aligned(stokes):
    ellipsoid, theta, precession = Ellipsoid((1, 1, 2)), 1.0, -0.7
    equatorial, _, axial = ellipsoid.inertia
    spin = precession * cos(theta) * (equatorial / axial - 1)
    return Scene(
        ellipsoid, stokes, EulerStart((theta, 0.4, 0.0), (0.0, precession, spin)), 0.3 * stokes
    )


def test_correction_refuses_momentum_off_the_vorticity():
    scene = Scene(Ellipsoid((1, 1, 2)), 1e3, EulerStart((1.0, 0.4, 0.0), (0.1, 0.2, 0.3)), 1.0)
    with pytest.raises(ValueError, match="off the vorticity axis; use 'averaged-spheroid'"):
        CorrectedSpheroid().problem(scene)


@pytest.mark.parametrize("axes", [(1, 1, 2), (2, 1, 1), (1, 0.5, 1), (1, 1, 1)])
def test_slow_start_of_a_spheroid_gives_back_its_energy(axes):
    full = Scene(Ellipsoid(axes), 100.0, EulerStart((1.1, 0.4, 0.2), (0.2, 0.3, -1.0)), 50.0)
    slow = full.initial.slow[0]
    start = SlowStart(tuple(slow[:3].tolist()), float(slow[3]))
    scene = Scene(Ellipsoid(axes), 100.0, start, 50.0)
    assert (
        slow_difference(
            full, observed("averaged-spheroid", full), observed("averaged-spheroid", scene)
        )
        < 1e-12
    )


def test_a_start_on_the_separatrix_is_followed_the_same_from_either_side_of_it():
    ellipsoid = Ellipsoid(TRIAXIAL)
    short, middle, long = sorted(ellipsoid.inertia, reverse=True)
    wobble = np.sqrt(long * (middle - long) / (short * (short - middle)))
    rates = np.zeros(3)
    rates[list(ellipsoid.order)] = 1.0, 0.3, wobble
    errors = []
    for stokes in (1e3, 1e4):
        scene = Scene(
            ellipsoid, stokes, BodyStart((0.8, 0.3, -0.4, 0.2), tuple(rates.tolist())), 0.2 * stokes
        )
        full = observed("quaternion", scene, solver="cyrk-vern8", tolerance=1e-12)
        ours = observed("averaged", scene, solver="cyrk-dop853", tolerance=1e-12)
        errors.append(slow_difference(scene, ours, full))
        for sign in (1, -1):
            moved = SlowStart(
                tuple(scene.initial.angular_momentum[0]),
                scene.initial.energy[0] * (1 + sign * 1e-11),
            )
            other = observed(
                "averaged", replace(scene, start=moved), solver="cyrk-dop853", tolerance=1e-12
            )
            assert slow_difference(scene, ours, other) < 1e-7
    assert errors[1] < 0.3 * errors[0] < 0.3 * 0.13


@pytest.mark.parametrize(
    ("name", "averaged"), [("paper", "averaged"), ("spheroid", "averaged-spheroid")]
)
def test_moment_of_inertia_about_the_axis_of_rotation_stays_in_its_range(name, averaged):
    scene = named_scene(name)
    problem = form(averaged).problem(scene)
    assert problem.invariant is not None
    exact = solve(problem, "cyrk-vern8", 1e-14, np.linspace(0.0, problem.end, 101))
    assert np.abs(problem.invariant(exact.states)).max() < 1e-11
    # L²/2E beyond the largest moment of inertia by a tenth, and for a spheroid L·p̂ beyond |L|.
    start = exact.states[:1]
    beyond = start.copy()
    if averaged == "averaged":
        beyond[0, 3] = np.sum(start[0, :3] ** 2) / 2 / 1.1
    else:
        spheroid = Spheroid.of(scene.ellipsoid)
        beyond[0, 3] = np.sqrt(1.1 * np.sum(start[0, :3] ** 2)) / spheroid.inertia_ratio
    assert problem.invariant(beyond) == pytest.approx([0.1])


def test_a_run_that_leaves_the_range_is_no_success():
    """Energy that falls while L stays takes L²/2E beyond the largest moment of inertia."""
    problem = replace(
        form("averaged").problem(named_scene("paper")), field=draining, parameters=(1.0,), end=2.0
    )
    solution = solve(problem, "cyrk-vern8", 1e-12, np.linspace(0.0, 2.0, 11))
    assert solution.status == Status.FALSE_SUCCESS
    assert "invariant" in solution.message


def draining(_ops):
    """E' = -p₁E, L constant."""
    return lambda y, p: (0 * y[0], 0 * y[1], 0 * y[2], -p[0] * y[3])
