"""Who wins, in sentences."""

from collections.abc import Callable, Sequence

import pandas as pd

from polhode.harness.analysis.frames import by_scene, by_stokes
from polhode.harness.analysis.winners import TARGETS, averaged_forms, averaged_wins_from, costs_over_stokes
from polhode.harness.common.text import short

# St further apart than this leave open where between them averaging begins to pay.
GAP = 10.0 * (1 + 1e-9)


def when_averaged_wins(records: pd.DataFrame, target: float, write: Callable[[float], str]) -> str | None:
    """At which of the St measured an averaged form is the cheapest, in words; None if it is not at the largest.

    Where the St before the start is more than a factor `GAP` away, both are named, for nothing is known between them.
    `write` writes an St.
    """
    start = averaged_wins_from(records, target)
    if start is None:
        return None
    numbers = [stokes for stokes, _ in by_stokes(records)]
    onwards = f"from St = {write(start)} on" if start < numbers[-1] else f"at St = {write(start)}"
    if len(numbers) == 1:
        return f"{onwards}, the only one measured"
    if start == numbers[0]:
        return f"{onwards}, the smallest measured"
    before = numbers[numbers.index(start) - 1]
    if start > GAP * before:
        return f"{onwards}, not at {write(before)} (no St between measured)"
    return onwards if start < numbers[-1] else f"{onwards}, the largest measured"


def verdict(records: pd.DataFrame, targets: Sequence[float] = TARGETS) -> list[str]:
    """Where averaged forms win, in sentences, scene by scene."""
    return _each_scene(records, lambda runs: _averaged_or_not(runs, targets))


def averaged_costs(records: pd.DataFrame) -> list[str]:
    """How little an averaged form's cost depends on St, scene by scene."""
    return _each_scene(records, _costs_over_stokes)


def _each_scene(records: pd.DataFrame, lines: Callable[[pd.DataFrame], list[str]]) -> list[str]:
    return [f"{scene}: {line}" if scene else line for scene, runs in by_scene(records) for line in lines(runs)]


def _averaged_or_not(records: pd.DataFrame, targets: Sequence[float]) -> list[str]:
    if not averaged_forms(records):
        return []
    found = {short(target): when_averaged_wins(records, target, short) for target in targets}
    lines = [
        f"For a slow error of {target} an averaged form is the cheapest {words}."
        for target, words in found.items()
        if words
    ]
    never = ", ".join(target for target, words in found.items() if words is None)
    nowhere = f"For a slow error of {never} no averaged form is the cheapest at the largest St measured."
    return [*lines, nowhere] if never else lines


def _costs_over_stokes(records: pd.DataFrame) -> list[str]:
    lines = []
    for name in averaged_forms(records):
        found = costs_over_stokes(records, name)
        if found is not None:
            first, last, (low, middle, high) = found
            lines.append(
                f"The {name} form at St = {short(last)} costs {middle:.2f} times what it costs at St = {short(first)} "
                f"(median over solvers and tolerances; nine in ten lie between {low:.2f} and {high:.2f})."
            )
    return lines
