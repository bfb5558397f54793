"""Names of the rows of pytest-benchmark's tables: what a work-precision table shows beside the time.

pytest-benchmark has columns for times alone, so that form, solver, tolerance and error go into the name.
"extra_info" is what a benchmark carries beside its times: "case" and "result" of the suite, "polhode" of the
fixture `work_precision`.
"""

from collections.abc import Mapping, Sequence
from math import inf
from typing import Any

from polhode.harness.common.text import scientific, short
from polhode.harness.references.uncertainty import least_known


def name_rows(rows: Sequence[Any]) -> None:
    """Name the rows of one table, in place; those that are not polhode's keep their names."""
    suite = [row for row in rows if "case" in row["extra_info"]]
    front = _front(suite)
    cells = [_cells(row["extra_info"]) for row in suite]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    for row, texts in zip(suite, cells, strict=True):
        padded = [text.ljust(width) for text, width in zip(texts, widths, strict=True)]
        mark = "*" if id(row) in front else " "
        row["name"] = f"{'  '.join(padded)} {mark}"
    for row in rows:
        measured = row["extra_info"].get("polhode")
        if measured:
            row["name"] += f"  error {scientific(measured['error'])}"
            if measured["rhs_calls"] is not None:
                row["name"] += f", {measured['rhs_calls']} rhs"


def _cells(info: Mapping[str, Any]) -> list[str]:
    """Texts of a row's form, solver, tolerance and error, to be padded to columns."""
    case = info["case"]
    error = _error(info)
    least = _least(info)
    if error is None:
        accuracy = "error unknown"
    else:
        accuracy = f"error {scientific(error)}" if error > least else f"error <{scientific(least)}"
    return [case["form"], case["solver"], f"tol {short(case['tolerance'])}", accuracy]


def _error(info: Mapping[str, Any]) -> float | None:
    """The error of a run that the table shows."""
    return info["result"].get(f"{info['want']}_error")


def _least(info: Mapping[str, Any]) -> float:
    """The least error that the reference resolves; 0 where that is not known."""
    uncertainty = info["result"].get(f"{info['want']}_uncertainty")
    return 0.0 if uncertainty is None else least_known(uncertainty)


def _front(rows: Sequence[Any]) -> set[int]:
    """Identities of the rows that no other one beats in both time and error."""
    front: set[int] = set()
    best = inf
    for row in sorted(rows, key=lambda row: row["min"]):
        error = _error(row["extra_info"])
        # Errors below what the reference resolves count as equal.
        resolved = inf if error is None else max(error, _least(row["extra_info"]))
        if resolved < best:
            front.add(id(row))
            best = resolved
    return front
