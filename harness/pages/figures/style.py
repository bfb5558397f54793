"""The look of all figures: sizes, ink, the solvers' colours in both themes, keys, captions; pictures in few colours.

A figure is 838 pixels wide, as a page on GitHub shows it, and a phone shows it at 390: letters of 9.5
points are then 9 pixels high. Words stand in ink; colours are lines, points and areas alone.

In all modules of figures the widths of lines and the sizes of letters and markers are in points;
figures are measured in inches. Unless a comment says otherwise they are chosen by eye.
"""

import re
import textwrap
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from io import BytesIO
from itertools import cycle
from math import floor, inf, log10, nan
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.markers import MarkerStyle
from PIL import Image

from polhode.harness.common.files import PartialFile
from polhode.harness.common.text import percent
from polhode.models.catalogue import FORMS, form as find_form
from polhode.solvers.catalogue import SOLVERS

DPI = 150  # Pixels in an inch of a saved figure.
WIDTH = 838 / DPI  # Inches.
LETTERS = 9.5  # Points: words and numbers.
SMALL_LETTERS = 9  # Points: names and keys that have no room for `LETTERS`.
TITLE = 10.5  # Points: the title of a panel.
TITLE_LEFT = 0.06  # Inches from the figure's left edge to a title or a caption.
INK = "#1B222C"  # Words and axes.
SOFT = "#4A5361"  # Captions.
_GRID = "#D9DEE5"  # Lines of a panel's grid.
GREY = "#C4C4C4"  # What is not known.
BEHIND = "#BDBDBD"  # What is shown, and not named.
BAND_OPACITY = 0.2  # Of an area about a line: bands that overlap stay distinct.
SHARES_TO = 1.03  # Top of an axis of shares: above 1, with room for the width of a line there.
# The caption of a figure.
_CAPTION_SIZE = 9  # Points: its letters.
_CAPTION_SPACING = 1.25  # From line to line, over Matplotlib's height of a line.
_CAPTION_LINE = 0.175  # Inches: the room for a line.
_CAPTION_LETTERS = 82  # In a line at most: so many fit into the width at that size.
_CAPTION_BELOW = 0.04  # Inches below the text.
_CAPTION_MARGIN = 0.08  # Inches above and below it together.
# Matplotlib's settings for figures of `panels`, and for those of the paper (`harness/paper/drawing.py`).
RC: dict[Any, Any] = {
    "font.size": LETTERS,
    "axes.titlesize": TITLE,
    "axes.labelsize": LETTERS,
    "xtick.labelsize": LETTERS,
    "ytick.labelsize": LETTERS,
    "legend.fontsize": LETTERS,
    "legend.title_fontsize": LETTERS,
    "legend.frameon": False,
    "figure.titlesize": TITLE,
    "text.color": INK,
    "axes.labelcolor": INK,
    "axes.edgecolor": INK,
    "axes.linewidth": 0.7,
    "axes.titlelocation": "left",
    "xtick.color": INK,
    "ytick.color": INK,
    "grid.color": _GRID,
    "grid.linewidth": 0.6,
    "axes.axisbelow": True,
}
# By solver, averaged form and form `hybrid`: a colour on white, one on a dark ground, and a marker of Matplotlib: a
# letter, or corners, style (0 a polygon, 1 a star) and turn in degrees.
LOOKS: dict[str, tuple[str, str, Any]] = {
    name: (light, dark, tuple(marker) if isinstance(marker, list) else marker)
    for name, (light, dark, marker) in tomllib.loads(
        Path(__file__).with_name("looks.toml").read_text("utf-8")
    ).items()
}
# Solvers and forms without a look of their own, such as plug-ins, share a colour (on white, on a dark
# ground), and take these markers in turn.
OTHER = ("#6B3F1D", "#C8A27E")
_OTHER_MARKERS = ("X", (5, 1, 180), (3, 1, 0), (7, 1, 0))
# Series that are neither solvers nor ordered numbers; INK is one of them. Any two differ by 10 or
# more in CIEDE2000 for all eyes, with a contrast of 3 or more on white, which test_style.py checks.
BLUE = "#204E8B"
ORANGE = "#B08903"
GREEN = "#0E7444"
VERMILLION = "#A63205"
PURPLE = "#8D4E6B"
SKY = "#4C87A6"
SERIES = (BLUE, ORANGE, GREEN, VERMILLION, PURPLE, SKY, INK)
# From few to many, as of St or of errors: one hue, darker and darker.
_RAMP = ("#8FC1E3", "#3D8BC4", "#175E96", "#0A3A63", "#061D33")
# Edges of lines have colours between line and ground, and many. More colours, or nearer ones,
# than these make the file larger, and look the same. The numbers are estimates.
_MAX_COLOURS = 128  # Of a picture.
_LEAST_DIFFERENCE = 16  # Of 255: the difference of two colours in red, green or blue.
_GREY_RANGE = 2  # Of 255: red, green and blue of a grey differ by no more.
_GREY_STEP = 6  # Of 255: the difference of two greys.
# Colours of a picture that are compared with its palette at once: some 10 MB of memory.
_COMPARED_AT_ONCE = 4096


@dataclass(frozen=True)
class Look:
    """A colour on white, one on a dark ground, and a marker of Matplotlib."""

    colour: str
    dark: str
    marker: Any

    @property
    def both(self) -> str:
        """The colour of both themes, in CSS."""
        return f"light-dark({self.colour}, {self.dark})"

    @property
    def outline(self) -> str:
        """The marker as an SVG path, y downwards, in coordinates from about -1 to 1."""
        style = MarkerStyle(self.marker)
        path = style.get_path().transformed(style.get_transform())
        parts = []
        for values, code in path.iter_segments():
            # Matplotlib's reach from about -0.5 to 0.5, y upwards.
            points = " ".join(f"{value:.2f}" for value in (values.reshape(-1, 2) * (2, -2)).ravel())
            # Codes of Matplotlib's paths: 1 moves, 2 draws a line, 4 a cubic curve, others close the path.
            parts.append({1: f"M{points}", 2: f"L{points}", 4: f"C{points}"}.get(int(code), "Z"))
        return "".join(parts)


def looks(names: Iterable[str]) -> dict[str, Look]:
    """Looks of solvers and averaged forms, in the order of `rank`."""
    ordered = sorted(set(names), key=rank)
    markers = cycle(_OTHER_MARKERS)
    return {
        name: Look(*LOOKS[name]) if name in LOOKS else Look(*OTHER, next(markers))
        for name in ordered
    }


def colour(name: str) -> str:
    """Colour of a solver or an averaged form on white."""
    return LOOKS[name][0] if name in LOOKS else OTHER[0]


def both_colours(name: str) -> str:
    """Colour of a solver or an averaged form in both themes, in CSS."""
    return looks([name])[name].both


def ramp(count: int) -> list[str]:
    """`count` colours of one hue, from light to dark; a count above `_RAMP`'s repeats some.

    A count below 2 gives the middle one alone.
    """
    if count < 2:
        return [_RAMP[len(_RAMP) // 2]]
    places = np.linspace(0, len(_RAMP) - 1, count).round().astype(int)
    return [_RAMP[place] for place in places]


def rank(name: str) -> tuple[int, str]:
    """Key to sort solvers and forms: solvers first, then forms, each in the order of its catalogue."""
    catalogue = [*SOLVERS, *FORMS]
    return (catalogue.index(name) if name in catalogue else len(catalogue)), name


def is_averaged(form: str) -> bool:
    """Whether a form, which may have no name, is averaged."""
    return bool(form) and find_form(form).averaged


def power(value: float) -> str:
    """A number for a figure: from 1000 on and below 0.01 with its power of ten, others as they are."""
    # 1e-12 is more than the rounding of the logarithm of a power of ten.
    exponent = floor(log10(value) + 1e-12) if 0 < value < inf else 0
    if -3 < exponent < 3:
        return f"{value:g}"
    factor = f"{value / 10.0**exponent:.3g}"
    return f"$10^{{{exponent}}}$" if factor == "1" else f"${factor}\\times10^{{{exponent}}}$"


# --- panels ------------------------------------------------------------------------------------------


def panels(rows: int, columns: int, height: float, **options: Any) -> tuple[Figure, np.ndarray]:
    """A figure of the width of a page, `height` inches high, and its panels, shape (rows, columns).

    `options` go to `pyplot.subplots`.
    """
    options = {"layout": "constrained", **options}
    with plt.rc_context(RC):
        figure, grid = plt.subplots(
            rows, columns, figsize=(WIDTH, height), squeeze=False, **options
        )
        for axes in grid.flat:
            plain(axes)
    return figure, grid


def square_decades(axes: Axes, *, fill: bool = False) -> None:
    """Let a decade of x be as long as one of y, so that a slope looks as steep as it is; both axes are logarithmic.

    Panels that `fill` their room show more decades instead of becoming smaller.
    """
    axes.set_aspect("equal", adjustable="datalim" if fill else "box", anchor="NW")


def slopes(axes: Axes, start: tuple[float, float], end: float, powers: Mapping[int, str]) -> None:
    """Draw dotted lines of these powers of x from the point `start` to x = `end`, each with its name at its end."""
    x, y = start
    for power_of_x, name in powers.items():
        height = y * (end / x) ** power_of_x
        axes.loglog([x, end], [y, height], ":", color=INK, linewidth=1.2)
        axes.annotate(
            name, (end, height), (3, 0), textcoords="offset points", va="center", color=INK
        )


def plain(axes: Axes) -> Axes:
    """Axes in the house's style: a grid of major lines beneath, no frame above and at the right."""
    axes.grid(visible=True, which="major", color=_GRID, linewidth=0.6)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    axes.tick_params(colors=INK, labelsize=LETTERS)
    for label in (axes.xaxis.label, axes.yaxis.label):
        label.set_fontsize(LETTERS)
        label.set_color(INK)
    return axes


def percent_axis(axes: Axes) -> None:
    """Let the vertical axis show shares from 0 to 100 %."""
    axes.set_ylim(0, SHARES_TO)
    axes.set_yticks([0, 0.25, 0.5, 0.75, 1], ["0", "", "50 %", "", "100 %"])


def key(figure: Figure, handles: Sequence[Any], columns: int, **options: Any) -> Any:
    """The key of all panels, on top of a figure; `options` go to `Figure.legend`."""
    place: dict[str, Any] = {"loc": "outside upper left"}
    # Lengths are in units of the letters' size.
    style = {"frameon": False, "fontsize": LETTERS, "labelcolor": INK, "handlelength": 1.6}
    style |= {"columnspacing": 1.2, "handletextpad": 0.5, "borderaxespad": 0.2}
    return figure.legend(handles=handles, ncols=columns, **(place | style | options))


def caption(figure: Figure, text: str) -> None:
    """Write in soft ink below all panels, which keep their sizes; the figure grows. Nothing without a text."""
    if not text:
        return
    # No line begins with the unit of a number.
    unbroken = re.sub(r" (%|cores\b)", "\N{NO-BREAK SPACE}\\1", text)
    lines = textwrap.wrap(unbroken, _CAPTION_LETTERS)
    room = _CAPTION_LINE * len(lines) + _CAPTION_MARGIN
    width, height = figure.get_size_inches()
    figure.set_size_inches(width, height + room)
    bottom = room / (height + room)
    engine = figure.get_layout_engine()
    if engine is not None:
        engine.set(rect=(0, bottom, 1, 1 - bottom))  # pyright: ignore[reportCallIssue]
    else:
        # Positions are shares of the figure, which has become higher: panels keep their inches.
        _, height_now = figure.get_size_inches()
        for axes in figure.axes:
            # Not the part that a fixed aspect leaves of it in the higher figure.
            box = axes.get_position(original=True)
            from_below = box.y0 * height + height_now - height
            place = box.x0, from_below / height_now
            axes.set_position((*place, box.width, box.height * height / height_now))
    figure.text(
        TITLE_LEFT / width,
        _CAPTION_BELOW / (height + room),
        "\n".join(lines),
        fontsize=_CAPTION_SIZE,
        color=SOFT,
        va="bottom",
        linespacing=_CAPTION_SPACING,
    )


def save(figure: Figure, folder: Path, name: str) -> None:
    """Save a figure as ``NAME.png`` in a folder, in few colours that keep the file small, and close it."""
    drawn = BytesIO()
    figure.savefig(drawn, format="png", dpi=DPI)
    with PartialFile(folder / f"{name}.png", binary=True) as file, Image.open(drawn) as image:
        few_colours(image.convert("RGB")).save(file, "png", optimize=True)
    plt.close(figure)


def measured(lines: Sequence[str]) -> str:
    """Processor and cores, from the lines by which a page says where it was measured; nothing if they do not."""
    for line in lines:
        words = re.search(r"^Measured (?:on|from) .*? on (.+?, \d+ cores)", line)
        if words:
            return words[1]
    return ""


def repeats_vary(seconds: Any, spreads: Any) -> str:
    """By how much the repeats of runs differ, as figures of times say it; nothing where no run kept it.

    `spreads` are the longest times of the runs minus the shortest, and `seconds` the shortest: columns
    of a pandas table, one entry for each run.
    """
    shares: Any = (spreads.astype(float) / seconds.astype(float)).replace(inf, nan).dropna()
    return f"vary by {percent(float(shares.median()))} in the median" if len(shares) else ""


def few_colours(image: Image.Image, colours: int = _MAX_COLOURS) -> Image.Image:
    """A picture in `colours` of its own colours at most: those that most of it has, and no two of them near.

    Lines keep their colours, which a mean of areas would shift. Greys stay grey: a pane that is not quite
    white would else take on a tint. `image` has the mode RGB, the result has a palette.
    """
    # The most frequent colour comes first; each choice leaves out those near it.
    counted: Any = image.getcolors(image.width * image.height)
    left = np.array([colour for _, colour in sorted(counted, reverse=True)])
    chosen = []
    while len(left) and len(chosen) < colours:
        first = left[0]
        chosen.append(first)  # (red, green, blue)
        # A grey makes room for other greys alone, in small steps.
        grey = np.ptp(left, axis=1) <= _GREY_RANGE
        distance = np.max(np.abs(left - first), axis=1)
        if np.ptp(first) <= _GREY_RANGE:
            near = grey & (distance < _GREY_STEP)
        else:
            near = ~grey & (distance < _LEAST_DIFFERENCE)
        # The colour chosen leaves too.
        near[0] = True
        left = left[~near]
    palette = np.array(chosen)
    pixels = np.asarray(image).reshape(-1, 3).astype(int)
    # One number for each colour: 65536 red + 256 green + blue.
    packed, places = np.unique(pixels @ np.array([65536, 256, 1]), return_inverse=True)
    present = np.stack([packed // 65536, packed // 256 % 256, packed % 256], axis=1)
    # Pillow's own search is inexact: it takes white for a tint.
    nearest = np.concatenate(
        [
            np.argmin(((part[:, None] - palette) ** 2).sum(axis=2), axis=1)
            for part in np.array_split(present, len(present) // _COMPARED_AT_ONCE + 1)
        ]
    )
    drawn = Image.fromarray(nearest[places].astype(np.uint8).reshape(image.height, image.width))
    drawn = drawn.convert("P")
    drawn.putpalette(palette.astype(np.uint8).tobytes())
    return drawn
