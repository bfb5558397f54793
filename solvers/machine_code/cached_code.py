"""heyoka's machine code on disk, with checksums of its entries: code that does not match is not run.

heyoka keeps its code in the SQLite database ``cache.db``: the table ``cache`` has a row for each
piece of code, the key of which is the column ``hash``. Beside it ``sums.json`` holds the CRC-32 of
each row by its key. heyoka itself reads rows as they are: so `check` looks at them all before it is
told of the folder, and `note` writes down the checksums of new rows as the process ends.

The checksums are for accidents. Who may write to the folder may write code, hence it is the user's
alone.
"""

import json
import os
from collections.abc import Container, Mapping
from contextlib import closing, suppress
from pathlib import Path
from zlib import crc32

from polhode.models.files.cached import make_private, say

# Bytes that heyoka may cache, some fifty integrators: to read and sum them takes 20 ms of a start.
MAX_CODE_BYTES = 20_000_000
_DATABASE = "cache.db"
_CHECKSUMS = "sums.json"
# Column of the table that heyoka changes whenever it reads a row.
_CHANGING_COLUMN = "last_access"
# Bits of an extended error code of SQLite that have the primary code.
_PRIMARY_CODE = 0xFF
# Place of a column's name in a row of SQLite's `table_info`.
_NAME = 1


def check(folder: Path) -> bool:
    """Make the folder private, and drop what it holds if an entry does not match its checksum.

    False if the folder is of no use: it cannot be written, another process has locked its database, or it
    holds what can neither be read nor dropped.
    """
    from sqlite3 import SQLITE_BUSY, SQLITE_LOCKED, DatabaseError

    with suppress(OSError):
        make_private(folder)
        folder.chmod(0o700)
    if not os.access(folder, os.W_OK):
        return False
    try:
        noted = _noted_checksums(folder)
        checksums = _checksums(folder)
    except DatabaseError as error:
        # Errors of Python's own, such as text that is no UTF-8, have no code.
        code = getattr(error, "sqlite_errorcode", 0)
        if code & _PRIMARY_CODE in (SQLITE_BUSY, SQLITE_LOCKED):
            return False
        reason = str(error)
    else:
        if all(noted.get(key, checksum) == checksum for key, checksum in checksums.items()):
            # Entries without a checksum count as sound: their process was killed before
            # it noted them.
            _write(folder, noted, checksums)
            return True
        reason = "a checksum does not match"
    say(f"{folder}: damaged ({reason}), compiled anew")
    for file in folder.glob("*"):
        with suppress(OSError):
            file.unlink()
    return not (folder / _DATABASE).exists()


def note(folder: Path) -> None:
    """Write down the checksums of new entries."""
    noted = _noted_checksums(folder)
    # An entry that cannot be read now gets its checksum at the next start.
    with suppress(Exception):
        _write(folder, noted, _checksums(folder, noted))


def _write(folder: Path, noted: Mapping[str, int], checksums: Mapping[str, int]) -> None:
    """Write all checksums down if some are new: to a file of this process, which takes the old one's place."""
    if not checksums.keys() - noted.keys():
        return
    private = folder / f"sums.{os.getpid()}"
    with suppress(OSError):
        private.write_text(json.dumps({**noted, **checksums}), encoding="utf-8")
        private.replace(folder / _CHECKSUMS)


def _noted_checksums(folder: Path) -> dict[str, int]:
    """Checksums by key as they were written down; none if the file is missing or damaged."""
    try:
        noted = json.loads((folder / _CHECKSUMS).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return noted if isinstance(noted, dict) else {}


def _checksums(folder: Path, known: Container[str] = ()) -> dict[str, int]:
    """Checksum of each entry whose key is not known yet; raises sqlite3.DatabaseError if the file is damaged."""
    import sqlite3

    file = folder / _DATABASE
    if not file.exists():
        return {}
    # Read-only: another process may be writing.
    with closing(sqlite3.connect(f"{file.as_uri()}?mode=ro", uri=True)) as database:
        columns = [column[_NAME] for column in database.execute("PRAGMA table_info(cache)")]
        summed = ", ".join(name for name in columns if name != _CHANGING_COLUMN)
        keys = [key for (key,) in database.execute("SELECT hash FROM cache")]
        checksums = {}
        for key in keys:
            if str(key) in known:
                continue
            entry = database.execute(
                f"SELECT {summed} FROM cache WHERE hash = ?", (key,)
            ).fetchone()
            # Another process may have dropped it since.
            if entry is not None:
                checksums[str(key)] = _checksum(entry)
        return checksums


def _checksum(entry: tuple[object, ...]) -> int:
    """CRC-32 of an entry's columns, one behind the other."""
    total = 0
    for value in entry:
        total = crc32(value if isinstance(value, bytes) else str(value).encode(), total)
    return total
