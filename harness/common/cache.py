"""Where references are kept between runs: content-addressed files with a checksum, written atomically."""

import hashlib
import io
import os
import sys
import tempfile
from contextlib import suppress
from pathlib import Path

import numpy as np

# Hexadecimal digits of the checksum at the head of a file.
CHECKSUM = 64


def cache_folder() -> Path:
    """``$POLHODE_CACHE``, else ``$XDG_CACHE_HOME/polhode``, else ``~/.cache/polhode``."""
    own = os.environ.get("POLHODE_CACHE")
    if own:
        return Path(own)
    base = os.environ.get("XDG_CACHE_HOME")
    return (Path(base) if base else Path.home() / ".cache") / "polhode"


def load(key: str) -> dict[str, np.ndarray] | None:
    """Arrays kept under a key; None if there are none, or if the file is damaged.

    A damaged file is told by its checksum, removed, and named on stderr.
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
    path = path_of(key)
    with suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(dir=path.parent, prefix="partial-", delete=False) as file:
            try:
                file.write(_checksum(payload) + payload)
                file.close()
                os.replace(file.name, path)
            except BaseException:
                os.unlink(file.name)
                raise


def path_of(key: str) -> Path:
    """File that keeps the arrays of a key."""
    return cache_folder() / "references" / f"{key}.npz"


def _checksum(payload: bytes) -> bytes:
    return hashlib.sha256(payload).hexdigest().encode()
