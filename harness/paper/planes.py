"""What the L_z–E phase planes share: slow trajectories with L along the vorticity, parabolas, fixed points."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from polhode.harness.paper.drawing import (
    AVERAGED,
    BLACK,
    BOUND,
    GREEN,
    NODE,
    common_legend,
    draw_broken,
    groups,
    label,
    panels,
    styled_runs,
)
from polhode.harness.paper.item import Data, Table
from polhode.harness.paper.runs import (
    Run,
    aligned_start,
    averaged_run,
    averaged_run_to_pinch,
    full_run,
    graded,
    slow_scene,
)
from polhode.models.scene import Scene
from polhode.models.shape import Ellipsoid
from polhode.models.theory.fixed_points import FixedPoint, fixed_points

# L_z/I_max above which a trajectory with L_z > 0 counts as away from the pinch point.
ABOVE_PINCH = 0.2
# Share, as of `energy_at`, of starts on the upper parabola: rounding must not carry them out of the plane.
INSIDE = 1 - 1e-13
MARKERS = {"stable node": "o", "saddle": "*", "singular": "X"}
NAMES = {"stable node": "stable node", "saddle": "saddle", "singular": "singular point"}


def plane_path(ellipsoid: Ellipsoid, momentum: float, energy: float, slow_times: np.ndarray) -> Run:
    """Slow trajectory from L = momentum ẑ and E, over I_max; one with L_z > 0 ends in the pinch point, L = E = 0."""
    scene = slow_scene(ellipsoid, (0.0, 0.0, momentum, energy), float(slow_times[-1]))
    return averaged_run_to_pinch(scene, slow_times)[0] if momentum > 0 else averaged_run(scene, slow_times)


def energy_at(ellipsoid: Ellipsoid, momentum: float, share: float) -> float:
    """E over I_max between the bounds L²/2I_max (share 0) and L²/2I_min (share 1); L over I_max."""
    ratio = max(ellipsoid.inertia) / min(ellipsoid.inertia)
    return momentum**2 / 2 * (1 + share * (ratio - 1))


def plane_full_path(ellipsoid: Ellipsoid, stokes: float, momentum: float, theta: float, slow_times: np.ndarray) -> Run:
    """Full trajectory from L = momentum ẑ (over I_max) with θ₀ = theta, ψ₀ = π/2."""
    return full_run(plane_scene(ellipsoid, stokes, momentum, theta, float(slow_times[-1])), stokes * slow_times)


def plane_scene(ellipsoid: Ellipsoid, stokes: float, momentum: float, theta: float, slow_time: float) -> Scene:
    """Scene of such a start."""
    start = aligned_start(ellipsoid, momentum * max(ellipsoid.inertia), theta)
    return Scene(ellipsoid, stokes, start, stokes * slow_time)


def path_table(runs: list[tuple[float, np.ndarray, np.ndarray]], columns: str = "Lx Ly Lz E") -> dict[str, np.ndarray]:
    """Table of paths: a number that names each, its slow times, its slow variables."""
    names = columns.split()
    stacked = np.concatenate([slow for _, _, slow in runs])
    table = {
        "path": np.concatenate([np.full(len(times), number) for number, times, _ in runs]),
        "t2": np.concatenate([times for _, times, _ in runs]),
    }
    return table | {name: stacked[:, index] for index, name in enumerate(("Lx", "Ly", "Lz", "E")) if name in names}


def stacked(parts: list[tuple[dict[str, float], dict[str, np.ndarray]]]) -> dict[str, np.ndarray]:
    """One table of many parts, each with labels that are repeated in all its rows."""
    labels, values = parts[0]
    table = {
        name: np.concatenate([np.full(len(next(iter(own.values()))), given[name]) for given, own in parts])
        for name in labels
    }
    return table | {name: np.concatenate([own[name] for _, own in parts]) for name in values}


def columns(names: str, rows: Sequence[Sequence[float]]) -> dict[str, np.ndarray]:
    """Table of rows, with the names of its columns in one string."""
    return dict(zip(names.split(), np.array(rows, dtype=float).T, strict=True))


def plane_point(ellipsoid: Ellipsoid, point: FixedPoint) -> tuple[float, float]:
    """L_z and E of a fixed point, over I_max; there E = -L_z/4."""
    momentum = point.state[2] / max(ellipsoid.inertia)
    return momentum, -momentum / 4


def node(ellipsoid: Ellipsoid) -> tuple[float, float]:
    """L_z and E of the stable node, over I_max."""
    return next(plane_point(ellipsoid, point) for point in fixed_points(ellipsoid) if point.stability == "stable node")


def distance_from_node(ellipsoid: Ellipsoid, slow: np.ndarray) -> np.ndarray:
    """Largest difference of slow variables over I_max from the stable node, shape (n,)."""
    momentum, energy = node(ellipsoid)
    return np.max(np.abs(slow - np.array([0.0, 0.0, momentum, energy])), axis=-1)


def pinch_bound(ellipsoid: Ellipsoid, momentum: float) -> float:
    """Slow time L_z/(4π min X) by which a slow trajectory with L_z > 0 has reached the pinch point."""
    return momentum * max(ellipsoid.inertia) / (4 * np.pi * min(ellipsoid.resistance))


def draw_frame(axes: Axes, ellipsoid: Ellipsoid, low: float, high: float, *, title: str = "") -> Axes:
    """Draw parabolas, the line L_z + 4E = 0 and the fixed points of a plane; L_z runs from low to high."""
    momentum = np.linspace(low, high, 201)
    inertia = np.array(sorted(set(ellipsoid.inertia))) / max(ellipsoid.inertia)
    for number, moment in enumerate(inertia):
        middle = len(inertia) == 3 and number == 1
        axes.plot(momentum, momentum**2 / (2 * moment), color=BOUND, linestyle="--" if middle else "-", lw=1.4)
    axes.plot([low, 0.0], [-low / 4, 0.0], color=GREEN, linewidth=0.9)
    for point in fixed_points(ellipsoid):
        draw_point(axes, point.stability, *plane_point(ellipsoid, point))
    axes.set_xlim(low, high)
    return label(axes, "$L_z/I_{max}$", "$E/I_{max}$", title)


def draw_point(axes: Axes, stability: str, x: float, y: float) -> None:
    """Draw a fixed point with the marker of its stability."""
    size = 70 if stability == "saddle" else 30
    axes.scatter(x, y, s=size, marker=MARKERS[stability], color=NODE, edgecolor=BLACK, zorder=6, linewidth=0.6)


def name_points(axes: Axes, names: dict[str, str]) -> None:
    """Put the markers of fixed points into the legend; stability to text."""
    for stability, text in names.items():
        size = 70 if stability == "saddle" else 30
        axes.scatter([], [], s=size, marker=MARKERS[stability], color=NODE, edgecolor=BLACK, linewidth=0.6, label=text)


def draw_paths(axes: Axes, table: Table, heights: Sequence[float]) -> Axes:
    """Draw slow trajectories, each with an arrow where its E first falls through each of the heights."""
    draw_broken(axes, table, "Lz", "E", color=AVERAGED, linewidth=0.8)
    for _, part in groups(table, "path"):
        for height in heights:
            below = int(np.argmax(part["E"] < height))
            if below > 0:
                ends = [(part["Lz"][index], part["E"][index]) for index in (below - 1, below)]
                arrow = {"arrowstyle": "-|>", "color": AVERAGED, "linewidth": 0.0, "shrinkA": 0, "shrinkB": 0}
                axes.annotate("", ends[1], ends[0], arrowprops={**arrow, "mutation_scale": 7})
    return axes


def plane_steps(slow: np.ndarray, count: int) -> np.ndarray:
    """Indices of at most count points of a path in the L_z–E plane, denser at small E; slow has shape (n, 4)."""
    energy = slow[:, 3] + 1e-3
    return even_steps(np.stack([slow[:, 2] / np.sqrt(energy), np.log(energy)], axis=1), count)


def even_steps(path: np.ndarray, count: int) -> np.ndarray:
    """Indices of at most count points of a path, shape (n, d), at about equal steps along it; both ends included."""
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    return np.unique(np.searchsorted(length, np.linspace(0.0, length[-1], count)).clip(0, len(path) - 1))


def comparison_data(
    bodies: Sequence[tuple[float, Ellipsoid]],
    starts: Sequence[tuple[float, float]],
    stokes: Sequence[float],
    points: int,
) -> Data:
    """Slow and full trajectories of several bodies from (L_z0/I_max, θ₀), and their largest difference.

    Differences are measured while L_z of a start with L_z > 0 is well above the pinch point.
    """
    parts, rows = [], []
    for name, body in bodies:
        # Eight relaxation times of the slowest rotation.
        slow_times = graded(8.0 / min(body.damping), 4 * (points - 1) + 1)
        for path, (momentum, theta) in enumerate(starts):
            slow = plane_scene(body, 1.0, momentum, theta, 1.0).initial.slow[0] / max(body.inertia)
            averaged = plane_path(body, momentum, float(slow[3]), slow_times).slow
            before = averaged[:, 2] < 0 if momentum < 0 else averaged[:, 2] > ABOVE_PINCH
            runs = [(np.inf, averaged)]
            for number in stokes:
                full = plane_full_path(body, number, momentum, theta, slow_times).slow
                runs.append((number, full))
                difference = np.abs(full[: len(averaged)][before] - averaged[before])
                rows.append((name, number, path, float(difference.max())))
            labels = {"body": name, "path": path}
            parts += [({**labels, "stokes": n}, {"Lz": own[::4, 2], "E": own[::4, 3]}) for n, own in runs]
    return {"": stacked(parts), "differences": columns("body stokes path difference", rows)}


def comparison_figure(data: Data, bodies: Sequence[Ellipsoid], titles: Sequence[str]) -> Figure:
    """One plane per body, slow trajectories over full ones."""
    figure, axes = panels(-(-len(bodies) // 2), 2, 3.9, 2.9)
    for own, body, title, (_, part) in zip(axes, bodies, titles, groups(data[""], "body"), strict=True):
        draw_frame(own, body, -0.8, 0.8, title=title)
        # The averaged run lies thin on the broad full ones, which it would hide.
        for width, (style, runs) in zip((0.6, 1.7, 1.1), styled_runs(part, "stokes"), strict=False):
            style["linewidth"] = width
            draw_broken(own, runs, "Lz", "E", **style)
        own.set_ylim(0.0, 1.05 * max(part["E"]))
    name_points(axes[0], {point.stability: NAMES[point.stability] for point in fixed_points(bodies[0])})
    axes[0].plot([], [], color=BOUND, label="bounds of $L_z^2/2E$")
    if bodies[0].kind == "triaxial":
        axes[0].plot([], [], color=BOUND, linestyle="--", label="$L_z^2 = 2EI_2$")
    axes[0].plot([], [], color=GREEN, label="$L_z + 4E = 0$")
    common_legend(figure, axes[0])
    return figure
