"""Numbers cached on disk under a key, for modules that would compute them anew, and the folder of all caches.

A file is read whole, or not at all; the oldest files are removed.
"""

import os
import stat
import sys
import tempfile
from contextlib import suppress
from hashlib import sha256
from pathlib import Path
from threading import Lock

import numpy as np

# Environment variable that names the folder for caches.
CACHE_VARIABLE = "POLHODE_CACHE"
# Files that may lie in the folder; the oldest half is removed when there are more. An estimate: a
# triaxial shape takes up to six files, and a fraction of a second if its files are gone.
_MAX_FILES = 200
# Bytes of the checksum that a file begins with: SHA-256.
_SUM_BYTES = 32
# Digits of a file's name, of its key's SHA-256 in base 16: enough that no two keys share one.
_NAME_DIGITS = 32
# Links that a path may lead through, as in Linux.
_MAX_LINKS = 40
# The private folder that stands for refused ones, in this process; made when first needed.
_private_folder: tempfile.TemporaryDirectory[str] | None = None
_private_lock = Lock()


def cache_folder(library: str = "", part: str = "") -> Path:
    """Folder of polhode's caches, or a library's; a `part` is a folder in it.

    It is ``$POLHODE_CACHE``, else in ``$XDG_CACHE_HOME`` or ``~/.cache``. Machine code from there
    is run: a folder that someone else may write is not used. Its place takes a private one, which
    the process removes at its end; a line on standard error says so.
    """
    base = _base_folder(library)
    folder = Path(base, library, part) if os.environ.get(CACHE_VARIABLE) else base / part
    if reason := why_untrusted(base) or why_untrusted(folder):
        return _private(folder, reason) / (library or "polhode") / part
    return folder


def _base_folder(library: str) -> Path:
    """The folder of all caches that the user names, else the cache folder of one library."""
    if named := os.environ.get(CACHE_VARIABLE):
        return Path(named).absolute()
    # Without a home nothing is cached: no folder can be made below `os.devnull`, which is a file.
    home = path if (path := os.path.expanduser("~")) != "~" else os.devnull
    return Path(
        os.environ.get("XDG_CACHE_HOME") or Path(home, ".cache"), library or "polhode"
    ).absolute()


def why_untrusted(folder: Path) -> str | None:
    """Why someone else may write in a folder, or replace it; None if nobody else may.

    The folder must belong to the user, each folder above it to the user or to root. Others
    may write only in folders with a sticky bit, such as ``/tmp``, which protects foreign files.
    """
    if not hasattr(os, "geteuid"):
        return None
    # The way there by its links, and where it ends.
    return _why_untrusted(folder.absolute(), _MAX_LINKS) or _why_untrusted(folder.resolve(), 0)


def _why_untrusted(folder: Path, links: int) -> str | None:
    """The same of a way that may lead through this many links."""
    user = os.geteuid()
    for path in (*reversed(folder.parents), folder):
        try:
            status = path.lstat()
        except OSError:
            # It does not exist yet: the user makes it.
            return None
        owners = (user,) if path == folder else (user, 0)
        if status.st_uid not in owners:
            return f"{path} belongs to another user ({status.st_uid})"
        if stat.S_ISLNK(status.st_mode):
            if links == 0:
                return f"{path} leads through too many links"
            target = Path(path.parent, path.readlink(), folder.relative_to(path))
            return _why_untrusted(Path(os.path.normpath(target)), links - 1)
        if not stat.S_ISDIR(status.st_mode):
            # Nothing can be cached there.
            return None
        others = status.st_mode & (stat.S_IWGRP | stat.S_IWOTH)
        if others and (path == folder or not status.st_mode & stat.S_ISVTX):
            return f"others may write in {path}"
    return None


def _private(folder: Path, reason: str) -> Path:
    """The private folder of this process; the first call says why there is one."""
    global _private_folder
    with _private_lock:
        if _private_folder is None:
            _private_folder = tempfile.TemporaryDirectory(
                prefix="polhode-", ignore_cleanup_errors=True
            )
            expected = f"expected a folder that you alone may write; set {CACHE_VARIABLE} to one"
            say(
                f"{folder}: not used as a cache, {reason}, {expected}; "
                "caches last as long as this process"
            )
        return Path(_private_folder.name)


def say(line: str) -> None:
    """Say something of a cache on standard error, if anybody hears it."""
    if sys.stderr is not None:
        with suppress(OSError, ValueError):
            print(f"polhode: {line}", file=sys.stderr)


def make_private(folder: Path) -> None:
    """Make a folder and those above it that do not exist, for the user alone; raises OSError."""
    for path in (*reversed(folder.parents), folder):
        path.mkdir(mode=0o700, exist_ok=True)
    # Someone else may have been quicker. 1 is EPERM, "operation not permitted".
    if reason := why_untrusted(folder):
        raise PermissionError(1, reason, str(folder))


def load(key: str) -> np.ndarray | None:
    """The numbers cached under a key, as doubles of shape (n,); None if there are none, or the file was changed."""
    with suppress(OSError):
        content = _file(key).read_bytes()
        numbers = content[_SUM_BYTES:]
        if content[:_SUM_BYTES] == _sum(key, numbers):
            return np.frombuffer(numbers)
    return None


def save(key: str, numbers: np.ndarray) -> None:
    """Cache numbers, of any shape, under a key; a folder that cannot be written is no error."""
    file = _file(key)
    content = np.ascontiguousarray(numbers, dtype=float).tobytes()
    with suppress(OSError):
        make_private(file.parent)
        # Written beside it and then renamed, so that no other process reads half a file.
        private = file.with_suffix(f".{os.getpid()}")
        private.write_bytes(_sum(key, content) + content)
        private.replace(file)
        files = list(file.parent.iterdir())
        if len(files) > _MAX_FILES:
            oldest_first = sorted(files, key=lambda path: path.stat().st_mtime)
            for old in oldest_first[: _MAX_FILES // 2]:
                old.unlink()


def _file(key: str) -> Path:
    """The file of a key."""
    return cache_folder(part="numbers") / sha256(key.encode()).hexdigest()[:_NAME_DIGITS]


def _sum(key: str, content: bytes) -> bytes:
    """Checksum of a key and its numbers: a file cut short, or of another key, has another one."""
    return sha256(key.encode() + content).digest()
