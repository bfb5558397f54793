"""Messages on standard error about work that may take long.

On a terminal, one line that is rewritten: the work, its share done, and the time remaining.
Elsewhere, as in a pipe or a log, whole lines: `Progress` writes one note on a long run, `Steps` one
line at the start, if it knows the total, and one a minute.
"""

import sys
from collections.abc import Callable, Iterable, Iterator, Sized
from contextlib import suppress
from threading import Event, Thread
from time import time
from typing import IO, TYPE_CHECKING, Any, TypeVar

from polhode.harness.common.text import duration

if TYPE_CHECKING:
    from tqdm import tqdm

T = TypeVar("T")
# The numbers below are estimates: they set when messages appear, and change nothing that is computed.
PATIENCE = 1.0  # Seconds before `Progress` shows anything on a terminal.
INTERVAL = 0.2  # Seconds between two looks.
NOTE_AFTER = 3.0  # Seconds after which a note tells of a long run.
_LONG = 30.0  # Seconds from which on a run is long.
_LINE_EVERY = 60.0  # Seconds between two lines of `Steps` off a terminal.
_LEAST_BAR = 10  # Columns that the bar of `Steps` has at least.
_GROWTH = 3  # Columns by which the counts and the time remaining may yet grow.
_LEAST_DETAIL = 8  # Columns below which words on the present step are left out.
_COLUMNS = 80  # Columns of a terminal that does not tell its width: a terminal's usual ones.
# Share of the work done below which nothing is said about the rest.
_TOO_EARLY = 1e-3
# Options of tqdm: the bar stands for the whole work, 1, and is written anew at every look. The time
# remaining follows the mean speed since the start.
_EVERY_LOOK: dict[str, Any] = {
    "position": 0,
    "total": 1.0,
    "mininterval": 0.0,
    "miniters": 0,
    "smoothing": 0,
}
_UNKNOWN = "{desc}: {elapsed}"
_KNOWN = "{desc}: {percentage:.0f} %, {remaining} left"
_STEPS = (
    "{desc}: {percentage:3.0f} % |{bar}| {n_fmt} of {total_fmt} {unit}, {remaining} left{postfix}"
)
_STEPS_WITHOUT_TOTAL = "{desc}: {n_fmt} {unit}, {elapsed}{postfix}"


def expectation(done: float, seconds: float) -> str:
    """Words on the duration of a run whose share `done`, from 0 to 1, took `seconds`; empty if that is not long.

    Without a share done, they say that the run has hardly begun.
    """
    if not done > 0:
        return f"it has hardly begun after {duration(seconds)}"
    expected = seconds / done
    return f"it is expected to take about {duration(expected)}" if expected >= _LONG else ""


def _is_terminal(stream: IO[str] | None) -> bool:
    """Whether a stream is an open terminal."""
    # A stream may be closed already (ValueError), or be no file (AttributeError).
    with suppress(AttributeError, ValueError):
        return stream is not None and stream.isatty()
    return False


class Progress:
    """Messages on `stream`, by default standard error, by a thread of its own."""

    def __init__(self, quiet: bool = False, stream: IO[str] | None = None) -> None:
        self._stream = stream or sys.stderr
        self._quiet = quiet
        self._stop = Event()
        self._thread = Thread(target=self._watch, daemon=True)
        self._noting_since: float | None = None
        self._on_terminal = _is_terminal(self._stream)
        self._since = time()
        self.begin("")

    def begin(
        self,
        title: str,
        fraction: Callable[[], float] | None = None,
        note: Callable[[float], str] | None = None,
    ) -> "Progress":
        """Begin a task; return this object, for ``with``.

        `fraction` returns how much of it is done, from 0 to 1, if `advance` does not; `note`, of the
        seconds since it began, what is to be said of a long run, or nothing.
        """
        now = time()
        self._done = 0.0
        self._task = (title, fraction, note, now)
        if note and self._noting_since is None:
            self._noting_since = now
        return self

    def advance(self, done: float) -> None:
        """Set how much of the task is done, from 0 to 1."""
        self._done = done

    def _watch(self) -> None:
        """Look at the task again and again: write the note of a long run, and on a terminal keep its line."""
        shown = bar = None
        noted = False
        while not self._stop.wait(INTERVAL):
            title, fraction, note, began = task = self._task
            if note and not noted and time() - (self._noting_since or began) > NOTE_AFTER:
                noted = self._say(note(time() - began), bar)
            if not self._on_terminal:
                continue
            if bar is None or task is not shown:
                from tqdm import tqdm

                if bar:
                    bar.close()
                bar = tqdm(
                    desc=title,
                    file=self._stream,
                    disable=not title,
                    leave=False,
                    bar_format=_UNKNOWN,
                    delay=max(0.0, PATIENCE - (began - self._since)),
                    **_EVERY_LOOK,
                )
                shown = task
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
            print(f"note: {note}", file=self._stream, flush=True)
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


class Steps:
    """The count of finished steps of a work, on `stream`, by default standard error.

    Nothing runs beside the work: times that are measured in this process are not disturbed.
    """

    def __init__(
        self,
        title: str,
        total: int | None = None,
        unit: str = "steps",
        quiet: bool = False,
        stream: IO[str] | None = None,
    ) -> None:
        self._title = title
        self._total = total
        self._unit = unit
        self._stream = stream or sys.stderr
        self._quiet = quiet or self._stream is None
        self._bar: tqdm[Any] | None = None
        self._finished = 0
        self._detail = ""
        self._began = time()
        self._said = self._began

    def __enter__(self) -> "Steps":
        if self._quiet:
            return self
        if _is_terminal(self._stream):
            from tqdm import tqdm

            self._bar = tqdm(
                total=self._total,
                desc=self._title,
                unit=self._unit,
                file=self._stream,
                leave=False,
                dynamic_ncols=True,
                smoothing=0,
                bar_format=_STEPS_WITHOUT_TOTAL if self._total is None else _STEPS,
            )
        elif self._total:
            self._line(f"{self._title}: {self._total} {self._unit}")
        return self

    def __exit__(self, *exception: object) -> None:
        if self._bar is not None:
            self._bar.close()

    def detail(self, words: str) -> None:
        """Say what the present step is, where there is room for it."""
        self._detail = words
        if self._bar is not None:
            self._bar.set_postfix_str(self._fitting(words), refresh=True)

    def advance(self, count: int = 1) -> None:
        """Count finished steps."""
        self._finished += count
        if self._bar is not None:
            self._bar.update(count)
        elif not self._quiet and time() - self._said >= _LINE_EVERY:
            self._said = time()
            of = f" of {self._total}" if self._total is not None else ""
            after = duration(self._said - self._began)
            self._line(f"{self._title}: {self._finished}{of} {self._unit} after {after}")

    def over(self, items: Iterable[T]) -> Iterator[T]:
        """The items, each a step that is finished when the next one is requested."""
        with self:
            for item in items:
                yield item
                self.advance()

    def _fitting(self, words: str) -> str:
        """The words, shortened so that the bar keeps `_LEAST_BAR` columns; empty if little is left."""
        if self._bar is None:
            return ""
        state = self._bar.format_dict
        without_bar = {"bar_format": state["bar_format"].replace("{bar}", ""), "ncols": None}
        line = self._bar.format_meter(**{**state, **without_bar, "postfix": ""})
        # tqdm puts ", " before the words.
        room = (state["ncols"] or _COLUMNS) - len(line) - len(", ") - _LEAST_BAR - _GROWTH
        if room < _LEAST_DETAIL:
            return ""
        return words if len(words) <= room else words[: room - 1] + "…"

    def _line(self, words: str) -> None:
        """Write a whole line."""
        # Who listens may have gone.
        with suppress(OSError, ValueError):
            print(words, file=self._stream, flush=True)


def in_steps(
    items: Iterable[T],
    title: str,
    unit: str = "steps",
    quiet: bool = False,
    stream: IO[str] | None = None,
) -> Iterator[T]:
    """The items, each a finished step of `Steps` when the next one is requested."""
    total = len(items) if isinstance(items, Sized) else None
    return Steps(title, total, unit, quiet, stream).over(items)
