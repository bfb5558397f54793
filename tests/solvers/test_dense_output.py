"""Rows at requested times: they leave the steps alone, and are as accurate as the steps."""

from dataclasses import replace

import numpy as np
import pytest

from oracle.accepting import accepting
from oracle.classical import CLASSICAL
from polhode.models.catalogue import form
from polhode.models.scenes import named_scene
from polhode.solvers.solve import solve

RIGID_BODY = CLASSICAL["rigid-body"].problem
INTEGRATORS = accepting(RIGID_BODY)
# The first requested time, from which CVODE guesses its first step, is the same.
FEW = np.array([0.0, 0.5, 20.0])
MANY = np.concatenate([[0.0], np.arange(0.5, 20.0, 0.013), [20.0]])
TOLERANCE = 1e-6


@pytest.mark.parametrize("name", INTEGRATORS)
def test_requested_times_do_not_change_the_steps(name: str):
    few, many = (solve(RIGID_BODY, name, TOLERANCE, times, count=True) for times in (FEW, MANY))
    assert few.work.steps == many.work.steps
    # SciPy's interpolants round differently with the number of times.
    assert few.states[[1, 2]] == pytest.approx(many.states[[1, -1]], abs=1e-14)


@pytest.mark.parametrize("name", INTEGRATORS)
def test_interpolated_rows_are_as_accurate_as_steps(name: str):
    """A run that ends at a time has a step there: its error is the steps', that of a row there is the row's."""
    ends = MANY[200::100]
    exact = solve(RIGID_BODY, "taylor", 1e-15, MANY).states
    rows = np.abs(solve(RIGID_BODY, name, TOLERANCE, MANY).states - exact).max(axis=1)
    steps = [
        np.abs(
            solve(replace(RIGID_BODY, end=end), name, TOLERANCE, np.array([0.0, 0.5, end])).states[
                -1
            ]
            - state
        ).max()
        for end, state in zip(ends, exact[200::100], strict=True)
    ]
    assert rows.max() <= 3 * max(steps)


def test_the_drift_of_a_run_is_none_of_what_goes_on_from_its_rows():
    """The invariant is that of the whole run: few steps from a row would be allowed less than the row has drifted."""
    problem = form("quaternion").problem(named_scene("spheroid"))
    solution = solve(problem, "cyrk-bdf", 1e-3, np.linspace(0.0, problem.end, 11))
    assert problem.invariant is not None
    assert np.abs(problem.invariant(solution.states)).max() > 0.5
    assert solution(430.0).states.shape == (1, problem.dimension)
