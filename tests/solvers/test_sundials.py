"""CVODE and IDA in machine code alone: the same runs as through Python's callbacks, and nothing left behind."""

import json
import resource
import sys
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from time import perf_counter, sleep

import numpy as np
import pytest
from hidden import python

from oracle.classical import CLASSICAL
from oracle.runs import Run
from polhode import solve_ivp
from polhode.models.catalogue import form
from polhode.models.operations import Field, Operations
from polhode.models.problem import Problem
from polhode.models.scenes import named_scene
from polhode.solvers.catalogue import solver
from polhode.solvers.contract import SolverNotValidError, Status
from polhode.solvers.solve import solve
from polhode.solvers.sundials import callbacks, compiled, methods
from polhode.solvers.sundials.library import Sundials, _files, load_sundials

NAMES = ["cvode-adams", "cvode-bdf", "ida"]
PROBLEM = Run("triaxial", "quaternion").problem
TIMES = np.linspace(0.0, PROBLEM.end, 41)


@pytest.mark.parametrize("jacobian", ["exact", "difference"])
@pytest.mark.parametrize("name", NAMES)
def test_the_same_steps_as_through_python(name: str, jacobian):
    """Bit for bit, but for IDA, whose residual and Jacobian machine code rounds once instead of twice."""
    one, other = (
        solve(PROBLEM, name, 1e-8, TIMES, backend=backend, jacobian=jacobian, count=True)
        for backend in ("compiled", "numba")
    )
    assert one.states == pytest.approx(other.states, abs=1e-11 if name == "ida" else 0.0)
    for count in ("rhs_calls", "steps", "jacobians"):
        assert getattr(one.work, count) == getattr(other.work, count) > 0


@pytest.mark.parametrize("name", NAMES)
def test_looks_at_the_clock_change_nothing(name: str, monkeypatch: pytest.MonkeyPatch):
    at_once = solve(PROBLEM, name, 1e-8, TIMES, count=True)
    monkeypatch.setattr(compiled, "_CHUNK", 3)
    in_chunks = solve(PROBLEM, name, 1e-8, TIMES, count=True)
    assert np.array_equal(at_once.states, in_chunks.states)
    assert at_once.work == in_chunks.work


def slow(t, y):
    if y[0] > 99:  # A branch on the state: it runs as plain Python.
        return [0.0, 0.0]
    sleep(0.02)
    return [y[1], -y[0]]


def slow_algebraic(t, y):
    rates = slow(t, y)
    return [rates[0], y[1] - y[0]]


@pytest.mark.parametrize("name", NAMES)
def test_slow_right_hand_sides_keep_the_time_limit(name: str):
    began = perf_counter()
    run = solve_ivp(slow, (0, 1000), [1.0, 0.0], name, max_seconds=0.3)
    # Before, a thousand right-hand sides of 20 ms each; imports and a busy machine take some time.
    assert perf_counter() - began < 5.0
    assert "limit of wall time" in run.message


def test_the_time_limit_may_pass_before_initial_values_are_consistent():
    mass = [1.0, 0.0]
    run = solve_ivp(slow_algebraic, (0, 1000), [1.0, 0.0], "ida", mass=mass, max_seconds=0.01)
    assert "limit of wall time" in run.message


def test_rejected_steps_and_factorizations_are_counted():
    work = solve(CLASSICAL["stiff-van-der-pol"].problem, "cvode-bdf", 1e-6).work
    steps, rejected, jacobians, factorizations = (
        count or 0 for count in (work.steps, work.rejected, work.jacobians, work.factorizations)
    )
    # A step that was taken back makes a new matrix, of a Jacobian that may be an old one.
    assert steps > factorizations > jacobians > 0
    assert factorizations >= rejected > 0


CALLS = [0]


def counting_field(ops: Operations) -> Field:
    def rhs(y, p):
        CALLS[0] += 1
        return -1.0 * y[0], y[0] * y[0]

    return rhs


@pytest.mark.parametrize("name", NAMES)
def test_python_takes_no_part(name: str):
    problem = Problem("counting", counting_field, (1.0, 0.0), 5.0)
    solve(problem, name, 1e-8)
    CALLS[0] = 0
    assert solve(problem, name, 1e-8).success
    assert CALLS[0] == 0


def test_all_memory_is_given_back(monkeypatch: pytest.MonkeyPatch):
    """Whatever is made is freed once, after failures too, and a thousand runs leave no trace."""
    called: Counter[str] = Counter()
    call = Sundials.__call__

    def counted(self: Sundials, name: str, *arguments: float) -> int:
        called[name] += 1
        return call(self, name, *arguments)

    monkeypatch.setattr(Sundials, "__call__", counted)
    for name in NAMES:
        solve(PROBLEM, name, 1e-8)
        solve(PROBLEM, name, 1e-17)
    pairs = {
        "N_VMake_Serial": "N_VDestroy",
        "SUNContext_Create": "SUNContext_Free",
        "Create": "Free",
    }
    pairs |= {"SUNDenseMatrix": "SUNMatDestroy", "SUNLinSol_Dense": "SUNLinSolFree"}
    assert all(called[made] == called[freed] >= 6 for made, freed in pairs.items())
    monkeypatch.undo()

    def peak() -> int:
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss

    short = replace(PROBLEM, end=1e-3)
    for _ in range(100):
        solve(short, "ida", 1e-6)
    before = peak()
    for _ in range(1000):
        solve(short, "ida", 1e-6)
    assert peak() - before < 2000, "kB; one run's memory is some 20"


def test_runs_side_by_side():
    alone = [
        solve(PROBLEM, name, tolerance, TIMES).states
        for name in NAMES
        for tolerance in (1e-5, 1e-9)
    ]
    with ThreadPoolExecutor(4) as pool:
        runs = [
            pool.submit(solve, PROBLEM, name, each, TIMES)
            for name in NAMES
            for each in (1e-5, 1e-9)
        ] * 5
        assert all(
            np.array_equal(run.result().states, alone[i % len(alone)]) for i, run in enumerate(runs)
        )


def test_runs_side_by_side_through_python_give_standard_output_back():
    before = sys.stdout
    with ThreadPoolExecutor(4) as pool:
        problems = [replace(PROBLEM, end=PROBLEM.end / (1 + i)) for i in range(4)]
        runs = [pool.submit(solve, each, "cvode-bdf", 1e-6, backend="python") for each in problems]
        assert all(run.result().success for run in runs)
    assert sys.stdout is before


def test_input_that_the_library_refuses_is_no_state_that_is_not_finite():
    solution = solve(
        Problem("short", lambda ops: lambda y, p: (3.0,), (0.0,), 1e-300), "cvode-bdf", 1e-6
    )
    assert (solution.status, solution.message) == (Status.CRASHED, "illegal input at t = 0.0")


def square(ops: Operations) -> Field:
    return lambda y, p: (y[0] * y[0],)


@pytest.mark.parametrize("name", NAMES)
def test_a_stall_ends_without_a_word(name: str, capfd: pytest.CaptureFixture[str]):
    """Before t = 1, where the solution is infinite, steps no longer advance the time, which the library warns of."""
    solution = solve(Problem("blow-up", square, (1.0,), 2.0), name, 1e-4, max_seconds=20.0)
    assert (solution.status, solution.message[:19]) == (
        Status.STEP_UNDERFLOW,
        "stalled at t = 0.99",
    )
    assert tuple(capfd.readouterr()) == ("", "")


@pytest.mark.parametrize("name", NAMES)
def test_differences_of_a_jacobian_of_many_components_are_no_stall(
    name: str, monkeypatch: pytest.MonkeyPatch
):
    """They take a right-hand side for each component, all at one time: more than between two looks."""
    monkeypatch.setattr(callbacks, "_LOOK", 20)
    rates = np.linspace(1.0, 1000.0, 100)
    problem = Problem.from_function(lambda t, y: -rates * y, np.ones(100), 0.01)
    solution = solve(problem, name, 1e-6)
    assert solution.success, solution.message
    assert solution.states[-1] == pytest.approx(np.exp(-0.01 * rates), abs=1e-5)


def steep(ops: Operations) -> Field:
    return lambda y, p: (1 / ops.sqrt(1 - y[1]), 1.0)


@pytest.mark.parametrize("name", NAMES)
def test_steps_that_move_the_time_by_less_than_its_spacing_are_a_stall(name: str):
    """Beyond t = 1, where the rate is infinite and then no number, a million steps advance it by 1e-11."""
    solution = solve(Problem("steep", steep, (10.0, 0.0), 10.0), name, 1e-2, max_seconds=20.0)
    assert (solution.status, solution.message[:15]) == (Status.STEP_UNDERFLOW, "stalled at t = ")


def test_a_library_unknown_is_left_alone(monkeypatch: pytest.MonkeyPatch):
    for prefix in ("CVode", "IDA"):
        assert load_sundials(prefix) is not None
        assert load_sundials.__wrapped__(f"{prefix}S") is None
    monkeypatch.setattr("polhode.solvers.sundials.library.MAJOR", 8)
    assert load_sundials.__wrapped__("CVode") is None


SECOND_SOURCE = """
import json
from pathlib import Path
from polhode.models.catalogue import form
from polhode.models.scenes import named_scene
from polhode.solvers.catalogue import solver
from polhode.solvers.solve import solve

problem = form("quaternion").problem(named_scene("paper"))
runs = {name: solve(problem, name, 1e-6) for name in ("cvode-bdf", "cvode-adams")}
refused = ""
try:
    solve(problem, "cvode-bdf", 1e-6, backend="python")
except ValueError as error:
    refused = str(error)
print(json.dumps({
    "states": {name: run.states[-1].tolist() for name, run in runs.items()},
    "backends": [run.settings.backend for run in runs.values()],
    "ida": solver("ida").why_not,
    "note": solver("cvode-bdf").note,
    "refused": refused,
}))
"""


def test_libraries_of_sundials4py_serve_where_scikit_sundae_is_missing(tmp_path: Path):
    """A module of that name, which holds CVODE alone here; both wheels export the same C functions."""
    library = _files("sundials_cvode[-.]*")[0]
    (tmp_path / "sundials4py.so").symlink_to(library)
    # Beside it, the libraries that it is linked with.
    for file in library.parent.iterdir():
        (tmp_path / file.name).symlink_to(file)
    words = f"import sys\nsys.path.append('.')\n{SECOND_SOURCE}"
    done = python("sksundae", tmp_path, "-c", words)
    assert done.returncode == 0, done.stderr
    said = json.loads(done.stdout)
    problem = form("quaternion").problem(named_scene("paper"))
    for name, states in said["states"].items():
        assert states == solve(problem, name, 1e-6).states[-1].tolist()
    assert said["backends"] == ["compiled", "compiled"]
    assert said["ida"] == "scikit-sundae is not installed: pip install scikit-sundae"
    assert said["note"].startswith("available, by sundials4py")
    assert said["refused"].startswith("backend: got 'python', expected 'sksundae' installed")


def test_a_library_that_does_not_tell_its_version_has_that_of_sundials4py(
    monkeypatch: pytest.MonkeyPatch,
):
    monkeypatch.setattr(Sundials, "knows", lambda self, name: False)
    for version, loads in (("7.9.0", True), ("8.0.0", False), (None, False)):
        versions = {"sundials4py": version}
        monkeypatch.setattr("polhode.solvers.sundials.library.version_of", versions.get)
        assert (load_sundials.__wrapped__("CVode") is not None) is loads


@pytest.mark.parametrize("name", NAMES)
def test_without_the_libraries_python_calls(name: str, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(methods, "load_sundials", lambda prefix: None)
    assert solve(PROBLEM, name, 1e-6).settings.backend == "numba"
    assert "no C libraries found" in str(solver(name).note)
    with pytest.raises(
        SolverNotValidError, match="backend: got 'compiled', expected SUNDIALS' C libraries"
    ):
        solve(PROBLEM, name, 1e-6, backend="compiled")
