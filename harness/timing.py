"""Timing: repeated runs with the collector off, their minimum and spread, and a sentinel for a drifting machine."""

import gc
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from time import perf_counter

MOST_RUNS = 5
BUDGET = 1.0
SENTINEL_ROUNDS = 20_000


@dataclass(frozen=True)
class Timing:
    """Wall times of repeated runs, in seconds."""

    runs: tuple[float, ...]

    @property
    def seconds(self) -> float:
        """The minimum: what disturbs a run can only lengthen it."""
        return min(self.runs)

    @property
    def spread(self) -> float:
        """Largest minus smallest; 0 for a single run."""
        return max(self.runs) - min(self.runs)

    @property
    def wants_more(self) -> bool:
        """Whether a further run is due: up to five runs or one second, once if a run exceeds one second."""
        return len(self.runs) < MOST_RUNS and sum(self.runs) < BUDGET


@contextmanager
def collector_off() -> Iterator[None]:
    """Keep Python's garbage collector out of a timed run."""
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()


def seconds_of(function: Callable[[], object]) -> float:
    """Wall time of one call."""
    with collector_off():
        began = perf_counter()
        function()
        return perf_counter() - began


def time_runs(function: Callable[[], object]) -> Timing:
    """Time a warmed-up function repeatedly."""
    timing = Timing((seconds_of(function),))
    while timing.wants_more:
        timing = Timing((*timing.runs, seconds_of(function)))
    return timing


def sentinel() -> float:
    """Wall time, in seconds, of a fixed piece of arithmetic: the same on a steady machine, whatever else changes."""

    def kernel() -> float:
        x = 0.3
        for _ in range(SENTINEL_ROUNDS):
            x = 3.9 * x * (1.0 - x)
        return x

    return min(seconds_of(kernel) for _ in range(3))
