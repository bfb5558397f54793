"""Where the data of the items are kept: CSV files beside the figures, and a record that tells whether they hold."""

import csv
import hashlib
import json
import sys
from collections.abc import Iterator
from functools import cache
from importlib.metadata import version
from pathlib import Path

import numpy as np

from polhode import models, solvers
from polhode.harness.common.files import PartialFile
from polhode.harness.paper.item import Data, Grid, Item, Table

SCHEMA = 1
DIGITS = 8
LIBRARIES = ("numpy", "scipy", "heyoka", "cyrk")
# Modules of this package that change how items look, not what they compute.
APPEARANCE = ("polhode.harness.paper.drawing", "polhode.harness.paper.item")


def content_key(item: Item, grid: Grid) -> str:
    """Hash of all that an item's data depend on: its own code, that of models and solvers, the libraries."""
    content = {
        "schema": SCHEMA,
        "item": item.name,
        "settings": repr(getattr(item.compute, "__self__", None)),
        "grid": grid,
        "code": [_hash(path.read_bytes()) for path in code_of(item)] + [_rooms()],
        "libraries": {name: version(name) for name in LIBRARIES},
    }
    return _hash(json.dumps(content, sort_keys=True).encode())


def code_of(item: Item) -> list[Path]:
    """Files of this package that an item's data depend on: its module, and those from which that one takes names."""
    found, waiting = set(), {item.compute.__module__}
    while waiting:
        name = waiting.pop()
        found.add(name)
        sources = {getattr(value, "__module__", None) or "" for value in vars(sys.modules[name]).values()}
        near = {source for source in sources if source.startswith("polhode.harness.paper.")}
        waiting |= near - found - set(APPEARANCE)
    return sorted(Path(sys.modules[name].__file__ or "") for name in found)


@cache
def _rooms() -> str:
    paths = (path for room in (models, solvers) for path in sorted(Path(room.__file__ or "").parent.rglob("*.py")))
    return _hash("".join(_hash(path.read_bytes()) for path in paths).encode())


def _hash(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


def write(folder: Path, item: Item, grid: Grid, data: Data) -> None:
    """Write the tables of an item and, last, its record; whatever an interrupted run leaves is not taken for data."""
    folder.mkdir(parents=True, exist_ok=True)
    record = _record_path(folder, item)
    record.unlink(missing_ok=True)
    sums = {}
    for name, table in data.items():
        path = folder / _file_name(item, name)
        with PartialFile(path) as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(table)
            writer.writerows(_rows(table))
        sums[name] = _hash(path.read_bytes())
    content = {"key": content_key(item, grid), "grid": grid, "tables": sums}
    with PartialFile(record) as file:
        file.write(json.dumps(content, indent=1) + "\n")


def _rows(table: Table) -> Iterator[tuple[str, ...]]:
    columns = [
        column.tolist() if column.dtype.kind == "U" else [f"{value:.{DIGITS}g}" for value in column.tolist()]
        for column in map(np.asarray, table.values())
    ]
    return zip(*columns, strict=True)


def read(folder: Path, item: Item) -> tuple[Data, bool, Grid] | None:
    """The item's data, whether today's code made them, and their grid; None if there are none, or damaged ones."""
    try:
        record = json.loads(_record_path(folder, item).read_text(encoding="utf-8"))
        contents = {name: (folder / _file_name(item, name)).read_bytes() for name in record["tables"]}
        grid = Grid(record["grid"])
        if any(_hash(content) != record["tables"][name] for name, content in contents.items()):
            return None
    except (OSError, ValueError, KeyError):
        return None
    data = {name: _table(content.decode()) for name, content in contents.items()}
    return data, record["key"] == content_key(item, grid), grid


def _table(content: str) -> Table:
    header, *rows = csv.reader(content.splitlines())
    columns = zip(*rows, strict=True) if rows else [()] * len(header)
    return {name: _column(values) for name, values in zip(header, columns, strict=True)}


def _column(values: tuple[str, ...]) -> np.ndarray:
    try:
        return np.array(values, dtype=float)
    except ValueError:
        return np.array(values)


def _file_name(item: Item, table: str) -> str:
    return f"{item.name}-{table}.csv" if table else f"{item.name}.csv"


def _record_path(folder: Path, item: Item) -> Path:
    return folder / f"{item.name}.json"
