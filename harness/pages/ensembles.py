"""The pages on ensembles: of a sweep, with CSV files for the rest, and of what `polhode throughput` measured."""

import csv
import json
import tomllib
from collections.abc import Sequence
from contextlib import ExitStack
from functools import partial
from itertools import groupby
from pathlib import Path
from typing import Any

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from polhode.harness.common.files import PartialFile, write_file
from polhode.harness.common.machine import header
from polhode.harness.common.store import Store
from polhode.harness.common.text import percent, short
from polhode.harness.ensembles import summary
from polhode.harness.ensembles.ensemble import Ensemble
from polhode.harness.ensembles.statistics import RATES, SECOND, SLOW_NAMES, Statistics
from polhode.harness.ensembles.summary import arrived, means, snapshot_times
from polhode.harness.ensembles.sweep import NO_TIMES, Sweep, gather, surroundings
from polhode.harness.pages.figures.style import power
from polhode.harness.pages.figures.work_precision import save
from polhode.harness.pages.tables import fill

# What the page says of them stands in `texts/sweep.md`.
FILES = {
    "moments.csv": summary.moment_rows,
    "voigt.csv": summary.voigt_rows,
    "rates.csv": partial(summary.mean_rows, of="rates", rate=RATES),
    "slow.csv": partial(
        summary.mean_rows, of="slow", variable=[f"{name}/Imax" for name in SLOW_NAMES]
    ),
    "distributions.csv": summary.distribution_rows,
    "arrivals.csv": summary.arrival_rows,
}
# Components of a moment, and Stokes numbers from the smallest to the largest.
DASHES, COLOURS = ("-", "--", ":"), "viridis"
# 95 % of a normal variable lie within so many standard deviations.
STANDARD = 1.96
# Sweeps whose cost is laid out.
PLANS = tomllib.loads(Path(__file__).with_name("plans.toml").read_text(encoding="utf-8"))["plans"]
BLOCK = 100_000

Found = dict[str, Any]


def write_results(
    sweep: Sweep, store: Store, folder: Path, command: str
) -> tuple[Path, list[dict[str, Any]]]:
    """Write the page and the CSV files, those with rows; returns the page's path, and a row for each ensemble."""
    ensembles, pictures, written = [], [], dict[str, csv.DictWriter]()
    with ExitStack() as files:
        # Of all that the store holds, one task and the statistics of one shape are in memory.
        for _, same in groupby(sweep.ensembles, key=lambda ensemble: ensemble.ellipsoid.semi_axes):
            found = [(ensemble, gather(ensemble, store)) for ensemble in same]
            for ensemble, statistics in found:
                ensembles.append(summary.ensemble_row(ensemble, statistics))
                for name, make in FILES.items():
                    for row in make(ensemble, statistics):
                        if name not in written:
                            file = files.enter_context(PartialFile(folder / name, summed=True))
                            written[name] = csv.DictWriter(file, list(row))
                            written[name].writeheader()
                        written[name].writerow(row)
            pictures.append((f"shape-{len(pictures) + 1}", _shape(ensembles[-1])))
            save(picture(found), folder, pictures[-1][0])
    top = header(sweep.title, command, surroundings(sweep, store))
    write_file(
        folder / "README.md",
        _page(
            top,
            ensembles,
            [name for name in FILES if name in written],
            pictures,
            in_flow=sweep.ensembles[0].any_scene.flow is not None,
        ),
    )
    for name in FILES.keys() - written.keys():
        # Of a run by an earlier version.
        (folder / name).unlink(missing_ok=True)
    return folder / "README.md", ensembles


def _page(
    top: list[str],
    ensembles: list[dict[str, Any]],
    names: list[str],
    pictures: list[tuple[str, str]],
    *,
    in_flow: bool,
) -> str:
    rows = [
        row
        | {"shape": _shape(row), "failed": sum(row["failures"].values())}
        | {
            "ends": "; ".join(
                f"{name}: {_interval(each, '–')}" for name, each in row["arrived"].items()
            )
            or "–"
        }
        | {
            "median": _interval(row["transient_time"]["0.5"], "later")
            if row["transient_time"]
            else "–"
        }
        | {
            "shares": {
                name: each["value"]
                for name, each in row["arrived"].items()
                if each["value"] is not None
            }
        }
        for row in ensembles
    ]
    settled = groupby((row for row in rows if row["shares"]), key=_shape)
    return fill(
        "sweep",
        header=top,
        rows=rows,
        settled=[(shape, list(same)) for shape, same in settled],
        pictures=pictures,
        files=names,
        no_times=NO_TIMES,
        in_flow=in_flow,
    )


def _shape(row: dict[str, Any]) -> str:
    return " : ".join(short(row[name]) for name in "abc")


def _interval(interval: dict[str, float | None], none: str) -> str:
    value, low, high = (none if end is None else f"{end:.4g}" for end in interval.values())
    return f"{value} ({low} to {high})"


def picture(found: Sequence[tuple[Ensemble, Statistics]]) -> Any:
    """Ensembles of one shape in a row of panels, a colour for each Stokes number; bands hold 95 %."""
    figure, panels = plt.subplots(1, 3, figsize=(13, 3.8), layout="constrained")
    shades = mpl.colormaps[COLOURS](np.linspace(0.05, 0.85, len(found)))
    slow = all(
        ensemble.slow_time is not None and np.isfinite(ensemble.stokes) for ensemble, _ in found
    )
    for (ensemble, statistics), shade in zip(
        sorted(found, key=lambda each: each[0].stokes), shades, strict=True
    ):
        unit = ensemble.stokes if slow else 1.0
        _moments(panels[0], ensemble, statistics, unit, shade)
        _distribution(panels[1], ensemble, statistics, shade)
        for k, attractor in enumerate(ensemble.attractors):
            shares = arrived(statistics, k)
            times = np.linspace(0.0, ensemble.time, ensemble.samples) / unit
            name = f"{attractor.rotation}, St = {power(ensemble.stokes)}"
            panels[2].plot(
                times, [each.value for each in shares], color=shade, ls=DASHES[k % 3], label=name
            )
            ends = [[getattr(each, end) for each in shares] for end in ("low", "high")]
            panels[2].fill_between(times, *ends, color=shade, alpha=0.2, linewidth=0)
    for axes, title in zip(
        panels, ("Orientation in time", "Distribution of $L_z$", "Arrived"), strict=True
    ):
        axes.set_title(title, loc="left")
        axes.grid(True, linewidth=0.4, alpha=0.5)
        if axes is not panels[1]:
            axes.set_xlabel(
                "slow time $t_2 = t/\\mathrm{St}$" if slow else "time, in inverse shear rates"
            )
        if axes.get_legend_handles_labels()[1]:
            axes.legend(fontsize=7, frameon=False)
    panels[2].set(ylabel="fraction of the particles", ylim=(0, 1.02))
    return figure


def _moments(
    axes: Axes, ensemble: Ensemble, statistics: Statistics, unit: float, shade: Any
) -> None:
    """Mean squares of the direction of the last axis, the shortest of a triaxial shape; else means of L."""
    oriented = bool(ensemble.layout.axes)
    mean, error = means(statistics, "second" if oriented else "slow")
    for i, name in enumerate("xyz"):
        place = (
            (slice(None), -1, SECOND.index((i, i)))
            if oriented
            else (slice(None), SLOW_NAMES.index(f"L{name}"))
        )
        times, label = (
            np.array(snapshot_times(ensemble)) / unit,
            f"$p_{name}^2$" if oriented else f"$L_{name}$",
        )
        name = f"{label}, St = {power(ensemble.stokes)}"
        axes.plot(times, mean[place], color=shade, ls=DASHES[i], label=name)
        band = STANDARD * error[place]
        axes.fill_between(
            times, mean[place] - band, mean[place] + band, color=shade, alpha=0.2, linewidth=0
        )
    axes.set_ylabel(
        "mean of the axis' squared components" if oriented else "mean of L over $I_{max}$"
    )


def _distribution(axes: Axes, ensemble: Ensemble, statistics: Statistics, shade: Any) -> None:
    """Histograms of L_z at the start, after about a fifth of the run, and at the end."""
    edges, fifth = ensemble.layout.edges("Lz"), -(-(ensemble.snapshots - 1) // 5)
    part = percent(fifth / (ensemble.snapshots - 1))
    for snapshot, when, line in ((0, "start", ":"), (fifth, part, "--"), (-1, "end", "-")):
        counts = statistics.histograms[snapshot, SLOW_NAMES.index("Lz"), 1:-1]
        share = counts / max(statistics.finished, 1) / np.diff(edges)
        axes.stairs(
            share, edges, color=shade, ls=line, label=f"{when}, St = {power(ensemble.stokes)}"
        )
    axes.set(xlabel="$L_z$ over $I_{max}$", ylabel="density of particles")
    axes.set_yscale("symlog", linthresh=0.1)
    axes.set_ylim(bottom=0)


def write_page(found: Found, folder: Path) -> Path:
    """Write ``throughput.json``, a picture of it and ``throughput.md`` into a folder; returns the page's path."""
    write_file(folder / "throughput.json", json.dumps(found, indent=1) + "\n")
    save(_speeds(found["full"]), folder, "throughput")
    return write_file(folder / "throughput.md", page(found))


def page(found: Found) -> str:
    """The measured figures as a page."""
    # Tasks, bytes in the store and core hours of large sweeps, in blocks of `BLOCK`, from measured
    # whole tasks.
    rows, tasks = [], {(row["shape"], row["equations"]): row for row in found["tasks"]}
    for plan in PLANS:
        row = tasks[plan["shape"], plan["equations"]]
        # The number of rotations, and with it the cost of full equations, grows in proportion to
        # St.
        slower = (
            plan["stokes"] / found["settings"]["stokes"] if plan["equations"] == "full" else 1.0
        )
        count, seconds = (
            -(-plan["particles"] // BLOCK),
            plan["particles"] / row["per_second"] * slower,
        )
        rows.append(
            plan
            | {"tasks": count, "mib": count * row["record_bytes"] / 2**20, "hours": seconds / 3600}
        )
    top, mib = (
        header("What ensembles cost", "polhode throughput", [found]),
        (found["memory"]["bytes"] or 0) / 2**20,
    )
    return fill("throughput", header=top, block=BLOCK, plan=rows, mib=mib, **found)


def _speeds(rows: list[Found]) -> Any:
    """Particles per second against the largest error, a colour for each shape."""
    figure, axes = plt.subplots(figsize=(6.5, 4), layout="constrained")
    shapes = pd.DataFrame(rows).groupby("shape", sort=False)
    for (shape, some), shade in zip(shapes, ("#0072B2", "#D55E00"), strict=False):
        for whose, line, name in (("", "o-", "equal steps"), ("taylor_", "s:", "Taylor")):
            errors, speeds = some[f"{whose}error"], some[f"{whose}per_second"]
            axes.loglog(errors, speeds, line, color=shade, label=f"{name}, {shape}")
    axes.set(xlabel="largest error of the whole state", ylabel="particles per second and core")
    axes.grid(True, which="both", linewidth=0.4, alpha=0.5)
    axes.legend(frameon=False)
    return figure
