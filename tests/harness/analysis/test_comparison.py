"""Saved runs as tables, and two of them compared: slower or less accurate is a failure."""

import copy
import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from commandline import Run

from polhode.harness.analysis.comparison import benchmark_records, compare, read_runs
from polhode.harness.analysis.frames import frame
from polhode.harness.cli import main
from polhode.harness.common.store import Store, export

ROOT = Path(__file__).parents[3]


def record(solver: str = "taylor", **more: Any) -> dict[str, Any]:
    return {
        "key": f"key of {solver}",
        "scene_name": "paper",
        "scene": {"stokes": 100.0, "time": 50.0},
        "form": "quaternion",
        "solver": solver,
        "tolerance": 1e-6,
        "samples": 201,
        "max_seconds": 0.3,
        "backend": None,
        "jacobian": None,
        "status": "reached_end",
        "counted_seconds": 0.012,
        "slow_error": 1e-7,
        "orientation_error": 1e-6,
        "slow_uncertainty": 1e-15,
        "orientation_uncertainty": 1e-15,
        "seconds": 0.01,
        "seconds_spread": 0.05,
        "seconds_runs": [0.01, 0.0101, 0.06],
        "sentinel_seconds": 1e-3,
        **more,
    }


def timed(seconds: float) -> dict[str, Any]:
    return {"seconds": seconds, "seconds_runs": [seconds, 1.01 * seconds, 6 * seconds]}


# What is changed in the second run, and what the comparison must say.
CHANGES = [
    ({}, []),
    (timed(0.0149), []),
    (timed(0.0151), ["seconds"]),
    (timed(0.001), []),
    ({**timed(0.02), "sentinel_seconds": 2e-3}, []),
    ({**timed(0.032), "sentinel_seconds": 2e-3}, ["seconds"]),
    ({"seconds": 0.016, "seconds_runs": [0.016, 0.03, 0.04]}, []),
    # As pages share their records.
    ({"seconds": 0.0151, "seconds_runs": None}, ["seconds"]),
    ({"slow_error": 2.9e-7}, []),
    ({"slow_error": 3.1e-7}, ["error of L and E"]),
    ({"slow_error": 1e-12}, []),
    ({"slow_error": 3.1e-7, "slow_uncertainty": 1e-7}, []),
    ({"orientation_error": 1e-3, **timed(1.0)}, ["seconds", "orientation error"]),
    ({"orientation_error": None}, []),
    ({"status": "non_finite", "seconds": None, "seconds_runs": None}, ["status"]),
    ({"status": "time_limit", "seconds": None, "seconds_runs": None}, ["status"]),
    ({"key": "of other versions"}, []),
]


@pytest.mark.parametrize(("change", "expected"), CHANGES)
def test_what_got_worse(change: dict[str, Any], expected: list[str]):
    before, after = frame([record(), record("dop853")]), frame([record(**change), record("dop853")])
    if "sentinel_seconds" in change:
        after["sentinel_seconds"] = change["sentinel_seconds"]
        after.loc[1, "seconds"] = before.loc[1, "seconds"] * change["sentinel_seconds"] / 1e-3
    found = compare(before, after, slower=1.5, less_accurate=3.0)
    assert (found.shared, found.only_before, found.only_after) == (2, 0, 0)
    assert list(found.regressions["what"]) == expected
    assert set(found.regressions["solver"]) <= {"taylor"}


def test_a_slow_moment_is_no_regression():
    """One case of five took twice as long while the machine did, too; another one did so by itself."""
    names = ("taylor", "dop853", "radau", "lsoda", "bdf")
    before = frame([record(name) for name in names])
    changes = {"taylor": {**timed(0.02), "sentinel_seconds": 2e-3}, "dop853": timed(0.02)}
    after = frame([record(name, **changes.get(name, {})) for name in names])
    found = compare(before, after, slower=1.5, less_accurate=3.0)
    assert found.drift == 1.0
    assert list(found.regressions["solver"]) == ["dop853"]


def test_the_sentinel_of_another_python_says_nothing():
    before = frame([record(machine={"cores": 2, "python": "3.13.1"})])
    after = frame(
        [record(machine={"cores": 2, "python": "3.14.0"}, sentinel_seconds=2e-3, **timed(0.02))]
    )
    found = compare(before, after, slower=1.5, less_accurate=3.0)
    assert (found.drift, found.same_machine) == (1.0, False)
    assert list(found.regressions["what"]) == ["seconds"]


def test_another_machine_is_held_to_its_median_pace():
    """Three times as slow, and two cases of seven by more or less than that."""
    names = ("taylor", "dop853", "radau", "lsoda", "bdf", "rk45", "ida")
    before = frame([record(name, machine={"cores": 2, "python": "3.13.1"}) for name in names])
    other = {"machine": {"cores": 64, "python": "3.13.1"}, "sentinel_seconds": 5e-4}
    paces = {"radau": 0.06, "bdf": 0.02}
    after = frame([record(name, **other, **timed(paces.get(name, 0.03))) for name in names])
    found = compare(before, after, slower=1.5, less_accurate=3.0)
    assert (found.drift, found.same_machine) == (pytest.approx(3.0), False)
    assert list(found.regressions["solver"]) == ["radau"]


def test_a_run_that_was_near_its_limit_may_pass_it():
    before = frame([record(counted_seconds=0.25)])
    after = frame([record(status="time_limit", seconds=None, seconds_runs=None)])
    assert compare(before, after, slower=1.5, less_accurate=3.0).regressions.empty


def test_roundoff_is_no_loss_of_accuracy():
    before, after = frame([record(slow_error=1e-16)]), frame([record(slow_error=9e-14)])
    assert compare(before, after, slower=1.5, less_accurate=3.0).regressions.empty


def test_cases_are_matched_by_what_they_are():
    other, renamed = (
        record("radau", scene={"stokes": 100.0, "time": 50.0, "shape": {"semi_axes": axes}})
        for axes in ([1, 1, 2], [1, 0.8, 0.5])
    )
    before = frame([record(), record("dop853"), record("radau"), other])
    after = frame(
        [
            record("radau"),
            record("lsoda"),
            record(tolerance=1e-8),
            record(scene={"stokes": 1e3, "time": 50.0}),
            renamed,
        ]
    )
    found = compare(before, after, slower=1.5, less_accurate=3.0)
    assert (found.shared, found.only_before, found.only_after) == (1, 3, 4)


def suite(*records: dict[str, Any]) -> dict[str, Any]:
    """JSON of the benchmark suite with the given results."""
    benchmarks = []
    for each in copy.deepcopy(records):
        names = (
            "scene_name",
            "scene",
            "form",
            "solver",
            "tolerance",
            "samples",
            "max_seconds",
            "backend",
            "jacobian",
        )
        case, runs = {name: each.pop(name) for name in names}, each.pop("seconds_runs")
        info = {
            "key": each.pop("key"),
            "case": case,
            "sentinel_seconds": each.pop("sentinel_seconds"),
            "result": each,
        }
        for name in ("seconds", "seconds_spread"):
            each.pop(name)
        # A failed run has timed nothing; its statistics mean nothing.
        stats = {"min": min(runs or [1e-7]), "max": max(runs or [1e-7])}
        benchmarks.append(
            {"stats": stats, "extra_info": info | ({"seconds_runs": runs} if runs else {})}
        )
    surroundings = {"machine": {"cores": 2}, "versions": {"numpy": "2"}}
    return {"machine_info": {"polhode": surroundings}, "benchmarks": benchmarks}


FAILED = record(
    "radau",
    status="time_limit",
    seconds=None,
    seconds_spread=None,
    seconds_runs=None,
    slow_error=None,
)


def test_the_suites_json_gives_the_stores_table(tmp_path: Path):
    records = [record(), FAILED]
    (tmp_path / "runs.json").write_text(json.dumps(suite(*records)), encoding="utf-8")
    with Store(tmp_path / "runs.sqlite") as store:
        for each in records:
            row = {**each, "machine": {"cores": 2}, "versions": {"numpy": "2"}}
            store.put(row.pop("key"), {}, row)
        export(list(store), tmp_path / "runs.jsonl")
    tables = [read_runs(tmp_path / f"runs.{ending}") for ending in ("json", "sqlite", "jsonl")]
    for table in tables:
        assert set(table.columns) == set(tables[0].columns)
        assert table["seconds"].isna().tolist() == [False, True]
        same = [
            "key",
            "solver",
            "status",
            "slow_error",
            "seconds",
            "seconds_spread",
            "stokes",
            "scene.time",
        ]
        pd.testing.assert_frame_equal(table[same], tables[0][same])


def test_failed_runs_of_today_stand_beside_the_others(tmp_path: Path):
    old = suite(record(), FAILED)
    timed_run, failed = old.pop("benchmarks")
    del failed["stats"]
    other = {"stats": {}, "extra_info": {"polhode": {"error": 1e-9}}}
    polhode = {**old["machine_info"]["polhode"], "failed": [failed]}
    new = {"machine_info": {}, "polhode": polhode, "benchmarks": [timed_run, other]}
    assert benchmark_records(new) == benchmark_records(suite(record(), FAILED))


def test_of_repeated_runs_the_shortest_counts(tmp_path: Path):
    for name, runs in (
        ("1", [FAILED, record(**timed(0.03))]),
        ("2", [record("radau"), record(**timed(0.02))]),
    ):
        (tmp_path / f"{name}.json").write_text(json.dumps(suite(*runs)), encoding="utf-8")
    before = frame([record(), record("radau")])
    [worse] = compare(
        before, read_runs(tmp_path), slower=1.5, less_accurate=3.0
    ).regressions.to_dict("records")
    assert (worse["solver"], worse["what"], worse["after"]) == ("taylor", "seconds", 0.02)


@pytest.mark.parametrize(
    ("name", "content", "reason"),
    [
        ("a.json", "{", "Expecting property name"),
        ("a.json", "[]", "expected JSON of the benchmark suite"),
        ("a.json", '{"machine_info": {}}', "no 'polhode' in it"),
        ("a.json", json.dumps(suite()), "got no records"),
        ("a.jsonl", "not json\n", "Expecting value"),
        ("a.jsonl", "", "got no records"),
        (
            "a.jsonl",
            '{"answer": 42}\n',
            "got a record without 'scene_name', expected those of `polhode bench`",
        ),
        ("a.json", b"\xff", "expected JSON of the benchmark suite"),
    ],
)
def test_files_that_hold_no_runs_are_refused(
    tmp_path: Path, name: str, content: str | bytes, reason: str
):
    path = tmp_path / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(ValueError, match=reason) as refusal:
        read_runs(path)
    assert str(refusal.value).startswith(str(path))


@pytest.fixture
def polhode(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Run:
    """`polhode ARGUMENTS` in this process."""
    monkeypatch.chdir(tmp_path)

    def run(*arguments: object) -> subprocess.CompletedProcess[str]:
        with pytest.raises(SystemExit) as end:
            main([*map(str, arguments)])
        code = end.value.code
        assert isinstance(code, int)
        return subprocess.CompletedProcess(arguments, code, *capsys.readouterr())

    return run


def test_the_command(polhode: Run, tmp_path: Path):
    for name, runs in {
        "before": [record(), FAILED],
        "same": [record(**timed(0.011)), FAILED],
        "slower": [record(**timed(0.03)), FAILED],
        "worse": [record(slow_error=1e-3), FAILED],
        "other": [record("lsoda")],
    }.items():
        (tmp_path / f"{name}.json").write_text(json.dumps(suite(*runs)), encoding="utf-8")

    done = polhode("compare", "before.json", "same.json")
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout == "2 cases compared, 0 gone, 0 new; the machine takes 1.00 times as long\n"

    done = polhode("compare", "before.json", "slower.json")
    assert (done.returncode, done.stderr) == (1, "polhode: regressions: 1 in 2 cases\n")
    assert done.stdout.splitlines()[-1].split() == [
        "paper",
        "100",
        "quaternion",
        "taylor",
        "1e-06",
        "seconds",
        "0.01",
        "0.03",
    ]
    assert polhode("compare", "before.json", "slower.json", "--slower", 4).returncode == 0

    done = polhode("compare", "before.json", "worse.json", "--json")
    assert done.returncode == 1
    found = json.loads(done.stdout)
    assert (found["shared"], found["only_before"], found["only_after"], found["drift"]) == (
        2,
        0,
        0,
        1.0,
    )
    (worse,) = found["regressions"]
    assert (worse["what"], worse["before"], worse["after"]) == ("error of L and E", 1e-7, 1e-3)
    assert polhode("compare", "before.json", "worse.json", "--less-accurate", 2e4).returncode == 0

    for arguments, reason in {
        (
            "before.json",
            "no-such.json",
        ): "no-such.json: No such file or directory, expected an existing one",
        (
            "before.json",
            "other.json",
        ): "other.json: got no case that before.json has, expected some",
        ("before.json", "same.json", "--slower", "1"): "'--slower': 1.0 is not in the range x>1.0",
        (
            "before.json",
        ): "Missing argument 'AFTER', expected: polhode compare [OPTIONS] BEFORE AFTER",
    }.items():
        refused = polhode("compare", *arguments)
        assert refused.returncode == 2
        assert refused.stderr.splitlines()[0].endswith(reason)
        assert refused.stderr.count("\n") == 1


def test_plain_runs_leave_the_suite_out():
    words = [
        sys.executable,
        "-m",
        "pytest",
        "tests/benchmarks",
        "--collect-only",
        "-q",
        "-p",
        "no:cacheprovider",
    ]
    done = subprocess.run(
        words, cwd=ROOT, env=os.environ, capture_output=True, text=True, check=False, timeout=120
    )
    assert done.returncode == pytest.ExitCode.NO_TESTS_COLLECTED, done.stdout
