"""Figures of runs: cost against error, on axes that are given back; who is robust or fast, as profiles.

`work_precision` draws one panel on given axes, `panels` a whole figure of them. In `panels` errors fall
to the right, so that better runs are lower and further right. `profiles` reads a table of seconds, and
`heat_map` one of their ratios: a row for each problem, a column for each method. Looks, sizes and
limits without a reason are chosen by eye (`style`).

A problem of the profiles is a scene, a Stokes number and an error to be reached. E. D. Dolan and J.
J. Moré, Benchmarking optimization software with performance profiles, Math. Program. 91 (2002);
shares within a time: N. Hansen et al., COCO, Optim. Methods Softw. 36 (2021).
"""

from collections.abc import Sequence
from itertools import cycle
from math import ceil, floor, log10
from pathlib import Path
from textwrap import wrap
from typing import Any, NamedTuple

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
from polhode.harness.analysis.pareto import LEAST_GAIN, Method, costs, pareto_front
from polhode.harness.analysis.regime_map import MAP_TARGETS as TARGETS
from polhode.harness.common.text import short
from polhode.harness.common.timing import MOST_RUNS
from polhode.harness.pages.figures.style import (
    BEHIND,
    GREY,
    INK,
    LETTERS,
    SMALL_LETTERS,
    TITLE,
    TITLE_LEFT,
    WIDTH,
    caption,
    is_averaged,
    key,
    looks,
    percent_axis,
    plain,
    power,
    repeats_vary,
    save,
)
from polhode.harness.pages.tables import fill
from polhode.harness.references.uncertainty import KNOWN, known
from polhode.solvers.contract import Status

# Colour of the band under the Pareto front, the line of runs that no other run beats in both time and error.
_FRONT = "#F2E27A"
_FRONT_NAME = "Pareto front"
# Lines of a panel up to which each is named.
_FEW_LINES = 8
# Scenes that a caption names; of more it gives the number.
_FEW_SCENES = 4
# Names longer than this, in letters, break at the comma.
_LONGEST_NAME = 19
# Letters that find room beside a panel in any case: parts of a broken name that are longer break at hyphens.
_LONGEST_LINE = 15
UNKNOWN_LABEL = f"grey: within {KNOWN:g} times the\nreference's uncertainty"
# The end of the labels of solvers that have runs without a result.
NO_RESULT = ": no result"
# Runs beyond this error, over I_max or in rad, have failed, whatever their status: they lie outside
# the axes, and stay in the table. An estimate: no orientation is off by more than π, and L and E of a run
# that is worth a look by less than some I_max.
LARGEST_ERROR = 10.0
# Dashes of a solver's lines: one for each full form, where a scene is solved in several.
_DASHES = ("-", "--", ":", "-.")
# A value closer than this to a power of ten, in decades, counts as beyond it: its marker is not cut.
_MARKER_ROOM = 0.02
# Decades of the error up to which each power of ten is written; of more decades every other one.
_MAX_WRITTEN_DECADES = 7
# A panel that shows less than a decade of the time is extended by this factor at both ends. Then a power of ten
# mostly stands on its axis. By eye.
_EXTENSION = 3
# Ticks of an axis, more than any has: the locator would else leave out some.
_MAX_TICKS = 30
# Points from a panel's top to its title: room for the hollow markers of runs without a result.
_TITLE_DISTANCE = 13
# Inches of a figure of panels.
_LEFT = 0.72  # Numbers and label of the time.
_NAMES_WIDTH = 1.5  # Names beside a panel.
_ABOVE = 0.42  # Title of a panel, and runs without a result.
_BELOW = 0.5  # Numbers and label of the error, below the lowest panel.
_BELOW_UPPER = 0.22  # Numbers of the error, below the panels above it.
_LEAST_HEIGHT = 1.0  # Least height of a panel.
_MOST_DECADE = 0.42  # Largest width and height of a decade.
_KEY_LINE = 0.2  # A line of the key.
_KEY_MARGIN = 0.06  # Room below the key.
_KEY_LETTERS = 68  # Letters for which two columns of the key, together, have room.
# Points, of names beside a panel.
_NAME_SPACING = 12.5  # The least distance between two lines of names.
# From the panel's edge to a name: room for a marker and the line that leads there.
_NAME_OFFSET = 24.0
_MARKER_OFFSET = 9.0  # From a name back to the middle of its marker.
_DASH = 5.0  # Half the length of the dash that stands for a line without a marker.
_BEHIND_NAME = "nowhere on the front"
# Factors over the time of the fastest method; both are choices.
_LARGEST_FACTOR = 1000.0  # The figure ends here.
_NEAR = 2.0  # The sentence names the method that stays most often within this factor.
# Share of the problems that the surest method solves whose ratios the sentence bounds.
_NINE_IN_TEN = 0.9
_PROFILES_HEIGHT = 4.6  # Inches of the figure of profiles.
# The axis of seconds of the profiles goes beyond the least and the largest time by this factor.
_BEYOND = 1.1
# Methods that the figure names, those that are fast and sure; the others are grey. A choice.
NAMED = 7
# Ratios below which the heat map writes "1", in bold, as two digits would be rounded to it, and below which
# it writes a number at all: "9.9" is the longest text that fits into a cell.
_FASTEST_BELOW = 1.05
_WRITTEN_BELOW = 9.95
# Ratios of the heat map's key, to the largest that has a shade of its own.
_KEY_RATIOS = (1, 2, 5, 10, 30, 100)
_LARGEST_SHADED = 100.0


class _Limits(NamedTuple):
    """Ends of a panel's axes, as exponents of ten: of the error, and of the seconds."""

    least_error: float
    most_error: float
    least_time: float
    most_time: float

    @property
    def error_decades(self) -> float:
        """How many decades of the error the panel has."""
        return self.most_error - self.least_error

    @property
    def time_decades(self) -> float:
        """How many decades of the seconds the panel has."""
        return self.most_time - self.least_time


class _LineName(NamedTuple):
    """A line of a panel that has its name beside it."""

    line: Line2D
    text: str
    end: tuple[float, float]  # The line's last point: error and seconds.
    height: float  # Of that point above the foot of the figure, in points.


def conditions(
    runs: pd.DataFrame, machine: str, repeats: str = f"fastest of up to {MOST_RUNS}"
) -> str:
    """Tolerances, machine, repeats and their spread, in sentences, as figures of times name them.

    `runs` has the columns "tolerance" and "seconds"; the spread is left out without "seconds_spread". `machine`
    may be empty. `repeats` says which of the repeats counts.
    """
    tolerances: Any = runs["tolerance"].dropna().astype(float)
    parts = []
    if len(tolerances):
        loosest, tightest = short(float(tolerances.max())), short(float(tolerances.min()))
        same = loosest == tightest
        parts.append(f"Tolerance {loosest}." if same else f"Tolerances {loosest} to {tightest}.")
    words = f"Times: warm runs, the {repeats}"
    if "seconds_spread" in runs:
        vary = repeats_vary(runs["seconds"], runs["seconds_spread"])
        words += f", which {vary}" if vary else ""
    parts.append(f"{words}{f'; {machine}' if machine else ''}.")
    return " ".join(parts)


def work_precision(axes: Axes, runs: pd.DataFrame, error: str = "slow_error") -> Axes:
    """Draw cost against error of all runs of one scene; averaged forms by their cheapest runs and their model error.

    A band of stairs lies under the Pareto front of the full forms' known runs, on which a run counts
    if it halves the error; methods that are nowhere on it stand behind, pale. Points within `KNOWN`
    times the reference's uncertainty are grey, as are all where it is not known. Runs without a result
    stand hollow along the upper edge, at their tolerance.

    Parameters
    ----------
    axes : matplotlib.axes.Axes
    runs : DataFrame
        Records of one scene (`polhode.harness.analysis.frames.frame`).
    error : str
        Column to draw along x.

    Returns
    -------
    matplotlib.axes.Axes
        The axes given.
    """
    # Runs that fail have no seconds.
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
            _draw_averaged(axes, where(done, done["form"] == form), error, form)
    axes.set(xscale="log", yscale="log")
    axes.yaxis.set_minor_formatter(NullFormatter())
    plain(axes)
    _without_result(axes, runs)
    low, high = axes.get_ylim()
    if high < 10 * low:
        axes.set_ylim(low / _EXTENSION, high * _EXTENSION)
    return axes


def _draw_averaged(axes: Axes, runs: pd.DataFrame, error: str, form: str) -> None:
    """Draw the cheapest runs of an averaged form, and its model error as a dotted line.

    The model error is the distance of the form's exact solution from the solution of the full equations.
    """
    look = looks([form])[form]
    cheapest = pareto_front(runs, error)
    size = 9  # Larger than the markers of solvers, which may lie beneath.
    style = {"marker": look.marker, "markersize": size, "linewidth": 0, "color": look.colour}
    axes.plot(*_points(cheapest, error), label=f"{form} form,\ncheapest runs", **style)
    _grey_out(axes, cheapest, error, look.marker, size)
    # All runs of the form have the same model error; a form may have none.
    for model_error in runs[f"model_{error}"].dropna().head(1):
        label = f"{form} form,\nmodel error"
        axes.axvline(
            float(model_error), color=look.colour, linewidth=1.0, linestyle=":", label=label
        )


def _points(runs: pd.DataFrame, error: str) -> tuple[np.ndarray, np.ndarray]:
    """Errors and seconds of runs, each of shape (n,)."""
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
    """A hollow marker above the upper edge for each solver and tolerance with a run that has no result.

    It stands at the tolerance; markers of one tolerance stand side by side.
    """
    figure: Any = axes.figure
    failed: Any = where(runs, runs["status"] != Status.REACHED_END)
    places = failed["tolerance"].astype(float)
    if axes.lines:
        # Failed runs whose tolerance lies beyond the errors that are drawn stand at the edge.
        places = places.clip(*sorted(axes.get_xlim()))
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
            # 7 points above the edge; solvers at one tolerance stand 8 points apart.
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
    lines = axes.get_lines()
    if len([line for line in lines if not str(line.get_label()).startswith("_")]) > few:
        _grey_behind(lines)
    names = _names_of(axes)
    for name, height in zip(names, _heights_of(axes, names), strict=True):
        _write_name(axes, name, height)


def _grey_behind(lines: Sequence[Line2D]) -> None:
    """Show pale lines in grey, without markers or names, and the failed runs of solvers without a named line."""
    named = set()
    for line in lines:
        label = str(line.get_label())
        # Pale lines alone have an opacity (`work_precision`, `profiles`).
        if line.get_alpha() is not None:
            line.set(color=BEHIND, marker="", alpha=1.0, label=f"_{label}")
        elif _has_name(line):
            named.add(label.partition(", ")[0])
    for line in lines:
        label = str(line.get_label())
        solver = label.removeprefix("_").removesuffix(NO_RESULT)
        if label.endswith(NO_RESULT) and solver not in named:
            line.set(color=BEHIND)


def _has_name(line: Line2D) -> bool:
    """Whether a line's name belongs beside the panel, and not into the key."""
    label = str(line.get_label())
    in_key = label.startswith("_") or "\n" in label or label == _FRONT_NAME
    return not in_key and len(np.asarray(line.get_xydata())) > 0


def _points_of(figure: Any) -> float:
    """Pixels of a point, 1/72 inch.

    Names stand at places in points, which a picture's resolution does not change.
    """
    return figure.dpi / 72


def _names_of(axes: Axes) -> list[_LineName]:
    """Names of a panel's lines by the heights of their ends, the lowest first."""
    names = []
    for line in axes.get_lines():
        if not _has_name(line):
            continue
        label = str(line.get_label())
        text = _broken(label) if len(label) > _LONGEST_NAME else label
        end = np.asarray(line.get_xydata())[-1]
        height = axes.transData.transform(end)[1] / _points_of(axes.figure)
        names.append(_LineName(line, text, tuple(end), height))
    return sorted(names, key=lambda name: name.height)


def _broken(name: str) -> str:
    """A name in lines that find room beside a panel."""
    parts = name.replace(", ", ",\n").splitlines()
    return "\n".join(
        line for part in parts for line in wrap(part, _LONGEST_LINE, break_long_words=False)
    )


def _heights_of(axes: Axes, names: Sequence[_LineName]) -> np.ndarray:
    """Heights of names above the foot of the figure, in points.

    Names move as little as keeps them apart, in order and beside the panel.
    """
    if not names:
        return np.array([])
    box = axes.get_window_extent()
    point = _points_of(axes.figure)
    # Stacked without gaps the names, as high as `rooms`, have their middles at `middles`. Heights less
    # `middles` may not fall from one name to the next: isotonic regression finds the nearest such values.
    rooms = np.array([_NAME_SPACING * (1 + name.text.count("\n")) for name in names])
    middles = np.cumsum(rooms) - rooms / 2
    # Names may rise above the panel by a line and a half. Below it stand the
    # numbers of its axis.
    highest = box.y1 / point + 1.5 * _NAME_SPACING - rooms.sum()
    lowest = min(box.y0 / point, highest)
    shifts = isotonic_regression([name.height for name in names] - middles).x
    return middles + np.clip(shifts, lowest, highest)


def _write_name(axes: Axes, name: _LineName, height: float) -> None:
    """Write a line's name beside the panel, at a height in points, with its marker and a line from its end."""
    figure: Any = axes.figure
    point = _points_of(figure)
    # The line starts at the name's left edge, lest it cross the names beside it, and leaves room for the
    # marker: 12 points there, 2 at the other end.
    arrow = {
        "arrowstyle": "-",
        "color": BEHIND,
        "lw": 0.4,
        "shrinkA": 12,
        "shrinkB": 2,
        "relpos": (0, 0.5),
    }
    left = axes.get_window_extent().x1 / point + _NAME_OFFSET
    axes.annotate(
        name.text,
        name.end,
        (left, height),
        textcoords="figure points",
        arrowprops=arrow,
        annotation_clip=False,
        fontsize=LETTERS,
        color=INK,
        va="center",
        linespacing=1.0,
    )
    # The middle of the marker, in shares of the figure's width and height.
    x, y = np.array([left - _MARKER_OFFSET, height]) * point / figure.bbox.size
    line = name.line
    style = {"color": line.get_color(), "marker": line.get_marker(), "markersize": 6}
    mark = Line2D([x], [y], transform=figure.transFigure, **style)
    if mark.get_marker() in ("", "None", None):
        dash = _DASH * point / figure.bbox.width
        mark = Line2D(
            [x - dash, x + dash],
            [y, y],
            transform=figure.transFigure,
            color=line.get_color(),
            linewidth=line.get_linewidth(),
        )
    figure.add_artist(mark)


def work_precision_panels(
    records: pd.DataFrame, error: str, label: str, *, scene: str = "", note: str = ""
) -> Figure:
    """One panel of `work_precision` per St, on the same axes.

    `error` is the column to draw, `label` its name on the axis. `scene` begins each title; `note` stands
    below the panels.
    """
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

    `error` is the column to draw, `label` its name on the axis. Decades of the error and of the time have
    one length. The key stands on top, `note` below.
    """
    everything = pd.concat([runs for _, runs in groups])
    limits = []
    for _, runs in groups:
        shown: Any = everything if alike else runs
        error_ends = _decades(shown[error], LARGEST_ERROR)
        time_ends = _decades(shown["seconds"], np.inf, least=1)
        limits.append(_Limits(*error_ends, *time_ends))
    width = WIDTH - _LEFT - _NAMES_WIDTH
    # Inches of a decade, the same in all panels and along both axes.
    decade = min(min(width / ends.error_decades for ends in limits), _MOST_DECADE)
    heights = [max(_LEAST_HEIGHT, decade * ends.time_decades) for ends in limits]
    # The height follows below, once all that stands above and beside the panels is known.
    drawing = plt.figure(figsize=(WIDTH, 1.0))
    grid = [drawing.add_subplot() for _ in groups]
    for axes, (title, runs), ends, height in zip(grid, groups, limits, heights, strict=True):
        _draw_panel(axes, runs, error, ends, height / decade)
        axes.set_title(title, fontsize=TITLE, loc="left", pad=_TITLE_DISTANCE, color=INK)
    grid[-1].set_xlabel(f"{label}, smaller to the right", fontsize=LETTERS, color=INK)
    handles = _key_of(grid)
    columns = _key_columns(handles)
    key_height = _KEY_LINE * ceil(len(handles) / columns) + _KEY_MARGIN
    below = [_BELOW if not alike or axes is grid[-1] else _BELOW_UPPER for axes in grid]
    total = key_height + sum(heights) + _ABOVE * len(grid) + sum(below)
    drawing.set_size_inches(WIDTH, total)
    # Panels are placed from the top down; `edge` is the lowest inch that is taken.
    edge = total - key_height
    for axes, ends, height, room in zip(grid, limits, heights, below, strict=True):
        edge -= _ABOVE + height
        # Left, bottom, width and height, in shares of the figure.
        axes.set_position(
            (_LEFT / WIDTH, edge / total, decade * ends.error_decades / WIDTH, height / total)
        )
        edge -= room
    _write_key(drawing, handles, columns)
    caption(drawing, note)
    for axes in grid:
        name_lines(axes, _FEW_LINES)
    return drawing


def _draw_panel(
    axes: Axes, runs: pd.DataFrame, error: str, ends: _Limits, time_decades: float
) -> None:
    """Draw runs into a panel whose height has room for `time_decades`, with a power of ten at each tick."""
    axes.set_xlim(10.0**ends.most_error, 10.0**ends.least_error)
    work_precision(axes, runs, error)
    # A panel of the least height is filled up with empty decades.
    most_time = max(ends.most_time, ends.least_time + time_decades)
    axes.set_ylim(10.0**ends.least_time, 10.0**most_time)
    step = 100.0 if ends.error_decades > _MAX_WRITTEN_DECADES else 10.0
    axes.xaxis.set_major_locator(LogLocator(step, numticks=_MAX_TICKS))
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.yaxis.set_major_locator(LogLocator(10.0, numticks=_MAX_TICKS))
    axes.set_ylabel("time, s", fontsize=LETTERS, color=INK)


def _decades(values: pd.Series, most: float, least: int = 0) -> tuple[float, float]:
    """Exponents of the powers of ten around positive values below `most`; more than `least` decades apart."""
    numbers = values.dropna().to_numpy(float)
    numbers = numbers[(numbers > 0) & (numbers < most)]
    if not numbers.size:
        # An empty panel: any two decades.
        return -1.0, 1.0
    low = floor(log10(float(numbers.min())) - _MARKER_ROOM)
    high = ceil(log10(float(numbers.max())) + _MARKER_ROOM)
    return low, max(high, low + least + 1)


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


def _key_columns(handles: Sequence[Any]) -> int:
    """Columns of the key, which are filled one after the other: two where the longest texts of both have room."""
    half = ceil(len(handles) / 2)
    columns = (handles[:half], handles[half:])
    letters = [max(len(str(handle.get_label())) for handle in part) for part in columns if part]
    return 2 if sum(letters) <= _KEY_LETTERS else 1


def _write_key(drawing: Figure, handles: Sequence[Any], columns: int) -> None:
    """Write the key into the upper left corner."""
    spacing = {"columnspacing": 1.4, "handletextpad": 0.8, "labelspacing": 0.35}
    key(drawing, handles, columns, loc="upper left", bbox_to_anchor=(0.0, 1.0), **spacing)


def times(table: pd.DataFrame, error: str = "slow_error") -> pd.DataFrame:
    """Seconds to each of `TARGETS`, NaN without: a row for each problem that somebody solves, a column for each method.

    `error` is the column of `table` that has to meet them.
    """
    groups = []
    for _, scene_runs in by_scene(table):
        groups += [runs for _, runs in by_stokes(scene_runs)]
    # A row for each form and solver, a column for each problem.
    seconds: Any = costs(enumerate(groups), TARGETS, error).dropna(how="all").T
    if not len(seconds):
        return seconds
    # Pairs of one label are one method: the fastest of them counts.
    labels = [Method(form, solver).label for form, solver in seconds.index]
    return seconds.groupby(labels, sort=False).min().T


def profile_lines(
    runs: pd.DataFrame,
    folder: Path,
    name: str = "profiles",
    title: str = "Robust or fast",
    note: str = "",
) -> list[str]:
    """Save the figure `profiles` of runs as ``NAME.png`` into a folder; the lines of a page on it.

    There is no figure and no line where nobody solves anything. `title` heads the lines, `note` stands below
    the figure.
    """
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
    """Who is seldom far from the fastest, and who gets there most often, from a table of `times`."""
    ratios = seconds.div(seconds.min(axis=1), axis=0)
    nearly_fastest = (ratios <= _NEAR).mean()
    reached = seconds.notna().mean()
    # Among equally sure methods the sentence names first the one that is fast more often.
    order = nearly_fastest.sort_values(ascending=False, kind="stable").index
    first = str(order[0])
    ordered = reached.reindex(order)
    surest = [str(name) for name in ordered.index[ordered == ordered.max()]]
    return fill(
        "profiles-sentence",
        count=len(seconds),
        first=first,
        surest=surest,
        near=nearly_fastest[first],
        reached=ordered.max(),
        factor=_NEAR,
        slow=[np.nanquantile(ratios[name].to_numpy(float), _NINE_IN_TEN) for name in surest],
    )


def profiles(seconds: pd.DataFrame, note: str = "") -> Figure:
    """The share of problems solved within a factor of the fastest, and within a time; `note` stands below.

    With n problems a curve rises by 1/n at each one that the method solves, up to the right end of the panel.
    """
    figure = plt.figure(figsize=(WIDTH, _PROFILES_HEIGHT))
    grid = [figure.add_subplot(2, 1, place) for place in (1, 2)]
    ratios = seconds.div(seconds.min(axis=1), axis=0)
    fastest = float(np.nanmin(seconds.to_numpy(float)))
    longest = float(np.nanmax(seconds.to_numpy(float)))
    # Methods are ranked by the share of problems solved nearly as fast as the fastest, plus the share
    # solved at all: both count as much.
    standing = (ratios <= _NEAR).mean() + seconds.notna().mean()
    named = set(standing.sort_values(ascending=False).index[:NAMED])
    for name, look in looks(map(str, seconds)).items():
        for axes, values, end in (
            (grid[0], ratios[name], _LARGEST_FACTOR),
            (grid[1], seconds[name], longest * _BEYOND),
        ):
            style: dict[str, Any] = {"color": look.colour, "linewidth": 1.8}
            if name not in named:
                style = {"color": BEHIND, "linewidth": 0.8, "alpha": 0.5, "zorder": 1}
            points, shares = _profile(values.dropna().to_numpy(float), len(seconds), end)
            axes.step(points, shares, where="post", label=name, **style)
    grid[0].set_xlim(1, _LARGEST_FACTOR)
    grid[1].set_xlim(fastest / _BEYOND, longest * _BEYOND)
    for axes, label in (
        (grid[0], "time over that of the fastest"),
        (grid[1], "wall time of a warm run, s"),
    ):
        axes.set_xscale("log")
        percent_axis(axes)
        # In these low panels less room above 1 than `percent_axis` leaves.
        axes.set_ylim(0, 1.02)
        axes.set_xlabel(label)
        title = f"Share of {len(seconds)} problems solved"
        axes.set_title(title, fontsize=TITLE, loc="left", color=INK)
        plain(axes)
    # 0.55 inches at the left hold the numbers and the label; the other shares are chosen by eye.
    figure.subplots_adjust(
        left=0.55 / WIDTH, right=1 - _NAMES_WIDTH / WIDTH, bottom=0.1, top=0.94, hspace=0.55
    )
    caption(figure, note)
    for axes in grid:
        name_lines(axes)
    return figure


def _profile(values: np.ndarray, count: int, end: float) -> tuple[np.ndarray, np.ndarray]:
    """Places and heights of the steps of one curve, which rises by 1/count at each value up to `end`."""
    points = np.sort(values)
    points = points[points <= end]
    shares = np.arange(1, len(points) + 1) / count
    # The curve goes on at its height to the edge of the panel.
    points = np.append(points, end)
    shares = np.append(shares, shares[-1] if len(shares) else 0.0)
    return points, shares


def heat_map(
    ratios: pd.DataFrame, titles: Sequence[str], note: str = "", most: float = _LARGEST_SHADED
) -> Figure:
    """Ratios of times to the fastest one: a row for each problem, a column for each solver, a panel for each title.

    `ratios` has two levels of rows: a value for each title, in their order, and the names of the problems.
    Shades end at the ratio `most`. Numbers stand where a solver is within 10 times the fastest. A cell is
    white where no run reaches the error. `note` stands below.
    """
    names = [str(name) for name in ratios]
    rows = [str(row) for row in ratios.index.get_level_values(1).unique()]
    # Inches.
    left = 1.25  # Names of rows.
    right = 0.05  # From the cells to the figure's edge.
    title_height = 0.32
    bottom = 0.95  # Names of columns.
    key_height = 0.5
    row_height = 0.19
    cell = (WIDTH - left - right) / len(names)
    panel = row_height * len(rows)
    total = (panel + title_height) * len(titles) + bottom + key_height
    figure = plt.figure(figsize=(WIDTH, total))
    shades = plt.get_cmap("YlOrBr")
    # Panels are placed from the top down; `edge` is the lowest inch that is taken.
    edge = total - key_height
    grid = []
    for place, title in zip(ratios.index.get_level_values(0).unique(), titles, strict=True):
        edge -= title_height + panel
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
        _write_ratios(axes, values)
        axes.set_title(
            title,
            fontsize=TITLE,
            loc="left",
            color=INK,
            pad=4,
            # From the left edge of the cells, over their width.
            x=(TITLE_LEFT - left) / (cell * len(names)),
        )
        axes.set_ylim(len(rows), 0)
        axes.set_yticks(np.arange(len(rows)) + 0.5, rows, fontsize=SMALL_LETTERS, color=INK)
        axes.tick_params(length=0)
        axes.spines[:].set_visible(False)
        axes.xaxis.set_major_locator(FixedLocator([]))
    grid[-1].set_xticks(
        np.arange(len(names)) + 0.5, names, fontsize=SMALL_LETTERS, color=INK, rotation=90, va="top"
    )
    handles = []
    for ratio in _KEY_RATIOS:
        shade = shades(log10(ratio) / log10(most))
        handles.append(Patch(facecolor=shade, label=f"{ratio}"))
    handles[-1].set_label(f"{_KEY_RATIOS[-1]} and more")
    handles.append(Patch(facecolor="white", edgecolor="0.7", label="never"))
    key(
        figure,
        handles,
        len(handles),
        loc="upper left",
        fontsize=SMALL_LETTERS,
        handlelength=1.0,
        columnspacing=0.9,
        handletextpad=0.4,
        borderaxespad=0.1,
        title="Time over that of the fastest",
        title_fontsize=SMALL_LETTERS,
        alignment="left",
    )
    caption(figure, note)
    return figure


def _write_ratios(axes: Axes, ratios: np.ndarray) -> None:
    """Write the ratios near the fastest into the cells of a heat map, shape (rows, columns)."""
    for (row, column), ratio in np.ndenumerate(ratios):
        if ratio < _WRITTEN_BELOW:
            fastest = ratio < _FASTEST_BELOW
            text = "1" if fastest else f"{ratio:.2g}"
            style = {"fontsize": 8, "weight": "bold" if fastest else "normal"}
            axes.text(column + 0.5, row + 0.5, text, ha="center", va="center", color=INK, **style)
