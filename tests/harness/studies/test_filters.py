"""Filters: what is left of a study, and one clear line where nothing is."""

import tomllib

import pytest
from commandline import STUDY, Run

from polhode.harness.common.store import read_export
from polhode.harness.studies.study import Study, parse_study

SECOND = """
[[scenes]]
name = "round"
stokes = 50.0
tags = ["spheroid", "short"]
slow_time = 0.02
shape.semi_axes = [1.0, 1.0, 2.0]
start.euler_angles = [1.0, 0.5, 0.0]
start.euler_rates = [1.0, 1.0, -1.0]
"""
TWO_SCENES = STUDY.replace('name = "paper"', 'name = "paper"\ntags = ["short"]') + SECOND


@pytest.fixture
def study() -> Study:
    return parse_study({**tomllib.loads(TWO_SCENES), "forms": ["quaternion", "spheroid-axis"]})


def cases(study: Study) -> set[tuple[str, float, str, str]]:
    return {
        (c.scene_name, c.scene.stokes, c.form, c.solver) for batch in study.batches() for c in batch
    }


def test_filters_of_one_kind_add_and_of_several_kinds_narrow(study: Study):
    everything = cases(study)
    assert cases(study.part()) == everything
    assert cases(study.part(scenes=["round"])) == {
        case for case in everything if case[0] == "round"
    }
    assert cases(study.part(tags=["spheroid"])) == cases(study.part(scenes=["round"]))
    assert cases(study.part(tags=["spheroid", "short"])) == everything
    narrow = study.part(tags=["short"], solvers=["cyrk-vern8"], forms=["spheroid-axis"])
    assert cases(narrow) == {("round", 50.0, "spheroid-axis", "cyrk-vern8")}


def test_a_part_asks_the_same_questions(study: Study):
    def keys(some: Study) -> set[str]:
        return {case.key for batch in some.batches() for case in batch}

    assert keys(study.part(tags=["spheroid"])) < keys(study)


def test_tags_are_no_part_of_the_question(study: Study):
    first, other = ({c.key for b in one.batches() for c in b} for one in (study, study.part()))
    assert first == other
    bare = parse_study(
        {**tomllib.loads(STUDY + SECOND.replace('tags = ["spheroid", "short"]\n', ""))}
    )
    tagged = parse_study(tomllib.loads(TWO_SCENES))
    assert [c.key for b in bare.batches() for c in b] == [
        c.key for b in tagged.batches() for c in b
    ]
    assert {c.tags for b in tagged.batches() for c in b} == {("short",), ("spheroid", "short")}


@pytest.mark.parametrize(
    ("filters", "message"),
    [
        ({"scenes": ["square"]}, "scene: got 'square', expected one of paper, round"),
        ({"tags": ["long"]}, "tag: got 'long', expected one of short, spheroid"),
        (
            {"forms": ["tumbling"]},
            "form: got 'tumbling', expected one of quaternion, spheroid-axis",
        ),
        ({"solvers": ["ida"]}, "solver: got 'ida', expected one of cyrk-dop853, cyrk-vern8"),
        (
            {"scenes": ["paper"], "forms": ["spheroid-axis"]},
            "filters: got scene paper, form spheroid-axis, expected some that go together in study 'small'",
        ),
    ],
)
def test_what_is_not_there_is_one_line(study: Study, filters: dict[str, list[str]], message: str):
    with pytest.raises(ValueError, match="^" + message.replace("(", r"\(") + "$"):
        study.part(**filters)


def test_a_study_without_tags_says_so():
    with pytest.raises(
        ValueError, match=r"tag: got 'short', expected none, for the study has no tags"
    ):
        parse_study(tomllib.loads(STUDY)).part(tags=["short"])


def test_the_command_line_runs_a_part_into_a_folder_of_its_own(here: Run, tmp_path):
    (tmp_path / "two.toml").write_text(TWO_SCENES, encoding="utf-8")
    done = here(
        "bench", "two.toml", "--tag", "spheroid", "--solver", "cyrk-vern8", "--quick", "--quiet"
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout == "reports/small-spheroid-cyrk-vern8-quick/README.md\n"
    folder = tmp_path / "reports" / "small-spheroid-cyrk-vern8-quick"
    assert (
        "polhode bench two.toml --quick --tag spheroid --solver cyrk-vern8"
        in (folder / "README.md").read_text()
    )
    records = list(read_export(folder / "records.jsonl.gz"))
    assert {(record["scene_name"], record["solver"]) for record in records} == {
        ("round", "cyrk-vern8")
    }
    assert {tuple(record["tags"]) for record in records} == {("spheroid", "short")}

    refused = here("bench", "two.toml", "--tag", "long")
    assert refused.returncode == 2
    assert refused.stderr == "polhode: tag: got 'long', expected one of short, spheroid\n"
