"""Drawing of the L_z–E phase planes: bounds, fixed points, trajectories, and their legend.

`draw_frame` draws what a plane has without trajectories; `name_points` and `name_lines` put that
into the legend of one of a figure's planes. L_z and E are over I_max. No item's data depend on this
module. Widths of lines are in points, by eye. A thing of larger `zorder` lies above others.
"""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes

from polhode.harness.pages.figures.style import GREEN
from polhode.harness.paper.drawing import AVERAGED, BLACK, BOUND, NODE, draw_broken
from polhode.harness.paper.item import Table
from polhode.harness.paper.planes import place_of
from polhode.harness.paper.tables import groups
from polhode.models.shape import Ellipsoid
from polhode.models.theory.fixed_points import fixed_points

# Words of the legend for the stability of a fixed point.
POINTS = {"stable node": "stable node", "saddle": "saddle", "singular": "singular point"}
# Marker of a fixed point by its stability, and the marker's area in square points, by eye.
_MARKERS = {"stable node": ("o", 30), "saddle": ("*", 70), "singular": ("X", 30)}
# An arrow on a trajectory: a head in the direction of the motion, and no line. `shrinkA` and
# `shrinkB` are gaps before and after it, in points; `mutation_scale` is its size in points, by eye.
_ARROW = {
    "arrowstyle": "-|>",
    "color": AVERAGED,
    "linewidth": 0.0,
    "shrinkA": 0,
    "shrinkB": 0,
    "mutation_scale": 7,
}


def draw_frame(axes: Axes, ellipsoid: Ellipsoid, low: float, high: float) -> None:
    """Draw the parabolas L_z² = 2EI, the line L_z + 4E = 0 and the fixed points of a plane.

    L_z/I_max runs from `low`, which is negative, to `high`. The parabola of the middle moment of
    inertia is dashed; the others are the bounds of E. All fixed points lie on the line.
    """
    # Enough points for a parabola to look smooth.
    momentum = np.linspace(low, high, 201)
    moments = np.array(sorted(set(ellipsoid.inertia))) / max(ellipsoid.inertia)
    for number, moment in enumerate(moments):
        is_middle = len(moments) == 3 and number == 1
        linestyle = "--" if is_middle else "-"
        energy = momentum**2 / (2 * moment)
        axes.plot(momentum, energy, color=BOUND, linestyle=linestyle, linewidth=1.4)
    axes.plot([low, 0.0], [-low / 4, 0.0], color=GREEN, linewidth=0.9)
    for point in fixed_points(ellipsoid):
        draw_point(axes, point.stability, place_of(ellipsoid, point))
    axes.set(xlim=(low, high), xlabel="$L_z/I_{max}$", ylabel="$E/I_{max}$")


def draw_point(
    axes: Axes, stability: str, place: tuple[float, ...] = (), text: str | None = None
) -> None:
    """Draw a fixed point with the marker of its stability.

    Parameters
    ----------
    axes
        The plane.
    stability
        A key of `POINTS`.
    place
        The point's two coordinates; without them it stands in the legend alone.
    text
        Its name in the legend; None for none.
    """
    marker, size = _MARKERS[stability]
    x, y = place or ([], [])
    axes.scatter(
        x,
        y,
        s=size,
        marker=marker,
        color=NODE,
        edgecolor=BLACK,
        zorder=6,
        linewidth=0.6,
        label=text,
    )


def name_points(axes: Axes, names: dict[str, str]) -> None:
    """Put the markers of fixed points into the legend; `names` has a text for each stability."""
    for stability, text in names.items():
        draw_point(axes, stability, text=text)


def name_lines(axes: Axes, ellipsoid: Ellipsoid, bounds: str) -> None:
    """Put the lines of `draw_frame` into the legend; `bounds` is the text for the bounds of E."""
    axes.plot([], [], color=BOUND, label=bounds)
    if ellipsoid.kind == "triaxial":
        axes.plot([], [], color=BOUND, linestyle="--", label="$L_z^2 = 2EI_2$")
    axes.plot([], [], color=GREEN, label="$L_z + 4E = 0$")


def draw_paths(axes: Axes, table: Table, heights: Sequence[float]) -> None:
    """Draw slow trajectories, with an arrow where E first falls below each of the heights.

    `table` has a row for each point, with columns `path`, the number of its trajectory, `Lz` and
    `E`; `heights` are values of E, over I_max.
    """
    draw_broken(axes, table.Lz, table.E, table.path, color=AVERAGED, linewidth=0.8)
    for _, rows in groups(table, "path"):
        points = list(zip(rows.Lz, rows.E, strict=True))
        for height in heights:
            # 0 if the trajectory starts below the height, or stays above it: it has no arrow there.
            first_below = int(np.argmax(rows["E"] < height))
            if first_below > 0:
                tip = points[first_below]
                tail = points[first_below - 1]
                axes.annotate("", tip, tail, arrowprops=_ARROW)
