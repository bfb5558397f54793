"""Every status, provoked for real."""

import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from math import pi
from time import perf_counter

import numpy as np
import pytest

from oracle.accepting import accepting
from oracle.runs import SCENES, Run
from polhode.models.operations import Field, Operations
from polhode.models.problem import Factory, Problem
from polhode.solvers import contract
from polhode.solvers.catalogue import solver
from polhode.solvers.contract import (
    Integrator,
    Outcome,
    Record,
    Settings,
    Solver,
    SolverNotValidError,
    Status,
)
from polhode.solvers.solve import solve
from polhode.solvers.sundials.methods import CvodeBdf, Ida
from polhode.solvers.taylor import taylor_integrator

pytestmark = pytest.mark.usefixtures("quickly_compiled")


class CvodeCallback(CvodeBdf):
    """Where SUNDIALS' C libraries are not found."""

    backends = ("numba", "python")


class IdaCallback(Ida):
    """Where SUNDIALS' C libraries are not found."""

    backends = ("numba", "python")


RUN = Run("triaxial", "quaternion")
INTEGRATORS = accepting(RUN.problem)
WAYS = [
    *INTEGRATORS,
    *(pytest.param(one(), id=one.__name__) for one in (CvodeCallback, IdaCallback)),
]


def square_field(ops: Operations) -> Field:
    def rhs(y, p):
        return (y[0] * y[0],)

    return rhs


def root_field(ops: Operations) -> Field:
    return lambda y, p: (ops.sqrt(y[0]),)


def inverse_field(ops: Operations) -> Field:
    return lambda y, p: (1.0 / y[0],)


def sudden_field(ops: Operations) -> Field:
    return lambda y, p: (1.0 + ops.exp(1e4 * (y[0] - 1.0)),)


def ending_field(ops: Operations) -> Field:
    """Falls through 0, below which it is no number."""
    return lambda y, p: (-ops.sqrt(y[0]) - 0.1,)


def exploding_field(ops: Operations) -> Field:
    return lambda y, p: (ops.exp(y[0]),)


def growth_field(ops: Operations) -> Field:
    def rhs(y, p):
        return (1.0 * y[0],)

    return rhs


def turning_field(ops: Operations) -> Field:
    cos = ops.cos

    def rhs(y, p):
        return (1.0 + 0.0 * y[0], cos(y[0]))

    return rhs


# An angle that is wrapped every 100 pi, and its sine.
TURNS = Problem("turns", turning_field, (0.0, 0.0), 700.0, periodic=(0,))
# y = 1/(1 - t) is infinite at t = 1, y = 1e248 exp(t) exceeds double precision at t = 138.7.
BLOW_UP = Problem("blow-up", square_field, (1.0,), 2.0)
GROWTH = Problem("growth", growth_field, (1e248,), 200.0)


def assert_finished_rows(solution, exact):
    """Rows are those of the requested times up to the failure, and right."""
    assert len(solution.states) == len(solution.times) >= 1
    assert np.all(np.isfinite(solution.states))
    assert solution.states[:, 0] == pytest.approx(exact(solution.times), rel=1e-2)


@pytest.mark.parametrize("name", WAYS)
def test_blow_up_in_finite_time(name: str | Solver):
    times = np.linspace(0.0, 2.0, 21)
    solution = solve(BLOW_UP, name, 1e-6, times)
    assert solution.status in (Status.STEP_UNDERFLOW, Status.NON_FINITE)
    assert (solution.status is Status.NON_FINITE) == (name == "taylor")
    assert len(solution.times) in (10, 11)
    assert_finished_rows(
        replace(solution, times=times[:9], states=solution.states[:9]), lambda t: 1 / (1 - t)
    )


@pytest.mark.parametrize("name", WAYS)
def test_growth_beyond_double_precision(name: str | Solver):
    solution = solve(GROWTH, name, 1e-7, np.linspace(0.0, 200.0, 21))
    assert solution.status in (Status.STEP_UNDERFLOW, Status.NON_FINITE)
    assert len(solution.times) == 14
    assert_finished_rows(solution, lambda t: 1e248 * np.exp(t))


@pytest.mark.parametrize("field", [ending_field, exploding_field])
@pytest.mark.parametrize("name", WAYS)
def test_where_a_field_ends_so_does_the_run(name: str | Solver, field: Factory):
    """CVODE and IDA take rates that are no numbers for zeros, and CVODE has no end of a step of length 0."""
    solution = solve(Problem("end", field, (1.0,), 3.0), name, 1e-6, max_seconds=10.0)
    assert solution.status in (Status.STEP_UNDERFLOW, Status.NON_FINITE)


class OutsideTableError(ValueError):
    """What a field of a user's own may raise."""


@pytest.mark.parametrize(
    ("field", "start"), [(root_field, -1.0), (inverse_field, 0.0), (growth_field, np.nan)]
)
@pytest.mark.parametrize("name", WAYS)
def test_rates_that_are_no_numbers_end_a_run_at_its_start(
    name: str | Solver, field: Factory, start: float
):
    """SciPy's explicit methods would look for a first step without end."""
    for backend in solver(name).backends:
        solution = solve(Problem("start", field, (start,), 1.0), name, 1e-6, backend=backend)
        assert (solution.status, len(solution.times)) == (Status.NON_FINITE, np.isfinite(start)), (
            backend
        )


@pytest.mark.parametrize("name", ["dop853", "radau", "lsoda", *WAYS[-2:]])
def test_a_number_too_large_for_plain_python_is_no_crash(name: str | Solver):
    """Steps of y = t lead beyond y = 1, where Python's exp raises."""
    solution = solve(Problem("sudden", sudden_field, (0.0,), 2.0), name, 1e-6, backend="python")
    assert solution.status in (Status.STEP_UNDERFLOW, Status.NON_FINITE)


def test_an_error_of_the_field_is_not_a_state_that_is_not_finite():
    def field(ops):
        def rates(y, p):
            if isinstance(y[0], float) and y[0] > 0.5:
                raise OutsideTableError("beyond the table")
            return (0.0 * y[0] + 1.0,)

        return rates

    for name in ("dop853", "radau", "lsoda"):
        solution = solve(Problem("table", field, (0.0,), 1.0), name, 1e-6, backend="python")
        assert solution.status is Status.CRASHED
        assert "OutsideTableError: beyond the table (" in solution.message


@pytest.mark.parametrize("name", WAYS)
def test_step_limit_keeps_the_rows_before_it(name: str | Solver):
    full = solve(RUN.problem, name, 1e-6, RUN.times, count=True)
    solution = solve(RUN.problem, name, 1e-6, RUN.times, max_steps=20)
    assert solution.status is Status.STEP_LIMIT
    assert solution.work.steps == 20
    assert 1 <= len(solution.times) < len(RUN.times)
    # A closer end makes a first step of its own; rows are the same to the tolerance.
    assert np.abs(solution.states - full.states[: len(solution.states)]).max() < 1e-3


@pytest.mark.parametrize("name", WAYS)
def test_messages_count_the_steps_of_all_segments(name: str | Solver):
    times = np.linspace(0.0, TURNS.end, 701)
    steps = solve(TURNS, name, 1e-4, times, count=True).work.steps
    assert steps is not None
    limit = 7 * steps // 10
    solution = solve(TURNS, name, 1e-4, times, max_steps=limit)
    assert solution.status is Status.STEP_LIMIT
    assert solution.times[-1] > 100 * pi, "beyond the first segment"
    assert (solution.work.steps, solution.message) == (limit, f"{limit} steps")


@pytest.mark.usefixtures("processor_clock")
@pytest.mark.parametrize("name", WAYS)
def test_time_limit_keeps_the_rows_before_it(name: str | Solver):
    long = replace(RUN.problem, end=1e7)
    times = np.concatenate([[0.0, 1.0], np.linspace(1e3, 1e7, 1000)])
    solve(RUN.problem, name, 1e-9)
    solution = solve(long, name, 1e-9, times, max_seconds=0.1)
    assert solution.status is Status.TIME_LIMIT
    assert 0.1 <= solution.seconds < 1.0
    assert 2 <= len(solution.times) < len(times)
    assert solution.times[1] == 1.0
    assert solution.states[1] == pytest.approx(
        solve(replace(long, end=1.0), name, 1e-9).states[-1], abs=1e-6
    )


@pytest.mark.parametrize("name", [*WAYS[-2:], "cvode-adams", "cvode-bdf", "ida"])
def test_sundials_refuses_a_tolerance_below_roundoff(name: str | Solver):
    solution = solve(RUN.problem, name, 1e-17, RUN.times)
    assert solution.status is Status.TOLERANCE_UNATTAINABLE
    assert len(solution.times) == 1


@pytest.mark.parametrize("name", INTEGRATORS)
def test_absent_library(name: str, monkeypatch):
    library = solver(name).library
    monkeypatch.setattr(contract, "installed", lambda other: other != library)
    solution = solve(RUN.problem, name, 1e-6)
    assert solution.status is Status.ADAPTER_MISSING
    assert "pip install" in solution.message
    assert solution.times.tolist() == [0.0]


@pytest.mark.parametrize(
    "name",
    [
        name
        for name in INTEGRATORS
        if "exact" in solver(name).jacobians and "python" in solver(name).backends
    ],
)
def test_without_a_compiler_jacobians_are_differences(name: str, monkeypatch):
    monkeypatch.setattr(contract, "installed", lambda library: library != "llvmlite")
    solution = solve(RUN.problem, name, 1e-6)
    assert solution.success
    assert solution.settings.jacobian == "difference"
    with pytest.raises(SolverNotValidError, match="pip install llvmlite"):
        solve(RUN.problem, name, 1e-6, jacobian="exact")


@pytest.mark.parametrize("name", ["dop853", "cvode-bdf", "ida"])
def test_without_a_compiler_the_field_is_plain_python(name: str, monkeypatch):
    monkeypatch.setattr(contract, "installed", lambda library: library != "llvmlite")
    assert solve(RUN.problem, name, 1e-6).settings.backend == "python"


def test_the_other_solvers_work_without_the_optional_libraries():
    """In a fresh process in which nothing but NumPy and SciPy can be imported."""
    program = """
import sys
for absent in ("heyoka", "llvmlite", "numba", "CyRK", "sksundae"):
    sys.modules[absent] = None
from polhode.models.problem import Problem
from polhode.solvers.catalogue import SOLVERS
from polhode.solvers.solve import solve
def field(ops):
    return lambda y, p: (-1.0 * y[0],)
problem = Problem("decay", field, (1.0,), 1.0)
statuses = {name: solve(problem, name, 1e-6).status.value for name in SOLVERS if name != "exact"}
print(sorted(name for name, status in statuses.items() if status == "reached_end"))
print(sorted(set(statuses.values())))
"""
    output = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    ).stdout
    assert output.splitlines() == [
        "['bdf', 'dop853', 'lsoda', 'radau', 'rk45']",
        "['adapter_missing', 'reached_end']",
    ]


class Liar(Solver):
    """Claims success, whatever it did."""

    name, summary, accepts = "liar", "", ""
    library = package = "numpy"
    error_constant = 0.0

    def __init__(self, rows: int, steps: int, states: np.ndarray):
        self.rows, self.steps, self.states = rows, steps, states

    def prepare(self, problem: Problem, settings: Settings) -> Integrator:
        def integrate(record: Record) -> Outcome:
            record.put(self.states[1 : self.rows])
            record.work.steps = self.steps
            return Status.REACHED_END, ""

        return integrate


@pytest.mark.parametrize(
    ("rows", "steps", "spoil", "status", "message"),
    [
        (41, 30, 1.0, Status.REACHED_END, ""),
        (30, 30, 1.0, Status.FALSE_SUCCESS, "stopped at t ="),
        (1, 30, 1.0, Status.FALSE_SUCCESS, "stopped at t = 0.0"),
        (41, 2, 1.0, Status.FALSE_SUCCESS, "after 2 steps, expected at least 12"),
        (41, 30, 1.01, Status.FALSE_SUCCESS, "invariant is broken by 2.0e-02"),
        (41, 30, np.nan, Status.NON_FINITE, "not finite at t ="),
    ],
)
def test_false_success(rows, steps, spoil, status, message):
    states = solve(RUN.problem, "cyrk-vern8", 1e-12, RUN.times).states.copy()
    states[35, :4] *= spoil
    problem = replace(RUN.problem, least_steps=12)
    solution = solve(problem, Liar(rows, steps, states), 1e-9, RUN.times)
    assert solution.status is status
    assert message in solution.message
    assert solution.success == (status is Status.REACHED_END)


class Breaker(Liar):
    """Says that it filled so many rows, and raises in two lines."""

    def prepare(self, problem: Problem, settings: Settings) -> Integrator:
        def integrate(record: Record) -> Outcome:
            record.filled = self.rows
            raise RuntimeError("one\nand another")

        return integrate


@pytest.mark.parametrize(
    ("rows", "message"),
    [(rows, f"filled {rows} rows, expected 1 to 41") for rows in (-1, 0, 42, 10**6)]
    + [(1, "raised RuntimeError: one and another (")],
)
def test_a_solver_that_breaks_its_contract_has_crashed_in_one_line(rows: int, message: str):
    solution = solve(RUN.problem, Breaker(rows, 1, np.empty(0)), 1e-9, RUN.times)
    assert (solution.status, solution.times.tolist()) == (Status.CRASHED, [0.0])
    assert solution.message.startswith(f"solver 'liar' {message}")


@pytest.mark.parametrize(
    ("steps", "factor", "good"),
    [
        (30, 1.25, False),
        (5000, 1.25, True),
        (None, 1.25, False),
        (5000, 3.0, False),
        (50_000, 3.0, False),
    ],
)
def test_at_a_loose_tolerance_a_norm_may_drift_step_by_step(steps, factor, good):
    status = Status.REACHED_END if good else Status.FALSE_SUCCESS
    states = solve(RUN.problem, "cyrk-vern8", 1e-12, RUN.times).states.copy()
    states[35, :4] *= factor
    assert solve(RUN.problem, Liar(41, steps, states), 1e-4, RUN.times).status is status


@pytest.mark.parametrize(("problem", "limit"), [(BLOW_UP, 10**9), (RUN.problem, 2)])
def test_two_failed_taylor_runs_do_not_agree(problem: Problem, limit: int):
    """heyoka reports err_nf_state and step_limit as values, so that two failed runs would differ by nothing."""
    times = np.linspace(0.0, problem.end, 5)
    loose, tight = (
        solve(problem, "taylor", tolerance, times, max_steps=limit) for tolerance in (1e-6, 1e-12)
    )
    for solution in (loose, tight):
        assert not solution.success
        assert len(solution.states) == len(solution.times) < len(times)
        assert np.all(np.isfinite(solution.states))
    assert solve(BLOW_UP, "taylor", 1e-6, times).message == "taylor_outcome.err_nf_state"


@pytest.mark.parametrize("tolerance", [0.0, -1e-6, np.nan, np.inf])
def test_impossible_tolerances_are_refused(tolerance: float):
    with pytest.raises(ValueError, match="tolerance: got"):
        solve(RUN.problem, "taylor", tolerance)


@pytest.mark.parametrize(
    "times", [[0.0], [1.0, 2.0], [0.0, 1.0, 1.0], [0.0, np.nan], [0.0, np.inf], [[0.0, 1.0]]]
)
def test_impossible_times_are_refused(times):
    with pytest.raises(ValueError, match="times: got"):
        solve(RUN.problem, "taylor", 1e-6, np.array(times))


def test_every_status_explains_itself():
    assert all(len(status.meaning) > 20 for status in Status)
    assert [status for status in Status if status.success] == [Status.REACHED_END]


def test_a_limit_of_steps_holds_for_all_segments_of_a_run():
    """Angles are wrapped between segments; a limit met at the very end of one is no licence for the next."""
    from polhode.models.catalogue import form

    problem = replace(form("spheroid-angles").problem(SCENES["prolate"]), end=2000.0)
    times = np.linspace(0.0, problem.end, 401)
    assert (solve(problem, "taylor", 1e-9, times).work.steps or 0) > 1500
    for limit in (1, 100, 700, 701, 702):
        solution = solve(problem, "taylor", 1e-9, times, max_steps=limit)
        assert solution.status is Status.STEP_LIMIT
        assert solution.work.steps == limit


def test_threads_do_not_share_an_integrator_that_holds_a_state():
    given = growth_field, 1, 0, 1e-6
    with ThreadPoolExecutor(1) as pool:
        assert pool.submit(taylor_integrator, *given).result() is not taylor_integrator(*given)
    assert taylor_integrator(*given) is taylor_integrator(*given)


@pytest.mark.parametrize(
    ("left", "usual", "steps"), [(60.0, 1600, 1600), (0.01, 1600, 100), (-1.0, 10, 1)]
)
def test_a_deadline_is_looked_at_more_often_when_it_is_near(left: float, usual: int, steps: int):
    record = Record(np.zeros(2), np.zeros((2, 1)), deadline=perf_counter() + left)
    assert record.chunk(usual) == steps


def test_angles_of_many_turns_at_the_start_cost_no_accuracy():
    far = replace(TURNS, start=(2e5 * np.pi + 0.3, 0.0), end=20.0)
    near = replace(TURNS, start=(0.3, 0.0), end=20.0)
    for name in ("taylor", "cyrk-vern7"):
        one, other = (solve(problem, name, 1e-8).states[-1] for problem in (far, near))
        assert one[1] == pytest.approx(other[1], abs=1e-7)
