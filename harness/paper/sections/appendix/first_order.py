"""The appendices: the tables of averages, and the first-order correction of a spheroid."""

import numpy as np
from matplotlib.figure import Figure
from scipy.integrate import cumulative_simpson

from polhode.harness.paper.drawing import AVERAGED, CYCLE, ORANGE, SKY, label, logarithmic, panels
from polhode.harness.paper.item import Data, Grid, Item, Number, Section, Verdict, Word
from polhode.harness.paper.planes import columns
from polhode.harness.paper.runs import aligned_start, averaged_run, full_run, power_law, spheroid, spheroid_of
from polhode.harness.paper.sections.appendix.averages import ITEMS
from polhode.models.scene import Scene
from polhode.models.theory.spheroid_correction import CorrectedSpheroid
from polhode.solvers.solve import solve

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
    body, shape = spheroid(KAPPA), spheroid_of(KAPPA)
    scene = Scene(body, stokes, aligned_start(body, MOMENTUM * max(body.inertia), THETA, PHI), stokes * SLOW_TIME)
    slow_times = np.linspace(0.0, SLOW_TIME, points)
    form = CorrectedSpheroid()
    states = solve(form.problem(scene), "taylor", 1e-13, slow_times).states
    corrected = form.observe(scene, states).angular_momentum[:, 2] / max(body.inertia)
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
        law = found[name][-1] * (found["stokes"] / found["stokes"][-1]) ** slope
        right.plot(found["stokes"], law, ":", color=color, label=f"slope {slope}")
    logarithmic(label(right, "Stokes number St", "largest error of $L_z/I_e$")).legend()
    return figure


def verdict_first_order(data: Data) -> Verdict:
    """Fitted orders."""
    found = data["errors"]
    large = found["stokes"] >= 900
    leading, printed, corrected = (
        power_law(found["stokes"][large], found[name][large]) for name in ("averaged", "printed", "corrected")
    )
    constant = float(found["corrected"][-1] * found["stokes"][-1] ** 2)
    numbers = (
        Number(
            "order in St of the corrected error", corrected.exponent, -2.1, -1.9, "", (corrected.low, corrected.high)
        ),
        Number("order of the averaged error", leading.exponent, -1.1, -0.9, "", (leading.low, leading.high)),
        Number("order with the correction as printed", printed.exponent, -1.1, -0.9, "", (printed.low, printed.high)),
        Number("corrected error × St², largest St", constant, 10.0, 2e3, "I_e"),
    )
    sentence = (
        f"With the local, signed frequency and a shifted start the corrected error is {constant:.3g}/St² (the averaged "
        f"one falls like St^({leading.exponent:.2f})); as printed, with the mean frequency and the start unshifted, it "
        f"falls like St^({printed.exponent:.2f})."
    )
    caption = (
        f"κ = {KAPPA:g}, L along the vorticity, L_z0 = {MOMENTUM:g} I_e, θ₀ = {THETA:g}, φ₀ = {PHI:g}. Left: L_z at "
        f"St = {SHOWN:g}; right: largest errors up to t₂ = {SLOW_TIME:g}."
    )
    return Verdict(Word.CORRECTED, sentence, numbers, caption)


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
