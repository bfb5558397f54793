"""Data of the items: CSV files beside the figures, and a record that says whether they hold."""

import json
from io import BytesIO
from pathlib import Path

import pandas as pd

from polhode.harness.analysis.frames import read_csv
from polhode.harness.common.files import digest, read_file, write_file
from polhode.harness.common.machine import here
from polhode.harness.common.store import Record
from polhode.harness.paper.dependencies import code_key
from polhode.harness.paper.item import Computed, Data, Grid, Item, Table, Verdict
from polhode.harness.paper.tables import tables_of
from polhode.models.libraries import version_of

ITEM_SCHEMA = 1  # Version of the files.
DIGITS = 8  # Significant digits of the numbers in them.
# Libraries by which items compute: data made with another version are not today's.
_LIBRARIES = ("numpy", "scipy", "heyoka", "cyrk")
# Exceptions with which the computation of an item may end.
ITEM_FAILURES = (
    ArithmeticError,
    AttributeError,
    ImportError,
    LookupError,
    RuntimeError,
    TypeError,
    ValueError,
)
_NO_DATA = "Not computed yet"
# Data, verdict, whether today's code made the data, and their grid; or, in words, why there is none.
Judged = tuple[Data, Verdict, bool, Grid] | str


def content_key(item: Item, grid: Grid) -> str:
    """Hash of all that an item's data depend on: its settings, all code that computes, the libraries."""
    content = {
        "schema": ITEM_SCHEMA,
        "item": item.name,
        "settings": repr(item.experiment),
        "grid": grid,
        "code": code_key(item.experiment),
        "libraries": {name: version_of(name) for name in _LIBRARIES},
    }
    return digest(content)


def write(folder: Path, item: Item, grid: Grid, parts: Computed) -> Data:
    """Write the tables of an item and, last, its record; return them as they read back."""
    folder.mkdir(parents=True, exist_ok=True)
    contents = {
        name: pd.DataFrame(table)
        .to_csv(index=False, float_format=f"%.{DIGITS}g", na_rep="nan")
        .encode()
        for name, table in tables_of(parts).items()
    }
    record = folder / f"{item.name}.json"
    record.unlink(missing_ok=True)
    for name, content in contents.items():
        write_file(folder / file_name(item, name), content, summed=True)
    record_content = {
        "key": content_key(item, grid),
        "grid": grid,
        "tables": [*contents],
        "measured": here(),
    }
    write_file(record, json.dumps(record_content, indent=1) + "\n")
    return {name: _table(content) for name, content in contents.items()}


def read(folder: Path, item: Item) -> tuple[Data, bool, Grid] | None:
    """The item's data, whether today's code made them, and their grid; None if there are none, or damaged ones."""
    try:
        record = json.loads((folder / f"{item.name}.json").read_text(encoding="utf-8"))
        contents = {name: read_file(folder / file_name(item, name)) for name in record["tables"]}
        grid = Grid(record["grid"])
    except (OSError, ValueError, KeyError):
        return None
    data = {name: _table(content) for name, content in contents.items()}
    return data, record["key"] == content_key(item, grid), grid


def measured(folder: Path, item: Item) -> Record:
    """When, where and by what the item's data were made; empty if that was not kept, or there are none."""
    try:
        record = json.loads((folder / f"{item.name}.json").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return record.get("measured", {})


def judged(folder: Path, item: Item) -> Judged:
    """The item's data, verdict, whether today's code made them, and their grid; or, in words, why there is none."""
    stored = read(folder, item)
    if stored is None:
        return _NO_DATA
    try:
        return stored[0], item.experiment.judge(stored[0]), *stored[1:]
    except ITEM_FAILURES as error:
        # Older code kept other columns, or other rows.
        return f"The verdict failed ({type(error).__name__}: {error})" if stored[1] else _NO_DATA


def _table(content: bytes) -> Table:
    """A CSV file as a record array; all numbers are floats, as an integer column could hold no NaN."""
    frame = read_csv(BytesIO(content))
    return frame.astype(dict.fromkeys(frame.select_dtypes("number"), float)).to_records(index=False)


def file_name(item: Item, table: str) -> str:
    """File of one of the item's tables."""
    return f"{item.name}-{table}.csv" if table else f"{item.name}.csv"
