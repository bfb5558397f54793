"""Progress: silent at first and off a terminal, the time remaining from what is done, and how far solvers tell."""

import io
import re
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
def hasty(monkeypatch: pytest.MonkeyPatch) -> None:
    """Progress that looks at once, and often."""
    monkeypatch.setattr(progress, "PATIENCE", 0.01)
    monkeypatch.setattr(progress, "INTERVAL", 0.02)


@pytest.mark.parametrize("told", [True, False])
@pytest.mark.usefixtures("hasty")
def test_the_time_remaining_follows_from_what_is_done(told: bool):
    terminal, fraction = Terminal(), [0.0]
    with Progress(stream=terminal) as shown:
        shown.begin("solving", None if told else lambda: fraction[0])
        time.sleep(0.12)
        fraction[0] = 0.01
        shown.advance(0.01)
        time.sleep(0.1)
        shown.begin("writing")
        time.sleep(0.1)
    lines = [line.strip() for line in terminal.getvalue().split("\r") if line.strip()]
    assert lines[0] == "solving: 00:00"
    # A tenth of a second for one per cent, that is, ten or twenty for the rest.
    assert re.fullmatch(
        r"solving: 1 %, 00:[12]\d left", next(line for line in lines if "%" in line)
    )
    assert lines[-1] == "writing: 00:00"


@pytest.mark.usefixtures("hasty")
def test_a_terminal_is_left_clean_and_anything_else_alone():
    terminal, pipe, quiet = Terminal(), io.StringIO(), Terminal()
    for shown in (
        Progress(stream=terminal),
        Progress(stream=pipe),
        Progress(quiet=True, stream=quiet),
    ):
        with shown:
            shown.begin("solving")
            time.sleep(0.1)
    assert terminal.getvalue().startswith("\rsolving: 00:00")
    assert not terminal.getvalue().split("\r")[-2].strip()
    assert pipe.getvalue() == quiet.getvalue() == ""


@pytest.mark.usefixtures("hasty")
def test_a_long_run_is_said_to_be_long_once(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(progress, "NOTE_AFTER", 0.05)
    for terminal in (Terminal(), io.StringIO()):
        with Progress(stream=terminal) as shown:
            shown.begin("solving", None, lambda seconds: "")
            time.sleep(0.15)
            assert "note" not in terminal.getvalue()
            shown.begin("solving", None, lambda seconds: "it is long")
            time.sleep(0.3)
        said = "note: it is long; Ctrl-C keeps what is finished"
        assert terminal.getvalue().count(said) == 1


@pytest.mark.parametrize(
    ("done", "words"),
    [
        (0.0, "it has hardly begun after 3.0 s"),
        (1e-4, "it is expected to take about 30000 s"),
        (0.2, ""),
    ],
)
def test_how_long_a_run_will_take_follows_from_what_is_done(done: float, words: str):
    assert progress.expectation(done, 3.0) == words


def test_nothing_is_shown_at_first():
    terminal = Terminal()
    with Progress(stream=terminal) as shown:
        shown.begin("solving")
        time.sleep(0.5)
    assert terminal.getvalue() == ""


@pytest.mark.parametrize("solver", ["taylor", "cyrk-tsit5", "rk45", "cvode-adams"])
def test_a_run_tells_how_far_it_is_between_rows(solver: str):
    problem = replace(form("quaternion").problem(named_scene("long")), end=2e4)
    records: list[Record] = []
    found = solve(problem, solver, 1e-10, watch=records.append, max_seconds=0.2)
    (record,) = records
    if found.success:
        assert record.reached == problem.end
    else:
        assert record.filled == 1
        assert 0 < record.reached < problem.end
    assert record.times[0] == 0
    np.testing.assert_array_equal(record.rows[0], problem.start)
