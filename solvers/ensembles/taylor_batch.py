"""Full forms for many particles at once: heyoka's Taylor integrator in SIMD lanes."""

from copy import deepcopy
from typing import Any

import numpy as np

from polhode.models.libraries import installed
from polhode.models.once import OncePerThread, once
from polhode.models.operations import ARRAYS
from polhode.models.problem import Factory, Problem
from polhode.solvers.compile import load_heyoka, parameter_array, traced_system
from polhode.solvers.contract import Status
from polhode.solvers.ensembles.one_by_one import run_one_by_one
from polhode.solvers.machine_code.program import REGISTERS

# A particle that needs more steps is recorded as failed: a stiff one, at small St, is no case for
# this method. An estimate: 1e7 steps take ten seconds or more.
_MOST_STEPS = 10_000_000
# Places in what heyoka's propagation of a batch returns: the states on the grid, shape (m, d, lanes);
# and in its result for a lane: how it ended.
_STATES = -1
_ENDED = 0


def run_batches(
    problem: Problem,
    starts: np.ndarray,
    times: np.ndarray,
    tolerance: float,
    own_parameters: np.ndarray | None = None,
    max_steps: int = _MOST_STEPS,
) -> tuple[np.ndarray, np.ndarray]:
    """Solve a problem from starts, shape (n, d): states, shape (m, n, d), and statuses.

    Particles may have parameters of their own, shape (n, p), in the order of the problem's; without heyoka
    they may not (ValueError).

    States of a particle that failed are NaN. Particles of like speed share a batch, so that no lane
    waits long for the others. The problem has no periodic components, whose angles would need
    wrapping; the times increase from 0 to the end; the tolerance is heyoka's `tol`. A particle that
    needs more than `max_steps` steps has failed. Without heyoka the particles run by `run_one_by_one`,
    with its own limit of steps.
    """
    if not installed("heyoka"):
        if own_parameters is not None:
            raise ValueError("own_parameters: got an array without heyoka, expected None")
        states, statuses = run_one_by_one(problem, starts, times, tolerance)
        states[:, statuses != str(Status.REACHED_END)] = np.nan
        return states, statuses
    parameters = parameter_array(problem)[:, None] if own_parameters is None else own_parameters.T
    integrator = _integrator(problem.field, problem.dimension, len(parameters), tolerance)
    lanes = integrator.batch_size
    of_all = np.broadcast_to(parameters, (len(parameters), len(starts)))
    grid = np.repeat(times[:, None], lanes, axis=1)
    # A particle's rows lie together, as they are read.
    states = np.empty((len(starts), len(times), starts.shape[1])).swapaxes(0, 1)
    statuses = np.empty(len(starts), dtype=object)
    order = np.argsort(_speed(problem, starts, parameters), kind="stable")
    for first in range(0, len(order), lanes):
        together = order[first : first + lanes]
        in_lanes = np.resize(together, lanes)
        integrator.pars[:] = of_all[:, in_lanes]
        rows = _propagate(integrator, starts[in_lanes], grid, max_steps)
        if np.array_equal(integrator.time, grid[-1]) and np.isfinite(rows[-1]).all():
            states[:, together] = rows[:, : len(together)]
            statuses[together] = str(Status.REACHED_END)
            continue
        # One particle's failure stops its whole batch: each of them gets a run of its own.
        # It fills all lanes, of which the first one counts.
        for particle in together:
            alone = np.tile(starts[particle], (lanes, 1))
            integrator.pars[:] = of_all[:, [particle]]
            states[:, particle] = _propagate(integrator, alone, grid, max_steps)[:, 0]
            first_lane = integrator.propagate_res[0]
            statuses[particle] = _status(first_lane[_ENDED])
    states[:, statuses != str(Status.REACHED_END)] = np.nan
    return states, statuses


def _propagate(integrator: Any, starts: np.ndarray, grid: np.ndarray, max_steps: int) -> np.ndarray:
    """States, shape (m, lanes, d), of one batch from starts, shape (lanes, d), on a grid, shape (m, lanes)."""
    integrator.set_time(0.0)
    integrator.state[:] = starts.T
    states = integrator.propagate_grid(grid, max_steps=max_steps)[_STATES]
    return np.moveaxis(states, 2, 1)


def _speed(problem: Problem, starts: np.ndarray, parameters: np.ndarray) -> np.ndarray:
    """Square of the state's rate of change at each start, shape (n,): batches are sorted by it."""
    with np.errstate(all="ignore"):
        rates = problem.field(ARRAYS)(starts.T, parameters)
        return sum((np.square(rate) for rate in rates), start=np.zeros(len(starts)))


def _status(outcome: Any) -> str:
    """The status that heyoka's outcome stands for.

    A run ends at its last time, at the limit of steps, or where its state is not finite; heyoka's other
    outcomes need events or a limit that is not set here. Should one appear, it counts as a failed step.
    """
    outcomes = load_heyoka().taylor_outcome
    statuses = {
        outcomes.time_limit: "REACHED_END",
        outcomes.step_limit: "STEP_LIMIT",
        outcomes.err_nf_state: "NON_FINITE",
    }
    return str(Status[statuses.get(outcome, "STEP_UNDERFLOW")])


@OncePerThread
def _integrator(*key: Any) -> Any:
    """A copy of an integrator for this thread, arguments as of `_compiled`."""
    return deepcopy(_compiled(*key))


@once()
def _compiled(factory: Factory, dimension: int, parameters: int, tolerance: float) -> Any:
    """heyoka's integrator of a field, for as many particles at once as `REGISTERS` registers hold."""
    heyoka = load_heyoka()
    lanes = REGISTERS * heyoka.recommended_simd_size()
    system = traced_system(factory, dimension, parameters)
    return heyoka.taylor_adaptive_batch(system, np.zeros((dimension, lanes)), tol=tolerance)
