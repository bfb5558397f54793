"""Numbers kept on disk under a key, for those who would compute them anew: made lately, whole, or not at all."""

import os
from contextlib import suppress
from hashlib import sha256
from pathlib import Path

import numpy as np

# Environment variable that names the folder for caches.
CACHE_VARIABLE = "POLHODE_CACHE"
# Files that may lie in the folder; the oldest half goes when there are more.
MOST = 200


def cache_folder(library: str = "") -> Path:
    """Folder of polhode's caches, or a library's: ``$POLHODE_CACHE``, else in ``$XDG_CACHE_HOME`` or ``~/.cache``."""
    if own := os.environ.get(CACHE_VARIABLE):
        return Path(own, library).absolute()
    # Who has no home keeps nothing.
    home = path if (path := os.path.expanduser("~")) != "~" else os.devnull
    return Path(
        os.environ.get("XDG_CACHE_HOME") or Path(home, ".cache"), library or "polhode"
    ).absolute()


def load(key: str) -> np.ndarray | None:
    """The numbers kept under a key; None if there are none, or if the file is not what was written."""
    with suppress(OSError):
        content = _file(key).read_bytes()
        if content[:32] == _sum(key, content[32:]):
            return np.frombuffer(content[32:])
    return None


def save(key: str, numbers: np.ndarray) -> None:
    """Keep numbers under a key; a folder that cannot be written is no error."""
    file, content = _file(key), np.ascontiguousarray(numbers, dtype=float).tobytes()
    with suppress(OSError):
        file.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        private = file.with_suffix(f".{os.getpid()}")
        private.write_bytes(_sum(key, content) + content)
        private.replace(file)
        files = list(file.parent.iterdir())
        if len(files) > MOST:
            for old in sorted(files, key=lambda each: each.stat().st_mtime)[: MOST // 2]:
                old.unlink()


def _file(key: str) -> Path:
    return cache_folder() / "numbers" / sha256(key.encode()).hexdigest()[:32]


def _sum(key: str, content: bytes) -> bytes:
    return sha256(key.encode() + content).digest()
