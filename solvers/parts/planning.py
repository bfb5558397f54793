"""How large steps may be: a law, checked by short runs with two steps.

The law of errors: a step h leaves the slow components with errors of about
``_COEFFICIENT γ r**-_POWER (h r)**_ORDER``.
r is the rate of the fast angle, γ the rate at which the slow part relaxes, so that h r is the angle
of a step. The time has no part in it: errors accumulate no longer than the slow components
remember, a time 1/γ. Solved for h it is the law of steps, ``h = H r**-_EXPONENT``.

A *check* (`kernels.Kernels.check`) runs the next turns by a plan and by one with smaller steps. The
difference of the two shows the error of the plan, and the plan is widened or narrowed to suit.

Numbers that are called estimates are not the result of a recorded measurement: checks make up for
what is wrong with the law, and a wrong number elsewhere costs time, not accuracy.
"""

from math import inf, isfinite, log, pi, sqrt
from typing import Any, NamedTuple

import numpy as np

from polhode.solvers.contract import Record
from polhode.solvers.parts.kernels import CheckAt, LawAt

# Numbers of the law above; estimates. The coefficient is an inverse time, in the problem's unit.
_ORDER = 6
_POWER = 2.0
_COEFFICIENT = 6e-7
# Steps ``H r**-EXPONENT`` err alike; they lie between steps equal in angle (1) and in time (0).
_EXPONENT = 1 - _POWER / _ORDER
# First guess of the ratio of errors to the law: SCALE (s²/f)**SHARE. Of `models.problem.Parts`, s is the strength and
# f the forgetting, per unit of time. Estimates, by which most short runs need one check.
_SCALE = 1.4
_SHARE = 0.6
# Error aimed at over the tolerance: estimates may be off, and what follows the check may amplify.
_AIM = 0.2
# Least error aimed at, over the rounding of one number; an estimate.
_LEAST_ERROR = 100.0
# Largest share of the remaining run that a step takes: rows within the first step are the same
# whatever its length, so that a check would see nothing. An estimate.
_MAX_STEP_SHARE = 0.4

# How long a check is. It takes this share of the remaining run,
_CHECKED = 0.003
# and at least and at most these turns; estimates.
_LEAST_TURNS = 2.0
_MOST_TURNS = 500.0
# A run is checked as a whole if it has fewer turns than this,
_WHOLE_TURNS = 4.0
# or than that number times this multiple of the damping in a turn, if that is more,
_WHOLE_DAMPED = 4.0
# but not if it has more turns than this. Estimates.
_MOST_WHOLE_TURNS = 200.0
# Turns at the beginning and at the end of a check over which means are taken; an estimate.
_MEAN_TURNS = 5.0
# A check that is not longer than this many times `_MEAN_TURNS` takes means over its halves; an estimate.
_MIN_SPANS = 4
# Steps of a check's second run over the steps of its first run. An estimate: nearer to 1 the two runs differ by
# less, and by more of rounding; farther from it the second one costs more.
_FINER = 0.8

# Decision of a check. The plan stands if the estimated error over the one aimed at is within
# these bounds; estimates.
_LEAST_RATIO = 0.3
_MOST_RATIO = 2.0
# Otherwise the law is scaled for an error of this share of the one aimed at; an estimate.
_MIDDLE = 0.8
# Least ratio that is reckoned with: takes the place of 0.
_TINY_RATIO = 1e-6
# Ratio of a plan whose runs end in nothing: the next plan's steps are a third as long.
_HOPELESS = 1e3
# Checks of one plan at most; if all end in nothing, steps are a hundredth as long by then.
MAX_PLAN_CHECKS = 4
# Order by which errors of steps fall that are not checked again: lower, as the slow part may not be
# small there.
_LEAST_ORDER = 4
# A check sees errors from this multiple of their rounding on; for smaller ones steps are narrowed
# without a check. An estimate.
_CLEAR = 4.0
# Another round pays if wider steps cost no more than this share of the present ones,
_REWARDING = 0.85
# and if the plans differ by more steps than this, the cost of a check beside its own steps. Estimates.
_CHECK_COST = 250.0
# An angle of the fast components, in rad, that may be off per turn, in tolerances; an estimate by
# which L, which sways with the angle, errs by less than 2 tolerances in runs of 1e5 turns.
_PER_TURN = 0.1


class Plan(NamedTuple):
    """A law of steps."""

    factor: float  # H
    floor: float  # the square of the least rate that counts
    widest: float  # angle of a step, in rad

    def law(self, between: tuple[float, float] = (0.0, inf)) -> tuple[float, ...]:
        """The law as machine code receives it; it holds between two rates."""
        law = [0.0] * LawAt.SIZE
        law[LawAt.FACTOR] = self.factor
        law[LawAt.EXPONENT] = _EXPONENT
        law[LawAt.WIDEST] = self.widest
        law[LawAt.FLOOR] = self.floor
        law[LawAt.LOWEST], law[LawAt.HIGHEST] = between
        return tuple(law)

    def step(self, rate: float) -> float:
        """A step at a rate of the fast angle."""
        return min(self.factor * rate**-_EXPONENT, self.widest / rate)

    def narrowed(self, factor: float) -> "Plan":
        """One whose steps are all this factor times as long."""
        return Plan(self.factor * factor, self.floor, self.widest * factor)


class Checked(NamedTuple):
    """A plan and what a check made of it."""

    plan: Plan
    ratio: float  # estimated error over the one aimed at


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
        """The plan of widest steps, none longer than `longest` at a rate, if errors are `scale` times the law."""
        factor = (self.aim / (self.problem.strength * self.scale * _COEFFICIENT)) ** (1 / _ORDER)
        return Plan(min(factor, longest * rate**_EXPONENT), self.problem.floor, self.problem.widest)

    def plan(self, old: Plan | None, state: np.ndarray, now: float, record: Record) -> Plan:
        """The widest plan for the error aimed at, beginning with the one in use."""
        self.checked = self.checked_plan(self.checked if old else None, state, now, record)
        plan = self.checked
        # Below what a check sees, steps are narrowed unchecked.
        unchecked = self.error / self.aim
        if unchecked < 1:
            plan = self.checked.narrowed(unchecked ** (1 / _LEAST_ORDER))
        return old if old and old == plan else plan

    def checked_plan(self, old: Plan | None, state: np.ndarray, now: float, record: Record) -> Plan:
        """The widest plan that a check lets stand, beginning with an old one."""
        rate = self.problem.rate(state)
        length = float(record.times[-1]) - now
        longest = _MAX_STEP_SHARE * length
        plan = old or self.by_law(rate, longest)
        # The latest plans that err little enough, and too much.
        good: Checked | None = None
        bad: Checked | None = None
        for _ in range(MAX_PLAN_CHECKS):
            ratio = self.off(plan, state, now, record)
            if bad and ratio != _HOPELESS and ratio >= bad.ratio:
                # Only rounding is left, which more steps add to.
                return bad.plan
            if ratio <= _MOST_RATIO:
                good = Checked(plan, ratio)
            else:
                bad = Checked(plan, ratio)
            if _LEAST_RATIO <= ratio <= _MOST_RATIO or record.expired:
                break
            if good and bad:
                # Between two that were checked, by the order that they show.
                return self.next(plan, ratio, self._order(good, bad, rate), rate, longest)
            before = plan
            plan = self.next(plan, ratio, _ORDER, rate, longest)
            saved = abs(1 / before.step(rate) - 1 / plan.step(rate))
            if saved * length < _CHECK_COST or (
                good and saved * before.step(rate) < 1 - _REWARDING
            ):
                return good.plan if good else self.next(before, ratio, _LEAST_ORDER, rate, longest)
        return good.plan if good else plan

    def _order(self, good: Checked, bad: Checked, rate: float) -> float:
        """The order by which errors fall from one checked plan to another."""
        errors = bad.ratio / max(good.ratio, _TINY_RATIO)
        steps = bad.plan.step(rate) / good.plan.step(rate)
        return log(errors) / log(steps)

    def next(self, plan: Plan, ratio: float, order: float, rate: float, longest: float) -> Plan:
        """A plan of the error aimed at, after one with `ratio` times that error, of an order."""
        step = plan.step(rate) * (_MIDDLE / max(ratio, _TINY_RATIO)) ** (1 / order)
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
        whole = self._time_of_check(length, turn)
        # Means over the same turns at both ends of a check that is long enough, else over its halves.
        span = _MEAN_TURNS * turn
        if not whole > _MIN_SPANS * span:
            span = whole / 2
        results = self._compared(plan, state, span, whole, rate)
        steps = results[CheckAt.STEPS]
        record.work.rejected = (record.work.rejected or 0) + int(steps)
        if results[CheckAt.CODES]:
            return inf, 0.0
        fast = results[CheckAt.FAST]
        if results[CheckAt.AMPLITUDE_END] > results[CheckAt.AMPLITUDE_BEGIN]:
            fast /= min(1.0, results[CheckAt.AMPLITUDE_END])
        # Slow components remember for a time between the memory of the fastest and the slowest one.
        memory = 1 / sqrt(problem.strength * problem.forgetting)
        remaining = max(0.0, min(length, memory) - whole)
        # The change from the first part to the second is taken to go on at the same rate.
        growth = remaining / (whole - span)
        slow = results[CheckAt.SLOW] + results[CheckAt.CHANGE] * growth
        # To and fro in the slow quantities, as the root of the steps; of the same sign in the phase,
        # where that moves little in a step.
        slow_rounding = rate * sqrt(steps) * (1 + growth)
        fast_rounding = steps / (1 + whole / turn) / _PER_TURN
        rounding = problem.epsilon * max(slow_rounding, fast_rounding)
        # The smaller steps reduce an error e to _FINER**_ORDER e: the difference is the rest.
        return max(slow, fast / _PER_TURN) / (1 - _FINER**_ORDER), rounding

    def _time_of_check(self, length: float, turn: float) -> float:
        """How long a check of a remaining run takes, in the run's time."""
        damping = self.problem.strength * turn
        whole_turns = min(_MOST_WHOLE_TURNS, _WHOLE_TURNS * max(1.0, _WHOLE_DAMPED * damping))
        if length < turn * whole_turns:
            return length
        return min(length, _MOST_TURNS * turn, max(_LEAST_TURNS * turn, _CHECKED * length))

    def _compared(
        self, plan: Plan, state: np.ndarray, span: float, whole: float, rate: float
    ) -> list[Any]:
        """The numbers of a check by machine code, at the places of `CheckAt`."""
        problem = self.problem
        # A list first, as Python fills it in less time than NumPy an array.
        numbers: list[Any] = [0.0] * CheckAt.SIZE
        numbers[CheckAt.FIRST_LAW : CheckAt.SECOND_LAW] = plan.law()
        numbers[CheckAt.SECOND_LAW : CheckAt.SPAN] = plan.narrowed(_FINER).law()
        numbers[CheckAt.SPAN] = span
        numbers[CheckAt.WHOLE] = whole
        numbers[CheckAt.RATE] = rate
        scheme = problem.scheme.addresses[problem.number]
        array = np.array(numbers, problem.number)
        problem.kernels.check(scheme, problem.address, state, array)
        return array.tolist()
