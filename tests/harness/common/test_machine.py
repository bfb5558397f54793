"""Where and when: the head of every page of measured records."""

from pathlib import Path
from subprocess import run

import pytest

from polhode.harness.common.code_digest import code_digest
from polhode.harness.common.machine import (
    Maker,
    commit,
    dates,
    machine,
    makers_of,
    provenance,
    surroundings,
    surroundings_of,
)

ONE = {
    "machine": {"processor": "One", "cores": 2, "system": "Linux", "python": "3.11"},
    "versions": {"polhode": "1", "numpy": "2"},
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
    # A record of a day alone stands for the day's beginning.
    day = {**runs[0], "date": runs[0]["date"][:10]}
    assert " timed runs" in provenance("", [day, *runs])[2]


def test_every_machine_is_named_once():
    text = "\n".join(provenance("polhode bench", [ONE, TWO, ONE]))
    assert text.startswith("Made by `polhode bench`.")
    assert (
        text.count("One, 2 cores, Linux, Python 3.11 (numpy 2)") == text.count("Two, 2 cores") == 1
    )


def test_a_page_names_every_version_and_commit_that_measured_it():
    first, second = ({**ONE, "commit": letter * 9} for letter in "ab")
    line = provenance("", [first, second, first, ONE, {}])[2]
    assert line.startswith(
        "Measured on an unknown date by polhode 1, commit aaaaaaaaa, and polhode 1, commit "
        "bbbbbbbbb, and polhode 1, commit not kept, and polhode of an unknown version, commit not "
        "kept, on One, 2 cores,"
    )
    assert makers_of(line) == [
        Maker("1", "a" * 9),
        Maker("1", "b" * 9),
        Maker("1", ""),
        Maker("", ""),
    ]
    assert makers_of("Measured on Monday.") == []


def test_a_page_names_the_code_that_measured_it_beside_the_commit():
    old = {**ONE, "commit": "a" * 9}
    new = {**old, "code": "0123456789ab"}
    line = provenance("", [old, new])[2]
    assert "commit aaaaaaaaa, and polhode 1, commit aaaaaaaaa, code 0123456789ab, on One" in line
    assert makers_of(line) == [Maker("1", "a" * 9), Maker("1", "a" * 9, "0123456789ab")]
    assert "code" not in surroundings_of(old)
    assert surroundings_of({**new, "seconds": 1.0}) == new
    assert surroundings()["code"] == code_digest()


def test_a_commit_is_of_the_clone_and_tells_changes_of_code(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    def git(*words: str) -> str:
        who = ["-c", "user.name=A", "-c", "user.email=a@b.c"]
        done = run(["git", *who, *words], cwd=tmp_path, check=True, capture_output=True, text=True)
        return done.stdout.strip()

    code = tmp_path / "harness" / "common" / "machine.py"
    code.parent.mkdir(parents=True)
    code.write_text("before", encoding="utf-8")
    (tmp_path / "page.md").write_text("before", encoding="utf-8")
    monkeypatch.setattr("polhode.harness.common.machine.__file__", str(code))
    monkeypatch.delenv("GIT_DIR", raising=False)

    def found() -> str | None:
        commit.cache_clear()
        return commit()

    assert found() is None
    git("init", "--quiet")
    git("add", ".")
    git("commit", "--quiet", "--message", "first")
    name = git("rev-parse", "--short=9", "HEAD")
    (tmp_path / "page.md").write_text("after", encoding="utf-8")
    assert found() == name
    code.write_text("after", encoding="utf-8")
    assert found() == f"{name} with changes"
    record = surroundings()
    assert makers_of(provenance("", [record])[2])[0].commit == f"{name} with changes"
    commit.cache_clear()


def test_an_unknown_processor_stands_on_no_page_of_another_one(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(Path, "read_text", lambda *_, **__: "")
    monkeypatch.setattr("platform.processor", lambda: "")
    known = {**ONE, "machine": {**machine(), "processor": "One"}}
    assert str(machine()["processor"]) not in "\n".join(provenance("polhode bench", [known]))
