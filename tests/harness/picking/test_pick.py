"""`pick`: what it promises is kept by runs, what it refuses is refused in one line, what it excludes has a reason."""

import json
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from commandline import SCENE

from polhode.harness.answers.interval import Interval
from polhode.harness.calibration.scenes import SAMPLES as MEASURED, STRATA, TRAINING_SEED, questions
from polhode.harness.cli import main
from polhode.harness.commands.pick import FEW, pick_page
from polhode.harness.common.text import short
from polhode.harness.picking.candidate import LOOSEST, TIGHTEST
from polhode.harness.picking.ranking import NotAttainableError, pick
from polhode.harness.picking.recommendation import Recommendation, Way, outside_of_fit
from polhode.harness.picking.refusals import one_digit
from polhode.harness.references.errors import errors
from polhode.models.catalogue import FORMS, form
from polhode.models.observables import Observables
from polhode.models.scene import BodyStart, EulerStart, Scene, SlowStart
from polhode.models.scenes import named_scene
from polhode.models.shape import Ellipsoid
from polhode.solvers.catalogue import SOLVERS, solver as find_solver
from polhode.solvers.solve import solve

SAMPLES = 201


def observed(scene, form_name, solver_name, tolerance):
    problem = form(form_name).problem(scene)
    run = solve(problem, solver_name, tolerance, np.linspace(0, problem.end, SAMPLES))
    assert run.success
    return form(form_name).observe(scene, run.states)


def exact(scene):
    """Tight runs of a solver and a form that are not the first choice's."""
    if scene.stokes == 0:
        return observed(scene, "jeffery", "exact", 1e-14)
    stiff = scene.stokes < 1
    return observed(
        scene, "quaternion", "cyrk-radau" if stiff else "cyrk-vern8", 1e-12 if stiff else 1e-15
    )


@pytest.mark.parametrize(
    ("name", "error", "want"),
    [
        ("paper", 1e-2, "slow"),
        ("paper", 1e-6, "slow"),
        ("paper", 1e-9, "orientation"),
        ("spheroid-near-pole", 1e-5, "orientation"),
        ("rest-5e4", 1e-5, "slow"),
        ("near-spheroid", 1e-7, "slow"),
        ("needle", 1e-5, "orientation"),
        ("tumbler", 1e-6, "slow"),
        ("jeffery", 1e-7, "orientation"),
        ("top", 1e-6, "orientation"),
        ("sphere", 1e-8, "slow"),
    ],
)
def test_first_choice_meets_the_error(name, error, want):
    scene = named_scene(name)
    row = pick(scene, error, want).ranking[0]
    found = errors(
        scene.ellipsoid, observed(scene, row.form, row.solver, row.tolerance), exact(scene)
    )
    made = found.slow if want == "slow" else found.orientation
    assert made is not None
    assert made <= error
    assert row.error.low <= row.error.predicted <= row.error.high <= error


@pytest.mark.parametrize(
    "name", ["paper", "spheroid", "stiff", "jeffery", "top", "tumbler", "sphere", "rest-5e5"]
)
def test_every_row_and_every_reason(name):
    """Each method is either ranked, as `solve` accepts it, or excluded with a reason."""
    scene = named_scene(name)
    found = pick(scene, 1e-5)
    named = [(each.form, each.solver) for each in (*found.ranking, *found.excluded)]
    assert sorted(named) == sorted((form_name, solver) for form_name in FORMS for solver in SOLVERS)
    for row in found.ranking:
        find_solver(row.solver).check(form(row.form).problem(scene))
        assert TIGHTEST <= row.tolerance <= LOOSEST
        assert 0 < row.seconds.low <= row.seconds.predicted <= row.seconds.high
        assert row.first_run_seconds >= row.seconds.predicted
        assert row.reason
    assert all(each.reason for each in found.excluded)
    assert all(a.seconds.mean <= b.seconds.mean for a, b in pairwise(found.ranking))
    first = found.ranking[0].seconds
    overlapping = [row.seconds.overlaps(first) for row in found.ranking]
    assert [row.tied for row in found.ranking] == (
        overlapping if sum(overlapping) > 1 else [False] * len(overlapping)
    )


def test_the_same_question_has_the_same_answer_at_once():
    assert pick(named_scene("paper"), 1e-6) is pick(named_scene("paper"), 1e-6)


def test_averaged_form_wins_long_runs_at_loose_errors():
    """St = 1e6 over 8e4 rotations: known from a twin alone, and far cheaper than following each."""
    scene = named_scene("long")
    found = pick(scene, 1e-3)
    assert found.ranking[0].form == "averaged"
    full = next(row for row in found.ranking if row.form == "quaternion")
    assert full.seconds.predicted > 100 * found.ranking[0].seconds.predicted
    assert all(row.form != "averaged" for row in pick(scene, 1e-8).ranking)


def test_the_first_choice_for_a_long_run_from_rest_gets_there():
    scene = Scene(Ellipsoid((1.0, 0.8, 0.5)), 1e8, EulerStart((1.0, 0.5, 0.0)), 3e7)
    first = pick(scene, 1e-3).ranking[0]
    assert solve(form(first.form).problem(scene), first.solver, first.tolerance).success


@pytest.mark.parametrize(
    ("name", "error", "form_name", "word"),
    [
        ("rest-5e4", 1e-3, "averaged", "L = 0"),
        ("pinch-point", 1e-4, "averaged-spheroid", "pinch point"),
        ("paper", 1e-3, "averaged", "crosses L² = 2EI₂"),
        ("stiff", 1e-3, "averaged", "St is too small"),
        ("jeffery", 1e-3, "quaternion", "St = 0"),
        ("stiff", 1e-3, "quaternion", "stability"),
        ("spheroid", 1e-3, "averaged", "equal"),
    ],
)
def test_reasons_name_the_cause(name, error, form_name, word):
    excluded = pick(named_scene(name), error).excluded
    assert any(each.form == form_name and word in each.reason for each in excluded)


def test_orientation_is_not_left_to_forms_that_have_none():
    found = pick(named_scene("spheroid"), 1e-3, "orientation")
    assert all(form(row.form).orientation != "none" for row in found.ranking)


def test_slow_start_has_averaged_forms_alone():
    scene = replace(named_scene("paper"), stokes=1e5, time=5e3)
    lx, ly, lz = scene.initial.angular_momentum[0].tolist()
    bare = replace(scene, start=SlowStart((lx, ly, lz), float(scene.initial.energy[0])))
    assert {row.form for row in pick(bare, 1e-2).ranking} == {"averaged"}
    with pytest.raises(ValueError, match="expected 'slow'"):
        pick(bare, 1e-2, "orientation")


@pytest.mark.parametrize("error", [1e-300, 1e-17])
def test_unattainable_errors(error):
    with pytest.raises(
        NotAttainableError, match=r"not attainable in double precision, expected at least \d"
    ):
        pick(named_scene("paper"), error)


def test_rounding_along_the_run_is_unattainable_too():
    with pytest.raises(NotAttainableError, match="rounding along the run"):
        pick(named_scene("long"), 1e-13, "orientation")


def test_chaos_is_unattainable():
    with pytest.raises(NotAttainableError, match="chaotic"):
        pick(named_scene("jeffery-chaotic"), 1e-3, "orientation")


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (["paper", "--want", "statistics"], "got 'statistics', expected 'slow' or 'orientation'"),
        (["paper", "--want", "speed"], "got 'speed', expected 'slow' or 'orientation'"),
        (["paper", "--error", "0"], "error: got 0.0, expected a finite positive number"),
        (["paper", "--error", "-1e-3"], "error: got -0.001, expected a finite positive number"),
        (["paper", "--error", "nan"], "error: got nan, expected a finite positive number"),
        (
            ["paper", "--error", "1e300"],
            "error: got 1e+300, expected a finite positive number of at most 1e+60",
        ),
        (["paper", "--error", "1e-18"], "not attainable"),
        (["sphere", "--want", "orientation"], "for a sphere, which has none"),
        (["nowhere"], "got 'nowhere', expected a file"),
        (["paper", "--samples", "1"], "samples: got 1, expected a whole number from 2 to 10000000"),
        (
            ["paper", "--samples", "1000000000"],
            "samples: got 1000000000, expected a whole number from 2 to 10000000",
        ),
    ],
)
def test_bad_input_is_one_line(words, complaint, capsys):
    with pytest.raises(SystemExit) as ended:
        main(["pick", *words])
    out, err = capsys.readouterr()
    assert ended.value.code == 2
    assert not out
    assert complaint in err
    assert len(err.splitlines()) == 1


def test_json_is_the_contract(capsys):
    with pytest.raises(SystemExit) as ended:
        main(["pick", "paper", "--error", "1e-6", "--want", "slow", "--json"])
    found = json.loads(capsys.readouterr().out)
    assert ended.value.code == 0
    assert list(found) == ["want", "error", "ranking", "excluded"]
    assert (found["want"], found["error"]) == ("slow", 1e-6)
    for row in found["ranking"]:
        assert set(row) == {
            "form",
            "solver",
            "tolerance",
            "error",
            "seconds",
            "first_run_seconds",
            "tied",
            "reason",
        }
        assert set(row["error"]) == set(row["seconds"]) == {"predicted", "low", "high"}
    for row in found["excluded"]:
        assert set(row) == {"form", "solver", "reason"}


def test_table_for_people(capsys):
    with pytest.raises(SystemExit):
        main(["pick", "paper", "--error", "1e-3"])
    out = capsys.readouterr().out
    first = pick(named_scene("paper"), 1e-3).ranking[0]
    assert out.startswith(
        f"Run {first.form} by {first.solver} at tolerance {short(first.tolerance)}: about "
    )
    assert "within" in out.splitlines()[0]
    assert "tie" in out.splitlines()[0]
    assert "crosses L² = 2EI₂" not in out
    assert out.splitlines()[3].endswith("tied")
    assert out.count("\ntied: its 95 % interval of time overlaps with the first one's") == 1


def test_why_for_people(capsys):
    with pytest.raises(SystemExit):
        main(["pick", "paper", "--error", "1e-3", "--why"])
    out = capsys.readouterr().out
    assert "no significant difference" in out
    assert "crosses L² = 2EI₂" in out
    assert " rotations and " in out


def test_a_recommendation_is_a_line_a_table_and_a_page():
    found = pick(named_scene("paper"), 1e-6)
    assert repr(found).startswith(found.summary)
    assert len(repr(found)) < 700
    table = found.frame()
    assert list(table["solver"]) == [way.solver for way in found.ranking]
    assert table["seconds_high"].tolist()[0] == found.ranking[0].seconds.high
    assert "<table" in found._repr_html_()


@pytest.mark.parametrize(
    ("count", "words"), [(1, "1 more way, not cheaper:"), (2, "2 more ways, not cheaper:")]
)
def test_ways_not_shown_are_counted(count, words):
    interval = Interval(1.0, 0.5, 2.0)
    row = Way("quaternion", "taylor", 1e-9, interval, interval, 1.0, False, "")
    found = Recommendation("slow", 1e-6, 1.0, 1.0, (FEW + count) * (row,), ())
    assert f"\n{words} --all" in pick_page(found, everything=False)
    assert "more way" not in pick_page(found, everything=True)
    assert "tied" not in pick_page(found, everything=False)


@pytest.mark.parametrize(("samples", "noted"), [(max(MEASURED), False), (max(MEASURED) + 1, True)])
@pytest.mark.parametrize("options", [[], ["--json"]])
def test_times_beyond_the_measured_samples_are_said_to_be_extrapolated(
    samples, noted, options, capsys
):
    with pytest.raises(SystemExit):
        main(["pick", "paper", "--error", "1e-3", "--samples", str(samples), *options])
    assert ("extrapolated" in capsys.readouterr().err) is noted


@pytest.mark.parametrize("change", [{"stokes": 1e-20}, {"ellipsoid": Ellipsoid((1.0, 0.8, 1e-12))}])
def test_scenes_that_laws_were_not_fitted_to_are_named(change: dict):
    for stratum in STRATA:
        assert not any(
            outside_of_fit(each.scene) for each in questions(TRAINING_SEED, 300, stratum)
        )
    scene, words = (
        replace(named_scene("paper"), time=1.0),
        "Laws were fitted to St from 1e-4 to 1e8 and semi-axes of",
    )
    assert words not in repr(pick(scene, 1e-4))
    found = pick(replace(scene, **change), 1e-4)
    assert words in repr(found)
    assert words in pick_page(found, everything=False)


def test_that_is_said_beside_json_too(capsys, tmp_path: Path):
    text = SCENE.replace("1000.0", "1e-20").replace("slow_time = 0.5", "time = 1.0")
    (tmp_path / "far.toml").write_text(text, encoding="utf-8")
    with pytest.raises(SystemExit):
        main(["pick", str(tmp_path / "far.toml"), "--json"])
    said = capsys.readouterr()
    assert said.err.startswith("note: Laws were fitted to St from 1e-4")
    assert "ranking" in json.loads(said.out)


@pytest.mark.parametrize(
    ("tolerance", "rounded"),
    [(3.9e-7, 3e-7), (1e-7, 1e-7), (9.999e-12, 9e-12), (2e-15, 2e-15), (0.0, 0.0)],
)
def test_tolerances_have_one_digit(tolerance, rounded):
    assert one_digit(tolerance) == rounded


def test_solve_runs_what_pick_says(tmp_path, capsys):
    scene = named_scene("paper")
    row = pick(scene, 1e-6).ranking[0]
    way = ["--form", row.form, "--solver", row.solver, "--tolerance", str(row.tolerance)]
    with pytest.raises(SystemExit) as ended:
        main(["solve", "paper", *way, "--out", str(tmp_path / "paper.csv")])
    assert ended.value.code == 0
    assert (
        f"{row.form} by {row.solver} at tolerance {short(row.tolerance)}" in capsys.readouterr().err
    )
    table = np.loadtxt(tmp_path / "paper.csv", delimiter=",", skiprows=1)
    written = Observables(table[:, 2:5], table[:, 5], table[:, 6:].reshape(-1, 3, 3))
    assert errors(scene.ellipsoid, written, exact(scene)).slow <= 1e-6


@pytest.mark.parametrize("error", [1e-6, 1e-9])
def test_the_error_is_met_on_a_body_that_settles(error):
    """A sphere at St = 2 soon turns steadily: DOP853's steps are stability's, and its error does not fall."""
    start = BodyStart((1.0, 0.0, 0.0, 0.0), (0.3, 0.5, -0.9))
    scene = Scene(Ellipsoid((1.0, 1.0, 1.0)), 2.0, start, 30.0)
    row = pick(scene, error).ranking[0]
    times = np.linspace(0.0, 1.0, 201)
    runs = []
    for name, solver, tolerance in (
        (row.form, row.solver, row.tolerance),
        ("quaternion", "cyrk-vern8", 1e-15),
    ):
        equations = form(name)
        problem = equations.problem(scene)
        runs.append(
            equations.observe(
                scene, solve(problem, solver, tolerance, problem.end * times).states
            ).slow
        )
    assert np.max(np.abs(runs[0] - runs[1])) / max(scene.ellipsoid.inertia) <= error
