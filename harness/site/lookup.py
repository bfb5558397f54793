"""The answer to a question of the opening page, from measured runs; `verdict.js` gives the same in a browser."""

from collections.abc import Mapping, Sequence
from math import isnan
from typing import Any

import numpy as np

from polhode.harness.analysis.pareto import TIE, cost

# St that differ by less than this share are the same: a typed St has few digits.
_SAME = 1e-3

Column = Mapping[str, Any]
"""What was measured of one particle at one St, for one kind of error.

`limit` is the least error that the reference knows; `methods` holds form, solver, label, whether the
form is averaged, and `points`: error, seconds, tolerance and the spread of the repeats over their time,
from the fastest run to the most accurate one.
"""


def look_up(
    columns: Sequence[Column], particle: str, want: str, stokes: float, error: float
) -> dict[str, Any]:
    """The answers at the requested St if it was measured, else at its measured neighbours on both sides.

    `beyond` is whether it lies below or above all measured St: then there is one neighbour alone, or none.
    """
    own = [one for one in columns if (one["particle"], one["want"]) == (particle, want)]
    own = sorted((one for one in own if one["St"] > 0), key=lambda one: one["St"])
    same = [one for one in own if abs(one["St"] / stokes - 1) < _SAME]
    below = [one for one in own if one["St"] < stokes][-1:]
    above = [one for one in own if one["St"] > stokes][:1]
    chosen = same or [*below, *above]
    beyond = not same and len(chosen) < 2
    return {"beyond": beyond, "answers": [_answer(column, error) for column in chosen]}


def _answer(column: Column, error: float) -> dict[str, Any]:
    """The run to make at one St, and what the averaged forms do there.

    `cost` is the interpolated time by which methods are ranked; `error`, `seconds` and `tolerance` are those of the
    fastest measured run that meets the error. `averaged` has form, least error and seconds of each averaged form.
    """
    # Of each averaged method: form, solver, least error, seconds of a run that meets the error.
    averaged = []
    for method in column["methods"]:
        if method["averaged"]:
            least = min(point[0] for point in method["points"])
            run = _run(method["points"], error)
            averaged.append([method["form"], method["solver"], least, run[1] if run else None])
    answer: dict[str, Any] = {"St": column["St"], "averaged": _best_of_each(averaged)}
    # At or below the limit nobody knows which run is good enough.
    methods = column["methods"] if column["limit"] is None or error > column["limit"] else []
    answer["known"] = bool(methods)
    ranked = []
    for method in methods:
        seconds = _cost(method["points"], error)
        if seconds is not None:
            ranked.append((seconds, method["form"], method["solver"], method))
    ranked.sort(key=lambda entry: entry[:3])
    if not ranked:
        return answer
    seconds, *_, winner = ranked[0]
    run = _run(winner["points"], error)
    assert run is not None
    # The cheapest by interpolation may have no cheap run: an averaged form that is good enough is
    # never dearer than what is recommended.
    for entry in ranked:
        other = _run(entry[3]["points"], error)
        if entry[3]["averaged"] and other is not None and other[1] < run[1]:
            seconds, *_, winner = entry
            run = other
    rivals = [entry for entry in ranked if entry[3]["label"] != winner["label"]]
    answer |= {"form": winner["form"], "solver": winner["solver"], "cost": seconds}
    answer |= {"error": run[0], "seconds": run[1], "tolerance": run[2]}
    answer |= {"next": None, "tied": False}
    if rivals:
        later, form, solver, rival = rivals[0]
        answer["next"] = [form, solver, later]
        other = _run(rival["points"], error)
        assert other is not None
        answer["tied"] = later / seconds <= max(TIE, 1 + run[3], 1 + other[3])
    return answer


def _best_of_each(averaged: Sequence[list[Any]]) -> list[list[Any]]:
    """The least error of each averaged form, and the least time of a run that is good enough."""
    best: dict[str, list[Any]] = {}
    for form, _, least, seconds in averaged:
        entry = best.setdefault(form, [form, least, None])
        entry[1] = min(entry[1], least)
        if seconds is not None and (entry[2] is None or seconds < entry[2]):
            entry[2] = seconds
    return [*best.values()]


def _run(points: Sequence[Sequence[float]], error: float) -> Sequence[float] | None:
    """The fastest run whose error is no larger."""
    return next((point for point in points if point[0] <= error), None)


def _cost(points: Sequence[Sequence[float]], error: float) -> float | None:
    """Time for an error, logarithms interpolated between two runs, as the map's; None where no run gets there."""
    seconds = cost(np.array(points)[:, :2], error)
    return None if isnan(seconds) else seconds
