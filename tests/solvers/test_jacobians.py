"""Exact Jacobians against central differences in forty digits, for the fields of all forms and classical problems."""

import mpmath
import numpy as np
import pytest

from oracle.classical import CLASSICAL
from oracle.runs import runs
from polhode.models.operations import Operations
from polhode.models.problem import Problem
from polhode.solvers.compile import exact_jacobian

PROBLEMS = {str(run): run.problem for run in runs()} | {name: each.problem for name, each in CLASSICAL.items()}
CONTEXT = mpmath.MPContext()
CONTEXT.dps = 40
MPMATH = Operations(CONTEXT.sin, CONTEXT.cos, CONTEXT.sqrt, lambda x, a, b: a if x > 0 else b)
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
    exact = exact_jacobian(problem.field, problem.dimension, len(parameters))(state, np.array(parameters))
    expected = differences(problem, [CONTEXT.mpf(y) for y in state], [CONTEXT.mpf(p) for p in parameters])
    assert np.abs(exact - expected).max() <= 1e-11 * np.abs(expected).max()
