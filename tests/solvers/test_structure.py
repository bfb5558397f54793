"""Jacobians, patterns and bands that users know: as exact as without, and without full matrices."""

from functools import cache
from time import perf_counter, sleep

import numpy as np
import pytest
from scipy import sparse
from scipy.integrate import solve_ivp as scipys

from polhode import Problem, solve_ivp
from polhode.models.own_function import MAX_EXACT_JACOBIAN, MAX_RECORDED
from polhode.solvers.solve import solve

SUNDIALS = ["cvode-adams", "cvode-bdf", "ida"]
IMPLICIT = ["radau", "bdf", "lsoda", *SUNDIALS]


@cache
def heat(n):
    """The heat equation on n points, its Jacobian, and its pattern."""
    second = sparse.diags([1.0, -2.0, 1.0], [-1, 0, 1], shape=(n, n), format="csc") * (n + 1) ** 2
    source = np.linspace(0, 1, n)

    def rates(t, y):
        padded = np.concatenate([[0.0], y, [0.0]])
        return (n + 1) ** 2 * (padded[2:] - 2 * y + padded[:-2]) + np.cos(t) * source - y**3

    def jacobian(t, y):
        return second - sparse.diags(3 * y**2)

    return rates, np.sin(np.pi * np.arange(1, n + 1) / (n + 1)), jacobian, abs(second) > 0


def known(n):
    *_, jacobian, pattern = heat(n)
    return {
        "sparse pattern": {"jac_sparsity": pattern},
        "full pattern": {"jac_sparsity": pattern.toarray()},
        "bands": {"lband": 1, "uband": 1},
        "sparse Jacobian": {"jacobian": jacobian},
        "full Jacobian": {"jac": lambda t, y: jacobian(t, y).toarray()},
        "both": {"jacobian": jacobian, "jac_sparsity": pattern},
        "both bands": {"jacobian": jacobian, "lband": 1, "uband": 1},
        "wide pattern": {"jac_sparsity": pattern + sparse.eye(n, k=n - 1)},
        "wide and Jacobian": {"jacobian": jacobian, "jac_sparsity": pattern + sparse.eye(n, k=9)},
        "nothing": {},
    }


@cache
def exact_end(n):
    """The heat equation's last row, by SciPy's BDF."""
    rates, start, _, pattern = heat(n)
    # It subtracts entries of an array that it has not filled.
    with np.errstate(invalid="ignore", over="ignore"):
        exact = scipys(rates, (0, 0.2), start, "BDF", jac_sparsity=pattern, rtol=1e-8, atol=1e-9)
    return exact.y[:, -1]


@pytest.mark.parametrize("n", [30, 210])
@pytest.mark.parametrize("what", known(12))
@pytest.mark.parametrize("name", [None, *IMPLICIT])
def test_what_is_known_of_a_jacobian_changes_no_solution(name, what, n):
    rates, start, *_ = heat(n)
    if name is None and what == "nothing":
        pytest.skip("an explicit method")
    for t_eval in (None, [0.1, 0.2]):
        run = solve_ivp(rates, (0, 0.2), start, name, t_eval, **known(n)[what])
        assert run.success
        assert run.y[:, -1] == pytest.approx(exact_end(n), abs=2e-4)
        if what not in ("nothing", "wide pattern"):
            assert run.nfev < 2500


def plain(rates):
    """The same rates as plain Python, by a branch on the state; and the number of their calls."""
    calls = [0]

    def branching(t, y):
        calls[0] += 1
        return y if y[0] > 1e99 else rates(t, y)

    return branching, calls


@pytest.mark.parametrize("name", SUNDIALS)
def test_right_hand_sides_for_differences_are_counted(name):
    rates, start, *_ = heat(60)
    branching, calls = plain(rates)
    pattern = known(60)["wide pattern"]["jac_sparsity"]
    problem = Problem.from_function(branching, start, 0.2, jac_sparsity=pattern)
    calls[0] = 0
    work = solve(problem, name, 1e-6).work
    assert work.jacobians > 0
    # IDA asks once more, for the rates at the start.
    assert work.rhs_calls == calls[0] - (name == "ida")


# Every fourth component depends on all of its kind: no bands, and 60 groups of columns.
GROUPED = np.kron(np.ones((60, 60)), np.eye(4))


def test_differences_end_at_the_time_limit():
    late = []
    began = perf_counter()

    def slow(t, y):
        late.append(perf_counter() > began + 1.0)
        # The first Jacobian is fast: a run may end after it. IDA takes most calls for Jacobians.
        if len(late) > 70:
            sleep(0.02)
        return y if y[0] > 1e99 else -y

    run = solve_ivp(slow, (0, 1), np.ones(240), "ida", jac_sparsity=GROUPED, max_seconds=0.9)
    assert "limit of wall time" in run.message
    assert sum(late) < 10


@pytest.mark.parametrize("name", SUNDIALS)
def test_no_run_ends_before_its_first_factorization(name):
    """The process would crash where the library frees what it has not made."""

    def slow(t, y):
        sleep(0.001)
        return y if y[0] > 1e99 else -y

    run = solve_ivp(slow, (0, 1), np.ones(240), name, jac_sparsity=GROUPED, max_seconds=0.001)
    assert "limit of wall time" in run.message
    # A Jacobian takes 61.
    assert run.nfev > 61


@pytest.mark.parametrize("n", [30, 60])
def test_differences_about_0_serve_as_well_as_the_exact_jacobian(n):
    rates, start, jacobian, _ = heat(n)
    pattern = known(n)["wide pattern"]["jac_sparsity"]
    steps = []
    for given in ({}, {"jacobian": jacobian}):
        problem = Problem.from_function(
            plain(rates)[0], 0 * start, 0.2, jac_sparsity=pattern, **given
        )
        steps.append(solve(problem, "cvode-bdf", 1e-6, count=True).work.steps)
    # Before, 62 and 53 of 30 components, 76 and 57 of 60.
    assert steps[0] <= 1.05 * steps[1]


@pytest.mark.parametrize("name", SUNDIALS)
def test_differences_of_a_function_that_returns_the_same_array(name):
    rates, start, *_ = heat(60)
    rows = np.empty(60)

    def filling(t, y):
        rows[:] = rates(t, y)
        return rows

    branching, calls = plain(filling)
    pattern = known(60)["wide pattern"]["jac_sparsity"]
    assert solve_ivp(branching, (0, 0.2), start, name, jac_sparsity=pattern).success
    # Before, all differences were 0, and runs took thousands of right-hand sides.
    assert calls[0] < 500


@pytest.mark.parametrize("name", IMPLICIT)
def test_a_jacobian_is_called_backwards_too(name):
    calls = []

    def jacobian(t, y, a):
        calls.append(t)
        return np.array([[0.0, 1.0], [-a - 3 * y[0] ** 2, 0.0]])

    def rates(t, y, a):
        return [y[1], -a * y[0] - y[0] ** 3]

    there = scipys(rates, (1, 3), [1.0, 0.0], rtol=1e-11, atol=1e-11, args=(2.0,)).y[:, -1]
    run = solve_ivp(rates, (3, 1), there, name, args=[2.0], jacobian=jacobian, rtol=1e-7)
    assert run.y[:, -1] == pytest.approx([1.0, 0.0], abs=1e-3)
    if name != "lsoda":
        assert calls
    assert all(1 <= t <= 3 for t in calls)


def test_beyond_a_size_nothing_is_compiled_entry_by_entry():
    rates, start, *_ = heat(MAX_EXACT_JACOBIAN + 10)
    problem = Problem.from_function(rates, start, 0.1)
    assert not problem.plain
    for name in ("radau", "cvode-bdf"):
        run = solve(problem, name, 1e-4)
        assert (run.success, run.settings.backend, run.settings.jacobian) == (
            True,
            "python",
            "difference",
        )
    rates, start, *_ = heat(MAX_RECORDED + 1)
    with pytest.raises(ValueError, match=rf"^solver 'taylor': rates has {MAX_RECORDED + 1} comp"):
        solve_ivp(rates, (0, 0.1), start, "taylor")


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"jac_sparsity": np.ones(3)}, r"^jac_sparsity: got shape \(3,\), expected \(2, 2\)"),
        ({"jacobian": "exact"}, "^jacobian: got 'exact', expected a matrix of shape"),
        ({"lband": -1}, "^lband: got -1, expected a whole number from 0 to 1"),
        ({"uband": 2}, "^uband: got 2, expected a whole number from 0 to 1"),
    ],
)
def test_what_is_no_structure_is_refused(given, words):
    with pytest.raises(ValueError, match=words):
        solve_ivp(lambda t, y: -y, (0, 1), [1.0, 2.0], **given)
