"""Chaos told from order, and what it leaves of a reference."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from math import exp, inf, log

import numpy as np
import pytest

from polhode.harness.references import reference as module
from polhode.harness.references.chaos import Growth, growth, tangent_integrator
from polhode.harness.references.errors import errors, statistics_distance
from polhode.models.catalogue import form as find_form
from polhode.models.operations import Field, Operations
from polhode.models.problem import Problem
from polhode.models.scenes import named_scene
from polhode.solvers.solve import solve

pytestmark = pytest.mark.usefixtures("quickly_compiled")

CHAOTIC = named_scene("jeffery-chaotic")


def lorenz(ops: Operations) -> Field:
    """Lorenz's system at its classical parameters; p is unused."""

    def rhs(y, p):
        return 10.0 * (y[1] - y[0]), y[0] * (28.0 - y[2]) - y[1], y[0] * y[1] - 8.0 / 3.0 * y[2]

    return rhs


def saddle(ops: Operations) -> Field:
    """Growth at the rate p₀ exactly."""

    def rhs(y, p):
        return p[0] * y[0], -p[0] * y[1]

    return rhs


def test_the_exponent_of_lorenz_is_the_published_one():
    """0.9056: Sprott, Chaos and Time-Series Analysis (2003), appendix A."""
    found = growth(Problem("lorenz", lorenz, (1.0, 1.0, 20.0), 1500.0), 3000)
    assert found.chaotic
    assert found.exponent == pytest.approx(0.9056, rel=0.02)


def test_the_exponent_of_a_saddle_is_exact():
    found = growth(Problem("saddle", saddle, (1e-3, 1.0), 60.0, parameters=(0.25,)))
    assert found.exponent == pytest.approx(0.25, rel=1e-6)
    assert found.meaningful_until(1e-8) == pytest.approx(log(1e6) / 0.25, abs=3)


@pytest.mark.parametrize(
    ("name", "form"), [("paper", "quaternion"), ("jeffery", "jeffery"), ("long", "quaternion")]
)
def test_regular_motion_is_not_called_chaotic(name: str, form: str):
    scene = named_scene(name)
    scene = replace(scene, time=min(scene.time, 2e4))
    found = growth(find_form(form).problem(scene))
    assert not found.chaotic
    assert found.meaningful_until() == inf


def test_threads_do_not_share_an_integrator_that_holds_a_state():
    with ThreadPoolExecutor(1) as pool:
        assert pool.submit(tangent_integrator, saddle, 2, 1).result() is not tangent_integrator(
            saddle, 2, 1
        )


def test_growth_agrees_with_two_neighbouring_trajectories():
    problem = find_form("jeffery").problem(replace(CHAOTIC, time=500.0))
    found = growth(problem)
    direction = np.cos(np.arange(1.0, 5.0))
    tiny = 1e-9 * direction / np.linalg.norm(direction)
    times = found.times
    one = solve(problem, "taylor", 1e-15, times).states
    other = solve(
        replace(problem, start=tuple(np.array(problem.start) + tiny)), "taylor", 1e-15, times
    ).states
    parted = np.linalg.norm(other - one, axis=1) / 1e-9
    small = parted * 1e-9 < 1e-4
    assert np.log(parted[small]) == pytest.approx(found.logarithm[small], abs=0.02)


def test_meaningful_until_is_shorter_for_larger_errors():
    times = np.linspace(0, 100, 101)
    grown = Growth(times, 0.5 * times)
    assert grown.meaningful_until(1e-16) == pytest.approx(log(1e14) / 0.5, abs=1)
    assert grown.meaningful_until(1e-6) == pytest.approx(log(1e4) / 0.5, abs=1)
    assert grown.meaningful_until(exp(-60)) == inf


def test_chaos_bounds_what_a_reference_says_of_trajectories(tmp_path, monkeypatch):
    monkeypatch.setenv("POLHODE_CACHE", str(tmp_path))
    monkeypatch.setattr(module, "QUADRUPLE_UP_TO_COST", 0.0)
    scene = replace(CHAOTIC, time=2.5e3)
    known = module.reference(scene, "jeffery", 501)
    assert known.meaningful_until is not None
    assert 500 < known.meaningful_until < 2.5e3
    assert known.orientation_uncertainty is not None
    assert known.orientation_uncertainty < 0.2
    form = find_form("jeffery")
    found = form.observe(scene, solve(form.problem(scene), "cyrk-vern8", 1e-12, known.times).states)
    whole = errors(scene.ellipsoid, found, known.observables)
    assert whole.orientation is not None
    assert whole.orientation > 1
    distance = statistics_distance(scene.ellipsoid, found, known.observables)
    assert distance < 4 * known.statistics_uncertainty
    tumbling = statistics_distance(scene.ellipsoid, known.observables[:60], known.observables)
    assert tumbling > 2 * distance
