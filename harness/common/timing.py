"""Timing: repeated runs with the collector off, their minimum and spread, and a sentinel for an unsteady machine."""

import gc
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from math import inf
from time import perf_counter, sleep

MOST_RUNS = 5
BUDGET = 1.0
SENTINEL_ROUNDS = 20_000
# A machine is steady while the sentinel takes at most this many times its quickest; else it is looked at again after so
# many seconds.
NEAR, PAUSE = 1.15, 0.02


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


@dataclass
class Patience:
    """Waits while a machine is slow: some halve their speed for seconds on end, as others work on the same processor.

    Parameters
    ----------
    look : callable
        Returns the sentinel's time where the timed runs take place.
    share : float
        Part of the time that may be spent waiting.
    """

    look: Callable[[], float]
    share: float = 0.1
    _quickest: float = field(default=inf, init=False)
    _began: float = field(default_factory=perf_counter, init=False)
    _waited: float = field(default=0.0, init=False)

    def steady(self) -> float:
        """The sentinel's time, once it is near its quickest or patience has run out."""
        found = self._look()
        while found > NEAR * self._quickest and self._waited < self.share * (perf_counter() - self._began):
            paused = perf_counter()
            sleep(PAUSE)
            found = self._look()
            self._waited += perf_counter() - paused
        return found

    def _look(self) -> float:
        found = self.look()
        self._quickest = min(self._quickest, found)
        return found
