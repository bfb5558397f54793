"""The page of the classical test problems: profiles over all, work and precision of each."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from polhode.harness.analysis.frames import where
from polhode.harness.analysis.pareto import times_at_error
from polhode.harness.common.files import write_file
from polhode.harness.common.machine import header
from polhode.harness.common.store import Record
from polhode.harness.common.text import duration, in_two_digits, markdown, short
from polhode.harness.pages.figures.profiles import profiles
from polhode.harness.pages.figures.work_precision import panels, save
from polhode.models.problems.catalogue import PROBLEMS

TARGETS, PROFILED = (1e-3, 1e-6, 1e-9), 1e-6
FACTORS = (1.0, 2.0, 5.0, 20.0)
Times = dict[str, dict[str, float]]


def write_page(rows: Sequence[Record], folder: Path, command: str) -> Path:
    """Write page, figures and `runs.csv` into a folder; return the page's path."""
    table = pd.DataFrame(rows).assign(form="", slow_uncertainty=0.0)
    folder.mkdir(parents=True, exist_ok=True)
    runs = table.drop(columns=["machine", "versions", "form", "slow_uncertainty"])
    write_file(folder / "runs.csv", runs.to_csv(index=False))
    groups = [(str(name), runs.assign(slow_error=runs["error"])) for name, runs in table.groupby("problem", sort=False)]
    save(panels(groups, "slow_error", "error at the end", alike=False), folder, "work-precision")
    save(profiles(pd.DataFrame(_times(table, PROFILED).values()).dropna(how="all")), folder, "profiles")
    page = folder / "README.md"
    write_file(page, "\n".join([*header("Classical test problems", command, rows), *_body(table)]) + "\n")
    return page


def _times(table: pd.DataFrame, target: float) -> Times:
    """By problem and solver, the time at an error."""
    return {
        str(name): {solver: seconds for (_, solver), seconds in times_at_error(runs, target, "error").items()}
        for name, runs in table.groupby("problem", sort=False)
    }


def _shares(times: Times) -> dict[str, list[float]]:
    """By solver, for each problem the time over that of the fastest; infinite where it does not reach the error."""
    solved = {name: own for name, own in times.items() if own}
    solvers = dict.fromkeys(solver for own in solved.values() for solver in own)
    ratios = {solver: [own.get(solver, np.inf) / min(own.values()) for own in solved.values()] for solver in solvers}
    return dict(sorted(ratios.items(), key=lambda item: sorted(item[1])))


def _body(table: pd.DataFrame) -> list[str]:
    names = [name for name in PROBLEMS if name in set(table["problem"])]
    shares = _shares(_times(table, PROFILED))
    profile = [
        [solver, *(f"{100 * np.mean(np.array(own) <= factor):.0f} %" for factor in FACTORS), _reached(own)]
        for solver, own in shares.items()
    ]
    by_target = [_times(table, target) for target in TARGETS]
    fastest = [[name, *(_winner(times[name]) for times in by_target)] for name in names]
    status = table["status"].astype(str)
    failed = where(table, (status != "reached_end") & (status != "time_limit"))
    lines = [
        "Every solver that takes a problem, at every tolerance; the error is that of the state at the end against the "
        "published one: the largest of a component, relative where the component exceeds one in size. Relative and "
        "absolute tolerance are the same. Times are those of the fastest warm run.",
        "",
        f"## Who is fast, at an error of {short(PROFILED)}",
        "",
        "Share of the problems that a solver brings to this error within so many times the fastest one's time.",
        "",
        markdown(["solver", *(f"× {short(f)}" for f in FACTORS), "reached"], profile, right=range(1, 6)),
        "",
        "![Performance profiles](profiles.png)",
        "",
        "## Each problem",
        "",
        markdown(["problem", *(f"fastest at {short(target)}" for target in TARGETS)], fastest),
        "",
        "![Work and precision](work-precision.png)",
        "",
        *(f"- **{name}**: {PROBLEMS[name].source}." for name in names),
    ]
    if len(failed):
        reasons = failed[["problem", "solver", "tolerance", "status", "message"]].to_numpy().tolist()
        lines += ["", "## What failed", "", markdown(["problem", "solver", "tolerance", "status", "why"], reasons)]
    return [*lines, "", "`runs.csv` holds every run."]


def _reached(ratios: Sequence[float]) -> str:
    return f"{np.isfinite(ratios).sum()} of {len(ratios)}"


def _winner(times: Mapping[str, float]) -> str:
    if not times:
        return "–"
    (first, best), *others = times.items()
    lead = f", by {in_two_digits(others[0][1] / best)} before {others[0][0]}" if others else ""
    return f"{first}: {duration(best)}{lead}"
