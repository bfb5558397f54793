"""Relative and absolute tolerances, one per component if need be; limits of steps; time as the solver's own."""

import numpy as np
import pytest

from oracle.accepting import accepting
from polhode import Problem, solve_ivp
from polhode.solvers.catalogue import solver
from polhode.solvers.compile import frozen, trace
from polhode.solvers.contract import SolverNotValidError
from polhode.solvers.solve import solve


def growth(t, y):
    return [y[0]]


def large_and_small(t, y):
    return [-y[0] + np.cos(t), 1e-6 * y[0] - 0.1 * y[1]]


def root(t, y):
    return [np.sqrt(0.7 - t)]


GROWTH = frozen(Problem.from_function(growth, [1e-9], 30.0))
PAIR = frozen(Problem.from_function(large_and_small, [1.0, 1e-6], 5.0))
ROOT = frozen(Problem.from_function(root, [0.0], 0.7, t_start=0.1))
SOLVERS = accepting(PAIR)


@pytest.mark.parametrize("name", SOLVERS)
def test_what_is_small_is_followed_by_the_absolute_tolerance(name):
    run = solve(GROWTH, name, 1e-6, atol=1e-15)
    assert run.success
    assert run.states[-1, 0] == pytest.approx(1e-9 * np.exp(30.0), rel=1e-3)


@pytest.mark.parametrize("name", SOLVERS)
def test_components_have_tolerances_of_their_own(name):
    exact = solve(PAIR, "taylor", 1e-15).states[-1]
    run = solve(PAIR, name, 1e-6, atol=[1e-6, 1e-12])
    assert run.success
    error = np.abs(run.states[-1] - exact)
    assert error[0] < 1e-4
    assert error[1] < 1e-10
    with pytest.raises(
        ValueError, match=r"^atol: got \[1e-06, 1e-06, 1.0\], expected one number or 2"
    ):
        solve(PAIR, name, 1e-6, atol=[1e-6, 1e-6, 1.0])


@pytest.mark.parametrize("name", [one for one in SOLVERS if "atol 0" in solver(one).tolerances])
def test_no_absolute_tolerance_of_what_starts_at_0_is_named_as_the_cause(name):
    for atol in (0.0, [1e-6, 0.0]):
        run = solve_ivp(lambda t, y: [y[1], -y[0]], (0, 1), [1.0, 0.0], name, atol=atol)
        assert not run.success
        assert "atol: got 0, expected a positive number, as y[1] is 0 at the start" in run.message
    run = solve_ivp(lambda t, y: [y[1], -y[0]], (0, 1), [1.0, 0.1], name, atol=0.0)
    assert run.success


def test_relative_tolerances_of_components_are_refused_by_name_where_the_library_has_none():
    assert solve(PAIR, "cyrk-vern7", [1e-6, 1e-9], atol=1e-12).success
    with pytest.raises(SolverNotValidError, match="expected one number for solver 'radau'"):
        solve(PAIR, "radau", [1e-6, 1e-9])


@pytest.mark.parametrize("name", SOLVERS)
def test_limits_of_steps_are_kept_or_refused_by_name(name):
    method = solver(name)
    if "max_step" in method.limits:
        run = solve(PAIR, name, 1e-3, max_step=0.01, count=True)
        assert run.work.steps >= 500
    if "first_step" in method.limits:
        assert solve(PAIR, name, 1e-6, first_step=1e-4).success
    else:
        with pytest.raises(SolverNotValidError, match=f"solver '{name}' has no such limit"):
            solve(PAIR, name, 1e-6, first_step=1e-4)
    with pytest.raises(SolverNotValidError, match=r"^max_step: got -1, expected a positive"):
        solve(PAIR, name, 1e-6, max_step=-1)


@pytest.mark.parametrize("name", SOLVERS)
def test_no_time_lies_beyond_the_end(name):
    run = solve(ROOT, name, 1e-6)
    assert run.success
    assert run.states[-1, 0] == pytest.approx(0.6**1.5 * 2 / 3, abs=1e-4)


def test_default_tolerances_follow_the_size_of_the_start():
    found = solve_ivp(growth, (0, 30), [1e-9], "radau")
    assert found.y[0, -1] == pytest.approx(1e-9 * np.exp(30.0), rel=1e-3)
    assert "atol" not in found.message
    found = solve_ivp(lambda t, y: [1.0 - y[0]], (0, 1), [0.0], "radau")
    assert "atol = rtol = 1e-06, as y0 is 0" in found.message


def test_limits_of_runs_are_statuses():
    assert "limit of steps" in solve_ivp(growth, (0, 30), [1.0], "rk45", max_steps=10).message
    run = solve_ivp(lambda t, y: [-1e9 * y[0]], (0, 1e3), [1.0], "cyrk-tsit5", max_seconds=0.2)
    assert not run.success


def test_a_frozen_problem_is_traced_once(monkeypatch):
    calls = []
    monkeypatch.setattr(trace, "__wrapped__", lambda *given: calls.append(given) or "")
    assert frozen(frozen(PAIR)) == PAIR
    solve(PAIR, "radau", 1e-6).sol([1.2, 3.4])
    assert not calls
