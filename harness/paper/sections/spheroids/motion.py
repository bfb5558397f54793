"""Section "Spheroids" in time, the collapse on St*, and in the L_z–E plane, where full runs stand beside slow ones."""

from functools import partial
from math import pi

import numpy as np
from matplotlib.figure import Figure
from scipy.signal import find_peaks

from polhode.harness.paper.drawing import draw_groups, label, panels
from polhode.harness.paper.item import Data, Grid, Item, Number, Section, Table, Verdict, Word
from polhode.harness.paper.planes import draw_frame, draw_paths, fixed_point, name_lines, name_points, plane_steps
from polhode.harness.paper.runs import full_run, spheroid
from polhode.harness.paper.sections.planes import Planes, end_numbers, plane_tables
from polhode.harness.paper.sections.spheroids.pinch import ITEM as PINCH
from polhode.harness.paper.sections.spheroids.projections import ITEMS as PROJECTIONS
from polhode.harness.paper.slow_motion import NAMES, SlowMotion
from polhode.harness.paper.tables import columns, groups, path_table
from polhode.models.forms.spheroid import Spheroid
from polhode.models.scene import BodyStart, Scene
from polhode.models.scenes import NEAR_POLE_START, SPHEROID_START, aligned_start
from polhode.models.shape import Ellipsoid
from polhode.models.theory.fixed_points import eigenvalues

PROLATE = spheroid(2.0)
FIRST = SlowMotion(PROLATE, SPHEROID_START, 0.5, Word.SHARPENED, 500.0, (20.0, 60.0), (0.0, 0.25))
SECOND = SlowMotion(PROLATE, NEAR_POLE_START, 1.0, Word.CORRECTED, 5e3, (20.0, 90.0), (0.25, 0.35), lingers=True)

# Effective Stokes number, and L_z and E over I_max, of the figure on the collapse.
STOKES_STAR, MOMENTUM, ENERGY = 2.071, -1.0, 0.6
COLLAPSE_KAPPAS = (0.3, 0.5, 2.0, 3.33)
# Scaled time after which the curves should have become one.
LATE = 6.0


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


def compute_collapse(grid: Grid) -> Data:
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
    stokes = dict(zip(data["rates"]["kappa"], data["rates"]["stokes"], strict=True))
    for own, name in zip(axes, ("Lz", "E"), strict=True):
        draw_groups(
            own, data[""], "path", f"t2 {name}", lambda kappa: f"$\\kappa$ = {kappa:g}, St = {stokes[kappa]:.0f}"
        )
        label(own, "$t\\dot\\gamma/\\mathrm{St}^*$", NAMES[name])
    axes[0].legend()
    return figure


def verdict_collapse(data: Data) -> Verdict:
    """Spread of the relaxation rates on the clocks t/St and t/St*, and of the late curves."""
    found = data["rates"]
    star, plain = (float(found[name].max() / found[name].min()) for name in ("star", "t2"))
    late = np.array([part["Lz"][part["t2"] >= LATE] for _, part in groups(data[""], "path")])
    prolate = found["kappa"] > 1
    apart = float(np.max(np.abs(np.diff(late[prolate], axis=0))))
    waves = np.max(np.abs(late[prolate] + 0.5), axis=1)
    rates = [_frequency(part) for kappa, part in groups(data[""], "path") if kappa > 1]
    return Verdict(
        Word.CORRECTED,
        f"The relaxation rates of L_z at the node differ by a factor of {plain:.2g} per St and {star:.2g} per St*: St* "
        "takes out part of the shape. It is the damping about the symmetry axis, while prolate spheroids end tumbling "
        f"about another: they go on oscillating twice a turn, by {' and '.join(f'{wave:.2g}' for wave in waves)} "
        "I_max, and oblate ones do not oscillate at all. The late curves are not one: the two prolate ones, of equal "
        f"frequency, differ in phase and so by {apart:.2g}.",
        f"Full runs of spheroids at St* = {STOKES_STAR:g} from L = (0, 0, {MOMENTUM:g}) I_max, E = {ENERGY:g} I_max; "
        "I_max is I_e for prolate and I_a for oblate ones.",
        Number("largest over smallest relaxation rate of L_z at the node, per St*", star, 1.3, 2.0),
        Number("the same per St", plain, 3.0, 4.0),
        Number(f"oscillation of L_z after t/St* = {LATE:g}, prolate", float(waves.min()), low=0.05, unit="I_max"),
        *(
            Number.near(f"frequency of that oscillation, κ = {kappa:g}", rate, 1.0, 0.1, "γ̇")
            for kappa, rate in zip(found["kappa"][prolate], rates, strict=True)
        ),
        Number("difference of the two prolate curves there", apart, low=0.05, unit="I_max"),
        Number("oscillation there, oblate", float(np.max(np.abs(late[~prolate] + 0.5))), high=0.01, unit="I_max"),
    )


def _frequency(run: Table) -> float:
    """Angular frequency of L_z, in units of the shear rate, from its first settled maximum to its last."""
    settled = run["t2"] >= LATE / 2
    peaks, _ = find_peaks(run["Lz"][settled])
    first, *_, last = run["t2"][settled][peaks]
    return float(2 * pi * (len(peaks) - 1) / (last - first) / STOKES_STAR)


ON_EDGE = 0.16
PLANES = Planes(
    "κ",
    {kappa: spheroid(kappa) for kappa in (2.0, 3.33, 0.5, 0.3)},
    201,
    (
        ("difference of κ = 3.33 over that of 2, St = 1000", ((3.33, 2.0),), 1.2),
        ("difference of κ = 0.3 over that of 0.5, St = 1000", ((0.3, 0.5),), 1.0),
    ),
)


def compute_plane(grid: Grid) -> Data:
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


def verdict_plane(data: Data) -> Verdict:
    """Where the trajectories end."""
    reached, pinch = end_numbers(data["ends"])
    on_edge = data["ends"]["share"] == 1.0
    last = [part["Lz"][-1] for number, part in groups(data[""], "path") if on_edge[int(number)]]
    from_saddle = float(np.max(np.abs(np.array(last) - fixed_point(PROLATE, "saddle")[0])))
    count = len(np.unique(data[""]["path"]))
    return Verdict(
        Word.CORRECTED,
        "Every start with L_z < 0 off the upper parabola reaches the node, those on it reach the saddle. Starts with "
        f"L_z > 0 meet the pinch point in a finite slow time, at most {pinch.value:.2g} of the bound L_z/(4π min X). "
        "The saddle lies at (I_a/I_e)(-1/2, 1/8); the caption prints the node's place for it.",
        f"L_z–E plane of a prolate spheroid, κ = 2, with {count} slow trajectories of L_x = L_y = 0; I_max = I_e.",
        reached,
        Number("distance from the saddle where starts on the upper parabola end", from_saddle, high=2e-3, unit="I_max"),
        pinch,
    )


SECTION = Section(
    "spheroids",
    "Spheroids at large St",
    (
        Item.of(
            FIRST,
            "spheroid-slow-1",
            "Slow variables of a spheroid, first start",
            "The slow solution predicts the full one accurately for St ≳ 100, and on average even at St = 50; the "
            "oscillation about it shrinks with growing St; all end at L_z = -I_e/2, E = I_e/8.",
        ),
        Item.of(
            SECOND,
            "spheroid-slow-2",
            "Slow variables of a spheroid, start near the saddle's stable manifold",
            "The same accuracy for St ≳ 100, with an intermediate plateau while the run lingers near the spinning "
            "mode.",
        ),
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
        Item.of(
            PLANES,
            "spheroid-planes",
            "Full and slow trajectories of four spheroids",
            "For a given St the deviation from the slow trajectories decreases as κ approaches one, and with growing "
            "St; κ = 3.33 at St = 1000 shows the largest oscillations.",
        ),
        Item(
            "spheroid-collapse",
            "Collapse on the effective Stokes number",
            "At the same St* = I_a St/(8πX_c), L_z and E of different spheroids approach their end alike; the "
            "long-time evolution is a function of t/St* alone.",
            compute_collapse,
            figure_collapse,
            verdict_collapse,
        ),
        *PROJECTIONS,
    ),
)
