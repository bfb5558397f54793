"""The page of solvers that know St: how many times as fast as the fastest other one, and the ratios set as targets.

`splitting`, `splitting-extended` and `stroboscopic` know St: they are made for large St. The README says how
they work, under "The physics".
"""

import json
import tomllib
from collections.abc import Sequence
from dataclasses import replace
from math import isnan, nan
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from polhode.harness.analysis.frames import by_stokes, frame, where
from polhode.harness.analysis.pareto import costs
from polhode.harness.common.files import digest, read_file, write_file
from polhode.harness.common.machine import provenance
from polhode.harness.common.store import Record, record_lines, write_records
from polhode.harness.common.text import duration, markdown, short
from polhode.harness.common.timing import seconds_of
from polhode.harness.pages.tables import fill, lines_of
from polhode.harness.studies.study import Study
from polhode.models.catalogue import form as find_form
from polhode.models.problem import Problem
from polhode.models.scene import Scene
from polhode.solvers.catalogue import SOLVERS, solver as find_solver
from polhode.solvers.contract import Status
from polhode.solvers.solve import solve

# Errors of L and E over I_max, columns of the table: the targets, in `known_stokes.toml` beside this module, are
# for 1e-6 to 1e-8; a decade or two on either side are added. Which ones to show is a choice.
_ERRORS = (1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9)
# Least ratios set as targets, by scene, St and error of L and E over I_max.
_TARGET_ROWS = tomllib.loads(
    Path(__file__).with_name("known_stokes.toml").read_text(encoding="utf-8")
)["targets"]
_TARGETS = {(scene, stokes, error): ratio for scene, stokes, error, ratio in _TARGET_ROWS}
# Solvers of polhode, the ones that know St; all others are rivals.
_OWN = [name for name in SOLVERS if find_solver(name).family == "polhode"]
# Targets of `stroboscopic`; a fourth one, its least error of 1e-10, stands in the page's text. Like the rows of
# `known_stokes.toml` they are set by polhode's authors, not measured.
_SLOW_ERROR = 5e-9  # of L and E, over I_max
_ORIENTATION_ERROR = 3e-4  # rad
_LEAST_SPEEDUP = 30.0  # time of the fastest rival over its own, to both errors
# St of these runs, and of the longer run beside them: the cost of averaging should hardly depend on St,
# and a St a hundred times as large shows whether it does.
_STOKES = 1e6
_LARGER_STOKES = 1e8
# Target: most time of the longer run over the time of the shorter one.
_MOST_LONGER = 1.3
# Both runs take turns this often, so that what slows the machine slows both; the fastest of each
# count. An estimate: half as many find the fastest less surely, twice as many take twice the time.
_ROUNDS = 7


def write_page(study: Study, records: Sequence[Record], folder: Path, command: str) -> Path:
    """Write the page, its records and `longer.json` into a folder and return the page's path.

    Where `longer.json` does not belong to these records, `stroboscopic` is run to measure it.
    """
    folder.mkdir(parents=True, exist_ok=True)
    write_records(records, folder)
    records_digest = digest("".join(record_lines(records)))
    table = frame(records)
    rows, met, ratios = _splitting(table)
    page = fill(
        "known-stokes",
        title=study.title,
        made=provenance(command, records),
        met=met.count(True),
        targets=len(met),
        known=ratios,
        slower=[(ratio, stokes) for ratio, stokes in ratios if ratio < 1],
        stroboscopic=_stroboscopic(study, table, folder, records_digest),
        ratios=markdown(
            ["scene", "St", *map(short, _ERRORS)], rows, right=range(1, 2 + len(_ERRORS))
        ),
    )
    return write_file(folder / "README.md", page)


def _splitting(
    table: pd.DataFrame,
) -> tuple[list[list[str]], list[bool], list[tuple[float, float]]]:
    """How `splitting` compares with its rivals.

    A ratio is the time of the fastest rival over the time of `splitting` at equal error of L and E.

    Returns
    -------
    tuple
        Rows of the page's table: scene, St and a cell for each of `_ERRORS`; whether each target is
        met; the ratios known, each with its St.
    """
    rows = []
    met = []
    ratios = []
    for scene in dict.fromkeys(table["scene_name"].astype(str)):
        groups = by_stokes(where(table, table["scene_name"] == scene))
        # The study has one form, `spheroid-axis`: a column's solver is name enough.
        all_times: Any = costs(groups, _ERRORS).droplevel(0, axis=1)
        for stokes, _ in groups:
            cells = []
            for error in _ERRORS:
                times = all_times.loc[error, stokes]
                rivals = times.drop(_OWN, errors="ignore").dropna().sort_values()
                ratio = rivals.min() / times.get("splitting", nan)
                if not isnan(ratio):
                    ratios.append((float(ratio), stokes))
                cell = "–"
                if not isnan(ratio):
                    cell = f"{ratio:.2g} ({rivals.index[0]}, {duration(rivals.min())})"
                target = _TARGETS.get((scene, stokes, error))
                if target is not None:
                    met.append(ratio >= target)
                    cell += f" {'✓' if met[-1] else '✕'} ≥ {target:g}"
                cells.append(cell)
            rows.append([scene, short(stokes), *cells])
    return rows, met, ratios


def _stroboscopic(
    study: Study, table: pd.DataFrame, folder: Path, records_digest: str
) -> list[str]:
    """The time that averaging takes for tight errors of both kinds, and for a longer run, in sentences.

    There are none without a run of `stroboscopic` that meets both errors.
    """
    runs = where(table, (table["scene_name"] == "spheroid") & (table["stokes"] == _STOKES))
    done = where(runs, runs["seconds"].notna() & (runs["status"] == Status.REACHED_END))
    meets_slow = done["slow_error"] <= _SLOW_ERROR
    meets_orientation = done["orientation_error"] <= _ORIENTATION_ERROR
    good: Any = where(done, meets_slow & meets_orientation)
    # The least time of each solver to both errors, the fastest first.
    best = good.groupby("solver")["seconds"].min().sort_values().to_dict()
    if "stroboscopic" not in best:
        return []
    rival = next((solver for solver in best if solver not in _OWN), None)
    stroboscopic = where(done, done["solver"] == "stroboscopic")
    scene = next(
        scene for name, scene in study.scenes if name == "spheroid" and scene.stokes == _STOKES
    )
    tolerance = min(stroboscopic["tolerance"].to_numpy(float))
    return lines_of(
        "known-stokes-stroboscopic",
        best=best,
        rival=rival,
        least=min(stroboscopic["slow_error"].to_numpy(float)),
        longer=_cached_longer(folder, records_digest, scene, tolerance, study.samples),
        slow_error=_SLOW_ERROR,
        orientation_error=_ORIENTATION_ERROR,
        least_speedup=_LEAST_SPEEDUP,
        stokes=_STOKES,
        larger=_LARGER_STOKES,
        most=_MOST_LONGER,
    )


def _cached_longer(
    folder: Path, records_digest: str, scene: Scene, tolerance: float, samples: int
) -> float:
    """`_longer`, measured once for the records of this digest: a page written anew does not run it again."""
    path = folder / "longer.json"
    if path.exists() and (record := json.loads(read_file(path)))["records"] == records_digest:
        return record["ratio"]
    ratio = _longer(scene, tolerance, samples)
    write_file(path, json.dumps({"records": records_digest, "ratio": ratio}) + "\n", summed=True)
    return ratio


def _longer(scene: Scene, tolerance: float, samples: int) -> float:
    """Time of a run by `stroboscopic` at `_LARGER_STOKES` over the time of one at the scene's own St.

    The duration grows by the factor of St: both runs go over the same slow time t/St.
    """
    form = find_form("spheroid-axis")
    factor = _LARGER_STOKES / scene.stokes
    longer_scene = replace(scene, stokes=scene.stokes * factor, time=scene.time * factor)
    problems = [form.problem(scene), form.problem(longer_scene)]

    def seconds(problem: Problem) -> float:
        return seconds_of(
            lambda: solve(
                problem, "stroboscopic", tolerance, np.linspace(0.0, problem.end, samples)
            )
        )

    rounds = [[*map(seconds, problems)] for _ in range(_ROUNDS)]
    first, second = np.min(rounds, axis=0)
    return float(second / first)
