"""Who wins: the cheapest measured run that meets an error, and from which St on the averaged form does."""

from collections.abc import Sequence
from dataclasses import dataclass

import pandas as pd

from polhode.harness.tables import where
from polhode.models.catalogue import FORMS
from polhode.models.catalogue import form as find_form

TARGETS = (1e-1, 1e-2, 1e-3, 1e-4, 1e-6, 1e-8, 1e-10)
# Runs within this factor of the fastest are a tie: two thirds of it is what the machine's noise makes.
TIE = 1.15


@dataclass(frozen=True)
class Winner:
    """The cheapest run that meets an error at one St.

    Parameters
    ----------
    row : Series
        The record of the run.
    tied : tuple of str
        The other methods within the tie: solvers of the same form by their name, others as "form, solver".
    """

    row: pd.Series
    tied: tuple[str, ...]


def cheapest(runs: pd.DataFrame, target: float, error: str = "slow_error") -> Winner | None:
    """The cheapest run of `runs`, all of one scene, whose error meets `target`; None if none does."""
    good = runs.query(f"status == 'reached_end' and {error} <= @target and seconds.notna()").sort_values(by=["seconds"])
    if good.empty:
        return None
    best = good.iloc[0]
    near = good[good["seconds"] <= TIE * best["seconds"]]
    pairs = zip(near["form"], near["solver"], strict=True)
    names = dict.fromkeys(solver if form == best["form"] else f"{form}, {solver}" for form, solver in pairs)
    return Winner(best, tuple(names)[1:])


def averaged_wins_from(records: pd.DataFrame, target: float) -> float | None:
    """Smallest St from which on, at every larger St measured, an averaged form is the cheapest; None if it never is."""
    averaged = {name for name in FORMS if find_form(name).averaged}
    start = None
    for stokes in sorted(set(records["stokes"].astype(float))):
        winner = cheapest(where(records, records["stokes"] == stokes), target)
        if winner is None or winner.row["form"] not in averaged:
            start = None
        elif start is None:
            start = stokes
    return start


def sentences(records: pd.DataFrame, targets: Sequence[float] = TARGETS) -> list[str]:
    """The verdict on slow errors in sentences, from the records alone."""
    lines, never = [], []
    for target in targets:
        start = averaged_wins_from(records, target)
        if start is None:
            never.append(f"{target:g}")
        else:
            lines.append(f"For a slow error of {target:g} an averaged form is the cheapest from St = {start:g} on.")
    if never:
        lines.append(
            f"For a slow error of {', '.join(never)} no averaged form is the cheapest at the largest St measured."
        )
    return lines


def averaged_costs(records: pd.DataFrame) -> list[str]:
    """How little an averaged form's cost depends on St, in sentences, one per form."""
    lines = []
    for name in dict.fromkeys(records["form"]):
        if not find_form(name).averaged:
            continue
        done = where(records, (records["form"] == name) & records["seconds"].notna())
        table = (
            done.pivot_table(index=["solver", "tolerance"], columns="stokes", values="seconds").dropna().astype(float)
        )
        if len(table.columns) < 2 or table.empty:
            continue
        first, last = table.columns[0], table.columns[-1]
        ratio = (table[last] / table[first]).quantile([0.05, 0.5, 0.95]).tolist()
        lines.append(
            f"The {name} form at St = {last:g} costs {ratio[1]:.2f} times what it costs at St = {first:g} (median over "
            f"solvers and tolerances; nine in ten lie between {ratio[0]:.2f} and {ratio[2]:.2f})."
        )
    return lines
