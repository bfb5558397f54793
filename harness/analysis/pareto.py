"""Speed at equal error: the time that a method takes to reach an error, and who is the fastest.

A method is a form by a solver; a run is a method at a tolerance. Frames have a row for each run.
Their columns are "form", "solver", "tolerance", "stokes", "status", "seconds", and errors with
uncertainties, such as "slow_error", the error of L and E over I_max, and "slow_uncertainty", of its
reference.

Two questions differ. `cheapest` asks which of the runs that were measured meets an error in the
least time. `cost` asks for the time to an error between two runs: it interpolates along the
method's Pareto front, the runs that no other run beats in both time and error.
"""

from collections.abc import Iterable, Iterator, Sequence
from typing import Any, Literal, NamedTuple

import numpy as np
import pandas as pd

from polhode.harness.analysis.frames import by_stokes, where
from polhode.harness.analysis.in_full import HYBRID
from polhode.harness.references.uncertainty import least_known, uncertainty_of
from polhode.models.catalogue import form as find_form
from polhode.solvers.catalogue import solver as find_solver
from polhode.solvers.contract import Status

# Kinds of methods. Full equations are solved by implicit or explicit solvers, or by tailored ones,
# which know that St is large; averaged equations by any.
Side = Literal["implicit", "explicit", "tailored", "averaged"]
# The family of the tailored solvers.
_TAILORED_FAMILY = "polhode"
# Errors of a page's tables of winners, from the loosest to the tightest: where averaging may win, each power
# of ten, below that every second one.
TARGETS = (1e-1, 1e-2, 1e-3, 1e-4, 1e-6, 1e-8, 1e-10)
# A time within this factor of the fastest ties with it. An estimate: two thirds of the 15 % are for the
# machine's noise. With twice the 15 % more cells of the map are ties.
TIE = 1.15
# A run counts on the front of all methods only if it lowers the error by this factor: less may be
# rounding. An estimate.
LEAST_GAIN = 2.0
# Shares of the values below the three quantiles that `cost_over_stokes` gives: the median, and what 90 % of the
# values lie between.
_QUANTILES = (0.05, 0.5, 0.95)


class Method(NamedTuple):
    """A form by a solver."""

    form: str
    solver: str

    def __str__(self) -> str:
        return f"{self.form}, {self.solver}"

    @property
    def side(self) -> Side:
        """The kind of method that it is."""
        if find_form(self.form).averaged:
            return "averaged"
        if self.form == HYBRID or find_solver(self.solver).family == _TAILORED_FAMILY:
            return "tailored"
        return "implicit" if find_solver(self.solver).implicit else "explicit"

    @property
    def label(self) -> str:
        """Its name on a map: the form's if the form averages, and else the solver's."""
        # Any solver will do for averaged equations.
        return self.form if self.side == "averaged" or self.form == HYBRID else self.solver


def methods(runs: pd.DataFrame) -> Iterator[tuple[Method, pd.DataFrame]]:
    """Methods in the order of their first runs, each with its runs."""
    groups: Any = runs.groupby(["form", "solver"], sort=False)
    for (form, solver), method_runs in groups:
        yield Method(str(form), str(solver)), method_runs


def pareto_front(runs: pd.DataFrame, error: str = "slow_error", gain: float = 1.0) -> pd.DataFrame:
    """The runs that no other run beats in both time and error, the fastest first.

    With a `gain` above 1 each has at most 1/gain of the error of the one before it.
    """
    return runs.iloc[_unbeaten(runs[[error, "seconds"]].to_numpy(float), gain)]


def _unbeaten(points: np.ndarray, gain: float) -> list[int]:
    """Rows of the points that no other point beats in both columns, the fastest first.

    `points` has columns error and time, shape (n, 2).
    """
    least = np.inf
    unbeaten = []
    # By time, and by error where times are equal. A point is kept if its error is below all before
    # it.
    for row in np.lexsort(points.T):
        error = points[row, 0]
        # A point of equal error is slower, and so beaten.
        is_lower = error < least if gain == 1.0 else error * gain <= least
        if is_lower:
            unbeaten.append(row)
            least = error
    return unbeaten


def front(runs: pd.DataFrame, error: str = "slow_error") -> np.ndarray:
    """Errors and times, shape (n, 2), along the Pareto front of the runs that reached their end.

    Times grow and errors fall from row to row.
    """
    points = runs[[error, "seconds"]].to_numpy(float, na_value=np.nan)
    reached = (runs["status"] == Status.REACHED_END).to_numpy(bool)
    points = points[reached & ~np.isnan(points).any(axis=1)]
    return points[_unbeaten(points, gain=1.0)]


def cost(points: np.ndarray, target: float) -> float:
    """Time, in seconds, at which a method reaches an error, from the points of its `front`.

    Between runs, log(time) is linear in log(error). A target looser than all runs
    takes the time of the fastest run. NaN if no run reaches the target.
    """
    if not len(points) or points[-1, 0] > target:
        return float("nan")
    if points[0, 0] <= target:
        return float(points[0, 1])
    # An error may be 0, which has no logarithm.
    errors = np.maximum(points[:, 0], np.finfo(float).tiny)
    # `interp` needs places that grow; errors fall along a front, so that their negative logarithms
    # grow.
    digits = -np.log(errors)
    return float(np.exp(np.interp(-np.log(target), digits, np.log(points[:, 1]))))


def costs(
    groups: Iterable[tuple[Any, pd.DataFrame]], targets: Sequence[float], error: str = "slow_error"
) -> pd.DataFrame:
    """Times at which methods reach errors, in seconds.

    Parameters
    ----------
    groups
        Pairs of a scene's name, or its St, and its runs.
    targets
        The errors.
    error
        The column of errors.

    Returns
    -------
    DataFrame
        A row for each pair of error and scene, and a column for each method. NaN where a method
        does not reach the error, or the reference does not resolve it.
    """
    rows = {}
    for name, runs in groups:
        needed: Any = runs[["form", "solver", "status", "seconds", error]]
        fronts = {method: front(method_runs, error) for method, method_runs in methods(needed)}
        limit = limit_of(runs, error)
        for target in targets:
            if target > limit:
                seconds = {method: cost(points, target) for method, points in fronts.items()}
            else:
                seconds = dict.fromkeys(fronts, np.nan)
            rows[target, name] = seconds
    return pd.DataFrame.from_dict(rows, orient="index")


def limit_of(runs: pd.DataFrame, error: str) -> float:
    """The least error that the reference of one scene's runs resolves.

    NaN, above which no error lies, where its uncertainty is unknown.
    """
    uncertainty = runs[uncertainty_of(error)].dropna()
    # All runs of a scene have the same reference.
    return least_known(float(uncertainty.iloc[0]) if len(uncertainty) else None)


def cheapest(
    runs: pd.DataFrame, target: float, error: str = "slow_error"
) -> tuple[dict[Any, Any], tuple[Method, ...]] | None:
    """The fastest run of one scene whose error is at most `target`, and the methods that tie.

    None if no run meets the error. A method ties by a run that meets the error and takes little
    longer than the fastest. Little is what `TIE` allows, or what repeats of one of the two runs vary
    by, whichever is more.
    """
    reached = runs["status"] == Status.REACHED_END
    good = where(runs, reached & (runs[error] <= target) & runs["seconds"].notna()).sort_values(
        by=["seconds"]
    )
    if good.empty:
        return None
    fastest = good.iloc[0]
    # How much longer than the fastest each run may take, in seconds.
    allowed = pd.Series((TIE - 1.0) * fastest["seconds"], good.index)
    if "seconds_spread" in good:
        spreads = good["seconds_spread"].fillna(0.0).clip(lower=fastest["seconds_spread"])
        allowed = spreads.clip(lower=(TIE - 1.0) * fastest["seconds"])
    ties = where(good, good["seconds"] <= fastest["seconds"] + allowed)
    # The first one is the fastest method itself.
    _, *tied_methods = [method for method, _ in methods(ties)]
    return fastest.to_dict(), tuple(tied_methods)


def averaged_wins_from(records: pd.DataFrame, target: float) -> float | None:
    """Smallest St from which on an averaged form is the cheapest at every St measured.

    None if it is not at the largest St.
    """
    # Forgotten at each St at which another form is the cheapest.
    start = None
    for stokes, runs in by_stokes(records):
        winner = cheapest(runs, target)
        if winner is None or not find_form(winner[0]["form"]).averaged:
            start = None
        elif start is None:
            start = stokes
    return start


def averaged_forms(records: pd.DataFrame) -> list[str]:
    """Averaged forms that were run, by name."""
    return [str(name) for name in dict.fromkeys(records["form"]) if find_form(name).averaged]


def cost_over_stokes(records: pd.DataFrame, form: str) -> tuple[float, float, list[float]] | None:
    """How the time of an averaged form changes from the smallest to the largest St measured.

    Returns
    -------
    tuple
        The two St, and the quantiles of 5, 50 and 95 % of the ratio of times, over solvers and
        tolerances that have times at all St. None if there are none, or if there is one St alone.
    """
    done = where(records, (records["form"] == form) & records["seconds"].notna())
    times = done.pivot_table(index=["solver", "tolerance"], columns="stokes", values="seconds")
    times = times.dropna().astype(float)
    if len(times.columns) < 2 or times.empty:
        return None
    first = times.columns[0]
    last = times.columns[-1]
    ratios = times[last] / times[first]
    return float(first), float(last), ratios.quantile(list(_QUANTILES)).tolist()
