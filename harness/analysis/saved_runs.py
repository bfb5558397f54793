"""Saved runs as one table, whichever way they were made: pytest-benchmark's JSON, a store, or its export."""

import json
from math import inf
from pathlib import Path
from typing import Any

import pandas as pd

from polhode.harness.analysis.frames import frame
from polhode.harness.common.store import Record, Store, read_export


def read_runs(path: Path) -> pd.DataFrame:
    """Records as a frame: of ``.json`` of the benchmark suite, ``.sqlite`` of `polhode bench`, or its ``.jsonl``.

    Or of a folder of such ``.json`` files, repetitions of one run: of each case the shortest comes last. Raises
    ValueError, in one line, if there are no such records.
    """
    records = _repeated(path) if path.is_dir() else _records(path)
    if not records:
        raise ValueError(f"{path}: got no records, expected at least one")
    return frame(records)


def _repeated(folder: Path) -> list[Record]:
    """Records of all runs in a folder, failed ones first and the shortest last."""
    records = [record for path in sorted(folder.glob("*.json")) for record in _records(path)]
    return sorted(records, key=lambda record: record.get("seconds") or inf, reverse=True)


def _records(path: Path) -> list[Record]:
    if path.suffix == ".sqlite" and path.is_file():
        with Store(path) as store:
            return store.records()
    try:
        if path.suffix == ".jsonl":
            return list(read_export(path))
        return benchmark_records(json.loads(path.read_text(encoding="utf-8")))
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        reason = f"no {error} in it" if isinstance(error, KeyError) else str(error)
        expected = "expected JSON of the benchmark suite, a .sqlite store, or its .jsonl export"
        raise ValueError(f"{path}: {expected} ({reason})") from None


def benchmark_records(contents: dict[str, Any]) -> list[Record]:
    """Records of the benchmark suite as the store has them; failed runs have no time."""
    surroundings = contents["machine_info"]["polhode"]
    records = []
    for benchmark in contents["benchmarks"]:
        info = benchmark["extra_info"]
        record = {"key": info["key"], **info["case"], **info["result"], **surroundings}
        record |= {"sentinel_seconds": info["sentinel_seconds"], "date": contents.get("datetime")}
        if "seconds_runs" in info:
            shortest, longest = benchmark["stats"]["min"], benchmark["stats"]["max"]
            record |= {"seconds": shortest, "seconds_spread": longest - shortest, "seconds_runs": info["seconds_runs"]}
        records.append(record)
    return records
