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
from polhode.solvers.parts.schemes import SCHEMES, Scheme, dop853

# Name of the eighth-order pair's method.
RUNGE_KUTTA = "DOP853"
# Time of an evaluation of a field over the time of a splitting's slow and fast flow.
_EVALUATION = 1.6
Array = np.ndarray


@dataclass(frozen=True)
class Method:
    """A compiled step, bound to a problem's parameters."""

    name: str
    lanes: Lanes
    constants: Callable[[float], Array]  # what a step of a given length needs to know
    cost: float  # of a step, in slow and fast flows of a splitting
    sure: float  # difference from steps twice as wide over the error, hardly ever less


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
        return Method(name, code, lambda h: np.array([h, *p]), _EVALUATION * stages, 2.0**6.5)
    (scheme,) = (candidate for candidate in SCHEMES if candidate.name == name)
    assert parts is not None
    # Two flows stand behind the flows of a step: the last of one step and the first of the next in
    # one, and the first one undone.
    fast = *scheme.fast, 2 * scheme.fast[0], -scheme.fast[0]
    shares = (
        *((parts.fast, share) for share in fast),
        *((parts.slow, share) for share in scheme.slow),
    )

    def constants(h: float) -> Array:
        return np.concatenate([part.constants(p, share * h) for part, share in shares])

    return Method(
        name, _splitting(parts, scheme, problem.dimension), constants, scheme.stages, 2.0**5
    )


@once()
def _splitting(parts: Parts, scheme: Scheme, dimension: int) -> Lanes:
    zeros = [0.0] * 64
    fast = parts.fast.flow(OPERATIONS)
    slow = parts.slow.flow(OPERATIONS)
    fast_size, slow_size = (len(part.constants(zeros, 0.0)) for part in (parts.fast, parts.slow))
    count = len(scheme.fast)
    begin = fast_size * (count + 2)

    def turned(y: Sequence[Any], c: Sequence[Any], share: int) -> Sequence[Any]:
        return fast(y, c[share * fast_size :])

    def step(y: Sequence[Any], c: Sequence[Any]) -> Sequence[Any]:
        for i in range(scheme.stages):
            y = slow(y, c[begin + min(i, scheme.stages - 1 - i) * slow_size :])
            y = turned(y, c, min(i + 1, scheme.stages - 1 - i) or count)
        return y

    ends = partial(turned, share=0), partial(turned, share=count + 1)
    return lanes(step, dimension, begin + slow_size * len(scheme.slow), *ends)


@once()
def _runge_kutta(field: Factory, dimension: int, parameters: int) -> tuple[Lanes, int]:
    table = dop853()
    rhs = field(OPERATIONS)
    nodes = table.A[: table.N_STAGES].tolist()
    weights = table.B.tolist()

    def step(y: Sequence[Any], c: Sequence[Any]) -> Sequence[Any]:
        slopes = [rhs(y, c[1:])]
        for row in nodes[1:]:
            slopes.append(rhs(moved(y, c[0], row, slopes), c[1:]))
        return moved(y, c[0], weights, slopes)

    return lanes(step, dimension, 1 + parameters), len(nodes)


def change(h: Any, shares: Sequence[float], slopes: Sequence[Sequence[Any]]) -> list[Any]:
    """Change of each component in a step of length h, by the shares of slopes."""
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
