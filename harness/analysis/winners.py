"""Who wins: the cheapest measured run that meets an error, and from which St on the averaged form does."""

from dataclasses import dataclass

import pandas as pd

from polhode.harness.analysis.frames import by_stokes, where
from polhode.harness.analysis.pareto import Method, methods
from polhode.models.catalogue import form as find_form

TARGETS = (1e-1, 1e-2, 1e-3, 1e-4, 1e-6, 1e-8, 1e-10)
# Runs within this factor of the fastest are a tie: two thirds of it is what the machine's noise makes.
TIE = 1.15


@dataclass(frozen=True)
class Winner:
    """The cheapest run that meets an error at one St, as a row of the frame, and the other methods within the tie."""

    row: pd.Series
    tied: tuple[Method, ...]


def cheapest(runs: pd.DataFrame, target: float, error: str = "slow_error") -> Winner | None:
    """The cheapest run of `runs`, all of one scene, whose error meets `target`; None if none does."""
    good = runs.query(f"status == 'reached_end' and {error} <= @target and seconds.notna()").sort_values(by=["seconds"])
    if good.empty:
        return None
    near = where(good, good["seconds"] <= TIE * good.iloc[0]["seconds"])
    return Winner(good.iloc[0], tuple(method for method, _ in methods(near))[1:])


def averaged_wins_from(records: pd.DataFrame, target: float) -> float | None:
    """Smallest St from which on, at every larger St measured, an averaged form is the cheapest; None if it never is."""
    averaged = averaged_forms(records)
    start = None
    for stokes, runs in by_stokes(records):
        winner = cheapest(runs, target)
        if winner is None or winner.row["form"] not in averaged:
            start = None
        elif start is None:
            start = stokes
    return start


def averaged_forms(records: pd.DataFrame) -> list[str]:
    """Averaged forms that were run, by name."""
    return [str(name) for name in dict.fromkeys(records["form"]) if find_form(name).averaged]


def costs_over_stokes(records: pd.DataFrame, form: str) -> tuple[float, float, list[float]] | None:
    """Smallest and largest St, and the ratio of a form's times there: quantiles 5, 50 and 95 %; None without a pair."""
    done = where(records, (records["form"] == form) & records["seconds"].notna())
    table = done.pivot_table(index=["solver", "tolerance"], columns="stokes", values="seconds").dropna().astype(float)
    if len(table.columns) < 2 or table.empty:
        return None
    first, last = table.columns[0], table.columns[-1]
    return float(first), float(last), (table[last] / table[first]).quantile([0.05, 0.5, 0.95]).tolist()
