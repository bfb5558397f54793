"""The regime map: over St and error, which form and solver wins, by how much, and where it is a tie."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import isnan

import pandas as pd

from polhode.harness.analysis.frames import by_stokes, where
from polhode.harness.analysis.pareto import TIE, Method, cost, front, methods, pareto_front
from polhode.harness.references.uncertainty import known, least_known, uncertainty_of
from polhode.solvers.contract import Status

# Errors of the map, from the loosest to the tightest.
TARGETS = tuple(float(f"1e-{exponent}") for exponent in range(2, 13))

# Averaged equations are not tried over more slow time than this: all is over long before.
LONGEST_SLOW_TIME = 100.0


@dataclass(frozen=True)
class Cell:
    """The cheapest method at one St and error, and that of another label; None and NaN where none is known."""

    stokes: float
    target: float
    known: bool
    winner: Method | None = None
    second: Method | None = None
    seconds: float = float("nan")
    lead: float = float("nan")  # time of the second over that of the winner

    @property
    def tied(self) -> bool:
        """Whether the second is within `TIE` of the winner."""
        return self.lead <= TIE


def cells(records: pd.DataFrame, error: str, targets: Sequence[float] = TARGETS) -> list[Cell]:
    """Cells of the map of one scene at several St, by St and then by error, a column such as "slow_error"."""
    found = []
    for stokes, runs in by_stokes(records):
        uncertainty = runs[uncertainty_of(error)].dropna()
        limit = least_known(float(uncertainty.iloc[0]) if len(uncertainty) else None)
        fronts = {method: front(own, error) for method, own in methods(runs)}
        for target in targets:
            costs = {method: cost(points, target) for method, points in fronts.items()}
            found.append(_cell(stokes, target, costs) if target > limit else Cell(stokes, target, known=False))
    return found


def _cell(stokes: float, target: float, costs: dict[Method, float]) -> Cell:
    ranked = sorted((seconds, str(method), method) for method, seconds in costs.items() if not isnan(seconds))
    if not ranked:
        return Cell(stokes, target, known=True)
    seconds, _, winner = ranked[0]
    others = [entry for entry in ranked[1:] if entry[2].label != winner.label]
    later, _, second = others[0] if others else (float("nan"), "", None)
    return Cell(stokes, target, True, winner, second, seconds, later / seconds)


@dataclass(frozen=True)
class Standing:
    """How a method fares on a map, whether it wins or not."""

    method: Method
    won: int  # cells
    tied: int  # cells in which it is second, within the tie
    front: int  # St at which it lies on the Pareto front of all methods
    measured: int  # St at which it was run
    failures: dict[str, int]  # runs without a result, by status


def standings(records: pd.DataFrame, error: str, found: Sequence[Cell]) -> list[Standing]:
    """Every method of one scene at several St, those that win most of the cells first."""
    done = where(records, (records["status"] == Status.REACHED_END) & records["seconds"].notna())
    sure = where(done, known(done, error).fillna(value=False))
    fronts = [pareto_front(runs, error) for _, runs in sure.groupby("stokes")]
    on_front = [method for each in fronts for method, _ in methods(each)]
    winners = [cell.winner for cell in found]
    ties = [cell.second for cell in found if cell.tied]
    rows = []
    for method, own in methods(records):
        failures = own.loc[own["status"] != Status.REACHED_END, "status"].astype(str).value_counts(sort=False).to_dict()
        counts = winners.count(method), ties.count(method), on_front.count(method), len(set(own["stokes"]))
        rows.append(Standing(method, *counts, failures))
    return sorted(rows, key=lambda row: (-row.won, -row.front, -row.tied, str(row.method)))


def usual_form(found: Sequence[Cell]) -> str:
    """The full form that wins most cells."""
    forms = [cell.winner.form for cell in found if cell.winner and cell.winner.side != "averaged"]
    return max(dict.fromkeys(forms), key=forms.count, default="")
