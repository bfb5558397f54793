"""How the figures of the reproduction look: the style of all figures, panels with labels and units, keys above."""

import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from io import BytesIO
from itertools import chain, cycle
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from cycler import cycler
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from PIL import Image

from polhode.harness.common.files import write_file
from polhode.harness.pages.figures.style import (
    BLUE,
    DPI,
    GREEN,
    INK,
    ORANGE,
    PURPLE,
    RC,
    SERIES,
    TITLE,
    VERMILLION,
    WIDTH,
    few_colours,
    key,
    power,
)
from polhode.harness.paper.item import Table
from polhode.harness.paper.tables import groups

# A column's name, or a function of the rows that gives the values.
Values = str | Callable[[Table], Any]

BLACK = INK
YELLOW = "#F2E27A"  # Areas alone.
CYCLE = SERIES
# Colours of the averaged run and of full ones at several St, in turn. The planes have three runs at
# most: green is a line of theirs.
AVERAGED = BLACK
RUNS = (AVERAGED, BLUE, ORANGE, VERMILLION, GREEN)
BOUND = "0.55"  # Grey of the bounds of a plane.
NODE = PURPLE
FIGURE_FORMATS = ("png", "svg")
# Settings of the paper's figures alone. With a salt the same figure gives the same SVG.
_STYLE: dict[Any, Any] = {
    "axes.grid": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "lines.linewidth": 1.1,
    "svg.hashsalt": "polhode",
    "mathtext.fontset": "dejavusans",
}
# A key is a legend. Its widths are counted in letters, and are estimates.
_KEY_LETTERS = 74  # A line as wide as the page.
_GAP = 6  # The sample of a line, and the gap, that each name needs besides.
_NAME_LETTERS = 50  # A longer name in a key above a panel as wide as the page breaks.
_LETTER = 0.082  # Inches: the width of most letters, in labels of axes.


@contextmanager
def style() -> Iterator[None]:
    """Matplotlib with the settings of the reproduction, whatever the user's own are."""
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update({**RC, **_STYLE, "axes.prop_cycle": cycler(color=CYCLE)})
        yield


def panels(
    rows: int,
    columns: int,
    height: float,
    spatial: Sequence[int] = (),
    **options: Any,
) -> tuple[Figure, list[Axes]]:
    """A figure as wide as a page, and its axes in reading order; some may have three dimensions.

    `height` is the height of a row of panels, in inches.
    """
    layout = ConstrainedLayoutEngine(wspace=options.pop("wspace", None))
    figure = Figure(figsize=(WIDTH, height * rows), layout=layout)
    places: Any = np.arange(rows * columns).reshape(rows, columns).tolist()
    kinds: dict[Any, Any] = {place: {"projection": "3d"} for place in spatial}
    axes_by_place = figure.subplot_mosaic(places, per_subplot_kw=kinds, **options)
    return figure, [axes_by_place[place] for place in chain.from_iterable(places)]


def column(table: Table, values: Values) -> Any:
    """Values of a table's rows: a column by its name, or what a function makes of the rows."""
    return table[values] if isinstance(values, str) else values(table)


def draw_each(
    axes: Axes,
    table: Table,
    key: str,
    x: Values,
    y: Values,
    *,
    label: Callable[[float], str] | None = None,
    colors: Sequence[str] = CYCLE,
    **style: Any,
) -> None:
    """Draw a curve for each value of a table's key column, in turn in each of the colors.

    Raises ValueError for a table without rows: a figure that lacks its data is a mistake.
    """
    require_rows(table)
    for color, (value, rows) in zip(cycle(colors), groups(table, key), strict=False):
        text = label(value) if label else None
        axes.plot(column(rows, x), column(rows, y), **{"color": color, "label": text, **style})


def draw_levels(
    axes: Axes, table: Table, key: str, y: Values, colors: Sequence[str] = CYCLE, **style: Any
) -> None:
    """Draw a horizontal line for each value of a table's key column, at the first of its values."""
    require_rows(table)
    for color, (_, rows) in zip(cycle(colors), groups(table, key), strict=False):
        axes.axhline(column(rows, y)[0], **{"color": color, **style})


def draw_power(
    axes: Axes,
    x: np.ndarray,
    last: float,
    exponent: float,
    *,
    color: str = BLACK,
    linestyle: str = ":",
    label: str | None = None,
) -> None:
    """Draw a power law that has the value `last` at the last of the points x."""
    text = f"slope {exponent:.3g}" if label is None else label
    axes.plot(x, last * (x / x[-1]) ** exponent, color=color, linestyle=linestyle, label=text)


def name_line(axes: Axes, label: str, **style: Any) -> None:
    """Put a line into the legend that other calls draw."""
    axes.plot([], [], label=label, **style)


def key_above(figure: Figure, axes: Axes, **options: Any) -> None:
    """Put the key of one of the axes above all of them."""
    handles, labels = axes.get_legend_handles_labels()
    for handle, label in zip(handles, labels, strict=True):
        handle.set_label(label)
    key(figure, handles, _columns(labels, _KEY_LETTERS), **options)


def key_of(axes: Axes, **options: Any) -> None:
    """Put the key of a panel above it, below the panel's title."""
    handles, labels = axes.get_legend_handles_labels()
    columns = axes.get_gridspec().ncols  # pyright: ignore[reportOptionalMemberAccess]
    names = [_wrapped(label, _NAME_LETTERS / columns) for label in labels]
    style: dict[str, Any] = {
        "loc": "lower left",
        "bbox_to_anchor": (0.0, 1.0),
        "ncols": _columns(names, _KEY_LETTERS / columns - _GAP),
        "title": axes.get_title(loc="left") or None,
        "title_fontsize": TITLE,
        "alignment": "left",
        "borderaxespad": 0.2,
        "handlelength": 1.6,
        "handletextpad": 0.5,
        "columnspacing": 1.2,
        "labelspacing": 0.3,
    }
    axes.legend(handles, names, **(style | options))
    axes.set_title("", loc="left")


def _columns(labels: Sequence[str], room: float) -> int:
    """The most columns in which names, filled in column by column, have room."""
    lengths = [max(len(_seen(line)) for line in label.split("\n")) for label in labels]
    for columns in range(len(lengths), 1, -1):
        widths = [max(part) for part in np.array_split(lengths, columns)]
        if sum(widths) + _GAP * columns <= room:
            return columns
    return 1


def _seen(text: str) -> str:
    """About the letters that are seen of a text with formulas."""
    return re.sub(r"\\(?:mathrm|dot)|(?<=\\)[a-z]+|[${}_^\\]", "", text)


def _wrapped(text: str, letters: float) -> str:
    """A text in lines of at most a number of letters; no line breaks within a formula."""
    words = re.findall(r"(?:\$[^$]*\$|[^\s$])+", text)
    lines = [""]
    for word in words:
        longer = f"{lines[-1]} {word}".strip()
        if lines[-1] and len(_seen(longer)) > letters:
            lines.append(word)
        else:
            lines[-1] = longer
    return "\n".join(lines)


def _fit_labels(figure: Figure) -> None:
    """Break labels of axes that are longer than their axes, by the width of most letters."""
    flat = [axes for axes in figure.axes if not hasattr(axes, "get_zlabel")]
    labels = [label for axes in flat for label in (axes.xaxis.label, axes.yaxis.label)]
    texts = [label.get_text() for label in labels]
    # Too long ones would leave no room for the axes that are measured.
    for label in labels:
        label.set_text("")
    # Labels of several lines leave less room than none: the second round measures that.
    for _ in range(2):
        figure.draw_without_rendering()
        boxes = [axes.get_window_extent() for axes in flat]
        lengths = [pixels for box in boxes for pixels in (box.width, box.height)]
        for label, text, pixels in zip(labels, texts, lengths, strict=True):
            label.set_text(_wrapped(text, pixels / figure.dpi / _LETTER))


def require_rows(table: Table) -> None:
    """Raise ValueError for a table without rows."""
    if not len(table):
        raise ValueError("curve: got a table without rows, expected some")


def unit_sphere(axes: Any) -> None:
    """Prepare three-dimensional axes for paths on the unit sphere."""
    u, v = np.meshgrid(np.linspace(0, 2 * np.pi, 25), np.linspace(0, np.pi, 13))
    x = np.cos(u) * np.sin(v)
    y = np.sin(u) * np.sin(v)
    z = np.cos(v)
    axes.computed_zorder = False
    axes.plot_wireframe(x, y, z, color="0.85", linewidth=0.4, zorder=0)
    white_panes(axes)
    axes.set(xlabel="flow $x$", ylabel="gradient $y$", zlabel="vorticity $z$")
    axes.set(xticks=(-1, 0, 1), yticks=(-1, 0, 1), zticks=(-1, 0, 1), box_aspect=(1, 1, 1))
    axes.grid(visible=False)


def white_panes(axes: Any) -> None:
    """Let the panes behind three-dimensional axes be white, and the vertical label read upwards."""
    for axis in (axes.xaxis, axes.yaxis, axes.zaxis):
        axis.set_pane_color((1.0, 1.0, 1.0, 1.0))
    axes.zaxis.set_rotate_label(False)
    axes.zaxis.label.set_rotation(90)


def run_name(stokes: float) -> str:
    """A full run by its St, or the averaged one, whose St is ∞."""
    return "averaged" if np.isinf(stokes) else f"full, St = {power(stokes)}"


def draw_broken(axes: Axes, x: np.ndarray, y: np.ndarray, paths: np.ndarray, **style: Any) -> None:
    """Draw several paths as one line with gaps, so that they share one entry of the legend."""
    gaps = np.flatnonzero(np.diff(paths)) + 1
    axes.plot(np.insert(x, gaps, np.nan), np.insert(y, gaps, np.nan), **style)


def save(figure: Figure, folder: Path, name: str, *, svg: bool = False) -> None:
    """Save a figure as PNG, and as SVG if wanted; the same figure gives the same files.

    Few colours keep the PNG small.
    """
    _fit_labels(figure)
    for ending in FIGURE_FORMATS if svg else FIGURE_FORMATS[:1]:
        drawn = BytesIO()
        metadata = {"Date": None} if ending == "svg" else {"Software": None}
        figure.savefig(drawn, format=ending, dpi=DPI, metadata=metadata)
        if ending == "png":
            with Image.open(drawn) as image:
                drawn = BytesIO()
                few_colours(image.convert("RGB")).save(drawn, "png", optimize=True)
        write_file(folder / f"{name}.{ending}", drawn.getvalue())
