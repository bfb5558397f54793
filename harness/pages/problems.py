"""The page of the classical test problems: profiles over all, work and precision of each.

A heat map shows, for each problem and error, how many times as long as the fastest each solver takes.
"""

from collections.abc import Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

import pandas as pd

from polhode.harness.analysis.frames import read_csv, where
from polhode.harness.analysis.pareto import TIE, costs
from polhode.harness.common.files import read_file, write_file
from polhode.harness.common.machine import made_lines, provenance
from polhode.harness.common.store import Record
from polhode.harness.common.text import duration, in_two_digits, markdown, short
from polhode.harness.pages.figures.style import measured, power, rank, save
from polhode.harness.pages.figures.work_precision import conditions, heat_map, profiles, sentence
from polhode.harness.pages.tables import fill
from polhode.models.problems.catalogue import PROBLEMS
from polhode.solvers.contract import Status

# Requested errors of the state at the end, relative where a component exceeds one in size
# (`Classical.error`): loose, middle and tight, of the table and the heat map; a choice.
_TARGETS = (1e-3, 1e-6, 1e-9)
# The tightest one of `_TARGETS` that some solver reaches on every problem of reports/problems.
_PROFILED_TARGET = 1e-6
# Five significant digits of numbers in `runs.csv`: times and errors are known to fewer.
_CSV_NUMBER = "%.5g"


def write_page(rows: Sequence[Record], folder: Path, command: str) -> Path:
    """Write page, figures and `runs.csv` into a folder; return the page's path.

    `rows` are records of `polhode.harness.work_precision.run_problems`.
    """
    # The page says these once for all runs. Rows of earlier runs lack "code".
    told_once = ["machine", "versions", "commit", "code", "date"]
    table = pd.DataFrame(rows).drop(columns=told_once, errors="ignore")
    write_file(folder / "runs.csv", table.to_csv(index=False, float_format=_CSV_NUMBER))
    return _write(table, folder, provenance(command, rows))


def rewrite_page(folder: Path) -> Path:
    """Write page and figures anew from `runs.csv`, with machine and versions of the old page; the page's path.

    Raises ValueError if the folder has no page, and OSError if it has no `runs.csv`.
    """
    made = made_lines(folder / "README.md")
    runs = read_csv(BytesIO(read_file(folder / "runs.csv"))).fillna({"message": ""})
    return _write(runs, folder, made)


def _write(table: pd.DataFrame, folder: Path, made: Sequence[str]) -> Path:
    """Write page and figures of the runs in a table; `made` says how they were made.

    The columns needed are `problem`, `solver`, `tolerance`, `status`, `message`, `error`, `seconds` and
    `spread`, the longest time of the repeats minus the shortest in s. The last three are empty for a run that
    did not reach its end, and the last two for one that took too long to be repeated. `tolerance` is empty,
    too, where the process failed: one row then stands for all.
    """
    # The functions below read columns by the names that records of scenes have. The error is the error of
    # the state at the end, where the published digits count as exact. Every run has one form, the problem's own.
    runs = table.assign(
        form="",
        slow_uncertainty=0.0,
        slow_error=table["error"],
        seconds_spread=table["spread"],
    )
    groups = [
        (str(name), problem_runs) for name, problem_runs in runs.groupby("problem", sort=False)
    ]
    # Seconds to each error: a row for each error and problem, a column for each solver. The columns are
    # first named by form and solver: the form is dropped.
    times: Any = costs(groups, _TARGETS).droplevel(0, axis=1)
    note = conditions(runs, measured(made))
    # The heat map has a column for each solver that gets to some error of some problem, in the
    # order of the catalogue.
    compared = times.dropna(how="all", axis="columns")
    compared = compared[sorted(compared, key=rank)]
    if not compared.empty:
        ratios = compared.div(compared.min(axis=1), axis=0)
        titles = [f"to an error of {power(target)} at the end" for target in _TARGETS]
        save(heat_map(ratios, titles, note), folder, "work-precision")
    # Profiles are over the problems that some solver brings to this error.
    profiled = times.loc[_PROFILED_TARGET].dropna(how="all").dropna(axis="columns", how="all")
    if not profiled.empty:
        reached = (
            f"{len(profiled)} classical problems, each to an error of {short(_PROFILED_TARGET)}."
        )
        save(profiles(profiled, f"{reached} {note}"), folder, "profiles")
    names = [name for name in PROBLEMS if name in set(runs["problem"])]
    fastest = []
    for name in names:
        winners = [_winner(times.loc[target, name]) for target in _TARGETS]
        fastest.append([name, *winners])
    status = runs["status"].astype(str)
    # A run at the time limit of the study is slow, not wrong: a longer limit might let it reach its end.
    # pages/outcomes.py counts it, and one at a limit of steps, as "stopped". These runs have no limit of
    # steps of the study's: one that ends so was stopped by its own library, and failed.
    page = fill(
        "problems",
        made=made,
        compared=not compared.empty,
        sentence="" if profiled.empty else sentence(profiled),
        profiled=_PROFILED_TARGET,
        # In percent of the fastest time.
        tie=100 * (TIE - 1),
        fastest=markdown(
            ["problem", *(f"fastest at {short(target)}" for target in _TARGETS)], fastest
        ),
        sources={name: PROBLEMS[name].source for name in names},
        failed=where(runs, (status != Status.REACHED_END) & (status != Status.TIME_LIMIT)).to_dict(
            "records"
        ),
    )
    return write_file(folder / "README.md", page)


def _winner(times: Any) -> str:
    """The fastest solver, its time, and its lead over the next one or the tie with it, in words.

    `times` are the seconds of one problem to one error by solver, a series; NaN where none is
    known.
    """
    ranked = sorted((seconds, solver) for solver, seconds in times.dropna().items())
    if not ranked:
        return "–"
    seconds, fastest = ranked[0]
    words = f"{fastest}: {duration(seconds)}"
    if len(ranked) == 1:
        return words
    next_seconds, second = ranked[1]
    if next_seconds > TIE * seconds:
        return f"{words}, {in_two_digits(next_seconds / seconds)} × as fast as {second}"
    return f"{words} = {second}"
