"""Two saved runs side by side, whichever way they were made: which cases became slower, less accurate, or failed.

`polhode compare` shows it. The "sentinel" is a fixed piece of arithmetic that is timed beside each case
(`polhode.harness.common.timing`): it takes longer where the machine is slower.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from math import inf
from pathlib import Path
from statistics import median
from typing import Any

import pandas as pd

from polhode.harness.analysis.frames import frame, of_runs, rows_of
from polhode.harness.common.store import Record, Store, is_record_file, read_export
from polhode.harness.references.uncertainty import least_known, uncertainty_of
from polhode.solvers.contract import Status

# Records that agree in these columns are of the same case; versions may differ.
_IDENTITY = [
    "scene_name",
    "stokes",
    "scene.time",
    "form",
    "solver",
    "tolerance",
    "samples",
    "backend",
    "jacobian",
]
# An error below this says nothing, however well the reference is known: it is rounding.
_LEAST_ERROR = 1e-13
# A change in time below this, in seconds, is the clock's; an estimate.
_LEAST_SECONDS = 2e-5
# Columns of errors, with the words for a regression of each.
_ERRORS = {"slow_error": "error of L and E", "orientation_error": "orientation error"}
# Timed cases, at least, of which the median ratio tells how much slower another machine is; an
# estimate.
_MIN_MACHINE_CASES = 5


@dataclass(frozen=True)
class Comparison:
    """Numbers of cases that two runs share or have alone, and the cases that got worse.

    `drift` is how many times as long the fixed piece of arithmetic took in the second run. Times
    are compared after division by it, or by what it took beside the case itself if that is more: a
    slow moment is no regression. On another machine or Python the sentinel does not compare:
    `drift` is then the median ratio of the cases' times, and 1 where fewer than
    `_MIN_MACHINE_CASES` are shared.
    """

    shared: int
    only_before: int
    only_after: int
    drift: float
    same_machine: bool
    regressions: pd.DataFrame  # `_IDENTITY`, `what`, `before` and `after`


def compare(
    before: pd.DataFrame, after: pd.DataFrame, *, slower: float, less_accurate: float
) -> Comparison:
    """Compare two frames of records by factors above 1, beyond the scatter of times and what references know.

    A time that grows by more than `slower`, or an error by more than `less_accurate`, is a regression.
    """
    first = _by_identity(before)
    second = _by_identity(after)
    same_machine = {*map(_machine, first.values())} == {*map(_machine, second.values())}
    shared = first.keys() & second.keys()
    if same_machine:
        drift = _sentinel(second) / _sentinel(first)
    else:
        drift = _ratio([(first[case], second[case]) for case in shared])
    worse = []
    for case in first:
        if case in shared:
            identity = dict(zip(_IDENTITY, case, strict=False))
            changes = _changes(first[case], second[case], drift, slower, less_accurate)
            worse += [{**identity, **change} for change in changes]
    regressions = pd.DataFrame(worse, columns=pd.Index([*_IDENTITY, "what", "before", "after"]))
    alone = len(first) - len(shared), len(second) - len(shared)
    return Comparison(len(shared), *alone, drift, same_machine, regressions)


def _by_identity(table: pd.DataFrame) -> dict[tuple[Any, ...], Record]:
    """Rows by what makes them the same case; of several, as of several versions or repetitions, the last counts."""
    rows = {}
    for row in rows_of(table):
        identity = (*map(row.get, _IDENTITY), _scene(row))
        rows[identity] = row
    return rows


def _scene(row: Record) -> frozenset[tuple[str, Any]]:
    """Shape and start, which another study may give the same name."""
    features = [
        (name, value)
        for name, value in row.items()
        if name.startswith("scene.") and value is not None
    ]
    return frozenset(
        (name, tuple(value) if isinstance(value, list) else value) for name, value in features
    )


def _sentinel(rows: Mapping[Any, Record]) -> float:
    """Median time of the fixed piece of arithmetic; 1 where nothing was measured."""
    times = [row["sentinel_seconds"] for row in rows.values() if row.get("sentinel_seconds")]
    return median(times) if times else 1.0


def _ratio(pairs: Sequence[tuple[Record, Record]]) -> float:
    """Median ratio of the times on two machines; 1 where too few cases have both."""
    ratios = [
        after["seconds"] / before["seconds"]
        for before, after in pairs
        if before.get("seconds") and after.get("seconds")
    ]
    return median(ratios) if len(ratios) >= _MIN_MACHINE_CASES else 1.0


def _changes(
    before: Record, after: Record, drift: float, slower: float, less_accurate: float
) -> list[Record]:
    """Changes for the worse in one case."""
    if before["status"] == Status.REACHED_END != after["status"]:
        # One that came near its time limit before may miss it by chance.
        close_to_limit = before["counted_seconds"] * slower * drift > after["max_seconds"]
        change = {"what": "status", "before": before["status"], "after": after["status"]}
        return [] if close_to_limit and after["status"] == Status.TIME_LIMIT else [change]
    changes = []
    if before.get("seconds") is not None and after.get("seconds") is not None:
        # How many times as long the sentinel took beside the case itself, where that compares.
        alone = before.get("sentinel_seconds")
        beside = after.get("sentinel_seconds")
        # Times of the second run are divided by `pace`.
        pace = (
            max(drift, beside / alone)
            if alone and beside and _machine(before) == _machine(after)
            else drift
        )
        first = before["seconds"]
        second = after["seconds"] / pace
        noise = _scatter(before) + _scatter(after) / pace
        if second > slower * first and second - first > max(_LEAST_SECONDS, noise):
            changes.append({"what": "seconds", "before": first, "after": second})
    for error, words in _ERRORS.items():
        first = before.get(error)
        second = after.get(error)
        floor = max(_LEAST_ERROR, least_known(after.get(uncertainty_of(error)) or 0.0))
        if first is not None and second is not None and second > max(floor, less_accurate * first):
            changes.append({"what": words, "before": first, "after": second})
    return changes


def _machine(row: Record) -> tuple[Any, ...]:
    """Machine and Python that a row was measured with."""
    return tuple(value for name, value in sorted(row.items()) if name.startswith("machine."))


def _scatter(row: Record) -> float:
    """How far repeated runs lie above their shortest, by the median: one disturbed run does not count."""
    # The records of some pages go without them.
    runs = row.get("seconds_runs") or [0.0]
    return median(runs) - min(runs)


def read_runs(path: Path) -> pd.DataFrame:
    """Records as a frame: of JSON of the benchmark suite or a folder of such, a ``.sqlite`` store, its ``.jsonl``."""
    # The last run of a case counts: in a folder, failed runs come first and the shortest last.
    paths = sorted(path.glob("*.json")) if path.is_dir() else [path]
    records = [*chain.from_iterable(map(_records, paths))]
    if path.is_dir():
        records.sort(key=lambda record: record.get("seconds") or inf, reverse=True)
    return of_runs(frame(records), path)


def _records(path: Path) -> list[Record]:
    """Records of one file, by its kind; ValueError, in one line, if it is none of them."""
    if path.suffix == ".sqlite" and path.is_file():
        with Store(path) as store:
            return list(store)
    try:
        if is_record_file(path):
            return list(read_export(path))
        return benchmark_records(json.loads(path.read_text(encoding="utf-8")))
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        reason = f"no {error} in it" if isinstance(error, KeyError) else str(error)
        expected = "expected JSON of the benchmark suite, a .sqlite store, or its .jsonl export"
        raise ValueError(f"{path}: {expected} ({reason})") from None


def benchmark_records(contents: dict[str, Any]) -> list[Record]:
    """Records of the benchmark suite as the store has them; failed runs have no time.

    Rows of other tests are left out. Before 0.2.0 failed runs stood among the others.
    """
    polhode = contents.get("polhode") or contents["machine_info"]["polhode"]
    surroundings = {name: polhode[name] for name in ("machine", "versions")}
    records = []
    for benchmark in [*contents["benchmarks"], *polhode.get("failed", [])]:
        info = benchmark["extra_info"]
        if "case" not in info:
            continue
        record = {"key": info["key"], **info["case"], **info["result"], **surroundings}
        record |= {"sentinel_seconds": info["sentinel_seconds"], "date": contents.get("datetime")}
        if "seconds_runs" in info:
            shortest = benchmark["stats"]["min"]
            longest = benchmark["stats"]["max"]
            record |= {
                "seconds": shortest,
                "seconds_spread": longest - shortest,
                "seconds_runs": info["seconds_runs"],
            }
        records.append(record)
    return records
