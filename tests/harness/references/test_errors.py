"""Error measures, on solutions that were spoilt on purpose by a known amount."""

from dataclasses import replace
from math import cos, pi, sin

import numpy as np
import pytest

from polhode.harness.references.errors import balance_residual, errors, statistics_distance
from polhode.models.catalogue import form as find_form
from polhode.models.observables import Observables, completed
from polhode.models.scene import Scene
from polhode.models.scenes import named_scene
from polhode.models.shape import Ellipsoid
from polhode.solvers.solve import solve

pytestmark = pytest.mark.usefixtures("quickly_compiled")

TRIAXIAL = Ellipsoid((1.0, 0.8, 0.5))
PROLATE = Ellipsoid((1.0, 1.0, 2.0))


def solved(scene: Scene, form: str, samples: int, tolerance: float = 1e-14) -> Observables:
    shape = find_form(form)
    problem = shape.problem(scene)
    return shape.observe(
        scene, solve(problem, "taylor", tolerance, np.linspace(0, problem.end, samples)).states
    )


def turned(rotation: np.ndarray, axis: np.ndarray, angle: float) -> np.ndarray:
    """Bodies turned by an angle about axes in space, shape (n, 3), by Rodrigues' formula on each body axis."""
    k = axis[:, None] / np.linalg.norm(axis, axis=1)[:, None, None]
    along = np.sum(rotation * k, axis=2, keepdims=True)
    return rotation * cos(angle) + np.cross(k, rotation) * sin(angle) + k * along * (1 - cos(angle))


@pytest.fixture(scope="module")
def run() -> Observables:
    return solved(replace(named_scene("paper"), stokes=100.0, time=50.0), "quaternion", 501)


def test_each_slow_variable_has_its_own_error(run: Observables):
    momentum, energy = run.angular_momentum.copy(), run.energy.copy()
    momentum[7] += np.array([1e-3, -2e-3, 3e-3]) * max(TRIAXIAL.inertia)
    energy[9] -= 4e-3 * max(TRIAXIAL.inertia)
    found = errors(TRIAXIAL, Observables(momentum, energy, run.rotation), run)
    assert found.slow_each == pytest.approx((1e-3, 2e-3, 3e-3, 4e-3))
    assert (found.slow, found.worst_sample) == (pytest.approx(4e-3), 9)
    assert found.orientation == 0


@pytest.mark.parametrize("angle", [1e-12, 1e-3, 3.0])
def test_orientation_error_is_the_angle_turned(run: Observables, angle: float):
    axis = np.tile([0.3, -0.5, 0.8], (501, 1))
    found = errors(TRIAXIAL, replace(run, rotation=turned(run.rotation, axis, angle)), run)
    assert found.orientation == pytest.approx(angle, rel=1e-3)


def test_phase_is_along_the_motion_and_shape_across(run: Observables):
    body = np.einsum("nij,nj->ni", run.rotation, run.angular_momentum) / np.array(TRIAXIAL.inertia)
    omega = np.einsum("nij,ni->nj", run.rotation, body)
    across = np.cross(omega, [0.2, 0.9, -0.4])
    late = errors(TRIAXIAL, replace(run, rotation=turned(run.rotation, omega, 1e-5)), run)
    aside = errors(TRIAXIAL, replace(run, rotation=turned(run.rotation, across, 1e-5)), run)
    assert late.phase == pytest.approx(1e-5)
    assert late.shape == pytest.approx(0, abs=1e-9)
    assert aside.shape == pytest.approx(1e-5)
    assert aside.phase == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize("form", ["quaternion", "spheroid-axis", "spheroid-angles"])
def test_a_run_shifted_in_time_is_out_of_phase_alone(form: str):
    scene = replace(named_scene("spheroid"), time=20.0)
    delay = 1e-6
    later = replace(scene, time=20.0 + 20.0 / 200)
    dense = solved(later, "quaternion", 202)
    shape = find_form(form)
    problem = shape.problem(later)
    times = np.concatenate([[0.0], np.linspace(0, later.time, 202)[1:] + delay])
    shifted = shape.observe(
        later, solve(replace(problem, end=times[-1]), "taylor", 1e-14, times).states
    )
    found = errors(PROLATE, shifted, dense)
    speed = (
        np.linalg.norm(np.cross(dense.angular_momentum, dense.rotation[:, 2]), axis=1)
        / PROLATE.inertia[0]
    )
    assert found.phase == pytest.approx(delay * speed[1:].max(), rel=1e-4)
    assert found.shape is not None
    assert found.shape < 1e-4 * delay


def test_large_differences_are_not_split(run: Observables):
    found = errors(
        TRIAXIAL,
        replace(run, rotation=turned(run.rotation, np.tile([1.0, 0, 0], (501, 1)), 1.0)),
        run,
    )
    assert found.orientation == pytest.approx(1.0)
    assert found.phase is None
    assert found.shape is None


@pytest.mark.parametrize(
    ("semi_axes", "form"), [((1, 0.8, 0.5), "quaternion"), ((1, 1, 2), "spheroid-axis")]
)
def test_balance_shows_energy_that_nobody_put_in(semi_axes: tuple, form: str):
    scene = Scene(Ellipsoid(semi_axes), 20.0, named_scene("paper").start, 20.0)
    true, run = solved(scene, "quaternion", 401), solved(scene, form, 401)
    assert balance_residual(scene, run, true) == pytest.approx(0, abs=1e-12)
    planted = 1e-5 * max(scene.ellipsoid.inertia) * np.linspace(0, 1, 401) ** 2
    spoilt = replace(run, energy=run.energy + planted)
    assert balance_residual(scene, spoilt, true) == pytest.approx(1e-5, rel=1e-3)


def test_balance_of_a_loose_run_is_that_of_the_power_integrated_densely():
    scene = replace(named_scene("paper"), stokes=20.0, time=20.0)
    sparse = balance_residual(
        scene, solved(scene, "quaternion", 201, 1e-3), solved(scene, "quaternion", 201)
    )
    dense = balance_residual(
        scene, solved(scene, "quaternion", 3201, 1e-3), solved(scene, "quaternion", 3201)
    )
    assert sparse is not None
    assert dense is not None
    assert sparse == pytest.approx(dense, rel=0.2)


def test_balance_is_unknown_where_the_samples_do_not_resolve_it():
    scene = replace(named_scene("paper"), stokes=1e4, time=5e3)
    assert (
        balance_residual(
            scene, solved(scene, "quaternion", 101, 1e-6), solved(scene, "quaternion", 101)
        )
        is None
    )


def test_completed_rotations_are_rotations():
    scene = replace(named_scene("spheroid"), time=20.0)
    rotation = completed(scene.ellipsoid, solved(scene, "spheroid-axis", 11).rotation)
    assert rotation is not None
    assert np.einsum("nij,nkj->nik", rotation, rotation) == pytest.approx(
        np.tile(np.eye(3), (11, 1, 1)), abs=1e-15
    )
    assert np.linalg.det(rotation) == pytest.approx(np.ones(11))


def test_averaged_forms_and_spheres_have_no_orientation_error():
    scene = replace(named_scene("paper"), time=50.0)
    run, averaged = solved(scene, "quaternion", 11), solved(scene, "averaged", 11)
    assert errors(TRIAXIAL, averaged, run, scene).orientation is None
    sphere = named_scene("sphere")
    run = solved(sphere, "quaternion", 11)
    assert errors(sphere.ellipsoid, run, run).orientation is None


def test_distributions_agree_whatever_the_order_and_differ_by_the_shift(run: Observables):
    order = np.random.default_rng(1).permutation(501)
    shuffled = Observables(run.angular_momentum[order], run.energy[order], run.rotation[order])
    assert statistics_distance(TRIAXIAL, shuffled, run) == pytest.approx(0, abs=1e-15)
    shifted = replace(run, energy=run.energy + 0.1 * run.energy.max())
    assert statistics_distance(TRIAXIAL, shifted, run) == pytest.approx(0.1)


def test_different_numbers_of_samples_are_refused(run: Observables):
    with pytest.raises(ValueError, match="samples: got 500, expected 501"):
        errors(TRIAXIAL, run[:500], run)


def test_symmetric_bodies_may_turn_about_their_axis():
    scene = replace(named_scene("spheroid"), time=5.0)
    run = solved(scene, "quaternion", 11)
    about = turned(run.rotation, run.rotation[:, 2], pi / 3)
    assert errors(PROLATE, replace(run, rotation=about), run).orientation == pytest.approx(
        0, abs=1e-15
    )
