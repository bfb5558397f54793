"""Steps and right-hand sides of fixed runs must not grow: `baseline.json` holds what they were, and why it was renewed.

Renew it with ``python tests/solvers/test_baseline.py "why the counts are what they are now"``.
"""

import json
import sys
from pathlib import Path

import pytest

from polhode.models.catalogue import form
from polhode.models.problem import Problem
from polhode.models.problems.catalogue import PROBLEMS
from polhode.models.scenes import named_scene
from polhode.solvers.catalogue import SOLVERS, solver
from polhode.solvers.solve import solve

FILE = Path(__file__).with_name("baseline.json")
TOLERANCE = 1e-6
# Another processor rounds a last bit otherwise, and a step more follows.
SLACK = 0.02
RUNS = {
    "rigid-body": lambda: PROBLEMS["rigid-body"].problem,
    "hires": lambda: PROBLEMS["hires"].problem,
    "paper, quaternion": lambda: form("quaternion").problem(named_scene("paper")),
    "paper, averaged": lambda: form("averaged").problem(named_scene("paper")),
    "spheroid, spheroid-axis": lambda: form("spheroid-axis").problem(named_scene("spheroid")),
}


def counts(problem: Problem) -> dict[str, list[int | None]]:
    """Steps and right-hand sides of every solver that takes the problem."""
    found = {}
    for name in SOLVERS:
        if solver(name).takes(problem) and not solver(name).closed_form:
            work = solve(problem, name, TOLERANCE, count=True).work
            found[name] = [work.steps, work.rhs_calls]
    return found


def grown(now: dict[str, list[int | None]], before: dict[str, list[int | None]]) -> list[str]:
    """Which counts are larger than they were."""
    return [
        f"{name}: {new} {what}, {old} before"
        for name, pair in now.items()
        for what, new, old in zip(
            ("steps", "right-hand sides"), pair, before.get(name, pair), strict=True
        )
        if new is not None and old is not None and new > old * (1 + SLACK) + 1
    ]


@pytest.mark.parametrize("run", RUNS)
def test_counts_do_not_grow(run: str):
    before = json.loads(FILE.read_text())["counts"][run]
    now = counts(RUNS[run]())
    assert grown(now, before) == []
    assert set(before) <= set(now)


def test_growth_is_noticed():
    assert grown({"a": [104, None]}, {"a": [100, None]}) == ["a: 104 steps, 100 before"]
    assert grown({"a": [102, 7], "new": [9, 9]}, {"a": [100, None]}) == []


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit('expected the reason: python tests/solvers/test_baseline.py "why"')
    lines = [f"  {json.dumps(name)}: {json.dumps(counts(make()))}" for name, make in RUNS.items()]
    text = ",\n".join(lines)
    FILE.write_text(f'{{"reason": {json.dumps(sys.argv[1])},\n "counts": {{\n{text}\n}}}}\n')
