"""Timing: repeated runs with the collector off, their minimum and spread, and a sentinel for an unsteady machine.

The sentinel is a fixed piece of arithmetic, timed beside the runs. Run times rise and fall with it, so
dividing by it makes slow and fast moments comparable. Wall time is what a clock shows; processor time
is what the process computed. A number without a reason beside it is an estimate.
"""

import gc
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from math import inf
from resource import RUSAGE_SELF, getrusage
from statistics import median
from time import perf_counter, sleep
from typing import Any, TypeVar

T = TypeVar("T")

# A case is repeated until either is reached: short runs, which vary most, get five repeats, and long
# ones do not take minutes.
MOST_RUNS = 5
BUDGET = 1.0  # Seconds of all its runs.
# Rounds of the loop of `sentinel`: about 1 ms for all of them, on a machine of 2026.
_SENTINEL_ROUNDS = 20_000
# Loops of which the shortest counts: an interrupt lengthens one of them.
_SENTINEL_LOOPS = 3
# A machine is steady while the sentinel takes at most this many times its quickest.
_MAX_STEADY_RATIO = 1.15
_PAUSE = 0.02  # Seconds before an unsteady machine is looked at again.
# A time is disturbed if the sentinel beside it took more than this many times its quickest.
MAX_SENTINEL_RATIO = 1.5
# A time is disturbed too if the fastest run had the processor for less than this share of its wall time.
MIN_PROCESSOR_SHARE = 0.9
_JUDGED_FROM = 1e-3  # Seconds: the processor's share of a shorter run is not judged.
# A run is repeated if its limit stopped it while it lacked the processor. The limit is meant for the
# solver, not for a busy machine.
MAX_REPETITIONS = 2
_LIMIT_FACTOR = 1.5  # Factor on the time limit of a repetition.


@dataclass(frozen=True)
class Timing:
    """Wall times of repeated runs, in seconds, and the processor's, where known."""

    runs: tuple[float, ...]
    processor: tuple[float, ...] = ()

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
        """Whether a further run is due: up to `MOST_RUNS` runs or `BUDGET` seconds.

        While the fastest run is disturbed, twice that.
        """
        effort = 1 + self.disturbed
        return len(self.runs) < effort * MOST_RUNS and sum(self.runs) < effort * BUDGET

    def and_one(self, seconds: float, processor: float) -> "Timing":
        """The same with a further run."""
        return Timing((*self.runs, seconds), (*self.processor, processor))

    @property
    def disturbed(self) -> bool:
        """Whether even the fastest run had to wait for the processor."""
        if not self.processor or self.seconds < _JUDGED_FROM:
            return False
        processor = self.processor[self.runs.index(self.seconds)]
        return processor < MIN_PROCESSOR_SHARE * self.seconds


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


def with_processor(function: Callable[[], T]) -> tuple[T, float, float]:
    """The value of a call, its wall time, and its time without waiting for others, both in seconds.

    A process that the system took off the processor, which `ru_nivcsw` counts, waited for others: its time without
    waiting is its processor time. Else it is the wall time, in which the process may have slept of its own accord.
    Processor time adds up all threads of the process, and may exceed the wall time if a call has several.
    """
    before = getrusage(RUSAGE_SELF)
    began = perf_counter()
    value = function()
    seconds = perf_counter() - began
    after = getrusage(RUSAGE_SELF)
    used = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    # A process that sleeps waits for nobody.
    return value, seconds, used if after.ru_nivcsw > before.ru_nivcsw else seconds


def within(limit: float, run: Callable[[float], T], stopped: Callable[[T], bool]) -> tuple[T, bool]:
    """The value of a run that stops by itself after `limit` seconds, and whether other work stopped it.

    `run(limit)` gives the value, and `stopped(value)` whether the limit stopped the run.
    """
    # `had` is the time without waiting. A run that was stopped while it had to wait for the processor is
    # run again. The new limit is the old one × wall/`had` × `_LIMIT_FACTOR`. There `had` counts as at least
    # limit/4, so that a run that hardly had the processor gets no limit without end.
    value, seconds, had = with_processor(lambda: run(limit))
    for _ in range(MAX_REPETITIONS):
        if not stopped(value) or had >= MIN_PROCESSOR_SHARE * limit:
            break
        longer = _LIMIT_FACTOR * limit * seconds / max(had, limit / 4)
        value, seconds, had = with_processor(lambda longer=longer: run(longer))
    return value, stopped(value) and had < MIN_PROCESSOR_SHARE * limit


def time_runs(function: Callable[[], object]) -> Timing:
    """Time a warmed-up function repeatedly."""
    timing = Timing((seconds_of(function),))
    while timing.wants_more:
        timing = Timing((*timing.runs, seconds_of(function)))
    return timing


def sentinel() -> float:
    """Wall time, in seconds, of a fixed piece of arithmetic: the same on a steady machine, whatever else changes.

    The arithmetic is a loop in plain Python, whose steps depend on each other: the logistic map, which neither
    settles nor overflows with these numbers. The least of `_SENTINEL_LOOPS` loops counts.
    """

    def kernel() -> float:
        x = 0.3
        for _ in range(_SENTINEL_ROUNDS):
            x = 3.9 * x * (1.0 - x)
        return x

    return min(seconds_of(kernel) for _ in range(_SENTINEL_LOOPS))


@dataclass
class Patience:
    """Waits while a machine is slow: some halve their speed for seconds, as others work on the same processor.

    It looks at the sentinel before each run that is timed, and waits while the sentinel is not near its quickest.
    """

    # The sentinel's time where the timed runs take place, in seconds: `sentinel`, or the same in a worker
    # process, and inf if that failed.
    look: Callable[[], float]
    share: float = 0.1  # of the time, that may be spent waiting
    _quickest: float = field(default=inf, init=False)
    _began: float = field(default_factory=perf_counter, init=False)
    _waited: float = field(default=0.0, init=False)

    def steady(self) -> float:
        """The sentinel's time, once it is near its quickest or patience has run out."""
        sentinel = self._look()
        while sentinel > _MAX_STEADY_RATIO * self._quickest and self._waited < self.share * (
            perf_counter() - self._began
        ):
            paused = perf_counter()
            sleep(_PAUSE)
            sentinel = self._look()
            self._waited += perf_counter() - paused
        return sentinel

    def busy(self, sentinel: float) -> bool:
        """Whether the machine was so slow, by a time of the sentinel, that a time says little."""
        return sentinel > MAX_SENTINEL_RATIO * self._quickest

    def _look(self) -> float:
        """The sentinel's time now, remembered if it is the quickest so far."""
        sentinel = self.look()
        self._quickest = min(self._quickest, sentinel)
        return sentinel


def disturbance(records: Iterable[Mapping[str, Any]]) -> tuple[int, int]:
    """How many of the timed records are disturbed, and of how many it is known whether they are."""
    flags = [bool(record["disturbed"]) for record in records if record.get("disturbed") is not None]
    return sum(flags), len(flags)


@dataclass(frozen=True)
class Pace:
    """The sentinel's usual time, in seconds, on a machine with its Python; no other machine's compares."""

    machine: Mapping[str, Any] | None
    sentinel: float | None

    @classmethod
    def usual(cls, records: Iterable[Mapping[str, Any]]) -> "Pace":
        """Pace of timed records: the machine of the last one, and the median of the sentinel there."""
        timed = [record for record in records if "seconds" in record and _sentinel_of(record)]
        if not timed:
            return cls(None, None)
        machine = timed[-1].get("machine")
        return cls(
            machine,
            median(_sentinel_of(record) for record in timed if record.get("machine") == machine),
        )

    def seconds(self, record: Mapping[str, Any]) -> float:
        """Wall time of a record as it would be at this pace.

        It is the time as measured if that was on another machine, or without a sentinel.
        """
        seconds = float(record["seconds"])
        sentinel = _sentinel_of(record)
        comparable = self.sentinel and sentinel and record.get("machine") == self.machine
        return seconds * self.sentinel / sentinel if comparable and self.sentinel else seconds


def _sentinel_of(record: Mapping[str, Any]) -> float:
    """The sentinel's time beside a record; 0 where it is not known."""
    sentinel = record.get("sentinel_seconds")
    return sentinel if sentinel and sentinel < inf else 0.0
