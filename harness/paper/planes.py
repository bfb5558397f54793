"""Common parts of the L_z–E phase planes: slow trajectories with L along the vorticity, parabolas, fixed points."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes

from polhode.harness.paper.drawing import AVERAGED, BLACK, BOUND, GREEN, NODE, draw_broken
from polhode.harness.paper.item import Table
from polhode.harness.paper.runs import Run, slow_run, slow_run_to_pinch
from polhode.harness.paper.tables import groups
from polhode.models.scene import Scene
from polhode.models.scenes import aligned_start
from polhode.models.shape import Ellipsoid
from polhode.models.theory.fixed_points import FixedPoint, Stability, fixed_points

# St of the full trajectories in the planes, the smaller one first.
PLANE_STOKES = (1e3, 1e4)
Differences = dict[float, dict[float, float]]
"""Largest differences by St and by the number that names a body."""
# L_z/I_max above which a trajectory with L_z > 0 counts as away from the pinch point.
ABOVE_PINCH = 0.2
# Distance from the node, over I_max, at which a trajectory has reached it.
REACHED = 1e-2
POINTS = {"stable node": "stable node", "saddle": "saddle", "singular": "singular point"}
# Markers of fixed points and their sizes.
_MARKERS = {"stable node": ("o", 30), "saddle": ("*", 70), "singular": ("X", 30)}


def plane_path(ellipsoid: Ellipsoid, momentum: float, energy: float, slow_times: np.ndarray) -> Run:
    """Slow trajectory from L = momentum ẑ and E, over I_max; one with L_z > 0 ends in the pinch point, L = E = 0."""
    return plane_path_and_end(ellipsoid, momentum, energy, slow_times)[0]


def plane_path_and_end(
    ellipsoid: Ellipsoid, momentum: float, energy: float, slow_times: np.ndarray
) -> tuple[Run, float]:
    """The same, and the slow time at which it ends: between rows where it meets the pinch point."""
    slow = (0.0, 0.0, momentum, energy)
    if momentum > 0:
        return slow_run_to_pinch(ellipsoid, slow, slow_times)
    return slow_run(ellipsoid, slow, slow_times), float(slow_times[-1])


def energy_at(ellipsoid: Ellipsoid, momentum: float, share: float) -> float:
    """E over I_max between the bounds L²/2I_max (share 0) and L²/2I_min (share 1); L over I_max."""
    ratio = max(ellipsoid.inertia) / min(ellipsoid.inertia)
    return momentum**2 / 2 * (1 + share * (ratio - 1))


def aligned_scene(
    ellipsoid: Ellipsoid,
    stokes: float,
    momentum: float,
    theta: float,
    slow_time: float,
    phi: float = 0.0,
) -> Scene:
    """Scene from L = momentum ẑ (over I_max) with θ₀ = theta, φ₀ = phi, ψ₀ = π/2."""
    start = aligned_start(ellipsoid, momentum * max(ellipsoid.inertia), theta, phi)
    return Scene(ellipsoid, stokes, start, stokes * slow_time)


def place_of(ellipsoid: Ellipsoid, point: FixedPoint) -> tuple[float, float]:
    """L_z and E of a fixed point, over I_max; there E = -L_z/4."""
    momentum = point.state[2] / max(ellipsoid.inertia)
    return momentum, -momentum / 4


def fixed_point(ellipsoid: Ellipsoid, stability: Stability) -> tuple[float, float]:
    """L_z and E, over I_max, of the fixed point of a stability."""
    return next(
        place_of(ellipsoid, point)
        for point in fixed_points(ellipsoid)
        if point.stability == stability
    )


def distance_from_node(ellipsoid: Ellipsoid, slow: np.ndarray) -> np.ndarray:
    """Largest difference of slow variables over I_max from the stable node, shape (n,)."""
    return np.max(
        np.abs(slow - np.array([0.0, 0.0, *fixed_point(ellipsoid, "stable node")])), axis=-1
    )


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


def plane_steps(slow: np.ndarray, count: int) -> np.ndarray:
    """Indices of at most count points of a path in the L_z–E plane, denser at small E; slow has shape (n, 4)."""
    energy = slow[:, 3] + 1e-3
    return even_steps(np.stack([slow[:, 2] / np.sqrt(energy), np.log(energy)], axis=1), count)


def even_steps(path: np.ndarray, count: int) -> np.ndarray:
    """Indices of at most count points of a path, shape (n, d), at about equal steps along it; both ends included."""
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    return np.unique(
        np.searchsorted(length, np.linspace(0.0, length[-1], count)).clip(0, len(path) - 1)
    )


def distances(points: np.ndarray, line: np.ndarray) -> np.ndarray:
    """Distance of each point from a line of straight segments; shapes (n, 2) and (m, 2)."""
    offsets = points[:, None] - line[:-1]
    sides = np.diff(line, axis=0)
    lengths = np.maximum(np.sum(sides**2, axis=-1), np.finfo(float).tiny)
    share = np.sum(offsets * sides, axis=-1) / lengths
    return np.linalg.norm(offsets - share.clip(0.0, 1.0)[..., None] * sides, axis=-1).min(axis=-1)
