"""Machine code that composes the flows of a problem's parts: no Python per step, nor per requested time."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from polhode.models.operations import Field, Operations
from polhode.models.problem import Parts

# A step follows the rate of the fast angle when that has changed by this factor; in between it stays, since what errs
# to and fro within a turn adds up to nothing only while steps are equal.
BAND = 1.05
# Only contraction of a*b + c is allowed: it changes the last bit, never the meaning.
FAST: dict[str, Any] = {"error_model": "numpy", "fastmath": {"contract"}}

# Components that fade away are set to zero once in so many steps: computing with subnormal numbers is slow.
SETTLING, NOTHING = 1024, 1e-100

# More parameters than any problem has.
ANY = 64

# What `Kernels.advance` returns.
FINISHED, STEPS_DONE, PAUSED, NOT_FINITE, NO_STEP = range(5)


@dataclass(frozen=True)
class Kernels:
    """Compiled functions of one problem's parts.

    Parameters
    ----------
    advance : callable
        ``advance(scheme, p, state, clock, count, times, rows, until, max_steps) -> int``: steps until the rows are
        filled, a time is reached, or as many steps are done as allowed. `scheme` holds the fast and the slow shares
        and, as one array, the factor, the exponent and the widest angle of its step, and the square of the least rate
        that counts; `clock` the time at which the step was last changed, the step, and the rates between which it
        stays; `count` the steps since then, the rows filled, and the steps in all. All go on from there.
    turn : callable
        ``turn(p, state, times, rows)``: rows of the fast flow alone, over any angles.
    """

    advance: Callable[..., int]
    turn: Callable[..., None]


def start_of(state: np.ndarray, time: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """State, clock and count of a run that begins."""
    return state.copy(), np.array([time, 0.0, 0.0, -1.0]), np.array([0, 1, 0])


@dataclass(frozen=True)
class Flows:
    """Compiled pieces that the kernels are made of."""

    fast: Any
    slow: Any
    rate: Any
    fast_constants: Any
    slow_constants: Any
    prepare: Any  # the constants of a step's flows
    compose: Any  # a step but for its last fast flow
    empty: Any  # room for them
    load: Any  # an array as a state
    store: Any  # the reverse


@cache
def kernels(parts: Parts, dimension: int) -> Kernels:
    """Compile the kernels of a problem's parts, once in the life of the process."""
    flows = bound_flows(parts, dimension)
    compiled = Kernels(_advance(flows), _turn(flows, parts.reach))
    # numba compiles at the first call.
    p, state, rows = np.zeros(ANY), np.ones(dimension), np.ones((1, dimension))
    scheme = np.array([0.5, 0.5]), np.array([1.0]), np.ones(4)
    compiled.advance(scheme, p, *start_of(state, 0.0), np.zeros(1), rows, np.inf, 1)
    compiled.turn(p, state, np.zeros(1), rows)
    return compiled


@cache
def bound_flows(parts: Parts, dimension: int) -> Flows:
    """Compile the pieces, once in the life of the process."""
    import numba
    from numba.np.unsafe.ndarray import to_fixed_tuple

    njit = numba.njit(**FAST)
    operations = Operations(math.sin, math.cos, math.sqrt, njit(lambda x, a, b: a if x > 0 else b))
    fast: Field = njit(parts.fast.flow(operations))
    slow: Field = njit(parts.slow.flow(operations))
    rate = njit(parts.rate(operations))
    fast_constants, slow_constants = njit(parts.fast.constants), njit(parts.slow.constants)

    @njit
    def prepare(p: Any, fast_shares: Any, slow_shares: Any, step: float, fast_rows: Any, slow_rows: Any) -> None:
        stages = len(slow_shares)
        for i in range(stages + 2):
            # The last fast flow of a step and the first one of the next, in one.
            share = 2 * fast_shares[0] if i > stages else fast_shares[i]
            fast_rows[i, :] = fast_constants(p, share * step)
        for i in range((stages + 1) // 2):
            slow_rows[i, :] = slow_rows[stages - 1 - i, :] = slow_constants(p, slow_shares[i] * step)

    @njit
    def compose(y: Any, fast_rows: Any, slow_rows: Any, first: int) -> Any:
        y = slow(fast(y, fast_rows[first]), slow_rows[0])
        for i in range(1, len(slow_rows)):
            y = slow(fast(y, fast_rows[i]), slow_rows[i])
        return y

    @njit
    def empty(stages: int, p: Any) -> Any:
        shapes = (stages + 2, len(fast_constants(p, 0.0))), (stages, len(slow_constants(p, 0.0)))
        return np.empty(shapes[0]), np.empty(shapes[1])

    @njit
    def load(state: Any) -> Any:
        return to_fixed_tuple(state, dimension)  # pyright: ignore[reportCallIssue]

    @njit
    def store(y: Any, state: Any) -> None:
        for i in range(dimension):
            state[i] = y[i] if abs(y[i]) > NOTHING else 0.0

    return Flows(fast, slow, rate, fast_constants, slow_constants, prepare, compose, empty, load, store)


def _advance(flows: Flows) -> Callable[..., int]:
    import numba

    njit = numba.njit(**FAST)
    fast, rate, prepare, compose = flows.fast, flows.rate, flows.prepare, flows.compose
    empty, load, store = flows.empty, flows.load, flows.store

    @njit
    def fill(scheme: Any, p: Any, y: Any, now: float, end: float, filled: int, times: Any, rows: Any, room: Any) -> int:
        """Rows within a step, by a part of the step each."""
        while filled < len(times) and times[filled] <= end:
            prepare(p, scheme[0], scheme[1], times[filled] - now, *room)
            store(fast(compose(y, *room, 0), room[0][len(scheme[1])]), rows[filled])
            filled += 1
        return filled

    @njit
    def advance(
        scheme: Any, p: Any, state: Any, clock: Any, count: Any, times: Any, rows: Any, until: float, max_steps: int
    ) -> int:
        fast_shares, slow_shares, law = scheme
        stages = len(slow_shares)
        fast_rows, slow_rows = empty(stages, p)
        room, y = empty(stages, p), load(state)
        begin, step, low, high = clock[0], clock[1], clock[2], clock[3]
        n, filled, total, whole = count[0], count[1], count[2], True
        prepare(p, fast_shares, slow_shares, step, fast_rows, slow_rows)
        code, limit = FINISHED, total + max_steps
        while filled < len(times):
            if total >= limit or begin + n * step >= until:
                code = STEPS_DONE if total >= limit else PAUSED
                break
            speed = np.sqrt(rate(y, p) ** 2 + law[3])
            if not low <= speed <= high:
                if not whole:
                    y, whole = fast(y, fast_rows[stages]), True
                begin, n = begin + n * step, 0
                low, high = speed / BAND, speed * BAND
                step = min(law[0] * speed ** -law[1], law[2] / speed)
                if not begin + step > begin:
                    code = NO_STEP if np.isfinite(speed) else NOT_FINITE
                    break
                prepare(p, fast_shares, slow_shares, step, fast_rows, slow_rows)
            now, end = begin + n * step, begin + (n + 1) * step
            if times[filled] <= end:
                at = y if whole else fast(y, fast_rows[stages])
                filled = fill((fast_shares, slow_shares), p, at, now, end, filled, times, rows, room)
            elif total % SETTLING == 0:
                store(y, state)
                y = load(state)
            y = compose(y, fast_rows, slow_rows, 0 if whole else stages + 1)
            whole = False
            n, total = n + 1, total + 1
        if not whole:
            y = fast(y, fast_rows[stages])
        store(y, state)
        clock[0], clock[1], clock[2], clock[3] = begin, step, low, high
        count[0], count[1], count[2] = n, filled, total
        return code

    return advance


def _turn(flows: Flows, reach: float) -> Callable[..., None]:
    import numba

    fast, rate, constants, load, store = flows.fast, flows.rate, flows.fast_constants, flows.load, flows.store

    @numba.njit(**FAST)
    def turn(p: Any, state: Any, times: Any, rows: Any) -> None:
        speed = rate(load(state), p)
        for k in range(1, len(times)):
            time = times[k] - times[0]
            if speed * time > reach:
                time -= np.floor(speed * time / (2 * np.pi)) * (2 * np.pi / speed)
            pieces = int(np.ceil(speed * time / reach)) + 1
            y = load(state)
            for _ in range(pieces):
                y = fast(y, constants(p, time / pieces))
            store(y, rows[k])

    return turn
