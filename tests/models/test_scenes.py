"""Scenes and their starts: what is refused, what is derived, and the built-in ones."""

from math import inf, nan, pi

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from oracle.first_principles import body_rates, jeffery, rotation_from_euler
from polhode.harness.answers.rules import simplest
from polhode.models.catalogue import FORMS, form
from polhode.models.form import FormNotValidError
from polhode.models.observables import observe_slow
from polhode.models.rotation import (
    angular_velocity_from_euler,
    euler_from_quaternion,
    euler_rates_from_angular_velocity,
    make_third,
    matrix_from_euler,
    matrix_from_quaternion,
    quaternion_from_euler,
    quaternion_from_matrix,
)
from polhode.models.scene import BodyStart, EulerStart, Scene, SlowStart, start_from
from polhode.models.scenes import SCENES, find_scene, named_scene
from polhode.models.shape import Ellipsoid

TRIAXIAL = Ellipsoid((1, 0.8, 0.5))
angles = st.tuples(*[st.floats(-10, 10)] * 3)


@settings(max_examples=100, deadline=None, derandomize=True)
@given(angles, angles, st.integers(0, 2))
def test_orientations_agree_with_elementary_rotations(euler, rates, axis):
    truth = rotation_from_euler(*euler)
    quaternion = quaternion_from_euler(euler)
    assert np.allclose(matrix_from_quaternion(np.array(quaternion)), truth, atol=1e-13)
    assert np.allclose(matrix_from_euler(np.array(euler)), truth, atol=1e-13)
    assert np.allclose(rotation_from_euler(*euler_from_quaternion(quaternion)), truth, atol=1e-12)
    order = [(axis + shift) % 3 for shift in (1, 2, 0)]
    assert np.allclose(
        matrix_from_quaternion(np.array(make_third(quaternion, axis))), truth[order], atol=1e-13
    )
    omega = angular_velocity_from_euler(euler, rates)
    assert np.allclose(omega, body_rates(euler, rates), atol=1e-12)
    if abs(np.sin(euler[0])) > 1e-2:
        assert np.allclose(euler_rates_from_angular_velocity(euler, omega), rates, atol=1e-9)


def test_angular_velocity_at_stokes_zero_is_jefferys():
    scene = Scene(TRIAXIAL, 0.0, EulerStart((0.7, 0.4, 1.1), (9.0, 9.0, 9.0)), 1.0)
    truth = jeffery(TRIAXIAL.semi_axes, rotation_from_euler(0.7, 0.4, 1.1))
    assert np.allclose(scene.angular_velocity, truth, atol=1e-14)
    inertia = np.array(TRIAXIAL.inertia)
    assert np.allclose(
        scene.initial.angular_momentum[0], rotation_from_euler(0.7, 0.4, 1.1).T @ (inertia * truth)
    )
    assert scene.initial.energy[0] == pytest.approx(np.sum(inertia * truth**2) / 2)


def test_durations():
    scene = Scene(TRIAXIAL, 50.0, EulerStart((0.7, 0.4, 1.1)), 100.0)
    assert (scene.slow_time, scene.torque_factor) == (2.0, 0.02)
    top = Scene(TRIAXIAL, inf, scene.start, 100.0)
    assert (top.slow_time, top.torque_factor) == (0.0, 0.0)
    inertialess = Scene(TRIAXIAL, 0.0, scene.start, 100.0)
    assert (inertialess.slow_time, inertialess.torque_factor) == (inf, inf)


@pytest.mark.parametrize(("energy", "ratio"), [(0.0, max), (0.07, lambda _: 3 / 7), (9.0, min)])
def test_a_start_by_l_and_e_is_one_that_the_shape_can_have_where_a_run_led_beyond(
    energy: float, ratio
):
    start = start_from(TRIAXIAL, observe_slow(np.array([[0.1, 0.1, -0.2, energy]])))
    assert isinstance(start, SlowStart)
    assert 0.03 / Scene(TRIAXIAL, 1.0, start, 1.0).initial.energy[0] == pytest.approx(
        ratio(TRIAXIAL.inertia)
    )


@pytest.mark.parametrize("scale", [1e30, 2.0, 1.0, 1e-300, 5e-324])
def test_quaternions_are_normalised(scale: float):
    assert BodyStart((scale, 0.0, 0.0, 0.0)).quaternion == (1.0, 0.0, 0.0, 0.0)
    assert np.linalg.norm(BodyStart((scale, scale, -scale, 0.0)).quaternion) == pytest.approx(
        1, abs=1e-15
    )


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Scene(TRIAXIAL, -1.0, EulerStart((0, 0, 0)), 1.0), "stokes: got -1.0"),
        (lambda: Scene(TRIAXIAL, nan, EulerStart((0, 0, 0)), 1.0), "stokes: got nan"),
        (lambda: Scene(TRIAXIAL, 1.0, EulerStart((0, 0, 0)), 0.0), "time: got 0.0"),
        (lambda: Scene(TRIAXIAL, 1.0, EulerStart((0, 0, 0)), inf), "time: got inf"),
        (
            lambda: Scene(TRIAXIAL, 1e-60, EulerStart((0, 0, 0)), 1e300),
            "^time: got 1e[+]300 at St = 1e-60, expected a",
        ),
        (
            lambda: Scene(TRIAXIAL, "50", EulerStart((0, 0, 0)), 1.0),
            "stokes: got '50', expected a number",
        ),
        (
            lambda: Scene(TRIAXIAL, [50.0], EulerStart((0, 0, 0)), 1.0),
            r"stokes: got \[50.0\], expected a number",
        ),
        (
            lambda: Scene(TRIAXIAL, 1.0, EulerStart((0, 0, 0)), None),
            "time: got None, expected a number",
        ),
        (
            lambda: Scene(TRIAXIAL, 10**400, EulerStart((0, 0, 0)), 1.0),
            r"^stokes: got 10+, expected a number of double",
        ),
        (
            lambda: Scene(TRIAXIAL, 1.0, EulerStart((0, 0, 0)), 10**400),
            r"^time: got 10+, expected a number of double",
        ),
        (
            lambda: Ellipsoid((10**400, 1, 1)),
            r"^semi_axes: got \(10+, expected 3 numbers of double precision$",
        ),
        (lambda: Ellipsoid(-np.ones(3)), "^semi_axes: got -1.0, expected finite positive numbers$"),
        (
            lambda: Scene(TRIAXIAL, np.float64(-1), EulerStart((0, 0, 0)), 1.0),
            "^stokes: got -1.0, expected",
        ),
        (
            lambda: EulerStart(np.full(3, 1e40)),
            r"^start.euler_angles: got \[1e\+40, 1e\+40, 1e\+40\], expected",
        ),
        (lambda: Ellipsoid(None), "semi_axes: got None, expected 3 numbers"),
        (
            lambda: Ellipsoid(("a", 1.0, 1.0)),
            r"semi_axes: got \('a', 1.0, 1.0\), expected 3 numbers",
        ),
        (lambda: Ellipsoid({1, 2, 3}), r"semi_axes: got \{1, 2, 3\}, expected 3 numbers"),
        (
            lambda: Ellipsoid(iter([1, 2, 3])),
            "semi_axes: got <list_iterator .*, expected 3 numbers",
        ),
        (
            lambda: Ellipsoid((1e200, 1e-200, 1)),
            r"semi_axes: got \[1e\+200, 1e-200, 1.0\], expected shortest / longest",
        ),
        (
            lambda: Scene((1, 1, 1), 1.0, EulerStart((0, 0, 0)), 1.0),
            r"ellipsoid: got \(1, 1, 1\), expected an Ell",
        ),
        (
            lambda: Scene(TRIAXIAL, 1.0, (0, 0, 0), 1.0),
            r"start: got \(0, 0, 0\), expected an EulerStart, Body",
        ),
        (lambda: EulerStart("abc"), "start.euler_angles: got 'abc', expected 3 numbers"),
        (lambda: SlowStart((0.1, 0.0, 0.0), "0.1"), "start.energy: got '0.1', expected a number"),
        (lambda: EulerStart((0.0, nan, 0.0)), r"start.euler_angles: got \[0.0, nan, 0.0\]"),
        (lambda: EulerStart((0.0, 0.0, 0.0), (inf, 0.0, 0.0)), "start.euler_rates: got"),
        (
            lambda: EulerStart((0.0, 0.0)),
            "start.euler_angles: got \\(0.0, 0.0\\), expected 3 numbers",
        ),
        (lambda: BodyStart((0.0, 0.0, 0.0, 0.0)), "start.quaternion: got"),
        (lambda: BodyStart((1.0, 0.0, 0.0, nan)), "start.quaternion: got"),
        (
            lambda: BodyStart((1.0, 0.0, 0.0)),
            "start.quaternion: got \\(1.0, 0.0, 0.0\\), expected 4 numbers",
        ),
        (lambda: BodyStart((1.0, 0.0, 0.0, 0.0), (0.0, 0.0, nan)), "start.angular_velocity: got"),
        (lambda: find_scene("x" * 5000), r"scene: got 'x+', expected a file or one of paper"),
        (lambda: form("..:x"), r"form: got '\.\.:x', expected one of euler-angles"),
        (lambda: SlowStart((0.1, 0.0, nan), 0.1), "start.angular_momentum: got"),
        (lambda: SlowStart((0.1, 0.0, 0.0), -0.1), "start.energy: got -0.1"),
        (lambda: Scene(TRIAXIAL, 1.0, SlowStart((0.1, 0.0, 0.0), 9.0), 1.0), "start: got L² / 2E"),
        (
            lambda: Scene(TRIAXIAL, 1.0, SlowStart((0.1, 0.1, -0.2), 0.07), 1.0).angular_velocity,
            "expected an orientation",
        ),
    ],
)
def test_what_has_no_meaning_is_refused_by_name(make, message):
    with pytest.raises(ValueError, match=message):
        make()


@pytest.fixture(scope="module")
def accepting() -> dict[str, list[str]]:
    """Forms that accept each built-in scene."""

    def accepts(name: str, scene: Scene) -> bool:
        try:
            form(name).check(scene)
        except FormNotValidError:
            return False
        return True

    return {
        name: [each for each in FORMS if accepts(each, entry.scene)]
        for name, entry in SCENES.items()
    }


@pytest.mark.parametrize("name", SCENES)
def test_built_in_scene(name, accepting):
    scene = named_scene(name)
    assert SCENES[name].scene is scene
    assert SCENES[name].summary
    assert "\n" not in SCENES[name].summary
    chosen = simplest(scene)
    assert form(chosen).problem(scene).end == scene.time
    assert chosen in accepting[name]


def test_every_form_has_a_built_in_scene(accepting):
    assert set(FORMS) == {form for forms in accepting.values() for form in forms}


def test_unknown_scene_names_the_known_ones():
    with pytest.raises(ValueError, match="scene: got 'papr', expected one of paper, paper-saddle"):
        named_scene("papr")


def test_paper_scene_is_the_papers():
    scene = named_scene("paper")
    assert scene.ellipsoid.semi_axes == (1.0, 0.8, 0.5)
    assert scene.start == EulerStart((pi / 3, pi / 6, 0.0), (1.0, 1.0, -1.0))


def test_scenes_are_as_hard_as_they_say():
    start = named_scene("paper").initial
    middle = sorted(named_scene("paper").ellipsoid.inertia)[1]
    assert np.sum(start.angular_momentum**2) < 2 * middle * start.energy[0]
    pinch = named_scene("pinch-point").initial.angular_momentum[0]
    assert pinch[2] > 0
    assert np.hypot(*pinch[:2]) < 1e-15
    assert np.linalg.norm(named_scene("fast-spin").angular_velocity) == pytest.approx(1e3, rel=1e-3)
    for name in SCENES:
        if name.startswith("rest-"):
            assert not np.any(named_scene(name).initial.slow)


def test_a_quaternion_comes_back_from_its_matrix_but_for_its_sign():
    random = np.random.default_rng(7)
    # Any, about half turns about any axis and about the three of the body, and next to none.
    some = random.normal(size=(300, 4)) * 10 ** random.uniform(-9, 0, (300, 4))
    q = np.concatenate(
        [
            random.normal(size=(100, 4)),
            some,
            np.eye(4),
            np.eye(4) + 1e-9 * random.normal(size=(4, 4)),
        ]
    )
    q /= np.linalg.norm(q, axis=1, keepdims=True)
    found = quaternion_from_matrix(matrix_from_quaternion(q))
    assert found.shape == q.shape
    np.testing.assert_allclose(np.abs(np.sum(found * q, axis=1)), 1.0, rtol=1e-15)
    np.testing.assert_allclose(
        found * np.sign(np.sum(found * q, axis=1, keepdims=True)), q, atol=3e-16
    )
    np.testing.assert_allclose(
        quaternion_from_matrix(matrix_from_quaternion(q[0])), found[0], atol=1e-16
    )
