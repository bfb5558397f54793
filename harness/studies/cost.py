"""Costs of one right-hand side, of a first run in a fresh process, and of `solve` beside the bare library call.

A "first run" is one in a process that has neither imported the solver's library nor compiled the form's
equations. It is cold if its cache folder is empty, warm if an earlier process has filled it. A "bare call"
is what the library takes for the same rows, called without this package.
"""

import ctypes
import os
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from math import inf
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter, process_time
from typing import Any

import numpy as np

from polhode.harness import DEFAULT_SAMPLES
from polhode.harness.common.progress import in_steps
from polhode.harness.common.timing import seconds_of
from polhode.harness.common.worker import Worker
from polhode.models.catalogue import form as find_form
from polhode.models.files.cached import CACHE_VARIABLE
from polhode.models.once import once
from polhode.models.problem import Problem
from polhode.models.scenes import named_scene
from polhode.solvers.catalogue import SOLVERS, solver as find_solver
from polhode.solvers.compile import array_callback, c_callback, parameter_array
from polhode.solvers.contract import Backend
from polhode.solvers.machine_code.llvm import compile_file
from polhode.solvers.solve import solve

# Seconds that the calls of a measurement take at least. An estimate: far above the clock's steps, far below a
# second.
_ENOUGH = 2e-3
# Factor from one number of calls to the next, until they take that long. An estimate: with a larger one the
# calls take much longer than they must, with a smaller one more numbers of calls are tried.
_MORE_CALLS = 4
# Measurements of which the best counts, and starts of Python of which the fastest counts. Estimates: what
# disturbs a run can only lengthen it, and seldom disturbs five in a row.
_ROUNDS = 5
STARTS = 5
# Seconds that a first run may take. An estimate: import and compilation take seconds.
_LIMIT = 60.0
# Tolerance of the runs: a middle one of those in the studies.
_TOLERANCE = 1e-8
# Most that `solve` may take beyond a bare call: a share of the bare call, or these seconds if that is more.
# A goal (`Overhead.allowed`); the page of reports/solvers tells who keeps it.
_ALLOWED_SHARE = 0.05
_ALLOWED_SECONDS = 50e-6


def rhs_seconds(problem: Problem, backend: Backend) -> float:
    """Wall time, in seconds, of one right-hand side as solvers call it.

    The back end "compiled" calls it from machine code, the others from Python.
    """
    y = np.array(problem.start)
    parameters = parameter_array(problem)
    out = np.empty_like(y)
    if backend == "compiled":
        callback = c_callback(problem.field, problem.dimension, len(parameters))
        loop = _compiled_loop()
        pointers = [array.ctypes.data for array in (out, y, parameters)]

        def run(calls: int) -> None:
            loop(callback.address, calls, *pointers)
    else:
        evaluate, values = array_callback(problem, backend, parameters)

        def run(calls: int) -> None:
            for _ in range(calls):
                evaluate(y, values, out)

    calls = 1
    best = 0.0
    while best < _ENOUGH:
        calls *= _MORE_CALLS
        best = seconds_of(partial(run, calls))
    return min(best, *(seconds_of(partial(run, calls)) for _ in range(_ROUNDS - 1))) / calls


@once()
def _compiled_loop() -> Any:
    """A loop over any C callback, from the file in LLVM's language beside this module.

    Its arguments are the callback's address, the number of calls, and the addresses of rates, state and
    parameters. No call passes through Python.
    """
    code = compile_file(Path(__file__).with_suffix(".ll"))
    pointer = ctypes.c_void_p
    return code.function(ctypes.CFUNCTYPE(None, pointer, ctypes.c_int64, pointer, pointer, pointer))


@dataclass(frozen=True)
class FirstRun:
    """Seconds of a first run: import and compilation, in processor time that other work hardly lengthens; the run."""

    library: float  # processor time of the import
    compilation: float  # processor time of the compilation
    run: float  # wall time of the integration


def first_run(problem: Problem, solver: str, tolerance: float, cache_folder: str) -> FirstRun:
    """Measure a first run in a fresh process; heyoka keeps compiled code, in the folder."""
    os.environ[CACHE_VARIABLE] = cache_folder
    method = find_solver(solver)
    began = process_time()
    method.load()
    imported = process_time()
    method.prepare(problem, method.settings(tolerance))
    if problem.next_segment:
        # Segments are compiled when a run comes to them.
        solve(problem, solver, tolerance)
    prepared = process_time()
    solution = solve(problem, solver, tolerance)
    return FirstRun(imported - began, prepared - imported, solution.seconds)


def first_runs(
    problem: Problem, solvers: Sequence[str], quiet: bool = True
) -> dict[str, tuple[FirstRun, FirstRun]]:
    """Cold and warm first run of each solver, in fresh processes; without the solvers of which `_fresh` gives None."""
    runs = {}
    for name in in_steps(solvers, "first runs", "solvers", quiet):
        with TemporaryDirectory() as folder:
            # The first run finds the folder empty, the second one filled.
            pair = [_fresh(problem, name, folder) for _ in range(2)]
        if all(pair):
            runs[name] = tuple(pair)
    return runs


def _fresh(problem: Problem, solver: str, folder: str) -> FirstRun | None:
    """A first run in a process of its own; None if it raises, or its process dies or is killed."""
    with Worker() as worker:
        return worker.run(first_run, problem, solver, _TOLERANCE, folder, limit=_LIMIT).value


def startup_seconds() -> float:
    """Wall time, in seconds, of `polhode --help` in a process of its own: the least of `STARTS`."""
    code = "from polhode.harness.cli import main; main(['--help'])"
    start = partial(
        subprocess.run, [sys.executable, "-c", code], check=True, stdout=subprocess.DEVNULL
    )
    return min(seconds_of(start) for _ in range(STARTS))


@dataclass(frozen=True)
class Overhead:
    """Minima, in seconds, of a bare library call and of `solve` for the same rows."""

    solver: str
    bare: float
    solve: float

    @property
    def seconds(self) -> float:
        """Wall time of `solve` beyond the bare library call, in s."""
        return self.solve - self.bare

    @property
    def allowed(self) -> bool:
        """Whether that is no more than the goal (`_ALLOWED_SHARE`, `_ALLOWED_SECONDS`)."""
        return self.seconds <= max(_ALLOWED_SHARE * self.bare, _ALLOWED_SECONDS)


def paper_problem() -> Problem:
    """The built-in scene `paper` in the quaternion form."""
    return find_form("quaternion").problem(named_scene("paper"))


def measure(
    problem: Problem,
    tolerance: float = _TOLERANCE,
    solvers: tuple[str, ...] = tuple(name for name in SOLVERS if name != "exact"),
    samples: int = DEFAULT_SAMPLES,
    seconds: float = 1.0,
    quiet: bool = True,
) -> list[Overhead]:
    """Overheads of solvers whose bare call is known, minima of calls in turns over about `seconds` for each.

    `samples` equispaced rows are asked of both. `exact`, which is no library's, is no default. The default of
    `seconds` is an estimate: many calls of some milliseconds fit into it. Solvers without a known bare call, or
    not installed, are left out.
    """
    times = np.linspace(0.0, problem.end, samples)
    table = []
    for name in in_steps(solvers, "solve beside bare calls", "solvers", quiet):
        method = find_solver(name)
        bare = (
            method.bare_call(problem, method.settings(tolerance), times)
            if method.available
            else None
        )
        if bare is None:
            continue
        # Least seconds of the bare call and of `solve`, which take turns so that a slow moment meets both.
        best = [inf, inf]
        calls = (bare, lambda name=name: solve(problem, name, tolerance, times))
        for call in calls:
            call()
        end = perf_counter() + seconds
        # At least once, however long a call takes.
        while perf_counter() < end or inf in best:
            best = [min(before, seconds_of(call)) for before, call in zip(best, calls, strict=True)]
        table.append(Overhead(name, *best))
    return table
