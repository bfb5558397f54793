"""Figures: functions that draw on Matplotlib axes and return them."""

import textwrap
from collections.abc import Iterable, Sequence
from itertools import cycle
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from polhode.harness.analysis.frames import by_stokes, where
from polhode.harness.analysis.pareto import pareto_front
from polhode.harness.common.text import short
from polhode.harness.pages.figures.style import GREY, is_averaged, looks, power, rank
from polhode.harness.references.uncertainty import KNOWN, known

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# The band under the Pareto front.
FRONT = "#F7EFA6"
UNKNOWN = f"grey: within {KNOWN:g} times the\nreference's uncertainty"
# Runs beyond this error have failed, whatever their status; they stay in the table.
LARGEST_ERROR = 10.0
# One per full form, where a scene is solved in several.
DASHES = ("-", "--", ":", "-.")
STOPPED = {
    "time_limit": "stopped at the time limit, from this tolerance on",
    "step_limit": "stopped at the limit of steps, from this tolerance on",
}
# In inches: the legend at least, a panel, and a line of small print; the latter and a name of the legend in letters.
LEGEND_WIDTH, PANEL, SMALL_PRINT = 2.3, (5.2, 3.9), 0.11
LINE, NAME = 92, 28
LEGEND_MARGIN = 0.15
NO_BREAK = "\N{NO-BREAK SPACE}"


def work_precision(axes: "Axes", runs: pd.DataFrame, error: str = "slow_error") -> "Axes":
    """Draw cost against error of all runs of one scene; averaged forms by their cheapest runs and their model error.

    A band lies under the Pareto front of the full forms' known runs. Points within `KNOWN` times the reference's
    uncertainty are grey.

    Parameters
    ----------
    axes : matplotlib.axes.Axes
    runs : DataFrame
        Records of one scene (`polhode.harness.analysis.frames.frame`).
    error : str
        Column to draw along x.
    """
    done = where(runs, runs["seconds"].notna() & runs[error].notna())
    forms = [str(form) for form in dict.fromkeys(done["form"])]
    full = [form for form in forms if not is_averaged(form)]
    _front(axes, where(done, done["form"].isin(full) & known(done, error)), error)
    for solver, look in looks(runs["solver"]).items():
        for form, dash in zip(full, cycle(DASHES)):
            own = where(done, (done["solver"] == solver) & (done["form"] == form))
            if own.empty:
                continue
            label = solver if len(full) == 1 else f"{solver}, {form}"
            style = {"marker": look.marker, "color": look.colour, "markersize": 4.5, "linewidth": 1.1}
            axes.plot(*_points(own, error), linestyle=dash, label=label, **style)
            _grey_out(axes, own, error, look.marker, 4.5)
    for form in forms:
        if form not in full:
            _averaged(axes, where(done, done["form"] == form), form, error)
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.grid(True, which="major", linewidth=0.4, alpha=0.5)
    return axes


def _points(runs: pd.DataFrame, error: str) -> tuple[np.ndarray, np.ndarray]:
    return runs[error].to_numpy(float), runs["seconds"].to_numpy(float)


def _front(axes: "Axes", runs: pd.DataFrame, error: str) -> None:
    front = pareto_front(where(runs, runs["status"] == "reached_end"), error)
    if len(front):
        band = {"color": FRONT, "solid_capstyle": "round", "solid_joinstyle": "round", "zorder": 0.5}
        axes.plot(*_points(front, error), linewidth=7, label="Pareto front", **band)


def _grey_out(axes: "Axes", runs: pd.DataFrame, error: str, marker: Any, size: float) -> None:
    """Cover the points that lie below what the reference resolves in grey."""
    unknown = where(runs, ~known(runs, error))
    if len(unknown):
        style = {"marker": marker, "markersize": size, "linewidth": 0, "color": GREY, "zorder": 2.5}
        label = "_again" if UNKNOWN in axes.get_legend_handles_labels()[1] else UNKNOWN
        axes.plot(*_points(unknown, error), label=label, **style)


def _averaged(axes: "Axes", runs: pd.DataFrame, form: str, error: str) -> None:
    look, front = looks([form])[form], pareto_front(runs, error)
    style = {"marker": look.marker, "markersize": 9, "linewidth": 0, "color": look.colour}
    axes.plot(*_points(front, error), label=f"{form} form,\ncheapest runs", **style)
    _grey_out(axes, front, error, look.marker, 9)
    model = runs[f"model_{error}"].dropna()
    if not model.empty:
        label = f"{form} form,\nmodel error"
        axes.axvline(float(model.iloc[0]), color=look.colour, linewidth=1.0, linestyle=":", label=label)


def failures(runs: pd.DataFrame) -> list[str]:
    """What has no point, line by line: the methods of each status that is no success, with their tolerances.

    Lines are as long as a panel is wide.
    """
    failed = where(runs, runs["status"] != "reached_end")
    lines = []
    for status in dict.fromkeys(failed["status"]):
        own = where(failed, failed["status"] == status)
        names = []
        for solver in dict.fromkeys(own["solver"]):
            tolerances = own.loc[own["solver"] == solver, "tolerance"].astype(float)
            loosest, tightest = short(tolerances.max()), short(tolerances.min())
            alone = status in STOPPED or loosest == tightest
            names.append(f"{solver} {loosest}" if alone else f"{solver} {loosest} to {tightest}")
        heading = STOPPED.get(status, f"{str(status).replace('_', ' ')}, at tolerance")
        text = f"{heading}: {',  '.join(name.replace(' ', NO_BREAK) for name in names)}"
        wrapped = textwrap.wrap(text, LINE, break_long_words=False, break_on_hyphens=False, subsequent_indent="   ")
        lines += [line.replace(NO_BREAK, " ") for line in wrapped]
    return lines


def mark_failures(axes: "Axes", runs: pd.DataFrame) -> None:
    """List at the top of the axes what has no point (`failures`), on a white ground over lines and grid."""
    lines = failures(runs)
    if lines:
        style = {"va": "top", "ha": "left", "fontsize": 6, "color": "0.35", "zorder": 4}
        style["bbox"] = {"facecolor": "white", "edgecolor": "none", "pad": 1.5}
        axes.text(0.02, 0.98, "\n".join(lines), transform=axes.transAxes, **style)


def work_precision_panels(records: pd.DataFrame, error: str, label: str) -> "Figure":
    """One panel of `work_precision` per St, with a common legend."""
    import matplotlib.pyplot as plt

    groups = by_stokes(records)
    columns = 2 if len(groups) > 1 else 1
    lines = -(-len(groups) // columns)
    size = PANEL[0] * columns + LEGEND_WIDTH, PANEL[1] * lines
    figure, grid = plt.subplots(lines, columns, figsize=size, sharex=True, sharey=True, squeeze=False)
    for axes, (stokes, runs) in zip(grid.flat, groups, strict=False):
        work_precision(axes, runs, error)
        mark_failures(axes, runs)
        axes.set_title(f"St = {power(stokes)}", fontsize=10)
    for axes in grid.flat[len(groups) :]:
        axes.set_visible(False)
    _limits(grid[0, 0], [runs for _, runs in groups], error)
    for column in grid.T:
        lowest = [axes for axes in column if axes.get_visible()][-1]
        lowest.set_xlabel(f"{label}; more accurate to the right")
        lowest.tick_params(labelbottom=True)
    for axes in grid[:, 0]:
        axes.set_ylabel("wall time of a warm run, s")
    share = _legend(figure, grid.flat, PANEL[0] * columns)
    figure.tight_layout(rect=(0, 0, share, 1))
    return figure


def _limits(axes: "Axes", panels: Sequence[pd.DataFrame], error: str) -> None:
    """More accurate to the right, and above the points of each panel room for its own lines of small print."""
    values = pd.concat([runs[error] for runs in panels]).dropna().to_numpy(float)
    values = values[(values > 0) & (values < LARGEST_ERROR)]
    if not values.size:
        return
    axes.set_xlim(values.max() * 3, values.min() / 3)
    seconds = [runs["seconds"].dropna().to_numpy(float) for runs in panels]
    low, tops = min(own.min() for own in seconds if own.size) / 2, []
    for runs, own in zip(panels, seconds, strict=True):
        high = own.max() * 2 if own.size else 2 * low
        share = min(0.6, len(failures(runs)) * SMALL_PRINT / (0.8 * PANEL[1]))
        tops.append(high * (high / low) ** (share / (1 - share)))
    axes.set_ylim(low, max(tops))


def _legend(figure: "Figure", panels: Iterable["Axes"], panels_width: float) -> float:
    """One legend of all panels: solvers, then the rest, the unknown last.

    The figure grows as wide as the names need beside its panels, `panels_width` inches; returns the panels' share.
    """
    entries = {name: handle for axes in panels for handle, name in zip(*axes.get_legend_handles_labels(), strict=True)}
    rest = [name for name in entries if "\n" in name or name == "Pareto front"]
    names = sorted(entries, key=lambda name: (name == UNKNOWN, name in rest, rank(name.partition(",")[0])))
    texts = [name.replace(", ", ",\n") if len(name) > NAME else name for name in names]
    style = {"loc": "center right", "bbox_to_anchor": (1, 0.5), "frameon": False, "fontsize": 8, "handlelength": 3}
    legend = figure.legend([entries[name] for name in names], texts, **style)
    width = panels_width + max(LEGEND_WIDTH, legend.get_window_extent().width / figure.dpi + LEGEND_MARGIN)
    figure.set_size_inches(width, figure.get_size_inches()[1])
    legend.set_loc("center left")
    legend.set_bbox_to_anchor((panels_width / width, 0.5), figure.transFigure)
    return panels_width / width


def save(figure: "Figure", folder: Path, name: str) -> None:
    """Save a figure and close it."""
    import matplotlib.pyplot as plt

    figure.savefig(folder / f"{name}.png", dpi=150)
    plt.close(figure)
