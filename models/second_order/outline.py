"""Predicts, before a run, which parts of it averaging to second order can follow, and its error.

The first-order solution says where the run goes. Along it rho, the size of the near-identity
transformation over St, is the ratio of each order of averaging to the one before. Later kicks
amplify an error: it shifts the phases of the resonances that follow, and so their kicks.
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
# The highest harmonic of the torque: an error φ of the phase, in rad, makes an error of this many
# φ rho in the swing.
_HARMONIC = 2
# Share of the requested error that averaging may cost; by trial.
_SHARE = 0.5
# Share of it that all kicks left out may cost together; by trial.
_LEFT_OUT = 0.3
# Share of it that one kick left out may cost; by trial.
_ONE = 0.15
# In 97.5 % of runs kicks of random phases stay below this multiple of the root of the sum of their
# squares: 2.5/√2, as a walk's largest distance exceeds a bound at most twice as often as its last.
_RANDOM = 1.77
# Least turns of the body in a stretch between windows: a shorter one costs more than it saves.
_TURNS = 300
# A window is cut where this share of its weighted turning is left, but far more turns, for a looser
# tolerance.
_FALLEN = 0.1
# Errors are forgotten at this share of the slowest damping rate; by trial.
_FADING = 0.15
# Most e-foldings of forgetting in a run, lest exponentials overflow.
_LONG_AGO = 600.0
# Windows are chosen at falling levels of the error per time: ratio of one level to the one before.
_FALL = 0.53
# Least level over the largest one.
_LEAST = 1e-8
# Times at which errors in a window are estimated, in half widths from its middle.
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
    error: float = 0.0  # of L and E, over I_max, that averaging adds to the run's largest one
    decisive: bool = False  # whether the run behind it needs a new outline
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
        """Estimated error of L and E, over I_max, by second order alone; inf if that cannot be."""
        return (
            sum(stretch.error for stretch in self.stretches)
            if all(stretch.second_order for stretch in self.stretches)
            else inf
        )


# At extreme St and times estimates overflow; what is not finite is not averaged.
@once()
@np.errstate(over="ignore", invalid="ignore")
def outline(scene: Scene, budget: float = inf) -> Outline:
    """Outline of a run with orientation and 0 < St < inf.

    Windows are as wide as the requested error demands.
    """
    path = path_of(scene)
    share = _SHARE * budget
    ahead = Ahead.of(path, budget)
    kicks = path.kicks
    if kicks:
        # A window may be narrower than the path's steps.
        halves = [ahead.strong.get(kick, kick.width) for kick in kicks]
        path = path.at(np.outer(_INSIDE, halves) + [kick.time for kick in kicks])
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
        np.where(sound, ratio, 0) for ratio in (path.swing, path.smaller, path.third)
    )
    local = swing * np.hypot(smaller, path.fading) * path.scale
    for kick, half in ahead.strong.items():
        why[np.abs(times - kick.time) <= half] = len(reasons)
        reasons.append(f"resonance {kick.mode}")
        local = local + kick.missed(times)
    for kick in kicks:
        if kick in ahead.left:
            at = np.searchsorted(times, kick.time)
            sudden[at] = hypot(sudden[at], ahead.left[kick])
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
    # An error of the phase puts the swing back wrongly.
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
    """How the kicks on a path amplify errors, and which kicks need a window.

    An error e = (z, φ) of (|L|, E) and of (α, β) turns the phase of a kick by k·φ, and so the kick.
    At random phases the mean square of the error at the end of the run is e·Ge; G is summed from
    the end of the run backwards.
    """

    path: Path
    strong: dict[Kick, float]  # half widths of windows
    left: dict[Kick, float]  # error at the end of the run of each kick that is left out
    behind: list[
        tuple[float, Array, Array]
    ]  # time of each kick that is not left out, G before it, and (α, β) turned until then

    @classmethod
    def of(cls, path: Path, budget: float) -> "Ahead":
        """The kicks of a path, where windows are to miss no more than a budget."""
        ahead = cls(path, {}, {}, [])
        together = 0.0
        kicks = sorted((*path.kicks, *path.crossings()), key=lambda kick: -kick.time)
        if not kicks:
            return ahead
        g = np.diag([1.0, 1, 0, 0])
        last = path.turned[-1]
        turned_at_kicks = path.turned_at(np.array([kick.time for kick in kicks]))
        for kick, turned in zip(kicks, turned_at_kicks, strict=True):
            onwards = np.eye(4)
            onwards[2:, :2] = last - turned
            response = onwards[:, :2] @ kick.along
            square = 0.5 * (response.conj() @ g @ response).real
            size = max(kick.size, sqrt(square))
            if size <= _ONE * budget and hypot(together, size) <= _LEFT_OUT / _RANDOM * budget:
                ahead.left[kick] = size
                together = hypot(together, size)
                continue
            g = onwards.T @ g @ onwards
            last = turned
            g[2:, 2:] += square * np.outer(kick.mode, kick.mode)
            ahead.behind.append((kick.time, g, last))
            if kick.width:
                ahead.strong[kick] = kick.window(
                    _ONE * budget / max(1, sqrt(0.5 * (g[0, 0] + g[1, 1])))
                )
        return ahead

    def weight(self, times: Array) -> Array:
        """By how much later kicks amplify an error made at these times."""
        weight = np.ones(len(times))
        if self.behind:
            until, g, last = (np.array(column) for column in zip(*self.behind, strict=True))
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
    ranges: list[tuple[int, int]] = []
    for first, last in pairwise([0, *changes, len(between)]):
        if (
            ranges
            and (between[first] or turns[last] - turns[first] < _TURNS)
            and between[ranges[-1][0]]
        ):
            ranges[-1] = ranges[-1][0], last
        else:
            ranges.append((first, last))
    gained = path.summed(path.wear * weight)
    for first, last in ranges:
        part = slice(first, last + 1)
        causes = [cause for cause in dict.fromkeys(between[first:last].tolist()) if cause]
        if causes:
            reason = "; ".join(dict.fromkeys(reasons[cause] for cause in causes))
            decisive = _SEPARATRIX in causes or _TOO_SLOW in causes
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
            error = drifting[part].max() - (drifting[first] if first else 0.0) + passing[part].max()
            swing = lag[last] - lag[first] + path.swing[part].max()
            turned = gained[last] - gained[first]
            ends = float(times[first]), float(times[last])
            yield Stretch(*ends, True, error=float(error), swing=float(swing), turned=float(turned))
