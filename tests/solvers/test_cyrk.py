"""CyRK's C functions without its package's import of numba, and the package all the same for whoever wants it."""

import platform
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from polhode import solve_ivp
from polhode.models.catalogue import form
from polhode.models.problem import Problem
from polhode.models.scene import Ellipsoid, Scene
from polhode.models.scenes import PAPER_START
from polhode.solvers.catalogue import SOLVERS, solver as find_solver
from polhode.solvers.contract import Status
from polhode.solvers.cyrk import entry_with_jacobian, followed
from polhode.solvers.solve import solve

needs_the_entry = pytest.mark.skipif(
    entry_with_jacobian() is None, reason="no C++ entry of CyRK found"
)

PROGRAM = """
import sys
import polhode.solvers.cyrk as library
from polhode.models.problem import Problem
from polhode.solvers.solve import solve
known = {known!r}
library._KNOWN = known or library._KNOWN
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


def _stiff_spheroid(stokes: float) -> Problem:
    scene = Scene(Ellipsoid((1.0, 1.0, 2.0)), stokes, PAPER_START, 20.0)
    return form("spheroid-axis").problem(scene)


@needs_the_entry
@pytest.mark.parametrize("stokes", [1e-4, 1e-8])
@pytest.mark.parametrize("tolerance", [1e-6, 1e-8, 1e-9])
def test_radau_takes_the_steps_of_scipys(stokes: float, tolerance: float):
    problem = _stiff_spheroid(stokes)
    found = solve(problem, "cyrk-radau", tolerance)
    assert found.success
    # SciPy's Radau takes 159 to 857 steps, with the same exact Jacobian.
    steps = {1e-6: 160, 1e-8: 485, 1e-9: 855}[tolerance]
    assert found.work.steps == pytest.approx(steps, rel=0.05)


@needs_the_entry
@pytest.mark.parametrize("name", ["cyrk-radau", "cyrk-bdf", "cyrk-lsoda"])
def test_an_exact_jacobian_changes_a_run_by_its_error_alone(name: str):
    problem = _stiff_spheroid(1e-2)
    exact, differenced = (
        solve(problem, name, 1e-7, jacobian=jacobian).states[-1]
        for jacobian in ("exact", "difference")
    )
    assert exact == pytest.approx(differenced, abs=1e-4)
    assert np.any(exact != differenced)


@needs_the_entry
def test_a_jacobian_is_in_use_between_segments_and_with_events():
    """Vectors of C++ hold no memory of the library's: runs in many calls end as one does."""
    problem = _stiff_spheroid(1e-3)
    times = np.linspace(0.0, problem.end, 2001)
    assert solve(problem, "cyrk-radau", 1e-8, times, count=True).work.rhs_calls
    runs = [solve(problem, "cyrk-radau", 1e-8, times).states for _ in range(20)]
    assert all(np.array_equal(run, runs[0]) for run in runs)


def test_without_the_entry_the_library_differences(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("polhode.solvers.cyrk.entry_with_jacobian", lambda: None)
    method = find_solver("cyrk-radau")
    assert method.settings(1e-6).jacobian == "difference"
    assert method.note == "available, Jacobian by finite differences: no C++ entry found"
    with pytest.raises(ValueError, match="jacobian: got 'exact', expected CyRK's C\\+\\+ entry"):
        method.settings(1e-6, jacobian="exact")
    assert solve(_stiff_spheroid(1e-2), method, 1e-5).success
    assert find_solver("cyrk-vern8").note is None


@needs_the_entry
@pytest.mark.parametrize("name", ["cyrk-radau", "cyrk-bdf", "cyrk-lsoda"])
def test_the_list_of_solvers_says_which_way_the_jacobian_goes(name):
    method = find_solver(name)
    assert method.note == "available, exact Jacobian through the C++ entry"
    assert method.settings(1e-6).jacobian == "exact"


@needs_the_entry
@pytest.mark.parametrize("name", ["cyrk-radau", "cyrk-bdf", "cyrk-lsoda"])
def test_a_jacobian_without_numbers_stops_no_run(name: str):
    """The derivative of |y| at 0 is no number, the rates are; y[1] = 1 - exp(-t)."""

    def rates(t: float, y: np.ndarray) -> list[object]:
        return [np.sqrt(y[0] ** 2 + y[1] ** 2) + 1 - y[0], 1 - y[1]]

    result = solve_ivp(rates, (0.0, 1.0), [0.0, 0.0], name, rtol=1e-8, max_seconds=20.0)
    assert result.success
    assert result.y[1, -1] == pytest.approx(1 - np.exp(-1.0), abs=1e-6)
    other = solve_ivp(rates, (0.0, 1.0), [0.0, 0.0], "dop853", rtol=1e-10)
    assert result.y[0, -1] == pytest.approx(other.y[0, -1], abs=1e-6)
