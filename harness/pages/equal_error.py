"""Every solver at equal error: speed, what the interpreter costs, what `solve` itself costs.

Two runs at the same tolerance have different errors. The page therefore compares the times that
solvers take to the same error, interpolated between the runs of each (`polhode.harness.analysis.pareto`).
A table of `costs` has a row for each error and St, and a column for each form and solver.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from math import isnan, nan
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
import pandas as pd

from polhode.harness.analysis.frames import by_stokes, frame, where
from polhode.harness.analysis.pareto import costs
from polhode.harness.common.files import read_file, write_file
from polhode.harness.common.machine import provenance
from polhode.harness.common.store import Record, read_export, record_file, write_records
from polhode.harness.common.text import duration, markdown, scientific, short
from polhode.harness.pages.figures.style import measured as measured_on, save
from polhode.harness.pages.figures.work_precision import conditions, work_precision_panels
from polhode.harness.pages.tables import fill, lines_of
from polhode.harness.studies.cost import STARTS, FirstRun, Overhead
from polhode.solvers.catalogue import SOLVERS, solver as find_solver
from polhode.solvers.contract import Backend, Status

# Errors of L and E over I_max at which solvers are compared: loose, middle and tight; a choice.
COMPARED_ERRORS = (1e-4, 1e-6, 1e-8)
# Errors at which forms are compared, by Taylor's method alone, which gets to tighter ones; a choice.
_FORMS_ERRORS = (1e-6, 1e-8, 1e-10, 1e-12)
# Errors of L and E over I_max between which two solvers' times may cross: ten in a decade, from large to
# small. A crossing is thus known to a tenth of a decade. The ends lie beyond all errors measured.
_CROSSING_ERRORS = np.geomspace(1e-1, 1e-13, 121).tolist()
# The solvers of which the page says below which error the first is the faster.
_TAYLOR = "taylor"
_VERNER = "cyrk-vern8"
# Libraries whose whole run is machine code: no Python between the steps.
_ALONE = ("heyoka", "CyRK", "SUNDIALS")
# Fields of `Measured` that hold no records; `costs.json` holds them.
_COSTS = ("overheads", "first_runs", "rhs_costs", "startup")
# How each back end calls a right-hand side: "alone" is machine code without Python.
_BACKENDS: dict[Backend, str] = {
    "python": "plain Python",
    "numba": "compiled, called from Python",
    "compiled": "alone",
}


@dataclass(frozen=True)
class Measured:
    """All that the page is made of: records of three studies, and costs (`polhode.harness.studies.cost`)."""

    solvers: Sequence[Record]  # Every solver on the paper's ellipsoid.
    spheroid: Sequence[Record]  # Forms of the spheroid.
    backends: Sequence[Record]  # The same methods by each back end and Jacobian.
    overheads: Sequence[Overhead]  # `solve` beside the bare call of the library.
    # By solver: with an empty cache of compiled code (cold), and with the cache that this run left (warm).
    first_runs: Mapping[str, tuple[FirstRun, FirstRun]]
    rhs_costs: Mapping[Backend, float]  # Seconds of one right-hand side.
    startup: float  # Seconds of `polhode --help`.


def write_page(measured: Measured, folder: Path, command: str) -> Path:
    """Write the pages, their figure and their data into a folder; return the path of the first page."""
    saved = {name: getattr(measured, name) for name in _COSTS}
    write_file(
        folder / "costs.json", json.dumps(saved, default=asdict, indent=1) + "\n", summed=True
    )
    for name in ("solvers", "spheroid", "backends"):
        write_records(getattr(measured, name), folder, name)
    return _write_pages(measured, folder, command)


def draw(measured: Measured, folder: Path, command: str) -> None:
    """Draw time against error of every solver, as ``slow.png`` in a folder."""
    runs = frame(measured.solvers)
    scene = str(runs["scene_name"].iloc[0])
    note = conditions(runs, measured_on(provenance(command, measured.solvers)))
    label = "error of L and E over $I_{max}$"
    save(work_precision_panels(runs, "slow_error", label, scene=scene, note=note), folder, "slow")


def read_measured(folder: Path) -> Measured:
    """The measurements that `write_page` wrote into a folder; OSError if a file of them is missing."""
    records = {
        name: list(read_export(record_file(folder, name)))
        for name in ("solvers", "spheroid", "backends")
    }
    measured_costs: Any = json.loads(read_file(folder / "costs.json"))
    measured_costs["overheads"] = [Overhead(**row) for row in measured_costs["overheads"]]
    measured_costs["first_runs"] = {
        name: tuple(FirstRun(**row) for row in pair)
        for name, pair in measured_costs["first_runs"].items()
    }
    return Measured(**records, **measured_costs)


def rewrite_pages(folder: Path, command: str) -> Path:
    """Write pages and figure anew from the data in a folder; ValueError if there are none."""
    if not (folder / "costs.json").is_file():
        raise ValueError(f"{folder / 'costs.json'}: no such file, expected a page's data")
    return _write_pages(read_measured(folder), folder, command)


def _write_pages(measured: Measured, folder: Path, command: str) -> Path:
    """Write the pages and the figure; return the path of the first page."""
    draw(measured, folder, command)
    for name, text in pages(measured, command).items():
        write_file(folder / name, text)
    return folder / "README.md"


def pages(measured: Measured, command: str) -> dict[str, str]:
    """The texts of two files, by their names: the page, and the page of all times."""
    solvers, spheroid, backends = (
        frame(getattr(measured, name)) for name in ("solvers", "spheroid", "backends")
    )
    records = [*measured.solvers, *measured.spheroid, *measured.backends]
    made = provenance(command, records)
    times = costs(by_stokes(solvers), COMPARED_ERRORS)
    forms = _ratios(
        costs(by_stokes(spheroid), _FORMS_ERRORS),
        ("quaternion", _TAYLOR),
        ("spheroid-axis", _TAYLOR),
    )
    claims, worth = _worth(times)
    overheads = []
    for overhead in measured.overheads:
        row = asdict(overhead)
        # The time of `solve` beyond the bare call: in µs, over the time of that call, and whether the study
        # allows it.
        row["extra"] = 1e6 * overhead.seconds
        row["share"] = overhead.seconds / overhead.bare
        row["allowed"] = "yes" if overhead.allowed else "no"
        overheads.append(row)
    page = fill(
        "equal-error",
        made=made,
        claims=claims,
        worth=worth,
        measured=measured,
        backends=_BACKENDS,
        interpreter=_interpreter(backends),
        crossings=_crossings(solvers, times),
        forms=_table(
            ["St", *map(short, _FORMS_ERRORS)],
            [[short(stokes), *row] for stokes, row in forms.iterrows()],
        ),
        overheads=overheads,
        first_runs=[
            {"solver": name, "cold": cold, "warm": warm}
            for name, (cold, warm) in measured.first_runs.items()
        ],
        # Starts of `polhode --help`, of which the fastest is `startup`.
        starts=STARTS,
    )
    times_page = fill(
        "equal-error-times", made=made, times=_times(times), jacobians=_jacobians(backends)
    )
    return {"README.md": page, "times.md": times_page}


def _table(header: Sequence[str], rows: Sequence[Sequence[Any]], words: int = 1) -> str:
    """A table in Markdown whose first columns, `words` of them, are left-aligned."""
    return markdown(header, rows, right=range(words, len(header)))


def _worth(times: Any) -> tuple[list[str], str]:
    """How the libraries of `_ALONE` compare: sentences, and a table with a row for each place.

    A place is an error and a St. There every library stands with its fastest method. `times` is a table of
    `costs`.
    """
    rows = []
    # By library, for the places that it reaches: its least time over the least time of these libraries.
    behind = {name: [] for name in _ALONE}
    places = []
    for target in COMPARED_ERRORS:
        places += [(target, *entry) for entry in times.loc[target]["quaternion"].iterrows()]
    for target, stokes, solver_times in places:
        # Times fall along `ranked`: of a library's methods the last one, the fastest, stays in the dict.
        ranked = solver_times.dropna().sort_values(ascending=False).items()
        by_library = {
            find_solver(str(solver)).family: (solver, seconds) for solver, seconds in ranked
        }
        best = {name: by_library[name] for name in _ALONE if name in by_library}
        least = min((seconds for _, seconds in best.values()), default=nan)
        for name, (_, seconds) in best.items():
            behind[name].append(seconds / least)
        cells: dict[str, str] = dict.fromkeys(_ALONE, "–")
        for name, (solver, seconds) in best.items():
            cells[name] = f"{solver}, {duration(seconds)}"
        rows.append([short(target), short(stokes), *cells.values()])
    shares = [(name, factors, median(factors)) for name, factors in behind.items() if factors]
    claims = lines_of("equal-error-claims", shares=shares, places=len(places))
    return claims, _table(["error of L and E", "St", *_ALONE], rows, 2)


def _finished(table: pd.DataFrame) -> Any:
    """Runs that reached their end, with their seconds and calls of the right-hand side, NaN where unknown."""
    done = where(table, table["status"] == Status.REACHED_END).rename(
        columns={"work.rhs_calls": "calls"}
    )
    done = done.reindex(columns=["stokes", "solver", "backend", "jacobian", "seconds", "calls"])
    return done.astype({"seconds": float, "calls": float})


def _interpreter(table: pd.DataFrame) -> list[dict[Any, Any]]:
    """Times of an algorithm by the three back ends, and their ratios to the time of compiled code alone.

    An algorithm has one name. SciPy's method of that name runs by the back ends "python" and "numba". CyRK's
    method, which runs alone, is the same algorithm, and has "cyrk-" before the name.
    """
    done = _finished(table)
    comparable = [*map(_comparable, done["solver"], done["backend"], done["jacobian"])]
    done = done[comparable]
    done["method"] = done["solver"].str.removeprefix("cyrk-")
    # A row for each St and method, a column for each back end.
    times = done.pivot_table("seconds", ["stokes", "method"], "backend", sort=False)
    times = times.reindex(columns=[*_BACKENDS])
    ratios = times.div(times["compiled"], axis=0).add_suffix("_ratio")
    return times.join(ratios).reset_index().to_dict("records")


def _comparable(solver: str, backend: str, jacobian: str) -> bool:
    """Whether a run counts for its algorithm and back end in the comparison of back ends.

    Runs of CyRK count by the back end "compiled" alone. SciPy's methods lack it, and have the other two.
    """
    method = find_solver(solver)
    if method.implicit:
        # The one Jacobian that all three back ends of the algorithm have.
        common = "exact" if method.family == "SUNDIALS" else "difference"
        if jacobian != common:
            return False
    return backend == "compiled" or method.family != "CyRK"


def _jacobians(table: pd.DataFrame) -> list[dict[Any, Any]]:
    """Runs by exact Jacobians beside those by finite differences, of the same St, solver and back end."""
    done = _finished(table)
    done["called"] = done["backend"].map(_BACKENDS)
    exact, differences = (where(done, done["jacobian"] == kind) for kind in ("exact", "difference"))
    pairs = exact.merge(
        differences, on=["stokes", "solver", "called"], suffixes=("", "_by_differences")
    )
    return pairs.assign(ratio=pairs["seconds_by_differences"] / pairs["seconds"]).to_dict("records")


def _crossings(table: pd.DataFrame, times: Any) -> str:
    """A table by St: the error at which Verner's method stops being the faster one as the error falls, and ratios.

    `times` is a table of `costs` at `COMPARED_ERRORS`, `table` the runs themselves.
    """
    both = where(table, (table["form"] == "quaternion") & table["solver"].isin([_TAYLOR, _VERNER]))
    falling: Any = costs(by_stokes(both), _CROSSING_ERRORS)["quaternion"]
    all_ratios = _ratios(times, ("quaternion", _TAYLOR), ("quaternion", _VERNER))
    rows = []
    for stokes, ratios in all_ratios.iterrows():
        at_stokes = falling.xs(stokes, level=1).dropna(subset=[_TAYLOR])
        # A comparison with an unknown time is false.
        ahead = (at_stokes[_VERNER] < at_stokes[_TAYLOR]).to_numpy()
        # Verner's method is ahead at one of these errors, and no more at the next one.
        stops = np.flatnonzero(ahead[:-1] & ~ahead[1:])
        crossing = scientific(at_stokes.index[stops[0] + 1]) if len(stops) else "none"
        rows.append([short(stokes), crossing, *ratios])
    columns = [f"{_TAYLOR} / {_VERNER} at {short(error)}" for error in COMPARED_ERRORS]
    return _table(["St", "they cross at", *columns], rows)


def _ratios(times: Any, first: tuple[str, str], second: tuple[str, str]) -> Any:
    """Ratio of the first method's time to the second's, in words: a row for each St, a column for each error.

    A method is a pair of form and solver. `times` is a table of `costs`.
    """
    ratios = times[first] / times[second]
    words = ratios.map(lambda ratio: "–" if isnan(ratio) else f"{ratio:.2f}")
    # `unstack` turns errors, the outer level of the rows, into columns, in their order in `times`.
    return words.unstack(0)[[*times.index.unique(0)]]


def _times(times: Any) -> dict[float, str]:
    """Every solver's times by St in the quaternion form: a table in Markdown for each of `COMPARED_ERRORS`."""
    tables = {}
    for target in COMPARED_ERRORS:
        by_solver = times.loc[target]["quaternion"].T.dropna(how="all")
        rows = [
            [solver, *map(duration, by_solver.loc[solver])]
            for solver in SOLVERS
            if solver in by_solver.index
        ]
        tables[target] = _table(
            ["solver", *(f"St = {short(stokes)}" for stokes in by_solver)], rows
        )
    return tables
