"""`solve_ivp`: events."""

from math import acos, pi

import numpy as np
import pytest
from scipy.integrate import solve_ivp as scipys

from oracle.accepting import accepting
from polhode import Problem, solve_ivp

pytestmark = pytest.mark.usefixtures("quickly_compiled")


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


TABLE = np.linspace(0, 50, 200)
FORCE = 0.37 * np.cos(1.2 * TABLE)
CALL_PYTHON = [
    *("dop853", "rk45", "radau", "bdf", "lsoda"),
    *("cvode-adams", "cvode-bdf", "ida"),
]


def tabulated(t, y):
    return [y[1], y[0] - y[0] ** 3 - 0.3 * y[1] + np.interp(t, TABLE, FORCE)]


@pytest.mark.parametrize("name", [None, *CALL_PYTHON])
def test_any_function_runs_as_plain_python(name):
    question = tabulated, (2.0, 12.0), [1.0, 0.0]
    exact = scipys(*question, "DOP853", rtol=1e-10, atol=1e-10, max_step=0.1)
    run = solve_ivp(*question, name, rtol=1e-8)
    assert run.success
    assert run.message.endswith("plain Python")
    assert run.t[-1] == 12.0
    assert run.y[:, -1] == pytest.approx(exact.y[:, -1], abs=1e-4)
    rows = solve_ivp(*question, name, [3.0, 7.0, 11.0], rtol=1e-8)
    assert rows.t.tolist() == [3.0, 7.0, 11.0]
    assert rows.sol([5.0, 7.0])[:, 1] == pytest.approx(rows.y[:, 1], abs=1e-12)
    between = scipys(*question, "DOP853", [5.0], rtol=1e-10, atol=1e-10, max_step=0.1)
    assert rows.sol(5.0) == pytest.approx(between.y[:, 0], abs=1e-4)
    back = solve_ivp(tabulated, (12.0, 2.0), exact.y[:, -1], name, rtol=1e-10)
    assert back.y[:, -1] == pytest.approx([1.0, 0.0], abs=1e-2)


@pytest.mark.parametrize(
    ("name", "scipys_name"),
    [
        ("dop853", "DOP853"),
        ("rk45", "RK45"),
        ("radau", "Radau"),
        ("bdf", "BDF"),
        ("lsoda", "LSODA"),
    ],
)
def test_plain_python_by_scipys_methods_takes_scipys_steps(name, scipys_name):
    question = tabulated, (0.0, 12.0), [1.0, 0.0]
    run = solve_ivp(*question, name, rtol=1e-6, atol=1e-6)
    theirs = scipys(*question, scipys_name, rtol=1e-6, atol=1e-6)
    np.testing.assert_array_equal(run.t, theirs.t)
    np.testing.assert_array_equal(run.y, theirs.y)

    def low(t, y):
        return y[0] < -0.5

    low.terminal = True  # pyright: ignore
    stopped = solve_ivp(*question, name, events=low)
    assert stopped.t[-1] == stopped.t_events[0][0] < 12.0
    assert stopped.y[0, -1] == pytest.approx(-0.5, abs=1e-6)


def test_a_run_of_plain_python_that_fails_has_its_rows():
    def ends(t, y):
        return [y[0] ** 2 + 0 * np.interp(t, TABLE, FORCE)]

    for name in ("rk45", "radau", "cvode-bdf"):
        run = solve_ivp(ends, (0, 2), [1.0], name, max_seconds=20.0)
        assert not run.success
        assert len(run.t) > 0
        assert run.t[-1] < 1.1
    limited = solve_ivp(tabulated, (0, 50), [1.0, 0.0], "rk45", max_steps=5)
    assert "limit of steps" in limited.message


@pytest.mark.parametrize("name", SOLVERS)
def test_backwards_is_the_way_there_reversed(name):
    def driven(t, y):
        return [y[1], -y[0] + np.cos(2 * t) * np.sqrt(np.abs(t - 1.0) + 1.0)]

    there = scipys(driven, (1.0, 4.0), [1.0, 0.0], "DOP853", rtol=1e-12, atol=1e-12)
    end = there.y[:, -1]

    def passes(t, y):
        return y[0]

    run = solve_ivp(driven, (4.0, 1.0), end, name, [4.0, 2.5, 1.0], rtol=1e-9, events=passes)
    theirs = scipys(
        driven, (4.0, 1.0), end, "DOP853", [4.0, 2.5, 1.0], rtol=1e-12, atol=1e-12, events=passes
    )
    assert run.success
    assert run.t.tolist() == [4.0, 2.5, 1.0]
    assert run.y == pytest.approx(theirs.y, abs=1e-5)
    assert run.t_events[0] == pytest.approx(theirs.t_events[0], abs=1e-5)
    assert run.sol(2.5) == pytest.approx(theirs.y[:, 1], abs=1e-5)
    whole = solve_ivp(driven, (4.0, 1.0), end, name)
    assert (whole.t[0], whole.t[-1]) == (4.0, 1.0)


@pytest.mark.parametrize("name", ["RK45", "DOP853", "Radau", "BDF", "LSODA"])
def test_scipys_names_of_methods_are_known(name):
    found = solve_ivp(lambda t, y: [-y[0]], (0.0, 1.0), [1.0], method=name)
    same = solve_ivp(lambda t, y: [-y[0]], (0.0, 1.0), [1.0], method=name.lower())
    assert found.success
    assert found.y.tolist() == same.y.tolist()


def test_output_times_of_a_backward_span_are_named_as_given():
    words = r"^t_eval: got \[0, 5, 10\], expected decreasing numbers from 10 to 0$"
    with pytest.raises(ValueError, match=words):
        solve_ivp(oscillator, (10, 0), [1.0, 0.0], t_eval=[0, 5, 10])
    for wrong in ([10, 5, 5], [11, 5], [5, -1], [], "ten", [[10, 0]]):
        with pytest.raises(ValueError, match=r"t_eval: got .* expected decreasing"):
            solve_ivp(oscillator, (10, 0), [1.0, 0.0], t_eval=wrong)
    assert solve_ivp(oscillator, (10, 0), [1.0, 0.0], t_eval=[10, 5, 0]).t.tolist() == [10, 5, 0]


def test_what_is_no_function_is_refused_in_one_line():
    with pytest.raises(ValueError, match=r"^f: got 'pend', expected a function f\(t, y\)$"):
        solve_ivp("pend", (0, 1), [1.0, 0.0])  # pyright: ignore
    for events in (3, [ground, 3]):
        with pytest.raises(ValueError, match=r"^events: got 3, expected a function event\(t, y\)$"):
            solve_ivp(oscillator, (0, 1), [1.0, 0.0], events=events)  # pyright: ignore
    for start in ([1 + 0j, 0j], np.array([1 + 0j, 0j])):
        with pytest.raises(ValueError, match=r"^y0: got .*: give real and imaginary parts"):
            solve_ivp(oscillator, (0, 1), start)  # pyright: ignore


@pytest.mark.parametrize(
    ("f", "start", "right"),
    [
        # y₀ falls below 0.3 at t = 1.204, y₂ is below it from the start on.
        (lambda t, y: [-y[0], 1.0 * ((y[0] > 0.3) == (y[2] > 0.3)), -2 * y[2]], [1, 0, 0.2], 1.796),
        (lambda t, y: [1.0, 2.0 if (y[0] > 1) == True else 0.5], [0, 0], 4.5),  # noqa: E712
        (lambda t, y: [1.0, 1.0 * ((y[0] > 1) != (t > 2))], [0, 0], 1.0),
        (lambda t, y: [1.0, 1.0 if (t > 1) in (True, 1) else 0.0], [0, 0], 2.0),
    ],
)
def test_comparisons_of_comparisons_are_those_of_python(f, start, right):
    assert solve_ivp(f, (0, 3), start).y[1, -1] == pytest.approx(right, abs=2e-3)


def test_sol_takes_the_last_time_that_is_shown():
    """Counted from a start other than 0 and back, it may lie beyond the last row by rounding."""

    def passed(t, y):
        return y[0] - 0.37123

    passed.terminal = True
    for began in np.linspace(0.1, 3, 40):
        run = solve_ivp(lambda t, y: [-y[0]], (began, began + 5), [1.0], events=passed)
        assert run.sol(run.t[-1])[0] == pytest.approx(0.37123)
        with pytest.raises(ValueError, match="expected times from"):
            run.sol(run.t[-1] + 1e-9)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"max_seconds": None}, "max_seconds: got None, expected a positive number"),
        ({"max_step": "a"}, "max_step: got 'a', expected a positive number"),
        ({"first_step": "a"}, "first_step: got 'a', expected a positive number"),
        ({"max_steps": 1.5}, "max_steps: got 1.5, expected a whole number"),
        ({"y0": 1.0, "mass": [1]}, "y0: got 1.0, expected a sequence of finite numbers"),
        ({"y0": ["1"]}, r"y0: got \['1'\], expected a sequence of finite numbers"),
        ({"y0": np.array(["2020-01-01"], dtype="datetime64[s]")}, "y0: got array"),
        ({"y0": [10**400]}, "y0: got .10000"),
        ({"t_span": (-1e308, 1e308)}, "t_span: got .*, expected a finite duration"),
        ({"t_span": (0, 5e-324)}, "t_span: got .*, expected a duration that holds 201 different"),
        (
            {"t_span": (-1e10, 1.0), "t_eval": [1e-8, 2e-8]},
            "t_eval: got .*, expected times that still differ when counted from the start, -1e10",
        ),
        ({"mass": np.ones((2, 3))}, r"mass: got array\(\[\[1., 1., 1.\], \[1"),
        ({"fun": max, "y0": [1.0, 2.0]}, "f: got ValueError at the start"),
    ],
)
def test_values_of_the_wrong_kind_are_refused_in_a_line(given: dict, words: str):
    arguments = {"fun": lambda t, y: [-y[0]], "t_span": (0, 1), "y0": [1.0], **given}
    with pytest.raises(ValueError, match=words) as refusal:
        solve_ivp(**arguments)
    assert "\n" not in str(refusal.value)
