"""What is said of a user's problem: a wrong Jacobian, a moved start, a tolerance without meaning."""

import re

import numpy as np
import pytest
from scipy import sparse

from polhode import Problem, WorkPrecision, solve_ivp


def decays(t, y):
    return [-y[0] + y[1], -2 * y[1]]


def on_a_line(t, y):
    return [-y[0] + y[1], y[0] + y[1] - 1]


def raises(t, y):
    raise ZeroDivisionError("no table\nat this time")


WRONG = {
    "shape": (lambda t, y: np.zeros((3, 3)), "got shape (3, 3)"),
    "flat": (lambda t, y: [1.0, 2.0], "got shape (2,)"),
    "nothing": (lambda t, y: None, "got shape ()"),
    "sparse": (lambda t, y: sparse.csc_matrix((2, 3)), "got shape (2, 3)"),
    "words": (lambda t, y: [["a", "b"], ["c", "d"]], "got [['a', 'b'], ['c', 'd']]"),
    "arguments": (lambda t: np.eye(2), "takes 1 positional argument but 2 were given at the start"),
    "raises": (raises, "got ZeroDivisionError: no table at this time at the start"),
}


@pytest.mark.parametrize("name", WRONG)
@pytest.mark.parametrize("method", [None, "radau", "cvode-bdf", "cyrk-bdf"])
def test_a_jacobian_that_is_no_matrix_of_the_right_shape_is_refused_in_a_line(name, method):
    jacobian, got = WRONG[name]
    with pytest.raises(ValueError, match=re.escape(got)) as refusal:
        solve_ivp(decays, (0, 1), [1, 1], method, jac=jacobian)
    words = str(refusal.value)
    assert words.startswith("jacobian: got ")
    assert words.endswith("expected a function (t, y) that returns a matrix of shape (2, 2)")
    assert "\n" not in words


def test_the_same_of_a_study():
    problem = Problem.from_function(decays, [1.0, 1.0], 1.0, jacobian=WRONG["shape"][0])
    with pytest.raises(ValueError, match=r"jacobian: got shape \(3, 3\), expected a function"):
        _ = WorkPrecision(problem, ["radau"], (1e-4,)).frame


@pytest.mark.parametrize("kind", [np.array, sparse.csr_matrix])
def test_a_right_jacobian_is_taken_at_the_users_start_and_with_the_parameters(kind):
    asked = []

    def jacobian(t, y, rate):
        asked.append((t, *y, rate))
        return kind([[-rate, 1.0], [0.0, -2.0]])

    done = solve_ivp(
        lambda t, y, rate: [-rate * y[0] + y[1] + 0 * t, -2 * y[1]],
        (3.0, 2.0),
        [1.0, 4.0],
        "bdf",
        jac=jacobian,
        args=(5.0,),
    )
    assert done.success
    assert asked[0] == (3.0, 1.0, 4.0, 5.0)


@pytest.mark.parametrize("mass", [[1.0, 0.0], [[1.0, 0.0], [0.0, 0.0]]])
def test_a_start_that_the_algebraic_equations_move_is_said_to_be(mass):
    done = solve_ivp(on_a_line, (0, 1), [0.5, 5.0], mass=mass)
    assert done.success
    np.testing.assert_allclose(done.y[:, 0], [0.5, 0.5], atol=1e-6)
    words = "the start was moved to meet the algebraic equations: y[1] from 5 to 0.5"
    assert done.message.endswith(words)
    kept = solve_ivp(on_a_line, (0, 1), [0.5, 0.5], mass=mass)
    assert "moved" not in kept.message


def test_the_table_of_a_study_says_so_too():
    problem = Problem.from_function(on_a_line, [0.5, 5.0], 1.0, mass=[1.0, 0.0])
    (message,) = WorkPrecision(problem, ["ida"], (1e-6,), quiet=True).frame["message"]
    assert message.startswith("the start was moved to meet the algebraic equations: y[1] from 5")


@pytest.mark.parametrize(("rtol", "said"), [(10, "rtol = 10"), (1.0, "rtol = 1"), (0.1, "")])
def test_a_tolerance_that_allows_anything_is_said_to(rtol, said):
    message = solve_ivp(decays, (0, 1), [1, 1], rtol=rtol).message
    words = f"{said} allows errors as large as the solution"
    assert message.endswith(words) if said else "rtol" not in message
