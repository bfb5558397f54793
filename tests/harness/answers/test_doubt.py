"""False successes that nothing but a second run finds, and good runs, which are left alone."""

import numpy as np
import pytest

from polhode import solve
from polhode.models.scene import Scene, SlowStart
from polhode.models.shape import Ellipsoid
from polhode.solvers.contract import Status

pytestmark = pytest.mark.usefixtures("quickly_compiled")


@pytest.mark.parametrize("tolerance", [0.3, 0.03])
def test_a_run_that_is_far_off_is_no_success(tolerance: float):
    """Angular velocities too large by the tolerance: quaternions of unit norm, steps enough."""
    given = {"form": "quaternion", "solver": "planted:FirstOrder", "tolerance": tolerance}
    found, claimed = solve("paper", **given), solve("paper", **given, estimate=False)
    true = solve("paper", form="quaternion", solver="cyrk-vern8", tolerance=1e-14, estimate=False)
    unit = max(found.scene.ellipsoid.inertia)
    off = np.max(np.abs(found.observables.slow - true.observables.slow)) / unit
    assert claimed.status is Status.REACHED_END
    assert (found.status is Status.FALSE_SUCCESS) == (tolerance > 0.1) == bool(off > 0.1)
    assert found.message.startswith("L or E is off by ") == (tolerance > 0.1)


def test_a_chaotic_run_is_not_doubted():
    found = solve("jeffery-chaotic", form="jeffery", solver="cyrk-dop853", tolerance=1e-6)
    assert found.error.slow is None or found.error.slow.high > 0.1
    assert found.status is Status.REACHED_END


def test_a_run_that_nothing_else_follows_to_its_end_is_kept():
    """Averaged equations of so small an St break down by one solver and not by another."""
    scene = Scene(Ellipsoid((1.0, 0.8, 0.5)), 0.1, SlowStart((0.1, 0.05, 0.2), 0.0525 / 0.8), 1e5)
    found = solve(scene, form="averaged", solver="cyrk-radau", tolerance=1e-6)
    assert (found.status, found.error.slow, found.error.kind) == (Status.REACHED_END, None, None)
    assert "St is too small to average over rotations" in found.error.note
