"""Work and accuracy of one's own equation, as tests: ``pytest docs/examples/benchmarks``.

``pytest --polhode-update-counts`` stores the counts in work_counts.json, beside this file.
"""

import pytest

from polhode import Problem


def brusselator(t, y, a=1.0, b=3.0):
    u, v = y
    return a + u * u * v - (b + 1.0) * u, b * u - u * u * v


PROBLEM = Problem.from_function(brusselator, [1.5, 3.0], 20.0)


@pytest.mark.parametrize("solver", ["cyrk-vern8", "taylor", "cvode-bdf"])
def test_work_and_accuracy(work_precision, solver):
    run = work_precision(PROBLEM, solver, 1e-8)
    assert run.status == "reached_end"
    assert run.error < 1e-4
    assert run.grown == {}
