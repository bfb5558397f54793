"""Reasons of refusals, without what stands around them."""

import pickle

import pytest

from polhode.models.catalogue import form as find_form
from polhode.models.form import FormNotValidError
from polhode.models.registry import NotFoundError
from polhode.models.scene import BodyStart, Scene
from polhode.models.shape import Ellipsoid
from polhode.solvers.contract import SolverNotValidError


def test_the_condition_is_told_alone():
    form = find_form("averaged")
    assert (
        form.refuse("St = 0: 'slow'; use less", "jeffery").condition == "St = 0: 'slow'; use less"
    )
    assert FormNotValidError("otherwise made").condition == "otherwise made"


@pytest.mark.parametrize(
    ("refusal", "words"),
    [
        (
            FormNotValidError("St = 0", "averaged", "jeffery"),
            "form 'averaged': St = 0; use 'jeffery'",
        ),
        (SolverNotValidError("no explicit form", "radau"), "solver 'radau': no explicit form"),
        (
            NotFoundError("form", "eular", "one of euler-angles", " (?)"),
            "form: got 'eular' (?), expected one of euler-angles",
        ),
    ],
)
def test_refusals_go_from_process_to_process(refusal: ValueError, words: str):
    copy = pickle.loads(pickle.dumps(refusal))
    assert str(copy) == words
    assert vars(copy) == vars(refusal)


@pytest.mark.parametrize("stokes", [0.0, 10.0])
@pytest.mark.parametrize("axes", [(1.0, 1.0, 1.0), (1.0, 0.8, 0.5)])
def test_a_scene_without_rotation_has_its_own_reason(
    stokes: float, axes: tuple[float, float, float]
):
    scene = Scene(Ellipsoid(axes), stokes, BodyStart((1.0, 0.0, 0.0, 0.0)), 5.0)
    with pytest.raises(FormNotValidError) as caught:
        find_form("averaged-second-order").reach(scene)
    assert not caught.value.condition.startswith("form")
