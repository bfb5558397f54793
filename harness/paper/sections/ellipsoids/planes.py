"""Section "Triaxial ellipsoids" in the phase space: L_z–E planes, the critical trajectory, 3-D projections."""

from math import sqrt

import numpy as np
from matplotlib.figure import Figure

from polhode.harness.paper import planes
from polhode.harness.paper.drawing import BLACK, BLUE, BOUND, NODE, ORANGE, VERMILLION, common_legend, panels
from polhode.harness.paper.item import Computed, Data, Grid, Table
from polhode.harness.paper.runs import graded, slow_run
from polhode.harness.paper.sections.ellipsoids.motion import (
    ELLIPSOID,
    MIDDLE,
    SIDES,
    critical_after,
    critical_before,
    state_of,
)
from polhode.harness.paper.sections.planes import NAMES, plane_tables
from polhode.harness.paper.tables import by, groups, path
from polhode.models.theory.fixed_points import fixed_points
from polhode.models.theory.separatrix import Separatrix

# Where local and averaged critical trajectory are compared: L_z over I_max around the singular point.
CLOSE = 2e-3
ON_EDGE = 0.25
# Half sizes of the magnified view of the singular point, over I_max.
WINDOW = 0.004, 0.0016


def compute_plane(grid: Grid) -> Computed:
    """Slow trajectories, and the critical one: local and averaged, before and after the singular point."""
    shares = (0.001, 0.1, 0.2, 0.35, 0.5, 0.65, 0.8, 0.95, 0.999)
    starts = [(momentum, share) for momentum in (-1.1, -0.08, 1.1) for share in shares[:: grid.of(1, 4)]]
    yield from plane_tables(ELLIPSOID, [*starts, (-1.1, 1.0)], grid.of(2001, 601), ON_EDGE, _kept)
    for number, side in enumerate(SIDES):
        local = Separatrix(ELLIPSOID, side)
        states = np.array([state_of(local, y, local.critical(y)) for y in np.geomspace(1e-6, 0.5, 41).tolist()])
        yield "critical", {"kind": 0, "side": number, "Lz": states[:, 2], "E": states[:, 3]}
    _, before = critical_before(0.8, 2001)
    for number, slow in enumerate((before[::2], critical_after(graded(0.5, 401)))):
        yield "critical", {"kind": 1, "side": number, "Lz": slow[:, 2], "E": slow[:, 3]}


def _kept(slow: np.ndarray) -> np.ndarray:
    """Indices of points at even steps, and of all in the magnified view of the singular point, or next to it."""
    inside = np.abs(slow[:, 2:] - planes.fixed_point(ELLIPSOID, "singular")) < 1.2 * np.array(WINDOW)
    return np.union1d(planes.plane_steps(slow, 250), np.flatnonzero(np.all(inside, axis=1)))


def figure_plane(data: Data) -> Figure:
    """The plane, and the neighbourhood of the singular point."""
    figure, (left, right) = panels(1, 2, 4.6, 4.4)
    x, y = planes.fixed_point(ELLIPSOID, "singular")
    for own in (left, right):
        planes.draw_frame(own, ELLIPSOID, -1.0, 1.0)
        planes.draw_paths(own, data[""], (0.6, 0.2, 0.1))
        for kind, line in groups(data["critical"], "kind"):
            style = {"color": (ORANGE, VERMILLION)[int(kind)], "linestyle": ("--", "-")[int(kind)]}
            for _, part in groups(line, "side"):
                own.plot(part.Lz, part.E, linewidth=2.0, zorder=4 + (kind == 0), **style)
    left.set_ylim(0.0, 0.8)
    right.set(xlim=(x - WINDOW[0], x + WINDOW[0]), ylim=(y - WINDOW[1], y + WINDOW[1]))
    right.locator_params(axis="x", nbins=5)
    right.set_title("around the singular point")
    planes.name_points(left, NAMES)
    planes.name_lines(left, ELLIPSOID, "$L_z^2 = 2EI_1, 2EI_3$")
    left.plot([], [], color=VERMILLION, lw=2, label="critical, averaged")
    left.plot([], [], color=ORANGE, lw=2, linestyle="--", label="critical, local solution")
    common_legend(figure, left)
    return figure


def misfit(critical: Table, side: float) -> float:
    """How far the local critical trajectory is off the averaged one near the singular point."""
    local, averaged = _both(critical, side)
    close = local[np.abs(local.Lz + MIDDLE / 2) < CLOSE]
    return np.max(np.min(_gap(close[:, None], averaged), axis=1))


def far_misfit(critical: Table, side: float) -> float:
    """The same at the end of the local one."""
    local, averaged = _both(critical, side)
    return np.min(_gap(local[-1], averaged))


def _both(critical: Table, side: float) -> tuple[Table, Table]:
    own = by(by(critical, "side")[side], "kind")
    return own[0.0], own[1.0]


def _gap(first: Table, second: Table) -> np.ndarray:
    return np.hypot(first.Lz - second.Lz, first.E - second.E)


def compute_space(grid: Grid) -> Computed:
    """One slow trajectory with L_x = 0 throughout and one with L_y = 0, and the fixed points."""
    slow_times = graded(1.0, grid.of(401, 101))
    for zero in (1, 0):
        slow = np.array([0.0, 0.0, -0.2, planes.energy_at(ELLIPSOID, 1.0, 0.7)])
        slow[1 - zero] = sqrt(1 - 0.2**2)
        yield "", path(zero, slow_times, slow_run(ELLIPSOID, slow.tolist(), slow_times).slow)


def figure_space(data: Data) -> Figure:
    """Two three-dimensional views with their projections."""
    figure, axes = panels(1, 2, 4.4, 3.5, subplot_kw={"projection": "3d"})
    for own, (zero, part) in zip(axes, groups(data[""], "path"), strict=True):
        name = "Lx" if zero == 1 else "Ly"
        u, v = np.meshgrid(np.linspace(0.0, 1.0, 16), np.linspace(-0.6, 0.6, 16))
        own.plot_wireframe(u, v, (u**2 + v**2) / 2, color=BOUND, linewidth=0.4)
        across, along, energy = part[name], part.Lz, part.E
        own.plot(across, along, energy, color=BLUE, linewidth=1.6)
        bound, wall = (across**2 + along**2) / 2, np.full_like(energy, 0.6)
        for projection in ((across, along, bound), (0 * across, along, energy), (across, wall, energy)):
            own.plot(*projection, color=BLACK, linewidth=0.8)
        for point in fixed_points(ELLIPSOID):
            own.scatter(0.0, *planes.place_of(ELLIPSOID, point), color=NODE, edgecolor=BLACK, s=25)
        own.set(xlabel=f"$L_{name[1]}/I_{{max}}$", ylabel="$L_z/I_{max}$", zlabel="$E/I_{max}$", ylim=(-0.6, 0.6))
        own.set_title(f"$L_{'xy'[int(zero)]} = 0$", y=1.0)
        own.view_init(22, 35)
        own.set_box_aspect((1, 1, 0.8), zoom=1.0)
    return figure
