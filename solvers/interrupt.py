"""Ctrl-C during a call into a library that would lose its rows, or swallow the exception."""

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any


@contextmanager
def deferred_interrupt(press: Callable[[], None]) -> Iterator[None]:
    """Hold back `KeyboardInterrupt`: Ctrl-C calls `press`, the exception follows at the end of the block.

    Python's own handler alone is replaced, in the main thread; elsewhere Ctrl-C does what it always does.
    """
    if (
        threading.current_thread() is not threading.main_thread()
        or signal.getsignal(signal.SIGINT) is not signal.default_int_handler
    ):
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
