"""Progress: silent at first and off a terminal, the time remaining from what is done, and how far solvers tell."""

import io
import re
import time
from dataclasses import replace

import numpy as np
import pytest

from polhode.harness.commands import _study_options
from polhode.harness.common import progress
from polhode.harness.common.progress import Progress, Steps, in_steps
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
        said = "note: it is long\n"
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


@pytest.mark.usefixtures("hasty")
def test_short_pieces_do_not_put_off_what_is_shown(monkeypatch: pytest.MonkeyPatch):
    # Longer than each piece, on a busy machine too, and shorter than all of them.
    monkeypatch.setattr(progress, "PATIENCE", 1.0)
    terminal = Terminal()
    with Progress(stream=terminal) as shown:
        for k in range(15):
            shown.begin(f"piece {k}")
            time.sleep(0.1)
    assert "piece 0:" not in terminal.getvalue()
    assert "piece 14: 00:0" in terminal.getvalue()


def columns(monkeypatch: pytest.MonkeyPatch, count: int) -> None:
    """A terminal of so many columns."""
    monkeypatch.setattr("tqdm.std._screen_shape_wrapper", lambda: lambda _: (count, 24))


@pytest.mark.parametrize("width", [80, 120])
def test_steps_have_a_bar_in_a_narrow_terminal_too(monkeypatch: pytest.MonkeyPatch, width: int):
    columns(monkeypatch, width)
    terminal = Terminal()
    with Steps("bench-quick", 486, "cases", stream=terminal) as shown:
        first = terminal.getvalue().strip()
        for _ in range(243):
            shown.detail("splitting-extended 1e-11, St = 1000")
            time.sleep(1e-3)
            shown.advance()
        lines = [line for line in terminal.getvalue().split("\r") if "243" in line or "240" in line]
    assert first.startswith("bench-quick:   0 % |")
    assert all(len(line) <= width for line in terminal.getvalue().split("\r"))
    bars = [line.split("|")[1] for line in terminal.getvalue().split("\r") if "|" in line]
    assert min(map(len, bars)) >= 10
    assert any("splitting-ex" in line for line in lines)
    assert ("St = 1000" in terminal.getvalue()) is (width == 120)
    # The line is taken away at the end.
    assert not terminal.getvalue().split("\r")[-2].strip()


def test_steps_off_a_terminal_are_a_line_at_the_start_and_one_a_minute(
    monkeypatch: pytest.MonkeyPatch,
):
    now = [0.0]
    monkeypatch.setattr(progress, "time", lambda: now[0])
    pipe, quiet = io.StringIO(), io.StringIO()
    for stream in (pipe, quiet):
        now[0] = 0.0
        for _ in in_steps(range(9), "errors", "scenes", stream is quiet, stream):
            now[0] += 20.0
    assert pipe.getvalue().splitlines() == [
        "errors: 9 scenes",
        "errors: 3 of 9 scenes after 60 s",
        "errors: 6 of 9 scenes after 120 s",
        "errors: 9 of 9 scenes after 180 s",
    ]
    assert quiet.getvalue() == ""


def test_steps_without_a_total_are_counted():
    terminal = Terminal()
    with Steps("report", None, "pages", stream=terminal) as shown:
        shown.detail("Cost")
        shown.advance()
        time.sleep(0.15)
        shown.detail("Motion")
        shown.advance()
    assert "report: 1 pages, 00:00, Motion" in terminal.getvalue()


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


@pytest.mark.usefixtures("hasty")
@pytest.mark.parametrize("quiet", [True, False])
def test_loading_libraries_is_said_to_take_time(monkeypatch: pytest.MonkeyPatch, quiet: bool):
    terminal = Terminal()
    monkeypatch.setattr("sys.stderr", terminal)
    with _study_options.loading(quiet):
        time.sleep(0.15)
    assert ("loading: 00:00" in terminal.getvalue()) is not quiet
