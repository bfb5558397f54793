"""Bit flips in every kind of file that polhode reads again: what is read is what was written, or nothing."""

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

# What reading a damaged file may raise; then nothing is read.
REFUSALS = (ValueError, OSError)


@dataclass(frozen=True)
class Row:
    """A row of a table."""

    name: str
    pair: tuple[float, float]
    count: int


# Rows and records of all kinds of values: words, numbers whose digits do not end, pairs, counts.
ROWS = [Row(f"case {i}", (i / 7, -i / 3), i) for i in range(30)]
RECORDS = [
    {"key": f"{i}", "status": "reached_end", "seconds": i / 7, "work": {"steps": i}}
    for i in range(30)
]


def _store(path: Path) -> list[Any]:
    """The records of a store, but for their dates."""
    with Store(path) as store:
        return [{**record, "date": ""} for record in store]


def _write_store(path: Path) -> None:
    """Write `RECORDS` into a store."""
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
        # heyoka's own columns: a hash, a level of optimization, code of a few kB, a counter of uses.
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
    # The newest file there is the one that was just saved.
    numbers = max(
        (cached.cache_folder() / "numbers").iterdir(), key=lambda file: file.stat().st_mtime_ns
    )
    code = _machine_code(folder / "code")

    def reference() -> Any:
        loaded = cache.load("key")
        return None if loaded is None else loaded["x"].tolist()

    def shape() -> Any:
        loaded = cached.load("shape")
        return None if loaded is None else loaded.tolist()

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
    random = Random(seed)
    complaints = []
    with tempfile.TemporaryDirectory() as place:
        files = kinds(Path(place))
        written = {name: read() for name, (_, read) in files.items()}
        for number in range(count):
            name = list(files)[number % len(files)]
            path, read = files[name]
            whole = {file: file.read_bytes() for file in path.parent.iterdir() if file.is_file()}
            damaged = bytearray(whole[path])
            bit = random.randrange(8 * len(damaged))
            damaged[bit // 8] ^= 1 << bit % 8
            path.write_bytes(damaged)
            try:
                with redirect_stderr(StringIO()):
                    read_again = read()
            except REFUSALS:
                read_again = None
            if read_again is not None and read_again != written[name]:
                complaints.append(f"{name}: bit {bit} of {path.name} is used as good")
            # Reading may have replaced, removed or added files: the folder becomes as it was.
            for file in path.parent.iterdir():
                if file.is_file() and file not in whole:
                    file.unlink()
            for file, content in whole.items():
                file.write_bytes(content)
    return complaints
