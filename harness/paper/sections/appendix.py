"""The appendices: the tables of averages, entry by entry against brute force, and the first-order correction.

The averages are means of products of the rotation matrix over the motion of the free top, by which
the averaged equations are derived. The correction is `lzsfod2`, the O(1/St) oscillation of L_z.
"""

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil, pi
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from scipy.integrate import cumulative_simpson

from polhode.harness.common.text import in_two_digits, short
from polhode.harness.pages.figures.style import BLUE, ORANGE, SKY, VERMILLION, square_decades
from polhode.harness.paper.drawing import AVERAGED, draw_power, key_above, key_of, panels
from polhode.harness.paper.item import (
    Computed,
    Data,
    Experiment,
    Grid,
    Item,
    Number,
    Range,
    Section,
    Table,
    Verdict,
    Word,
)
from polhode.harness.paper.planes import aligned_scene
from polhode.harness.paper.runs import averaged_run, full_run, run_form, spheroid
from polhode.harness.paper.sections.appendix_entries import (
    MIXED,
    Entry,
    ellipsoid_entries,
    mixed_names,
    spheroid_entries,
)
from polhode.harness.paper.tables import exponent
from polhode.models.forms.averaged import mean_squares
from polhode.models.forms.spheroid import Spheroid
from polhode.models.free_top.torque_free import TorqueFree
from polhode.models.operations import FLOAT
from polhode.models.rotation import matrix_from_euler, matrix_from_quaternion
from polhode.models.scenes import PAPER_ELLIPSOID
from polhode.models.shape import Ellipsoid
from polhode.models.theory.spheroid_correction import CorrectedSpheroid

# Deviation from brute force up to which a formula holds: what rounding makes of sums over states.
_ROUNDING = 1e-11
# Deviations below this one are drawn at it, on a logarithmic axis.
_LEAST_DRAWN = 1e-17
# Entries of a table from which on its figure has two columns.
_ONE_COLUMN = 12


def frame(momentum: np.ndarray) -> np.ndarray:
    """α_ij: columns are the axes aligned with L, the third one along it, in space components (`fodij`)."""
    third = momentum / np.linalg.norm(momentum)
    first = np.array([third[1], -third[0], 0.0]) / np.hypot(third[0], third[1])
    return np.stack([first, np.cross(third, first), third], axis=1)


def ensemble(
    ellipsoid: Ellipsoid, momentum: np.ndarray, omega: np.ndarray, nodes: int
) -> np.ndarray:
    """Rotations t_ij, shape (n, 3, 3), at equal times of a period T of the Euler top and equal angles of precession.

    `momentum` gives the direction of L in space, `omega` the angular velocity in body axes at the
    start, `nodes` the number of times. Means over the rotations are then averages of the paper:
    equal steps integrate periodic functions to rounding, if there are enough.
    """
    w1, w2, w3 = omega.tolist()
    top = TorqueFree(ellipsoid.inertia, (1.0, 0.0, 0.0, 0.0), (w1, w2, w3))
    quaternion, _ = top.at(top.period * np.arange(nodes) / nodes)
    body = matrix_from_quaternion(quaternion)
    aligned = body @ frame(np.array(ellipsoid.inertia) * omega)
    # Eight angles are exact for the second and third moments: these are trigonometric polynomials of
    # degree three in the angle of precession.
    turns = matrix_from_euler(np.outer(2 * pi * np.arange(8) / 8, (0, 1, 0)))
    return np.einsum("nij,pjk,lk->npil", aligned, turns, frame(momentum)).reshape(-1, 3, 3)


@dataclass(frozen=True)
class _Averages(Experiment):
    """A table of averages, each entry against the brute-force mean over random states."""

    @abstractmethod
    def compute(self, grid: Grid) -> Computed:
        """Largest deviation of every entry, printed and corrected."""

    @abstractmethod
    def judge(self, data: Data) -> Verdict:
        """Which entries hold."""

    def draw(self, data: Data) -> Figure:
        """The deviations, entry by entry."""
        table = data[""]
        columns = 1 if len(table) < _ONE_COLUMN else 2
        count = ceil(len(table) / columns)
        figure, axes = panels(1, columns, 0.9 + 0.165 * count)
        for place, panel in enumerate(axes):
            rows = table[place * count : (place + 1) * count]
            heights = -np.arange(len(rows))
            style: dict[str, Any] = {"linestyle": "none"}
            right = np.maximum(rows.corrected, _LEAST_DRAWN)
            panel.plot(
                right, heights, marker="o", color=BLUE, markersize=4, label="corrected", **style
            )
            printed = np.maximum(rows.printed, _LEAST_DRAWN)
            panel.plot(
                printed,
                heights,
                marker="x",
                color=VERMILLION,
                markersize=5,
                label="printed",
                **style,
            )
            panel.set_yticks(heights, rows.entry.tolist(), fontsize=8.5)
            panel.set(
                xlabel="deviation from brute force",
                ylabel="average of",
                xscale="log",
                xlim=(1e-18, 10),
                xticks=(1e-16, 1) if columns > 1 else (1e-16, 1e-8, 1),
                ylim=(-count + 0.3, 0.7),
            )
        key_above(figure, axes[0])
        return figure


_CAPTION = (
    "Entries of the table of averages, in its order: largest deviation from the brute-force "
    "average over random states."
)
_HOLDS = Range.at_most(_ROUNDING, "rounding in means over states")


@dataclass(frozen=True)
class SpheroidAverages(_Averages):
    """The averages over the precession of the symmetric top."""

    def compute(self, grid: Grid) -> Computed:
        """Largest deviation of every entry from the mean over the precession, over random L and cones."""
        generator = np.random.default_rng(3)
        # Angles of precession about L: 16 are more than the moments of degree two need.
        angle = 2 * pi * np.arange(16) / 16
        entries = spheroid_entries()
        worst = np.zeros((len(entries), 2))
        for _ in range(grid.of(200, 40)):
            direction = generator.normal(size=3)
            direction /= np.linalg.norm(direction)
            height = generator.uniform(0.05, 0.95)
            width = np.sqrt(1 - height**2)
            circle = [width * np.sin(angle), -width * np.cos(angle), np.full(16, height)]
            axis = frame(direction) @ np.stack(circle)
            square = np.array([height**2])
            off = [entry.deviations(axis, axis, direction, square) for entry in entries]
            worst = np.maximum(worst, off)
        yield "", _deviations(entries, worst)

    def judge(self, data: Data) -> Verdict:
        """Whether all entries hold as printed."""
        table = data[""]
        wrong = int(np.sum(table.printed > _ROUNDING))
        return Verdict(
            Word.CONFIRMED,
            f"All {len(table)} entries agree with the average to "
            f"{in_two_digits(table.corrected.max())}.",
            _CAPTION,
            [
                Number(
                    f"largest deviation of the {len(table)} formulas", table.corrected.max(), _HOLDS
                ),
                Number(
                    f"printed entries of {len(table)} that deviate",
                    wrong,
                    Range(0.0, 0.0, "the claim: all hold"),
                ),
            ],
        )


@dataclass(frozen=True)
class EllipsoidAverages(_Averages):
    """The second and third moments of the rotation matrix over the Euler top."""

    def compute(self, grid: Grid) -> Computed:
        """Largest deviation of every entry, printed and corrected, from the brute-force mean."""
        generator = np.random.default_rng(5)
        ellipsoid = Ellipsoid(PAPER_ELLIPSOID)
        entries = ellipsoid_entries()
        worst = np.zeros((len(entries), 2))
        means = mean_squares(FLOAT)
        for _ in range(grid.of(24, 6)):
            omega = generator.normal(size=3)
            direction = generator.normal(size=3)
            direction /= np.linalg.norm(direction)
            momentum2 = float(np.sum((ellipsoid.inertia * omega) ** 2))
            energy2 = float(np.sum(ellipsoid.inertia * omega**2))
            t = ensemble(ellipsoid, direction, omega, 256)
            u = t @ frame(direction)
            z = np.array(means(momentum2, energy2, *ellipsoid.inertia))
            off = [entry.deviations(t, u, direction, z) for entry in entries]
            worst = np.maximum(worst, off)
        yield "", _deviations(entries, worst)

    def judge(self, data: Data) -> Verdict:
        """Which entries, and which general formulas, hold as printed."""
        table = data[""]
        wrong = table.printed > _ROUNDING
        general = np.array([name.startswith("general") for name in table.entry])
        failed = int(np.sum(wrong & ~general))
        mixed = int(np.sum(np.isin(table.entry[wrong], mixed_names())))
        wrong_formulas = [
            name.removeprefix("general ")
            for name in table.entry[wrong & general]
            if MIXED not in name
        ]
        six = Range(6.0, 6.0, "the correction: the six mixed third moments and no other entry")
        return Verdict(
            Word.CORRECTED,
            f"{np.sum(~wrong & ~general)} of {np.sum(~general)} entries hold as printed. The "
            f"{failed} mixed third moments do not: they, and the general formula for {MIXED} above "
            f"them, lack α₃₃/2. Of the {np.sum(general) - 1} other general formulas those for "
            f"{' and '.join(wrong_formulas)} contradict the entries below them, which are right. "
            f"Corrected, all agree to {in_two_digits(table.corrected.max())}.",
            _CAPTION,
            [
                Number(
                    f"largest deviation of the {len(table)} formulas, corrected",
                    table.corrected.max(),
                    _HOLDS,
                ),
                Number(f"printed entries of {np.sum(~general)} that deviate", failed, six),
                Number("the same among the mixed third moments", mixed, six),
                Number(
                    "general formulas that deviate",
                    int(np.sum(wrong & general)),
                    Range(
                        3.0, 3.0, "the correction: those with δ_i3, without α₃₃/2, without a square"
                    ),
                ),
            ],
        )


def _deviations(entries: Sequence[Entry], worst: np.ndarray) -> dict[str, Any]:
    """A table's columns, from the largest deviations of printed and corrected entries, shape (n, 2)."""
    names = [entry.name for entry in entries]
    return {"entry": names, "printed": worst[:, 0], "corrected": worst[:, 1]}


# Runs of the first-order correction.
_KAPPA = 2.0
_MOMENTUM = -0.9  # L_z over I_e at the start.
_THETA = 0.9  # Rad, at the start.
_PHI = 0.6  # Rad, at the start.
_SLOW_TIME = 0.04  # Slow time that they are followed.
# St of the run that is shown.
_SHOWN_STOKES = 200.0
# Smallest St of the fits.
_FITTED_STOKES = 900.0


@dataclass(frozen=True)
class FirstOrder(Experiment):
    """The averaged solution of a spheroid with its O(1/St) oscillation added."""

    def compute(self, grid: Grid) -> Computed:
        """L_z in full, averaged and corrected at one St; the largest error against St."""
        yield "", {"t2": np.linspace(0.0, _SLOW_TIME, 401), **_first_order(_SHOWN_STOKES, 401)}
        for stokes in np.geomspace(1e2, 1e5, grid.of(13, 4)).tolist():
            runs = _first_order(stokes, grid.of(4001, 1001))
            full = runs.pop("full")
            errors = {name: np.max(np.abs(run - full)) for name, run in runs.items()}
            yield "errors", {"stokes": stokes, **errors}

    def judge(self, data: Data) -> Verdict:
        """How the errors fall with St."""
        errors = data["errors"]
        gain = errors.averaged / errors.printed
        large = errors[errors.stokes >= _FITTED_STOKES]
        orders = {
            name: exponent(large.stokes, large[name])
            for name in ("averaged", "printed", "corrected")
        }
        constant = errors.corrected[-1] * errors.stokes[-1] ** 2
        better = errors.stokes[errors.corrected < errors.printed][0]
        first = Range.near(-1.0, 0.1, "theory: first order")
        return Verdict(
            Word.SHARPENED,
            f"As printed the error is {gain[0]:.2g} times (St = {errors.stokes[0]:g}) to "
            f"{gain[-1]:.2g} times (St = {short(errors.stokes[-1])}) smaller than that of "
            f"averaging, but of the same order, St^({orders['printed']:.2f}) beside "
            f"St^({orders['averaged']:.2f}): the mean frequency and the unshifted start leave a "
            "part. With the local, signed frequency and a shifted start it is "
            f"{constant:.4g} I_e/St², smaller than as printed from St = {in_two_digits(better)} "
            "on.",
            f"κ = {_KAPPA:g}, L along the vorticity, L_z0 = {_MOMENTUM:g} I_e, θ₀ = {_THETA:g}, "
            f"φ₀ = {_PHI:g}. Left: L_z at St = {_SHOWN_STOKES:g}; right: largest errors up to "
            f"t₂ = {_SLOW_TIME:g}.",
            [
                Number(
                    "averaged error over that as printed, smallest",
                    gain.min(),
                    Range(1.0, 100.0, "the claim: better; of the same order, so not by any factor"),
                ),
                Number(
                    "order in St of the corrected error",
                    float(orders["corrected"]),
                    Range.near(-2.0, 0.1, "theory: second order"),
                    interval=orders["corrected"].interval,
                ),
                Number(
                    "order of the averaged error",
                    float(orders["averaged"]),
                    first,
                    interval=orders["averaged"].interval,
                ),
                Number(
                    "order with the correction as printed",
                    float(orders["printed"]),
                    first,
                    interval=orders["printed"].interval,
                ),
                Number(
                    "corrected error × St², largest St",
                    constant,
                    Range(
                        10.0, 2e3, "of order (8πY/I)³, the cube of the damping, over the rotation"
                    ),
                    "I_e",
                ),
            ],
        )

    def draw(self, data: Data) -> Figure:
        """L_z at one St; errors against St."""
        table = data[""]
        errors = data["errors"]
        figure, (left, right) = panels(1, 2, 3.1)
        left.plot(table.t2, table.full, color=BLUE, linewidth=2.0, label="full")
        left.plot(table.t2, table.averaged, color=AVERAGED, label="averaged")
        text = "with first-order correction"
        left.plot(table.t2, table.corrected, color=ORANGE, linestyle="--", label=text)
        left.set(xlabel="slow time $t_2$", ylabel="$L_z/I_e$", title=f"St = {_SHOWN_STOKES:g}")
        key_of(left)
        for name, color, slope in (
            ("averaged", AVERAGED, -1),
            ("printed", SKY, -1),
            ("corrected", ORANGE, -2),
        ):
            self._draw_errors(right, errors, name, color, slope)
        right.set(
            xlabel="Stokes number St",
            ylabel="largest error of $L_z/I_e$",
            xscale="log",
            yscale="log",
        )
        square_decades(right, fill=True)
        key_of(right)
        return figure

    def _draw_errors(self, axes: Any, errors: Table, name: str, color: str, slope: int) -> None:
        """Errors of one solution, and the power law that they follow."""
        values = errors[name]
        axes.plot(errors.stokes, values, marker="o", color=color, markersize=3.5, label=name)
        draw_power(axes, errors.stokes, values[-1], slope, color=color)


def _first_order(stokes: float, points: int) -> dict[str, np.ndarray]:
    """L_z/I_e of the full and the averaged run, with the correction as printed, and corrected.

    The printed correction subtracts an oscillation at twice the angle of precession, for which it
    takes the mean of L_z since the start. `polhode.models.theory.spheroid_correction` derives the
    corrected one. Arrays have `points` values, at equal slow times.
    """
    shape = Spheroid.of(spheroid(_KAPPA))
    scene = aligned_scene(spheroid(_KAPPA), stokes, _MOMENTUM, _THETA, _SLOW_TIME, _PHI)
    slow_times = np.linspace(0.0, _SLOW_TIME, points)
    averaged = averaged_run(scene, slow_times)
    momentum = averaged.states[:, 2]
    spin = averaged.states[:, 3]
    phase = cumulative_simpson(momentum, x=slow_times, initial=0.0)
    # At the start the mean is L_z itself.
    mean = np.concatenate([momentum[:1], phase[1:] / slow_times[1:]])
    tilt = 1 - (shape.inertia_ratio * spin / momentum) ** 2
    amplitude = shape.equatorial_damping * shape.anisotropy * tilt / 4
    oscillation = amplitude / mean * np.sin(2 * (stokes * phase + _PHI)) / stokes
    return {
        "full": full_run(scene, stokes * slow_times).slow[:, 2],
        "averaged": averaged.slow[:, 2],
        "printed": momentum - oscillation,
        "corrected": run_form(CorrectedSpheroid(), scene, slow_times, 1e-13).slow[:, 2],
    }


APPENDIX_SECTION = Section(
    "appendix",
    "Appendices: averages and first-order correction",
    (
        Item(
            "averages-spheroid",
            "Table of averages, spheroid",
            "appendix, spheroid",
            "Eight averages over the precession of the symmetric top.",
            SpheroidAverages(),
        ),
        Item(
            "averages-ellipsoid",
            "Table of averages, ellipsoid",
            "appendix, ellipsoid",
            "Second and third moments of the rotation matrix over the Euler top: 81 entries, with "
            "general formulas.",
            EllipsoidAverages(),
        ),
        Item(
            "first-order",
            "First-order correction of a spheroid",
            "lzsfod2",
            "With the O(1/St) oscillation of `lzsfod2` added, L_z agrees better with the full "
            "solution, down to smaller St.",
            FirstOrder(),
        ),
    ),
)
