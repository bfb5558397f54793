"""Where references are kept between runs: content-addressed files with a checksum, written atomically."""

import hashlib
import io
import os
import tempfile
from pathlib import Path

import numpy as np


def cache_folder() -> Path:
    """``$POLHODE_CACHE``, else ``$XDG_CACHE_HOME/polhode``, else ``~/.cache/polhode``."""
    own = os.environ.get("POLHODE_CACHE")
    if own:
        return Path(own)
    base = os.environ.get("XDG_CACHE_HOME")
    return (Path(base) if base else Path.home() / ".cache") / "polhode"


def load(key: str) -> dict[str, np.ndarray] | None:
    """Arrays kept under a key; None if there are none or the file is damaged, which is told by its checksum."""
    path = _path(key)
    try:
        content = path.read_bytes()
    except OSError:
        return None
    checksum, payload = content[:64], content[64:]
    if hashlib.sha256(payload).hexdigest().encode() != checksum:
        path.unlink(missing_ok=True)
        return None
    with np.load(io.BytesIO(payload), allow_pickle=False) as arrays:
        return dict(arrays)


def keep(key: str, arrays: dict[str, np.ndarray]) -> None:
    """Keep arrays under a key; a folder that cannot be written is no error, the work is done again next time."""
    buffer = io.BytesIO()
    np.savez(buffer, allow_pickle=False, **arrays)
    payload = buffer.getvalue()
    path = _path(key)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(dir=path.parent, delete=False) as file:
            file.write(hashlib.sha256(payload).hexdigest().encode() + payload)
        os.replace(file.name, path)
    except OSError:
        return


def _path(key: str) -> Path:
    return cache_folder() / "references" / f"{key}.npz"
