"""Events of a run, sought at every accepted step and placed on its interpolation, as in SciPy.

An event is a function of time and state whose sign changes. Numbers that pass zero are placed by
Brent's method. Conditions (True or False), and numbers that reach zero and stay there, are bisected
to the first time of the new value.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from math import isnan
from typing import Any

import numpy as np

from polhode.models.libraries import IMPORTS
from polhode.models.own_function import place_of

# The state, shape (d,), at a time since the last look.
Between = Callable[[float], np.ndarray]

# Tolerance of the place of an event, absolute and relative to the time: the one of SciPy's
# `solve_ivp`.
_PLACE = np.float64(4 * np.finfo(float).eps)
# Iterations of Brent's method, at most; an estimate. Simple roots take some ten. The slowest tried,
# of third and ninth order, took 206 at most in steps up to 1e6 long, and 257 in one of 1e12.
_MAX_ITERATIONS = 300
# Looks within a step, where its interpolation costs next to nothing: a step of high order is longer
# than a half period of what it follows. An estimate: two passages between two looks are missed, and
# so is a number that touches zero without passing it.
_LOOKS_WITHIN_STEP = 8
# Solvers that run many steps in one call look after few of them at first (`_FIRST_LOOK` in
# `cyrk.py` and `taylor.py`); the number grows by this factor each time: a terminal event soon after
# the start costs no more than a few steps. An estimate.
LOOK_GROWTH = 4


@dataclass
class SoughtEvent:
    """One event: its function, and the times and states at which it happened so far.

    Parameters
    ----------
    name : str
        For messages.
    function : callable
        ``function(t, y)`` of the run's time, which begins at 0, and state: a number, or True or
        False.
    direction : float
        It counts where the function rises if positive, where it falls if negative.
    terminal : int
        n if the run ends when the event happens for the n-th time; 0 if it does not end the run.
    times, states
        Where it happened, in order of time; states of shape (d,). `EventSearch` fills them.
    """

    name: str
    function: Callable[[float, np.ndarray], Any]
    direction: float = 0.0
    terminal: int = 0
    times: list[float] = field(default_factory=list)
    states: list[np.ndarray] = field(default_factory=list)
    last: float = 0.0  # value at the last look, by `EventSearch.begin` first the one at the start
    condition: bool = False  # whether its values are True and False; `value` finds out

    def value(self, time: float, state: np.ndarray) -> float:
        """Its value as a number, 1 and -1 of True and False.

        ValueError, in one line with the user's line of code, if it has none.
        """
        try:
            value = self.function(time, state)
            kind = type(value)
            if kind is bool or kind is np.bool_:
                self.condition = True
                return 1.0 if value else -1.0
            return float(value.item() if kind is np.ndarray else value)
        except Exception as error:
            words = f"{type(error).__name__}: {error}{place_of(error, __file__)}"
            raise ValueError(f"event {self.name!r}: got {words}") from error

    def passed(self, value: float) -> bool:
        """Whether it happened between the last look and this value.

        A value of 0 counts when it is reached, not when it is left, so that no passage counts
        twice; a start at 0 does not count. Next to NaN nothing counts.
        """
        before = self.last
        if before == 0 or isnan(before) or isnan(value) or before * value > 0:
            return False
        # It rose if it was negative before. A direction of 0 takes either.
        return self.direction * -before >= 0

    def place(self, low: float, high: float, value: float, between: Between) -> float:
        """The time of a passage after `low`, the last look, up to `high`, where it has the value."""

        def at(time: float) -> float:
            return self.value(time, between(time))

        before = self.last
        if value != 0 and not self.condition:
            with IMPORTS:
                from scipy.optimize import brentq

            # The interpolant may differ from the steps by rounding, and have no change of sign between them.
            if before * at(low) <= 0:
                return low
            if value * at(high) <= 0:
                return high
            place: Any = brentq(at, low, high, xtol=_PLACE, rtol=_PLACE, maxiter=_MAX_ITERATIONS)
            return place
        # Until `low` and `high` are neighboring doubles: the value has changed at `high`.
        while low < (middle := 0.5 * (low + high)) < high:
            if before * at(middle) > 0:
                low = middle
            else:
                high = middle
        return high


class EventFailedError(Exception):
    """An event's function has raised an error: the caller's fault, no failure of the run."""


class EventSearch:
    """All events of a run, followed from step to step.

    `polhode.solvers.solve` calls `begin` with the start. A solver calls `through` with what it has
    accepted since, until that returns True: a terminal event has happened, at the time `ended`. If
    an event's function fails, both raise the ValueError of `SoughtEvent.value`.
    """

    def __init__(self, events: Sequence[SoughtEvent]) -> None:
        self.events = events
        # Time of the last look.
        self.now = 0.0
        # Time and state, shape (d,), of the event that ended the run; None and empty before.
        self.ended: float | None = None
        self.end_state = np.empty(0)

    def begin(self, time: float, state: np.ndarray) -> None:
        """Take the values at the start."""
        self.now = time
        for event in self.events:
            event.last = event.value(time, state)

    def through(self, times: Sequence[float], states: Any, between: Between) -> bool:
        """Look at states, shape (n, d), at n increasing times; say whether one ends the run.

        `between` holds from the last look of the previous call on. After the event that ends the
        run no further state is looked at.
        """
        for time, state in zip(times, states, strict=True):
            passages = []
            for event in self.events:
                value = event.value(time, state)
                if event.passed(value):
                    passages.append((event.place(self.now, time, value, between), event))
                event.last = value
            self.now = time
            if passages and self._note(passages, between):
                return True
        return False

    def _note(self, passages: list[tuple[float, SoughtEvent]], between: Between) -> bool:
        """Note passages between two looks in order of time, up to one that ends the run."""
        passages.sort(key=lambda passage: passage[0])
        for time, event in passages:
            if self.ended is not None and time > self.ended:
                # Passages at the very time of the end still count.
                break
            state = np.array(between(time))
            event.times.append(time)
            event.states.append(state)
            if event.terminal and len(event.times) >= event.terminal and self.ended is None:
                self.ended = time
                self.end_state = state
        return self.ended is not None


def looks(steps: np.ndarray) -> np.ndarray:
    """Equispaced times within steps, and their ends.

    `steps` holds the ends of n steps, shape (n + 1,); the first step starts at the last look, whose
    time is left out. A step has `_LOOKS_WITHIN_STEP` looks within and one at its end: n times as many in all.
    """
    parts = _LOOKS_WITHIN_STEP + 1
    # Places as numbers of steps from the beginning, such as 2 and 3/9.
    places = np.arange(1, (len(steps) - 1) * parts + 1) / parts
    return np.interp(places, np.arange(len(steps)), steps)
