"""How large steps may be: a law for each scheme, checked by short runs with two steps."""

from dataclasses import dataclass
from math import inf, isfinite, pi, sqrt
from typing import Any

import numpy as np

from polhode.solvers.contract import Record
from polhode.solvers.parts.schemes import SCHEMES, Scheme

# Error aimed at over the tolerance: estimates may be off, and what follows the check may amplify.
AIM = 0.2
# Rows are reached by few flows where the square of the relaxation in half a step is below so many errors aimed at.
FEW = 12.0
# A check takes this share of what is left of the run, within so many turns, against steps smaller by this factor, at so
# many times within some turns at its beginning and at its end. It takes all of a run of few turns, or of more where
# they are damped, in proportion.
CHECKED, LEAST_TURNS, MOST_TURNS = 0.005, 2.0, 2000.0
ALL, DAMPED, MOST_ALL = 4.0, 4.0, 200.0
FINER, MEAN_OVER = 0.8, 5.0
# No step is a larger share of the run.
SEEN = 0.4
# The step stands if the estimated error is within these factors of the one wanted; else the law is scaled, so often.
FITTING, ROUNDS = (0.1, 2.0), 4
# Of the errors, where they fall more slowly than by a law.
LEAST_ORDER = 4
# Another round for wider steps pays if they cost no more than this share of those at hand.
REWARDING = 0.85
# What a check costs beside its flows, in such; a plan so little off needs none once its step follows.
CHECK, NEARLY = 2000.0, 10.0
# An angle of the fast components, in rad, that may be off per turn, in tolerances.
PER_TURN = 3.0
# Slow components remember for so many times of relaxation, between that of the fastest and that of the slowest one.
MEMORY = 1.0
# Scale of the error of a plan that ends in nothing.
HOPELESS = 1e3
# Few stages are repeated in a step, which looks at the rate once. At small angles ABA(8,6,4) gains as much as
# ABA(10,6,4), at wide ones it loses.
CHOICE = tuple(each.repeated(max(1, 4 // each.stages)) for each in SCHEMES if each.name != "ABA(8,6,4)")


@dataclass(frozen=True)
class Plan:
    """A scheme and the factor of its step, ``Scheme.step``, with the square of the least rate that counts."""

    scheme: Scheme
    factor: float
    floor: float
    few: bool

    def law(self, smaller: float = 1.0, between: tuple[float, float] = (0.0, inf)) -> np.ndarray:
        """What machine code receives as law; all steps smaller by a factor, if asked; it holds between two rates."""
        widest = self.scheme.widest * smaller
        return np.array([self.factor * smaller, self.scheme.exponent, widest, self.floor, *between, self.few])

    def flows_per_time(self, rate: float) -> float:
        """Slow flows in a unit of time at a rate of the fast angle."""
        return self.scheme.stages / self.scheme.step(self.factor, rate)


class Planner:
    """Chooses plans for one problem (`splitting.Split`) and one tolerance, from its short runs."""

    def __init__(self, problem: Any, tolerance: float) -> None:
        self.problem, self.error = problem, AIM * tolerance
        # What each scheme's errors are to its law, as far as is known.
        self.scales = dict.fromkeys((each.name for each in CHOICE), 1.0)

    def cheapest(self, rate: float, longest: float) -> Plan:
        """The plan of fewest flows at a rate, where each scheme's errors are so many times those of its law."""
        wanted, plans = self.error / self.problem.strength, list[Plan]()
        for each in CHOICE:
            factor = min(each.factor(wanted / self.scales[each.name]), longest * rate**each.exponent)
            relaxed = 0.5 * self.problem.strength * each.step(factor, rate)
            plans.append(Plan(each, factor, self.problem.floor, relaxed**2 < FEW * self.error))
        return min(plans, key=lambda plan: plan.flows_per_time(rate))

    def plan(self, old: Plan | None, state: np.ndarray, now: float, record: Record) -> Plan:
        """The cheapest plan found that a check lets stand, beginning with that in use."""
        rate, seen, good = self.problem.rate(state), set[str](), list[Plan]()
        length = float(record.times[-1]) - now
        # Rows within the first step are the same whatever its length: a check sees nothing there.
        longest = SEEN * length
        plan = before = old or self.cheapest(rate, longest)
        worst = inf
        for _ in range(ROUNDS):
            ratio = self.off(plan, state, now, record)
            if ratio >= worst:
                # What is left is rounding, which more steps add to.
                return before
            worst = ratio if ratio > FITTING[1] else inf
            if ratio <= FITTING[1]:
                good.append(plan)
            if FITTING[0] <= ratio <= FITTING[1] or record.expired:
                break
            name = plan.scheme.name
            found = ratio * self.error / self.problem.strength / plan.scheme.law(plan.factor, rate)
            if not seen:
                # What one scheme's errors have become, those of the others are expected to have become as well.
                self.scales = {each: scale * found / self.scales[name] for each, scale in self.scales.items()}
            if (name in seen or ratio < NEARLY) and ratio > 1:
                # The errors fall more slowly than by the law: where the slow part is not so small.
                found *= ratio ** (plan.scheme.order / LEAST_ORDER - 1)
            self.scales[name] = found
            seen.add(name)
            before, plan = plan, self.cheapest(rate, longest)
            gain = before.flows_per_time(rate) - plan.flows_per_time(rate)
            if good and gain < max((1 - REWARDING) * before.flows_per_time(rate), CHECK / length):
                break
            if not good and ratio < NEARLY and plan.scheme is before.scheme:
                return plan
        return min(good, key=lambda plan: plan.flows_per_time(rate)) if good else plan

    def off(self, plan: Plan, state: np.ndarray, now: float, record: Record) -> float:
        """Estimated error of a plan over the one aimed at."""
        error = self.estimated(plan, state, now, record)
        rounding = self.problem.rounding
        return max(error, rounding) / max(self.error, rounding) if isfinite(error) else HOPELESS

    def estimated(self, plan: Plan, state: np.ndarray, now: float, record: Record) -> float:
        """Error of the slow quantities in the rest of the run, from short runs by the plan and by smaller steps.

        What the two differ by in a turn's mean grows with time, as long as the slow quantities remember; the rest goes
        to and fro within a turn. What the fast components err by, in rad per turn, counts as well: over their amplitude
        where that is small and grows, as at a saddle.
        """
        problem, length = self.problem, float(record.times[-1]) - now
        turn = 2 * pi / problem.rate(state)
        window = min(length, MOST_TURNS * turn, max(LEAST_TURNS * turn, CHECKED * length))
        if length < turn * min(MOST_ALL, ALL * max(1.0, DAMPED * problem.strength * turn)):
            window = length
        span = MEAN_OVER * turn if window > 4 * MEAN_OVER * turn else window / 2
        laws, setting, found = (
            problem.numbers(each)
            for each in ([*plan.law(), *plan.law(FINER)], [now, span, window, 2 * pi / turn], [0.0] * 7)
        )
        problem.kernels.check(plan.scheme.addresses[problem.number], laws, problem.address, state, setting, found)
        slow, fast, change, begin, end, steps, failed = found.tolist()
        record.work.rejected = (record.work.rejected or 0) + int(steps)
        if failed:
            return inf
        if end > begin:
            fast /= min(1.0, end)
        remaining = max(0.0, min(length, MEMORY / sqrt(problem.strength * problem.forgetting)) - window)
        error = max(slow + change / (window - span) * remaining, fast / PER_TURN)
        return error / (1 - FINER**plan.scheme.order)
