"""Who wins: the cheapest measured run that meets an error, and from which St on the averaged form does."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from polhode.harness.analysis.frames import where
from polhode.harness.common.text import scientific, short
from polhode.models.catalogue import form as find_form

SECOND_ORDER = "averaged-second-order"
TARGETS = (1e-1, 1e-2, 1e-3, 1e-4, 1e-6, 1e-8, 1e-10)
# Runs within this factor of the fastest are a tie: two thirds of it is what the machine's noise makes.
TIE = 1.15
# St further apart than this leave open where between them averaging begins to pay.
GAP = 10.0 * (1 + 1e-9)


@dataclass(frozen=True)
class Winner:
    """The cheapest run that meets an error at one St.

    Parameters
    ----------
    row : Series
        The record of the run.
    tied : tuple of str
        The other solvers of the same form within the tie.
    others : dict
        Those of other forms, by form.
    """

    row: pd.Series
    tied: tuple[str, ...]
    others: dict[str, tuple[str, ...]]

    @property
    def ties(self) -> str:
        """All methods within the tie, grouped by form; empty where there is none."""
        others = [f"{form} by {', '.join(solvers)}" for form, solvers in self.others.items()]
        return "; ".join([*([", ".join(self.tied)] if self.tied else []), *others])


def cheapest(runs: pd.DataFrame, target: float, error: str = "slow_error") -> Winner | None:
    """The cheapest run of `runs`, all of one scene, whose error meets `target`; None if none does."""
    good = runs.query(f"status == 'reached_end' and {error} <= @target and seconds.notna()").sort_values(by=["seconds"])
    if good.empty:
        return None
    best = good.iloc[0]
    near = good[good["seconds"] <= TIE * best["seconds"]]
    solvers: dict[str, dict[str, None]] = {}
    for form, solver in zip(near["form"], near["solver"], strict=True):
        solvers.setdefault(form, {})[solver] = None
    tied = {form: tuple(names) for form, names in solvers.items()}
    return Winner(best, tied.pop(best["form"])[1:], tied)


def averaged_wins_from(records: pd.DataFrame, target: float) -> float | None:
    """Smallest St from which on, at every larger St measured, an averaged form is the cheapest; None if it never is."""
    averaged = averaged_forms(records)
    start = None
    for stokes in sorted(set(records["stokes"].astype(float))):
        winner = cheapest(where(records, records["stokes"] == stokes), target)
        if winner is None or winner.row["form"] not in averaged:
            start = None
        elif start is None:
            start = stokes
    return start


def when_averaged_wins(records: pd.DataFrame, target: float, write: Callable[[float], str]) -> str | None:
    """At which of the St measured an averaged form is the cheapest, in words; None if it is not at the largest.

    A start between two St more than `GAP` apart is told as the two, for nothing is known between them. `write` writes
    an St.
    """
    start = averaged_wins_from(records, target)
    if start is None:
        return None
    numbers = sorted(set(records["stokes"].astype(float)))
    onwards = f"from St = {write(start)} on" if start < numbers[-1] else f"at St = {write(start)}"
    if len(numbers) == 1:
        return f"{onwards}, the only one measured"
    if start == numbers[0]:
        return f"{onwards}, the smallest measured"
    before = numbers[numbers.index(start) - 1]
    if start > GAP * before:
        return f"{onwards}, not at {write(before)} (no St between measured)"
    return onwards if start < numbers[-1] else f"{onwards}, the largest measured"


def sentences(records: pd.DataFrame, targets: Sequence[float] = TARGETS) -> list[str]:
    """The verdict on slow errors in sentences, from the records alone, scene by scene."""
    return [
        f"{scene}: {line}" if scene else line for scene, runs in by_scene(records) for line in _sentences(runs, targets)
    ]


def by_scene(records: pd.DataFrame) -> list[tuple[str, pd.DataFrame]]:
    """Runs of each scene under its name; those of a single one under none."""
    names = list(dict.fromkeys(records["scene_name"])) if "scene_name" in records else []
    if len(names) < 2:
        return [("", records)]
    return [(str(name), where(records, records["scene_name"] == name)) for name in names]


def _sentences(records: pd.DataFrame, targets: Sequence[float]) -> list[str]:
    if not averaged_forms(records):
        return []
    lines, never = [], []
    for target in targets:
        found = when_averaged_wins(records, target, short)
        if found is None:
            never.append(f"{target:g}")
        else:
            lines.append(f"For a slow error of {target:g} an averaged form is the cheapest {found}.")
    if never:
        lines.append(
            f"For a slow error of {', '.join(never)} no averaged form is the cheapest at the largest St measured."
        )
    return lines


def averaged_costs(records: pd.DataFrame) -> list[str]:
    """How little an averaged form's cost depends on St, and how much the second order gains, scene by scene."""
    return [
        f"{scene}: {line}" if scene else line
        for scene, runs in by_scene(records)
        for line in [*_costs_over_stokes(runs), *_second_against_first(runs)]
    ]


def _costs_over_stokes(records: pd.DataFrame) -> list[str]:
    lines = []
    for name in averaged_forms(records):
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


def _second_against_first(records: pd.DataFrame) -> list[str]:
    """Model errors and costs of the second order of averaging against the first, one sentence per St."""
    first = next((name for name in averaged_forms(records) if name != SECOND_ORDER), None)
    if first is None:
        return []
    lines = []
    for stokes in sorted(set(records["stokes"].astype(float))):
        runs = where(records, (records["stokes"] == stokes) & records["seconds"].notna())
        of = {name: where(runs, runs["form"] == name) for name in (first, SECOND_ORDER)}
        both = pd.merge(of[first], of[SECOND_ORDER], on=["solver", "tolerance"])
        if both.empty:
            continue
        ratios = both["seconds_y"].to_numpy(float) / both["seconds_x"].to_numpy(float)
        error, second_error = (own["model_slow_error"].to_numpy(float).max() for own in of.values())
        lines.append(
            f"At St = {stokes:g} the second order of averaging is off by {scientific(second_error)}, the first by "
            f"{scientific(error)}; it costs {np.median(ratios):.2f} times as much (median over solvers and tolerances)."
        )
    return lines


def averaged_forms(records: pd.DataFrame) -> list[str]:
    """Averaged forms that were run, by name."""
    return [str(name) for name in dict.fromkeys(records["form"]) if find_form(name).averaged]
