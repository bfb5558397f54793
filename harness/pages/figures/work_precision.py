"""Figures of runs: cost against error, on axes that are given back; who is robust or fast, as profiles.

`work_precision` draws one panel on given axes, `panels` a whole figure of them. There errors fall to
the right, so that better runs are lower and further right. `profiles` and `heat_map` read a table of
seconds: a row for each problem, a column for each method.

A problem of the profiles is a scene, a Stokes number and an error to be reached. E. D. Dolan and J.
J. Moré, Benchmarking optimization software with performance profiles, Math. Program. 91 (2002);
shares within a time: N. Hansen et al., COCO, Optim. Methods Softw. 36 (2021).
"""

from collections.abc import Sequence
from itertools import cycle
from math import ceil, floor, log10
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import FixedLocator, LogLocator, NullFormatter
from matplotlib.transforms import offset_copy
from scipy.optimize import isotonic_regression

from polhode.harness.analysis.frames import by_scene, by_stokes, where
from polhode.harness.analysis.pareto import (
    LEAST_GAIN,
    MAP_TARGETS as TARGETS,
    Method,
    costs,
    pareto_front,
)
from polhode.harness.common.text import percent, short
from polhode.harness.pages.figures.style import (
    BEHIND,
    GREY,
    INK,
    LETTERS,
    TITLE,
    WIDTH,
    caption,
    is_averaged,
    key,
    looks,
    plain,
    power,
    save,
)
from polhode.harness.pages.tables import fill
from polhode.harness.references.uncertainty import KNOWN, known
from polhode.solvers.contract import Status

# The band under the Pareto front, the line of runs that no other run beats in both time and error.
_FRONT = "#F2E27A"
_FRONT_NAME = "Pareto front"
# Lines of a panel up to which each is named.
_FEW_LINES = 8
# Scenes that a caption names; of more it gives the number.
_FEW_SCENES = 4
# Names longer than this, in letters, break at the comma.
_LONGEST_NAME = 19
UNKNOWN_LABEL = f"grey: within {KNOWN:g} times the\nreference's uncertainty"
# The end of the labels of solvers that have runs without a result.
NO_RESULT = ": no result"
# Runs beyond this error, over I_max or in rad, have failed, whatever their status: they lie outside
# the axes, and stay in the table.
LARGEST_ERROR = 10.0
# Dashes of a solver's lines: one for each full form, where a scene is solved in several.
_DASHES = ("-", "--", ":", "-.")
# Inches of a figure of panels.
_LEFT = 0.72  # Numbers and label of the time.
_NAMES_WIDTH = 1.5  # Names beside a panel.
_ABOVE = 0.42  # Title of a panel, and runs without a result.
_BELOW = 0.5  # Numbers and label of the error, below the lowest panel.
_LEAST_HEIGHT = 1.0  # Of a panel.
_MOST_DECADE = 0.42  # Width and height of a decade.
_KEY_LINE = 0.2  # A line of the key.
_KEY_LETTERS = 68  # Letters for which two columns of the key, together, have room.
_NAME_SPACING = 12.5  # Points: the least distance between two lines of names.
_BEHIND_NAME = "nowhere on the front"
# Factors over the time of the fastest method; both are choices.
_LARGEST_FACTOR = 1000.0  # The figure ends here.
_NEAR = 2.0  # The sentence names the method that stays most often within this factor.
# Methods that the figure names, those that are fast and sure; the others are grey.
NAMED = 7


def conditions(runs: pd.DataFrame, machine: str, repeats: str = "fastest of up to 5") -> str:
    """Tolerances, machine, repeats and their spread, as figures of times name them."""
    tolerances: Any = runs["tolerance"].dropna().astype(float)
    parts = []
    if len(tolerances):
        loosest, tightest = short(float(tolerances.max())), short(float(tolerances.min()))
        same = loosest == tightest
        parts.append(f"Tolerance {loosest}." if same else f"Tolerances {loosest} to {tightest}.")
    words = f"Times: warm runs, the {repeats}"
    if "seconds_spread" in runs:
        timed = where(runs, runs["seconds"].notna() & runs["seconds_spread"].notna())
        shares: Any = timed["seconds_spread"].astype(float) / timed["seconds"].astype(float)
        if len(shares):
            words += f", which vary by {percent(float(shares.median()))} in the median"
    parts.append(f"{words}{f'; {machine}' if machine else ''}.")
    return " ".join(parts)


def work_precision(axes: Axes, runs: pd.DataFrame, error: str = "slow_error") -> Axes:
    """Draw cost against error of all runs of one scene; averaged forms by their cheapest runs and their model error.

    A band of stairs lies under the Pareto front of the full forms' known runs, on which a run counts
    if it halves the error; methods that are nowhere on it stand behind, pale. Points within `KNOWN`
    times the reference's uncertainty are grey. Runs without a result stand hollow along the upper
    edge, at their tolerance.

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
    sure = where(done, done["form"].isin(full) & known(done, error) & reached)
    front = pareto_front(sure, error, LEAST_GAIN)
    if len(front):
        band = {
            "color": _FRONT,
            "solid_capstyle": "round",
            "solid_joinstyle": "round",
            "zorder": 0.5,
        }
        axes.plot(*_stairs(*_points(front, error)), linewidth=6, label=_FRONT_NAME, **band)
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
    plain(axes)
    _without_result(axes, runs)
    # The axis spans more than a decade, so that at least one power of ten stands on it.
    low, high = axes.get_ylim()
    if high < 10 * low:
        axes.set_ylim(low / 3, high * 3)
    return axes


def _points(runs: pd.DataFrame, error: str) -> tuple[np.ndarray, np.ndarray]:
    return runs[error].to_numpy(float), runs["seconds"].to_numpy(float)


def _stairs(errors: np.ndarray, seconds: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The line along which an error costs as much as the next run that is more accurate.

    Points come from the fastest to the most accurate. Between two of them the line goes at the time of the
    second one: no run in between is measured, and only the second one has the error.
    """
    return np.repeat(errors, 2)[:-1], np.repeat(seconds, 2)[1:]


def _grey_out(axes: Axes, runs: pd.DataFrame, error: str, marker: Any, size: float) -> None:
    """Cover the points that lie below what the reference resolves in grey."""
    unknown = where(runs, ~known(runs, error))
    if len(unknown):
        style = {"marker": marker, "markersize": size, "linewidth": 0, "color": GREY, "zorder": 2.5}
        # Matplotlib leaves labels that begin with "_" out of the key: it names the grey points once.
        label = "_again" if UNKNOWN_LABEL in axes.get_legend_handles_labels()[1] else UNKNOWN_LABEL
        axes.plot(*_points(unknown, error), label=label, **style)


def _without_result(axes: Axes, runs: pd.DataFrame) -> None:
    """A hollow marker above the upper edge for each run without a result, at its tolerance, side by side."""
    figure: Any = axes.figure
    failed: Any = where(runs, runs["status"] != Status.REACHED_END)
    # Failed runs whose tolerance lies beyond the errors that are drawn stand at the edge.
    places = (
        failed["tolerance"].astype(float).clip(*(sorted(axes.get_xlim()) if axes.lines else ()))
    )
    for tolerance, failed_runs in failed.groupby(places):
        for i, (solver, look) in enumerate(looks(failed_runs["solver"]).items()):
            style = {
                "marker": look.marker,
                "color": look.colour,
                # Large and thin enough for the hollow to show, within a cross too.
                "markersize": 7,
                "markeredgewidth": 0.8,
                "fillstyle": "none",
                "linewidth": 0,
            }
            place = offset_copy(axes.get_xaxis_transform(), figure, 8 * i, 7, units="points")
            axes.plot(
                [tolerance],
                [1.0],
                transform=place,
                clip_on=False,
                label=f"_{solver}{NO_RESULT}",
                **style,
            )


def name_lines(axes: Axes, few: int = 0) -> None:
    """Write each line's name beside the panel in ink, after its marker, near where it ends.

    A panel of more than `few` lines shows pale ones in grey, without markers or names.
    """
    axes.get_ylim()  # Limits that follow from the data are set once they are asked for.
    figure: Any = axes.figure
    # In points, which a picture's resolution does not change.
    scale = figure.dpi / 72
    ends = []
    named = set()
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
            named.add(label.partition(", ")[0])
            ends.append((axes.transData.transform(end)[1] / scale, tuple(end), line, name))
    for line in lines:
        solver, _, what = str(line.get_label()).removeprefix("_").partition(": ")
        if many and what == "no result" and solver not in named:
            line.set(color=BEHIND)
    ends.sort(key=lambda entry: entry[0])
    box = axes.get_window_extent()
    # Names move as little as keeps them apart, in order and beside the panel. `rooms` are their heights
    # in points. Stacked without gaps their middles are at `middles`; heights less `middles` may not
    # fall from one name to the next, and isotonic regression finds the nearest such values.
    rooms = np.array([_NAME_SPACING * (1 + name.count("\n")) for *_, name in ends])
    middles = np.cumsum(rooms) - rooms / 2
    # Below the panel stand the numbers of its axis.
    highest = box.y1 / scale + 1.5 * _NAME_SPACING - rooms.sum()
    lowest = min(box.y0 / scale, highest)
    free = [y - middle for (y, *_), middle in zip(ends, middles, strict=True)]
    heights = middles + np.clip(isotonic_regression(free).x if free else [], lowest, highest)
    for (_, end, line, name), height in zip(ends, heights, strict=True):
        # From the name's left edge, lest it cross the names beside it.
        arrow = {
            "arrowstyle": "-",
            "color": BEHIND,
            "lw": 0.4,
            "shrinkA": 12,
            "shrinkB": 2,
            "relpos": (0, 0.5),
        }
        # Points: room for a marker and the line that leads to the name.
        place = (box.x1 / scale + 24, height)
        axes.annotate(
            name,
            end,
            place,
            textcoords="figure points",
            arrowprops=arrow,
            annotation_clip=False,
            fontsize=LETTERS,
            color=INK,
            va="center",
            linespacing=1.0,
        )
        spot = np.array([place[0] - 9, height]) * scale / figure.bbox.size
        style = {"color": line.get_color(), "marker": line.get_marker(), "markersize": 6}
        mark = Line2D([spot[0]], [spot[1]], transform=figure.transFigure, **style)
        if mark.get_marker() in ("", "None", None):
            mark = Line2D(
                [spot[0] - 5 * scale / figure.bbox.width, spot[0] + 5 * scale / figure.bbox.width],
                [spot[1]] * 2,
                transform=figure.transFigure,
                color=line.get_color(),
                linewidth=line.get_linewidth(),
            )
        figure.add_artist(mark)


def work_precision_panels(
    records: pd.DataFrame, error: str, label: str, *, scene: str = "", note: str = ""
) -> Figure:
    """One panel of `work_precision` per St, on the same axes; `note` stands below them."""
    before = f"{scene}, " if scene else ""
    groups = [(f"{before}St = {power(stokes)}", runs) for stokes, runs in by_stokes(records)]
    return panels(groups, error, label, note=note)


def panels(
    groups: Sequence[tuple[str, pd.DataFrame]],
    error: str,
    label: str,
    *,
    alike: bool = True,
    note: str = "",
) -> Figure:
    """Panels of `work_precision` below each other, for each title and its runs; `alike` ones share their axes.

    Decades of the error are as long as those of the time. The key stands on top, `note` below.
    """
    everything = pd.concat([runs for _, runs in groups])
    # For each panel the ends of its axes, as exponents of ten: of the error, and of the seconds.
    limits = []
    for _, runs in groups:
        shown: Any = everything if alike else runs
        limits.append(
            (_decades(shown[error], LARGEST_ERROR), _decades(shown["seconds"], np.inf, least=1))
        )
    width = WIDTH - _LEFT - _NAMES_WIDTH
    # Inches of a decade, the same in all panels and along both axes.
    decade = min(min(width / (high - low) for (low, high), _ in limits), _MOST_DECADE)
    heights = [max(_LEAST_HEIGHT, decade * (top - bottom)) for _, (bottom, top) in limits]
    drawing = plt.figure(figsize=(WIDTH, 1.0))
    grid = [drawing.add_subplot() for _ in groups]
    for axes, (title, runs), ((low, high), (bottom, top)), height in zip(
        grid, groups, limits, heights, strict=True
    ):
        axes.set_xlim(10.0**high, 10.0**low)
        work_precision(axes, runs, error)
        # A panel that is lower than its names is filled up with empty decades.
        axes.set_ylim(10.0**bottom, 10.0 ** max(top, bottom + height / decade))
        axes.set_title(title, fontsize=TITLE, loc="left", pad=13, color=INK)
        axes.xaxis.set_major_locator(LogLocator(100.0 if high - low > 7 else 10.0, numticks=30))
        axes.xaxis.set_minor_formatter(NullFormatter())
        axes.yaxis.set_major_locator(LogLocator(10.0, numticks=30))
        axes.set_ylabel("time, s", fontsize=LETTERS, color=INK)
    grid[-1].set_xlabel(f"{label}, smaller to the right", fontsize=LETTERS, color=INK)
    handles = _key_of(grid)
    half = ceil(len(handles) / 2)
    parts = (handles[:half], handles[half:])
    letters = [max(len(str(handle.get_label())) for handle in part) for part in parts if part]
    columns = 2 if sum(letters) <= _KEY_LETTERS else 1
    key_height = _KEY_LINE * ceil(len(handles) / columns) + 0.06
    below = [_BELOW if not alike or axes is grid[-1] else 0.22 for axes in grid]
    total = key_height + sum(heights) + _ABOVE * len(grid) + sum(below)
    drawing.set_size_inches(WIDTH, total)
    top_edge = total - key_height
    for axes, ((low, high), _), height, room in zip(grid, limits, heights, below, strict=True):
        top_edge -= _ABOVE + height
        box = (_LEFT / WIDTH, top_edge / total, decade * (high - low) / WIDTH, height / total)
        axes.set_position(box)
        top_edge -= room
    _write_key(drawing, handles, columns)
    caption(drawing, note)
    for axes in grid:
        name_lines(axes, _FEW_LINES)
    return drawing


def _decades(values: pd.Series, most: float, least: int = 0) -> tuple[float, float]:
    """Exponents of the powers of ten around positive values below `most`; more than `least` decades apart.

    A value within 0.02 decades of a power of ten counts as beyond it, so that its marker is not cut.
    """
    numbers = values.dropna().to_numpy(float)
    numbers = numbers[(numbers > 0) & (numbers < most)]
    if not numbers.size:
        return -1.0, 1.0
    low = floor(log10(float(numbers.min())) - 0.02)
    return low, max(ceil(log10(float(numbers.max())) + 0.02), low + least + 1)


def _key_of(grid: Sequence[Axes]) -> list[Any]:
    """Entries of the key: bands, averaged forms, and what grey and hollow mean."""
    entries = {}
    for axes in grid:
        for line, name in zip(*axes.get_legend_handles_labels(), strict=True):
            if "\n" in name or name == _FRONT_NAME:
                entries[name.replace("\n", " ")] = line
    entries[_BEHIND_NAME] = Line2D([], [], color=BEHIND)
    entries["hollow, above: no result"] = Line2D(
        [], [], marker="o", fillstyle="none", color="0.4", lw=0
    )
    named = []
    for name, line in entries.items():
        handle = Line2D([], [], color=line.get_color(), linestyle=line.get_linestyle())
        handle.update_from(line)
        handle.set_label(name)
        named.append(handle)
    return named


def _write_key(drawing: Figure, handles: Sequence[Any], columns: int) -> None:
    spacing = {"columnspacing": 1.4, "handletextpad": 0.8, "labelspacing": 0.35}
    key(drawing, handles, columns, loc="upper left", bbox_to_anchor=(0.0, 1.0), **spacing)


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
    runs: pd.DataFrame,
    folder: Path,
    name: str = "profiles",
    title: str = "Robust or fast",
    note: str = "",
) -> list[str]:
    """Save the figure into a folder; what a page says about it, nothing where nobody solves anything."""
    seconds = times(runs)
    if seconds.empty:
        return []
    scenes = [str(scene) for scene in dict.fromkeys(runs["scene_name"])]
    shown = ", ".join(scenes) if len(scenes) <= _FEW_SCENES else f"{len(scenes)} scenes"
    stokes = runs["stokes"].to_numpy(float)
    problems = (
        f"A problem is a scene ({shown}), an St from {short(stokes.min())} to "
        f"{short(stokes.max())} and an error from {short(TARGETS[0])} to {short(TARGETS[-1])}."
    )
    save(profiles(seconds, f"{problems} {note}".strip()), folder, name)
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
    """Who is seldom far from the fastest, and who gets there most often, from a table of `times`.

    `slow` is what nine in ten of the ratios of the surest method stay below.
    """
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


def profiles(seconds: pd.DataFrame, note: str = "") -> Figure:
    """The share of problems solved within a factor of the fastest, and within a time; `note` stands below.

    A curve rises by 1/n at each of n problems that the method solves, and ends at the share that it solves at all.
    """
    height = 4.6
    figure = plt.figure(figsize=(WIDTH, height))
    grid = [figure.add_subplot(2, 1, place) for place in (1, 2)]
    ratios = seconds.div(seconds.min(axis=1), axis=0)
    fastest, longest = (
        float(end)
        for end in (np.nanmin(seconds.to_numpy(float)), np.nanmax(seconds.to_numpy(float)))
    )
    # Methods are ranked by the share of problems solved nearly as fast as the fastest, plus the share
    # solved at all: both count as much.
    standing = (ratios <= _NEAR).mean() + seconds.notna().mean()
    named = set(standing.sort_values(ascending=False).index[:NAMED])
    for name, look in looks(map(str, seconds)).items():
        for axes, values, end in (
            (grid[0], ratios[name], _LARGEST_FACTOR),
            (grid[1], seconds[name], longest * 1.1),
        ):
            points = np.sort(values.dropna().to_numpy(float))
            points = points[points <= end]
            shares = np.arange(1, len(points) + 1) / len(seconds)
            # The curve goes on at its height to the edge of the panel.
            points = np.append(points, end)
            shares = np.append(shares, shares[-1] if len(shares) else 0.0)
            style: dict[str, Any] = {"color": look.colour, "linewidth": 1.8}
            if name not in named:
                style = {"color": BEHIND, "linewidth": 0.8, "alpha": 0.5, "zorder": 1}
            axes.step(points, shares, where="post", label=name, **style)
    grid[0].set_xlim(1, _LARGEST_FACTOR)
    grid[1].set_xlim(fastest / 1.1, longest * 1.1)
    for axes, label in (
        (grid[0], "time over that of the fastest"),
        (grid[1], "wall time of a warm run, s"),
    ):
        axes.set_xscale("log")
        axes.set_ylim(0, 1.02)
        axes.set_yticks([0, 0.25, 0.5, 0.75, 1], ["0", "", "50 %", "", "100 %"])
        axes.set_xlabel(label)
        title = f"Share of {len(seconds)} problems solved"
        axes.set_title(title, fontsize=TITLE, loc="left", color=INK)
        plain(axes)
    figure.subplots_adjust(
        left=0.55 / WIDTH, right=1 - _NAMES_WIDTH / WIDTH, bottom=0.1, top=0.94, hspace=0.55
    )
    caption(figure, note)
    for axes in grid:
        name_lines(axes)
    return figure


def heat_map(
    ratios: pd.DataFrame, titles: Sequence[str], note: str = "", most: float = 100.0
) -> Figure:
    """Time over that of the fastest: a row for each problem, a column for each solver, a panel for each title.

    `ratios` has the titles' places as its outer level of rows. Numbers stand where a solver is
    within 10 times the fastest; white: no run gets there.
    """
    names = [str(name) for name in ratios]
    rows = [str(row) for row in ratios.index.get_level_values(1).unique()]
    # Inches: names of rows, title of a panel, and names of columns.
    left, top, bottom = 1.25, 0.32, 0.95
    cell = (WIDTH - left - 0.05) / len(names)
    height = 0.19
    panel = height * len(rows)
    total = (panel + top) * len(titles) + bottom + 0.5
    figure = plt.figure(figsize=(WIDTH, total))
    shades = plt.get_cmap("YlOrBr")
    edge = total - 0.5
    grid = []
    for place, title in zip(ratios.index.get_level_values(0).unique(), titles, strict=True):
        edge -= top + panel
        axes = figure.add_axes(
            (left / WIDTH, edge / total, cell * len(names) / WIDTH, panel / total)
        )
        grid.append(axes)
        values = ratios.loc[place].reindex(index=rows).to_numpy(float)
        axes.pcolormesh(
            np.log10(values),
            cmap=shades,
            vmin=0,
            vmax=log10(most),
            edgecolor="white",
            linewidth=0.6,
        )
        for (i, j), value in np.ndenumerate(values):
            # Below 9.95 two digits, "9.9", fit into a cell; below 1.05 they would read "1".
            if value < 9.95:
                text = "1" if value < 1.05 else f"{value:.2g}"
                style = {"fontsize": 8, "weight": "bold" if value < 1.05 else "normal"}
                axes.text(j + 0.5, i + 0.5, text, ha="center", va="center", color=INK, **style)
        axes.set_title(
            title,
            fontsize=TITLE,
            loc="left",
            color=INK,
            pad=4,
            x=(0.06 - left) / (cell * len(names)),
        )
        axes.set_ylim(len(rows), 0)
        axes.set_yticks(np.arange(len(rows)) + 0.5, rows, fontsize=9, color=INK)
        axes.tick_params(length=0)
        axes.spines[:].set_visible(False)
        axes.xaxis.set_major_locator(FixedLocator([]))
    grid[-1].set_xticks(
        np.arange(len(names)) + 0.5, names, fontsize=9, color=INK, rotation=90, va="top"
    )
    steps = [1, 2, 5, 10, 30, 100]
    handles = [
        Patch(facecolor=shades(log10(step) / log10(most)), label=f"{step}") for step in steps
    ]
    handles[-1].set_label(f"{steps[-1]} and more")
    handles.append(Patch(facecolor="white", edgecolor="0.7", label="never"))
    key(
        figure,
        handles,
        len(handles),
        loc="upper left",
        fontsize=9,
        handlelength=1.0,
        columnspacing=0.9,
        handletextpad=0.4,
        borderaxespad=0.1,
        title="Time over that of the fastest",
        title_fontsize=9,
        alignment="left",
    )
    caption(figure, note)
    return figure
