"""Figures of ensembles: orientation and arrivals of one shape, from the tables beside its page; speed.

An ensemble is many particles of one shape at one St, with random starts. p is the direction of the last
of the body axes that the tables count: of a spheroid the symmetry axis, else z'. An attractor is a stable
state of the averaged motion in simple shear; a particle has arrived at it once it stays near it to the
end. L is the angular momentum; tables have it over the largest moment of inertia. x is the axis of the
flow, y of its gradient, z of its vorticity. Looks and sizes without a reason are chosen by eye (`style`).
"""

from collections.abc import Mapping, Sequence
from itertools import product
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator
from scipy.optimize import isotonic_regression
from scipy.spatial.transform import Rotation

from polhode.harness.common.text import short
from polhode.harness.pages.figures.style import (
    BAND_OPACITY,
    BLUE,
    INK,
    LETTERS,
    SHARES_TO,
    SMALL_LETTERS,
    SOFT,
    TITLE,
    VERMILLION,
    caption,
    key,
    panels,
    plain,
    power,
    ramp,
    square_decades,
)

_HEIGHT = 3.1  # Inches of both figures.
_LINE_WIDTH = 1.6  # Points, of means and of shares that have arrived.
# Dashes of the lines of one St: for the components x, y, z, and for the attractors; and the signs that
# stand for them in a title.
_DASHES = ("-", "--", ":")
_DASH_SIGNS = ("—", "- -", "···")
# In standard deviations: 95 % of a normal variable lie within this distance of its mean.
_STANDARD = 1.96
# Names beside a panel, as shares of its height: their least distance, and the room at its foot and top.
_NAME_SPACING = 0.09
_NAME_MARGIN = 0.03
_NAMES_LEFT = 1.02  # Left edge of these names, from the panel's left edge, over its width.
# Rows of the tables that are drawn: of `moments`, means of p_x², p_y², p_z²; of `slow`, of L.
_COMPONENTS = ("xx", "yy", "zz")
_SLOW = ("Lx/Imax", "Ly/Imax", "Lz/Imax")
# Width and height of the sketch of a body, as shares of its panel, and the number of places along either
# side of the panel where it may stand.
_SKETCH = (0.42, 0.46)
_SKETCH_PLACES = 7
# The body's axes in that sketch, a column each: right, up and towards the eye. The angles are chosen
# by eye.
_VIEW = Rotation.from_euler("zyx", (-25, 25, -60), degrees=True).as_matrix()
_BODY_COLOUR = "#DCE9F4"
# Points of an ellipse of the sketch, one in every other degree: smooth at its size.
_ELLIPSE_POINTS = 181
# Length of the arrow of p beyond the body, over the longest semi-axis.
_ARROW = 0.75
# The inset of histograms in a panel: left, bottom, width and height, as shares of it.
_HISTOGRAM = (0.43, 0.16, 0.4, 0.46)
# Ends of its axis of shares: from one particle in 2000 to a little above all.
_HISTOGRAM_SHARES = (5e-4, 1.2)
# Ends of the axis of speeds, particles in a second: the speeds of reports/sweep lie between them.
_SPEEDS = (1e4, 1e6)
# Colours of the shapes of the figure of speeds.
_SPEED_COLOURS = (BLUE, VERMILLION)


def last_axis(axes: Sequence[float]) -> str:
    """The last of a body's semi-axes, along which p lies, in words."""
    a, b, c = axes
    length = "last"
    if c > max(a, b):
        length = "longest"
    elif c < min(a, b):
        length = "shortest"
    return f"symmetry axis, {length}" if a == b else f"{length} axis"


def picture(tables: Mapping[str, pd.DataFrame], note: str = "") -> Figure:
    """Orientation, or L where there is none, and arrivals of one shape against time, a colour for each St.

    `tables` holds the rows of one shape by the stem of their file: `moments`, `slow`,
    `distributions`, `arrivals`. Bands hold 95 %.
    """
    # Any row of any table has the semi-axes.
    filled = next(table for table in tables.values() if len(table))
    axes = [float(filled[name].iloc[0]) for name in "abc"]
    numbers = sorted({float(stokes) for stokes in tables["distributions"]["stokes"]})
    # Every second colour: the colours of neighbouring St then differ more.
    shades = dict(zip(numbers, ramp(2 * len(numbers))[1::2], strict=True))
    # A slow time t/St needs a finite St above 0.
    slow = all(0 < stokes < np.inf for stokes in numbers)
    drawing, grid = panels(1, 2, _HEIGHT)
    oriented = len(tables.get("moments", ())) > 0
    _means(grid[0, 0], tables["moments" if oriented else "slow"], shades, slow, oriented)
    _arrivals(grid[0, 1], tables.get("arrivals", pd.DataFrame()), shades, slow)
    _histogram(grid[0, 1], tables["distributions"], shades)
    shape = " : ".join(map(short, axes))
    what = "Means of L"
    if oriented:
        # The body's axes in turn, so that the one along p comes last.
        numbers_of_axes: Any = tables["moments"]["body_axis"]
        p_last = np.roll(axes, 3 - int(numbers_of_axes.max())).tolist()
        _body(grid[0, 0], p_last)
        what = f"p: {last_axis(p_last)}"
    grid[0, 0].set_title(what, fontsize=TITLE, loc="left", color=INK)
    for axis in grid.flat:
        axis.set_xlabel("slow time $t_2 = t/\\mathrm{St}$" if slow else "time, inverse shear rates")
    handles = [
        Line2D([], [], color=shade, linewidth=2, label=f"{shape}, St = {power(stokes)}")
        for stokes, shade in shades.items()
    ]
    key(drawing, handles, 2)
    caption(drawing, note)
    return drawing


def _unit(stokes: float, slow: bool) -> float:
    """The unit of the time axis, in inverse shear rates: St for the slow time t₂ = t/St, else 1."""
    return stokes if slow else 1.0


def _means(axes: Axes, table: Any, shades: Mapping[float, str], slow: bool, oriented: bool) -> None:
    """Draw mean squares of p if the shape is `oriented`, else means of L, against time.

    `table` is `moments` or `slow`, as `picture` has it. `shades` are colours by St. `slow` says that times are
    slow times.
    """
    column, components = ("moment", _COMPONENTS) if oriented else ("variable", _SLOW)
    if oriented:
        table = table[table["body_axis"] == table["body_axis"].max()]
    ends = []
    for component, dash in zip(components, _DASHES, strict=True):
        rows = table[table[column] == component]
        for stokes, line in rows.groupby("stokes"):
            stokes = float(str(stokes))
            times = line["time"].to_numpy(float) / _unit(stokes, slow)
            mean = line["mean"].to_numpy(float)
            band = _STANDARD * line["standard_error"].to_numpy(float)
            axes.plot(times, mean, color=shades[stokes], ls=dash, linewidth=_LINE_WIDTH)
            area = {"color": shades[stokes], "alpha": BAND_OPACITY, "linewidth": 0}
            axes.fill_between(times, mean - band, mean + band, **area)
        # The x of "xx" or of "Lx/Imax".
        letter = component[-1] if oriented else component[1]
        name = f"$p_{letter}^2$" if oriented else f"$L_{letter}$"
        # A name stands at the mean of its lines' ends.
        ends.append((float(rows.groupby("stokes")["mean"].last().mean()), name))
    axes.set_ylabel("mean square of p" if oriented else "mean of L over $I_{max}$")
    _name(axes, ends)


def _body(axes: Axes, semi_axes: Sequence[float]) -> None:
    """Sketch the body and p, an arrow along its last axis, where the panel's lines leave most room."""
    points = np.concatenate([line.get_xydata() for line in axes.get_lines()])
    inside = axes.transAxes.inverted().transform(axes.transData.transform(points))
    width, height = _SKETCH
    # By the place of the lower left corner: how many points of lines lie in the sketch there.
    crossed = {}
    lefts = np.linspace(0.0, 1 - width, _SKETCH_PLACES)
    bottoms = np.linspace(0.0, 1 - height, _SKETCH_PLACES)
    for x, y in product(lefts, bottoms):
        within = np.all((inside >= (x, y)) & (inside <= (x + width, y + height)), axis=1)
        # Among equal places, the nearest to the middle of the right edge wins.
        crossed[x, y] = int(within.sum()), abs(y + height / 2 - 0.5) - x
    x, y = min(crossed, key=lambda place: crossed[place])
    sketch = axes.inset_axes((x, y, width, height))
    lengths = np.array(semi_axes, float) / max(semi_axes)
    # Ends of the semi-axes: right, up and towards the eye, a column for each axis of the body. The matrix
    # `ends` maps the unit ball to the body, and `ends[:2]` maps it to the body's outline: an ellipse whose
    # semi-axes are the singular vectors times the singular values.
    ends = _VIEW * lengths
    along, sizes, _ = np.linalg.svd(ends[:2], full_matrices=False)
    turn = np.linspace(0, 2 * np.pi, _ELLIPSE_POINTS)
    circle = np.array([np.cos(turn), np.sin(turn)])
    sketch.fill(*(along * sizes @ circle), facecolor=_BODY_COLOUR, edgecolor=SOFT, linewidth=1.0)
    for first, second in ((0, 1), (1, 2), (2, 0)):
        # The ellipse in the plane of two axes; where its outward normal points away from the eye, it is
        # hidden.
        unit = np.zeros((3, len(turn)))
        unit[[first, second]] = circle
        visible = (_VIEW / lengths @ unit)[2] >= 0
        line = np.where(visible, ends @ unit, np.nan)
        sketch.plot(line[0], line[1], color=SOFT, linewidth=0.7)
    tail = ends[:2, 2]
    tip = tail + _ARROW * _VIEW[:2, 2] / np.linalg.norm(_VIEW[:2, 2])
    arrow = {"arrowstyle": "-|>", "color": INK, "lw": 1.4, "shrinkA": 0, "shrinkB": 0}
    sketch.annotate("", tip, tail, arrowprops=arrow)
    sketch.annotate("p", tip, (4, 0), textcoords="offset points", color=INK, fontsize=LETTERS)
    # The longest semi-axis is 1; the arrow goes to the right and up.
    sketch.set(xlim=(-1.1, 1.4), ylim=(-1.0, 1.75), aspect="equal")
    sketch.axis("off")


def _name(axes: Axes, ends: Sequence[tuple[float, str]]) -> None:
    """Write names at the right edge, no two on each other; `ends` are heights on the vertical axis with their names."""
    low, high = axes.get_ylim()
    ordered = sorted(ends)
    places = np.array([(y - low) / (high - low) for y, _ in ordered])
    # Heights less `steps` may not fall from one name to the next: isotonic regression finds the nearest such
    # values, so that names move as little as keeps them apart.
    steps = _NAME_SPACING * np.arange(len(ordered))
    free = isotonic_regression(places - steps).x if len(ordered) else places
    highest = 1 - _NAME_MARGIN - _NAME_SPACING * (len(ordered) - 1)
    heights = np.clip(free, _NAME_MARGIN, highest) + steps
    for (_, name), height in zip(ordered, heights, strict=True):
        style: dict[str, Any] = {"va": "center", "color": INK, "fontsize": LETTERS}
        axes.text(_NAMES_LEFT, height, name, transform=axes.transAxes, **style)


def _arrivals(axes: Axes, table: Any, shades: Mapping[float, str], slow: bool) -> None:
    """Draw the share of the particles that have arrived at each attractor against time, with its interval."""
    axes.set_ylim(0, SHARES_TO)
    axes.set_yticks([0, 0.5, 1], ["0", "50 %", "100 %"])
    axes.set_ylabel("share of the particles")
    if not len(table):
        axes.set_title("No attractor is named", fontsize=TITLE, loc="left", color=INK)
        return
    names = list(dict.fromkeys(table["attractor"]))
    for (stokes, attractor), line in table.groupby(["stokes", "attractor"], sort=False):
        stokes = float(str(stokes))
        times = line["time"].to_numpy(float) / _unit(stokes, slow)
        dash = _DASHES[names.index(attractor) % len(_DASHES)]
        shade = shades[stokes]
        style = {"color": shade, "ls": dash, "linewidth": _LINE_WIDTH}
        axes.plot(times, line["fraction"].to_numpy(float), **style)
        low = line["low"].to_numpy(float)
        high = line["high"].to_numpy(float)
        axes.fill_between(times, low, high, color=shade, alpha=BAND_OPACITY, linewidth=0)
    words = [
        f"{sign + ' ' if len(names) > 1 else ''}{name}"
        for sign, name in zip(_DASH_SIGNS, names, strict=False)
    ]
    title = f"About the {', '.join(words)}"
    axes.set_title(title, fontsize=TITLE, loc="left", color=INK)


def _histogram(axes: Axes, table: Any, shades: Mapping[float, str]) -> None:
    """Draw histograms of L_z at the start and at the end, as an inset."""
    inset = axes.inset_axes(_HISTOGRAM)
    vertical = table[table["variable"] == "Lz/Imax"]
    for stokes, line in vertical.groupby("stokes"):
        for time, dash in ((line["time"].min(), ":"), (line["time"].max(), "-")):
            # Bins beyond the first and the last edge have infinite ends.
            rows = line[
                (line["time"] == time) & np.isfinite(line["low"]) & np.isfinite(line["high"])
            ]
            # The table leaves out empty bins: there the share is 0.
            edges = sorted({*rows["low"], *rows["high"]})
            particles: Any = rows.set_index("low")["particles"].reindex(edges[:-1], fill_value=0)
            share = particles.to_numpy(float) / max(float(rows["particles"].sum()), 1.0)
            inset.stairs(share, edges, color=shades[float(str(stokes))], ls=dash, linewidth=1.2)
    inset.set_yscale("log")
    inset.set_ylim(*_HISTOGRAM_SHARES)
    inset.xaxis.set_major_locator(MaxNLocator(2))
    inset.set_yticks([1e-3, 1e-1], ["0.1 %", "10 %"])
    inset.minorticks_off()
    title = "$L_z$, start dotted"
    inset.set_title(title, fontsize=SMALL_LETTERS, color=INK, loc="left", pad=2)
    plain(inset)
    # Smaller yet: the numbers of both axes have little room.
    inset.tick_params(labelsize=8.5)
    inset.yaxis.tick_right()
    inset.spines["right"].set_visible(True)
    inset.spines["left"].set_visible(False)


def speeds(rows: Sequence[Mapping[str, Any]], note: str = "") -> Figure:
    """Particles per second against the largest error, a colour for each shape.

    `rows` are `polhode.harness.ensembles.throughput`'s of full equations, by equal steps and by Taylor's method
    on several particles at once ("lanes"). Bars reach down to the speed that three of four repeats reach.
    """
    figure, grid = panels(1, 1, _HEIGHT)
    axes = grid[0, 0]
    shapes = pd.DataFrame(rows).groupby("shape", sort=False)
    handles = []
    for (shape, shape_rows), shade in zip(shapes, _SPEED_COLOURS, strict=False):
        # Columns of the two methods differ in their prefix.
        for prefix, marker, dash, name in (
            ("", "o", "-", "equal steps"),
            ("taylor_", "s", ":", "Taylor's lanes"),
        ):
            style: dict[str, Any] = {"color": shade, "marker": marker, "ls": dash, "markersize": 6}
            label = f"{name}, {shape}"
            errors = shape_rows[f"{prefix}error"]
            fastest = shape_rows[f"{prefix}per_second"]
            axes.loglog(errors, fastest, **style)
            if f"{prefix}slower_per_second" in shape_rows:
                slower = shape_rows[f"{prefix}slower_per_second"]
                axes.vlines(errors, slower, fastest, color=shade, linewidth=3.0, alpha=0.5)
            handles.append(Line2D([], [], label=label, **style))
    axes.set(xlabel="largest error of the whole state", ylabel="particles/(s · core)")
    axes.set_ylim(*_SPEEDS)
    square_decades(axes)
    key(figure, handles, 2)
    caption(figure, note)
    return figure
