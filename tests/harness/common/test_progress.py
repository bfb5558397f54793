"""Progress: silent at first and off a terminal, the time remaining from what is done, and how far solvers tell."""

import io
import time
from dataclasses import replace

import numpy as np
import pytest

from polhode.harness.common import progress
from polhode.harness.common.progress import Progress
from polhode.models.catalogue import form
from polhode.models.scenes import named_scene
from polhode.solvers.contract import Record
from polhode.solvers.solve import solve


class Terminal(io.StringIO):
    """A stream that says it is a terminal."""

    def isatty(self) -> bool:
        return True


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """The time that progress reads, set by hand."""
    now = [100.0]
    monkeypatch.setattr(progress, "monotonic", lambda: now[0])
    return now


@pytest.mark.parametrize(
    ("elapsed", "done", "line"),
    [
        (1.9, 0.5, ""),
        (5.0, 0.0, "solving: 5 s"),
        (10.0, 0.25, "solving: 25 %, 30 s left"),
        (100.0, 0.5, "solving: 50 %, 1 min 40 s left"),
        (100.0, 0.01, "solving: 1 %, 2 h 45 min left"),
    ],
)
def test_the_time_remaining_follows_from_what_is_done(clock: list[float], elapsed: float, done: float, line: str):
    told, read = Progress(stream=Terminal()), Progress(stream=Terminal())
    told.begin("solving")
    told.advance(done)
    read.begin("solving", lambda: done)
    clock[0] += elapsed
    assert told.line() == read.line() == line
    told.begin("writing")
    assert told.line() == ""


def test_a_terminal_is_left_clean_and_anything_else_alone(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(progress, "PATIENCE", 0.0)
    monkeypatch.setattr(progress, "INTERVAL", 0.01)
    terminal, pipe, quiet = Terminal(), io.StringIO(), Terminal()
    for shown in (Progress(stream=terminal), Progress(stream=pipe), Progress(quiet=True, stream=quiet)):
        with shown:
            shown.begin("solving")
            time.sleep(0.1)
    assert terminal.getvalue().startswith("\r\x1b[Ksolving: 0 s")
    assert terminal.getvalue().endswith("\r\x1b[K")
    assert pipe.getvalue() == quiet.getvalue() == ""


@pytest.mark.parametrize("solver", ["taylor", "cyrk-tsit5", "rk45", "cvode-adams"])
def test_a_run_tells_how_far_it_is_between_rows(solver: str):
    problem = replace(form("quaternion").problem(named_scene("long")), end=2e4)
    records: list[Record] = []
    found = solve(problem, solver, 1e-10, watch=records.append, max_seconds=0.4)
    (record,) = records
    if found.success:
        assert record.reached == problem.end
    else:
        assert record.filled == 1
        assert 0 < record.reached < problem.end
    assert record.times[0] == 0
    np.testing.assert_array_equal(record.rows[0], problem.start)
