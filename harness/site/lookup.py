"""The answer to a question of the opening page, from measured runs; `verdict.js` gives the same in a browser."""

from collections.abc import Mapping, Sequence
from math import inf
from typing import Any, NamedTuple

import numpy as np

from polhode.harness.analysis.pareto import TIE, cost

# St that differ by less than this share are the same: a typed St has few digits. An estimate: measured St
# lie far wider apart, so that one of them at most is the same. `verdict.js` has the same number.
_SAME = 1e-3

Column = Mapping[str, Any]
"""What was measured of one particle at one St, for one kind of error.

`particle` is its name, `want` the kind of error, "slow" (L and E) or "orientation" (`answers._WANTS`), and
`St` the Stokes number. `span` is the length of the runs in words, which `verdict.js` shows. `limit` is the
least error that the reference knows, None where its uncertainty is unknown: then it knows none. `methods`
holds form, solver, label, whether the form is averaged, and `points`, from the fastest run to the most
accurate one. A point has the error, the seconds of the fastest repeat, the tolerance, and the spread: the
longest repeat less the fastest, over the fastest. Methods of one label count as one: an averaged form or
`hybrid` by any solver, or a solver in any full form (`pareto.Method.label`).
"""


class _Run(NamedTuple):
    """A point of a method: a measured run."""

    error: float
    seconds: float
    tolerance: float
    spread: float  # of its repeats, over its seconds


class _Candidate(NamedTuple):
    """A method that gets to the requested error; in order, the cheapest comes first."""

    seconds: float  # Interpolated between two runs.
    form: str
    solver: str
    label: str
    averaged: bool
    run: _Run  # The fastest measured one that meets the error.


def look_up(
    columns: Sequence[Column], particle: str, want: str, stokes: float, error: float
) -> dict[str, Any]:
    """The answers at the requested St if it was measured, else at its measured neighbours on both sides.

    Parameters
    ----------
    columns
        What was measured.
    particle, want
        The name of the particle and the kind of error, as columns have them.
    stokes
        The requested St, above 0.
    error
        The requested error: of L and E over I_max, or of the orientation in rad.

    Returns
    -------
    dict
        `answers` has what `_answer` gives, for two St, one or none. `beyond` is whether the requested St
        lies below or above all measured ones: then there is one neighbour alone, or none.
    """
    # St = 0 is no neighbour: St are compared by their quotient.
    measured = [
        column
        for column in columns
        if (column["particle"], column["want"]) == (particle, want) and column["St"] > 0
    ]
    measured.sort(key=lambda column: column["St"])
    same = [column for column in measured if abs(column["St"] / stokes - 1) < _SAME]
    below = [column for column in measured if column["St"] < stokes]
    above = [column for column in measured if column["St"] > stokes]
    chosen = same or [*below[-1:], *above[:1]]
    beyond = not same and len(chosen) < 2
    return {"beyond": beyond, "answers": [_answer(column, error) for column in chosen]}


def _answer(column: Column, error: float) -> dict[str, Any]:
    """The run to make at one St, and what the averaged forms do there.

    `averaged` has form, least error and seconds of each averaged form. `known` is whether the reference
    resolves the error and methods were measured. The rest is there if a method gets to the error:
    `form` and `solver` are the recommended ones, `cost` is the interpolated time by which methods are
    ranked. `error`, `seconds` and `tolerance` belong to the fastest measured run that meets the error.
    `next` has form, solver and interpolated time of the best method of another label, or is None; `tied`
    is whether its time is not clearly longer.
    """
    answer: dict[str, Any] = {"St": column["St"]}
    answer["averaged"] = _averaged_forms(column["methods"], error)
    # At or below the limit nobody knows which run is good enough.
    known = column["limit"] is not None and error > column["limit"]
    methods = column["methods"] if known else []
    answer["known"] = bool(methods)
    ranked = sorted(_candidates(methods, error))
    if not ranked:
        return answer
    winner = ranked[0]
    # Rank is by interpolated time. An answer is never dearer than an averaged form that is good enough: the
    # quickest of those whose measured run is quicker than the winner's own wins.
    for candidate in ranked:
        if candidate.averaged and candidate.run.seconds < winner.run.seconds:
            winner = candidate
    rival = next((candidate for candidate in ranked if candidate.label != winner.label), None)
    run = winner.run
    answer |= {"form": winner.form, "solver": winner.solver, "cost": winner.seconds}
    answer |= {"error": run.error, "seconds": run.seconds, "tolerance": run.tolerance}
    answer |= {"next": None, "tied": False}
    if rival is not None:
        answer["next"] = [rival.form, rival.solver, rival.seconds]
        tie_factor = max(TIE, 1 + run.spread, 1 + rival.run.spread)
        # The ratio is below 1 where an averaged form has won by its measured run: that is a tie too.
        answer["tied"] = rival.seconds / winner.seconds <= tie_factor
    return answer


def _candidates(methods: Sequence[Mapping[str, Any]], error: float) -> list[_Candidate]:
    """The methods that get to the error, of the `methods` of a column."""
    candidates = []
    for method in methods:
        run = _run(method["points"], error)
        if run is None:
            continue
        # Error and seconds are the first two numbers of a point.
        seconds = cost(np.array(method["points"])[:, :2], error)
        names = (method["form"], method["solver"], method["label"])
        candidates.append(_Candidate(seconds, *names, method["averaged"], run))
    return candidates


def _averaged_forms(methods: Sequence[Mapping[str, Any]], error: float) -> list[list[Any]]:
    """Name, least error, and least time of a run that meets the error, or None, for each averaged form."""
    least_errors: dict[str, float] = {}
    least_seconds: dict[str, float | None] = {}
    for method in methods:
        if not method["averaged"]:
            continue
        form = method["form"]
        least_error = min(_Run(*point).error for point in method["points"])
        least_errors[form] = min(least_error, least_errors.get(form, inf))
        run = _run(method["points"], error)
        least_seconds.setdefault(form, None)
        if run is not None:
            least = least_seconds[form]
            least_seconds[form] = run.seconds if least is None else min(run.seconds, least)
    return [[form, least_errors[form], least_seconds[form]] for form in least_errors]


def _run(points: Sequence[Sequence[float]], error: float) -> _Run | None:
    """The fastest run that meets an error, or None: points go from the fastest run to the most accurate one."""
    runs = (_Run(*point) for point in points)
    return next((run for run in runs if run.error <= error), None)
