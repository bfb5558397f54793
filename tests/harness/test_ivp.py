"""`solve_ivp`: events."""

from math import acos, pi

import numpy as np
import pytest
from scipy.integrate import solve_ivp as scipys

from oracle.accepting import accepting
from polhode import Problem, solve_ivp


def oscillator(t, y):
    return [y[1], -y[0]]


def falling(t, y):
    return [y[1], -0.5]


def choke(t, y):
    return [y[0] ** 3 / (1 - y[0] ** 2)]


def ground(t, y):
    return y[0]


ground.terminal, ground.direction = True, -1  # pyright: ignore


def close(t, y):
    return y[0] - 0.95


close.terminal = True  # pyright: ignore

SOLVERS = accepting(Problem.from_function(oscillator, [1.0, 0.0], 1.0))


@pytest.mark.parametrize("name", SOLVERS)
def test_a_terminal_event_is_the_last_row(name):
    run = solve_ivp(falling, (0, 100), [0.0, 10.0], name, events=ground)
    assert (run.status, run.success, len(run.t_events[0])) == (1, True, 1)
    assert run.t[-1] == run.t_events[0][0] == pytest.approx(40.0, abs=1e-4)
    assert run.y[:, -1] == pytest.approx([0.0, -10.0], abs=1e-4)
    assert run.y[:, -1] == pytest.approx(run.y_events[0][0], abs=0)
    assert run.sol(20.0)[0] == pytest.approx(100.0, rel=1e-3)
    short = solve_ivp(falling, (0, 100), [0.0, 10.0], name, [1.0, 2.0, 99.0], events=ground)
    assert short.t.tolist() == [1.0, 2.0]


@pytest.mark.parametrize("name", SOLVERS)
def test_a_terminal_event_before_a_singularity_ends_the_run(name):
    run = solve_ivp(choke, (0, 5), [0.3], name, events=close, max_seconds=20.0)
    assert (run.status, run.success) == (1, True)
    assert run.t[-1] == pytest.approx(3.848859, abs=2e-3)


@pytest.mark.parametrize("name", SOLVERS)
def test_conditions_are_placed_where_they_change(name):
    conditions = [
        lambda t, y: y[0] > 0.3,
        lambda t, y: max(y[0] - 0.3, 0.0),
        lambda t, y: -1 if y[0] < 0.3 else 1,
        lambda t, y: np.array([y[0] - 0.3]),
    ]
    run = solve_ivp(oscillator, (0, 3), [1.0, 0.0], name, events=conditions, rtol=1e-8)
    for times in run.t_events:
        assert times == pytest.approx([acos(0.3)], abs=1e-5)


@pytest.mark.parametrize("name", SOLVERS)
def test_directions_and_counts_are_scipys(name):
    def third(t, y):
        return y[0]

    third.terminal = 3  # pyright: ignore

    def rising(t, y):
        return y[0]

    rising.direction = 1  # pyright: ignore
    question = oscillator, (0.1, 30), [1.0, 0.0]
    run = solve_ivp(*question, name, events=[rising, third], rtol=1e-8)
    theirs = scipys(*question, "DOP853", events=[rising, third], rtol=1e-10, atol=1e-10)
    for mine, exact in zip(run.t_events, theirs.t_events, strict=True):
        assert mine == pytest.approx(exact, abs=1e-5)
    assert run.t[-1] == pytest.approx(0.1 + 2.5 * pi, abs=1e-5)


@pytest.mark.parametrize("name", ["cyrk-lsoda", "cyrk-dop853", "taylor"])
def test_looking_for_events_changes_no_row(name):
    """Over several chunks of steps."""
    times = np.linspace(0.0, 2000.0, 31)
    question = oscillator, (0, 2000), [1.0, 0.0], name, times
    plain, run = solve_ivp(*question), solve_ivp(*question, events=lambda t, y: y[0])
    assert plain.y == pytest.approx(run.y, abs=1e-2 if name == "cyrk-lsoda" else 1e-3)
    never = solve_ivp(*question, events=lambda t, y: y[0] - 2)
    assert len(never.t) == 31
    assert never.success


def test_an_error_in_an_event_names_it_and_its_line():
    def broken(t, y):
        return y[7]

    for name in ("cyrk-dop853", "taylor", "radau", "cvode-bdf"):
        with pytest.raises(ValueError, match=r"^event 'broken': got IndexError.*test_ivp.py:\d+"):
            solve_ivp(oscillator, (0, 1), [1.0, 0.0], name, events=broken)
