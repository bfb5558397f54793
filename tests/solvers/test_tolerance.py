"""Every solver in every form, to its tolerance: the error falls with it, and stays below the stated constant."""

import numpy as np
import pytest

from oracle.runs import SLOW_TO_COMPILE, Run, runs
from polhode.solvers.catalogue import SOLVERS, solver
from polhode.solvers.contract import SolverNotValidError
from polhode.solvers.solve import solve

pytestmark = pytest.mark.usefixtures("quickly_compiled")

TOLERANCES = 10.0 ** -np.arange(4.0, 10.5)
# These take their time, and their compiled counterparts go all the way.
SHORTENED = ("radau", "bdf", "lsoda")
# Below this the reference's and double precision's own errors take part.
FLOOR = 2e-12


def tolerances_of(run: Run, name: str) -> np.ndarray:
    """All of them; three by Python's pace; two where heyoka compiles anew for each, but for two short fields."""
    if name == "taylor" and run.form not in ("quaternion", "jeffery"):
        # The longest field takes a second at low orders, twice that at higher ones.
        return TOLERANCES[:3:2] if run.form == SLOW_TO_COMPILE else TOLERANCES[:5:4]
    return TOLERANCES[:5:2] if name in SHORTENED else TOLERANCES


def waits(run: Run, name: str) -> bool:
    """Whether a case is for all tests alone: compilation of the longest field, which others make for other solvers."""
    return run.form == SLOW_TO_COMPILE and name in ("taylor", "ida")


def takes_too_long(run: Run, name: str) -> bool:
    """The longest scene by Python's pace, of a form that shorter ones have too."""
    return name in SHORTENED[:2] and run.scene == "triaxial" and run.form != "averaged"


@pytest.mark.parametrize(
    ("run", "name"),
    [
        pytest.param(run, name, id=f"{run}-{name}", marks=[pytest.mark.slow] * waits(run, name))
        for run in runs()
        for name in SOLVERS
        if name != "exact"
    ],
)
def test_error_follows_the_tolerance(run: Run, name: str):
    if takes_too_long(run, name):
        pytest.skip("the compiled counterpart does")
    try:
        solver(name).check(run.problem)
    except SolverNotValidError as refusal:
        pytest.skip(str(refusal))
    tolerances = tolerances_of(run, name)
    solutions = [solve(run.problem, name, float(tolerance), run.times) for tolerance in tolerances]
    assert all(solution.success for solution in solutions)
    errors = np.array([run.error(solution.states) for solution in solutions])
    # At tolerances at which a run takes the least steps that it ever takes its error stays the
    # same.
    own = np.append(np.abs(np.diff(np.log(errors + FLOOR))) > 1e-3, True)
    above = (errors > FLOOR) & own
    assert above.sum() >= min(4, len(tolerances))
    slope = np.polyfit(np.log(tolerances[above]), np.log(errors[above]), 1)[0]
    assert 0.7 <= slope <= 1.3
    worst = np.max(errors[above] / tolerances[above]) / run.rotations
    assert worst <= solver(name).error_constant


@pytest.mark.parametrize("run", runs(closed=True), ids=str)
def test_the_closed_form_meets_the_integrated_field(run: Run):
    solution = solve(run.problem, "exact", 1e-3, run.times)
    assert solution.success
    assert run.error(solution.states) < FLOOR * max(1.0, run.rotations)


def test_every_form_of_the_catalogue_takes_part():
    from polhode.models.catalogue import FORMS

    assert {run.form for run in runs()} == {*FORMS} - {"hybrid"}
