"""What a field as a built-in function saves over one that is called through ctypes, in whole runs.

    python tests/benchmarks/array_function.py

prints the ratio of the two times for solvers that call the field back: least times of some runs,
taken in turns. The module `solvers/machine_code/array_function.py` reads inner layouts of Python
and NumPy; this is what it has to pay for.
"""

import ctypes
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from time import perf_counter

import numpy as np

from polhode import Ellipsoid
from polhode.models.catalogue import form as find_form
from polhode.models.scene import Scene
from polhode.models.scenes import PAPER_ELLIPSOID, PAPER_START
from polhode.solvers import compile as compilation
from polhode.solvers.machine_code.array_function import array_function
from polhode.solvers.machine_code.llvm import compile_file
from polhode.solvers.solve import solve

# A function of LLVM's language whose arguments are pointers to arrays, and whose body is the field.
FUNCTION = """define void @function($signature) {
$lines
ret void
}
"""
# Solvers that call the field back, from Python or from C.
SOLVERS = ("dop853", "rk45", "radau", "bdf", "lsoda", "cvode-adams", "cvode-bdf", "ida")
# Two full forms, of seven and of six components.
FORMS = ("quaternion", "euler-angles")
# Tight, so that a run has many steps, and calls are a large part of its time.
TOLERANCE = 1e-8
# St, and the end of the run in inverse shear rates: an oscillating problem and a stiff one.
RUNS = ((10.0, 200.0), (1e-2, 20.0))
# Runs of each kind, in turns, of which the shortest counts.
REPEATS = 5


def through_ctypes(lines: str, arrays: Mapping[str, int]) -> Callable[..., None]:
    """The field of `array_function`, called through ctypes with arrays of its own, whose addresses are known.

    `lines` are those of the field's code. `arrays` are the lengths of its arguments by name, in the order state,
    parameters, rates.
    """
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "function.ll"
        path.write_text(FUNCTION, encoding="utf-8")
        signature = ", ".join(f"ptr %{name}" for name in arrays)
        code = compile_file(path, signature=signature, lines=lines)
    function = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * len(arrays))(code.address)
    inner_y, inner_p, inner_out = (np.empty(length) for length in arrays.values())
    at_y, at_p, at_out = (array.ctypes.data for array in (inner_y, inner_p, inner_out))

    # The code lives as long as the function that calls it.
    def call(y: np.ndarray, p: np.ndarray, out: np.ndarray, code: object = code) -> None:
        inner_y[:] = y
        inner_p[:] = p
        function(at_y, at_p, at_out)
        out[:] = inner_out

    return call


def seconds(form: str, solver: str, stokes: float, end: float) -> tuple[float, float]:
    """Least times, in seconds, of runs with the built-in function and through ctypes."""
    scene = Scene(Ellipsoid(PAPER_ELLIPSOID), stokes, PAPER_START, end)
    problem = find_form(form).problem(scene)
    least = [np.inf, np.inf]
    for _ in range(REPEATS):
        for kind, function in enumerate((array_function, through_ctypes)):
            # What was compiled with the other kind is forgotten.
            compilation.array_function = function
            for cached in (compilation.compiled_callback, compilation.exact_jacobian):
                cached.cache_clear()
            run = {"backend": "numba", "times": np.array([0.0, end])}
            # The first run compiles: the second one counts.
            for _ in range(2):
                began = perf_counter()
                solve(problem, solver, TOLERANCE, **run)
                taken = perf_counter() - began
            least[kind] = min(least[kind], taken)
    compilation.array_function = array_function
    return least[0], least[1]


def main() -> None:
    """Print a line for each solver, form and St."""
    for stokes, end in RUNS:
        for form in FORMS:
            for solver in SOLVERS:
                built_in, called = seconds(form, solver, stokes, end)
                ratio = called / built_in
                print(f"St = {stokes:g}, {form}, {solver}: {built_in:.4f} s, ctypes × {ratio:.2f}")


if __name__ == "__main__":
    main()
