"""Measured errors as far as they bear a law: below what a reference in double precision knows they bear none."""

import pytest

from polhode.harness.calibration.samples import sample_of
from polhode.harness.common.timing import Pace
from polhode.models.files.scene_file import scene_table
from polhode.models.scenes import named_scene


@pytest.mark.parametrize(
    ("error", "uncertainty", "known"),
    [
        (1e-8, 1e-16, 1e-8),
        (1e-8, 1e-9, 1e-8),
        (1e-10, 1e-9, None),
        (1e-17, 1e-16, 1e-12),
        (0.5, 1e-16, None),
    ],
)
def test_an_error_bears_a_law_where_it_is_known(error, uncertainty, known):
    sample = sample_of(
        _record("paper", "quaternion", "cyrk-vern8", 1e-9, error, uncertainty), Pace(None, None)
    )
    assert sample is not None
    assert (sample.errors["slow"][1] if known else sample.errors.get("slow")) == (
        known and pytest.approx(known)
    )


def test_errors_of_a_closed_form_are_rounding_at_any_tolerance():
    sample = sample_of(_record("top", "euler-top", "exact", 1e-5, 2e-15, 0.0), Pace(None, None))
    assert sample is not None
    assert sample.errors["slow"][1] < 1e-14


def _record(scene, form, solver, tolerance, error, uncertainty):
    return {
        "scene_name": scene,
        "scene": scene_table(named_scene(scene)),
        "form": form,
        "solver": solver,
        "tolerance": tolerance,
        "samples": 51,
        "status": "reached_end",
        "seconds": 1e-3,
        "solver_slow_error": error,
        "slow_uncertainty": uncertainty,
    }
