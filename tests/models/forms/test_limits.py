"""Jeffery orbits, tumbling periods, and the choice of the simplest form."""

from math import inf, pi

import mpmath as mp
import numpy as np
import pytest
from observed import observed, orientation_difference, slow_difference

from polhode.harness.answers.rules import simplest
from polhode.models.catalogue import form
from polhode.models.forms.jeffery import JefferyOrbit, _spin_integral
from polhode.models.rotation import matrix_from_quaternion
from polhode.models.scene import BodyStart, EulerStart, Scene, SlowStart
from polhode.models.shape import Ellipsoid
from polhode.models.theory.tumbling_period import tumbling_period
from polhode.solvers.taylor import taylor_integrator

pytestmark = pytest.mark.usefixtures("quickly_compiled")

SHAPES = [
    (1, 1, 2),
    (1, 2, 1),
    (2, 1, 1),
    (0.5, 1, 1),
    (1, 1, 10),
    (1, 1, 0.05),
    (1, 1, 1),
    (1, 1, 1 + 1e-9),
]
STARTS = [
    (pi / 3, pi / 6, 0.3),
    (0, 0, 0),
    (pi / 2, 0, 1.0),
    (pi, 0.3, 0.2),
    (2.5, 4.0, 5.0),
    (1e-9, 0.2, 0.3),
]


@pytest.mark.parametrize("axes", SHAPES)
@pytest.mark.parametrize("angles", STARTS)
def test_jeffery_orbit_solves_the_field_with_its_spin(axes, angles):
    scene = Scene(Ellipsoid(axes), 0.0, EulerStart(angles), 50.0)
    problem = form("jeffery").problem(scene)
    assert problem.closed_form is not None
    times = np.linspace(0, 50, 51)
    closed = problem.closed_form(times)
    assert np.allclose(closed[0], problem.start, rtol=0, atol=1e-14)
    numerical, exact = (
        observed("jeffery", scene, samples=51),
        observed("jeffery", scene, solver="exact", samples=51),
    )
    assert orientation_difference(numerical, exact) < 1e-12
    assert slow_difference(scene, numerical, exact) < 1e-12


@pytest.mark.parametrize("kappa", [1e-9, 1e-6, 1e-3, 0.5, 30.0])
def test_spin_of_thin_discs_and_needles_keeps_its_digits(kappa):
    """The integral over the tangent of the phase, by mpmath; the spin is this over κ."""
    across, along, sine, cosine = 0.8125, 0.1875, float(np.sin(1.5)), float(np.cos(1.5))
    k = mp.mpf(kappa)

    def rate(u):
        w = (1 + (k * u) ** 2) / (1 + u * u)
        return (1 - (k * u) ** 2) / (1 + (k * u) ** 2) / mp.sqrt(along + across * w) / (1 + u * u)

    with mp.workdps(30):
        decades, end = [mp.mpf(10) ** i for i in range(-3, 14)], mp.mpf(sine) / mp.mpf(cosine)
        partial = mp.quad(rate, [0, *(each for each in decades if each < end), end])
        whole = mp.quad(rate, [0, *decades, mp.inf])
    assert abs(float(_spin_integral(sine, cosine, kappa, across, along) - partial)) < 1e-15
    assert abs(float(_spin_integral(1.0, 0.0, kappa, across, along) - whole)) < 1e-15


def test_axis_of_a_long_jeffery_orbit():
    """The phase in 40 digits: 4e7 rad after t = 1e8."""
    orbit, time = JefferyOrbit(2.0, 1.0, 2, BodyStart((0.6, 0.3, 0.5, 0.2)).quaternion), 1e8
    px, py, pz = matrix_from_quaternion(np.array(orbit.quaternion))[2].tolist()
    with mp.workdps(40):
        s, tau = mp.hypot(px / 2, py), mp.atan2(-mp.mpf(px) / 2, -mp.mpf(py)) + mp.mpf(time) / 2.5
        axis = np.array(
            [float(each) for each in (-2 * s * mp.sin(tau), -s * mp.cos(tau), mp.mpf(pz))]
        )
    found = matrix_from_quaternion(orbit.at(np.array([time])))[0, 2]
    assert np.abs(found - axis / np.linalg.norm(axis)).max() < 3e-10


@pytest.mark.parametrize("kappa", [0.01, 0.5, 2.0, 10.0, 100.0])
def test_jeffery_period(kappa):
    """The linear flow's own frequency: the axis p̂ is a line element of the flow W + Λ E, squeezed to unit length."""
    anisotropy = (kappa**2 - 1) / (kappa**2 + 1)
    flow = np.array([[0, 1 + anisotropy], [anisotropy - 1, 0]]) / 2
    period = 2 * pi * (kappa + 1 / kappa)
    assert period == pytest.approx(2 * pi / abs(np.linalg.eigvals(flow)[0].imag), rel=1e-11)
    scene = Scene(Ellipsoid((1.0, 1.0, kappa)), 0.0, EulerStart((1.0, 0.3, 0.2)), period)
    states = form("jeffery").problem(scene).closed_form(np.array([0.0, 1.0]) * period)
    rows = form("jeffery").observe(scene, states).rotation[:, 2]
    assert np.allclose(rows, rows[0], rtol=0, atol=1e-11)
    halfway = form("jeffery").observe(
        scene, form("jeffery").problem(scene).closed_form(np.array([period / 2]))
    )
    assert np.allclose(halfway.rotation[0, 2], rows[0] * [-1, -1, 1], atol=1e-11)


def test_jeffery_orbit_costs_the_same_at_any_time():
    scene = Scene(Ellipsoid((1, 1, 2)), 0.0, EulerStart((1.0, 0.3, 0.2)), 1e9)
    states = form("jeffery").problem(scene).closed_form(np.array([1e9]))
    assert np.linalg.norm(states[0]) == pytest.approx(1, abs=1e-14)


def test_triaxial_jeffery_has_no_closed_form_and_no_inertia():
    scene = Scene(Ellipsoid((1, 0.8, 0.5)), 0.0, EulerStart((1.0, 0.3, 0.2), (5.0, 5.0, 5.0)), 10.0)
    assert form("jeffery").problem(scene).closed_form is None
    at_rest = Scene(scene.ellipsoid, 0.0, EulerStart((1.0, 0.3, 0.2)), 10.0)
    assert np.array_equal(scene.initial.slow, at_rest.initial.slow)


@pytest.mark.parametrize(
    ("axes", "stokes"), [((1.0, 1.0, 3.0), 0.1), ((1.0, 0.8, 0.5), 20.0), ((1.0, 0.8, 0.5), 1e4)]
)
def test_tumbler_turns_in_the_period_of_theory(axes, stokes):
    """One turn on the limit cycle, by Newton's method on its time."""
    scene = Scene(Ellipsoid(axes), stokes, BodyStart((0.5, 0.5, 0.5, 0.5), (0.0, -0.5, 0.0)), 1.0)
    problem, period = form("tumbling").problem(scene), tumbling_period(scene.ellipsoid, stokes, 1)
    integrator = taylor_integrator(problem.field, 2, len(problem.parameters), 1e-16)
    integrator.time, integrator.state[:], integrator.pars[:] = (
        0.0,
        problem.start,
        problem.parameters,
    )
    integrator.propagate_until(40 * stokes / scene.ellipsoid.damping[1])
    integrator.state[0] %= 2 * pi
    integrator.time, goal = 0.0, integrator.state[0] - 2 * pi
    # From a little below, for back in time the damping blows up.
    integrator.propagate_until(period - 1e-4)
    for _ in range(5):
        integrator.propagate_until(
            integrator.time - (integrator.state[0] - goal) / integrator.state[1]
        )
    assert integrator.time == pytest.approx(period, rel=1e-12)


PLANAR = BodyStart((1.0, 0.0, 0.0, 0.3), (0.0, 0.0, 0.5))
TILTED = EulerStart((1.0, 0.3, 0.2), (0.1, 0.2, 0.3))


@pytest.mark.parametrize(
    ("axes", "stokes", "start", "name"),
    [
        ((1, 0.8, 0.5), 10.0, TILTED, "quaternion"),
        ((1, 0.8, 0.5), 10.0, PLANAR, "tumbling"),
        ((1, 1, 2), 10.0, TILTED, "spheroid-axis"),
        ((1, 1, 2), 10.0, PLANAR, "tumbling"),
        ((1, 1, 1), 10.0, TILTED, "spheroid-axis"),
        ((1, 0.8, 0.5), 0.0, TILTED, "jeffery"),
        ((1, 1, 2), 0.0, PLANAR, "jeffery"),
        ((1, 0.8, 0.5), inf, TILTED, "euler-top"),
    ],
)
def test_simplest_form(axes, stokes, start, name):
    scene = Scene(Ellipsoid(axes), stokes, start, 10.0)
    chosen = simplest(scene)
    assert chosen == name
    full = observed("jeffery" if stokes == 0 else "quaternion", scene)
    assert slow_difference(scene, observed(chosen, scene), full) < 1e-10


def test_simplest_form_refuses_what_is_not_defined():
    scene = Scene(Ellipsoid((1, 0.8, 0.5)), 10.0, TILTED, 10.0)
    slow = Scene(scene.ellipsoid, 10.0, SlowStart((0.1, 0.1, -0.2), 0.07), 10.0)
    with pytest.raises(ValueError, match="no orientation; use 'averaged'"):
        simplest(slow)
