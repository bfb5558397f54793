"""Spheroids at finite St: period of tumbling, drift of spinning ones, planar flows that stop them.

The paper has the change of the period at small St (`vivtp`), the figure of the period, the drift in
its introduction, and planar flows in its discussion. κ is the ratio of the symmetry axis to the
other ones. A tumbling spheroid turns end over end about the vorticity, in the end on a limit cycle.
`polhode.models.theory.tumbling_period` finds that cycle and its period. All times are in inverse
shear rates.

In figures, heights of panels are in inches, and widths of lines and sizes of marks and letters in
points. They and the limits of axes are chosen by eye.

Ends of the ranges for which a verdict holds are estimates where their reasons do not give them.
"""

from dataclasses import dataclass
from functools import partial
from itertools import product
from math import inf, pi
from typing import Any, ClassVar

import numpy as np
from matplotlib.figure import Figure
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicHermiteSpline
from scipy.optimize import minimize_scalar

from polhode.harness.common.text import short
from polhode.harness.pages.figures.style import square_decades
from polhode.harness.paper.drawing import (
    BLACK,
    draw_each,
    draw_levels,
    draw_power,
    key_above,
    key_of,
    name_line,
    panels,
)
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
from polhode.harness.paper.runs import bisected, full_run, run_form, spheroid
from polhode.harness.paper.tables import by, exponent, groups, joined, worst
from polhode.models.catalogue import form as find_form
from polhode.models.forms.spheroid_axis import field
from polhode.models.forms.tumbling import Tumbling
from polhode.models.rotation import quaternion_from_euler
from polhode.models.scene import BodyStart, Scene
from polhode.models.theory.fixed_points import eigenvalues
from polhode.models.theory.tumbling_period import tumbling_period, weak_inertia_period_change
from polhode.solvers.compile import exact_jacobian

# Aspect ratios of the prolate spheroids whose period is followed: any will do, each twice as slender
# as the one before.
_PERIOD_KAPPAS = (2.0, 4.0, 8.0, 16.0)
# A tumbler turns about an equatorial axis.
_TUMBLING_AXIS = 0
# Share by which the law of order St² (`vivtp`) is off where it counts as lost: the paper names
# none, an estimate.
_LAW_LOST = 0.1


def _periods(stokes: np.ndarray) -> Computed:
    """Tumbling periods of each spheroid at each St, and how far they lie from Jeffery's.

    `change` is `period` less `jeffery`, Jeffery's period, and is negative. All three are in inverse
    shear rates.
    """
    for kappa, number in product(_PERIOD_KAPPAS, stokes.tolist()):
        period = tumbling_period(spheroid(kappa), number, _TUMBLING_AXIS)
        jeffery = tumbling_period(spheroid(kappa), 0.0, _TUMBLING_AXIS)
        row = {"kappa": kappa, "stokes": number, "period": period, "jeffery": jeffery}
        yield "", {**row, "change": period - jeffery}


def validity(rows: Table) -> float:
    """St at which the law of order St² is off by `_LAW_LOST`.

    `rows` are the rows of one κ in the table of `PeriodChange`, in increasing St.
    """
    error = np.abs(rows.change / rows.printed - 1)
    # Up to the first St at which the law is lost. ln St is interpolated in the error.
    last = int(np.argmax(error > _LAW_LOST))
    return float(np.exp(np.interp(_LAW_LOST, error[: last + 1], np.log(rows.stokes[: last + 1]))))


@dataclass(frozen=True)
class PeriodChange(Experiment):
    """Change of the period at small St against the printed law."""

    def compute(self, grid: Grid) -> Computed:
        """Periods, and the change that the law gives, `printed`.

        The range of St goes from where the law holds to where it is lost for all κ. It and the number
        of St are estimates.
        """
        for table, row in _periods(np.geomspace(1e-2, 1e4, grid.of(121, 25))):
            body = spheroid(row["kappa"])
            printed = weak_inertia_period_change(body, row["stokes"], _TUMBLING_AXIS)
            yield table, {**row, "printed": printed}

    def judge(self, data: Data) -> Verdict:
        """Size and sign of the change, and up to which St the law holds."""
        table = data[""]
        smallest = table.stokes.min()
        start = table[table.stokes == smallest]
        limits = [validity(rows) for _, rows in groups(table, "kappa")]
        # The aspect ratio from which on the St of `limits` only rise.
        falls = np.flatnonzero(np.diff(limits) <= 0)
        first_rising = _PERIOD_KAPPAS[falls[-1] + 1 if len(falls) else 0]
        return Verdict(
            Word.CORRECTED,
            "Value and sign of `vivtp` hold, but the period decreases where the text says that it "
            f"increases. The law is 10 % off at St = {joined(limits, '.2g')} for "
            f"κ = {joined(_PERIOD_KAPPAS)}, not at order unity, and the later the slenderer the "
            f"spheroid from κ = {first_rising:g} on.",
            "Left: decrease of the tumbling period below Jeffery's, at "
            f"{len(np.unique(table.stokes))} Stokes numbers from a collocated limit cycle; dotted, "
            "the law of order St². Right: the ratio of the two against St/κ².",
            [
                Number(
                    f"ΔT over the law, less one, at St = {short(smallest)}, worst κ",
                    worst(start.change / start.printed - 1),
                    Range.near(0.0, 2e-3, "the next term of the series is of order St² ≤ 1e-3"),
                ),
                Number(
                    "largest ΔT",
                    table.change.max(),
                    Range.at_most(0.0, "the period falls, as `vivtp` has it"),
                    "1/γ̇",
                ),
                Number(
                    f"St at which the law is 10 % off, κ = {_PERIOD_KAPPAS[0]:g}",
                    limits[0],
                    Range(10.0, 30.0, "an order of magnitude above unity, and still one number"),
                ),
                Number(
                    f"the same over that, κ = {_PERIOD_KAPPAS[-1]:g}",
                    limits[-1] / limits[0],
                    Range.at_least(1.0, "the claim: further the slenderer"),
                ),
            ],
        )

    def draw(self, data: Data) -> Figure:
        """The change against St, and over the law against St/κ²."""
        table = data[""]
        figure, (left, right) = panels(1, 2, 3.0, width_ratios=[2, 3])
        draw_each(
            left,
            table,
            "kappa",
            "stokes",
            lambda rows: -rows.change,
            label=lambda kappa: rf"$\kappa$ = {kappa:g}",
        )
        draw_each(left, table, "kappa", "stokes", lambda rows: -rows.printed, linestyle=":")
        name_line(left, "law of order St$^2$", color=BLACK, linestyle=":")
        left.set(
            xlabel="Stokes number St",
            ylabel=r"decrease of the period, $-\Delta T\,\dot\gamma$",
            xscale="log",
            yscale="log",
            xlim=(1e-2, 1e4),
            ylim=(1e-9, 1e3),
        )
        square_decades(left)
        key_above(figure, left)
        draw_each(
            right,
            table,
            "kappa",
            lambda rows: rows.stokes / rows.kappa**2,
            lambda rows: rows.change / rows.printed,
        )
        right.set(
            xlabel=r"St / $\kappa^2$",
            ylabel=r"$\Delta T$ over the law of order St$^2$",
            xscale="log",
            xlim=(1e-4, 1e2),
        )
        return figure


# Aspect ratios and St, from Jeffery's limit to the fall of the period, of runs in time. A choice.
_INTEGRATED = (
    (2.0, 0.1),
    (2.0, 1.0),
    (2.0, 10.0),
    (2.0, 100.0),
    (4.0, 1.0),
    (4.0, 100.0),
    (8.0, 200.0),
    (16.0, 1e3),
)


def _integrated_period(kappa: float, stokes: float) -> float:
    """Time of one turn, in inverse shear rates, by integration in time, after the transient.

    It is a check of `tumbling_period`, which finds the limit cycle without following it in time.
    """
    ellipsoid = spheroid(kappa)
    # Forty relaxation times leave e^-40 of the transient. After them 60κ are some nine Jeffery
    # periods, 2πκ each, of a slender spheroid: an estimate.
    settled = 40 * stokes / ellipsoid.damping[_TUMBLING_AXIS]
    # z' lies along the flow and y' along the vorticity, about which the spheroid turns at -½.
    start = BodyStart((0.5, 0.5, 0.5, 0.5), (0.0, -0.5, 0.0))
    # Rows 0.01 apart, and a tolerance about as tight as double precision allows, keep the error of
    # the period below the 1e-8 that `judge` allows.
    scene = Scene(ellipsoid, stokes, start, settled + 60 * kappa)
    times = np.concatenate([[0.0], np.arange(settled, scene.time, 0.01)])
    states = run_form(Tumbling(), scene, times, 1e-14).states
    # States are the angle, which falls, and its rate.
    angle = np.unwrap(states[1:, 0])
    rate = states[1:, 1]
    whole_turns = int((angle[0] - angle[-1]) / (2 * pi))
    # Times at which the angle has fallen by one turn, two turns and so on.
    passages = []
    for turn in range(1, whole_turns + 1):
        goal = angle[0] - 2 * pi * turn
        spline = CubicHermiteSpline(times[1:], angle - goal, rate)
        passages.append(spline.roots(extrapolate=False)[0])
    return float(np.mean(np.diff(passages)))


@dataclass(frozen=True)
class Period(Experiment):
    """The period from small to large St."""

    seconds: ClassVar[float] = 10.0

    def compute(self, grid: Grid) -> Computed:
        """Period at all St, and by integration in time at some.

        The range of St reaches both limits to 1e-6, which `judge` checks. The number of St is an
        estimate.
        """
        yield from _periods(np.geomspace(1e-3, 1e6, grid.of(73, 19)))
        for kappa, stokes in grid.of(_INTEGRATED, _INTEGRATED[1:4:2]):
            period = _integrated_period(kappa, stokes)
            difference = period / tumbling_period(spheroid(kappa), stokes, _TUMBLING_AXIS) - 1
            row = {"kappa": kappa, "stokes": stokes, "period": period, "difference": difference}
            yield "integrated", row

    def judge(self, data: Data) -> Verdict:
        """Both limits, and that the period only falls between them."""
        table = data[""]
        curves = [rows for _, rows in groups(table, "kappa")]
        # The table keeps the small change apart from the period, whose digits would not show it.
        small = worst([rows.change[0] / rows.jeffery[0] for rows in curves])
        large = worst([rows.period[-1] / (4 * pi) - 1 for rows in curves])
        rise = max(np.max(np.diff(rows.period) / rows.period[1:]) for rows in curves)
        smallest = f"{table.stokes.min():g}"
        largest = short(table.stokes.max())
        return Verdict(
            Word.CONFIRMED,
            "Between the limits the period falls monotonically; at St = "
            f"{smallest} it is Jeffery's to {small:.1g}, at St = {largest} it is 4π to "
            f"{large:.1g} for κ = {joined(_PERIOD_KAPPAS)}.",
            "Period of a tumbling prolate spheroid on its limit cycle, "
            f"κ = {joined(_PERIOD_KAPPAS)}, with Jeffery's period (dotted) and 4π (dashed); "
            "crosses: turns of runs in time.",
            [
                Number(
                    f"|T/4π - 1| at St = {largest}, worst κ",
                    large,
                    Range.at_most(1e-6, "the distance falls like 1/St² or faster"),
                ),
                Number(
                    f"|T/2π(κ+1/κ) - 1| at St = {smallest}, worst κ",
                    small,
                    Range.at_most(1e-6, "the change is of order St²"),
                ),
                Number(
                    "collocated against integrated period, relative",
                    worst(data["integrated"].difference),
                    Range.at_most(1e-8, "the error of the integration in time"),
                ),
                Number(
                    "largest relative rise of the period from one St to the next",
                    rise,
                    Range.at_most(1e-7, "the table keeps eight digits"),
                ),
            ],
        )

    def draw(self, data: Data) -> Figure:
        """Period against St."""
        table = data[""]
        figure, (axes,) = panels(1, 1, 4.3)
        draw_each(
            axes, table, "kappa", "stokes", "period", label=lambda kappa: rf"$\kappa$ = {kappa:g}"
        )
        draw_levels(axes, table, "kappa", "jeffery", linestyle=":", linewidth=0.8)
        integrated = data["integrated"]
        style: dict[str, Any] = {"color": BLACK, "marker": "+", "linestyle": "none", "zorder": 4}
        axes.plot(integrated.stokes, integrated.period, label="integrated in time", **style)
        axes.axhline(4 * pi, color=BLACK, linestyle="--", linewidth=0.8, label=r"$4\pi$ (free top)")
        name_line(axes, r"$2\pi(\kappa+1/\kappa)$ (Jeffery)", color=BLACK, linestyle=":")
        axes.set(
            xlabel="Stokes number St",
            ylabel=r"period $T\dot\gamma$",
            xscale="log",
            yscale="log",
        )
        ticks = (4, 8, 16, 32)
        axes.set_yticks([n * pi for n in ticks], [rf"${n}\pi$" for n in ticks])
        axes.minorticks_off()
        key_above(figure, axes)
        return figure


# Aspect ratios of the spheroids that spin about the vorticity: two oblate and two prolate ones.
_DRIFT_KAPPAS = (0.3, 0.5, 2.0, 4.0)
# The state of `spheroid-axis` is (L_x, L_y, L_z, p_x, p_y, p_z), p the symmetry axis: places of the
# components across the vorticity.
_ACROSS = [0, 1, 3, 4]
# A run in time gives the growth at one St too. Both numbers are estimates: St is small, and the
# tilt so small that its square, 1e-6, does not show in the rate.
_FOLLOWED_STOKES = 0.02
_FOLLOWED_TILT = 1e-3  # Rad, at the start.
# St between which the largest rate is looked for. `judge` checks it against the rates at all St.
_PEAK_STOKES = (5.0, 3000.0)


def spinning(kappa: float, stokes: float, tilt: float, time: float) -> Scene:
    """A spheroid that spins about its axis along the vorticity, but for a tilt in rad.

    It has the angular velocity of the ambient flow, -½. `time` is in inverse shear rates.
    """
    start = BodyStart(quaternion_from_euler((tilt, 0.0, 0.0)), (0.0, 0.0, -0.5))
    return Scene(spheroid(kappa), stokes, start, time)


def growth(kappa: float, stokes: float) -> float:
    """Rate at which a tilt of the axis grows, in shear rates: the largest real part of an eigenvalue.

    The eigenvalues belong to the equations linearized about the spinning motion.
    """
    problem = find_form("spheroid-axis").problem(spinning(kappa, stokes, 0.0, 1.0))
    # Both the state and the parameters of the form have six numbers.
    matrix = exact_jacobian(field, 6, 6)(np.array(problem.start), np.array(problem.parameters))
    return float(np.linalg.eigvals(matrix[np.ix_(_ACROSS, _ACROSS)]).real.max())


def followed_growth(kappa: float, stokes: float) -> float:
    """The rate of `growth` from a run: over one Jeffery period, after one that forgets the start."""
    half = pi * (kappa + 1 / kappa)  # Half a Jeffery period.
    times = half * np.array([0.0, 2.0, 4.0])
    run = full_run(spinning(kappa, stokes, _FOLLOWED_TILT, times[-1]), times)
    # The part of z' across the vorticity, at the start and after each period.
    _, after_one, after_two = np.linalg.norm(run.observables.rotation[:, 2, :2], axis=1)
    return float(np.log(after_two / after_one) / (2 * half))


def peak_of(kappa: float) -> float:
    """St at which the rate has its largest size."""
    low, high = np.log(_PEAK_STOKES)
    best = minimize_scalar(
        lambda logarithm: -abs(growth(kappa, float(np.exp(logarithm)))),
        bounds=(low, high),
        method="bounded",
        # An error of ln St: an estimate, far finer than `judge` and the figure need.
        options={"xatol": 1e-6},
    )
    return float(np.exp(best.x))


def printed_growth(kappa: float) -> float:
    """Rate × St at large St by the printed eigenvalues: the largest rate of L or of the tilt."""
    # The first two rates belong to L, the fourth one to the tilt's square.
    rates = eigenvalues(spheroid(kappa), 2)
    return max(*rates[:2], rates[3] / 2)


@dataclass(frozen=True)
class SpinDrift(Experiment):
    """How fast a spinning spheroid leaves the vorticity axis, or returns to it."""

    def compute(self, grid: Grid) -> Computed:
        """Growth at all St; its peak; at one small St from a run too.

        The range of St reaches the power laws at both ends, which `judge` checks. The number of St is
        an estimate.
        """
        numbers = np.geomspace(1e-4, 1e6, grid.of(61, 21)).tolist()
        for kappa in _DRIFT_KAPPAS:
            rates = [growth(kappa, stokes) for stokes in numbers]
            yield "", {"kappa": kappa, "stokes": numbers, "growth": rates}
            at_followed = growth(kappa, _FOLLOWED_STOKES)
            followed = followed_growth(kappa, _FOLLOWED_STOKES)
            yield "runs", {"kappa": kappa, "growth": at_followed, "followed": followed}
            peak = peak_of(kappa)
            yield "peaks", {"kappa": kappa, "stokes": peak, "growth": growth(kappa, peak)}

    def judge(self, data: Data) -> Verdict:
        """Exponents at both ends, the sign, and the rates that are printed."""
        curves = by(data[""], "kappa")
        peaks = data["peaks"]
        small = [rows.growth[0] / rows.stokes[0] for rows in curves.values()]
        return Verdict(
            Word.SHARPENED,
            "A small tilt of the axis from the vorticity grows (κ > 1) or decays (κ < 1) at "
            f"{joined(small, '.3g')} St for κ = {joined(_DRIFT_KAPPAS)} as St → 0. The rate has its "
            f"largest size at St = {joined(peaks.stokes, '.3g')} and then falls like 1/St, to the "
            "rates of the averaged equations: of the tilt, half the fourth eigenvalue printed for "
            "the spinning mode, or of L where that is slower.",
            "Rate at which the tilt of a spheroid that spins about its axis, along the vorticity, "
            "grows or decays: the largest real part of the equations linearized about it; dots: "
            "its largest size.",
            self._numbers(data),
        )

    def _numbers(self, data: Data) -> list[Number]:
        """Exponents at both ends, signs, and rates against two other computations."""
        curves = by(data[""], "kappa")
        runs = data["runs"]
        peaks = data["peaks"]
        slow = [
            exponent(rows.stokes[rows.stokes < 1e-2], np.abs(rows.growth[rows.stokes < 1e-2]))
            for rows in curves.values()
        ]
        fast = [
            exponent(rows.stokes[rows.stokes > 1e5], np.abs(rows.growth[rows.stokes > 1e5]))
            for rows in curves.values()
        ]
        large = [
            rows.growth[-1] * rows.stokes[-1] / printed_growth(kappa) - 1
            for kappa, rows in curves.items()
        ]
        signs = [np.sign(rows.growth[0]) == np.sign(kappa - 1) for kappa, rows in curves.items()]
        at_grid = [np.max(np.abs(rows.growth)) for rows in curves.values()]
        return [
            Number(
                "exponent in St below St = 0.01, off 1, worst κ",
                worst([slope - 1 for slope in slow]),
                Range.at_most(1e-2, "the claim's O(1/St) time; corrections are of order St"),
                floor=1e-7,
            ),
            Number(
                "share of κ with the sign of the claim at small St",
                float(np.mean(signs)),
                Range(1.0, 1.0, "the claim: prolate ones leave the axis, oblate ones return"),
                measure="four chosen κ",
            ),
            Number(
                f"the rate against a run in time, St = {_FOLLOWED_STOKES:g}, relative, worst κ",
                worst(runs.followed / runs.growth - 1),
                Range.at_most(1e-2, "the tilt's square, and what is left of the start"),
                floor=1e-5,
            ),
            Number(
                "largest rate over the largest at the grid's points, least of all κ",
                float(np.min(np.abs(peaks.growth) / np.array(at_grid))),
                Range(1.0, 1.05, "a peak lies above the grid's points, and near one of them"),
            ),
            Number(
                "exponent above St = 1e5, off -1, worst κ",
                worst([slope + 1 for slope in fast]),
                Range.at_most(2e-2, "corrections are of order 1/St"),
            ),
            Number(
                "rate × St at St = 1e6 over the printed eigenvalues', less one, worst κ",
                worst(large),
                Range.at_most(1e-3, "corrections are of order 1/St"),
            ),
        ]

    def draw(self, data: Data) -> Figure:
        """The rate against St, with both power laws."""
        table = data[""]
        peaks = data["peaks"]
        figure, (axes,) = panels(1, 1, 4.3)
        # Peaks are points of the curves: some are sharp.
        columns = ("kappa", "stokes", "growth")
        # NumPy's types say that names are None.
        names: Any = columns
        curves = np.rec.fromarrays(
            [np.concatenate([table[name], peaks[name]]) for name in columns], names=names
        )
        draw_each(
            axes,
            curves[np.lexsort([curves.stokes, curves.kappa])],
            "kappa",
            "stokes",
            lambda rows: np.abs(rows.growth),
            label=lambda kappa: rf"$\kappa$ = {kappa:g}, {'grows' if kappa > 1 else 'decays'}",
        )
        axes.plot(peaks.stokes, np.abs(peaks.growth), "o", color=BLACK, markersize=3)
        last = table[table.kappa == _DRIFT_KAPPAS[-1]]
        small = last[last.stokes < 1e-1]
        large = last[last.stokes > 1e3]
        # At twice the last curve, so that the lines do not lie on it.
        draw_power(axes, small.stokes, 2 * abs(small.growth[-1]), 1)
        draw_power(axes, large.stokes, 2 * abs(large.growth[-1]), -1, linestyle="--")
        axes.set(
            xlabel="Stokes number St",
            ylabel=r"rate of the tilt from the vorticity, $|\lambda|/\dot\gamma$",
            xscale="log",
            yscale="log",
        )
        square_decades(axes, fill=True)
        key_of(axes)
        return figure


# Aspect ratios and St of the planar flows: one oblate and two prolate spheroids, from without inertia
# to with much of it. A choice.
_PLANAR_KAPPAS = (0.5, 2.0, 4.0)
_PLANAR_STOKES = (0.0, 1.0, 10.0, 100.0)


def turns(kappa: float, stokes: float, alpha: float) -> bool:
    """Whether an axis in the plane of the flow u = y x̂ + αx ŷ goes on turning.

    α is 0 in simple shear and 1 in pure strain, in which nothing turns. With inertia the axis starts
    at full speed.
    """
    # The axis has the angle χ in the plane, and Λ = (κ² - 1)/(κ² + 1). Without inertia χ changes at
    # the rate (α - 1)/2 + Λ(1 + α)/2 cos 2χ; with it, the rate relaxes to this one.
    body = spheroid(kappa)
    slope = (kappa**2 - 1) / (kappa**2 + 1) * (1 + alpha) / 2

    def jeffery(angle: float) -> float:
        """The rate of the angle without inertia."""
        return (alpha - 1) / 2 + slope * np.cos(2 * angle)

    if stokes == 0:
        return abs(slope) < (1 - alpha) / 2
    damping = body.damping[0] / stokes

    def rates(_: float, state: np.ndarray) -> tuple[float, float]:
        """Rates of the state, the angle and its rate."""
        return state[1], damping * (jeffery(state[0]) - state[1])

    def stops(_: float, state: np.ndarray) -> float:
        """The event that ends the run: the rate of the angle is zero."""
        return state[1]

    stops.terminal = True  # pyright: ignore[reportFunctionMemberAccess]
    # Sixty relaxation times, and 300 inverse shear rates for turns that are slow: an estimate. So is
    # the tolerance, 1e-8, far below the 6e-5 to which α is found.
    end = 60 / damping + 300
    # The largest speed that the flow gives an axis without inertia.
    start = (0.0, (alpha - 1) / 2 - abs(slope))
    return solve_ivp(rates, (0.0, end), start, "DOP853", rtol=1e-8, events=stops).status == 0


@dataclass(frozen=True)
class PlanarFlows(Experiment):
    """Which planar flows stop a spheroid."""

    seconds: ClassVar[float] = 2.0

    def compute(self, grid: Grid) -> Computed:
        """The α above which turning ends, by bisection."""
        for kappa, stokes in product(_PLANAR_KAPPAS, _PLANAR_STOKES):
            # Down to rounding where turning has a closed form, to 6e-5 where it takes a run.
            halvings = 50 if stokes == 0 else grid.of(14, 9)
            threshold = bisected(partial(turns, kappa, stokes), 0.0, 1.0, halvings)
            printed = min(kappa, 1 / kappa) ** 2
            row = {"kappa": kappa, "stokes": stokes, "threshold": threshold, "printed": printed}
            yield "", row

    def judge(self, data: Data) -> Verdict:
        """The thresholds at St = 0 as printed, and that inertia only raises them."""
        table = data[""]
        without_inertia = table[table.stokes == 0]
        thresholds = {kappa: rows.threshold for kappa, rows in groups(table, "kappa")}
        words = "; ".join(
            f"{joined(values, '.3g')} for κ = {kappa:g}" for kappa, values in thresholds.items()
        )
        return Verdict(
            Word.CONFIRMED,
            "Without inertia the thresholds are those printed, by Jeffery's rate in closed form. "
            "Inertia that carries an axis past the point where it would stop raises them at large "
            f"St: at St = {joined(_PLANAR_STOKES)} they are {words}.",
            "Largest α for which an axis in the plane of the flow u = y x̂ + αx ŷ goes on turning, "
            "from a start at more than its largest speed; dotted: as printed, for St = 0.",
            [
                Number(
                    "threshold at St = 0 less the printed one, worst κ",
                    worst(without_inertia.threshold - without_inertia.printed),
                    Range.at_most(1e-9, "50 halvings, kept in eight digits"),
                ),
                Number(
                    "least change of a threshold from one St to the next",
                    min(np.diff(values).min() for values in thresholds.values()),
                    Range(
                        -1e-3, inf, "inertia never stops a body earlier; the last halving's width"
                    ),
                ),
                Number("largest threshold", table.threshold.max()),
            ],
        )

    def draw(self, data: Data) -> Figure:
        """Thresholds against St."""
        table = data[""]
        figure, (axes,) = panels(1, 1, 4.1)
        draw_each(
            axes,
            table,
            "kappa",
            "stokes",
            "threshold",
            label=lambda kappa: rf"$\kappa$ = {kappa:g}",
            marker="o",
        )
        style: dict[str, Any] = {"color": "0.4", "linestyle": ":", "linewidth": 0.8}
        draw_levels(axes, table, "kappa", "printed", **style)
        # Linear up to St = 1, as 0 has no place on a logarithmic axis.
        axes.set_xscale("symlog", linthresh=1.0)
        axes.set(
            xlabel="Stokes number St",
            ylabel=r"largest $\alpha$ of turning",
            xlim=(-0.2, 150.0),
            ylim=(0.0, 1.0),
        )
        key_of(axes)
        return figure


PERIODS_SECTION = Section(
    "periods",
    "Spheroids at finite St: periods, drift, planar flows",
    (
        Item(
            "period-change",
            "Change of the period at small St",
            "vivtp",
            "Weak inertia increases the period of a tumbling prolate spheroid over Jeffery's by "
            "the O(St²) of `vivtp`; it holds up to St of order unity, and further the slenderer "
            "the spheroid.",
            PeriodChange(),
        ),
        Item(
            "period",
            "Period against St",
            "fig. of the period",
            "The period goes from Jeffery's 2π(κ + 1/κ) to 4π, whatever the aspect ratio, as St "
            "grows.",
            Period(),
        ),
        Item(
            "spin-drift",
            "Drift of a spinning spheroid, from small to large St",
            "introduction",
            "At small St inertia makes a prolate spheroid drift to the plane of the flow and an "
            "oblate one to the vorticity axis, on a time of O(1/St).",
            SpinDrift(),
        ),
        Item(
            "planar-flows",
            "Planar flows that stop a spheroid",
            "discussion of planar linear flows",
            "In planar linear flows a spheroid goes on turning as long as α < κ² (oblate), 1/κ² "
            "(prolate).",
            PlanarFlows(),
        ),
    ),
)
