"""Results of the benchmark suite as files of asv, airspeed velocity, which compares them.

asv keeps a folder for each machine in which each commit has a file, and beside these a list of all
benchmarks. A benchmark has parameters, here solver and tolerance, and a result for each pair of
them. Keys and names that asv prescribes are written as they are, and empty where a run has nothing for them.
"""

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

_VERSION = 2  # Version of asv's format of results, and of benchmarks.json.
_MACHINE_VERSION = 1  # Version of asv's format of machine.json.
# Version of each benchmark: asv compares only results of one version.
_BENCHMARK_VERSION = "1"
# Seconds after which asv stops a benchmark that it runs itself, its own default. It runs none of these.
_TIMEOUT = 60.0
# Digits of a commit with which the name of a run's file begins, as in asv's own.
_COMMIT_DIGITS = 8
_MILLISECONDS = 1000  # In a second.
# Series that asv shows of the suite, by name: the column of a record, and asv's kind and unit.
_SERIES = {"time_solve": ("seconds", "time", "seconds"), "track_error": ("slow_error", "track", "")}
# asv's names for the values in a benchmark's list, in their order.
_COLUMNS = ("result", "params", "version", "started_at")


def write_asv(path: Path, folder: Path) -> Path:
    """Add the JSON of a run of the suite to a folder of asv's results.

    A scene at an St in a form is a benchmark. Failed runs are null. Writes `machine.json`, the list
    `benchmarks.json`, and the run's file.

    Parameters
    ----------
    path
        The JSON.
    folder
        asv's folder; it may be new.

    Returns
    -------
    Path
        The run's file.

    Raises
    ------
    ValueError
        The file is no such JSON, or names no commit. The message has one line.
    """
    contents = json.loads(path.read_text(encoding="utf-8"))
    records = _records(path, contents)
    commit = _commit(path, contents)
    milliseconds = _date(contents)
    machine = _machine(contents["machine_info"]["node"], records[0]["machine"])
    python = records[0]["machine"]["python"]
    # asv calls an environment so that it did not make itself.
    environment = f"existing-py{python}"
    tables = _tables(records)
    # Each list is in the order of `_COLUMNS`.
    results = {
        name: [table["result"], table["params"], _BENCHMARK_VERSION, milliseconds]
        for name, table in tables.items()
    }
    run = {
        "commit_hash": commit,
        "env_name": environment,
        "date": milliseconds,
        "params": {**machine, "python": python},
        "python": python,
        "requirements": records[0]["versions"],
        "env_vars": {},
        "result_columns": list(_COLUMNS),
        "results": results,
        "durations": {},
        "version": _VERSION,
    }
    node_folder = folder / machine["machine"]
    make_folder(folder)
    make_folder(node_folder)
    _write(node_folder / "machine.json", {**machine, "version": _MACHINE_VERSION})
    _write(folder / "benchmarks.json", _benchmarks(folder / "benchmarks.json", tables))
    return _write(node_folder / f"{commit[:_COMMIT_DIGITS]}-{environment}.json", run)


def _commit(path: Path, contents: Any) -> str:
    """The commit of the run; ValueError, in one line, if the file names none."""
    commit = contents.get("commit_info", {}).get("id")
    # A whole commit has 40 digits by SHA-1, 64 by SHA-256.
    pattern = rf"[0-9a-f]{{{_COMMIT_DIGITS},64}}"
    if isinstance(commit, str) and re.fullmatch(pattern, commit):
        return commit
    raise ValueError(f"{path}: got commit {commit!r}, expected the JSON of a run in a clone")


def _date(contents: Any) -> int:
    """The commit's time, or else the run's, as asv dates results: milliseconds since 1970."""
    moment = contents["commit_info"].get("time") or contents["datetime"]
    return int(_MILLISECONDS * datetime.fromisoformat(moment).timestamp())


def _machine(node: str, machine: Mapping[str, Any]) -> dict[str, str]:
    """A machine as asv describes it; a folder has its name.

    `node` is the machine's name in the network. `machine` is what a record says of it. Its "system" has the
    system and the architecture, as in "Linux x86_64".
    """
    name = re.sub(r"[^A-Za-z0-9._-]", "-", node) or "machine"
    system, _, _ = machine["system"].partition(" ")
    _, _, architecture = machine["system"].rpartition(" ")
    return {
        "arch": architecture,
        "cpu": machine["processor"],
        "machine": name,
        "num_cpu": str(machine["cores"]),
        "os": system,
        "ram": "",
    }


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
    """Benchmarks by asv's name, each with parameters, results, kind and unit.

    Results are in the order of the product of the parameters, solvers and tolerances.
    """
    groups: dict[tuple[str, float, str], list[Record]] = {}
    for record in records:
        key = record["scene_name"], record["scene"]["stokes"], record["form"]
        groups.setdefault(key, []).append(record)
    tables = {}
    for (scene, stokes, form), runs in groups.items():
        solvers = list(dict.fromkeys(run["solver"] for run in runs))
        tolerances = sorted({run["tolerance"] for run in runs}, reverse=True)
        run_of = {(run["solver"], run["tolerance"]): run for run in runs}
        ordered_runs = [run_of.get(method) for method in product(solvers, tolerances)]
        for series, (column, kind, unit) in _SERIES.items():
            tables[f"{scene}.St{in_full(stokes)}.{form}.{series}"] = {
                "result": [_value(run, column) for run in ordered_runs],
                # asv lists the values of parameters as Python writes them.
                "params": [list(map(repr, solvers)), list(map(in_full, tolerances))],
                "type": kind,
                "unit": unit,
            }
    return tables


def _value(record: Record | None, column: str) -> float | None:
    """A record's value as asv lists it; None, asv's failure, for a failed or missing run."""
    if record is None or record["status"] != Status.REACHED_END:
        return None
    return record.get(column)


def _benchmarks(path: Path, tables: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """The list of benchmarks in a file, with this run's benchmarks added."""
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
    """Write JSON."""
    return write_file(path, json.dumps(content, indent=1) + "\n")
