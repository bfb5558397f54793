"""The time to an answer over plain practice, on an idle machine and beside other processes."""

import os
import subprocess

import pytest

from polhode.harness.answers import timed
from polhode.harness.answers.timed import Timing, busy, strata
from polhode.harness.cli import main


def timing(plain: float, seconds: float) -> Timing:
    return Timing("1-0", "triaxial", 1.0, 1e-6, "slow", "", seconds, plain, 0.0, 1e-7, plain)


def test_scenes_lie_in_the_stratum_of_plain_practice():
    rows = strata([timing(0.002, 0.003), timing(0.004, 0.004), timing(0.5, 0.1)])
    assert [(row.name, row.scenes) for row in rows] == [("below 10 ms", 2), ("above 0.1 s", 1)]
    assert rows[0].median == pytest.approx(1.25)
    assert rows[0].total == pytest.approx(7 / 6)
    assert rows[1].quicker == 1.0


def test_a_scene_beside_other_processes_lies_where_it_would_without():
    slowed = timing(0.5, 0.6)._replace(undisturbed=0.002)
    assert [row.name for row in strata([slowed], load=8)] == ["below 10 ms"]


def test_targets_are_twice_as_large_beside_other_processes():
    (idle,), (loaded,) = strata([timing(0.002, 0.003)]), strata([timing(0.002, 0.003)], load=8)
    assert loaded.targets == (2 * idle.targets[0], 2 * idle.targets[1])


def test_other_processes_are_at_work_and_end(monkeypatch):
    started = []

    def start(command):
        started.append(popen(command))
        return started[-1]

    popen = subprocess.Popen
    monkeypatch.setattr(timed.subprocess, "Popen", start)
    with busy(2):
        assert len(started) == 2
        assert all(other.poll() is None for other in started)
    assert all(other.poll() is not None for other in started)


def test_the_page_says_what_else_ran(tmp_path, capsys):
    with pytest.raises(SystemExit) as ended:
        main(["validate", "--time", "2", "--load", "1", "--seed", "3", "--out", str(tmp_path)])
    assert ended.value.code == 0
    assert "beside 1 other process" in capsys.readouterr().out
    assert sorted(os.listdir(tmp_path)) == ["SHA256SUMS", "time-load1.md", "times-load1.csv"]
