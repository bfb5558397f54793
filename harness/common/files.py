"""The one way to write a file: it appears under its name when it is complete; what failed is left as FILE.partial.

Files that are read again, such as tables and records, have their checksums in SHA256SUMS beside
them, which `sha256sum --check` reads too. JSON is such as every reader takes: numbers that are not
finite, for which it has no sign, are words.
"""

import errno
import fcntl
import json
import os
import secrets
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from hashlib import file_digest, sha256
from math import inf, isfinite, nan
from pathlib import Path
from typing import IO, Any

_STANDARD_OUTPUT = (Path("-"), Path("/dev/stdout"))
# The number that the system gives standard output.
_STANDARD_OUTPUT_NUMBER = 1
# The file of the checksums in a folder, by its usual name.
SUMS = "SHA256SUMS"
# The words that stand in JSON for numbers that it has no sign for. A string that is one of them is read as the
# number too.
_WORDS = {"Infinity": inf, "-Infinity": -inf, "NaN": nan}
# Random bytes in the private name of a file that is being written: no two runs share one. With eight, 64 bits,
# chance does not bring the same name twice; the number is a choice.
_PRIVATE_BYTES = 8


class PartialFile:
    """A file written in the same folder under a private name, and renamed when the block succeeds.

    If the block fails, what was written is left as FILE.partial. Devices and pipes, which cannot be
    renamed, are written to at once (not `atomic`). A link stays, and what it points to is replaced;
    ``-`` is standard output. Text is UTF-8, with line ends as written.

    Parameters
    ----------
    path : Path
        The file, whose folder must be there.
    binary : bool
        Whether bytes are written, not text.
    summed : bool
        Whether the file's checksum is kept beside it, so that `read_file` notices damage. Devices and
        pipes have none.

    Raises
    ------
    OSError
        At once if the path is a folder or lies in none; later if the file cannot be written.
    """

    def __init__(self, path: Path, *, binary: bool = False, summed: bool = False) -> None:
        if path.is_dir():
            raise IsADirectoryError(errno.EISDIR, "is a folder, expected a file name", str(path))
        if not path.parent.is_dir():
            raise FileNotFoundError(
                errno.ENOENT, "no such folder, expected an existing one", str(path.parent)
            )
        # Devices and pipes lie in /dev and /proc; /dev/shm holds ordinary files.
        top, *under = path.absolute().parts[1:3]
        device = path in _STANDARD_OUTPUT or (top in ("dev", "proc") and under != ["shm"])
        self.path = path.resolve() if path.is_symlink() and not device else path
        self.atomic = not device and (self.path.is_file() or not self.path.exists())
        self.partial = (
            self.path.with_name(self.path.name + ".partial") if self.atomic else self.path
        )
        # A process that is killed leaves its file under this name.
        token = secrets.token_hex(_PRIVATE_BYTES)
        self._private = self.path.with_name(f".{self.path.name}.{token}.partial")
        self._how: dict[str, Any] = {} if binary else {"encoding": "utf-8", "newline": ""}
        self._binary = "b" * binary
        self._summed = summed and self.atomic
        self._file: IO[Any] | None = None

    def open(self) -> IO[Any]:
        """Open the file, if it is not open yet; raises OSError if it cannot be written."""
        if self._file is None:
            # By its number, standard output is what the caller redirected it to, and goes on from
            # there.
            to_output = self.path in _STANDARD_OUTPUT
            in_place = _STANDARD_OUTPUT_NUMBER if to_output else self.path
            where = self._private if self.atomic else in_place
            # "x" refuses a file that is there: nobody else's is written over.
            mode = ("x" if self.atomic else "w") + self._binary
            try:
                self._file = open(where, mode, closefd=not to_output, **self._how)  # noqa: SIM115
            except OSError as error:
                error.filename = str(self.path)
                raise
        return self._file

    def __enter__(self) -> IO[Any]:
        return self.open()

    def __exit__(
        self, kind: type[BaseException] | None, failure: BaseException | None, *where: object
    ) -> None:
        try:
            self._close(failure)
        except OSError as error:
            failure = error
            raise
        finally:
            # The system reports a full disk without the file's name.
            if isinstance(failure, OSError) and failure.errno and not failure.filename:
                failure.filename = str(self.path)

    def _close(self, failure: BaseException | None) -> None:
        """Give the file its name, or the name of a partial file if the block failed."""
        file = self.open()
        final_path = self.partial
        try:
            # On a full disk, closing fails as flushing did.
            with file:
                file.flush()
                if self.atomic and failure is None:
                    # On the disk before it has its name: a crash of the machine leaves no empty file.
                    os.fsync(file.fileno())
                    if self._summed:
                        _keep_checksum(self.path, self._private)
                    final_path = self.path
        finally:
            if self.atomic:
                os.replace(self._private, final_path)
                if self._summed and final_path is self.path:
                    # The earlier file is gone, and its checksum goes.
                    _keep_checksum(self.path)


def make_folder(folder: Path) -> None:
    """Make a folder if there is none, with those above it; raises OSError if no page can be written in it."""
    # A trial file is opened and removed again: rights alone do not tell.
    folder.mkdir(parents=True, exist_ok=True)
    trial = PartialFile(folder / "README.md")
    trial.open().close()
    trial._private.unlink(missing_ok=True)


def write_file(path: Path, content: str | bytes, *, summed: bool = False) -> Path:
    """Write a whole file at once, its folder too, and return its path; a failure leaves nothing behind."""
    path.parent.mkdir(parents=True, exist_ok=True)
    target = PartialFile(path, binary=isinstance(content, bytes), summed=summed)
    # FILE.partial may hold the rows of an earlier failure, which are not to be lost.
    target.partial = target._private
    try:
        with target as file:
            file.write(content)
    finally:
        target._private.unlink(missing_ok=True)
    return path


def remove_file(path: Path) -> None:
    """Remove a file, if it is there, and the checksum that is kept of it."""
    path.unlink(missing_ok=True)
    # `_keep_checksum` drops the line of a file that is not there.
    if path.name in _sums(path.parent):
        _keep_checksum(path)


def open_file(path: Path) -> IO[bytes]:
    """Open a file to read bytes; ValueError if it fails a checksum that is kept of it, OSError if there is no file.

    A file without a checksum is opened unchecked.
    """
    # Another process may replace the file between opening it and reading its checksum: one more try.
    for _ in range(2):
        file = path.open("rb")
        sums = _sums(path.parent).get(path.name)
        if not sums or file_digest(file, "sha256").hexdigest() in sums:
            file.seek(0)
            return file
        file.close()
    raise ValueError(f"{path}: fails its checksum in {SUMS}, expected what was written")


def read_file(path: Path) -> bytes:
    """Content of a file; raises as `open_file` does."""
    with open_file(path) as file:
        return file.read()


def _sums(folder: Path) -> dict[str, list[str]]:
    """Checksums by file name, none if SHA256SUMS cannot be read.

    A file has two of them while it is replaced: see `_keep_checksum`.
    """
    sums: dict[str, list[str]] = {}
    with suppress(OSError):
        for line in (folder / SUMS).read_text(encoding="utf-8", errors="replace").splitlines():
            checksum, _, name = line.partition("  ")
            sums.setdefault(name, []).append(checksum)
    return sums


def _keep_checksum(path: Path, *coming: Path) -> None:
    """Keep the checksum of a file, and of one that is about to take its place: until then both hold.

    A file that is not there has none, and loses the one that was kept of it.
    """
    with alone(path.parent):
        sums = []
        for file in (path, *coming):
            with suppress(OSError), file.open("rb") as content:
                sums.append(file_digest(content, "sha256").hexdigest())
        sums_by_name = _sums(path.parent) | {path.name: sums}
        lines = []
        for name in sorted(sums_by_name):
            lines += [f"{checksum}  {name}\n" for checksum in dict.fromkeys(sums_by_name[name])]
        write_file(path.with_name(SUMS), "".join(lines))


@contextmanager
def alone(folder: Path) -> Iterator[None]:
    """Wait until no other process is in here for the same folder, which is locked meanwhile.

    The lock is the system's: it ends with the process that has it, whatever ends that.
    """
    place = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(place, fcntl.LOCK_EX)
        yield
    finally:
        os.close(place)


def dumps(value: Any, *, sort_keys: bool = True, **how: Any) -> str:
    """One line of JSON, keys sorted unless `sort_keys` is false; `how` goes to `json.dumps`.

    Tuples become lists.
    """

    def word(value: Any) -> Any:
        # `json.dumps` alone writes Infinity, -Infinity and NaN, the keys of `_WORDS`.
        return json.dumps(value) if isinstance(value, float) and not isfinite(value) else value

    return json.dumps(_with(word, value), sort_keys=sort_keys, allow_nan=False, **how)


def loads(text: str) -> Any:
    """The value that `dumps` wrote, words turned into numbers again; raises ValueError if the text is no JSON."""
    return _with(
        lambda item: _WORDS.get(item, item) if isinstance(item, str) else item, json.loads(text)
    )


def digest(value: Any) -> str:
    """SHA-256, in hexadecimal digits, of a value's JSON, keys in order: the same for the same content.

    `json.dumps` writes the JSON, without the words of `dumps`: what is stored goes by these digests.
    """
    return sha256(json.dumps(value, sort_keys=True).encode()).hexdigest()


def _with(change: Callable[[Any], Any], value: Any) -> Any:
    """A value with all in it that is neither dictionary nor list changed by a function."""
    if isinstance(value, dict):
        return {name: _with(change, item) for name, item in value.items()}
    return (
        [_with(change, item) for item in value]
        if isinstance(value, list | tuple)
        else change(value)
    )
