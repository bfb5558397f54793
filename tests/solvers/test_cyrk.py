"""CyRK's C functions without its package's import of numba, and the package all the same for whoever wants it."""

import platform
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from polhode.models.problem import Problem
from polhode.solvers.catalogue import SOLVERS
from polhode.solvers.contract import Status
from polhode.solvers.cyrk import followed
from polhode.solvers.solve import solve

PROGRAM = """
import sys
import polhode.solvers.cyrk as library
from polhode.models.problem import Problem
from polhode.solvers.solve import solve
KNOWN = {known!r}
library.KNOWN = KNOWN or library.KNOWN
problem = Problem("decay", lambda ops: lambda y, p: (-1.0 * y[0],), (1.0,), 1.0)
print(solve(problem, "cyrk-vern8", 1e-9).states[-1, 0], "numba" in sys.modules)
import CyRK
print(CyRK.__version__, callable(CyRK.pysolve_ivp), "numba" in sys.modules)
from CyRK.nb.numba_solver import nbsolve2_ivp
print(solve(problem, "cyrk-radau", 1e-9).states[-1, 0])
"""


@pytest.mark.parametrize("known", [(), ("unknown",)])
def test_the_package_runs_when_it_is_asked_for(known: tuple[str, ...]):
    program = [sys.executable, "-c", PROGRAM.format(known=known)]
    first, second, third = subprocess.run(
        program, capture_output=True, text=True, check=True
    ).stdout.splitlines()
    assert float(first.split()[0]) == pytest.approx(0.36787944117144233, abs=1e-9)
    assert first.split()[1] == str(bool(known)), (
        "the package's own bridge to versions unknown imports numba"
    )
    assert second.split()[1:] == ["True", "True"]
    assert float(third) == pytest.approx(0.36787944117144233, abs=1e-8)


def test_a_solution_is_followed_at_the_pace_of_its_steps_and_as_far_as_it_goes():
    """To a pole: y' = y² has the solution 1/(1 - t)."""
    problem = Problem("pole", lambda ops: lambda y, p: (y[0] * y[0],), (1.0,), 2.0)
    times, states = followed(problem, 1e-9, 1000)
    assert len(times) == pytest.approx(1000, abs=5)
    assert times[-1] == pytest.approx(1, abs=1e-6)
    early = times < 0.9
    assert states[early, 0] == pytest.approx(1 / (1 - times[early]), rel=1e-6)
    assert np.all(np.diff(times) > 0)
    assert np.diff(times[early])[-1] < 0.5 * (times[1] - times[0])


def test_a_start_without_rates_ends_at_once():
    problem = Problem("root", lambda ops: lambda y, p: (-ops.sqrt(y[0]),), (-1.0,), 2.0)
    assert solve(problem, "cyrk-vern8", 1e-9).status is Status.NON_FINITE
    assert followed(problem, 1e-9, 100)[0].tolist() == [0.0]


@pytest.mark.parametrize("name", [name for name in SOLVERS if name.startswith("cyrk-")])
def test_a_start_of_which_the_library_has_no_norm_ends_at_once(name: str):
    """LSODA has a norm of its own, and the others one of larger rates where the state is as large."""
    problem = Problem("oscillator", lambda ops: lambda y, p: (y[1], -1.0 * y[0]), (1.0, 0.0), 2.0)
    ends = [
        solve(replace(problem, start=(y0, 0.0)), name, 1e-6).status for y0 in (1e148, 1e149, 1e300)
    ]
    beyond = (
        (Status.REACHED_END, Status.STEP_UNDERFLOW)
        if name == "cyrk-lsoda"
        else [Status.NON_FINITE] * 2
    )
    assert ends == [Status.REACHED_END, *beyond]


@pytest.mark.skipif(
    platform.machine() not in ("x86_64", "AMD64"), reason="nothing is flushed to zero elsewhere"
)
def test_rates_at_the_start_are_those_that_the_library_sees():
    """The square of 1e-160 is no longer there where underflow is flushed to zero."""
    problem = Problem(
        "tiny", lambda ops: lambda y, p: (y[0] / ops.sqrt(y[0] * y[0]),), (1e-160,), 2.0
    )
    assert solve(problem, "cyrk-vern8", 1e-9).status is Status.NON_FINITE
    assert followed(problem, 1e-9, 100)[0].tolist() == [0.0]
