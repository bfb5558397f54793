"""One line on a terminal about work that takes longer than two seconds: what, how far, and the time remaining."""

import sys
from collections.abc import Callable
from threading import Event, Thread
from time import time
from typing import IO, Any

# Seconds before anything is shown, and between two looks.
PATIENCE, INTERVAL = 2.0, 0.2
# Less of the work done says nothing about the rest.
TOO_EARLY = 1e-3
EVERY_LOOK: dict[str, Any] = {
    "position": 0,
    "total": 1.0,
    "mininterval": 0.0,
    "miniters": 0,
    "smoothing": 0,
}
UNKNOWN, KNOWN = "{desc}: {elapsed}", "{desc}: {percentage:.0f} %, {remaining} left"


class Progress:
    """A line on `stream`, by default standard error, rewritten by a thread of its own; none if that is no terminal."""

    def __init__(self, quiet: bool = False, stream: IO[str] | None = None) -> None:
        self._stream, self._quiet = stream or sys.stderr, quiet
        self._stop, self._thread = Event(), Thread(target=self._watch, daemon=True)
        self.begin("")

    def begin(self, what: str, fraction: Callable[[], float] | None = None) -> None:
        """Begin a piece of the work; `fraction` returns how much of it is done, from 0 to 1, if `advance` does not."""
        self._done, self._piece = 0.0, (what, fraction, time())

    def advance(self, done: float) -> None:
        """Set how much of the piece is done, from 0 to 1."""
        self._done = done

    def _watch(self) -> None:
        shown = bar = None
        while not self._stop.wait(INTERVAL):
            what, fraction, began = piece = self._piece
            if bar is None or piece is not shown:
                from tqdm import tqdm

                if bar:
                    bar.close()
                bar = tqdm(
                    desc=what,
                    file=self._stream,
                    disable=not what,
                    leave=False,
                    delay=PATIENCE,
                    **EVERY_LOOK,
                )
                shown, bar.start_t = piece, began
            done = fraction() if fraction else self._done
            bar.bar_format = KNOWN if done >= TOO_EARLY else UNKNOWN
            bar.update(done - bar.n)
        if bar:
            bar.close()

    def __enter__(self) -> "Progress":
        # A process without a console has no standard error.
        if not self._quiet and self._stream is not None and self._stream.isatty():
            self._thread.start()
        return self

    def __exit__(self, *exception: object) -> None:
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join()
