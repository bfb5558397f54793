"""The data beside the page of the averaged forms' accuracy: `errors.csv` and `absent.csv`, written and read back."""

import csv
from collections.abc import Sequence
from dataclasses import astuple
from pathlib import Path

from polhode.harness.averaging.orders import VARIABLES, Absent, Measured

ERRORS, ABSENT = "errors.csv", "absent.csv"
HEAD = ["case", "family", "form"]
COLUMNS = [
    *HEAD,
    "a",
    "b",
    "c",
    "St",
    "slow_time",
    *(f"{kind}_{name}" for kind in ("model", "solver") for name in VARIABLES),
    "reference_uncertainty",
    "pieces",
]
# Fields of `Absent` under the names that `errors.csv` uses.
ABSENT_COLUMNS = [*HEAD, "St", "reason"]


def write_data(rows: Sequence[Measured], absent: Sequence[Absent], folder: Path) -> None:
    """Write both tables into a folder, in full precision."""
    _write(folder / ERRORS, COLUMNS, [_cells(row) for row in rows])
    _write(folder / ABSENT, ABSENT_COLUMNS, [astuple(row) for row in absent])


def read_data(folder: Path) -> tuple[list[Measured], list[Absent]]:
    """Read both tables back.

    Raises
    ------
    ValueError
        If a file is missing, or is none that `write_data` wrote.
    """
    rows = [_measured(row) for row in _read(folder / ERRORS, COLUMNS)]
    absent = [
        Absent(row["case"], row["family"], row["form"], float(row["St"]), row["reason"])
        for row in _read(folder / ABSENT, ABSENT_COLUMNS)
    ]
    return rows, absent


def _cells(row: Measured) -> list[object]:
    names = row.subject, row.family, row.form, *row.semi_axes
    return [*names, row.stokes, row.until, *row.model, *row.solver, row.uncertainty, row.pieces]


def _measured(row: dict[str, str]) -> Measured:
    def numbers(kind: str) -> tuple[float, ...]:
        return tuple(float(row[f"{kind}_{name}"]) for name in VARIABLES)

    return Measured(
        row["case"],
        row["family"],
        row["form"],
        (float(row["a"]), float(row["b"]), float(row["c"])),
        float(row["St"]),
        float(row["slow_time"]),
        numbers("model"),
        numbers("solver"),
        float(row["reference_uncertainty"]),
        int(row["pieces"]),
    )


def _write(path: Path, columns: Sequence[str], rows: Sequence[Sequence[object]]) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        csv.writer(file).writerows([columns, *rows])


def _read(path: Path, columns: Sequence[str]) -> list[dict[str, str]]:
    try:
        with path.open(newline="", encoding="utf-8") as file:
            table = csv.DictReader(file)
            if table.fieldnames != list(columns):
                raise ValueError(f"{path}: got the columns {table.fieldnames}, expected those of `polhode accuracy`")
            return list(table)
    except OSError as error:
        raise ValueError(f"{path}: {error.strerror}, expected the data that `polhode accuracy` writes") from None
