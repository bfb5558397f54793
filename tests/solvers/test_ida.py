"""IDA on the mass form: where the angular velocity is algebraic, and next to there."""

from dataclasses import replace

import numpy as np
import pytest

from oracle.first_principles import jeffery
from oracle.runs import SCENES, Run
from polhode.models.catalogue import FORMS, form
from polhode.models.form import FormNotValidError
from polhode.models.operations import Field, Operations
from polhode.models.problem import MassForm, Problem
from polhode.models.scene import Scene
from polhode.solvers.catalogue import SOLVERS, solver
from polhode.solvers.contract import SolverNotValidError, Status
from polhode.solvers.solve import solve

JEFFERY = Run("no-inertia", "jeffery")
NO_INERTIA = SCENES["no-inertia"]


def forms_without_inertia() -> list[str]:
    """Forms that keep the angular velocity at St = 0."""
    names = []
    for name in FORMS:
        try:
            problem = form(name).problem(NO_INERTIA)
        except FormNotValidError:
            continue
        if problem.parameters is None and problem.mass_form is not None:
            names.append(name)
    return names


@pytest.mark.parametrize("jacobian", ["exact", "difference"])
@pytest.mark.parametrize("backend", ["compiled", "numba", "python"])
@pytest.mark.parametrize("name", forms_without_inertia())
def test_ida_at_zero_inertia_follows_jeffery(name: str, backend, jacobian):
    run, times = Run("no-inertia", name), JEFFERY.times
    solution = solve(run.problem, "ida", 1e-10, times, backend=backend, jacobian=jacobian)
    assert solution.success
    rotation = form(name).observe(NO_INERTIA, solution.states).rotation
    expected = (
        form("jeffery")
        .observe(NO_INERTIA, solve(JEFFERY.problem, "cyrk-vern8", 1e-14, times).states)
        .rotation
    )
    known = ~np.isnan(rotation)
    assert known.any()
    assert np.abs(rotation - expected)[known].max() < 1e-6


def test_ida_computes_consistent_initial_values():
    """From a wrong angular velocity, which a form would never give."""
    problem = form("quaternion").problem(NO_INERTIA)
    wrong = replace(problem, start=(*problem.start[:4], 5.0, -3.0, 2.0))
    right, corrected = (solve(each, "ida", 1e-10, JEFFERY.times) for each in (problem, wrong))
    rotation = form("quaternion").observe(NO_INERTIA, right.states[:1]).rotation[0]
    assert corrected.states[0, 4:] == pytest.approx(
        jeffery(NO_INERTIA.ellipsoid.semi_axes, rotation), abs=1e-10
    )
    assert corrected.states[:, :4] == pytest.approx(right.states[:, :4], abs=1e-7)


def unsolvable(ops: Operations) -> Field:
    return lambda y, p: (1.0, y[1] * y[1] + 1.0)


@pytest.mark.parametrize("backend", ["compiled", "numba"])
def test_where_there_are_no_consistent_initial_values(backend):
    problem = Problem("unsolvable", unsolvable, (0.0, 0.5), 1.0, None, MassForm((1.0, 0.0), ()))
    solution = solve(problem, "ida", 1e-6, backend=backend)
    assert solution.status is Status.STEP_UNDERFLOW
    assert "no consistent initial values" in solution.message


@pytest.mark.parametrize("stokes", [1e-1, 1e-3, 1e-6])
def test_ida_at_small_inertia(stokes: float):
    scene = Scene(NO_INERTIA.ellipsoid, stokes, NO_INERTIA.start, 10.0)
    problem = form("quaternion").problem(scene)
    times = np.linspace(0.0, 10.0, 11)
    ida, radau = solve(problem, "ida", 1e-10, times), solve(problem, "cyrk-radau", 1e-12, times)
    assert ida.success
    assert radau.success
    assert np.abs(ida.states - radau.states)[1:].max() < 1e-6


def test_inertia_fades_out_linearly():
    """The state at St differs from that at St = 0 by O(St): the implicit form joins the two."""
    times = np.linspace(0.0, 10.0, 11)

    def orientation(stokes: float) -> np.ndarray:
        scene = Scene(NO_INERTIA.ellipsoid, stokes, NO_INERTIA.start, 10.0)
        return solve(form("quaternion").problem(scene), "ida", 1e-11, times).states[:, :4]

    limit = orientation(0.0)
    distances = [np.abs(orientation(stokes) - limit).max() for stokes in (1e-2, 1e-3, 1e-4)]
    slope = np.polyfit(np.log([1e-2, 1e-3, 1e-4]), np.log(distances), 1)[0]
    assert slope == pytest.approx(1, abs=0.05)


@pytest.mark.parametrize("name", [name for name in SOLVERS if name not in ("ida", "exact")])
def test_the_others_refuse_what_has_no_explicit_form(name: str):
    problem = form("quaternion").problem(NO_INERTIA)
    with pytest.raises(SolverNotValidError, match="use solver 'ida' or form 'jeffery'"):
        solve(problem, name, 1e-6)
    assert solver("ida").check(problem) is None


@pytest.mark.usefixtures("processor_clock")
def test_ida_keeps_its_rows_at_a_time_limit():
    problem = replace(form("quaternion").problem(NO_INERTIA), end=1e6)
    times = np.concatenate([[0.0, 1.0], np.linspace(10, 1e6, 100)])
    solution = solve(problem, "ida", 1e-10, times, max_seconds=0.1)
    assert solution.status is Status.TIME_LIMIT
    assert 2 <= len(solution.times) < len(times)
