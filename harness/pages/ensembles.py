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

# Files beside the page; `texts/sweep.md` describes them.
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
# Components of a moment, and Stokes numbers from the smallest to the largest.
_DASHES = ("-", "--", ":")
_COLOURS = "viridis"
# In standard deviations: 95 % of a normal variable lie within this distance of its mean.
_STANDARD = 1.96
# Sweeps whose cost is laid out.
_PLANS = tomllib.loads(Path(__file__).with_name("plans.toml").read_text(encoding="utf-8"))["plans"]
_BLOCK = 100_000  # Particles of one task of such a sweep.

Found = dict[str, Any]


def write_results(
    sweep: Sweep, store: Store, folder: Path, command: str
) -> tuple[Path, list[dict[str, Any]]]:
    """Write the page and the CSV files, those with rows; returns the page's path, and a row for each ensemble."""
    ensembles = []
    pictures = []
    written = dict[str, csv.DictWriter]()
    with ExitStack() as files:
        # Memory holds one task of the store, and the statistics of one shape.
        for _, same in groupby(sweep.ensembles, key=lambda ensemble: ensemble.ellipsoid.semi_axes):
            of_shape = [(ensemble, gather(ensemble, store)) for ensemble in same]
            for ensemble, statistics in of_shape:
                ensembles.append(summary.ensemble_row(ensemble, statistics))
                for name, make in _FILES.items():
                    for row in make(ensemble, statistics):
                        if name not in written:
                            file = files.enter_context(PartialFile(folder / name, summed=True))
                            written[name] = csv.DictWriter(file, list(row))
                            written[name].writeheader()
                        written[name].writerow(row)
            pictures.append((f"shape-{len(pictures) + 1}", _shape(ensembles[-1])))
            save(picture(of_shape), folder, pictures[-1][0])
    top = header(sweep.title, command, surroundings(sweep, store))
    write_file(
        folder / "README.md",
        _page(
            top,
            ensembles,
            [name for name in _FILES if name in written],
            pictures,
            in_flow=sweep.ensembles[0].any_scene.flow is not None,
        ),
    )
    for name in _FILES.keys() - written.keys():
        # A run by an earlier version left it.
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
    rows = []
    for ensemble in ensembles:
        arrived_at = ensemble["arrived"].items()
        ends = [f"{name}: {_interval(interval, '–')}" for name, interval in arrived_at]
        times = ensemble["transient_time"]
        columns = {
            "shape": _shape(ensemble),
            "failed": sum(ensemble["failures"].values()),
            "ends": "; ".join(ends) or "–",
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


def picture(of_shape: Sequence[tuple[Ensemble, Statistics]]) -> Any:
    """Ensembles of one shape in a row of panels, a colour for each Stokes number; bands hold 95 %."""
    figure, panels = plt.subplots(1, 3, figsize=(13, 3.8), layout="constrained")
    shades = mpl.colormaps[_COLOURS](np.linspace(0.05, 0.85, len(of_shape)))
    slow = all(
        ensemble.slow_time is not None and np.isfinite(ensemble.stokes) for ensemble, _ in of_shape
    )
    for (ensemble, statistics), shade in zip(
        sorted(of_shape, key=lambda pair: pair[0].stokes), shades, strict=True
    ):
        unit = ensemble.stokes if slow else 1.0
        _moments(panels[0], ensemble, statistics, unit, shade)
        _distribution(panels[1], ensemble, statistics, shade)
        for k, attractor in enumerate(ensemble.attractors):
            shares = arrived(statistics, k)
            times = np.linspace(0.0, ensemble.time, ensemble.samples) / unit
            name = f"{attractor.rotation}, St = {power(ensemble.stokes)}"
            panels[2].plot(
                times, [share.value for share in shares], color=shade, ls=_DASHES[k % 3], label=name
            )
            low = [share.low for share in shares]
            high = [share.high for share in shares]
            panels[2].fill_between(times, low, high, color=shade, alpha=0.2, linewidth=0)
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
        times = np.array(snapshot_times(ensemble)) / unit
        label = f"$p_{name}^2$" if oriented else f"$L_{name}$"
        name = f"{label}, St = {power(ensemble.stokes)}"
        axes.plot(times, mean[place], color=shade, ls=_DASHES[i], label=name)
        band = _STANDARD * error[place]
        axes.fill_between(
            times, mean[place] - band, mean[place] + band, color=shade, alpha=0.2, linewidth=0
        )
    axes.set_ylabel(
        "mean of the axis' squared components" if oriented else "mean of L over $I_{max}$"
    )


def _distribution(axes: Axes, ensemble: Ensemble, statistics: Statistics, shade: Any) -> None:
    """Histograms of L_z at the start, after about a fifth of the run, and at the end."""
    edges = ensemble.layout.edges("Lz")
    fifth = -(-(ensemble.snapshots - 1) // 5)
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


def write_page(throughput: Found, folder: Path) -> Path:
    """Write ``throughput.json``, a picture of it and ``throughput.md`` into a folder; returns the page's path."""
    write_file(folder / "throughput.json", json.dumps(throughput, indent=1) + "\n")
    save(_speeds(throughput["full"]), folder, "throughput")
    return write_file(folder / "throughput.md", page(throughput))


def page(throughput: Found) -> str:
    """The measured figures as a page."""
    # Tasks, bytes in the store and core hours of large sweeps, in blocks of `_BLOCK`, from measured
    # whole tasks.
    rows = []
    tasks = {(row["shape"], row["equations"]): row for row in throughput["tasks"]}
    for plan in _PLANS:
        row = tasks[plan["shape"], plan["equations"]]
        # The number of rotations, and with it the cost of full equations, grows in proportion to
        # St.
        slower = (
            plan["stokes"] / throughput["settings"]["stokes"]
            if plan["equations"] == "full"
            else 1.0
        )
        count = -(-plan["particles"] // _BLOCK)
        seconds = plan["particles"] / row["per_second"] * slower
        rows.append(
            plan
            | {"tasks": count, "mib": count * row["record_bytes"] / 2**20, "hours": seconds / 3600}
        )
    top = header("What ensembles cost", "polhode throughput", [throughput])
    mib = (throughput["memory"]["bytes"] or 0) / 2**20
    return fill("throughput", header=top, block=_BLOCK, plan=rows, mib=mib, **throughput)


def _speeds(rows: list[Found]) -> Any:
    """Particles per second against the largest error, a colour for each shape."""
    figure, axes = plt.subplots(figsize=(6.5, 4), layout="constrained")
    shapes = pd.DataFrame(rows).groupby("shape", sort=False)
    for (shape, some), shade in zip(shapes, ("#0072B2", "#D55E00"), strict=False):
        for whose, line, name in (("", "o-", "equal steps"), ("taylor_", "s:", "Taylor")):
            errors = some[f"{whose}error"]
            speeds = some[f"{whose}per_second"]
            axes.loglog(errors, speeds, line, color=shade, label=f"{name}, {shape}")
    axes.set(xlabel="largest error of the whole state", ylabel="particles per second and core")
    axes.grid(True, which="both", linewidth=0.4, alpha=0.5)
    axes.legend(frameon=False)
    return figure
