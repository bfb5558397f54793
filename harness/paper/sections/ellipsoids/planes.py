"""Section "Triaxial ellipsoids" in the phase space: L_z–E planes, the critical trajectory, 3-D projections."""

import numpy as np
from matplotlib.figure import Figure

from polhode.harness.paper.drawing import (
    BOUND,
    GREEN,
    ORANGE,
    VERMILLION,
    common_legend,
    groups,
    panels,
)
from polhode.harness.paper.item import Data, Grid, Item, Number, Section, Table, Verdict, Word
from polhode.harness.paper.planes import (
    ABOVE_PINCH,
    INSIDE,
    columns,
    comparison_data,
    comparison_figure,
    distance_from_node,
    draw_frame,
    draw_paths,
    energy_at,
    name_points,
    path_table,
    pinch_bound,
    plane_path,
    plane_point,
    plane_steps,
    stacked,
)
from polhode.harness.paper.runs import graded
from polhode.harness.paper.sections.ellipsoids.motion import ELLIPSOID, ITEMS, critical_after, critical_before
from polhode.harness.paper.sections.ellipsoids.space import ITEM as SPACE
from polhode.models.shape import Ellipsoid
from polhode.models.theory.fixed_points import fixed_points
from polhode.models.theory.separatrix import Separatrix

UNIT = max(ELLIPSOID.inertia)
MIDDLE = sorted(ELLIPSOID.inertia)[1] / UNIT
REACHED = 1e-2
# Where local and averaged critical trajectory are compared: L_z over I_max around the singular point.
CLOSE = 2e-3
# Slow time for which the start on the upper parabola is followed, before rounding carries it off.
ON_EDGE = 0.25
# Half sizes of the magnified view of the singular point, over I_max.
WINDOW = 0.02, 0.008


def compute_plane(grid: Grid) -> Data:
    """Slow trajectories, and the critical one: local and averaged, before and after the singular point."""
    slow_times = graded(1.0, grid.of(2001, 601))
    shares = (0.001, 0.1, 0.2, 0.35, 0.5, 0.65, 0.8, 0.95, 0.999)
    starts = [(momentum, share) for momentum in (-1.1, -0.08, 1.1) for share in shares[:: grid.of(1, 4)]]
    starts.append((-1.1, 1.0))
    paths, ends = [], []
    for number, (momentum, share) in enumerate(starts):
        times = slow_times[slow_times <= ON_EDGE] if share == 1.0 else slow_times
        run = plane_path(ELLIPSOID, momentum, energy_at(ELLIPSOID, momentum, min(share, INSIDE)), times)
        kept = np.union1d(plane_steps(run.slow, 250), np.flatnonzero(_in_window(run.slow)))
        paths.append((number, run.times[kept], run.slow[kept]))
        last = float(distance_from_node(ELLIPSOID, run.slow[-1]))
        ends.append((number, momentum, share, last, run.times[-1], pinch_bound(ELLIPSOID, momentum)))
    return {
        "": path_table(paths, "Lz E"),
        "ends": columns("path Lz0 share distance end bound", ends),
        "critical": stacked([*_local(), *_averaged()]),
    }


def _in_window(slow: np.ndarray) -> np.ndarray:
    """Which points lie in the magnified view of the singular point, or next to it; slow has shape (n, 4)."""
    return (np.abs(slow[:, 2] + MIDDLE / 2) < 1.2 * WINDOW[0]) & (np.abs(slow[:, 3] - MIDDLE / 8) < 1.2 * WINDOW[1])


def _local() -> list[tuple[dict, dict]]:
    """Critical trajectory of the local solution on either side, over I_max."""
    parts = []
    for number, side in enumerate(("long", "short")):
        local = Separatrix(ELLIPSOID, side)
        states = [local.slow_state(y, local.critical(y)) for y in np.geomspace(1e-6, 0.5, 41).tolist()]
        lz, energy = np.array(states)[:, 2:].T / UNIT
        parts.append(({"kind": 0.0, "side": number}, {"Lz": lz, "E": energy}))
    return parts


def _averaged() -> list[tuple[dict, dict]]:
    """Critical trajectory of the averaged equations, to the singular point and from it on to the node."""
    _, before = critical_before(0.8, 2001)
    after = critical_after(graded(0.5, 401))
    return [
        ({"kind": 1.0, "side": side}, {"Lz": slow[:, 2], "E": slow[:, 3]})
        for side, slow in enumerate((before[::2], after))
    ]


def figure_plane(data: Data) -> Figure:
    """The plane, and the neighbourhood of the singular point."""
    figure, (left, right) = panels(1, 2, 4.6, 4.4)
    middle = next(point for point in fixed_points(ELLIPSOID) if point.stability == "singular")
    x, y = plane_point(ELLIPSOID, middle)
    for own in (left, right):
        draw_frame(own, ELLIPSOID, -1.0, 1.0)
        draw_paths(own, data[""], (0.6, 0.2, 0.1))
        for (kind, _), part in _critical(data["critical"]):
            color, line, width = (ORANGE, "--", 2.0) if kind == 0 else (VERMILLION, "-", 2.0)
            own.plot(part["Lz"], part["E"], color=color, linestyle=line, linewidth=width, zorder=4 + (kind == 0))
    left.set_ylim(0.0, 0.8)
    right.set(xlim=(x - WINDOW[0], x + WINDOW[0]), ylim=(y - WINDOW[1], y + WINDOW[1]))
    right.locator_params(axis="x", nbins=5)
    right.set_title("around the singular point")
    name_points(left, {"stable node": "stable node", "saddle": "saddle", "singular": "singular point"})
    left.plot([], [], color=BOUND, label="$L_z^2 = 2EI_1, 2EI_3$")
    left.plot([], [], color=BOUND, linestyle="--", label="$L_z^2 = 2EI_2$")
    left.plot([], [], color=GREEN, label="$L_z + 4E = 0$")
    left.plot([], [], color=VERMILLION, lw=2, label="critical, averaged")
    left.plot([], [], color=ORANGE, lw=2, linestyle="--", label="critical, local solution")
    common_legend(figure, left)
    return figure


def _critical(table: Table) -> list[tuple[tuple[float, float], Table]]:
    return [((kind, side), own) for kind, part in groups(table, "kind") for side, own in groups(part, "side")]


def verdict_plane(data: Data) -> Verdict:
    """Where trajectories end, and how well the local critical trajectory fits."""
    ends, critical = data["ends"], dict(_critical(data["critical"]))
    left, on_edge = ends["Lz0"] < 0, ends["share"] == 1.0
    reached = float(np.mean(ends["distance"][left & ~on_edge] < REACHED))
    saddle = plane_point(ELLIPSOID, next(point for point in fixed_points(ELLIPSOID) if point.stability == "saddle"))
    edge = dict(groups(data[""], "path"))[float(np.argmax(on_edge))]
    from_saddle = float(np.hypot(edge["Lz"][-1] - saddle[0], edge["E"][-1] - saddle[1]))
    share = float(np.max(ends["end"][~left] / ends["bound"][~left]))
    misfits, far = [], []
    for side in (0.0, 1.0):
        local, averaged = critical[0.0, side], critical[1.0, side]
        near = np.abs(local["Lz"] + MIDDLE / 2) < CLOSE
        gap = np.hypot(*(local[name][near, None] - averaged[name][None] for name in ("Lz", "E")))
        misfits.append(float(np.max(np.min(gap, axis=1))))
        end = np.hypot(*(local[name][-1] - averaged[name] for name in ("Lz", "E")))
        far.append(float(np.min(end)))
    numbers = (
        Number(f"share of the {int(np.sum(left & ~on_edge))} starts with L_z < 0 that reach the node", reached, 1, 1),
        Number(
            "distance from the saddle where a start on the upper parabola ends", from_saddle, high=5e-3, unit="I_max"
        ),
        Number("slow time to the pinch point from L_z > 0, over L_z/(4π min X), longest", share, 0, 1),
        Number("local against averaged critical trajectory, before the point", misfits[0], high=2e-3, unit="I_max"),
        Number("the same after the point", misfits[1], high=2e-3, unit="I_max"),
        Number("the same at the end of the local one, y = 0.5, worse side", max(far), low=1e-3, unit="I_max"),
    )
    sentence = (
        "All starts with L_z < 0 off the upper parabola reach the node, passing the singular point without a trace, "
        "one on it reaches the saddle; those with L_z > 0 meet the pinch point in a finite slow time, not an infinite "
        f"one. The local critical trajectory agrees with the averaged equations to {max(misfits):.1g} I_max while L_z "
        f"is within {CLOSE:g} I_max of the point, and is off by {max(far):.1g} I_max at y = 0.5."
    )
    count = len(np.unique(data[""]["path"]))
    caption = f"L_z–E plane of the ellipsoid (1, 0.8, 0.5) with {count} slow trajectories of L_x = L_y = 0."
    return Verdict(Word.CORRECTED, sentence, numbers, caption)


BODIES = tuple(Ellipsoid((1.0, b, c)) for b in (0.55, 0.75, 0.95) for c in (0.5, 0.3))
STARTS = tuple((momentum, theta) for momentum in (-0.7, 0.7) for theta in (0.4, 0.9, 1.4))
STOKES = (1e3, 1e4)


def compute_planes(grid: Grid) -> Data:
    """Slow and full trajectories of six ellipsoids."""
    return comparison_data(list(enumerate(BODIES)), STARTS, STOKES, grid.of(151, 101))


def _title(body: Ellipsoid) -> str:
    return f"({', '.join(f'{length:g}' for length in body.semi_axes)})"


def figure_planes(data: Data) -> Figure:
    """Six planes."""
    return comparison_figure(data, BODIES, [_title(body) for body in BODIES])


def verdict_planes(data: Data) -> Verdict:
    """The difference falls with St, and is larger for the flatter bodies."""
    found = data["differences"]
    worst = np.array(
        [[float(part["difference"].max()) for _, part in groups(own, "stokes")] for _, own in groups(found, "body")]
    )
    ratio = worst[:, 0] / worst[:, 1]
    numbers = (
        Number(f"largest difference at St = {STOKES[1]:g}, worst body", float(worst[:, 1].max()), 0, 0.02, "I_max"),
        Number(f"difference at St = {STOKES[0]:g} over that at {STOKES[1]:g}, smallest", float(ratio.min()), 5.0, 20.0),
        Number(
            "difference of c/a = 0.3 over that of 0.5, smallest", float((worst[1::2, 0] / worst[::2, 0]).min()), low=1.0
        ),
    )
    sentence = (
        f"Largest difference at St = {STOKES[0]:g}: "
        + ", ".join(f"{value:.2g} {_title(body)}" for body, value in zip(BODIES, worst[:, 0], strict=True))
        + f" I_max; at St = {STOKES[1]:g} {ratio.min():.2g} to {ratio.max():.2g} times less."
    )
    starts = ", ".join(f"({momentum:g}, {theta:g})" for momentum, theta in STARTS)
    caption = (
        f"Slow (black) and full trajectories of six ellipsoids from (L_z0/I_max, θ₀) = {starts}, ψ₀ = π/2, with L "
        f"along the vorticity. Differences of starts with L_z > 0 count as far as L_z = {ABOVE_PINCH:g} I_max; slow "
        "trajectories end at the pinch point."
    )
    return Verdict(Word.SHARPENED, sentence, numbers, caption)


SECTION = Section(
    "ellipsoids",
    "Triaxial ellipsoids at large St",
    (
        ITEMS[2],
        *ITEMS[:2],
        Item(
            "ellipsoid-plane",
            "The L_z–E plane of an ellipsoid",
            "With L_x = L_y = 0 all slow trajectories with L_z < 0 but the critical one and the upper parabola go to "
            "the node; those with L_z > 0 reach the pinch point in infinite time; the local solution gives the "
            "critical trajectory.",
            compute_plane,
            figure_plane,
            verdict_plane,
        ),
        Item(
            "ellipsoid-planes",
            "Full and slow trajectories of six ellipsoids",
            "The agreement is good for St ≳ 1000; deviations grow with eccentricity and shrink with growing St.",
            compute_planes,
            figure_planes,
            verdict_planes,
        ),
        SPACE,
    ),
)
