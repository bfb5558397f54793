"""Beyond the paper: endings that averaging cannot tell, basins and transient times."""

from itertools import product
from math import pi, sqrt

import numpy as np
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure

from polhode.harness.paper import drawing
from polhode.harness.paper.drawing import label, panels
from polhode.harness.paper.item import Computed, Data, Grid, Table
from polhode.harness.paper.planes import distance_from_node, energy_at
from polhode.harness.paper.runs import averaged_run, full_run, graded, slow_run
from polhode.harness.paper.sections.beyond.crossings import ELLIPSOID, same_slow_start
from polhode.harness.paper.tables import Estimate, groups, share
from polhode.models.rotation import quaternion_from_euler
from polhode.models.scene import BodyStart, EulerStart, Scene
from polhode.models.scenes import PAPER_START

# Some averaged runs graze L² = 2EI₂, where a Taylor series hardly converges.
GRAZING = "cyrk-vern8"
ENDING_TIME = 1.5
# Of the figure of arrivals.
TICKS = [0.2, 0.5, 1.0], ["0.2", "0.5", "1"]
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


def compute_endings(grid: Grid) -> Computed:
    """Arrival at the node from next to the saddle: averaged, and full at several St, with the end of z'."""
    generator = np.random.default_rng(23)
    slow_times = np.linspace(0.0, ENDING_TIME, 1501)
    for near, index in product(NEAR, range(grid.of(24, 6))):
        start = saddle_start(generator, near)
        averaged = averaged_run(Scene(ELLIPSOID, 1.0, start, ENDING_TIME), slow_times, solver=GRAZING).slow
        expected = _arrival(slow_times, averaged)
        for stokes in ENDING_STOKES[:: grid.of(1, 2)]:
            for phase, own in enumerate((start, same_slow_start(start, generator))):
                run = full_run(Scene(ELLIPSOID, stokes, own, stokes * ENDING_TIME), stokes * slow_times)
                case = {"near": near, "start": index, "stokes": stokes, "phase": phase, "averaged": expected}
                up = float(run.observables.rotation[-1, 2, 2] > 0)
                yield "", {**case, "full": _arrival(slow_times, run.slow), "up": up}


def _arrival(slow_times: np.ndarray, slow: np.ndarray, near: float = ARRIVED) -> float:
    """Slow time from which on L and E stay close to the node; the end if they do not."""
    away = np.flatnonzero(distance_from_node(ELLIPSOID, slow) > near)
    return float(slow_times[min(int(away[-1]) + 1, len(slow_times) - 1)]) if len(away) else 0.0


def late(table: Table) -> dict[float, Estimate]:
    """Share of arrivals that are late or early, by St."""
    return {n: share(np.abs(own.full - own.averaged) > 0.2 * own.averaged) for n, own in groups(table, "stokes")}


def flips(table: Table) -> dict[float, Estimate]:
    """Share of starts whose end depends on the fast phase, by St."""
    return {
        stokes: share(part.up[part.phase == 0] != part.up[part.phase == 1]) for stokes, part in groups(table, "stokes")
    }


BASIN_STOKES, BASIN_TIME = 1e3, 0.6
NEAR_NODE = 0.02


def compute_basins(grid: Grid) -> Computed:
    """Transient times of the averaged equations from |L| = I_max/2; ends of z' over starts at one St."""
    slow_times = graded(2.0, 1201)
    size, side = grid.of(41, 9), grid.of(64, 10)
    for cosine, height in product(np.linspace(-0.999, 0.999, size).tolist(), np.linspace(0.002, 0.998, size).tolist()):
        sine = sqrt((1 - cosine**2) / 2)
        slow = (0.5 * sine, 0.5 * sine, 0.5 * cosine, energy_at(ELLIPSOID, 0.5, height))
        arrival = _arrival(slow_times, slow_run(ELLIPSOID, slow, slow_times, solver=GRAZING).slow, NEAR_NODE)
        yield "transients", {"cosine": cosine, "share": height, "t2": arrival}
    times, steps = np.array([0.0, BASIN_STOKES * BASIN_TIME]), np.arange(side) + 0.5
    for theta, psi in product((steps * pi / side).tolist(), (steps * 2 * pi / side - pi).tolist()):
        start = EulerStart((theta, PAPER_START.angles[1], psi), PAPER_START.rates)
        run = full_run(Scene(ELLIPSOID, BASIN_STOKES, start, times[-1]), times, 1e-9)
        yield "ends", {"theta": theta, "psi": psi, "z": run.observables.rotation[-1, 2, 2]}


def map_of(table: Table, names: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Coordinates of a table's rows, the second running fastest, and its values, shape (first, second)."""
    first, second, values = (table[name] for name in names.split())
    return np.unique(first), np.unique(second), values.reshape(len(np.unique(first)), -1)


def figure_basins(data: Data) -> Figure:
    """Two maps."""
    figure, (left, right) = panels(1, 2, 4.3, 3.4)
    cosine, height, slow_times = map_of(data["transients"], "cosine share t2")
    times = left.pcolormesh(cosine, height, slow_times.T, cmap="cividis", rasterized=True)
    figure.colorbar(times, ax=left, label="slow time to the node")
    label(left, "$L_z/|L|$", "share of $E$ between its bounds")
    both = ListedColormap((drawing.BLUE, drawing.YELLOW))
    theta, psi, up = map_of(data["ends"], "theta psi z")
    ends = right.pcolormesh(psi, theta, up, cmap=both, vmin=-1, vmax=1, rasterized=True)
    bar = figure.colorbar(ends, ax=right, label="$z'$ at the end, along the vorticity axis $z$", ticks=(-0.5, 0.5))
    bar.ax.set_yticklabels(["down", "up"], rotation="vertical", va="center")
    label(right, "$\\psi_0$, rad", "$\\theta_0$, rad", f"St = {BASIN_STOKES:g}")
    for axes in (left, right):
        axes.grid(visible=False)
    return figure
