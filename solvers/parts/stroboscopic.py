"""Stroboscopic averaging: turns of the full equations give the averaged field."""

from dataclasses import dataclass
from functools import cached_property
from math import isfinite, pi

import numpy as np

from polhode.models.once import once
from polhode.models.problem import Problem
from polhode.solvers.contract import Outcome, Record, Status
from polhode.solvers.parts.schemes import ABA, dop853
from polhode.solvers.parts.splitting import Split, Splitting
from polhode.solvers.parts.strobe_kernels import MAX_TURNS_TO_ROW, StrobeKernels, strobe_kernels

# Runs of fewer turns are left to splitting.
_LEAST_TURNS = 1000
# Least turns of a macro-step over its order: it costs fifteen times its order.
_PAYING = 20.0
# Turns of a segment that is left to splitting where macro-steps do not pay.
_SEGMENT_TURNS = 600.0
# Times that a segment is doubled at most, while macro-steps go on not to pay.
_LONGEST = 4
# Share of the tolerance for the error of a macro-step; rows within it err more.
_MACRO = 0.1
# Share of the tolerance for the error of averaging.
_AVERAGING = 0.1
# Share of the tolerance for the error of micro-steps.
_MICRO = 0.1
# Micro-steps per turn: at first, at least, at most.
_FIRST = 6
_FEWEST = 4
MAX_MICRO_STEPS = 24
# Share of the error allowed below which fewer micro-steps are tried.
_EASY = 0.1
# Orders of the difference.
_ORDERS = (2, 4, 6)
# Rounding of the difference, which no choice improves.
_ROUNDING = 3e-15
# Weights of (Φ^k - Φ^-k) in the central differences, Φ the map of a turn.
_WEIGHTS = np.array([[1 / 2, 0.0, 0.0], [2 / 3, -1 / 12, 0.0], [3 / 4, -3 / 20, 1 / 60]])
# Addresses of its rows, by the turns of their differences.
_ROWS = {1 + i: row.ctypes.data for i, row in enumerate(_WEIGHTS)}
# Stages of a macro-step, the field at its end included.
_STAGES = 13
# Power of the error by which a macro-step changes: one over the order of the estimate.
_EXPONENT = 1 / 8
# Factor of a new macro-step, lest it be refused.
_SAFETY = 0.85
# Bounds of a change of macro-steps.
_SHRINK = 0.2
_GROW = 5.0
# The first macro-step, in times of relaxation.
_FIRST_STEP = 0.3


@dataclass
class Setting:
    """Settings of the next macro-step.

    Micro-steps per turn, whether fewer may do, turns (0: not known), failures.
    """

    micro: int = _FIRST
    easy: bool = False
    turns: float = 0.0
    failed: int = 0


@once()
def interpolant() -> np.ndarray:
    """Its terms between two points, of their difference and the stages in between."""
    table = dop853()
    terms = np.zeros((3 + len(table.D), 1 + len(table.A)))
    terms[:3, 0] = (1.0, -1.0, 2.0)
    terms[1, 1] = 1.0
    terms[2, [1, _STAGES]] = -1.0
    terms[3:, 1:] = table.D
    return terms


class Strobe:
    """A problem bound to the machine code of stroboscopic averaging, and to splitting elsewhere."""

    def __init__(self, problem: Problem, tolerance: float) -> None:
        self.split = Split(problem, tolerance)
        self.tolerance = tolerance
        self.p = self.split.address
        self.scheme = ABA.addresses[float]
        self.table = dop853()
        # Machine code takes addresses in less time than arrays.
        self.nodes = self.table.A.ctypes.data
        self.inner = 0
        # Either machine code is compiled beforehand if it is the one needed, and else where it
        # turns out to be.
        _ = self.kernels if self.pays(np.array(problem.start), problem.end) else self.split.kernels

    @cached_property
    def kernels(self) -> StrobeKernels:
        """The machine code, compiled at first use."""
        return strobe_kernels(self.split.parts, self.split.dimension)

    def pays(self, start: np.ndarray, length: float) -> bool:
        """Whether there is a torque, and a run is long enough.

        No rate that is not finite passes.
        """
        rate = self.split.rate(start)
        return self.split.strength > 0 and isfinite(rate) and length * rate >= 2 * pi * _LEAST_TURNS

    def run(self, record: Record) -> Outcome:
        """Fill the record's rows."""
        begin = float(record.times[0])
        end = float(record.times[-1])
        if not self.pays(record.start, end - begin):
            return self.split.run(record)
        point = np.append(record.start, begin)
        setting = Setting()
        record.work.steps = record.work.rejected = self.inner = 0
        while record.filled < len(record.times):
            if stopped := record.stopped:
                return stopped
            moved = self.step(point, setting, record)
            setting.failed = setting.failed + 1 if moved is None else 0
            if moved is None:
                # Ever longer, so that vain attempts cost little.
                outcome = self.split_segment(
                    point, _SEGMENT_TURNS * 2 ** min(setting.failed - 1, _LONGEST), record
                )
                if outcome is not None:
                    return outcome
            else:
                point = moved
            record.now = float(point[-1])
        return Status.REACHED_END, ""

    def step(self, point: np.ndarray, setting: Setting, record: Record) -> np.ndarray | None:
        """A macro-step and its rows; None where averaging does not pay or does not hold."""
        rate = self.split.rate(point[:-1])
        left = float(record.times[-1] - point[-1])
        period = 2 * pi / rate
        memory = min(left, 1 / self.split.strength) / period
        scale = np.full(len(point), self.tolerance)
        scale[-1] = self.tolerance * (record.times[-1] - record.times[0])
        horizon = memory / scale
        horizon[-1] = left / period / scale[-1]
        fields = self.fields(point, setting, horizon)
        order = self.order(fields, horizon)
        if order is None:
            return None
        stages = np.empty((len(self.table.A), len(point)))
        end = np.empty(len(point))
        stages[0] = fields[_ORDERS.index(order)]
        turns = setting.turns or max(_FIRST_STEP * memory, 2 * _PAYING * order)
        while True:
            turns = float(min(np.ceil(turns), np.ceil(left / period) + 2))
            if turns < min(_PAYING * order, left / period):
                setting.turns = 0.0
                return None
            numbers = np.array([setting.micro, order // 2, 1, 1, _STAGES, turns], dtype=float)
            self.stages(numbers, point, stages, end)
            estimates = (
                turns * (self.table.E5 @ stages[:_STAGES]),
                turns * (self.table.E3 @ stages[:_STAGES]),
            )
            error = self.error(estimates, scale * _MACRO + turns * _ROUNDING)
            factor = _SAFETY * error**-_EXPONENT if error > 0 else _GROW
            if error <= 1:
                break
            record.work.rejected = (record.work.rejected or 0) + 1
            turns *= max(_SHRINK, factor) if np.isfinite(error) else _SHRINK
        setting.turns = turns * min(_GROW, factor)
        record.work.steps = (record.work.steps or 0) + 1
        record.work.inner = self.inner
        last = int(np.searchsorted(record.times, end[-1], side="right"))
        if last > record.filled:
            numbers[3:5] = _STAGES, len(stages)
            self.stages(numbers, point, stages, end.copy())
            record.put(
                self.rows(
                    point, end, stages, turns, setting.micro, record.times[record.filled : last]
                )
            )
        return end

    def rows(
        self,
        point: np.ndarray,
        end: np.ndarray,
        stages: np.ndarray,
        turns: float,
        micro: int,
        times: np.ndarray,
    ) -> np.ndarray:
        """Rows within a macro-step."""
        rows = np.empty((len(times), len(point) - 1))
        rests = np.empty(len(times))
        terms = interpolant() @ np.vstack([end - point, turns * stages])
        setting = np.array([len(times), 1.0 + int(MAX_TURNS_TO_ROW * micro), turns])
        self.kernels.rows(self.scheme, self.p, setting, terms, point, times, rests, rows)
        return rows

    def fields(self, point: np.ndarray, setting: Setting, horizon: np.ndarray) -> np.ndarray:
        """Averaged fields of all orders, with as many micro-steps as their error allows."""
        fields = np.empty((len(_ORDERS), len(point)))
        compared = np.empty((1, len(point)))
        if setting.easy:
            setting.micro = max(_FEWEST, setting.micro - 1)
        while True:
            self.mean(point, setting.micro, fields)
            # Differences of single turns show what smaller steps change; of the smallest, what
            # larger ones do.
            more = (
                min(MAX_MICRO_STEPS, setting.micro + 2)
                if setting.micro < MAX_MICRO_STEPS
                else MAX_MICRO_STEPS - 2
            )
            self.mean(point, more, compared)
            off = (
                np.max(np.maximum(np.abs(fields[0] - compared[0]) - _ROUNDING, 0.0) * horizon)
                / _MICRO
            )
            if not off > 1 or setting.micro >= MAX_MICRO_STEPS:
                break
            setting.micro = more
        setting.easy = off < _EASY
        return fields

    def stages(
        self, numbers: np.ndarray, point: np.ndarray, stages: np.ndarray, end: np.ndarray
    ) -> None:
        """Stages of a macro-step; `end` is the point of the last one."""
        self.inner += int(2 * numbers[0] * numbers[1] * (numbers[4] - numbers[3]))
        self.kernels.macro(
            self.scheme, self.p, numbers, _ROWS[int(numbers[1])], point, self.nodes, stages, end
        )

    def mean(self, point: np.ndarray, micro: int, out: np.ndarray) -> None:
        """Averaged fields, a row of `out` per order from the second on; `micro` steps a turn."""
        self.inner += 2 * micro * len(out)
        setting = np.array([micro, len(out), len(out)], dtype=float)
        self.kernels.mean(self.scheme, self.p, setting, _ROWS[1], point, out)

    def order(self, fields: np.ndarray, horizon: np.ndarray) -> int | None:
        """The lowest order whose difference errs little enough, by comparison with the next one."""
        apart = np.maximum(np.abs(fields[:-1] - fields[1:]) - _ROUNDING, 0.0)
        second, fourth = np.max(apart * horizon, axis=1)
        errors = second, fourth, fourth * min(1.0, fourth / second) if second > 0 else 0.0
        return next(
            (order for order, error in zip(_ORDERS, errors, strict=True) if error <= _AVERAGING),
            None,
        )

    def error(self, estimates: tuple[np.ndarray, np.ndarray], scale: np.ndarray) -> float:
        """Error of a macro-step over the one allowed, by DOP853's estimates of orders 5 and 3."""
        with np.errstate(over="ignore"):
            fifth, third = (float(np.sum((estimate / scale) ** 2)) for estimate in estimates)
        return 0.0 if fifth == 0 else fifth / float(np.sqrt((fifth + 0.01 * third) * len(scale)))

    def split_segment(self, point: np.ndarray, turns: float, record: Record) -> Outcome | None:
        """A number of turns by splitting.

        The outcome if the run ends there, else the point moves on.
        """
        until = float(point[-1]) + turns * 2 * pi / self.split.rate(point[:-1])
        last = int(np.searchsorted(record.times, until))
        at_end = last >= len(record.times)
        inner = record.times[record.filled : last]
        times = np.concatenate([point[-1:], inner, [] if at_end else [until]])
        steps = record.work.steps or 0
        room = np.empty((len(times), len(point) - 1))
        segment = Record(times, room, record.deadline, record.max_steps - steps)
        segment.rows[0] = point[:-1]
        status, message = self.split.run(segment)
        record.work.add(segment.work)
        record.work.inner = self.inner
        done = min(segment.filled - 1, len(inner))
        record.put(segment.rows[1 : 1 + done])
        if at_end or not status.success:
            return status, message.replace(
                f"{segment.work.steps} steps", f"{steps + (segment.work.steps or 0)} steps"
            )
        point[:] = *segment.rows[-1], until
        return None


class Stroboscopic(Splitting):
    """Stroboscopic averaging of order 2, 4 or 6 in 1/St; its cost depends on the slow time alone, not on St.

    Class: heterogeneous multiscale. With the angle turned about L as the independent variable
    torque-free motion is periodic. Central differences of the map of one turn give the averaged
    equations; DOP853 integrates them by macro-steps of whole turns; parts of a turn lead to the
    requested times. Turns are made of micro-steps of one composition, of order (10, 6, 4). Order of
    the difference and micro-steps follow from comparison with the next. Stability: of explicit
    macro-steps, short against the time of relaxation. Tolerance: error of L/I_e over the whole run;
    orientation errs by that times the angle turned. Caveat: short runs, and segments where
    averaging does not hold (L nearly vanishes) or does not pay, are runs of `splitting`.
    Differences of turns lose digits in proportion to St: 1e-10 is the least error at St = 1e8.
    Error per rotation over tolerance: at most 10; 2 measured. Source: Calvo, Chartier, Murua and
    Sanz-Serna, Appl. Numer. Math. 61 (2011) 1077.
    """

    name = "stroboscopic"
    also_needs = ("scipy",)  # for the coefficients of DOP853
    summary = "averaged equations from turns of the full ones, for nearly torque-free spheroids and long runs"

    def bound(self, problem: Problem, tolerance: float) -> Strobe:
        """The problem bound to machine code."""
        return Strobe(problem, tolerance)
