"""`pick`: runs confirm what it predicts, refusals have one line, and exclusions a reason."""

import json
import re
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from polhode.harness import api
from polhode.harness.answers import pace as paces, race as races
from polhode.harness.answers.forecast import raced_segment
from polhode.harness.answers.interval import Interval
from polhode.harness.answers.pick import forget, pick
from polhode.harness.answers.race import TIED, contenders, listed
from polhode.harness.answers.recommendation import RankedRun, Recommendation
from polhode.harness.answers.request import NotAttainableError
from polhode.harness.answers.rules import LOOSEST, TIGHTEST
from polhode.harness.cli import main
from polhode.harness.commands.pick import FEW, pick_page
from polhode.harness.common.text import short
from polhode.harness.references.errors import errors
from polhode.models.catalogue import FORMS, form
from polhode.models.observables import Observables
from polhode.models.scene import BodyStart, EulerStart, Scene, SlowStart
from polhode.models.scenes import named_scene
from polhode.models.shape import Ellipsoid
from polhode.solvers.catalogue import SOLVERS, solver as find_solver
from polhode.solvers.solve import solve

pytestmark = pytest.mark.usefixtures("quickly_compiled")

SAMPLES = 201
NUMBER = r"\d(?:\.\d+)?(?:e-?\d+)?"


def observed(scene, form_name, solver_name, tolerance):
    problem = form(form_name).problem(scene)
    run = solve(problem, solver_name, tolerance, np.linspace(0, problem.end, SAMPLES))
    assert run.success
    return form(form_name).observe(scene, run.states)


def exact(scene):
    """Tight runs of a solver and a form that are not the first choice's."""
    if scene.stokes == 0:
        return observed(scene, "jeffery", "exact", 1e-14)
    if scene.stokes < 1:
        return observed(scene, "quaternion", "radau", 1e-11)
    return observed(scene, "quaternion", "cyrk-vern7", 1e-14)


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


@pytest.mark.parametrize("name", ["paper", "spheroid", "stiff", "jeffery", "top", "sphere"])
def test_every_row_and_every_reason(name):
    """Each method is either ranked, as `solve` accepts it, or excluded with a reason."""
    scene = named_scene(name)
    found = pick(scene, 1e-5)
    named = [(row.form, row.solver) for row in (*found.ranking, *found.excluded)]
    assert sorted(named) == sorted((form_name, solver) for form_name in FORMS for solver in SOLVERS)
    for row in found.ranking:
        find_solver(row.solver).check(form(row.form).problem(scene))
        assert TIGHTEST <= row.tolerance <= LOOSEST
        assert 0 < row.seconds.low <= row.seconds.predicted <= row.seconds.high
        assert row.first_run_seconds >= row.seconds.predicted
        assert row.reason
    assert all(row.reason for row in found.excluded)
    times = [row.seconds.predicted for row in found.ranking]
    assert all(a <= b for a, b in pairwise(times))
    near = [time <= TIED * times[0] for time in times]
    assert [row.tied for row in found.ranking] == (near if sum(near) > 1 else [False] * len(near))


def test_the_same_question_has_the_same_answer_at_once():
    assert pick(named_scene("paper"), 1e-6) is pick(named_scene("paper"), 1e-6)


@pytest.fixture
def clock(monkeypatch):
    """Steps cost what this clock says: some time for each solver, times a factor; `clock(factor)` sets it."""

    def quickest(method, tolerance, scene, rows):
        problem = method.form.problem(scene)
        run = solve(problem, method.solver, tolerance, np.linspace(0.0, problem.end, rows))
        steps = paces.steps_in(run)
        weight = len(method.form.name) * len(method.solver.name)
        return factors[-1] * 1e-8 * weight * (steps + 0.2 * rows), steps

    def set_to(factor):
        factors.append(factor)
        forget()
        paces.forget()

    factors = [1.0]
    monkeypatch.setattr(paces, "_quickest", quickest)
    steps = paces.steps_in
    monkeypatch.setattr(
        races.Remembering,
        "paid",
        lambda _, run, samples: factors[-1] * (2e-3 + 2e-6 * steps(run.solution)),
    )
    set_to(1.0)
    yield set_to
    forget()
    paces.forget()


@pytest.mark.parametrize("name", ["load.toml", "paper", "spheroid", "stiff", "rest-5e4"])
def test_a_clock_that_is_slow_or_fast_changes_nothing(name, clock):
    scene = api.as_scene(str(Path(__file__).with_name(name)) if "." in name else name)
    error = 1.8e-10 if "." in name else 1e-7
    answers = []
    # A race on the scene of the file takes seconds: the slow clock is held against the fast one alone.
    for factor in (8.0, 0.125) if "." in name else (1.0, 8.0, 0.125):
        clock(factor)
        rows = pick(scene, error).ranking
        answers.append([(row.form, row.solver, row.tolerance) for row in rows])
    assert all(answer == answers[0] for answer in answers)


def test_a_solver_that_errs_is_seen_through():
    """Its angular velocities are too large by its tolerance, whatever it claims."""
    scene = named_scene("paper")
    found = pick(scene, 1e-6, names=[("quaternion", "planted:FirstOrder")])
    (row,) = [row for row in found.ranking if row.solver == "planted:FirstOrder"] or [None]
    if row is not None:
        problem = form("quaternion").problem(scene)
        run = solve(problem, row.solver, row.tolerance, np.linspace(0, problem.end, SAMPLES))
        made = errors(scene.ellipsoid, form("quaternion").observe(scene, run.states), exact(scene))
        assert made.slow <= 1e-6
    (dreamer,) = [
        row
        for row in pick(scene, 1e-6, names=[("quaternion", "planted:Dreamer")]).excluded
        if row.solver == "planted:Dreamer"
    ]
    assert "errs by" in dreamer.reason


def test_two_that_err_alike_are_no_reference():
    """Two that stand still agree to the last digit, and neither is believed."""
    liars = [("quaternion", "planted:Dreamer"), ("quaternion", "planted:Idler")]
    found = pick(named_scene("paper"), 1e-6, names=liars)
    assert not {row.solver for row in found.ranking} & {"planted:Dreamer", "planted:Idler"}


@pytest.fixture(scope="module")
def every_method() -> Recommendation:
    """Every method raced along a tenth of the scene `paper`, with its pace timed once."""
    scene = named_scene("paper")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(paces, "_REPEATS", 1)
        paces.forget()
        found = pick(replace(scene, time=scene.time / 10), 1e-4, everything=True)
    paces.forget()
    return found


def test_all_and_names_add_methods(every_method):
    scene = named_scene("paper")
    usual = {(row.form, row.solver) for row in pick(scene, 1e-4).ranking}
    assert usual <= set(listed())
    named = api.pick(scene, 1e-4, form="euler-angles", solver="cyrk-dop853")
    assert ("euler-angles", "cyrk-dop853") in {(row.form, row.solver) for row in named.ranking}
    assert len(every_method.ranking) > 2 * len(usual)
    methods, refusals = contenders(scene, "slow", everything=True)
    assert len(methods) + len(refusals) == len(FORMS) * len(SOLVERS)


def test_a_missing_library_is_named_and_others_stand_in(monkeypatch):
    forget()
    monkeypatch.setattr("polhode.solvers.contract.installed", lambda library: library != "CyRK")
    found = pick(named_scene("paper"), 1e-5)
    assert not any(row.solver.startswith("cyrk") for row in found.ranking)
    reasons = [row.reason for row in found.excluded if row.solver == "cyrk-vern8"]
    assert "cyrk is not installed: pip install cyrk" in reasons
    forget()


def test_without_libraries_they_are_named(monkeypatch):
    forget()
    monkeypatch.setattr("polhode.solvers.contract.installed", lambda library: False)
    with pytest.raises(NotAttainableError, match="is not installed: pip install"):
        pick(named_scene("paper"), 1.7e-6)
    forget()


def test_rows_do_not_change_the_choice():
    """Errors are those of the run, not of its rows."""
    scene = named_scene("paper")
    few, many = (pick(scene, 1e-6, samples=samples).ranking for samples in (2, 2001))
    tolerances = {(row.form, row.solver): row.tolerance for row in many}
    assert all(
        tolerances.get((row.form, row.solver), row.tolerance) == row.tolerance for row in few
    )


def test_long_runs_at_loose_errors_are_averaged():
    """St = 1e8 over 8e6 rotations: far cheaper than following each."""
    scene = replace(named_scene("long"), stokes=1e8, time=100 * named_scene("long").time)
    assert raced_segment(scene).kind == "surrogate"
    found = pick(scene, 1e-3)
    assert found.ranking[0].form in ("averaged", "hybrid", "averaged-second-order")
    assert any(row.form == "quaternion" and "costs more" in row.reason for row in found.excluded)


def test_the_model_error_of_first_order_falls_no_faster_than_physics_allows():
    """At St = 1e7 and 1e-7 averaging errs by 1.2e-5 on this body; fits between smaller St said 6e-8."""
    ellipsoid, start = Ellipsoid((1.0, 0.8, 0.5)), EulerStart((1.0, 0.5, 0.0), (1.0, 1.0, -1.0))
    for stokes, error in ((1e6, 1e-5), (1e7, 1e-7)):
        found = pick(Scene(ellipsoid, stokes, start, 0.3 * stokes), error)
        assert all(row.form != "averaged" for row in found.ranking)


@pytest.mark.parametrize(
    ("name", "error", "form_name", "word"),
    [
        ("rest-5e4", 1e-3, "averaged", "L = 0"),
        ("stiff", 1e-3, "averaged", "St is too small"),
        ("jeffery", 1e-3, "quaternion", "St = 0"),
        ("stiff", 1e-3, "quaternion", "stability"),
        ("spheroid", 1e-3, "averaged", "equal"),
        ("paper", 1e-3, "euler-angles", "--all races it"),
    ],
)
def test_reasons_name_the_cause(name, error, form_name, word):
    excluded = pick(named_scene(name), error).excluded
    assert any(row.form == form_name and word in row.reason for row in excluded)


def test_orientation_is_not_left_to_forms_that_have_none():
    found = pick(named_scene("spheroid"), 1e-3, "orientation")
    assert all(form(row.form).orientation != "none" for row in found.ranking)


def from_l_and_e(stokes: float) -> Scene:
    """The paper's scene at a large St, its orientation forgotten: averaged forms alone take it."""
    scene = replace(named_scene("paper"), stokes=stokes, time=0.05 * stokes)
    lx, ly, lz = scene.initial.angular_momentum[0].tolist()
    return replace(scene, start=SlowStart((lx, ly, lz), float(scene.initial.energy[0])))


@pytest.mark.parametrize("stokes", [1e5, 1e6])
def test_a_start_by_l_and_e_alone_has_a_run(stokes):
    assert {row.form for row in pick(from_l_and_e(stokes), 1e-2).ranking} == {"averaged"}
    with pytest.raises(ValueError, match="expected 'slow'"):
        pick(from_l_and_e(stokes), 1e-2, "orientation")


@pytest.mark.parametrize(
    ("scene", "error", "want"),
    [(named_scene("spheroid"), 1e-14, "orientation"), (from_l_and_e(1e6), 1e-7, "slow")],
    ids=["spheroid", "averaged alone"],
)
def test_an_error_that_is_refused_comes_with_one_that_is_not(scene, error, want):
    with pytest.raises(NotAttainableError) as refused:
        pick(scene, error, want)
    text = str(refused.value)
    assert text.startswith(f"error: got {error!r}, not attainable: expected at least ")
    least = re.search(rf"at least ({NUMBER})", text)
    assert least
    assert float(least[1]) > error
    assert pick(scene, float(least[1]), want).ranking


@pytest.mark.parametrize("error", [1e-300, 1e-17])
def test_unattainable_errors(error):
    with pytest.raises(
        NotAttainableError, match=r"not attainable in double precision, expected at least \d"
    ):
        pick(named_scene("paper"), error)


def test_chaos_is_unattainable():
    with pytest.raises(NotAttainableError, match="chaotic"):
        pick(named_scene("jeffery-chaotic"), 1e-3, "orientation")


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (["paper", "--want", "statistics"], "got 'statistics', expected 'slow' or 'orientation'"),
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
        (["paper", "--form", "quaternoin"], "got 'quaternoin' (did you mean 'quaternion'?)"),
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
        assert list(row) == [
            *("form", "solver", "tolerance", "error", "seconds", "first_run_seconds"),
            *("tied", "reason"),
        ]
        assert set(row["error"]) == set(row["seconds"]) == {"predicted", "low", "high"}
    for row in found["excluded"]:
        assert set(row) == {"form", "solver", "reason"}


def test_table_for_people(capsys):
    with pytest.raises(SystemExit):
        main(["pick", "paper", "--error", "1e-3", "--why"])
    out = capsys.readouterr().out
    first = pick(named_scene("paper"), 1e-3).ranking[0]
    assert out.startswith(
        f"Run {first.form} by {first.solver} at tolerance {short(first.tolerance)}: about "
    )
    assert "within" in out.splitlines()[0]
    assert " rotations and " in out
    assert first.reason in out


def test_it_says_when_not_to_ask():
    interval = Interval(2e-3, 1e-3, 3e-3)
    row = RankedRun("quaternion", "taylor", 1e-9, interval, interval, 1.0, False, "")
    quick = Recommendation("slow", 1e-6, 1.0, 1.0, (row,), (), seconds=0.02)
    assert quick.advice.startswith("Choosing took 20 ms, longer than this run.")
    assert "type `polhode solve SCENE --error 1e-6` without asking first" in quick.advice
    turned = replace(quick, want="orientation")
    assert "--error 1e-6 --want orientation`" in turned.advice
    assert quick.advice in quick.summary
    assert not replace(quick, seconds=0.001).advice


def test_a_recommendation_is_a_line_a_table_and_a_page():
    found = pick(named_scene("paper"), 1e-6)
    assert repr(found).startswith(found.summary)
    assert len(repr(found)) < 700
    table = found.frame()
    assert list(table["solver"]) == [row.solver for row in found.ranking]
    assert table["seconds_high"].tolist()[0] == found.ranking[0].seconds.high
    assert "<table" in found._repr_html_()


def test_rows_stand_in_the_order_of_their_times_and_tie_within_a_fifth(every_method):
    ranking = every_method.ranking
    seconds = [row.seconds.predicted for row in ranking]
    assert seconds == sorted(seconds)
    near = [time <= 1.2 * seconds[0] for time in seconds]
    assert [row.tied for row in ranking] == [close and sum(near) > 1 for close in near]


@pytest.mark.parametrize(
    ("count", "words"), [(1, "1 more row, not cheaper:"), (2, "2 more rows, not cheaper:")]
)
def test_rows_not_shown_are_counted(count, words):
    interval = Interval(1.0, 0.5, 2.0)
    row = RankedRun("quaternion", "taylor", 1e-9, interval, interval, 1.0, False, "")
    found = Recommendation("slow", 1e-6, 1.0, 1.0, (FEW + count) * (row,), ())
    assert f"\n{words} --all" in pick_page(found, everything=False)
    assert "more row" not in pick_page(found, everything=True)
    assert "tied" not in pick_page(found, everything=False)


def test_solve_runs_what_pick_says(tmp_path, capsys):
    scene = named_scene("paper")
    row = pick(scene, 1e-6).ranking[0]
    method = ["--form", row.form, "--solver", row.solver, "--tolerance", str(row.tolerance)]
    with pytest.raises(SystemExit) as ended:
        main(["solve", "paper", *method, "--out", str(tmp_path / "paper.csv")])
    assert ended.value.code == 0
    table = np.loadtxt(tmp_path / "paper.csv", delimiter=",", skiprows=1)
    written = Observables(table[:, 2:5], table[:, 5], table[:, 6:].reshape(-1, 3, 3))
    assert errors(scene.ellipsoid, written, exact(scene)).slow <= 1e-6


@pytest.mark.parametrize("error", [1e-6, 1e-9])
def test_the_error_is_met_on_a_body_that_settles(error):
    """A sphere at St = 2 soon turns steadily: DOP853's steps are stability's, and its error does not fall."""
    start = BodyStart((1.0, 0.0, 0.0, 0.0), (0.3, 0.5, -0.9))
    scene = Scene(Ellipsoid((1.0, 1.0, 1.0)), 2.0, start, 30.0)
    row = pick(scene, error).ranking[0]
    made = errors(
        scene.ellipsoid, observed(scene, row.form, row.solver, row.tolerance), exact(scene)
    )
    assert made.slow <= error
