"""Drawing of the L_z–E phase planes: parabolas, fixed points, trajectories. The data of no item depend on it."""

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

# Words of legends for the stability of fixed points.
POINTS = {"stable node": "stable node", "saddle": "saddle", "singular": "singular point"}
# Markers of fixed points and their sizes, which Matplotlib takes in square points.
_MARKERS = {"stable node": ("o", 30), "saddle": ("*", 70), "singular": ("X", 30)}


def draw_frame(axes: Axes, ellipsoid: Ellipsoid, low: float, high: float) -> None:
    """Draw parabolas, the line L_z + 4E = 0 and the fixed points of a plane; L_z runs from low to high."""
    momentum = np.linspace(low, high, 201)
    inertia = np.array(sorted(set(ellipsoid.inertia))) / max(ellipsoid.inertia)
    for number, moment in enumerate(inertia):
        middle = len(inertia) == 3 and number == 1
        axes.plot(
            momentum,
            momentum**2 / (2 * moment),
            color=BOUND,
            linestyle="--" if middle else "-",
            lw=1.4,
        )
    axes.plot([low, 0.0], [-low / 4, 0.0], color=GREEN, linewidth=0.9)
    for point in fixed_points(ellipsoid):
        draw_point(axes, point.stability, place_of(ellipsoid, point))
    axes.set(xlim=(low, high), xlabel="$L_z/I_{max}$", ylabel="$E/I_{max}$")


def draw_point(
    axes: Axes, stability: str, place: tuple[float, ...] = (), text: str | None = None
) -> None:
    """Draw a fixed point with the marker of its stability; without a place it stands in the legend alone."""
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
    """Put the markers of fixed points into the legend; stability to text."""
    for stability, text in names.items():
        draw_point(axes, stability, text=text)


def name_lines(axes: Axes, ellipsoid: Ellipsoid, bounds: str) -> None:
    """Put the lines of a frame into the legend."""
    axes.plot([], [], color=BOUND, label=bounds)
    if ellipsoid.kind == "triaxial":
        axes.plot([], [], color=BOUND, linestyle="--", label="$L_z^2 = 2EI_2$")
    axes.plot([], [], color=GREEN, label="$L_z + 4E = 0$")


def draw_paths(axes: Axes, table: Table, heights: Sequence[float]) -> None:
    """Draw slow trajectories, each with an arrow where its E first falls through each of the heights."""
    draw_broken(axes, table.Lz, table.E, table.path, color=AVERAGED, linewidth=0.8)
    for _, part in groups(table, "path"):
        for height in heights:
            below = int(np.argmax(part["E"] < height))
            if below > 0:
                ends = [(part["Lz"][index], part["E"][index]) for index in (below - 1, below)]
                arrow = {
                    "arrowstyle": "-|>",
                    "color": AVERAGED,
                    "linewidth": 0.0,
                    "shrinkA": 0,
                    "shrinkB": 0,
                }
                axes.annotate("", ends[1], ends[0], arrowprops={**arrow, "mutation_scale": 7})
