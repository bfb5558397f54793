"""Where a solution ends, no run claims success, and none goes on for ever; where a quotient has a limit, it does."""

import numpy as np
import pytest
from scipy.special import sici

from polhode import Problem, solve_ivp
from polhode.solvers.solve import solve


def choke(t, y):
    return [y[0] ** 3 / (1 - y[0] ** 2)]


def root(t, y):
    return [-1 / y[0]]


def inverse_cube(t, y):
    return [-1 / y[0] ** 3]


def quench(t, y):
    return [1 / (1 - y[0])]


def relaxing_choke(t, y):
    return [-y[0] + y[1], y[1] ** 3 / (1 - y[1] ** 2)]


def blow_up(t, y):
    return [y[0] ** 2]


def pole_of_time(t, y):
    return [1 / (1 - t)]


ENDING = {
    "choke": (choke, 5.0, [0.3]),
    "root": (root, 1.0, [1.0]),
    "inverse cube": (inverse_cube, 1.0, [1.0]),
    "quench": (quench, 2.0, [0.0]),
    "relaxing choke": (relaxing_choke, 5.0, [1.0, 0.3]),
    "blow-up": (blow_up, 2.0, [1.0]),
    "pole of time": (pole_of_time, 2.3, [0.0]),
}


@pytest.mark.parametrize("solver", ["taylor", "cvode-bdf", "cvode-adams", "cyrk-vern8", "lsoda"])
@pytest.mark.parametrize("name", ENDING)
def test_no_run_succeeds_beyond_the_end_of_a_solution(name, solver):
    f, end, start = ENDING[name]
    found = solve_ivp(f, (0, end), start, solver, max_seconds=20.0)
    assert not found.success
    assert "time" not in found.message.split(";")[0], "it ended by itself"


@pytest.mark.parametrize("solver", ["cyrk-tsit5", "cyrk-vern8"])
def test_nor_without_rows_in_between(solver):
    run = solve(Problem.from_function(quench, [0.0], 2.0), solver, 1e-6, max_seconds=20.0)
    assert run.status in ("step_underflow", "false_success")


def limit(t, y):
    return [1.0, np.sin(y[0]) / y[0]]


def stiff(t, y):
    return [y[1], 1e4 * ((1 - y[0] ** 2) * y[1] - y[0]) / (1.0 + 0.1 * y[0])]


@pytest.mark.parametrize("solver", ["cvode-bdf", "cyrk-vern8", "taylor", "radau"])
def test_a_quotient_that_has_a_limit_is_no_end(solver):
    found = solve_ivp(limit, (0, 3.01), [-1.5, 0.0], solver)
    assert found.success
    assert found.y[1, -1] == pytest.approx(sici(1.51)[0] + sici(1.5)[0], abs=1e-3)


@pytest.mark.parametrize("solver", ["cvode-bdf", "lsoda", "radau"])
def test_relaxation_is_no_end(solver):
    assert solve_ivp(stiff, (0, 3), [2.0, 0.0], solver).success
    growth = solve_ivp(lambda t, y: [20.0 * y[0]], (0, 20), [1e-9], solver)
    assert growth.success
