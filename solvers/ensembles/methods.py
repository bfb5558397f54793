"""Methods of equal steps for many particles at once: splitting, and an eighth-order pair's."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from polhode.models.once import once
from polhode.models.problem import Factory, Parts, Problem
from polhode.solvers.machine_code.lanes import Lanes, lanes
from polhode.solvers.machine_code.tracing import OPERATIONS
from polhode.solvers.parts.flows import constant_counts
from polhode.solvers.parts.schemes import SCHEMES, Scheme, dop853

# Name of the eighth-order pair's method.
RUNGE_KUTTA = "DOP853"
# Time of an evaluation of a field over the time of a splitting's slow and fast flow. An estimate, by
# which `equal_steps.plan` compares methods: a wrong one takes the slower method.
_EVALUATION = 1.6
# The difference of two runs, one by steps twice as wide, over the error of the finer one: 2**order
# - 1 where steps are small. It is hardly ever less than these numbers. Estimates: smaller ones run more
# particles anew, larger ones leave more errors above the tolerance.
_SURE_RUNGE_KUTTA = 2.0**6.5
_SURE_SPLITTING = 2.0**5
Array = np.ndarray


@dataclass(frozen=True)
class Method:
    """A compiled step, bound to a problem's parameters."""

    name: str
    lanes: Lanes
    constants: Callable[[float], Array]  # what a step of a given length needs to know
    cost: float  # of a step, in slow and fast flows of a splitting
    sure: float  # difference from steps twice as wide over the error, which is hardly ever less


def names(problem: Problem) -> tuple[str, ...]:
    """Methods that a problem can be solved by."""
    splittings = tuple(scheme.name for scheme in SCHEMES) if problem.parts else ()
    return (*splittings, RUNGE_KUTTA)


def method(name: str, problem: Problem) -> Method:
    """A method for a problem; its machine code is made once in the life of the process."""
    p = [float(value) for value in problem.parameters or ()]
    parts = problem.parts
    if name == RUNGE_KUTTA:
        code, stages = _runge_kutta(problem.field, problem.dimension, len(p))
        cost = _EVALUATION * stages
        return Method(name, code, lambda h: np.array([h, *p]), cost, _SURE_RUNGE_KUTTA)
    (scheme,) = (candidate for candidate in SCHEMES if candidate.name == name)
    assert parts is not None
    code = _splitting(parts, scheme, problem.dimension)
    fast_shares = _fast_shares(scheme)

    def constants(h: float) -> Array:
        fast = [parts.fast.constants(p, share * h) for share in fast_shares]
        slow = [parts.slow.constants(p, share * h) for share in scheme.slow]
        return np.concatenate([*fast, *slow])

    return Method(name, code, constants, scheme.stages, _SURE_SPLITTING)


def _fast_shares(scheme: Scheme) -> tuple[float, ...]:
    """Shares of the fast flows whose constants a step needs.

    First come the shares of the first half of a step. The next share joins the last flow of a step and
    the first one of the next step. The last share undoes the first flow.
    """
    return *scheme.fast, 2 * scheme.fast[0], -scheme.fast[0]


@once()
def _splitting(parts: Parts, scheme: Scheme, dimension: int) -> Lanes:
    """Steps of a scheme, with the constants ``fast flows of _fast_shares | first half of the slow ones``.

    The last fast flow of a step and the first of the next are taken at once. So a row begins with
    the first fast flow, and at its end half of the last one is undone.
    """
    fast = parts.fast.flow(OPERATIONS)
    slow = parts.slow.flow(OPERATIONS)
    fast_size, slow_size = constant_counts(parts)
    stages = scheme.stages
    # Places in `_fast_shares`.
    double_at = len(scheme.fast)
    undoing_at = double_at + 1
    slow_at = fast_size * (undoing_at + 1)

    def turned(y: Sequence[Any], c: Sequence[Any], share: int) -> Sequence[Any]:
        """The fast flow of a place in `_fast_shares`."""
        return fast(y, c[share * fast_size :])

    def step(y: Sequence[Any], c: Sequence[Any]) -> Sequence[Any]:
        for i in range(stages):
            # Flow i and flow `stages - 1 - i` have the same share.
            y = slow(y, c[slow_at + min(i, stages - 1 - i) * slow_size :])
            # The fast flow behind it is number i + 1 of 0 to `stages`; after the last one, 0 by
            # the mirror image, come both that one and the first of the next step.
            mirrored = min(i + 1, stages - 1 - i)
            y = turned(y, c, mirrored if mirrored > 0 else double_at)
        return y

    begin = partial(turned, share=0)
    end = partial(turned, share=undoing_at)
    return lanes(step, dimension, slow_at + slow_size * len(scheme.slow), begin, end)


@once()
def _runge_kutta(field: Factory, dimension: int, parameters: int) -> tuple[Lanes, int]:
    """Steps of DOP853 with the constants (h, parameters), and its evaluations per step."""
    table = dop853()
    rhs = field(OPERATIONS)
    # Row i: the shares of the slopes before in the state at which slope i is taken.
    stage_shares = table.A[: table.N_STAGES].tolist()
    weights = table.B.tolist()

    def step(y: Sequence[Any], c: Sequence[Any]) -> Sequence[Any]:
        h = c[0]
        p = c[1:]
        slopes = [rhs(y, p)]
        for shares in stage_shares[1:]:
            slopes.append(rhs(moved(y, h, shares, slopes), p))
        return moved(y, h, weights, slopes)

    return lanes(step, dimension, 1 + parameters), len(stage_shares)


def change(h: Any, shares: Sequence[float], slopes: Sequence[Sequence[Any]]) -> list[Any]:
    """Change of each component in a step of length h, by the shares of slopes.

    Shares without a slope here are 0: in a table's row they belong to later stages.
    """
    used = [(share, slope) for share, slope in zip(shares, slopes, strict=False) if share]
    changes = list[Any]()
    for i in range(len(slopes[0])):
        weighted_slope = sum((share * slope[i] for share, slope in used), start=0.0)
        changes.append(h * weighted_slope)
    return changes


def moved(
    y: Sequence[Any], h: Any, shares: Sequence[float], slopes: Sequence[Sequence[Any]]
) -> list[Any]:
    """The state after that step."""
    return [before + more for before, more in zip(y, change(h, shares, slopes), strict=True)]
