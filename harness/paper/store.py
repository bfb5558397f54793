"""Data of the items in a folder: CSV files with the tables, and a record in JSON.

The record `ITEM.json` is written last. It names the tables, and has the key of all that the data
depend on (`content_key`). Data are current if today's code has the same key. Each section has a
folder of its own, which the functions take.
"""

import json
from io import BytesIO
from pathlib import Path
from typing import NamedTuple

import pandas as pd

from polhode.harness.analysis.frames import read_csv
from polhode.harness.common.files import digest, read_file, write_file
from polhode.harness.common.machine import here
from polhode.harness.common.store import Record
from polhode.harness.paper.dependencies import code_key
from polhode.harness.paper.item import Computed, Data, Grid, Item, Table, Verdict
from polhode.harness.paper.tables import tables_of
from polhode.models.libraries import version_of

ITEM_SCHEMA = 1  # Version of the files: data of another one are not today's.
# Significant digits of numbers in the CSV files. Verdicts are computed from the files, so that these
# need more than the four digits of pages. A choice: more make the files larger.
DIGITS = 8
# Libraries by which items compute: data made with another version of one are not today's.
_LIBRARIES = ("numpy", "scipy", "heyoka", "cyrk")
# Exceptions with which computing, judging or drawing an item may end: the item fails, and the others
# go on.
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


class Stored(NamedTuple):
    """Data of an item as they are in the folder."""

    data: Data
    is_current: bool  # Whether today's code, settings and libraries would make the same.
    grid: Grid  # The grid on which they were computed.


class Judgement(NamedTuple):
    """Data of an item with their verdict."""

    data: Data
    verdict: Verdict
    is_current: bool  # As of `Stored`.
    grid: Grid


Judged = Judgement | str
"""A judgement, or in words why there is none."""


def content_key(item: Item, grid: Grid) -> str:
    """Hash of all that an item's data depend on: settings, code that computes, libraries."""
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
    # Without its record no table counts, should this be interrupted.
    record.unlink(missing_ok=True)
    for name, content in contents.items():
        # `summed`: the folder's SHA256SUMS gets its checksum, which `read_file` compares.
        write_file(folder / file_name(item, name), content, summed=True)
    record_content = {
        "key": content_key(item, grid),
        "grid": grid,
        "tables": [*contents],
        "measured": here(),
    }
    write_file(record, json.dumps(record_content, indent=1) + "\n")
    return {name: _table(content) for name, content in contents.items()}


def read(folder: Path, item: Item) -> Stored | None:
    """The item's data in the folder; None if there are none, or if one of the files is damaged."""
    try:
        record = json.loads((folder / f"{item.name}.json").read_text(encoding="utf-8"))
        contents = {name: read_file(folder / file_name(item, name)) for name in record["tables"]}
        grid = Grid(record["grid"])
    except (OSError, ValueError, KeyError):
        return None
    data = {name: _table(content) for name, content in contents.items()}
    return Stored(data, record["key"] == content_key(item, grid), grid)


def measured(folder: Path, item: Item) -> Record:
    """When, where and by which versions the item's data were made; empty if no file says so."""
    try:
        record = json.loads((folder / f"{item.name}.json").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return record.get("measured", {})


def judged(folder: Path, item: Item) -> Judged:
    """The item's data in the folder, judged; or in words why they cannot be."""
    stored = read(folder, item)
    if stored is None:
        return _NO_DATA
    try:
        verdict = item.experiment.judge(stored.data)
    except ITEM_FAILURES as error:
        if stored.is_current:
            return f"The verdict failed ({type(error).__name__}: {error})"
        # Older code wrote other columns or other rows, which today's `judge` cannot read.
        return _NO_DATA
    return Judgement(stored.data, verdict, stored.is_current, stored.grid)


def _table(content: bytes) -> Table:
    """A CSV file as a record array. All its numbers are floats, as integers could not be NaN."""
    frame = read_csv(BytesIO(content))
    numeric_columns = frame.select_dtypes("number")
    return frame.astype(dict.fromkeys(numeric_columns, float)).to_records(index=False)


def file_name(item: Item, table: str) -> str:
    """Name of the file of one of the item's tables; the first table, "", has the item's name."""
    return f"{item.name}-{table}.csv" if table else f"{item.name}.csv"
