"""The number of rotations against quadrature of |ω| over a tight run of an unrelated solver."""

from dataclasses import replace
from math import inf, pi

import numpy as np
import pytest

from polhode.harness.references import rotations as module
from polhode.harness.references.rotations import STIFF, damping_times, is_stiff, rotations
from polhode.models.catalogue import form
from polhode.models.scene import BodyStart, EulerStart, Scene, SlowStart
from polhode.models.scenes import named_scene
from polhode.models.shape import Ellipsoid
from polhode.solvers.solve import solve

START = EulerStart((1.0, 0.5, 0.2), (1.0, 1.0, -1.0))
TRIAXIAL, PROLATE, OBLATE = (
    Ellipsoid((1.0, 0.8, 0.5)),
    Ellipsoid((1.0, 1.0, 1.5)),
    Ellipsoid((0.4, 1.0, 1.0)),
)


def by_quadrature(scene, samples=40_001):
    """∫|ω| dt/2π by the trapezoidal rule over a run at tolerance 1e-11."""
    name = "jeffery" if scene.stokes == 0 else "quaternion"
    times = np.linspace(0, scene.time, samples)
    solver = "cyrk-radau" if 0 < scene.stokes < 1 else "taylor"
    run = solve(form(name).problem(scene), solver, 1e-8 if solver == "cyrk-radau" else 1e-11, times)
    assert run.success
    seen = form(name).observe(scene, run.states)
    body = np.einsum("nij,nj->ni", seen.rotation, seen.angular_momentum) / scene.ellipsoid.inertia
    return float(np.trapezoid(np.linalg.norm(body, axis=1), times)) / (2 * pi)


NAMED = [
    "paper",
    "paper-saddle",
    "pinch-point",
    "rest-5e4",
    "needle",
    "plate",
    "stiff",
    "jeffery",
    "tumbler",
    "top",
]


@pytest.mark.parametrize("name", NAMED)
def test_named_scenes(name):
    scene = named_scene(name)
    assert rotations(scene) == pytest.approx(by_quadrature(scene), rel=1e-3)


@pytest.mark.parametrize("ellipsoid", [TRIAXIAL, PROLATE, OBLATE, Ellipsoid((1.0, 1.0, 1.0))])
@pytest.mark.parametrize("stokes", [1e3, 1e4, inf])
def test_averages_give_the_rotations_of_the_full_run(ellipsoid, stokes, monkeypatch):
    """With the threshold lowered, so that a tight run is short enough to compare with."""
    monkeypatch.setattr(module, "MANY", 50.0)
    scene = Scene(ellipsoid, stokes, START, 1000.0)
    turned = module._averaged_angle(scene)
    assert turned is not None
    assert rotations(scene) == turned / (2 * pi)
    assert rotations(scene) == pytest.approx(by_quadrature(scene), rel=1e-2)


def test_start_without_orientation():
    scene = Scene(TRIAXIAL, 1e4, START, 1000.0)
    slow = scene.initial
    lx, ly, lz = slow.angular_momentum[0].tolist()
    bare = replace(scene, start=SlowStart((lx, ly, lz), float(slow.energy[0])))
    assert rotations(bare) == pytest.approx(rotations(scene), rel=1e-3)
    with pytest.raises(ValueError, match="expected a quaternion"):
        rotations(replace(bare, stokes=0.0))


def test_averages_are_not_trusted_where_momentum_vanishes(monkeypatch):
    """L → 0 and L_z changes sign: the averaged run does not know the way on, the full one does."""
    monkeypatch.setattr(module, "MANY", 50.0)
    scene = replace(named_scene("pinch-point"), stokes=1e4, time=3000.0)
    assert module._averages_well(scene)
    assert module._averaged_angle(scene) is None
    assert rotations(scene) == pytest.approx(by_quadrature(scene), rel=1e-3)


@pytest.mark.parametrize(
    ("stokes", "limit"), [(20.0, "LONGEST_ROTATIONS"), (0.05, "LONGEST_STIFF")]
)
def test_long_runs_go_on_at_the_mean_rate(stokes, limit, monkeypatch):
    scene = Scene(TRIAXIAL, stokes, START, 2000.0)
    whole = rotations(scene)
    monkeypatch.setattr(module, limit, 60.0 if limit == "LONGEST_ROTATIONS" else 400.0)
    assert rotations(scene) == pytest.approx(whole, rel=0.02)
    assert rotations(scene) != whole


def test_at_rest_without_torque():
    assert rotations(Scene(TRIAXIAL, inf, BodyStart((1.0, 0.0, 0.0, 0.0)), 10.0)) == 0


@pytest.mark.parametrize(("stokes", "time", "stiff"), [(300.0, 2e5, False), (0.1, 1e3, True)])
def test_a_run_is_stiff_where_an_explicit_method_takes_as_many_steps_at_any_tolerance(
    stokes, time, stiff
):
    """However many its damping times are."""
    scene = replace(named_scene("paper"), stokes=stokes, time=time)
    assert damping_times(scene) > STIFF
    assert is_stiff(scene) is stiff
    problem = form("quaternion").problem(scene)
    loose, tight = (
        solve(problem, "cyrk-vern8", tolerance, (0.0, time / 10)).work.steps
        for tolerance in (1e-5, 1e-9)
    )
    # Accuracy alone asks for 10^(4/8) as many.
    assert (tight < 2 * loose) is stiff
