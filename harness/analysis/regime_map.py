"""The regime map: over St and error, which form and solver wins, by how much, and where it is a tie."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from math import isnan
from typing import Literal

import numpy as np
import pandas as pd

from polhode.harness.analysis.frames import by_stokes, where
from polhode.harness.analysis.pareto import pareto_front
from polhode.harness.analysis.winners import TIE
from polhode.harness.common.text import in_two_digits, short
from polhode.harness.references.uncertainty import known, least_known, uncertainty_of
from polhode.harness.studies.case import Case
from polhode.harness.studies.study import Study
from polhode.models.catalogue import form as find_form
from polhode.solvers.catalogue import solver as find_solver
from polhode.solvers.contract import Status

Side = Literal["implicit", "explicit", "averaged"]

# Errors of the map, from the loosest to the tightest.
TARGETS = tuple(float(f"1e-{exponent}") for exponent in range(2, 13))
# Averaged equations are not tried over more slow time than this: all is over long before.
LONGEST_SLOW_TIME = 100.0
SAME_WORK = ("averaged", "averaged-spheroid")


@dataclass(frozen=True)
class Method:
    """A form by a solver."""

    form: str
    solver: str

    def __str__(self) -> str:
        return f"{self.form}, {self.solver}"

    @property
    def side(self) -> Side:
        """Which kind of method it is."""
        if find_form(self.form).averaged:
            return "averaged"
        return "implicit" if find_solver(self.solver).implicit else "explicit"

    @property
    def label(self) -> str:
        """What tells it apart on a map: averaged forms by their name, since any solver will do, others by solver."""
        return self.form if self.side == "averaged" else self.solver


@dataclass(frozen=True)
class Cell:
    """One St and one error of the map.

    Parameters
    ----------
    stokes, target : float
    known : bool
        Whether the reference is good enough to tell; nobody wins where it is not.
    winner, second : Method or None
        The cheapest, and the cheapest of another label; None where none reaches the error.
    seconds, lead : float
        Time of the winner, interpolated between tolerances, and that of the second over it; NaN where there is none.
    """

    stokes: float
    target: float
    known: bool
    winner: Method | None
    second: Method | None
    seconds: float
    lead: float

    @property
    def tied(self) -> bool:
        """Whether the second is within `TIE` of the winner."""
        return self.lead <= TIE


def parts(study: Study) -> Iterator[Study]:
    """The study cut into what makes sense: averaged forms where the slow time is not endless."""
    full = tuple(name for name in study.forms if not find_form(name).averaged)
    for scene in study.scenes:
        forms = study.forms if scene[1].slow_time <= LONGEST_SLOW_TIME else full
        yield replace(study, scenes=(scene,), forms=forms)


@dataclass(frozen=True)
class Parts:
    """The batches of all `parts` of a study, to be run as one."""

    study: Study

    @property
    def name(self) -> str:
        """The study's."""
        return self.study.name

    def batches(self) -> Iterator[list[Case]]:
        """Cases in batches that are timed in interleaved order."""
        for part in parts(self.study):
            yield from part.batches()


def cells(records: pd.DataFrame, error: str, targets: Sequence[float] = TARGETS) -> list[Cell]:
    """Cells of the map of one scene, by St and then by error.

    Parameters
    ----------
    records : DataFrame
        Of one scene at several St (`polhode.harness.analysis.frames.frame`).
    error : {"slow_error", "orientation_error"}
    targets : sequence of float
    """
    found = []
    for stokes, runs in by_stokes(records):
        uncertainty = runs[uncertainty_of(error)].dropna()
        limit = least_known(float(uncertainty.iloc[0]) if len(uncertainty) else None)
        fronts = {method: front(own, error) for method, own in methods(runs)}
        for target in targets:
            costs = {method: cost(points, target) for method, points in fronts.items()}
            found.append(_cell(stokes, target, target > limit, costs))
    return found


@dataclass(frozen=True)
class Standing:
    """How a method fares on a map, whether it wins or not.

    Parameters
    ----------
    method : Method
    won, tied : int
        Cells that it wins, and in which it ties with the winner.
    front : int
        Stokes numbers at which a run of it lies on the Pareto front of all known runs.
    measured : int
        Stokes numbers at which it was run.
    failures : dict
        Number of its runs without a result, by status.
    """

    method: Method
    won: int
    tied: int
    front: int
    measured: int
    failures: dict[str, int]


def standings(records: pd.DataFrame, error: str, found: Sequence[Cell]) -> list[Standing]:
    """Every method of one scene, those that win most first.

    Parameters
    ----------
    records : DataFrame
        Of one scene at several St.
    error : {"slow_error", "orientation_error"}
    found : sequence of Cell
        The map of the same records.
    """
    done = where(records, (records["status"] == Status.REACHED_END) & records["seconds"].notna())
    sure = where(done, known(done, error).fillna(value=False))
    fronts = [pareto_front(runs, error) for _, runs in sure.groupby("stokes")]
    on_front = [method for each in fronts for method, _ in methods(each)]
    winners = [cell.winner for cell in found]
    ties = [cell.second for cell in found if cell.tied]
    rows = []
    for method, own in methods(records):
        statuses = [str(status) for status in own["status"] if status != Status.REACHED_END]
        failures = {status: statuses.count(status) for status in dict.fromkeys(statuses)}
        counts = winners.count(method), ties.count(method), on_front.count(method), len(set(own["stokes"]))
        rows.append(Standing(method, *counts, failures))
    return sorted(rows, key=lambda row: (-row.won, -row.front, -row.tied, str(row.method)))


def methods(runs: pd.DataFrame) -> Iterator[tuple[Method, pd.DataFrame]]:
    """Runs of each form and solver."""
    for name, own in runs.groupby(["form", "solver"], sort=False):
        form, solver = name if isinstance(name, tuple) else (name, "")
        yield Method(str(form), str(solver)), own


def front(runs: pd.DataFrame, error: str) -> np.ndarray:
    """Errors and times, shape (n, 2), of a method's runs that none of its other runs beats, times increasing."""
    done = runs.query("status == 'reached_end' and seconds.notna()")
    pairs = done[["seconds", error]].dropna().to_numpy(float)
    points, best = [], float("inf")
    for seconds, size in sorted(pairs.tolist()):
        if size < best:
            points.append((size, seconds))
            best = size
    return np.array(points).reshape(-1, 2)


def cost(points: np.ndarray, target: float) -> float:
    """Time at which a front reaches an error: logarithms interpolated between its runs; NaN where it never does."""
    if not len(points) or points[-1, 0] > target:
        return float("nan")
    if points[0, 0] <= target:
        return float(points[0, 1])
    tiny = np.finfo(float).tiny
    sizes, seconds = np.log(np.maximum(points[:, 0], tiny)), np.log(points[:, 1])
    return float(np.exp(np.interp(-np.log(target), -sizes, seconds)))


def _cell(stokes: float, target: float, known: bool, costs: dict[Method, float]) -> Cell:
    ranked = sorted((seconds, str(method), method) for method, seconds in costs.items() if not isnan(seconds))
    if not known or not ranked:
        return Cell(stokes, target, known, None, None, float("nan"), float("nan"))
    seconds, _, winner = ranked[0]
    others = [entry for entry in ranked[1:] if entry[2].label != winner.label]
    later, _, second = others[0] if others else (float("nan"), "", None)
    return Cell(stokes, target, known, winner, second, seconds, later / seconds)


def scatter(table: pd.DataFrame) -> tuple[float, float] | None:
    """Scatter of times of the same work at several St: as measured, and divided by the sentinel's.

    Forms averaged to first order hold no St in slow time: over the same slow time they do the same work at every St.
    Returns standard deviations of the logarithm about the mean of each group; None where nothing was repeated.
    """
    if "scene.time" not in table:
        return None
    runs = where(table, table["form"].isin(SAME_WORK) & table["seconds"].notna())
    logs = pd.DataFrame(
        {
            "plain": np.log(runs["seconds"].to_numpy(float)),
            "pace": np.log(runs["sentinel_seconds"].to_numpy(float)),
            "slow_time": (runs["scene.time"].to_numpy(float) / runs["stokes"].to_numpy(float)).round(12),
            **{name: runs[name].to_numpy() for name in ("scene_name", "form", "solver", "tolerance")},
        }
    )
    logs["paced"] = logs["plain"] - logs["pace"]
    groups = logs.groupby(["scene_name", "form", "solver", "tolerance", "slow_time"])[["plain", "paced"]]
    freedom = len(logs) - groups.ngroups
    if freedom < 1:
        return None
    apart = (logs[["plain", "paced"]] - groups.transform("mean")).to_numpy(float)
    plain, paced = np.sqrt((apart**2).sum(axis=0) / freedom)
    return float(plain), float(paced)


def usual_form(found: Sequence[Cell]) -> str:
    """The full form that wins most cells."""
    forms = [cell.winner.form for cell in found if cell.winner and cell.winner.side != "averaged"]
    return max(dict.fromkeys(forms), key=forms.count, default="")


def sentences(found: Sequence[Cell], what: str) -> list[str]:
    """What a map shows, in sentences: which kind of method wins where, and by how much."""
    words = {"implicit": "An implicit solver", "explicit": "An explicit solver", "averaged": "An averaged form"}
    lines = []
    for side, subject in words.items():
        own = [cell for cell in found if cell.winner and cell.winner.side == side]
        if not own:
            lines.append(f"{subject} never wins ({what}).")
            continue
        low, high = min(cell.stokes for cell in own), max(cell.stokes for cell in own)
        leads = sorted(cell.lead for cell in own if not isnan(cell.lead))
        ties = sum(cell.tied for cell in own)
        middle, most = (in_two_digits(lead) for lead in (leads[len(leads) // 2], leads[-1])) if leads else ("", "")
        by = f", by a factor {middle} (median) to {most}" if leads else ""
        share = f"{len(own)} of {sum(cell.winner is not None for cell in found)}"
        span = f"from St = {short(low)} to {short(high)}" if low < high else f"at St = {short(low)}"
        lines.append(f"{subject} wins {share} cells, {span}{by}; {ties} are ties ({what}).")
    return lines
