"""Solvers of problems that state their parts: the flows, the schemes, and what every solver has to stand."""

import os
import pickle
import signal
import time
from dataclasses import replace
from math import exp, inf, pi
from threading import Timer

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from oracle.accepting import takes
from oracle.classical import CLASSICAL
from oracle.runs import SCENES, Run
from polhode.models.catalogue import form
from polhode.models.forms.spheroid_axis import PARTS, field
from polhode.models.operations import ARRAYS, FLOAT
from polhode.models.problem import Problem
from polhode.models.scene import BodyStart, EulerStart, Scene
from polhode.models.scenes import named_scene
from polhode.models.shape import Ellipsoid
from polhode.solvers import contract
from polhode.solvers.catalogue import SOLVERS, solver
from polhode.solvers.contract import SolverNotValidError, Status
from polhode.solvers.parts.kernels import Code, clock
from polhode.solvers.parts.planning import MAX_PLAN_CHECKS
from polhode.solvers.parts.schemes import ABA, PARALLEL, SCHEMES, Scheme
from polhode.solvers.parts.splitting import Split
from polhode.solvers.parts.strobe_kernels import TERMS
from polhode.solvers.parts.stroboscopic import MAX_MICRO_STEPS, Setting, Strobe
from polhode.solvers.solve import Interrupted, solve
from polhode.solvers.taylor import propagate, taylor_integrator

FORM = form("spheroid-axis")
PROLATE = Run("prolate", "spheroid-axis").problem
PARAMETERS = PROLATE.parameters or ()
NAMES = [name for name in SOLVERS if solver(name).family == "polhode"]
TOLERANCE = 1e-8
# One for all exact runs, as heyoka compiles for each tolerance anew.
TIGHT = 1e-16


def problem(
    stokes: float, end: float, kappa: float = 2.0, start=SCENES["prolate"].start
) -> Problem:
    return FORM.problem(Scene(Ellipsoid((1.0, 1.0, kappa)), stokes, start, end))


def any_state(seed: int) -> tuple[np.ndarray, tuple[float, ...]]:
    random = np.random.default_rng(seed)
    state = random.normal(size=6)
    state[3:] /= np.linalg.norm(state[3:])
    return state, PARAMETERS if seed == 0 else (
        1.0,
        *random.uniform(0.1, 1.0, 2),
        *random.normal(size=3),
    )


@pytest.mark.parametrize("seed", range(3))
def test_the_parts_add_up_to_the_field(seed: int):
    state, p = any_state(seed)
    step = 1e-4
    rates = [
        (
            np.array(advance(state, part.constants(p, step)))
            - advance(state, part.constants(p, -step))
        )
        / (2 * step)
        for part in (PARTS.fast, PARTS.slow)
        for advance in [part.flow(FLOAT)]
    ]
    assert sum(rates) == pytest.approx(np.array(field(FLOAT)(state, p)), abs=1e-7)


def test_the_fast_flow_is_a_rotation_about_l():
    advance = PARTS.fast.flow(FLOAT)
    for seed in range(20):
        state, p = any_state(seed)
        angle = np.random.default_rng(seed).uniform(-PARTS.reach, PARTS.reach)
        speed = PARTS.rate(FLOAT)(state, p)
        got = np.array(advance(state, PARTS.fast.constants(p, angle / speed)))
        expected = Rotation.from_rotvec(angle / speed * state[:3]).apply(state[3:])
        assert got[3:] == pytest.approx(expected, abs=2e-15)
        assert got[:3].tolist() == state[:3].tolist()


@pytest.mark.parametrize("seed", range(3))
def test_the_slow_flow_is_that_of_the_field_at_fixed_axis(seed: int):
    state, p = any_state(seed)
    rates, end = field(FLOAT), 1.3

    def fixed(t: float, momentum: np.ndarray):
        return rates([*momentum, *state[3:]], p)[:3]

    expected = solve_ivp(fixed, (0, end), state[:3], "DOP853", rtol=1e-13, atol=1e-13).y[:, -1]
    got = np.array(PARTS.slow.flow(FLOAT)(state, PARTS.slow.constants(p, end)))
    assert got[:3] == pytest.approx(expected, abs=1e-11)
    assert got[3:].tolist() == state[3:].tolist()


def test_both_flows_at_once_are_one_after_the_other():
    assert PARTS.both
    together, (fast, slow) = (
        PARTS.both(FLOAT),
        (part.flow(FLOAT) for part in (PARTS.fast, PARTS.slow)),
    )
    for seed in range(20):
        state, p = any_state(seed)
        constants = PARTS.fast.constants(p, 0.5), PARTS.slow.constants(p, 0.3)
        expected = np.array(slow(fast(state, constants[0]), constants[1]))
        assert np.array(together(state, *constants)) == pytest.approx(expected, abs=2e-15)
        # What L has gained moves as L does.
        gained = np.array(together(state, *constants, (0.1, 0.2, 0.3)))
        assert gained[:3] - [0.1, 0.2, 0.3] == pytest.approx(expected[:3] - state[:3], abs=2e-15)
        assert gained[3:].tolist() == np.array(together(state, *constants))[3:].tolist()


def test_flows_of_many_states_at_once():
    states = np.array([any_state(seed)[0] for seed in range(5)])
    for part in (PARTS.fast, PARTS.slow):
        constants = part.constants(PARAMETERS, 0.4)
        together = np.array(part.flow(ARRAYS)(states.T, constants)).T
        assert together == pytest.approx(
            np.array([part.flow(FLOAT)(state, constants) for state in states]), abs=1e-15
        )


def test_a_problem_with_parts_pickles():
    assert pickle.loads(pickle.dumps(PROLATE)) == PROLATE


QUADRATURE = {"S2": 2, "SABA2": 4, "ABA(8,6,4)": 8, "ABA(10,6,4)": 10}


@pytest.mark.parametrize("scheme", SCHEMES, ids=lambda scheme: scheme.name)
def test_a_scheme_is_a_quadrature_in_the_slow_part(scheme: Scheme):
    """To first order in the slow part: its nodes are where the fast flows before them end."""
    fast, slow = np.split(scheme.numbers[float][1 : 2 * scheme.stages + 2], [scheme.stages + 1])
    assert np.array_equal(fast, fast[::-1])
    assert np.array_equal(slow, slow[::-1])
    nodes = np.cumsum(fast)[:-1]
    for k in range(QUADRATURE[scheme.name]):
        assert slow @ nodes**k == pytest.approx(1 / (k + 1), abs=5e-15)


def test_chains_integrate_products_of_slow_flows():
    """In the mean over the chains, their nodes and shares are a quadrature of the first order and of the second."""
    stages, chains = PARALLEL.stages, PARALLEL.chains
    first, numbers = (stages + 1) * chains, PARALLEL.numbers[float][1:]
    fast, slow = (
        numbers[:first].reshape(-1, chains),
        numbers[first : first + stages * chains].reshape(-1, chains),
    )
    weights = numbers[first + stages * chains :][:chains]
    assert [weights.sum(), *fast.sum(axis=0), *slow.sum(axis=0)] == pytest.approx(
        [1.0] * (1 + 2 * chains), abs=1e-15
    )
    nodes = np.cumsum(fast, axis=0)[:-1]
    powers = [slow * nodes**k for k in range(9)]
    for k, each in enumerate(powers):
        assert weights @ each.sum(axis=0) == pytest.approx(
            1 / (k + 1), abs=5e-12 if k < 6 else 1e-9
        )
    for k in range(4):
        for m in range(4 - k):
            before, after = powers[k], powers[m]
            pairs = np.sum((np.cumsum(before, axis=0) - 0.5 * before) * after, axis=0)
            assert weights @ pairs == pytest.approx(1 / ((k + 1) * (k + m + 2)), abs=2e-9)


def end_state(each: Problem, scheme: Scheme, steps: int) -> np.ndarray:
    rows = np.array([each.start, each.start])
    law = np.array([each.end / steps, 0.0, inf, 0.0, 0.0, inf])
    split = Split(each, TOLERANCE)
    split.scheme = scheme
    arrays = rows[0].copy(), clock(0.0), np.array([0.0, each.end]), rows
    assert split.advance(law, *arrays, limit=steps) == Code.FINISHED
    return rows[1]


@pytest.mark.parametrize(
    ("name", "stokes", "end", "order", "steps"),
    [
        ("S2", 20.0, 6.0, 2, (24, 32, 48)),
        ("SABA2", 20.0, 6.0, 2, (16, 24, 32)),
        ("ABA(8,6,4)", 20.0, 6.0, 4, (16, 24, 32)),
        ("ABA(10,6,4)", 20.0, 6.0, 4, (16, 24, 32)),
        # With a slow part as small as this, the terms linear in it are all.
        ("SABA2", 1e5, 3.0, 4, (4, 5, 6, 8)),
        ("ABA(8,6,4)", 1e5, 3.0, 8, (3, 4, 5, 6)),
        # Here those quadratic in it.
        ("ABA(10,6,4)", 1e4, 6.0, 6, (8, 9, 10, 11)),
        ("parallel", 20.0, 6.0, 4, (24, 32, 48)),
    ],
)
def test_order_at_fixed_steps(
    name: str, stokes: float, end: float, order: int, steps: tuple[int, ...]
):
    each = problem(stokes, end)
    scheme = next(scheme for scheme in (*SCHEMES, PARALLEL) if scheme.name == name)
    exact = solve(each, "taylor", TIGHT).states[-1]
    errors = [np.abs(end_state(each, scheme, n) - exact)[:3].max() for n in steps]
    assert -np.polyfit(np.log(steps), np.log(errors), 1)[0] == pytest.approx(order, abs=0.35)


def test_means_of_compositions_are_taken_where_they_hold():
    """A step errs less than one of a single composition; strong damping, and parts without `restored`, have one."""
    for kappa in (0.1, 10.0, 2.0):
        each = problem(1e5, 200.0, kappa)
        exact = solve(each, "taylor", TIGHT).states[-1]
        # Of 1.3 to 3.3 rad.
        for steps in (100, 200):
            one, mean = (
                np.abs(end_state(each, scheme, steps) - exact)[:3].max()
                for scheme in (ABA, PARALLEL)
            )
            assert 0 < 4 * mean < one
    assert each.parts is not None
    assert Split(each, TOLERANCE).scheme is PARALLEL
    assert abs(np.linalg.norm(end_state(each, PARALLEL, 50)[3:]) - 1) < 1e-12
    assert Split(replace(each, parts=replace(each.parts, restored=None)), TOLERANCE).scheme is ABA
    # Here means diverged in the first step.
    damped = problem(0.0125, 10.0, 0.05)
    assert solve(damped, "splitting", 1e-4).states[-1] == pytest.approx(
        solve(damped, "cyrk-radau", 1e-8).states[-1], abs=1e-3
    )


@pytest.mark.parametrize(("kappa", "stokes"), [(2.0, 1e5), (5.0, 1e6)])
def test_the_tolerance_bounds_the_error_of_l_in_long_runs(kappa: float, stokes: float):
    """L sways with the orientation, whose phase errs ever more."""
    each = problem(stokes, 5e5, kappa)
    times = np.linspace(0.0, each.end, 201)
    exact = solve(each, "splitting", 1e-11, times).states
    for tolerance in (1e-6, 1e-8):
        found = solve(each, "splitting", tolerance, times).states
        assert np.abs(found - exact)[:, :3].max() < 2 * tolerance


@pytest.mark.parametrize(
    ("kappa", "stokes", "end", "start"),
    [
        (0.31, 5.5e5, 2.2e5, EulerStart((1.2, 0.5, 0.0))),
        (0.2, 1.3e6, 1.2e5, SCENES["prolate"].start),
    ],
    ids=["from-rest", "turning"],
)
def test_tolerances_near_rounding_ask_for_no_end_of_steps(
    kappa: float, stokes: float, end: float, start: EulerStart
):
    """Nor does rounding in as many steps pile up: it had the same sign in each, and errors grew with the steps."""
    each = problem(stokes, end, kappa, start)
    times = np.linspace(0.0, each.end, 101)
    exact = solve(each, "splitting-extended", 1e-12, times).states
    costs = []
    for tolerance, error in ((1e-9, 1e-9), (1e-11, 1e-11), (1e-15, 1e-12)):
        found = solve(each, "splitting", tolerance, times)
        costs.append((found.work.steps or 0) + (found.work.rejected or 0))
        assert np.abs(found.states - exact)[:, :3].max() < error
    assert costs[1] < 4 * costs[0]
    assert costs[2] < 10 * costs[1]


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("kappa", [0.1, 0.5, 2.0, 5.0, 10.0])
def test_slow_error_on_long_runs(name: str, kappa: float):
    """A tolerance is the error of L over the whole run, however long."""
    each = problem(2e4, 2000.0, kappa)
    times = np.linspace(0.0, each.end, 201)
    exact = solve(each, "taylor", TIGHT, times).states
    for tolerance in (1e-5, 1e-7, 1e-9):
        solution = solve(each, name, tolerance, times)
        assert solution.success
        assert np.abs(solution.states - exact)[:, :3].max() < 30 * tolerance


@pytest.mark.parametrize("name", NAMES)
def test_torque_free_motion_is_exact(name: str):
    each = problem(inf, 1e4)
    times = np.linspace(0.0, each.end, 51)
    solution = solve(each, name, 1e-3, times)
    assert solution.success
    momentum, axis = np.array(each.start, np.longdouble).reshape(2, 3)
    size = np.sqrt(momentum @ momentum)
    angle, about = times[:, None] * size, momentum / size
    along = about @ axis * about
    expected = along + np.cos(angle) * (axis - along) + np.sin(angle) * np.cross(about, axis)
    assert solution.states[:, :3] == pytest.approx(np.tile(momentum.astype(float), (51, 1)), abs=0)
    assert np.abs(solution.states[:, 3:] - expected).max() < (
        2e-15 if name == "splitting-extended" else 1e-11
    )


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("stokes", [inf, 1e4])
def test_from_rest(name: str, stokes: float):
    """L = 0 is nothing special: the least rate that counts is that at which the shear makes L grow."""
    each = problem(stokes, 200.0, start=EulerStart((0.3, 0.5, 0.0)))
    times = np.linspace(0.0, each.end, 101)
    solution, exact = (solve(each, method, 1e-9, times) for method in (name, "cyrk-dop853"))
    assert solution.success
    assert np.abs(solution.states - exact.states).max() < 1e-6


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize(("stokes", "end"), [(0.05, 3.0), (1.0, 10.0)])
def test_small_stokes_numbers(name: str, stokes: float, end: float):
    each = problem(stokes, end)
    times = np.linspace(0.0, end, 31)
    exact = solve(each, "taylor", TIGHT, times).states
    errors = []
    for tolerance in (1e-4, 1e-6, 1e-8):
        solution = solve(each, name, tolerance, times)
        assert solution.success
        errors.append(np.abs(solution.states - exact).max() / tolerance)
    assert max(errors) < 50


@pytest.mark.parametrize("name", NAMES)
def test_through_the_pinch_point(name: str):
    each = FORM.problem(named_scene("pinch-point"))
    times = np.linspace(0.0, each.end, 201)
    solution, exact = solve(each, name, TOLERANCE, times), solve(each, "taylor", TIGHT, times)
    assert solution.success
    assert np.abs(solution.states - exact.states)[:, :3].max() < 100 * TOLERANCE


FEW = np.array([0.0, 0.5, 40.0])
MANY = np.concatenate([[0.0], np.arange(0.5, 40.0, 0.013), [40.0]])


@pytest.mark.parametrize("name", NAMES)
def test_requested_times_do_not_change_the_steps(name: str):
    few, many = (solve(PROLATE, name, 1e-6, times) for times in (FEW, MANY))
    assert few.work == many.work
    assert few.states[[1, 2]].tolist() == many.states[[1, -1]].tolist()


@pytest.mark.parametrize("name", NAMES)
def test_rows_between_steps_are_as_accurate_as_steps(name: str):
    each = problem(1e4, 2000.0)
    times = np.linspace(0.0, each.end, 5001)
    errors = np.abs(
        solve(each, name, 1e-7, times).states - solve(each, "taylor", TIGHT, times).states
    )[:, :3]
    assert errors.max(axis=1)[1::7].max() < 3e-7
    # Next to a step's end and far from one alike.
    assert errors.max() < 1.5 * errors[::10].max()


@pytest.mark.parametrize("name", NAMES)
def test_step_limit_keeps_the_rows_before_it(name: str):
    each = problem(1e3, 400.0)
    times = np.linspace(0.0, each.end, 201)
    full = solve(each, name, TOLERANCE, times)
    limited = solve(each, name, TOLERANCE, times, max_steps=20)
    assert (limited.status, limited.work.steps, limited.message) == (
        Status.STEP_LIMIT,
        20,
        "20 steps",
    )
    assert 1 < len(limited.times) < len(times)
    assert limited.states.tolist() == full.states[: len(limited.states)].tolist()
    steps = full.work.steps
    assert steps is not None
    assert solve(each, name, TOLERANCE, times, max_steps=steps).success
    assert solve(each, name, TOLERANCE, times, max_steps=steps - 1).status is Status.STEP_LIMIT


@pytest.mark.usefixtures("processor_clock")
@pytest.mark.parametrize("name", NAMES)
def test_time_limit_keeps_the_rows_before_it(name: str):
    each = problem(1e4, 1e9)
    times = np.concatenate([[0.0, 1.0], np.linspace(1e3, each.end, 1000)])
    solve(PROLATE, name, TOLERANCE)
    solution = solve(each, name, TOLERANCE, times, max_seconds=0.1)
    assert solution.status is Status.TIME_LIMIT
    assert 0.1 <= solution.seconds < 1.0
    assert 2 <= len(solution.times) < len(times)
    assert solution.states[1] == pytest.approx(
        solve(replace(each, end=1.0), "taylor", TIGHT).states[-1], abs=1e-6
    )


@pytest.mark.parametrize("name", NAMES)
def test_a_state_that_is_not_finite(name: str):
    broken = replace(PROLATE, start=(np.nan, *PROLATE.start[1:]))
    solution = solve(broken, name, TOLERANCE, np.linspace(0.0, 40.0, 5))
    assert solution.status is Status.NON_FINITE


@pytest.mark.parametrize("name", NAMES)
def test_a_library_that_is_absent(name: str, monkeypatch):
    monkeypatch.setattr(contract, "installed", lambda library: library != solver(name).library)
    solution = solve(PROLATE, name, TOLERANCE)
    assert solution.status is Status.ADAPTER_MISSING
    assert "pip install" in solution.message


@pytest.mark.parametrize("name", NAMES)
def test_problems_without_parts_are_refused_in_a_line(name: str):
    with pytest.raises(
        SolverNotValidError, match=r"states no parts.*use form 'spheroid-axis'"
    ) as refusal:
        solve(CLASSICAL["rigid-body"].problem, name, TOLERANCE)
    assert "\n" not in str(refusal.value)
    assert takes(name, PROLATE)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize(
    "scene", ["spheroid", "spheroid-near-pole", "rest-spheroid", "needle", "thin-plate", "sphere"]
)
def test_hard_cases(name: str, scene: str):
    """Errors stay within bounds, and where a saddle amplifies them, within those of another good method."""
    each = FORM.problem(named_scene(scene))
    times = np.linspace(0.0, each.end, 201)
    exact = solve(each, "taylor", TIGHT, times).states
    for tolerance in (1e-6, 1e-9):
        solution = solve(each, name, tolerance, times)
        assert solution.success
        other = solve(each, "cyrk-vern8", tolerance, times)
        error, others = (np.abs(run.states - exact)[:, :3].max() for run in (solution, other))
        assert error < max(300 * tolerance, 3 * others)


@pytest.mark.parametrize("name", NAMES)
def test_ctrl_c_keeps_the_finished_rows(name: str):
    each = replace(FORM.problem(named_scene("spheroid")), end=1e9)
    times = np.concatenate([[0.0, 1.0], np.linspace(100.0, each.end, 1000)])
    solve(replace(each, end=1.0), name, TOLERANCE)
    pressed: list[float] = []

    def press() -> None:
        pressed.append(time.perf_counter())
        os.kill(os.getpid(), signal.SIGINT)

    timer = Timer(0.3, press)
    timer.start()
    try:
        with pytest.raises(KeyboardInterrupt) as caught:
            solve(each, name, TOLERANCE, times)
    finally:
        timer.cancel()
    assert time.perf_counter() - pressed[0] < 1.5
    assert isinstance(caught.value, Interrupted)
    solution = caught.value.solution
    assert len(solution.times) == len(solution.states) >= 2
    assert np.isfinite(solution.states).all()


def test_fast_spin_over_many_turns():
    """Phases of thousands of turns."""
    start = BodyStart((0.5, 0.5, 0.5, 0.5), (60.0, 50.0, 62.4))
    each = problem(1e4, 100.0, start=start)
    times = np.linspace(0.0, each.end, 101)
    exact = solve(each, "taylor", TIGHT, times).states
    turns = np.linalg.norm(each.start[:3]) * each.end / (2 * pi)
    assert turns > 100
    for name in NAMES:
        error = np.abs(solve(each, name, 1e-8, times).states - exact).max()
        assert error < 30 * turns * 1e-8


@pytest.mark.skipif(not solver("splitting-extended").available, reason="no long double of 80 bits")
def test_long_double_keeps_the_phase():
    """Beside Taylor's method in long double: what rounding to double leaves is far larger."""
    each = problem(1e5, 8000.0)
    times = np.linspace(0.0, each.end, 21)
    integrator = taylor_integrator(
        each.field, each.dimension, len(PARAMETERS), 1e-18, "long double"
    )
    integrator.time, integrator.state[:], integrator.pars[:] = (
        np.longdouble(0),
        each.start,
        each.parameters,
    )
    exact = contract.Record(times, np.tile(np.array(each.start, np.longdouble), (21, 1)))
    assert propagate(integrator, exact) == (Status.REACHED_END, "")
    wide, double = (solve(each, name, 1e-15, times) for name in ("splitting-extended", "splitting"))
    errors = [np.abs(run.states - exact.rows).max() for run in (wide, double)]
    assert wide.success
    assert errors[0] < min(1e-12, 0.1 * errors[1])


def test_averaging_reaches_tight_errors_on_long_runs():
    each = problem(1e6, 5e5)
    times = np.linspace(0.0, each.end, 101)
    exact = solve(each, "taylor", TIGHT, times).states
    for tolerance, slow, turned in ((1e-8, 5e-9, 3e-4), (1e-10, 1e-10, 1e-5)):
        solution = solve(each, "stroboscopic", tolerance, times)
        assert solution.success
        errors = np.abs(solution.states - exact).max(axis=0)
        assert errors[:3].max() < slow
        assert errors[3:].max() < turned


def test_turns_close_as_closely_as_their_steps_are_taken():
    """A rod that tumbles in the flow's plane: the rate of its turns varies, and much is left to close them."""
    each = problem(5e4, 5e4, 4.0)
    times = np.linspace(0.0, each.end, 51)
    solution, exact = (
        solve(each, *method, times) for method in (("stroboscopic", 1e-11), ("taylor", TIGHT))
    )
    assert solution.success
    errors = np.abs(solution.states - exact.states).max(axis=0)
    # The phase acts on L, which sways by a hundredth within a turn.
    assert errors[:3].max() < 1e-9
    assert errors[3:].max() < 1e-6


def test_plans_whose_checks_fail_are_narrowed_to_the_last(monkeypatch):
    each = problem(1e4, 1e4)
    split, state, tried = Split(each, TOLERANCE), np.array(each.start), []
    monkeypatch.setattr(
        split.planner, "estimated", lambda plan, *_: (tried.append(plan.step(1.0)) or inf, 0.0)
    )
    record = contract.Record(np.array([0.0, each.end]), np.empty((2, each.dimension)))
    tried.append(split.planner.plan(None, state, 0.0, record).step(1.0))
    assert np.all(np.diff(tried) < 0)
    assert len(tried) == 1 + MAX_PLAN_CHECKS


def test_the_smallest_micro_steps_are_compared_with_larger_ones(monkeypatch):
    strobe = Strobe(problem(1e6, 5e5), TOLERANCE)
    monkeypatch.setattr(strobe, "mean", lambda point, micro, out: out.fill(micro))
    for horizon, easy in ((1.0, False), (1e-3, True)):
        setting = Setting(MAX_MICRO_STEPS)
        strobe.fields(np.zeros(7), setting, np.full(7, horizon))
        assert (setting.micro, setting.easy) == (MAX_MICRO_STEPS, easy)


def test_a_row_that_is_not_found_is_not_a_number():
    """Time that passes twice as fast as turns do: trials go to and fro beside a row."""
    each, turns = problem(1e6, 5e5), 10.0
    strobe, point, terms = Strobe(each, TOLERANCE), np.append(each.start, 0.0), np.zeros((TERMS, 7))
    turn = 2 * pi / strobe.split.rate(point[:-1])
    terms[0, -1] = 2 * turn * turns
    rests, rows = np.empty(2), np.empty((2, 6))
    setting, times = np.array([2.0, 4.0, turns]), turn * np.array([1.2, 2.0])
    strobe.kernels.rows(strobe.scheme, strobe.p, setting, terms, point, times, rests, rows)
    assert np.isnan(rows[0]).all()
    assert np.allclose(rows[1], point[:-1], atol=1e-6)


def test_averaging_costs_the_same_at_any_stokes_number():
    steps = []
    for stokes in (1e6, 1e7, 1e8):
        each = problem(stokes, 0.5 * stokes)
        solution = solve(each, "stroboscopic", 1e-7, np.linspace(0.0, each.end, 11))
        assert solution.success
        steps.append((solution.work.steps or 0) + (solution.work.rejected or 0))
    assert max(steps) < 100
    assert max(steps) < 1.3 * min(steps)


@pytest.mark.parametrize("tolerance", [1e-5, 1e-7])
def test_averaging_hands_over_where_l_nearly_vanishes(tolerance: float):
    """L along z shrinks to 0 and turns over: no average there, at any Stokes number."""
    scene = replace(named_scene("pinch-point"), stokes=1e5, time=1e4)
    each = FORM.problem(scene)
    times = np.linspace(0.0, each.end, 201)
    solution, exact = (
        solve(each, "stroboscopic", tolerance, times),
        solve(each, "taylor", TIGHT, times),
    )
    assert solution.success
    assert np.linalg.norm(exact.states[:, :3], axis=1).min() < 0.05
    assert np.abs(solution.states - exact.states)[:, :3].max() < 100 * tolerance


UNIT = st.floats(-1.0, 1.0)


@pytest.mark.parametrize("name", NAMES)
@settings(max_examples=25, deadline=None, derandomize=True)
@given(
    kappa=st.floats(-3.0, 3.0).map(exp),
    stokes=st.one_of(st.floats(0.0, 8.0).map(lambda x: 10.0**x), st.just(inf)),
    size=st.one_of(st.floats(-3.0, 1.0).map(lambda x: 10.0**x), st.just(0.0)),
    spin=st.tuples(UNIT, UNIT, UNIT),
    angles=st.tuples(st.floats(0.01, 3.13), UNIT, UNIT),
    tolerance=st.sampled_from([1e-4, 1e-6, 1e-8]),
)
def test_any_spheroid_and_start(name: str, kappa, stokes, size, spin, angles, tolerance):
    """An error that grows no faster than the angle turned, from rest as well and without torque."""
    start = EulerStart(angles, tuple(size * each for each in spin))
    each = problem(stokes, min(100.0, 3.0 * stokes), kappa, start)
    times = np.linspace(0.0, each.end, 21)
    solution, exact = solve(each, name, tolerance, times), solve(each, "cyrk-dop853", 1e-12, times)
    assert solution.success
    turns = np.trapezoid(np.linalg.norm(exact.states[:, :3], axis=1), times) / (2 * pi)
    off = np.abs(solution.states - exact.states).max() / np.abs(exact.states).max()
    assert off < solver(name).error_constant * (1 + turns) * tolerance + 1e-9


@settings(max_examples=10, deadline=None, derandomize=True)
@given(
    kappa=st.floats(-2.3, 2.3).map(exp),
    stokes=st.floats(4.5, 6.0),
    spin=st.tuples(UNIT, UNIT, UNIT),
)
def test_averaging_any_spheroid(kappa, stokes, spin):
    start = EulerStart((1.0, 0.5, 0.0), tuple(3.0 + each for each in spin))
    each = problem(10**stokes, 3000.0, kappa, start)
    times = np.linspace(0.0, each.end, 21)
    solution, exact = (
        solve(each, *method, times) for method in (("stroboscopic", TOLERANCE), ("taylor", TIGHT))
    )
    assert solution.success
    # Over a thousand turns and more, needles included, whose phase acts on L.
    assert np.abs(solution.states - exact.states)[:, :3].max() < 10 * TOLERANCE
