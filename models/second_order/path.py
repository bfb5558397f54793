"""The first-order solution of a scene, the size of averaging along it, and its resonances.

`outline` cuts a run into segments by what stands here. `docs/second-order.md`, section 8, has the
mathematics: rho (`swing`), the orders of averaging, the errors of angles, and kicks. A kick is the
sudden change of L and E at a resonance. Columns of `slow` are L in space, (0, 1, 2), and E, 3.
"""

from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from math import exp, inf, pi, sqrt

import numpy as np

from polhode.models import path_solver
from polhode.models.catalogue import averaged_form, form as find_form
from polhode.models.form import FormNotValidError
from polhode.models.forms.spheroid import Spheroid
from polhode.models.once import once
from polhode.models.scene import Scene
from polhode.models.second_order import spheroid as spheroidal, tables
from polhode.models.second_order.extent import extent
from polhode.models.second_order.swing import modes_at, series_for
from polhode.models.second_order.tables import Kick
from polhode.models.shape import Ellipsoid

Array = np.ndarray

# Constants that stand "by trial" were tried on random starts. reports/hybrid and reports/second-order have
# other starts, and count how many runs stay within the errors that they state.
#
# Tolerance of the solver that follows a path: an error of the path shifts the times of kicks. An
# estimate: the path's own error, of order 1/St, is larger up to St = 1e8.
_PATH_TOLERANCE = 1e-8
# About how many points the path of a triaxial ellipsoid has, which meets kicks. An estimate: between two
# points rates are taken as straight, and a path that turns back across a resonance shows no kick there.
_KICKED = 240
# The same of a spheroid, which meets none. An estimate: between them only rates are summed.
_SMOOTH = 100
# Paths that are cached. An estimate: a scene is asked for again at once, with other budgets.
_CACHED_PATHS = 16
# |L| over I_max below which a body does not rotate. An estimate: far above the rounding of L, and far below any |L|
# at which averaging holds.
TINY = 1e-12
# Least distance of two times of a path, over the whole run: between times that differ by rounding alone,
# rates are noise. An estimate, some 5000 roundings.
_LEAST_STEP = 1e-12
# |L| over I_max that is divided by where |L| is 0.
_NO_SIZE = 1e-300
# Depth a² at which tables end, less what a first-order path may be off by. An estimate: with less, a run
# whose path stays inside may leave the tables.
_DEEPEST = tables.MAX_A2 - 0.2
# Third-order terms over rho times the second-order ones, such that estimates bound most runs; by
# trial.
_MARGIN = 3.6
# Third-order terms over first-order ones times the square of the damping in a radian; by trial.
_DAMPED = 0.05
# Error beside a resonance over the product of the mode's swing and the share by which it changes the mode's
# frequency; by trial, 4 to 7 in random bodies. The slow start misses as much as the swing does later, and
# directions of L swing more than |L|.
_ERROR_BESIDE_RESONANCE = 5.0
# Least speed at which the shear turns a body, in rad per unit of time: half its rate.
LEAST_SPEED = 0.5
# Mean square of cot α over 97.5 % of the phases α at L² = 2EI₂. There E jumps by ln(2 sin α)/(4K) of what a polhode
# takes (Neishtadt, Sov. J. Plasma Phys. 12, 1986), so that the jump changes with α by cot α/(4K) of that. At the end
# of the tables the elliptic integral 4K is some 15; 4π, which is less, is taken for it.
_SADDLE = 15.0
# Square of the slow time, in 1/(St times the slowest damping rate), in which |L| rises from 0 far
# enough; by trial.
_RISEN = 45.0


@dataclass(frozen=True)
class Path:
    """The first-order solution of a scene, and the size of averaging and its errors along it."""

    ellipsoid: Ellipsoid
    torque_factor: float  # 1/St
    times: Array  # slow times, shape (m,)
    slow: Array  # (L, E), shape (m, 4)

    @classmethod
    def of(cls, scene: Scene) -> "Path":
        """The path of a scene with 0 < St < inf."""
        form = find_form(averaged_form(scene))
        times = np.zeros(1)
        slow = scene.initial.slow
        # If L is 0 or along the middle axis, nothing is averaged.
        with suppress(FormNotValidError):
            problem = form.problem(scene)
            points = _KICKED if scene.ellipsoid.kind == "triaxial" else _SMOOTH
            times, states = path_solver.solved(problem, _PATH_TOLERANCE, points)
            # Times of a short run may lie closer than numbers can.
            apart = np.append(True, np.diff(times) > 0)
            times = times[apart]
            slow = form.observe(scene, states).slow[apart]
        if times[-1] < scene.slow_time:
            # |L| is 0 or falls to 0: the last state stands until |L| has risen again.
            end = times[-1] + sqrt(_RISEN * scene.torque_factor / min(scene.ellipsoid.damping))
            # At large St that takes less than a digit of the time.
            if end > times[-1]:
                times = np.append(times, min(end, scene.slow_time))
                slow = slow[[*range(len(slow)), -1]]
        return cls(scene.ellipsoid, scene.torque_factor, times, slow)

    def at(self, times: Array) -> "Path":
        """The same at further times."""
        every = np.union1d(self.times, times[(times > 0) & (times < self.times[-1])])
        every = every[np.append(np.diff(every) > _LEAST_STEP * every[-1], True)]
        slow = _interpolated(every, self.times, self.slow)
        return replace(self, times=every, slow=slow)

    @cached_property
    def size(self) -> Array:
        """|L| over I_max."""
        lx, ly, lz, _ = self.slow.T
        return np.sqrt(lx * lx + ly * ly + lz * lz) / max(self.ellipsoid.inertia)

    @cached_property
    def spin(self) -> Array:
        """Upper bound of |ω|, in shear rates, and 1 at least."""
        # |ω|² is at most (1/I₁ + 1/I₃) 2E - L²/(I₁I₃): rotation about the middle axis only lessens
        # it.
        low, _, high = sorted(self.ellipsoid.inertia)
        return np.sqrt(
            np.maximum(2 * self.slow[:, 3] * (1 / low + 1 / high) - high / low * self.size**2, 1)
        )

    @cached_property
    def scale(self) -> Array:
        """Bound of the error of L and E, over I_max, per relative change of L and per rad of the pose."""
        return self.size * self.spin

    @cached_property
    def longest(self) -> Array:
        """Whether the polhode circles the longest axis."""
        return (
            2 * self.slow[:, 3] * sorted(self.ellipsoid.inertia)[1]
            > (max(self.ellipsoid.inertia) * self.size) ** 2
        )

    @cached_property
    def a2(self) -> Array:
        """a² = -ln(1 - x), shape (m,), 0 for a spheroid; inf from `_DEEPEST` on and where |L| is 0."""
        if self.ellipsoid.kind != "triaxial":
            return np.zeros(len(self.times))
        axis, width = _range(self.ellipsoid, self.longest)
        with np.errstate(all="ignore"):
            h = 2 * self.slow[:, 3] / (max(self.ellipsoid.inertia) * self.size) ** 2
            a2 = -np.log1p(-np.clip((h - axis) / width, 0, 1))
        return np.where((a2 < _DEEPEST) & (self.size > TINY), a2, inf)

    @cached_property
    def _sides(self) -> list[tuple[bool, Array, tables.Table]]:
        """Sides of L² = 2EI₂ on which the path lies.

        For each whether it is the longest axis' side, the indices of its points, and the table.
        """
        sides = list[tuple[bool, Array, tables.Table]]()
        for longest in (False, True) if self.ellipsoid.kind == "triaxial" else ():
            points = np.flatnonzero(np.isfinite(self.a2) & (self.longest == longest))
            if len(points):
                sides.append((longest, points, tables.table(self.ellipsoid, longest)))
        return sides

    @cached_property
    def _orders(self) -> Array:
        """ρ and the largest rate of second order, rows of shape (2, m)."""
        swing, second = orders = np.full((2, len(self.times)), inf)
        if self.ellipsoid.kind != "triaxial":
            rotating = self.size > TINY
            orders[:, rotating] = spheroidal.orders(
                Spheroid.of(self.ellipsoid), self.torque_factor, self.slow[rotating]
            )
        unit = max(self.ellipsoid.inertia)
        for longest, points, table in self._sides:
            size = extent(self.ellipsoid, longest, self.slow[points, :3], self.a2[points])
            swing[points] = size * self.torque_factor
            # dh/d ln a², as h = i₃ + (i₂ - i₃)(1 - exp(-a²)).
            steep = np.exp(-self.a2[points]) * self.a2[points] * _range(self.ellipsoid, longest)[1]
            second[points] = (
                tables.second(table, unit, self.slow[points] / unit, self.a2[points], steep)
                * self.torque_factor
            )
        return orders

    swing = property(lambda path: path._orders[0], doc="ρ, the size of the transformation.")

    second = property(
        lambda path: path._orders[1], doc="|L'| or |E'| of second order over I_max, the larger one."
    )

    @cached_property
    def change(self) -> Array:
        """|L'| of first order over I_max."""
        # Between two steps the rate is the slope of the parabola through three points; at the ends it
        # is the slope of the first and of the last step.
        steps = np.diff(self.times)
        # At extreme St rates in slow time overflow: they are as good as infinite.
        with np.errstate(over="ignore", invalid="ignore"):
            slopes = np.diff(self.slow[:, :3].T) / steps
            within = (steps[1:] * slopes[:, :-1] + steps[:-1] * slopes[:, 1:]) / (
                steps[1:] + steps[:-1]
            )
            x, y, z = np.concatenate([slopes[:, :1], within, slopes[:, -1:]], axis=1)
            change = np.sqrt(x * x + y * y + z * z) / max(self.ellipsoid.inertia)
        return np.where(np.isnan(change), inf, change)

    @cached_property
    def speed(self) -> Array:
        """Approximate rate at which the body turns: 2E/|L|, or as the shear turns any body."""
        unit = max(self.ellipsoid.inertia)
        size = np.maximum(self.size, _NO_SIZE)
        return np.maximum(LEAST_SPEED, 2 * self.slow[:, 3] / unit / size)

    @cached_property
    def smaller(self) -> Array:
        """Ratio of third-order terms to second-order ones: by rho and the change of L in a radian, together."""
        slow = self.change / np.maximum(self.size, TINY) * self.torque_factor / self.speed
        return np.hypot(_MARGIN * self.swing, slow)

    @cached_property
    def fading(self) -> Array:
        """Relative change of the transformation in a radian: the ratio of its next order to it."""
        with np.errstate(all="ignore"):
            rate = np.abs(np.gradient(np.log(self.swing), self.times))
        return np.where(np.isfinite(rate), rate, 0) * self.torque_factor / self.speed

    @property
    def third(self) -> Array:
        """|L'| or |E'| of third order over I_max.

        First order has a part in it, as second order may vanish where a body settles.
        """
        damped = max(self.ellipsoid.damping) * self.torque_factor / self.speed
        with np.errstate(invalid="ignore"):
            third = self.second * self.smaller + _DAMPED * self.change * damped**2
        # Infinity times 0 is NaN: no bound is known.
        return np.where(np.isnan(third), inf, third)

    def lag(self, swing: Array) -> Array:
        """Errors of the angles, in rad: their rates miss the mean square of the swing, ρ²/2."""
        return self.summed(self.speed * swing**2 / 2) / self.torque_factor

    @cached_property
    def dephasing(self) -> Array:
        """Rates, over St, at which angles go wrong by lasting errors of L and E, per error over I_max.

        Such an error of e is a relative change of L, and a turn of the pose in rad, of e over `scale`.
        """
        dephasing = plain_dephasing(self.ellipsoid) / self.spin
        unit = max(self.ellipsoid.inertia)
        for longest, points, _ in self._sides:
            size = self.size[points]
            energy = self.slow[points, 3] / unit
            by_momentum, by_energy = np.moveaxis(self.rates[points], 2, 0)
            # At the same a², E follows L².
            scaled = np.abs(by_momentum + by_energy * (2 * energy / size)[:, None])
            # A turn of the pose changes x by up to 2 √(x (1 - x)), and so E at the same L.
            fall = np.exp(-self.a2[points])
            _, width = _range(self.ellipsoid, longest)
            turn = unit * size * np.abs(width) * np.sqrt(fall * (1 - fall))
            turned = np.abs(by_energy) * turn[:, None]
            rate = (scaled + turned).max(axis=1) / self.spin[points]
            dephasing[points] = np.maximum(dephasing[points], rate)
        return dephasing

    def phase(self, error: Array) -> Array:
        """Errors of the angles, in rad: lasting errors of L and E make their rates wrong."""
        # An angle with an error of half a turn is unknown: a larger error says no more.
        return np.minimum(self.summed(error * self.dephasing) / self.torque_factor, pi)

    @property
    def error_growth(self) -> Array:
        """Growth rate of a solver's error: by angle, and by a fast body's energy."""
        return self.speed * np.maximum(1, self.scale)

    @cached_property
    def kicks(self) -> tuple[Kick, ...]:
        """Kicks of the resonances that the path passes, in their order."""
        kicks = list[Kick]()
        for longest, points, table in self._sides:
            kicks += self._kicks(longest, points, table)
        return tuple(sorted(kicks, key=lambda kick: kick.time))

    def _kicks(self, side: bool, points: Array, table: tables.Table) -> list[Kick]:
        """Kicks at one side's points, of which `points` are the indices; `side` is whether it is the longest axis'."""
        times = self.times
        a2 = self.a2
        # Columns 0 to 3 of the resonances are k₁, k₂, a² and dD/da² over l. A path meets a resonance
        # between neighbours, one above and one below its a².
        above = a2[points, None] > table.resonances[:, 2]
        at, which = np.nonzero((np.diff(points) == 1)[:, None] & (above[1:] != above[:-1]))
        if not len(at):
            return []
        at = points[at]
        k1, k2, there, slope = table.resonances[which, :4].T
        # The path meets each resonance between two points: `share` is where between them.
        share = (there - a2[at]) / (a2[at + 1] - a2[at])
        step = times[at + 1] - times[at]
        when = times[at] + share * step
        drift = np.abs(a2[at + 1] - a2[at]) / step
        slow = self.slow[at] + share[:, None] * (self.slow[at + 1] - self.slow[at])
        rates = self.rates[at] + share[:, None, None] * (self.rates[at + 1] - self.rates[at])
        size, strength, along, turned = self._modes(side, slow, rates, table.resonances[which])
        # √(1/(St |D'|)), where D' is l `slope` times the rate of a².
        width = np.sqrt(self.torque_factor / (size * np.abs(slope) * drift))
        # √(2π) widths, and never longer than the run.
        lasting = np.minimum(sqrt(2 * pi) * width, times[-1])
        strength = lasting * strength
        along = lasting[:, None] * along
        bend = lasting * np.abs(turned) * width / (sqrt(2 * pi) * self.torque_factor)
        return [
            Kick(
                time=float(when[i]),
                size=float(strength[i]),
                mode=(int(k1[i]), int(k2[i])),
                width=float(width[i]),
                along=along[i],
                bend=float(bend[i]),
                drift=float(drift[i] * width[i]),
            )
            for i in range(len(at))
        ]

    @cached_property
    def beside(self) -> Array:
        """Passing errors of L and E, over I_max, beside resonances that the path comes near and does not pass.

        Their modes swing L and E with an amplitude like 1/D, D their frequency. The change of D by the
        swing is left out: in the distance in a², errors fall like its third power.
        """
        errors = np.zeros(len(self.times))
        for longest, points, table in self._sides:
            a2 = self.a2[points]
            there = table.resonances[:, 2]
            resonances = table.resonances[(there < a2.min()) | (there > a2.max())]
            if not len(resonances):
                continue
            there, slope = resonances[:, 2:4].T
            distances = np.abs(a2[:, None] - there)
            # The strength of each mode is taken where the path is nearest to its resonance.
            nearest = points[distances.argmin(axis=0)]
            size, strength, _, turned = self._modes(
                longest, self.slow[nearest], self.rates[nearest], resonances
            )
            # At unit distance: D in slow time, the amplitude of L, and the change of D over D.
            frequency = size * np.abs(slope) / self.torque_factor
            amplitude = strength / frequency
            share = np.abs(turned) / self.torque_factor / frequency**2
            change = np.sum(amplitude * share / distances**3, axis=1)
            errors[points] += _ERROR_BESIDE_RESONANCE * change
        return errors

    def _modes(
        self, side: bool, slow: Array, rates: Array, resonances: Array
    ) -> tuple[Array, Array, Array, Array]:
        """The modes of n resonances, rows of `Table.resonances`, in slow time.

        `slow` is (L, E) and `rates` is `Path.rates`, shapes (n, 4) and (n, 2, 2), where each mode is met.
        Returns |L|, the modes of L' and of (|L|', E') over I_max, and the mode of (|L| D)', D = k₁ν₁ + k₂ν₂, that
        the latter makes. Their shapes are (n,), (n,), (n, 2) and (n,).
        """
        k1, k2, there = resonances[:, :3].T
        unit = max(self.ellipsoid.inertia)
        size = np.linalg.norm(slow[:, :3], axis=1)
        series = series_for(self.ellipsoid, side)
        modes = modes_at(series, slow[:, :3], there, k1.astype(int), k2.astype(int))
        # A mode P exp(iφ) + c.c. has the amplitude 2P.
        strength, grown, risen = (2 / unit * mode for mode in modes)
        h = 2 * slow[:, 3] / size**2
        fall = np.exp(-there)
        # E = ½ l² h, so that its change is l h dl + ½ l² dh, with dh = (i₂ - i₃) x (1 - x) dy.
        energy = (
            size * h * grown
            + 0.5 * size**2 * _range(self.ellipsoid, side)[1] * fall * (1 - fall) * risen
        )
        along = np.stack([grown, energy], axis=1)
        turned = np.einsum("ki,kij,kj->k", np.stack([k1, k2], axis=1), rates, along)
        return size, strength, along, turned

    def crossings(self) -> list[Kick]:
        """Jumps at L² = 2EI₂, as kicks by the phase α: one wherever `a2` becomes infinite.

        Their size of infinity says that none is left out for a finite budget, their width of 0 that they are
        no resonances.
        """
        inside = np.isfinite(self.a2)
        unit = max(self.ellipsoid.inertia)
        jumps = []
        for at in np.flatnonzero(inside[:-1] & ~inside[1:]):
            # The last row but one is ν₁.
            series = tables.table(self.ellipsoid, bool(self.longest[at])).series[-2:-1]
            nu1 = tables.evaluated(series, 2 * self.a2[at : at + 1] / tables.MAX_A2 - 1)[0, 0]
            rate = abs(np.gradient(self.slow[:, 3], self.times)[at]) / unit
            taken = rate * self.torque_factor * 2 * pi / (unit * self.size[at] * nu1)
            # `taken` is what E changes by in a period of the polhode. √2 makes an amplitude of a root
            # mean square.
            jump = np.array([0, sqrt(2 * _SADDLE) * taken / (4 * pi)])
            jumps.append(
                Kick(
                    time=float(self.times[at]),
                    size=inf,
                    mode=(1, 0),
                    width=0.0,
                    along=jump,
                    bend=0.0,
                    drift=0.0,
                )
            )
        return jumps

    @cached_property
    def rates(self) -> Array:
        """Rates of (α, β), over St, per change of (|L|, E) over I_max, shape (m, 2, 2)."""
        unit = max(self.ellipsoid.inertia)
        size = self.size
        energy = self.slow[:, 3] / max(self.ellipsoid.inertia)
        rates = np.zeros((len(self.times), 2, 2))
        for side, points, table in self._sides:
            t = 2 * self.a2[points] / tables.MAX_A2 - 1
            _, width = _range(self.ellipsoid, side)
            nu, rise = np.split(tables.evaluated(table.turning, t).T, 2, axis=1)
            # The rates are |L| ν. `steep` is ∂a²/∂E, so that `rise` becomes |L| ∂ν/∂E; `fall` is ∂a²/∂|L|
            # over ∂a²/∂E, as a² depends on E/L² alone. E is `energy` and |L| is `size`, over I_max.
            steep = 2 * np.exp(self.a2[points]) / (unit * size[points] ** 2 * width)
            rise = unit * (size[points] * steep)[:, None] * rise
            fall = -2 * energy[points] / size[points]
            rates[points] = np.stack([unit * nu + fall[:, None] * rise, rise], axis=2)
        return rates

    @cached_property
    def turned(self) -> Array:
        """(α, β) turned by each time per lasting error of (|L|, E) over I_max, shape (m, 2, 2)."""
        return self.summed(self.rates) / self.torque_factor

    def turned_at(self, times: Array) -> Array:
        """The same at other times, shape (n, 2, 2)."""
        return _interpolated(times, self.times, self.turned.reshape(-1, 4)).reshape(-1, 2, 2)

    def summed(self, rates: Array) -> Array:
        """Integrals from the start to each time, the first index."""
        integrals = np.zeros(rates.shape)
        ((rates[1:] + rates[:-1]).T * np.diff(0.5 * self.times)).T.cumsum(axis=0, out=integrals[1:])
        return integrals

    def may_cross(self, error: float) -> Array:
        """Whether an error of L and E, over I_max, carries the run out of the tables or their side."""
        if self.ellipsoid.kind != "triaxial":
            return np.zeros(len(self.times), bool)
        unit = max(self.ellipsoid.inertia)
        _, width = _range(self.ellipsoid, self.longest)
        # `moved` is the change of x = (h - i₃)/(i₂ - i₃), h = 2E/L², by errors of E and of |L|. It may
        # take 1 - x, which is exp(-a²), to the end of the tables.
        with np.errstate(all="ignore"):
            moved = (
                error
                * 2
                * (1 + 2 * self.slow[:, 3] / (unit * self.size))
                / (unit * self.size**2 * np.abs(width))
            )
        return ~(np.exp(-self.a2) > exp(-tables.MAX_A2) + moved)


@once(size=_CACHED_PATHS)
def path_of(scene: Scene) -> Path:
    """The path of a scene, cached for outlines with other budgets.

    Raises FormNotValidError if the library that follows paths is missing.
    """
    try:
        return Path.of(scene)
    except ModuleNotFoundError as error:
        raise FormNotValidError(
            f"{error.name}, which follows first-order paths, is not installed"
        ) from None


def plain_dephasing(ellipsoid: Ellipsoid) -> float:
    """`Path.dephasing` of a body with |ω| <= 1, away from L² = 2EI₂."""
    # The body precesses at about |L|/I₂, a spheroid exactly so. An error e of |L| over I_max changes this
    # rate by e I_max/I₂.
    _, middle, high = sorted(ellipsoid.inertia)
    return high / middle


def _interpolated(points: Array, times: Array, rows: Array) -> Array:
    """Rows, shape (m, k) at `times`, interpolated linearly at `points`, shape (n, k)."""
    return np.stack([np.interp(points, times, column) for column in rows.T], axis=1)


def _range(ellipsoid: Ellipsoid, longest: Array | bool) -> tuple[Array, Array]:
    """2E/L² of a side's permanent axis, and the way from there to L² = 2EI₂."""
    low, middle, high = sorted(ellipsoid.inertia)
    axis = 1 / np.where(longest, low, high)
    return axis, 1 / middle - axis
