"""Solvers with planted errors, delays and lies, called by their names ``planted:Class``."""

import os
import signal
import time
from collections.abc import Callable
from math import cos, sin
from typing import Any

import numpy as np

from polhode.models.operations import FLOAT
from polhode.models.problem import Problem
from polhode.solvers.contract import Integrator, Outcome, Record, Settings, Solver, Status
from polhode.solvers.taylor import Taylor

# Seconds that `Sleeper` sleeps in every run, and when it is first prepared: far longer than the runs of
# the tests beside them, so that times tell which sleep was counted.
NAP = 0.03
LONG_NAP = 0.2
# Tolerance of the run that is taken for the exact solution: below the rounding of doubles.
EXACT_TOLERANCE = 1e-16
# Error of `Steady`, relative to the angular velocities: above the errors and tolerances that tests request.
STEADY_ERROR = 1e-5
# A run that ends before this time, in inverse shear rates, is the first one of a study's case, which
# compiles: it goes over 1e-9 of the duration (`polhode.harness.studies.case`). Liars do it honestly.
COMPILING_UNTIL = 1e-3


class _Disturbed(Taylor):
    """The exact solution of the quaternion form, but for what `disturb` does to it after the start.

    A state is the quaternion of the orientation, four numbers, and the angular velocity, three.
    """

    def disturb(self, states: np.ndarray, tolerance: float) -> np.ndarray:
        """The states that the solver gives instead of the exact ones, both of shape (n, 7)."""
        raise NotImplementedError

    def prepare(self, problem: Problem, settings: Settings) -> Integrator:
        exact = super().prepare(problem, settings.at(EXACT_TOLERANCE))

        def integrate(record: Record) -> Outcome:
            outcome = exact(record)
            record.rows[1 : record.filled] = self.disturb(
                record.rows[1 : record.filled], settings.tolerance
            )
            return outcome

        return integrate


def _too_fast(excess: float, states: np.ndarray) -> np.ndarray:
    """The states with angular velocities too large by this share of themselves."""
    return np.column_stack([states[:, :4], states[:, 4:] * (1 + excess)])


class FirstOrder(_Disturbed):
    """Angular velocities too large by the tolerance."""

    name = "planted:FirstOrder"

    def disturb(self, states: np.ndarray, tolerance: float) -> np.ndarray:
        return _too_fast(tolerance, states)


class SecondOrder(_Disturbed):
    """Angular velocities too large by the square of the tolerance."""

    name = "planted:SecondOrder"

    def disturb(self, states: np.ndarray, tolerance: float) -> np.ndarray:
        return _too_fast(tolerance**2, states)


class Steady(_Disturbed):
    """Angular velocities too large by the same share, whatever the tolerance."""

    name = "planted:Steady"

    def disturb(self, states: np.ndarray, tolerance: float) -> np.ndarray:
        return _too_fast(STEADY_ERROR, states)


class Askew(_Disturbed):
    """Turned by the tolerance, in rad, about an axis fixed in the body."""

    name = "planted:Askew"

    def disturb(self, states: np.ndarray, tolerance: float) -> np.ndarray:
        # The quaternion of the turn is (w, x, y, z); its axis is the unit vector (2, 1, -2)/3. The rows
        # multiply a quaternion by it from the right: the axis is fixed in the body.
        w = cos(tolerance / 2)
        s = sin(tolerance / 2)
        x, y, z = s * 2 / 3, s / 3, -s * 2 / 3
        right = np.array([[w, -x, -y, -z], [x, w, z, -y], [y, -z, w, x], [z, y, -x, w]])
        return np.column_stack([states[:, :4] @ right.T, states[:, 4:]])


class Opposite(_Disturbed):
    """Quaternions of the other sign, which are the same orientation."""

    name = "planted:Opposite"

    def disturb(self, states: np.ndarray, tolerance: float) -> np.ndarray:
        return np.column_stack([-states[:, :4], states[:, 4:]])


class Midpoint(Solver):
    """The explicit midpoint rule with the tolerance as its step: a genuine method of second order."""

    name = "planted:Midpoint"
    summary = "explicit midpoint rule of fixed step"
    accepts = "every form with an explicit vector field"
    library = "numpy"
    package = "numpy"
    backends = ("python",)

    def prepare(self, problem: Problem, settings: Settings) -> Integrator:
        field, p = problem.field(FLOAT), problem.parameters

        def integrate(record: Record) -> Outcome:
            y = record.start.copy()
            steps = 0
            for begin, end in zip(record.times[:-1], record.times[1:], strict=True):
                count = max(1, round((end - begin) / settings.tolerance))
                h = (end - begin) / count
                for _ in range(count):
                    middle = y + 0.5 * h * np.array(field(y, p))
                    y = y + h * np.array(field(middle, p))
                steps += count
                record.put(y[None])
            record.work.steps = steps
            record.work.rhs_calls = 2 * steps
            return Status.REACHED_END, ""

        return integrate


class Sleeper(Taylor):
    """Sleeps before it works: long when the compiling run is prepared, briefly in every run."""

    name = "planted:Sleeper"

    def prepare(self, problem: Problem, settings: Settings) -> Integrator:
        exact = super().prepare(problem, settings)
        if problem.end < COMPILING_UNTIL:
            time.sleep(LONG_NAP)

        def integrate(record: Record) -> Outcome:
            time.sleep(NAP)
            return exact(record)

        return integrate


class _Liar(Taylor):
    """Claims success whatever `lie` did to the record of a run; the compiling run is an honest one."""

    lie: Callable[[Any, Record], None]

    def prepare(self, problem: Problem, settings: Settings) -> Integrator:
        exact = super().prepare(problem, settings)

        def integrate(record: Record) -> Outcome:
            if record.times[-1] > COMPILING_UNTIL:
                self.lie(record)
            else:
                exact(record)
            return Status.REACHED_END, "all is well"

        return integrate


class Quitter(_Liar):
    """Stops half way."""

    name = "planted:Quitter"

    def lie(self, record: Record) -> None:
        half = len(record.times) // 2
        record.put(np.tile(record.start, (half, 1)))


class Idler(_Liar):
    """Reaches the end without a step."""

    name = "planted:Idler"

    def lie(self, record: Record) -> None:
        record.put(np.tile(record.start, (len(record.times) - 1, 1)))
        record.work.steps = 0


class Breaker(_Liar):
    """Leaves the unit quaternions, by a factor of a thousand."""

    name = "planted:Breaker"

    def lie(self, record: Record) -> None:
        record.put(np.tile(record.start * 1e3, (len(record.times) - 1, 1)))


class Dreamer(_Liar):
    """Stays where it was, and keeps every invariant; nobody counts its steps."""

    name = "planted:Dreamer"

    def lie(self, record: Record) -> None:
        record.put(np.tile(record.start, (len(record.times) - 1, 1)))


class Blower(_Liar):
    """Blows up."""

    name = "planted:Blower"

    def lie(self, record: Record) -> None:
        record.put(np.full((len(record.times) - 1, len(record.start)), np.nan))


class Victim(_Liar):
    """Its process is killed, as a system without memory does."""

    name = "planted:Victim"

    def lie(self, record: Record) -> None:
        os.kill(os.getpid(), signal.SIGKILL)


class Doomed(Taylor):
    """Comes to its end once, and is killed when it is timed."""

    name = "planted:Doomed"

    def prepare(self, problem: Problem, settings: Settings) -> Integrator:
        exact = super().prepare(problem, settings)

        def integrate(record: Record) -> Outcome:
            # The run that counts calls comes first: it ends well. The timed ones do not.
            if record.times[-1] > COMPILING_UNTIL and not settings.count:
                os.kill(os.getpid(), signal.SIGKILL)
            return exact(record)

        return integrate


class Raiser(_Liar):
    """Raises in the middle of a run."""

    name = "planted:Raiser"

    def lie(self, record: Record) -> None:
        raise RuntimeError("planted failure")
