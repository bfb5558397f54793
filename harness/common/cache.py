"""Arrays of references, cached on disk between runs: a file for each key.

A key is a digest, in hexadecimal digits, of all that the arrays follow from. Files have a checksum
of key and content, so that none stands for another.
"""

import hashlib
import io
from contextlib import suppress
from pathlib import Path

import numpy as np

from polhode.harness.common.files import write_file
from polhode.models.files.cached import cache_folder, make_private, say

# Hexadecimal digits of the checksum, a SHA-256, at the head of a file.
_CHECKSUM_DIGITS = 64


def load(key: str) -> dict[str, np.ndarray] | None:
    """Arrays cached under a key; None if there are none.

    A file that is damaged, or has another key, is removed, and counts as none.
    """
    path = path_of(key)
    try:
        content = path.read_bytes()
    except OSError:
        return None
    checksum = content[:_CHECKSUM_DIGITS]
    payload = content[_CHECKSUM_DIGITS:]
    if _checksum(key, payload) != checksum:
        say(f"{path}: damaged, or another one renamed; computed anew")
        with suppress(OSError):
            path.unlink()
        return None
    with np.load(io.BytesIO(payload), allow_pickle=False) as arrays:
        return dict(arrays)


def save(key: str, arrays: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Cache arrays under a key, and return them as `load` would: in C order.

    A sum over an array in another order differs in its last bit.
    """
    arrays = {name: np.array(array, order="C") for name, array in arrays.items()}
    buffer = io.BytesIO()
    # NumPy 2.0 knows no `allow_pickle` here and would store it as an array.
    np.savez(buffer, **arrays)  # pyright: ignore[reportArgumentType]
    payload = buffer.getvalue()
    path = path_of(key)
    # A folder that cannot be written is no error, the work is done again next time.
    with suppress(OSError):
        make_private(path.parent)
        write_file(path, _checksum(key, payload) + payload)
    return arrays


def path_of(key: str) -> Path:
    """File of the arrays of a key."""
    return cache_folder(part="references") / f"{key}.reference"


def _checksum(key: str, payload: bytes) -> bytes:
    """The SHA-256 of key and content, as hexadecimal digits."""
    return hashlib.sha256(key.encode() + payload).hexdigest().encode()
