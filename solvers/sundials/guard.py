"""How a SUNDIALS run is stopped from within: its right-hand side turns NaN, upon which the library gives up."""

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import perf_counter
from typing import Any

import numpy as np

from polhode.solvers.contract import Record

Callback = Callable[..., None]

# Seconds between two looks at the deadline, and looks at one and the same time that make a stall.
INTERVAL = 1e-3
STALLED = 100


class Guard:
    """Stops a run from within its right-hand side, which looks at the clock and, at every alarm, here.

    A step too small to advance the time is no error to the library: it "will continue anyway". Here it is.
    """

    def __init__(self) -> None:
        self.open(None)

    def open(self, record: Record | None) -> None:
        """Begin a run into a record, whose `now` follows the run."""
        self.record = record
        self.calls, self.alarm, self.deadline = 0, 0.0, record.deadline if record else np.inf
        self.time, self.repeats = -np.inf, 0

    def close(self) -> None:
        """Stop the run at its next right-hand side."""
        self.alarm = self.deadline = 0.0

    def closed(self, time: float) -> bool:
        """Whether the right-hand side at a time is to turn NaN, from now on."""
        if self.alarm == 0.0 == self.deadline:
            return True
        now = perf_counter()
        self.repeats = self.repeats + 1 if time == self.time else 0
        self.time, self.alarm = time, now + INTERVAL
        if self.record:
            self.record.now = time
        if now > self.deadline or self.stalled:
            self.close()
            return True
        return False

    @property
    def stalled(self) -> bool:
        """Whether the time stands still."""
        return self.repeats >= STALLED


def guarded(callback: Callback, parameters: Any, guard: Guard, count: bool) -> Callback:
    """CVODE's right-hand side: NaN once the guard is closed, and counting if asked."""

    def rhs(t: float, y: np.ndarray, out: np.ndarray) -> None:
        if perf_counter() > guard.alarm and guard.closed(t):
            out[:] = np.nan
        else:
            callback(y, parameters, out)

    def counted(t: float, y: np.ndarray, out: np.ndarray) -> None:
        guard.calls += 1
        rhs(t, y, out)

    return counted if count else rhs


def guarded_residual(residual: Callback, mass: np.ndarray, parameters: Any, guard: Guard, count: bool) -> Callback:
    """IDA's residual, as `guarded`."""

    def resfn(t: float, y: np.ndarray, rates: np.ndarray, out: np.ndarray) -> None:
        if perf_counter() > guard.alarm and guard.closed(t):
            out[:] = np.nan
        else:
            residual(y, rates, mass, parameters, out)

    def counted(t: float, y: np.ndarray, rates: np.ndarray, out: np.ndarray) -> None:
        guard.calls += 1
        resfn(t, y, rates, out)

    return counted if count else resfn


@contextmanager
def deferred_interrupt(press: Callable[[], None]) -> Iterator[None]:
    """Hold back `KeyboardInterrupt`: Ctrl-C calls `press`, the exception follows at the end of the block.

    The library would lose its rows or swallow the exception. Python's own handler alone is replaced, in the main
    thread; elsewhere Ctrl-C does what it always does.
    """
    in_main_thread = threading.current_thread() is threading.main_thread()
    if not in_main_thread or signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        yield
        return
    pressed = []

    def handler(number: int, frame: Any) -> None:
        pressed.append(number)
        press()

    signal.signal(signal.SIGINT, handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    if pressed:
        raise KeyboardInterrupt
