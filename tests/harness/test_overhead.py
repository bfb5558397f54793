"""The bare calls that `solve` is measured against are fair: they give the rows that it gives."""

from dataclasses import replace

import numpy as np
import pytest

from polhode.harness.overhead import Overhead, bare_call, measure, paper_problem
from polhode.solvers.catalogue import SOLVERS, solver
from polhode.solvers.solve import solve

PROBLEM = replace(paper_problem(), end=20.0)
TIMES = np.linspace(0.0, 20.0, 21)


@pytest.mark.parametrize("name", [name for name in SOLVERS if name != "exact" and not name.startswith("cyrk")])
def test_a_bare_call_gives_the_same_rows(name: str):
    method = solver(name)
    result = bare_call(method, PROBLEM, method.settings(1e-6), TIMES)()
    rows = {"scipy": lambda: result.y.T, "sksundae": lambda: result.y, "heyoka": lambda: result[-1]}[method.library]()
    assert rows == pytest.approx(solve(PROBLEM, name, 1e-6, TIMES).states, abs=1e-14)


def test_overhead_is_judged_by_share_or_by_time():
    assert Overhead("a", 1e-3, 1.049e-3).allowed
    assert Overhead("a", 1e-4, 1.49e-4).allowed
    assert not Overhead("a", 1e-4, 1.51e-4).allowed
    assert Overhead("a", 1e-1, 1.049e-1).allowed
    assert not Overhead("a", 1e-1, 1.051e-1).allowed


def test_measuring_gives_a_row_per_solver():
    table = measure(PROBLEM, solvers=("taylor", "cyrk-vern8", "cvode-bdf"), samples=21, seconds=0.05)
    assert [row.solver for row in table] == ["taylor", "cyrk-vern8", "cvode-bdf"]
    assert all(0 < row.bare < 1 and 0 < row.solve < 1 for row in table)
