"""Section "Spheroids" in the phase planes: L_z–E, L–E, and projections for finite L_x and L_y."""

from math import sqrt

import numpy as np
from matplotlib.figure import Figure

from polhode.harness.paper.drawing import BLACK, BOUND, CYCLE, GREEN, NODE, groups, label, panels
from polhode.harness.paper.item import Data, Grid, Item, Number, Section, Verdict, Word
from polhode.harness.paper.planes import (
    columns,
    comparison_data,
    comparison_figure,
    distance_from_node,
    draw_frame,
    draw_paths,
    energy_at,
    path_table,
    pinch_bound,
    plane_path,
    stacked,
)
from polhode.harness.paper.runs import averaged_run, graded, slow_scene, spheroid
from polhode.harness.paper.spheroid_motion import ITEMS
from polhode.models.fixed_points import fixed_points

PROLATE = spheroid(2.0)
REACHED = 1e-2
# Slow time for which starts on the upper parabola are followed, before rounding carries them off it.
ON_EDGE = 0.25


def compute_plane(grid: Grid) -> Data:
    """Slow trajectories from both edges of the plane, and from close to the pinch point."""
    slow_times = graded(1.0, grid.of(501, 301))
    shares = (0.001, 0.05, 0.15, 0.3, 0.5, 0.7, 0.85, 0.95, 0.999)
    starts = [(momentum, share) for momentum in (-1.1, -0.06, 1.1) for share in shares[:: grid.of(1, 4)]]
    starts += [(-1.1, 1.0), (-0.06, 1.0)]
    paths, ends = [], []
    for number, (momentum, share) in enumerate(starts):
        times = slow_times[slow_times <= ON_EDGE] if share == 1.0 else slow_times
        run = plane_path(PROLATE, momentum, energy_at(PROLATE, momentum, share), times)
        paths.append((number, run.times, run.slow))
        last = float(distance_from_node(PROLATE, run.slow[-1]))
        ends.append((number, momentum, share, last, run.times[-1], pinch_bound(PROLATE, momentum)))
    thinned = [(number, times[::4], slow[::4]) for number, times, slow in paths]
    return {"": path_table(thinned, "Lz E"), "ends": columns("path Lz0 share distance end bound", ends)}


def figure_plane(data: Data) -> Figure:
    """The plane with all its trajectories."""
    figure, (axes,) = panels(1, 1, 6.0, 4.2)
    draw_frame(axes, PROLATE, -1.0, 1.0)
    draw_paths(axes, data[""])
    axes.set_ylim(0.0, 0.8)
    axes.scatter([], [], marker="o", color=NODE, edgecolor=BLACK, label="stable node (tumbling)")
    axes.scatter([], [], marker="*", s=90, color=NODE, edgecolor=BLACK, label="saddle (spinning)")
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
    return Verdict(Word.CORRECTED, sentence, numbers)


def caption_plane(data: Data) -> str:
    """What the figure shows."""
    count = len(np.unique(data[""]["path"]))
    return f"L_z–E plane of a prolate spheroid, κ = 2, with {count} slow trajectories of L_x = L_y = 0; I_max = I_e."


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
        Number(f"largest difference at St = {high:g}, worst κ", max(worst[k, high] for k in KAPPAS), 0, 0.05, "I_max"),
        Number(f"difference at St = {low:g} over that at {high:g}, smallest", min(ratios), low=4.0),
        Number(f"difference of κ = 3.33 over that of 2, St = {low:g}", worst[3.33, low] / worst[2.0, low], low=1.2),
        Number(f"difference of κ = 0.3 over that of 0.5, St = {low:g}", worst[0.3, low] / worst[0.5, low], low=1.0),
    )
    sentence = (
        f"Largest difference at St = {low:g}: "
        + ", ".join(f"{worst[kappa, low]:.2g} (κ = {kappa:g})" for kappa in KAPPAS)
        + f" I_max; at St = {high:g} it is {min(ratios):.2g} to {max(ratios):.2g} times less."
    )
    return Verdict(Word.SHARPENED, sentence, numbers)


def caption_planes(data: Data) -> str:
    """What the figure shows."""
    starts = ", ".join(f"({momentum:g}, {theta:g})" for momentum, theta in STARTS)
    return f"Slow (black) and full trajectories from (L_z0/I_max, θ₀) = {starts} with L along the vorticity."


RATIOS = (0.1, 1.0, 10.0)


def compute_l_planes(grid: Grid) -> Data:
    """Slow trajectories with L_x = 0 or L_y = 0 and several ratios of L_xy to L_z, of either sign."""
    slow_times = graded(1.0, 401)
    parts, ends = [], []
    for zero in (0, 1):
        for ratio in RATIOS:
            for sign in (-1.0, 1.0):
                for share in grid.of((0.05, 0.3, 0.6, 0.9), (0.3, 0.9)):
                    along = sign / sqrt(1 + ratio**2)
                    slow = np.array([0.0, 0.0, along, energy_at(PROLATE, 1.0, share)])
                    slow[1 - zero] = ratio / sqrt(1 + ratio**2)
                    run = averaged_run(slow_scene(PROLATE, tuple(slow), slow_times[-1]), slow_times)
                    labels = {"zero": zero, "ratio": sign * ratio, "path": len(ends)}
                    size = np.linalg.norm(run.slow[:, :3], axis=1)
                    parts.append((labels, {"L": size[::4], "E": run.slow[::4, 3]}))
                    ends.append((zero, sign * ratio, share, float(distance_from_node(PROLATE, run.slow[-1]))))
    return {"": stacked(parts), "ends": columns("zero ratio share distance", ends)}


def figure_l_planes(data: Data) -> Figure:
    """Two L–E planes."""
    figure, axes = panels(1, 2, 3.8, 3.3)
    size = np.linspace(0.0, 1.0, 101)
    ratio = min(PROLATE.inertia) / max(PROLATE.inertia)
    for own, (zero, part) in zip(axes, groups(data[""], "zero"), strict=True):
        own.plot(size, size**2 / 2, color=BOUND)
        own.plot(size, size**2 / (2 * ratio), color=BOUND)
        for color, wanted in zip(CYCLE, RATIOS, strict=False):
            for sign, line in ((-1.0, "-"), (1.0, "--")):
                chosen = {name: column[part["ratio"] == sign * wanted] for name, column in part.items()}
                for index, (_, path) in enumerate(groups(chosen, "path")):
                    text = f"$L_{{xy}}/L_z$ = {sign * wanted:g}" if index == 0 else None
                    own.plot(path["L"], path["E"], color=color, linestyle=line, linewidth=0.8, label=text)
        own.plot(0.5, 0.125, "o", color=NODE, markeredgecolor=BLACK, zorder=5)
        own.plot(ratio / 2, ratio / 8, "*", color=NODE, markeredgecolor=BLACK, zorder=5, markersize=10)
        own.set_ylim(0.0, 1.0)
        label(own, "$|L|/I_{max}$", "$E/I_{max}$", f"$L_{'xy'[int(zero)]} = 0$")
    axes[0].legend(loc="upper left")
    return figure


def verdict_l_planes(data: Data) -> Verdict:
    """All of them reach the node."""
    distance = data["ends"]["distance"]
    numbers = (
        Number(f"share of the {len(distance)} starts that reach the node", float(np.mean(distance < REACHED)), 1, 1),
        Number("largest distance at the end", float(np.max(distance)), high=REACHED, unit="I_max"),
    )
    sentence = (
        "Whatever the ratio of L_xy to L_z, its sign, and which of L_x and L_y is zero, every slow trajectory ends at "
        "the node: those with L_z > 0 pass the neighbourhood of L = 0 and come back."
    )
    return Verdict(Word.CONFIRMED, sentence, numbers)


def caption_l_planes(data: Data) -> str:
    """What the figure shows."""
    return (
        "L–E planes of κ = 2 from |L| = I_e with L_x = 0 (left) and L_y = 0 (right); colours tell L_xy/L_z, dashed "
        "lines start with L_z > 0."
    )


ENERGIES = (2 / 9, 0.305, 0.472)
MOMENTUM = 2 / 3
AZIMUTHS = (0.0, 45.0, 90.0)


def compute_projections(grid: Grid) -> Data:
    """Slow trajectories from |L| = 2I_e/3, three energies, all directions of L."""
    slow_times = graded(1.0, 601)
    parts, ends, crossings = [], [], []
    for energy in ENERGIES:
        for cosine in grid.of((-0.95, -0.5, 0.1, 0.6, 0.95), (-0.6, 0.6)):
            found = {}
            for azimuth in AZIMUTHS:
                sine, angle = sqrt(1 - cosine**2), np.radians(azimuth)
                direction = np.array([sine * np.sin(angle), sine * np.cos(angle), cosine]) * MOMENTUM
                run = averaged_run(slow_scene(PROLATE, (*direction, energy), slow_times[-1]), slow_times)
                across = np.linalg.norm(run.slow[:, :2], axis=1)
                values = {"Lz": run.slow[::8, 2], "Lxy": across[::8], "E": run.slow[::8, 3]}
                parts.append(({"E0": energy, "azimuth": azimuth, "path": len(ends)}, values))
                ends.append((energy, cosine, azimuth, float(distance_from_node(PROLATE, run.slow[-1]))))
                found[azimuth] = across
            crossings.append((energy, cosine, float(np.mean(_between(*(found[azimuth] for azimuth in AZIMUTHS))))))
    return {
        "": stacked(parts),
        "ends": columns("E0 cosine azimuth distance", ends),
        "between": columns("E0 cosine share", crossings),
    }


def _between(low: np.ndarray, middle: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Where, in time, one value lies between two others, up to rounding."""
    slack = 1e-9
    return (middle >= np.minimum(low, high) - slack) & (middle <= np.maximum(low, high) + slack)


def figure_projections(data: Data) -> Figure:
    """Three rows: L_z–E and L_z–L_xy."""
    figure, axes = panels(3, 2, 3.9, 2.4)
    for row, (energy, part) in enumerate(groups(data[""], "E0")):
        left, right = axes[2 * row], axes[2 * row + 1]
        momentum = np.linspace(-0.7, 0.7, 101)
        left.plot(momentum, momentum**2 / 2, color=BOUND, linewidth=0.8)
        for color, (azimuth, own) in zip((CYCLE[0], BLACK, CYCLE[1]), groups(part, "azimuth"), strict=True):
            text = {0.0: "$L_{x0} = 0$", 45.0: "$L_{x0} = L_{y0}$", 90.0: "$L_{y0} = 0$"}[azimuth]
            for index, (_, path) in enumerate(groups(own, "path")):
                for axes_, name in ((left, "E"), (right, "Lxy")):
                    axes_.plot(path["Lz"], path[name], color=color, lw=0.8, label=text if index == 0 else None)
        left.plot(-0.5, 0.125, "o", color=NODE, markeredgecolor=BLACK, zorder=5)
        right.plot(-0.5, 0.0, "o", color=NODE, markeredgecolor=BLACK, zorder=5)
        left.set_ylim(0.0, 1.1 * energy)
        label(left, "$L_z/I_{max}$", "$E/I_{max}$", f"$E_0/I_e$ = {energy:.3f}")
        label(right, "$L_z/I_{max}$", r"$\sqrt{L_x^2+L_y^2}/I_{max}$")
    axes[1].legend(loc="upper right")
    return figure


def verdict_projections(data: Data) -> Verdict:
    """They all end at the node; those of L_x0 = L_y0 run between the two others."""
    distance, share = data["ends"]["distance"], data["between"]["share"]
    within = float(np.mean(share))
    numbers = (
        Number(f"share of the {len(distance)} starts that reach the node", float(np.mean(distance < REACHED)), 1, 1),
        Number("share of the time in which L_xy of L_x0 = L_y0 lies between the limiting cases", within, 0.5, 1.0),
        Number("the same, least start", float(np.min(share)), 0.0, 1.0),
    )
    sentence = (
        "Every start ends at the node, whatever L_x0/L_y0 and the cone angle. In time, the trajectory of L_x0 = L_y0 "
        f"keeps its L_xy between those of L_x0 = 0 and L_y0 = 0 for {100 * within:.0f} % of the run."
    )
    return Verdict(Word.SHARPENED, sentence, numbers)


def caption_projections(data: Data) -> str:
    """What the figure shows."""
    cosines = ", ".join(f"{value:g}" for value in np.unique(data["ends"]["cosine"]))
    return f"Slow trajectories of κ = 2 from |L| = 2I_e/3, L_z/|L| = {cosines}, at three energies (I_aη₀/L₀ grows)."


SECTION = Section(
    "spheroids",
    "Spheroids at large St",
    (
        *ITEMS[:2],
        Item(
            "spheroid-plane",
            "The L_z–E plane of a spheroid",
            "With L_x = L_y = 0 and L_z < 0 almost all slow trajectories converge to the tumbling node of κ = 2; the "
            "upper parabola is the stable manifold of the saddle; from L_z > 0 they approach the pinch point.",
            compute_plane,
            figure_plane,
            verdict_plane,
            caption_plane,
        ),
        ITEMS[3],
        Item(
            "spheroid-planes",
            "Full and slow trajectories of four spheroids",
            "For a given St the deviation from the slow trajectories decreases as κ approaches one, and with growing "
            "St; κ = 3.33 at St = 1000 shows the largest oscillations.",
            compute_planes,
            figure_planes,
            verdict_planes,
            caption_planes,
        ),
        ITEMS[2],
        Item(
            "spheroid-projections",
            "Projections for finite L_x and L_y",
            "From |L| = 2I_e/3 all slow trajectories end at the node, whatever L_x0/L_y0 and the cone angle; each is "
            "bounded by the limiting cases L_x = 0 and L_y = 0.",
            compute_projections,
            figure_projections,
            verdict_projections,
            caption_projections,
        ),
        Item(
            "spheroid-l-planes",
            "The L–E planes",
            "The topology in the L–E plane does not depend on L_xy/L_z, nor on which of L_x and L_y is zero.",
            compute_l_planes,
            figure_l_planes,
            verdict_l_planes,
            caption_l_planes,
        ),
    ),
)
