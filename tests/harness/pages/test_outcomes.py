"""What became of runs on hard cases, and the page about it."""

import json
import re
import tomllib
from pathlib import Path

import pandas as pd
import pytest
from commandline import STUDY

from polhode.harness.pages.outcomes import INACCURATE, limits, outcome, sentences, write_page
from polhode.harness.studies.study import parse_study
from polhode.models.files.scene_file import scene_table
from polhode.models.scenes import named_scene

RUN = {
    "status": "reached_end",
    "seconds": 0.1,
    "solver_slow_error": 1e-9,
    "model_slow_error": 0.0,
    "message": "",
}


@pytest.mark.parametrize(
    ("change", "kind", "words"),
    [
        ({}, "reached", "solver error 1.0e-9"),
        ({"model_slow_error": 0.5}, "reached", "the form itself is off by 5.0e-1"),
        ({"solver_slow_error": 0.1}, "inaccurate", "solver error 1.0e-1"),
        (
            {"solver_slow_error": None, "reference_failed": "no agreement"},
            "unknown",
            "no agreement",
        ),
        ({"status": "time_limit"}, "stopped", "time limit"),
        ({"status": "non_finite", "message": "at t = 3"}, "failed", "non finite: at t = 3"),
        ({"status": "something_new"}, "failed", "something new"),
    ],
)
def test_outcomes_of_hard_cases(change: dict, kind: str, words: str):
    found = outcome({**RUN, **change})
    assert found[0] == kind
    assert words in found[1]


def test_errors_of_a_fast_body_are_measured_against_it():
    """Ω = 1e3 makes L² and E large: the limit grows with the larger of them."""
    records = [
        {"scene_name": name, "scene": scene_table(named_scene(name))}
        for name in ("fast-spin", "rest-50")
    ]
    allowed = limits(records)
    scene = named_scene("fast-spin")
    assert allowed["rest-50"] == INACCURATE
    assert allowed["fast-spin"] == pytest.approx(
        INACCURATE * float(scene.initial.energy[0]) / max(scene.ellipsoid.inertia)
    )
    run = {**RUN, "solver_slow_error": 10.0}
    assert outcome(run, allowed["fast-spin"])[0] == "reached"
    assert outcome(run, allowed["rest-50"])[0] == "inaccurate"


def test_page_of_several_scenes_counts_every_run(tmp_path: Path, site_reports: Path):
    records = [
        json.loads(line)
        for line in (site_reports / "bench" / "records.jsonl").read_text().splitlines()
    ]
    study = parse_study(tomllib.loads(STUDY))
    page = write_page(study, records, tmp_path, "polhode bench several.toml").read_text(
        encoding="utf-8"
    )
    found = pd.read_csv(tmp_path / "outcomes.csv")
    assert len(found) == len(records)
    assert found.loc[found["outcome"] == "stopped", "reason"].tolist() == [
        "time limit: stopped by hand"
    ]
    for name, own in found.groupby("solver"):
        reached = (own["outcome"] == "reached").sum()
        assert re.search(rf"^\| {name} +\| +{len(own)} \|[^|]*\| +{reached} \|", page, re.MULTILINE)
    assert len((tmp_path / "records.jsonl").read_text().splitlines()) == len(records)


def test_who_failed_least_is_judged_by_the_runs_that_anybody_got_through():
    def endings(**outcomes: str) -> list[dict]:
        """A letter for each scene: reached, failed, or not taken."""
        kinds, run = (
            {"r": "reached", "f": "failed"},
            {"St": 1.0, "form": "quaternion", "tolerance": 1e-6},
        )
        return [
            {**run, "scene": f"s{i}", "solver": name, "outcome": kinds[kind]}
            for name, letters in outcomes.items()
            for i, kind in enumerate(letters)
            if kind in kinds
        ]

    sure = sentences(endings(one="rrff", two="rfrf", few="r---"), "1 s")[0]
    said = "of the 3 hard runs that at least one solver got through, one, two each take 3 and got through 2"
    assert f"{said} (missed in the scenes s1, s2)." in sure
    sure = sentences(endings(one="r" * 9 + "-", two="f" + "r" * 9), "1 s")[0]
    assert (
        sure
        == "Of the 10 hard runs that at least one solver got through, one takes 9 and got through all of them."
    )
    sure = sentences(endings(one="r" * 9 + "-f", two="f" + "r" * 9 + "r"), "1 s")[0]
    assert "one takes 10 and got through 9; two takes 11 and got through 10 (missed" in sure
