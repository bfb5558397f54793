"""Write `docs/since-0.1.md`: what changed since polhode 0.1, numbers side by side.

Numbers of 0.1 stand in the repository's files at its commit, or in `docs/since.toml`; today's in
the reports and in the tree. `python docs/since.py` writes the page; it needs a clone with its history.
"""

import csv
import json
import re
import subprocess
import tomllib
from collections.abc import Sequence
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from polhode.harness.analysis.in_full import ran_in_full
from polhode.harness.common.machine import made_by, makers_of, versions_and_commits
from polhode.harness.common.text import markdown
from polhode.harness.pages.figures.style import is_averaged
from polhode.harness.site.answers import question
from polhode.harness.site.lookup import look_up
from polhode.harness.site.markup import plain
from polhode.harness.studies.study import read_study
from polhode.solvers.contract import Status

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "since-0.1.md"
# The last commit before the work on 0.2, at which trials were made.
BEFORE = "fcc7aa9"
_TRIALS = tomllib.loads((ROOT / "docs" / "since.toml").read_text(encoding="utf-8"))
_PARTS = ("models", "solvers", "harness", "polhode", "tests", "docs")
LINES = "## Lines of code"
# Kinds of confirmation on reports/pick/stated.md that rest on a second run of the whole scene.
_SECOND_RUNS = ("looser", "sharper", "tighter", "unlike")
_NOTHING = "–"
# Questions to the look-up: St and errors beyond what was measured, as many as the trials asked.
_STOKES = np.geomspace(2.9e-5, 3e8, 45).tolist()
_ERRORS = np.geomspace(1.0, 1e-14, 49).tolist()
_COLUMNS = {"slow": "slow_error", "orientation": "orientation_error"}
_NEAR = 1e-3  # The look-up rounds errors and times to so many parts.


def git(*words: str) -> str:
    """What git prints; raises CalledProcessError if it fails."""
    done = subprocess.run(["git", *words], cwd=ROOT, check=True, capture_output=True, text=True)
    return done.stdout


def before(path: str) -> str:
    """A file of 0.1."""
    return git("show", f"{BEFORE}:{path}")


def now(path: str) -> str:
    """The same file of today."""
    return (ROOT / path).read_text(encoding="utf-8")


def _section(title: str, words: str, *lines: str) -> list[str]:
    """A heading with its mark, a paragraph, and the lines below it."""
    return [title, "", words, "", *lines]


def time_to_an_answer() -> list[str]:
    """Times of `solve` over plain practice, by what plain practice takes."""
    rows = []
    for name, trial in _TRIALS["time_to_an_answer"].items():
        row = re.search(
            rf"^\| {name} +\| +(\d+) \| +(\S+) \|", now("reports/pick/time.md"), re.MULTILINE
        )
        today = f"{row[2]} ({row[1]} scenes)" if row else _NOTHING
        rows.append(
            [name, f"{trial['from']:g} to {trial['to']:g} ({trial['scenes']} scenes)", today]
        )
    return _section(
        "## Time to an answer",
        "Time of `polhode.solve(scene, error=E)` over that of the plain practice of a careful user, in the "
        "median. 0.1: trials, the range over seeds. Now: [reports/pick](../reports/pick/time.md).",
        markdown(["plain practice takes", "0.1", "now"], rows, right=(1, 2)),
    )


def stated_errors() -> list[str]:
    """Runs whose stated error bounds the one measured, by what confirms the run."""
    counted = re.findall(
        r"^\| (\w+) +\| ([\w -]+?) +\| (orientation|slow) +\| +(\d+) \| +(\d+) \|",
        now("reports/pick/stated.md"),
        re.MULTILINE,
    )

    def of(kinds: Sequence[str], families: Sequence[str], wants: Sequence[str]) -> str:
        chosen = [
            (int(count), int(misses))
            for kind, family, want, count, misses in counted
            if kind in kinds and want in wants and (not families or family in families)
        ]
        runs = sum(count for count, _ in chosen)
        missed = sum(misses for _, misses in chosen)
        return _share(runs - missed, runs) if runs else _NOTHING

    both = ("slow", "orientation")
    averaged = ("first order", "second order")
    gone = "no longer done"
    today = {
        "a second whole run": of(_SECOND_RUNS, (), both),
        "a look over part of the run, L and E": gone,
        "a look over part of the run, axis": gone,
        "segments of hybrid": of(("estimate",), ("hybrid",), both),
        "an averaged form's own estimate, L and E": of(("estimate",), averaged, ("slow",)),
        "an averaged form's own estimate, orientation": of(
            ("estimate",), averaged, ("orientation",)
        ),
    }
    rows = [
        [name, _share(trial["held"], trial["runs"]), today[name]]
        for name, trial in _TRIALS["stated_errors"].items()
    ]
    return _section(
        "## Stated errors that hold",
        "Stated errors that bound the one measured, of L and E or of the orientation, by what confirms the run. "
        "0.1: trials. Now: [reports/pick](../reports/pick/stated.md), which counts other scenes.",
        markdown(["confirmed by", "0.1", "now"], rows, right=(1, 2)),
    )


def _share(part: int, whole: int) -> str:
    return f"{part} of {whole} ({100 * part / whole:.1f} %)"


def wrong_answers() -> tuple[int, int]:
    """Questions to the look-up, and those with an answer that the measured runs contradict."""
    folder = ROOT / "reports" / "regimes"
    columns = json.loads(json.dumps(plain(question(folder)[1]["question-data"]["columns"])))
    runs = pd.read_csv(folder / "runs.csv")
    runs = runs[~ran_in_full(runs, read_study(None, "regimes").scenes)]
    runs = runs[runs["status"] == Status.REACHED_END]
    runs = runs.assign(averaged=runs["form"].map(is_averaged))
    by_place = {
        (str(name), float(stokes)): runs_there
        for (name, stokes), runs_there in runs.groupby(["scene_name", "stokes"])
    }
    asked = 0
    wrong = 0
    for particle, want, stokes, error in product(
        ("ellipsoid", "spheroid"), _COLUMNS, _STOKES, _ERRORS
    ):
        asked += 1
        answers = look_up(columns, particle, want, stokes, error)["answers"]
        wrong += any(
            _contradicted(answer, by_place[particle, answer["St"]], _COLUMNS[want], error)
            for answer in answers
        )
    return asked, wrong


def _contradicted(answer: dict[str, Any], runs: pd.DataFrame, column: str, error: float) -> bool:
    """Whether an answer is looser than requested, or dearer than an averaged run that is good enough."""
    errors = runs[column].to_numpy(float)
    good = runs["averaged"].to_numpy(bool) & (errors <= error * (1 - _NEAR))
    least = runs["seconds"].to_numpy(float)[good].min(initial=np.inf)
    if "form" not in answer:
        return answer["known"] and bool(good.any())
    mine = runs[(runs["form"] == answer["form"]) & (runs["solver"] == answer["solver"])]
    run = mine[np.isclose(mine["tolerance"], answer["tolerance"], rtol=1e-9)]
    looser = run[column].min() > error * (1 + _NEAR)
    return bool(looser or answer["seconds"] > least * (1 + _NEAR))


def look_ups() -> list[str]:
    """Wrong answers of the site's look-up."""
    trial = dict(_TRIALS["look_up"])
    questions = trial.pop("questions")
    asked, wrong = wrong_answers()
    kinds = "; ".join(f"{count} gave {name}" for name, count in trial.items())
    return _section(
        "## Wrong answers of the look-up",
        f"0.1: {sum(trial.values())} of {questions} questions ({kinds}), by trials.",
        f"Now: {wrong} of {asked} questions have an answer that is looser than requested, or dearer than an "
        "averaged run that is good enough, held against [the map's runs](../reports/regimes/runs.csv).",
        "",
    )


def lines_of_code() -> list[str]:
    """Lines and characters of Python, by part."""
    rows = []
    for part in _PARTS:
        old = [
            before(path)
            for path in git("ls-tree", "-r", "--name-only", BEFORE, part).split()
            if path.endswith(".py")
        ]
        new = [
            now(path)
            for path in git("ls-files", part).split()
            if path.endswith(".py") and (ROOT / path).is_file()
        ]
        rows.append([part, *_counts(old), *_counts(new)])
    heads = [
        "part",
        "lines, 0.1",
        "thousand characters, 0.1",
        "lines, now",
        "thousand characters, now",
    ]
    return _section(
        LINES,
        "Python files. A line of 0.1 has up to 120 columns and often several statements; one of today has up to "
        "100 and one statement.",
        markdown(heads, rows, right=(1, 2, 3, 4)),
    )


def _counts(texts: Sequence[str]) -> list[str]:
    lines = sum(text.count("\n") for text in texts)
    return [str(lines), f"{sum(map(len, texts)) / 1000:.0f}"]


def cold_start() -> list[str]:
    """Wall times of commands in processes of their own."""
    solve = "`polhode solve paper`"
    once_more = "`polhode.solve('paper')` once more in a process"
    renamed = {
        "the same with a new shape and an empty cache": f"{solve} with a new shape and an empty cache",
        "the same `polhode.solve('paper')` once more": once_more,
    }
    table = re.findall(r"^\| (.+?) \| (\d+\.\d+) \|$", before("docs/method.md"), re.MULTILINE)
    path = ROOT / "reports" / "cold-start" / "seconds.csv"
    today = {}
    if path.is_file():
        with path.open(newline="", encoding="utf-8") as file:
            today = {row["command"]: row["wall"] for row in csv.DictReader(file)}
    rows = []
    for former, seconds in table:
        name = renamed.get(former, former)
        rows.append([name, seconds, today.get(name, _NOTHING)])
    return _section(
        "## Cold start",
        "Seconds of a command in a process of its own, the median of five, by `make cold-start`. 0.1: its docs "
        "on the method.",
        *([] if today else ["Not measured anew yet.", ""]),
        markdown(["command", "0.1, s", "now, s"], rows, right=(1, 2)),
    )


def throughput() -> list[str]:
    """Particles per second and core, full equations."""
    path = "reports/sweep/throughput.json"
    table_before = json.loads(before(path))
    table_now = json.loads(now(path))
    rates_now = _rates(table_now)
    rows = []
    for (shape, target), rate in _rates(table_before).items():
        if (shape, target) in rates_now:
            error = f"{target:.0e}".replace("e-0", "e-")
            rows.append([shape, error, f"{rate:,.0f}", f"{rates_now[shape, target]:,.0f}"])
    return _section(
        "## Throughput",
        "Particles a second and core, full equations, every state within the error "
        "([reports/sweep](../reports/sweep/throughput.md)).",
        *_unchanged(table_before == table_now),
        markdown(["shape", "error", "0.1", "now"], rows, right=(1, 2, 3)),
    )


def _rates(table: dict[str, Any]) -> dict[tuple[str, float], float]:
    """Particles a second of full equations, by shape and error."""
    return {(row["shape"], row["target"]): row["per_second"] for row in table["full"]}


def _unchanged(same: bool) -> list[str]:
    return (
        ["Not measured anew since 0.1: both columns are the same measurement.", ""] if same else []
    )


def sources() -> list[str]:
    """Which version measured the pages that today's numbers stand on."""
    rows = []
    for name in ("pick/time.md", "pick/stated.md", "regimes/README.md", "sweep/throughput.md"):
        makers = makers_of(now(f"reports/{name}"))
        rows.append([f"[{name}](../reports/{name})", *versions_and_commits(makers)])
    return [
        "## What measured today's numbers",
        "",
        markdown(["page", "version", "commit"], rows),
        f"0.1 is commit {BEFORE}. {made_by('python docs/since.py')}",
    ]


def page() -> str:
    """The page."""
    parts = [
        [
            "# What changed since 0.1",
            "",
            "Numbers side by side; [CHANGELOG](../CHANGELOG.md) says what is new.",
            "",
        ],
        time_to_an_answer(),
        stated_errors(),
        look_ups(),
        lines_of_code(),
        cold_start(),
        throughput(),
        sources(),
    ]
    return "\n".join(line for part in parts for line in part) + "\n"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
