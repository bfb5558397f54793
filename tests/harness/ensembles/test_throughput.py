"""What the bench of ensembles measures, on a small scale, and the page that it makes of it."""

import pytest

from polhode.harness.ensembles import throughput as ensemble_bench
from polhode.harness.ensembles.throughput import SETTINGS
from polhode.harness.pages.ensembles import page


@pytest.mark.parametrize("equations", ["full", "averaged"])
def test_ensembles_are_measured_by_what_is_kept_of_them(equations: str):
    row = ensemble_bench.ensemble_throughput("1 : 0.8 : 0.5", equations, particles=60)
    for kept in ("end_", "sampled_", ""):
        assert 0 < row[f"{kept}slower_per_second"] <= row[f"{kept}per_second"]
    assert 0 < row["median_error"] < 1e-4
    assert row["median_error"] < row["error_of_99_percent"] < 1e-2
    assert row["record_bytes"] > 5000


def test_equal_steps_are_held_against_taylor_at_the_same_largest_error(
    monkeypatch: pytest.MonkeyPatch,
):
    monkeypatch.setattr(SETTINGS, "rounds", 1)
    monkeypatch.setattr(SETTINGS, "stokes", 20.0)
    # Fewer lanes at once are compiled in a fraction of the time.
    monkeypatch.setattr("polhode.solvers.ensembles.taylor_batch.REGISTERS", 1)
    row = ensemble_bench.full_throughput(
        "1 : 1 : 2", ensemble_bench.SHAPES["1 : 1 : 2"], 1e-4, particles=200
    )
    assert 0 < row["median_error"] < row["error"] <= 1e-4
    assert 0 < row["taylor_error"] <= 1e-4
    assert row["speedup"] == pytest.approx(row["per_second"] / row["taylor_per_second"])
    assert 0 < row["slower_per_second"] <= row["per_second"]
    assert 0 < row["taylor_slower_per_second"] <= row["taylor_per_second"]
    assert row["steps"] % ensemble_bench.MIN_SEGMENTS == 0


def test_long_runs_are_held_against_full_equations(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(SETTINGS, "long_stokes", 5e3)
    averaged, hybrid = ensemble_bench.long_runs(particles=20, known=3)
    assert (averaged["equations"], hybrid["equations"]) == ("averaged", "hybrid")
    # Both are steps of the same equations; averaging errs by up to 133/St, hybrid by what was asked
    # for.
    assert 1e-5 < averaged["error"] < 133 / 5e3
    assert hybrid["error"] < SETTINGS.long_error
    assert hybrid["within"] == 1


def test_the_page_shows_what_was_measured():
    task = {
        "shape": "1 : 0.8 : 0.5",
        "end_per_second": 1e5,
        "sampled_per_second": 5e4,
        "median_error": 1e-7,
    }
    task |= {"error_of_99_percent": 2e-6, "record_bytes": 2**20}
    full = {
        "shape": "s",
        "target": 1e-4,
        "method": "m",
        "steps": 9,
        "per_second": 6e3,
        "taylor_per_second": 1e3,
    }
    full |= {
        "speedup": 6.0,
        "error": 1e-5,
        "median_error": 1e-7,
        "taylor_error": 1e-5,
        "plan_seconds": 0.1,
    }
    long = {
        "equations": "hybrid",
        "per_second": 3e4,
        "within": 0.9,
        "median_error": 1e-5,
        "error": 1e-3,
    }
    long |= {"plan_seconds": 2.5}
    found = {
        "settings": {
            "stokes": 1e3,
            "slow_time": 0.2,
            "tolerance": 1e-9,
            "rounds": 2,
            "task_seconds": 1.0,
            "long_stokes": 1e6,
            "long_error": 1e-4,
            "long_known": 7,
            "judge": "a solver",
            "known": 5,
        },
        "date": "2026-11-22T00:00:00Z",
        "machine": {"processor": "P", "cores": 2, "system": "S", "python": "3"},
        "versions": {"polhode": "0"},
        "full": [full],
        "long": [long],
        "tasks": [
            {**task, "shape": "1 : 1 : 2", "equations": "full", "per_second": 1e5},
            {**task, "equations": "full", "per_second": 1e4},
            {**task, "equations": "averaged", "per_second": 4e4},
        ],
        "overhead": [{"engine": "serial", "share": 0.01}],
        "memory": {"particles": 100, "bytes": 2**28, "seconds": 9.0},
        "two_processes": {"particles": 100, "ratio": 2.0, "one_seconds": 4.0, "two_seconds": 2.0},
    }
    cells = [
        [cell.strip() for cell in line.split("|")[1:-1]]
        for line in page(found).splitlines()
        if "|" in line
    ]
    assert [
        "1 : 0.8 : 0.5",
        "averaged",
        "100,000",
        "50,000",
        "40,000",
        "1.0e-7",
        "2.0e-6",
        "1,048,576",
    ] in cells
    # 10⁹ particles at 10⁵ a second; 10⁷ particles at a hundredth of 10⁴.
    assert ["1 : 1 : 2", "full", "1,000,000,000", "1000", "10,000", "10,000.0 MiB", "2.78"] in cells
    assert ["1 : 0.8 : 0.5", "full", "10,000,000", "1e5", "100", "100.0 MiB", "27.78"] in cells
    assert [
        "1 : 0.8 : 0.5",
        "averaged",
        "1,000,000,000",
        "1000",
        "10,000",
        "10,000.0 MiB",
        "6.94",
    ] in cells
    assert ["hybrid", "30,000", "90 %", "1.0e-5", "1.0e-3", "2.5"] in cells
    assert (
        "runs in turns, of 5 of long runs and whole ensembles, one process at a time; the spread"
        in page(found)
    )
    full |= {"slower_per_second": 5e3, "taylor_slower_per_second": 8e2}
    long["slower_per_second"] = 2e4
    # They take 20, 25 and 50 % longer.
    assert "three turns in four take at most 25 % longer, in the median." in page(found)
