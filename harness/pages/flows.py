"""The page of linear flows: cost beside shear, closed orbits and alignment, tracks, stated errors.

A linear flow is u = A x. A planar one has A₁₂ = 1, A₂₁ = α and no other component. There the axis of a
spheroid of aspect ratio κ without inertia turns with the period 4π/√((1 - α)² - B²(1 + α)²). The
spheroid's anisotropy is B = (κ² - 1)/(κ² + 1). The root is real up to the threshold
α = (1 - |B|)/(1 + |B|); at larger α the axis aligns. A track is a gradient A(t) given at knots, with a
cubic spline between them. The tables' columns are the keys of the rows of
`polhode.harness.flows.measure`: `theory` is the period of the formula, infinite beyond the
threshold, and `apart` a difference or an angle in rad.
"""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from polhode.harness.analysis.frames import read_csv
from polhode.harness.common.files import read_file, write_file
from polhode.harness.common.machine import provenance
from polhode.harness.common.store import Record
from polhode.harness.flows import measure
from polhode.harness.pages.figures.style import (
    INK,
    TITLE,
    caption,
    key,
    panels,
    ramp,
    save,
    square_decades,
)
from polhode.harness.pages.tables import fill

_TITLE = "Linear flows other than simple shear"
_HEIGHT = 3.7  # Inches of the figure; chosen by eye.
# Points of a theoretical curve from α = -1 to its threshold: near there the period rises without
# bound, and fewer points show corners.
_CURVE_POINTS = 2000
# Ends of the axes of periods, in 1/γ̇, and of α. They hold the periods and thresholds of
# `measure._ALPHAS` and `_RATIOS`. Other values ask for other limits: points outside are not shown.
_PERIODS = (5.0, 100.0)
_ALPHAS = (-1.0, 0.6)
# The order of a cubic spline: the power of the spacing of knots by which errors along a track fall.
_SPLINE_ORDER = 4


def write_tables(tables: Mapping[str, Sequence[Record]], timed: Record, folder: Path) -> None:
    """Write the tables of `polhode.harness.flows.measure` into a folder; `timed` records machine and versions."""
    for name, rows in tables.items():
        write_file(folder / f"{name}.csv", pd.DataFrame(rows).to_csv(index=False), summed=True)
    write_file(folder / "timed.json", json.dumps(timed, indent=2) + "\n", summed=True)


def write_page(folder: Path, command: str) -> Path:
    """Write the page and its figure from the tables in a folder; the path of the page.

    Raises OSError if a table is missing.
    """
    tables = read_tables(folder)
    note = (
        "Left: period of the axis at St = 0 (Jeffery's equations). Right: L at "
        f"t = {measure.TRACK_TIME:g} against the flow that the track was taken from. "
        "No computing times are shown."
    )
    save(figure(tables["orbits"], tables["orders"], note), folder, "flows")
    return write_file(folder / "README.md", page(folder, command))


def read_tables(folder: Path) -> dict[str, Any]:
    """The tables of a page, each under its name; OSError if one is missing."""
    return {name: read_csv(folder / f"{name}.csv") for name in measure.TABLES}


def page(folder: Path, command: str) -> str:
    """The page as Markdown."""
    tables = read_tables(folder)
    timed = json.loads(read_file(folder / "timed.json"))
    return fill(
        "flows",
        title=_TITLE,
        made=provenance(command, [timed]),
        findings=findings(tables),
        fields=_rows(tables["fields"]),
        costs=_rows(tables["costs"]),
        orbits=_rows(_by_ratio(tables["orbits"])),
        extension=_rows(tables["extension"]),
        orders=_rows(_with_order(tables["orders"])),
        knots=_rows(tables["knots"]),
        stated=_rows(bounded(tables["stated"])),
        measured=measure,
    )


def _rows(table: Any) -> list[dict[str, Any]]:
    """The rows of a frame as mappings, which templates read."""
    return [{str(name): value for name, value in row.items()} for row in table.to_dict("records")]


def findings(tables: Mapping[str, Any]) -> list[str]:
    """The findings of the tables, in sentences; `tables` come from `read_tables`."""
    costs = tables["costs"]
    orbits = tables["orbits"]
    knots = tables["knots"]
    # `ratio` is the time by the equations of any flow over that by shear's.
    cyrk = costs[costs["solver"].str.startswith("cyrk")]
    taylor = costs[costs["solver"] == "taylor"]
    closed = orbits[np.isfinite(orbits["theory"])]
    aligned = orbits[~np.isfinite(orbits["theory"])]
    # The slope of log error against log spacing is the order.
    log_spacing, log_error = np.log(tables["orders"][["spacing", "error"]].to_numpy(float)).T
    order, _ = np.polyfit(log_spacing, log_error, 1)
    # Solvers that go on over a knot, and the others, which start anew at each.
    goes_on = knots["solver"].str.startswith("cyrk") | (knots["solver"] == "taylor")
    going_on = knots[goes_on]
    restarting = knots[~goes_on]
    counts = bounded(tables["stated"])
    runs = counts["runs"].sum()
    return [
        f"Given shear's matrix, the equations of any flow give the rates of shear to "
        f"{tables['fields']['apart'].max():.1e} of their norm, at {tables['fields']['states'].min()} "
        "random states of each form.",
        f"A constant gradient takes {cyrk['ratio'].min():.2f} to {cyrk['ratio'].max():.2f} times the "
        f"time of shear by CyRK, {taylor['ratio'].min():.2f} to {taylor['ratio'].max():.2f} times by "
        "Taylor's method.",
        f"{len(closed)} orbits in planar flows close after the period of theory to "
        f"{closed['apart'].max():.1e}; {len(aligned)} axes beyond the threshold align to "
        f"{aligned['apart'].max():.1e} rad.",
        f"Errors along a track fall like the spacing of its knots to the power {order:.1f}.",
        f"A knot costs {going_on['knot_us'].min():.0f} to {going_on['knot_us'].max():.0f} µs beyond the run "
        f"in a constant flow by CyRK's explicit methods and Taylor's, {restarting['knot_us'].min():.0f} to "
        f"{restarting['knot_us'].max():.0f} µs by the others, which start anew at each.",
        f"Of {runs} random runs, half of them along tracks, {counts['slow'].sum() / runs:.1%} stay "
        f"within the error of L and E that they state, {counts['angle'].sum() / runs:.1%} within that "
        "of the orientation, held against an integration of its own in long double.",
    ]


def bounded(stated: Any) -> pd.DataFrame:
    """Runs by form and kind of flow, and how many of them stay within the errors that they state.

    `slow` (L and E over I_max) and `angle` (of the orientation, rad) are errors against the integration in long
    double. `slow_high` and `angle_high` are the upper ends that the run states, `requested` is the error of L and E.
    The result counts, under `slow` and `angle`, the runs within the stated errors; `met` counts those within
    the requested one, `runs` all.
    """
    # A failed run has infinite errors, and states none that hold.
    judged = stated.assign(
        slow=np.isfinite(stated["slow"]) & (stated["slow"] <= stated["slow_high"]),
        angle=np.isfinite(stated["angle"]) & (stated["angle"] <= stated["angle_high"]),
        met=stated["slow"] <= stated["requested"],
        flow=stated["track"].map({True: "track", False: "constant"}),
    )
    groups = judged.groupby(["form", "flow"], sort=False)
    return groups[["slow", "angle", "met"]].sum().assign(runs=groups.size()).reset_index()


def _by_ratio(orbits: Any) -> pd.DataFrame:
    """One row for each aspect ratio: its threshold, orbits that close, axes that align.

    `period` is the largest relative difference of a measured period from theory. `apart` is the largest difference
    of the axis after a period from its start, `angle` the largest one, in rad, from the direction of theory.
    """
    rows = []
    for ratio, ratio_orbits in orbits.groupby("ratio"):
        closed = ratio_orbits[np.isfinite(ratio_orbits["theory"])]
        aligned = ratio_orbits[~np.isfinite(ratio_orbits["theory"])]
        rows.append(
            {
                "ratio": ratio,
                "threshold": _threshold(float(str(ratio))),
                "closed": len(closed),
                "period": float((closed["period"] / closed["theory"] - 1).abs().max()),
                "apart": float(closed["apart"].max()),
                "aligned": len(aligned),
                "angle": float(aligned["apart"].max()),
            }
        )
    return pd.DataFrame(rows)


def _threshold(ratio: float) -> float:
    """The α from which on the axis of a spheroid of that aspect ratio aligns (the module's docstring)."""
    anisotropy = abs(measure.anisotropy(ratio))
    return (1 - anisotropy) / (1 + anisotropy)


def _with_order(orders: Any) -> pd.DataFrame:
    """The rows with a column `order`: the slope of log error against log spacing from the row before."""
    fall = np.log(orders["error"]).diff() / np.log(orders["spacing"]).diff()
    return orders.assign(order=fall)


def figure(orbits: Any, orders: Any, note: str = "") -> Figure:
    """Periods in planar flows with their theory, and errors along tracks against the spacing of knots.

    `orbits` and `orders` are tables of `read_tables`; `note` stands below.
    """
    # The right panel is narrow: errors go over more decades than spacings, and decades have one length.
    drawn, grid = panels(1, 2, _HEIGHT, width_ratios=[3, 1])
    _draw_periods(grid[0, 0], orbits)
    _draw_orders(grid[0, 1], orders)
    handles = [
        Line2D([], [], color=INK, marker="o", markersize=4, linewidth=0, label="measured"),
        # `_SPLINE_ORDER` in words.
        Line2D([], [], color=INK, linewidth=1.3, label="theory; at the right a fourth power"),
    ]
    ratios = [float(str(ratio)) for ratio, _ in orbits.groupby("ratio")]
    for ratio, shade in zip(ratios, ramp(len(ratios)), strict=True):
        handles.append(Line2D([], [], color=shade, linewidth=2, label=f"κ = {ratio:g}"))
    key(drawn, handles, 3, columnspacing=0.8)
    caption(drawn, note)
    return drawn


def _draw_periods(axes: Axes, orbits: Any) -> None:
    """Measured periods as points on the formula's curve, by aspect ratio, against α."""
    groups = list(orbits.groupby("ratio"))
    for (ratio, ratio_orbits), shade in zip(groups, ramp(len(groups)), strict=True):
        kappa = float(str(ratio))
        threshold = _threshold(kappa)
        # Without the ends: at the threshold the period is infinite. At α = -1 it is 2π for every κ, and the
        # curve begins one point beside it.
        alphas = np.linspace(-1.0, threshold, _CURVE_POINTS)[1:-1]
        theory = [measure.period(float(alpha), kappa) for alpha in alphas]
        axes.plot(alphas, theory, color=shade, linewidth=1.3)
        closed = ratio_orbits[np.isfinite(ratio_orbits["theory"])]
        axes.plot(closed["alpha"], closed["period"], "o", color=shade, markersize=4)
        axes.axvline(threshold, color=shade, linewidth=0.8, linestyle=":")
    axes.set_yscale("log")
    axes.set_ylim(*_PERIODS)
    axes.set_yticks([5, 10, 20, 50, 100], ["5", "10", "20", "50", "100"])
    axes.minorticks_off()
    axes.set_xlim(*_ALPHAS)
    axes.set_xticks([-1, -0.5, 0, 0.5])
    axes.set_xlabel("α of u = (y, αx, 0): -1 rotates, 0 shears")
    axes.set_ylabel("period of the axis, 1/γ̇")
    axes.set_title("Axis ratio κ; dotted: threshold", loc="left", fontsize=TITLE)


def _draw_orders(axes: Axes, orders: Any) -> None:
    """Errors as points, and a line through the last one that falls with the order of a cubic spline."""
    spacing = orders["spacing"].to_numpy(float)
    error = orders["error"].to_numpy(float)
    # The darkest colour of the ramp.
    axes.loglog(spacing, error, "o", color=ramp(3)[2], markersize=5)
    prediction = error[-1] * (spacing / spacing[-1]) ** _SPLINE_ORDER
    axes.loglog(spacing, prediction, "-", color=INK, linewidth=1.0)
    axes.set_xlabel("spacing of\nknots, 1/γ̇")
    axes.set_ylabel("error of L over $I_{max}$")
    axes.minorticks_off()
    axes.set_xlim(spacing.min() / 2, spacing.max() * 2)
    axes.set_xticks([0.1, 1.0], ["0.1", "1"])
    square_decades(axes)
    axes.set_title("Along a track", loc="left", fontsize=TITLE)
