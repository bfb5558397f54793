"""Where the wall time of a thread goes: every moment counts for the innermost piece of work alone."""

from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
from threading import local
from time import perf_counter


class _Spent(local):
    """Seconds by piece of work, of the thread that asks."""

    def __init__(self) -> None:
        self.seconds: defaultdict[str, float] = defaultdict(float)


SPENT = _Spent()


@contextmanager
def spent_on(work: str) -> Iterator[None]:
    """Count a block, or a function that this decorates."""
    seconds = SPENT.seconds
    began, inside = perf_counter(), sum(seconds.values())
    try:
        yield
    finally:
        seconds[work] += perf_counter() - began - (sum(seconds.values()) - inside)
