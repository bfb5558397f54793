"""CyRK's C functions without its package's import of numba, and the package all the same for whoever wants it."""

import subprocess
import sys

import pytest

PROGRAM = """
import sys
import polhode.solvers.cyrk_library as library
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
    first, second, third = subprocess.run(program, capture_output=True, text=True, check=True).stdout.splitlines()
    assert float(first.split()[0]) == pytest.approx(0.36787944117144233, abs=1e-9)
    assert first.split()[1] == str(bool(known)), "the package's own bridge to versions unknown imports numba"
    assert second.split()[1:] == ["True", "True"]
    assert float(third) == pytest.approx(0.36787944117144233, abs=1e-8)
