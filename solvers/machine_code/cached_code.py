"""heyoka's machine code on disk with a checksum of every entry: damaged code is never run.

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


def check(folder: Path) -> bool:
    """Make the folder private, and drop what it holds if an entry does not match its checksum.

    False if the folder is of no use: it cannot be written, or holds what can neither be read nor
    dropped.
    """
    from sqlite3 import DatabaseError

    with suppress(OSError):
        make_private(folder)
        folder.chmod(0o700)
    if not os.access(folder, os.W_OK):
        return False
    try:
        noted = _noted(folder)
        sums = _sums(folder)
        if all(noted.get(key, checksum) == checksum for key, checksum in sums.items()):
            # Entries without a checksum count as sound: their process was killed before
            # it noted them.
            _write(folder, noted, sums)
            return True
        reason = "a checksum does not match"
    except DatabaseError as error:
        reason = str(error)
    say(f"{folder}: damaged ({reason}), compiled anew")
    for file in folder.glob("*"):
        with suppress(OSError):
            file.unlink()
    return not (folder / "cache.db").exists()


def note(folder: Path) -> None:
    """Write down the checksums of new entries."""
    noted = _noted(folder)
    # An entry that cannot be read now gets its checksum at the next start.
    with suppress(Exception):
        _write(folder, noted, _sums(folder, noted))


def _write(folder: Path, noted: Mapping[str, int], sums: Mapping[str, int]) -> None:
    if sums.keys() - noted.keys():
        private = folder / f"sums.{os.getpid()}"
        with suppress(OSError):
            private.write_text(json.dumps({**noted, **sums}), encoding="utf-8")
            private.replace(folder / "sums.json")


def _noted(folder: Path) -> dict[str, int]:
    try:
        sums = json.loads((folder / "sums.json").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return sums if isinstance(sums, dict) else {}


def _sums(folder: Path, noted: Container[str] = ()) -> dict[str, int]:
    """Checksum of each entry not known yet; raises sqlite3.DatabaseError if the file is damaged."""
    import sqlite3

    file = folder / "cache.db"
    if not file.exists():
        return {}
    with closing(sqlite3.connect(f"{file.as_uri()}?mode=ro", uri=True)) as code:
        names = [
            row[1] for row in code.execute("PRAGMA table_info(cache)") if row[1] != "last_access"
        ]
        entry = f"SELECT {', '.join(names)} FROM cache WHERE hash = ?"
        keys = [key for (key,) in code.execute("SELECT hash FROM cache") if str(key) not in noted]
        return {str(key): _sum(code.execute(entry, (key,)).fetchone() or ()) for key in keys}


def _sum(entry: tuple[object, ...]) -> int:
    total = 0
    for value in entry:
        total = crc32(value if isinstance(value, bytes) else str(value).encode(), total)
    return total
