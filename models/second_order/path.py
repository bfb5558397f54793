"""The first-order solution of a scene, and what averaging is like along it: its size, and the resonances it passes."""

from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from math import exp, inf, pi, sqrt

import numpy as np

from polhode.models.catalogue import averaged_form, form as find_form
from polhode.models.form import FormNotValidError
from polhode.models.forms.spheroid import Spheroid
from polhode.models.once import once
from polhode.models.registry import imported
from polhode.models.scene import Scene
from polhode.models.second_order import spheroid as spheroidal, tables
from polhode.models.second_order.extent import extent
from polhode.models.second_order.swing import modes_at, series_for
from polhode.models.second_order.tables import Kick
from polhode.models.shape import Ellipsoid

Array = np.ndarray

# The solver that follows a path, imported on use, as models know no solvers; its tolerance, by
# which kicks are where they are said to be. Points of a path, and of a spheroid's, which has no
# kicks.
FOLLOWED = "polhode.solvers.following:followed"
TOLERANCE = 1e-8
_KICKED = 240
_SMOOTH = 100
# |L| over I_max below which a body does not rotate, and what times lie apart at least, over the whole: rates are taken
# between them.
TINY = 1e-12
_CLOSE = 1e-12
# Depth a² at which tables end, less what a first-order path may be wrong by.
_DEEPEST = tables.MOST - 0.2
# Third-order terms over what rho makes of those of second order, so that estimates bound most runs;
# chosen by trial.
_MARGIN = 3.6
# Of those of first order, over the square of the damping over a radian; by trial, too.
_DAMPED = 0.05
# Least speed at which the shear turns a body.
LEAST_SPEED = 0.5
# What L² = 2EI₂ makes of a phase: E changes by ln(2 sin α)/(4K) of what a polhode takes, the mean
# square of cot α being this over 97.5 % of the phases α (Neishtadt, Sov. J. Plasma Phys. 12, 1986).
# At the end of the tables the elliptic integral 4K is some 15; 4π, which is less, is taken for it.
_SADDLE = 15.0
# Square of the slow time, in 1/(St times the slowest damping rate), in which |L| rises from 0 far
# enough; by trial.
_RISEN = 45.0


@dataclass(frozen=True)
class Path:
    """The first-order solution of a scene, and what averaging is like along it."""

    ellipsoid: Ellipsoid
    torque_factor: float
    times: Array
    slow: Array

    @classmethod
    def of(cls, scene: Scene) -> "Path":
        """The path of a scene with 0 < St < inf."""
        form = find_form(averaged_form(scene))
        times = np.zeros(1)
        slow = scene.initial.slow
        # Where L is 0 or along the middle axis, nothing is averaged.
        with suppress(FormNotValidError):
            problem = form.problem(scene)
            points = _KICKED if scene.ellipsoid.kind == "triaxial" else _SMOOTH
            times, states = imported(FOLLOWED)(problem, TOLERANCE, points)
            # Times of a short run may lie closer than numbers can.
            apart = np.append(True, np.diff(times) > 0)
            times = times[apart]
            slow = form.observe(scene, states).slow[apart]
        if times[-1] < scene.slow_time:
            # |L| is 0 or falls to it: what is said of it holds until it has risen again.
            end = times[-1] + sqrt(_RISEN * scene.torque_factor / min(scene.ellipsoid.damping))
            # At large St that takes less than a digit of the time.
            if end > times[-1]:
                times = np.append(times, min(end, scene.slow_time))
                slow = slow[[*range(len(slow)), -1]]
        return cls(scene.ellipsoid, scene.torque_factor, times, slow)

    def at(self, times: Array) -> "Path":
        """The same at further times."""
        every = np.union1d(self.times, times[(times > 0) & (times < self.times[-1])])
        every = every[np.append(np.diff(every) > _CLOSE * every[-1], True)]
        slow = _interpolated(every, self.times, self.slow)
        return replace(self, times=every, slow=slow)

    @cached_property
    def size(self) -> Array:
        """|L| over I_max."""
        lx, ly, lz, _ = self.slow.T
        return np.sqrt(lx * lx + ly * ly + lz * lz) / max(self.ellipsoid.inertia)

    @cached_property
    def spin(self) -> Array:
        """max(1, |ω|), at most."""
        # |ω|² is at most (1/I₁ + 1/I₃) 2E - L²/(I₁I₃), as the rotation about the middle axis only lessens it.
        low, _, high = sorted(self.ellipsoid.inertia)
        return np.sqrt(
            np.maximum(2 * self.slow[:, 3] * (1 / low + 1 / high) - high / low * self.size**2, 1)
        )

    @cached_property
    def scale(self) -> Array:
        """What changes of L over |L| and of the pose in rad make a slow error, over I_max, at most."""
        return self.size * self.spin

    @cached_property
    def longest(self) -> Array:
        """Whether the side is that of the longest axis."""
        return (
            2 * self.slow[:, 3] * sorted(self.ellipsoid.inertia)[1]
            > (max(self.ellipsoid.inertia) * self.size) ** 2
        )

    @cached_property
    def a2(self) -> Array:
        """a² = -ln(1 - x); inf on L² = 2EI₂ and beyond the tables."""
        if self.ellipsoid.kind != "triaxial":
            return np.zeros(len(self.times))
        axis, width = _range(self.ellipsoid, self.longest)
        with np.errstate(all="ignore"):
            h = 2 * self.slow[:, 3] / (max(self.ellipsoid.inertia) * self.size) ** 2
            a2 = -np.log1p(-np.clip((h - axis) / width, 0, 1))
        return np.where((a2 < _DEEPEST) & (self.size > TINY), a2, inf)

    @cached_property
    def _sides(self) -> list[tuple[bool, Array, tables.Table]]:
        """Sides of L² = 2EI₂ on which the path lies: whether that of the longest axis, where, and the table."""
        sides = (False, True) if self.ellipsoid.kind == "triaxial" else ()
        found = [
            (side, np.flatnonzero(np.isfinite(self.a2) & (self.longest == side))) for side in sides
        ]
        return [
            (side, here, tables.table(self.ellipsoid, side)) for side, here in found if len(here)
        ]

    @cached_property
    def _orders(self) -> Array:
        swing, second = orders = np.full((2, len(self.times)), inf)
        if self.ellipsoid.kind != "triaxial":
            here = self.size > TINY
            orders[:, here] = spheroidal.orders(
                Spheroid.of(self.ellipsoid), self.torque_factor, self.slow[here]
            )
        unit = max(self.ellipsoid.inertia)
        for longest, here, found in self._sides:
            size = extent(self.ellipsoid, longest, self.slow[here, :3], self.a2[here])
            swing[here] = size * self.torque_factor
            steep = np.exp(-self.a2[here]) * self.a2[here] * _range(self.ellipsoid, longest)[1]
            second[here] = (
                tables.second(found, unit, self.slow[here] / unit, self.a2[here], steep)
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
    def smaller(self) -> Array:
        """What terms of third order are over those of second order: rho, or how far L changes in a radian."""
        slow = self.change / np.maximum(self.size, TINY) * self.torque_factor / self.speed
        return np.hypot(_MARGIN * self.swing, slow)

    @cached_property
    def fading(self) -> Array:
        """How far the transformation changes in a radian, over itself: its next order is so much of it."""
        with np.errstate(all="ignore"):
            rate = np.abs(np.gradient(np.log(self.swing), self.times))
        return np.where(np.isfinite(rate), rate, 0) * self.torque_factor / self.speed

    @property
    def third(self) -> Array:
        """|L'| or |E'| of third order over I_max; that of second order may vanish where a body settles."""
        damped = max(self.ellipsoid.damping) * self.torque_factor / self.speed
        with np.errstate(invalid="ignore"):
            third = self.second * self.smaller + _DAMPED * self.change * damped**2
        # A rate of infinity times nothing is not known.
        return np.where(np.isnan(third), inf, third)

    @cached_property
    def kicks(self) -> tuple[Kick, ...]:
        """Kicks of the resonances that the path passes, in their order."""
        found = [kick for each in self._sides for kick in self._kicks(*each)]
        return tuple(sorted(found, key=lambda kick: kick.time))

    def crossings(self) -> list[Kick]:
        """Jumps at L² = 2EI₂, as kicks by the phase α."""
        inside = np.isfinite(self.a2)
        unit = max(self.ellipsoid.inertia)
        found = []
        for at in np.flatnonzero(inside[:-1] & ~inside[1:]):
            series = tables.table(self.ellipsoid, bool(self.longest[at])).series[-2:-1]
            nu1 = tables.evaluated(series, 2 * self.a2[at : at + 1] / tables.MOST - 1)[0, 0]
            rate = abs(np.gradient(self.slow[:, 3], self.times)[at]) / unit
            taken = rate * self.torque_factor * 2 * pi / (unit * self.size[at] * nu1)
            jump = np.array([0, sqrt(2 * _SADDLE) * taken / (4 * pi)])
            found.append(Kick(float(self.times[at]), inf, (1, 0), 0.0, jump, 0.0, 0.0))
        return found

    def _kicks(self, side: bool, here: Array, table: tables.Table) -> list[Kick]:
        unit = max(self.ellipsoid.inertia)
        times = self.times
        a2 = self.a2
        above = a2[here, None] > table.resonances[:, 2]
        at, which = np.nonzero((np.diff(here) == 1)[:, None] & (above[1:] != above[:-1]))
        if not len(at):
            return []
        at = here[at]
        k1, k2, there, slope = table.resonances[which, :4].T
        share = (there - a2[at]) / (a2[at + 1] - a2[at])
        step = times[at + 1] - times[at]
        when = times[at] + share * step
        drift = np.abs(a2[at + 1] - a2[at]) / step
        slow = self.slow[at] + share[:, None] * (self.slow[at + 1] - self.slow[at])
        size = np.linalg.norm(slow[:, :3], axis=1)
        width = np.sqrt(self.torque_factor / (size * np.abs(slope) * drift))
        lasting = 2 / unit * np.minimum(sqrt(2 * pi) * width, times[-1])
        found = modes_at(
            series_for(self.ellipsoid, side), slow[:, :3], there, k1.astype(int), k2.astype(int)
        )
        strength, grown, risen = (lasting * each for each in found)
        h = 2 * slow[:, 3] / size**2
        fall = np.exp(-there)
        energy = (
            size * h * grown
            + 0.5 * size**2 * _range(self.ellipsoid, side)[1] * fall * (1 - fall) * risen
        )
        modes = zip(k1.astype(int).tolist(), k2.astype(int).tolist(), strict=True)
        along = np.stack([grown, energy], axis=1)
        rates = self.rates[at] + share[:, None, None] * (self.rates[at + 1] - self.rates[at])
        turned = np.einsum("ki,kij,kj->k", np.stack([k1, k2], axis=1), rates, along)
        bend = np.abs(turned) * width / (sqrt(2 * pi) * self.torque_factor)
        times, sizes, widths, *rest = (
            each.tolist() for each in (when, strength, width, bend, drift * width)
        )
        return [Kick(*each) for each in zip(times, sizes, modes, widths, along, *rest, strict=True)]

    def may_cross(self, error: float) -> Array:
        """Where an error of L and E over I_max carries the run to the end of the tables or across L² = 2EI₂."""
        if self.ellipsoid.kind != "triaxial":
            return np.zeros(len(self.times), bool)
        unit, (_, width) = max(self.ellipsoid.inertia), _range(self.ellipsoid, self.longest)
        with np.errstate(all="ignore"):
            moved = (
                error
                * 2
                * (1 + 2 * self.slow[:, 3] / (unit * self.size))
                / (unit * self.size**2 * np.abs(width))
            )
        return ~(np.exp(-self.a2) > exp(-tables.MOST) + moved)

    @cached_property
    def turned(self) -> Array:
        """(α, β) turned until each time per lasting error of (|L|, E) over I_max, shape (m, 2, 2)."""
        return self.summed(self.rates) / self.torque_factor

    def turned_at(self, times: Array) -> Array:
        """The same at other times, shape (n, 2, 2)."""
        return _interpolated(times, self.times, self.turned.reshape(-1, 4)).reshape(-1, 2, 2)

    @cached_property
    def rates(self) -> Array:
        """Change of the rates of (α, β), over St, per change of (|L|, E) over I_max, shape (m, 2, 2)."""
        unit = max(self.ellipsoid.inertia)
        size = self.size
        energy = self.slow[:, 3] / max(self.ellipsoid.inertia)
        rates = np.zeros((len(self.times), 2, 2))
        for side, here, table in self._sides:
            t, (_, width) = 2 * self.a2[here] / tables.MOST - 1, _range(self.ellipsoid, side)
            nu, rise = np.split(tables.evaluated(table.turning, t).T, 2, axis=1)
            # ∂a²/∂E, and ∂a²/∂|L| over it.
            steep = 2 * np.exp(self.a2[here]) / (unit * size[here] ** 2 * width)
            rise = unit * (size[here] * steep)[:, None] * rise
            fall = -2 * energy[here] / size[here]
            rates[here] = np.stack([unit * nu + fall[:, None] * rise, rise], axis=2)
        return rates

    @cached_property
    def speed(self) -> Array:
        """How fast the body turns, about: 2E/|L|, or as fast as the shear turns any."""
        unit = max(self.ellipsoid.inertia)
        return np.maximum(LEAST_SPEED, 2 * self.slow[:, 3] / unit / np.maximum(self.size, 1e-300))

    @property
    def wear(self) -> Array:
        """How fast a solver's error of the full equations grows: with the angle, and with a fast body's energy."""
        return self.speed * np.maximum(1, self.scale)

    def summed(self, rates: Array) -> Array:
        """Integrals from the start to each time, the first index."""
        found = np.zeros(rates.shape)
        ((rates[1:] + rates[:-1]).T * np.diff(0.5 * self.times)).T.cumsum(axis=0, out=found[1:])
        return found

    def lag(self, swing: Array) -> Array:
        """Errors of the angles, in rad: their rates miss the mean square of the swing, half its largest one's."""
        return self.summed(self.speed * swing**2 / 2) / self.torque_factor

    def phase(self, error: Array) -> Array:
        """Errors of the angles, in rad, from slow errors that last: what these make of their rates."""
        speed = max(self.ellipsoid.inertia) / sorted(self.ellipsoid.inertia)[1] / self.torque_factor
        return np.minimum(speed * self.summed(error / self.spin), pi)


@once(size=16)
def path_of(scene: Scene) -> Path:
    """The path of a scene, kept for outlines with other budgets."""
    try:
        return Path.of(scene)
    except ModuleNotFoundError as error:
        raise FormNotValidError(
            f"{error.name}, which follows first-order paths, is not installed"
        ) from None


def _interpolated(wanted: Array, times: Array, rows: Array) -> Array:
    return np.stack([np.interp(wanted, times, column) for column in rows.T], axis=1)


def _range(ellipsoid: Ellipsoid, longest: Array | bool) -> tuple[Array, Array]:
    """2E/L² of a side's permanent axis, and the way from there to L² = 2EI₂."""
    low, middle, high = sorted(ellipsoid.inertia)
    axis = 1 / np.where(longest, low, high)
    return axis, 1 / middle - axis
