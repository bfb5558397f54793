"""Where references are kept between runs: content-addressed files with a checksum."""

import hashlib
import io
import sys
from contextlib import suppress
from pathlib import Path

import numpy as np

from polhode.harness.common.files import write_file
from polhode.solvers.compile import cache_folder

# Hexadecimal digits of the checksum at the head of a file.
CHECKSUM = 64


def load(key: str) -> dict[str, np.ndarray] | None:
    """Arrays kept under a key; None if there are none, or if the file is damaged.

    The checksum shows a damaged file, which is removed and named on stderr.
    """
    path = path_of(key)
    try:
        content = path.read_bytes()
    except OSError:
        return None
    checksum, payload = content[:CHECKSUM], content[CHECKSUM:]
    if _checksum(payload) != checksum:
        print(f"polhode: {path}: damaged, its checksum does not match; computed anew", file=sys.stderr)
        with suppress(OSError):
            path.unlink()
        return None
    with np.load(io.BytesIO(payload), allow_pickle=False) as arrays:
        return dict(arrays)


def keep(key: str, arrays: dict[str, np.ndarray]) -> None:
    """Keep arrays under a key; a folder that cannot be written is no error, the work is done again next time."""
    buffer = io.BytesIO()
    np.savez(buffer, allow_pickle=False, **arrays)
    payload = buffer.getvalue()
    with suppress(OSError):
        write_file(path_of(key), _checksum(payload) + payload)


def path_of(key: str) -> Path:
    """File that keeps the arrays of a key."""
    return cache_folder() / "references" / f"{key}.npz"


def _checksum(payload: bytes) -> bytes:
    return hashlib.sha256(payload).hexdigest().encode()
