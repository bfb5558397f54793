"""Problems of ordinary functions, as SciPy's `solve_ivp` takes them."""

import math
import pickle
from dataclasses import dataclass
from functools import partial

import numpy as np
import pytest
from numpy import sin
from scipy.integrate import solve_ivp as scipys

from oracle.accepting import accepting
from polhode import Problem, solve_ivp
from polhode.solvers.compile import compiled_callback
from polhode.solvers.machine_code.tracing import FieldError
from polhode.solvers.solve import solve

pytestmark = pytest.mark.usefixtures("quickly_compiled")

NOTHING = None  # A global that is no function stays what it is.


RATE = 1.0


def decaying(t, y):
    return -RATE * y


def bell(x):
    return np.exp(-x * x)


def driven(t, y, a, b):
    x, v = y
    assert NOTHING is None
    return np.array([v, -a * sin(x) + 0.1 * bell(v) + b * np.cos(t)])


def matrix(t, y, k):
    rates = np.empty_like(y)
    rates[:] = np.array([[0.0, 1.0], [-1.0, 0.0]]) @ y + np.zeros(2, dtype=float)
    rates[1] -= k * math.log(2) * np.log2(2 + y[0] * y[0])
    return rates


def bent(t, y, k):
    x, v = y
    force = np.heaviside(x, 0.5) * np.sin(np.array([v, x])) - np.heaviside(-x, 0.5) * np.maximum(
        y[::-1], -0.3
    )
    return k * -y + y / k - np.abs(k - y) + np.where(force > 0.4, 0.4, force)


def with_constants(t, y):
    return (
        math.sin(0.3) * np.cos(0.2) * y[::-1]
        - np.sqrt(2.0) * np.exp(-0.5) * np.log(3) * np.abs(-0.4) * y
    )


def scaled_by_itself(t, y):
    return y[0] * (np.array([[-1.0, 2.0], [-2.0, -1.0]]) @ y) / (1.0 + y[1] * y[1])


def one_by_one(t, y, *, decay=np.exp):
    rate = lambda each: -decay(-each) * bell(each)  # noqa: E731
    return [rate(each) for each in y] + [sum(bell(each) * RATE for each in y) * 0.1]


def by_name(t, y, of, also):
    return [-of(each) + also(each) for each in y]


@pytest.mark.parametrize(
    ("f", "parameters", "timed"),
    [
        (driven, (1.0, 0.3), True),
        (matrix, (0.2,), False),
        (with_constants, (), False),
        (scaled_by_itself, (), False),
    ],
)
def test_every_solver_agrees_with_scipy(f, parameters, timed):
    problem = Problem.from_function(f, [1.0, 0.5], 10.0, parameters)
    assert (problem.name, problem.dimension) == (f.__name__, 2 + timed)
    exact = scipys(f, (0, 10), [1.0, 0.5], "DOP853", rtol=1e-13, atol=1e-13, args=parameters).y[
        :, -1
    ]
    names = accepting(problem)
    assert {"taylor", "radau", "ida", "cvode-bdf", "cyrk-vern8"} <= set(names)
    for name in names:
        np.testing.assert_allclose(
            solve(problem, name, 1e-9).states[-1, :2], exact, atol=1e-6, err_msg=name
        )
    again = pickle.loads(pickle.dumps(problem))
    assert again == problem


def test_arrays_and_branches_are_numpys_in_machine_code_and_for_taylor():
    problem, out = Problem.from_function(bent, [1.0, 0.5], 0.05, (1.3,)), np.empty(2)
    callback = compiled_callback(problem.field, 2, 1)
    for state in (*np.random.default_rng(3).uniform(-2, 2, (50, 2)), np.zeros(2)):
        callback(state, np.array([1.3]), out)
        np.testing.assert_allclose(out, bent(0.0, state, 1.3), rtol=1e-14, atol=1e-15)
    # No branch changes on the way.
    states = [solve(problem, name, 1e-11).states[-1] for name in ("taylor", "dop853")]
    np.testing.assert_allclose(*states, rtol=1e-9)


@pytest.mark.parametrize(
    ("f", "y0", "parameters", "words"),
    [
        (lambda t, y: [1.0], [1.0, 2.0], (), "f: got 1 rates, expected 2"),
        (lambda y: [1.0], [1.0], (), r"f: got <lambda>\(y\), expected f\(t, y\)"),
        (lambda t, y, a: [a], [1.0], (), r"f: got <lambda>\(t, y, a\), expected f\(t, y\)"),
        (
            lambda t, y: [y[5]],
            [1.0],
            (),
            r"f: got IndexError at the start: index 5.*test_own_function.py:\d+: \(?lambda",
        ),
        (lambda y, t: [y], [1.0], (), r"expected f\(t, y\).*the time comes first"),
        (
            lambda t, y: [math.inf],
            [1.0],
            (),
            r"f: got the rates \[inf\] at the start, expected finite",
        ),
        (driven, "ab", (), "y0: got 'ab', expected a sequence of finite numbers"),
        (driven, [], (), "y0: got no numbers"),
        (driven, [1j, 1.0], (), "^y0: got .* give real and imaginary parts"),
        (driven, np.eye(2), (), r"^y0: got .*y0.ravel\(\)"),
        (driven, [1.0, 2.0], [{"k": 1.0}], "^parameters: got .* goes into a closure"),
        (driven, [1.0, 2.0], [np.eye(2)], "^parameters: got .* goes into a closure"),
        (lambda t, y: None, [1.0, 2.0], (), "^f: got None, expected rates"),
        (lambda t, y: 1j * y, [1.0], (), "^f: got the rates .*real and imaginary parts"),
        (driven, [1.0, 2.0], 3.0, "parameters: got 3.0, expected a sequence"),
        (driven, [1.0, 2.0], (1.0, math.nan), "parameters: got .*nan"),
    ],
)
def test_errors_are_in_the_users_words(f, y0, parameters, words):
    with pytest.raises(ValueError, match=words):
        Problem.from_function(f, y0, 1.0, parameters)


@pytest.mark.parametrize("end", [0.0, math.inf, None, "3"])
def test_an_end_that_is_no_time_other_than_the_start_is_refused(end):
    with pytest.raises(ValueError, match=f"^t_end: got {end!r}, expected a "):
        Problem.from_function(matrix, [1.0, 2.0], end, (1.0,))


def branching(t, y):
    return [y[0] if y[0] > 0 else 0.0]


def test_what_runs_as_plain_python_is_refused_by_compiled_solvers_with_its_line():
    problem = Problem.from_function(branching, [1.0], 1.0)
    for name in ("taylor", "cyrk-dop853"):
        with pytest.raises(
            ValueError,
            match=rf"^solver '{name}': y\[0\] > 0 branches on the state.*; use .*np.where .*"
            r"test_own_function.py:\d+: return .*calls Python: dop853",
        ):
            solve(problem, name, 1e-6)


def falls(t, y, *args):
    return y[0]


falls.direction, falls.terminal = -1, True  # pyright: ignore


def test_what_comprehensions_lambdas_and_keywords_name_is_compiled_too():
    def of_two(t, y):
        return one_by_one(t, y[:1])

    ours = solve_ivp(of_two, (0.0, 2.0), [1.0, 0.0], "cyrk-dop853", rtol=1e-10)
    theirs = scipys(of_two, (0.0, 2.0), [1.0, 0.0], "DOP853", rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(ours.y[:, -1], theirs.y[:, -1], atol=1e-8)
    given = solve_ivp(
        partial(by_name, of=np.sin, also=bell), (0.0, 2.0), [1.0], "cyrk-dop853", rtol=1e-10
    )
    theirs = scipys(
        partial(by_name, of=np.sin, also=bell), (0.0, 2.0), [1.0], "DOP853", rtol=1e-12, atol=1e-12
    )
    np.testing.assert_allclose(given.y[:, -1], theirs.y[:, -1], atol=1e-8)


@pytest.mark.parametrize("method", ["taylor", "cyrk-dop853", "radau"])
def test_solve_ivp_gives_what_scipy_gives(method: str):
    span, start, args = (0.5, 8.0), [1.0, 0.5], (1.0, 0.3)
    times = np.linspace(1.0, 7.0, 13)
    ours = solve_ivp(driven, span, start, method, times, args=args, events=falls, rtol=1e-10)
    theirs = scipys(
        driven, span, start, "DOP853", times, args=args, events=falls, rtol=1e-12, atol=1e-12
    )
    np.testing.assert_array_equal(ours.t, theirs.t)
    np.testing.assert_allclose(ours.y, theirs.y, atol=1e-7)
    np.testing.assert_allclose(ours.t_events[0], theirs.t_events[0], rtol=1e-7)
    np.testing.assert_allclose(ours.y_events[0], theirs.y_events[0], atol=1e-7)
    assert (ours.status, ours.success) == (theirs.status, theirs.success) == (1, True)
    whole = solve_ivp(driven, span, start, method, args=args, rtol=1e-10)
    assert (whole.status, whole.y.shape) == (0, (2, 201))
    np.testing.assert_allclose(whole.sol(times[:3]), theirs.y[:, :3], atol=1e-7)
    for wrong in ([0.0, 1.0], [1.0, 9.0], [1.0, 9.0, 2.0], [2.0, 1.0], [1.0, 1.0], []):
        with pytest.raises(ValueError, match="t_eval: got"):
            solve_ivp(driven, span, start, method, wrong, args=args)


def test_an_event_may_end_a_run_at_its_second_time(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(falls, "terminal", 2)
    question = (lambda t, y: [y[1], -y[0]]), (0, 20), [1.0, 0.0]
    ours, theirs = (
        solve_ivp(*question, events=falls, rtol=1e-10),
        scipys(*question, events=falls, rtol=1e-10),
    )
    np.testing.assert_allclose(ours.t_events[0], theirs.t_events[0], rtol=1e-3)
    assert len(ours.t_events[0]) == 2
    assert ours.status == theirs.status == 1


def test_of_scipys_options_those_that_would_change_nothing_are_taken():
    two = [lambda t, y: y[0] - 0.5, lambda t, y: y[0] - 0.25]
    found = solve_ivp(lambda t, y: -y, (0, 2), [1.0], events=two, rtol=1e-10, dense_output=True)
    assert solve_ivp(lambda t, y: -y, (0, 2), [1.0], events=None, args=None).t_events == []
    np.testing.assert_allclose(np.ravel(found.t_events), np.log([2, 4]), rtol=1e-8)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"vectorized": True}, "^solve_ivp: got vectorized, expected no options of SciPy's but"),
        ({"t_span": (0, 10, 20)}, r"^t_span: got \(0, 10, 20\), expected 2 numbers"),
        ({"t_span": 2.0}, r"^t_span: got 2.0, expected 2 numbers"),
        (
            {"args": [{"k": 1.0}]},
            r"^args: got \{'k': 1.0\}, expected numbers; .* closure: lambda t, y",
        ),
        ({"args": [np.eye(2)]}, "^args: got array.*closure: lambda t, y"),
        (
            {"t_span": (20, 20)},
            r"^t_span: got \(20, 20\), expected a start and another, finite end$",
        ),
        ({"rtol": 0}, "^rtol: got 0, expected a finite positive number$"),
        ({"events": 3}, r"^events: got 3, expected a function event\(t, y\)$"),
        ({"events": [[]]}, r"^events: got \[\], expected a function event\(t, y\)$"),
    ],
)
def test_what_solve_ivp_cannot_take_is_refused_in_one_line(change: dict, words: str):
    with pytest.raises(ValueError, match=words):
        solve_ivp(**{"fun": lambda t, y: -y, "t_span": (0, 2), "y0": [1.0]} | change)


@pytest.mark.parametrize("terminal", [False, True])
def test_an_event_that_does_not_happen_has_no_times(terminal: bool):
    def half(t, y):
        return y[0] - 0.5

    half.terminal = terminal  # pyright: ignore
    question = (lambda t, y: -y), (0, 2), [1.0]
    ours = solve_ivp(*question, events=[half, lambda t, y: y[0] + 1], rtol=1e-10)
    theirs = scipys(*question, events=[half, lambda t, y: y[0] + 1], rtol=1e-10)
    assert (
        [len(each) for each in ours.t_events] == [len(each) for each in theirs.t_events] == [1, 0]
    )
    assert [len(each) for each in ours.y_events] == [len(each) for each in theirs.y_events]


@pytest.mark.parametrize("name", ["cyrk-dop853", "taylor", "radau", "cvode-bdf"])
def test_names_of_the_module_mean_what_they_do_when_a_run_begins(name, monkeypatch):
    problem = Problem.from_function(decaying, [1.0], 1.0)
    for rate in (1.0, 2.0, 1.0):
        monkeypatch.setitem(globals(), "RATE", rate)
        found = solve(problem, name, 1e-9)
        assert found.states[-1, 0] == pytest.approx(math.exp(-rate), abs=1e-6)
        problem = found.problem


@pytest.mark.parametrize("backend", ["numba", "python"])
def test_between_its_rows_a_solution_refuses_names_that_mean_something_else(backend, monkeypatch):
    found = solve(Problem.from_function(decaying, [1.0], 1.0), "dop853", 1e-9, backend=backend)
    assert found(0.5).states[0, 0] == pytest.approx(math.exp(-0.5 * RATE), abs=1e-6)
    monkeypatch.setitem(globals(), "RATE", 2.0)
    with pytest.raises(ValueError, match="have changed since the run"):
        found(0.5)


@dataclass
class Decay:
    """Compared by its values, and so without a hash."""

    rate: float = 2.0

    def __call__(self, t, y):
        return -self.rate * y


@pytest.mark.parametrize("name", ["cyrk-dop853", "taylor"])
def test_an_object_without_a_hash_is_a_function_too(name):
    found = solve(Problem.from_function(Decay(), [1.0], 1.0), name, 1e-9)
    assert found.states[-1, 0] == pytest.approx(math.exp(-2.0), abs=1e-6)


@pytest.mark.parametrize("f", [lambda t, y: -y if t else y, lambda t, y: -y if t == 0 else y])
def test_branching_by_time_is_plain_python(f):
    assert "plain Python" in solve_ivp(f, (0, 1), [1.0]).message
    with pytest.raises(ValueError, match="branches on the state or the time"):
        solve_ivp(f, (0, 1), [1.0], "taylor")


@pytest.mark.parametrize(
    "use",
    [lambda t, y: y - t, lambda t, y: y * np.cos(t), lambda t, y: [t]],
)
def test_time_that_is_used_only_after_the_start_is_refused(use, monkeypatch):
    problem = Problem.from_function(lambda t, y: use(t, y) if RATE > 1 else -y, [1.0], 1.0)
    monkeypatch.setitem(globals(), "RATE", 2.0)
    for name in ("taylor", "dop853"):
        with pytest.raises(FieldError, match="the time, which was not used at the start"):
            solve(problem, name, 1e-6)


NO_NUMBERS = [
    lambda t, y: np.maximum(np.sqrt(y - 0.5), 0.0) - 2.0,
    lambda t, y: np.minimum(0.0, np.sqrt(y - 0.5)) - 1.0,
    lambda t, y: np.heaviside(np.sqrt(y - 0.5), 0.0) - 2.0,
]


@pytest.mark.parametrize("f", NO_NUMBERS)
@pytest.mark.parametrize("name", ["cyrk-dop853", "cvode-bdf"])
def test_what_is_no_number_is_hidden_by_no_function(f, name):
    assert not solve(Problem.from_function(f, [1.0], 2.0), name, 1e-6).success


class Damped:
    """Its methods use NumPy's functions, call each other, and so do functions made where it is."""

    rate = 0.5

    def rhs(self, t, y):
        return -self.rate * np.exp(-y)

    def __call__(self, t, y):
        return [-self.rate * np.exp(-y[0])]

    def through_itself(self, t, y):
        return self.rhs(t, y)


def closed_over():
    from numpy import exp

    def helper(x, e=exp):
        return e(-x)

    def again(t, y, n=2):
        return -Damped.rate * helper(y) if n == 0 else again(t, y, n - 1)

    return again


def with_rate(t, y, rate):
    return -rate * np.exp(-y)


@pytest.mark.parametrize("name", ["taylor", "radau", "ida"])
@pytest.mark.parametrize(
    "f",
    [
        Damped().rhs,
        Damped().through_itself,
        Damped(),
        closed_over(),
        partial(with_rate, rate=Damped.rate),
    ],
)
def test_methods_and_closures_are_functions_too(f, name: str):
    """The solution of y' = -exp(-y)/2 is ln(e - t/2)."""
    solution = solve(Problem.from_function(f, [1.0], 1.0), name, 1e-9)
    assert solution.states[-1, 0] == pytest.approx(math.log(math.e - 0.5), abs=1e-7)
