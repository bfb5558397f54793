"""What `solve` costs over the bare library call: both run in turns, each with everything ready.

The bare call is the shortest that a user of the library would write for the same rows with the same callbacks:
`propagate_grid`, `solve_ivp(…, t_eval=…)`, ``CVODE(…).solve(times, …)``, CyRK's C entry, the closed form itself.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import inf, pi
from time import perf_counter
from typing import Any

import numpy as np

from polhode.harness.common.timing import collector_off
from polhode.models.catalogue import form
from polhode.models.problem import Problem
from polhode.models.scene import EulerStart, Scene
from polhode.models.shape import Ellipsoid
from polhode.solvers.catalogue import SOLVERS
from polhode.solvers.catalogue import solver as find_solver
from polhode.solvers.compile import c_callback, parameter_array
from polhode.solvers.contract import Record, Settings, Solver
from polhode.solvers.cyrk import Call, CyrkSolver, method_number
from polhode.solvers.exact import Exact
from polhode.solvers.scipy_ivp import ScipySolver
from polhode.solvers.solve import solve
from polhode.solvers.sundials import SundialsSolver
from polhode.solvers.taylor import Taylor, taylor_integrator

# What is allowed: a share of the bare call or a time in seconds, whichever is more.
ALLOWED_SHARE = 0.05
ALLOWED_SECONDS = 50e-6

Bare = Callable[[], object]
Make = Callable[[Any, Problem, Settings, np.ndarray], Bare]


@dataclass(frozen=True)
class Overhead:
    """Minima, in seconds, of a bare library call and of `solve` for the same rows."""

    solver: str
    bare: float
    solve: float

    @property
    def seconds(self) -> float:
        """What `solve` costs on top."""
        return self.solve - self.bare

    @property
    def allowed(self) -> bool:
        """Whether that is at most 5 % or 50 µs."""
        return self.seconds <= max(ALLOWED_SHARE * self.bare, ALLOWED_SECONDS)


def paper_problem() -> Problem:
    """The paper's ellipsoid at St = 1e3, 500 units of time, quaternion form."""
    start = EulerStart((pi / 3, pi / 6, 0.0), (1.0, 1.0, -1.0))
    return form("quaternion").problem(Scene(Ellipsoid((1.0, 0.8, 0.5)), 1e3, start, 500.0))


def bare_call(method: Solver, problem: Problem, settings: Settings, times: np.ndarray) -> Bare:
    """The library's own call for the rows that `solve` gives, everything prepared; ValueError if none is known."""
    make = _maker(method)
    if make is None:
        raise ValueError(f"solver {method.name!r}: no bare call is known, expected one of the catalogue's")
    return make(method, problem, settings, times)


def has_bare_call(method: Solver) -> bool:
    """Whether the library's own call is known: by its class, since a library can be called in many ways."""
    return _maker(method) is not None


def _maker(method: Solver) -> Make | None:
    return next((make for base, make in _BARE.items() if isinstance(method, base)), None)


def measure(
    problem: Problem,
    tolerance: float = 1e-8,
    solvers: tuple[str, ...] = tuple(name for name in SOLVERS if name != "exact"),
    samples: int = 201,
    seconds: float = 1.0,
) -> list[Overhead]:
    """Measure the overhead of solvers, about `seconds` for each: bare call and `solve` in turns, the minimum of each.

    Solvers that are not installed, or whose bare call is not known, are left out.
    """
    times = np.linspace(0.0, problem.end, samples)
    table = []
    for name in solvers:
        method = find_solver(name)
        if not (method.available and has_bare_call(method)):
            continue
        bare = bare_call(method, problem, method.settings(tolerance), times)
        best = [inf, inf]
        calls: tuple[Bare, Bare] = (bare, lambda name=name: solve(problem, name, tolerance, times))
        for call in calls:
            call()
        with collector_off():
            end = perf_counter() + seconds
            while perf_counter() < end or best[1] == inf:
                for i, call in enumerate(calls):
                    began = perf_counter()
                    call()
                    best[i] = min(best[i], perf_counter() - began)
        table.append(Overhead(name, *best))
    return table


def _scipy(method: Any, problem: Problem, settings: Settings, times: np.ndarray) -> Bare:
    from scipy.integrate import solve_ivp

    fun, options = method.bind(problem, settings)
    start, span = np.array(problem.start), (times[0], times[-1])
    return lambda: solve_ivp(fun, span, start, method.method, times, **options)


def _sundials(method: Any, problem: Problem, settings: Settings, times: np.ndarray) -> Bare:
    library, start = method.bind(problem, settings, None)
    begin = start(Record(times, np.array([problem.start])))
    return lambda: library.solve(times, *begin)


def _heyoka(method: Any, problem: Problem, settings: Settings, times: np.ndarray) -> Bare:
    parameters = parameter_array(problem)
    integrator = taylor_integrator(problem.field, problem.dimension, len(parameters), settings.tolerance)
    start = np.array(problem.start)

    def call() -> object:
        integrator.time = 0.0
        integrator.state[:], integrator.pars[:] = start, parameters
        return integrator.propagate_grid(times)

    return call


def _cyrk(method: Any, problem: Problem, settings: Settings, times: np.ndarray) -> Bare:
    parameters = parameter_array(problem)
    address = c_callback(problem.field, problem.dimension, len(parameters)).address
    call = Call(address, method_number(method.method), parameters, settings.tolerance)
    start, end, wanted = np.array(problem.start), float(times[-1]), times[1:]

    def bare() -> None:
        call.library.c_free(call(0.0, end, start, wanted, 10**9))

    return bare


def _closed_form(method: Any, problem: Problem, settings: Settings, times: np.ndarray) -> Bare:
    assert problem.closed_form is not None
    closed_form = problem.closed_form
    return lambda: closed_form(times)


_BARE: dict[type[Solver], Make] = {
    ScipySolver: _scipy,
    SundialsSolver: _sundials,
    Taylor: _heyoka,
    CyrkSolver: _cyrk,
    Exact: _closed_form,
}
