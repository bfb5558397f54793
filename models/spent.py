"""Where the wall time of a process goes: every moment counts for the innermost piece of work alone."""

from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
from time import perf_counter

# Seconds by piece of work.
SPENT: defaultdict[str, float] = defaultdict(float)


@contextmanager
def spent_on(work: str) -> Iterator[None]:
    """Count a block, or a function that this decorates."""
    began, inside = perf_counter(), sum(SPENT.values())
    try:
        yield
    finally:
        SPENT[work] += perf_counter() - began - (sum(SPENT.values()) - inside)
