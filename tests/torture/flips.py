"""Bit flips in every kind of file that polhode reads again: what comes back is what was written, or a complaint."""

import sqlite3
import tempfile
from collections.abc import Callable
from contextlib import closing, redirect_stderr
from dataclasses import dataclass
from io import StringIO
from pathlib import Path
from random import Random
from typing import Any

import numpy as np

from polhode.harness.common import cache
from polhode.harness.common.files import SUMS, read_file, write_file
from polhode.harness.common.store import Store, export, read_export, read_table, write_table
from polhode.models.files import cached
from polhode.solvers.machine_code import cached_code

REFUSALS = (ValueError, OSError)


@dataclass(frozen=True)
class Row:
    """A row of a table."""

    name: str
    pair: tuple[float, float]
    count: int


ROWS = [Row(f"case {i}", (i / 7, -i / 3), i) for i in range(30)]
RECORDS = [
    {"key": f"{i}", "status": "reached_end", "seconds": i / 7, "work": {"steps": i}}
    for i in range(30)
]


def _store(path: Path) -> list[Any]:
    with Store(path) as store:
        return [{**record, "date": ""} for record in store]


def _write_store(path: Path) -> None:
    with Store(path) as store:
        for record in RECORDS:
            store.put(record["key"], {}, record)


def _machine_code(folder: Path) -> Path:
    """A database as heyoka has it, with noise for code, and the checksums beside it."""
    folder.mkdir()
    with closing(sqlite3.connect(folder / "cache.db")) as code, code:
        code.execute(
            "CREATE TABLE cache (hash INTEGER PRIMARY KEY, opt_level, object BLOB, last_access)"
        )
        rows = [(number, 3, Random(number).randbytes(3000), number) for number in range(5)]
        code.executemany("INSERT INTO cache VALUES (?, ?, ?, ?)", rows)
    cached_code.note(folder)
    return folder / "cache.db"


def _entries(file: Path) -> list[Any] | None:
    """What heyoka would run after the check; None if it compiles anew."""
    if not cached_code.check(file.parent) or not file.exists():
        return None
    with closing(sqlite3.connect(file)) as code:
        return code.execute("SELECT hash, opt_level, object FROM cache ORDER BY hash").fetchall()


def kinds(folder: Path) -> dict[str, tuple[Path, Callable[[], Any]]]:
    """One file of each kind, and how it is read; None stands for what is computed anew."""
    write_table(folder / "errors.csv", Row, ROWS)
    export(RECORDS, folder / "records.jsonl")
    _write_store(folder / "store.sqlite")
    arrays = {"x": np.arange(200) / 7}
    cache.save("key", arrays)
    cached.save("shape", np.arange(300) / 7)
    numbers = max(
        (cached.cache_folder() / "numbers").iterdir(), key=lambda file: file.stat().st_mtime_ns
    )
    code = _machine_code(folder / "code")

    def reference() -> Any:
        found = cache.load("key")
        return None if found is None else found["x"].tolist()

    def shape() -> Any:
        found = cached.load("shape")
        return None if found is None else found.tolist()

    write_file(folder / "timed.json", '{"seconds": 1.5}', summed=True)
    return {
        "table": (folder / "errors.csv", lambda: read_table(folder / "errors.csv", Row)),
        "records": (folder / "records.jsonl", lambda: list(read_export(folder / "records.jsonl"))),
        "sums": (folder / SUMS, lambda: read_table(folder / "errors.csv", Row)),
        "other data": (folder / "timed.json", lambda: read_file(folder / "timed.json")),
        "store": (folder / "store.sqlite", lambda: _store(folder / "store.sqlite")),
        "reference": (cache.path_of("key"), reference),
        "shape": (numbers, shape),
        "machine code": (code, lambda: _entries(code)),
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
            whole = {file: file.read_bytes() for file in path.parent.iterdir() if file.is_file()}
            content = whole[path]
            damaged, bit = bytearray(content), random.randrange(8 * len(content))
            damaged[bit // 8] ^= 1 << bit % 8
            path.write_bytes(damaged)
            try:
                with redirect_stderr(StringIO()):
                    found = read()
            except REFUSALS:
                found = None
            if found is not None and found != true[name]:
                complaints.append(f"{name}: bit {bit} of {path.name} is used as good")
            for file in path.parent.iterdir():
                if file.is_file() and file not in whole:
                    file.unlink()
            for file, content in whole.items():
                file.write_bytes(content)
    return complaints
