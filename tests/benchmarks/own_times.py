"""Are the times of `WorkPrecision` those of `solve`? Every solver, on three functions of one's own.

`python tests/benchmarks/own_times.py` prints the ratio of the two for each; on an idle machine all
lie within a tenth of 1.
"""

import sys
from functools import partial

import numpy as np

from polhode import Problem, WorkPrecision
from polhode.solvers.catalogue import SOLVERS, solver as find_solver
from polhode.solvers.compile import frozen
from polhode.solvers.solve import solve

# Relative: a usual one.
TOLERANCE = 1e-6
# Runs of which the fastest counts, as `WorkPrecision` takes it; more than its five, so that the time to be
# compared with is the surer one.
RUNS = 15
# Limit of a run, in seconds. Far more than any takes, but for solvers that are stuck.
MAX_SECONDS = 5.0
# Most and least ratio of the two times. On an idle machine all ratios lie between them.
TOO_SLOW = 1.1
TOO_FAST = 0.9
# A matrix of 50 rows: decay rates 1 to 50 on the diagonal, each component fed by the next one.
MATRIX = np.diag(-np.arange(1.0, 51.0)) + np.diag(np.ones(49), 1)


def brusselator(t, y):
    """Prigogine and Lefever's oscillator."""
    return 1 + y[0] ** 2 * y[1] - 4 * y[0], 3 * y[0] - y[0] ** 2 * y[1]


def lorenz(t, y):
    """Lorenz's equations."""
    x, y_, z = y
    return 10 * (y_ - x), x * (28 - z) - y_, x * y_ - 8 / 3 * z


def linear(t, y):
    """A matrix times the state."""
    return MATRIX @ y


# Starts and ends are made up: runs of some turns or decay times.
PROBLEMS = {
    "Brusselator": Problem.from_function(brusselator, [1.5, 3.0], 20.0),
    "Lorenz": Problem.from_function(lorenz, [1.0, 1.0, 1.0], 5.0),
    "A @ y, n = 50": Problem.from_function(linear, np.ones(50), 2.0),
}


def main() -> None:
    """Print the table; exit code 1 if a ratio is off by more than a tenth."""
    off = 0
    for name, problem in PROBLEMS.items():
        solvers = [solver for solver in SOLVERS if find_solver(solver).takes(problem)]
        study = WorkPrecision(problem, solvers, [TOLERANCE], max_seconds=MAX_SECONDS, quiet=True)
        frame = study.frame.set_index("solver")
        timed = frozen(problem)
        for solver in solvers:
            row = frame.loc[solver]
            if row["status"] != "reached_end":
                print(f"{name:15}{solver:20}{row['status']}")
                continue
            again = partial(solve, timed, solver, TOLERANCE, study.times, atol=row["atol"])
            seconds = min(again().seconds for _ in range(RUNS))
            ratio = row["seconds"] / seconds
            off += not TOO_FAST <= ratio <= TOO_SLOW
            print(f"{name:15}{solver:20}{1e6 * row['seconds']:10.0f} µs {ratio:6.2f}")
    print(f"{off} ratios beyond a tenth")
    sys.exit(off > 0)


if __name__ == "__main__":
    main()
