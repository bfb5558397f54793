"""What counts as a known error: more than ten times the reference's uncertainty."""

from math import isnan

import pandas as pd
import pytest

from polhode.harness.analysis.frames import frame
from polhode.harness.analysis.regime_map import cells
from polhode.harness.references.uncertainty import known, least_known

ROWS = [
    {"slow_error": 1.01e-9, "slow_uncertainty": 1e-10},
    {"slow_error": 1e-9, "slow_uncertainty": 1e-10},
    {"slow_error": 0.0, "slow_uncertainty": 0.0},
    {"slow_error": 1e-3, "slow_uncertainty": None},
    {"slow_error": None, "slow_uncertainty": None},
]


def test_an_error_is_known_above_ten_uncertainties():
    found = known(pd.DataFrame(ROWS), "slow_error")
    assert found[:4].tolist() == [True, False, False, False]
    assert found[4] is pd.NA


def test_without_a_stated_uncertainty_nothing_is_known():
    assert known(pd.DataFrame([{"slow_error": 1.0}]), "slow_error").tolist() == [False]
    assert isnan(least_known(None))


def test_of_every_error_of_a_frame_it_is_known_or_not():
    table = frame(
        [{**row, "orientation_error": 1e-3, "orientation_uncertainty": 1e-9} for row in ROWS]
    )
    assert known(table, "slow_error")[:4].tolist() == [True, False, False, False]
    assert known(table, "orientation_error").tolist() == [True] * 5


@pytest.mark.parametrize("uncertainty", [1e-10, 0.9e-9])
def test_the_regime_map_goes_by_the_same_limit(uncertainty: float):
    run = {
        "form": "quaternion",
        "solver": "taylor",
        "status": "reached_end",
        "seconds": 1.0,
        "stokes": 1.0,
    }
    errors = [run | {"slow_error": 10.0**-k, "slow_uncertainty": uncertainty} for k in range(1, 13)]
    table = pd.DataFrame(errors)
    at = dict(zip(table["slow_error"], known(table, "slow_error"), strict=True))
    targets = tuple(at)
    assert {cell.target: cell.resolved for cell in cells(table, "slow_error", targets)} == at
