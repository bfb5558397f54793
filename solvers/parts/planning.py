"""How large steps may be: a law, checked by short runs with two steps."""

from math import inf, isfinite, log, pi, sqrt
from typing import Any, NamedTuple

import numpy as np

from polhode.solvers.contract import Record
from polhode.solvers.parts.kernels import CHECK_SIZE, CheckAt, LawAt

# The law of errors. A step h leaves the slow components with errors of about
# COEFFICIENT γ r**-POWER (h r)**ORDER; r is the rate of the fast angle, γ the rate at which the
# slow part relaxes. The time has no part in it: errors accumulate no longer than the slow
# components remember, a time 1/γ. The angle h r is never wider than flows reach.
_ORDER = 6
_POWER = 2.0
_COEFFICIENT = 6e-7
# First guess of the ratio of errors to the law: SCALE (s²/f)**SHARE, s the strength of the torque
# and f the rate at which it is forgotten.
_SCALE = 1.4
_SHARE = 0.6
# Steps ``H r**-EXPONENT`` err alike; they lie between steps equal in angle (1) and in time (0).
_EXPONENT = 1 - _POWER / _ORDER
# Error aimed at over the tolerance: estimates may be off, and what follows the check may amplify.
_AIM = 0.2
# A check takes this share of the remaining run.
_CHECKED = 0.003
# Least and most turns of a check.
_LEAST_TURNS = 2.0
_MOST_TURNS = 500.0
# A check takes all of a run of fewer turns, or of more where they are damped: in proportion to this
# multiple of the damping in a turn, up to a most number of turns.
_ALL = 4.0
_DAMPED = 4.0
_MOST_ALL = 200.0
# Ratio of the steps that a check compares.
_FINER = 0.8
# Turns at the beginning and at the end of a check over which means are taken.
_MEAN_OVER = 5.0
# Largest share of the run that a step takes.
_MAX_STEP_SHARE = 0.4
# The step stands if the estimated error is within these factors of the requested one.
_FITTING = (0.3, 2.0)
# Otherwise the law is scaled for an error of this share of the requested one.
_MIDDLE = 0.8
# Least estimate, over the requested error: takes the place of 0.
_LEAST = 1e-6
# Checks of one plan at most.
MAX_PLAN_CHECKS = 4
# Order by which errors of steps fall that are not checked again: lower, as the slow part may not be
# small there.
_LEAST_ORDER = 4
# A check sees errors from this multiple of their rounding on; for smaller ones steps are narrowed
# without a check.
_CLEAR = 4.0
# Least error aimed at, over the rounding of one number.
_LEAST_ERROR = 100.0
# Another round pays if wider steps cost no more than this share of the present ones.
_REWARDING = 0.85
# It pays only if the plans differ by a check, which costs this many steps beside its own.
_CHECK = 250.0
# An angle of the fast components, in rad, that may be off per turn, in tolerances.
_PER_TURN = 0.1
# Scale of the error of a plan that ends in nothing.
_HOPELESS = 1e3


class Plan(NamedTuple):
    """The number H of steps, the square of the least rate that counts, and the widest angle."""

    factor: float
    floor: float
    widest: float

    def law(self, between: tuple[float, float] = (0.0, inf)) -> tuple[float, ...]:
        """The law as machine code receives it; it holds between two rates."""
        law = [0.0] * len(LawAt)
        law[LawAt.FACTOR] = self.factor
        law[LawAt.EXPONENT] = _EXPONENT
        law[LawAt.WIDEST] = self.widest
        law[LawAt.FLOOR] = self.floor
        law[LawAt.LOWEST] = between[0]
        law[LawAt.HIGHEST] = between[1]
        return tuple(law)

    def step(self, rate: float) -> float:
        """A step at a rate of the fast angle."""
        return min(self.factor * rate**-_EXPONENT, self.widest / rate)

    def narrowed(self, factor: float) -> "Plan":
        """One whose steps are all smaller by a factor."""
        return Plan(self.factor * factor, self.floor, self.widest * factor)


class Planner:
    """Chooses plans for one problem (`splitting.Split`) and one tolerance, from its short runs."""

    def __init__(self, problem: Any, tolerance: float) -> None:
        self.problem = problem
        self.error = max(_AIM * tolerance, _LEAST_ERROR * problem.epsilon)
        # The error that checked steps are to have, no less than a check sees.
        self.aim = self.error
        # Ratio of errors to the law, as far as checks have shown it.
        self.scale = (
            _SCALE * (problem.strength**2 / problem.forgetting) ** _SHARE
            if problem.strength > 0
            else 1.0
        )
        # The plan of checked steps.
        self.checked: Plan | None = None

    def by_law(self, rate: float, longest: float) -> Plan:
        """The plan of widest steps at a rate, if errors are `scale` times the law."""
        factor = (self.aim / (self.problem.strength * self.scale * _COEFFICIENT)) ** (1 / _ORDER)
        return Plan(min(factor, longest * rate**_EXPONENT), self.problem.floor, self.problem.widest)

    def plan(self, old: Plan | None, state: np.ndarray, now: float, record: Record) -> Plan:
        """The widest plan for the error aimed at, beginning with the one in use."""
        self.checked = self.checked_plan(self.checked if old else None, state, now, record)
        unchecked = self.error / self.aim
        plan = (
            self.checked.narrowed(unchecked ** (1 / _LEAST_ORDER))
            if unchecked < 1
            else self.checked
        )
        return old if old and old == plan else plan

    def checked_plan(self, old: Plan | None, state: np.ndarray, now: float, record: Record) -> Plan:
        """The widest plan that a check lets stand, beginning with an old one."""
        rate = self.problem.rate(state)
        length = float(record.times[-1]) - now
        # Rows within the first step are the same whatever its length: a check sees nothing there.
        longest = _MAX_STEP_SHARE * length
        plan = old or self.by_law(rate, longest)
        good = None
        bad = None
        for _ in range(MAX_PLAN_CHECKS):
            ratio = self.off(plan, state, now, record)
            if bad and bad[1] <= ratio != _HOPELESS:
                # Only rounding is left, which more steps add to.
                return bad[0]
            if ratio <= _FITTING[1]:
                good = plan, ratio
            else:
                bad = plan, ratio
            if _FITTING[0] <= ratio <= _FITTING[1] or record.expired:
                break
            if good and bad:
                # Between two that were checked.
                order = log(bad[1] / max(good[1], _LEAST)) / log(
                    bad[0].step(rate) / good[0].step(rate)
                )
                return self.next(plan, ratio, order, rate, longest)
            before = plan
            plan = self.next(plan, ratio, _ORDER, rate, longest)
            saved = abs(1 / before.step(rate) - 1 / plan.step(rate))
            if saved * length < _CHECK or (good and saved * before.step(rate) < 1 - _REWARDING):
                return good[0] if good else self.next(before, ratio, _LEAST_ORDER, rate, longest)
        return good[0] if good else plan

    def next(self, plan: Plan, ratio: float, order: float, rate: float, longest: float) -> Plan:
        """A plan of the error aimed at, after one with `ratio` times that error, of an order."""
        step = plan.step(rate) * (_MIDDLE / max(ratio, _LEAST)) ** (1 / order)
        law = _COEFFICIENT * rate ** (_ORDER - _POWER) * step**_ORDER
        self.scale = self.aim / (self.problem.strength * law)
        return self.by_law(rate, longest)

    def off(self, plan: Plan, state: np.ndarray, now: float, record: Record) -> float:
        """Estimated error of a plan over the one that checked steps are to have."""
        error, rounding = self.estimated(plan, state, now, record)
        self.aim = max(self.error, _CLEAR * rounding)
        return error / self.aim if isfinite(error) else _HOPELESS

    def estimated(
        self, plan: Plan, state: np.ndarray, now: float, record: Record
    ) -> tuple[float, float]:
        """Error of the slow quantities in the remaining run, from short runs by two step sizes.

        The difference of the two in a turn's mean grows with time, as long as the slow quantities
        remember; the remainder oscillates within a turn. Errors of the fast components, in rad
        per turn, count as well: over their amplitude where that is small and grows, as at a saddle.
        The second number is the part of rounding in the estimate.
        """
        problem = self.problem
        length = float(record.times[-1]) - now
        rate = problem.rate(state)
        turn = 2 * pi / rate
        trial = min(length, _MOST_TURNS * turn, max(_LEAST_TURNS * turn, _CHECKED * length))
        if length < turn * min(_MOST_ALL, _ALL * max(1.0, _DAMPED * problem.strength * turn)):
            trial = length
        span = _MEAN_OVER * turn if trial > 4 * _MEAN_OVER * turn else trial / 2
        numbers = np.zeros(CHECK_SIZE, problem.number)
        numbers[CheckAt.FIRST_LAW : CheckAt.SECOND_LAW] = plan.law()
        numbers[CheckAt.SECOND_LAW : CheckAt.SPAN] = plan.narrowed(_FINER).law()
        numbers[CheckAt.SPAN] = span
        numbers[CheckAt.WHOLE] = trial
        numbers[CheckAt.RATE] = rate
        problem.kernels.check(
            problem.scheme.addresses[problem.number], problem.address, state, numbers
        )
        found = numbers.tolist()
        steps = found[CheckAt.STEPS]
        fast = found[CheckAt.FAST]
        record.work.rejected = (record.work.rejected or 0) + int(steps)
        if found[CheckAt.CODES]:
            return inf, 0.0
        if found[CheckAt.AMPLITUDE_END] > found[CheckAt.AMPLITUDE_BEGIN]:
            fast /= min(1.0, found[CheckAt.AMPLITUDE_END])
        # Slow components remember for a time between the memory of the fastest and the slowest one.
        remaining = max(0.0, min(length, 1 / sqrt(problem.strength * problem.forgetting)) - trial)
        grown = remaining / (trial - span)
        # To and fro in the slow quantities; of the same sign in the phase, where that moves little
        # in a step.
        rounding = problem.epsilon * max(
            rate * sqrt(steps) * (1 + grown), steps / (1 + trial / turn) / _PER_TURN
        )
        slow = found[CheckAt.SLOW] + found[CheckAt.CHANGE] * grown
        return max(slow, fast / _PER_TURN) / (1 - _FINER**_ORDER), rounding
