"""A call that nothing but the end of its process stops; in a module, so that a spawned process finds it."""

import ctypes
import os
from pathlib import Path


def sleep_holding_the_lock(seconds: int) -> None:
    """Sleep in C with the interpreter's lock held."""
    ctypes.PyDLL(None).sleep(seconds)


def die_once(mark: Path, number: int) -> str:
    """Die of the signal of that number, unless the file `mark` says that it happened before."""
    if not mark.exists():
        mark.touch()
        os.kill(os.getpid(), number)
    return "alive"


class TwoArgumentsError(Exception):
    """Pickled, it cannot be read: only its message is kept."""

    def __init__(self, first: str, second: str) -> None:
        super().__init__(first + second)


def of_two_arguments() -> TwoArgumentsError:
    """A value that the other side cannot read."""
    return TwoArgumentsError("a", "b")
