"""Errors of averaging against St, case by case, beside the predicted slopes.

A case is a body with a start (`polhode.harness.averaging.cases`). Looks and sizes without a reason are
chosen by eye (`style`).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from polhode.harness.pages.figures.style import (
    INK,
    TITLE,
    caption,
    colour,
    key,
    panels,
    square_decades,
)

# Looks of the two orders of averaging.
_COLOURS = {1: colour("averaged"), 2: colour("averaged-second-order")}
_MARKERS = {1: "o", 2: "s"}
_NAMES = {1: "first order", 2: "second order"}
_HEIGHT = 5.9  # Inches.
_MARGINS = {"x": 0.1, "y": 0.05}  # Shares of a panel's sides around its lines; chosen by eye.
# Share of the errors that lie below a dotted line of the predicted slope; a choice.
_SHARE_BELOW = 0.9


@dataclass(frozen=True)
class Line:
    """Errors of one case at its St, by an order of averaging, 1 or 2, that lets them fall like 1/St^power."""

    order: int
    power: int
    stokes: Sequence[float]
    error: Sequence[float]


def against_stokes(
    lines_by_title: Mapping[str, Sequence[Line]], label: str, note: str = ""
) -> Figure:
    """A panel for each title, one thin line for each case; dotted, the predicted slopes.

    A decade of the error is as long as one of St. `label` is for the axis of errors, `note` stands below.
    """
    figure, grid = panels(1, len(lines_by_title), _HEIGHT, sharex=True, sharey=True)
    predicted = set()
    for axes, (title, lines) in zip(grid[0], lines_by_title.items(), strict=True):
        for line in lines:
            style = {"color": _COLOURS[line.order], "marker": _MARKERS[line.order]}
            axes.loglog(line.stokes, line.error, linewidth=1.0, markersize=4, alpha=0.8, **style)
        for order, power in sorted({(line.order, line.power) for line in lines}):
            alike = [line for line in lines if (line.order, line.power) == (order, power)]
            _prediction(axes, alike, power)
            predicted.add((order, power))
        axes.margins(**_MARGINS)
        axes.set_title(title, loc="left", fontsize=TITLE, color=INK)
        axes.set_xlabel("Stokes number")
        axes.minorticks_off()
        square_decades(axes)
    grid[0, 0].set_ylabel(label)
    handles = []
    for order, name in _NAMES.items():
        powers = sorted(power for line_order, power in predicted if line_order == order)
        slopes = " or ".join(f"$1/\\mathrm{{St}}{f'^{p}' if p > 1 else ''}$" for p in powers)
        style = {"color": _COLOURS[order], "marker": _MARKERS[order], "markersize": 5}
        if powers:
            handles.append(Line2D([], [], label=f"{name}, dotted: {slopes}", **style))
    key(figure, handles, 2)
    caption(figure, note)
    return figure


def _prediction(axes: Axes, lines: Sequence[Line], power: int) -> None:
    """Draw a dotted line of the predicted slope above nine in ten of the errors.

    Its height is the 90 % quantile of error · St^power, which is constant if the prediction holds.
    """
    stokes = np.concatenate([line.stokes for line in lines])
    errors = np.concatenate([line.error for line in lines])
    ends = np.array([stokes.min(), stokes.max()])
    heights = np.quantile(errors * stokes**power, _SHARE_BELOW) / ends**power
    axes.loglog(ends, heights, ":", color=_COLOURS[lines[0].order], linewidth=2)
