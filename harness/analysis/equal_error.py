"""A work-precision study of a problem at equal error: seconds, and the best of each library.

`polhode.WorkPrecision` makes the frames. They have a row for each solver and tolerance, with
columns "solver", "error", "uncertainty", the one of its reference, "seconds" and "family", the
solver's library.
"""

from itertools import chain

import numpy as np
import pandas as pd

from polhode.harness.analysis.frames import where
from polhode.harness.analysis.pareto import cost, front
from polhode.harness.references.uncertainty import least_known
from polhode.harness.studies.setups import FUNCTION

# Errors at which the solvers of a family are compared, from a loose to a tight one; an estimate.
STUDY_TARGETS = (1e-3, 1e-5, 1e-7, 1e-9)


def seconds_to(frame: pd.DataFrame, target: float) -> dict[str, float]:
    """Seconds that each solver takes to reach an error, of the solvers that do.

    Empty if the reference does not resolve the error.
    """
    # All rows have the same reference.
    uncertainty = frame["uncertainty"].dropna()
    if uncertainty.empty or target <= least_known(float(uncertainty.iloc[0])):
        return {}
    times = {}
    for solver, rows in frame.groupby("solver", sort=False):
        points = front(rows.astype({"error": float, "seconds": float}), "error")
        seconds = cost(points, target)
        if np.isfinite(seconds):
            times[str(solver)] = seconds
    return times


def best_of_families(frame: pd.DataFrame) -> pd.DataFrame:
    """The rows of one solver of each family: the one that is its fastest at more of `STUDY_TARGETS` than any other.

    Each function that the user gives is a family of its own.
    """
    times_by_target = [seconds_to(frame, target) for target in STUDY_TARGETS]
    is_function = frame["family"] == FUNCTION
    families = frame["family"].where(~is_function, frame["solver"])
    best = []
    for _, rows in frame.groupby(families, sort=False):
        solvers = list(dict.fromkeys(rows["solver"]))
        wins = dict.fromkeys(solvers, 0)
        for times in times_by_target:
            reaching = [solver for solver in solvers if solver in times]
            if reaching:
                fastest = min(reaching, key=times.__getitem__)
                wins[fastest] += 1
        # The first one in the frame if several win as often.
        best.append(max(solvers, key=wins.__getitem__))
    return where(frame, frame["solver"].isin(best)).reset_index(drop=True)


def over_table(frame: pd.DataFrame, name: str, target: float) -> pd.DataFrame:
    """Seconds to an error against a parameter, the column `name`.

    A row for each value, and a column for each solver that reaches the error at some value; NaN
    where it does not.
    """
    rows = {value: seconds_to(runs, target) for value, runs in frame.groupby(name)}
    reaching = {*chain.from_iterable(rows.values())}
    solvers = [solver for solver in dict.fromkeys(frame["solver"]) if solver in reaching]
    return pd.DataFrame.from_dict(rows, orient="index", columns=None).reindex(columns=solvers)
