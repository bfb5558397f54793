"""Figures of averaging: errors against St, by case or as bands; errors and speed of the form `hybrid`."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from polhode.harness.pages.figures.style import colour, power as power_of

_COLOURS = {1: colour("averaged"), 2: colour("averaged-second-order")}
_CROSSING_COLOURS = {False: "#0072B2", True: "#D55E00"}
_ORDER_NAMES = {1: "first order", 2: "second order"}
_SIZE = (8.0, 4.2)  # Inches: two panels beside each other.


@dataclass(frozen=True)
class Line:
    """Errors of one case at its St, by an order of averaging that lets them fall like 1/St^power."""

    order: int
    power: int
    stokes: Sequence[float]
    error: Sequence[float]


def against_stokes(panels: Mapping[str, Sequence[Line]], label: str) -> Figure:
    """A panel for each title, one thin line for each case; dotted, the predicted slopes."""
    figure, row = plt.subplots(
        1, len(panels), figsize=_SIZE, sharex=True, sharey=True, layout="constrained"
    )
    for axes, (title, lines) in zip(row, panels.items(), strict=True):
        for line in lines:
            style = {
                "color": _COLOURS[line.order],
                "linewidth": 1.2,
                "markersize": 3.5,
                "alpha": 0.8,
            }
            axes.loglog(line.stokes, line.error, "o-", **style)
        for order, power in sorted({(line.order, line.power) for line in lines}):
            _prediction(axes, [line for line in lines if line.order == order], power)
        axes.margins(y=0.12)
        if lines:
            axes.legend(loc="upper right", fontsize=10, labelcolor="linecolor", handlelength=1.2)
        axes.set_title(title, loc="left", fontsize=11)
        axes.set_xlabel("Stokes number St", fontsize=11)
        axes.grid(True, linewidth=0.4, alpha=0.5)
    row[0].set_ylabel(label, fontsize=11)
    return figure


@dataclass(frozen=True)
class Band:
    """Errors at St, by an order of averaging: what 2.5 %, half and 97.5 % of the bodies stay below."""

    order: str
    crosses: bool
    stokes: Sequence[float]
    low: Sequence[float]
    middle: Sequence[float]
    high: Sequence[float]


def bands(panels: Mapping[str, Sequence[Band]]) -> Figure:
    """A panel for each title, bands in one colour for bodies that cross L² = 2EI₂ and one for the others."""
    rows = -(-len(panels) // 2)
    figure, grid = plt.subplots(
        rows, 2, figsize=(8.0, 2.5 * rows), sharex=True, sharey=True, layout="constrained"
    )
    for axes, (title, panel) in zip(grid.flat, panels.items(), strict=False):
        for band in panel:
            shade = _CROSSING_COLOURS[band.crosses]
            first = band.order == "first order"
            axes.fill_between(band.stokes, band.low, band.high, color=shade, alpha=0.2, linewidth=0)
            axes.loglog(
                band.stokes, band.middle, "-" if first else "--", color=shade, linewidth=1.6
            )
        axes.set_title(title, loc="left", fontsize=11)
        axes.grid(True, linewidth=0.4, alpha=0.5)
    for axes in grid.flat[len(panels) :]:
        axes.set_visible(False)
    for axes in grid[-1]:
        axes.set_xlabel("Stokes number St", fontsize=11)
    for axes in grid[:, 0]:
        axes.set_ylabel("error", fontsize=11)
    grid[0, 0].set_ylim(1e-10, 3.0)
    handles = [
        Line2D([], [], color=_CROSSING_COLOURS[False], label="first order, does not cross"),
        Line2D([], [], color=_CROSSING_COLOURS[False], ls="--", label="second order"),
        Line2D([], [], color=_CROSSING_COLOURS[True], label="first order, crosses L² = 2EI₂"),
    ]
    figure.legend(handles=handles, loc="outside upper center", ncols=3, fontsize=10, frameon=False)
    return figure


def errors_and_speed(runs: Any, speeds: Any) -> Figure:
    """Two panels on the form `hybrid`: measured over requested error; speed over two full solvers."""
    figure, (left, right) = plt.subplots(1, 2, figsize=_SIZE, layout="constrained")
    draw = np.random.default_rng(0)
    for stokes, stokes_runs in runs.groupby("stokes"):
        asked = stokes_runs["error"] * 10 ** draw.uniform(-0.6, 0.6, len(stokes_runs))
        left.loglog(
            asked,
            stokes_runs["slow"],
            ".",
            markersize=4,
            alpha=0.6,
            label=f"St = {power_of(stokes)}",
        )
    for asked in sorted(runs["error"].unique()):
        left.plot([asked / 4, asked * 4], [asked, asked], color="black", linewidth=1.5)
    left.set_xlabel("error asked for (spread sideways)", fontsize=11)
    left.set_ylabel("slow error over $I_{max}$; black: asked for", fontsize=11)
    for name, marker in (("spheroids", "o"), ("triaxial", "^")):
        body_speeds = speeds[speeds["bodies"] == name]
        stokes = body_speeds["stokes"] * 10 ** draw.uniform(-0.25, 0.25, len(body_speeds))
        right.loglog(stokes, body_speeds["gain"], marker, markersize=5, alpha=0.7, label=name)
    right.axhline(1.0, color="black", linewidth=1.5)
    right.set_xlabel("Stokes number St (spread sideways)", fontsize=11)
    right.set_ylabel("times as fast as cyrk-vern8 or taylor", fontsize=11)
    for axes in (left, right):
        # Within the panel it would hide the largest errors.
        axes.legend(
            fontsize=9, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2, frameon=False
        )
    return figure


def _prediction(axes: Axes, lines: Sequence[Line], power: int) -> None:
    """A dotted line of the predicted slope above nine in ten of the errors."""
    stokes = np.concatenate([line.stokes for line in lines])
    errors = np.concatenate([line.error for line in lines])
    ends = np.array([stokes.min(), stokes.max()])
    order = lines[0].order
    exponent = f"^{power}" if power > 1 else ""
    label = f"{_ORDER_NAMES[order]}, dotted: $\\propto 1/\\mathrm{{St}}{exponent}$"
    heights = np.quantile(errors * stokes**power, 0.9) / ends**power
    axes.loglog(ends, heights, ":", color=_COLOURS[order], linewidth=2, label=label)
