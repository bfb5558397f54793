"""Questions beyond the paper: averaging's error, crossings of L² = 2EI₂, the saddle, basins.

All are of the paper's ellipsoid (1, 0.8, 0.5). A crossing is the passage of a run over the
separatrix of the free top, from wobbling about the longest axis (L² < 2EI₂) to wobbling about the
shortest. The first item answers the paper's remark on resonances. The node is the stable fixed point of
the averaged equations, the saddle the rotation about the longest axis. A fast phase is the angle of
the nutation or of the precession: averaged equations do not know it.

In figures, heights of panels are in inches, and widths of lines and sizes of marks and letters in
points. They and the limits of axes are chosen by eye.

Ends of the ranges for which a verdict holds are estimates where their reasons do not give them.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product
from math import pi, sqrt
from typing import Any, ClassVar, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from scipy import optimize, stats

from polhode.harness.common.text import in_two_digits, short
from polhode.harness.pages.figures.style import BLUE, GREEN, SKY, VERMILLION, power, square_decades
from polhode.harness.paper.drawing import (
    AVERAGED,
    BLACK,
    YELLOW,
    draw_broken,
    draw_each,
    draw_power,
    key_of,
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
from polhode.harness.paper.planes import distance_from_node, energy_at
from polhode.harness.paper.runs import averaged_run, full_run, graded, slow_run
from polhode.harness.paper.tables import (
    SLOW,
    Estimate,
    by,
    exponent,
    groups,
    joined,
    mean,
    root_mean_squares,
    share,
    worst,
)
from polhode.models.free_top.torque_free import TorqueFree
from polhode.models.rotation import quaternion_from_euler
from polhode.models.scene import BodyStart, EulerStart, Scene
from polhode.models.scenes import PAPER_ELLIPSOID, PAPER_START
from polhode.models.shape import Ellipsoid
from polhode.models.theory.fixed_points import fixed_points

_ELLIPSOID = Ellipsoid(PAPER_ELLIPSOID)
# Sides of L² = 2EI₂, by the axis about which the free body wobbles: L² > 2EI₂ about the shortest,
# L² < 2EI₂ about the longest. The column `side` of tables has the index: 0 does not cross, 1 does.
_SIDES = ("short", "long")
# Slow time up to which the order of averaging is measured: all starts of the long side cross before
# it. An estimate, which `compute` checks.
_ORDER_TIME = 0.1
# Faster than Taylor series over these numbers of turns. Taylor series hardly converge where a run
# grazes L² = 2EI₂.
_FAST_SOLVER = "cyrk-vern8"
# Smallest St of the fits of the order, an estimate: just below the third one that is computed.
_ASYMPTOTIC = 9e4
# Starts lie between these shares of the way from the lower to the upper bound of L²/2E on their
# side. Starts of the long side are close to L² = 2EI₂ and cross it soon. Estimates.
_SHARES = {"short": (0.2, 0.8), "long": (0.6, 0.9)}


def random_start(generator: np.random.Generator, side: str) -> BodyStart:
    """Random orientation and rotation on one side of L² = 2EI₂, one of `_SIDES`.

    The start is clear of L² = 2EI₂ and of the permanent rotations (`_SHARES`). Its speed |ω| = 0.8, in
    shear rates, is any of order one.
    """
    inertia = np.array(_ELLIPSOID.inertia)
    i1, i2, i3 = np.sort(inertia)
    low, high = (i2, i3) if side == "short" else (i1, i2)
    least, most = _SHARES[side]
    while True:
        omega = generator.normal(size=3)
        omega *= 0.8 / np.linalg.norm(omega)
        # L²/2E: it lies between the smallest and the largest moment of inertia.
        ratio = np.sum((inertia * omega) ** 2) / np.sum(inertia * omega**2)
        if least < (ratio - low) / (high - low) < most:
            q = generator.normal(size=4)
            return BodyStart(tuple((q / np.linalg.norm(q)).tolist()), tuple(omega.tolist()))


def same_slow_start(start: BodyStart | EulerStart, generator: np.random.Generator) -> BodyStart:
    """Another start with the same L and E: the free top at a random time.

    L and E are all that averaged equations know of a start; the other phases of nutation and
    precession are what they do not know.
    """
    top = TorqueFree(_ELLIPSOID.inertia, start.quaternion, start.angular_velocity)
    # Inverse shear rates: long against the periods of both phases, so that these come out evenly
    # spread.
    quaternion, omega = top.at([generator.uniform(50.0, 500.0)])
    return BodyStart(tuple(quaternion[0].tolist()), tuple(omega[0].tolist()))


def above_middle(slow: np.ndarray) -> np.ndarray:
    """Whether L² > 2EI₂, shape (n,), for slow variables (L_x, L_y, L_z, E) over I_max, shape (n, 4)."""
    middle = sorted(_ELLIPSOID.inertia)[1] / max(_ELLIPSOID.inertia)
    return np.sum(slow[:, :3] ** 2, axis=1) > 2 * slow[:, 3] * middle


def start_exponents(part: Table) -> np.ndarray:
    """Exponent p of error ∝ St^p for each start, fitted from `_ASYMPTOTIC` on.

    `part` has the rows of one side in the table of `AveragingOrder`.
    """
    large = part[part.stokes >= _ASYMPTOTIC]
    return np.array([exponent(run.stokes, run.error) for _, run in groups(large, "start")])


def typical_errors(part: Table) -> np.ndarray:
    """Geometric mean of the error over starts, at each St; `part` as of `start_exponents`."""
    return np.array(
        [np.exp(np.mean(np.log(stokes_rows.error))) for _, stokes_rows in groups(part, "stokes")]
    )


def two_laws(stokes: np.ndarray, errors: np.ndarray) -> tuple[float, float]:
    """a and b of errors ((a/St)² + b²/St)^½, in the units of the errors.

    They are a jump and a scattering, which add up as independent ones do. `stokes` and `errors` have
    a value for each St, shape (n,).
    """
    # The squared error is linear in a² and b². Divided by it, all St count with relative misfits.
    laws = np.stack([stokes**-2, 1 / stokes], axis=1) / errors[:, None] ** 2
    jump, scattering = np.sqrt(optimize.nnls(laws, np.ones(len(stokes)))[0]).tolist()
    return jump, scattering


def local_exponents(part: Table) -> list[Estimate]:
    """Mean over starts of the exponents between neighbouring St; `part` as of `start_exponents`."""
    runs = (np.diff(np.log([run.stokes, run.error])) for _, run in groups(part, "start"))
    exponents = [errors / steps for steps, errors in runs]
    return [mean(column) for column in np.transpose(exponents)]


@dataclass(frozen=True)
class AveragingOrder(Experiment):
    """How the error of first-order averaging falls with St, over random starts."""

    seconds: ClassVar[float] = 60.0

    def compute(self, grid: Grid) -> Computed:
        """Largest error of L and E, over I_max, of the averaged form: a row for each side, start and St.

        The numbers of rows, starts and St, and the range of St, are estimates.
        """
        # Any seed would do.
        generator = np.random.default_rng(11)
        slow_times = np.linspace(0.0, _ORDER_TIME, 3001)
        # Stokes numbers, and below them the starts of each side: without a crossing, and more with
        # one, whose errors scatter more.
        numbers = np.geomspace(1e4, grid.of(3e6, 3e5), grid.of(6, 4)).tolist()
        numbers += grid.of([1e7], [])
        for side, (name, count) in enumerate(zip(_SIDES, grid.of((16, 64), (4, 8)), strict=True)):
            for index in range(count):
                start = random_start(generator, name)
                scene = Scene(_ELLIPSOID, 1.0, start, _ORDER_TIME)
                averaged = averaged_run(scene, slow_times, solver=_FAST_SOLVER).slow
                if side and not above_middle(averaged)[-1]:
                    message = f"start {index} does not cross L² = 2EI₂ by t₂ = {_ORDER_TIME:g}"
                    raise RuntimeError(message)
                for stokes in numbers:
                    scene = Scene(_ELLIPSOID, stokes, start, stokes * _ORDER_TIME)
                    full = full_run(scene, stokes * slow_times, solver=_FAST_SOLVER)
                    error = np.max(np.abs(full.slow - averaged))
                    yield "", {"side": side, "start": index, "stokes": stokes, "error": error}

    def judge(self, data: Data) -> Verdict:
        """The exponent without a crossing, and the two laws with one."""
        laws = Laws.of(data[""])
        return Verdict(
            Word.MEASURED,
            laws.sentence(),
            f"Largest error of L and E of the averaged form up to t₂ = {_ORDER_TIME:g}; "
            f"{len(laws.single)} random starts without and {laws.starts} with a crossing, "
            "|ω| = 0.8. Two laws: √((a/St)² + b²/St).",
            self._numbers(laws),
        )

    def _numbers(self, laws: "Laws") -> list[Number]:
        """Exponents, and how well the two laws fit.

        Widths of ranges, 0.1 or 0.15 in an exponent, allow for a few St and a finite number of starts.
        """
        low, high = laws.free.interval
        return [
            Number(
                "exponent without a crossing",
                float(laws.free),
                Range.near(-1.0, 0.1, "theory: first order"),
                interval=(low, high),
            ),
            Number(
                "slowest fall of a single start, without",
                laws.single.max(),
                Range(-1.2, -0.2, "errors of all starts fall; one may be near a resonance"),
            ),
            Number(
                "exponent with a crossing between the two smallest St",
                float(laws.local[0]),
                Range.near(-1.0, 0.15, "theory: the jump, of order 1/St, rules at small St"),
                interval=laws.local[0].interval,
            ),
            Number(
                "the same between the two largest St",
                float(laws.local[-1]),
                Range.near(float(laws.foreseen[-1]), 0.15, "the two laws"),
                interval=laws.local[-1].interval,
            ),
            Number(
                "largest relative distance of the typical error from the two laws",
                laws.misfit,
                Range.at_most(0.1, "the scatter of a mean over the starts"),
            ),
            Number(
                "the same from the best power of St",
                laws.straight,
                Range(2 * laws.misfit, 1.0, "a single power is the poorer law"),
            ),
            Number(
                "the two laws fitted without the largest St, off there",
                laws.ahead,
                Range.at_most(0.2, "twice the misfit allowed"),
            ),
            Number(
                "b without over b with a crossing",
                laws.calm / laws.scattering,
                Range(0.0, 0.3, "theory: the scattering belongs to the crossing"),
            ),
            Number(
                "root mean square with a crossing over St^-½ ln St, last over first St",
                laws.growth,
                Range(0.0, 1.0, "theory: St^-½ ln St is an upper bound"),
            ),
        ]

    def draw(self, data: Data) -> Figure:
        """Errors of single starts and their means, without and with a crossing."""
        laws = Laws.of(data[""])
        figure, axes = panels(1, 2, 3.4, sharey=True)
        titles = ("no crossing of $L^2 = 2EI_2$", "crossing $L^2 = 2EI_2$")
        for panel, rows, size, title in zip(
            axes, (laws.without, laws.crossing), laws.sizes, titles, strict=True
        ):
            style: dict[str, Any] = {"color": SKY, "linewidth": 0.5, "label": "single starts"}
            draw_broken(panel, rows.stokes, rows.error, rows.start, **style)
            line: dict[str, Any] = {"color": BLUE, "linewidth": 2.0, "marker": "o", "markersize": 4}
            panel.plot(laws.stokes, size, label="root mean square", **line)
            panel.set(
                xlabel="Stokes number St",
                ylabel="largest error of L and E$/I_{max}$",
                title=title,
                xscale="log",
                yscale="log",
            )
        falling = laws.sizes[0][0] * laws.stokes[0] / laws.stokes[-1]
        draw_power(axes[0], laws.stokes, falling, -1)
        axes[1].plot(
            laws.stokes,
            laws.typical,
            "o",
            color=GREEN,
            markersize=4,
            label="geometric mean",
        )
        axes[1].plot(laws.stokes, laws.fitted, color=BLACK, linewidth=0.9, label="two laws")
        bound = laws.bound * laws.sizes[1][-1] / laws.bound[-1]
        text = r"$\mathrm{St}^{-1/2}\,\ln\,$St"
        axes[1].plot(laws.stokes, bound, linestyle="--", color=VERMILLION, label=text)
        for panel in axes:
            square_decades(panel, fill=True)
            key_of(panel)
        return figure


@dataclass(frozen=True)
class Laws:
    """Laws of averaging's errors in St, without and with a crossing of L² = 2EI₂.

    "Free" and "calm" are values without a crossing. Arrays have a value for each St, or, if
    "between neighbouring St", one less; `single` has one for each start without a crossing.
    """

    without: Table
    crossing: Table
    stokes: np.ndarray
    sizes: list[np.ndarray]  # Root mean squares without and with a crossing.
    typical: np.ndarray  # Geometric means with a crossing.
    single: np.ndarray  # Exponents of the starts without a crossing.
    free: Estimate  # The mean of `single`.
    local: list[Estimate]  # Exponents between neighbouring St, with a crossing.
    jump: float  # a of the two laws √((a/St)² + b²/St), with a crossing; over I_max.
    scattering: float  # b of the two laws, with a crossing; over I_max.
    calm: float  # b of the two laws without a crossing; over I_max.

    @classmethod
    def of(cls, table: Table) -> "Laws":
        """The laws of the item's table."""
        without = table[table.side == 0]
        crossing = table[table.side == 1]
        stokes, calm_size = root_mean_squares(without, "stokes", "error")
        _, size = root_mean_squares(crossing, "stokes", "error")
        typical = typical_errors(crossing)
        jump, scattering = two_laws(stokes, typical)
        _, calm = two_laws(stokes, typical_errors(without))
        single = start_exponents(without)
        return cls(
            without=without,
            crossing=crossing,
            stokes=stokes,
            sizes=[calm_size, size],
            typical=typical,
            single=single,
            free=mean(single),
            local=local_exponents(crossing),
            jump=jump,
            scattering=scattering,
            calm=calm,
        )

    @property
    def starts(self) -> int:
        """Starts with a crossing."""
        return len(by(self.crossing, "start"))

    @property
    def bound(self) -> np.ndarray:
        """Neishtadt's and Okunev's bound, but for a factor."""
        return np.log(self.stokes) / np.sqrt(self.stokes)

    @property
    def fitted(self) -> np.ndarray:
        """The two laws at the St of the table."""
        return np.hypot(self.jump / self.stokes, self.scattering / np.sqrt(self.stokes))

    @property
    def foreseen(self) -> np.ndarray:
        """Exponents between neighbouring St by the two laws."""
        return np.diff(np.log(self.fitted)) / np.diff(np.log(self.stokes))

    @property
    def misfit(self) -> float:
        """Largest relative distance of the typical errors from the two laws."""
        return worst(self.fitted / self.typical - 1)

    @property
    def straight(self) -> float:
        """The same from the best power of St."""
        logarithm = np.log(self.stokes)
        law = np.polyfit(logarithm, np.log(self.typical), 1)
        return worst(np.exp(np.polyval(law, logarithm)) / self.typical - 1)

    @property
    def ahead(self) -> float:
        """Relative distance at the largest St of the two laws fitted without it."""
        jump, scattering = two_laws(self.stokes[:-1], self.typical[:-1])
        last = self.stokes[-1]
        return abs(np.hypot(jump / last, scattering / np.sqrt(last)) / self.typical[-1] - 1)

    @property
    def growth(self) -> float:
        """The root mean square with a crossing over the bound, last over first St."""
        ratio = self.sizes[1] / self.bound
        return float(ratio[-1] / ratio[0])

    def sentence(self) -> str:
        """The finding in words."""
        low, high = self.free.interval
        # Starts without a crossing whose error falls like 1/St, to 0.05 in the exponent.
        regular = int(np.sum(np.abs(self.single + 1) < 0.05))
        # St at which both terms of the two laws are equal.
        even = (self.jump / self.scattering) ** 2
        return (
            f"From St = {in_two_digits(_ASYMPTOTIC)} on the largest error without a crossing falls "
            f"like St^({self.free:.3f}), the mean over {len(self.single)} starts: υ = "
            f"{1 + self.free:.2f} (95 %: {1 + low:.2f} … {1 + high:.2f}); {regular} of them fall "
            "like 1/St to 0.05 in the exponent, the slowest like "
            f"St^({self.single.max():.2f}). With a crossing there is no single υ. Theory has two "
            "laws for a separatrix, ε = 1/St: the crossing itself leaves a jump of order ε "
            "(crossing-jumps), and resonances with a second frequency, which gather in front of "
            "it, scatter by ε^½ up to a logarithm (Neishtadt and Okunev, arXiv:2108.08540, prove "
            "O(ε^½ ln 1/ε) for periodic perturbations of systems with one frequency, but for a "
            "share O(ε^½ ln⁵ 1/ε) of starts). So the exponent is to go from -1 to -½. It does: "
            f"the geometric mean over {self.starts} starts is √((a/St)² + b²/St), a = "
            f"{self.jump:.2g} I_max, b = {self.scattering:.2g} I_max, to {100 * self.misfit:.2g} %, "
            f"where the best power of St misses by {100 * self.straight:.2g} %; both terms are "
            f"equal at St = {in_two_digits(even)}. Between neighbouring St the exponents are "
            f"{joined(self.local, '.2f')}, by the two laws {joined(self.foreseen, '.2f')}, and "
            f"without a crossing {joined(local_exponents(self.without), '.2f')}. Fitted without "
            f"the largest St, the two laws foretell its error to {100 * self.ahead:.2g} %. The "
            "root mean square over Neishtadt's and Okunev's bound changes by a factor of "
            f"{self.growth:.2g} from St = {in_two_digits(self.stokes[0])} to "
            f"{in_two_digits(self.stokes[-1])}, with no start left out. That the ε^½ comes of "
            "resonances is theirs: here only its size is measured."
        )


# Slow time of the runs over the crossing, which the averaged run meets at 0.05
# (reports/paper/ellipsoids.md): until after the end of `_AFTER_CROSSING`.
_JUMP_TIME = 0.08
# Windows of slow time, counted from the crossing, over which deviations are averaged: this takes
# the regular oscillation out. Both are clear of the crossing itself; their places are estimates.
_BEFORE_CROSSING = (-0.03, -0.02)
_AFTER_CROSSING = (0.015, 0.025)
# Largest St at which resonances are taken not to matter: an estimate. In `averaging-order` their term equals the
# jump's near 2.5e5.
_MIDDLE_STOKES = 3e5
# Standard deviation of ln(2 sin πξ), ξ uniform; its mean is 0.
SPREAD = np.pi / np.sqrt(12)


def law(values: np.ndarray) -> np.ndarray:
    """Distribution function of -ln(2 sin πξ), ξ uniform, in units of its standard deviation.

    It is Neishtadt's law of the jump at a separatrix, of which `Jumps.sentence` names the source.
    -ln(2 sin πξ) is no less than -ln 2, and at most x with probability 1 - (2/π) arcsin(½ e^-x).
    """
    return 1 - 2 / np.pi * np.arcsin(np.exp(-np.maximum(SPREAD * values, -np.log(2))) / 2)


def fitted_level(count: int) -> float:
    """5 % level of the distance between the law and `count` of its own values.

    Their mean and deviation are fitted. The distance is Kolmogorov's and Smirnov's. Its tabulated
    level holds for laws without fitted parameters. So 4000 simulated samples give the level, as in
    Lilliefors' test for a normal law: 200 of them lie above it, which fixes it to a percent or two.
    """
    # One sample in each row. Any seed would do.
    values = -np.log(2 * np.sin(np.pi * np.random.default_rng(31).uniform(size=(4000, count))))
    values = np.sort(
        (values - values.mean(axis=1, keepdims=True)) / values.std(axis=1, keepdims=True)
    )
    # A sample's distribution function jumps at each value from one of these heights to the next.
    steps = np.arange(count + 1) / count
    distances = np.maximum(steps[1:] - law(values), law(values) - steps[:-1]).max(axis=1)
    return float(np.quantile(distances, 0.95))


class Scatter(NamedTuple):
    """How deviations of (L_x, L_y, L_z, E) over I_max scatter about their mean."""

    size: float  # Standard deviation over I_max: the root of the variances' sum.
    share: float  # Share of the variance along the main direction.
    # Components along it, which points to where the law has its tail, in units of their deviation.
    along: np.ndarray


def scatter(part: Table) -> Scatter:
    """Scatter of deviations in L and E."""
    values = np.stack([part[name] for name in SLOW], axis=1)
    values = values - values.mean(axis=0)
    _, sizes, directions = np.linalg.svd(values, full_matrices=False)
    along = values @ directions[0]
    along = along * np.sign(stats.skew(along)) / along.std()
    size = float(np.sqrt(np.mean(np.sum(values**2, axis=1))))
    return Scatter(size, float(sizes[0] ** 2 / np.sum(sizes**2)), along)


@dataclass(frozen=True)
class Jumps:
    """How deviations from averaging scatter after a crossing, against the law of the jump.

    Scatters are over starts, and in units of I_max. Arrays have a value for each St, `along` one for each
    start. Distances are Kolmogorov's and Smirnov's: the largest difference of two distribution functions.
    They are those at the smallest St.
    """

    stokes: np.ndarray
    sizes: np.ndarray  # Scatter after the crossing.
    shares: list[float]  # Share of the scatter's variance along its main direction.
    ratio: float  # Scatter after the crossing over that before, at the smallest St.
    along: np.ndarray  # Deviations along the main direction, as of `Scatter`, at the smallest St.
    distance: float  # Between the distribution of `along` and the law.
    normal: float  # Between the distribution of `along` and a normal one.

    @classmethod
    def of(cls, table: Table) -> "Jumps":
        """The scatters of the item's table."""
        before, after = _scatters(table)
        stokes = np.array(list(after))
        sizes = np.array([scatter.size for scatter in after.values()])
        first = stokes[0]
        along = after[first].along
        return cls(
            stokes=stokes,
            sizes=sizes,
            shares=[scatter.share for scatter in after.values()],
            ratio=sizes[0] / before[first].size,
            along=along,
            distance=float(stats.kstest(along, law).statistic),
            normal=float(stats.kstest(along, "norm").statistic),
        )

    @property
    def critical(self) -> float:
        """Tabulated 5 % level of a distance from a law without fitted parameters.

        A normal law with fitted mean and deviation has a lower one: what exceeds the tabulated
        level is rejected all the more.
        """
        return float(stats.kstwo.isf(0.05, len(self.along)))

    @property
    def level(self) -> float:
        """5 % level of the distance from the law, whose mean and deviation are fitted."""
        return fitted_level(len(self.along))

    @property
    def middle(self) -> str:
        """The largest St at which resonances are taken not to matter (`_MIDDLE_STOKES`), as text."""
        return in_two_digits(self.stokes[self.stokes <= _MIDDLE_STOKES][-1])

    def sentence(self) -> str:
        """The finding in words."""
        # Values of the law at even phases ξ, which give its skewness.
        tail = -np.log(2 * np.sin(np.pi * (np.arange(100_000) + 0.5) / 100_000))
        return (
            "Neishtadt (J. Appl. Math. Mech. 51 (1987) 586) and Cary, Escande and Tennyson (Phys. "
            "Rev. A 34 (1986) 4256) find, for one frequency, a jump of order ε ln(2 sin πξ) with a "
            "phase ξ that is uniform over starts. Scatter × St after the crossing is "
            f"{joined(self.sizes * self.stokes, '.2g')} I_max at "
            f"St = {', '.join(map(in_two_digits, self.stokes))}, "
            f"{self.ratio:.2g} times that before at the first: of order 1/St to "
            f"St = {self.middle}, as the law has it. At St = {in_two_digits(self.stokes[0])} the "
            f"deviations of {len(self.along)} starts with the same L and E lie along one direction "
            f"({self.shares[0]:.3f} of their variance) with the law's one-sided tail "
            f"(skewness {stats.skew(self.along):.2g}, the law's {stats.skew(tail):.2g}); their "
            f"distribution is {self.distance:.2g} off the law's, and {self.normal:.2g} off a normal "
            f"one, which the 5 % level, {self.critical:.2g}, rejects. The law is not rejected: as "
            "many of its own values, mean and deviation fitted, are more than "
            f"{self.level:.2g} off in 5 % of cases, because its density has no bound at its edge, so "
            "that the test is weak. The torque depends on the angle of precession too, a second "
            "phase that the law does not have; with its resonances one expects what is seen at "
            "larger St: deviations along more directions (share along one: "
            f"{joined(self.shares, '.2g')}) and a slower fall than 1/St."
        )

    def numbers(self) -> list[Number]:
        """Distances from the law and from a normal law, directions, and exponents in St."""
        regular = self.stokes <= _MIDDLE_STOKES
        late = self.stokes >= _MIDDLE_STOKES
        slope = exponent(self.stokes[regular], self.sizes[regular])
        later = exponent(self.stokes[late], self.sizes[late])
        return [
            Number(
                f"distance of the distribution from that of ln(2 sin πξ), St = {self.stokes[0]:g}",
                self.distance,
                Range(
                    0.0,
                    min(self.level, self.normal),
                    "not rejected at 5 %, and nearer than a normal one",
                ),
            ),
            Number("5 % level of the former, mean and deviation fitted", self.level),
            Number(
                "the distance from a normal one",
                self.normal,
                Range(self.critical, 1.0, "a normal distribution is rejected at 5 %"),
            ),
            Number(
                f"share of the variance along one direction, St = {self.stokes[0]:g}",
                self.shares[0],
                Range(0.9, 1.0, "the law has one phase, and so one direction"),
                measure=f"the variance over {len(self.along)} random phases of one L and E",
            ),
            Number(
                f"exponent in St of the scatter, up to St = {self.middle}",
                float(slope),
                Range.near(-1.0, 0.2, "the law: of order 1/St"),
                interval=slope.interval,
            ),
            Number(
                f"the same from there to St = {self.stokes[-1]:g}",
                float(later),
                Range(-1.0, -0.3, "between 1/St and, but for a logarithm, St^-½"),
            ),
            Number(
                f"scatter after over scatter before the crossing, St = {self.stokes[0]:g}",
                self.ratio,
                Range(1.5, 100.0, "the crossing adds to the scatter clearly"),
            ),
        ]


@dataclass(frozen=True)
class CrossingJumps(Experiment):
    """How deviations from averaging scatter after a crossing, over starts with the same L and E."""

    seconds: ClassVar[float] = 8.0

    def compute(self, grid: Grid) -> Computed:
        """Deviations of full runs from the averaged one, before and after the crossing.

        The table has a row for each St, `after` (0 before the crossing, 1 after it) and start. The
        columns of `SLOW` are means over the window of slow time, over I_max. The numbers of rows of a
        run, starts and St are estimates.
        """
        # Any seed would do.
        generator = np.random.default_rng(29)
        slow_times = np.linspace(0.0, _JUMP_TIME, 2001)
        averaged = averaged_run(Scene(_ELLIPSOID, 1.0, PAPER_START, _JUMP_TIME), slow_times).slow
        crossing = slow_times[np.argmax(above_middle(averaged))]
        starts = [same_slow_start(PAPER_START, generator) for _ in range(grid.of(128, 48))]
        for stokes in grid.of((1e4, 3e4, 1e5, 3e5, 1e6), (1e4, 3e4, 3e5, 1e6)):
            deviations = []
            for start in starts:
                scene = Scene(_ELLIPSOID, stokes, start, stokes * _JUMP_TIME)
                # The tolerance is looser than usual, and the error far below the scatter, which is
                # of order 1/St. An estimate.
                run = full_run(scene, stokes * slow_times, 1e-11, solver=_FAST_SOLVER)
                deviations.append(run.slow - averaged)
            for after, (low, high) in enumerate((_BEFORE_CROSSING, _AFTER_CROSSING)):
                window = (slow_times > crossing + low) & (slow_times < crossing + high)
                means = np.array(deviations)[:, window].mean(axis=1)
                yield (
                    "",
                    {"stokes": stokes, "after": after, **dict(zip(SLOW, means.T, strict=True))},
                )

    def judge(self, data: Data) -> Verdict:
        """How the scatter falls with St, and whether its distribution is the law's."""
        findings = Jumps.of(data[""])
        return Verdict(
            Word.MEASURED,
            findings.sentence(),
            f"(1, 0.8, 0.5) from the paper's start at {len(findings.along)} fast phases. Left: distribution "
            "of the deviation from the averaged run, just after the crossing, along its main "
            "direction, in units of its standard deviation, beside the law; right: scatter before "
            "and after the crossing, against St.",
            findings.numbers(),
        )

    def draw(self, data: Data) -> Figure:
        """The distribution beside the law; scatter against St."""
        before, after = _scatters(data[""])
        stokes = np.array(list(after))
        along = after[stokes[0]].along
        figure, (left, right) = panels(1, 2, 3.1)
        places = np.linspace(-2.0, 5.0, 401)
        shares = (np.arange(len(along)) + 0.5) / len(along)
        style: dict[str, Any] = {
            "drawstyle": "steps-mid",
            "color": BLUE,
            "linewidth": 2.0,
            "label": "measured",
        }
        left.plot(np.sort(along), shares, **style)
        left.plot(places, law(places), color=VERMILLION, label=r"$-\ln(2\,\sin\,\pi\xi)$")
        normal = stats.norm.cdf(places)
        left.plot(places, normal, color=AVERAGED, linestyle=":", label="normal")
        left.set(
            xlabel="deviation over its standard deviation",
            ylabel="share of starts below",
            title=f"St = {short(stokes[0])}",
        )
        key_of(left)
        for scatters, color, label in (
            (after, BLUE, "after the crossing"),
            (before, GREEN, "before it"),
        ):
            sizes = [scatter.size for scatter in scatters.values()]
            right.plot(stokes, sizes, marker="o", color=color, label=label)
        draw_power(right, stokes, after[stokes[0]].size * stokes[0] / stokes[-1], -1)
        right.set(
            xlabel="Stokes number St",
            ylabel="scatter of the deviation$/I_{max}$",
            xscale="log",
            yscale="log",
        )
        square_decades(right, fill=True)
        key_of(right)
        return figure


def _scatters(table: Table) -> tuple[dict[float, Scatter], dict[float, Scatter]]:
    """Scatter before and after the crossing, by St."""
    before = {stokes: scatter(rows) for stokes, rows in groups(table[table.after == 0], "stokes")}
    after = {stokes: scatter(rows) for stokes, rows in groups(table[table.after == 1], "stokes")}
    return before, after


# Slow time of the runs from next to the saddle: longer than any arrival at the node, which `judge`
# checks.
_ENDING_TIME = 1.5
# Ticks of the figure of arrivals: slow times, and their texts.
_TICKS = ([0.2, 0.5, 1.0], ["0.2", "0.5", "1"])
# Distance from the node, over I_max, at which a run has arrived. An estimate, above what remains of
# the full runs' oscillation at the smallest St.
_ARRIVED = 0.06
_ENDING_STOKES = (3e2, 5e2, 1e3, 3e3, 1e4)  # St of the full runs: a choice.
# How near to the saddle the starts are: standard deviation of their tilts, in rad, and of their
# angular velocities, in shear rates. A choice.
_NEAR_SADDLE = (3e-2, 3e-3, 3e-4)
# Populations of the shares: of starts next to the saddle, and of starts of the map.
_AT_THE_SADDLE = "starts drawn normally about the saddle, φ even, at two fast phases"
_ON_THE_MAP = "a map of starts even in θ and ψ, not of random ones"
# Share of the averaged arrival by which a full one counts as late or early: an estimate.
_OFF_BY = 0.2


def saddle_start(generator: np.random.Generator, spread: float) -> BodyStart:
    """Longest axis along +z or -z and ω = -½ ẑ, both but for random deviations.

    z is the vorticity. `spread` is the standard deviation of the deviations, in rad and in units of
    the shear rate.
    """
    # At θ = π/2 the longest axis x' lies along +z for ψ = π/2 and along -z for ψ = -π/2.
    phi = generator.uniform(0, 2 * pi)
    psi = generator.choice([-pi / 2, pi / 2])
    tilt = generator.normal(scale=spread, size=2)
    quaternion = quaternion_from_euler((pi / 2 + tilt[0], phi, psi + tilt[1]))
    noise = generator.normal(scale=spread, size=3)
    sign = -np.sign(psi)
    return BodyStart(quaternion, (0.5 * sign + noise[0], noise[1], noise[2]))


def _arrival(slow_times: np.ndarray, slow: np.ndarray, radius: float = _ARRIVED) -> float:
    """Slow time from which on L and E stay close to the node, or the last one if they do not.

    `slow` has the slow variables at the slow times, shape (n, 4). `radius` is the distance that is
    close, over I_max.
    """
    away = np.flatnonzero(distance_from_node(_ELLIPSOID, slow) > radius)
    return float(slow_times[min(int(away[-1]) + 1, len(slow_times) - 1)]) if len(away) else 0.0


def late(table: Table) -> dict[float, Estimate]:
    """Share of arrivals that are late or early, by St, of rows of the table of `SaddleEndings`."""
    shares = {}
    for stokes, arrivals in groups(table, "stokes"):
        delay = np.abs(arrivals.full - arrivals.averaged)
        shares[stokes] = share(delay > _OFF_BY * arrivals.averaged)
    return shares


@dataclass(frozen=True)
class SaddleEndings(Experiment):
    """How full runs from next to the saddle end, and when."""

    seconds: ClassVar[float] = 5.0

    def compute(self, grid: Grid) -> Computed:
        """Arrival at the node: averaged, and full at several St, with the end of z'.

        A row is a full run. `near` is the spread of the start. `phase` is 0 for the start itself
        and 1 for another one with its L and E. `averaged` and `full` are slow times of arrival.
        `up` is 1 if z' ends along +z. The numbers of starts and of rows of a run are estimates.
        """
        # Any seed would do.
        generator = np.random.default_rng(23)
        slow_times = np.linspace(0.0, _ENDING_TIME, 1501)
        for spread, index in product(_NEAR_SADDLE, range(grid.of(24, 6))):
            start = saddle_start(generator, spread)
            scene = Scene(_ELLIPSOID, 1.0, start, _ENDING_TIME)
            averaged = averaged_run(scene, slow_times, solver=_FAST_SOLVER).slow
            expected = _arrival(slow_times, averaged)
            for stokes in _ENDING_STOKES[:: grid.of(1, 2)]:
                for phase, body_start in enumerate((start, same_slow_start(start, generator))):
                    scene = Scene(_ELLIPSOID, stokes, body_start, stokes * _ENDING_TIME)
                    run = full_run(scene, stokes * slow_times)
                    up = float(run.observables.rotation[-1, 2, 2] > 0)
                    case = {"near": spread, "start": index, "stokes": stokes, "phase": phase}
                    arrivals = {"averaged": expected, "full": _arrival(slow_times, run.slow)}
                    yield "", {**case, **arrivals, "up": up}

    def judge(self, data: Data) -> Verdict:
        """How many arrivals are off, and how many ends depend on the fast phase."""
        table = data[""]
        stokes = np.array(list(by(table, "stokes")))
        last = stokes[-1]
        shares = {spread: late(rows) for spread, rows in groups(table, "near")}
        flipped = _flips(table)[last]
        clauses = []
        for spread in _NEAR_SADDLE:
            percentages = [100 * value for value in shares[spread].values()]
            clauses.append(f"{joined(percentages, '.0f')} % from {spread:g} of the saddle")
        named = "; ".join(clauses)
        return Verdict(
            Word.MEASURED,
            "All full runs end at the node, but those that start next to the saddle may reach it "
            f"at a time more than a fifth off the averaged one. At St = {joined(stokes)} so do "
            f"{named}. In which of its two mirror images they end, z' up or down, depends on the "
            "fast phase, which averaging does not know: it differs for "
            f"{100 * flipped:.0f} % of the pairs of starts with the same L and E at St = "
            f"{short(last)}.",
            f"{len(np.unique(table.start))} random starts at each of the distances "
            f"{joined(_NEAR_SADDLE)} (tilts in rad, and angular velocities) from the rotation of "
            "(1, 0.8, 0.5) about its longest axis, each at two fast phases. Left: slow time from "
            f"which L and E stay within {_ARRIVED:g} I_max of the node; right: shares.",
            self._numbers(table, shares, flipped),
        )

    def _numbers(
        self, table: Table, shares: Mapping[float, Mapping[float, Estimate]], flipped: Estimate
    ) -> list[Number]:
        """Shares of arrivals that are off, by distance from the saddle, and of the ends."""
        first, *_, last = by(table, "stokes")
        farthest = _NEAR_SADDLE[0]
        nearest = _NEAR_SADDLE[-1]
        numbers = []
        for spread in _NEAR_SADDLE:
            name = (
                f"share of arrivals off by a fifth, St = {short(last)}, {spread:g} from the saddle"
            )
            value = shares[spread][last]
            numbers.append(
                Number(name, float(value), interval=value.interval, measure=_AT_THE_SADDLE)
            )
        far = float(shares[farthest][first])
        return [
            *numbers,
            Number(f"the same at St = {first:g}, {farthest:g} from it", far),
            Number(
                f"the same at St = {first:g}, {nearest:g} from it",
                float(shares[nearest][first]),
                Range(far, 1.0, "theory: more of those that start nearer to the saddle"),
            ),
            Number(
                f"z' ends the other way from the same L and E, St = {short(last)}",
                float(flipped),
                interval=flipped.interval,
            ),
            # `_arrival` gives the end of the run, the last sample, for one that does not arrive.
            Number(
                "share of full runs that reach the node",
                float(np.mean(table.full < 0.999 * _ENDING_TIME)),
                Range(1.0, 1.0, "theory: the node attracts all"),
                measure=_AT_THE_SADDLE,
            ),
            Number(
                "share of full runs that end with z' up",
                float(np.mean(table.up)),
                Range(0.2, 0.8, "the mirror symmetry of the equations"),
                measure=_AT_THE_SADDLE,
            ),
        ]

    def draw(self, data: Data) -> Figure:
        """Arrivals of full against averaged runs; shares against St."""
        table = data[""]
        figure, (left, right) = panels(1, 2, 3.4)
        self._draw_arrivals(left, table)
        self._draw_shares(right, table)
        return figure

    def _draw_arrivals(self, axes: Axes, table: Table) -> None:
        """Arrivals of full runs against arrivals of averaged ones."""
        bounds = [0.9 * min(table.averaged), 1.1 * max(table.full)]
        axes.plot(bounds, bounds, color=AVERAGED, linewidth=0.8, label="equal")
        draw_each(
            axes,
            table,
            "stokes",
            "averaged",
            "full",
            label=lambda stokes: f"St = {power(stokes)}",
            marker=".",
            linestyle="none",
            markersize=4,
        )
        axes.set(
            xlabel="arrival of the averaged run, slow time",
            ylabel="arrival of the full run, slow time",
            xscale="log",
            yscale="log",
        )
        for axis in (axes.xaxis, axes.yaxis):
            axis.set_ticks(*_TICKS)
            axis.set_ticks([], minor=True)
        square_decades(axes, fill=True)
        key_of(axes)

    def _draw_shares(self, axes: Axes, table: Table) -> None:
        """Shares of arrivals that are off, and of ends that the fast phase changes, against St."""
        draw_each(
            axes,
            table,
            "near",
            lambda rows: list(late(rows)),
            lambda rows: list(late(rows).values()),
            label=lambda spread: f"{spread:g} off the saddle",
            marker="o",
        )
        flips = _flips(table)
        text = "end of $z'$ changes with the fast phase"
        style: dict[str, Any] = {
            "marker": "s",
            "linestyle": "--",
            "color": VERMILLION,
            "label": text,
        }
        axes.plot(list(flips), list(flips.values()), **style)
        axes.set(
            xlabel="Stokes number St",
            ylabel="share of starts",
            xscale="log",
            ylim=(-0.03, 1.03),
            title="arrival off by a fifth from",
        )
        key_of(axes)


def _flips(table: Table) -> dict[float, Estimate]:
    """Share of the pairs of starts whose ends differ, by St."""
    flips = {}
    for stokes, rows in groups(table, "stokes"):
        flips[stokes] = share(rows.up[rows.phase == 0] != rows.up[rows.phase == 1])
    return flips


# St of the runs of the map: the smallest at which the paper calls the agreement good in the L_z–E
# planes.
_BASIN_STOKES = 1e3
# Slow time after which the end of z' is taken: longer than most transients. An estimate.
_BASIN_TIME = 0.6
# Distance from the node, over I_max, at which a transient has ended: an estimate.
_NEAR_NODE = 0.02
# z component of the axis beyond which it points along the vorticity: within 0.45 rad, as `_numbers` says. A choice:
# any up to 0.98 gives the same share.
_ALIGNED = 0.9
# Slow time of the runs of the averaged equations: longer than every transient, which `_numbers` checks. An estimate.
_TRANSIENT_TIME = 2.0


@dataclass(frozen=True)
class Basins(Experiment):
    """How long the way to the node is, and which of its mirror images is reached."""

    seconds: ClassVar[float] = 5.0

    def compute(self, grid: Grid) -> Computed:
        """Transient times of the averaged equations from |L| = I_max/2; ends of z' at one St.

        |L| has its value at the node. The numbers of points and of rows of a run are estimates.
        """
        slow_times = graded(_TRANSIENT_TIME, 1201)
        # Points along either side of the map of transients (`size`) and of the map of ends
        # (`side`).
        size = grid.of(41, 9)
        side = grid.of(64, 10)
        cosines = np.linspace(-0.999, 0.999, size).tolist()
        heights = np.linspace(0.002, 0.998, size).tolist()
        # L has the size I_max/2 and the cosine of its angle to the vorticity, with L_x = L_y. The
        # range of the cosine ends just inside ±1, where L is along the vorticity. The height is the
        # share of E between its bounds, which are permanent rotations: it ends just inside 0 and 1.
        for cosine, height in product(cosines, heights):
            sine = sqrt((1 - cosine**2) / 2)
            slow = (0.5 * sine, 0.5 * sine, 0.5 * cosine, energy_at(_ELLIPSOID, 0.5, height))
            run = slow_run(_ELLIPSOID, slow, slow_times, solver=_FAST_SOLVER).slow
            arrival = _arrival(slow_times, run, _NEAR_NODE)
            yield "transients", {"cosine": cosine, "share": height, "t2": arrival}
        times = np.array([0.0, _BASIN_STOKES * _BASIN_TIME])
        # θ and ψ are the middles of equal parts of [0, π] and [-π, π].
        steps = np.arange(side) + 0.5
        thetas = (steps * pi / side).tolist()
        psis = (steps * 2 * pi / side - pi).tolist()
        for theta, psi in product(thetas, psis):
            start = EulerStart((theta, PAPER_START.angles[1], psi), PAPER_START.rates)
            # The tolerance may be loose: only the direction of z' at the end counts. Starts on the
            # border between up and down may end wrongly.
            run = full_run(Scene(_ELLIPSOID, _BASIN_STOKES, start, times[-1]), times, 1e-9)
            yield "ends", {"theta": theta, "psi": psi, "z": run.observables.rotation[-1, 2, 2]}

    def judge(self, data: Data) -> Verdict:
        """Medians and shares of the maps."""
        transients = data["transients"]
        ends = data["ends"]
        median = float(np.median(transients.t2))
        node = next(point for point in fixed_points(_ELLIPSOID) if point.stability == "stable node")
        # The median times the slowest rate: all eigenvalues of the node are negative.
        relative = -median * max(node.eigenvalues)
        up_map = map_of(ends, "theta psi z")[2] > 0
        # A grid is no sample: its shares have no interval.
        up = float(np.mean(up_map))
        by_area = np.average(up_map.ravel(), weights=np.sin(ends.theta))
        down_the_rows = (up_map[1:] != up_map[:-1]).ravel()
        along_the_rows = (up_map[:, 1:] != up_map[:, :-1]).ravel()
        mixed = float(np.mean(np.concatenate([down_the_rows, along_the_rows])))
        return Verdict(
            Word.MEASURED,
            f"The transient takes t₂ = {median:.2g} in the median, {relative:.2g} times the slowest "
            f"relaxation time, and up to {transients.t2.max():.2g} on this map, next to the "
            f"saddle's stable manifold. At St = {_BASIN_STOKES:g} the two ends of z' share the "
            f"starts, evenly spaced in θ and ψ, {100 * up:.0f} : {100 - 100 * up:.0f} "
            f"({100 * by_area:.0f} : {100 - 100 * by_area:.0f} by solid angle), and "
            f"{100 * mixed:.0f} % of neighbours on the map end differently. Medians and shares are "
            "those of these maps, not of random starts.",
            "(1, 0.8, 0.5). Left: slow time until the averaged run stays within "
            f"{_NEAR_NODE:g} I_max of the node, from |L| = I_max/2, L_x = L_y. Right: where z' "
            f"points at t₂ = {_BASIN_TIME:g}, {len(up_map)}×{len(up_map)} starts with the paper's "
            "rates.",
            self._numbers(data, median, relative, up, mixed),
        )

    def _numbers(
        self, data: Data, median: float, relative: float, up: float, mixed: float
    ) -> list[Number]:
        """Lengths of the transients, and shares of the map of ends."""
        transients = data["transients"]
        ends = data["ends"]
        return [
            Number(
                "median transient, slow time",
                median,
                Range(
                    0.05, 0.6, "some relaxation times: the slowest is 0.11, the others 0.03 to 0.05"
                ),
            ),
            Number(
                "the same times the slowest rate at the node",
                relative,
                Range(1.0, 10.0, "an exponential approach to 0.02 takes about four times"),
            ),
            Number(
                "longest transient of the map, slow time",
                transients.t2.max(),
                Range(median, 0.999 * _TRANSIENT_TIME, "all arrive before their runs end"),
            ),
            Number(
                "share of starts that end with z' up",
                up,
                Range(0.1, 0.9, "both ends are reached: the equations are mirror symmetric"),
                measure=_ON_THE_MAP,
            ),
            Number(
                "share of neighbours on the map that end differently",
                mixed,
                Range(0.0, 0.6, "half, and some, were ends random"),
                measure="pairs of neighbours on the map of starts even in θ and ψ",
            ),
            Number(
                "share of full runs with z' within 0.45 rad of the vorticity axis at the end",
                float(np.mean(np.abs(ends.z) > _ALIGNED)),
                Range(0.8, 1.0, "the node attracts all; some are still on their way"),
                measure=_ON_THE_MAP,
            ),
        ]

    def draw(self, data: Data) -> Figure:
        """Both maps."""
        figure, (left, right) = panels(1, 2, 2.5)
        cosines, heights, transients = map_of(data["transients"], "cosine share t2")
        mesh = left.pcolormesh(cosines, heights, transients.T, cmap="cividis", rasterized=True)
        figure.colorbar(mesh, ax=left, label="slow time to the node")
        left.set(xlabel="$L_z/|L|$", ylabel="share of $E$ between its bounds")
        self._draw_ends(figure, right, data["ends"])
        for axes in (left, right):
            axes.grid(visible=False)
        return figure

    def _draw_ends(self, figure: Figure, axes: Axes, ends: Table) -> None:
        """The map of the ends of z'."""
        thetas, psis, heights = map_of(ends, "theta psi z")
        colors: Any = ListedColormap((BLUE, YELLOW))
        style: dict[str, Any] = {"cmap": colors, "vmin": -1, "vmax": 1, "rasterized": True}
        mesh = axes.pcolormesh(psis, thetas, heights, **style)
        label = "$z'$ at the end, along the vorticity axis $z$"
        bar = figure.colorbar(mesh, ax=axes, label=label, ticks=(-0.5, 0.5))
        bar.ax.set_yticklabels(["down", "up"], rotation="vertical", va="center")
        axes.set(
            xlabel=r"$\psi_0$, rad", ylabel=r"$\theta_0$, rad", title=f"St = {_BASIN_STOKES:g}"
        )


def map_of(table: Table, names: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Coordinates of a map's rows and columns, and its values, shape (rows, columns).

    The table has a row for each value, one row of the map after the other. `names` has
    the names of the table's columns with the first and the second coordinate and the value, with
    spaces between them.
    """
    first, second, values = (table[name] for name in names.split())
    return np.unique(first), np.unique(second), values.reshape(len(np.unique(first)), -1)


BEYOND_SECTION = Section(
    "beyond",
    "Beyond the paper",
    (
        Item(
            "averaging-order",
            "Order of averaging's error, with and without a crossing",
            "the remark on resonances",
            "The paper expects an error of O(St^(-1+υ)), 0 < υ < 1, from resonances, and leaves υ "
            "open.",
            AveragingOrder(),
        ),
        Item(
            "crossing-jumps",
            "What a crossing of L² = 2EI₂ leaves behind",
            "beyond",
            "Not in the paper: is the deviation from averaging after a crossing the jump of an "
            "adiabatic invariant at a separatrix?",
            CrossingJumps(),
        ),
        Item(
            "saddle-endings",
            "Full and averaged runs from next to the saddle",
            "beyond",
            "Not in the paper: how often do full trajectories near the saddle end differently from "
            "averaged ones?",
            SaddleEndings(),
        ),
        Item(
            "basins",
            "Basins and transient times",
            "beyond",
            "Not in the paper: how long is the way to the node, and which of its mirror images is "
            "reached?",
            Basins(),
        ),
    ),
)
