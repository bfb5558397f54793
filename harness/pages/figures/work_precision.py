"""Figures of runs: cost against error, on axes that are given back; who is robust or fast, as profiles.

A problem of the profiles is a scene, a Stokes number and an error to be reached. E. D. Dolan and J.
J. Moré, Benchmarking optimization software with performance profiles, Math. Program. 91 (2002);
shares within a time: N. Hansen et al., COCO, Optim. Methods Softw. 36 (2021).
"""

from collections.abc import Sequence
from itertools import cycle
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import NullFormatter
from matplotlib.transforms import offset_copy
from scipy.optimize import isotonic_regression

from polhode.harness.analysis.frames import by_scene, by_stokes, where
from polhode.harness.analysis.pareto import MAP_TARGETS as TARGETS, Method, costs, pareto_front
from polhode.harness.common.files import PartialFile
from polhode.harness.pages.figures.style import GREY, is_averaged, looks, power
from polhode.harness.pages.tables import fill
from polhode.harness.references.uncertainty import KNOWN, known
from polhode.solvers.contract import Status

# The band under the Pareto front.
_FRONT = "#F7EFA6"
_FRONT_NAME = "Pareto front"
# Lines of a panel up to which each is named.
_FEW_LINES = 8
# Names longer than this, in letters, break at the comma.
_LONGEST_NAME = 24
UNKNOWN_LABEL = f"grey: within {KNOWN:g} times the\nreference's uncertainty"
# Runs beyond this error have failed, whatever their status; they stay in the table.
LARGEST_ERROR = 10.0
# One per full form, where a scene is solved in several.
_DASHES = ("-", "--", ":", "-.")
# A page shows figures 800 pixels wide.
_PANEL = (3.35, 2.9)  # Inches: width and height of a panel.
_NAMES_WIDTH = 1.05  # Inches: width of the names beside a panel.
_LEGEND = 0.75  # Inches: height of the legend below all panels.
# Width of a figure of one panel, in inches: the legend needs it.
_LEAST_WIDTH = 6.4
# Numbers left of a panel that shares no axis.
_TICKS = 0.4
# Names beside a panel.
_LETTERS = 8.5  # Points: their size.
_NAME_SPACING = 10.5  # Points: the least distance between two lines of them.
BEHIND = "#BDBDBD"
_BEHIND_NAME = "behind the front"
# Factors over the time of the fastest method.
_LARGEST_FACTOR = 1000.0  # The figure ends here.
_NEAR = 2.0  # The sentence names the method that stays most often within this factor.
# Methods that the figure names, those that are fast and sure; the others are grey.
NAMED = 7


def work_precision(axes: Axes, runs: pd.DataFrame, error: str = "slow_error") -> Axes:
    """Draw cost against error of all runs of one scene; averaged forms by their cheapest runs and their model error.

    A band lies under the Pareto front of the full forms' known runs; methods that are nowhere on it
    stand behind, pale. Points within `KNOWN` times the reference's uncertainty are grey. Runs
    without a result stand hollow along the upper edge, at their tolerance.

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
    reached = done["status"] == Status.REACHED_END
    front = pareto_front(where(done, done["form"].isin(full) & known(done, error) & reached), error)
    if len(front):
        band = {
            "color": _FRONT,
            "solid_capstyle": "round",
            "solid_joinstyle": "round",
            "zorder": 0.5,
        }
        axes.plot(*_points(front, error), linewidth=7, label=_FRONT_NAME, **band)
    leading = set(zip(front["solver"], front["form"], strict=True))
    for solver, look in looks(runs["solver"]).items():
        for form, dash in zip(full, cycle(_DASHES)):
            method_runs = where(done, (done["solver"] == solver) & (done["form"] == form))
            if method_runs.empty:
                continue
            label = solver if len(full) == 1 else f"{solver}, {form}"
            style: dict[str, Any] = {
                "marker": look.marker,
                "color": look.colour,
                "markersize": 5,
                "linewidth": 1.5,
            }
            if (solver, form) not in leading:
                style |= {"alpha": 0.45, "markersize": 3.5, "linewidth": 0.8, "zorder": 1.5}
            axes.plot(*_points(method_runs, error), linestyle=dash, label=label, **style)
            _grey_out(axes, method_runs, error, look.marker, style["markersize"])
    for form in forms:
        if form not in full:
            form_runs = where(done, done["form"] == form)
            look = looks([form])[form]
            cheapest = pareto_front(form_runs, error)
            style = {"marker": look.marker, "markersize": 9, "linewidth": 0, "color": look.colour}
            axes.plot(*_points(cheapest, error), label=f"{form} form,\ncheapest runs", **style)
            _grey_out(axes, cheapest, error, look.marker, 9)
            for model in form_runs[f"model_{error}"].dropna().head(1):
                label = f"{form} form,\nmodel error"
                axes.axvline(
                    float(model), color=look.colour, linewidth=1.0, linestyle=":", label=label
                )
    axes.set(xscale="log", yscale="log")
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.grid(True, which="major", linewidth=0.4, alpha=0.5)
    _without_result(axes, runs)
    # Over more than a decade, so that a power of ten names one.
    low, high = axes.get_ylim()
    if high < 10 * low:
        axes.set_ylim(low / 3, high * 3)
    return axes


def _points(runs: pd.DataFrame, error: str) -> tuple[np.ndarray, np.ndarray]:
    return runs[error].to_numpy(float), runs["seconds"].to_numpy(float)


def _grey_out(axes: Axes, runs: pd.DataFrame, error: str, marker: Any, size: float) -> None:
    """Cover the points that lie below what the reference resolves in grey."""
    unknown = where(runs, ~known(runs, error))
    if len(unknown):
        style = {"marker": marker, "markersize": size, "linewidth": 0, "color": GREY, "zorder": 2.5}
        label = "_again" if UNKNOWN_LABEL in axes.get_legend_handles_labels()[1] else UNKNOWN_LABEL
        axes.plot(*_points(unknown, error), label=label, **style)


def _without_result(axes: Axes, runs: pd.DataFrame) -> None:
    """A hollow marker above the upper edge for each run without a result, at its tolerance, side by side."""
    figure: Any = axes.figure
    failed: Any = where(runs, runs["status"] != Status.REACHED_END)
    # Those beyond the errors that are drawn stand at the edge.
    places = (
        failed["tolerance"].astype(float).clip(*(sorted(axes.get_xlim()) if axes.lines else ()))
    )
    for tolerance, failed_runs in failed.groupby(places):
        for i, (solver, look) in enumerate(looks(failed_runs["solver"]).items()):
            style = {
                "marker": look.marker,
                "color": look.colour,
                "markersize": 4,
                "fillstyle": "none",
                "linewidth": 0,
            }
            place = offset_copy(axes.get_xaxis_transform(), figure, 6 * i, 6, units="points")
            axes.plot(
                [tolerance],
                [1.0],
                transform=place,
                clip_on=False,
                label=f"_{solver}: no result",
                **style,
            )


def name_lines(axes: Axes, few: int = 0) -> None:
    """Write each line's name beside the panel, near where it ends.

    A panel of more than `few` lines shows pale ones in grey, without markers or names.
    """
    axes.get_ylim()  # Limits that follow from the data are set once they are asked for.
    # In points, which a picture's resolution does not change.
    scale = axes.figure.dpi / 72
    ends = []
    lines = axes.get_lines()
    many = len([line for line in lines if not str(line.get_label()).startswith("_")]) > few
    for line in lines:
        label = str(line.get_label())
        points = np.asarray(line.get_xydata())
        if many and line.get_alpha() is not None:
            line.set(color=BEHIND, marker="", alpha=1.0, label=f"_{label}")
        elif (
            not label.startswith("_") and "\n" not in label and label != _FRONT_NAME and len(points)
        ):
            end = points[-1]
            name = label.replace(", ", ",\n") if len(label) > _LONGEST_NAME else label
            ends.append((axes.transData.transform(end)[1] / scale, tuple(end), line, name))
    ends.sort(key=lambda entry: entry[0])
    box = axes.get_window_extent()
    # Names move as little as keeps them apart, in order and beside the panel.
    rooms = np.array([_NAME_SPACING * (1 + name.count("\n")) for *_, name in ends])
    middles = np.cumsum(rooms) - rooms / 2
    lowest = box.y0 / scale - _NAME_SPACING / 2
    highest = box.y1 / scale + _NAME_SPACING / 2 - rooms.sum()
    free = [y - middle for (y, *_), middle in zip(ends, middles, strict=True)]
    heights = middles + np.clip(isotonic_regression(free).x if free else [], lowest, highest)
    for (_, end, line, name), height in zip(ends, heights, strict=True):
        style = {
            "fontsize": _LETTERS,
            "color": line.get_color(),
            "fontweight": "bold",
            "va": "center",
        }
        # From the name's left edge, lest it cross the names beside it.
        arrow = {
            "arrowstyle": "-",
            "color": BEHIND,
            "lw": 0.4,
            "shrinkA": 0,
            "shrinkB": 2,
            "relpos": (0, 0.5),
        }
        place = (box.x1 / scale + 8, height)
        axes.annotate(
            name,
            end,
            place,
            textcoords="figure points",
            arrowprops=arrow,
            annotation_clip=False,
            **style,
        )


def work_precision_panels(records: pd.DataFrame, error: str, label: str) -> Figure:
    """One panel of `work_precision` per St, on the same axes."""
    return panels(
        [(f"St = {power(stokes)}", runs) for stokes, runs in by_stokes(records)], error, label
    )


def panels(
    groups: Sequence[tuple[str, pd.DataFrame]], error: str, label: str, *, alike: bool = True
) -> Figure:
    """One panel of `work_precision` for each title and its runs, with one legend; `alike` ones share their axes."""
    columns = 2 if len(groups) > 1 else 1
    lines = -(-len(groups) // columns)
    between = _NAMES_WIDTH + (0.0 if alike else _TICKS)
    size = max((_PANEL[0] + between) * columns, _LEAST_WIDTH), _PANEL[1] * lines + _LEGEND
    figure, grid = plt.subplots(
        lines, columns, figsize=size, sharex=alike, sharey=alike, squeeze=False
    )
    for axes, (title, runs) in zip(grid.flat, groups, strict=False):
        # Those that a panel shows, more accurate to the right.
        errors = (
            (pd.concat([group_runs for _, group_runs in groups]) if alike else runs)[error]
            .dropna()
            .to_numpy(float)
        )
        errors = errors[(errors > 0) & (errors < LARGEST_ERROR)]
        if errors.size:
            axes.set_xlim(errors.max() * 3, errors.min() / 3)
        work_precision(axes, runs, error)
        axes.set_title(title, fontsize=11, loc="left", pad=15)
    for axes in grid.flat[len(groups) :]:
        axes.set_visible(False)
    for column in grid.T:
        lowest = [axes for axes in column if axes.get_visible()][-1]
        lowest.set_xlabel(f"{label}, smaller to the right")
        lowest.tick_params(labelbottom=True)
    for axes in grid[:, 0]:
        axes.set_ylabel("wall time of a warm run, s")
    width, height = size
    margins = {
        "left": 0.65 / width,
        "right": 1 - _NAMES_WIDTH / width,
        "bottom": (_LEGEND + 0.5) / height,
    }
    figure.subplots_adjust(
        **margins,
        top=1 - 0.45 / height,
        wspace=between / (_PANEL[0] - 0.65),
        hspace=0.28 if alike else 0.4,
    )
    for axes in grid.flat[: len(groups)]:
        name_lines(axes, _FEW_LINES)
    legend = {}
    for axes in grid.flat:
        for line, name in zip(*axes.get_legend_handles_labels(), strict=True):
            if "\n" in name or name == _FRONT_NAME:
                legend[name.replace("\n", " ")] = line
    legend[_BEHIND_NAME] = Line2D([], [], color=BEHIND)
    legend["hollow: no result, at that tolerance"] = Line2D(
        [], [], marker="o", fillstyle="none", color="0.4", lw=0
    )
    style = {
        "frameon": False,
        "fontsize": 8.5,
        "columnspacing": 1.0,
        "handlelength": 1.5,
        "ncols": columns + 1,
    }
    figure.legend(
        [*legend.values()], [*legend], loc="lower left", bbox_to_anchor=(0.01, 0.0), **style
    )
    return figure


def save(figure: Figure, folder: Path, name: str) -> None:
    """Save a figure and close it."""
    with PartialFile(folder / f"{name}.png", binary=True) as file:
        figure.savefig(file, format="png", dpi=150)
    plt.close(figure)


def times(table: pd.DataFrame, error: str = "slow_error") -> pd.DataFrame:
    """Seconds to each error, NaN without: a row for each problem that somebody solves, a column for each method."""
    groups = []
    for _, scene_runs in by_scene(table):
        groups += [runs for _, runs in by_stokes(scene_runs)]
    seconds: Any = costs(enumerate(groups), TARGETS, error).dropna(how="all").T
    return (
        seconds.groupby([Method(*column).label for column in seconds.index], sort=False).min().T
        if len(seconds)
        else seconds
    )


def profile_lines(
    runs: pd.DataFrame, folder: Path, name: str = "profiles", title: str = "Robust or fast"
) -> list[str]:
    """Save the figure into a folder; what a page says about it, nothing where nobody solves anything."""
    seconds = times(runs)
    if seconds.empty:
        return []
    save(profiles(seconds), folder, name)
    return [
        fill(
            "profiles",
            of=name,
            title=title,
            sentence=sentence(seconds),
            first=TARGETS[0],
            last=TARGETS[-1],
        )
    ]


def sentence(seconds: pd.DataFrame) -> str:
    """Who is seldom far from the fastest, and who gets there most often."""
    ratios = seconds.div(seconds.min(axis=1), axis=0)
    nearly_fastest = (ratios <= _NEAR).mean()
    reached = seconds.notna().mean()
    # Among equally sure methods the sentence names the one that is fast more often.
    order = nearly_fastest.sort_values(ascending=False, kind="stable").index
    first = str(order[0])
    surest = str(reached.reindex(order).idxmax())
    slow = np.nanquantile(ratios[surest].to_numpy(float), 0.9)
    shares = {
        "near": nearly_fastest[first],
        "reached": reached[surest],
        "factor": _NEAR,
        "slow": slow,
    }
    return fill("profiles-sentence", count=len(seconds), first=first, surest=surest, **shares)


def profiles(seconds: pd.DataFrame) -> Figure:
    """The share of problems solved within a factor of the fastest, and within a time."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(9.8, 4.0), sharey=True)
    ratios = seconds.div(seconds.min(axis=1), axis=0)
    fastest, longest = (
        float(end)
        for end in (np.nanmin(seconds.to_numpy(float)), np.nanmax(seconds.to_numpy(float)))
    )
    standing = (ratios <= _NEAR).mean() + seconds.notna().mean()
    named = set(standing.sort_values(ascending=False).index[:NAMED])
    for name, look in looks(map(str, seconds)).items():
        for axes, values, end in (
            (left, ratios[name], _LARGEST_FACTOR),
            (right, seconds[name], longest * 1.1),
        ):
            points = np.sort(values.dropna().to_numpy(float))
            points = points[points <= end]
            shares = np.arange(1, len(points) + 1) / len(seconds)
            points = np.append(points, end)
            shares = np.append(shares, shares[-1] if len(shares) else 0.0)
            style = {} if name in named else {"alpha": 0.5, "zorder": 1}
            axes.step(
                points, shares, where="post", color=look.colour, linewidth=1.6, label=name, **style
            )
    left.set(xlim=(1, _LARGEST_FACTOR), ylim=(0, 1.02))
    right.set_xlim(fastest / 1.1, longest * 1.1)
    for axes, label in (
        (left, "time over that of the fastest"),
        (right, "wall time of a warm run, s"),
    ):
        axes.set_xscale("log")
        axes.set_xlabel(label, fontsize=11)
        axes.grid(True, linewidth=0.4, alpha=0.5)
    left.set_ylabel("share of the problems solved", fontsize=11)
    figure.subplots_adjust(left=0.07, right=0.8, bottom=0.14, top=0.97, wspace=0.74)
    for axes in (left, right):
        name_lines(axes)
    return figure
