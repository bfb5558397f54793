"""One line on a terminal about work that takes longer than two seconds: what, how far, and the time remaining."""

import sys
from collections.abc import Callable
from threading import Event, Thread
from typing import IO, Any

from tqdm import tqdm

# Seconds before anything is shown, and between two looks.
PATIENCE, INTERVAL = 2.0, 0.2
# Less of the work done says nothing about the rest.
TOO_EARLY = 1e-3
EVERY_LOOK: dict[str, Any] = {"position": 0, "total": 1.0, "mininterval": 0.0, "miniters": 0, "smoothing": 0}
UNKNOWN, KNOWN = "{desc}: {elapsed}", "{desc}: {percentage:.0f} %, {remaining} left"


class Progress:
    """A line on `stream`, by default standard error, rewritten while the block runs; nothing where that is no terminal.

    A thread of its own writes it, so that the work is not slowed down.
    """

    def __init__(self, quiet: bool = False, stream: IO[str] | None = None) -> None:
        self._stream, self._quiet = stream or sys.stderr, quiet
        self._stop, self._thread = Event(), Thread(target=self._watch, daemon=True)
        self.begin("")

    def begin(self, what: str, fraction: Callable[[], float] | None = None) -> None:
        """Begin a piece of the work; `fraction` returns how much of it is done, from 0 to 1, if `advance` does not."""
        hidden = self._quiet or not what or not self._stream.isatty()
        bar = tqdm(desc=what, file=self._stream, disable=hidden, leave=False, delay=PATIENCE, **EVERY_LOOK)
        self._done, self._piece = 0.0, (bar, fraction)

    def advance(self, done: float) -> None:
        """Set how much of the piece is done, from 0 to 1."""
        self._done = done

    def _watch(self) -> None:
        shown, _ = self._piece
        while not self._stop.wait(INTERVAL):
            bar, fraction = self._piece
            if bar is not shown:
                shown.close()
                shown = bar
            done = fraction() if fraction else self._done
            bar.bar_format = KNOWN if done >= TOO_EARLY else UNKNOWN
            bar.update(done - bar.n)
        shown.close()

    def __enter__(self) -> "Progress":
        self._thread.start()
        return self

    def __exit__(self, *exception: object) -> None:
        self._stop.set()
        self._thread.join()
