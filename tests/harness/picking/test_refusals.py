"""Reasons of refusals, without what stands around them."""

import pytest

from polhode.models.catalogue import form as find_form
from polhode.models.form import FormNotValidError
from polhode.models.scene import BodyStart, Scene
from polhode.models.shape import Ellipsoid


def test_the_condition_is_told_alone():
    form = find_form("averaged")
    assert form.refuse("St = 0: 'slow'; use less", "jeffery").condition == "St = 0: 'slow'; use less"
    assert FormNotValidError("otherwise made").condition == "otherwise made"


@pytest.mark.parametrize("stokes", [0.0, 10.0])
@pytest.mark.parametrize("axes", [(1.0, 1.0, 1.0), (1.0, 0.8, 0.5)])
def test_a_scene_without_rotation_has_its_own_reason(stokes: float, axes: tuple[float, float, float]):
    scene = Scene(Ellipsoid(axes), stokes, BodyStart((1.0, 0.0, 0.0, 0.0)), 5.0)
    with pytest.raises(FormNotValidError) as caught:
        find_form("averaged-second-order").reach(scene)
    assert not caught.value.condition.startswith("form")
