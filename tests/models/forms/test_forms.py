"""All full forms describe the same motion, in any naming of the body axes, and refuse what they do not describe."""

from math import cos, inf, pi, sin

import numpy as np
import pytest
from observed import observed, orientation_difference, slow_difference

from oracle.first_principles import body, integrate, momentum_and_energy
from polhode.models.catalogue import FORMS, form
from polhode.models.form import FormNotValidError
from polhode.models.forms.euler_angles import POLE_LIMIT
from polhode.models.free_top.torque_free import TorqueFree
from polhode.models.operations import FLOAT
from polhode.models.rotation import make_third, matrix_from_quaternion
from polhode.models.scene import BodyStart, EulerStart, Scene, SlowStart
from polhode.models.shape import Ellipsoid
from polhode.solvers.solve import solve

pytestmark = pytest.mark.usefixtures("quickly_compiled")

START = EulerStart((pi / 3, pi / 6, 0.3), (1.0, 1.0, -1.0))
STOKES = pytest.mark.parametrize("stokes", [0.1, 1.0, 1e2, 1e4, inf])
TRIAXIAL = (1.0, 0.8, 0.5)
FULL = [name for name in FORMS if not form(name).averaged]


@STOKES
@pytest.mark.parametrize("axes", [TRIAXIAL, (0.5, 1.0, 0.8), (1, 1, 2), (1, 2, 1), (0.3, 1, 1)])
def test_full_forms_agree(axes, stokes):
    scene = Scene(Ellipsoid(axes), stokes, START, 100.0)
    quaternion = observed("quaternion", scene)
    compared = 0
    for name in FULL:
        try:
            form(name).check(scene)
        except FormNotValidError:
            continue
        if name == "spheroid-angles" and near_pole(quaternion, scene.ellipsoid.symmetry_axis):
            continue
        other = observed(name, scene)
        compared += 1
        assert slow_difference(scene, other, quaternion) < 1e-10, name
        assert orientation_difference(other, quaternion) < 1e-10, name
    assert compared >= 2


def near_pole(observables, axis):
    return np.max(np.abs(observables.rotation[:, axis, 2])) > 1 - 1e-6


@pytest.mark.parametrize("stokes", [0.1, 50.0])
@pytest.mark.parametrize("axes", [TRIAXIAL, (0.4, 1, 1)])
def test_quaternion_form_agrees_with_first_principles(axes, stokes):
    angles, rates = (pi / 3, pi / 6, 0.3), (1.0, 1.0, -1.0)
    end = 10.0 if stokes > 1 else 3.0
    scene = Scene(Ellipsoid(axes), stokes, EulerStart(angles, rates), end)
    observables = observed("quaternion", scene, samples=11)
    shape = body(axes)
    rotation, omega = integrate(shape, stokes, angles, rates, np.linspace(0, end, 11))
    momentum, energy = momentum_and_energy(shape, rotation, omega)
    assert np.allclose(observables.rotation, rotation, atol=1e-9)
    assert np.allclose(observables.angular_momentum, momentum, atol=1e-9)
    assert np.allclose(observables.energy, energy, atol=1e-9)


@pytest.mark.parametrize("upright", [0, 1, 2])
@pytest.mark.parametrize("axes", [TRIAXIAL, (1, 1, 2), (2, 1, 1), (1, 0.4, 1), (1, 1, 1)])
@pytest.mark.parametrize("stokes", [0.1, 100.0])
def test_tumbling_agrees_with_quaternion(axes, upright, stokes):
    quaternion = make_third(EulerStart((0.0, 0.3, 0.4)).quaternion, upright)
    rotation = matrix_from_quaternion(np.array(quaternion))
    assert abs(rotation[(2 - upright + 2) % 3, 2]) == pytest.approx(1)
    scene = Scene(Ellipsoid(axes), stokes, BodyStart(quaternion, tuple(0.7 * rotation[:, 2])), 20.0)
    full, planar = (
        observed(name, scene, solver="cyrk-vern8") for name in ("quaternion", "tumbling")
    )
    assert slow_difference(scene, full, planar) < 1e-11
    assert orientation_difference(full, planar) < 1e-11


@pytest.mark.parametrize("name", FORMS)
@pytest.mark.parametrize("axis", [0, 1])
def test_naming_of_the_body_axes_changes_nothing(name, axis):
    scene = example(name)
    named = renamed(scene, axis)
    before, after = (
        observed(name, each, solver="cyrk-dop853", tolerance=1e-15) for each in (scene, named)
    )
    assert slow_difference(scene, before, after) < 1e-11
    rows = [(axis + shift) % 3 for shift in (1, 2, 0)]
    if np.isfinite(before.rotation).any():
        assert np.nanmax(np.abs(before.rotation[:, rows] - after.rotation)) < 1e-11
        assert np.array_equal(np.isnan(before.rotation[:, rows]), np.isnan(after.rotation))


def renamed(scene, axis):
    order = [(axis + shift) % 3 for shift in (1, 2, 0)]
    a, b, c = (scene.ellipsoid.semi_axes[i] for i in order)
    omega = tuple(scene.angular_velocity[i] for i in order)
    return Scene(
        Ellipsoid((a, b, c)),
        scene.stokes,
        BodyStart(make_third(scene.start.quaternion, axis), omega),
        scene.time,
    )


def example(name):
    """A scene that the form accepts."""
    stokes = {"jeffery": 0.0, "euler-top": inf, "averaged-second-order": 1e4}.get(name, 30.0)
    axes = (1.0, 1.0, 2.0) if "spheroid" in name or name == "averaged-second-order" else TRIAXIAL
    start = START
    if name == "tumbling":
        start = BodyStart(EulerStart((pi / 2, 0.3, 0.0)).quaternion, (0.0, 0.4, 0.0))
    return Scene(Ellipsoid(axes), stokes, start, 10.0)


@pytest.mark.parametrize(
    ("name", "unit"), [("quaternion", slice(0, 4)), ("spheroid-axis", slice(3, 6))]
)
def test_drift_of_the_norm_does_not_reach_the_torque(name, unit):
    problem = form(name).problem(example(name))
    drifted = np.array(problem.start)
    drifted[unit] *= 1.01
    before, after = (
        np.array(problem.field(FLOAT)(y, problem.parameters)) for y in (problem.start, drifted)
    )
    kinematic = np.zeros(problem.dimension, dtype=bool)
    kinematic[unit] = True
    assert np.allclose(after[~kinematic], before[~kinematic], rtol=1e-14)
    assert np.allclose(after[kinematic], 1.01 * before[kinematic], rtol=1e-14)
    assert problem.invariant is not None
    assert problem.invariant(drifted[None])[0] == pytest.approx(1.01**2 - 1, rel=1e-12)


def test_odd_permutation_changes_nothing():
    scene = Scene(Ellipsoid(TRIAXIAL), 30.0, START, 50.0)
    q0, q1, q2, q3 = scene.start.quaternion
    half = np.sqrt(0.5)
    w1, w2, w3 = scene.angular_velocity
    turned = BodyStart(
        (half * (q0 - q3), half * (q1 + q2), half * (q2 - q1), half * (q3 + q0)), (w2, -w1, w3)
    )
    swapped = Scene(Ellipsoid((0.8, 1.0, 0.5)), 30.0, turned, 50.0)
    assert (
        slow_difference(scene, observed("quaternion", scene), observed("quaternion", swapped))
        < 1e-11
    )
    averaged = observed("averaged", scene), observed("averaged", swapped)
    assert slow_difference(scene, *averaged) < 1e-12


@pytest.mark.parametrize("solver", ["exact", "taylor"])
@pytest.mark.parametrize("axes", [TRIAXIAL, (1, 2, 1), (1, 1, 1)])
def test_euler_top_keeps_momentum_and_energy(axes, solver):
    scene = Scene(Ellipsoid(axes), inf, START, 100.0)
    observables = observed("euler-top", scene, solver=solver)
    assert np.allclose(observables.slow, scene.initial.slow, atol=1e-13)
    assert orientation_difference(observables, observed("quaternion", scene)) < 1e-11


@pytest.mark.parametrize(
    "name", ["quaternion", "euler-angles", "spheroid-angles", "spheroid-axis", "tumbling"]
)
def test_implicit_form_reaches_stokes_zero(name):
    start = EulerStart((pi / 2, 0.3, 0.0)) if name == "tumbling" else EulerStart((1.0, 0.3, 0.4))
    scene = Scene(Ellipsoid((1, 1, 2)), 0.0, start, 20.0)
    implicit = observed(name, scene, solver="ida", tolerance=1e-11)
    exact = observed("jeffery", scene, solver="exact")
    assert slow_difference(scene, implicit, exact) < 1e-6
    assert orientation_difference(implicit, exact) < 1e-6
    assert form(name).problem(scene).parameters is None


@pytest.mark.parametrize("solver", ["taylor", "dop853", "lsoda", "cyrk-vern8", "cyrk-lsoda"])
@pytest.mark.parametrize("distance", [3e-6, 1e-9])
def test_angles_never_pass_the_pole_unnoticed(solver, distance):
    ellipsoid = Ellipsoid(TRIAXIAL)
    at_pole = EulerStart((distance, 0.3, 0.2)).quaternion
    quaternion, omega = TorqueFree(ellipsoid.inertia, at_pole, (1.0, -0.3, 0.4)).at([-1.0])
    scene = Scene(ellipsoid, inf, BodyStart(tuple(quaternion[0]), tuple(omega[0])), 2.0)
    problem = form("euler-angles").problem(scene)
    solution = solve(problem, solver, 1e-8, np.linspace(0, 2.0, 9))
    assert not solution.success
    exact = observed("euler-top", scene, solver="exact")
    assert (
        orientation_difference(observed("quaternion", scene, solver=solver, tolerance=1e-8), exact)
        < 1e-5
    )


def test_angles_are_right_up_to_the_limit():
    """At the closest approach θ̇ = 0, which fixes the direction of ω."""
    ellipsoid, psi = Ellipsoid(TRIAXIAL), 0.2
    at_pole = EulerStart((2 * POLE_LIMIT, 0.3, psi)).quaternion
    quaternion, omega = TorqueFree(ellipsoid.inertia, at_pole, (sin(psi), cos(psi), 0.4)).at([-1.0])
    scene = Scene(ellipsoid, inf, BodyStart(tuple(quaternion[0]), tuple(omega[0])), 2.0)
    difference = orientation_difference(
        observed("euler-angles", scene), observed("euler-top", scene, solver="exact")
    )
    assert difference < 1e-9


SPHEROID, SPHERE = Ellipsoid((1, 1, 2)), Ellipsoid((1, 1, 1))
SLOW, SLOW_SPHEROID = SlowStart((0.1, 0.1, -0.2), 0.07), SlowStart((0.1, 0.1, -0.2), 0.15)
UPRIGHT = BodyStart((1.0, 0.0, 0.0, 0.0), (0.0, 0.0, -0.5))
REFUSED = [
    ("quaternion", Ellipsoid(TRIAXIAL), 10.0, SLOW, "no orientation", "averaged"),
    ("quaternion", SPHEROID, 10.0, SLOW_SPHEROID, "no orientation", "averaged-spheroid"),
    (
        "euler-angles",
        Ellipsoid(TRIAXIAL),
        10.0,
        EulerStart((1e-6, 0.0, 0.0)),
        "sin θ| = 1.0e-06 < 1e-5",
        "quaternion",
    ),
    ("euler-angles", Ellipsoid(TRIAXIAL), 10.0, UPRIGHT, "sin θ", "quaternion"),
    ("spheroid-angles", Ellipsoid(TRIAXIAL), 10.0, START, "all different", "euler-angles"),
    ("spheroid-angles", SPHEROID, 10.0, UPRIGHT, "sin θ", "spheroid-axis"),
    ("spheroid-axis", Ellipsoid(TRIAXIAL), 10.0, START, "all different", "quaternion"),
    ("spheroid-axis", SPHEROID, 10.0, SLOW_SPHEROID, "no orientation", "averaged-spheroid"),
    ("tumbling", Ellipsoid(TRIAXIAL), 10.0, START, "leaves the vorticity axis", "quaternion"),
    ("tumbling", SPHEROID, 10.0, EulerStart((1.0, 0.0, 0.0)), "no principal axis", "spheroid-axis"),
    ("jeffery", SPHEROID, 10.0, START, "St = 10 is not 0", "quaternion"),
    ("euler-top", SPHEROID, 10.0, START, "St = 10 is finite", "quaternion"),
    ("euler-top", SPHEROID, 0.0, START, "St = 0 is finite", "jeffery"),
    ("averaged", SPHEROID, 10.0, START, "are equal", "averaged-spheroid"),
    (
        "averaged",
        Ellipsoid((*np.array([1.0, 1, 2]),)),
        10.0,
        START,
        "of [1.0, 1.0, 2.0] are",
        "averaged-spheroid",
    ),
    (
        "averaged-spheroid",
        Ellipsoid((*np.array([1.0, 2, 3]),)),
        10.0,
        START,
        "axes [1.0, 2.0, 3.0] are",
        "averaged",
    ),
    ("averaged", Ellipsoid(TRIAXIAL), 0.0, START, "St = 0", "jeffery"),
    ("averaged", Ellipsoid(TRIAXIAL), inf, START, "St = inf", "euler-top"),
    ("averaged", Ellipsoid(TRIAXIAL), 10.0, EulerStart((1.0, 0.0, 0.0)), "L = 0", "quaternion"),
    ("averaged-spheroid", Ellipsoid(TRIAXIAL), 10.0, START, "all different", "averaged"),
    ("averaged-spheroid", SPHEROID, 0.0, START, "St = 0", "jeffery"),
    ("averaged-spheroid", SPHEROID, inf, START, "St = inf", "euler-top"),
    ("averaged-spheroid", SPHEROID, 10.0, EulerStart((1.0, 0.0, 0.0)), "L = 0", "spheroid-axis"),
]


@pytest.mark.parametrize(("name", "ellipsoid", "stokes", "start", "condition", "instead"), REFUSED)
def test_refusal_names_the_condition_and_a_form_that_accepts(
    name, ellipsoid, stokes, start, condition, instead
):
    scene = Scene(ellipsoid, stokes, start, 10.0)
    with pytest.raises(FormNotValidError) as refusal:
        form(name).problem(scene)
    assert condition in refusal.value.condition
    assert (refusal.value.form, refusal.value.instead) == (name, instead)
    assert str(refusal.value) == f"form {name!r}: {refusal.value.condition}; use {instead!r}"
    form(instead).check(scene)


@pytest.mark.parametrize("stokes", [0.0, 10.0, inf])
@pytest.mark.parametrize("name", ["quaternion", "euler-angles", "averaged", "euler-top", "jeffery"])
def test_without_orientation_and_without_averages_no_form_is_named(name: str, stokes: float):
    start = SlowStart((0.0, 0.0, 0.0), 0.0) if stokes == 10 else SLOW
    scene = Scene(Ellipsoid(TRIAXIAL), stokes, start, 1.0)
    with pytest.raises(FormNotValidError) as refusal:
        form(name).check(scene)
    assert not refusal.value.instead


@pytest.mark.parametrize("name", FORMS)
def test_form_says_what_it_is(name):
    equations = form(name)
    assert equations.name == name
    assert equations.summary
    assert equations.valid_for
    assert "e-0" not in equations.valid_for
    problem = equations.problem(example(name))
    assert len(equations.state) == problem.dimension
    assert problem.name == name


@pytest.mark.parametrize("name", FORMS)
def test_observables_at_the_start_are_the_scenes(name):
    scene = example(name)
    equations = form(name)
    observables = equations.observe(scene, np.array([equations.problem(scene).start]))
    initial = scene.initial
    tolerance = 1e-14
    assert np.allclose(observables.slow, initial.slow, atol=tolerance)
    known = np.isfinite(observables.rotation)
    assert np.allclose(observables.rotation[known], initial.rotation[known], atol=tolerance)
    assert np.flatnonzero(known.all(axis=(0, 2))).tolist() == list(equations.known_axes(scene))
