"""The bare calls that `solve` is measured against are fair: they give the rows that it gives."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from polhode.harness.studies import cost
from polhode.harness.studies.cost import Overhead, measure, paper_problem
from polhode.models.problem import Problem
from polhode.solvers.catalogue import SOLVERS, solver
from polhode.solvers.contract import Integrator, Settings, Solver
from polhode.solvers.solve import solve

PROBLEM = replace(paper_problem(), end=20.0)
TIMES = np.linspace(0.0, 20.0, 21)


class Lone(Solver):
    """Of a library with a known bare call, but written by itself: its bare call is anyone's guess."""

    name = "lone"
    summary = accepts = ""
    library = package = "scipy"

    def prepare(self, problem: Problem, settings: Settings) -> Integrator:
        raise AssertionError("nothing is prepared")


@pytest.mark.parametrize(
    "name", [name for name in SOLVERS if solver(name).library in ("scipy", "sksundae", "heyoka")]
)
def test_a_bare_call_gives_the_same_rows(name: str):
    method = solver(name)
    call = method.bare_call(PROBLEM, method.settings(1e-6), TIMES)
    assert call is not None
    result: Any = call()
    rows = {"scipy": lambda: result.y.T, "sksundae": lambda: result, "heyoka": lambda: result[-1]}[
        method.library
    ]()
    assert rows == pytest.approx(solve(PROBLEM, name, 1e-6, TIMES).states, abs=1e-14)


def test_overhead_is_judged_by_share_or_by_time():
    assert Overhead("a", 1e-3, 1.049e-3).allowed
    assert Overhead("a", 1e-4, 1.49e-4).allowed
    assert not Overhead("a", 1e-4, 1.51e-4).allowed
    assert Overhead("a", 1e-1, 1.049e-1).allowed
    assert not Overhead("a", 1e-1, 1.051e-1).allowed


def test_measuring_gives_a_row_per_solver():
    table = measure(
        PROBLEM, solvers=("taylor", "cyrk-vern8", "cvode-bdf"), samples=21, seconds=0.05
    )
    assert [row.solver for row in table] == ["taylor", "cyrk-vern8", "cvode-bdf"]
    assert all(0 < row.bare < 1 and 0 < row.solve < 1 for row in table)


def test_a_solver_whose_bare_call_is_unknown_is_left_out(monkeypatch: pytest.MonkeyPatch):
    lone = Lone()
    assert lone.available
    assert lone.bare_call(PROBLEM, Settings(1e-6, "numba"), TIMES) is None
    monkeypatch.setattr(cost, "find_solver", lambda name: lone if name == "lone" else solver(name))
    table = measure(PROBLEM, solvers=("lone", "taylor"), samples=21, seconds=0.01)
    assert [row.solver for row in table] == ["taylor"]


def test_bare_calls_are_known_of_every_method_of_a_library():
    for method in map(solver, SOLVERS):
        known = method.bare_call(PROBLEM, method.settings(1e-6), TIMES) is not None
        assert known == (method.family in ("heyoka", "SciPy", "SUNDIALS", "CyRK")), method.name
