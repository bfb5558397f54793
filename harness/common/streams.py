"""Standard streams that are closed or cannot be written: no file takes their place, and no note ends a run."""

import io
import os
import sys
from contextlib import suppress
from typing import Any


class _Forgiving(io.FileIO):
    """A file whose writes never fail: what cannot be written is dropped."""

    def write(self, content: Any) -> int:
        """Write what can be written; the number of bytes given."""
        with suppress(OSError):
            super().write(content)
        return len(memoryview(content).cast("B"))


def prepare_streams() -> None:
    """Make standard streams safe to use; a program calls it before it opens anything.

    1. A number from 0 to 2 that is closed is taken. Otherwise a file that is opened later would get
       the number, and what is meant for a stream would be written there.
    2. A closed standard output is one that cannot be written: OSError, as on a full disk.
    3. Messages on standard error that nobody hears are dropped: they are no result.
    """
    closed = [number for number in (0, 1, 2) if not _is_open(number)]
    for _ in closed:
        # The system takes the lowest free number; reading alone, writes to it fail.
        number = os.open(os.devnull, os.O_RDONLY)
        # Processes that this one starts have streams too.
        os.set_inheritable(number, True)
    if sys.stdout is None:
        sys.stdout = open(1, "w", encoding="utf-8", closefd=False)  # noqa: SIM115
    if sys.stderr is None or (sys.stderr is sys.__stderr__ and sys.stderr.fileno() == 2):
        encoding = sys.stderr.encoding if sys.stderr else "utf-8"
        sys.stderr = io.TextIOWrapper(
            io.BufferedWriter(_Forgiving(2, "w", closefd=False)),
            encoding=encoding,
            errors="backslashreplace",
            line_buffering=True,
        )


def forget_output() -> None:
    """Let what was not written go nowhere, so that the interpreter does not try again at its end."""
    with suppress(OSError, ValueError, AttributeError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _is_open(number: int) -> bool:
    """Whether the process has an open file of that number."""
    try:
        os.fstat(number)
    except OSError:
        return False
    return True
