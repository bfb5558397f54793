"""The appendices: the tables of averages against brute force, and the first-order correction.

The paper derives its averaged equations by tables of averages: means of products of the rotation
matrix over the motion of the free top. `SpheroidAverages` and `EllipsoidAverages` compute each mean
from many states of the motion, for random starts. They keep how far the printed formula, and the
corrected one, is off at most. `appendix_entries.py` has the formulas.

`FirstOrder` tests `lzsfod2`, the O(1/St) oscillation of L_z that the averaged solution lacks.
Names such as `lzsfod2` are labels of the paper's LaTeX source (docs/misprints.md).

In figures, heights of panels are in inches, and widths of lines and sizes of marks and letters in
points. They and the limits of axes are chosen by eye.

Ends of the ranges for which a verdict holds are estimates where their reasons do not give them.
"""

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import ceil, pi
from typing import Any

import numpy as np
from matplotlib.axes import Axes
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
from polhode.harness.paper.tables import Estimate, exponent
from polhode.models.forms.averaged import mean_squares
from polhode.models.forms.spheroid import Spheroid
from polhode.models.free_top.torque_free import TorqueFree
from polhode.models.operations import FLOAT
from polhode.models.rotation import matrix_from_euler, matrix_from_quaternion
from polhode.models.scenes import PAPER_ELLIPSOID
from polhode.models.shape import Ellipsoid
from polhode.models.theory.spheroid_correction import CorrectedSpheroid

# Largest deviation from brute force of a formula that holds: rounding in sums over states. An
# estimate: formulas that hold are off by 8e-15 at most (reports/paper/appendix.md), wrong ones by
# 0.5 and more.
_ROUNDING = 1e-11
# Smaller deviations, 0 among them, are drawn at this one: their axis is logarithmic.
_LEAST_DRAWN = 1e-17
# A table of as many entries or more has two columns on its figure. Any number between 8, the
# spheroid's entries, and 86, the ellipsoid's, would do.
_ONE_COLUMN = 12
# Height of that figure in inches, by eye: of an entry, and of what is above and below all entries.
_ENTRY_HEIGHT = 0.165
_MARGIN_HEIGHT = 0.9


def frame(momentum: np.ndarray) -> np.ndarray:
    """Axes aligned with L, as columns in space components, shape (3, 3): α_ij of `fodij`.

    The third one is along L, and the first one in the plane of flow and gradient. `momentum` has
    shape (3,), and is not along the vorticity, where the first one has no direction.
    """
    third = momentum / np.linalg.norm(momentum)
    first = np.array([third[1], -third[0], 0.0]) / np.hypot(third[0], third[1])
    return np.stack([first, np.cross(third, first), third], axis=1)


def ensemble(
    ellipsoid: Ellipsoid, momentum: np.ndarray, omega: np.ndarray, nodes: int
) -> np.ndarray:
    """Rotations t_ij through which the free top passes, over which the paper's averages are means.

    They are at equal times of the period T of the body's motion about L, and at each of these at
    equal angles of precession. Equal steps integrate periodic functions to rounding, if there are
    enough.

    Parameters
    ----------
    ellipsoid
        The body.
    momentum
        A vector along L, in space axes.
    omega
        Angular velocity at the start, in body axes.
    nodes
        Number of times in a period.

    Returns
    -------
    ndarray
        Rotation matrices, shape (8 `nodes`, 3, 3).
    """
    w1, w2, w3 = omega.tolist()
    top = TorqueFree(ellipsoid.inertia, (1.0, 0.0, 0.0, 0.0), (w1, w2, w3))
    quaternion, _ = top.at(top.period * np.arange(nodes) / nodes)
    body = matrix_from_quaternion(quaternion)
    # The top's own start has body axes along the space axes, where L has the components I_i ω_i.
    aligned = body @ frame(np.array(ellipsoid.inertia) * omega)
    # Eight angles of precession about L. They are exact for second and third moments, which are
    # trigonometric polynomials of at most degree three in the angle.
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
        """The deviations of the printed and of the corrected formulas, entry by entry."""
        table = data[""]
        columns = 1 if len(table) < _ONE_COLUMN else 2
        count = ceil(len(table) / columns)
        figure, axes = panels(1, columns, _MARGIN_HEIGHT + _ENTRY_HEIGHT * count)
        for place, panel in enumerate(axes):
            rows = table[place * count : (place + 1) * count]
            self._draw_entries(panel, rows)
            panel.set(
                xlabel="deviation from brute force",
                ylabel="average of",
                xscale="log",
                # From below `_LEAST_DRAWN` to above the largest deviation, of order 1.
                xlim=(1e-18, 10),
                xticks=(1e-16, 1) if columns > 1 else (1e-16, 1e-8, 1),
                # Entries are at 0, -1, …; a shorter last column leaves room below.
                ylim=(-count + 0.3, 0.7),
            )
        key_above(figure, axes[0])
        return figure

    def _draw_entries(self, axes: Axes, rows: Table) -> None:
        """Two marks for each entry, the first entry on top."""
        heights = -np.arange(len(rows))
        corrected = np.maximum(rows.corrected, _LEAST_DRAWN)
        printed = np.maximum(rows.printed, _LEAST_DRAWN)
        dots: dict[str, Any] = {"marker": "o", "markersize": 4, "color": BLUE}
        crosses: dict[str, Any] = {"marker": "x", "markersize": 5, "color": VERMILLION}
        axes.plot(corrected, heights, linestyle="none", label="corrected", **dots)
        axes.plot(printed, heights, linestyle="none", label="printed", **crosses)
        axes.set_yticks(heights, rows.entry.tolist(), fontsize=8.5)


_CAPTION = (
    "Entries of the table of averages, in its order: largest deviation from the brute-force "
    "average over random states."
)
_HOLDS = Range.at_most(_ROUNDING, "rounding in means over states")


@dataclass(frozen=True)
class SpheroidAverages(_Averages):
    """The averages over the precession of the symmetric top."""

    def compute(self, grid: Grid) -> Computed:
        """Largest deviation of every entry from the mean over the precession of the axis about L.

        It is the largest over random directions of L, and random cones about it.
        """
        # Any seed would do. The numbers of starts are estimates: a single start in general position
        # shows a wrong formula. Columns of `worst`: the printed formula, and the corrected one.
        generator = np.random.default_rng(3)
        # Angles of precession about L: 16 are more than moments of degree two need.
        angle = 2 * pi * np.arange(16) / 16
        entries = spheroid_entries()
        worst = np.zeros((len(entries), 2))
        for _ in range(grid.of(200, 40)):
            direction = generator.normal(size=3)
            direction /= np.linalg.norm(direction)
            # The component of the symmetry axis along L, and the radius of its circle about L.
            # Between 0.05 and 0.95, by estimate, neither is so small that a wrong term would hide.
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
        """Largest deviation of every entry from the brute-force mean, over random L and ω.

        L is random in its direction alone, as the space axes are; its size follows from ω.
        """
        # Any seed would do. The numbers of starts are estimates, as for spheroids.
        generator = np.random.default_rng(5)
        ellipsoid = Ellipsoid(PAPER_ELLIPSOID)
        entries = ellipsoid_entries()
        worst = np.zeros((len(entries), 2))
        means = mean_squares(FLOAT)
        for _ in range(grid.of(24, 6)):
            omega = generator.normal(size=3)
            direction = generator.normal(size=3)
            direction /= np.linalg.norm(direction)
            # L² and 2E, on which the mean squares z of the components along L depend.
            momentum2 = float(np.sum((ellipsoid.inertia * omega) ** 2))
            energy2 = float(np.sum(ellipsoid.inertia * omega**2))
            # 256 times of a period, an estimate, leave rounding alone. t is in space axes, u in
            # axes along L.
            t = ensemble(ellipsoid, direction, omega, 256)
            u = t @ frame(direction)
            z = np.array(means(momentum2, energy2, *ellipsoid.inertia))
            off = [entry.deviations(t, u, direction, z) for entry in entries]
            worst = np.maximum(worst, off)
        yield "", _deviations(entries, worst)

    def judge(self, data: Data) -> Verdict:
        """Which entries, and which general formulas, hold as printed.

        The table has 81 entries, each for given components, and 5 general formulas for all
        components of a kind.
        """
        table = data[""]
        is_wrong = table.printed > _ROUNDING
        is_general = np.array([name.startswith("general") for name in table.entry])
        wrong_entries = int(np.sum(is_wrong & ~is_general))
        wrong_formulas = [
            name.removeprefix("general ")
            for name in table.entry[is_wrong & is_general]
            if MIXED not in name
        ]
        return Verdict(
            Word.CORRECTED,
            f"{np.sum(~is_wrong & ~is_general)} of {np.sum(~is_general)} entries hold as printed. "
            f"The {wrong_entries} mixed third moments do not: they, and the general formula for "
            f"{MIXED} above them, lack α₃₃/2. "
            f"Of the {np.sum(is_general) - 1} other general formulas those for "
            f"{' and '.join(wrong_formulas)} contradict the entries below them, which are right. "
            f"Corrected, all agree to {in_two_digits(table.corrected.max())}.",
            _CAPTION,
            self._numbers(table, is_wrong, is_general),
        )

    def _numbers(self, table: Table, is_wrong: np.ndarray, is_general: np.ndarray) -> list[Number]:
        """The largest deviation, and how many entries and general formulas are wrong."""
        six = Range(6.0, 6.0, "the correction: the six mixed third moments and no other entry")
        three = Range(3.0, 3.0, "the correction: those with δ_i3, without α₃₃/2, without a square")
        wrong_and_mixed = np.isin(table.entry[is_wrong], mixed_names())
        return [
            Number(
                f"largest deviation of the {len(table)} formulas, corrected",
                table.corrected.max(),
                _HOLDS,
            ),
            Number(
                f"printed entries of {np.sum(~is_general)} that deviate",
                int(np.sum(is_wrong & ~is_general)),
                six,
            ),
            Number("the same among the mixed third moments", int(np.sum(wrong_and_mixed)), six),
            Number("general formulas that deviate", int(np.sum(is_wrong & is_general)), three),
        ]


def _deviations(entries: Sequence[Entry], worst: np.ndarray) -> dict[str, Any]:
    """Columns of a table of averages.

    `worst` has the largest deviations of each entry as printed and as corrected, shape (n, 2).
    """
    names = [entry.name for entry in entries]
    return {"entry": names, "printed": worst[:, 0], "corrected": worst[:, 1]}


# The spheroid and the start of the first-order correction, with L along the vorticity. The paper
# names κ alone. The other values are free, and chosen so that L, θ and φ are no special ones.
_KAPPA = 2.0  # Ratio of the symmetry axis to the other ones.
_MOMENTUM = -0.9  # L_z over I_e; the body is prolate, so that I_e is the largest moment of inertia.
_THETA = 0.9  # Rad.
_PHI = 0.6  # Rad.
_SLOW_TIME = 0.04  # Slow time of the runs. An estimate.
# St of the run that is shown, small enough that the oscillation is seen.
_SHOWN_STOKES = 200.0
# Smallest St of the fits of exponents: above it the errors follow power laws. An estimate,
# just below 1e3, which is one of the St computed, up to rounding.
_FITTED_STOKES = 900.0
# Solutions of `_first_order` whose errors are compared, with the color and the exponent in St of
# each, by theory.
_COMPARED = (("averaged", AVERAGED, -1), ("printed", SKY, -1), ("corrected", ORANGE, -2))


@dataclass(frozen=True)
class FirstOrder(Experiment):
    """The averaged solution of a spheroid with its O(1/St) oscillation added."""

    def compute(self, grid: Grid) -> Computed:
        """L_z in full, averaged and corrected at one St, and the largest errors against St.

        The table "errors" has the largest error along the run of each solution of `_COMPARED`, in
        units of I_e. The numbers of times and of St, and the range of St, are estimates.
        """
        yield "", {"t2": np.linspace(0.0, _SLOW_TIME, 401), **_first_order(_SHOWN_STOKES, 401)}
        for stokes in np.geomspace(1e2, 1e5, grid.of(13, 4)).tolist():
            runs = _first_order(stokes, grid.of(4001, 1001))
            full = runs.pop("full")
            errors = {name: np.max(np.abs(run - full)) for name, run in runs.items()}
            yield "errors", {"stokes": stokes, **errors}

    def judge(self, data: Data) -> Verdict:
        """How the errors fall with St."""
        errors = data["errors"]
        large = errors[errors.stokes >= _FITTED_STOKES]
        orders = {name: exponent(large.stokes, large[name]) for name, _, _ in _COMPARED}
        return Verdict(
            Word.SHARPENED,
            self._sentence(errors, orders),
            f"κ = {_KAPPA:g}, L along the vorticity, L_z0 = {_MOMENTUM:g} I_e, θ₀ = {_THETA:g}, "
            f"φ₀ = {_PHI:g}. Left: L_z at St = {_SHOWN_STOKES:g}; right: largest errors up to "
            f"t₂ = {_SLOW_TIME:g}.",
            self._numbers(errors, orders),
        )

    def _sentence(self, errors: Table, orders: Mapping[str, Estimate]) -> str:
        """The finding in words, from the errors by St and their exponents."""
        gain = errors.averaged / errors.printed
        # Smallest St at which the corrected solution is the better one.
        better = errors.stokes[errors.corrected < errors.printed][0]
        return (
            f"As printed the error is {gain[0]:.2g} times (St = {errors.stokes[0]:g}) to "
            f"{gain[-1]:.2g} times (St = {short(errors.stokes[-1])}) smaller than that of "
            f"averaging, but of the same order, St^({orders['printed']:.2f}) beside "
            f"St^({orders['averaged']:.2f}): the mean frequency and the unshifted start leave a "
            "part. With the local, signed frequency and a shifted start it is "
            f"{_constant(errors):.4g} I_e/St², smaller than as printed from "
            f"St = {in_two_digits(better)} on."
        )

    def _numbers(self, errors: Table, orders: Mapping[str, Estimate]) -> list[Number]:
        """The gain by the correction, exponents, and the size of the corrected error."""
        first_order = Range.near(-1.0, 0.1, "theory: first order")
        second_order = Range.near(-2.0, 0.1, "theory: second order")
        # The first two axes of `spheroid` are equatorial: 8πY/I_e, where Y is the resistance to
        # rotation about such an axis, Y_c in the paper.
        damping = spheroid(_KAPPA).damping[0]
        return [
            Number(
                "averaged error over that as printed, smallest",
                (errors.averaged / errors.printed).min(),
                Range(1.0, 100.0, "the claim: better; of the same order, so not by any factor"),
            ),
            Number(
                "order in St of the corrected error",
                float(orders["corrected"]),
                second_order,
                interval=orders["corrected"].interval,
            ),
            Number(
                "order of the averaged error",
                float(orders["averaged"]),
                first_order,
                interval=orders["averaged"].interval,
            ),
            Number(
                "order with the correction as printed",
                float(orders["printed"]),
                first_order,
                interval=orders["printed"].interval,
            ),
            Number(
                "corrected error × St², largest St",
                _constant(errors),
                Range(
                    10.0,
                    2e3,
                    f"of order (8πY/I_e)², here {damping**2:.0f}: St enters only as I_e St/(8πY); "
                    "the ends are estimates",
                ),
                "I_e",
            ),
        ]

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
        for name, color, slope in _COMPARED:
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

    def _draw_errors(self, axes: Axes, errors: Table, name: str, color: str, slope: int) -> None:
        """Errors of one solution, and the power law of theory through the last of them."""
        values = errors[name]
        axes.plot(errors.stokes, values, marker="o", color=color, markersize=3.5, label=name)
        draw_power(axes, errors.stokes, values[-1], slope, color=color)


def _constant(errors: Table) -> float:
    """The corrected error times St², over I_e, at the largest St."""
    return errors.corrected[-1] * errors.stokes[-1] ** 2


def _first_order(stokes: float, points: int) -> dict[str, np.ndarray]:
    """L_z/I_e by four solutions, at `points` equidistant slow times, shape (points,) each.

    "full" and "averaged" are runs of the two forms. "printed" subtracts from the averaged one the
    oscillation as the paper prints it. That has twice the angle of precession as its argument, and the
    paper computes the angle by the mean of L_z since the start. "corrected" is derived by
    `polhode.models.theory.spheroid_correction`.
    """
    shape = Spheroid.of(spheroid(_KAPPA))
    scene = aligned_scene(spheroid(_KAPPA), stokes, _MOMENTUM, _THETA, _SLOW_TIME, _PHI)
    slow_times = np.linspace(0.0, _SLOW_TIME, points)
    averaged = averaged_run(scene, slow_times)
    # The state is (L_x, L_y, L_z, η), L over I_e, with the spin η, the angular velocity about the
    # symmetry axis.
    momentum = averaged.states[:, 2]
    spin = averaged.states[:, 3]
    phase = cumulative_simpson(momentum, x=slow_times, initial=0.0)
    # At the start the mean is L_z itself.
    mean = np.concatenate([momentum[:1], phase[1:] / slow_times[1:]])
    # sin² of the angle between the symmetry axis and L, h̄² in the paper. The part of L along the axis
    # is I_a η, and `inertia_ratio` is I_a/I_e.
    tilt = 1 - (shape.inertia_ratio * spin / momentum) ** 2
    # `equatorial_damping` is 8πY_c/I_e, and `anisotropy` is (κ² - 1)/(κ² + 1): their product over 4
    # is the 2πY_c (κ² - 1)/(κ² + 1)/I_e of `lzsfod2`.
    amplitude = shape.equatorial_damping * shape.anisotropy * tilt / 4
    oscillation = amplitude / mean * np.sin(2 * (stokes * phase + _PHI)) / stokes
    # 1e-13, an estimate, is below the tolerance of the other runs, and far below the smallest
    # errors of "corrected", 1e-7.
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
