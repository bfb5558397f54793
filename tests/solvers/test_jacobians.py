"""Exact Jacobians against central differences in forty digits and heyoka's, of all forms and classical problems."""

import mpmath
import numpy as np
import pytest

from oracle.classical import CLASSICAL
from oracle.runs import runs
from polhode.models.operations import Field, Operations
from polhode.models.problem import Problem
from polhode.solvers.compile import exact_jacobian, load_heyoka, traced_system


def every_operation(ops: Operations) -> Field:
    sin, cos, sqrt, where_positive = ops.sin, ops.cos, ops.sqrt, ops.where_positive
    exp, log = ops.exp, ops.log

    def rhs(y, p):
        a, b, c = y
        return (
            3 - (a - 2) + (1 - b) - a / c + 2 / b - (+c) / 7 + p[0] * b**0 + 0 * sin(p[0]),
            exp(a) * log(c)
            + where_positive(a - b, a * b, 1.5)
            + where_positive(b - a, p[0], sqrt(c) / a)
            + cos(-b * a) * p[0] ** 2,
            a**2
            + b**-3
            + c**0.5
            + c**17
            + a**b
            + p[0] ** c
            + 1.7**b
            + where_positive(1.0, sin(c), c)
            + sqrt(2.0),
        )

    return rhs


PROBLEMS = {str(run): run.problem for run in runs()} | {
    name: each.problem for name, each in CLASSICAL.items()
}
PROBLEMS["every operation"] = Problem(
    "every operation", every_operation, (0.7, 0.4, 0.9), 1.0, (1.2,)
)
CONTEXT = mpmath.MPContext()
CONTEXT.dps = 40
MPMATH = Operations(
    CONTEXT.sin,
    CONTEXT.cos,
    CONTEXT.sqrt,
    lambda x, a, b: a if x > 0 else b,
    exp=CONTEXT.exp,
    log=CONTEXT.log,
)
STEP = CONTEXT.mpf("1e-13")


def differences(problem: Problem, state: list, parameters: list) -> np.ndarray:
    """∂f_i/∂y_j by central differences, whose error is of the order of 1e-26."""
    field = problem.field(MPMATH)

    def moved(j, by):
        return field([y + by if i == j else y for i, y in enumerate(state)], parameters)

    columns = [
        [(up - down) / (2 * STEP) for up, down in zip(moved(j, STEP), moved(j, -STEP), strict=True)]
        for j in range(len(state))
    ]
    return np.array(columns, dtype=float).T


@pytest.mark.parametrize("name", PROBLEMS)
def test_exact_jacobian(name: str):
    problem = PROBLEMS[name]
    parameters = problem.parameters or ()
    # Off the start, where terms vanish by chance.
    shift = 1e-3 * np.cos(np.arange(problem.dimension))
    state = np.array(problem.start) + shift
    exact = exact_jacobian(problem.field, problem.dimension, len(parameters))(
        state, np.array(parameters)
    )
    expected = differences(
        problem, [CONTEXT.mpf(y) for y in state], [CONTEXT.mpf(p) for p in parameters]
    )
    assert np.abs(exact - expected).max() <= 1e-11 * np.abs(expected).max()


@pytest.mark.parametrize(
    "name", ["triaxial-quaternion", "prolate-spheroid-axis", "stiff-van-der-pol"]
)
def test_exact_jacobian_is_that_of_heyoka(name: str):
    problem, heyoka = PROBLEMS[name], load_heyoka()
    d, p = problem.dimension, np.array(problem.parameters)
    system = traced_system(problem.field, d, len(p))
    variables = [variable for variable, _ in system]
    tensors = heyoka.diff_tensors([rate for _, rate in system], diff_args=variables, diff_order=1)
    state = np.array(problem.start) + 0.01
    expected = heyoka.cfunc(list(tensors.jacobian.ravel()), variables)(state, pars=p).reshape(d, d)
    assert exact_jacobian(problem.field, d, len(p))(state, p) == pytest.approx(
        expected, rel=1e-14, abs=1e-15
    )
