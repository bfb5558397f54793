"""Many particles of hybrid equations: what is drawn on the tori, and where averaging is good enough."""

from dataclasses import replace
from math import inf

import numpy as np
import pytest

from polhode.harness.ensembles import hybrid
from polhode.harness.ensembles.ensemble import Ensemble, least_of
from polhode.harness.ensembles.starts import Drawn, Starts
from polhode.harness.ensembles.summary import means
from polhode.models.catalogue import averaged_form, form as find_form, full_form
from polhode.models.forms.averaged import mean_squares
from polhode.models.operations import FLOAT
from polhode.models.scene import BodyStart, Scene
from polhode.models.shape import Ellipsoid
from polhode.solvers.solve import solve

TRIAXIAL, PROLATE = Ellipsoid((0.8, 1.0, 0.5)), Ellipsoid((2.0, 1.0, 1.0))
STARTS = Starts(motion="momentum-isotropic", angular_momentum=[0.0, 0.6, -0.8])


def drawn_of(ellipsoid: Ellipsoid, particles: int) -> tuple[Scene, Drawn]:
    drawn = STARTS.draw(ellipsoid, np.random.SeedSequence(7), particles)
    q, w = drawn.quaternion[0].tolist(), drawn.angular_velocity[0].tolist()
    return Scene(ellipsoid, 1e6, BodyStart(tuple(q), tuple(w)), 2e5), drawn


@pytest.mark.parametrize("ellipsoid", [TRIAXIAL, PROLATE])
def test_poses_that_are_drawn_keep_momentum_and_energy(ellipsoid: Ellipsoid):
    scene, drawn = drawn_of(ellipsoid, 300)
    starts = drawn.states(full_form(scene), ellipsoid)
    slow = drawn.states(averaged_form(scene), ellipsoid)
    (poses,) = hybrid.posed(scene, starts, slow[None], np.random.default_rng(1))
    form = find_form(full_form(scene))
    assert form.observe(scene, poses).slow == pytest.approx(
        form.observe(scene, starts).slow, abs=1e-13
    )
    assert not np.allclose(poses, starts, atol=0.1)
    if ellipsoid is TRIAXIAL:
        # The body's longest or shortest axis goes on to point along L or against it.
        body, drawn_body = (each[:, 4:] * np.array(ellipsoid.inertia) for each in (starts, poses))
        square, energy2 = np.sum(body**2, axis=1), np.sum(body * starts[:, 4:], axis=1)
        first, middle, last = ellipsoid.order
        near = np.where(energy2 * ellipsoid.inertia[middle] > square, first, last)
        kept = [one[k] * other[k] > 0 for one, other, k in zip(body, drawn_body, near, strict=True)]
        assert all(kept)


@pytest.mark.parametrize("share", [0.2, 0.999999, 1.000001, 1.5])
def test_phases_are_drawn_evenly(share: float):
    """Against the averages over the Euler top that the arithmetic-geometric mean gives."""
    scene, drawn = drawn_of(TRIAXIAL, 1)
    inertia = sorted(TRIAXIAL.inertia)
    low, middle, high = (1 / (2 * each) for each in reversed(inertia))
    energy = low + share * (middle - low) if share < 1 else middle + (share - 1) * (high - middle)
    unit = max(inertia)
    slow = np.tile([0.0, 0.6, 0.8, energy * unit], (40_000, 1))
    starts = np.tile(drawn.states("quaternion", TRIAXIAL), (40_000, 1))
    (poses,) = hybrid.posed(scene, starts, slow[None], np.random.default_rng(1))
    rotation = find_form("quaternion").observe(scene, poses).rotation
    along = rotation @ np.array([0.0, 0.6, 0.8])
    exact = mean_squares(FLOAT)(1.0, 2 * energy, *inertia)
    by_inertia = np.argsort(TRIAXIAL.inertia)
    assert np.mean(along[:, by_inertia] ** 2, axis=0) == pytest.approx(exact, abs=4 * 0.5 / 200)
    # About L every angle is as likely.
    across = rotation[:, 2] - along[:, 2:] * np.array([0.0, 0.6, 0.8])
    assert np.abs(across.mean(axis=0)).max() < 4 / 200


@pytest.mark.parametrize("ellipsoid", [TRIAXIAL, PROLATE])
def test_many_particles_are_as_right_as_one_by_one(ellipsoid: Ellipsoid):
    scene, drawn = drawn_of(ellipsoid, 8)
    form = find_form(full_form(scene))
    starts, times = drawn.states(form.name, ellipsoid), np.linspace(0, scene.time, 9)
    least = hybrid.least_momentum(scene, starts[:4], 1e-4)
    assert 0 < least < 1
    states, statuses = hybrid.run_hybrid(
        scene, starts, times, 1e-4, least, np.random.default_rng(1)
    )
    alone, _ = hybrid.run_hybrid(scene, starts, times, 1e-4, inf, np.random.default_rng(1))
    assert set(statuses) == {"reached_end"}
    assert np.array_equal(states[0], starts)
    slow, exact = (
        form.observe(scene, each.reshape(72, -1)).slow.reshape(9, 8, 4) for each in (states, alone)
    )
    errors = np.abs(slow - exact).max(axis=(0, 2)) / max(ellipsoid.inertia)
    assert np.sort(errors)[-2] < 1e-4
    assert np.median(errors) > 1e-6


def test_particles_of_small_momentum_follow_the_full_equations(monkeypatch: pytest.MonkeyPatch):
    scene, drawn = drawn_of(TRIAXIAL, 300)
    starts, times = drawn.states("quaternion", TRIAXIAL), np.linspace(0, scene.time, 33)
    path, _ = hybrid.averaged(scene, starts, np.linspace(0, scene.time, 65), 1e-4)
    least = hybrid.least_between(scene, path).min(axis=0)
    limit, given, plain = float(np.sort(least)[3]), [], hybrid.run_full
    monkeypatch.setattr(hybrid, "run_full", lambda *some: given.append(some) or plain(*some))
    states, statuses = hybrid.run_hybrid(
        scene, starts, times, 1e-4, limit, np.random.default_rng(1)
    )
    assert set(statuses) == {"reached_end"}
    ((_, full, until, _),) = given
    small = least < limit
    assert np.array_equal(full, starts[small])
    problem, rows = find_form("quaternion").problem(scene), len(until) // 2
    assert 3 < rows < 33
    runs = (
        solve(replace(problem, start=tuple(start)), "cyrk-dop853", 1e-14, times[:rows])
        for start in full.tolist()
    )
    exact = np.stack([run.states for run in runs], axis=1)
    assert states[:rows, small] == pytest.approx(exact, abs=1e-2)
    alone, _ = hybrid.run_alone(scene, full, times, 1e-5)
    form = find_form("quaternion")
    slow, true = (
        form.observe(scene, each.reshape(-1, 7)).slow for each in (states[:, small], alone)
    )
    assert slow == pytest.approx(true, abs=5e-5)
    # Where this would take longer than form `hybrid`, it is left to that.
    monkeypatch.setattr(hybrid, "MAX_FULL_TIME", 0.0)
    monkeypatch.setattr(
        hybrid,
        "run_alone",
        lambda scene, some, *rest: (given.append(some), (states[:, small], "w"))[1],
    )
    _, statuses = hybrid.run_hybrid(scene, starts, times, 1e-4, limit, np.random.default_rng(1))
    assert np.array_equal(given[1], starts[small])
    assert (statuses[small] == "w").all()


def test_momentum_is_followed_between_the_times():
    scene, drawn = drawn_of(PROLATE, 40)
    starts = drawn.states("spheroid-axis", PROLATE)
    path, fine = (
        hybrid.averaged(scene, starts, np.linspace(0, scene.time, count), 1e-4)[0]
        for count in (hybrid.MIN_PATH_TIMES, 1601)
    )
    exact = np.linalg.norm(fine[..., :3], axis=2)
    found = hybrid.least_between(scene, path)
    assert found.min(axis=0) == pytest.approx(exact.min(axis=0), rel=0.2)
    assert (found <= np.minimum(exact[:-1:25], exact[25::25]) * 1.001).all()


@pytest.mark.parametrize(("wrong", "by_chance"), [(0, 1), (12, 1), (300, 1), (12, 8), (400, 0)])
def test_the_least_momentum_parts_those_that_keep_the_error_from_those_that_miss(
    wrong: int, by_chance: int, monkeypatch: pytest.MonkeyPatch
):
    scene, drawn = drawn_of(PROLATE, 400)
    starts, random = drawn.states("spheroid-axis", PROLATE), np.random.default_rng(1)
    path, _ = hybrid.averaged(
        scene, starts, np.linspace(0, scene.time, hybrid.MIN_PATH_TIMES), 1e-4
    )
    least = hybrid.least_between(scene, path).min(axis=0)
    by_size = np.append(np.sort(least), inf)

    def alone(
        scene: Scene, some: np.ndarray, times: np.ndarray, _: float
    ) -> tuple[np.ndarray, np.ndarray]:
        at, statuses = hybrid.averaged(scene, some, times, 1e-4)
        miss = hybrid.least_between(scene, at).min(axis=0) < by_size[wrong]
        miss[-3 * by_chance :: 3] = True
        at[:, miss, :3] += 1e-3
        return hybrid.posed(scene, some, at, random), statuses

    monkeypatch.setattr(hybrid, "run_alone", alone)
    found = hybrid.least_momentum(scene, starts, 1e-4)
    # Of eight that miss, spread over the upper part, one alone may stay.
    expected = wrong if by_chance < 8 else 315
    assert by_size[expected] <= found <= by_size[min(400, expected + 20)]


def test_averaging_is_not_tried_where_its_error_shows():
    scene, drawn = drawn_of(PROLATE, 3)
    starts = drawn.states("spheroid-axis", PROLATE)
    assert hybrid.least_momentum(scene, starts, 1e-6) == inf
    at_rest = starts * [0, 0, 0, 1, 1, 1]
    assert hybrid.least_momentum(scene, at_rest, 1e-3) == inf
    few = Ensemble(
        PROLATE, 1e6, 10.0, STARTS, particles=hybrid.BOTH_WAYS, equations="hybrid", tolerance=1e-3
    )
    assert least_of(few) == inf
    assert few.method.startswith("cyrk-vern8")


def test_hybrid_particles_have_the_moments_of_full_ones(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("polhode.harness.ensembles.ensemble.BOTH_WAYS", 6)
    full = Ensemble(
        TRIAXIAL, 1e4, 2e3, STARTS, particles=400, block=400, tolerance=1e-4, samples=5, snapshots=3
    )
    many = replace(full, equations="hybrid", tolerance=2e-2)
    assert many.method.startswith("averaged, where |L| falls below 0.")
    by_full, by_hybrid = full.run(0), many.run(0)
    assert by_hybrid.finished == 400
    assert np.abs(means(by_hybrid, "slow")[0] - means(by_full, "slow")[0]).max() < 2e-2
    (one, error), (other, _) = means(by_full, "second"), means(by_hybrid, "second")
    assert (np.abs(one - other)[1:] <= 4.5 * error[1:]).all()
    assert one[0] == pytest.approx(other[0], abs=1e-12)
