"""Section "Spheroids" in time, the collapse on St*, and in the L_z–E plane, where full runs stand beside slow ones."""

from functools import partial
from math import pi

import numpy as np
from matplotlib.figure import Figure
from scipy.signal import find_peaks

from polhode.harness.paper.drawing import CYCLE, label, panels
from polhode.harness.paper.item import Computed, Data, Grid, Table
from polhode.harness.paper.planes import draw_frame, draw_paths, name_lines, name_points, plane_steps
from polhode.harness.paper.runs import full_run, spheroid
from polhode.harness.paper.sections.planes import plane_tables
from polhode.harness.paper.sections.slow_motion import NAMES
from polhode.harness.paper.tables import columns, groups, path_table
from polhode.models.forms.spheroid import Spheroid
from polhode.models.scene import BodyStart, Scene
from polhode.models.scenes import aligned_start
from polhode.models.shape import Ellipsoid
from polhode.models.theory.fixed_points import eigenvalues

PROLATE = spheroid(2.0)

# Effective Stokes number, and L_z and E over I_max, of the figure on the collapse.
STOKES_STAR, MOMENTUM, ENERGY = 2.071, -1.0, 0.6
COLLAPSE_KAPPAS = (0.3, 0.5, 2.0, 3.33)
# Scaled time after which the curves should have become one.
LATE = 6.0
# Oscillation of L_z/I_max below which a spheroid counts as at rest by then.
CALM = 0.01


def collapse_start(kappa: float) -> tuple[Ellipsoid, float, BodyStart]:
    """Spheroid, its Stokes number at the given St*, and the start with the given L_z and E."""
    ellipsoid, shape = spheroid(kappa), Spheroid.of(spheroid(kappa))
    largest = max(ellipsoid.inertia)
    momentum, energy = MOMENTUM * largest, ENERGY * largest
    spin2 = (momentum**2 - 2 * shape.equatorial_inertia * energy) / (
        shape.axial_inertia * (shape.axial_inertia - shape.equatorial_inertia)
    )
    theta = float(np.arccos(np.sqrt(spin2) * shape.axial_inertia / momentum))
    start = aligned_start(ellipsoid, momentum, theta)
    stokes = STOKES_STAR / (shape.axial_inertia / (8 * pi * ellipsoid.resistance[2]))
    return ellipsoid, stokes, BodyStart(start.quaternion, start.angular_velocity)


def compute_collapse(grid: Grid) -> Computed:
    """L_z and E of four spheroids with the same St*, and the rate at which L_z relaxes to the node on either clock."""
    scaled = np.linspace(0.0, 12.0, grid.of(401, 201))
    paths, rows = [], []
    for kappa in COLLAPSE_KAPPAS:
        ellipsoid, stokes, start = collapse_start(kappa)
        run = full_run(Scene(ellipsoid, stokes, start, 13 * STOKES_STAR), STOKES_STAR * scaled)
        paths.append((kappa, scaled, run.slow))
        rate = -eigenvalues(ellipsoid, int(np.argmax(ellipsoid.inertia)))[2]
        rows.append((kappa, stokes, rate, rate * STOKES_STAR / stokes))
    return {"": path_table(paths, ("Lz", "E")), "rates": columns("kappa stokes t2 star", rows)}


def figure_collapse(data: Data) -> Figure:
    """L_z and E against t/St*."""
    figure, axes = panels(1, 2, 3.8, 3.0)
    stokes = dict(zip(data["rates"].kappa, data["rates"].stokes, strict=True))
    for own, name in zip(axes, ("Lz", "E"), strict=True):
        for color, (kappa, part) in zip(CYCLE, groups(data[""], "path"), strict=False):
            own.plot(part.t2, part[name], color=color, label=f"$\\kappa$ = {kappa:g}, St = {stokes[kappa]:.0f}")
        label(own, "$t\\dot\\gamma/\\mathrm{St}^*$", NAMES[name])
    axes[0].legend()
    return figure


def frequency(run: Table) -> float:
    """Angular frequency of L_z, in units of the shear rate, from its first settled maximum to its last."""
    settled = run[run.t2 >= LATE / 2]
    peaks, _ = find_peaks(settled.Lz)
    first, *_, last = settled.t2[peaks]
    return float(2 * pi * (len(peaks) - 1) / (last - first) / STOKES_STAR)


ON_EDGE = 0.16


def compute_plane(grid: Grid) -> Computed:
    """Slow trajectories from both edges of the plane, and from close to the pinch point."""
    shares = (0.001, 0.05, 0.15, 0.3, 0.5, 0.7, 0.85, 0.95, 0.999)
    starts = [(momentum, share) for momentum in (-1.1, -0.06, 1.1) for share in shares[:: grid.of(1, 4)]]
    starts += [(-1.1, 1.0), (-0.06, 1.0)]
    return plane_tables(PROLATE, starts, grid.of(2001, 601), ON_EDGE, partial(plane_steps, count=150))


def figure_plane(data: Data) -> Figure:
    """The plane with all its trajectories."""
    figure, (axes,) = panels(1, 1, 6.0, 4.2)
    draw_frame(axes, PROLATE, -1.0, 1.0)
    draw_paths(axes, data[""], (0.6, 0.2))
    axes.set_ylim(0.0, 0.8)
    name_points(axes, {"stable node": "stable node (tumbling)", "saddle": "saddle (spinning)"})
    name_lines(axes, PROLATE, "$L_z^2 = 2EI_a$ and $L_z^2 = 2EI_e$")
    axes.legend(loc="upper center")
    return figure
