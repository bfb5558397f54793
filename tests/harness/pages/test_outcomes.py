"""What became of runs on hard cases, and the page about it."""

import re
import tomllib
from pathlib import Path

import pandas as pd
import pytest
from commandline import STUDY

from polhode.harness.common.store import read_export
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
    records = list(read_export(site_reports / "bench" / "records.jsonl.gz"))
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
    assert len([*read_export(tmp_path / "records.jsonl.gz")]) == len(records)


def endings(**outcomes: str) -> list[dict]:
    """A letter for each scene: reached, failed, unknown, or not taken."""
    kinds = {"r": "reached", "f": "failed", "u": "unknown"}
    run = {"St": 1.0, "form": "quaternion", "tolerance": 1e-6}
    return [
        {**run, "scene": f"s{i}", "solver": name, "outcome": kinds[kind]}
        for name, letters in outcomes.items()
        for i, kind in enumerate(letters)
        if kind in kinds
    ]


def test_a_solver_without_a_miss_is_named():
    (sure, _) = sentences(endings(one="r" * 9 + "-", two="f" + "r" * 9), "1 s")
    assert sure == "one got through all 9 runs."
    (sure, _) = sentences(endings(one="rrr", two="rrr", few="r--"), "1 s")
    assert (
        sure
        == "one, two got through all 3 runs each. Among solvers that take few cases, few got through all 1 of theirs."
    )


def test_no_solver_is_named_as_sure_that_missed_a_run_nobody_got_through():
    (sure, _) = sentences(endings(one="rrfuf", two="ffrff", few="r---"), "1 s")
    assert sure.startswith("No solver: none of the 2 that take most of the cases got through all")
    assert (
        "one comes nearest, with 2 of 5: 1 with an error that no reference knows, 2 failed." in sure
    )
    assert "Another solver got through 1 of the 3 cases that it missed." in sure
    assert sure.endswith("Among solvers that take few cases, few got through all 1 of theirs.")
    (sure, _) = sentences(endings(one="rrf", two="rff"), "1 s")
    assert sure.endswith("No other solver got through the cases that it missed.")


def test_solvers_that_got_through_as_many_runs_are_all_named():
    (sure, _) = sentences(endings(one="rrff", two="frrf", three="ffff", few="---r"), "1 s")
    assert "one, two come nearest, with 2 of 4 each. " in sure
    assert "Another solver got through 1 of the 1 cases that they all missed." in sure
