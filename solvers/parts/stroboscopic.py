"""Stroboscopic averaging: turns of the full equations give the averaged field.

A *point* is a state with its time behind it, an array of shape (d + 1,). Φ maps a point to the
point one turn of the fast angle later. The *averaged field* is the rate of change of a point per
turn, dΦⁿ/dn at n = 0; its last component is the period. A central difference of Φ¹, Φ², Φ³ and
their inverses gives it. DOP853 integrates it over the number of turns: a *macro-step* is a whole
number of turns, usually many. Each turn of the differences is made of *micro-steps* of splitting.
`strobe_kernels` has the machine code of all loops.

The control of errors bounds parts: each macro-step, the difference, the micro-steps. It proves no bound of
the error of a run. That rests on measurements: the error stated for a run comes from its comparison with
one by splitting (`docs/method.md`), and `reports/pick/stated.md` counts how often it holds.
"""

from dataclasses import dataclass
from functools import cached_property
from math import isfinite, pi

import numpy as np

from polhode.models.once import once
from polhode.models.problem import Problem
from polhode.solvers.contract import Outcome, Record, Status
from polhode.solvers.parts.schemes import ABA, dop853
from polhode.solvers.parts.splitting import Split, Splitting
from polhode.solvers.parts.strobe_kernels import (
    MAX_TURNS_TO_ROW,
    MacroAt,
    MeanAt,
    RowsAt,
    StrobeKernels,
    strobe_kernels,
)

# Numbers called estimates have no recorded measurement. The shares of the tolerance,
# `MAX_MICRO_STEPS` and `_ROUNDING` decide errors. Any other estimate decides the time alone.

# Runs of fewer turns are left to splitting; an estimate.
_LEAST_TURNS = 1000
# Least turns of a macro-step over the order of its difference. Each of DOP853's twelve new stages
# takes as many turns as the order says, half of them backwards; with the three stages that rows
# need, a macro-step costs fifteen times its order in turns, and eight turns more for each trial of
# micro-steps. With one trial that is less, at any order, than the turns that it covers.
_PAYING = 20.0
# Turns of a segment that is left to splitting where macro-steps do not pay; an estimate.
_SEGMENT_TURNS = 600.0
# Largest number of times that a segment's length is doubled while macro-steps still do not pay; an
# estimate: segments of 9,600 turns at most.
_LONGEST = 4
# Shares of the tolerance for the errors of a macro-step, of averaging and of micro-steps. They
# leave most of it, as rows within a macro-step err more than its end. Estimates. The first
# belongs to one macro-step, the others to a run. Nothing here bounds the sum over macro-steps: errors
# of time add up in it, and errors of L fade only as damping forgets them.
_MACRO = 0.1
_AVERAGING = 0.1
_MICRO = 0.1
# Turns of a macro-step beyond what the present period asks for: so the last row mostly lies within the step
# although the period changes. If it does not, another step follows. An estimate.
_SPARE_TURNS = 2.0
# Micro-steps more per turn of the fields that tell the error of micro-steps, and of the next trial. An estimate: the
# difference shows a third of the error and more, and `_MICRO` leaves room for that.
_MORE_MICRO_STEPS = 2
# Micro-steps per turn, at first, at least and at most; estimates.
_FIRST = 6
_FEWEST = 4
MAX_MICRO_STEPS = 24
# Error of micro-steps over the allowed one, below which the next macro-step tries one micro-step
# fewer per turn; an estimate.
_EASY = 0.1
# Orders of the central difference. Order 2j takes turns from Φ^-j to Φ^j.
_ORDERS = (2, 4, 6)
# Rounding error of a component of the averaged field, per turn, which no choice improves: smaller
# differences say nothing. The fields of order 2, 4 and 6 of 200 random spheroids at St = 1e8 and 1e9
# differ by rounding alone: in a component of the state by 1.3e-15 at most. The number is
# some twice that: an estimate. It serves for the period and for L of any size too, which that
# measurement does not cover.
_ROUNDING = 3e-15
# Weights of Φ^k - Φ^-k in the central differences: a row for each order, a column for each k = 1,
# 2, 3.
_WEIGHTS = np.array([[1 / 2, 0.0, 0.0], [2 / 3, -1 / 12, 0.0], [3 / 4, -3 / 20, 1 / 60]])
# Address of row j - 1 by j, the largest k that it uses, which is half its order. The address of the first
# row, by 1, is that of the whole table.
_WEIGHT_ROWS = {1 + i: row.ctypes.data for i, row in enumerate(_WEIGHTS)}
# Stages of DOP853, the field at the end of the step included. Three more make its interpolant.
_STAGES = 13
# Power of error / allowed error by which macro-steps change: DOP853's estimate of the error of a
# step falls with the eighth power of its length.
_EXPONENT = 1 / 8
# A new macro-step is this much shorter than that power says, as a refused one costs more; an
# estimate.
_SAFETY = 0.85
# Least and largest ratio of a macro-step to the one before: SciPy's least one, and half its largest,
# for which no reason is recorded; an estimate.
_SHRINK = 0.2
_GROW = 5.0
# The first macro-step in times of relaxation, or in what is left of a shorter run; an estimate.
_FIRST_STEP = 0.3


@dataclass
class Setting:
    """Settings of the next macro-step, which each step leaves for the next one."""

    micro: int = _FIRST  # micro-steps per turn
    easy: bool = False  # whether one micro-step fewer may do
    turns: float = 0.0  # length in turns; 0 where it is not known
    failed: int = 0  # macro-steps in a row that did not pay or did not hold


@once()
def interpolant() -> np.ndarray:
    """The matrix of DOP853's interpolant in a step, shape (7, 17).

    It multiplies a column: first the change Δ of the point over the step, then the step's length times
    each of the 16 stages. The product is the interpolant's seven terms F0, F1, ... as `strobe_kernels`
    adds them up. The first three belong to the cubic through both ends, with the
    slopes f and g there, the stages 0 and `_STAGES` - 1 times the length: Δ, f - Δ, 2Δ - f - g.
    """
    table = dop853()
    change = 0
    begin = 1
    end = _STAGES
    terms = np.zeros((3 + len(table.D), 1 + len(table.A)))
    terms[0, change] = 1.0
    terms[1, [change, begin]] = -1.0, 1.0
    terms[2, [change, begin, end]] = 2.0, -1.0, -1.0
    terms[3:, 1:] = table.D
    return terms


class Strobe:
    """A problem bound to the machine code of stroboscopic averaging, and to splitting elsewhere."""

    def __init__(self, problem: Problem, tolerance: float) -> None:
        self.split = Split(problem, tolerance)
        self.tolerance = tolerance
        # Address of the field's parameters.
        self.p = self.split.address
        self.scheme = ABA.addresses[float]
        self.table = dop853()
        # Address of the method's matrix A: machine code takes addresses in less time than arrays.
        self.matrix = self.table.A.ctypes.data
        # Micro-steps of the differences so far, without those that close turns or lead to rows.
        self.inner = 0
        # The machine code that the start asks for is compiled now, before a run is timed; the other
        # one is compiled where a run turns out to need it.
        _ = self.kernels if self.pays(np.array(problem.start), problem.end) else self.split.kernels

    @cached_property
    def kernels(self) -> StrobeKernels:
        """The machine code, compiled at first use."""
        return strobe_kernels(self.split.parts, self.split.dimension)

    def pays(self, start: np.ndarray, length: float) -> bool:
        """Whether there is a torque, the rate is finite, and the run has `_LEAST_TURNS`."""
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
                # Segments by splitting become longer, so that vain attempts cost little beside
                # them.
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
        """Take a macro-step, fill its rows and return its end; None if averaging does not do.

        It does not where no order of the difference errs little enough, or where the step would
        have fewer turns than `_PAYING` asks for. A step to the end of the run is taken however short it is.
        """
        period = 2 * pi / self.split.rate(point[:-1])
        left = float(record.times[-1] - point[-1])
        turns_left = left / period
        # Turns for which an error of the state is remembered: the turns in the shortest time of
        # relaxation, by the largest rate, or the turns left. Slower components remember errors for longer, so that
        # this allows them more. Splitting's checks take a longer time, with the least rate in it too;
        # no reason for the difference is recorded.
        memory = min(left, 1 / self.split.strength) / period
        # Allowed errors. A time error of tolerance × duration turns the angle by tolerance × the whole
        # angle turned.
        scale = np.full(len(point), self.tolerance)
        scale[-1] = self.tolerance * (record.times[-1] - record.times[0])
        # An error of the field per turn times `horizon` is the error of the run over its tolerance:
        # errors add up over the turns that are remembered, and errors of time over all that are
        # left.
        horizon = memory / scale
        horizon[-1] = turns_left / scale[-1]
        fields = self.fields(point, setting, horizon)
        order = self.order(fields, horizon)
        if order is None:
            return None
        stages = np.empty((len(self.table.A), len(point)))
        end = np.empty(len(point))
        stages[0] = fields[_ORDERS.index(order)]
        # A first step has no fewer than twice the turns that pay, unless the run ends before; an estimate.
        turns = setting.turns or max(_FIRST_STEP * memory, 2 * _PAYING * order)
        while True:
            turns = float(min(np.ceil(turns), np.ceil(turns_left) + _SPARE_TURNS))
            if turns < min(_PAYING * order, turns_left):
                setting.turns = 0.0
                return None
            numbers = np.empty(MacroAt.SIZE)
            numbers[MacroAt.MICRO_STEPS] = setting.micro
            numbers[MacroAt.TURNS] = order // 2
            numbers[MacroAt.ROWS] = 1
            # Stage 0 is known.
            numbers[MacroAt.STAGE] = 1
            numbers[MacroAt.STAGES_END] = _STAGES
            numbers[MacroAt.MACRO_TURNS] = turns
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
            # The interpolant's further stages. Their points would overwrite `end`.
            numbers[MacroAt.STAGE] = _STAGES
            numbers[MacroAt.STAGES_END] = len(stages)
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
        """States at times within a macro-step from `point` to `end`, shape (n, d).

        From the nearest end of a turn a part of a turn leads to each time, in one micro-step more
        than the whole ones in half a turn.
        """
        rows = np.empty((len(times), len(point) - 1))
        rests = np.empty(len(times))
        terms = interpolant() @ np.vstack([end - point, turns * stages])
        numbers = np.empty(RowsAt.SIZE)
        numbers[RowsAt.ROWS] = len(times)
        numbers[RowsAt.MICRO_STEPS] = 1.0 + int(MAX_TURNS_TO_ROW * micro)
        numbers[RowsAt.MACRO_TURNS] = turns
        self.kernels.rows(self.scheme, self.p, numbers, terms, point, times, rests, rows)
        return rows

    def fields(self, point: np.ndarray, setting: Setting, horizon: np.ndarray) -> np.ndarray:
        """Averaged fields of all orders, with as many micro-steps as their error asks for.

        At `MAX_MICRO_STEPS` the fields are taken as they are: neither the macro-step nor the choice of
        the order is refused for errors of micro-steps.
        """
        fields = np.empty((len(_ORDERS), len(point)))
        compared = np.empty((1, len(point)))
        if setting.easy:
            setting.micro = max(_FEWEST, setting.micro - 1)
        while True:
            self.mean(point, setting.micro, fields)
            # The error of micro-steps shows in differences of order 2, which take a single turn either way. They are
            # compared with those of more micro-steps per turn, at most `MAX_MICRO_STEPS`; at that number, of fewer.
            more = min(MAX_MICRO_STEPS, setting.micro + _MORE_MICRO_STEPS)
            if setting.micro == MAX_MICRO_STEPS:
                more = MAX_MICRO_STEPS - _MORE_MICRO_STEPS
            self.mean(point, more, compared)
            # The fields of order 2 differ by this beyond rounding.
            difference = np.maximum(np.abs(fields[0] - compared[0]) - _ROUNDING, 0.0)
            # The error of the run that it makes, over the one allowed; NaN ends the search too.
            off = np.max(difference * horizon) / _MICRO
            if not off > 1 or setting.micro >= MAX_MICRO_STEPS:
                break
            setting.micro = more
        setting.easy = off < _EASY
        return fields

    def stages(
        self, numbers: np.ndarray, point: np.ndarray, stages: np.ndarray, end: np.ndarray
    ) -> None:
        """Fill the stages that `numbers` names, and `end` with the point of the last one."""
        turns = int(numbers[MacroAt.TURNS])
        computed = int(numbers[MacroAt.STAGES_END] - numbers[MacroAt.STAGE])
        # Each stage takes `turns` turns forth and `turns` turns back.
        self.inner += 2 * int(numbers[MacroAt.MICRO_STEPS]) * turns * computed
        self.kernels.macro(
            self.scheme, self.p, numbers, _WEIGHT_ROWS[turns], point, self.matrix, stages, end
        )

    def mean(self, point: np.ndarray, micro: int, out: np.ndarray) -> None:
        """Fill rows of `out` with the averaged fields of order 2, 4, 6, by `micro` steps a turn."""
        self.inner += 2 * micro * len(out)
        numbers = np.empty(MeanAt.SIZE)
        numbers[MeanAt.MICRO_STEPS] = micro
        # Row j, from 1 on, is of order 2j, which asks for j turns.
        numbers[MeanAt.TURNS] = len(out)
        numbers[MeanAt.ROWS] = len(out)
        self.kernels.mean(self.scheme, self.p, numbers, _WEIGHT_ROWS[1], point, out)

    def order(self, fields: np.ndarray, horizon: np.ndarray) -> int | None:
        """The lowest order whose difference errs little enough, by comparison with the next one.

        None if no order does. Fields that are NaN give order 6, whose step then fails. Order 6 has no
        next one: going from order 4 to 6 is taken to reduce the error by the factor by which going from
        order 2 to 4 reduces it.
        """
        apart = np.maximum(np.abs(fields[:-1] - fields[1:]) - _ROUNDING, 0.0)
        second, fourth = np.max(apart * horizon, axis=1)
        errors = second, fourth, fourth * min(1.0, fourth / second) if second > 0 else 0.0
        return next(
            (order for order, error in zip(_ORDERS, errors, strict=True) if error <= _AVERAGING),
            None,
        )

    def error(self, estimates: tuple[np.ndarray, np.ndarray], scale: np.ndarray) -> float:
        """Error of a macro-step over the one allowed, by DOP853's estimates of orders 5 and 3.

        Hairer's DOP853 and SciPy's use this formula, with its 0.01.
        """
        with np.errstate(over="ignore"):
            fifth, third = (float(np.sum((estimate / scale) ** 2)) for estimate in estimates)
        return 0.0 if fifth == 0 else fifth / float(np.sqrt((fifth + 0.01 * third) * len(scale)))

    def split_segment(self, point: np.ndarray, turns: float, record: Record) -> Outcome | None:
        """Run some turns from `point` by splitting, and move `point` to their end.

        Returns the outcome if the run ends there, at its end or by a failure, else None.
        """
        until = float(point[-1]) + turns * 2 * pi / self.split.rate(point[:-1])
        last = int(np.searchsorted(record.times, until))
        at_end = last >= len(record.times)
        inner = record.times[record.filled : last]
        times = np.concatenate([point[-1:], inner, [] if at_end else [until]])
        # The record of the segment: rows from its start on, and a row more for its end.
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
    """Stroboscopic averaging of order 2, 4 or 6 in 1/St; at equal slow time its cost hardly grows with St.

    Class: heterogeneous multiscale. With the angle turned about L as the independent variable
    torque-free motion is periodic. Central differences of the map of one turn give the averaged
    equations; DOP853 integrates them by macro-steps of whole turns; parts of a turn lead to the
    requested times. Turns are made of micro-steps of one composition, of order (10, 6, 4). Order of
    the difference and micro-steps follow from comparison with the next. Stability: of explicit
    macro-steps, which the control of errors alone bounds: in trials from a tenth to five times the
    shortest time of relaxation. Tolerance: error of L/I_e over the whole run, where I_e is the
    inertia across the symmetry axis; orientation errs by that times the angle turned. Caveat: short
    runs, and segments where averaging does not hold (L nearly vanishes) or does not pay, are runs of
    `splitting`. Differences of turns lose digits in proportion to St: the least error measured is
    3e-11 at St = 1e6 (`reports/known-stokes`). Error per rotation over tolerance: at most 10, as of
    `splitting`; the test of that runs short scenes, which are left to it.
    Source: Calvo, Chartier, Murua and Sanz-Serna, Appl. Numer. Math. 61 (2011) 1077.
    """

    name = "stroboscopic"
    also_needs = ("scipy",)  # for the coefficients of DOP853
    summary = "averaged equations from turns of the full ones, for nearly torque-free spheroids and long runs"

    def bound(self, problem: Problem, tolerance: float) -> Strobe:
        """The problem bound to machine code."""
        return Strobe(problem, tolerance)
