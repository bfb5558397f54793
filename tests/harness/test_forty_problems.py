"""On forty problems no known error is off by more than a factor of 2, and no success by 0.1 of the state's size."""

import numpy as np
import pytest

from oracle.forty_problems import FORTY
from polhode import WorkPrecision

SOLVERS = ("taylor", "cyrk-dop853", "cyrk-tsit5", "cyrk-lsoda", "cvode-bdf", "radau")
# Errors below this share of a component are within what SciPy's own run is off by.
RESOLVED = 1e-9


@pytest.mark.slow
@pytest.mark.parametrize("name", FORTY)
def test_known_errors_are_right_and_successes_near(name):
    one = FORTY[name]
    ratio = one.classical.atol if one.classical else None
    study = WorkPrecision(
        one.problem, SOLVERS, [1e-4, 1e-7], 51, 5.0, quiet=True, error="final", atol=ratio
    )
    frame, checked = study.frame, 0
    if one.end is None:
        assert not (frame["status"] == "reached_end").any(), frame[["solver", "status"]]
        return
    end = one.end()
    components = len(end)
    states = study.reference[0][:, :components].astype(float)
    size = np.abs(states).max(axis=0)
    # Errors at the end are over the size that the reference says; what it is off by there counts.
    off = float(np.max(np.abs(states[-1] - end) / np.where(size > 0, size, 1)))
    for row in frame.to_dict("records"):
        if row["known"]:
            assert off < max(0.5 * row["error"], RESOLVED), (row["solver"], row["error"], off)
            checked += 1
        if row["status"] == "reached_end":
            assert row["error"] < 1 or np.isnan(row["error"])
            assert apart_of(study, row, end) <= 0.1, (row["solver"], row["tolerance"])
    assert checked, frame[["solver", "status", "error", "uncertainty", "message"]]


def apart_of(study, row, end):
    """How far a row's end is from the exact one, over the size of the state."""
    from polhode.solvers.solve import solve

    run = solve(study.problem, row["solver"], row["tolerance"], study.times, atol=row["atol"])
    states = run.states[:, : len(end)]
    return np.max(np.abs(states[-1] - end)) / max(np.abs(states).max(), np.abs(end).max())
