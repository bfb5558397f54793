"""Two saved runs of the same study compared: which cases became slower, less accurate, or failed.

`polhode compare` shows it. `read_runs` reads either run, and `compare` matches their cases. The
"sentinel" is a fixed piece of arithmetic that is timed beside each case
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
# Errors up to this one, over I_max or in rad, do not count, however well the reference is known: they are
# rounding. An estimate: some 450 times the distance of doubles near 1.
_LEAST_ERROR = 1e-13
# Seconds: a smaller change in time is the clock's and the call's. An estimate.
_LEAST_SECONDS = 2e-5
# Columns of errors, with the words for a regression of each.
_ERRORS = {"slow_error": "error of L and E", "orientation_error": "orientation error"}
# Least number of timed cases whose median ratio tells how much slower another machine is. An
# estimate.
_MIN_MACHINE_CASES = 5


@dataclass(frozen=True)
class Comparison:
    """Numbers of cases that two runs share or have alone, and the cases that got worse.

    `drift` says how many times as long the second run's machine takes. On the same machine that is
    the ratio of the sentinel's times. On another machine or Python the sentinel does not compare:
    there it is the median ratio of the cases' times, or 1 if fewer than `_MIN_MACHINE_CASES` are
    shared.
    """

    shared: int
    only_before: int
    only_after: int
    drift: float
    same_machine: bool
    regressions: pd.DataFrame  # Columns `_IDENTITY`, `what`, `before` and `after`.


def compare(
    before: pd.DataFrame, after: pd.DataFrame, *, slower: float, less_accurate: float
) -> Comparison:
    """Compare two frames of records.

    A time that grows by a factor of more than `slower` is a regression, and so is an error that
    grows by a factor of more than `less_accurate`. Changes within the scatter of the times, or within what
    the reference resolves, are none. A run that fails, and did not before, is a regression too.
    """
    first = _by_identity(before)
    second = _by_identity(after)
    shared = [case for case in first if case in second]
    same_machine = {*map(_machine, first.values())} == {*map(_machine, second.values())}
    if same_machine:
        drift = _sentinel(second) / _sentinel(first)
    else:
        drift = _median_ratio([(first[case], second[case]) for case in shared])
    rows = []
    for case in shared:
        # The last part of a case is its shape and start, which the table does not show.
        columns = dict(zip(_IDENTITY, case[:-1], strict=True))
        changes = _changes(first[case], second[case], drift, slower, less_accurate)
        rows += [{**columns, **change} for change in changes]
    regressions = pd.DataFrame(rows, columns=pd.Index([*_IDENTITY, "what", "before", "after"]))
    return Comparison(
        shared=len(shared),
        only_before=len(first) - len(shared),
        only_after=len(second) - len(shared),
        drift=drift,
        same_machine=same_machine,
        regressions=regressions,
    )


def _by_identity(table: pd.DataFrame) -> dict[tuple[Any, ...], Record]:
    """Rows by case: the values in `_IDENTITY`, and shape and start.

    The last row of a case counts, if there are several, as of several versions.
    """
    rows = {}
    for row in rows_of(table):
        identity = (*map(row.get, _IDENTITY), _scene(row))
        rows[identity] = row
    return rows


def _scene(row: Record) -> frozenset[tuple[str, Any]]:
    """Shape and start: another study may give the same name to another scene."""
    features = []
    for name, value in row.items():
        if name.startswith("scene.") and value is not None:
            features.append((name, tuple(value) if isinstance(value, list) else value))
    return frozenset(features)


def _sentinel(rows: Mapping[Any, Record]) -> float:
    """Median time of the sentinel, in seconds; 1 where nothing was measured."""
    times = [row["sentinel_seconds"] for row in rows.values() if row.get("sentinel_seconds")]
    return median(times) if times else 1.0


def _median_ratio(pairs: Sequence[tuple[Record, Record]]) -> float:
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
    """Changes for the worse in one case: what got worse, and its values before and after."""
    if before["status"] == Status.REACHED_END and after["status"] != Status.REACHED_END:
        if _missed_limit_by_chance(before, after, drift * slower):
            return []
        return [{"what": "status", "before": before["status"], "after": after["status"]}]
    return [
        *_slower(before, after, drift, slower),
        *_less_accurate(before, after, less_accurate),
    ]


def _missed_limit_by_chance(before: Record, after: Record, allowed: float) -> bool:
    """Whether a run ended at its time limit that came near it before.

    Near is a time that reaches the limit if it grows by the factor `allowed`. The limit holds for
    "counted_seconds", the time of the first run.
    """
    if after["status"] != Status.TIME_LIMIT:
        return False
    return before["counted_seconds"] * allowed > after["max_seconds"]


def _slower(before: Record, after: Record, drift: float, slower: float) -> list[Record]:
    """The change in time, if a case became slower by more than its machine did.

    `after` is the time of the second run as the machine of the first would take.
    """
    if before.get("seconds") is None or after.get("seconds") is None:
        return []
    pace = drift
    sentinel_before = before.get("sentinel_seconds")
    sentinel_after = after.get("sentinel_seconds")
    if sentinel_before and sentinel_after and _machine(before) == _machine(after):
        # A moment in which the machine was slower than in the whole run is no regression.
        pace = max(drift, sentinel_after / sentinel_before)
    first = before["seconds"]
    second = after["seconds"] / pace
    noise = _scatter(before) + _scatter(after) / pace
    if second > slower * first and second - first > max(_LEAST_SECONDS, noise):
        return [{"what": "seconds", "before": first, "after": second}]
    return []


def _less_accurate(before: Record, after: Record, less_accurate: float) -> list[Record]:
    """Errors that grew by more than the factor `less_accurate`, and that the reference resolves."""
    changes = []
    for error, words in _ERRORS.items():
        first = before.get(error)
        second = after.get(error)
        if first is None or second is None:
            continue
        resolved = least_known(after.get(uncertainty_of(error)) or 0.0)
        if second > max(_LEAST_ERROR, resolved, less_accurate * first):
            changes.append({"what": words, "before": first, "after": second})
    return changes


def _machine(row: Record) -> tuple[Any, ...]:
    """Machine and Python that a row was measured with."""
    return tuple(value for name, value in sorted(row.items()) if name.startswith("machine."))


def _scatter(row: Record) -> float:
    """How far the median of the repeated times lies above the shortest, in seconds.

    By the median, one disturbed run does not count. Records without repeated times have no scatter.
    """
    runs = row.get("seconds_runs") or [0.0]
    return median(runs) - min(runs)


def read_runs(path: Path) -> pd.DataFrame:
    """Records as a frame, from a file or a folder.

    A file is JSON of the benchmark suite, a ``.sqlite`` store, or a store's ``.jsonl`` export; a
    folder has several files of JSON. Raises ValueError, in one line, if a file is none of these or holds
    no record, OSError if it cannot be read.
    """
    if path.is_dir():
        records = [*chain.from_iterable(map(_records, sorted(path.glob("*.json"))))]
        # `_by_identity` takes the last run of a case: failed ones come first, the shortest last.
        records.sort(key=lambda record: record.get("seconds") or inf, reverse=True)
    else:
        records = _records(path)
    return of_runs(frame(records), path)


def _records(path: Path) -> list[Record]:
    """Records of one file, by its kind; ValueError, in one line, if it is of none."""
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
    """Records of the benchmark suite's JSON, as the store has them; failed runs have no time.

    Rows of other tests are left out.
    """
    # Older files have the suite's facts in `machine_info`; before 0.2.0 failed runs stood among the
    # others.
    polhode = contents.get("polhode") or contents["machine_info"]["polhode"]
    surroundings = {name: polhode[name] for name in ("machine", "versions")}
    records = []
    for benchmark in [*contents["benchmarks"], *polhode.get("failed", [])]:
        info = benchmark["extra_info"]
        if "case" not in info:
            continue
        record = {
            "key": info["key"],
            **info["case"],
            **info["result"],
            **surroundings,
            "sentinel_seconds": info["sentinel_seconds"],
            "date": contents.get("datetime"),
        }
        if "seconds_runs" in info:
            shortest = benchmark["stats"]["min"]
            longest = benchmark["stats"]["max"]
            record["seconds"] = shortest
            record["seconds_spread"] = longest - shortest
            record["seconds_runs"] = info["seconds_runs"]
        records.append(record)
    return records
