"""The closed-form Euler top against extended-precision integration and against 100-digit textbook formulas."""

from itertools import permutations, product

import mpmath as mp
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from oracle.euler_top import geodesic, integrate, matrix, precise, small_angle, textbook, unit
from polhode.harness.references.extended import extended_run
from polhode.models.catalogue import form
from polhode.models.free_top.torque_free import TorqueFree
from polhode.models.rotation import matrix_from_quaternion
from polhode.models.scene import BodyStart, Scene
from polhode.models.shape import Ellipsoid

Long = np.longdouble
UNTURNED = (1.0, 0.0, 0.0, 0.0)
MIXED = (0.5, -0.5, 0.5, 0.5)


def start(body):
    return body.inertia, body.quaternion, body.angular_velocity


def invariants(inertia, quaternion, omega):
    """L in space axes, shape (n, 3), and E, shape (n,)."""
    moment = np.array(inertia) * omega
    return np.einsum("nij,ni->nj", matrix_from_quaternion(quaternion), moment), np.sum(
        moment * omega, axis=1
    ) / 2


def half_ulp_change(body, times):
    """Largest change, in angle and in ω, that half an ulp in one component of the start makes, shape (2, n)."""
    quaternion, omega = body.at(times, dtype=Long)
    start = np.array([*body.quaternion, *body.angular_velocity], dtype=Long)
    changes = []
    for component, sign in product(range(7), (-1, 1)):
        moved = start.copy()
        moved[component] += sign * Long(np.spacing(np.abs(np.float64(start[component])))) / 2
        q, w = TorqueFree(body.inertia, tuple(moved[:4]), tuple(moved[4:])).at(times, dtype=Long)
        changes.append([geodesic(q, quaternion), np.max(np.abs(w - omega), axis=1)])
    return np.max(changes, axis=0)


def random_body(seed, *, inertia=None, speed=1.0):
    rng = np.random.default_rng(seed)
    inertia = inertia or tuple(rng.uniform(0.2, 1.0, 3))
    omega = rng.normal(size=3)
    return TorqueFree(
        inertia, tuple(unit(rng.normal(size=4))), tuple(speed * omega / np.linalg.norm(omega))
    )


def near_separatrix(distance, signs, order):
    """Start whose 1−m is about the distance; the signs choose the branch, the order permutes the axes."""
    inertia, omega = (
        np.array([3.0, 4.0, 6.0]) / 8,
        np.array([1.0, 0.1, 0.5 * (1 + distance)]) / 2 * signs,
    )
    return TorqueFree(tuple(inertia[order]), MIXED, tuple(omega[order]))


def regular_bodies():
    """Random starts away from the separatrix: triaxial ones, then some with two equal inertias."""
    for seed in range(48):
        first, second, third = np.random.default_rng(seed + 1000).uniform(0.2, 1.0, 3)
        kinds = [
            (first, second, third),
            (first, first, third),
            (first, second, second),
            (first, second, first),
        ]
        body = random_body(seed, inertia=kinds[0 if seed < 36 else seed % 4])
        if body._polhode.m1 >= 0.1:
            yield body


@pytest.mark.parametrize("body", list(regular_bodies()), ids=lambda body: f"{body._polhode.m1:.2f}")
def test_agrees_with_extended_precision_integration(body):
    times = np.linspace(0, 1000, 21)[1:]
    quaternion, omega = body.at(times)
    true_quaternion, true_omega = integrate(*start(body), times)
    assert quaternion.dtype == omega.dtype == np.float64
    # The sign of the quaternion too: it is continuous from the start.
    assert np.max(np.abs(quaternion - true_quaternion)) < 1e-12
    assert np.max(geodesic(quaternion, true_quaternion)) < 1e-12
    assert np.max(np.abs(omega - true_omega)) < 1e-12
    invariant = invariants(body.inertia, quaternion, omega)
    for value, truth in zip(
        invariant, invariants(body.inertia, true_quaternion, true_omega), strict=True
    ):
        assert np.max(np.abs(value - truth)) < 1e-12


def test_the_random_starts_lie_on_both_sides_and_in_every_order():
    cases = {(body._polhode.order, body._polhode.sense) for body in regular_bodies()}
    assert {sense for _, sense in cases} == {-1, 1}
    assert {order for order, _ in cases} == set(permutations(range(3)))


@pytest.mark.parametrize("signs", list(product((-1, 1), repeat=3)))
@pytest.mark.parametrize("distance", [0.0, 1e-14, -1e-14, 1e-10, -1e-6, 1e-3, -1e-1])
def test_near_and_on_the_separatrix_within_ten_half_ulps(distance, signs):
    order = np.random.default_rng(abs(hash((distance, signs)))).permutation(3)
    body = near_separatrix(distance, signs, order)
    times = np.array([0.5, 3.0, 10.0, 30.0, 100.0])
    quaternion, omega = body.at(times, dtype=Long)
    true_quaternion, true_omega = integrate(*start(body), times)
    angle, change = half_ulp_change(body, times)
    assert (body._polhode.m1 == 0) == (distance == 0)
    assert np.all(geodesic(quaternion, true_quaternion) < 10 * angle)
    assert np.all(np.max(np.abs(omega - true_omega), axis=1) < 10 * change)


HARD = {
    "triaxial": random_body(1),
    "other side": random_body(2, inertia=(0.9, 0.5, 0.3), speed=0.03),
    "fast": random_body(3, speed=1e3),
    "nearly equal 1, 2": random_body(4, inertia=(0.7, 0.7 * (1 + 1e-9), 0.4)),
    "nearly equal 2, 3": random_body(5, inertia=(0.3, 0.7, 0.7 * (1 - 1e-9))),
    "nearly equal 1, 3": random_body(6, inertia=(0.6, 0.3, 0.6 * (1 + 1e-9))),
    "nearly a sphere": random_body(7, inertia=(0.6, 0.6 * (1 + 1e-9), 0.6 * (1 - 2e-9))),
    "needle": random_body(8, inertia=(1e-4, 0.7, 0.8)),
    "near axis 1": TorqueFree((0.4, 0.5, 0.8), MIXED, (1.0, 1e-12, -3e-9)),
    "near axis 2": TorqueFree((0.4, 0.5, 0.8), MIXED, (1e-18, -1.0, 1e-30)),
    "near axis 3": TorqueFree((0.4, 0.5, 0.8), MIXED, (-1e-7, 1e-20, -1.0)),
    "separatrix 1e-14": near_separatrix(1e-14, (1, -1, 1), [2, 0, 1]),
    "separatrix -1e-7": near_separatrix(-1e-7, (-1, 1, 1), [1, 0, 2]),
}


@pytest.mark.parametrize("name", HARD)
def test_within_ten_half_ulps_up_to_a_million_time_units(name):
    body, times = HARD[name], np.array([0.0, 1e-3, 1.7, 1234.5, -1e6])
    quaternion, omega = body.at(times, dtype=Long)
    angle, change = half_ulp_change(body, times)
    with mp.workdps(100):
        truth = textbook(*start(body), times)
        off = [
            small_angle(matrix(q).T * true) for q, (true, _) in zip(quaternion, truth, strict=True)
        ]
        rates = np.array(
            [
                [float(true[k] - precise(w[k])) for k in range(3)]
                for w, (_, true) in zip(omega, truth, strict=True)
            ]
        )
    assert np.all(off < 10 * angle)
    assert np.all(np.max(np.abs(rates), axis=1) < 10 * change)


@pytest.mark.parametrize(
    ("inertia", "omega"),
    [
        ((0.3, 0.5, 0.7), (0.0, 0.0, 0.0)),
        ((0.3, 0.5, 0.7), (0.4, 0.0, 0.0)),
        ((0.3, 0.5, 0.7), (0.0, -0.4, 0.0)),
        ((0.3, 0.5, 0.7), (0.0, 0.0, 0.4)),
        ((0.5, 0.5, 0.7), (0.3, -0.4, 0.0)),
        ((0.7, 0.5, 0.7), (0.3, 0.0, 0.1)),
        ((0.4, 0.4, 0.4), (0.3, -0.4, 0.5)),
    ],
)
def test_permanent_rotation_is_exact(inertia, omega):
    body, times = TorqueFree(inertia, MIXED, omega), np.array([2.5, 40.0, 1e6])
    quaternion, rates = body.at(times, dtype=Long)
    assert body.is_permanent
    assert np.array_equal(rates, np.broadcast_to(omega, (3, 3)))
    true_quaternion, _ = integrate(*start(body), times[:2])
    assert np.max(np.abs(quaternion[:2] - true_quaternion)) < 1e-18


@pytest.mark.parametrize(("axial", "equatorial"), [(0.2, 0.7), (0.9, 0.5)])
def test_symmetric_top(axial, equatorial):
    """`spherloth`–`EetaL`: constant spin, θ constant, precession L/I_e, whichever axis is the odd one."""
    for odd in range(3):
        inertia = tuple(axial if axis == odd else equatorial for axis in range(3))
        body = random_body(odd, inertia=inertia)
        eta = body.angular_velocity[odd]
        times = np.linspace(0, 50, 101)
        quaternion, omega = body.at(times)
        momenta, energies = invariants(inertia, quaternion, omega)
        momentum = np.linalg.norm(momenta[0])
        symmetry_axis = matrix_from_quaternion(quaternion)[:, odd]
        assert np.max(np.abs(omega[:, odd] - eta)) < 1e-15
        assert (
            np.max(np.abs(symmetry_axis @ momenta[0] / momentum - axial * eta / momentum)) < 1e-15
        )
        energy = (momentum**2 - axial * (axial - equatorial) * eta**2) / (2 * equatorial)
        assert np.max(np.abs(energies - energy)) < 1e-15
        assert body.precession_period == pytest.approx(2 * np.pi * equatorial / momentum, rel=1e-15)
        assert body.period == pytest.approx(
            2 * np.pi * equatorial / abs((axial - equatorial) * eta), rel=1e-15
        )
        after, _ = body.at([body.precession_period])
        assert np.max(np.abs(matrix_from_quaternion(after)[0, odd] - symmetry_axis[0])) < 1e-14


def hurwitz_group():
    """The 24 rotations that permute the axes, up to sign of the quaternion."""
    for entries in product((-1, 0, 1), repeat=4):
        if sum(map(abs, entries)) in (1, 2, 4) and next(entry for entry in entries if entry) > 0:
            yield unit(np.array(entries, dtype=Long))


def multiply(left, right):
    a, u, b, v = left[..., :1], left[..., 1:], right[..., :1], right[..., 1:]
    scalar = a * b - np.sum(u * v, axis=-1, keepdims=True)
    return np.concatenate([scalar, a * v + b * u + np.cross(u, v)], axis=-1)


@pytest.mark.parametrize("seed", [0, 2, 3])
def test_renaming_the_body_axes_changes_nothing(seed):
    body, times = random_body(seed), np.array([0.0, 3.0, 200.0])
    quaternion, omega = body.at(times, dtype=Long)
    renamings = list(hurwitz_group())
    assert len(renamings) == 24
    for renaming in renamings:
        matrix = np.rint(matrix_from_quaternion(renaming)).astype(int)
        back = renaming * np.array([1, -1, -1, -1])
        renamed = TorqueFree(
            tuple(np.abs(matrix) @ np.array(body.inertia)),
            tuple(multiply(np.array(body.quaternion, dtype=Long), renaming)),
            tuple(matrix @ np.array(body.angular_velocity)),
        )
        moved_quaternion, moved_omega = renamed.at(times, dtype=Long)
        assert np.max(np.abs(moved_omega @ matrix - omega)) < 1e-17
        assert np.max(geodesic(multiply(moved_quaternion, back), quaternion)) < 1e-16


@pytest.mark.parametrize("seed", range(4))
def test_restarting_on_the_way_changes_nothing(seed):
    body, middle, rest = random_body(seed), 123.375, np.array([-123.375, 0.0, 77.75])
    (quaternion,), (omega,) = body.at([middle], dtype=Long)
    resumed = TorqueFree(body.inertia, tuple(quaternion), tuple(omega)).at(rest, dtype=Long)
    straight = body.at(middle + rest, dtype=Long)
    assert np.max(geodesic(resumed[0], straight[0])) < 1e-15
    assert np.max(np.abs(resumed[1] - straight[1])) < 1e-15


@settings(max_examples=150, deadline=None, derandomize=True)
@given(
    st.permutations([0.2, 0.5, 0.5 * (1 + 1e-9), 0.5, 0.9]),
    st.tuples(
        *[st.one_of(st.floats(-1, 1), st.sampled_from([0.0, -0.0, 5e-324, 1e-200, 1.0, -1.0]))] * 3
    ),
)
def test_every_start_keeps_its_invariants(moments, omega):
    inertia = tuple(moments[:3])
    body = TorqueFree(inertia, MIXED, omega)
    quaternion, rates = body.at([0.0, 1.0, 1e6])
    momenta, energies = invariants(inertia, quaternion, rates)
    size = np.max(np.abs(omega))
    assert np.max(np.abs(quaternion[0] - MIXED)) < 1e-16
    assert np.max(np.abs(rates[0] - omega)) <= 1e-16 * size
    assert np.max(np.abs(np.linalg.norm(quaternion, axis=1) - 1)) < 1e-15
    assert np.max(np.abs(momenta - momenta[0])) <= 2e-15 * size
    assert np.max(np.abs(energies - energies[0])) <= 2e-15 * size**2
    assert not np.isnan([body.period, body.precession_period]).any()


@pytest.mark.parametrize("axes", [(1.0, 0.119, 0.145), (0.33, 0.144, 1.0), (1.0, 0.999, 0.5)])
def test_almost_equal_moments_lose_no_digits(axes):
    """The closed form of a scene against its equations in long double, whose (I₂ - I₃)/I₁ lose none either.

    Moments of inertia rounded to doubles made orientations err by 40 times as much.
    """
    scene = Scene(Ellipsoid(axes), np.inf, BodyStart(MIXED, (0.3, -0.8, 0.4)), 30.0)
    times = np.linspace(0, scene.time, 31)
    reference = extended_run(form("quaternion").problem(scene), times, "long double", 1e-18)
    problem = form("euler-top").problem(scene)
    found = problem.closed_form(times)
    assert np.abs(found - reference[:, :7]).max() < 2e-15
