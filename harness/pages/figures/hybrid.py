"""The figure of the form `hybrid`: how errors keep to those requested, and how fast it is.

`hybrid` averages the parts of a run where that is accurate enough for the tolerance, and solves the
full equations in the others. `polhode.harness.averaging.hybrid` makes the tables that are drawn.
Looks and sizes without a reason are chosen by eye (`style`).
"""

from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from polhode.harness.pages.figures.style import (
    INK,
    TITLE,
    WIDTH,
    caption,
    key,
    percent_axis,
    plain,
    power,
    ramp,
)

_HEIGHT = 4.7  # Inches; chosen by eye.
# Ends of the axis of the measured error over the allowed one. Smaller ratios stand at the left edge.
# Larger ones are cut off: reports/hybrid has none. Chosen by eye.
_LEAST_RATIO = 1e-3
_LARGEST_RATIO = 30.0
# Left end of the axis of gains, unless one is smaller: the line at 1 then stands off the edge.
_LEAST_GAIN = 0.7
# Dashes of the two kinds of bodies.
_BODIES = {"spheroids": "-", "triaxial": "--"}
_LINE_WIDTH = 1.8  # Points, of a distribution.


def errors_and_speed(runs: Any, speeds: Any, note: str = "") -> Figure:
    """Empirical distributions, a line for each St: of errors, a panel for each requested error; of speeds below.

    Runs whose error is above the one requested, and above the reference's uncertainty, are circled.

    Parameters
    ----------
    runs : DataFrame
        `stokes`; `error`, the requested one; `slow`, the measured error of L and E; `uncertainty` of the
        reference. All errors are over I_max.
    speeds : DataFrame
        `stokes`; `bodies`, "spheroids" or "triaxial"; `gain`, the time of the faster full solver over
        that of `hybrid`.
    note : str
        Stands below.
    """
    requested = sorted(runs["error"].unique(), reverse=True)
    numbers = sorted({*runs["stokes"], *speeds.dropna(subset=["gain"])["stokes"]})
    shades = dict(zip(numbers, ramp(len(numbers)), strict=True))
    drawing = plt.figure(figsize=(WIDTH, _HEIGHT), layout="constrained")
    grid = drawing.add_gridspec(2, max(1, len(requested)))
    first: Axes | None = None
    for place, error in enumerate(requested):
        axes = drawing.add_subplot(grid[0, place], sharey=first)
        first = first or axes
        _errors(axes, runs[runs["error"] == error], shades)
        axes.set_title(f"Error {power(error)}", fontsize=TITLE, loc="left", color=INK)
        if place:
            axes.tick_params(labelleft=False)
        else:
            percent_axis(axes)
            axes.set_ylabel("share of the runs")
    speed = drawing.add_subplot(grid[1, :])
    _speeds(speed, speeds, shades)
    handles = [
        Line2D([], [], color=shade, linewidth=2, label=f"St = {power(stokes)}")
        for stokes, shade in shades.items()
    ]
    handles.append(
        Line2D([], [], marker="o", fillstyle="none", color=INK, linewidth=0, label="missed")
    )
    key(drawing, handles, 3)
    caption(drawing, note)
    return drawing


def _errors(axes: Axes, runs: Any, shades: dict[float, str]) -> None:
    """Share of the runs whose measured error over the allowed one is at most the value on the axis, by St.

    Allowed is the requested error or, if it is larger, the reference's uncertainty. A failed run has no ratio and
    counts among the runs: its line ends below 100 %.
    """
    for stokes, stokes_runs in runs.groupby("stokes"):
        allowed = stokes_runs[["error", "uncertainty"]].max(axis=1)
        ratios = np.sort((stokes_runs["slow"] / allowed).dropna().to_numpy(float))
        shares = np.arange(1, len(ratios) + 1) / len(stokes_runs)
        # A run whose error is 0 stands at the left edge too: 0 has no place on a logarithmic axis.
        ratios = np.maximum(ratios, _LEAST_RATIO)
        shade = shades[float(str(stokes))]
        axes.step(ratios, shares, where="post", color=shade, linewidth=_LINE_WIDTH)
        missed = ratios > 1
        # Circles at the edge of the panel stand out whole, and move nothing.
        style = {"marker": "o", "markersize": 6, "fillstyle": "none", "linewidth": 0}
        style |= {"clip_on": False, "in_layout": False}
        axes.plot(ratios[missed], shares[missed], color=INK, zorder=3, **style)
    axes.axvline(1.0, color=INK, linewidth=1.0)
    axes.set_xscale("log")
    axes.set_xlim(_LEAST_RATIO, _LARGEST_RATIO)
    axes.set_xticks([1e-2, 1], ["0.01", "1"])
    axes.set_xlabel("measured over allowed")
    plain(axes)


def _speeds(axes: Axes, speeds: Any, shades: dict[float, str]) -> None:
    """Share of the bodies whose gain is at least the value on the axis, by St and kind of bodies."""
    drawn = speeds.dropna(subset=["gain"])
    for (stokes, bodies), group in drawn.groupby(["stokes", "bodies"]):
        # From the largest gain down: the share that reaches a gain grows.
        gains = np.sort(group["gain"].to_numpy(float))[::-1]
        shares = np.arange(1, len(gains) + 1) / len(gains)
        dash = _BODIES.get(str(bodies), "-")
        axes.step(
            np.append(gains, gains[-1:]),
            np.append(shares, 1.0),
            where="pre",
            color=shades[float(str(stokes))],
            linestyle=dash,
            linewidth=_LINE_WIDTH,
        )
    axes.axvline(1.0, color=INK, linewidth=1.0)
    axes.set_xscale("log")
    low, high = axes.get_xlim()
    axes.set_xlim(min(low, _LEAST_GAIN), high)
    axes.set_xlabel("at least so many times as fast as the faster of the full solvers")
    title = "Speed at equal error; dashed: triaxial bodies"
    axes.set_title(title, fontsize=TITLE, loc="left", color=INK)
    percent_axis(axes)
    axes.set_ylabel("share of the bodies")
    plain(axes)
