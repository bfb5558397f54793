"""Times of slow and quick moments at one pace."""

from math import inf

import pytest

from polhode.harness.common.pace import Pace

HERE, THERE = {"processor": "this one", "python": "3.13.1"}, {"processor": "this one", "python": "3.14.0"}


def a_record(seconds: float, sentinel: float | None, machine: dict = HERE) -> dict:
    return {"seconds": seconds, "sentinel_seconds": sentinel, "machine": machine}


def test_times_are_compared_at_the_usual_pace_of_one_machine():
    records = [a_record(3.0, 1e-3), a_record(2.0, 2e-3), a_record(1.0, None), a_record(1.0, inf)]
    pace = Pace.usual([a_record(1.0, 9e-3, THERE), *records, {"sentinel_seconds": 9e-3, "machine": HERE}])
    assert (pace.machine, pace.sentinel) == (HERE, pytest.approx(1.5e-3))
    assert [pace.seconds(record) for record in records] == pytest.approx([4.5, 1.5, 1.0, 1.0])


def test_another_python_says_nothing_of_the_pace():
    pace = Pace(HERE, 1e-3)
    assert pace.seconds(a_record(2.0, 4e-3, THERE)) == 2.0
    assert pace.seconds(a_record(2.0, 4e-3)) == pytest.approx(0.5)


def test_without_a_sentinel_times_are_as_timed():
    assert Pace.usual([{"seconds": 1.0}]) == Pace(None, None)
    assert Pace(None, None).seconds(a_record(2.0, 4e-3)) == 2.0
