"""References of any problem without heyoka: their stated uncertainty holds the true error."""

import numpy as np
import pytest

from polhode.harness.references import any_problem
from polhode.harness.references.any_problem import reference_of
from polhode.harness.references.extended import ReferenceFailedError
from polhode.models.problem import Problem
from polhode.solvers.solve import solve


def oscillator(t, y):
    return [y[1], -y[0]]


def decay(t, y):
    return [-y[0]]


def deviation(states: np.ndarray, exact: np.ndarray) -> float:
    return float((np.abs(states - exact).max(axis=0) / np.abs(exact).max(axis=0)).max())


@pytest.mark.parametrize(
    ("function", "start", "end", "solution"),
    [
        (oscillator, [1.0, 0.0], 10.0, np.cos),
        # 10,000 steps of the same length: all runs share the rounding of the time.
        (oscillator, [1.0, 0.0], 100.0, np.cos),
        (decay, [1.0], 10.0, lambda t: np.exp(-t)),
    ],
)
def test_uncertainty_of_unlike_runs_holds_the_true_error(
    function, start, end, solution, monkeypatch: pytest.MonkeyPatch
):
    def no_taylor(*_):
        raise ReferenceFailedError("as without heyoka")

    monkeypatch.setattr(any_problem, "_by_taylor", no_taylor)
    times = np.linspace(0.0, end, 11)
    problem = Problem.from_function(function, start, end)
    known = reference_of(problem, times, deviation, 10.0)
    error = np.abs(known.states[:, 0] - solution(times)).max()
    assert 0 < error <= known.uncertainty < 1e-9


def test_the_witness_compiles_a_recorded_function_once(monkeypatch: pytest.MonkeyPatch):
    """Machine code is cached by the field: segments with equal fields share it."""
    fields = set()

    def noting(segment, *arguments, **named):
        fields.add(segment.field)
        return solve(segment, *arguments, **named)

    monkeypatch.setattr(any_problem, "solve", noting)
    problem = Problem.from_function(oscillator, [1.0, 0.0], 10.0)
    reference_of(problem, np.linspace(0.0, 10.0, 11), deviation, 10.0)
    assert fields == {problem.field}
