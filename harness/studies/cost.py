"""What one right-hand side costs, and what the first run costs that later ones do not."""

import ctypes
import os
import subprocess
import sys
import time
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from polhode.harness.common.timing import seconds_of
from polhode.models.problem import Problem
from polhode.solvers.catalogue import solver as find_solver
from polhode.solvers.compile import CACHE_VARIABLE, array_callback, c_callback, parameter_array
from polhode.solvers.contract import Backend
from polhode.solvers.llvm import Signature, compile_lines
from polhode.solvers.solve import solve

# A measurement repeats until it takes this long, in seconds, and is the best of `ROUNDS`.
ENOUGH = 2e-3
ROUNDS = 5
STARTS = 5


def rhs_seconds(problem: Problem, backend: Backend) -> float:
    """Wall time of one right-hand side at the start, as a solver of a back end calls it.

    Parameters
    ----------
    problem : Problem
    backend : {"compiled", "numba", "python"}
        "compiled" is called from machine code, as CyRK does; the others from Python, as SciPy and SUNDIALS do, so
        that the call itself counts.

    Returns
    -------
    float
        Seconds; the best of five measurements.
    """
    y, parameters = np.array(problem.start), parameter_array(problem)
    out = np.empty_like(y)
    if backend == "compiled":
        callback = c_callback(problem.field, problem.dimension, len(parameters))
        loop, pointers = _compiled_loop(), [array.ctypes.data for array in (out, y, parameters)]

        def run(calls: int) -> None:
            loop(callback.address, calls, *pointers)
    else:
        evaluate, values = array_callback(problem, backend, parameters)

        def run(calls: int) -> None:
            for _ in range(calls):
                evaluate(y, values, out)

    calls, best = 1, 0.0
    while best < ENOUGH:
        calls *= 4
        best = _seconds(run, calls)
    return min(best, *(_seconds(run, calls) for _ in range(ROUNDS - 1))) / calls


def _seconds(run: Any, calls: int) -> float:
    began = time.perf_counter()
    run(calls)
    return time.perf_counter() - began


@cache
def _compiled_loop() -> Any:
    """A loop over any C callback."""
    head = "void @function(ptr %callback, i64 %calls, ptr %out, ptr %y, ptr %p)"
    lines = """
br label %again
again:
%done = phi i64 [0, %entry], [%next, %again]
call void %callback(ptr %out, double 0.0, ptr %y, ptr %p)
%next = add i64 %done, 1
%more = icmp slt i64 %next, %calls
br i1 %more, label %again, label %end
end:
"""
    code = compile_lines(Signature(head, "entry:"), lines)
    pointer = ctypes.c_void_p
    function = ctypes.CFUNCTYPE(None, pointer, ctypes.c_int64, pointer, pointer, pointer)(code.address)
    function.code = code  # pyright: ignore[reportAttributeAccessIssue]
    return function


@dataclass(frozen=True)
class FirstRun:
    """Seconds of a first run in a fresh process.

    Parameters
    ----------
    library : float
        Importing the solver's library.
    compilation : float
        Compiling the vector field and preparing the integrator.
    run : float
        The run itself, by then prepared.
    """

    library: float
    compilation: float
    run: float


def first_run(problem: Problem, solver: str, tolerance: float, cache_folder: str | None = None) -> FirstRun:
    """Measure a first run: only in a process that has compiled nothing before does this mean anything.

    Cold if the folder is empty: nothing was ever compiled; warm if a process before this one used it. heyoka alone
    keeps compiled code on disk; other fields are compiled anew in every process.

    Parameters
    ----------
    problem : Problem
        Passed to the process by pickling.
    solver : str
        Catalogue name.
    tolerance : float
    cache_folder : str, optional
        Folder of heyoka's cache, by way of ``POLHODE_CACHE``; where it always is if not given.
    """
    if cache_folder is not None:
        os.environ[CACHE_VARIABLE] = cache_folder
    method = find_solver(solver)
    began = time.perf_counter()
    method.load()
    imported = time.perf_counter()
    method.prepare(problem, method.settings(tolerance))
    prepared = time.perf_counter()
    solution = solve(problem, solver, tolerance)
    return FirstRun(imported - began, prepared - imported, solution.seconds)


def startup_seconds() -> float:
    """Wall time of `polhode --help` in a process of its own: the minimum of some starts."""
    code = "from polhode.harness.cli import main; main(['--help'])"

    def start() -> None:
        subprocess.run([sys.executable, "-c", code], check=True, stdout=subprocess.DEVNULL)

    return min(seconds_of(start) for _ in range(STARTS))
