"""Section "Spheroids" in time: slow variables, collapse on St*, and what happens at the pinch point."""

from functools import partial
from math import pi, sqrt

import numpy as np
from matplotlib.figure import Figure

from polhode.harness.paper.drawing import AVERAGED, CYCLE, groups, label, logarithmic, panels, power
from polhode.harness.paper.item import Data, Grid, Item, Number, Table, Verdict, Word
from polhode.harness.paper.planes import columns, draw_frame, path_table
from polhode.harness.paper.runs import (
    aligned_start,
    averaged_run,
    averaged_run_to_pinch,
    full_run,
    power_law,
    slow_scene,
    spheroid,
    spheroid_of,
)
from polhode.harness.paper.slow_motion import Comparison
from polhode.models.fixed_points import eigenvalues
from polhode.models.scene import BodyStart, Scene
from polhode.models.scenes import NEAR_POLE_START, SPHEROID_START
from polhode.models.shape import Ellipsoid

SHOWN, MEASURED = (50.0, 100.0, 500.0, 5e3), (1e3, 2e3, 1e4, 2e4, 5e4)
PROLATE = spheroid(2.0)
FIRST = Comparison(PROLATE, SPHEROID_START, SHOWN, MEASURED, 0.5, 500.0, (20.0, 60.0), (0.0, 0.25), Word.SHARPENED)
SECOND = Comparison(PROLATE, NEAR_POLE_START, SHOWN, MEASURED, 1.0, 5e3, (20.0, 90.0), (0.25, 0.35), Word.CORRECTED)

# Effective Stokes number, and L_z and E over I_max, of the figure on the collapse.
STOKES_STAR, MOMENTUM, ENERGY = 2.071, -1.0, 0.6
COLLAPSE_KAPPAS = (0.3, 0.5, 2.0, 3.33)
# Scaled time after which the curves should have become one.
LATE = 6.0


def collapse_start(kappa: float) -> tuple[Ellipsoid, float, BodyStart]:
    """Spheroid, its Stokes number at the given St*, and the start with the given L_z and E."""
    ellipsoid, shape = spheroid(kappa), spheroid_of(kappa)
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
        paths.append(
            (kappa, scaled, full_run(Scene(ellipsoid, stokes, start, 13 * STOKES_STAR), STOKES_STAR * scaled).slow)
        )
        axis = int(np.argmax(ellipsoid.inertia))
        rows.append((kappa, stokes, -eigenvalues(ellipsoid, axis)[2]))
    kappa, stokes, rate = np.array(rows).T
    return {
        "": path_table(paths, "Lz E"),
        "rates": {"kappa": kappa, "stokes": stokes, "t2": rate, "star": rate * STOKES_STAR / stokes},
    }


def figure_collapse(data: Data) -> Figure:
    """L_z and E against t/St*."""
    figure, axes = panels(1, 2, 3.8, 3.0)
    stokes = dict(zip(data["rates"]["kappa"], data["rates"]["stokes"], strict=True))
    for color, (kappa, part) in zip(CYCLE, groups(data[""], "path"), strict=False):
        for own, name in zip(axes, ("Lz", "E"), strict=True):
            own.plot(part["t2"], part[name], color=color, label=f"$\\kappa$ = {kappa:g}, St = {stokes[kappa]:.0f}")
    label(axes[0], "$t\\dot\\gamma/\\mathrm{St}^*$", "$L_z/I_{max}$").legend()
    label(axes[1], "$t\\dot\\gamma/\\mathrm{St}^*$", "$E/I_{max}$")
    return figure


def verdict_collapse(data: Data) -> Verdict:
    """Spread of the relaxation rates on the clocks t/St and t/St*, and of the late curves."""
    found = data["rates"]
    star, plain = (float(found[name].max() / found[name].min()) for name in ("star", "t2"))
    late = np.array([part["Lz"][part["t2"] >= LATE] for _, part in groups(data[""], "path")])
    prolate = found["kappa"] > 1
    apart = float(np.max(np.abs(np.diff(late[prolate], axis=0))))
    wave = float(np.max(np.abs(late[prolate] + 0.5)))
    numbers = (
        Number("largest over smallest relaxation rate of L_z at the node, per St*", star, 1.3, 2.0),
        Number("the same per St", plain, low=2 * star),
        Number(f"oscillation of L_z after t/St* = {LATE:g}, prolate", wave, low=0.05, unit="I_max"),
        Number("difference of the two prolate curves there", apart, low=0.05, unit="I_max"),
        Number("oscillation there, oblate", float(np.max(np.abs(late[~prolate] + 0.5))), high=0.01, unit="I_max"),
    )
    sentence = (
        f"The relaxation rates of L_z at the node differ by a factor of {plain:.2g} per St and {star:.2g} per St*: St* "
        "takes out part of the shape. It is the damping about the symmetry axis, while prolate spheroids end tumbling "
        f"about another: they go on oscillating by {wave:.2g} I_max, at frequencies that St* does not contain, and "
        f"oblate ones do not oscillate at all. The late curves are not one: the two prolate ones differ by {apart:.2g}."
    )
    return Verdict(Word.CORRECTED, sentence, numbers)


def caption_collapse(data: Data) -> str:
    """What the figure shows."""
    return (
        f"Full runs of spheroids at St* = {STOKES_STAR:g} from L = (0, 0, {MOMENTUM:g}) I_max, E = {ENERGY:g} I_max; "
        "I_max is I_e for prolate and I_a for oblate ones."
    )


# The pinch point: L_z over I_max at the start, θ₀, and the tilt of L, in rad, of the second panel.
PINCH_MOMENTUM, PINCH_THETA = 0.4, 0.3
PINCH_TILT = 0.2
PINCH_STOKES = (1e3, 1e4, 1e5)
# Half the window around the crossing in which the smallest |L| is looked for, over I_max.
PINCH_WINDOW = 0.05


def compute_pinch(grid: Grid) -> Data:
    """Paths past the pinch point; the smallest |L| of full runs against St."""
    slow_times = np.linspace(0.0, 0.12, grid.of(401, 201))
    aligned, tilted = _pinch_scene(1.0, 0.0, slow_times[-1]), _tilted_scene(1.0, slow_times[-1])
    exact = slow_scene(PROLATE, (0.0, 0.0, *aligned.initial.slow[0, 2:] / max(PROLATE.inertia)), slow_times[-1])
    ends, pinch = averaged_run_to_pinch(exact, slow_times)
    paths = {
        "aligned": [(np.inf, ends.times, ends.slow)],
        "tilted": [(np.inf, slow_times, averaged_run(tilted, slow_times).slow)],
    }
    for stokes in PINCH_STOKES:
        for name, scene_of in (("aligned", partial(_pinch_scene, phi=0.0)), ("tilted", _tilted_scene)):
            scene = scene_of(stokes, slow_time=slow_times[-1])
            paths[name].append((stokes, slow_times, full_run(scene, stokes * slow_times).slow))
    phases = grid.of(6, 3)
    rows = [
        (stokes, phi, _least_momentum(stokes, phi, pinch))
        for stokes in np.geomspace(1e3, grid.of(1e8, 1e6), grid.of(11, 7)).tolist()
        for phi in (np.arange(phases) * pi / phases).tolist()
    ]
    return {
        "aligned": path_table(paths["aligned"]),
        "tilted": path_table(paths["tilted"]),
        "end": {"t2": np.array([pinch])},
        "crossing": columns("stokes phi least", rows),
    }


def _pinch_scene(stokes: float, phi: float, slow_time: float) -> Scene:
    start = aligned_start(PROLATE, PINCH_MOMENTUM * max(PROLATE.inertia), PINCH_THETA, phi)
    return Scene(PROLATE, stokes, start, stokes * slow_time)


def _tilted_scene(stokes: float, slow_time: float) -> Scene:
    """The same start turned about the flow axis, so that L gets a component along the gradient."""
    aligned = _pinch_scene(stokes, 0.0, slow_time)
    q0, q1, q2, q3 = aligned.start.quaternion  # pyright: ignore[reportAttributeAccessIssue]
    c, s = np.cos(PINCH_TILT / 2), np.sin(PINCH_TILT / 2)
    turned = (c * q0 - s * q1, c * q1 + s * q0, c * q2 - s * q3, c * q3 + s * q2)
    return Scene(PROLATE, stokes, BodyStart(turned, aligned.angular_velocity), aligned.time)


def _least_momentum(stokes: float, phi: float, slow_time: float) -> float:
    """Smallest |L|/I_max of a full run that starts with L along the vorticity."""
    speed = PINCH_MOMENTUM / slow_time
    half = min(slow_time, max(PINCH_WINDOW, 10 / sqrt(stokes)) / speed)
    times = np.concatenate([[0.0], stokes * (slow_time + half * np.linspace(-0.999, 2.0, 12001))])
    slow = full_run(_pinch_scene(stokes, phi, times[-1] / stokes), times).slow
    return float(np.min(np.linalg.norm(slow[:, :3], axis=1)))


def figure_pinch(data: Data) -> Figure:
    """Paths in the plane, aligned and tilted, and the smallest |L|."""
    figure, axes = panels(1, 3, 3.4, 3.0)
    for own, (name, title) in zip(
        axes, (("aligned", "$L_x = L_y = 0$ at the start"), ("tilted", "$L_y \\neq 0$ at the start")), strict=False
    ):
        draw_frame(own, PROLATE, -0.55, 0.4, title=title)
        for number, (stokes, part) in enumerate(groups(data[name], "path")):
            averaged = np.isinf(stokes)
            text = "averaged" if averaged else f"full, St = {power(stokes)}"
            color = AVERAGED if averaged else CYCLE[number - 1]
            own.plot(part["Lz"], part["E"], color=color, label=text, zorder=4 if averaged else 3)
        own.set_ylim(0.0, 0.16)
    axes[0].legend(loc="upper center", fontsize=7)
    found = data["crossing"]
    axes[2].plot(found["stokes"], found["least"], "o", markersize=2.5, color=CYCLE[0], label="single runs")
    stokes, mean = _root_mean_squares(found)
    axes[2].plot(stokes, mean, color=CYCLE[0], label="root mean square")
    for line, slope in (("--", -0.5), (":", pinch_exponent())):
        law = mean[-1] * (stokes / stokes[-1]) ** slope
        axes[2].plot(stokes, law, color=AVERAGED, linestyle=line, label=f"slope {slope:.3g}")
    logarithmic(label(axes[2], "Stokes number St", "smallest $|L|/I_{max}$")).legend()
    return figure


def pinch_exponent() -> float:
    """Exponent in St of the smallest |L| of a prolate spheroid with Y_c > X_c on its way past the pinch point.

    There h = cos θ_LO → 1 and dL_z/dt₂ → -4πX_c, so that by `lysmain` a small L_y grows like L_z^e, where
    e = (X_c + Y_c I_a/I_e - 2Y_c)/X_c < 0. What is left of the O(1/St) oscillation in L_y reaches L_z when
    L_z^(1 - e) is of order 1/St.
    """
    shape = spheroid_of(PROLATE.aspect_ratio)
    axial, equatorial = PROLATE.resistance[2], PROLATE.resistance[0]
    growth = (axial + equatorial * shape.inertia_ratio - 2 * equatorial) / axial
    return -1 / (1 - growth)


def _root_mean_squares(found: Table) -> tuple[np.ndarray, np.ndarray]:
    stokes = np.unique(found["stokes"])
    return stokes, np.array([np.sqrt(np.mean(found["least"][found["stokes"] == number] ** 2)) for number in stokes])


def verdict_pinch(data: Data) -> Verdict:
    """How close full runs come to L = 0, and where the slow trajectory ends."""
    stokes, mean = _root_mean_squares(data["crossing"])
    local = power_law(stokes[-2:], mean[-2:]).exponent
    aligned, tilted = (dict(groups(data[name], "path")) for name in ("aligned", "tilted"))
    end, largest = float(data["end"]["t2"][0]), max(PINCH_STOKES)
    agreement = float(np.max(np.abs(tilted[largest]["Lz"] - tilted[np.inf]["Lz"])))
    crossed = max(float(aligned[number]["Lz"][-1]) for number in PINCH_STOKES)
    prediction = pinch_exponent()
    numbers = (
        Number.near(f"exponent of the smallest |L| in St at St = {stokes[-1]:.0e}", local, prediction, 0.1),
        Number("slow time at which the aligned averaged run ends", end, 0.015, 0.03),
        Number("last L_z of the full runs, largest", crossed, high=-0.3, unit="I_max"),
        Number(f"averaged against full L_z with L_y ≠ 0, St = {largest:g}", agreement, high=0.02, unit="I_max"),
    )
    sentence = (
        f"At large St full runs pass at |L| ∝ St^({local:.3f}), wider than St^-1/2: on the way the slow "
        f"equations amplify the small L_y that the fast oscillation leaves, which predicts St^({prediction:.3f}) "
        f"for κ = {PROLATE.aspect_ratio:g}. The slow trajectory does not grind to a halt: it runs into the pinch point "
        f"at a finite speed and ends there at t₂ = {end:.3g}. With a small L_y it passes, and agrees with the full "
        f"run to {agreement:.1g} I_max at St = {largest:g}."
    )
    return Verdict(Word.CORRECTED, sentence, numbers)


def caption_pinch(data: Data) -> str:
    """What the figure shows."""
    return (
        f"κ = 2 from L_z = {PINCH_MOMENTUM:g} I_e, θ₀ = {PINCH_THETA:g}. Left: L along the vorticity; middle: L turned "
        f"by {PINCH_TILT:.2g} rad; right: smallest |L| of full runs that differ in φ₀ alone."
    )


ITEMS = (
    Item(
        "spheroid-slow-1",
        "Slow variables of a spheroid, first start",
        "The slow solution predicts the full one accurately for St ≳ 100, and on average even at St = 50; the "
        "oscillation about it shrinks with growing St; all end at L_z = -I_e/2, E = I_e/8.",
        FIRST.compute,
        FIRST.figure,
        FIRST.verdict,
        FIRST.caption,
    ),
    Item(
        "spheroid-slow-2",
        "Slow variables of a spheroid, start near the saddle's stable manifold",
        "The same accuracy for St ≳ 100, with an intermediate plateau while the run lingers near the spinning mode.",
        SECOND.compute,
        SECOND.figure,
        SECOND.verdict,
        SECOND.caption,
    ),
    Item(
        "spheroid-collapse",
        "Collapse on the effective Stokes number",
        "At the same St* = I_a St/(8πX_c), L_z and E of different spheroids approach their end alike; the long-time "
        "evolution is a function of t/St* alone.",
        compute_collapse,
        figure_collapse,
        verdict_collapse,
        caption_collapse,
    ),
    Item(
        "spheroid-pinch",
        "Full and slow trajectories at the pinch point",
        "Slow trajectories with L_x = L_y = 0 grind to a halt at the pinch point; full ones cross it within a "
        "neighbourhood of O(St^-1/2); with small L_x and L_y slow and full trajectories agree throughout.",
        compute_pinch,
        figure_pinch,
        verdict_pinch,
        caption_pinch,
    ),
)
