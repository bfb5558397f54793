"""CVODE and IDA through scikit-sundae: Python calls the field, the Jacobian and every step, over the very same steps.

Whatever a callback raises ends a run between two steps, with its rows kept. A step too small to advance the time is no
error to the library: it "will continue anyway". Here it is.
"""

import io
from contextlib import redirect_stdout
from typing import Any

import numpy as np

from polhode.models.problem import Problem
from polhode.solvers.compile import array_callback, exact_jacobian
from polhode.solvers.contract import UNLIMITED, Outcome, Record, Settings, Status
from polhode.solvers.sundials.library import FAILURES, posed

# Steps at one and the same time that make a stall.
STALLED = 1000


class Callbacks:
    """A problem bound to one of scikit-sundae's classes, ``CVODE`` or ``IDA``."""

    def __init__(self, library: type, problem: Problem, settings: Settings, **options: Any) -> None:
        self.implicit, self.calls = library.__name__ == "IDA", 0
        self.mass, values = posed(problem, self.implicit)
        callback, parameters = array_callback(problem, settings.backend, values)

        def field(t: float, y: np.ndarray, out: np.ndarray) -> None:
            self.calls += 1
            callback(y, parameters, out)

        def residual(t: float, y: np.ndarray, rates: np.ndarray, out: np.ndarray) -> None:
            field(t, y, out)
            np.subtract(self.mass * rates, out, out=out)

        if settings.jacobian == "exact":
            jacobian, diagonal = exact_jacobian(problem.field, problem.dimension, len(values)), np.diag(self.mass)

            def of_field(t: float, y: np.ndarray, rates: np.ndarray, out: np.ndarray) -> None:
                out[:] = jacobian(y, values)

            def of_residual(t: float, y: np.ndarray, rates: np.ndarray, r: Any, cj: float, out: np.ndarray) -> None:
                out[:] = cj * diagonal - jacobian(y, values)

            options["jacfn"] = of_residual if self.implicit else of_field
        algebraic = np.flatnonzero(self.mass == 0)
        if len(algebraic):
            options |= {"algebraic_idx": algebraic.tolist(), "calc_initcond": "yp0"}
        options |= {"rtol": settings.tolerance, "atol": settings.tolerance, "max_num_steps": UNLIMITED}
        self.rates = lambda y, out: callback(y, parameters, out)
        self.library = library(residual if self.implicit else field, **options)

    def start(self, record: Record) -> tuple[np.ndarray, ...]:
        """What a run starts from: the state, and IDA's rates besides."""
        if not self.implicit:
            return (record.start,)
        rates = np.empty(len(record.start))
        self.rates(record.start, rates)
        return record.start, np.divide(rates, self.mass, out=np.zeros(len(rates)), where=self.mass > 0)

    def run(self, record: Record) -> Outcome:
        """Fill the record's rows."""
        # The wrapper prints the library's errors, NumPy warns of what becomes infinite.
        with redirect_stdout(io.StringIO()), np.errstate(all="ignore"):
            try:
                record.rows[0] = self.library.init_step(record.times[0], *self.start(record)).y
            except RuntimeError as error:
                return Status.STEP_UNDERFLOW, f"no consistent initial values: {error}"
            return self._through(record)

    def _through(self, record: Record) -> Outcome:
        times, work, stalled = record.times, record.work, 0
        end, record.now, work.steps = float(times[-1]), float(times[0]), 0
        while True:
            # The first step is guessed from the first time wanted.
            result = self.library.step(end if work.steps else times[1], method="onestep", tstop=end)
            work.jacobians = result.njev
            if not result.success:
                return FAILURES.get(result.status, (Status.NON_FINITE,))[0], result.message
            # After an interpolation the library first hands back the step it has.
            stalled = 0 if result.t > record.now else stalled + 1
            if not stalled:
                work.steps, record.now = work.steps + 1, result.t
            if stalled > STALLED:
                return Status.STEP_UNDERFLOW, f"stalled at t = {record.now!r}"
            last = int(np.searchsorted(times, record.now, side="right"))
            for time in times[record.filled : last].tolist():
                record.put(self.library.step(time, tstop=end).y[None])
            if record.now >= end:
                return Status.REACHED_END, ""
            if work.steps >= record.max_steps:
                return Status.STEP_LIMIT, f"{work.steps} steps"
            if record.expired:
                return Status.TIME_LIMIT, f"after {work.steps} steps"
