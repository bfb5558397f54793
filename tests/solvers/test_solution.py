"""What a solution says of itself."""

import pickle
from dataclasses import replace

import numpy as np
import pytest

from oracle.accepting import takes
from oracle.classical import CLASSICAL
from oracle.runs import Run, runs
from polhode.solvers.catalogue import SOLVERS
from polhode.solvers.solve import solve

PROBLEM = CLASSICAL["rigid-body"].problem


def test_a_solution_prints_in_a_few_lines_whatever_its_length():
    times = np.linspace(0.0, PROBLEM.end, 5001)
    solution = solve(PROBLEM, "dop853", 1e-7, times, count=True)
    lines = str(solution).splitlines()
    assert len(lines) == 7
    assert max(map(len, lines)) < 120
    facts = dict(line.strip().split(": ", 1) for line in lines[1:])
    assert facts["status"] == "reached_end"
    assert facts["rows"] == f"5001, t = 0 to {PROBLEM.end:g}"
    assert facts["solver"] == "dop853 at tolerance 1e-07, numba"
    assert f"{solution.work.rhs_calls} rhs_calls, {solution.work.steps} steps" in facts["work"]
    assert repr(pickle.loads(pickle.dumps(solution))) == repr(solution)


def test_a_failure_prints_its_reason():
    solution = solve(PROBLEM, "taylor", 1e-9, max_steps=3)
    assert "  status: step_limit: 3 steps" in str(solution).splitlines()
    # heyoka reports neither right-hand sides nor rejections.
    assert "  work: 3 steps" in str(solution).splitlines()


def test_a_solution_without_rows_has_none_at_other_times():
    solution = solve(replace(PROBLEM, start=(np.nan,) * PROBLEM.dimension), "taylor", 1e-9)
    with pytest.raises(
        ValueError,
        match=r"t: got array\(\[0.5\]\), expected a solution with rows, not .* non_finite$",
    ):
        solution(0.5)


@pytest.mark.parametrize("name", list(SOLVERS))
def test_a_success_has_no_message(name: str):
    problems = PROBLEM, Run("prolate", "spheroid-axis").problem, runs(closed=True)[0].problem
    problem = next(each for each in problems if takes(name, each))
    assert solve(problem, name, 1e-5).message == ""
