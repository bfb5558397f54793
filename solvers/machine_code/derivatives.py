"""The exact Jacobian of a vector field: traced numbers that carry their derivatives along.

It is automatic differentiation in forward mode, by all components of the state at once. The rules
of the chain, product and quotient act on traced numbers, so that they write lines of LLVM's.
"""

from collections.abc import Callable
from functools import partial
from typing import Any

from polhode.models.once import once
from polhode.models.operations import Operations
from polhode.models.problem import Factory
from polhode.solvers.machine_code.tracing import (
    OPERATIONS,
    Number,
    call,
    either_side,
    of_library,
    read,
    trace,
    written,
)


# A float or a traced number without derivatives is its own value, and has no slopes.
def _value(x: Any) -> Any:
    return x.value if isinstance(x, Dual) else x


def _slopes(x: Any) -> dict[int, Any]:
    return x.slopes if isinstance(x, Dual) else {}


def _chained(value: Any, *parts: tuple[Any, Any]) -> "Dual":
    """A number made of others, each beside the derivative by it."""
    slopes: dict[int, Any] = {}
    for x, derivative in parts:
        for i, slope in _slopes(x).items():
            term = _product(slope, derivative)
            slopes[i] = slopes[i] + term if i in slopes else term
    return Dual(value, slopes)


def _product(a: Any, b: Any) -> Any:
    """a*b without lines for nothing: most derivatives of sums are 1 or -1."""
    if isinstance(b, float) and b in (1.0, -1.0):
        return a if b == 1.0 else -a
    return b if isinstance(a, float) and a == 1.0 else a * b


def _quotient(above: Any, below: Any) -> "Dual":
    inverse = 1.0 / _value(below)
    quotient = _value(above) / _value(below)
    return _chained(quotient, (above, inverse), (below, -quotient * inverse))


def _power(base: Any, exponent: Any) -> "Dual":
    x = _value(base)
    n = _value(exponent)
    power = x**n
    # The derivative of x**0 is 0 at x = 0 too, where 0 * x**-1 has no value.
    by_base = n * x ** (n - 1) if isinstance(exponent, Dual) or n != 0 else 0.0
    return _chained(
        power, (base, by_base), (exponent, power * call("log", x) if _slopes(exponent) else 0.0)
    )


class Dual:
    """A number and its derivatives by the components of the state, those that are not zero."""

    # NumPy's numbers leave arithmetic to it.
    __array_ufunc__ = None

    def __init__(self, value: Any, slopes: dict[int, Any]) -> None:
        self.value = value
        self.slopes = slopes

    __add__, __radd__ = either_side(
        lambda a, b: _chained(_value(a) + _value(b), (a, 1.0), (b, 1.0))
    )
    __sub__, __rsub__ = either_side(
        lambda a, b: _chained(_value(a) - _value(b), (a, 1.0), (b, -1.0))
    )
    __mul__, __rmul__ = either_side(
        lambda a, b: _chained(_value(a) * _value(b), (a, _value(b)), (b, _value(a)))
    )
    __truediv__, __rtruediv__ = either_side(_quotient)
    __pow__, __rpow__ = either_side(_power)

    def __neg__(self) -> "Dual":
        return _chained(-self.value, (self, -1.0))

    def __pos__(self) -> "Dual":
        return self


def _function(name: str, derivative: Callable[[Any], Any], x: Any) -> Any:
    if not isinstance(x, Dual):
        return call(name, x)
    return _chained(call(name, x.value), (x, derivative(x.value)))


def _where_positive(x: Any, a: Any, b: Any) -> Dual:
    where = partial(OPERATIONS.where_positive, _value(x))
    value = where(_value(a), _value(b))
    # Slopes on either side of x = 0; the jump from one side to the other adds none.
    above = _slopes(a)
    below = _slopes(b)
    slopes = {i: where(above.get(i, 0.0), below.get(i, 0.0)) for i in {*above, *below}}
    return Dual(value, slopes)


# Derivatives of functions of C's library by their only argument; `_of_library` differentiates atan2.
_DERIVATIVES: dict[str, Callable[[Any], Any]] = {
    "expm1": partial(call, "exp"),
    "log1p": lambda x: 1.0 / (1.0 + x),
    "tan": lambda x: 1.0 / (call("cos", x) * call("cos", x)),
    "asin": lambda x: 1.0 / call("sqrt", 1.0 - x * x),
    "acos": lambda x: -1.0 / call("sqrt", 1.0 - x * x),
    "atan": lambda x: 1.0 / (1.0 + x * x),
    "sinh": partial(of_library, "cosh"),
    "cosh": partial(of_library, "sinh"),
    "tanh": lambda x: 1.0 - of_library("tanh", x) * of_library("tanh", x),
    "asinh": lambda x: 1.0 / call("sqrt", x * x + 1.0),
    "acosh": lambda x: 1.0 / call("sqrt", x * x - 1.0),
    "atanh": lambda x: 1.0 / (1.0 - x * x),
}


def _of_library(name: str, *arguments: Any) -> Any:
    """A function of C's library."""
    if not any(isinstance(x, Dual) for x in arguments):
        return of_library(name, *arguments)
    values = [_value(x) for x in arguments]
    result = of_library(name, *values)
    if name == "atan2":
        above, beside = values
        square = above * above + beside * beside
        parts = (arguments[0], beside / square), (arguments[1], -above / square)
        return _chained(result, *parts)
    return _chained(result, (arguments[0], _DERIVATIVES[name](values[0])))


_DUAL = Operations(
    partial(_function, "sin", lambda x: call("cos", x)),
    partial(_function, "cos", lambda x: -call("sin", x)),
    partial(_function, "sqrt", lambda x: 0.5 / call("sqrt", x)),
    _where_positive,
    exp=partial(_function, "exp", partial(call, "exp")),
    log=partial(_function, "log", lambda x: 1.0 / x),
    other=_of_library,
)


@once()
def trace_jacobian(factory: Factory, dimension: int, parameters: int, mass: bool = False) -> str:
    """LLVM's lines that compute a field's Jacobian column by column.

    They read and write arrays as the lines of `tracing.trace` do.

    With `mass` it is the residual's Jacobian, ``cj * mass - jacobian``, where the slope follows the
    state by %cj.
    """
    # Refuses what no field may do, and says where.
    trace(factory, dimension, parameters)
    lines: dict[str, str] = {}
    y = [Dual(number, {i: 1.0}) for i, number in enumerate(read(lines, "y", dimension))]
    rates = factory(_DUAL)(y, [Dual(number, {}) for number in read(lines, "p", parameters)])
    slopes = [_slopes(rate) for rate in rates]
    # Entry (row, column) stands at column * dimension + row.
    entries = list[Any]()
    for i in range(dimension):
        entries += [slope.get(i, 0.0) for slope in slopes]
    if mass:
        masses = read(lines, "mass", dimension)
        cj = Number(lines, "%cj")
        entries = [-entry for entry in entries]
        for i, diagonal in enumerate(masses):
            place = i * dimension + i
            entries[place] = cj * diagonal + entries[place]
    return written(lines, entries)
