"""Reasons of refusals, without what stands around them."""

import pytest

from polhode.harness.averaging.cases import paper_cases
from polhode.harness.picking.refusals import why_unreached
from polhode.models.catalogue import form as find_form
from polhode.models.form import FormNotValidError
from polhode.models.scene import BodyStart, Scene
from polhode.models.second_order import run
from polhode.models.shape import Ellipsoid


def test_the_condition_is_told_alone():
    form = find_form("averaged")
    assert form.refuse("St = 0: 'slow'; use less", "jeffery").condition == "St = 0: 'slow'; use less"
    assert FormNotValidError("otherwise made").condition == "otherwise made"


@pytest.mark.parametrize("stokes", [0.0, 10.0])
@pytest.mark.parametrize("axes", [(1.0, 1.0, 1.0), (1.0, 0.8, 0.5)])
def test_a_scene_without_rotation_has_its_own_reason(stokes: float, axes: tuple[float, float, float]):
    scene = Scene(Ellipsoid(axes), stokes, BodyStart((1.0, 0.0, 0.0, 0.0)), 5.0)
    form = find_form("averaged-second-order")
    with pytest.raises(FormNotValidError) as caught:
        form.reach(scene)
    assert why_unreached(form, scene, caught.value) == caught.value.condition
    assert not caught.value.condition.startswith("form")


def test_a_run_that_meets_the_separatrix_has_the_shortest_part_s_reason_too(monkeypatch):
    monkeypatch.setattr(run, "STOPS", (0.7, 0.5))
    form, scene = find_form("averaged-second-order"), paper_cases()[2].scene(100.0)
    with pytest.raises(FormNotValidError) as caught:
        form.reach(scene)
    met = "the run meets L² = 2EI₂ near t₂ = 0.049"
    assert why_unreached(form, scene, caught.value) == (
        f"{met}; even ended at t₂ = 0.0245, St = 100 is too small for this start"
    )
