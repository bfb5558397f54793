"""Section "Spheroids" in the L_z–E plane: slow trajectories, and full ones beside them."""

import numpy as np
from matplotlib.figure import Figure

from polhode.harness.paper.drawing import BOUND, GREEN, groups, panels
from polhode.harness.paper.item import Data, Grid, Item, Number, Section, Verdict, Word
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
    plane_steps,
)
from polhode.harness.paper.runs import graded, spheroid
from polhode.harness.paper.sections.spheroids.motion import ITEMS
from polhode.harness.paper.sections.spheroids.pinch import ITEM as PINCH
from polhode.harness.paper.sections.spheroids.projections import ITEMS as PROJECTIONS
from polhode.models.theory.fixed_points import fixed_points

PROLATE = spheroid(2.0)
REACHED = 1e-2
# Slow time for which starts on the upper parabola are followed, before rounding carries them off it.
ON_EDGE = 0.16


def compute_plane(grid: Grid) -> Data:
    """Slow trajectories from both edges of the plane, and from close to the pinch point."""
    slow_times = graded(1.0, grid.of(2001, 601))
    shares = (0.001, 0.05, 0.15, 0.3, 0.5, 0.7, 0.85, 0.95, 0.999)
    starts = [(momentum, share) for momentum in (-1.1, -0.06, 1.1) for share in shares[:: grid.of(1, 4)]]
    starts += [(-1.1, 1.0), (-0.06, 1.0)]
    paths, ends = [], []
    for number, (momentum, share) in enumerate(starts):
        times = slow_times[slow_times <= ON_EDGE] if share == 1.0 else slow_times
        run = plane_path(PROLATE, momentum, energy_at(PROLATE, momentum, min(share, INSIDE)), times)
        paths.append((number, run.times, run.slow))
        last = float(distance_from_node(PROLATE, run.slow[-1]))
        ends.append((number, momentum, share, last, run.times[-1], pinch_bound(PROLATE, momentum)))
    kept = [(path, plane_steps(path[2], 150)) for path in paths]
    thinned = [(number, times[index], slow[index]) for (number, times, slow), index in kept]
    return {"": path_table(thinned, "Lz E"), "ends": columns("path Lz0 share distance end bound", ends)}


def figure_plane(data: Data) -> Figure:
    """The plane with all its trajectories."""
    figure, (axes,) = panels(1, 1, 6.0, 4.2)
    draw_frame(axes, PROLATE, -1.0, 1.0)
    draw_paths(axes, data[""], (0.6, 0.2))
    axes.set_ylim(0.0, 0.8)
    name_points(axes, {"stable node": "stable node (tumbling)", "saddle": "saddle (spinning)"})
    axes.plot([], [], color=BOUND, label="$L_z^2 = 2EI_a$ and $L_z^2 = 2EI_e$")
    axes.plot([], [], color=GREEN, label="$L_z + 4E = 0$")
    axes.legend(loc="upper center")
    return figure


def verdict_plane(data: Data) -> Verdict:
    """Where the trajectories end."""
    ends = data["ends"]
    left, on_edge = ends["Lz0"] < 0, ends["share"] == 1.0
    reached = float(np.mean(ends["distance"][left & ~on_edge] < REACHED))
    saddle = next(point for point in fixed_points(PROLATE) if point.stability == "saddle")
    last = [part["Lz"][-1] for number, part in groups(data[""], "path") if on_edge[int(number)]]
    from_saddle = float(np.max(np.abs(np.array(last) - saddle.state[2] / max(PROLATE.inertia))))
    share = float(np.max(ends["end"][~left] / ends["bound"][~left]))
    numbers = (
        Number(f"share of the {int(np.sum(left & ~on_edge))} starts with L_z < 0 that reach the node", reached, 1, 1),
        Number("distance from the saddle where starts on the upper parabola end", from_saddle, high=2e-3, unit="I_max"),
        Number("slow time to the pinch point from L_z > 0, over L_z/(4π min X), longest", share, 0, 1),
    )
    sentence = (
        "Every start with L_z < 0 off the upper parabola reaches the node, those on it reach the saddle. Starts with "
        f"L_z > 0 meet the pinch point in a finite slow time, at most {share:.2g} of the bound L_z/(4π min X). The "
        "saddle lies at (I_a/I_e)(-1/2, 1/8); the caption prints the node's place for it."
    )
    count = len(np.unique(data[""]["path"]))
    caption = f"L_z–E plane of a prolate spheroid, κ = 2, with {count} slow trajectories of L_x = L_y = 0; I_max = I_e."
    return Verdict(Word.CORRECTED, sentence, numbers, caption)


KAPPAS = (2.0, 3.33, 0.5, 0.3)
STOKES = (1e3, 1e4)
STARTS = tuple((momentum, theta) for momentum in (-0.7, 0.7) for theta in (0.4, 0.9, 1.4))


def compute_planes(grid: Grid) -> Data:
    """Slow and full trajectories of four spheroids, and their largest difference."""
    return comparison_data([(kappa, spheroid(kappa)) for kappa in KAPPAS], STARTS, STOKES, grid.of(201, 101))


def figure_planes(data: Data) -> Figure:
    """Four planes."""
    return comparison_figure(data, [spheroid(kappa) for kappa in KAPPAS], [f"κ = {kappa:g}" for kappa in KAPPAS])


def verdict_planes(data: Data) -> Verdict:
    """The difference falls with St and, at fixed St, grows with anisotropy within either family."""
    found = data["differences"]
    worst = {
        (kappa, stokes): float(np.max(part["difference"]))
        for kappa, own in groups(found, "body")
        for stokes, part in groups(own, "stokes")
    }
    ratios = [worst[kappa, STOKES[0]] / worst[kappa, STOKES[1]] for kappa in KAPPAS]
    low, high = STOKES
    numbers = (
        Number(f"largest difference at St = {high:g}, worst κ", max(worst[k, high] for k in KAPPAS), 0, 0.02, "I_max"),
        Number(f"difference at St = {low:g} over that at {high:g}, smallest", min(ratios), 5.0, 20.0),
        Number(f"difference of κ = 3.33 over that of 2, St = {low:g}", worst[3.33, low] / worst[2.0, low], low=1.2),
        Number(f"difference of κ = 0.3 over that of 0.5, St = {low:g}", worst[0.3, low] / worst[0.5, low], low=1.0),
    )
    sentence = (
        f"Largest difference at St = {low:g}: "
        + ", ".join(f"{worst[kappa, low]:.2g} (κ = {kappa:g})" for kappa in KAPPAS)
        + f" I_max; at St = {high:g} it is {min(ratios):.2g} to {max(ratios):.2g} times less."
    )
    starts = ", ".join(f"({momentum:g}, {theta:g})" for momentum, theta in STARTS)
    caption = (
        f"Slow (black) and full trajectories from (L_z0/I_max, θ₀) = {starts} with L along the vorticity. Differences "
        f"of starts with L_z > 0 count as far as L_z = {ABOVE_PINCH:g} I_max; slow trajectories end at the pinch point."
    )
    return Verdict(Word.SHARPENED, sentence, numbers, caption)


SECTION = Section(
    "spheroids",
    "Spheroids at large St",
    (
        *ITEMS[:2],
        Item(
            "spheroid-plane",
            "The L_z–E plane of a spheroid",
            "With L_x = L_y = 0 and L_z < 0 almost all slow trajectories converge to the tumbling node of κ = 2; the "
            "upper parabola is the stable manifold of the saddle, which the caption puts at (-1/2, 1/8); from L_z > 0 "
            "they grind to a halt at the pinch point.",
            compute_plane,
            figure_plane,
            verdict_plane,
        ),
        PINCH,
        Item(
            "spheroid-planes",
            "Full and slow trajectories of four spheroids",
            "For a given St the deviation from the slow trajectories decreases as κ approaches one, and with growing "
            "St; κ = 3.33 at St = 1000 shows the largest oscillations.",
            compute_planes,
            figure_planes,
            verdict_planes,
        ),
        ITEMS[2],
        *PROJECTIONS,
    ),
)
