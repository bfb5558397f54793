"""The regime map: the cheapest method at each St and error, and how each method fares on the map.

`cells` makes the map of one scene from the frame of its runs (`pareto.py`). Times to an error are
interpolated between runs, by `costs`. Methods that share a label count as one: one averaged form by
several solvers, or several full forms by one solver. A `Cell` has the winner, and the best method of another
label. `harness/pages/regimes.py` makes maps and standings of it; the site's look-up reads their cells.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import pandas as pd

from polhode.harness.analysis.frames import by_stokes, where
from polhode.harness.analysis.pareto import (
    LEAST_GAIN,
    TIE,
    Method,
    costs,
    limit_of,
    methods,
    pareto_front,
)
from polhode.harness.references.uncertainty import known
from polhode.solvers.contract import Status

# Errors of the regime map, each power of ten from the loosest to the tightest: 0.01 is the coarsest that is
# asked for, and below 1e-12 rounding decides.
MAP_TARGETS = tuple(float(f"1e-{exponent}") for exponent in range(2, 13))
# The map has no runs of averaged equations over more slow time, t/St, than this: transients, which decay within
# a few units of it, are over long before. An estimate.
LONGEST_SLOW_TIME = 100.0


@dataclass(frozen=True)
class Cell:
    """The cheapest method at one St and error, and the next of another label.

    Methods are None, and times NaN, where there are none.
    """

    stokes: float
    target: float  # The error.
    resolved: bool  # Whether the reference resolves so small an error.
    winner: Method | None = None
    second: Method | None = None
    seconds: float = float("nan")  # Time of the winner.
    lead: float = float("nan")  # Time of the second over that of the winner.
    spread: float = 0.0  # How much repeats vary, over their time: the larger one of both methods.

    @property
    def tied(self) -> bool:
        """Whether the second is within `TIE` of the winner, or within what repeats vary by."""
        return self.lead <= max(TIE, 1.0 + self.spread)


def cells(records: pd.DataFrame, error: str, targets: Sequence[float] = MAP_TARGETS) -> list[Cell]:
    """Cells of the map of one scene at several St, by St and then by error.

    `error` is a column, such as "slow_error".
    """
    groups = by_stokes(records)
    times: Any = costs(groups, targets, error)
    map_cells = []
    for stokes, runs in groups:
        limit = limit_of(runs, error)
        for target in targets:
            if target > limit:
                seconds = times.loc[target, stokes].dropna()
                cell = _cell(stokes, target, seconds, runs, error)
            else:
                cell = Cell(stokes, target, resolved=False)
            map_cells.append(cell)
    return map_cells


def _cell(stokes: float, target: float, times: pd.Series, runs: pd.DataFrame, error: str) -> Cell:
    """The cell of one St and error, from the seconds of each method that reaches the error."""
    # pandas gives the methods, which are the index, as plain tuples.
    seconds_of: Any = times.to_dict()
    ranked = sorted((seconds, Method(*method)) for method, seconds in seconds_of.items())
    if not ranked:
        return Cell(stokes, target, resolved=True)
    best_seconds, winner = ranked[0]
    rivals = [(seconds, method) for seconds, method in ranked[1:] if method.label != winner.label]
    if not rivals:
        return Cell(stokes, target, resolved=True, winner=winner, seconds=best_seconds)
    second_seconds, second = rivals[0]
    return Cell(
        stokes,
        target,
        resolved=True,
        winner=winner,
        second=second,
        seconds=best_seconds,
        lead=second_seconds / best_seconds,
        spread=max(
            _spread(runs, winner, target, error),
            _spread(runs, second, target, error),
        ),
    )


def _spread(runs: pd.DataFrame, method: Method, target: float, error: str) -> float:
    """How much the repeats of a method's cheapest run to an error vary, over its time.

    It is 0 for a method that has no such run, or kept no repeats.
    """
    if "seconds_spread" not in runs:
        return 0.0
    by_method = (runs["form"] == method.form) & (runs["solver"] == method.solver)
    reached = runs["status"] == Status.REACHED_END
    good = where(runs, by_method & reached & (runs[error] <= target))
    good = good.dropna(subset=["seconds", "seconds_spread"]).sort_values(by=["seconds"])
    if good.empty:
        return 0.0
    cheapest = good.iloc[0]
    return float(cheapest["seconds_spread"]) / float(cheapest["seconds"])


@dataclass(frozen=True)
class Standing:
    """How a method fares on a map, whether it wins or not."""

    method: Method
    won: int  # Cells.
    tied: int  # Cells in which it is second, within the tie.
    front: int  # St at which it lies on the Pareto front of all methods.
    measured: int  # St at which it has records.
    failures: dict[
        str, int
    ]  # Records that are no success, by status, also those that were not run.


def standings(records: pd.DataFrame, error: str, panel: Sequence[Cell]) -> list[Standing]:
    """Every method of one scene at several St, those that win most of the cells first.

    `panel` is the scene's map. The fronts are of the measured runs whose error the reference
    resolves.
    """
    won = Counter(cell.winner for cell in panel)
    tied = Counter(cell.second for cell in panel if cell.tied)
    on_front = _counts_on_fronts(records, error)
    rows = []
    for method, runs in methods(records):
        failed = runs.loc[runs["status"] != Status.REACHED_END, "status"].astype(str)
        standing = Standing(
            method,
            won=won[method],
            tied=tied[method],
            front=on_front[method],
            measured=len(set(runs["stokes"])),
            failures=failed.value_counts(sort=False).to_dict(),
        )
        rows.append(standing)
    return sorted(rows, key=lambda row: (-row.won, -row.front, -row.tied, str(row.method)))


def _counts_on_fronts(records: pd.DataFrame, error: str) -> Counter[Method]:
    """At how many St each method lies on the Pareto front of all methods."""
    reached = records["status"] == Status.REACHED_END
    done = where(records, reached & records["seconds"].notna())
    resolved = where(done, known(done, error).fillna(value=False))
    counts: Counter[Method] = Counter()
    for _, runs in resolved.groupby("stokes"):
        counts.update(method for method, _ in methods(pareto_front(runs, error, LEAST_GAIN)))
    return counts


def usual_form(panel: Sequence[Cell]) -> str:
    """The full form that wins most cells, of several the first on the map; empty if none wins any.

    Maps name the winner by its solver alone where the form is this one.
    """
    winners = [cell.winner for cell in panel if cell.winner]
    # Averaged forms and `hybrid` have their own name as label.
    forms = [winner.form for winner in winners if winner.label != winner.form]
    return max(dict.fromkeys(forms), key=forms.count, default="")
