"""The harness on solvers whose errors, delays and lies are known, because they are planted."""

import signal
import sqlite3
import subprocess
import sys
import time
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import planted
import pytest
from commandline import SCRIPT, STUDY, Run

from polhode.harness.analysis.frames import frame
from polhode.harness.analysis.pareto import cheapest
from polhode.harness.common.store import Record, Store, read_export
from polhode.harness.common.worker import Failure, KilledFromOutsideError, Reply, Worker
from polhode.harness.references.reference import reference
from polhode.harness.studies.case import time_once
from polhode.harness.studies.runner import Runner
from polhode.harness.studies.study import Choice, Study, read_study

TOLERANCES = (1e-1, 1e-2, 1e-3)
SOLVERS = (
    *(
        "planted:FirstOrder",
        "planted:SecondOrder",
        "planted:Askew",
        "planted:Opposite",
        "planted:Midpoint",
    ),
    *("planted:Sleeper", "planted:Quitter", "planted:Idler", "planted:Breaker", "planted:Dreamer"),
    *("planted:Blower", "planted:Raiser"),
)


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Study:
    path = tmp_path_factory.mktemp("study") / "study.toml"
    path.write_text(STUDY, encoding="utf-8")
    whole = read_study(path)
    name, scene = whole.scenes[0]
    choices = {(name, scene.stokes): Choice(tags=["short", "warm"])}
    return replace(
        whole, scenes=whole.scenes[:1], solvers=SOLVERS, tolerances=TOLERANCES, choices=choices
    )


@pytest.fixture(scope="module")
def records(study: Study, tmp_path_factory: pytest.TempPathFactory) -> list[Record]:
    with Store(tmp_path_factory.mktemp("store") / "store.sqlite") as store:
        return Runner(store, quiet=True).run(study)


def test_every_record_tells_when_it_was_measured_and_the_tags_of_its_scene(records: list[Record]):
    for record in records:
        age = datetime.now(UTC) - datetime.fromisoformat(record["date"])
        assert 0 <= age.total_seconds() < 600
        assert record["tags"] == ["short", "warm"]


def of(records: list[Record], solver: str) -> list[Record]:
    return [record for record in records if record["solver"] == f"planted:{solver}"]


def test_every_case_has_one_record(study: Study, records: list[Record]):
    pairs = [(record["solver"], record["tolerance"]) for record in records]
    assert len(pairs) == len(set(pairs)) == len(SOLVERS) * len(TOLERANCES)


@pytest.mark.parametrize(("solver", "order"), [("FirstOrder", 1), ("SecondOrder", 2)])
def test_planted_errors_are_measured_to_the_last_digit(
    study: Study, records: list[Record], solver: str, order: int
):
    _, scene = study.scenes[0]
    true = reference(scene, "quaternion", study.samples)
    for record in of(records, solver):
        e = record["tolerance"] ** order
        momentum = np.abs(true.observables.angular_momentum[1:]).max() * e
        energy = true.observables.energy[1:].max() * (2 * e + e * e)
        expected = max(momentum, energy) / max(scene.ellipsoid.inertia)
        assert record["status"] == "reached_end"
        assert record["slow_error"] == pytest.approx(expected, rel=1e-9)
        assert record["slow_error"] == record["solver_slow_error"]
        assert record["model_slow_error"] == 0
        assert record["orientation_error"] < 1e-12


def test_a_planted_angle_is_the_orientation_error(records: list[Record]):
    for record in of(records, "Askew"):
        assert record["orientation_error"] == pytest.approx(record["tolerance"], rel=1e-9)


def test_both_signs_of_a_quaternion_are_one_orientation(records: list[Record]):
    for record in of(records, "Opposite"):
        assert record["status"] == "reached_end"
        assert record["orientation_error"] < 1e-12
        assert record["slow_error"] < 1e-12


def test_the_order_of_a_genuine_method_is_measured(records: list[Record]):
    runs = of(records, "Midpoint")
    slopes = np.diff(np.log10([run["slow_error"] for run in runs])) / np.diff(
        np.log10([run["tolerance"] for run in runs])
    )
    assert slopes == pytest.approx([2, 2], abs=0.15)
    assert [run["work"]["steps"] for run in runs] == [10, 100, 1000]
    assert [run["work"]["rhs_calls"] for run in runs] == [20, 200, 2000]


def test_a_sleeper_is_timed(records: list[Record]):
    for record in of(records, "Sleeper"):
        assert 5 <= len(record["seconds_runs"]) <= 10
        assert record["seconds"] == min(record["seconds_runs"])
        assert planted.NAP <= record["seconds"] < 3 * planted.NAP
        assert record["counted_seconds"] >= planted.NAP
        assert record["prepare_seconds"] >= planted.LONG_NAP + planted.NAP


@pytest.mark.parametrize(
    ("solver", "status", "reason"),
    [
        ("Quitter", "false_success", "the library stopped at t = "),
        ("Idler", "false_success", "success after 0 steps"),
        ("Breaker", "false_success", "the invariant is broken by 1.0e+06"),
        ("Blower", "non_finite", "a state is not finite"),
        ("Raiser", "crashed", "RuntimeError: planted failure"),
    ],
)
def test_liars_and_failures_keep_their_rows_without_a_time(
    records, solver: str, status: str, reason: str
):
    for record in of(records, solver):
        assert record["status"] == status
        assert reason in record["message"]
        assert "seconds" not in record
        assert "slow_error" not in record


def test_a_lie_that_keeps_every_invariant_shows_in_the_error(records: list[Record]):
    assert all(record["slow_error"] > 0.1 for record in of(records, "Dreamer"))


def test_no_liar_wins(records: list[Record]):
    table = frame(records)
    for target in (1e-1, 1e-2, 1e-3):
        winner = cheapest(table, target)
        assert winner is not None
        honest = {
            f"planted:{name}"
            for name in ("FirstOrder", "SecondOrder", "Askew", "Opposite", "Midpoint")
        }
        assert {str(winner[0]["solver"]), *(method.solver for method in winner[1])} <= honest


@pytest.mark.parametrize("good_runs", [0, 1])
def test_a_case_that_fails_when_it_is_timed_has_failed(
    study: Study, tmp_path: Path, good_runs: int
):
    class Failing(Worker):
        timed = 0

        def run(self, function, *arguments, limit):
            self.timed += function is time_once
            if self.timed > good_runs and function is time_once:
                return Reply(None, Failure.CRASHED, "crashed with SIGSEGV", 0.0)
            return super().run(function, *arguments, limit=limit)

    one = replace(study, solvers=("planted:FirstOrder",), tolerances=TOLERANCES[:1])
    with Store(tmp_path / "store.sqlite") as store:
        (record,) = Runner(store, quiet=True, _worker=Failing()).run(one)
    assert (record["status"], record["message"]) == ("crashed", "crashed with SIGSEGV")
    assert "seconds" not in record
    assert "slow_error" not in record


def test_a_slow_back_end_says_nothing_of_the_others(study: Study, tmp_path: Path):
    name, scene = study.scenes[0]
    long = replace(scene, time=1e3)
    ways = {
        "solvers": ("rk45",),
        "backends": ("python", "numba"),
        "tolerances": (1e-8, 1e-10),
        "max_seconds": 0.02,
    }
    with Store(tmp_path / "store.sqlite") as store:
        found = Runner(store, quiet=True).run(
            replace(study, scenes=((name, long),), choices={}, samples=3, **ways)
        )
    stopped = [
        (record["tolerance"], record["backend"], record["status"], record["inferred"])
        for record in found
    ]
    assert stopped == [
        *((1e-8, backend, "time_limit", False) for backend in ("python", "numba")),
        *((1e-10, backend, "time_limit", True) for backend in ("python", "numba")),
    ]


def test_a_kill_from_outside_is_no_fact_about_a_library(
    study: Study, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    # Once is enough here: each costs a process.
    monkeypatch.setattr("polhode.harness.common.worker.ATTEMPTS", 1)
    some = replace(
        study,
        solvers=("planted:Victim", "planted:Doomed", "planted:FirstOrder"),
        tolerances=(1e-1,),
    )
    with Store(tmp_path / "store.sqlite") as store:
        with pytest.raises(KilledFromOutsideError, match="2 of 3 cases were killed from outside"):
            Runner(store, quiet=True).run(some)
        assert [record["solver"] for record in store] == ["planted:FirstOrder"]


# What a repeated run must give again; times differ.
LASTING = (
    "status",
    "slow_error",
    "orientation_error",
    "errors",
    "work",
    "slow_uncertainty",
    "reached",
    "inferred",
)


def stored(path: Path) -> dict[str, Record]:
    with Store(path) as store:
        records = list(store)
    assert len(records) == len({record["key"] for record in records})
    return {record["key"]: record for record in records}


def finished(path: Path) -> int:
    """Number of cases in a store that somebody else is writing."""
    if not path.exists():
        return 0
    connection = sqlite3.connect(f"file:{path}?mode=ro", uri=True, timeout=10)
    try:
        return connection.execute("SELECT count(*) FROM cases").fetchone()[0]
    except sqlite3.OperationalError:
        return 0
    finally:
        connection.close()


@pytest.fixture
def study_file(tmp_path: Path) -> Path:
    path = tmp_path / "study.toml"
    path.write_text(STUDY.replace("[50.0, 100.0]", "50.0"), encoding="utf-8")
    return path


def interrupted(folder: Path, environment: dict[str, str], number: int) -> tuple[int, str]:
    """Start a study and send it a signal once its first cases are in the store."""
    words = [SCRIPT, "bench", "study.toml", "--out", "broken"]
    with subprocess.Popen(
        words, cwd=folder, env=environment, stderr=subprocess.PIPE, text=True
    ) as process:
        while process.poll() is None and not finished(folder / "broken" / "store.sqlite"):
            time.sleep(0.005)
        process.send_signal(number)
        _, text = process.communicate(timeout=60)
    return process.returncode, text


def test_killed_and_resumed_gives_the_same_records(
    here: Run, environment, study_file: Path, tmp_path: Path
):
    whole = read_study(study_file)
    with Store(tmp_path / "whole.sqlite") as store:
        Runner(store, quiet=True).run(whole)
    complete = stored(tmp_path / "whole.sqlite")
    cases = [case for batch in whole.batches() for case in batch]
    assert set(complete) == {case.key for case in cases}

    code, _ = interrupted(tmp_path, environment, signal.SIGKILL)
    assert code == -signal.SIGKILL
    early = stored(tmp_path / "broken" / "store.sqlite")
    assert 0 < len(early) < len(complete)
    assert not (tmp_path / "broken" / "README.md").exists()

    resumed = here("bench", "study.toml", "--out", "broken", "--resume", "--quiet")
    assert (resumed.returncode, resumed.stderr, resumed.stdout) == (0, "", "broken/README.md\n")
    late = stored(tmp_path / "broken" / "store.sqlite")
    assert {key: late[key] for key in early} == early, "finished cases are not run again"
    assert set(late) == set(complete)
    for key, record in complete.items():
        assert {name: late[key][name] for name in LASTING} == {
            name: record[name] for name in LASTING
        }
    names = sorted(
        path.name for path in (tmp_path / "broken").iterdir() if not path.name.startswith("store")
    )
    assert {"README.md", "SHA256SUMS", "orientation.png", "records.jsonl.gz", "slow.png"} <= set(
        names
    )
    assert not any("partial" in name for name in names)
    page = tmp_path / "broken" / "README.md"
    before = page.read_text(encoding="utf-8")
    page.unlink()
    again = here("bench", "study.toml", "--out", "broken", "--page-only")
    assert (again.returncode, page.read_text(encoding="utf-8")) == (0, before)
    assert here("bench", "study.toml", "--out", "none", "--page-only").returncode == 2
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "records.jsonl").write_text('{"answer": 42}\n', encoding="utf-8")
    refused = here("bench", "study.toml", "--out", "other", "--page-only")
    assert (refused.returncode, refused.stdout) == (2, "")
    assert refused.stderr.startswith(
        "polhode: other/records.jsonl: got a record without 'scene_name', expected"
    )


# An export that takes ten seconds, whatever the machine.
SLOW_EXPORT = """
import time
from polhode.harness import cli
from polhode.harness.common import store

def records(self):
    for number in range(1000):
        yield {"key": str(number), "note": "x" * 100}
        time.sleep(0.01)

store.Store.__iter__ = records
cli.main(["export", "store.sqlite", "out.jsonl"])
"""


def test_a_terminated_export_leaves_the_rows_written_as_partial(tmp_path: Path):
    with Store(tmp_path / "store.sqlite") as store:
        store.put("a", {}, {})
    words = [sys.executable, "-P", "-c", SLOW_EXPORT]
    with subprocess.Popen(words, cwd=tmp_path, stderr=subprocess.PIPE, text=True) as process:
        while process.poll() is None and not list(tmp_path.glob(".out.jsonl.*.partial")):
            time.sleep(0.005)
        time.sleep(0.3)
        process.send_signal(signal.SIGTERM)
        _, text = process.communicate(timeout=60)
    assert process.returncode == 1
    assert text == "polhode: interrupted\n"
    assert not (tmp_path / "out.jsonl").exists()
    rows = list(read_export(tmp_path / "out.jsonl.partial"))
    assert [row["key"] for row in rows] == [str(number) for number in range(len(rows))]
    assert 1 < len(rows) < 1000


def test_ctrl_c_says_how_to_go_on(environment, study_file: Path, tmp_path: Path):
    code, text = interrupted(tmp_path, environment, signal.SIGINT)
    assert code == 1
    last = text.splitlines()[-1].split("\r")[-1]
    assert last.endswith(
        "polhode: interrupted: finished cases are in broken/store.sqlite, --resume goes on"
    )
    assert "Traceback" not in text
    assert stored(tmp_path / "broken" / "store.sqlite")


def test_starting_afresh_keeps_the_last_store(here: Run, study_file: Path, tmp_path: Path):
    with Store(tmp_path / "broken" / "store.sqlite") as store:
        store.put("a", {}, {})
    early = stored(tmp_path / "broken" / "store.sqlite")
    small = study_file.read_text(encoding="utf-8").replace("[1e-4, 1e-6, 1e-8]", "[1e-4]")
    study_file.write_text(small, encoding="utf-8")
    assert here("bench", study_file.name, "--out", "broken", "--quick").returncode == 0
    assert stored(tmp_path / "broken" / "previous.sqlite") == early
    assert len(stored(tmp_path / "broken" / "store.sqlite")) == 2

    for ending in ("csv", "jsonl", "jsonl.gz"):
        done = here("export", "broken/store.sqlite", f"out.{ending}")
        assert (done.returncode, done.stderr) == (0, "")
        if ending == "csv":
            assert len((tmp_path / "out.csv").read_text(encoding="utf-8").splitlines()) == 3
        else:
            assert len([*read_export(tmp_path / f"out.{ending}")]) == 2
    refused = here("export", "broken/store.sqlite", "out.xlsx")
    assert refused.returncode == 2
    assert (
        refused.stderr
        == "polhode: out.xlsx: expected a file name ending in .csv, .jsonl or .jsonl.gz\n"
    )

    (tmp_path / "broken" / "store.sqlite").write_bytes(b"damaged" * 1000)
    refused = here("bench", study_file.name, "--out", "broken", "--resume")
    assert refused.returncode == 2
    assert refused.stderr.startswith("polhode: broken/store.sqlite: not a readable store")
    assert refused.stderr.count("\n") == 1
    assert (tmp_path / "broken" / "store.sqlite").read_bytes() == b"damaged" * 1000
