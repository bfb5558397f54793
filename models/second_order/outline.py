"""Predicts, before a run, which parts of it averaging to second order can follow, and its error.

The first-order solution says where the run goes. Along it rho, the size of the near-identity
transformation over St, is the ratio of each order of averaging to the one before. Later kicks
amplify an error: it shifts the phases of the resonances that follow, and so their kicks. A kick is the
sudden change of L and E at a resonance; a full segment is one of the full equations.
`docs/second-order.md` has the mathematics in sections 8 and 9.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from math import hypot, inf, pi, sqrt
from typing import NamedTuple

import numpy as np

from polhode.models.once import once
from polhode.models.scene import Scene
from polhode.models.second_order.path import TINY, Path, path_of
from polhode.models.second_order.tables import Kick

Array = np.ndarray

# Constants that stand "by trial" were tried on random starts. reports/hybrid and reports/second-order have
# other starts, and count how many runs stay within the errors that they were asked for and that they
# state. Estimates decide what a run costs, not what it states.
#
# Largest rho at which a run is averaged. An estimate: there third-order terms exceed second-order ones by
# the estimate of `path._MARGIN`, so that the expansion in 1/St means nothing.
_MAX_RHO = 0.35
# An error φ of the angles by their lag, in rad, makes an error of this many φ rho |L| in what the generator puts
# back. An estimate: the highest harmonic of a spheroid's torque in its phase. Errors of the angles by lasting
# errors count once.
_HARMONIC = 2
# Share of the requested error that averaging may cost; by trial.
_SHARE_OF_AVERAGING = 0.5
# Share of the requested error that all kicks left out may cost together; by trial.
_SHARE_OF_KICKS = 0.3
# Share of the requested error that one kick left out may cost; by trial.
_SHARE_OF_ONE_KICK = 0.15
# In 97.5 % of runs kicks of random phases stay below this multiple of the root of the sum of their
# squares: 2.5/√2. The mean square of a kick is half the square of its size. A normal number exceeds 2.5
# standard deviations in 1.25 % of cases, and a walk's largest distance at most twice as often as its last.
_RANDOM_PHASES = 1.77
# Least turns of the body in an averaged segment: a shorter one costs more than it saves. An estimate.
_LEAST_TURNS = 300
# A full segment is cut where this share of its `PlannedSegment.turned` is left, if more than twice
# that share of its turns is left: its later part is solved to a looser tolerance. An estimate.
_CUT_AT = 0.1
# Errors are forgotten at this share of the slowest damping rate; by trial.
_FORGETTING = 0.15
# Most e-foldings of forgetting in a run: exp(709) overflows.
_MAX_FORGETTING = 600.0
# `gains` above a level become full segments. The level falls by this ratio until the rest is within
# the allowed error; by trial.
_LEVEL_RATIO = 0.53
# Least level over the highest one; below it the level is 0, and every gain a full segment. An estimate:
# a lower one costs more rounds.
_LEAST_LEVEL = 1e-8
# Times at which errors in the full segment of a kick are estimated, in half widths from the kick:
# nine inside, the outermost of them at 1e-9 from the ends, and one just beyond either end.
_HALF_WIDTHS = np.concatenate([[-1.01], np.linspace(-1, 1, 9) * (1 - 1e-9), [1.01]])

# Reasons not to average, by number; resonances follow. Behind a segment of either of the first two
# the first-order path means little.
_REASONS = ("", "L² = 2EI₂", "St is too small for |L|", "the requested error")
_SEPARATRIX = 1
_TOO_SLOW = 2
_INACCURATE = 3


@dataclass(frozen=True)
class PlannedSegment:
    """From `start` to `end` in slow time, by averaging to second order or, for a `reason`, not."""

    start: float
    end: float
    second_order: bool
    reason: str = ""
    # By how much averaging here raises the run's largest error of L and E, over I_max.
    error: float = 0.0
    decisive: bool = False  # whether the run behind it needs a new outline
    # Error in rad that averaging adds to angles at once: what `AveragingErrors` has as `at_once` and `lag`.
    swing: float = 0.0
    # Error in rad that angles gain in the segment: from averaging's errors of L and E since the outline's
    # start, and per further error of L and E, over I_max.
    phase: float = 0.0
    phase_per_error: float = 0.0
    turned: float = 0.0  # its `Path.error_growth` summed over slow time, times what later kicks amplify an error by


@dataclass(frozen=True)
class Outline:
    """The segments of a run and the kicks on its first-order path."""

    segments: tuple[PlannedSegment, ...]
    kicks: tuple[Kick, ...]
    orientation: float  # estimated error in rad of a run by second order alone, π at most

    @property
    def slow(self) -> float:
        """Estimated error of L and E, over I_max, by second order alone; inf if that cannot be."""
        return (
            sum(segment.error for segment in self.segments)
            if all(segment.second_order for segment in self.segments)
            else inf
        )


class KickAhead(NamedTuple):
    """A kick that is not left out, as errors made before it meet it."""

    time: float  # slow time
    # G just before the kick, shape (4, 4): rows and columns belong to |L|, E, α and β.
    error_form: Array
    turned: Array  # `Path.turned` at its time, shape (2, 2)


@dataclass(frozen=True)
class Ahead:
    """How the kicks on a path amplify errors, and which kicks need a full segment.

    An error e = (z, φ) of (|L|, E) and of (α, β) turns the phase of a kick by k·φ, and so the kick.
    At random phases the mean square of the error at the end of the run is e·Ge. From the end of the
    run backwards, G takes two steps for each kick.

    - Back to the kick, from the next one or from the end, G becomes MᵀGM. B is what the angles turn on
      the way per error of (|L|, E)::

                |L| E  α  β
            M = | 1  0  0  0 |  |L|
                | 0  1  0  0 |  E
                |  B    1  0 |  α
                |       0  1 |  β

    - At the kick, the mean square of the error that it makes, times k kᵀ, is added to the last 2 x 2
      entries.
    """

    path: Path
    strong: dict[Kick, float]  # half lengths of their full segments
    left: dict[Kick, float]  # error at the end of the run of each kick that is left out
    behind: list[KickAhead]  # kicks that are not left out, from the last to the first

    @classmethod
    def of(cls, path: Path, budget: float) -> "Ahead":
        """The kicks of a path; those that may be left out, and the full segments of others, follow from a budget.

        The budget is the requested error of L and E, over I_max.
        """
        strong = dict[Kick, float]()
        left = dict[Kick, float]()
        behind = list[KickAhead]()
        kicks = sorted((*path.kicks, *path.crossings()), key=lambda kick: -kick.time)
        if not kicks:
            return cls(path, strong, left, behind)
        most_by_one = _SHARE_OF_ONE_KICK * budget
        most_by_all = _SHARE_OF_KICKS / _RANDOM_PHASES * budget
        # Error of all kicks left out so far: their phases are random, so that squares add up.
        left_together = 0.0
        # At the end of the run errors of |L| and E count, errors of the angles do not.
        error_form = np.diag([1.0, 1, 0, 0])
        # `Path.turned` at the next kick that is not left out, or at the end of the run.
        turned_later = path.turned[-1]
        turned_at_kicks = path.turned_at(np.array([kick.time for kick in kicks]))
        for kick, turned in zip(kicks, turned_at_kicks, strict=True):
            onwards = _error_map(turned_later - turned)
            square = _mean_square_at_end(kick, onwards, error_form)
            size = max(kick.size, sqrt(square))
            together = hypot(left_together, size)
            if size <= most_by_one and together <= most_by_all:
                left[kick] = size
                left_together = together
                continue
            error_form = onwards.T @ error_form @ onwards
            # An error φ of the angles turns the kick's phase by k·φ.
            error_form[2:, 2:] += square * np.outer(kick.mode, kick.mode)
            turned_later = turned
            behind.append(KickAhead(kick.time, error_form, turned))
            # Jumps at L² = 2EI₂ have no width: the first step of `outline` gives them full segments.
            if kick.width:
                # As `weight` has it just before the kick.
                amplification = max(1, sqrt(0.5 * (error_form[0, 0] + error_form[1, 1])))
                strong[kick] = kick.half_width(most_by_one / amplification)
        return cls(path, strong, left, behind)

    def weight(self, times: Array) -> Array:
        """By how much later kicks amplify an error of L and E made at these slow times, shape (m,): 1 or more."""
        weight = np.ones(len(times))
        if self.behind:
            kick_times, error_forms, turned = (
                np.array(column) for column in zip(*self.behind, strict=True)
            )
            # Kicks stand from the last to the first: `following` is the index of the next kick behind
            # each time, -1 behind the last kick, where nothing amplifies an error.
            following = len(kick_times) - 1 - np.searchsorted(kick_times[::-1], times, side="right")
            before = following >= 0
            following = following[before]
            # The columns of M for errors of |L| and of E, from these times to the next kick.
            onwards = np.zeros((len(following), 4, 2))
            onwards[:, [0, 1], [0, 1]] = 1
            onwards[:, 2:] = turned[following] - self.path.turned_at(times[before])
            # ½ tr G of |L| and E.
            mean_square = 0.5 * np.sum(onwards * (error_forms[following] @ onwards), axis=(1, 2))
            weight[before] = np.sqrt(np.maximum(mean_square, 1))
        return weight


def _error_map(turned: Array) -> Array:
    """M, shape (4, 4): an error of (|L|, E, α, β) later on, per error now; B of `Ahead` is `turned`."""
    onwards = np.eye(4)
    onwards[2:, :2] = turned
    return onwards


def _mean_square_at_end(kick: Kick, onwards: Array, error_form: Array) -> float:
    """Mean square, over the kick's phases, of the error at the end of the run that its change of (|L|, E) makes.

    The derivative of that change by the phase has the same mean square. `onwards` is M to the place
    where `error_form` is G.
    """
    response = onwards[:, :2] @ kick.along
    return 0.5 * float(np.real(response.conj() @ error_form @ response))


class AveragingErrors(NamedTuple):
    """Errors of averaged segments at each time of a path, shape (m,) each; of L and E over I_max, of angles in rad."""

    drifting: Array  # lasting ones of L and E, of all segments so far
    passing: Array  # of L and E, at that time alone
    # The swing leaves out this error of L and E. If a segment begins there, it is one of the slow state, and lasts.
    offset: Array
    at_once: Array  # of angles, at that time alone: rho of a spheroid, what the swing leaves out of others
    # Error of angles over the whole path so far: by the swing's mean square, and by kicks left out. Spheroids
    # have no kicks.
    lag: Array


# At extreme St and times estimates overflow; a run is not averaged where they are not finite.
@once()
@np.errstate(over="ignore", invalid="ignore")
def outline(scene: Scene, budget: float = inf) -> Outline:
    """Outline of a run with orientation and 0 < St < inf.

    The budget is the requested error of L and E, over I_max: full segments are as long as it
    demands. At inf the whole run is averaged, unless averaging means nothing. Section 9 of
    docs/second-order.md has the same steps.
    """
    path = path_of(scene)
    allowed = _SHARE_OF_AVERAGING * budget
    ahead = Ahead.of(path, budget)
    kicks = path.kicks
    if kicks:
        # A full segment may be shorter than the path's steps. A kick left out is looked at within its width.
        halves = [ahead.strong.get(kick, kick.width) for kick in kicks]
        path = path.at(np.outer(_HALF_WIDTHS, halves) + [kick.time for kick in kicks])
    times = path.times
    amplification = ahead.weight(path.times)
    reasons = [*_REASONS]
    # `cause` is the number of the reason for which averaging does not hold, per time: 0 if it holds.
    # Steps 1 and 2: L² = 2EI₂, and St is too small for |L|.
    cause = _cause_by_path(path, budget)
    averaged = cause == 0
    swing, smaller, third = (
        np.where(averaged, ratio, 0) for ratio in (path.swing, path.smaller, path.third)
    )
    # Step 3: resonances. The kicks that matter get full segments, whose ends miss some of the mode.
    # Local errors are the passing ones of each time: the next order of the swing, its part beside resonances
    # that are not passed, and what full segments miss.
    local_errors = swing * np.hypot(smaller, path.fading) * path.scale + path.beside
    for kick, half in ahead.strong.items():
        cause[np.abs(times - kick.time) <= half] = len(reasons)
        reasons.append(f"resonance {kick.mode}")
        local_errors = local_errors + kick.missed(times)
    averaged = cause == 0
    kick_errors, phase_of_kicks = _errors_of_kicks_left(ahead, path, averaged)
    # Step 4: the requested error. `gains` are the lasting errors that third order adds at each time,
    # as later kicks amplify them.
    gains = third * np.gradient(times) * amplification
    unknown = averaged & ~(np.isfinite(gains) & np.isfinite(local_errors))
    cause[unknown] = _INACCURATE
    averaged &= ~unknown
    gains = np.where(unknown, 0, gains)
    local_errors = np.where(unknown, 0, local_errors)
    # Lasting errors fade: an error of the past counts by the ratio of growth then and now.
    growth = np.exp(
        min(_FORGETTING * min(scene.ellipsoid.damping), _MAX_FORGETTING / float(times[-1])) * times
    )
    # An error of the phase puts the swing back wrongly.
    swing_per_radian = np.where(averaged & (local_errors <= allowed), swing * path.scale, 0)
    level, lasting_errors, phase_errors = _level_within(
        allowed, path, gains, growth, swing_per_radian
    )
    cause[averaged & ((gains > level) | (local_errors > allowed))] = _INACCURATE
    # The lag of the angles puts the swing back wrongly too: by twice the swing at most, however large the lag is.
    lag = path.lag(np.where(cause == 0, swing, 0))
    local_errors = local_errors + _HARMONIC * np.minimum(lag, 1) * swing * path.scale
    cause[(cause == 0) & (local_errors > allowed)] = _INACCURATE
    # The averaged segments state errors that last, and errors that pass.
    drifting = lasting_errors + kick_errors
    passing = np.where(cause == 0, local_errors + phase_errors, 0)
    if scene.ellipsoid.kind == "triaxial":
        at_once = np.where(passing > 0, passing / path.scale, 0)
        errors = AveragingErrors(drifting, passing, passing, at_once, lag + phase_of_kicks)
    else:
        # The start of a spheroid has |L| to a higher order, but not the slow phase.
        errors = AveragingErrors(drifting, passing, np.zeros_like(passing), path.swing, lag)
    orientation = pi
    if np.isfinite(path.swing).all():
        phase = path.phase(drifting + errors.offset[0])[-1]
        orientation = min(pi, phase + errors.lag[-1] + errors.at_once.max())
    segments = tuple(_segments(path, cause, reasons, errors, amplification))
    return Outline(segments, kicks, float(orientation))


def _cause_by_path(path: Path, budget: float) -> Array:
    """The number of the reason, per time, for which averaging does not hold at the state there; 0 if it does."""
    at_separatrix = ~np.isfinite(path.a2) | (path.may_cross(budget) if budget < inf else False)
    cause = np.where(at_separatrix, _SEPARATRIX, np.where(path.swing < _MAX_RHO, 0, _TOO_SLOW))
    cause[~(path.size > TINY)] = _TOO_SLOW
    cause[(cause == 0) & ~(np.isfinite(path.third) & np.isfinite(path.smaller))] = _TOO_SLOW
    return cause


def _errors_of_kicks_left(ahead: Ahead, path: Path, averaged: Array) -> tuple[Array, Array]:
    """Errors by all kicks left out so far where the run is averaged, at random phases, shapes (m,).

    The first are errors of L and E, over I_max, the second are errors of α and β, in rad. A kick changes E and
    |L| in a proportion of its own. It may thereby change a², and so the rates of the angles, by far more than an
    error that is alike in both.
    """
    errors = np.zeros(len(path.times))
    square = np.zeros(len(path.times))
    # In the order of their times.
    for kick, size in reversed(ahead.left.items()):
        at = int(np.searchsorted(path.times, kick.time))
        if averaged[at]:
            errors[at] = hypot(errors[at], size)
            turned = path.turned[at:] - path.turned_at(np.array([kick.time]))[0]
            square[at:] += (np.abs(turned @ kick.along) ** 2).max(axis=1)
    return _RANDOM_PHASES * np.sqrt(np.cumsum(errors**2)), _RANDOM_PHASES * np.sqrt(square)


def _level_within(
    allowed: float, path: Path, gains: Array, growth: Array, swing_per_radian: Array
) -> tuple[float, Array, Array]:
    """The level above which gains become full segments, so that the others stay within the allowed error.

    With it come the lasting errors of the others and, per time, what the angles' errors by them make.
    """
    level = highest_level = gains.max()
    while True:
        lasting_errors = (growth * np.where(gains <= level, gains, 0)).cumsum() / growth
        phase_errors = path.phase(lasting_errors) * swing_per_radian
        if not (lasting_errors + phase_errors).max() > allowed:
            return level, lasting_errors, phase_errors
        level = _LEVEL_RATIO * level if level > _LEAST_LEVEL * highest_level else 0.0


def _segments(
    path: Path,
    cause: Array,
    reasons: list[str],
    errors: AveragingErrors,
    amplification: Array,
) -> Iterator[PlannedSegment]:
    """Segments of the run, in their order."""
    times = path.times
    turns = path.summed(path.speed) / (2 * pi * path.torque_factor)
    # Full segments reach from one point at which averaging holds to another.
    between = np.where(cause[:-1] > 0, cause[:-1], cause[1:])
    ranges = _ranges(between, turns)
    gained = path.summed(path.error_growth * amplification)
    phase_per_error = path.summed(path.dephasing) / path.torque_factor
    drifting, passing, _, at_once, lag = errors
    # Not clipped at π: segments state differences of it.
    phase_of_drift = path.summed(drifting * path.dephasing) / path.torque_factor
    # Sum over the averaged segments so far.
    offset = 0.0
    for first, last in ranges:
        part = slice(first, last + 1)
        averaged = not between[first]
        if averaged:
            offset += errors.offset[first]
        phase = phase_of_drift + offset * phase_per_error
        numbers = [number for number in dict.fromkeys(between[first:last].tolist()) if number]
        if numbers:
            reason = "; ".join(dict.fromkeys(reasons[number] for number in numbers))
            decisive = _SEPARATRIX in numbers or _TOO_SLOW in numbers
            for begin, end in _cut(first, last, gained, turns):
                yield PlannedSegment(
                    float(times[begin]),
                    float(times[end]),
                    False,
                    reason,
                    # The run needs a new outline behind the last part alone.
                    decisive=decisive and end == last,
                    phase=float(phase[end] - phase[begin]),
                    phase_per_error=float(phase_per_error[end] - phase_per_error[begin]),
                    turned=float(gained[end] - gained[begin]),
                )
        else:
            # Lasting errors of earlier times count in earlier segments. The run's first time has none.
            error = drifting[part].max() - (drifting[first] if first else 0.0) + passing[part].max()
            swing = lag[last] - lag[first] + at_once[part].max()
            turned = gained[last] - gained[first]
            ends = float(times[first]), float(times[last])
            yield PlannedSegment(
                *ends,
                True,
                error=float(error),
                swing=float(swing),
                phase=float(phase[last] - phase[first]),
                phase_per_error=float(phase_per_error[last] - phase_per_error[first]),
                turned=float(turned),
            )


def _ranges(between: Array, turns: Array) -> list[tuple[int, int]]:
    """First and last points of segments; a short averaged one behind a full one joins it.

    `between` has the cause of each step of the path, 0 where it is averaged, and `turns` the turns of
    the body until each point.
    """
    changes = (np.flatnonzero(np.diff(between > 0)) + 1).tolist()
    ranges: list[tuple[int, int]] = []
    for first, last in pairwise([0, *changes, len(between)]):
        full_or_short = between[first] or turns[last] - turns[first] < _LEAST_TURNS
        if ranges and full_or_short and between[ranges[-1][0]]:
            ranges[-1] = ranges[-1][0], last
        else:
            ranges.append((first, last))
    return ranges


def _cut(first: int, last: int, gained: Array, turns: Array) -> Iterator[tuple[int, int]]:
    """First and last points of the parts of a full segment, whose later parts have looser tolerances.

    A part ends where the share `_CUT_AT` of what the segment gains is left, if enough turns are left.
    """
    while first < last:
        left_at_cut = _CUT_AT * (gained[last] - gained[first])
        cut = int(np.searchsorted(gained, gained[last] - left_at_cut))
        least_turns = max(_LEAST_TURNS, 2 * _CUT_AT * (turns[last] - turns[first]))
        lasting = turns[last] - turns[cut] > least_turns
        until = cut if cut > first and lasting else last
        yield first, until
        first = until
