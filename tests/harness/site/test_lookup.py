"""The look-up of the opening page, asked 8,820 questions: by Python, and by the page's own script."""

import json
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from polhode.harness import site
from polhode.harness.analysis.in_full import ran_in_full
from polhode.harness.analysis.pareto import Method
from polhode.harness.pages.figures.style import is_averaged
from polhode.harness.pages.regimes import read_cells
from polhode.harness.site.answers import question
from polhode.harness.site.lookup import look_up
from polhode.harness.site.markup import plain
from polhode.harness.studies.study import read_study
from polhode.solvers.contract import Status

REGIMES = Path(__file__).parents[3] / "reports" / "regimes"
SCRIPT = Path(site.__file__).with_name("verdict.js")
NODE = shutil.which("node")
# Beyond both ends of what is measured, between the St, and between the tolerances.
STOKES = np.geomspace(2.9e-5, 3e8, 45).tolist()
ERRORS = np.geomspace(1.0, 1e-14, 49).tolist()
COLUMN = {"slow": "slow_error", "orientation": "orientation_error"}

pytestmark = pytest.mark.skipif(not REGIMES.is_dir(), reason="no committed map here")


@pytest.fixture(scope="module")
def columns() -> list[dict]:
    """What the page's script reads."""
    _, data = question(REGIMES)
    return json.loads(json.dumps(plain(data["question-data"]["columns"])))


@pytest.fixture(scope="module")
def questions() -> list[tuple]:
    particles = ("ellipsoid", "spheroid")
    return [(p, w, s, e) for p in particles for w in COLUMN for s in STOKES for e in ERRORS]


@pytest.fixture(scope="module")
def answers(columns: list[dict], questions: list[tuple]) -> list[dict]:
    return [look_up(columns, *words) for words in questions]


@pytest.fixture(scope="module")
def runs() -> dict[tuple, dict[str, np.ndarray]]:
    """Columns of the runs that reached their end, by particle and St, without those of `hybrid` in full."""
    table = pd.read_csv(REGIMES / "runs.csv")
    table = table[~ran_in_full(table, read_study(None, "regimes").scenes)]
    table = table[table["status"] == Status.REACHED_END]
    table = table.assign(averaged=table["form"].map(is_averaged))
    return {
        (str(name), float(stokes)): {column: own[column].to_numpy() for column in own}
        for (name, stokes), own in table.groupby(["scene_name", "stokes"])
    }


def test_the_questions_are_many(questions: list[tuple]):
    assert len(questions) == 8820


def test_an_answer_is_a_measured_run_no_looser_than_asked(questions, answers, runs):
    checked = 0
    for (particle, want, _, error), found in zip(questions, answers, strict=True):
        for answer in found["answers"]:
            if "form" not in answer:
                continue
            own = runs[particle, answer["St"]]
            (run,) = np.flatnonzero(
                (own["form"] == answer["form"])
                & (own["solver"] == answer["solver"])
                & (np.abs(own["tolerance"] / answer["tolerance"] - 1) <= 1e-9)
            )
            assert own[COLUMN[want]][run] <= error
            assert own["seconds"][run] == pytest.approx(answer["seconds"], rel=1e-3)
            checked += 1
    assert checked > 8000


def test_no_averaged_run_that_is_good_enough_is_cheaper(questions, answers, runs):
    averaged_answers = 0
    for (particle, want, _, error), found in zip(questions, answers, strict=True):
        for answer in found["answers"]:
            own = runs[particle, answer["St"]]
            errors = own[COLUMN[want]]
            good = own["seconds"][own["averaged"] & (errors <= error)]
            for form, least, seconds in answer["averaged"]:
                # What the page says of each averaged form is what its runs say.
                mine = errors[own["form"] == form]
                assert least == pytest.approx(np.fmin.reduce(mine), rel=1e-3)
                reached = bool((mine * 1.001 <= error).any())
                assert not reached or seconds is not None
                assert seconds is None or least <= error
            if "form" in answer and len(good):
                assert answer["seconds"] <= good.min() * 1.001
                averaged_answers += is_averaged(answer["form"])
    assert averaged_answers > 500


def test_between_two_stokes_numbers_both_neighbours_answer(questions, answers, runs):
    measured = sorted({stokes for _, stokes in runs if stokes > 0})
    for (_, _, stokes, _), found in zip(questions, answers, strict=True):
        shown = [answer["St"] for answer in found["answers"]]
        below = [one for one in measured if one < stokes]
        above = [one for one in measured if one > stokes]
        assert shown == [*below[-1:], *above[:1]]
        assert found["beyond"] == (not below or not above)


@pytest.mark.parametrize("stokes", [1e-4, 1.0, 1e4, 1e8])
def test_at_a_measured_stokes_number_it_answers_alone(columns, stokes):
    found = look_up(columns, "spheroid", "slow", stokes * (1 + 1e-5), 1e-4)
    assert [answer["St"] for answer in found["answers"]] == [stokes]
    assert not found["beyond"]


def test_below_what_was_measured_nothing_is_recommended(questions, answers, runs, columns):
    """The page then names `polhode pick`."""
    limits = {(one["particle"], one["want"], one["St"]): one["limit"] for one in columns}
    nothing = 0
    for (particle, want, _, error), found in zip(questions, answers, strict=True):
        for answer in found["answers"]:
            least = np.fmin.reduce(runs[particle, answer["St"]][COLUMN[want]])
            limit = limits[particle, want, answer["St"]]
            limit = np.inf if limit is None else limit
            if error < max(least, limit) * (1 - 1e-3):
                assert "form" not in answer
                nothing += 1
            elif error > max(least, limit) * (1 + 1e-3):
                assert "form" in answer
    assert nothing > 500


def test_where_the_reference_is_not_known_nothing_is_recommended(columns):
    column = next(one for one in columns if (one["particle"], one["St"]) == ("spheroid", 1.0))
    unknown = [column | {"limit": None}]
    asked = ("spheroid", column["want"], 1.0, 1e-4)
    assert "form" in look_up([column], *asked)["answers"][0]
    assert "form" not in look_up(unknown, *asked)["answers"][0]


def test_the_map_and_the_look_up_agree(columns):
    """Averaged forms stand under their own name, whichever solver runs them."""
    compared = 0
    for (name, error), cells in read_cells(REGIMES / "cells.csv").items():
        want = next(word for word, column in COLUMN.items() if column == error)
        for cell in cells:
            (answer,) = look_up(columns, name, want, cell.stokes, cell.target)["answers"]
            if cell.winner is None:
                assert "form" not in answer
            else:
                assert Method(answer["form"], answer["solver"]).label == cell.winner.label
                compared += 1
    assert compared > 400


@pytest.mark.skipif(NODE is None, reason="no node on this machine")
def test_the_script_gives_the_same_answers(tmp_path, columns, questions, answers):
    (tmp_path / "asked.json").write_text(json.dumps([columns, questions]), encoding="utf-8")
    program = (
        f"const {{ lookUp }} = require({json.dumps(str(SCRIPT))});"
        "const [columns, asked] = JSON.parse(require('fs').readFileSync(process.argv[1], 'utf8'));"
        "console.log(JSON.stringify(asked.map((words) => lookUp(columns, ...words))));"
    )
    done = subprocess.run(
        [str(NODE), "-e", program, str(tmp_path / "asked.json")],
        capture_output=True,
        text=True,
        timeout=120,
        check=True,
    )
    by_script = json.loads(done.stdout)
    assert len(by_script) == len(answers)
    for asked, one, other in zip(questions, by_script, answers, strict=True):
        assert one["beyond"] == other["beyond"], asked
        for mine, theirs in zip(one["answers"], other["answers"], strict=True):
            assert mine.keys() == theirs.keys(), asked
            for name, value in mine.items():
                if name == "cost":
                    assert value == pytest.approx(theirs[name], rel=1e-12)
                elif name == "next" and value is not None:
                    assert value[:2] == theirs[name][:2], asked
                else:
                    assert value == theirs[name], (asked, name)
