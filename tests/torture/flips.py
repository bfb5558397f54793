"""Bit flips in every kind of file that polhode reads again: what comes back is what was written, or a complaint."""

import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from random import Random
from typing import Any

import numpy as np

from polhode.harness.common import cache
from polhode.harness.common.files import SUMS, read_file, write_file
from polhode.harness.common.store import DamagedStoreError, Store, export, read_export
from polhode.harness.common.tables import read_table, write_table
from polhode.harness.picking.laws import load_laws, own_laws_path, parse_laws

REFUSALS = (ValueError, OSError, DamagedStoreError)


@dataclass(frozen=True)
class Row:
    """A row of a table."""

    name: str
    pair: tuple[float, float]
    count: int


ROWS = [Row(f"case {i}", (i / 7, -i / 3), i) for i in range(30)]
RECORDS = [{"key": f"{i}", "status": "reached_end", "seconds": i / 7, "work": {"steps": i}} for i in range(30)]


def _store(path: Path) -> list[Any]:
    with Store(path) as store:
        return [{**record, "date": ""} for record in store]


def _write_store(path: Path) -> None:
    with Store(path) as store:
        for record in RECORDS:
            store.put(record["key"], {}, record)


def kinds(folder: Path) -> dict[str, tuple[Path, Callable[[], Any]]]:
    """One file of each kind, and how it is read; None stands for what is computed anew."""
    write_table(folder / "errors.csv", Row, ROWS)
    export(RECORDS, folder / "records.jsonl")
    _write_store(folder / "store.sqlite")
    arrays = {"x": np.arange(200) / 7}
    cache.keep("key", arrays)
    load_laws().save(own_laws_path())

    def reference() -> Any:
        found = cache.load("key")
        return None if found is None else found["x"].tolist()

    write_file(folder / "timed.json", '{"seconds": 1.5}', summed=True)
    return {
        "table": (folder / "errors.csv", lambda: read_table(folder / "errors.csv", Row)),
        "records": (folder / "records.jsonl", lambda: list(read_export(folder / "records.jsonl"))),
        "sums": (folder / SUMS, lambda: read_table(folder / "errors.csv", Row)),
        "other data": (folder / "timed.json", lambda: read_file(folder / "timed.json")),
        "store": (folder / "store.sqlite", lambda: _store(folder / "store.sqlite")),
        "reference": (cache.path_of("key"), reference),
        "laws": (own_laws_path(), lambda: parse_laws(read_file(own_laws_path()).decode())),
    }


def flipped(seed: int, count: int) -> list[str]:
    """Complaints about so many flips, the kinds of files in turn."""
    random, complaints = Random(seed), []
    with tempfile.TemporaryDirectory() as place:
        files = kinds(Path(place))
        true = {name: read() for name, (_, read) in files.items()}
        for number in range(count):
            name = list(files)[number % len(files)]
            path, read = files[name]
            content = path.read_bytes()
            damaged, bit = bytearray(content), random.randrange(8 * len(content))
            damaged[bit // 8] ^= 1 << bit % 8
            path.write_bytes(damaged)
            try:
                found = read()
            except REFUSALS:
                found = None
            if found is not None and found != true[name]:
                complaints.append(f"{name}: bit {bit} of {path.name} is used as good")
            for beside in path.parent.glob(f"{path.name}-*"):
                beside.unlink()
            path.write_bytes(content)
    return complaints
