"""One line on a terminal about work that takes longer than two seconds: what, how far, and the time remaining."""

import sys
from collections.abc import Callable
from threading import Event, Thread
from time import monotonic
from types import TracebackType
from typing import IO

# Seconds before anything is shown, and between two looks.
PATIENCE, INTERVAL = 2.0, 0.2
# Less of the work done tells nothing about the rest.
TOO_EARLY = 1e-3


class Progress:
    """A line on `stream`, rewritten while the block runs and gone after it; nothing where that is no terminal.

    It is written by a thread of its own, so that the work is not slowed down by it.

    Parameters
    ----------
    quiet : bool
        Show nothing.
    stream : file, optional
        By default standard error.
    """

    def __init__(self, quiet: bool = False, stream: IO[str] | None = None) -> None:
        self._stream = stream or sys.stderr
        self._shown = not quiet and self._stream.isatty()
        self._stop, self._thread = Event(), Thread(target=self._watch, daemon=True)
        self.begin("")

    def begin(self, what: str, fraction: Callable[[], float] | None = None) -> None:
        """Begin a piece of the work; `fraction` tells how much of it is done, from 0 to 1, if `advance` does not."""
        self._done, self._work = 0.0, (what, fraction, monotonic())

    def advance(self, done: float) -> None:
        """Tell how much of the piece is done, from 0 to 1."""
        self._done = done

    def line(self) -> str:
        """What to show now; empty as long as it is too early."""
        what, fraction, began = self._work
        elapsed = monotonic() - began
        if not what or elapsed < PATIENCE:
            return ""
        done = fraction() if fraction else self._done
        if done < TOO_EARLY:
            return f"{what}: {_clock(elapsed)}"
        return f"{what}: {100 * done:.0f} %, {_clock(elapsed * (1 - done) / done)} left"

    def _watch(self) -> None:
        shown = ""
        while not self._stop.wait(INTERVAL):
            text = self.line()
            if text != shown:
                self._stream.write(f"\r\x1b[K{text}")
                self._stream.flush()
                shown = text
        if shown:
            self._stream.write("\r\x1b[K")
            self._stream.flush()

    def __enter__(self) -> "Progress":
        if self._shown:
            self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        if self._shown:
            self._stop.set()
            self._thread.join()


def _clock(seconds: float) -> str:
    """Seconds as a person says them: 12 s, 3 min 20 s, 2 h 5 min."""
    whole = round(seconds)
    if whole < 60:
        return f"{whole} s"
    minutes, rest = divmod(whole, 60)
    return f"{minutes} min {rest} s" if minutes < 60 else f"{minutes // 60} h {minutes % 60} min"
