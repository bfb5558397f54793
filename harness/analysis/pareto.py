"""Speed at equal error: what a method takes for an error, interpolated between its own measured runs."""

from collections.abc import Iterable

import numpy as np
import pandas as pd

from polhode.harness.analysis.frames import where
from polhode.solvers.catalogue import solver as find_solver


def pareto_front(runs: pd.DataFrame, error: str = "slow_error") -> pd.DataFrame:
    """The runs that no other run beats in both time and error, from the fastest to the most accurate."""
    ordered = runs.sort_values(by=["seconds", error])
    return where(ordered, ordered[error].astype(float).cummin().diff().fillna(-1.0) < 0)


def time_at_error(runs: pd.DataFrame, target: float, error: str = "slow_error") -> float | None:
    """Wall time in s that one method takes for an error, by log-log interpolation along its Pareto front.

    Parameters
    ----------
    runs : DataFrame
        Records of one form and solver on one scene.
    target : float
    error : str
        Column of the error.

    Returns
    -------
    float or None
        None if no run is that accurate; the fastest run's time if every run is more accurate.
    """
    done = where(runs, (runs["status"] == "reached_end") & runs["seconds"].notna() & runs[error].notna())
    if done.empty:
        return None
    front = pareto_front(done, error)
    errors = np.maximum(front[error].to_numpy(float), np.finfo(float).tiny)
    seconds = front["seconds"].to_numpy(float)
    if errors[-1] > target:
        return None
    if errors[0] <= target:
        return float(seconds[0])
    return float(np.exp(np.interp(-np.log(target), -np.log(errors), np.log(seconds))))


def times_at_error(runs: pd.DataFrame, target: float, error: str = "slow_error") -> dict[tuple[str, str], float]:
    """Time at an error of every form and solver on one scene that reaches it, the fastest first."""
    found = {}
    for form in dict.fromkeys(runs["form"]):
        for solver in dict.fromkeys(runs["solver"]):
            own = where(runs, (runs["form"] == form) & (runs["solver"] == solver))
            seconds = time_at_error(own, target, error)
            if seconds is not None:
                found[form, solver] = seconds
    return dict(sorted(found.items(), key=lambda item: item[1]))


def fastest(
    times: dict[tuple[str, str], float], form: str, libraries: Iterable[str] = (), solvers: Iterable[str] = ()
) -> tuple[str, float] | None:
    """The fastest solver of a form among some libraries or solvers, and its time; None if there is none."""
    wanted, names = set(libraries), set(solvers)
    for (one, solver), seconds in times.items():
        if one == form and (find_solver(solver).family in wanted or solver in names):
            return solver, seconds
    return None


def crossing(runs: pd.DataFrame, form: str, first: str, second: str, error: str = "slow_error") -> float | None:
    """The largest error at which `second` stops being faster than `first` as the error falls; None if it never does."""
    grid = np.geomspace(1e-1, 1e-13, 121)
    ahead = None
    for target in grid:
        times = times_at_error(where(runs, runs["solver"].isin([first, second])), float(target), error)
        if (form, first) not in times:
            continue
        second_ahead = times.get((form, second), np.inf) < times[form, first]
        if ahead and not second_ahead:
            return float(target)
        ahead = second_ahead
    return None
