"""Splitting: exact flows of a problem's fast and slow parts in turns, by schemes for nearly integrable systems."""

from dataclasses import dataclass, replace
from math import inf, isfinite, pi, sqrt

import numpy as np

from polhode.models.operations import FLOAT, numpy_operations
from polhode.models.problem import Parts, Problem
from polhode.solvers.compile import parameter_array
from polhode.solvers.contract import (
    UNLIMITED,
    Integrator,
    Outcome,
    Record,
    Settings,
    Solver,
    SolverNotValidError,
    Status,
)
from polhode.solvers.machine_code.underflow import FlushedToZero
from polhode.solvers.parts.kernels import At, Code, clock, kernel
from polhode.solvers.parts.schemes import SCHEMES, Scheme

# Deadline and Ctrl-C are looked at once per this many slow flows, some 20 ms.
CHUNK = 1_000_000
# Error aimed at over the tolerance: estimates may be off, and what follows the check may amplify.
AIM = 0.2
# The least rate that counts: L grows from rest as fast as the shear makes it, in half a unit of it.
SHEAR = 0.5
# The check of the step: over this share of what is left of the run, within so many turns, against steps smaller by
# this factor, at so many times within some turns at the beginning and at the end.
CHECKED, LEAST_TURNS, MOST_TURNS = 0.01, 2.0, 2000.0
FINER, POINTS, MEAN_OVER = 0.8, 12, 5.0
# The step stands if the estimated error is within these factors of the one wanted; else the law is scaled, so often.
FITTING, ROUNDS = (0.2, 1.3), 4
# Another round for wider steps pays if they cost no more than this share of those at hand.
REWARDING = 0.85
# An angle of the fast components, in rad, that may be off per turn, in tolerances.
PER_TURN = 3.0
# Further checks come after these shares of a run, if that is so many turns at least.
AGAIN, LEAST_BETWEEN = (0.1, 0.4), 50.0
# Scale of the error of a plan that ends in nothing.
HOPELESS = 1e3
# Errors that rounding makes are no reason for smaller steps.
ROUNDING = 1e-13

_FAILED: dict[int, Status] = {Code.NOT_FINITE: Status.NON_FINITE, Code.NO_STEP: Status.STEP_UNDERFLOW}


@dataclass(frozen=True)
class Plan:
    """A scheme and the factor of its step, ``Scheme.step``, with the square of the least rate that counts."""

    scheme: Scheme
    factor: float
    floor: float

    def law(self, smaller: float = 1.0) -> np.ndarray:
        """What machine code receives as law; all steps smaller by a factor, if asked."""
        return np.array([self.factor * smaller, self.scheme.exponent, self.scheme.widest * smaller, self.floor])

    def flows_per_time(self, rate: float) -> float:
        """Slow flows in a unit of time at a rate of the fast angle."""
        return self.scheme.stages / self.scheme.step(self.factor, rate)


class Split:
    """A problem bound to the machine code of its parts.

    Parameters
    ----------
    problem : Problem
        With parts.
    tolerance : float
        Error of the slow components that is allowed; `AIM` of it is aimed at.
    """

    def __init__(self, problem: Problem, tolerance: float) -> None:
        assert problem.parts is not None
        self.parts: Parts = problem.parts
        self.p, self.error = parameter_array(problem), AIM * tolerance
        self.dimension = problem.dimension
        self.strength = problem.parts.strength(self.p.tolist())
        self.floor = SHEAR * self.strength
        self.resting = np.isin(np.arange(problem.dimension), problem.parts.resting)

    def rate(self, state: np.ndarray) -> float:
        """Rate of the fast angle, no less than the least one that counts."""
        speed = self.parts.rate(FLOAT)(state.tolist(), self.p)
        return sqrt(speed * speed + self.floor)

    def cheapest(self, rate: float, scales: dict[str, float]) -> Plan:
        """The plan of fewest flows at a rate, where each scheme's errors are so many times those of its law."""
        wanted = self.error / self.strength
        expected = [(each, each.factor(wanted / scales[each.name])) for each in SCHEMES]
        return min((Plan(*each, self.floor) for each in expected), key=lambda plan: plan.flows_per_time(rate))

    def plan(self, record: Record) -> Plan:
        """The cheapest plan found that a check at the start lets stand."""
        rate, names = self.rate(record.start), [each.name for each in SCHEMES]
        begin = float(record.times[0])
        plan, scales, good = self.cheapest(rate, dict.fromkeys(names, 1.0)), {}, []
        for _ in range(ROUNDS):
            ratio = self.off(plan, record.start, begin, record)
            if ratio <= FITTING[1]:
                good.append(plan)
            if FITTING[0] <= ratio <= FITTING[1] or record.expired:
                break
            # What one scheme's errors are to its law, those of schemes not yet tried are expected to be to theirs.
            found = ratio * self.error / self.strength / plan.scheme.law(plan.factor, rate)
            scales[plan.scheme.name] = found
            before, plan = plan, self.cheapest(rate, dict.fromkeys(names, found) | scales)
            if plan.flows_per_time(rate) > REWARDING * before.flows_per_time(rate) and good:
                break
        return min(good, key=lambda plan: plan.flows_per_time(rate)) if good else plan

    def off(self, plan: Plan, state: np.ndarray, now: float, record: Record) -> float:
        """Estimated error of a plan over the one aimed at."""
        error = self.estimated(plan, state, now, record)
        return max(error, ROUNDING) / max(self.error, ROUNDING) if isfinite(error) else HOPELESS

    def estimated(self, plan: Plan, state: np.ndarray, now: float, record: Record) -> float:
        """Error of the slow components in the whole run, from short runs by the plan and by smaller steps.

        What the two differ by in a turn's mean grows with time, as long as the slow components remember; the rest goes
        to and fro within a turn. What the others err by, in rad per turn, counts as well.
        """
        length, turn = float(record.times[-1]) - now, 2 * pi / self.rate(state)
        window = min(length, MOST_TURNS * turn, max(LEAST_TURNS * turn, CHECKED * length))
        span = MEAN_OVER * turn if window > 4 * MEAN_OVER * turn else min(turn, window / 2)
        points = np.arange(1, POINTS + 1) / POINTS * span
        times = now + np.concatenate([[0.0], points, window - span + points])
        rows = np.empty((2, len(times), len(state)))
        rows[:, 0] = state
        for each, smaller in zip(rows, (1.0, FINER), strict=True):
            own = clock(now)
            if self.advance(plan.scheme, plan.law(smaller), state.copy(), own, times, each) != Code.FINISHED:
                return inf
            record.work.rejected = (record.work.rejected or 0) + int(own[At.STEPS])
        apart = (rows[0] - rows[1])[1:]
        slow, fast = apart[:, self.resting], apart[:, ~self.resting]
        drift = np.linalg.norm(slow[POINTS:].mean(axis=0) - slow[:POINTS].mean(axis=0)) / (window - span)
        remaining = max(0.0, min(length, 1 / self.strength) - window)
        errors = (
            np.linalg.norm(slow, axis=1).max() + drift * remaining,
            np.max(np.linalg.norm(fast, axis=1) / (1 + (times[1:] - now) / turn)) / PER_TURN,
        )
        return float(max(errors)) / (1 - FINER**plan.scheme.order)

    def marks(self, record: Record) -> list[float]:
        """Times at which the plan is checked anew, and the end."""
        begin, end = float(record.times[0]), float(record.times[-1])
        turn = 2 * pi / self.rate(record.start)
        return [
            *(begin + share * (end - begin) for share in AGAIN if share * (end - begin) > LEAST_BETWEEN * turn),
            end,
        ]

    def run(self, record: Record) -> Outcome:
        """Fill the record's rows."""
        plan, work = self.plan(record), record.work
        state, own = record.start.copy(), clock(float(record.times[0]))
        for mark in self.marks(record):
            now = float(own[At.BEGIN] + own[At.SINCE] * own[At.STEP])
            ratio = self.off(plan, state, now, record) if own[At.STEPS] else 1.0
            if ratio > FITTING[1]:
                plan = replace(plan, factor=plan.factor * ratio ** (-1 / plan.scheme.order))
                own[: At.FILLED] = clock(now)[: At.FILLED]
            own[At.UNTIL] = inf if mark == record.times[-1] else mark
            law, chunk = plan.law(), CHUNK // plan.scheme.stages
            code = Code.STEPS_DONE
            while code == Code.STEPS_DONE:
                limit = min(chunk, record.max_steps - int(own[At.STEPS]))
                code = self.advance(plan.scheme, law, state, own, record.times, record.rows, limit)
                record.filled, work.steps = int(own[At.FILLED]), int(own[At.STEPS])
                record.now = float(own[At.BEGIN] + own[At.SINCE] * own[At.STEP])
                if code == Code.STEPS_DONE and work.steps >= record.max_steps:
                    return Status.STEP_LIMIT, f"{work.steps} steps"
                if code == Code.STEPS_DONE and record.expired:
                    return Status.TIME_LIMIT, f"after {work.steps} steps"
            if code in _FAILED:
                return _FAILED[code], f"after {work.steps} steps"
            if code == Code.FINISHED:
                break
        return Status.REACHED_END, ""

    def advance(
        self,
        scheme: Scheme,
        law: np.ndarray,
        state: np.ndarray,
        own: np.ndarray,
        times: np.ndarray,
        rows: np.ndarray,
        limit: int = UNLIMITED,
    ) -> int:
        """Advance state and clock until the rows are filled, or a limit is met; says which."""
        own[[At.LIMIT, At.ROWS]] = limit, len(times)
        with FlushedToZero():
            kernel(self.parts, self.dimension)(scheme.numbers, law, self.p, state, own, times, rows)
        return int(own[At.CODE])

    def free(self, record: Record) -> Outcome:
        """Fill the record's rows by the fast flow alone, modulo whole turns."""
        rate = self.parts.rate(FLOAT)(record.start.tolist(), self.p)
        left = record.times[1:] - record.times[0]
        left -= np.floor(left * rate / (2 * pi)) * (2 * pi / rate) if rate > 0 else 0.0
        state, pieces = tuple(record.start), int(2 * pi / self.parts.reach) + 1
        ops = numpy_operations()
        flow, constants = self.parts.fast.flow(ops), self.parts.fast.constants(self.p, left / pieces, ops)
        for _ in range(pieces):
            state = flow(state, constants)
        record.put(np.stack(np.broadcast_arrays(*state), axis=1))
        record.work.steps = 1
        return Status.REACHED_END, ""


class PartsSolver(Solver):
    """What solvers share that need a problem's parts."""

    accepts = "forms that state their parts: spheroid-axis"
    library = "llvmlite"
    package = "llvmlite"
    family = "polhode"
    many_periods = True
    backends = ("compiled",)

    def check(self, problem: Problem) -> None:
        """Refuse a problem that states no parts."""
        super().check(problem)
        if problem.parts is None:
            raise SolverNotValidError(
                f"solver {self.name!r}: {problem.name!r} states no parts with exact flows; "
                "use form 'spheroid-axis' or solver 'taylor'"
            )


class Splitting(PartsSolver):
    """Exact rotation and exact relaxation in turns: schemes of order (2), (4, 2), (8, 6, 4) and (10, 6, 4).

    Class: palindromic compositions for nearly integrable systems; torque-free motion is exact at any step. Scheme and
    step follow from the tolerance by a law, and from a check by two step sizes at the beginning of the run.
    Stability: unconditional in the relaxation but for short backward ones; the step is bound by the angle, so that at
    small St, where relaxation outpaces the rotation, steps are as short as those of an explicit method.
    Tolerance: error of L/I_e over the whole run, however long; orientation errs by that times the angle turned.
    Caveat: what lingers at a saddle amplifies errors after the check.
    Error per rotation over tolerance: at most 10; 2 measured.
    Source: Blanes, Casas, Farrés, Laskar, Makazaga and Murua, Appl. Numer. Math. 68 (2013) 58.
    """

    name = "splitting"
    summary = "exact rotation and exact relaxation in turns, for nearly torque-free spheroids"
    error_constant = 10.0

    def prepare(self, problem: Problem, settings: Settings) -> Integrator:
        """Compile the kernels, once per parts."""
        split = Split(problem, settings.tolerance)

        def integrate(record: Record) -> Outcome:
            return split.run(record) if split.strength > 0 else split.free(record)

        return integrate
