"""The store: SQLite, one row per case, its key the hash of the case, so that resume means skipping known keys."""

import csv
import json
import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from polhode.harness.common.files import PartialFile
from polhode.harness.common.plain_json import dumps, loads

Record = dict[str, Any]

_TABLE = """
CREATE TABLE IF NOT EXISTS cases (
    key TEXT PRIMARY KEY,
    "case" TEXT NOT NULL,
    result TEXT NOT NULL,
    written TEXT NOT NULL DEFAULT (datetime('now'))
)
"""
_ALL = """SELECT key, strftime('%Y-%m-%dT%H:%M:%SZ', written), "case", result FROM cases ORDER BY rowid"""


class DamagedStoreError(RuntimeError):
    """The file is not a store, or a damaged one; its contents are left as they are."""


class Store:
    """A store file, made if it does not exist; two runs may share one.

    Raises DamagedStoreError if the file is no readable SQLite database, which is never overwritten.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        path.parent.mkdir(parents=True, exist_ok=True)
        with self._readable():
            self._connection = sqlite3.connect(path, timeout=60.0)
            try:
                self._prepare()
            except BaseException:
                self.close()
                raise

    def _prepare(self) -> None:
        self._connection.execute("PRAGMA journal_mode=WAL")
        if self._connection.execute("PRAGMA quick_check").fetchone()[0] != "ok":
            raise DamagedStoreError(f"{self.path}: the store is damaged")
        tables = {name for (name,) in self._connection.execute("SELECT name FROM sqlite_master")}
        if tables and "cases" not in tables:
            raise DamagedStoreError(f"{self.path}: a database of something else")
        with self._connection:
            self._connection.execute(_TABLE)

    def close(self) -> None:
        """Close the file."""
        self._connection.close()

    def __enter__(self) -> "Store":
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    def keys(self) -> set[str]:
        """Keys of all cases."""
        with self._readable():
            return {key for (key,) in self._connection.execute("SELECT key FROM cases")}

    def result(self, key: str) -> Record | None:
        """Result of one case; None if the store does not hold it."""
        with self._readable():
            row = self._connection.execute("SELECT result FROM cases WHERE key = ?", (key,)).fetchone()
        return None if row is None else json.loads(row[0])

    def put(self, key: str, case: Record, result: Record) -> None:
        """Write a case once; a second writer of the same key changes nothing."""
        row = key, json.dumps(case, sort_keys=True), json.dumps(result, sort_keys=True)
        with self._connection:
            self._connection.execute('INSERT OR IGNORE INTO cases (key, "case", result) VALUES (?, ?, ?)', row)

    def records(self) -> list[Record]:
        """All cases with their results, each as one flat dictionary, in the order of writing.

        `date` is the date and time in UTC, ISO 8601; that of the writing where the result does not tell.
        """
        with self._readable():
            rows = self._connection.execute(_ALL).fetchall()
        return [
            {"key": key, "date": written, **json.loads(case), **json.loads(result)}
            for key, written, case, result in rows
        ]

    @contextmanager
    def _readable(self) -> Iterator[None]:
        try:
            yield
        except sqlite3.DatabaseError as error:
            if isinstance(error, sqlite3.OperationalError) and "locked" in str(error):
                raise
            raise DamagedStoreError(f"{self.path}: not a readable store: {error}") from None


def export(records: list[Record], path: Path) -> None:
    """Write records as CSV or JSON Lines, as the file's ending says, for sharing; ValueError if it has another one.

    Numbers that are not finite are words, which `read_export` and `float` read (`polhode.harness.common.plain_json`).
    """
    if path.suffix not in (".csv", ".jsonl"):
        raise ValueError(f"{path}: expected a file name ending in .csv or .jsonl")
    with PartialFile(path) as file:
        if path.suffix == ".jsonl":
            file.writelines(dumps(record) + "\n" for record in records)
            return
        columns = list(dict.fromkeys(name for record in records for name in record))
        writer = csv.DictWriter(file, columns)
        writer.writeheader()
        writer.writerows(
            {name: dumps(value) if isinstance(value, dict | list) else value for name, value in record.items()}
            for record in records
        )


def read_export(path: Path) -> list[Record]:
    """Records of a JSON Lines file that `export` wrote, now or before; ValueError if a line is no JSON."""
    return [loads(line) for line in path.read_text(encoding="utf-8").splitlines()]
