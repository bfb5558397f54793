"""Where a run can be followed by averaging to second order, and how wrong it is there, before anything is solved.

The first-order solution says where the run goes. Along it rho, the size of the near-identity transformation over St,
is what each order of averaging is smaller by than the one before. Later kicks amplify an error: it shifts the phases of
the resonances behind it, and so what these give.
"""

from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise
from math import hypot, inf, pi, sqrt

import numpy as np

from polhode.models.scene import Scene
from polhode.models.second_order.path import TINY, Kick, Path, path_of

Array = np.ndarray

# Above this rho the expansion in 1/St means nothing.
MEANINGLESS = 0.35
# Third-order terms over what rho makes of those of second order, so that estimates bound most runs; chosen by trial.
MARGIN = 4.5
# The highest harmonic of the torque: where the phase is wrong by φ, the swing is by so many φ rho.
HARMONIC = 2
# Shares of the error asked for that averaging and kicks left out may cost, the latter together and one alone; by trial.
SHARE, LEFT_OUT, ONE = 0.5, 0.3, 0.15
# Kicks of random phases stay below so many times the root of the sum of their squares all along in 97.5 %: 2.5/√2, as a
# walk's largest distance is beyond one at most twice as often as its last.
RANDOM = 1.77
# Turns of the body that a stretch between windows lasts at least, lest it cost more than it saves.
TURNS = 300
# Share of the slowest damping rate at which errors are forgotten, by trial; levels between which windows are chosen.
FADING, LEVELS = 0.15, 30

# Reasons for which averaging means nothing, and a first-order path beyond them little.
SEPARATRIX, TOO_SLOW = "L² = 2EI₂", "St is too small for |L|"


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
    turned: float = 0.0  # rad over St that the body turns in it, times what later kicks amplify an error by


@dataclass(frozen=True)
class Outline:
    """A run on its first-order path: `slow` = (L, E), shape (m, 4), at slow `times`, and its stretches."""

    times: Array
    slow: Array
    stretches: tuple[Stretch, ...]
    kicks: tuple[Kick, ...]
    orientation: float  # estimated error in rad of a run by second order alone, π at most

    @property
    def error(self) -> float:
        """Estimated slow error of a run by second order alone: inf if it cannot be followed."""
        return sum(each.error for each in self.stretches) if all(s.second_order for s in self.stretches) else inf


@lru_cache(maxsize=64)
def outline(scene: Scene, budget: float = inf) -> Outline:
    """Outline of a run with orientation and 0 < St < inf; windows as the error asked for demands."""
    path, share = path_of(scene), SHARE * budget
    strong, weight, left = strong_kicks(path, budget)
    if path.kicks:
        # A window may be narrower than the path's steps, and on the finer path further kicks may get one.
        shares = np.concatenate([[-1.01], np.linspace(-1, 1, 9) * (1 - 1e-9), [1.01]])
        halves = [strong.get(each, each.width) for each in path.kicks]
        path = path.at(np.concatenate([each.time + h * shares for each, h in zip(path.kicks, halves, strict=True)]))
        strong, weight, left = strong_kicks(path, budget)
    times, reasons, sudden = path.times, _reasons(path, budget), np.zeros(len(path.times))
    swing, second = (np.where(reasons == "", each, 0) for each in (path.swing, path.second))
    local = MARGIN * swing**2 * path.size
    for each in path.kicks:
        if each in strong:
            reasons[np.abs(times - each.time) <= strong[each]] = f"resonance {each.mode}"
            local = local + each.missed(times)
        else:
            at = np.searchsorted(times, each.time)
            sudden[at] = hypot(sudden[at], left[each])
    sudden = RANDOM * np.sqrt(np.cumsum(np.where(reasons == "", sudden, 0) ** 2))
    held = np.where(reasons == "", MARGIN * second * swing, 0) * np.gradient(times) * weight
    late = np.tril(np.exp(-np.maximum(FADING * min(scene.ellipsoid.damping) * (times[:, None] - times), 0)))
    levels = np.append(np.geomspace(1, 1e-8, LEVELS) * held.max(), 0)
    errors = late @ np.where(held[:, None] <= levels, held[:, None], 0)
    # Where the phase is wrong, the swing is put back wrongly.
    wrong = path.phase(errors) * np.where(reasons == "", swing * path.size, 0)[:, None]
    kept = int(np.argmax((errors + wrong).max(axis=0) <= share))
    reasons[(reasons == "") & ((held > levels[kept]) | (local > share))] = "the error asked for"
    lag = path.lag(np.where(reasons == "", swing, 0))
    local = local + HARMONIC * np.minimum(lag, 1) * swing * path.size
    reasons[(reasons == "") & (local > share)] = "the error asked for"
    drifting, passing = errors[:, kept] + sudden, np.where(reasons == "", local + wrong[:, kept], 0)
    orientation = pi
    if np.isfinite(path.swing).all():
        orientation = min(pi, path.phase(drifting[:, None])[-1, 0] + lag[-1] + path.swing.max())
    stretches = tuple(_stretches(path, reasons, drifting, passing, lag, weight))
    return Outline(times, path.slow, stretches, path.kicks, float(orientation))


def strong_kicks(path: Path, budget: float) -> tuple[dict[Kick, float], Array, dict[Kick, float]]:
    """Half widths of kicks' windows, and by how much later kicks amplify an error made at the path's times.

    Last what comes of the kicks that are left out. An error (z, φ) of (|L|, E) and of (α, β) turns the phase of a kick
    by k·φ, and so the kick. At random phases the square of what comes of it is zᵀAz + 2zᵀXφ + φᵀFφ in the mean, counted
    from the end of the run backwards.
    """
    weight, together, last = np.ones(len(path.times)), 0.0, path.turned[-1]
    strong, left = dict[Kick, float](), dict[Kick, float]()
    a, x, f = np.eye(2), np.zeros((2, 2)), np.zeros((2, 2))
    for kick in sorted((*path.kicks, *path.crossings()), key=lambda each: -each.time):
        at = max(1, int(np.searchsorted(path.times, kick.time)))
        share = (kick.time - path.times[at - 1]) / (path.times[at] - path.times[at - 1])
        here = path.turned[at - 1] + share * (path.turned[at] - path.turned[at - 1])
        b = last - here
        a_here = a + x @ b + b.T @ x.T + b.T @ f @ b
        square = 0.5 * (kick.along.conj() @ a_here @ kick.along).real
        size = max(kick.size, sqrt(square))
        if size <= ONE * budget and hypot(together, size) <= LEFT_OUT / RANDOM * budget:
            left[kick], together = size, hypot(together, size)
        else:
            a, x, last = a_here, x + b.T @ f, here
            f = f + square * np.outer(kick.mode, kick.mode)
            b = last - path.turned[:at]
            square = a + x @ b + np.swapaxes(x @ b, 1, 2) + np.swapaxes(b, 1, 2) @ f @ b
            weight[:at] = np.sqrt(np.maximum(0.5 * np.trace(square, axis1=1, axis2=2), 1))
            if kick.width:
                strong[kick] = kick.window(ONE * budget / weight[at - 1])
    return strong, weight, left


def _reasons(path: Path, budget: float) -> Array:
    """Why averaging does not hold at the times of a path: "" where it does."""
    beyond = ~np.isfinite(path.a2) | (path.may_cross(budget) if budget < inf else False)
    reasons = np.where(beyond, SEPARATRIX, "").astype(object)
    reasons[~beyond & ~(path.swing < MEANINGLESS)] = TOO_SLOW
    reasons[~(path.size > TINY)] = TOO_SLOW
    return reasons


def _stretches(path: Path, reasons: Array, drifting: Array, passing: Array, lag: Array, weight: Array) -> list[Stretch]:
    """Stretches of the run; those by second order last a while, unless it is the whole run."""
    times, turn = path.times, 2 * pi * path.torque_factor * max(path.ellipsoid.inertia)
    # Windows reach from a sound point to a sound point.
    between = [one or other for one, other in pairwise(reasons)]
    changes = [i for i in range(1, len(between)) if bool(between[i]) != bool(between[i - 1])]
    found: list[tuple[int, int]] = []
    for first, last in pairwise([0, *changes, len(between)]):
        turns = (times[last] - times[first]) * path.size[first] / turn
        if found and (between[first] or turns < TURNS) and between[found[-1][0]]:
            found[-1] = found[-1][0], last
        else:
            found.append((first, last))
    gained = path.summed(path.speed * weight)
    stretches = []
    for first, last in found:
        here, why = slice(first, last + 1), [each for each in between[first:last] if each]
        stretch = Stretch(float(times[first]), float(times[last]), not why, turned=float(gained[last] - gained[first]))
        if why:
            decisive = SEPARATRIX in why or TOO_SLOW in why
            stretch = replace(stretch, reason="; ".join(dict.fromkeys(why)), decisive=decisive)
        else:
            error = drifting[here].max() - (drifting[first] if first else 0.0) + passing[here].max()
            stretch = replace(stretch, error=float(error), swing=float(lag[last] - lag[first] + path.swing[here].max()))
        stretches.append(stretch)
    return stretches
