"""Times of a work-precision study's solvers to an error, the best solver of a library, both over a parameter.

`polhode.WorkPrecision` makes the frames. They have a row for each solver and tolerance, with "error", the
"uncertainty" of its reference, "seconds" and "family", the library.
"""

from itertools import chain

import numpy as np
import pandas as pd

from polhode.harness.analysis.frames import where
from polhode.harness.analysis.pareto import cost, front
from polhode.harness.references.uncertainty import least_known
from polhode.harness.studies.setups import FUNCTION

# Errors at which solvers are compared, from a loose to a tight one; an estimate.
STUDY_TARGETS = (1e-3, 1e-5, 1e-7, 1e-9)


def seconds_to(frame: pd.DataFrame, target: float) -> dict[str, float]:
    """Seconds that each solver takes to an error, if it reaches it; none where the reference does not resolve it."""
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
    """The rows of one solver of each family: the one that is the fastest at most of `STUDY_TARGETS`.

    A function that the user gives is a family of its own.
    """
    reached = {target: seconds_to(frame, target) for target in STUDY_TARGETS}
    kept = []
    functions = frame["family"] == FUNCTION
    families = frame["family"].where(~functions, frame["solver"])
    for _, rows in frame.groupby(families, sort=False):
        names = list(dict.fromkeys(rows["solver"]))
        wins = dict.fromkeys(names, 0)
        for times in reached.values():
            family_times = {name: times[name] for name in names if name in times}
            if family_times:
                wins[min(family_times, key=family_times.__getitem__)] += 1
        kept.append(max(names, key=wins.__getitem__))
    return where(frame, frame["solver"].isin(kept)).reset_index(drop=True)


def over_table(frame: pd.DataFrame, name: str, target: float) -> pd.DataFrame:
    """Seconds to an error: a row for each value of a parameter, a column for each solver that gets there."""
    rows = {value: seconds_to(runs, target) for value, runs in frame.groupby(name)}
    # Names of the solvers that reach the error at some value.
    reaching = {*chain.from_iterable(rows.values())}
    solvers = [solver for solver in dict.fromkeys(frame["solver"]) if solver in reaching]
    return pd.DataFrame.from_dict(rows, orient="index", columns=None).reindex(columns=solvers)
