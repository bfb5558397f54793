"""The first-order solution of a scene, and what averaging is like along it: its size, and the resonances it passes."""

from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property, lru_cache
from math import exp, inf, pi, sqrt

import numpy as np

from polhode.models.catalogue import averaged_form
from polhode.models.catalogue import form as find_form
from polhode.models.form import FormNotValidError
from polhode.models.forms.spheroid import Spheroid
from polhode.models.operations import FLOAT, numpy_operations
from polhode.models.scene import Scene
from polhode.models.second_order import spheroid as spheroidal
from polhode.models.second_order import tables
from polhode.models.second_order.averages import NAMES
from polhode.models.second_order.field import averaged_rates, regular
from polhode.models.second_order.slow_path import interpolated, refined, slow_path
from polhode.models.second_order.swing import modes_at, series_for
from polhode.models.shape import Ellipsoid

Array = np.ndarray

# |L| over I_max below which a body does not rotate.
TINY = 1e-12
# Depth a² at which tables end, less what a first-order path may be wrong by.
DEEPEST = tables.MOST - 0.2
# Of resonances, the least and the largest half width of a window, in √(|dD/dt|/St) of the divisor.
WIDTHS = (5.0, 40.0)
# Least speed at which the shear turns a body.
LEAST_SPEED = 0.5
# What L² = 2EI₂ makes of a phase: E changes by ½ ln(2 sin ψ/2) of what a polhode takes, and the mean square of cot ψ/2
# is this over 97.5 % of the phases ψ (Neishtadt, Sov. J. Plasma Phys. 12, 1986).
SADDLE = 15.0
# Square of the slow time, in 1/(St times the slowest damping rate), in which |L| rises from 0 to where averaging holds.
RISEN = 45.0


@dataclass(frozen=True, eq=False)
class Kick:
    """What a resonance gives L, over I_max."""

    time: float
    size: float
    mode: tuple[int, int]
    width: float  # time that the phase takes to turn by a radian there
    along: Array  # what it gives (|L|, E), over I_max, complex: the part of the phase that happens to be is real

    def window(self, budget: float) -> float:
        """Half width of the window outside which less than the budget is missed."""
        least, largest = WIDTHS
        return self.width * min(largest, max(least, 2.5 * (self.size / budget) ** (1 / 3)))

    def missed(self, times: Array) -> Array:
        """What the averaged equations miss of it at times outside a window."""
        away = np.abs(times - self.time)
        return 2 * self.size * np.minimum(1, self.width / np.maximum(away, 1e-300)) ** 3


@dataclass(frozen=True)
class Path:
    """The first-order solution of a scene, and what averaging is like along it."""

    ellipsoid: Ellipsoid
    torque_factor: float
    times: Array
    slow: Array
    size: Array  # |L| over I_max
    a2: Array  # inf on L² = 2EI₂ and beyond the tables
    longest: Array  # the side
    swing: Array  # rho
    second: Array  # |L'| of second order over I_max

    @classmethod
    def of(cls, scene: Scene) -> "Path":
        """The path of a scene with 0 < St < inf."""
        form = find_form(averaged_form(scene))
        times, slow = np.zeros(1), scene.initial.slow
        # Where L is 0 or along the middle axis, nothing is averaged.
        with suppress(FormNotValidError):
            problem = form.problem(scene)
            rhs, p = problem.field(FLOAT), problem.parameters
            times, states = slow_path(lambda y: rhs(y, p), problem.start, problem.end)
            with np.errstate(all="ignore"):
                slopes = np.stack(problem.field(numpy_operations())(states.T, p), axis=1)
            times, states = refined(times, states, np.nan_to_num(slopes))
            slow = form.observe(scene, states).slow
        if times[-1] < scene.slow_time:
            # |L| is 0 or falls to it: what is said of it holds until it has risen again.
            end = times[-1] + sqrt(RISEN * scene.torque_factor / min(scene.ellipsoid.damping))
            times, slow = np.append(times, min(end, scene.slow_time)), slow[[*range(len(times)), -1]]
        return cls._along(scene.ellipsoid, scene.torque_factor, times, slow)

    def at(self, times: Array) -> "Path":
        """The same at further times."""
        every = np.union1d(self.times, times[(times > 0) & (times < self.times[-1])])
        slow = interpolated(every, self.times, self.slow)
        return self._along(self.ellipsoid, self.torque_factor, every, slow)

    @classmethod
    def _along(cls, ellipsoid: Ellipsoid, torque_factor: float, times: Array, slow: Array) -> "Path":
        unit = max(ellipsoid.inertia)
        size = np.linalg.norm(slow[:, :3], axis=1) / unit
        swing, second = np.full(len(times), inf), np.full(len(times), inf)
        longest, a2 = np.zeros(len(times), bool), np.zeros(len(times))
        if ellipsoid.kind != "triaxial":
            here = size > TINY
            swing[here], second[here] = spheroidal.orders(Spheroid.of(ellipsoid), torque_factor, slow[here])
        else:
            i3, i2, i1 = (1 / inertia for inertia in sorted(ellipsoid.inertia, reverse=True))
            with np.errstate(all="ignore"):
                h = 2 * slow[:, 3] / (unit * size) ** 2
                longest = h > i2
                a2 = tables.depth(np.clip(np.where(longest, (i1 - h) / (i1 - i2), (h - i3) / (i2 - i3)), 0, 1))
            a2[~((a2 < DEEPEST) & (size > TINY))] = inf
            for side in (False, True):
                here = np.isfinite(a2) & (longest == side)
                if here.any():
                    found = tables.table(ellipsoid, side)
                    swing[here] = _swing(found, unit * size[here], a2[here]) * torque_factor
                    second[here] = _second(found, unit, slow[here, :3] / unit, a2[here]) * torque_factor
        return cls(ellipsoid, torque_factor, times, slow, size, a2, longest, swing, second)

    @property
    def _sides(self) -> tuple[bool, ...]:
        return (False, True) if self.ellipsoid.kind == "triaxial" else ()

    @cached_property
    def kicks(self) -> tuple[Kick, ...]:
        """Kicks of the resonances that the path passes, in their order."""
        found = []
        for side in self._sides:
            here = np.isfinite(self.a2) & (self.longest == side)
            if (here[1:] & here[:-1]).any():
                found += self._kicks(side, here)
        return tuple(sorted(found, key=lambda kick: kick.time))

    def crossings(self) -> list[Kick]:
        """Jumps at L² = 2EI₂, as kicks by the phase α."""
        inside, unit = np.isfinite(self.a2), max(self.ellipsoid.inertia)
        rates = np.gradient(self.slow[:, 3] / unit, self.times) if len(self.times) > 1 else np.zeros(1)
        found = []
        for at in np.flatnonzero(inside[:-1] & ~inside[1:]):
            series = tables.table(self.ellipsoid, bool(self.longest[at])).series[-2:-1]
            nu1 = tables.evaluated(series, 2 * self.a2[at : at + 1] / tables.MOST - 1)[0, 0]
            taken = abs(rates[at]) * self.torque_factor * 2 * pi / (unit * self.size[at] * nu1)
            jump = np.array([0, sqrt(2 * SADDLE) * taken / (4 * pi)])
            found.append(Kick(float(self.times[at]), inf, (1, 0), 0.0, jump))
        return found

    def _kicks(self, side: bool, here: Array) -> list[Kick]:
        unit, times, a2 = max(self.ellipsoid.inertia), self.times, self.a2
        table = tables.table(self.ellipsoid, side)
        above = a2[:, None] > table.resonances[:, 2]
        at, which = np.nonzero((here[1:] & here[:-1])[:, None] & (above[1:] != above[:-1]))
        if not len(at):
            return []
        k1, k2, there, slope = table.resonances[which, :4].T
        share, step = (there - a2[at]) / (a2[at + 1] - a2[at]), times[at + 1] - times[at]
        when, drift = times[at] + share * step, np.abs(a2[at + 1] - a2[at]) / step
        slow = self.slow[at] + share[:, None] * (self.slow[at + 1] - self.slow[at])
        size = np.linalg.norm(slow[:, :3], axis=1)
        width = np.sqrt(self.torque_factor / (size * np.abs(slope) * drift))
        lasting = 2 / unit * np.minimum(sqrt(2 * pi) * width, times[-1])
        found = modes_at(series_for(self.ellipsoid, side), slow[:, :3], there, k1.astype(int), k2.astype(int))
        strength, grown, risen = (lasting * each for each in found)
        h, fall = 2 * slow[:, 3] / size**2, np.exp(-there)
        energy = size * h * grown + 0.5 * size**2 * self._width(side) * fall * (1 - fall) * risen
        modes = zip(k1.astype(int).tolist(), k2.astype(int).tolist(), strict=True)
        along = np.stack([grown, energy], axis=1)
        numbers = when.tolist(), strength.tolist(), modes, width.tolist(), along
        return [Kick(*each) for each in zip(*numbers, strict=True)]

    def _width(self, longest: bool) -> float:
        """i₂ - i₃ of a side."""
        i3, i2, i1 = (1 / inertia for inertia in sorted(self.ellipsoid.inertia, reverse=True))
        return i2 - i1 if longest else i2 - i3

    def may_cross(self, error: float) -> Array:
        """Where an error of L and E over I_max carries the run to the end of the tables or across L² = 2EI₂."""
        if self.ellipsoid.kind != "triaxial":
            return np.zeros(len(self.times), bool)
        unit, width = max(self.ellipsoid.inertia), np.where(self.longest, self._width(True), -self._width(False))
        with np.errstate(all="ignore"):
            moved = error * 2 * (1 + 2 * self.slow[:, 3] / (unit * self.size)) / (unit * self.size**2 * np.abs(width))
        return ~(np.exp(-self.a2) > exp(-tables.MOST) + moved)

    @cached_property
    def turned(self) -> Array:
        """(α, β) turned until each time per lasting error of (|L|, E) over I_max, shape (m, 2, 2)."""
        unit, size, energy = max(self.ellipsoid.inertia), self.size, self.slow[:, 3] / max(self.ellipsoid.inertia)
        rates = np.zeros((len(self.times), 2, 2))
        for side in self._sides:
            here = np.isfinite(self.a2) & (self.longest == side)
            if here.any():
                table, t = tables.table(self.ellipsoid, side), 2 * self.a2[here] / tables.MOST - 1
                nu, rise = (tables.evaluated(row, t).T for row in (table.series[-2:], table.rises))
                # ∂a²/∂E, and ∂a²/∂|L| over it.
                steep = 2 * np.exp(self.a2[here]) / (unit * size[here] ** 2 * self._width(side))
                rise, fall = unit * (size[here] * steep)[:, None] * rise, -2 * energy[here] / size[here]
                rates[here] = np.stack([unit * nu + fall[:, None] * rise, rise], axis=2)
        gained = 0.5 * (rates[1:] + rates[:-1]) * np.diff(self.times)[:, None, None] / self.torque_factor
        return np.concatenate([np.zeros((1, 2, 2)), np.cumsum(gained, axis=0)])

    @cached_property
    def speed(self) -> Array:
        """How fast the body turns, about: 2E/|L|, or as fast as the shear turns any."""
        size = np.linalg.norm(self.slow[:, :3], axis=1)
        return np.maximum(LEAST_SPEED, 2 * self.slow[:, 3] / np.maximum(size, 1e-300))

    def summed(self, rates: Array) -> Array:
        """Integrals, shape (m,), from the start to each time."""
        return np.append(0.0, np.cumsum(0.5 * (rates[1:] + rates[:-1]) * np.diff(self.times)))

    def lag(self, swing: Array) -> Array:
        """Errors of the angles, in rad: their rates miss the mean square of the swing, half its largest one's."""
        return self.summed(self.speed * swing**2 / 2) / self.torque_factor

    def phase(self, error: Array) -> Array:
        """Errors of the angles, in rad, from errors of L that last, shape (m, n): what these make of their rates."""
        speed = max(self.ellipsoid.inertia) / sorted(self.ellipsoid.inertia)[1] / self.torque_factor
        gained = np.diff(self.times)[:, None] * error[:-1] * speed
        return np.minimum(np.concatenate([np.zeros((1, error.shape[1])), np.cumsum(gained, axis=0)]), pi)


@lru_cache(maxsize=16)
def path_of(scene: Scene) -> Path:
    """The path of a scene, kept for outlines with other budgets."""
    return Path.of(scene)


def _swing(found: tables.Table, size: Array, a2: Array) -> Array:
    flow, drag = (np.interp(a2, tables.POINTS[::-1], row[::-1]) for row in found.swing.T)
    return flow / size**2 + drag / size


def _second(found: tables.Table, unit: float, momentum: Array, a2: Array) -> Array:
    """Size of L' of second order, over I_max, for L over I_max."""
    values = tables.evaluated(found.series[8:18], 2 * a2 / tables.MOST - 1)
    for pole in found.poles:
        twice, once = regular(a2 - pole[0], 1e-2 + 0 * a2)
        values += np.outer(pole[2:12], twice) + np.outer(pole[12:], once)
    values = values / np.array([unit ** tables.SCALES.get(name, tables.HIGHEST_SCALE) for name in NAMES[8:18]])[:, None]
    size = np.linalg.norm(momentum, axis=1)
    nothing = np.zeros(len(size))
    growth, _, *across = averaged_rates(numpy_operations())(
        size,
        (momentum / size[:, None]).T,
        (nothing, nothing, *values[:2]),
        (nothing, nothing, *values[2:4]),
        (nothing, nothing),
        values[4:],
    )
    return np.linalg.norm(growth[:, None] * momentum + np.stack(across, axis=1), axis=1)
