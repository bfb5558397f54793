"""Two saved runs side by side: which cases became slower, less accurate, or failed."""

from collections.abc import Mapping
from dataclasses import dataclass
from statistics import median
from typing import Any

import pandas as pd

from polhode.harness.common.store import Record
from polhode.harness.references.uncertainty import least_known, uncertainty_of

# What makes two records the same case, whatever the versions they were made with.
IDENTITY = ["scene_name", "stokes", "scene.time", "form", "solver", "tolerance", "samples", "backend", "jacobian"]
# An error below this says nothing, however well the reference is known.
LEAST_ERROR = 1e-13
# A change in time below this, in seconds, is the clock's.
LEAST_SECONDS = 2e-5
ERRORS = ("slow_error", "orientation_error")


@dataclass(frozen=True)
class Comparison:
    """Numbers of cases that two runs share or have alone, and the cases that got worse.

    `drift` is how many times as long the fixed piece of arithmetic took in the second run. Times are compared after
    division by it, or by what it took beside the case itself if that is more: a slow moment is no regression. On
    another machine or Python the sentinel does not compare, and times are as they are.
    """

    shared: int
    only_before: int
    only_after: int
    drift: float
    same_machine: bool
    regressions: pd.DataFrame  # `IDENTITY`, `what`, `before` and `after`


def compare(before: pd.DataFrame, after: pd.DataFrame, *, slower: float, less_accurate: float) -> Comparison:
    """Compare two frames of records.

    A run that failed since counts, but for one that came near its time limit before. A time counts as longer if the
    shortest run of the second exceeds the shortest of the first by the factor, and by more than the runs of both
    scatter; an error as larger if it exceeds the factor, and the least error that the reference knows. Both factors are
    above 1.
    """
    first, second = _by_identity(before), _by_identity(after)
    same_machine = {*map(_machine, first.values())} == {*map(_machine, second.values())}
    drift = _sentinel(second) / _sentinel(first) if same_machine else 1.0
    shared = first.keys() & second.keys()
    worse = [
        {**dict(zip(IDENTITY, case, strict=True)), **change}
        for case in first
        if case in shared
        for change in _changes(first[case], second[case], drift, slower, less_accurate)
    ]
    return Comparison(
        len(shared),
        len(first) - len(shared),
        len(second) - len(shared),
        drift,
        same_machine,
        pd.DataFrame(worse, columns=pd.Index([*IDENTITY, "what", "before", "after"])),
    )


def _by_identity(table: pd.DataFrame) -> dict[tuple[Any, ...], Record]:
    """Rows by what makes them the same case; of several, as of several versions or repetitions, the last counts."""
    rows = (
        {str(name): value if isinstance(value, list) or not pd.isna(value) else None for name, value in row.items()}
        for row in table.to_dict(orient="records")
    )
    return {tuple(row.get(column) for column in IDENTITY): row for row in rows}


def _sentinel(rows: Mapping[Any, Record]) -> float:
    """Median time of the fixed piece of arithmetic; 1 where nothing was measured."""
    times = [row["sentinel_seconds"] for row in rows.values() if row.get("sentinel_seconds")]
    return median(times) if times else 1.0


def _changes(before: Record, after: Record, drift: float, slower: float, less_accurate: float) -> list[Record]:
    """What got worse in one case."""
    if before["status"] == "reached_end" != after["status"]:
        near = before["counted_seconds"] * slower * drift > after["max_seconds"]
        change = {"what": "status", "before": before["status"], "after": after["status"]}
        return [] if near and after["status"] == "time_limit" else [change]
    changes = []
    if before.get("seconds") is not None and after.get("seconds") is not None:
        pace = max(drift, _pace(before, after))
        first, second = before["seconds"], after["seconds"] / pace
        noise = _scatter(before["seconds_runs"]) + _scatter(after["seconds_runs"]) / pace
        if second > slower * first and second - first > max(LEAST_SECONDS, noise):
            changes.append({"what": "seconds", "before": first, "after": second})
    for error in ERRORS:
        first, second = before.get(error), after.get(error)
        floor = max(LEAST_ERROR, least_known(after.get(uncertainty_of(error)) or 0.0))
        if first is None or second is None:
            continue
        if second > max(floor, less_accurate * first):
            changes.append({"what": error.replace("_", " "), "before": first, "after": second})
    return changes


def _pace(before: Record, after: Record) -> float:
    """How many times as long the sentinel took beside the case itself; 0 where that does not compare."""
    first, second = before.get("sentinel_seconds"), after.get("sentinel_seconds")
    return second / first if first and second and _machine(before) == _machine(after) else 0.0


def _machine(row: Record) -> tuple[Any, ...]:
    """Machine and Python that a row was measured with."""
    return tuple(value for name, value in sorted(row.items()) if name.startswith("machine."))


def _scatter(runs: list[float]) -> float:
    """How far repeated runs lie above their shortest, by the median: one disturbed run does not count."""
    return median(runs) - min(runs)
