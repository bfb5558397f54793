"""The appendices: the tables of averages, and the first-order correction of a spheroid."""

import numpy as np
from matplotlib.figure import Figure
from scipy.integrate import cumulative_simpson

from polhode.harness.paper.drawing import AVERAGED, CYCLE, ORANGE, SKY, draw_law, label, logarithmic, panels
from polhode.harness.paper.item import Data, Grid, Item, Number, Section, Verdict, Word
from polhode.harness.paper.planes import aligned_scene
from polhode.harness.paper.runs import averaged_run, full_run, power_law, run_form, spheroid
from polhode.harness.paper.sections.appendix.averages import ITEMS
from polhode.harness.paper.tables import columns
from polhode.models.forms.spheroid import Spheroid
from polhode.models.theory.spheroid_correction import CorrectedSpheroid

# The first-order correction: κ, L_z over I_e at the start, θ₀, φ₀, and the slow time followed.
KAPPA, MOMENTUM, THETA, PHI, SLOW_TIME = 2.0, -0.9, 0.9, 0.6, 0.04
SHOWN = 200.0


def compute_first_order(grid: Grid) -> Data:
    """L_z in full, averaged and corrected at one St; the largest error against St."""
    rows = []
    for stokes in np.geomspace(1e2, 1e5, grid.of(13, 4)).tolist():
        full, *others = _first_order(stokes, grid.of(4001, 1001))
        rows.append((stokes, *(float(np.max(np.abs(other - full))) for other in others)))
    curves = dict(zip(("full", "averaged", "printed", "corrected"), _first_order(SHOWN, 401), strict=True))
    times = {"t2": np.linspace(0.0, SLOW_TIME, 401)}
    return {"": times | curves, "errors": columns("stokes averaged printed corrected", rows)}


def _first_order(stokes: float, points: int) -> tuple[np.ndarray, ...]:
    """L_z/I_e of the full and the averaged run, with the correction as printed, and corrected."""
    shape = Spheroid.of(spheroid(KAPPA))
    scene = aligned_scene(spheroid(KAPPA), stokes, MOMENTUM, THETA, SLOW_TIME, PHI)
    slow_times = np.linspace(0.0, SLOW_TIME, points)
    corrected = run_form(CorrectedSpheroid(), scene, slow_times, 1e-13).slow[:, 2]
    averaged = averaged_run(scene, slow_times)
    lz, spin = averaged.states[:, 2], averaged.states[:, 3]
    phase = cumulative_simpson(lz, x=slow_times, initial=0.0)
    mean = np.concatenate([lz[:1], phase[1:] / slow_times[1:]])
    amplitude = shape.equatorial_damping * shape.anisotropy * (1 - (shape.inertia_ratio * spin / lz) ** 2) / 4
    printed = lz - amplitude / mean * np.sin(2 * (stokes * phase + PHI)) / stokes
    return full_run(scene, stokes * slow_times).slow[:, 2], averaged.slow[:, 2], printed, corrected


def figure_first_order(data: Data) -> Figure:
    """L_z in time, and errors against St."""
    figure, (left, right) = panels(1, 2, 4.0, 3.1)
    table, found = data[""], data["errors"]
    left.plot(table["t2"], table["full"], color=CYCLE[0], linewidth=2.0, label="full")
    left.plot(table["t2"], table["averaged"], color=AVERAGED, label="averaged")
    left.plot(table["t2"], table["corrected"], color=ORANGE, linestyle="--", label="with first-order correction")
    label(left, "slow time $t_2$", "$L_z/I_e$", f"St = {SHOWN:g}").legend()
    for name, color, slope in (("averaged", AVERAGED, -1), ("printed", SKY, -1), ("corrected", ORANGE, -2)):
        right.plot(found["stokes"], found[name], "o-", color=color, markersize=3.5, label=name)
        draw_law(right, found["stokes"], found[name][-1], slope, color=color)
    logarithmic(label(right, "Stokes number St", "largest error of $L_z/I_e$")).legend()
    return figure


def verdict_first_order(data: Data) -> Verdict:
    """Fitted orders."""
    found = data["errors"]
    large = found["stokes"] >= 900
    fits = {
        name: power_law(found["stokes"][large], found[name][large]) for name in ("corrected", "averaged", "printed")
    }
    leading, printed = fits["averaged"][0], fits["printed"][0]
    constant = float(found["corrected"][-1] * found["stokes"][-1] ** 2)
    return Verdict(
        Word.CORRECTED,
        f"With the local, signed frequency and a shifted start the corrected error is {constant:.3g}/St² (the averaged "
        f"one falls like St^({leading:.2f})); as printed, with the mean frequency and the start unshifted, it "
        f"falls like St^({printed:.2f}).",
        f"κ = {KAPPA:g}, L along the vorticity, L_z0 = {MOMENTUM:g} I_e, θ₀ = {THETA:g}, φ₀ = {PHI:g}. Left: L_z at "
        f"St = {SHOWN:g}; right: largest errors up to t₂ = {SLOW_TIME:g}.",
        Number("order in St of the corrected error", fits["corrected"][0], -2.1, -1.9, "", fits["corrected"][1]),
        Number("order of the averaged error", leading, -1.1, -0.9, "", fits["averaged"][1]),
        Number("order with the correction as printed", printed, -1.1, -0.9, "", fits["printed"][1]),
        Number("corrected error × St², largest St", constant, 10.0, 2e3, "I_e"),
    )


SECTION = Section(
    "appendix",
    "Appendices: averages and first-order correction",
    (
        *ITEMS,
        Item(
            "first-order",
            "First-order correction of a spheroid",
            "With the O(1/St) oscillation of `lzsfod2` added, L_z agrees better with the full solution, down to "
            "smaller St.",
            compute_first_order,
            figure_first_order,
            verdict_first_order,
        ),
    ),
)
