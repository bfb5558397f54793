"""Where the data of the items are kept: CSV files beside the figures, and a record that says whether they hold."""

import ast
import hashlib
import json
import sys
import tomllib
from functools import cache
from inspect import ismodule
from io import BytesIO
from pathlib import Path

import pandas as pd

from polhode import models, solvers
from polhode.harness.common.files import write_file
from polhode.harness.common.machine import package_version
from polhode.harness.common.plain_json import digest
from polhode.harness.paper.item import Computed, Data, Grid, Item, Table, Verdict
from polhode.harness.paper.tables import tables_of

SCHEMA = 1
DIGITS = 8
LIBRARIES = ("numpy", "scipy", "heyoka", "cyrk")
# Modules of this package that change how items look, not what they compute.
APPEARANCE = ("polhode.harness.paper.drawing", "polhode.harness.paper.item", "polhode.harness.paper.claims")
# What the expressions and the computation of an item may end with.
FAILURES = (ArithmeticError, AttributeError, LookupError, NameError, RuntimeError, TypeError, ValueError)
NO_DATA = "Not computed yet"


def content_key(item: Item, grid: Grid) -> str:
    """Hash of all that an item's data depend on: its own code and formulas, models and solvers, the libraries."""
    code = code_of(item)
    content = {
        "schema": SCHEMA,
        "item": item.name,
        "settings": repr(getattr(item.compute, "__self__", None)),
        "grid": grid,
        "code": [_code(path) for path in code] + [_rooms()],
        "formulas": [tomllib.loads(path.read_text("utf-8")) for path in formulas_of(code)],
        "libraries": {name: package_version(name) for name in LIBRARIES},
    }
    return digest(content)


def code_of(item: Item) -> list[Path]:
    """Files of this package that an item's data depend on: its module, and those from which that one takes names."""
    found, waiting = set(), {item.compute.__module__}
    while waiting:
        name = waiting.pop()
        found.add(name)
        values = vars(sys.modules[name]).values()
        sources = {value.__name__ if ismodule(value) else getattr(value, "__module__", None) or "" for value in values}
        near = {source for source in sources if source.startswith("polhode.harness.paper.")}
        waiting |= near - found - set(APPEARANCE)
    return sorted(Path(sys.modules[name].__file__ or "") for name in found)


def formulas_of(code: list[Path]) -> list[Path]:
    """Files of formulas beside an item's code."""
    return [path for folder in sorted({path.parent for path in code}) for path in folder.glob("entries.toml")]


@cache
def _rooms() -> str:
    paths = (path for room in (models, solvers) for path in sorted(Path(room.__file__ or "").parent.rglob("*.py")))
    return _hash("".join(_code(path) for path in paths).encode())


@cache
def _code(path: Path) -> str:
    """Hash of a module's code: neither comments nor docstrings nor the way it is broken into lines change it."""
    tree = ast.parse(path.read_bytes())
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and ast.get_docstring(node) is not None:
            node.body = node.body[1:]
    return _hash(ast.dump(tree).encode())


def _hash(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


def write(folder: Path, item: Item, grid: Grid, parts: Computed) -> Data:
    """Write the tables of an item and, last, its record; return them as they read back.

    Whatever an interrupted run leaves is not taken for data.
    """
    folder.mkdir(parents=True, exist_ok=True)
    record = folder / f"{item.name}.json"
    record.unlink(missing_ok=True)
    contents = {
        name: pd.DataFrame(table).to_csv(index=False, float_format=f"%.{DIGITS}g", na_rep="nan").encode()
        for name, table in tables_of(parts).items()
    }
    for name, content in contents.items():
        write_file(folder / file_name(item, name), content)
    sums = {name: _hash(content) for name, content in contents.items()}
    write_file(record, json.dumps({"key": content_key(item, grid), "grid": grid, "tables": sums}, indent=1) + "\n")
    return {name: _table(content) for name, content in contents.items()}


def read(folder: Path, item: Item) -> tuple[Data, bool, Grid] | None:
    """The item's data, whether today's code made them, and their grid; None if there are none, or damaged ones."""
    try:
        record = json.loads((folder / f"{item.name}.json").read_text(encoding="utf-8"))
        contents = {name: (folder / file_name(item, name)).read_bytes() for name in record["tables"]}
        grid = Grid(record["grid"])
        if any(_hash(content) != record["tables"][name] for name, content in contents.items()):
            return None
    except (OSError, ValueError, KeyError):
        return None
    data = {name: _table(content) for name, content in contents.items()}
    return data, record["key"] == content_key(item, grid), grid


def judged(folder: Path, item: Item) -> tuple[Data, Verdict, bool] | str:
    """The item's data, its verdict, and whether today's code made them; or, in words, why there is no verdict."""
    found = read(folder, item)
    if found is None:
        return NO_DATA
    try:
        return found[0], item.verdict(found[0]), found[1]
    except FAILURES as error:
        # Older code kept other columns, or other rows.
        return f"The verdict failed ({type(error).__name__}: {error})" if found[1] else NO_DATA


def _table(content: bytes) -> Table:
    frame = pd.read_csv(BytesIO(content))
    numbers = dict.fromkeys(frame.select_dtypes("number"), float)
    return frame.astype(numbers).to_records(index=False)


def file_name(item: Item, table: str) -> str:
    """File of one of the item's tables."""
    return f"{item.name}-{table}.csv" if table else f"{item.name}.csv"
