"""The solver by which models look along a run: `polhode` hands it over, and models import none."""

import subprocess
import sys

import numpy as np
import pytest

from polhode.models import path_solver
from polhode.models.problem import Problem
from polhode.solvers import following
from polhode.solvers.following import followed


def rotation(ops):
    return lambda y, p: (-y[1], y[0])


def test_it_is_that_of_the_solvers():
    problem = Problem("circle", rotation, (1.0, 0.0), 3.0)
    times, states = path_solver.solved(problem, 1e-8, 20)
    expected_times, expected_states = followed(problem, 1e-8, 20)
    np.testing.assert_array_equal(times, expected_times)
    np.testing.assert_array_equal(states, expected_states)


def test_models_import_no_solver_until_they_look_along_a_run():
    code = """
import sys
import polhode.models.hybrid.form
assert not [name for name in sys.modules if name.startswith("polhode.solvers")]
"""
    subprocess.run([sys.executable, "-c", code], check=True)


def test_without_one_the_error_says_what_to_call(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(path_solver, "_solver", None)
    with pytest.raises(RuntimeError, match=r"^no path solver: got None, expected one by .*\.use$"):
        path_solver.solved(Problem("circle", rotation, (1.0, 0.0), 3.0), 1e-8, 20)


def test_a_division_by_zero_on_the_way_ends_the_path_there(monkeypatch: pytest.MonkeyPatch):
    # Without machine code Python raises the error.
    monkeypatch.setattr(following, "installed", lambda _: False)

    def ending(ops):
        def rates(y, p):
            if y[0] > 1:
                raise ZeroDivisionError
            return (1 + 0 * y[0],)

        return rates

    times, states = following._followed_by_scipy(Problem("ending", ending, (0.0,), 3.0), 1e-8, 20)
    # Its steps grow tenfold: the next one would pass 1.
    assert 0.1 < times[-1] <= 1
    np.testing.assert_allclose(states[:, 0], times, atol=1e-12)
