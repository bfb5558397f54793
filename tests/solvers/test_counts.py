"""Work is counted truly: right-hand sides by a field that counts itself, steps and rejections by other means."""

# pyright: reportOptionalOperand=false, reportOperatorIssue=false

from dataclasses import replace

import numpy as np
import pytest

from oracle.accepting import accepting
from oracle.classical import CLASSICAL
from polhode.models.operations import Field, Operations
from polhode.models.problem import Problem
from polhode.solvers.catalogue import SOLVERS, solver
from polhode.solvers.solve import solve

RIGID_BODY = CLASSICAL["rigid-body"].problem
VAN_DER_POL = CLASSICAL["stiff-van-der-pol"].problem
CALLS = [0]


def counting_field(ops: Operations) -> Field:
    """Rigid body that counts its evaluations, wherever plain Python evaluates it."""

    def rhs(y, p):
        CALLS[0] += 1
        return y[1] * y[2], -y[2] * y[0], -0.51 * y[0] * y[1]

    return rhs


COUNTING = Problem("counting", counting_field, RIGID_BODY.start, RIGID_BODY.end)
IN_PYTHON = [name for name in SOLVERS if "python" in solver(name).backends]
TIMES = np.linspace(0.0, 20.0, 33)


@pytest.mark.parametrize(
    ("name", "jacobian"),
    [(name, each) for name in IN_PYTHON for each in solver(name).jacobians or (None,)],
)
def test_calls_are_those_that_the_field_sees(name: str, jacobian):
    """With the exact Jacobian's tracing of the field done before."""
    solve(COUNTING, name, 1e-6, TIMES, backend="python", jacobian=jacobian)
    CALLS[0] = 0
    solution = solve(COUNTING, name, 1e-6, TIMES, backend="python", jacobian=jacobian, count=True)
    # IDA asks the field once for the rates at the start.
    assert solution.work.rhs_calls == CALLS[0] - (name == "ida")
    for backend in set(solver(name).backends) - {"python"}:
        other = solve(RIGID_BODY, name, 1e-6, TIMES, backend=backend, jacobian=jacobian, count=True)
        assert other.work.rhs_calls == pytest.approx(solution.work.rhs_calls, rel=0.02)


@pytest.mark.parametrize("name", ["dop853", "bdf", "radau", "lsoda"])
def test_compiled_solvers_call_as_often_as_the_same_method_of_scipy(name: str):
    """CyRK's methods are SciPy's in C++; only finite-difference Jacobians and the first step differ by a few calls."""
    jacobian = "difference" if solver(name).implicit else None
    ours = solve(RIGID_BODY, f"cyrk-{name}", 1e-7, TIMES, count=True).work
    theirs = solve(RIGID_BODY, name, 1e-7, TIMES, jacobian=jacobian, count=True).work
    assert ours.steps == theirs.steps
    assert ours.rhs_calls == pytest.approx(theirs.rhs_calls, rel=0.03)


@pytest.mark.parametrize(
    ("name", "stages"), [("cyrk-vern8", 13), ("cyrk-vern7", 10), ("cyrk-tsit5", 6)]
)
def test_calls_of_an_explicit_method_are_its_stages(name: str, stages: int):
    """Calls per step without interpolation, but for the start's two and an unknown number of rejections."""
    work = solve(RIGID_BODY, name, 1e-10, count=True).work
    assert work.rhs_calls is not None
    assert work.steps is not None
    assert stages <= (work.rhs_calls - 2) / work.steps < stages * 1.3


@pytest.mark.parametrize("name", [name for name in accepting(RIGID_BODY) if name != "taylor"])
def test_counting_changes_nothing(name: str):
    plain, counted = (solve(RIGID_BODY, name, 1e-6, TIMES, count=count) for count in (False, True))
    assert np.array_equal(plain.states, counted.states)
    assert plain.work.rhs_calls is None
    assert counted.work.rhs_calls > 0
    assert counted.work.steps > 0


@pytest.mark.parametrize("first_step", [None, 0.5])
@pytest.mark.parametrize("name", ["rk45", "dop853"])
def test_rejected_steps_are_those_that_scipy_takes_back(
    name: str, first_step: float | None, monkeypatch
):
    """Counted by wrapping SciPy's own attempt at a step."""
    import scipy.integrate._ivp.rk as rk

    attempts, attempt = [0], rk.rk_step

    def counted(*arguments):
        attempts[0] += 1
        return attempt(*arguments)

    monkeypatch.setattr(rk, "rk_step", counted)
    work = solve(RIGID_BODY, name, 1e-5, TIMES, first_step=first_step).work
    assert work.rejected == attempts[0] - work.steps > 0


@pytest.mark.parametrize("name", [name for name in IN_PYTHON if "exact" in solver(name).jacobians])
def test_finite_differences_cost_right_hand_sides(name: str):
    """More calls per step, by at least one and a half per Jacobian, of a problem of two components."""
    problem = replace(VAN_DER_POL, end=0.5)
    exact, difference = (
        solve(problem, name, 1e-6, jacobian=each, count=True) for each in ("exact", "difference")
    )
    assert exact.success
    assert difference.success
    assert difference.states[-1] == pytest.approx(exact.states[-1], abs=1e-3)
    assert difference.work.jacobians > 0
    extra = (
        difference.work.rhs_calls / difference.work.steps - exact.work.rhs_calls / exact.work.steps
    )
    assert extra > 1.5 * difference.work.jacobians / difference.work.steps


def test_counts_that_a_library_does_not_report_are_none():
    taylor = solve(RIGID_BODY, "taylor", 1e-6, count=True).work
    assert (taylor.rhs_calls, taylor.rejected, taylor.jacobians, taylor.factorizations) == (
        None,
    ) * 4
    cyrk = solve(RIGID_BODY, "cyrk-bdf", 1e-6).work
    assert (cyrk.rhs_calls, cyrk.rejected, cyrk.jacobians, cyrk.factorizations) == (None,) * 4
    cvode = solve(RIGID_BODY, "cvode-bdf", 1e-6, backend="numba").work
    assert (cvode.steps, cvode.rejected, cvode.factorizations) == (None,) * 3
