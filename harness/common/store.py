"""The store: SQLite, one row per case, its key the hash of the case, so that resume means skipping known keys.

Every row has a digest of all that it holds, which is compared whenever the row is read. Records and
rows of dataclasses are written as files and read back, too.
"""

import csv
import gzip
import json
import reprlib
import sqlite3
import zlib
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, closing, contextmanager, suppress
from dataclasses import MISSING, astuple, fields
from io import StringIO, TextIOWrapper
from itertools import islice
from pathlib import Path
from typing import IO, Any, NamedTuple, TypeVar, cast, get_type_hints

from polhode.harness.common.files import (
    PartialFile,
    alone,
    digest,
    dumps,
    loads,
    open_file,
    read_file,
    remove_file,
)
from polhode.harness.common.machine import now

Record = dict[str, Any]
Entry = TypeVar("Entry")

# Marks of a file of ours, which SQLite keeps in its head: "plhd", and the version of the table.
_APPLICATION = 0x706C6864
_VERSION = 2
# Bytes up to which a store is checked as a whole when it is opened. An estimate: that takes 0.1 s or so;
# rows of larger ones are checked as they are read.
_MAX_CHECKED_AT_ONCE = 100_000_000
# Seconds that a statement waits while another process writes. An estimate: a write takes milliseconds.
_LOCK_SECONDS = 60.0
# Names of files of records end so: compressed, as reports hold them, and plain.
_RECORD_ENDINGS = (".jsonl.gz", ".jsonl")
# The first bytes of a file of gzip, whatever its name.
_GZIP_MARK = b"\x1f\x8b"
_TABLE = """
CREATE TABLE IF NOT EXISTS cases (
    key TEXT PRIMARY KEY, "case" TEXT NOT NULL, result TEXT NOT NULL, written TEXT NOT NULL, digest TEXT NOT NULL
)
"""
_ROW = 'SELECT key, "case", result, written, digest FROM cases '
_PUT = "INSERT INTO cases VALUES (?, ?, ?, ?, ?) ON CONFLICT (key) DO NOTHING"


class _Row(NamedTuple):
    """A row of the table: case and result are JSON, `written` is a date, `digest` one of all before it."""

    key: str
    case: str
    result: str
    written: str
    digest: str


class DamagedStoreError(ValueError):
    """The file is not a store, or a damaged one; its contents are left as they are."""


class Store(AbstractContextManager["Store"]):
    """A store file, made if it does not exist, never overwritten; two runs may share one.

    Its methods raise DamagedStoreError if the file is no readable store, OSError if it cannot be opened or written.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        path.parent.mkdir(parents=True, exist_ok=True)
        with self._readable():
            self._connection = sqlite3.connect(path, timeout=_LOCK_SECONDS)
            try:
                self._prepare()
            except BaseException:
                self.close()
                raise

    def _prepare(self) -> None:
        """Check the file, and make the table if it has none."""
        run = self._connection.execute
        # First what changes nothing: a database of something else stays as it is.
        self._check_application()
        # This statement alone does not wait while another process does the same, but fails. In WAL mode
        # readers do not wait for a writer.
        with alone(self.path.parent):
            run("PRAGMA journal_mode=WAL")
        small = self.path.stat().st_size <= _MAX_CHECKED_AT_ONCE
        if small and run("PRAGMA quick_check").fetchone()[0] != "ok":
            raise DamagedStoreError(f"{self.path}: the store is damaged")
        with self._connection:
            run("BEGIN IMMEDIATE")
            # Another run may have made the table meanwhile.
            if not self._check_application():
                run(_TABLE)
                run(f"PRAGMA application_id = {_APPLICATION}")
                run(f"PRAGMA user_version = {_VERSION}")

    def _check_application(self) -> bool:
        """Whether the file has a table; DamagedStoreError if it is no store, or one of another version."""
        run = self._connection.execute
        tables = {name for (name,) in run("SELECT name FROM sqlite_master")}
        application, version = (
            run(f"PRAGMA {name}").fetchone()[0] for name in ("application_id", "user_version")
        )
        if (tables and "cases" not in tables) or application not in (0, _APPLICATION):
            raise DamagedStoreError(f"{self.path}: a database of something else")
        if tables and version != _VERSION:
            raise DamagedStoreError(
                f"{self.path}: got version {version} of the store, expected {_VERSION}"
            )
        return bool(tables)

    def close(self) -> None:
        """Close the file."""
        self._connection.close()

    def __exit__(self, *exception: object) -> None:
        self.close()

    def keys(self) -> set[str]:
        """Keys of all cases."""
        with self._readable():
            return {key for (key,) in self._connection.execute("SELECT key FROM cases")}

    def __contains__(self, key: object) -> bool:
        with self._readable():
            return (
                self._connection.execute("SELECT 1 FROM cases WHERE key = ?", (key,)).fetchone()
                is not None
            )

    def result(self, key: str) -> Record | None:
        """Result of one case; None if the store does not hold it."""
        with self._readable():
            row = self._connection.execute(_ROW + "WHERE key = ?", (key,)).fetchone()
            return None if row is None else json.loads(self._sound(row).result)

    def put(self, key: str, case: Record, result: Record) -> None:
        """Write a case once; a second writer of the same key changes nothing."""
        content = key, json.dumps(case, sort_keys=True), json.dumps(result, sort_keys=True), now()
        row = _Row(*content, digest(content))
        with self._readable(), self._connection:
            self._connection.execute(_PUT, row)

    def made_once(self, key: str, case: Record, make: Callable[[], Record]) -> Record:
        """Result of one case, as the store holds it; where it does not, `make` gives the result first."""
        if key not in self:
            self.put(key, case, make())
        result = self.result(key)
        assert result is not None
        return result

    def drop(self, keys: Iterable[str]) -> None:
        """Forget the cases of some keys."""
        with self._readable(), self._connection:
            self._connection.executemany(
                "DELETE FROM cases WHERE key = ?", ((key,) for key in keys)
            )

    def __iter__(self) -> Iterator[Record]:
        """All cases with their results, each as one flat dictionary, in the order of writing; one in memory."""
        # A result without a date has the date of its writing.
        with self._readable():
            for row in self._connection.execute(_ROW + "ORDER BY rowid"):
                sound = self._sound(row)
                head = {"key": sound.key, "date": sound.written}
                yield {**head, **json.loads(sound.case), **json.loads(sound.result)}

    def _sound(self, columns: tuple[str, ...]) -> _Row:
        """The row, once its digest has been checked against its content."""
        row = _Row(*columns)
        if digest(row[:-1]) != row.digest:
            expected = "expected what was written; take an undamaged copy, or delete that row"
            raise DamagedStoreError(
                f"{self.path}: the store is damaged: case {row.key} fails its checksum, {expected}"
            )
        return row

    @contextmanager
    def _readable(self) -> Iterator[None]:
        """DamagedStoreError if the file is no readable database of ours; OSError if it cannot be opened or written."""
        try:
            yield
        except sqlite3.ProgrammingError:
            # A mistake of the caller's, such as another thread's store, is no damage.
            raise
        except (sqlite3.DatabaseError, UnicodeDecodeError) as error:
            # An OperationalError is about the place, such as a full disk, unless its words are about the
            # contents. All other errors are about the contents.
            contents = any(word in str(error) for word in ("table", "column", "malformed"))
            if isinstance(error, sqlite3.OperationalError) and not contents:
                raise OSError(
                    f"{self.path}: {error}, expected a writable file and room for it"
                ) from None
            raise DamagedStoreError(f"{self.path}: not a readable store: {error}") from None


def set_aside(path: Path, to: Path) -> None:
    """Rename a store, with all that SQLite has put beside it; OSError if a run is writing it."""
    # A run that writes is noticed at once, without waiting for its lock.
    with suppress(sqlite3.DatabaseError), closing(sqlite3.connect(path, timeout=0.0)) as connection:
        try:
            # It takes the file for itself alone, and moves what stands beside it into the file.
            connection.execute("PRAGMA journal_mode=DELETE")
        except sqlite3.OperationalError as error:
            if "locked" in str(error):
                expected = "expected its end, --resume to join it, or another --out"
                raise OSError(f"{path}: a run is writing it, {expected}") from None
            raise
    for ending in ("", "-wal", "-shm"):
        beside = path.with_name(path.name + ending)
        to.with_name(to.name + ending).unlink(missing_ok=True)
        if beside.exists():
            beside.rename(to.with_name(to.name + ending))


def export(records: Iterable[Record], path: Path) -> None:
    """Write records as CSV, JSON Lines or these compressed, as the file's ending says: .csv, .jsonl or .jsonl.gz.

    ValueError if it has another one. The same records give the same bytes.
    """
    # Numbers that are not finite are words, which `read_export` and `float` read
    # (`polhode.harness.common.files`).
    if path.name.endswith(_RECORD_ENDINGS[0]):
        with PartialFile(path, binary=True, summed=True) as file:
            _write_compressed(records, file)
    elif path.suffix == ".jsonl":
        with PartialFile(path, summed=True) as file:
            file.writelines(record_lines(records))
    elif path.suffix == ".csv":
        _export_csv(records, path)
    else:
        raise ValueError(f"{path}: expected a file name ending in .csv, .jsonl or .jsonl.gz")


def record_lines(records: Iterable[Record]) -> Iterator[str]:
    """Records as lines of JSON, one in memory at a time."""
    return (dumps(record) + "\n" for record in records)


def _write_compressed(records: Iterable[Record], file: IO[bytes]) -> None:
    """Write records as JSON Lines, compressed: the same bytes for the same records."""
    # Neither the time nor the private name of the file may be among its bytes.
    with (
        gzip.GzipFile(filename="", mode="wb", fileobj=file, mtime=0) as compressed,
        TextIOWrapper(cast("IO[bytes]", compressed), encoding="utf-8", newline="") as text,
    ):
        text.writelines(record_lines(records))


def _export_csv(records: Iterable[Record], path: Path) -> None:
    """Write records as CSV with a column for every key that one of them has."""
    # They are read twice: the columns are known only after the last record. Records of a store are read from
    # it again, an iterator is kept as a list.
    records = list(records) if iter(records) is records else records
    with PartialFile(path, summed=True) as file:
        columns = dict[str, None]()
        count = 0
        for record in records:
            columns |= dict.fromkeys(record)
            count += 1
        writer = csv.DictWriter(file, list(columns))
        writer.writeheader()
        # Another run may have added records to the store since they were counted.
        for record in islice(records, count):
            writer.writerow({name: _cell(value) for name, value in record.items()})


def _cell(value: Any) -> Any:
    """A cell of CSV: nested values as JSON, and a text that a spreadsheet would run as a formula in quotes."""
    if isinstance(value, dict | list):
        return dumps(value)
    return (
        "'" + value if isinstance(value, str) and value.startswith(("=", "+", "-", "@")) else value
    )


def read_export(path: Path) -> Iterator[Record]:
    """Records of JSON Lines that `export` wrote, compressed or not, one in memory at a time.

    ValueError if the file is another one, or damaged.
    """
    with open_file(path) as file:
        compressed = file.read(len(_GZIP_MARK)) == _GZIP_MARK
        file.seek(0)
        lines = gzip.GzipFile(fileobj=file) if compressed else file
        number = 0
        while True:
            number += 1
            try:
                line = lines.readline()
                if not line:
                    return
                record = loads(line.decode())
            except (EOFError, gzip.BadGzipFile, zlib.error) as error:
                raise ValueError(f"{path}: line {number}: {error}, expected gzip") from None
            except (ValueError, RecursionError) as error:
                raise ValueError(f"{path}: line {number}: {error}, expected JSON") from None
            if not isinstance(record, dict):
                raise ValueError(
                    f"{path}: line {number}: got {reprlib.repr(record)}, expected a JSON object"
                )
            yield record


def write_records(records: Iterable[Record], folder: Path, name: str = "records") -> None:
    """Write the records of a report compressed into its folder, in the place of plain ones of an older version."""
    compressed, plain = (folder / (name + ending) for ending in _RECORD_ENDINGS)
    export(records, compressed)
    remove_file(plain)


def record_file(folder: Path, name: str = "records") -> Path:
    """The file of a report's records: the compressed one, unless there is only the plain one of polhode 0.1."""
    compressed, plain = (folder / (name + ending) for ending in _RECORD_ENDINGS)
    return plain if plain.is_file() and not compressed.is_file() else compressed


def record_files(folder: Path) -> dict[str, Path]:
    """Each file of records in a folder, by its name without the ending."""
    names = {
        path.name.removesuffix(ending)
        for ending in _RECORD_ENDINGS
        for path in folder.glob(f"*{ending}")
    }
    return {name: record_file(folder, name) for name in sorted(names)}


def is_record_file(path: Path) -> bool:
    """Whether a file is one of records, by its name."""
    return path.name.endswith(_RECORD_ENDINGS)


def write_table(path: Path, kind: type, rows: Iterable[Any]) -> None:
    """Write rows, which are objects of the dataclass `kind`, in full precision; columns are named as its fields."""
    with PartialFile(path, summed=True) as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow([field.name for field in fields(kind)])
        writer.writerows(map(astuple, rows))


def read_table(path: Path, kind: type[Entry]) -> list[Entry]:
    """Rows as `write_table` wrote them; ValueError if the file is missing or damaged, or has other columns.

    A table written before columns with defaults were added takes these.
    """
    columns = fields(kind)  # pyright: ignore[reportArgumentType]
    required = sum(column.default is MISSING for column in columns)
    expected = [column.name for column in columns]
    # Tables written before a column was renamed: `metadata={"former": "pieces"}` of its field.
    present = {column.metadata.get("former"): column.name for column in columns}
    try:
        head, *lines = list(csv.reader(StringIO(read_file(path).decode(), newline=""))) or [[]]
    except OSError as error:
        raise ValueError(
            f"{path}: {error.strerror}, expected a table of {', '.join(expected)}"
        ) from None
    names = [present.get(name, name) for name in head]
    if len(names) < required or names != expected[: len(names)]:
        raise ValueError(
            f"{path}: got the columns {', '.join(head)}, expected {', '.join(expected)}"
        )
    if any(len(line) != len(names) for line in lines):
        raise ValueError(f"{path}: got rows of other lengths, expected {len(names)} cells in each")
    hints = get_type_hints(kind).values()
    return [kind(*map(_value, hints, line)) for line in lines]


def _value(kind: Any, cell: str) -> Any:
    """The value of a cell; a count in a column of floats, which have NaN, stays as whole as it was written."""
    whole = kind is float and cell.removeprefix("-").isdecimal()
    return int(cell) if whole else kind(cell)
