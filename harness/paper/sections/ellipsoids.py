"""Triaxial ellipsoids at large St: singular fixed point, slow variables, L_z–E plane, projections.

The singular fixed point is the rotation about the middle axis, L_z = -I₂/2. "Local" is the solution
next to it, by `polhode.models.theory.separatrix`. Its coordinates are y, by `complement_of`, and the
"shift" L_z' = L_z + I₂/2. I₁ < I₂ < I₃ are the moments of inertia, from
the longest axis to the shortest. "Critical" is the one trajectory on each side of
L² = 2EI₂ that meets the point. Tables number the sides: 0 is long, L² < 2EI₂, before the point, 1
is short, after it. L and E are over I_max, times are slow times t/St, unless another unit is named.

In figures, heights of panels are in inches, and widths of lines and sizes of marks and letters in
points. They, the limits of axes and the heights of arrows in a plane are chosen by eye.

Ends of the ranges for which a verdict holds are estimates where their reasons do not give them.
"""

from dataclasses import dataclass
from itertools import pairwise, product
from math import sqrt
from operator import itemgetter
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from polhode.harness.common.text import in_two_digits, short
from polhode.harness.pages.figures.style import BLUE, ORANGE, VERMILLION
from polhode.harness.paper import plane_drawing, planes
from polhode.harness.paper.drawing import (
    AVERAGED,
    BLACK,
    BOUND,
    NODE,
    draw_each,
    key_above,
    name_line,
    panels,
    white_panes,
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
from polhode.harness.paper.runs import bisected, full_run, graded, slow_run, slow_scene, spheroid
from polhode.harness.paper.sections.planes import (
    PlanesOfBodies,
    plane_tables,
    reaching_node,
    reaching_pinch,
)
from polhode.harness.paper.sections.slow_motion import ACCURATE, SlowMotion, order_of_damping
from polhode.harness.paper.tables import SLOW, by, path, worst
from polhode.models.forms.averaged import Averaged
from polhode.models.operations import FLOAT
from polhode.models.scene import Scene
from polhode.models.scenes import PAPER_ELLIPSOID, PAPER_START, SADDLE_START, SPHEROID_START
from polhode.models.shape import Ellipsoid
from polhode.models.theory.fixed_points import fixed_points
from polhode.models.theory.separatrix import Separatrix, Side

_ELLIPSOID = Ellipsoid(PAPER_ELLIPSOID)
_UNIT = max(_ELLIPSOID.inertia)  # I_max, the unit of L and E.
_MIDDLE = sorted(_ELLIPSOID.inertia)[1] / _UNIT  # The middle moment of inertia over I_max.
_SIDES: tuple[Side, Side] = ("long", "short")
# Complementary parameter y = μ'δ, as the paper writes it, up to which local and averaged rates are
# compared. An estimate: the terms that the local solution neglects, of order y log(16/y), are 1e-2.
_NEAR_Y = 1e-3
# Largest y of the passage through the singular point: there the local solution is good to some
# 10 %.
_PASSAGE_Y = 0.1
# Slow time for which the averaged passage is followed, over the time by the local solution. The
# averaged passage takes longer by the relative order y: 1.2 covers y = 0.1, with a margin that is
# an estimate.
_PASSAGE_LONGER = 1.2


def complement_of(slow: np.ndarray, side: Side) -> np.ndarray:
    """y = 1 - m, shape (n,), of slow variables over I_max, shape (n, 4).

    m is the parameter of the elliptic functions of the polhode. y is 0 on L² = 2EI₂, and negative
    beyond it.
    """
    encircled, middle, opposite = _moments(side)
    momentum2 = np.sum(slow[:, :3] ** 2, axis=1)
    energy2 = 2 * slow[:, 3]
    return (
        (encircled - opposite)
        * (momentum2 - energy2 * middle)
        / ((encircled - middle) * (momentum2 - energy2 * opposite))
    )


def _moments(side: Side) -> tuple[float, float, float]:
    """Moments over I_max about the axis that the polhode encircles, the middle axis and the opposite one."""
    i1, i2, i3 = np.array(sorted(_ELLIPSOID.inertia)) / _UNIT
    return (i3, i2, i1) if side == "short" else (i1, i2, i3)


def state_of(local: Separatrix, complement: float, shift: float) -> list[float]:
    """Slow variables over I_max, with L_x = L_y = 0, at y (`complement`) and L_z' (`shift`).

    L_z' is not over I_max.
    """
    return (np.array(local.slow_state(complement, shift)) / _UNIT).tolist()


def _averaged_rates(local: Separatrix, complement: float, shift: float) -> tuple[float, float]:
    """Rates of y and L_z'/I_max by the averaged equations, at y and L_z' as of `state_of`."""
    state = state_of(local, complement, shift)
    problem = Averaged().problem(slow_scene(_ELLIPSOID, state, 1.0))
    # Rates of (L_x, L_y, L_z, E) over I_max.
    rates = np.array(problem.field(FLOAT)(problem.start, problem.parameters))
    _, _, momentum, energy = state
    _, _, momentum_rate, energy_rate = rates
    # By `complement_of` y is `scale` times the quotient of L² - 2EI₂ and L² - 2EI, I of the
    # opposite axis. The rates of both are exact, and the rule for quotients gives the rate of y. A
    # difference of two values of y would lose its digits, as y is small.
    encircled, middle, opposite = _moments(local.side)
    upper = momentum**2 - 2 * energy * middle
    lower = momentum**2 - 2 * energy * opposite
    upper_rate = 2 * momentum * momentum_rate - 2 * energy_rate * middle
    lower_rate = 2 * momentum * momentum_rate - 2 * energy_rate * opposite
    scale = (encircled - opposite) / (encircled - middle)
    growth = scale * (upper_rate * lower - upper * lower_rate) / lower**2
    return float(growth), float(momentum_rate)


def critical_start(complement: float, points: int) -> tuple[list[float], float]:
    """Start, at y on the long side, of the averaged trajectory that meets the singular point, and when.

    A bisection of L_z' at the start finds it: trajectories that start with more pass the point with
    more. The start has the slow variables over I_max. Runs have `points` rows. The last row before
    the point is compared with the critical L_z' at the same y. The local solution adds the remaining
    time.
    """
    local = Separatrix(_ELLIPSOID, "long")
    # 1.2 is as `_PASSAGE_LONGER`, which says why. The local time is negative on this side. From
    # y > 0.3, where the local time says little, the passage takes less than 0.3 of slow time. Both
    # numbers 0.3 are estimates.
    times = np.linspace(0.0, 0.3 if complement > 0.3 else -1.2 * local.time(complement), points)

    def before_point(shift: float) -> tuple[float, float, float]:
        """Time, y and L_z'/I_max in the last row on the long side."""
        slow = slow_run(_ELLIPSOID, state_of(local, complement, shift), times).slow
        complements = complement_of(slow, "long")
        beyond = complements <= 0
        last = int(np.argmax(beyond)) - 1 if beyond.any() else len(slow) - 1
        return float(times[last]), float(complements[last]), float(slow[last, 2] + _MIDDLE / 2)

    def meets_below(shift: float) -> bool:
        """Whether a start at this L_z' passes the point with no more L_z' than the critical one."""
        _, left, momentum = before_point(shift)
        return momentum <= local.critical(left) / _UNIT

    # The ends, L_z' = -1.5 and 0.3 I_max, lie far on either side of the critical start. 45 halvings
    # narrow the 1.8 I_max between them down to 5e-14.
    shift = bisected(meets_below, -1.5 * _UNIT, 0.3 * _UNIT, 45)
    time, left, _ = before_point(shift)
    return state_of(local, complement, shift), time - local.time(left)


def critical_before(complement: float, points: int, times_left: np.ndarray) -> np.ndarray:
    """The averaged trajectory that meets the singular point, at n decreasing slow times left to it.

    It starts at y on the long side: none of the times left is longer than from there. The result
    has the slow variables over I_max, shape (n, 4).
    """
    start, arrival = critical_start(complement, points)
    times = np.concatenate([[0.0], arrival - times_left])
    return slow_run(_ELLIPSOID, start, times).slow[1:]


def critical_after(slow_times: np.ndarray) -> np.ndarray:
    """The averaged trajectory that leaves the singular point, at n slow times after it, the first 0.

    The result has the slow variables over I_max, shape (n, 4).
    """
    local = Separatrix(_ELLIPSOID, "short")
    # y of the start, where the local solution holds: at y = 0 the averaged equations are singular.
    beside = 1e-9
    return slow_run(_ELLIPSOID, state_of(local, beside, local.critical(beside)), slow_times).slow


def passage_time(side: Side, points: int) -> float:
    """Slow time between y = `_PASSAGE_Y` and the singular point by the averaged equations.

    Runs have `points` rows.
    """
    if side == "long":
        return critical_start(_PASSAGE_Y, points)[1]
    times = np.linspace(
        0.0, _PASSAGE_LONGER * Separatrix(_ELLIPSOID, side).time(_PASSAGE_Y), points
    )
    complement = complement_of(critical_after(times), side)
    return float(np.interp(_PASSAGE_Y, complement, times))


def _passage(local: Separatrix, points: int) -> dict[str, np.ndarray]:
    """Critical trajectories, local and averaged: y and L_z'/I_max at slow times from the singular point.

    Columns of the table "trajectory", of `points` rows or one less. Times before the point are
    negative.
    """
    duration = abs(local.time(_PASSAGE_Y))
    if local.side == "long":
        # Without 0: at the singular point itself the averaged equations are singular.
        times_left = duration * np.linspace(1.0, 0.0, points)[:-1]
        # The averaged passage from `_PASSAGE_Y` takes longer than the local one, so that every time
        # left lies within it. Tenfold rows bring the last one before the point close to it.
        slow = critical_before(_PASSAGE_Y, 10 * points, times_left)
        times = -times_left
    else:
        times = np.linspace(0.0, duration, points)
        slow = critical_after(times)
    complement = np.array([local.complement(float(time)) for time in times])
    shifts = np.array([local.critical(value) for value in complement.tolist()])
    return {
        "t2": times,
        "local_y": complement,
        "averaged_y": complement_of(slow, local.side),
        "local_shift": shifts / _UNIT,
        "averaged_shift": slow[:, 2] + _MIDDLE / 2,
    }


@dataclass(frozen=True)
class SingularPoint(Experiment):
    """The passage through the rotation about the middle axis, local solution and averaged equations.

    Columns `local_…` are by the local solution, columns `averaged_…` by the averaged equations. In
    the table "rates" they have the rates of y and of L_z' ("shift"), in "trajectory" y and L_z'
    themselves along the critical trajectory. "times" has the slow times of the passage.
    """

    def compute(self, grid: Grid) -> Computed:
        """Rates near the singular point, local and averaged; the critical trajectory on either side.

        The numbers of rows, and the range of y, are estimates.
        """
        for number, side in enumerate(_SIDES):
            local = Separatrix(_ELLIPSOID, side)
            for complement in np.geomspace(1e-8, 0.3, grid.of(40, 14)).tolist():
                shift = local.critical(complement)
                growth, push = local.rates(complement, shift)
                averaged = _averaged_rates(local, complement, shift)
                rates = {
                    "local_y": growth,
                    "averaged_y": averaged[0],
                    "local_shift": push / _UNIT,
                    "averaged_shift": averaged[1],
                }
                yield "rates", {"side": number, "y": complement, "shift": shift / _UNIT, **rates}
            yield "trajectory", {"side": number, **_passage(local, grid.of(401, 101))}
            times = {
                "averaged": passage_time(side, grid.of(4001, 1001)),
                "local": abs(local.time(_PASSAGE_Y)),
            }
            yield "times", {"side": number, **times}

    def judge(self, data: Data) -> Verdict:
        """How local and averaged solution compare, and how long the passage takes."""
        rates = data["rates"]
        arriving, leaving = data["times"].averaged
        local = float(data["times"].local[0])
        smallest = rates.y.min()
        slowest = np.abs(rates.averaged_y[rates.y == smallest]).min()
        return Verdict(
            Word.CORRECTED,
            f"By the averaged equations the point is reached in t₂ = {arriving:.3g} from y = 0.1 "
            f"and left in {leaving:.3g}; the local solution gives {local:.3g} for both. The rates "
            "fall like 1/log(16/y), so slowly that dy/dt₂ is still "
            f"{slowest:.2g} at y = {in_two_digits(smallest)}. `muassol` as printed keeps "
            "y log(16/y) alone; with y log(16/y) + y the local solution is good to powers of y.",
            "The ellipsoid (1, 0.8, 0.5) near the rotation about its middle axis: above, the "
            "critical trajectory before and after the singular point; below, the rates along it. "
            "Dotted: local solution; lines: averaged equations.",
            self._numbers(data, smallest, slowest),
        )

    def _numbers(self, data: Data, smallest: float, slowest: float) -> list[Number]:
        """Rates, times and paths of the passage, local against averaged."""
        rates = data["rates"]
        trajectory = data["trajectory"]
        arriving, leaving = data["times"].averaged
        local = float(data["times"].local[0])
        close_rates = rates[rates.y <= _NEAR_Y]
        passage = Range.near(
            local, 0.1 * local, "the local solution, good to the relative order y = 0.1"
        )
        return [
            Number(
                f"local over averaged rate of y, worst, y ≤ {_NEAR_Y:g}",
                worst(close_rates.local_y / close_rates.averaged_y - 1),
                Range.at_most(1e-2, "the next term is of relative order y log(16/y)"),
            ),
            Number("slow time from y = 0.1 to the singular point", arriving, passage),
            Number("slow time from the singular point to y = 0.1", leaving, passage),
            Number(
                "local against averaged y along the passage",
                worst(trajectory.local_y - trajectory.averaged_y),
                Range.at_most(1e-2, "relative order y = 0.1 of y = 0.1"),
            ),
            Number(
                "local against averaged L_z' along the passage",
                worst(trajectory.local_shift - trajectory.averaged_shift),
                Range.at_most(1e-3, "relative order y = 0.1 of a shift of 1e-2"),
                "I_max",
            ),
            Number(
                f"rate of y at y = {in_two_digits(smallest)}, smaller side",
                slowest,
                Range(
                    1.0,
                    100.0,
                    "an inverse logarithm: 4.2 times below the rate at y = 0.1; a rate like √y would "
                    "be below 0.01",
                ),
            ),
        ]

    def draw(self, data: Data) -> Figure:
        """The passage above, the rates below."""
        trajectory = data["trajectory"]
        rates = data["rates"]
        figure, axes = panels(2, 2, 2.1)
        time = "slow time from the singular point"
        for panel, name in ((axes[0], "y"), (axes[1], "shift")):
            _draw_sides(panel, trajectory, "t2", f"averaged_{name}", f"local_{name}")
            panel.set_xlabel(time)
            panel.locator_params(nbins=5)
        name_line(axes[0], "local solution", color=AVERAGED, linestyle=":")
        axes[0].set_ylabel("$y = \\mu'\\delta$")
        key_above(figure, axes[0])
        axes[1].set_ylabel("$L_z'/I_{max}$")
        axes[1].ticklabel_format(axis="y", style="sci", scilimits=(-2, 2), useMathText=True)
        for panel, name in ((axes[2], "y"), (axes[3], "shift")):
            _draw_sides(panel, rates, "y", f"averaged_{name}", f"local_{name}", absolute=True)
            panel.set(xlabel="$y = \\mu'\\delta$", xscale="log")
        axes[2].set_ylabel("$|dy/dt_2|$")
        axes[3].set_ylabel("$|dL_z'/dt_2|/I_{max}$")
        return figure


def _draw_sides(
    axes: Axes, table: Table, x: str, averaged: str, local: str, absolute: bool = False
) -> None:
    """Averaged and local values of both sides."""
    size = np.abs if absolute else np.asarray
    draw_each(
        axes,
        table,
        "side",
        x,
        lambda rows: size(rows[averaged]),
        label=lambda side: f"averaged, $L^2 {'>' if side else '<'} 2EI_2$",
    )
    style: dict[str, Any] = {"colors": (BLACK,), "linestyle": ":", "linewidth": 1.6}
    draw_each(axes, table, "side", x, lambda rows: size(rows[local]), **style)


# Runs that measure the irregularity of the oscillation: their St, and the slow time that they are
# followed. Both are estimates.
_IRREGULAR_STOKES = 500.0
_IRREGULAR_SLOW_TIME = 0.1
# Errors after L² = 2EI₂ over those before, up to which passing it has little effect: an estimate.
_LITTLE_EFFECT = 2.0


@dataclass(frozen=True)
class FirstStart(SlowMotion):
    """The paper's first start, with what it says of the oscillation and of passing L² = 2EI₂."""

    def compute(self, grid: Grid) -> Computed:
        """Also how irregularly L_z swings, beside the paper's first spheroid, at one St."""
        yield from super().compute(grid)
        # 400 samples in each inverse shear rate, so that every turning point of L_z shows.
        times = np.linspace(0.0, _IRREGULAR_STOKES * _IRREGULAR_SLOW_TIME, 20001)
        for body, start in ((self.ellipsoid, self.start), (spheroid(2.0), SPHEROID_START)):
            scene = Scene(body, _IRREGULAR_STOKES, start, times[-1])
            yield "scatter", {"swings": _scatter(full_run(scene, times).slow[:, 2])}

    def judge(self, data: Data) -> Verdict:
        """The verdict on the start, and on the two further claims."""
        verdict = super().judge(data)
        errors = data["errors"]
        ellipsoid, spheroid_swing = np.exp(data["scatter"].swings)
        passing = errors.after / errors.before
        largest = max(self.shown)
        words = (
            " Over many starts with a crossing of L² = 2EI₂ the error falls more slowly than 1/St "
            "(averaging-order). Two swings of L_z that follow each other in the same direction "
            f"differ at St = {_IRREGULAR_STOKES:g} by a factor of {ellipsoid:.2f} in the median, "
            f"those of the spheroid by {spheroid_swing:.2f}. After L² = 2EI₂ the largest error is "
            f"{passing.min():.2g} to {passing.max():.2g} times the one before, St = "
            f"{short(min(self.shown))} to {short(errors.stokes[-1])}: little is taken as at most "
            f"{_LITTLE_EFFECT:g} times. Between starts with the same L and E the scatter grows more "
            "(crossing-jumps)."
        )
        numbers = [
            *verdict.numbers,
            Number(
                "irregularity of L_z's oscillation: median factor between neighbouring swings, "
                f"St = {_IRREGULAR_STOKES:g}",
                ellipsoid,
                Range(
                    spheroid_swing,
                    10.0 * spheroid_swing,
                    "the claim: more irregular than the spheroid's",
                ),
            ),
            Number("the same of the spheroid's first start", spheroid_swing),
            Number(
                f"largest error after L² = 2EI₂, St = {largest:g}",
                errors.after[errors.stokes == largest][0],
                Range.at_most(1e-2, "of the order of the error before, some 20/St"),
                "I_max",
            ),
            Number(
                "the same over the largest before, worst St",
                passing.max(),
                Range(0.0, _LITTLE_EFFECT, "what little is taken as"),
            ),
        ]
        return Verdict(verdict.earned, verdict.sentence + words, verdict.caption, numbers)


def _scatter(values: np.ndarray) -> float:
    """Median size of the logarithm of the ratio of a swing to the next one in the same direction.

    A swing is the change of a value from one turning point to the next. Every other one has the same
    direction.
    """
    # Rows at which the difference to the next row changes its sign.
    turning = np.flatnonzero(np.diff(np.sign(np.diff(values)))) + 1
    swings = np.abs(np.diff(values[turning]))
    return float(np.median(np.abs(np.log(swings[2:] / swings[:-2]))))


# Distance along L_z, over I_max, from the singular point where critical trajectories are compared:
# half of the magnified view. An estimate.
_CLOSE_TO_POINT = 2e-3
# Slow time for which the trajectory on the upper parabola is followed: later, rounding carries it
# off. An estimate.
_ON_EDGE = 0.25
# Half sizes along L_z and E of the magnified view of the singular point, over I_max: by eye.
_WINDOW = (0.004, 0.0016)


@dataclass(frozen=True)
class Plane(Experiment):
    """Slow trajectories in the L_z–E plane of the paper's ellipsoid."""

    def compute(self, grid: Grid) -> Computed:
        """Slow trajectories, and the critical one: local and averaged, on both sides of the singular point.

        The numbers of rows are estimates.
        """
        # Starts are pairs of L_z/I_max and the share, by `energy_at`, of E between its bounds. Shares go
        # from next to the lower parabola to next to the upper one. The last start lies on the upper one.
        # -1.1 is beyond the fixed points of L_z < 0, the farthest of which is at -0.5, and -0.08
        # between them and the pinch point. The values are estimates.
        shares = (0.001, 0.1, 0.2, 0.35, 0.5, 0.65, 0.8, 0.95, 0.999)[:: grid.of(1, 4)]
        starts = [*product((-1.1, -0.08, 1.1), shares)]
        starts.append((-1.1, 1.0))
        yield from plane_tables(_ELLIPSOID, starts, grid.of(2001, 601), _ON_EDGE, _kept)
        for number, side in enumerate(_SIDES):
            local = Separatrix(_ELLIPSOID, side)
            # From next to the point to y = 0.5, where the local solution is no longer good.
            complements = np.geomspace(1e-6, 0.5, 41).tolist()
            states = np.array([state_of(local, y, local.critical(y)) for y in complements])
            # Kind 0 is the local solution, kind 1 below the averaged one.
            yield "critical", {"kind": 0, "side": number, "Lz": states[:, 2], "E": states[:, 3]}
        # The averaged one starts far from the point, at y = 0.8, and is followed for a slow time of 0.5
        # after it. Its rows are dense near the point, where both are compared. Before the point, the
        # start and the point itself are left out. The numbers are estimates.
        _, arrival = critical_start(0.8, 4001)
        before = critical_before(0.8, 4001, arrival * np.linspace(1.0, 0.0, 1001)[1:-1] ** 2)
        for number, slow in enumerate((before, critical_after(graded(0.5, 401)))):
            yield "critical", {"kind": 1, "side": number, "Lz": slow[:, 2], "E": slow[:, 3]}

    def judge(self, data: Data) -> Verdict:
        """Ends of the trajectories; the error of the local critical one."""
        paths = by(data[""], "path")
        before = misfits(data["critical"], 0.0)
        after = misfits(data["critical"], 1.0)
        close_misfit = max(before.close, after.close)
        far_misfit = max(before.at_end, after.at_end)
        return Verdict(
            Word.CORRECTED,
            "All starts with L_z < 0 off the upper parabola reach the node, passing the singular "
            "point, one on it reaches the saddle; those with L_z > 0 meet the pinch point in a "
            "finite slow time, not an infinite one. The local critical trajectory agrees with the "
            f"averaged equations to {close_misfit:.1g} I_max while L_z is within {_CLOSE_TO_POINT:g} I_max "
            f"of the point, and is off by {far_misfit:.1g} I_max at y = 0.5.",
            f"L_z–E plane of the ellipsoid (1, 0.8, 0.5) with {len(paths)} slow trajectories of "
            "L_x = L_y = 0; right, around the singular point.",
            self._numbers(data, before, after),
        )

    def _numbers(self, data: Data, before: "Misfit", after: "Misfit") -> list[Number]:
        """The ends of trajectories, and the error of the local critical one."""
        ends = data["ends"]
        left = (ends.Lz0 < 0) & (ends.share < 1.0)
        pinch = np.max((ends.end / ends.bound)[ends.Lz0 > 0])
        paths = by(data[""], "path")
        on_edge = paths[float(np.argmax(ends.share == 1.0))]
        saddle = planes.fixed_point(_ELLIPSOID, "saddle")
        off_saddle = np.hypot(on_edge.Lz[-1] - saddle[0], on_edge.E[-1] - saddle[1])
        far_misfit = max(before.at_end, after.at_end)
        small = Range.at_most(
            2e-3, "relative order y ≤ 0.1 of a distance of 2e-3, tenfold for log(16/y)"
        )
        return [
            reaching_node(f"{np.sum(left)} starts with L_z < 0", ends.distance[left]),
            Number(
                "distance from the saddle where a start on the upper parabola ends",
                off_saddle,
                Range.at_most(5e-3, "what is left of the approach when the run ends"),
                "I_max",
            ),
            reaching_pinch(pinch),
            Number(
                "local against averaged critical trajectory, before the point",
                before.close,
                small,
                "I_max",
            ),
            Number("the same after the point", after.close, small, "I_max"),
            # The local trajectory of `compute` ends at y = 0.5.
            Number(
                "the same at the end of the local one, y = 0.5, worse side",
                far_misfit,
                Range(1e-3, 1e-1, "y = 0.5 is no small parameter"),
                "I_max",
            ),
        ]

    def draw(self, data: Data) -> Figure:
        """The plane, and the neighbourhood of the singular point."""
        figure, (whole, close) = panels(1, 2, 3.0)
        critical = data["critical"]
        for axes in (whole, close):
            plane_drawing.draw_frame(axes, _ELLIPSOID, -1.0, 1.0)
            plane_drawing.draw_paths(axes, data[""], (0.6, 0.2, 0.1))
            # The dashed local solution, kind 0, lies on top of the averaged one, kind 1.
            for kind, color, line, order in ((0, ORANGE, "--", 5), (1, VERMILLION, "-", 4)):
                style: dict[str, Any] = {
                    "colors": (color,),
                    "linestyle": line,
                    "linewidth": 2.0,
                    "zorder": order,
                }
                draw_each(axes, critical[critical.kind == kind], "side", "Lz", "E", **style)
        whole.set(ylim=(0.0, 0.8))
        plane_drawing.name_points(whole, plane_drawing.POINTS)
        plane_drawing.name_lines(whole, _ELLIPSOID, "$L_z^2 = 2EI_1, 2EI_3$")
        name_line(whole, "critical, averaged", color=VERMILLION, linewidth=2)
        name_line(whole, "critical, local solution", color=ORANGE, linewidth=2, linestyle="--")
        momentum, energy = planes.fixed_point(_ELLIPSOID, "singular")
        width, height = _WINDOW
        close.set(
            xlim=(momentum - width, momentum + width),
            ylim=(energy - height, energy + height),
            title="around the singular point",
        )
        close.locator_params(axis="x", nbins=4)
        key_above(figure, whole)
        return figure


def _kept(slow: np.ndarray) -> np.ndarray:
    """Indices of points at even steps, and of all points in or just outside the magnified view.

    `slow` has the slow variables over I_max, shape (n, 4).
    """
    # 250 points draw a trajectory smoothly. 1.2 views: a line that leaves the view is drawn up to its edge.
    inside = np.abs(slow[:, 2:] - planes.fixed_point(_ELLIPSOID, "singular")) < 1.2 * np.array(
        _WINDOW
    )
    return np.union1d(planes.plane_steps(slow, 250), np.flatnonzero(np.all(inside, axis=1)))


class Misfit(NamedTuple):
    """Distances in the L_z–E plane, over I_max, of the local critical trajectory from the averaged one."""

    close: float  # The largest within `_CLOSE_TO_POINT` of the singular point.
    at_end: float  # At the end of the local trajectory, y = 0.5.


def misfits(critical: Table, side: float) -> Misfit:
    """How far the local critical trajectory is off the averaged one on a side, 0 or 1 as in the tables."""
    kinds = by(by(critical, "side")[side], "kind")
    local = kinds[0.0]
    averaged = kinds[1.0]
    gaps = planes.distances(
        np.column_stack([local.Lz, local.E]), np.column_stack([averaged.Lz, averaged.E])
    )
    near_point = np.abs(local.Lz + _MIDDLE / 2) < _CLOSE_TO_POINT
    return Misfit(np.max(gaps[near_point]), gaps[-1])


@dataclass(frozen=True)
class EllipsoidPlanes(PlanesOfBodies):
    """Full and slow trajectories of six ellipsoids (1, b, c), in the order of `SIX_BODIES`."""

    def expected(self, differences: planes.Differences) -> list[Number]:
        """That the differences fall with St and grow with eccentricity."""
        low, high = planes.PLANE_STOKES
        ratios = [differences[low][name] / differences[high][name] for name in self.bodies]
        by_axes = {body.semi_axes: differences[low][name] for name, body in self.bodies.items()}
        # The bodies (1, b, c) have every pair of these b and c.
        b_axes = sorted({b for _, b, _ in by_axes})
        small_c, large_c = sorted({c for _, _, c in by_axes})
        thinner = [by_axes[1.0, b, small_c] / by_axes[1.0, b, large_c] for b in b_axes]
        narrower = []
        for c in (small_c, large_c):
            for small_b, large_b in pairwise(b_axes):
                narrower.append(by_axes[1.0, small_b, c] / by_axes[1.0, large_b, c])
        larger = Range(1.0, 10.0, "the claim: larger; ten would be more than the change of shape")
        return [
            Number(
                f"largest difference at St = {low:g}, worst body",
                max(differences[low].values()),
                Range(0.0, 0.1, "good agreement: a tenth of the plane's width at most"),
                "I_max",
            ),
            Number(
                f"the same at St = {high:g}",
                max(differences[high].values()),
                Range(0.0, 0.02, "too small to see in the plane"),
                "I_max",
            ),
            Number(
                f"difference at St = {low:g} over that at {high:g}, smallest",
                min(ratios),
                Range(5.0, 20.0, "theory: ten, the ratio of the two St, to first order"),
            ),
            Number("difference of c/a = 0.3 over that of 0.5, smallest", min(thinner), larger),
            Number(
                "the same of b/a = 0.55 over 0.75 and 0.75 over 0.95, smallest",
                min(narrower),
                larger,
            ),
        ]


# Largest |L_z|/I_max of the figure in three dimensions: the trajectories stay within it.
_SHOWN_LZ = 0.6


@dataclass(frozen=True)
class Space(Experiment):
    """Slow trajectories in the invariant subspaces L_x = 0 and L_y = 0."""

    def compute(self, grid: Grid) -> Computed:
        """One slow trajectory with L_x = 0 throughout and one with L_y = 0."""
        # A slow time of 1 takes both runs to the node to within 1e-3 I_max, which `judge` checks.
        slow_times = graded(1.0, grid.of(401, 101))
        # `zero` is the place, in (L_x, L_y, L_z, E), of the component that is 0: 1 for L_y, then 0
        # for L_x. The start has |L| = 1 and L_z = -0.2 I_max, and 0.7 is the share of E between its
        # bounds. The values are estimates.
        for zero in (1, 0):
            slow = np.array([0.0, 0.0, -0.2, planes.energy_at(_ELLIPSOID, 1.0, 0.7)])
            slow[1 - zero] = sqrt(1 - 0.2**2)
            yield "", path(zero, slow_times, slow_run(_ELLIPSOID, slow.tolist(), slow_times).slow)

    def judge(self, data: Data) -> Verdict:
        """That a component that is zero stays zero."""
        paths = by(data[""], "path")
        last = np.array([itemgetter(*SLOW)(rows[-1]) for rows in paths.values()])
        grown = max(worst(rows[SLOW[int(zero)]]) for zero, rows in paths.items())
        return Verdict(
            Word.CORRECTED,
            "A component L_x or L_y that is zero stays zero. The (L_x, L_z, E) space belongs to "
            "L_y = 0 and the other one to L_x = 0: the paper's text names them the other way "
            "round.",
            "Slow trajectories of (1, 0.8, 0.5) (blue) in the invariant subspaces L_y = 0 and "
            "L_x = 0, with projections (black) on the bounding surfaces, the paraboloid "
            "L² = 2EI₃ among them, and the fixed points.",
            [
                Number(
                    "largest |L_x| or |L_y| that starts at zero",
                    grown,
                    Range.at_most(1e-14, "rounding"),
                    "I_max",
                    floor=1e-14,
                ),
                Number(
                    "distance from the node at the end",
                    planes.distance_from_node(_ELLIPSOID, last).max(),
                    Range.at_most(1e-3, "what is left of the approach when the run ends"),
                ),
            ],
        )

    def draw(self, data: Data) -> Figure:
        """Both subspaces in three dimensions."""
        paths = by(data[""], "path")
        figure, axes = panels(1, 2, 2.7, spatial=[0, 1])
        for panel, zero in zip(axes, (1, 0), strict=True):
            self._draw_subspace(panel, paths[zero], zero)
        return figure

    def _draw_subspace(self, axes: Axes, rows: Table, zero: int) -> None:
        """The trajectory with L_x = 0 (`zero` = 0) or L_y = 0 (`zero` = 1)."""
        space: Any = axes  # Its methods for three dimensions are no part of Axes.
        # The component of L that is not 0, and a grid of it and L_z: the paraboloid E = L²/2I_max.
        name = ("Ly", "Lx")[zero]
        horizontal = np.linspace(0.0, 1.0, 16)[None]
        vertical = np.linspace(-_SHOWN_LZ, _SHOWN_LZ, 16)[:, None]
        paraboloid = (horizontal**2 + vertical**2) / 2
        space.plot_wireframe(horizontal, vertical, paraboloid, color=BOUND, linewidth=0.4)
        space.plot(rows[name], rows.Lz, rows.E, color=BLUE, linewidth=1.6)
        # Projections: on the paraboloid, on the plane where the component is 0, and on the wall of
        # L_z.
        thin = {"color": BLACK, "linewidth": 0.8}
        space.plot(rows[name], rows.Lz, (rows[name] ** 2 + rows.Lz**2) / 2, **thin)
        space.plot(0 * rows.E, rows.Lz, rows.E, **thin)
        space.plot(rows[name], np.full_like(rows.E, _SHOWN_LZ), rows.E, **thin)
        for point in fixed_points(_ELLIPSOID):
            place = planes.place_of(_ELLIPSOID, point)
            space.scatter(0.0, *place, color=NODE, edgecolor=BLACK, s=25)
        white_panes(space)
        space.set(
            xlabel=f"$L_{name[1]}/I_{{max}}$",
            ylabel="$L_z/I_{max}$",
            zlabel="$E/I_{max}$",
            ylim=(-_SHOWN_LZ, _SHOWN_LZ),
        )
        space.locator_params(nbins=4)
        space.set_title(f"$L_{'xy'[zero]} = 0$", y=1.0)
        space.view_init(22, 35)  # Elevation and azimuth of the viewer, in degrees.
        space.set_box_aspect((1, 1, 0.8), zoom=1.0)


# The bodies (1, b, c) of the paper's planes of ellipsoids: for each b, c = 0.5 and then 0.3.
SIX_BODIES = [Ellipsoid((1.0, b, c)) for b, c in product((0.55, 0.75, 0.95), (0.5, 0.3))]

# Slow times of `FirstStart` and `SlowMotion`, 0.6 and 1.2, are long enough to end at the node. The
# second start lingers at the saddle: its errors follow a power law only from St = 5000 on. The first
# St of the fit matters little for the first start: its exponent is -1.02, -1.06 and -1.18 from St = 500, 1000
# and 5000 on. "constant" is judged at the largest St, where the error times St is 14 and 15 I_max.
# `EllipsoidPlanes` has 151 points of each trajectory, enough to draw it.
ELLIPSOIDS_SECTION = Section(
    "ellipsoids",
    "Triaxial ellipsoids at large St",
    (
        Item(
            "singular-point",
            "Approach to the singular fixed point",
            "muassol, lzassol",
            "Rotation about the middle axis is reached and left in a finite time; the rates of μ' "
            "and L_z' go to zero there like an inverse logarithm, and the local solution "
            "describes them.",
            SingularPoint(),
        ),
        Item(
            "ellipsoid-slow-1",
            "Slow variables of an ellipsoid, first start",
            "large St, ellipsoids",
            "Full and slow solution agree well for the St chosen, and better with growing St; the "
            "oscillations are more irregular than a spheroid's; all end at L_z = -I₃/2, E = I₃/8; "
            "passing L² = 2EI₂ has little effect.",
            FirstStart(
                _ELLIPSOID,
                PAPER_START,
                0.6,
                fitted_from=1e3,
                constant=Range(8.0, 30.0, order_of_damping(_ELLIPSOID)),
                relative=Range(0.0, ACCURATE, "the claim: good for the St chosen"),
            ),
        ),
        Item(
            "ellipsoid-slow-2",
            "Slow variables of an ellipsoid, start near the saddle",
            "large St, ellipsoids",
            "The comparison is good for the St chosen, 100 to 5000, and better with growing St, "
            "with intermediate plateaus while the run lingers at the rotation about the longest "
            "axis.",
            SlowMotion(
                _ELLIPSOID,
                SADDLE_START,
                1.2,
                (100.0, 150.0, 500.0, 5e3),
                word=Word.CORRECTED,
                fitted_from=5e3,
                constant=Range(8.0, 30.0, order_of_damping(_ELLIPSOID)),
                relative=Range(
                    ACCURATE, 1.5, "the correction: not good at 100, by a factor below three"
                ),
                plateau=True,
            ),
        ),
        Item(
            "ellipsoid-plane",
            "The L_z–E plane of an ellipsoid",
            "large St, ellipsoids, the phase plane",
            "With L_x = L_y = 0 all slow trajectories with L_z < 0 but the critical one and the "
            "upper parabola go to the node; those with L_z > 0 reach the pinch point in infinite "
            "time; the local solution gives the critical trajectory.",
            Plane(),
        ),
        Item(
            "ellipsoid-planes",
            "Full and slow trajectories of six ellipsoids",
            "large St, ellipsoids, the phase planes",
            "The agreement is good for St ≳ 1000; deviations grow with eccentricity and shrink "
            "with growing St.",
            EllipsoidPlanes(tuple(enumerate(SIX_BODIES)), 151),
        ),
        Item(
            "ellipsoid-space",
            "Projections on three dimensions",
            "large St, ellipsoids, the projections",
            "If L_x or L_y is zero at the start it is zero for all times; starts with L_x = 0 "
            "move in (L_x, L_z, E), those with L_y = 0 in (L_y, L_z, E).",
            Space(),
        ),
    ),
)
