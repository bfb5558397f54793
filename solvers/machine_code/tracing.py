"""Vector fields as lines of LLVM's language, by a number type of our own over `Operations`.

A field is a straight line of arithmetic. Called with numbers that write down what is done to them,
it yields one line for each operation, ``%v7 = fmul contract double %v1, %v4``. Equal lines are
written once; arithmetic on constants is Python's own. `contract` lets the processor round a*b + c
once instead of twice. That changes the rounding of one operation and never the meaning; where terms
cancel, more digits of the result may differ. The compiler may change nothing else.
"""

import inspect
import math
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from numbers import Real
from struct import pack, unpack
from typing import Any

import numpy as np

from polhode.models.once import once
from polhode.models.operations import Operations
from polhode.models.own_function import line_of
from polhode.models.problem import Factory
from polhode.models.recording import UntraceableError

# Powers that are multiplied out, in at most 6 multiplications. An estimate: the others take C's `pow`,
# which gives the same but for the last bits, in more time.
_MULTIPLIED_OUT = range(-16, 17)


class FieldError(ValueError):
    """A vector field does what no field may do; the message names file and line where they are known."""


def either_side(
    operation: Callable[[Any, Any], Any],
) -> tuple[Callable[[Any, Any], Any], Callable[[Any, Any], Any]]:
    """An operator of numbers and arrays, and its mirror image for a number on the right.

    Our own fields meet no arrays, and recorded functions are numbers alone by now. A user's factory
    may combine an array with a component: `np.array([1.0, 2.0]) * y[0]` is left to the number by
    NumPy, and computed element by element here.
    """

    def of_any(left: Any, right: Any) -> Any:
        if not (isinstance(left, np.ndarray) or isinstance(right, np.ndarray)):
            return operation(left, right)
        return np.vectorize(operation, otypes=[object])(
            *(np.array(side, dtype=object) for side in (left, right))
        )

    return of_any, lambda right, left: of_any(left, right)


def operand(x: Any) -> str:
    """How a line refers to a number, by name, or to a constant, by its 64 bits, not rounded."""
    return x.name if isinstance(x, Number) else f"0x{unpack('<Q', pack('<d', float(x)))[0]:016X}"


def _arithmetic(instruction: str, left: Any, right: Any) -> Any:
    """One of LLVM's four instructions of arithmetic, on numbers one of which at least is traced."""
    if not (isinstance(left, Number | Real) and isinstance(right, Number | Real)):
        return NotImplemented
    number: Any = left if isinstance(left, Number) else right
    return number.emit(f"{instruction} contract double {operand(left)}, {operand(right)}")


class Number:
    """A traced number: the name of the line that computes it. Arithmetic appends further lines."""

    # NumPy's functions refuse it, and NumPy's numbers leave arithmetic to it.
    __array_ufunc__ = None
    __hash__ = None  # pyright: ignore[reportAssignmentType]

    def __init__(self, lines: dict[str, str], name: str) -> None:
        # Names of results by the lines that compute them, in order; a field's numbers share it.
        self.lines = lines
        self.name = name

    def emit(self, line: str) -> "Number":
        """The number that a line computes, a new line or an equal one from before."""
        return Number(self.lines, self.lines.setdefault(line, f"%v{len(self.lines)}"))

    __add__, __radd__ = either_side(partial(_arithmetic, "fadd"))
    __sub__, __rsub__ = either_side(partial(_arithmetic, "fsub"))
    __mul__, __rmul__ = either_side(partial(_arithmetic, "fmul"))
    __truediv__, __rtruediv__ = either_side(partial(_arithmetic, "fdiv"))

    def __neg__(self) -> "Number":
        return self.emit(f"fneg double {self.name}")

    def __pos__(self) -> "Number":
        return self

    # Unlike the four above, a power of a traced number and an array is refused by a FieldError. An exponent
    # that is a whole number in an array without dimensions is taken. `np.array(y) ** 2` is NumPy's, element by element.
    def __pow__(self, exponent: Any) -> Any:
        if isinstance(exponent, Number) or exponent not in _MULTIPLIED_OUT:
            return call("pow", self, exponent)
        n = int(exponent)
        if n < 0:
            return 1.0 / self**-n
        if n == 0:
            return 1.0
        if n == 1:
            return self
        half = self ** (n // 2)
        return half * half * self if n % 2 else half * half

    def __rpow__(self, base: Any) -> "Number":
        return call("pow", base, self)

    def _compare(self, other: Any = None) -> bool:
        raise TypeError("a field cannot compare or branch; use ops.where_positive(x, a, b)")

    __bool__ = __lt__ = __le__ = __gt__ = __ge__ = __eq__ = __ne__ = _compare  # pyright: ignore

    def __float__(self) -> float:
        raise TypeError(
            "a field cannot use float() or math's functions; use ops.sin, ops.cos, ops.sqrt"
        )


def call(function: str, *arguments: Any) -> Any:
    """A mathematical function of numbers and constants that LLVM has as `@llvm.NAME.f64`.

    Names in use, which `math` has too: sin, cos, sqrt, exp, log, pow. LLVM knows these functions
    without a declaration. Fields of users call them with anything: what is no number is refused
    here by name.
    """
    wrong = next((x for x in arguments if not isinstance(x, Number | Real)), None)
    if wrong is not None:
        raise TypeError(f"{function}: got {wrong!r}, expected a number")
    return _called(f"llvm.{function}.f64", function, arguments)


def _called(symbol: str, function: str, arguments: Sequence[Any]) -> Any:
    """The function that machine code knows as `symbol`; of constants alone, `math`'s."""
    number = next((x for x in arguments if isinstance(x, Number)), None)
    if number is None:
        return getattr(math, function)(*arguments)
    operands = ", ".join(f"double {operand(x)}" for x in arguments)
    return number.emit(f"call contract double @{symbol}({operands})")


def _where_positive(x: Any, a: Any, b: Any) -> Any:
    if not isinstance(x, Number):
        return a if x > 0 else b
    positive = x.emit(f"fcmp ogt double {x.name}, 0.0").name
    return x.emit(f"select i1 {positive}, double {operand(a)}, double {operand(b)}")


def of_library(function: str, *arguments: Any) -> Any:
    """A function of C's library that is none of LLVM's own.

    Names are expm1, atan2 and the others that `llvm.py` declares before each text; another name is
    traced, and refused when the text is compiled. Arguments are not checked: they come from
    recordings, `Part` and rules of derivatives, which pass numbers alone.
    """
    return _called(function, function, arguments)


_expm1 = partial(of_library, "expm1")


# Operations on traced numbers.
OPERATIONS = Operations(
    partial(call, "sin"),
    partial(call, "cos"),
    partial(call, "sqrt"),
    _where_positive,
    _expm1,
    partial(call, "exp"),
    partial(call, "log"),
    of_library,
)


@once()
def trace(factory: Factory, dimension: int, parameters: int, mass: bool = False) -> str:
    """LLVM's lines that read state and parameters at %y and %p, and write the field's rates at %out.

    With `mass` it is the residual ``mass * slope - field(y, p)``, with two further arrays %slope
    and %mass, the diagonal of the mass matrix. With a full matrix SUNDIALS runs through
    scikit-sundae, without this residual. A FieldError says where the field does what no field may
    do.
    """
    lines: dict[str, str] = {}
    rates = _evaluate(factory, read(lines, "y", dimension), read(lines, "p", parameters))
    if mass:
        slopes = read(lines, "slope", dimension)
        masses = read(lines, "mass", dimension)
        rates = [m * slope - rate for m, slope, rate in zip(masses, slopes, rates, strict=True)]
    return written(lines, rates)


def read(lines: dict[str, str], name: str, size: int) -> tuple[Number, ...]:
    """The numbers of an array."""
    start = Number(lines, f"%{name}")
    places = [start.emit(f"getelementptr double, ptr %{name}, i64 {i}") for i in range(size)]
    return tuple(place.emit(f"load double, ptr {place.name}") for place in places)


def written(lines: dict[str, str], numbers: Iterable[Any]) -> str:
    """The lines, and those that write numbers at %out."""
    text = [f"{name} = {line}" for line, name in lines.items()]
    for i, number in enumerate(numbers):
        text += [
            f"%out{i} = getelementptr double, ptr %out, i64 {i}",
            f"store double {operand(number)}, ptr %out{i}",
        ]
    return "\n".join(text)


def _evaluate(factory: Factory, y: tuple[Number, ...], p: tuple[Number, ...]) -> tuple[Any, ...]:
    """The rates of a traced state, or the place where the field goes wrong."""
    with _located():
        rhs = factory(OPERATIONS)
    code = getattr(rhs, "__code__", None)
    place = f"{code.co_filename}:{code.co_firstlineno}" if code else repr(rhs)
    names = [
        name
        for name, parameter in inspect.signature(rhs).parameters.items()
        if parameter.default is parameter.empty
    ]
    if len(names) != 2 or names[0] == "t":
        raise FieldError(f"{place}: got rhs({', '.join(names)}), expected rhs(y, p)")
    with _located():
        rates = rhs(y, p)
    if not isinstance(rates, tuple | list) or len(rates) != len(y):
        got = (
            f"{len(rates)} rates"
            if isinstance(rates, tuple | list)
            else f"{type(rates).__name__!r}"
        )
        raise FieldError(
            f"{place}: got {got}, expected a tuple of {len(y)}, one per component of the state"
        )
    wrong = next((rate for rate in rates if not isinstance(rate, Number | Real)), None)
    if wrong is not None:
        raise FieldError(f"{place}: got the rate {wrong!r}, expected a number")
    return tuple(rates)


@contextmanager
def _located() -> Iterator[None]:
    """Name the line of the field, or of what it calls, in which an exception arose."""
    try:
        yield
    except UntraceableError as error:
        # It names the user's line itself.
        raise FieldError(str(error)) from error
    except Exception as error:
        frame = line_of(error, __file__)
        where, line = (
            (f"{frame.filename}:{frame.lineno}: ", f": {frame.line}") if frame else ("", "")
        )
        words = str(error)
        # Words of NumPy's functions, of `abs`, and of `np.sin` of an object without such a method.
        if re.search("__array_ufunc__|bad operand type for abs|no callable .* method", words):
            words = "a field cannot use this function; use those of ops"
        raise FieldError(f"{where}{words}{line}") from error
