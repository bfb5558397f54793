"""Parts of the paper's figures: style, panels, curves, legends, saving.

An item's `draw` makes a figure by `panels`, draws the rows of tables (`draw_each`, `draw_levels`,
`draw_power`), and puts legends outside the panels: `key_above` one for the figure, `key_of` one for
a panel. `harness/paper/reproduction.py` calls `draw` within `style`, and then `save`, which
breaks the labels of axes that are too long. `harness/pages/figures/style.py` has the colours and sizes, as of
all figures.
"""

import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from io import BytesIO
from itertools import cycle
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
YELLOW = "#F2E27A"  # For areas alone: a line of it would be too light on white.
CYCLE = SERIES  # Colours of curves, in turn.
AVERAGED = BLACK  # The averaged run.
# The averaged run, then full runs at several St. The L_z–E planes have three full runs at most,
# since their line L_z + 4E = 0 is green.
RUNS = (AVERAGED, BLUE, ORANGE, VERMILLION, GREEN)
BOUND = "0.55"  # Bounds of E in the L_z–E planes: a grey, from "0" for black to "1" for white.
NODE = PURPLE  # Fixed points in the L_z–E planes.
FIGURE_FORMATS = ("png", "svg")  # Endings of a figure's files; PNG is always written.
# Settings of Matplotlib that only the paper's figures have, beside `RC`.
_STYLE: dict[Any, Any] = {
    "axes.grid": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "lines.linewidth": 1.1,  # Points.
    # Without a salt the same figure would get other names of its parts, and so another SVG.
    "svg.hashsalt": "polhode",
    "mathtext.fontset": "dejavusans",
}
# A key is a legend. Widths of keys are counted in letters; all of them are estimates, by eye.
_KEY_LETTERS = 74  # Width of the page.
_GAP_LETTERS = 6  # Width of a name's sample of its line, with the gaps beside it.
_NAME_LETTERS = 50  # Longer names break into lines, in a panel as wide as the page.
_LETTER_WIDTH = 0.082  # Inches: width of a letter of an axis' label; most letters are narrower.


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
    *,
    wspace: float | None = None,
    **options: Any,
) -> tuple[Figure, list[Axes]]:
    """A figure as wide as a page, and its axes in reading order.

    Parameters
    ----------
    rows, columns
        Numbers of panels.
    height
        Height of one row of panels, in inches.
    spatial
        Panels that have three dimensions, by their places in reading order, from 0 on.
    wspace
        Room between the columns, as a share of the figure's width; None for Matplotlib's own.
    options
        Arguments of `Figure.subplot_mosaic`, such as ``sharey``.
    """
    layout = ConstrainedLayoutEngine(wspace=wspace)
    figure = Figure(figsize=(WIDTH, height * rows), layout=layout)
    places = range(rows * columns)
    mosaic: Any = np.arange(rows * columns).reshape(rows, columns).tolist()
    kinds: dict[Any, Any] = {place: {"projection": "3d"} for place in spatial}
    axes_by_place = figure.subplot_mosaic(mosaic, per_subplot_kw=kinds, **options)
    return figure, [axes_by_place[place] for place in places]


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
    """Draw a curve for each value of a table's key column.

    Parameters
    ----------
    axes
        The panel.
    table
        Rows of all curves.
    key
        Column whose values tell the curves apart.
    x, y
        Columns, or functions of a curve's rows.
    label
        A curve's name in the legend, from its value of `key`; None for no name.
    colors
        Colours of the curves, in turn.
    style
        Arguments of `Axes.plot`; they override the colour and the name.

    Raises
    ------
    ValueError
        The table has no rows: a figure that lacks its data is a mistake.
    """
    require_rows(table)
    for color, (value, rows) in zip(cycle(colors), groups(table, key), strict=False):
        text = label(value) if label else None
        axes.plot(column(rows, x), column(rows, y), **{"color": color, "label": text, **style})


def draw_levels(
    axes: Axes, table: Table, key: str, y: Values, colors: Sequence[str] = CYCLE, **style: Any
) -> None:
    """Draw a horizontal line for each value of a table's key column, at `y` of its first row.

    `draw_each` describes the arguments, and the error for a table without rows.
    """
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
    """Draw the power law x^exponent through `last` at the last of the points x, shape (n,).

    Without a `label` the legend names the exponent.
    """
    text = f"slope {exponent:.3g}" if label is None else label
    axes.plot(x, last * (x / x[-1]) ** exponent, color=color, linestyle=linestyle, label=text)


def name_line(axes: Axes, label: str, **style: Any) -> None:
    """Put a line of this style into the legend, and draw none: other calls draw it, unnamed."""
    axes.plot([], [], label=label, **style)


def key_above(figure: Figure, axes: Axes, **options: Any) -> None:
    """Put a key above all panels of a figure, with the names of one of them.

    `options` are arguments of `Figure.legend`.
    """
    handles, labels = axes.get_legend_handles_labels()
    key(figure, handles, _columns(labels, _KEY_LETTERS), **options)


def key_of(axes: Axes, **options: Any) -> None:
    """Put the key of a panel above it, below the panel's title.

    The title becomes the key's: a title of Matplotlib's would lie on the key. `options` are
    arguments of `Axes.legend`.
    """
    handles, labels = axes.get_legend_handles_labels()
    panels_beside = axes.get_gridspec().ncols  # pyright: ignore[reportOptionalMemberAccess]
    names = [_wrapped(label, _NAME_LETTERS / panels_beside) for label in labels]
    # The last five are lengths in units of the letters' size.
    style: dict[str, Any] = {
        "loc": "lower left",
        "bbox_to_anchor": (0.0, 1.0),
        "ncols": _columns(names, _KEY_LETTERS / panels_beside - _GAP_LETTERS),
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


def _columns(names: Sequence[str], room: float) -> int:
    """The largest number of columns in which a key's names fit into `room` letters.

    Matplotlib fills a key column by column.
    """
    lengths = []
    for name in names:
        lines = name.split("\n")
        lengths.append(max(map(_letters, lines)))
    for columns in range(len(lengths), 1, -1):
        widths = [max(part) for part in np.array_split(lengths, columns)]
        if sum(widths) + _GAP_LETTERS * columns <= room:
            return columns
    return 1


def _letters(text: str) -> int:
    r"""About the number of letters that a reader sees of a text with formulas.

    The signs of formulas do not count, nor do their commands: ``\mathrm``, but also ``\kappa``,
    which a reader sees as a letter. For an estimate that is close enough.
    """
    visible = re.sub(r"\\(?:mathrm|dot)|(?<=\\)[a-z]+|[${}_^\\]", "", text)
    return len(visible)


def _wrapped(text: str, letters: float) -> str:
    """A text in lines of at most a number of letters; a longer word has a line of its own.

    A formula, from $ to $, is part of a word: its spaces break no line.
    """
    words = re.findall(r"(?:\$[^$]*\$|[^\s$])+", text)
    lines = [""]
    for word in words:
        longer = f"{lines[-1]} {word}".strip()
        if lines[-1] and _letters(longer) > letters:
            lines.append(word)
        else:
            lines[-1] = longer
    return "\n".join(lines)


def _fit_labels(figure: Figure) -> None:
    """Break labels of axes that are longer than their axes, as estimated from `_LETTER_WIDTH`.

    Panels of three dimensions are left as they are.
    """
    flat = [axes for axes in figure.axes if not hasattr(axes, "get_zlabel")]
    labels = []
    for axes in flat:
        labels += [axes.xaxis.label, axes.yaxis.label]
    texts = [label.get_text() for label in labels]
    # Labels that are too long would leave no room for the axes that are measured.
    for label in labels:
        label.set_text("")
    # The first round measures the axes without labels. Labels of several lines make them smaller:
    # the second round measures that.
    for _ in range(2):
        figure.draw_without_rendering()
        lengths = []
        for axes in flat:
            box = axes.get_window_extent()
            lengths += [box.width, box.height]
        for label, text, pixels in zip(labels, texts, lengths, strict=True):
            inches = pixels / figure.dpi
            label.set_text(_wrapped(text, inches / _LETTER_WIDTH))


def require_rows(table: Table) -> None:
    """Raise ValueError for a table without rows."""
    if not len(table):
        raise ValueError("curve: got a table without rows, expected some")


def unit_sphere(axes: Any) -> None:
    """Prepare three-dimensional axes for paths on the unit sphere, which is drawn as a grey net."""
    # Meridians and parallels 15 degrees apart.
    azimuth, polar = np.meshgrid(np.linspace(0, 2 * np.pi, 25), np.linspace(0, np.pi, 13))
    x = np.cos(azimuth) * np.sin(polar)
    y = np.sin(azimuth) * np.sin(polar)
    z = np.cos(polar)
    # Lines lie above each other by the `zorder` of their call: Matplotlib's own order, by distance
    # from the eye, may put a whole path behind the net.
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
    """A run in the legend: a full one by its St, the averaged one, whose St is ∞, as such."""
    return "averaged" if np.isinf(stokes) else f"full, St = {power(stokes)}"


def draw_broken(axes: Axes, x: np.ndarray, y: np.ndarray, paths: np.ndarray, **style: Any) -> None:
    """Draw several paths as one line with gaps, so that they share one entry of the legend.

    `paths` has the number of each point's path; points of a path stand together. Shapes are (n,).
    """
    # Matplotlib breaks a line at NaN.
    gaps = np.flatnonzero(np.diff(paths)) + 1
    axes.plot(np.insert(x, gaps, np.nan), np.insert(y, gaps, np.nan), **style)


def save(figure: Figure, folder: Path, name: str, *, svg: bool = False) -> None:
    """Save a figure as PNG, and with `svg` as SVG too; the same figure gives the same files."""
    _fit_labels(figure)
    write_file(folder / f"{name}.png", _png(figure))
    if svg:
        drawn = BytesIO()
        # Without the date.
        figure.savefig(drawn, format="svg", dpi=DPI, metadata={"Date": None})
        write_file(folder / f"{name}.svg", drawn.getvalue())


def _png(figure: Figure) -> bytes:
    """A figure as PNG; few colours keep it small."""
    drawn = BytesIO()
    # Without the version of Matplotlib.
    figure.savefig(drawn, format="png", dpi=DPI, metadata={"Software": None})
    reduced = BytesIO()
    with Image.open(drawn) as image:
        few_colours(image.convert("RGB")).save(reduced, "png", optimize=True)
    return reduced.getvalue()
