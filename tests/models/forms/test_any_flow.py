"""Forms in linear flows other than simple shear: against shear, rotations, closed results and another integrator."""

from dataclasses import replace
from math import pi, sqrt

import numpy as np
import pytest

from oracle import first_principles
from polhode.harness.flows import space_frame
from polhode.models.catalogue import FORMS, form
from polhode.models.flow import Flow, flow_numbers, jeffery_spin
from polhode.models.form import FormNotValidError
from polhode.models.rotation import matrix_from_quaternion, quaternion_from_matrix
from polhode.models.scene import BodyStart, EulerStart, Scene, SlowStart
from polhode.models.shape import Ellipsoid
from polhode.solvers.compile import compiled_callback
from polhode.solvers.contract import SolverNotValidError
from polhode.solvers.solve import solve

pytestmark = pytest.mark.usefixtures("quickly_compiled")

ANY_FLOW = [name for name in FORMS if form(name).any_flow and name != "euler-top"]
SHEAR_ALONE = [name for name in FORMS if not form(name).any_flow]
EXPLICIT = ("cyrk-vern8", 1e-13)


def random_gradient(random):
    """A gradient of trace zero, of norm 1 or so."""
    gradient = random.normal(size=(3, 3)) / sqrt(3)
    return gradient - np.eye(3) * np.trace(gradient) / 3


def random_scene(random, name, flow=None):
    """A scene that a form takes."""
    axes = 10 ** random.uniform(-1, 0, 3)
    if "spheroid" in name:
        axes[1] = axes[0]
    stokes = 0.0 if name == "jeffery" else 10 ** random.uniform(-1, 3)
    start = EulerStart(tuple(random.uniform(0.3, 2.8, 3)), tuple(random.normal(size=3)))
    return Scene(Ellipsoid(tuple(axes.tolist())), stokes, start, 10.0, flow)


def in_general_equations(scene):
    """The same scene of simple shear, by the equations of any flow."""
    general = replace(scene)
    object.__setattr__(general, "flow", Flow.shear())
    return general


def observed(name, scene, solver, samples=21):
    """Observables along a run."""
    equations = form(name)
    problem = equations.problem(scene)
    found = solve(problem, *solver, np.linspace(0.0, problem.end, samples))
    assert found.success, found.message
    return equations.observe(scene, found.states)


def apart(first, second):
    """Largest difference of L, E and of the known entries of the rotation matrix."""
    slow = np.max(np.abs(first.slow - second.slow))
    return max(float(slow), float(np.nanmax(np.abs(first.rotation - second.rotation))))


def settled(scene, name="jeffery"):
    """The symmetry axis at the end of a run at St = 0."""
    return observed(name, scene, EXPLICIT).rotation[-1, 2]


# --- equal to simple shear ------------------------------------------------------------------------


@pytest.mark.parametrize("name", ANY_FLOW)
def test_fields_given_the_matrix_of_shear_are_those_of_shear(name):
    random = np.random.default_rng(1)
    for _ in range(20):
        scene = random_scene(random, name)
        problems = [form(name).problem(each) for each in (scene, in_general_equations(scene))]
        rates = np.empty((2, problems[0].dimension))
        for state in random.normal(size=(500, problems[0].dimension)):
            for problem, out in zip(problems, rates, strict=True):
                parameters = np.array(problem.parameters)
                compiled_callback(problem.field, len(state), len(parameters))(
                    state, parameters, out
                )
            assert np.linalg.norm(rates[1] - rates[0]) <= 1e-14 * np.linalg.norm(rates[0])


@pytest.mark.parametrize("solver", ["cyrk-vern8", "taylor", "cvode-bdf", "cyrk-radau", "dop853"])
@pytest.mark.parametrize("name", ANY_FLOW)
def test_runs_given_the_matrix_of_shear_are_those_of_shear(name, solver):
    scene = random_scene(np.random.default_rng(2), name)
    general = in_general_equations(scene)
    assert form(name).problem(general).field is not form(name).problem(scene).field
    tolerance = 1e-9
    difference = apart(
        observed(name, scene, (solver, tolerance)), observed(name, general, (solver, tolerance))
    )
    assert difference < 100 * tolerance


@pytest.mark.parametrize("solver", ["splitting", "splitting-extended", "stroboscopic"])
def test_parts_given_the_matrix_of_shear_are_those_of_shear(solver):
    start = EulerStart((1.0, 0.5, 0.2), (1.0, 1.0, -1.0))
    scene = Scene(Ellipsoid((1.0, 1.0, 2.0)), 1e3, start, 5e3)
    general = in_general_equations(scene)
    first, second = (observed("spheroid-axis", each, (solver, 1e-9)) for each in (scene, general))
    assert np.max(np.abs(first.slow - second.slow)) < 1e-9


def test_shear_given_as_a_matrix_is_simple_shear():
    scene = random_scene(np.random.default_rng(3), "quaternion")
    assert replace(scene, flow=Flow(np.array([[0, 1, 0], [0, 0, 0], [0, 0, 0]]))) == scene
    assert Flow.shear() == Flow.planar(0.0)
    assert Flow.planar(-0.0) == Flow.shear()


# --- other physics --------------------------------------------------------------------------------


def test_jeffery_velocity_agrees_with_the_flow_around_the_body():
    """Against the torque-free angular velocity from a layer of stokeslets."""
    random = np.random.default_rng(4)
    axes = (0.6, 1.0, 0.3)
    rotation = matrix_from_quaternion(random.normal(size=(5, 4)))
    for matrix in rotation:
        gradient = random_gradient(random)
        own = jeffery_spin(Ellipsoid(axes), matrix[None], flow_numbers(gradient))[0]
        inside = matrix @ gradient @ matrix.T
        other = first_principles.torque_free_angular_velocity(axes, inside)
        np.testing.assert_allclose(own, other, atol=1e-9)


@pytest.mark.parametrize("name", ANY_FLOW)
def test_a_rotated_flow_and_start_give_the_rotated_motion(name):
    random = np.random.default_rng(5)
    gradient = random_gradient(random)
    scene = random_scene(random, name, Flow(gradient))
    turn = matrix_from_quaternion(random.normal(size=4))
    turned_start = BodyStart(
        tuple(quaternion_from_matrix(scene.initial_rotation @ turn.T).tolist()),
        scene.angular_velocity,
    )
    rotated = replace(scene, start=turned_start, flow=Flow(turn @ gradient @ turn.T))
    plain, other = (observed(name, each, EXPLICIT) for each in (scene, rotated))
    np.testing.assert_allclose(other.energy, plain.energy, atol=1e-11)
    np.testing.assert_allclose(other.angular_momentum, plain.angular_momentum @ turn.T, atol=1e-11)
    np.testing.assert_allclose(other.rotation, plain.rotation @ turn.T, atol=1e-10)


def rotation_gradient(spin):
    """The gradient of a fluid that rotates as a whole."""
    x, y, z = spin
    return np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])


def test_rigid_rotation_carries_a_body_along():
    """Without inertia a body of any shape turns with a fluid that turns as a whole."""
    spin = np.array([0.3, -0.5, 0.4])
    start = BodyStart((0.5, 0.1, 0.6, 0.3))
    flow = Flow(rotation_gradient(spin))
    scene = Scene(Ellipsoid((1.0, 0.8, 0.5)), 0.0, start, 5.0, flow)
    seen = observed("jeffery", scene, EXPLICIT)
    rate = np.linalg.norm(spin)
    axis = spin / rate
    times = np.linspace(0.0, scene.time, 21)[:, None]
    for row in range(3):
        begin = scene.initial_rotation[row]
        along = (begin @ axis) * axis
        across = begin - along
        expected = along + np.cos(rate * times) * across
        expected = expected + np.sin(rate * times) * np.cross(axis, across)
        np.testing.assert_allclose(seen.rotation[:, row], expected, atol=1e-11)


@pytest.mark.parametrize("name", [name for name in ANY_FLOW if name != "jeffery"])
def test_rigid_rotation_about_a_principal_axis_is_steady(name):
    """A body whose axis lies along the fluid's rotation turns with the fluid, whatever St."""
    start = EulerStart((pi / 2, 0.4, 0.2))
    shape = Ellipsoid((1.0, 1.0, 0.5)) if "spheroid" in name else Ellipsoid((1.0, 0.8, 0.5))
    scene = Scene(shape, 5.0, start, 20.0)
    spin = 0.7 * scene.initial_rotation[2]
    body_spin = BodyStart(start.quaternion, (0.0, 0.0, 0.7))
    flow = Flow(rotation_gradient(spin))
    seen = observed(name, replace(scene, start=body_spin, flow=flow), EXPLICIT)
    np.testing.assert_allclose(
        seen.angular_momentum, np.tile(shape.inertia[2] * spin, (21, 1)), atol=1e-12
    )


def anisotropy(ratio):
    """B = (κ² - 1)/(κ² + 1) of an aspect ratio."""
    return (ratio**2 - 1) / (ratio**2 + 1)


@pytest.mark.parametrize("ratio", [2.0, 0.4])
@pytest.mark.parametrize("alpha", [-0.7, -0.2, 0.1])
def test_orbits_in_planar_flow_close(alpha, ratio):
    """After 4π/√((1-α)² - B²(1+α)²) the symmetry axis is where it was."""
    strain = anisotropy(ratio)
    period = 4 * pi / sqrt((1 - alpha) ** 2 - strain**2 * (1 + alpha) ** 2)
    start = EulerStart((1.1, 0.4, 0.3))
    shape = Ellipsoid((1.0, 1.0, ratio))
    scene = Scene(shape, 0.0, start, period, Flow.planar(alpha))
    # The axis p and -p are one: after half of it the axis lies the other way round in the plane.
    assert np.max(np.abs(settled(scene) - scene.initial_rotation[2])) < 1e-10
    half = settled(replace(scene, time=period / 2))
    np.testing.assert_allclose(half[:2], -scene.initial_rotation[2][:2], atol=1e-10)


@pytest.mark.parametrize("alpha", [0.6, 1.0])
def test_axes_align_in_planar_flow_beyond_the_threshold(alpha):
    """Along the eigenvector of O + B S that grows fastest."""
    ratio = 3.0
    strain = anisotropy(ratio)
    matrix = np.array(Flow.planar(alpha).gradient)
    operator = 0.5 * (matrix - matrix.T) + strain * 0.5 * (matrix + matrix.T)
    assert (1 - alpha) ** 2 < strain**2 * (1 + alpha) ** 2
    values, vectors = np.linalg.eig(operator)
    expected = vectors[:, np.argmax(values.real)].real
    start = EulerStart((1.1, 0.4, 0.3))
    scene = Scene(Ellipsoid((1.0, 1.0, ratio)), 0.0, start, 120.0, Flow.planar(alpha))
    assert abs(abs(settled(scene) @ expected) - 1) < 1e-10


@pytest.mark.parametrize(("ratio", "axis"), [(3.0, "along"), (0.3, "across")])
def test_axes_align_in_extension(ratio, axis):
    """A rod lies along the extension, a disc's axis across it; with inertia too."""
    start = EulerStart((1.1, 0.4, 0.3))
    still = Scene(Ellipsoid((1.0, 1.0, ratio)), 0.0, start, 80.0, Flow.extension())
    for scene, name in ((still, "jeffery"), (replace(still, stokes=0.5), "spheroid-axis")):
        end = settled(scene, name)
        along = abs(end[0])
        assert abs(along - (1.0 if axis == "along" else 0.0)) < 1e-10


def test_an_axis_follows_the_exponential_of_the_gradient():
    """At St = 0 p(t) ∝ exp((O + B S)t) p(0) in every constant flow."""
    from scipy.linalg import expm

    random = np.random.default_rng(7)
    for _ in range(5):
        gradient = random_gradient(random)
        ratio = float(10 ** random.uniform(-1, 1))
        scene = Scene(
            Ellipsoid((1.0, 1.0, ratio)), 0.0, EulerStart((1.1, 0.4, 0.3)), 6.0, Flow(gradient)
        )
        operator = 0.5 * (gradient - gradient.T)
        operator = operator + anisotropy(ratio) * 0.5 * (gradient + gradient.T)
        expected = expm(6.0 * operator) @ scene.initial_rotation[2]
        expected = expected / np.linalg.norm(expected)
        np.testing.assert_allclose(settled(scene), expected, atol=1e-10)


def test_forms_agree_with_an_independent_integration_in_long_double():
    random = np.random.default_rng(8)
    names = [name for name in ANY_FLOW if name != "jeffery"]
    scenes = []
    for k in range(12):
        scene = random_scene(random, names[k % 4], Flow(random_gradient(random)))
        scenes.append((names[k % 4], replace(scene, stokes=float(10 ** random.uniform(0.3, 2)))))
    shapes = [scene.ellipsoid for _, scene in scenes]
    bodies = space_frame.Bodies(
        [shape.scaled_axes for shape in shapes],
        [shape.inertia for shape in shapes],
        [shape.resistance for shape in shapes],
        [scene.stokes for _, scene in scenes],
    )
    gradients = np.array([scene.flow.gradient for _, scene in scenes], dtype=np.longdouble)
    rotation, momentum = space_frame.run(
        bodies,
        [scene.initial_rotation for _, scene in scenes],
        [scene.angular_velocity for _, scene in scenes],
        lambda time, step: gradients,
        [scene.time for _, scene in scenes],
        400,
    )
    compared = 0
    for i, (name, scene) in enumerate(scenes):
        equations = form(name)
        found = solve(equations.problem(scene), *EXPLICIT)
        if not found.success and equations.angles:
            continue
        compared += 1
        seen = equations.observe(scene, found.states)
        difference = np.abs(seen.angular_momentum[-1] - momentum[-1, i])
        assert np.max(difference) < 1e-9 * max(scene.ellipsoid.inertia), (name, scene)
        for axis in equations.known_axes(scene):
            assert np.max(np.abs(seen.rotation[-1, axis] - rotation[-1, i, axis])) < 1e-8, (
                name,
                scene,
            )
    assert compared > 8


# --- refusals -------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", SHEAR_ALONE)
def test_forms_of_shear_alone_refuse_in_one_line(name):
    start = EulerStart((1.0, 0.5, 0.2), (1.0, 1.0, -1.0))
    axes = (1.0, 1.0, 2.0) if name == "averaged-spheroid" else (1.0, 0.8, 0.5)
    scene = Scene(Ellipsoid(axes), 1e4, start, 1e3, Flow.planar(0.5))
    with pytest.raises(FormNotValidError, match="not simple shear") as refusal:
        form(name).problem(scene)
    full = "spheroid-axis" if name == "averaged-spheroid" else "quaternion"
    assert refusal.value.instead == full
    assert "\n" not in str(refusal.value)
    assert not form(name).takes(scene)
    slow = replace(scene, start=SlowStart((0.1, 0.0, 0.0), 0.5 * 0.01 / scene.ellipsoid.inertia[2]))
    assert not form(name).takes(slow)


def test_no_closed_form_in_other_flows():
    scene = Scene(Ellipsoid((1, 1, 2)), 0.0, EulerStart((1.0, 0.5, 0.2)), 5.0, Flow.planar(0.5))
    with pytest.raises(SolverNotValidError, match="no closed form here; use solver 'taylor'"):
        solve(form("jeffery").problem(scene), "exact", 1e-9)


@pytest.mark.parametrize(
    ("gradient", "words"),
    [
        (
            [[1.0, 0, 0], [0, 0, 0], [0, 0, 0]],
            "got the trace 1, expected 0 to 1e-12 of the norm, 1",
        ),
        ([[0, float("nan"), 0], [0, 0, 0], [0, 0, 0]], "got nan, expected finite numbers"),
        ([[0, float("inf"), 0], [0, 0, 0], [0, 0, 0]], "got inf, expected finite numbers"),
        ([[0, 1, 0], [0, 0, 0]], "expected three rows of three numbers"),
        ([[0, 1], [0, 0]], "expected three rows of three numbers"),
        ([[0, "1", 0], [0, 0, 0], [0, 0, 0]], "expected 3 numbers of double precision"),
        (1.0, "got 1.0, expected three rows of three numbers"),
    ],
)
def test_gradients_that_are_none_are_refused(gradient, words):
    with pytest.raises(ValueError, match=r"flow\.gradient: ") as refusal:
        Flow(gradient)
    assert words in str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_a_trace_of_rounding_is_none():
    third = 1 / 3
    Flow(((third, 0, 0), (0, third, 0), (0, 0, -2 / 3)))
