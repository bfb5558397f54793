"""The page of the main job, on records with known winners."""

from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any

import matplotlib as mpl
import pandas as pd
import pytest
from commandline import STUDY

from polhode.harness.analysis.frames import frame
from polhode.harness.pages import bench, outcomes, regimes
from polhode.harness.pages.bench import write_page
from polhode.harness.studies.study import Study, read_study

mpl.use("Agg")

# The reference knows the error of L and E to 1e-9, the orientation to 1e-7: below 1e-8 and 1e-6 it cannot
# tell.
RUN: dict[str, Any] = {
    "scene_name": "paper",
    "scene": {
        "stokes": 50.0,
        "time": 25.0,
        "shape": {"semi_axes": [1.0, 0.8, 0.5]},
        "start": {"euler_angles": [1.0, 0.5, 0.0], "euler_rates": [1.0, 1.0, -1.0]},
    },
    "samples": 11,
    "form": "quaternion",
    "status": "reached_end",
    "message": "",
    "inferred": False,
    "seconds_spread": 1e-5,
    "prepare_seconds": 0.001,
    "model_slow_error": 0.0,
    "model_orientation_error": 0.0,
    "slow_uncertainty": 1e-9,
    "orientation_uncertainty": 1e-7,
    "work": {"rhs_calls": 10, "steps": 5},
    "machine": {"processor": "one", "cores": 1, "system": "Linux", "python": "3.11"},
    "versions": {"polhode": "0"},
}


def run(solver: str, tolerance: float, seconds: float, error: float) -> dict[str, Any]:
    own = {"solver": solver, "tolerance": tolerance, "seconds": seconds, "slow_error": error}
    return {**RUN, **own, "solver_slow_error": error, "orientation_error": 10 * error}


RECORDS = [
    run("taylor", 1e-4, 0.5, 3e-5),
    run("taylor", 1e-8, 1.0, 4e-9),
    run("cyrk-dop853", 1e-4, 0.1, 2e-4),
    run("cyrk-dop853", 1e-8, 2.0, 5e-8),
]


GIVEN_BY_SUCCESS = (
    "seconds",
    "seconds_spread",
    "slow_error",
    "orientation_error",
    "solver_slow_error",
)
GIVEN_BY_SUCCESS += (
    "slow_uncertainty",
    "orientation_uncertainty",
    "model_slow_error",
    "model_orientation_error",
)


@pytest.mark.parametrize("page", [bench, regimes, outcomes])
def test_a_study_of_which_no_run_succeeds_has_its_page(
    page: ModuleType, study: Study, tmp_path: Path
):
    failed = [
        {name: value for name, value in row.items() if name not in GIVEN_BY_SUCCESS}
        for row in RECORDS
    ]
    text = page.write_page(
        study, [{**row, "status": "time_limit"} for row in failed], tmp_path, "polhode bench"
    )
    assert "paper" in text.read_text(encoding="utf-8")
    if page is bench:
        assert "- No run gave a result" in text.read_text(encoding="utf-8")
        assert (tmp_path / "runs.csv").read_text(encoding="utf-8").count("time_limit") == len(
            RECORDS
        )


@pytest.fixture
def study(tmp_path: Path) -> Study:
    path = tmp_path / "study.toml"
    path.write_text(STUDY.replace("[50.0, 100.0]", "50.0"), encoding="utf-8")
    return read_study(path)


@pytest.fixture
def no_figures(monkeypatch):
    for name, nothing in (("work_precision_panels", None), ("save", None), ("profile_lines", [])):
        monkeypatch.setattr(bench, name, lambda *_, nothing=nothing, **__: nothing)


def table_below(page: str, heading: str) -> list[list[str]]:
    """Cells of the first table below a line that contains the heading."""
    lines = page[page.index(heading) :].splitlines()
    first = next(i for i, line in enumerate(lines) if line.startswith("|"))
    rows = []
    for line in lines[first:]:
        if not line.startswith("|"):
            break
        rows.append([cell.strip() for cell in line.strip("|").split("|")])
    return [rows[0], *rows[2:]]


@pytest.mark.usefixtures("no_figures")
def test_every_run_is_a_line_of_the_table(study: Study, tmp_path: Path):
    write_page(study, RECORDS, tmp_path, "polhode bench")
    runs = pd.read_csv(tmp_path / "runs.csv")
    assert runs["slow_error"].tolist() == [record["slow_error"] for record in RECORDS]
    assert runs["seconds"].tolist() == [record["seconds"] for record in RECORDS]


@pytest.mark.usefixtures("no_figures")
def test_nobody_wins_an_error_that_the_reference_cannot_tell(study: Study, tmp_path: Path):
    near = {"radau": 0.101, "cyrk-lsoda": 0.102, "taylor": 0.103}
    averaged = [
        {**run(name, 1e-4, seconds, 2e-4), "form": "averaged"} for name, seconds in near.items()
    ]
    records = [*RECORDS, *averaged]
    page = write_page(study, records, tmp_path, "polhode bench").read_text(encoding="utf-8")
    slow = dict(table_below(page, "By error of L and E"))
    tied = "averaged by radau, averaged by cyrk-lsoda and 1 more"
    assert slow["0.001"] == f"quaternion, cyrk-dop853, 1e-4: 100 ms = {tied}"
    assert slow["1e-6"].startswith("quaternion, taylor, 1e-8: 1.0 s")
    assert slow["1e-8"] == slow["1e-10"] == "unknown"
    orientation = dict(table_below(page, "By orientation error"))
    assert orientation["1e-6"] == "unknown"
    assert orientation["1e-4"].startswith("quaternion, taylor, 1e-8")


def test_several_scenes_have_figures_tables_and_verdicts_of_their_own(study: Study, tmp_path: Path):
    other = [
        {**record, "scene_name": "round", "seconds": 10 * record["seconds"]} for record in RECORDS
    ]
    page = write_page(study, [*RECORDS, *other], tmp_path, "polhode bench").read_text(
        encoding="utf-8"
    )
    names = {
        "slow.png",
        "orientation.png",
        "slow-round.png",
        "orientation-round.png",
        "profiles.png",
    }
    assert {path.name for path in tmp_path.glob("*.png")} == names
    assert all(f"]({name})" in page for name in names)
    assert dict(table_below(page, "## The cheapest: paper"))["0.001"].endswith("100 ms")
    assert dict(table_below(page, "## The cheapest: round"))["0.001"].endswith("1.0 s")
    assert table_below(page, "Uncertainty of the references") == [
        ["scene", "St", "slow", "orientation, rad"],
        ["paper", "50", "1.0e-9", "1.0e-7"],
        ["round", "50", "1.0e-9", "1.0e-7"],
    ]


@pytest.mark.usefixtures("no_figures")
def test_the_page_tells_what_was_run(study: Study, tmp_path: Path):
    scene = {**RUN["scene"], "stokes": 200.0, "time": 100.0}
    at_rest = {"quaternion": [1.0, 0.0, 0.0, 0.0], "angular_velocity": [0.0, 0.0, 0.25]}
    other = {"scene_name": "round", "scene": {**scene, "start": at_rest}, "form": "euler-angles"}
    longer = {
        "scene_name": "round",
        "scene": {**scene, "start": at_rest, "time": 7.0},
        "samples": 21,
    }
    records = [
        *RECORDS,
        {**RECORDS[0], "scene": scene, "form": "averaged"},
        *({**RECORDS[0], **x} for x in (other, longer)),
    ]
    page = write_page(study, records, tmp_path, "polhode bench").read_text(encoding="utf-8")
    assert table_below(page, "## The scenes")[1:] == [
        ["paper", "1 : 0.8 : 0.5", "50, 200", "25, 100", "11", "quaternion, averaged"],
        ["round", "1 : 0.8 : 0.5", "200", "100, 7", "11, 21", "euler-angles, quaternion"],
    ]


@pytest.mark.usefixtures("no_figures")
def test_a_study_without_averaged_forms_has_no_verdict_on_them(study: Study, tmp_path: Path):
    page = write_page(study, RECORDS, tmp_path, "polhode bench").read_text(encoding="utf-8")
    assert "averaged form is the cheapest" not in page
    averaged = {**RECORDS[0], "form": "averaged", "seconds": 0.15, "seconds_spread": 0.0}
    page = write_page(study, [*RECORDS, averaged], tmp_path, "polhode bench").read_text(
        encoding="utf-8"
    )
    assert (
        "- For an error of L and E of 1e-4 an averaged form is the cheapest at St = 50, the only one measured."
        in page
    )


def test_every_method_of_a_scene_stands_on_the_page_with_its_distance_from_the_best(tmp_path: Path):
    records = [*RECORDS, run("bdf", 1e-4, 0.7, 3.0)]
    rows = {name: rest for name, *rest in bench.distances(frame(records))}
    # At errors of 0.01 and 0.001 taylor's 0.5 s are 5 times dop853's 0.1 s, which errs by 2e-4; at 1e-7
    # its 1.0 s, interpolated, are the fastest. bdf errs by 3.
    assert rows["cyrk-dop853"] == ["6 of 6", "4", "1", "1", "2"]
    reached, won, least, median, largest = rows["taylor"]
    assert (reached, won, least, largest) == ("6 of 6", "2", "1", "5")
    assert 1 < float(median) < 5
    assert rows["bdf"] == ["0 of 6", "0", "–", "–", "–"]
    assert list(rows) == ["cyrk-dop853", "taylor", "bdf"]
    study = replace(read_study(None, "bench"), title="A title")
    page = write_page(study, records, tmp_path, "polhode bench").read_text(encoding="utf-8")
    table = page.partition("## Every solver: how far from the best")[2].partition("\n## ")[0]
    assert "bdf" in table
    assert "0 of 6" in table
