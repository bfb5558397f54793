"""The study of the form `hybrid`: its starts, its rows in their files, what its page says."""

from dataclasses import replace
from itertools import islice
from math import isnan, nan
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from polhode.harness.averaging import hybrid
from polhode.harness.averaging.data import read_study, write_study
from polhode.harness.averaging.hybrid import (
    REQUESTED_ERRORS,
    SLOW_TIMES,
    STOKES,
    HybridError,
    Speed,
    Study,
    measure_errors,
    measure_speed,
    random_scenes,
)
from polhode.harness.common.files import write_file
from polhode.harness.common.machine import here
from polhode.harness.pages.averaging.hybrid import findings, page
from polhode.models.problem import Problem
from polhode.models.scene import Scene
from polhode.solvers.solve import Solution

ROW = HybridError(
    0, "triaxial", "1:0.8:0.5", 1e6, 0.5, 1e-6, "reached_end", 5e-7, 1e-3, 2e-6, 1e-12, 0.05, 5, 1.0
)
BAD = replace(ROW, start=1, slow=2e-6, estimated=1e-6, mirror=0.0)
# Of tables and of the solver that knows St, steps, and spreads of the four times.
TIMES = (0.25, 0.004, 0.02, 2e4, 1e5, 0.001, 0.002, 0.01, 0.004)
SPEEDS = [
    Speed(i, "triaxial", 1e6, 5e-7, 0.05, 0.01, 0.008, "taylor", 1e-9, 0.1 * (i + 1), *TIMES)
    for i in range(9)
]


def test_starts_are_spread_over_shapes_stokes_numbers_and_times():
    scenes = list(random_scenes(80))
    assert sum(scene.ellipsoid.kind == "triaxial" for scene in scenes) == 40
    assert {scene.stokes for scene in scenes} == set(STOKES)
    assert {round(scene.slow_time, 9) for scene in scenes} == set(SLOW_TIMES)
    assert scenes[:5] == list(random_scenes(5))
    axes = np.array([scene.ellipsoid.semi_axes for scene in scenes])
    assert 0.15 <= axes.min() < 0.2
    assert 0.9 < axes.max() <= 1


def test_rows_come_back_from_their_files(tmp_path: Path):
    study = Study([ROW, BAD], SPEEDS, {"errors": here(), "speed": here()})
    write_study(study, tmp_path)
    assert read_study(Study, tmp_path) == study
    said = page(study, "polhode")
    assert "unknown date" not in said
    assert "(the turns' shortest times vary by 15 % in the median)" in said


def test_a_table_without_the_spread_of_repeats_is_read_and_says_so(tmp_path: Path):
    write_study(Study([ROW], SPEEDS, {}), tmp_path)
    path = tmp_path / "speed.csv"
    lines = path.read_text(encoding="utf-8").splitlines()
    short = "\n".join(line.rsplit(",", 4)[0] for line in lines)
    write_file(path, f"{short}\n", summed=True)
    former = read_study(Study, tmp_path)
    assert [row.full_steps for row in former.speed] == [1e5] * len(SPEEDS)
    assert all(isnan(row.seconds_spread) for row in former.speed)
    assert "3 turns (the spread of repeats was not kept)" in page(former, "polhode")


def test_a_page_says_when_each_part_was_measured():
    said = [
        page(Study([ROW], SPEEDS, timed), "polhode")
        for timed in ({}, {"speed": here(date="2026-01-02")})
    ]
    assert (
        "Measured on an unknown date by polhode of an unknown version, commit not kept" in said[0]
    )
    assert "Measured on 2026-01-02, and on unknown dates by " in said[1]


def test_findings_count_what_was_kept():
    silent = replace(ROW, start=2, estimated=nan)
    said = "\n".join(findings(Study([ROW, BAD, silent], SPEEDS)))
    assert "within the requested one in 66.7 % of the runs" in said
    assert (
        "2 of 3 runs state an error of their own: it bounds the one measured in 50 %, in all runs of "
        "1 of 2 starts, 50 % (9.45 to 90.5 % at 95 %), and" in said
    )
    assert (
        "the right way up in 66.7 % of 3 runs, in all runs of 2 of 3 starts, 66.7 % (20.8" in said
    )
    far = replace(BAD, stokes=1e7)
    assert (
        "least often at St = 1e7, in 0 % of 1 runs, all runs of 0 of 1 starts, 0 % (0 to 79.3 % at 95 %); the"
        in findings(Study([ROW, far, silent], []))[1]
    )
    assert (
        "beside the faster one of cyrk-vern8 and taylor it was 50 times as fast in the median of 9 "
        "triaxial bodies, at least 10 times in each." in said
    )
    assert (
        "There it was 2 times as fast as `splitting`, which knows St, in the median of 9 spheroids"
        in said
    )
    assert (
        "Of 9 runs with segments of the full equations, beside full solutions by cyrk-vern8 too, these segments took 5 "
        "times fewer steps than the full" in said
    )
    assert (
        "took 250 ms in the median, 250 at most, when not seen before; read from disk 4 ms in the"
        in said
    )
    slower = [replace(row, stokes=1e8, seconds=0.02 + 0.01 * row.start) for row in SPEEDS[:2]]
    said = "\n".join(findings(Study([ROW], [*SPEEDS, *slower])))
    assert (
        "Of 2 triaxial starts, runs at St = 1e8 take 2 to 3 times as long as at St = 1e6." in said
    )
    text = page(Study([ROW, BAD], SPEEDS), "polhode accuracy --order hybrid")
    assert "## Speed" in text
    assert "right way up" not in page(Study([replace(ROW, mirror=nan)], []), "polhode")


@pytest.fixture(scope="module")
def short_scene() -> Scene:
    return next(islice(random_scenes(), 1, None))


def test_a_run_is_measured_against_the_reference(
    short_scene: Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setenv("POLHODE_CACHE", str(tmp_path))
    rows = measure_errors([replace(short_scene, time=100.0)], quiet=True)
    assert [row.error for row in rows] == list(REQUESTED_ERRORS)
    for row in rows:
        assert row.uncertainty < 1e-12
        assert row.slow <= row.error
    # The second time the reference is read.
    assert len(list(tmp_path.glob("references/*"))) == 1


def test_runs_compared_in_speed_take_turns(
    short_scene: Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    called, solve = [], hybrid.solve

    def watched(problem: Problem, solver: str, *rest: Any) -> Solution:
        called.append((problem.name, solver))
        return solve(problem, solver, *rest)

    monkeypatch.setenv("POLHODE_CACHE", str(tmp_path))
    own = {
        "solve": watched,
        "random_scenes": lambda *_: [short_scene],
        "FAST": {100.0: 1},
        "FAST_SLOW_TIME": 0.2,
    }
    for name, value in own.items():
        monkeypatch.setattr(hybrid, name, value)
    (row,) = measure_speed(quiet=True)
    assert row.slow <= hybrid.FAST_ERROR
    assert (row.solver in hybrid.FULL_SOLVERS, row.tolerance in hybrid.FULL_TOLERANCES) == (
        True,
        True,
    )
    assert row.solver != hybrid.SEGMENT_SOLVER or row.full_steps > 0
    assert min(row.seconds, row.few_seconds, row.full_seconds, row.knowing_seconds) > 0
    runs = [("hybrid", hybrid.SEGMENT_SOLVER)] * 2 + [
        ("spheroid-axis", solver) for solver in (*hybrid.FULL_SOLVERS, hybrid.KNOWING)
    ]
    turn = [run for run in runs for _ in range(hybrid.SPEED_REPEATS)]
    assert called[-len(turn) * hybrid.SPEED_REPEATS :] == turn * hybrid.SPEED_REPEATS


def test_tables_of_former_column_names_are_read(tmp_path: Path):
    study = Study([ROW, BAD], SPEEDS, {"errors": here(), "speed": here()})
    write_study(study, tmp_path)
    for name, present, former in (
        ("errors", "segments", "pieces"),
        ("speed", "segment_steps", "window_steps"),
    ):
        path = tmp_path / f"{name}.csv"
        text = path.read_text(encoding="utf-8")
        assert text.count(present) == 1
        write_file(path, text.replace(present, former), summed=True)
    assert read_study(Study, tmp_path) == study
