"""Beyond the paper: endings that averaging cannot tell, basins and transient times."""

from math import pi, sqrt

import numpy as np
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure

from polhode.harness.common.fits import wilson
from polhode.harness.pages.figures.style import power
from polhode.harness.paper.drawing import (
    AVERAGED,
    BLUE,
    CYCLE,
    GREEN,
    ORANGE,
    VERMILLION,
    YELLOW,
    label,
    logarithmic,
    panels,
)
from polhode.harness.paper.item import Data, Grid, Item, Number, Section, Table, Verdict, Word
from polhode.harness.paper.planes import distance_from_node, energy_at
from polhode.harness.paper.runs import averaged_run, full_run, graded, slow_run
from polhode.harness.paper.sections.beyond.averaging_order import ELLIPSOID, ORDER, same_slow_start
from polhode.harness.paper.tables import columns, groups
from polhode.models.rotation import quaternion_from_euler
from polhode.models.scene import BodyStart, EulerStart, Scene
from polhode.models.scenes import PAPER_START
from polhode.models.theory.fixed_points import fixed_points

# Some averaged runs graze L² = 2EI₂, where a Taylor series hardly converges.
GRAZING = "cyrk-vern8"
ENDING_TIME = 1.5
ARRIVED = 0.06
ENDING_STOKES = (3e2, 5e2, 1e3, 3e3, 1e4)
# How near to the saddle the starts are: standard deviation of their tilts, in rad, and of their angular velocities.
NEAR = (3e-2, 3e-3, 3e-4)


def saddle_start(generator: np.random.Generator, near: float) -> BodyStart:
    """Longest axis along the vorticity and ω = -½ along it, both but for about `near`."""
    theta, phi, psi = pi / 2, generator.uniform(0, 2 * pi), generator.choice([-pi / 2, pi / 2])
    tilt = generator.normal(scale=near, size=2)
    quaternion = quaternion_from_euler((theta + tilt[0], phi, psi + tilt[1]))
    noise = generator.normal(scale=near, size=3)
    sign = -np.sign(psi)
    return BodyStart(quaternion, (0.5 * sign + noise[0], noise[1], noise[2]))


def compute_endings(grid: Grid) -> Data:
    """Arrival at the node from next to the saddle: averaged, and full at several St, with the end of z'."""
    generator = np.random.default_rng(23)
    slow_times = np.linspace(0.0, ENDING_TIME, 1501)
    rows = []
    for near in NEAR:
        for index in range(grid.of(24, 6)):
            start = saddle_start(generator, near)
            scene = Scene(ELLIPSOID, 1.0, start, ENDING_TIME)
            averaged = averaged_run(scene, slow_times, solver=GRAZING).slow
            expected = _arrival(slow_times, averaged)
            for stokes in ENDING_STOKES[:: grid.of(1, 2)]:
                for phase, own in enumerate((start, same_slow_start(start, generator))):
                    run = full_run(Scene(ELLIPSOID, stokes, own, stokes * ENDING_TIME), stokes * slow_times)
                    up = float(run.observables.rotation[-1, 2, 2] > 0)
                    rows.append((near, index, stokes, phase, expected, _arrival(slow_times, run.slow), up))
    return {"": columns("near start stokes phase averaged full up", rows)}


def _arrival(slow_times: np.ndarray, slow: np.ndarray, near: float = ARRIVED) -> float:
    """Slow time from which on L and E stay close to the node; the end if they do not."""
    away = np.flatnonzero(distance_from_node(ELLIPSOID, slow) > near)
    return float(slow_times[min(int(away[-1]) + 1, len(slow_times) - 1)]) if len(away) else 0.0


def figure_endings(data: Data) -> Figure:
    """Arrival times against each other, and the shares."""
    figure, (left, right) = panels(1, 2, 3.9, 3.4)
    ends = [0.9 * min(data[""]["averaged"]), 1.1 * max(data[""]["full"])]
    left.plot(ends, ends, color=AVERAGED, linewidth=0.8, label="equal")
    for color, (stokes, part) in zip(CYCLE, groups(data[""], "stokes"), strict=False):
        left.plot(part["averaged"], part["full"], ".", color=color, markersize=4, label=f"St = {power(stokes)}")
    logarithmic(label(left, "arrival of the averaged run, slow time", "arrival of the full run, slow time")).legend()
    for axis in (left.xaxis, left.yaxis):
        axis.set_ticks([0.2, 0.5, 1.0], ["0.2", "0.5", "1"])
        axis.set_ticks([], minor=True)
    for color, (near, part) in zip((BLUE, GREEN, VERMILLION), groups(data[""], "near"), strict=True):
        stokes, late, _, _ = _shares(part)
        right.plot(stokes, late, "o-", color=color, label=f"arrival off by a fifth, {near:g} from the saddle")
    stokes, _, other, _ = _shares(data[""])
    right.plot(stokes, other, "s--", color=ORANGE, label="end of $z'$ changes with the fast phase")
    logarithmic(label(right, "Stokes number St", "share of starts"), "x")
    right.legend(loc="center right", bbox_to_anchor=(1.0, 0.3), fontsize=7)
    right.set_ylim(-0.03, 1.03)
    return figure


def _shares(table: Table) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """St, share of late or early arrivals, share of starts whose end depends on the fast phase, their number."""
    rows = []
    for stokes, part in groups(table, "stokes"):
        off = np.abs(part["full"] - part["averaged"]) > 0.2 * part["averaged"]
        first, second = (part["up"][part["phase"] == phase] for phase in (0, 1))
        rows.append((stokes, np.mean(off), np.mean(first != second), len(first)))
    stokes, late, other, count = np.array(rows).T
    return stokes, late, other, count


def verdict_endings(data: Data) -> Verdict:
    """Shares with their intervals."""
    table = data[""]
    stokes, _, other, count = _shares(table)
    late = {near: _shares(part)[1] for near, part in groups(table, "near")}
    runs = 2 * int(count[-1]) // len(late)
    flips = wilson(round(other[-1] * count[-1]), int(count[-1]))
    far, close = NEAR[0], NEAR[-1]
    shares = "; ".join(
        f"{', '.join(f'{100 * share:.0f}' for share in own)} % from {near:g} of the saddle"
        for near, own in late.items()
    )
    count = len(np.unique(data[""]["start"]))
    return Verdict(
        Word.MEASURED,
        "All full runs end at the node, but those that start next to the saddle may reach it at a time more than a "
        f"fifth off the averaged one. At St = {', '.join(f'{number:g}' for number in stokes)} so do {shares}. In which "
        "of its two mirror images they end, z' up or down, depends on the fast phase, which averaging does not know: "
        f"it differs for {100 * other[-1]:.0f} % of the pairs of starts with the same L and E at St = {stokes[-1]:g}.",
        f"{count} random starts at each of the distances {', '.join(f'{near:g}' for near in NEAR)} (tilts in rad, and "
        "angular velocities) from the rotation of (1, 0.8, 0.5) about its longest axis, each at two fast phases. Left: "
        f"slow time from which L and E stay within {ARRIVED:g} I_max of the node; right: shares.",
        *(
            Number(
                f"share of arrivals off by a fifth, St = {stokes[-1]:g}, {near:g} from the saddle",
                float(own[-1]),
                0.0,
                1.0,
                interval=wilson(round(own[-1] * runs), runs),
            )
            for near, own in late.items()
        ),
        Number(f"the same at St = {stokes[0]:g}, {far:g} from it", float(late[far][0]), float(late[far][-1]), 1.0),
        Number(f"the same at St = {stokes[0]:g}, {close:g} from it", float(late[close][0]), float(late[far][0]), 1.0),
        Number(f"z' ends the other way from the same L and E, St = {stokes[-1]:g}", float(other[-1]), 0, 1, "", flips),
        Number("share of full runs that reach the node", float(np.mean(table["full"] < 0.999 * ENDING_TIME)), 1, 1),
        Number("share of full runs that end with z' up", float(np.mean(table["up"])), 0.2, 0.8),
    )


BASIN_STOKES, BASIN_TIME = 1e3, 0.6
NEAR_NODE = 0.02


def compute_basins(grid: Grid) -> Data:
    """Transient times of the averaged equations from |L| = I_max/2; ends of z' over starts at one St."""
    slow_times = graded(2.0, 1201)
    size = grid.of(41, 9)
    transients = []
    for cosine in np.linspace(-0.999, 0.999, size).tolist():
        for share in np.linspace(0.002, 0.998, size).tolist():
            sine = sqrt((1 - cosine**2) / 2)
            slow = (0.5 * sine, 0.5 * sine, 0.5 * cosine, energy_at(ELLIPSOID, 0.5, share))
            run = slow_run(ELLIPSOID, slow, slow_times, solver=GRAZING)
            transients.append((cosine, share, _arrival(slow_times, run.slow, NEAR_NODE)))
    ends = []
    side = grid.of(64, 10)
    times = np.array([0.0, BASIN_STOKES * BASIN_TIME])
    for theta in ((np.arange(side) + 0.5) * pi / side).tolist():
        for psi in ((np.arange(side) + 0.5) * 2 * pi / side - pi).tolist():
            start = EulerStart((theta, PAPER_START.angles[1], psi), PAPER_START.rates)
            run = full_run(Scene(ELLIPSOID, BASIN_STOKES, start, times[-1]), times, 1e-9)
            ends.append((theta, psi, float(run.observables.rotation[-1, 2, 2])))
    return {"transients": columns("cosine share t2", transients), "ends": columns("theta psi z", ends)}


def _map(table: Table, names: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Coordinates of a table's rows, the second running fastest, and its values, shape (first, second)."""
    first, second, values = (table[name] for name in names.split())
    return np.unique(first), np.unique(second), values.reshape(len(np.unique(first)), -1)


def figure_basins(data: Data) -> Figure:
    """Two maps."""
    figure, (left, right) = panels(1, 2, 4.3, 3.4)
    cosine, share, slow_times = _map(data["transients"], "cosine share t2")
    times = left.pcolormesh(cosine, share, slow_times.T, cmap="cividis", rasterized=True)
    figure.colorbar(times, ax=left, label="slow time to the node")
    label(left, "$L_z/|L|$", "share of $E$ between its bounds")
    both = ListedColormap((BLUE, YELLOW))
    theta, psi, up = _map(data["ends"], "theta psi z")
    ends = right.pcolormesh(psi, theta, up, cmap=both, vmin=-1, vmax=1, rasterized=True)
    bar = figure.colorbar(ends, ax=right, label="$z'$ at the end, along the vorticity axis $z$", ticks=(-0.5, 0.5))
    bar.ax.set_yticklabels(["down", "up"], rotation="vertical", va="center")
    label(right, "$\\psi_0$, rad", "$\\theta_0$, rad", f"St = {BASIN_STOKES:g}")
    for axes in (left, right):
        axes.grid(visible=False)
    return figure


def verdict_basins(data: Data) -> Verdict:
    """Transient times, shares of the ends, and how mixed they are."""
    times = data["transients"]["t2"]
    ends = _map(data["ends"], "theta psi z")[2] > 0
    mixed = float(np.mean(np.concatenate([(ends[1:] != ends[:-1]).ravel(), (ends[:, 1:] != ends[:, :-1]).ravel()])))
    up = int(ends.sum())
    settled = float(np.mean(np.abs(data["ends"]["z"]) > 0.9))
    slowest = -max(
        value for point in fixed_points(ELLIPSOID) if point.stability == "stable node" for value in point.eigenvalues
    )
    median = float(np.median(times))
    side = len(np.unique(data["ends"]["theta"]))
    return Verdict(
        Word.MEASURED,
        f"The transient takes t₂ = {median:.2g} in the median, {median * slowest:.2g} times the slowest relaxation "
        f"time, and up to {times.max():.2g} next to the saddle's stable manifold. At St = {BASIN_STOKES:g} the two "
        f"ends of z' share the starts {100 * up / ends.size:.0f} : {100 - 100 * up / ends.size:.0f}, and "
        f"{100 * mixed:.0f} % of neighbours on the map end differently.",
        f"(1, 0.8, 0.5). Left: slow time until the averaged run stays within {NEAR_NODE:g} I_max of the node, from "
        f"|L| = I_max/2, L_x = L_y. Right: where z' points at t₂ = {BASIN_TIME:g}, {side}×{side} starts with the "
        "paper's rates.",
        Number("median transient, slow time", median, 0.05, 0.6),
        Number("the same times the slowest rate at the node", median * slowest, 1.0, 10.0),
        Number("longest transient of the map, slow time", float(times.max()), median, 2.0),
        Number("share of starts that end with z' up", up / ends.size, 0.1, 0.95, "", wilson(up, ends.size)),
        Number("share of neighbours on the map that end differently", mixed, 0.0, 0.6),
        Number("share of full runs with z' within 0.45 rad of the vorticity axis at the end", settled, low=0.8),
    )


SECTION = Section(
    "beyond",
    "Beyond the paper",
    (
        ORDER,
        Item(
            "saddle-endings",
            "Full and averaged runs from next to the saddle",
            "Not in the paper: how often do full trajectories near the saddle end differently from averaged ones?",
            compute_endings,
            figure_endings,
            verdict_endings,
        ),
        Item(
            "basins",
            "Basins and transient times",
            "Not in the paper: how long is the way to the node, and which of its mirror images is reached?",
            compute_basins,
            figure_basins,
            verdict_basins,
        ),
    ),
)
