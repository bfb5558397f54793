"""Many particles in SIMD lanes by equal steps, against the same particles one by one and by plain Python."""

from dataclasses import replace
from math import inf

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from polhode.models.catalogue import form as find_form
from polhode.models.operations import FLOAT
from polhode.models.problem import Problem
from polhode.models.scene import BodyStart, Scene
from polhode.models.shape import Ellipsoid
from polhode.solvers.ensembles import equal_steps, methods
from polhode.solvers.ensembles.equal_steps import Plan, plan, run
from polhode.solvers.ensembles.methods import RUNGE_KUTTA, method
from polhode.solvers.ensembles.taylor_batch import run_batches
from polhode.solvers.machine_code.lanes import by_particle, lanes
from polhode.solvers.machine_code.program import width
from polhode.solvers.machine_code.tracing import OPERATIONS
from polhode.solvers.solve import solve

TOLERANCE = 1e-6


def problem_of(
    axes: tuple[float, float, float], stokes: float, time: float
) -> tuple[Problem, np.ndarray]:
    """A problem, and starts that turn at all speeds from 0 to 1.2, some of them with L along the vorticity."""
    scene = Scene(Ellipsoid(axes), stokes, BodyStart((1.0, 0.0, 0.0, 0.0), (0.1, 0.2, 0.3)), time)
    form = find_form("quaternion" if scene.ellipsoid.kind == "triaxial" else "spheroid-axis")
    problem, random = form.problem(scene), np.random.default_rng(1)
    four, three = random.standard_normal((100, 4)), random.standard_normal((100, 3))
    three *= (random.uniform(0, 1.2, 100) / np.linalg.norm(three, axis=1))[:, None]
    three[:8] = [[0.0, 0.0, z] for z in (-0.5, 0.0, 0.01, 0.05, 0.1, 0.3, 0.6, 1.0)]
    if form.name == "quaternion":
        return problem, np.column_stack([four / np.linalg.norm(four, axis=1)[:, None], three])
    return problem, np.column_stack(
        [three, four[:, :3] / np.linalg.norm(four[:, :3], axis=1)[:, None]]
    )


def one_by_one(problem: Problem, starts: np.ndarray, times: np.ndarray) -> np.ndarray:
    """States of each particle, shape (m, n, d), by a method of its own that takes no time to compile."""
    runs = [
        solve(replace(problem, start=tuple(start)), "cyrk-dop853", 1e-14, times)
        for start in starts.tolist()
    ]
    assert all(run.success for run in runs)
    return np.stack([run.states for run in runs], axis=1)


def apart(states: np.ndarray, others: np.ndarray) -> np.ndarray:
    return np.abs(states - others).max(axis=(0, 2))


@settings(max_examples=10, deadline=None)
@given(st.integers(1, 40), st.integers(1, 5), st.integers(1, 3))
def test_lanes_are_the_map_repeated(particles: int, rows: int, steps: int):
    def step(ops):
        return lambda y, c: (
            ops.where_positive(y[1], 0.5, y[0]) - c[0] * y[1],
            ops.sqrt(y[0] * y[0] + c[1]) / -2,
            0.25,
        )

    def before(y, c):
        return y[0] + c[0], y[2], y[1] * y[1]

    def after(y, c):
        return y[0] - 0.5 * c[1], 2.0, y[1] - y[2]

    starts = np.random.default_rng(particles).standard_normal((particles, 3))
    constants = np.array([0.3, 2.0])
    compiled = COMPILED.setdefault(width(), lanes(step(OPERATIONS), 3, 2, before, after))
    found = by_particle(compiled.march(starts, rows, constants, steps), particles)
    assert found.shape == (particles, rows, 3)
    for start, seen in zip(starts.tolist(), found, strict=True):
        state = tuple(start)
        for row in range(rows):
            assert seen[row] == pytest.approx(state, rel=1e-14, abs=1e-15)
            state = before(state, constants.tolist())
            for _ in range(steps):
                state = step(FLOAT)(state, constants.tolist())
            state = after(state, constants.tolist())


COMPILED: dict = {}


@pytest.mark.parametrize(
    ("axes", "stokes", "time"),
    [
        ((1.0, 1.0, 0.05), 1e3, 60.0),
        ((1.0, 1.0, 0.98), 30.0, 60.0),
        ((1.0, 1.0, 1.0), 1.0, 5.0),
        ((1.0, 1.0, 2.0), 1.0, 5.0),
        ((1.0, 1.0, 2.0), 1e4, 100.0),
        ((1.0, 1.0, 20.0), 1e3, 30.0),
        ((1.0, 1.0, 0.5), inf, 100.0),
        ((0.8, 1.0, 0.5), 300.0, 60.0),
    ],
)
def test_every_particle_keeps_the_error_asked_for(axes, stokes, time):
    problem, starts = problem_of(axes, stokes, time)
    times = np.linspace(0.0, problem.end, 3)
    chosen = plan(problem, starts[::2], times, TOLERANCE)
    assert chosen is not None
    states, statuses = run(problem, starts, times, TOLERANCE, chosen)
    assert set(statuses) == {"reached_end"}
    exact = one_by_one(problem, starts, times)
    errors = apart(states, exact)
    # Particles that are not of the sample may err by a little more before they are in doubt.
    assert np.quantile(errors, 0.98) < TOLERANCE
    assert errors.max() < 5 * TOLERANCE


@pytest.mark.parametrize(("stokes", "expected"), [(1.0, RUNGE_KUTTA), (1e4, "ABA")])
def test_splitting_serves_where_the_torque_is_weak_and_runge_kutta_elsewhere(stokes, expected):
    problem, starts = problem_of((1.0, 1.0, 2.0), stokes, min(10.0 * stokes, 50.0))
    chosen = plan(problem, starts[:32], np.array([0.0, problem.end]), 1e-8)
    assert chosen is not None
    assert chosen.method.startswith(expected)


def test_particles_are_the_same_to_the_last_bit_in_lanes_of_any_width(
    monkeypatch: pytest.MonkeyPatch,
):
    problem, starts = problem_of((1.0, 1.0, 2.0), 100.0, 20.0)
    found = []
    for wide in (4, 16):
        monkeypatch.setattr("polhode.solvers.machine_code.lanes.width", lambda wide=wide: wide)
        methods._splitting.cache_clear()
        by = method("SABA2", problem)
        found.append(by_particle(by.lanes.march(starts, 3, by.constants(0.5), 20), len(starts)))
        methods._splitting.cache_clear()
    assert np.array_equal(*found)


@pytest.mark.parametrize("name", ["SABA2", "ABA(8,6,4)", "ABA(10,6,4)", RUNGE_KUTTA])
def test_methods_converge_as_their_order_says(name: str):
    problem, starts = problem_of((1.0, 1.0, 2.0), 20.0, 8.0)
    exact = one_by_one(problem, starts[:8], np.array([0.0, problem.end]))[-1]
    by = method(name, problem)
    errors = []
    for steps in (16, 32):
        end = by_particle(
            by.lanes.march(starts[:8], 2, by.constants(problem.end / steps), steps), 8
        )[:, -1]
        errors.append(np.abs(end - exact).max())
    # To order ε² splittings are of order 2 or 4.
    least = {"SABA2": 1.7, RUNGE_KUTTA: 7.0}.get(name, 3.7)
    assert np.log2(errors[0] / errors[1]) > least


def test_doubtful_particles_are_run_anew_until_they_are_right(monkeypatch: pytest.MonkeyPatch):
    problem, starts = problem_of((1.0, 1.0, 2.0), 1e3, 50.0)
    times, handed = np.linspace(0.0, problem.end, 3), []
    exact = one_by_one(problem, starts, times)

    def counted(problem, starts, times, tolerance):
        handed.append(len(starts))
        return run_batches(problem, starts, times, tolerance)

    monkeypatch.setattr(equal_steps, "run_batches", counted)
    states, _ = run(problem, starts, times, TOLERANCE, Plan("S2", 1, 0.0, 0.0, 0.0))
    assert apart(states, exact).max() < TOLERANCE
    assert handed == [len(starts)]
    handed.clear()
    states, _ = run(problem, starts, times, TOLERANCE, Plan("ABA(8,6,4)", 1, 1e-5, 0.0, 0.0))
    assert apart(states, exact).max() < 2 * TOLERANCE
    assert handed == []


def test_a_particle_that_is_not_finite_fails_alone_and_lanes_do_not_mix():
    problem, starts = problem_of((1.0, 1.0, 2.0), 1e3, 20.0)
    times = np.linspace(0.0, problem.end, 5)
    chosen = plan(problem, starts, times, TOLERANCE)
    assert chosen is not None
    good, _ = run(problem, starts, times, TOLERANCE, chosen)
    order = np.random.default_rng(2).permutation(len(starts))
    planted = starts[order].copy()
    planted[5] = np.nan
    states, statuses = run(problem, planted, times, TOLERANCE, chosen)
    assert statuses[5] == "non_finite"
    others = np.arange(len(starts)) != 5
    assert set(statuses[others]) == {"reached_end"}
    assert np.array_equal(states[:, others], good[:, order][:, others])
    alone = solve(replace(problem, start=tuple(starts[7])), "taylor", 1e-13, times)
    assert good[:, 7] == pytest.approx(alone.states, abs=TOLERANCE)


def test_no_plan_where_no_step_keeps_the_error():
    problem, starts = problem_of((1.0, 1.0, 2.0), 1e3, 20.0)
    assert plan(problem, starts, np.array([0.0, problem.end]), 1e-18) is None


def test_no_particles_are_no_work():
    walk = lanes(lambda y, c: [y[0] + c[0]], 1, 1)
    assert walk.march(np.empty((0, 1)), 5, np.array([1.0]), 3).shape[0] == 0
