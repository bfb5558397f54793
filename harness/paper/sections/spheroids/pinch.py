"""Section "Spheroids" at the pinch point L = 0: how full and slow trajectories pass it."""

from math import pi, sqrt

import numpy as np
from matplotlib.figure import Figure
from scipy.optimize import brentq

from polhode.harness.common.fits import power_law
from polhode.harness.common.text import short
from polhode.harness.paper.drawing import CYCLE, draw_law, label, logarithmic, panels, styled_runs
from polhode.harness.paper.item import Data, Grid, Item, Number, Table, Verdict, Word
from polhode.harness.paper.planes import aligned_scene, draw_frame
from polhode.harness.paper.runs import Run, averaged_run, full_run, slow_run_to_pinch, spheroid
from polhode.harness.paper.tables import columns, groups, path_table
from polhode.models.forms.spheroid import Spheroid
from polhode.models.scene import BodyStart, Scene

# Shown in the planes; L_z over I_max at the start, θ₀, and the tilt of L, in rad, of the second plane.
KAPPA, MOMENTUM, THETA, TILT = 2.0, 0.4, 0.3, 0.2
STOKES, SLOW_TIME = (1e3, 1e4, 1e5), 0.12
# Half sizes of the magnified view, over I_max.
CLOSE = 0.045, 0.0024
# Measured in its width: below and above the aspect ratio at which the paper's St^-1/2 ceases to hold.
KAPPAS = (1.2, 2.0, 3.0)
# Half the window around the crossing in which the smallest |L| is looked for, over I_max.
WINDOW = 0.05


def compute_pinch(grid: Grid) -> Data:
    """Paths past the pinch point; the smallest |L| of full runs against St."""
    slow_times = np.linspace(0.0, SLOW_TIME, grid.of(1201, 601))
    ends, pinch = _slow_to_pinch(KAPPA, slow_times)
    aligned = [(np.inf, ends.times, ends.slow)]
    tilted = [(np.inf, slow_times, averaged_run(_tilted_scene(1.0), slow_times).slow)]
    for stokes in STOKES:
        for paths, scene in ((aligned, _scene(KAPPA, stokes)), (tilted, _tilted_scene(stokes))):
            paths.append((stokes, slow_times, full_run(scene, stokes * slow_times).slow))
    phases = grid.of(4, 3)
    rows = []
    for kappa in KAPPAS:
        _, met = _slow_to_pinch(kappa, slow_times)
        rows += [
            (kappa, stokes, phi, _least_momentum(kappa, stokes, phi, met))
            for stokes in np.geomspace(1e3, grid.of(1e8, 1e7), grid.of(11, 5)).tolist()
            for phi in ((np.arange(phases) + 0.25) * pi / phases).tolist()
        ]
    return {
        "aligned": path_table(aligned),
        "tilted": path_table(tilted),
        "end": {"t2": np.array([pinch])},
        "crossing": columns("kappa stokes phi least", rows),
    }


def _scene(kappa: float, stokes: float, phi: float = 0.0, slow_time: float = SLOW_TIME) -> Scene:
    """L along the vorticity."""
    return aligned_scene(spheroid(kappa), stokes, MOMENTUM, THETA, slow_time, phi)


def _tilted_scene(stokes: float) -> Scene:
    """The same start turned about the flow axis, so that L gets a component along the gradient."""
    aligned = _scene(KAPPA, stokes)
    q0, q1, q2, q3 = aligned.start.quaternion  # pyright: ignore[reportAttributeAccessIssue]
    c, s = np.cos(TILT / 2), np.sin(TILT / 2)
    turned = (c * q0 - s * q1, c * q1 + s * q0, c * q2 - s * q3, c * q3 + s * q2)
    return Scene(aligned.ellipsoid, stokes, BodyStart(turned, aligned.angular_velocity), aligned.time)


def _slow_to_pinch(kappa: float, slow_times: np.ndarray) -> tuple[Run, float]:
    """The averaged run, L_x = L_y = 0 exactly, as far as the pinch point, and the slow time at which it is met."""
    body = spheroid(kappa)
    momentum, energy = _scene(kappa, 1.0).initial.slow[0, 2:] / max(body.inertia)
    return slow_run_to_pinch(body, (0.0, 0.0, momentum, energy), slow_times)


def _least_momentum(kappa: float, stokes: float, phi: float, slow_time: float) -> float:
    """Smallest |L|/I_max of a full run that starts with L along the vorticity."""
    speed = MOMENTUM / slow_time
    half = min(slow_time, max(WINDOW, 10 / sqrt(stokes)) / speed)
    times = np.concatenate([[0.0], stokes * (slow_time + half * np.linspace(-0.999, 2.0, 12001))])
    slow = full_run(_scene(kappa, stokes, phi, times[-1] / stokes), times).slow
    return float(np.min(np.linalg.norm(slow[:, :3], axis=1)))


def growth_exponent(kappa: float) -> float:
    """Exponent e with which a small L_y of a prolate spheroid grows like L_z^e on its way to the pinch point.

    There h = cos θ_LO → 1, as Y_c > X_c, and dL_z/dt₂ → -4πX_c: by `lysmain` e = (X_c + Y_c I_a/I_e - 2Y_c)/X_c.
    """
    axial, equatorial = spheroid(kappa).resistance[2], spheroid(kappa).resistance[0]
    return (axial + equatorial * Spheroid.of(spheroid(kappa)).inertia_ratio - 2 * equatorial) / axial


def pinch_exponent(kappa: float) -> float:
    """Exponent in St of the smallest |L| of a prolate spheroid on its way past the pinch point.

    What is left of the O(1/St) oscillation in L_y reaches L_z when L_z^(1 - e) is of order 1/St; a particle at rest
    takes up its motion within |L| of order St^-1/2. The wider of the two decides.
    """
    return max(-0.5, -1 / (1 - growth_exponent(kappa)))


def figure_pinch(data: Data) -> Figure:
    """Paths in the plane, aligned and tilted, the neighbourhood of the pinch point, and the smallest |L|."""
    figure, axes = panels(2, 2, 3.9, 3.0)
    titles = ("$L_x = L_y = 0$ at the start", "the same at the pinch point", "$L_y \\neq 0$ at the start")
    for own, name, title in zip(axes[:3], ("aligned", "aligned", "tilted"), titles, strict=True):
        draw_frame(own, spheroid(KAPPA), -0.55, 0.4, title=title)
        for width, (style, part) in zip((0.6, 1.9, 1.4, 1.0), styled_runs(data[name], "path"), strict=False):
            own.plot(part["Lz"], part["E"], **style | {"linewidth": width})
        own.set_ylim(0.0, 0.16)
    axes[1].set(xlim=(-CLOSE[0], CLOSE[0]), ylim=(0.0, 2 * CLOSE[1]))
    axes[0].legend(loc="upper center", fontsize=7)
    for color, (kappa, part) in zip(CYCLE, groups(data["crossing"], "kappa"), strict=False):
        stokes, mean = _root_mean_squares(part)
        axes[3].plot(part["stokes"], part["least"], ".", markersize=2, color=color)
        axes[3].plot(stokes, mean, color=color, label=f"$\\kappa$ = {kappa:g}")
        draw_law(axes[3], stokes, mean[-1], pinch_exponent(kappa), color=color)
    logarithmic(label(axes[3], "Stokes number St", "smallest $|L|/I_{max}$")).legend(fontsize=7, loc="lower left")
    return figure


def _root_mean_squares(found: Table) -> tuple[np.ndarray, np.ndarray]:
    stokes = np.unique(found["stokes"])
    return stokes, np.array([np.sqrt(np.mean(found["least"][found["stokes"] == number] ** 2)) for number in stokes])


def _local_exponent(found: Table) -> float:
    """Exponent of the smallest |L| between a tenth of the largest St and the largest."""
    stokes, mean = _root_mean_squares(found)
    last = stokes >= 0.099 * stokes[-1]
    return power_law(stokes[last], mean[last])[0]


def verdict_pinch(data: Data) -> Verdict:
    """How close full runs come to L = 0, and where the slow trajectory ends."""
    local = {kappa: _local_exponent(part) for kappa, part in groups(data["crossing"], "kappa")}
    aligned, tilted = (dict(groups(data[name], "path")) for name in ("aligned", "tilted"))
    end, largest = float(data["end"]["t2"][0]), max(STOKES)
    agreement = float(np.max(np.abs(tilted[largest]["Lz"] - tilted[np.inf]["Lz"])))
    crossed = max(float(aligned[number]["Lz"][-1]) for number in STOKES)
    at = f"at St = {short(data['crossing']['stokes'].max())}"
    widths = ", ".join(
        f"St^({found:.3f}) for κ = {kappa:g} (predicted {pinch_exponent(kappa):.3f})" for kappa, found in local.items()
    )
    # The largest aspect ratio with the width St^-1/2.
    widest = float(brentq(lambda kappa: growth_exponent(kappa) + 1, 1.1, 3.0))  # pyright: ignore[reportArgumentType]
    phases = len(np.unique(data["crossing"]["phi"]))
    return Verdict(
        Word.CORRECTED,
        f"Full runs pass at |L| ∝ {widths}: on the way the slow equations amplify the small L_y that the fast "
        f"oscillation leaves, which makes the neighbourhood wider than St^-1/2 for κ > {widest:.3f} and leaves the "
        "paper's law to rounder spheroids. The slow trajectory does not grind to a halt: it runs into the pinch point "
        f"at a finite speed and ends there at t₂ = {end:.3g}. With a small L_y it passes, and agrees with the full "
        f"run to {agreement:.1g} I_max at St = {largest:g}.",
        f"κ = {KAPPA:g} from L_z = {MOMENTUM:g} I_e, θ₀ = {THETA:g}. Above: L along the vorticity; below left: L "
        f"turned by {TILT:.2g} rad; below right: smallest |L| of full runs with L along the vorticity (dots: {phases} "
        "azimuths φ₀, lines: their root mean square, dotted: predicted exponents).",
        *(
            Number.near(f"exponent of the smallest |L| in St {at}, κ = {kappa:g}", found, pinch_exponent(kappa), 0.1)
            for kappa, found in local.items()
        ),
        Number("slow time at which the aligned averaged run ends", end, 0.015, 0.03),
        Number("last L_z of the full runs, largest", crossed, high=-0.3, unit="I_max"),
        Number(f"averaged against full L_z with L_y ≠ 0, St = {largest:g}", agreement, high=0.02, unit="I_max"),
    )


ITEM = Item(
    "spheroid-pinch",
    "Full and slow trajectories at the pinch point",
    "Slow trajectories with L_x = L_y = 0 grind to a halt at the pinch point; full ones cross it within a "
    "neighbourhood of O(St^-1/2); with small L_x and L_y slow and full trajectories agree throughout.",
    compute_pinch,
    figure_pinch,
    verdict_pinch,
)
