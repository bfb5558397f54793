"""Where a run can be followed by averaging to second order, and how wrong it is there, before anything is solved.

The first-order solution says where the run goes. Along it rho, the size of the near-identity transformation over St,
is what each order of averaging is smaller by than the one before.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from math import inf, pi, sqrt

import numpy as np

from polhode.models.catalogue import averaged_form
from polhode.models.catalogue import form as find_form
from polhode.models.forms.spheroid import Spheroid
from polhode.models.operations import FLOAT, numpy_operations
from polhode.models.scene import Scene
from polhode.models.second_order import spheroid as spheroidal
from polhode.models.second_order import tables
from polhode.models.second_order.averages import NAMES
from polhode.models.second_order.field import averaged_rates, regular
from polhode.models.second_order.slow_path import interpolated, refined, slow_path
from polhode.models.shape import Ellipsoid

Array = np.ndarray

# Above this rho the expansion in 1/St means nothing.
MEANINGLESS = 0.35
# Depth a² at which tables end, less what a first-order path may be wrong by.
DEEPEST = tables.MOST - 0.2
# Third-order terms over what rho makes of those of second order, so that estimates bound most runs.
MARGIN = 4.5
# Share of the error asked for that averaging may cost; a kick may cost a quarter of that.
SHARE = 0.5
# Of resonances, the least and the largest half width of a window, in √(|dD/dt|/St) of the divisor.
WIDTHS = (5.0, 40.0)
# Turns of the body that a stretch between windows lasts at least, lest it cost more than it saves.
TURNS = 300
# Share of the slowest damping rate at which errors are forgotten; levels between which windows are chosen.
FADING, LEVELS = 0.15, 30
# Square of the slow time, in 1/(St times the slowest damping rate), in which |L| rises from 0 to where averaging holds.
RISEN = 45.0


# Reasons for which averaging means nothing, and a first-order path beyond them little.
SEPARATRIX, TOO_SLOW = "L² = 2EI₂", "St is too small for |L|"


@dataclass(frozen=True)
class Stretch:
    """From `start` to `end` in slow time, by averaging to second order or, for a `reason`, not."""

    start: float
    end: float
    second_order: bool
    reason: str = ""
    error: float = 0.0  # slow, over I_max, that averaging adds
    decisive: bool = False  # whether what follows is to be looked at anew from where it ends


@dataclass(frozen=True)
class Outline:
    """A run on its first-order path: `slow` = (L, E), shape (m, 4), at slow `times`, and its stretches."""

    times: Array
    slow: Array
    stretches: tuple[Stretch, ...]
    kicks: "tuple[Kick, ...]"
    orientation: float  # estimated error in rad of a run by second order alone, π at most

    @property
    def error(self) -> float:
        """Estimated slow error of a run by second order alone: inf if it cannot be followed."""
        return sum(each.error for each in self.stretches) if all(s.second_order for s in self.stretches) else inf


@lru_cache(maxsize=64)
def outline(scene: Scene, budget: float = inf) -> Outline:
    """Outline of a run with orientation and 0 < St < inf; windows as the error asked for demands."""
    path, share = path_of(scene), SHARE * budget
    kicks = tuple(path.kicks())
    strong = [each for each in kicks if each.size > share / 4]
    if strong:
        # A window may be narrower than the path's steps.
        shares = np.concatenate([[-1.01], np.linspace(-1, 1, 9) * (1 - 1e-9), [1.01]])
        path = path.at(np.concatenate([each.time + each.window(share / 4) * shares for each in strong]))
    reasons, sudden = path.reasons(), np.zeros(len(path.times))
    swing, second = (np.where(reasons == "", each, 0) for each in (path.swing, path.second))
    local = MARGIN * swing**2 * path.size
    for each in kicks:
        if each.size > share / 4:
            away, name = np.abs(path.times - each.time), f"resonance ({each.mode[0]:.0f}, {each.mode[1]:.0f})"
            reasons[away <= each.window(share / 4)] = name
            local = local + 2 * each.size * np.minimum(1, each.width / np.maximum(away, 1e-300)) ** 3
        else:
            sudden[np.searchsorted(path.times, each.time)] += each.size
    sudden = np.where(reasons == "", sudden, 0)
    held = np.where(reasons == "", MARGIN * second * swing, 0) * np.gradient(path.times)
    late = np.tril(np.exp(-np.maximum(path.fading * (path.times[:, None] - path.times), 0)))
    levels = np.append(np.geomspace(1, 1e-8, LEVELS) * held.max(), 0)
    errors = late @ np.where(held[:, None] <= levels, held[:, None], 0)
    # Where the phase is wrong, the swing is put back wrongly.
    wrong = path.phase(errors) * np.where(reasons == "", swing * path.size, 0)[:, None]
    kept = int(np.argmax((errors + wrong).max(axis=0) <= share))
    reasons[(reasons == "") & ((held > levels[kept]) | (local > share))] = "the error asked for"
    drifting = errors[:, kept] + late @ sudden
    error = drifting + local + wrong[:, kept]
    return Outline(path.times, path.slow, path.stretches(reasons, error), kicks, path.orientation(drifting))


@dataclass(frozen=True)
class Kick:
    """What a resonance gives L, over I_max, if it is averaged over."""

    time: float
    size: float
    mode: tuple[float, float]
    width: float  # time that the phase takes to turn by a radian there

    def window(self, budget: float) -> float:
        """Half width of the window outside which less than the budget is missed."""
        least, largest = WIDTHS
        return self.width * min(largest, max(least, 2.5 * (self.size / budget) ** (1 / 3)))


@dataclass(frozen=True)
class _Path:
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
    def of(cls, scene: Scene) -> "_Path":
        form = find_form(averaged_form(scene))
        times, slow = np.zeros(1), scene.initial.slow
        if np.any(scene.initial.angular_momentum):
            problem = form.problem(scene)
            rhs, p = problem.field(FLOAT), problem.parameters
            times, states = slow_path(
                lambda y: np.array(rhs(tuple(y.tolist()), p)), np.array(problem.start), problem.end
            )
            with np.errstate(all="ignore"):
                slopes = np.stack(problem.field(numpy_operations())(states.T, p), axis=1)
            times, states = refined(times, states, np.nan_to_num(slopes))
            slow = form.observe(scene, states).slow
        if times[-1] < scene.slow_time:
            # |L| is 0 or falls to it: what is said of it holds until it has risen again.
            end = times[-1] + sqrt(RISEN * scene.torque_factor / min(scene.ellipsoid.damping))
            times, slow = np.append(times, min(end, scene.slow_time)), slow[[*range(len(times)), -1]]
        return cls._along(scene.ellipsoid, scene.torque_factor, times, slow)

    def at(self, times: Array) -> "_Path":
        """The same at further times."""
        every = np.union1d(self.times, times[(times > 0) & (times < self.times[-1])])
        slow = interpolated(every, self.times, self.slow)
        return self._along(self.ellipsoid, self.torque_factor, every, slow)

    @classmethod
    def _along(cls, ellipsoid: Ellipsoid, torque_factor: float, times: Array, slow: Array) -> "_Path":
        unit = max(ellipsoid.inertia)
        size = np.linalg.norm(slow[:, :3], axis=1) / unit
        swing, second = np.full(len(times), inf), np.full(len(times), inf)
        longest, a2 = np.zeros(len(times), bool), np.zeros(len(times))
        if ellipsoid.kind != "triaxial":
            here = size > 0
            swing[here], second[here] = spheroidal.orders(Spheroid.of(ellipsoid), torque_factor, slow[here])
        else:
            i3, i2, i1 = (1 / inertia for inertia in sorted(ellipsoid.inertia, reverse=True))
            with np.errstate(all="ignore"):
                h = 2 * slow[:, 3] / (unit * size) ** 2
                longest = h > i2
                a2 = tables.depth(np.clip(np.where(longest, (i1 - h) / (i1 - i2), (h - i3) / (i2 - i3)), 0, 1))
            a2[~(a2 < DEEPEST)] = inf
            for side in (False, True):
                here = np.isfinite(a2) & (longest == side)
                if here.any():
                    found = tables.table(ellipsoid, side)
                    swing[here] = _swing(found, unit * size[here], a2[here]) * torque_factor
                    second[here] = _second(found, unit, slow[here, :3] / unit, a2[here]) * torque_factor
        return cls(ellipsoid, torque_factor, times, slow, size, a2, longest, swing, second)

    def reasons(self) -> Array:
        """Why averaging does not hold at the times of the path: "" where it does."""
        reasons = np.where(np.isfinite(self.a2), "", SEPARATRIX).astype(object)
        reasons[np.isfinite(self.a2) & ~(self.swing < MEANINGLESS)] = TOO_SLOW
        reasons[~(self.size > 0)] = TOO_SLOW
        return reasons

    def kicks(self) -> Iterator[Kick]:
        """Kicks of the resonances that the path passes."""
        unit = max(self.ellipsoid.inertia)
        for side in (False, True) if self.ellipsoid.kind == "triaxial" else ():
            here = np.isfinite(self.a2) & (self.longest == side)
            if not here.any():
                continue
            for k1, k2, a2, slope, still, gain in tables.table(self.ellipsoid, side).resonances.tolist():
                above = self.a2 > a2
                for i in np.flatnonzero(here[1:] & here[:-1] & (above[1:] != above[:-1])):
                    drift = abs(self.a2[i + 1] - self.a2[i]) / (self.times[i + 1] - self.times[i])
                    share = (a2 - self.a2[i]) / (self.a2[i + 1] - self.a2[i])
                    time = self.times[i] + share * (self.times[i + 1] - self.times[i])
                    width = sqrt(self.torque_factor / (unit * self.size[i] * abs(slope) * drift))
                    size = 2 * (still + gain * unit * self.size[i]) / unit * min(sqrt(2 * pi) * width, self.times[-1])
                    yield Kick(time, size, (k1, k2), width)

    def stretches(self, reasons: Array, error: Array) -> tuple[Stretch, ...]:
        """Stretches of the run; those by second order last a while, unless it is the whole run."""
        turn = 2 * pi * self.torque_factor * max(self.ellipsoid.inertia)
        # Windows reach from a sound point to a sound point.
        between = [one or other for one, other in pairwise(reasons)]
        changes = [i for i in range(1, len(between)) if bool(between[i]) != bool(between[i - 1])]
        found: list[tuple[int, int]] = []
        for first, last in pairwise([0, *changes, len(between)]):
            turns = (self.times[last] - self.times[first]) * self.size[first] / turn
            if found and (between[first] or turns < TURNS) and between[found[-1][0]]:
                found[-1] = found[-1][0], last
            else:
                found.append((first, last))
        return tuple(
            Stretch(
                float(self.times[first]),
                float(self.times[last]),
                not between[first],
                "; ".join(dict.fromkeys(each for each in between[first:last] if each)),
                0.0 if between[first] else float(error[first : last + 1].max()),
                any(each in (SEPARATRIX, TOO_SLOW) for each in between[first:last]),
            )
            for first, last in found
        )

    def phase(self, error: Array) -> Array:
        """Errors of the angles, in rad, from errors of L that last, shape (m, n): what these make of their rates."""
        speed = max(self.ellipsoid.inertia) / sorted(self.ellipsoid.inertia)[1] / self.torque_factor
        gained = np.diff(self.times)[:, None] * error[:-1] * speed
        return np.minimum(np.concatenate([np.zeros((1, error.shape[1])), np.cumsum(gained, axis=0)]), pi)

    def orientation(self, error: Array) -> float:
        """Estimated error of the angles, in rad, from an error of L that lasts."""
        if not np.isfinite(self.swing).all():
            return pi
        return float(min(pi, self.phase(error[:, None])[-1, 0] + self.swing.max()))

    @property
    def fading(self) -> float:
        """Rate at which errors are forgotten."""
        return FADING * min(self.ellipsoid.damping)


@lru_cache(maxsize=16)
def path_of(scene: Scene) -> _Path:
    """The path of a scene, kept for outlines with other budgets."""
    return _Path.of(scene)


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
