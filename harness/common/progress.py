"""Messages on work that takes longer than two seconds.

On a terminal, one line that is rewritten: what, how far, and the time remaining. Anywhere, once, a
note on a long run.
"""

import sys
from collections.abc import Callable
from contextlib import suppress
from threading import Event, Thread
from time import time
from typing import IO, Any

from polhode.harness.common.text import duration

PATIENCE = 2.0  # Seconds before anything is shown.
INTERVAL = 0.2  # Seconds between two looks.
NOTE_AFTER = 3.0  # Seconds after which a note tells of a long run.
_LONG = 30.0  # Seconds from which on a run is long.
# Less of the work done says nothing about the rest.
_TOO_EARLY = 1e-3
_EVERY_LOOK: dict[str, Any] = {
    "position": 0,
    "total": 1.0,
    "mininterval": 0.0,
    "miniters": 0,
    "smoothing": 0,
}
_UNKNOWN = "{desc}: {elapsed}"
_KNOWN = "{desc}: {percentage:.0f} %, {remaining} left"


def expectation(done: float, seconds: float) -> str:
    """Words on the duration of a run whose share `done` took `seconds`; empty if that is not long."""
    if not done > 0:
        return f"it has hardly begun after {duration(seconds)}"
    expected = seconds / done
    return f"it is expected to take about {duration(expected)}" if expected >= _LONG else ""


class Progress:
    """Messages on `stream`, by default standard error, by a thread of its own."""

    def __init__(self, quiet: bool = False, stream: IO[str] | None = None) -> None:
        self._stream = stream or sys.stderr
        self._quiet = quiet
        self._stop = Event()
        self._thread = Thread(target=self._watch, daemon=True)
        self._noting_since: float | None = None
        self._on_terminal = False
        # A stream may be closed already, or none of a file.
        with suppress(AttributeError, ValueError):
            self._on_terminal = self._stream.isatty()
        self.begin("")

    def begin(
        self,
        title: str,
        fraction: Callable[[], float] | None = None,
        note: Callable[[float], str] | None = None,
    ) -> None:
        """Begin a piece of the work.

        `fraction` returns how much of it is done, from 0 to 1, if `advance` does not; `note`, of the
        seconds since it began, what is to be said of a long run, or nothing.
        """
        now = time()
        self._done = 0.0
        self._piece = (title, fraction, note, now)
        if note and self._noting_since is None:
            self._noting_since = now

    def advance(self, done: float) -> None:
        """Set how much of the piece is done, from 0 to 1."""
        self._done = done

    def _watch(self) -> None:
        shown = bar = None
        noted = False
        while not self._stop.wait(INTERVAL):
            title, fraction, note, began = piece = self._piece
            if note and not noted and time() - (self._noting_since or began) > NOTE_AFTER:
                noted = self._say(note(time() - began), bar)
            if not self._on_terminal:
                continue
            if bar is None or piece is not shown:
                from tqdm import tqdm

                if bar:
                    bar.close()
                bar = tqdm(
                    desc=title,
                    file=self._stream,
                    disable=not title,
                    leave=False,
                    delay=PATIENCE,
                    **_EVERY_LOOK,
                )
                shown = piece
                bar.start_t = began
            done = fraction() if fraction else self._done
            bar.bar_format = _KNOWN if done >= _TOO_EARLY else _UNKNOWN
            bar.update(done - bar.n)
        if bar:
            bar.close()

    def _say(self, note: str, bar: Any) -> bool:
        """Write a note on a line of its own, if there is one; whether there was."""
        if not note:
            return False
        if bar:
            bar.clear()
        # Who listens may have gone.
        with suppress(OSError, ValueError):
            print(f"note: {note}; Ctrl-C keeps what is finished", file=self._stream, flush=True)
        return True

    def __enter__(self) -> "Progress":
        # A process without a console has no standard error.
        if not self._quiet and self._stream is not None:
            self._thread.start()
        return self

    def __exit__(self, *exception: object) -> None:
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join()
