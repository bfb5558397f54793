"""Files that appear under their name only when they are complete; until then, and else, they are FILE.partial."""

import os
from pathlib import Path
from typing import IO

STANDARD_OUTPUT = Path("-"), Path("/dev/stdout")


class PartialFile:
    """A text file written as FILE.partial and renamed when the block succeeds.

    Devices and pipes, which cannot be renamed, are written to at once. A link stays, and what it points to is replaced.

    Parameters
    ----------
    path : Path
        An earlier file of this name stays as it is until the new one is complete; ``-`` is standard output.

    Attributes
    ----------
    partial : Path
        Where it is written.
    atomic : bool
        Whether it appears under its name only when it is complete.

    Raises
    ------
    OSError
        At once, if the path is a folder or lies in none.
    """

    def __init__(self, path: Path) -> None:
        if path.is_dir():
            raise IsADirectoryError(21, "is a folder, expected a file name", str(path))
        if not path.parent.is_dir():
            raise FileNotFoundError(2, "no such folder, expected an existing one", str(path.parent))
        device = path in STANDARD_OUTPUT or path.absolute().parts[1] in ("dev", "proc")
        self.path = path.resolve() if path.is_symlink() and not device else path
        self.atomic = not device and (self.path.is_file() or not self.path.exists())
        self.partial = self.path.with_name(self.path.name + ".partial") if self.atomic else self.path
        self._file: IO[str] | None = None

    def open(self) -> IO[str]:
        """Open the file, if it is not open yet; raises OSError if it cannot be written."""
        if self._file is None:
            # By its number, standard output is what the caller redirected it to, and goes on from where that stands.
            where, ours = (1, False) if self.path in STANDARD_OUTPUT else (self.partial, True)
            self._file = open(where, "w", encoding="utf-8", newline="", closefd=ours)  # noqa: SIM115
        return self._file

    def __enter__(self) -> IO[str]:
        return self.open()

    def __exit__(self, failure: type[BaseException] | None, *details: object) -> None:
        self.open().close()
        if failure is None and self.atomic:
            os.replace(self.partial, self.path)
