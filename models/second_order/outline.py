"""Where a run can be followed by averaging to second order, and how wrong it is there, before anything is solved.

The first-order solution says where the run goes. Along it rho, the size of the near-identity
transformation over St, is what each order of averaging is smaller by than the one before. Later
kicks amplify an error: it shifts the phases of the resonances behind it, and so what these give.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from math import hypot, inf, pi, sqrt

import numpy as np

from polhode.models.once import once
from polhode.models.scene import Scene
from polhode.models.second_order.path import TINY, Path, path_of
from polhode.models.second_order.tables import Kick

Array = np.ndarray

# Above this rho the expansion in 1/St means nothing.
_MEANINGLESS = 0.35
# The highest harmonic of the torque: where the phase is wrong by φ, the swing is by so many φ rho.
_HARMONIC = 2
# Shares of the error asked for that averaging and kicks left out may cost, the latter together and
# one alone; by trial.
_SHARE = 0.5
_LEFT_OUT = 0.3
_ONE = 0.15
# Kicks of random phases stay below so many times the root of the sum of their squares all along in
# 97.5 %: 2.5/√2, as a walk's largest distance is beyond one at most twice as often as its last.
_RANDOM = 1.77
# Turns of the body that a stretch between windows lasts at least, lest it cost more than it saves.
_TURNS = 300
# A window is cut where this share of its weighted turning is left, but far more turns, for a looser
# tolerance.
_FALLEN = 0.1
# Share of the slowest damping rate at which errors are forgotten, by trial, and so many e-foldings
# in a run at most.
_FADING = 0.15
_LONG_AGO = 600.0
# Levels between which windows are chosen: the share of the one before, and the least one's of the
# largest.
_FALL = 0.53
_LEAST = 1e-8
# Where a window is looked at, in half widths from its middle.
_INSIDE = np.concatenate([[-1.01], np.linspace(-1, 1, 9) * (1 - 1e-9), [1.01]])

# Reasons by number; beyond the first two, for which averaging means nothing, a first-order path
# means little.
_REASONS = ("", "L² = 2EI₂", "St is too small for |L|", "the error asked for")
_SEPARATRIX = 1
_TOO_SLOW = 2
_INACCURATE = 3


@dataclass(frozen=True)
class Stretch:
    """From `start` to `end` in slow time, by averaging to second order or, for a `reason`, not."""

    start: float
    end: float
    second_order: bool
    reason: str = ""
    error: float = 0.0  # slow, over I_max, that averaging adds to the largest one of the run
    decisive: bool = False  # whether what follows is to be looked at anew from where it ends
    swing: float = 0.0  # error in rad that averaging adds to angles at once: rho and the lag
    turned: float = (
        0.0  # its `Path.wear` summed over slow time, times what later kicks amplify an error by
    )


@dataclass(frozen=True)
class Outline:
    """The stretches of a run and the kicks on its first-order path."""

    stretches: tuple[Stretch, ...]
    kicks: tuple[Kick, ...]
    orientation: float  # estimated error in rad of a run by second order alone, π at most

    @property
    def slow(self) -> float:
        """Estimated slow error, over I_max, of a run by second order alone: inf if it cannot be followed."""
        return (
            sum(each.error for each in self.stretches)
            if all(s.second_order for s in self.stretches)
            else inf
        )


# At extreme St and times estimates overflow; what is not finite is not averaged.
@once()
@np.errstate(over="ignore", invalid="ignore")
def outline(scene: Scene, budget: float = inf) -> Outline:
    """Outline of a run with orientation and 0 < St < inf; windows as the error asked for demands."""
    path = path_of(scene)
    share = _SHARE * budget
    ahead = Ahead.of(path, budget)
    kicks = path.kicks
    if kicks:
        # A window may be narrower than the path's steps.
        halves = [ahead.strong.get(each, each.width) for each in kicks]
        path = path.at(np.outer(_INSIDE, halves) + [each.time for each in kicks])
    times = path.times
    weight = ahead.weight(path.times)
    reasons = [*_REASONS]
    # Why averaging means nothing, by number: 0 where it does.
    beyond = ~np.isfinite(path.a2) | (path.may_cross(budget) if budget < inf else False)
    why = np.where(beyond, _SEPARATRIX, np.where(path.swing < _MEANINGLESS, 0, _TOO_SLOW))
    why[~(path.size > TINY)] = _TOO_SLOW
    why[(why == 0) & ~(np.isfinite(path.third) & np.isfinite(path.smaller))] = _TOO_SLOW
    sound = why == 0
    sudden = np.zeros(len(times))
    swing, smaller, third = (
        np.where(sound, each, 0) for each in (path.swing, path.smaller, path.third)
    )
    local = swing * np.hypot(smaller, path.fading) * path.scale
    for each, half in ahead.strong.items():
        why[np.abs(times - each.time) <= half] = len(reasons)
        reasons.append(f"resonance {each.mode}")
        local = local + each.missed(times)
    for each in kicks:
        if each in ahead.left:
            at = np.searchsorted(times, each.time)
            sudden[at] = hypot(sudden[at], ahead.left[each])
    sound = why == 0
    if kicks:
        sudden = _RANDOM * np.sqrt(np.cumsum(np.where(sound, sudden, 0) ** 2))
    held = third * np.gradient(times) * weight
    unknown = sound & ~(np.isfinite(held) & np.isfinite(local))
    why[unknown] = _INACCURATE
    sound &= ~unknown
    held = np.where(unknown, 0, held)
    local = np.where(unknown, 0, local)
    late = np.exp(min(_FADING * min(scene.ellipsoid.damping), _LONG_AGO / float(times[-1])) * times)
    # Where the phase is wrong, the swing is put back wrongly.
    swung = np.where(sound & (local <= share), swing * path.scale, 0)
    level = most = held.max()
    while True:
        errors = (late * np.where(held <= level, held, 0)).cumsum() / late
        wrong = path.phase(errors) * swung
        if not (errors + wrong).max() > share:
            break
        level = _FALL * level if level > _LEAST * most else 0.0
    why[sound & ((held > level) | (local > share))] = _INACCURATE
    lag = path.lag(np.where(why == 0, swing, 0))
    local = local + _HARMONIC * np.minimum(lag, 1) * swing * path.scale
    why[(why == 0) & (local > share)] = _INACCURATE
    drifting = errors + sudden
    passing = np.where(why == 0, local + wrong, 0)
    orientation = pi
    if np.isfinite(path.swing).all():
        orientation = min(pi, path.phase(drifting)[-1] + lag[-1] + path.swing.max())
    stretches = tuple(_stretches(path, why, reasons, drifting, passing, lag, weight))
    return Outline(stretches, kicks, float(orientation))


@dataclass(frozen=True)
class Ahead:
    """What kicks on a path make of errors, and which of them matter.

    An error (z, φ) of (|L|, E) and of (α, β) turns the phase of a kick by k·φ, and so the kick. At
    random phases the square of what comes of it is e·Ge in the mean, e = (z, φ), counted from the
    end of the run backwards.
    """

    path: Path
    strong: dict[Kick, float]  # half widths of windows
    left: dict[Kick, float]  # what comes of kicks that are left out
    behind: list[
        tuple[float, Array, Array]
    ]  # the times of others, G and what (α, β) have turned by there

    @classmethod
    def of(cls, path: Path, budget: float) -> "Ahead":
        """The kicks of a path, where windows are to miss no more than a budget."""
        found = cls(path, {}, {}, [])
        together = 0.0
        kicks = sorted((*path.kicks, *path.crossings()), key=lambda each: -each.time)
        if not kicks:
            return found
        g = np.diag([1.0, 1, 0, 0])
        last = path.turned[-1]
        for kick, here in zip(
            kicks, path.turned_at(np.array([each.time for each in kicks])), strict=True
        ):
            onwards = np.eye(4)
            onwards[2:, :2] = last - here
            given = onwards[:, :2] @ kick.along
            square = 0.5 * (given.conj() @ g @ given).real
            size = max(kick.size, sqrt(square))
            if size <= _ONE * budget and hypot(together, size) <= _LEFT_OUT / _RANDOM * budget:
                found.left[kick] = size
                together = hypot(together, size)
                continue
            g = onwards.T @ g @ onwards
            last = here
            g[2:, 2:] += square * np.outer(kick.mode, kick.mode)
            found.behind.append((kick.time, g, last))
            if kick.width:
                found.strong[kick] = kick.window(
                    _ONE * budget / max(1, sqrt(0.5 * (g[0, 0] + g[1, 1])))
                )
        return found

    def weight(self, times: Array) -> Array:
        """By how much later kicks amplify an error made at these times."""
        weight = np.ones(len(times))
        if self.behind:
            until, g, last = (np.array(each) for each in zip(*self.behind, strict=True))
            at = len(until) - 1 - np.searchsorted(until[::-1], times, side="right")
            before = at >= 0
            at = at[before]
            onwards = np.zeros((int(before.sum()), 4, 2))
            onwards[:, [0, 1], [0, 1]] = 1
            onwards[:, 2:] = last[at] - self.path.turned_at(times[before])
            weight[before] = np.sqrt(
                np.maximum(0.5 * np.sum(onwards * (g[at] @ onwards), axis=(1, 2)), 1)
            )
        return weight


def _stretches(
    path: Path,
    why: Array,
    reasons: list[str],
    drifting: Array,
    passing: Array,
    lag: Array,
    weight: Array,
) -> Iterator[Stretch]:
    """Stretches of the run; those by second order last a while, unless it is the whole run."""
    times = path.times
    turns = path.summed(path.speed) / (2 * pi * path.torque_factor)
    # Windows reach from a sound point to a sound point.
    between = np.where(why[:-1] > 0, why[:-1], why[1:])
    changes = (np.flatnonzero(np.diff(between > 0)) + 1).tolist()
    found: list[tuple[int, int]] = []
    for first, last in pairwise([0, *changes, len(between)]):
        if (
            found
            and (between[first] or turns[last] - turns[first] < _TURNS)
            and between[found[-1][0]]
        ):
            found[-1] = found[-1][0], last
        else:
            found.append((first, last))
    gained = path.summed(path.wear * weight)
    for first, last in found:
        here = slice(first, last + 1)
        whole = [each for each in dict.fromkeys(between[first:last].tolist()) if each]
        if whole:
            reason = "; ".join(dict.fromkeys(reasons[each] for each in whole))
            decisive = _SEPARATRIX in whole or _TOO_SLOW in whole
            until = last
            while first < last:
                cut = int(
                    np.searchsorted(gained, gained[last] - _FALLEN * (gained[last] - gained[first]))
                )
                lasting = turns[last] - turns[cut] > max(
                    _TURNS, 2 * _FALLEN * (turns[last] - turns[first])
                )
                until = cut if cut > first and lasting else last
                ends = (float(times[first]), float(times[until]))
                turned = float(gained[until] - gained[first])
                yield Stretch(
                    *ends, False, reason, decisive=decisive and until == last, turned=turned
                )
                first = until
        else:
            error = drifting[here].max() - (drifting[first] if first else 0.0) + passing[here].max()
            swing = lag[last] - lag[first] + path.swing[here].max()
            turned = gained[last] - gained[first]
            ends = float(times[first]), float(times[last])
            yield Stretch(*ends, True, error=float(error), swing=float(swing), turned=float(turned))
