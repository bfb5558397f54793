"""Results of the benchmark suite in the files that asv (airspeed velocity) reads, compares and publishes."""

import json
import re
from collections.abc import Mapping, Sequence
from datetime import datetime
from itertools import product
from pathlib import Path
from typing import Any

from polhode.harness.analysis.comparison import benchmark_records
from polhode.harness.common.files import make_folder, write_file
from polhode.harness.common.store import Record
from polhode.harness.common.text import in_full
from polhode.solvers.contract import Status

# Versions of asv's file formats.
_VERSION = 2  # Results and benchmarks.json.
_MACHINE_VERSION = 1  # machine.json.
# Version of each benchmark; asv compares results of one version alone.
_BENCHMARK_VERSION = "1"
# Seconds after which asv would stop a benchmark that it runs itself.
_TIMEOUT = 60.0
# Series that asv shows of the suite: the column of a record, and asv's kind and unit.
_SERIES = {"time_solve": ("seconds", "time", "seconds"), "track_error": ("slow_error", "track", "")}
# Names, by asv, of the values that each result lists in this order.
_COLUMNS = ("result", "params", "version", "started_at")


def write_asv(path: Path, folder: Path) -> Path:
    """Add the JSON of a run of the suite to a folder of asv's results; return the file of the run.

    A scene at an St in a form is a benchmark, with solver and tolerance as its parameters; failed
    runs are null. `machine.json`, `benchmarks.json` and the run's file are written. ValueError, in
    one line, if the file is no such JSON, or names no commit.
    """
    contents = json.loads(path.read_text(encoding="utf-8"))
    records = _records(path, contents)
    commit = contents.get("commit_info", {}).get("id")
    if not (isinstance(commit, str) and re.fullmatch(r"[0-9a-f]{8,64}", commit)):
        raise ValueError(f"{path}: got commit {commit!r}, expected the JSON of a run in a clone")
    moment = contents["commit_info"].get("time") or contents["datetime"]
    # Since 1970, as asv dates its results.
    milliseconds = int(1000 * datetime.fromisoformat(moment).timestamp())
    machine = records[0]["machine"]
    node = re.sub(r"[^A-Za-z0-9._-]", "-", contents["machine_info"]["node"]) or "machine"
    described = {
        "arch": machine["system"].rpartition(" ")[2],
        "cpu": machine["processor"],
        "machine": node,
        "num_cpu": str(machine["cores"]),
        "os": machine["system"].partition(" ")[0],
        "ram": "",
    }
    tables = _tables(records)
    environment = f"existing-py{machine['python']}"
    result = {
        "commit_hash": commit,
        "env_name": environment,
        "date": milliseconds,
        "params": {**described, "python": machine["python"]},
        "python": machine["python"],
        "requirements": records[0]["versions"],
        "env_vars": {},
        "result_columns": list(_COLUMNS),
        "results": {
            name: [table["result"], table["params"], _BENCHMARK_VERSION, milliseconds]
            for name, table in tables.items()
        },
        "durations": {},
        "version": _VERSION,
    }
    make_folder(folder)
    make_folder(folder / node)
    _write(folder / node / "machine.json", {**described, "version": _MACHINE_VERSION})
    _write(folder / "benchmarks.json", _benchmarks(folder / "benchmarks.json", tables))
    return _write(folder / node / f"{commit[:8]}-{environment}.json", result)


def _records(path: Path, contents: Any) -> list[Record]:
    """Records of the suite's JSON; ValueError, in one line, if there are none."""
    try:
        records = benchmark_records(contents)
    except (KeyError, TypeError, AttributeError):
        records = []
    if not records:
        raise ValueError(f"{path}: got no records, expected JSON of the benchmark suite")
    return records


def _tables(records: Sequence[Record]) -> dict[str, dict[str, Any]]:
    """Series by asv's name: kind and unit, parameters, and results in the order of the parameters' product."""
    groups: dict[tuple[str, float, str], list[Record]] = {}
    for record in records:
        key = record["scene_name"], record["scene"]["stokes"], record["form"]
        groups.setdefault(key, []).append(record)
    tables = {}
    for (scene, stokes, form), runs in groups.items():
        solvers = list(dict.fromkeys(run["solver"] for run in runs))
        tolerances = sorted({run["tolerance"] for run in runs}, reverse=True)
        run_of = {(run["solver"], run["tolerance"]): run for run in runs}
        for series, (column, kind, unit) in _SERIES.items():
            results = [
                _value(run_of.get(method), column) for method in product(solvers, tolerances)
            ]
            tables[f"{scene}.St{in_full(stokes)}.{form}.{series}"] = {
                "result": results,
                "params": [list(map(repr, solvers)), list(map(in_full, tolerances))],
                "type": kind,
                "unit": unit,
            }
    return tables


def _value(record: Record | None, column: str) -> float | None:
    """A record's value as asv lists it; None, asv's mark of a failure, for a failed or missing run."""
    if record is None or record["status"] != Status.REACHED_END:
        return None
    return record.get(column)


def _benchmarks(path: Path, tables: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """The list of benchmarks, with the ones of earlier runs."""
    earlier = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
    new = {
        name: {
            "code": "",
            "name": name,
            "param_names": ["solver", "tolerance"],
            "params": table["params"],
            "timeout": _TIMEOUT,
            "type": table["type"],
            "unit": table["unit"],
            "version": _BENCHMARK_VERSION,
        }
        for name, table in tables.items()
    }
    return {**earlier, **new, "version": _VERSION}


def _write(path: Path, content: Mapping[str, Any]) -> Path:
    return write_file(path, json.dumps(content, indent=1) + "\n")
