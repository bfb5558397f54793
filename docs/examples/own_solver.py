"""A solver of one's own: the classical Runge-Kutta method, compared with Taylor's on the paper's ellipsoid."""

import numpy as np

from polhode.models.catalogue import form
from polhode.models.problem import Problem
from polhode.models.scenes import named_scene
from polhode.solvers.compile import compiled_callback, parameter_array
from polhode.solvers.contract import Integrator, Outcome, Record, Settings, Solver, Status
from polhode.solvers.solve import solve


class ClassicalRungeKutta(Solver):
    """Explicit Runge-Kutta method of order 4 with a fixed step; stable for steps below 2.8 over the fastest rate.

    Tolerance: the fourth power of the step, so that the error follows it. Error per rotation over
    tolerance: at most 0.07; 0.023 measured. Not so in slow time, nor for angles near a pole: a
    fixed step does not adapt, so that this solver does not belong into the catalogue. Source:
    Hairer, Nørsett, Wanner, Solving Ordinary Differential Equations I, section II.1.
    """

    name = "classical-rk4"
    summary = "the classical Runge-Kutta method of fixed step"
    accepts = "every form with an explicit vector field"
    library = package = "llvmlite"
    backends = ("numba",)
    error_constant = 0.07

    def prepare(self, problem: Problem, settings: Settings) -> Integrator:
        """Bind the right-hand side."""
        p = parameter_array(problem)
        callback = compiled_callback(problem.field, problem.dimension, len(p))
        k1, k2, k3, k4 = np.empty((4, problem.dimension))
        largest_step = settings.tolerance**0.25

        def integrate(record: Record) -> Outcome:
            y, record.work.steps = record.start.copy(), 0
            for begin, end in zip(record.times[:-1], record.times[1:], strict=True):
                steps = max(1, round((end - begin) / largest_step))
                h = (end - begin) / steps
                for _ in range(steps):
                    if record.expired:
                        return Status.TIME_LIMIT, f"after {record.work.steps} steps"
                    callback(y, p, k1)
                    callback(y + h / 2 * k1, p, k2)
                    callback(y + h / 2 * k2, p, k3)
                    callback(y + h * k3, p, k4)
                    y = y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
                    record.work.steps += 1
                record.put(y[None])
            # Whoever calls the field counts, where it is asked for.
            record.work.rhs_calls = 4 * record.work.steps if settings.count else None
            return Status.REACHED_END, ""

        return integrate


if __name__ == "__main__":
    problem = form("quaternion").problem(named_scene("paper"))
    times = np.linspace(0, problem.end, 201)
    exact = solve(problem, "taylor", 1e-15, times)
    for step in (0.4, 0.2, 0.1):
        own = solve(problem, ClassicalRungeKutta(), step**4, times)
        error = np.max(np.abs(own.states - exact.states))
        print(
            f"step {step:4}: {own.status}, {own.work.steps} steps, {own.seconds:.2f} s, error {error:.1e}"
        )
