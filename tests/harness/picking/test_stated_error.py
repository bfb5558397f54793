"""False successes that nothing but a second look finds, and good runs, which are left alone."""

from dataclasses import replace

import numpy as np
import pytest

from polhode import solve
from polhode.harness.answers.interval import Interval
from polhode.harness.picking.stated_error import RunError
from polhode.models.catalogue import form as find_form
from polhode.models.scene import Scene, SlowStart
from polhode.models.scenes import named_scene
from polhode.models.shape import Ellipsoid
from polhode.solvers.contract import Status


@pytest.mark.parametrize(
    ("method", "tolerance"), [("planted:FirstOrder", 0.3), ("planted:FirstOrder", 0.03)]
)
def test_a_run_that_is_far_off_is_no_success(method: str, tolerance: float):
    """Angular velocities too large by the tolerance: quaternions of unit norm, steps enough."""
    given = {"form": "quaternion", "solver": method, "tolerance": tolerance}
    found, claimed = solve("paper", **given), solve("paper", **given, estimate=False)
    true = solve("paper", form="quaternion", solver="cyrk-vern8", tolerance=1e-14, estimate=False)
    off = np.max(np.abs(found.observables.slow - true.observables.slow)) / max(
        found.scene.ellipsoid.inertia
    )
    assert claimed.status is Status.REACHED_END
    assert (found.status is Status.FALSE_SUCCESS) == (tolerance > 0.1) == bool(off > 0.1)
    assert found.message.startswith(f"L or E is off by {off:.1e}".replace("e-0", "e-")) == (
        tolerance > 0.1
    )


def test_a_chaotic_run_is_not_doubted():
    found = solve("jeffery-chaotic", form="jeffery", solver="cyrk-dop853", tolerance=1e-6)
    assert found.error.slow is None or found.error.slow.high > 0.1
    assert found.status is Status.REACHED_END


def test_a_run_that_nothing_else_follows_to_its_end_is_kept():
    """Averaged equations of so small an St break down by one solver and not by another."""
    scene = Scene(Ellipsoid((1.0, 0.8, 0.5)), 0.1, SlowStart((0.1, 0.05, 0.2), 0.0525 / 0.8), 1e5)
    found = solve(scene, form="averaged", solver="cyrk-radau", tolerance=1e-6)
    assert (found.status, found.error.slow) == (Status.REACHED_END, None)


@pytest.mark.parametrize(
    ("scene", "angle"), [("paper", "orientation"), ("spheroid", "symmetry axis")]
)
def test_words_say_what_the_angle_is_of(scene, angle):
    """Of a spheroid that of its axis: how far it has spun about this may be off by more."""
    found = solve(scene, form="quaternion", solver="cyrk-vern8", tolerance=1e-8)
    assert f"; {angle} within " in found.error.words()


@pytest.mark.parametrize(
    ("form", "low", "tolerance", "advice"),
    [
        # What begins at 0 is a bound alone; what pieces state does not fall with the tolerance.
        (
            "hybrid",
            0.0,
            1e-3,
            "may have been missed: it is at most 3.5e-2; do: --form spheroid-axis, whose",
        ),
        (
            "hybrid",
            2e-3,
            1e-3,
            "was missed: it is about 4.0e-3, at most 3.5e-2; do: --tolerance 1e-5",
        ),
        (
            "quaternion",
            5e-4,
            1e-3,
            "may have been missed: it is about 4.0e-3, at most 3.5e-2; do: --tolerance 1e-5",
        ),
        (
            "quaternion",
            2e-3,
            1e-12,
            "was missed: it is about 4.0e-3, at most 3.5e-2; no second run could confirm",
        ),
        (
            "averaged-spheroid",
            2e-3,
            1e-3,
            "was missed: it is about 4.0e-3, at most 3.5e-2; no full form takes",
        ),
    ],
)
def test_no_more_is_said_of_an_error_than_is_known(form, low, tolerance, advice):
    scene, seen = named_scene("spheroid"), RunError(Interval(4e-3, low, 3.5e-2), None, "")
    if find_form(form).averaged:
        scene = replace(scene, start=SlowStart((0.1, 0.2, 0.3), 0.4))
    said = seen.asked(1e-3, "slow", find_form(form), scene, tolerance).advice
    assert said.startswith(f"the error asked for, 0.001, {advice}")
