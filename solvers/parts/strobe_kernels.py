"""Machine code of stroboscopic averaging: turns, their central differences, a macro-step, and rows between its ends."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from polhode.models.problem import Parts
from polhode.solvers.parts.kernels import ANY, FAST, Flows, bound_flows

# Weights of (Φ^k - Φ^-k) in the central differences of order 2, 4 and 6.
WEIGHTS = np.array([[1 / 2, 0.0, 0.0], [2 / 3, -1 / 12, 0.0], [3 / 4, -3 / 20, 1 / 60]])


@dataclass(frozen=True)
class StrobeKernels:
    """Compiled functions of one problem's parts; a point is a state with its time behind it.

    Parameters
    ----------
    differences : callable
        ``differences(shares, p, point, micro, out)``: the averaged field, per turn, by central differences of order 2,
        4 and 6, from turns of so many micro-steps.
    macro : callable
        ``macro(shares, p, point, order, micro, turns, stages, ends)``: a step of so many turns; `stages[0]` holds the
        averaged field at its beginning, the others are filled, `ends` with the point at the end and the errors.
    extend : callable
        ``extend(shares, p, point, order, micro, turns, stages)``: the further stages that rows within the step need.
    rows : callable
        ``rows(shares, p, point, micro, turns, stages, end, times, rows, filled) -> int``: fill the rows
        within it, by a part of a turn each.
    """

    differences: Callable[..., None]
    macro: Callable[..., None]
    extend: Callable[..., None]
    rows: Callable[..., int]


@cache
def strobe_kernels(parts: Parts, dimension: int) -> StrobeKernels:
    """Compile the kernels of a problem's parts, once in the life of the process."""
    flows = bound_flows(parts, dimension)
    field = _field(flows, dimension)
    compiled = StrobeKernels(_differences(field), *_macro(field, dimension), _rows(flows, dimension))
    # numba compiles at the first call.
    shares, p, point = (np.array([0.5, 0.5]), np.array([1.0])), np.zeros(ANY), np.ones(dimension + 1)
    stages, ends = np.zeros((16, dimension + 1)), np.zeros((3, dimension + 1))
    compiled.differences(shares, p, point, 4, stages[:3].copy())
    compiled.macro(shares, p, point, 2, 4, 1.0, stages, ends)
    compiled.extend(shares, p, point, 2, 4, 1.0, stages)
    compiled.rows(shares, p, point, 4, 1.0, stages, ends[0], np.zeros(1), np.ones((1, dimension)), 1)
    return compiled


def _turn(flows: Flows) -> Any:
    import numba

    fast, rate, load, store = flows.fast, flows.rate, flows.load, flows.store
    fast_constants, slow, slow_constants = flows.fast_constants, flows.slow, flows.slow_constants

    @numba.njit(**FAST)
    def turn(p: Any, point: Any, micro: int, step: float, fast_rows: Any, slow_rows: Any, shares: Any) -> None:
        """One turn of the fast angle, forth or back as the step is, in micro-steps and two short ones that close it."""
        y, angle, stages = load(point), 0.0, len(slow_rows)
        for _ in range(micro):
            for i in range(stages):
                angle += rate(y, p) * shares[i]
                y = slow(fast(y, fast_rows[i]), slow_rows[i])
            angle += rate(y, p) * shares[stages]
            y = fast(y, fast_rows[stages])
        angle *= step
        passed = micro * step
        for _ in range(2):
            speed = rate(y, p)
            rest = (np.copysign(2 * np.pi, step) - angle) / speed
            half = fast_constants(p, rest / 2)
            y = fast(slow(fast(y, half), slow_constants(p, rest)), half)
            angle += 0.5 * rest * (speed + rate(y, p))
            passed += rest
        store(y, point)
        point[len(point) - 1] += passed

    return turn


def _field(flows: Flows, dimension: int) -> Any:
    import numba

    turn, prepare, empty, rate, load = _turn(flows), flows.prepare, flows.empty, flows.rate, flows.load

    @numba.njit(**FAST)
    def field(shares: Any, p: Any, point: Any, turns: int, micro: int, weights: Any, out: Any) -> None:
        """Weighted sums, a row of weights each, of differences of the map of 1, ..., turns turns."""
        fast_rows, slow_rows = empty(len(shares[1]), p)
        step = 2 * np.pi / (rate(load(point), p) * micro)
        out[:] = 0.0
        moved = np.empty(dimension + 1)
        for sign in (1.0, -1.0):
            prepare(p, shares[0], shares[1], sign * step, fast_rows, slow_rows)
            moved[:] = point
            moved[dimension] = 0.0
            for k in range(turns):
                turn(p, moved, micro, sign * step, fast_rows, slow_rows, shares[0])
                for row in range(len(out)):
                    for i in range(dimension + 1):
                        base = point[i] if i < dimension else 0.0
                        out[row, i] += sign * weights[row, k] * (moved[i] - base)

    return field


def _differences(field: Any) -> Callable[..., None]:
    import numba

    weights = WEIGHTS

    @numba.njit(**FAST)
    def differences(shares: Any, p: Any, point: Any, micro: int, out: Any) -> None:
        field(shares, p, point, 3, micro, weights, out)

    return differences


def _macro(field: Any, dimension: int) -> tuple[Callable[..., None], Callable[..., None]]:
    import numba
    from scipy.integrate._ivp import dop853_coefficients as dop

    a, b, e3, e5 = dop.A.copy(), dop.B.copy(), dop.E3.copy(), dop.E5.copy()
    weights, n_stages, n_all = WEIGHTS, dop.N_STAGES, dop.N_STAGES_EXTENDED

    @numba.njit(**FAST)
    def stage(row: Any, turns: float, stages: Any, used: int, point: Any, at: Any) -> None:
        for i in range(len(point)):
            change = 0.0
            for j in range(used):
                change += row[j] * stages[j, i]
            at[i] = point[i] + turns * change

    @numba.njit(**FAST)
    def macro(shares: Any, p: Any, point: Any, order: int, micro: int, turns: float, stages: Any, ends: Any) -> None:
        reach, row = order // 2, weights[order // 2 - 1 : order // 2]
        at = np.empty(dimension + 1)
        for s in range(1, n_stages):
            stage(a[s], turns, stages, s, point, at)
            field(shares, p, at, reach, micro, row, stages[s : s + 1])
        stage(b, turns, stages, n_stages, point, ends[0])
        field(shares, p, ends[0], reach, micro, row, stages[n_stages : n_stages + 1])
        for i in range(dimension + 1):
            ends[1, i], ends[2, i] = 0.0, 0.0
            for j in range(n_stages + 1):
                ends[1, i] += turns * e5[j] * stages[j, i]
                ends[2, i] += turns * e3[j] * stages[j, i]

    @numba.njit(**FAST)
    def extend(shares: Any, p: Any, point: Any, order: int, micro: int, turns: float, stages: Any) -> None:
        reach, row = order // 2, weights[order // 2 - 1 : order // 2]
        at = np.empty(dimension + 1)
        for s in range(n_stages + 1, n_all):
            stage(a[s], turns, stages, s, point, at)
            field(shares, p, at, reach, micro, row, stages[s : s + 1])

    return macro, extend


def _rows(flows: Flows, dimension: int) -> Callable[..., int]:
    import numba
    from scipy.integrate._ivp import dop853_coefficients as dop

    d, n_stages = dop.D.copy(), dop.N_STAGES
    prepare, empty, rate, load, store = flows.prepare, flows.empty, flows.rate, flows.load, flows.store
    compose, fast = flows.compose, flows.fast

    @numba.njit(**FAST)
    def series(point: Any, end: Any, turns: float, stages: Any, out: Any) -> None:
        for i in range(dimension + 1):
            change = end[i] - point[i]
            out[0, i] = change
            out[1, i] = turns * stages[0, i] - change
            out[2, i] = 2 * change - turns * (stages[n_stages, i] + stages[0, i])
            for k in range(len(d)):
                out[3 + k, i] = 0.0
                for j in range(d.shape[1]):
                    out[3 + k, i] += turns * d[k, j] * stages[j, i]

    @numba.njit(**FAST)
    def value(terms: Any, x: float, i: int) -> float:
        result = 0.0
        for k in range(len(terms)):
            result = (result + terms[len(terms) - 1 - k, i]) * (x if k % 2 == 0 else 1 - x)
        return result

    @numba.njit(**FAST)
    def rows(
        shares: Any,
        p: Any,
        point: Any,
        micro: int,
        turns: float,
        stages: Any,
        end: Any,
        times: Any,
        out: Any,
        filled: int,
    ) -> int:
        terms, at = np.empty((7, dimension + 1)), np.empty(dimension + 1)
        fast_rows, slow_rows = empty(len(shares[1]), p)
        series(point, end, turns, stages, terms)
        while filled < len(times) and times[filled] <= end[dimension]:
            wanted = times[filled] - point[dimension]
            whole = np.rint(turns * wanted / terms[0, dimension])
            speed, rest = 0.0, 0.0
            for _ in range(20):
                for i in range(dimension + 1):
                    at[i] = point[i] + value(terms, whole / turns, i)
                speed = rate(load(at), p)
                rest = times[filled] - at[dimension]
                if abs(rest) * speed < 1.01 * np.pi:
                    break
                whole += np.rint(rest * speed / (2 * np.pi))
            pieces = 1 + int(abs(rest) * speed * micro / (2 * np.pi))
            prepare(p, shares[0], shares[1], rest / pieces, fast_rows, slow_rows)
            y = load(at)
            for _ in range(pieces):
                y = fast(compose(y, fast_rows, slow_rows, 0), fast_rows[len(shares[1])])
            store(y, out[filled])
            filled += 1
        return filled

    return rows
