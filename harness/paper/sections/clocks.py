"""How full runs approach the fixed points and leave large L, against the printed rates; clocks, the collapse on St*."""

from functools import cache
from math import pi

import numpy as np
from scipy.signal import find_peaks

from polhode.harness.paper.item import Computed, Grid, Part, Table
from polhode.harness.paper.runs import Run, full_run, spheroid
from polhode.harness.paper.tables import groups, path
from polhode.models.forms.spheroid import Spheroid
from polhode.models.rotation import quaternion_from_euler
from polhode.models.scene import BodyStart, EulerStart, Scene
from polhode.models.scenes import aligned_start
from polhode.models.shape import Ellipsoid
from polhode.models.theory.fixed_points import eigenvalues

# Bodies whose z' is the axis of the stable rotation: tumbling, spinning, and about the shortest
# axis.
BODIES = tuple(
    Ellipsoid(axes)
    for axes in (
        (2.0, 1.0, 1.0),
        (1.0, 1.0, 0.5),
        (1.0, 0.8, 0.5),
        (1.0, 0.55, 0.3),
        (1.0, 0.95, 0.5),
    )
)
STOKES, AWAY = 1e5, 0.03
# From so large L, in units of I_max, and for so many of its decay times.
LARGE, LARGE_STOKES = 1e3, 1e4


def displaced(body: Ellipsoid, mode: int) -> BodyStart | EulerStart:
    """Rotation about z' along the vorticity, off in one of the four modes: L tilted to x or y, faster, or wobbling."""
    if mode == 3:
        return aligned_start(body, -body.inertia[2] / 2, AWAY)
    tilt, azimuth = ((AWAY, pi / 2), (AWAY, 0.0), (0.0, 0.0))[mode]
    return BodyStart(
        quaternion_from_euler((tilt, azimuth, 0.3)), (0.0, 0.0, -0.5 - (AWAY if mode == 2 else 0.0))
    )


def amplitude(run: Run, mode: int) -> np.ndarray:
    """How far a run is from the fixed point in a mode, shape (n,): of 2EI₃ - L² for the wobble."""
    momentum, energy = run.observables.angular_momentum, run.observables.slow[:, 3]
    inertia = run.scene.ellipsoid.inertia[2]
    if mode == 3:
        return 2 * energy * inertia - np.sum(momentum**2, axis=1)
    return np.abs(momentum[:, mode] + (inertia / 2 if mode == 2 else 0.0))


def fitted_rate(slow_times: np.ndarray, values: np.ndarray) -> float:
    """Rate of an exponential by least squares of the logarithm."""
    return float(np.polyfit(slow_times, np.log(np.maximum(values, 1e-300)), 1)[0])


@cache
def compute_decay(grid: Grid) -> tuple[Part, ...]:
    """Rates of all modes of all bodies from full runs; decay of large L of a spheroid."""
    return tuple(_decay(grid))


def _decay(grid: Grid) -> Computed:
    for number, body in enumerate(BODIES):
        for mode, printed in enumerate(eigenvalues(body, 2)):
            slow_times = np.linspace(0.0, 1.5 / abs(printed), grid.of(4001, 1001))
            run = full_run(
                Scene(body, STOKES, displaced(body, mode), STOKES * slow_times[-1]),
                STOKES * slow_times,
            )
            clock = body.inertia[2] / (8 * pi * body.resistance[2])
            # Of a tumbling spheroid the fourth variable is η, whose square the wobble is.
            share = 0.5 if mode == 3 and body.symmetry_axis == 0 else 1.0
            measured = share * fitted_rate(slow_times, amplitude(run, mode))
            yield (
                "",
                {
                    "body": number,
                    "mode": mode,
                    "printed": printed,
                    "measured": measured,
                    "clock": clock,
                },
            )
    # From large L, squares of L along and across the axis, and the angle by which L has turned.
    for kappa in (0.5, 2.0):
        body = spheroid(kappa)
        slow_times = np.linspace(0.0, 2.0 / min(body.damping), grid.of(401, 101))
        omega = LARGE * np.array([0.48, 0.0, 0.64]) / np.array(body.inertia) * max(body.inertia)
        scene = Scene(
            body,
            LARGE_STOKES,
            BodyStart((0.5, 0.5, 0.1, 0.7), tuple(omega)),
            LARGE_STOKES * slow_times[-1],
        )
        seen = full_run(scene, LARGE_STOKES * slow_times).observables
        momentum, axis = seen.angular_momentum, seen.rotation[:, 2]
        size = np.linalg.norm(momentum, axis=1)
        axial = np.einsum("ni,ni->n", momentum, axis) ** 2
        turned = np.arccos(np.clip(momentum @ momentum[0] / size / size[0], -1, 1))
        squares = {"axial": axial, "transverse": size**2 - axial}
        yield "large", {"kappa": kappa, "t2": slow_times, **squares, "turned": turned}


def large_decay(large: Table) -> list[float]:
    """Decay of L² from large L along and across the axis, over the printed rate, less one."""
    found = []
    for kappa, part in groups(large, "kappa"):
        body = spheroid(kappa)
        for name, axis in (("axial", 2), ("transverse", 0)):
            printed = -16 * pi * body.resistance[axis] / body.inertia[axis]
            found.append(fitted_rate(part.t2, part[name]) / printed - 1)
    return found


def on_clocks(table: Table) -> tuple[np.ndarray, ...]:
    """Rates of L_z per St, per St* of the longest axis, and per that of the axis turned about."""
    chosen = table[table.mode == 2]
    rate, clock = -chosen.measured, chosen.clock
    longest = [max(zip(b.semi_axes, b.inertia, b.resistance, strict=True)) for b in BODIES]
    other = np.array([inertia / (8 * pi * resistance) for _, inertia, resistance in longest])
    return rate, rate * other, rate * clock


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
    axial, equatorial = shape.axial_inertia, shape.equatorial_inertia
    spin2 = (momentum**2 - 2 * equatorial * energy) / (axial * (axial - equatorial))
    theta = float(np.arccos(np.sqrt(spin2) * axial / momentum))
    start = aligned_start(ellipsoid, momentum, theta)
    stokes = STOKES_STAR / (axial / (8 * pi * ellipsoid.resistance[2]))
    return ellipsoid, stokes, BodyStart(start.quaternion, start.angular_velocity)


def compute_collapse(grid: Grid) -> Computed:
    """L_z and E of four spheroids with the same St*, and the rate at which L_z relaxes to the node on either clock."""
    scaled = np.linspace(0.0, 12.0, grid.of(401, 201))
    for kappa in COLLAPSE_KAPPAS:
        ellipsoid, stokes, start = collapse_start(kappa)
        run = full_run(Scene(ellipsoid, stokes, start, 13 * STOKES_STAR), STOKES_STAR * scaled)
        yield "", path(kappa, scaled, run.slow, ("Lz", "E"))
        rate = -eigenvalues(ellipsoid, int(np.argmax(ellipsoid.inertia)))[2]
        yield (
            "rates",
            {"kappa": kappa, "stokes": stokes, "t2": rate, "star": rate * STOKES_STAR / stokes},
        )


def frequency(run: Table) -> float:
    """Angular frequency of L_z, in units of the shear rate, from its first settled maximum to its last."""
    settled = run[run.t2 >= LATE / 2]
    peaks, _ = find_peaks(settled.Lz)
    first, *_, last = settled.t2[peaks]
    return float(2 * pi * (len(peaks) - 1) / (last - first) / STOKES_STAR)
