"""Study files: what they expand to, and one clear line for what they cannot be."""

import copy
import tomllib
from dataclasses import replace
from math import inf
from pathlib import Path
from typing import Any

import pytest
from commandline import STUDY

from polhode.harness.studies.study import parse_study, read_study
from polhode.models.scenes import named_scene
from polhode.solvers.catalogue import SOLVERS

GOOD: dict[str, Any] = tomllib.loads(STUDY)
GONE = object()


def changed(path: str, value: Any) -> dict[str, Any]:
    """The good study with one entry set, or removed."""
    table = copy.deepcopy(GOOD)
    *above, last = path.split(".")
    inner = table
    for part in above:
        inner = inner[part] if isinstance(inner, dict) else inner[int(part)]
    if value is GONE:
        del inner[last]
    else:
        inner[last] = value
    return table


def test_scenes_forms_solvers_and_tolerances_are_crossed():
    batches = list(parse_study({**GOOD, "forms": ["quaternion", "averaged"]}).batches())
    assert len(batches) == 2 * 2 * 3
    cases = [case for batch in batches for case in batch]
    assert len({case.key for case in cases}) == len(cases) == 2 * 2 * 2 * 3
    assert all(len({(c.scene, c.form, c.tolerance) for c in batch}) == 1 for batch in batches)
    assert [batch[0].tolerance for batch in batches[:3]] == [1e-4, 1e-6, 1e-8]
    assert {case.scene.stokes for case in cases} == {50.0, 100.0}
    assert {case.scene.time for case in cases} == {1.0, 2.0}


def test_forms_and_solvers_that_do_not_fit_are_left_out():
    study = parse_study(
        {**GOOD, "forms": ["jeffery", "quaternion"], "solvers": ["exact", "taylor"]}
    )
    assert {(case.form, case.solver) for batch in study.batches() for case in batch} == {
        ("quaternion", "taylor")
    }


def test_one_stokes_number_needs_no_list():
    assert [scene.stokes for _, scene in parse_study(changed("scenes.0.stokes", 7)).scenes] == [7.0]


def test_whole_numbers_and_floats_are_the_same_study():
    whole = parse_study({**changed("scenes.0.stokes", [50, 100]), "max_seconds": 5})
    keys = [
        [case.key for batch in study.batches() for case in batch]
        for study in (whole, parse_study(GOOD))
    ]
    assert keys[0] == keys[1]


def test_a_quick_study_is_a_part():
    study = parse_study(GOOD)
    assert study.quick().tolerances == (1e-4, 1e-8)
    assert study.quick().max_seconds < study.max_seconds


def test_the_study_that_comes_with_the_package():
    study = read_study(None)
    assert study.name == "bench"
    assert study.solvers == tuple(SOLVERS)
    assert {scene.stokes for _, scene in study.scenes} == {1e2, 1e3, 1e4, 1e5}
    assert len(study.tolerances) >= 4


BAD = [
    ("name", GONE, "name: missing, expected a value"),
    (
        "name",
        "../elsewhere",
        "name: got '../elsewhere', expected a string that should match pattern",
    ),
    ("name", "", "name: got '', expected a string"),
    ("title", 3, "title: got 3, expected a string"),
    ("samples", 1, "samples: got 1, expected a number greater than or equal to 2"),
    ("samples", 10**9, "samples: got 1000000000, expected a number less than or equal to 100000"),
    ("samples", 11.5, "samples: got 11.5, expected a whole number"),
    ("max_seconds", 0, "max_seconds: got 0, expected a number greater than 0"),
    ("max_seconds", inf, "max_seconds: got inf, expected a finite number"),
    ("tolerances", [], "tolerances: got [], expected at least 1 item"),
    ("tolerances", 1e-6, "tolerances: got 1e-06, expected a list"),
    ("tolerances", [1e-6, 0.0], "tolerances[1]: got 0.0, expected a number greater than 0"),
    ("tolerances", [-1e-6], "tolerances[0]: got -1e-06, expected a number greater than 0"),
    ("tolerances", [float("nan")], "tolerances[0]: got nan, expected a finite number"),
    ("tolerances", [1e-6, 1e-3, 1e-6], "got 1e-06 2 times in tolerances, expected it once"),
    ("forms", [], "forms: got [], expected at least 1 item"),
    (
        "forms",
        ["quarternion"],
        "got 'quarternion' (did you mean 'quaternion'?) in forms, expected one of euler-angles",
    ),
    (
        "forms",
        ["jeffery"],
        "forms: got ['jeffery'], expected one that some scene and solver accept",
    ),
    ("solvers", [], "solvers: got [], expected at least 1 item"),
    ("solvers", ["rk4"], "got 'rk4' (did you mean 'rk45'?) in solvers, expected one of taylor"),
    ("solvers", ["taylor", "taylor"], "got 'taylor' 2 times in solvers, expected it once"),
    ("solver", ["taylor"], "solver: unknown key, expected one of name, title, samples"),
    ("scenes", [], "scenes: got [], expected at least 1 item"),
    ("scenes", [3], "scenes[0]: got 3, expected a table"),
    ("scenes.0.name", GONE, "scenes[0].name: missing, expected a value"),
    ("scenes.0.stokes", GONE, "scenes[0].stokes: missing, expected a value"),
    ("scenes.0.stokes", [], "scenes[0].stokes: got [], expected at least 1 item"),
    ("scenes.0.stokes", "high", "scenes[0].stokes[0]: got 'high', expected a number"),
    (
        "scenes.0.stokes",
        [1e2, -1.0],
        "scenes[0].stokes[1]: got -1.0, expected a number greater than or equal to 0",
    ),
    (
        "scenes.0.stokes",
        [1e2, float("nan")],
        "scenes[0].stokes[1]: got nan, expected a number greater than or equal",
    ),
    ("scenes.0.stokes", [1e2, 0.0], "scenes[0]: got slow_time at stokes = 0, expected time"),
    (
        "scenes.0.stokes",
        [1e2, 1e3, 1e2],
        "got ('paper', 100.0) 2 times in scenes, expected it once",
    ),
    (
        "scenes.0.colour",
        "red",
        "scenes[0]: colour: unknown key, expected one of stokes, slow_time, time, shape, start",
    ),
    (
        "scenes.0.shape.semi_axes",
        [1, 2],
        "scenes[0]: shape.semi_axes: got [1, 2], expected at least 3 items",
    ),
    ("scenes.0.tags", "fast", "scenes[0].tags: got 'fast', expected a list"),
]


@pytest.mark.parametrize(("path", "value", "line"), BAD, ids=[row[2][:60] for row in BAD])
def test_bad_studies_get_one_line(path: str, value: object, line: str):
    with pytest.raises(ValueError, match="expected") as refusal:
        parse_study(changed(path, value))
    assert line in str(refusal.value)
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize("content", [b"name = [", b"\xff\xfe\x00"], ids=["TOML", "bytes"])
def test_bad_files_are_named(tmp_path: Path, content: bytes):
    path = tmp_path / "study.toml"
    path.write_bytes(content)
    with pytest.raises(ValueError, match=r"study\.toml: expected a TOML file"):
        read_study(path)


def test_a_scene_may_limit_forms_and_solvers():
    forms = {"forms": ["quaternion", "euler-angles", "averaged"]}
    study = parse_study({**changed("scenes.0.forms", ["averaged"]), **forms})
    assert {case.form for batch in study.batches() for case in batch} == {"averaged"}
    study = parse_study({**changed("scenes.0.solvers", ["cyrk-vern8"]), **forms})
    assert {(case.form, case.solver) for batch in study.batches() for case in batch} == {
        (form, "cyrk-vern8") for form in forms["forms"]
    }


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        (
            "scenes.0.forms",
            ["averaged"],
            "got 'averaged' in forms of scene 'paper', expected some of the study's: quaternion",
        ),
        (
            "scenes.0.solvers",
            ["ida"],
            "got 'ida' in solvers of scene 'paper', expected some of the study's: cyrk-vern8",
        ),
        (
            "page",
            "both",
            "page: got 'both', expected 'costs', 'outcomes', 'known-stokes' or 'stiff'",
        ),
    ],
)
def test_limits_that_do_not_fit_are_one_line(path: str, value: Any, message: str):
    with pytest.raises(ValueError, match=message):
        parse_study(changed(path, value))


def test_a_built_in_scene_may_have_a_duration_of_its_own():
    study = parse_study(
        {**GOOD, "scenes": [{"name": "stiff", "builtin": True, "time": 5.0, "max_seconds": 3.0}]}
    )
    assert {case.max_seconds for batch in study.batches() for case in batch} == {3.0}
    assert {case.max_seconds for batch in study.quick().batches() for case in batch} == {0.2}
    ((name, scene),) = study.scenes
    assert (name, scene.time) == ("stiff", 5.0)
    assert scene == replace(named_scene("stiff"), time=5.0)
    over = {"name": "stiff", "builtin": True, "stokes": [5.0, 50.0], "slow_time": 0.5}
    for (_, scene), stokes in zip(
        parse_study({**GOOD, "scenes": [over]}).scenes, (5.0, 50.0), strict=True
    ):
        assert scene == replace(named_scene("stiff"), stokes=stokes, time=0.5 * stokes)
    with pytest.raises(
        ValueError,
        match="builtin and perhaps stokes, time, slow_time, tags, forms, solvers, max_sec",
    ):
        parse_study(
            {
                **GOOD,
                "scenes": [{"name": "stiff", "builtin": True, "shape": {"semi_axes": [1, 2, 3]}}],
            }
        )


def test_the_page_is_about_costs_of_one_scene_and_about_outcomes_of_several():
    two = {**GOOD, "scenes": [GOOD["scenes"][0], {**GOOD["scenes"][0], "name": "other"}]}
    assert parse_study(GOOD).page == "costs"
    assert parse_study(two).page == "outcomes"
    assert parse_study({**two, "page": "costs"}).page == "costs"
