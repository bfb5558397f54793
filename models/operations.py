"""The few operations a vector field may use besides arithmetic, bound to a kind of number."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

# ``rhs(y, p)``: the rates of a state y at parameters p, both of d numbers of any kind, by index.
Field = Callable[[Any, Any], tuple[Any, ...]]


def _by_math(name: str, *arguments: float) -> float:
    return getattr(math, name)(*arguments)


# NumPy's names of functions that `math` calls otherwise.
NUMPY_NAMES = {
    "asin": "arcsin",
    "acos": "arccos",
    "atan": "arctan",
    "asinh": "arcsinh",
    "acosh": "arccosh",
    "atanh": "arctanh",
    "atan2": "arctan2",
}


def _by_numpy(name: str, *arguments: Any) -> Any:
    return getattr(np, NUMPY_NAMES.get(name, name))(*arguments)


@dataclass(frozen=True)
class Operations:
    """Elementary functions of one kind of number: floats, arrays, LLVM's, heyoka's or mpmath's.

    A vector field is written once, as a factory ``field(ops)`` that returns ``rhs(y, p) -> tuple``. It
    uses nothing but indexing, arithmetic and the names it unpacked from `ops`.
    """

    sin: Callable[[Any], Any]
    cos: Callable[[Any], Any]
    sqrt: Callable[[Any], Any]
    # (x, a, b): a where x > 0 and b elsewhere; both are evaluated.
    where_positive: Callable[[Any, Any, Any], Any]
    expm1: Callable[[Any], Any] = math.expm1  # for `polhode.models.problem.Part` alone
    exp: Callable[[Any], Any] = math.exp
    log: Callable[[Any], Any] = math.log
    # (name, *arguments): a further function, by the name that `math` has for it; for functions of
    # users (`polhode.models.recording`) alone.
    other: Callable[..., Any] = _by_math

    def use(self, factory: Callable[["Operations"], Callable[..., Any]]) -> Callable[..., Any]:
        """Bind the inner function that `factory` makes, ready to be called from a vector field."""
        return factory(self)


def polynomial(coefficients: Sequence[Any], x: Any) -> Any:
    """Value of a polynomial, lowest power first, by Estrin's scheme: a processor computes its pairs side by side."""
    while len(coefficients) > 1:
        pairs = [
            low + high * x for low, high in zip(coefficients[::2], coefficients[1::2], strict=False)
        ]
        coefficients = [*pairs, *coefficients[2 * len(pairs) :]]
        x = x * x
    return coefficients[0]


@dataclass(frozen=True)
class WithRate:
    """The factory of a field with one more rate behind its own."""

    field: Callable[[Operations], Field]
    # ``rate(ops)(y, p)``: a number, the last rate.
    rate: Callable[[Operations], Callable[[Any, Any], Any]]

    def __call__(self, ops: Operations) -> Field:
        """The field of both."""
        rates = ops.use(self.field)
        rate = ops.use(self.rate)
        return lambda y, p: (*rates(y, p), rate(y, p))


FLOAT = Operations(math.sin, math.cos, math.sqrt, lambda x, a, b: a if x > 0 else b)
# Elementwise, to evaluate a field at many states at once.
ARRAYS = Operations(
    np.sin,
    np.cos,
    np.sqrt,
    lambda x, a, b: np.where(x > 0, a, b),
    np.expm1,
    np.exp,
    np.log,
    _by_numpy,
)
