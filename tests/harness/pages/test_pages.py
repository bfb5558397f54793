"""What commands print for people: short tables, wrapped on terminals alone, and what to do next."""

import os
import pty
import shlex
import subprocess
import sys
from contextlib import suppress
from os import terminal_size

import pytest

from polhode.harness.answers.interval import Interval
from polhode.harness.answers.recommendation import Excluded, RankedRun, Recommendation
from polhode.harness.commands.pick import FEW, pick_page
from polhode.harness.common import text
from polhode.harness.common.text import aligned, command_on_terminal, on_terminal
from polhode.solvers.catalogue import SOLVERS

ROWS = [
    ["averaged", "L and E alone, first order in the inverse Stokes number"],
    ["quaternion", "no singularity"],
]


def test_a_narrow_terminal_wraps_the_last_column(monkeypatch: pytest.MonkeyPatch):
    assert on_terminal(["form", "what"], ROWS) == aligned(["form", "what"], ROWS)
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    monkeypatch.setattr(text, "get_terminal_size", lambda: terminal_size((45, 24)))
    lines = on_terminal(["form", "what"], ROWS).splitlines()
    assert max(map(len, lines)) <= 45
    assert lines[2].startswith(" " * 12)
    assert " ".join(lines[1].split() + lines[2].split()) == " ".join(ROWS[0])


def test_two_wide_columns_share_the_room(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    monkeypatch.setattr(text, "get_terminal_size", lambda: terminal_size((80, 24)))
    wide = " ".join(["words"] * 12)
    lines = on_terminal(["a", "b"], [[wide, wide]]).splitlines()
    assert max(map(len, lines)) <= 80
    assert len(lines) == 1 + 2


def test_a_command_broken_by_a_narrow_terminal_can_be_pasted(monkeypatch: pytest.MonkeyPatch):
    words = ["polhode", "solve", "'my scene.toml'", "--form", "quaternion", "--out", "a.csv"]
    assert command_on_terminal(words) == " ".join(words)
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    monkeypatch.setattr(text, "get_terminal_size", lambda: terminal_size((40, 24)))
    broken = command_on_terminal(words)
    assert max(map(len, broken.splitlines())) <= 40
    assert len(broken.splitlines()) > 1
    assert shlex.split(broken.replace("\\\n", "")) == shlex.split(" ".join(words))


def on_narrow_terminal(*commands: list[str]) -> str:
    """What commands print, in one process, on a terminal of 80 columns that wants no colours."""
    code = """
from contextlib import suppress
from polhode.harness.answers import pace, race
from polhode.harness.cli import main
from polhode.harness.commands import setup
pace._REPEATS = 1
# Those with the longest names, and those that are refused: compiling all others takes seconds.
widest = sorted(race.SOLVERS, key=len)[-8:]
race.SOLVERS = [name for name in race.SOLVERS if name in {*widest, *race.IMPLICIT}]
setup.cold_start, setup.watch_sentinel = dict, lambda seconds: {"seconds": 1e-3, "ratio": 2.0, "load": 0.0}
"""
    code += "".join(f"with suppress(SystemExit):\n    main({words})\n" for words in commands)
    ours, theirs = pty.openpty()
    environment = {**os.environ, "COLUMNS": "80", "NO_COLOR": "1"}
    with subprocess.Popen(
        [sys.executable, "-c", code], stdout=theirs, stderr=theirs, env=environment
    ):
        os.close(theirs)
        printed = b""
        # The terminal's end is an error of the system's.
        with suppress(OSError):
            while piece := os.read(ours, 10_000):
                printed += piece
    os.close(ours)
    return printed.decode()


def test_commands_keep_within_a_terminal_of_80_columns():
    # At so large an error every method is quickly raced.
    pick = ["pick", "paper", "--error", "1e-2", "--all", "--quiet"]
    lists = (["shape", "1", "0.8", "0.5"], ["forms"], ["scenes"], ["solvers"], ["doctor"])
    printed = on_narrow_terminal(pick, ["solve", "paper"], *lists)
    assert [line for line in printed.splitlines() if len(line) > 80] == []
    # Which method is the quickest depends on the machine: several take 0.4 ms.
    assert printed.startswith("Run ")
    header = next(line for line in printed.splitlines() if line.startswith("form "))
    assert header.split() == [
        "form",
        "solver",
        "tolerance",
        "error",
        "below",
        "time",
        "first",
        "run",
    ]
    for last in (
        "first run",
        "orientation within",
        "symmetry axis of a spheroid",
        "stroboscopic",
        "What to do:",
    ):
        assert last in " ".join(printed.split())
    assert "\x1b" not in printed


def row(form: str, seconds: float) -> RankedRun:
    predicted = Interval(seconds, seconds / 2, seconds * 2)
    return RankedRun(
        form,
        "taylor",
        1e-8,
        Interval(1e-7, 1e-8, 9e-7),
        predicted,
        1.5,
        False,
        f"why {form} takes so long",
    )


def test_pick_shows_the_cheapest_and_the_forms_that_will_not_do():
    ranking = tuple(row("quaternion", 1e-3 * 2**i) for i in range(FEW + 3))
    excluded = [Excluded("averaged", name, "too far off") for name in SOLVERS]
    excluded += [Excluded("quaternion", "exact", "no closed form")]
    found = Recommendation("slow", 1e-6, 40.0, 16.0, ranking, tuple(excluded))
    page = pick_page(found, everything=False)
    assert page.startswith(
        "Run quaternion by taylor at tolerance 1e-8: about 1.0 ms (500 µs to 2.0 ms), L and E within"
    )
    assert page.count("taylor  ") == FEW
    assert "3 more rows, not cheaper: --all" in page
    assert "too far off" not in page
    page = pick_page(found, everything=False, why=True)
    assert "why quaternion takes so long" in page
    assert page.splitlines()[-1].split() == ["averaged", "too", "far", "off"]
    whole = pick_page(found, everything=True)
    assert whole.count("taylor  ") == FEW + 3
    assert [line.split()[:2] for line in whole.splitlines()[-2:]] == [
        ["averaged", "all"],
        ["quaternion", "exact"],
    ]
