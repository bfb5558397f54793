"""Timing on functions of known duration."""

import gc
import os
import subprocess
import sys
import time
from itertools import chain, count, repeat
from math import inf

import pytest

from polhode.harness.common.timing import (
    BUDGET,
    MOST_RUNS,
    Pace,
    Patience,
    Timing,
    collector_off,
    seconds_of,
    sentinel,
    time_runs,
    with_processor,
    within,
)


def test_a_sleeper_is_timed():
    timing = time_runs(lambda: time.sleep(0.05))
    assert len(timing.runs) == MOST_RUNS
    assert 0.05 <= timing.seconds < 0.1
    assert timing.spread >= 0


def test_the_minimum_of_uneven_runs():
    naps = iter([0.08, 0.02, 0.06, 0.04, 0.05])
    timing = time_runs(lambda: time.sleep(next(naps)))
    assert timing.seconds == min(timing.runs)
    assert 0.02 <= timing.seconds < 0.08
    assert timing.spread == max(timing.runs) - min(timing.runs) > 0


def test_a_slow_function_runs_once_and_a_quick_one_five_times():
    assert not Timing((BUDGET,)).wants_more
    assert Timing((0.6 * BUDGET,)).wants_more
    assert not Timing((0.6 * BUDGET, 0.6 * BUDGET)).wants_more
    assert Timing((MOST_RUNS - 1) * (1e-6,)).wants_more
    assert not Timing(MOST_RUNS * (1e-6,)).wants_more
    assert Timing((2.0,)).spread == 0


def test_a_run_that_waited_for_the_processor_is_disturbed_and_repeated():
    waited = Timing((0.01,) * MOST_RUNS, (0.005,) * MOST_RUNS)
    assert waited.disturbed
    assert waited.wants_more
    assert not Timing(2 * waited.runs, 2 * waited.processor).wants_more
    better = waited.and_one(0.006, 0.0059)
    assert not better.disturbed
    assert not better.wants_more
    # Too short to be judged by the processor's clock.
    assert not Timing((1e-5,), (1e-6,)).disturbed


@pytest.mark.parametrize(
    ("had", "limits"),
    [((0.5, 1.0), [1.0, 3.0]), ((0.95,), [1.0]), ((0.5, 0.6, 0.7), [1.0, 3.0, 7.5])],
)
def test_a_limit_ends_a_run_that_had_the_processor(had, limits, monkeypatch):
    """Another one gets as much more time, and is marked where not even that was enough."""
    shares, given = iter(had), []

    def watched(run):
        return run(), given[-1], next(shares)

    monkeypatch.setattr("polhode.harness.common.timing.with_processor", watched)
    ended = within(
        1.0, lambda limit: given.append(limit) or "stopped", lambda found: found == "stopped"
    )
    assert given == pytest.approx(limits, rel=0.03)
    assert ended == ("stopped", had[-1] < 0.9)


def test_waiting_for_others_is_no_use_of_the_processor():
    """One processor, two that want it."""
    here = os.sched_getaffinity(0)
    code = (
        f"import os; os.sched_setaffinity(0, {{{min(here)}}}); print(flush=True); sum(iter(int, 1))"
    )
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE) as other:
        try:
            os.sched_setaffinity(0, {min(here)})
            assert other.stdout
            other.stdout.readline()
            until = time.perf_counter() + 0.4
            _, seconds, had = with_processor(
                lambda: all(time.perf_counter() < until for _ in repeat(0))
            )
        finally:
            os.sched_setaffinity(0, here)
            other.kill()
    assert seconds >= 0.39
    assert 0.0 < had < 0.8 * seconds


def test_a_machine_far_slower_than_at_its_quickest_is_busy():
    patience = Patience(iter([1.0]).__next__)
    assert patience.steady() == 1.0
    assert [patience.busy(found) for found in (1.0, 1.4, 1.6)] == [False, False, True]


def test_the_collector_stays_out_and_comes_back():
    seen = []
    seconds_of(lambda: seen.append(gc.isenabled()))
    assert seen == [False]
    assert gc.isenabled()
    with pytest.raises(ZeroDivisionError), collector_off():
        _ = 1 / 0
    assert gc.isenabled()
    gc.disable()
    try:
        with collector_off():
            pass
        assert not gc.isenabled()
    finally:
        gc.enable()


def test_every_run_counts():
    calls = count()
    timing = time_runs(lambda: next(calls))
    assert next(calls) == len(timing.runs)


def test_the_sentinel_takes_a_millisecond_or_so():
    assert 1e-4 < min(sentinel() for _ in range(5)) < 0.1


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """The clock of what waits, which goes on while it waits and where it is set."""
    now = [time.perf_counter()]
    monkeypatch.setattr("polhode.harness.common.timing.perf_counter", lambda: now[0])
    monkeypatch.setattr(
        "polhode.harness.common.timing.sleep", lambda seconds: now.append(now.pop() + seconds)
    )
    return now


def test_slow_moments_are_waited_out(clock: list[float]):
    looks = iter([1.0, 2.0, 1.8, 1.1, 3.0])
    patience = Patience(lambda: next(looks))
    assert patience.steady() == 1.0
    clock[0] += 0.25
    assert patience.steady() == 1.1
    assert next(looks) == 3.0


def test_patience_ends(clock: list[float]):
    """A machine that stays slow is waited for during a tenth of the time, and no longer."""
    looks = chain([1.0], repeat(2.0))
    patience, began = Patience(lambda: next(looks)), clock[0]
    patience.steady()
    clock[0] += 0.4
    assert patience.steady() == 2.0
    assert 0.44 <= clock[0] - began < 0.5


HERE, THERE = (
    {"processor": "this one", "python": "3.13.1"},
    {"processor": "this one", "python": "3.14.0"},
)


def a_record(seconds: float, sentinel: float | None, machine: dict = HERE) -> dict:
    return {"seconds": seconds, "sentinel_seconds": sentinel, "machine": machine}


def test_times_are_compared_at_the_usual_pace_of_one_machine():
    records = [a_record(3.0, 1e-3), a_record(2.0, 2e-3), a_record(1.0, None), a_record(1.0, inf)]
    pace = Pace.usual(
        [a_record(1.0, 9e-3, THERE), *records, {"sentinel_seconds": 9e-3, "machine": HERE}]
    )
    assert (pace.machine, pace.sentinel) == (HERE, pytest.approx(1.5e-3))
    assert [pace.seconds(record) for record in records] == pytest.approx([4.5, 1.5, 1.0, 1.0])


def test_another_python_says_nothing_of_the_pace():
    pace = Pace(HERE, 1e-3)
    assert pace.seconds(a_record(2.0, 4e-3, THERE)) == 2.0
    assert pace.seconds(a_record(2.0, 4e-3)) == pytest.approx(0.5)


def test_without_a_sentinel_times_are_as_timed():
    assert Pace.usual([{"seconds": 1.0}]) == Pace(None, None)
    assert Pace(None, None).seconds(a_record(2.0, 4e-3)) == 2.0
