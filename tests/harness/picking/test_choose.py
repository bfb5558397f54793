"""What `polhode solve` runs where something is left open, and what it says of a choice that will not meet the error."""

from dataclasses import replace
from fractions import Fraction

import pytest

from polhode.harness.calibration.scenes import Question, questions
from polhode.harness.picking import load
from polhode.harness.picking.choice import (
    LARGEST_TOLERANCE,
    LEAST_TOLERANCE,
    Chosen,
    check_tolerance,
    choose,
)
from polhode.harness.picking.pilot import follow
from polhode.harness.picking.ranking import NotAttainableError, pick
from polhode.models.catalogue import FORMS, form
from polhode.models.scene import SlowStart
from polhode.models.scenes import named_scene


def test_choice_is_the_first_row_that_agrees():
    scene = named_scene("paper")
    rows = pick(scene, 1e-6).ranking
    first = choose(scene, None, None, None, 1e-6, "slow")
    assert first == Chosen(rows[0].form, rows[0].solver, rows[0].tolerance)
    assert choose(scene, None, None, None, Fraction(1, 10**6), "slow") == first
    taylor = next(row for row in rows if row.solver == "taylor")
    tried = choose(scene, None, "taylor", None, 1e-6, "slow")
    assert tried[:2] == (taylor.form, "taylor")
    assert tried.tolerance >= taylor.tolerance
    assert choose(scene, None, "taylor", 1e-9, 1e-6, "slow").tolerance == 1e-9
    assert choose(scene, "averaged", None, None, 1e-6, "slow")[:3] == ("averaged", "taylor", 1e-8)
    assert choose(scene, "quaternion", "radau", 1e-5, 1e-99, "slow") == Chosen(
        "quaternion", "radau", 1e-5
    )
    with pytest.raises(NotAttainableError):
        choose(scene, None, None, None, 1e-17, "slow")


@pytest.mark.parametrize("question", questions(31, 8), ids=lambda each: each.name)
def test_forms_that_cannot_be_chosen_are_not_run(
    question: Question, monkeypatch: pytest.MonkeyPatch
):
    run = []
    monkeypatch.setattr(
        load, "follow", lambda form, *rest: run.append(form.name) or follow(form, *rest)
    )
    scene = replace(question.scene, time=question.scene.time / 7)
    asked = question.error, question.want, question.samples
    chosen = choose(scene, None, None, None, *asked)
    assert "euler-angles" not in run
    first = pick(scene, *asked).ranking[0]
    assert chosen[:3] == (first.form, first.solver, first.tolerance)


def test_a_form_that_cannot_meet_the_error_is_chosen_with_a_note():
    scene = named_scene("paper")
    rows = pick(scene, 1e-6)
    (reason,) = {each.reason for each in rows.excluded if each.form == "averaged"}
    first = rows.ranking[0]
    note = choose(scene, "averaged", None, None, 1e-6, "slow").note
    better = f"{first.form} by {first.solver} is"
    assert note == f"averaged by taylor is not expected to meet the error 1e-6: {reason}; {better}"
    assert "model error up to 0.0" in note


def test_a_solver_that_is_held_back_is_chosen_with_a_note():
    note = choose(named_scene("stiff"), None, "cyrk-vern8", None, 1e-3, "slow").note
    assert "quaternion by cyrk-vern8 is not expected to meet the error 0.001" in note
    assert "stability, not the tolerance, sets its steps" in note


def test_what_no_method_can_do_is_in_the_note():
    note = choose(named_scene("paper"), "quaternion", None, None, 1e-17, "slow").note
    assert note.startswith(
        "quaternion by taylor runs all the same, but the error 1e-17 is not attainable in double"
    )


def test_of_a_form_of_ones_own_nothing_is_claimed():
    name = "polhode.models.forms.quaternion:Quaternion"
    note = choose(named_scene("paper"), name, None, None, 1e-6, "slow").note
    assert note.startswith(f"`pick` does not know whether {name} by taylor meets the error 1e-6; ")


def test_no_note_where_the_error_is_met_or_the_tolerance_is_given():
    scene = named_scene("paper")
    assert choose(scene, "quaternion", None, None, 1e-6, "slow").note == ""
    assert choose(scene, "averaged", None, 1e-9, 1e-6, "slow") == Chosen("averaged", "taylor", 1e-9)


def test_the_first_solver_that_takes_the_form():
    """At St = 0 the quaternion form has no explicit equations: none of the explicit solvers comes into question."""
    assert choose(named_scene("jeffery"), "quaternion", None, 1e-6, 1e-3, "slow").solver == "ida"
    assert choose(named_scene("top"), "euler-top", None, 1e-6, 1e-99, "slow").solver == "exact"


@pytest.mark.parametrize("name", [name for name in FORMS if form(name).orientation == "none"])
@pytest.mark.parametrize("tolerance", [None, 1e-8])
def test_orientation_is_not_to_be_had_of_forms_without_it(name: str, tolerance: float | None):
    scene = named_scene("paper" if name == "averaged" else "spheroid")
    solver = "taylor" if tolerance else None
    with pytest.raises(
        ValueError, match=f"want: got 'orientation' for form '{name}', which gives none, expected"
    ):
        choose(scene, name, solver, tolerance, 1e-3, "orientation")
    assert choose(scene, name, solver, tolerance, 1e-3, "slow").form == name


def test_a_start_by_l_and_e_leaves_averaged_forms():
    scene = replace(named_scene("paper"), stokes=1e5, time=5e3)
    lx, ly, lz = scene.initial.angular_momentum[0].tolist()
    bare = replace(scene, start=SlowStart((lx, ly, lz), float(scene.initial.energy[0])))
    assert choose(bare, None, None, None, 1e-2, "slow").form == "averaged"
    with pytest.raises(ValueError, match="expected 'slow'"):
        choose(bare, None, None, None, 1e-2, "orientation")


@pytest.mark.parametrize("tolerance", [LEAST_TOLERANCE, 2.2e-16, 1e-6, LARGEST_TOLERANCE])
def test_tolerances_that_double_precision_can_follow(tolerance: float):
    check_tolerance(tolerance)


@pytest.mark.parametrize("tolerance", [1e-30, 9.9e-17, 1.1, 1e300])
def test_tolerances_that_mean_nothing(tolerance: float):
    with pytest.raises(
        ValueError, match=r"^tolerance: got .*, expected a number from 1e-16, .* to 1$"
    ):
        check_tolerance(tolerance)
