"""Taylor's method where coefficients of the series leave the range of double precision."""

from math import cos, exp, sqrt

import numpy as np
import pytest

from polhode import Problem, solve_ivp
from polhode.solvers.solve import solve


def decay(rate):
    return lambda _, y: [-rate * y[0]], 1.0, 3 / rate, exp(-3.0)


def root(size, start, end):
    """y' = size/y."""
    return lambda _, y: [size / y[0]], start, end, sqrt(start**2 + 2 * size * end)


def hyperbola(rate, end):
    return lambda _, y: [-rate * y[0] ** 2], 1.0, end, 1 / (1 + rate * end)


PROBLEMS = {
    "1e50/y": root(1e50, 1.0, 1.0),
    "1e50/y, short": root(1e50, 1.0, 1e-40),
    "1e50/y, slow": root(1e50, 1e25, 1.0),
    "1e100/y": root(1e100, 1.0, 1e-90),
    "1/y from 1e-60": root(1.0, 1e-60, 1.0),
    "1/y for 1e30": root(1.0, 1.0, 1e30),
    "-1e50 y²": hyperbola(1e50, 1e-45),
    "-1e50 y² for long": hyperbola(1e50, 1.0),
    "decay of 1e-30": decay(1e-30),
    "decay of 1e-200": decay(1e-200),
    "decay of 1e30": decay(1e30),
    "decay of 1e200": decay(1e200),
}


@pytest.mark.parametrize("tolerance", [1e-6, 1e-9, 1e-13])
@pytest.mark.parametrize("name", PROBLEMS)
def test_fast_and_slow_rates(name, tolerance):
    """Powers of the rate up to the order overflow, or vanish, and with them the error that they show."""
    field, start, end, exact = PROBLEMS[name]
    solution = solve_ivp(
        field, (0.0, end), [start], method="taylor", rtol=tolerance, atol=tolerance * start
    )
    assert solution.success, solution.message
    assert solution.y[0, -1] == pytest.approx(exact, abs=1e3 * tolerance * max(1.0, exact))


def test_rows_of_such_a_run_are_right():
    end = 30e40
    times = np.linspace(0.0, end, 50)

    def turning(_, y):
        return [1e-40 * y[1], -1e-40 * y[0]]

    options = {"method": "taylor", "rtol": 1e-11, "atol": 1e-11, "t_eval": times}
    solution = solve_ivp(turning, (0.0, end), [1.0, 0.0], **options)
    assert solution.success
    assert solution.y[0] == pytest.approx([cos(1e-40 * time) for time in times], abs=1e-9)


def test_a_field_of_time_in_such_a_run():
    solution = solve_ivp(
        lambda t, y: [1e50 * t * y[0] ** 0],
        (0.0, 1e-20),
        [0.0],
        method="taylor",
        rtol=1e-10,
        atol=1e-10,
    )
    assert solution.success
    assert solution.y[0, -1] == pytest.approx(0.5e10, rel=1e-9)


@pytest.mark.parametrize("atol", [1e-9, 1e-30])
def test_a_run_that_becomes_infinite_is_no_success(atol):
    solution = solve_ivp(
        lambda _, y: [1e50 * y[0] ** 2], (0.0, 1.0), [1.0], method="taylor", rtol=1e-9, atol=atol
    )
    assert not solution.success
    assert np.isfinite(solution.y).all()


def test_times_too_long_for_taylor_with_events_are_no_success():
    rate = 1e-40
    found = solve_ivp(
        lambda _, y: [rate * y[1], -rate * y[0]],
        (0.0, 7 / rate),
        [1.0, 0.0],
        method="taylor",
        rtol=1e-10,
        atol=1e-10,
        events=lambda _, y: y[0] - 0.3,
    )
    assert not found.success
    assert "needs another solver" in found.message


def test_a_limit_of_steps_in_such_a_run_is_that():
    problem = Problem.from_function(lambda _, y: [1e30 * y[1], -1e30 * y[0]], [1.0, 0.0], 1e-24)
    assert solve(problem, "taylor", 1e-10, max_steps=1000).status == "step_limit"
