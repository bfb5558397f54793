"""The pages on ensembles: of a sweep, with CSV files for the rest, and of what `polhode throughput` measured.

An ensemble is many particles of one shape at one St; a sweep is ensembles of some shapes and St. Its particles
are run in blocks, the tasks of the store. `polhode.harness.ensembles.summary` makes the rows of all files.
"""

import csv
import json
import tomllib
from contextlib import ExitStack
from functools import partial
from itertools import groupby
from math import ceil
from pathlib import Path
from statistics import median
from typing import Any

import pandas as pd

from polhode.harness.analysis.frames import read_csv
from polhode.harness.common.files import PartialFile, dumps, loads, read_file, write_file
from polhode.harness.common.machine import made_lines, provenance
from polhode.harness.common.store import Store
from polhode.harness.common.text import percent, short
from polhode.harness.ensembles import summary
from polhode.harness.ensembles.statistics import RATES, SLOW_NAMES
from polhode.harness.ensembles.sweep import NO_TIMES, Sweep, gather, surroundings
from polhode.harness.pages.figures.ensembles import picture, speeds
from polhode.harness.pages.figures.style import measured, save
from polhode.harness.pages.tables import fill

# Files beside the page, and the function that makes an ensemble's rows of each from the ensemble and its
# statistics; `texts/sweep.md` describes them. In `mean_rows`, `of` names the statistic. The other keyword
# names a column, with its entries.
_FILES = {
    "moments.csv": summary.moment_rows,
    "voigt.csv": summary.voigt_rows,
    "rates.csv": partial(summary.mean_rows, of="rates", rate=RATES),
    "slow.csv": partial(
        summary.mean_rows, of="slow", variable=[f"{name}/Imax" for name in SLOW_NAMES]
    ),
    "distributions.csv": summary.distribution_rows,
    "arrivals.csv": summary.arrival_rows,
}
# A file with a row for each ensemble, from which the page is written anew.
_ENSEMBLES = "ensembles.json"
# The tables from which the picture of a shape is drawn.
_DRAWN = ("moments.csv", "slow.csv", "distributions.csv", "arrivals.csv")
# Large sweeps whose cost the page predicts.
_PLANS = tomllib.loads(Path(__file__).with_name("plans.toml").read_text(encoding="utf-8"))["plans"]
# Particles of one task of such a sweep, which a sweep file sets as `block`. A choice: with half as many there
# are twice as many tasks and mebibytes in the store, in the same hours.
_BLOCK = 100_000

_BYTES_OF_MIB = 2**20

Throughput = dict[str, Any]
"""Tables and numbers by name, as plain data, from `polhode.harness.ensembles.throughput.measure`."""


def write_results(
    sweep: Sweep, store: Store, folder: Path, command: str
) -> tuple[Path, list[dict[str, Any]]]:
    """Write the page, its pictures, `ensembles.json` and the CSV files that have rows into a folder.

    CSV files of an earlier run that have no rows now are removed. Returns the page's path, and a row of
    `summary.ensemble_row` for each ensemble. Raises ValueError if the store lacks a task.
    """
    ensembles = []
    # The stem of each picture's file, and its shape in words.
    pictures = []
    written = dict[str, csv.DictWriter]()
    with ExitStack() as files:
        # A sweep may be larger than the memory, which holds one task of the store and the rows of one shape
        # here. All files are open at once, and grow ensemble by ensemble.
        by_shape = groupby(sweep.ensembles, key=lambda ensemble: ensemble.ellipsoid.semi_axes)
        for _, shape_ensembles in by_shape:
            drawn: dict[str, list[dict[str, object]]] = {name: [] for name in _DRAWN}
            for ensemble in shape_ensembles:
                statistics = gather(ensemble, store)
                ensembles.append(summary.ensemble_row(ensemble, statistics))
                for name, make in _FILES.items():
                    for row in make(ensemble, statistics):
                        if name in drawn:
                            drawn[name].append(row)
                        if name not in written:
                            file = files.enter_context(PartialFile(folder / name, summed=True))
                            written[name] = csv.DictWriter(file, list(row))
                            written[name].writeheader()
                        written[name].writerow(row)
            if not drawn["distributions.csv"]:
                # No particle of this shape has finished.
                continue
            picture_name = f"shape-{len(pictures) + 1}"
            pictures.append((picture_name, _shape(ensembles[-1])))
            tables = {name: pd.DataFrame(rows) for name, rows in drawn.items()}
            save(_picture(tables, sweep), folder, picture_name)
    made = provenance(command, surroundings(sweep, store))
    write_file(folder / _ENSEMBLES, dumps(ensembles, sort_keys=False) + "\n", summed=True)
    names = [name for name in _FILES if name in written]
    write_file(folder / "README.md", _page(sweep, made, ensembles, names, pictures))
    for name in _FILES.keys() - written.keys():
        # A run by an earlier version left it.
        (folder / name).unlink(missing_ok=True)
    return folder / "README.md", ensembles


def redraw(sweep: Sweep, folder: Path) -> Path:
    """Draw the pictures of a sweep, and write its page, anew from the tables in its folder; the page's path.

    The sweep must be the one that made the folder, which is not checked. The page stays as it is in a folder of
    polhode 0.1, which wrote no table of ensembles.

    Raises
    ------
    ValueError
        No `distributions.csv` is in the folder, the page does not say how it was made, or a file is damaged.
    """
    if not (folder / "distributions.csv").is_file():
        raise ValueError(f"{folder / 'distributions.csv'}: no such file, expected those of a sweep")
    tables: dict[str, Any] = {
        name: read_csv(folder / name) if (folder / name).is_file() else pd.DataFrame()
        for name in _DRAWN
    }
    shapes = tables["distributions.csv"].groupby(["a", "b", "c"], sort=False)
    pictures = []
    for number, (shape, _) in enumerate(shapes, start=1):
        shape_tables: dict[str, pd.DataFrame] = {}
        for name, table in tables.items():
            shape_tables[name] = table
            if len(table):
                has_shape = (table[list("abc")] == list(shape)).all(axis=1)
                shape_tables[name] = table.loc[has_shape]
        picture_name = f"shape-{number}"
        pictures.append((picture_name, " : ".join(map(short, shape))))
        save(_picture(shape_tables, sweep), folder, picture_name)
    page = folder / "README.md"
    if (folder / _ENSEMBLES).is_file():
        ensembles = loads(read_file(folder / _ENSEMBLES).decode())
        names = [name for name in _FILES if (folder / name).is_file()]
        write_file(page, _page(sweep, made_lines(page), ensembles, names, pictures))
    return page


def _picture(tables: dict[str, pd.DataFrame], sweep: Sweep) -> Any:
    """The picture of one shape, from its rows of each file of `_DRAWN`."""
    tolerances = dict.fromkeys(short(ensemble.tolerance) for ensemble in sweep.ensembles)
    axes = "x: flow, y: gradient, z: vorticity"
    if sweep.ensembles[0].any_scene.flow is not None:
        axes = "x, y, z: axes of space"
    note = (
        f"{sweep.ensembles[0].particles} particles for each St, whose starts the sweep file gives; tolerance "
        f"{' or '.join(tolerances)}. {axes}; L over the largest moment of inertia. Bands hold 95 %."
    )
    return picture({name.removesuffix(".csv"): table for name, table in tables.items()}, note)


def _page(
    sweep: Sweep,
    made: list[str],
    ensembles: list[dict[str, Any]],
    names: list[str],
    pictures: list[tuple[str, str]],
) -> str:
    """The page of a sweep.

    `made` says how it was made; `ensembles` are rows of `summary.ensemble_row`, `names` the files beside it,
    `pictures` the stem of each picture's file with its shape in words.
    """
    rows = []
    for ensemble in ensembles:
        # By attractor the share of the particles that arrived there, with its interval.
        arrived_at = ensemble["arrived"].items()
        ends = [f"{name}: {_interval(interval, '–')}" for name, interval in arrived_at]
        times = ensemble["transient_time"]
        columns = {
            "shape": _shape(ensemble),
            "failed": sum(ensemble["failures"].values()),
            "ends": "; ".join(ends) or "–",
            # The time until half of the particles have arrived; "later" if it lies beyond the run's end.
            "median": _interval(times["0.5"], "later") if times else "–",
            "shares": {
                name: interval["value"]
                for name, interval in arrived_at
                if interval["value"] is not None
            },
        }
        rows.append(ensemble | columns)
    settled = groupby((row for row in rows if row["shares"]), key=_shape)
    return fill(
        "sweep",
        title=sweep.title,
        made=made,
        rows=rows,
        settled=[(shape, list(same)) for shape, same in settled],
        pictures=pictures,
        files=names,
        # The tasks' records say by this that no times were taken.
        no_times=NO_TIMES,
        in_flow=sweep.ensembles[0].any_scene.flow is not None,
    )


def _shape(row: dict[str, Any]) -> str:
    """The semi-axes of an ensemble's row, as a : b : c."""
    return " : ".join(short(row[name]) for name in "abc")


def _interval(interval: dict[str, float | None], none: str) -> str:
    """A value and its interval in words; `none` stands for what is unknown of it.

    `interval` has the value, the lower end and the upper one, in this order.
    """
    value, low, high = (none if end is None else f"{end:.4g}" for end in interval.values())
    return f"{value} ({low} to {high})"


def read_throughput(folder: Path) -> Throughput:
    """The numbers that `write_page` wrote into a folder.

    Raises ValueError if the folder has no ``throughput.json``.
    """
    path = folder / "throughput.json"
    if not path.is_file():
        raise ValueError(f"{path}: no such file, expected the numbers of `polhode throughput`")
    return json.loads(path.read_text(encoding="utf-8"))


def write_page(throughput: Throughput, folder: Path) -> Path:
    """Write ``throughput.json``, a picture of it and ``throughput.md`` into a folder; the page's path."""
    write_file(folder / "throughput.json", json.dumps(throughput, indent=1) + "\n")
    settings = throughput["settings"]
    has_spread = all("slower_per_second" in row for row in throughput["full"])
    spread = "The spread was not kept."
    if has_spread:
        spread = "Bars reach down to what three turns in four reach."
    *looser, tightest = map(short, settings["targets"])
    note = (
        f"St = {settings['stokes']:g}, t₂ = {settings['slow_time']:g}, isotropic starts; each tolerance "
        f"is the loosest that keeps all particles within {', '.join(looser)} and {tightest}. Processor time, the "
        f"least of {settings['rounds']} runs in turns; {measured(_made(throughput))}. {spread}"
    )
    save(speeds(throughput["full"], note), folder, "throughput")
    return write_file(folder / "throughput.md", page(throughput))


def _made(throughput: Throughput) -> list[str]:
    """Lines on machine and versions, which `throughput` holds under the names that records have."""
    return provenance("polhode throughput", [throughput])


def page(throughput: Throughput) -> str:
    """The measured numbers as a page, and what large sweeps take by them."""
    # The tasks measured give, for each planned sweep, its tasks, mebibytes in the store and core hours. A row
    # of "tasks" has the bytes of a task's record and the particles per second of a core.
    planned = []
    tasks = {(row["shape"], row["equations"]): row for row in throughput["tasks"]}
    for plan in _PLANS:
        task = tasks[plan["shape"], plan["equations"]]
        # Plans end at the slow time of the measurement: the number of rotations, and with it the cost of full
        # equations, grows in proportion to St.
        slower = 1.0
        if plan["equations"] == "full":
            slower = plan["stokes"] / throughput["settings"]["stokes"]
        count = ceil(plan["particles"] / _BLOCK)
        mib = count * task["record_bytes"] / _BYTES_OF_MIB
        seconds = plan["particles"] / task["per_second"] * slower
        planned.append(plan | {"tasks": count, "mib": mib, "hours": seconds / 3600})
    # If the measured process failed there is no number, and the page shows 0.
    memory_mib = (throughput["memory"]["bytes"] or 0) / _BYTES_OF_MIB
    return fill(
        "throughput",
        made=_made(throughput),
        repeats=_repeats(throughput),
        block=_BLOCK,
        plan=planned,
        mib=memory_mib,
        **throughput,
    )


def _repeats(throughput: Throughput) -> str:
    """By how much the turns of a measurement differ, in words, or that it was not kept."""
    # How much longer the slower turns take than the fastest, over the time of the fastest.
    longer = []
    for row in (*throughput["full"], *throughput["long"], *throughput["tasks"]):
        # Columns of speeds differ in their prefix: "full" has equal steps and "taylor_"; "tasks" has whole
        # tasks, runs whose end alone is read ("end_"), and runs with samples ("sampled_").
        for prefix in ("", "taylor_", "end_", "sampled_"):
            if f"{prefix}slower_per_second" in row:
                ratio = row[f"{prefix}per_second"] / row[f"{prefix}slower_per_second"]
                longer.append(ratio - 1)
    if not longer:
        return "the spread of repeats was not kept"
    return f"three turns in four take at most {percent(median(longer))} longer, in the median"
