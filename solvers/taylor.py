"""Taylor's method by heyoka: machine code, arbitrary order, dense output from the steps' own series."""

from collections.abc import Callable
from typing import Any, Literal

import numpy as np

from polhode.models.problem import Factory, Problem
from polhode.solvers.compile import KeptForThread, load_heyoka, parameter_array, traced_system
from polhode.solvers.contract import Integrator, Outcome, Record, Settings, Solver, Status

Precision = Literal["double", "long double", "quadruple"]

# Deadline and Ctrl-C are looked at once per this many steps.
CHUNK = 10_000


@KeptForThread
def taylor_integrator(
    factory: Factory,
    dimension: int,
    parameters: int,
    tolerance: float,
    precision: Precision = "double",
) -> Any:
    """heyoka's integrator of a field, kept for its thread; its state, time and parameters are set anew."""
    # Extended precisions are compiled in compact mode, which costs speed but saves up to half a
    # minute of compilation.
    heyoka = load_heyoka()
    number = {"double": float, "long double": np.longdouble, "quadruple": heyoka.real128}[precision]
    system, start = traced_system(factory, dimension, parameters), np.zeros(dimension, number)
    options = {"fp_type": number, "tol": number(tolerance), "compact_mode": precision != "double"}
    return heyoka.taylor_adaptive(system, start, **options)


def propagate(integrator: Any, record: Record) -> Outcome:
    """Propagate a heyoka integrator from the record's start over its times, in chunks of the same steps."""
    outcome = load_heyoka().taylor_outcome
    number, work = integrator.state.dtype, record.work
    steps, grid = 0, record.times.astype(number, copy=False)
    while True:
        result = integrator.propagate_grid(
            grid, max_steps=min(record.chunk(CHUNK), record.max_steps - steps)
        )
        reason, steps = result[0], steps + result[3]
        work.steps = steps
        rows = result[-1][1:]
        record.put(rows if reason != outcome.err_nf_state else rows[np.isfinite(rows).all(axis=1)])
        if reason == outcome.time_limit or record.filled == len(record.times):
            return Status.REACHED_END, ""
        if reason != outcome.step_limit:
            return (
                Status.NON_FINITE if reason == outcome.err_nf_state else Status.STEP_UNDERFLOW,
                str(reason),
            )
        if stopped := record.stopped:
            return stopped
        record.now = float(integrator.time)
        grid = np.concatenate([[integrator.time], record.times[record.filled :].astype(number)])


class Taylor(Solver):
    """Taylor's method of adaptive step; order about -ln(tolerance)/2 + 1, A-stable at no order.

    Tolerance: heyoka's `tol`, relative to the largest entry of the state, for truncation of the
    Taylor series in each step; there is no tolerance per component. On stiff problems the step is
    bound by stability. Source: Jorba and Zou, Experimental Mathematics 14 (2005) 99; Biscani and
    Izzo, MNRAS 504 (2021) 2614.
    """

    name = "taylor"
    summary = "Taylor's method of adaptive order and step (heyoka)"
    accepts = "every form with an explicit vector field"
    library = "heyoka"
    package = "heyoka"
    family = "heyoka"
    backends = ("compiled",)
    order_by_tolerance = True
    wears = 1.0
    error_constant = 20.0  # 6 measured

    def prepare(self, problem: Problem, settings: Settings) -> Integrator:
        parameters = parameter_array(problem)
        integrator = taylor_integrator(
            problem.field, problem.dimension, len(parameters), settings.tolerance
        )

        def integrate(record: Record) -> Outcome:
            integrator.time = record.times[0]
            integrator.state[:], integrator.pars[:] = record.start, parameters
            return propagate(integrator, record)

        return integrate

    def bare_call(
        self, problem: Problem, settings: Settings, times: np.ndarray
    ) -> Callable[[], object] | None:
        parameters, start = parameter_array(problem), np.array(problem.start)
        integrator = taylor_integrator(
            problem.field, problem.dimension, len(parameters), settings.tolerance
        )

        def call() -> object:
            integrator.time = 0.0
            integrator.state[:], integrator.pars[:] = start, parameters
            return integrator.propagate_grid(times)

        return call
