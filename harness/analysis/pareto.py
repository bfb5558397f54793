"""Speed at equal error: what a method takes for an error, who is the cheapest, and the regime map over St and error.

Frames have a row for each run: a form by a solver at a tolerance, with "seconds", "status" and errors
such as "slow_error", the error of L and E over I_max. The regime map has a `Cell` for each St and
error. A run lies on the Pareto front if no other one is both as fast and as accurate.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np
import pandas as pd

from polhode.harness.analysis.frames import by_stokes, where
from polhode.harness.analysis.in_full import HYBRID
from polhode.harness.references.uncertainty import known, least_known, uncertainty_of
from polhode.models.catalogue import form as find_form
from polhode.solvers.catalogue import solver as find_solver
from polhode.solvers.contract import Status

# Kinds of methods: of full equations by implicit, explicit, or solvers that know St, or averaged ones.
Side = Literal["implicit", "explicit", "tailored", "averaged"]
# The family of the solvers that know St.
_KNOWS_STOKES = "polhode"
# Errors of a page's tables.
TARGETS = (1e-1, 1e-2, 1e-3, 1e-4, 1e-6, 1e-8, 1e-10)
# Runs within this factor of the fastest are a tie: two thirds of the 15 % are what the machine's
# noise makes.
TIE = 1.15
# A run counts on a front of `standings` only if it lowers the error by this factor: less may be
# rounding. An estimate.
LEAST_GAIN = 2.0
# Errors of the regime map, from the loosest to the tightest.
MAP_TARGETS = tuple(float(f"1e-{exponent}") for exponent in range(2, 13))
# Averaged equations are not tried over more slow time than this: all is over long before.
LONGEST_SLOW_TIME = 100.0


class Method(NamedTuple):
    """A form by a solver."""

    form: str
    solver: str

    def __str__(self) -> str:
        return f"{self.form}, {self.solver}"

    @property
    def side(self) -> Side:
        """Which kind of method it is."""
        if find_form(self.form).averaged:
            return "averaged"
        if self.form == HYBRID or find_solver(self.solver).family == _KNOWS_STOKES:
            return "tailored"
        return "implicit" if find_solver(self.solver).implicit else "explicit"

    @property
    def label(self) -> str:
        """Its name on a map: the form's where it averages, since any solver will do, else the solver's."""
        return self.form if self.side == "averaged" or self.form == HYBRID else self.solver


def methods(runs: pd.DataFrame) -> Iterator[tuple[Method, pd.DataFrame]]:
    """Runs of each form and solver."""
    for (form, solver), method_runs in runs.groupby(["form", "solver"], sort=False):  # pyright: ignore[reportGeneralTypeIssues]
        yield Method(str(form), str(solver)), method_runs


def pareto_front(runs: pd.DataFrame, error: str = "slow_error", gain: float = 1.0) -> pd.DataFrame:
    """The runs that no other run beats in both time and error, from the fastest to the most accurate.

    Each but the first has at most 1/gain of the error of the one before it.
    """
    return runs.iloc[_unbeaten(runs[[error, "seconds"]].to_numpy(float), gain)]


def _unbeaten(points: np.ndarray, gain: float) -> list[int]:
    """Places of the points, error and time, that no other one beats in both, the fastest first."""
    order = np.lexsort(points.T)
    least = np.inf
    kept = []
    # From the fastest on, a point is kept if its error is below all before it.
    for place in order:
        lower = points[place, 0] < least if gain == 1.0 else points[place, 0] * gain <= least
        if lower:
            kept.append(place)
            least = points[place, 0]
    return kept


def front(runs: pd.DataFrame, error: str = "slow_error") -> np.ndarray:
    """Errors and times, shape (n, 2), along the Pareto front of the runs that reached their end."""
    points = runs[[error, "seconds"]].to_numpy(float, na_value=np.nan)
    reached = (runs["status"] == Status.REACHED_END).to_numpy(bool)
    points = points[reached & ~np.isnan(points).any(axis=1)]
    return points[_unbeaten(points, 1.0)]


def cost(points: np.ndarray, target: float) -> float:
    """Time at which a front reaches an error: logarithms interpolated between its runs; NaN where it never does."""
    if not len(points) or points[-1, 0] > target:
        return float("nan")
    if points[0, 0] <= target:
        return float(points[0, 1])
    # An error may be 0, which has no logarithm. Errors fall along a front: the signs make them grow.
    sizes = np.log(np.maximum(points[:, 0], np.finfo(float).tiny))
    seconds = np.log(points[:, 1])
    return float(np.exp(np.interp(-np.log(target), -sizes, seconds)))


def costs(
    groups: Iterable[tuple[Any, pd.DataFrame]], targets: Sequence[float], error: str = "slow_error"
) -> pd.DataFrame:
    """Times at errors: a row for each error and scene, a column for each form and solver; NaN where none is known.

    `groups` are pairs of a scene's name, or its St, and its runs. An error that the reference does
    not resolve has no times.
    """
    rows = {}
    for name, runs in groups:
        needed: Any = runs[["form", "solver", "status", "seconds", error]]
        fronts = {method: front(method_runs, error) for method, method_runs in methods(needed)}
        for target, resolved in zip(
            targets, np.array(targets) > limit_of(runs, error), strict=True
        ):
            seconds = {
                method: cost(points, target) for method, points in fronts.items() if resolved
            }
            rows[target, name] = seconds or dict.fromkeys(fronts, np.nan)
    return pd.DataFrame.from_dict(rows, orient="index")


def limit_of(runs: pd.DataFrame, error: str) -> float:
    """The least error that the reference of one scene's runs knows; NaN where its uncertainty is unknown."""
    uncertainty = runs[uncertainty_of(error)].dropna()
    return least_known(float(uncertainty.iloc[0]) if len(uncertainty) else None)


def cheapest(
    runs: pd.DataFrame, target: float, error: str = "slow_error"
) -> tuple[dict[Any, Any], tuple[Method, ...]] | None:
    """The cheapest run of one scene whose error meets `target`, and the other methods that tie with it; None if none.

    A tie is within `TIE`, or within the larger spread of the repeats of the two runs.
    """
    reached = runs["status"] == Status.REACHED_END
    good = where(runs, reached & (runs[error] <= target) & runs["seconds"].notna()).sort_values(
        by=["seconds"]
    )
    if good.empty:
        return None
    fastest = good.iloc[0]
    margin = (TIE - 1.0) * fastest["seconds"]
    if "seconds_spread" in good:
        # A lead counts beyond what the repeats of both runs vary by.
        margin = good["seconds_spread"].fillna(0.0).clip(lower=fastest["seconds_spread"])
        margin = margin.clip(lower=(TIE - 1.0) * fastest["seconds"])
    ties = where(good, good["seconds"] <= fastest["seconds"] + margin)
    return good.iloc[0].to_dict(), tuple(method for method, _ in methods(ties))[1:]


def averaged_wins_from(records: pd.DataFrame, target: float) -> float | None:
    """Smallest St from which on, at every larger St measured, an averaged form is the cheapest; None if it never is."""
    # Reset by every St at which another form is the cheapest.
    start = None
    for stokes, runs in by_stokes(records):
        winner = cheapest(runs, target)
        if winner is None or not find_form(winner[0]["form"]).averaged:
            start = None
        elif start is None:
            start = stokes
    return start


def averaged_forms(records: pd.DataFrame) -> list[str]:
    """Averaged forms that were run, by name."""
    return [str(name) for name in dict.fromkeys(records["form"]) if find_form(name).averaged]


def cost_over_stokes(records: pd.DataFrame, form: str) -> tuple[float, float, list[float]] | None:
    """Smallest and largest St, and the ratio of a form's times there: quantiles 5, 50 and 95 %; None without a pair."""
    done = where(records, (records["form"] == form) & records["seconds"].notna())
    table = (
        done.pivot_table(index=["solver", "tolerance"], columns="stokes", values="seconds")
        .dropna()
        .astype(float)
    )
    if len(table.columns) < 2 or table.empty:
        return None
    first = table.columns[0]
    last = table.columns[-1]
    return (
        float(first),
        float(last),
        (table[last] / table[first]).quantile([0.05, 0.5, 0.95]).tolist(),
    )


@dataclass(frozen=True)
class Cell:
    """The cheapest method at one St and error, and the next of another label; None and NaN where none is known."""

    stokes: float
    target: float
    known: bool  # whether the reference resolves so small an error
    winner: Method | None = None
    second: Method | None = None
    seconds: float = float("nan")
    lead: float = float("nan")  # time of the second over that of the winner
    spread: float = 0.0  # the larger one of both runs' spreads over their times

    @property
    def tied(self) -> bool:
        """Whether the second is within `TIE` of the winner, or within what repeats of the two runs vary by."""
        return self.lead <= max(TIE, 1.0 + self.spread)


def cells(records: pd.DataFrame, error: str, targets: Sequence[float] = MAP_TARGETS) -> list[Cell]:
    """Cells of the map of one scene at several St, by St and then by error, a column such as "slow_error"."""
    row_of_cells = []
    groups = by_stokes(records)
    times: Any = costs(groups, targets, error)
    for stokes, runs in groups:
        limit = limit_of(runs, error)
        for target in targets:
            seconds = times.loc[target, stokes].dropna()
            row_of_cells.append(
                _cell(stokes, target, seconds, runs, error)
                if target > limit
                else Cell(stokes, target, known=False)
            )
    return row_of_cells


def _cell(stokes: float, target: float, times: pd.Series, runs: pd.DataFrame, error: str) -> Cell:
    """The cell of one St and error, from the seconds of each method there."""
    seconds_of: Any = times.to_dict()
    ranked = sorted((seconds, Method(*method)) for method, seconds in seconds_of.items())
    if not ranked:
        return Cell(stokes, target, known=True)
    seconds, winner = ranked[0]
    # Methods with the winner's label, such as one averaged form by other solvers, are no rivals.
    rivals = [entry for entry in ranked[1:] if entry[1].label != winner.label]
    if not rivals:
        return Cell(stokes, target, True, winner, None, seconds)
    later, second = rivals[0]
    spread = max(_spread(runs, method, target, error) for method in (winner, second))
    return Cell(stokes, target, True, winner, second, seconds, later / seconds, spread)


def _spread(runs: pd.DataFrame, method: Method, target: float, error: str) -> float:
    """By how much the repeats of a method's cheapest run to an error vary, over its time; 0 where unknown."""
    if "seconds_spread" not in runs:
        return 0.0
    own = (runs["form"] == method.form) & (runs["solver"] == method.solver)
    good = where(runs, own & (runs["status"] == Status.REACHED_END) & (runs[error] <= target))
    good = good.dropna(subset=["seconds", "seconds_spread"]).sort_values(by=["seconds"])
    if good.empty:
        return 0.0
    return float(good.iloc[0]["seconds_spread"]) / float(good.iloc[0]["seconds"])


@dataclass(frozen=True)
class Standing:
    """How a method fares on a map, whether it wins or not."""

    method: Method
    won: int  # cells
    tied: int  # cells in which it is second, within the tie
    front: int  # St at which it lies on the Pareto front of all methods
    measured: int  # St at which it was run
    failures: dict[str, int]  # runs without a result, by status


def standings(records: pd.DataFrame, error: str, panel: Sequence[Cell]) -> list[Standing]:
    """Every method of one scene at several St, those that win most of the cells first."""
    done = where(records, (records["status"] == Status.REACHED_END) & records["seconds"].notna())
    sure = where(done, known(done, error).fillna(value=False))
    on_front = []
    for _, runs in sure.groupby("stokes"):
        on_front += [method for method, _ in methods(pareto_front(runs, error, LEAST_GAIN))]
    winners = [cell.winner for cell in panel]
    ties = [cell.second for cell in panel if cell.tied]
    rows = []
    for method, method_runs in methods(records):
        failures = (
            method_runs.loc[method_runs["status"] != Status.REACHED_END, "status"]
            .astype(str)
            .value_counts(sort=False)
            .to_dict()
        )
        counts = (
            winners.count(method),
            ties.count(method),
            on_front.count(method),
            len(set(method_runs["stokes"])),
        )
        rows.append(Standing(method, *counts, failures))
    return sorted(rows, key=lambda row: (-row.won, -row.front, -row.tied, str(row.method)))


def usual_form(panel: Sequence[Cell]) -> str:
    """The full form that wins most cells."""
    forms = [
        cell.winner.form for cell in panel if cell.winner and cell.winner.label != cell.winner.form
    ]
    return max(dict.fromkeys(forms), key=forms.count, default="")
