"""Where and when: the head of every page of measured records."""

from pathlib import Path

import pytest

from polhode.harness.common.machine import dates, machine, provenance

ONE = {
    "machine": {"processor": "One", "cores": 2, "system": "Linux", "python": "3.11"},
    "versions": {"polhode": "1"},
}
TWO = {**ONE, "machine": {**ONE["machine"], "processor": "Two"}}


def test_dates_of_records():
    first, later = {"date": "2026-01-02T23:59:59Z"}, {"date": "2026-01-10T00:00:00Z"}
    assert dates([first]) == "on 2026-01-02"
    assert dates([later, first, first]) == "from 2026-01-02 to 2026-01-10"
    assert dates([{}, first]) == "on 2026-01-02, and on unknown dates"
    assert dates([{}, {"date": None}]) == "on an unknown date"


def test_a_page_says_how_long_its_runs_took_without_pauses():
    times = ("10:00:00", "10:04:00", "10:08:00", "23:00:00", "23:01:00")
    runs = [
        {**ONE, "date": f"2026-01-02T{time}Z", "seconds": 1.0, "disturbed": False} for time in times
    ]
    assert "0 of 5 timed runs, made in 9 minutes (the fastest" in provenance("", runs)[2]
    assert "0 of 2 timed runs (the fastest" in provenance("", runs[-2:])[2]


def test_every_machine_is_named_once():
    text = "\n".join(provenance("polhode bench", [ONE, TWO, ONE]))
    assert text.startswith("Made by `polhode bench`.")
    assert (
        text.count("One, 2 cores, Linux, Python 3.11 (polhode 1)")
        == text.count("Two, 2 cores")
        == 1
    )


def test_an_unknown_processor_stands_on_no_page_of_another_one(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(Path, "read_text", lambda *_, **__: "")
    monkeypatch.setattr("platform.processor", lambda: "")
    known = {**ONE, "machine": {**machine(), "processor": "One"}}
    assert str(machine()["processor"]) not in "\n".join(provenance("polhode bench", [known]))
