"""The page of solvers that know St: how many times as fast as the fastest other one, and the ratios set as targets.

`splitting`, `splitting-extended` and `stroboscopic` know St: they are made for large St. `docs/method.md` says
how they work and where they are used.
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

# Errors of L and E over I_max, columns of the table.
_ERRORS = (1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9)
# Least ratios set as targets, by scene, St and error of L and E.
_TARGET_ROWS = tomllib.loads(
    Path(__file__).with_name("known_stokes.toml").read_text(encoding="utf-8")
)["targets"]
_TARGETS = {(scene, stokes, error): ratio for scene, stokes, error, ratio in _TARGET_ROWS}
# Solvers of polhode, the ones that know St; all others are rivals.
_OWN = [name for name in SOLVERS if find_solver(name).family == "polhode"]
# Limits that stroboscopic averaging has to meet: the error of L and E over I_max, the error of the
# orientation in rad, and how many times as fast as the best other solver it is. Like the rows of
# `known_stokes.toml` they are targets that polhode's authors set, and not measured.
_REACHED = (5e-9, 3e-4, 30.0)
_STOKES = 1e6  # St of its runs.
_LARGER = 1e8  # St of the longer run.
# Factor by which the longer run may take more time, a target: the cost of averaging should hardly
# depend on St.
_LONGER = 1.3
# Both runs take turns this often, so that what slows the machine slows both; the fastest of each
# count. An estimate.
_ROUNDS = 7


def write_page(study: Study, records: Sequence[Record], folder: Path, command: str) -> Path:
    """Write the page and its records into a folder and return the page's path."""
    folder.mkdir(parents=True, exist_ok=True)
    write_records(records, folder)
    of = digest("".join(record_lines(records)))
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
        stroboscopic=_stroboscopic(study, table, folder, of),
        ratios=markdown(
            ["scene", "St", *map(short, _ERRORS)], rows, right=range(1, 2 + len(_ERRORS))
        ),
    )
    return write_file(folder / "README.md", page)


def _splitting(
    table: pd.DataFrame,
) -> tuple[list[list[str]], list[bool], list[tuple[float, float]]]:
    """Rows of the table, which targets are met, and all ratios known with their St.

    A ratio is the time of the fastest rival over the time of `splitting` at equal error of L and E.
    """
    rows = []
    met = []
    ratios = []
    for scene in dict.fromkeys(table["scene_name"].astype(str)):
        groups = by_stokes(where(table, table["scene_name"] == scene))
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


def _stroboscopic(study: Study, table: pd.DataFrame, folder: Path, of: str) -> list[str]:
    """The time that averaging takes for tight errors of both kinds, and for a longer run, in sentences.

    Without a run of `stroboscopic` that meets both errors there are none.
    `of` is the digest of the records.
    """
    slow, orientation, _ = _REACHED
    runs = where(table, (table["scene_name"] == "spheroid") & (table["stokes"] == _STOKES))
    done = where(runs, runs["seconds"].notna() & (runs["status"] == Status.REACHED_END))
    good: Any = where(
        done, (done["slow_error"] <= slow) & (done["orientation_error"] <= orientation)
    )
    # The least time of each solver to both errors, the fastest first; then the fastest rival.
    best = good.groupby("solver")["seconds"].min().sort_values().to_dict()
    name = next((solver for solver in best if solver not in _OWN), None)
    if "stroboscopic" not in best:
        return []
    strobe = where(done, done["solver"] == "stroboscopic")
    scene = next(
        scene for name, scene in study.scenes if name == "spheroid" and scene.stokes == _STOKES
    )
    tolerance = min(strobe["tolerance"].to_numpy(float))
    longer = _cached_longer(folder, of, scene, tolerance, study.samples)
    least = min(strobe["slow_error"].to_numpy(float))
    figures = {"best": best, "other": name, "least": least, "longer": longer}
    return lines_of(
        "known-stokes-stroboscopic",
        **figures,
        reached=_REACHED,
        stokes=_STOKES,
        larger=_LARGER,
        most=_LONGER,
    )


def _cached_longer(folder: Path, of: str, scene: Scene, tolerance: float, samples: int) -> float:
    """`_longer`, measured once for the records of this digest: a page written anew does not run it again."""
    path = folder / "longer.json"
    if path.exists() and (record := json.loads(read_file(path)))["records"] == of:
        return record["ratio"]
    ratio = _longer(scene, tolerance, samples)
    write_file(path, json.dumps({"records": of, "ratio": ratio}) + "\n", summed=True)
    return ratio


def _longer(scene: Scene, tolerance: float, samples: int) -> float:
    """Time of a run at the larger St over that at a scene's own, run in turns.

    The duration grows by the factor of St: both runs go over the same slow time t/St.
    """
    form = find_form("spheroid-axis")
    factor = _LARGER / scene.stokes
    problems = [
        form.problem(replace(scene, stokes=scene.stokes * k, time=scene.time * k))
        for k in (1.0, factor)
    ]

    def seconds(problem: Problem) -> float:
        return seconds_of(
            lambda: solve(
                problem, "stroboscopic", tolerance, np.linspace(0.0, problem.end, samples)
            )
        )

    rounds = [[*map(seconds, problems)] for _ in range(_ROUNDS)]
    first, second = np.min(rounds, axis=0)
    return float(second / first)
