"""The operations of a function, recorded by calling it once with numbers that note them.

The numbers take NumPy's functions by NumPy's own protocols, `__array_ufunc__` and
`__array_function__`; the function itself is called as it is. A recording is a straight line of
operations, which `Recording.evaluate` repeats over any kind of number: machine code, heyoka's
expressions, numbers with derivatives.

A function that needs plain numbers (`math`, tables, splines, branches on the state) cannot be
recorded: `record` raises an UntraceableError that shows the user's own line.
"""

import linecache
import math
import operator
import os
from collections.abc import Callable, Sequence
from functools import cached_property
from numbers import Real
from threading import local
from traceback import FrameSummary, extract_tb
from typing import Any

import numpy as np

from polhode.models.operations import NUMPY_NAMES, Operations

# A node is the name of an operation and the indices of its operands, or the name of an input and its
# place: ("mul", 0, 3), ("y", 1), ("t",), ("constant", 0.5).
Node = tuple[Any, ...]
# Names of nodes that no operation computes.
_INPUTS = ("y", "p", "t", "constant")


def _power(base: Any, exponent: Any) -> Any:
    """Power, also of a plain number to one of heyoka's expressions."""
    try:
        return base**exponent
    except TypeError:
        # heyoka's expressions have no power of a plain number.
        return type(exponent)(base) ** exponent


_ARITHMETIC: dict[str, Callable[..., Any]] = {
    "add": operator.add,
    "sub": operator.sub,
    "mul": operator.mul,
    "div": operator.truediv,
    "pow": _power,
    "neg": operator.neg,
}
# Functions of one number that are fields of `Operations`, for every kind of number. So is
# `where_positive(x, a, b)`, which is a if x > 0 and b if not.
_COMMON = ("sin", "cos", "sqrt", "exp", "log")
# Advice of messages about a function that cannot be recorded.
_ADVICE = (
    "NumPy's functions for math's, np.where for a branch, np.zeros_like(y) or np.array for np.zeros"
)


# Characters that a message shows of the expression that cannot be recorded, and of the user's line.
# Estimates: they decide how long a message may get.
_MAX_EXPRESSION_SHOWN = 60
_MAX_LINE_SHOWN = 100


class UntraceableError(Exception):
    """A function does what cannot be recorded.

    The message quotes the expression and its line, where they are known.
    """


class _NeedsNumbersError(TypeError):
    """A function, or its rates, cannot be recorded; `record` makes an UntraceableError of it."""


class Recording:
    """A straight line of operations.

    Parameters
    ----------
    nodes : tuple of Node
        In the order of their computation.
    results : tuple of int
        Indices of the nodes that are the rates.
    """

    def __init__(self, nodes: tuple[Node, ...], results: tuple[int, ...]) -> None:
        self.nodes = nodes
        self.results = results

    @cached_property
    def _key(self) -> tuple[Any, ...]:
        # Constants are compared by their digits: 0.0 equals -0.0, and NaN nothing.
        nodes = tuple(
            ("constant", node[1].hex()) if node[0] == "constant" else node for node in self.nodes
        )
        return nodes, self.results

    @cached_property
    def _hash(self) -> int:
        return hash(self._key)

    def __hash__(self) -> int:
        return self._hash

    def __eq__(self, other: object) -> bool:
        if self is other:
            return True
        if not isinstance(other, Recording) or hash(self) != hash(other):
            return False
        return self._key == other._key

    @property
    def timed(self) -> bool:
        """Whether the time has a part in it."""
        return ("t",) in self.nodes

    @property
    def branches(self) -> bool:
        """Whether it takes one of two values somewhere."""
        return any(node[0] == "where_positive" for node in self.nodes)

    def evaluate(self, ops: Operations, y: Sequence[Any], p: Sequence[Any], t: Any) -> list[Any]:
        """The rates, as a list, over the kind of number that y, p and t are of."""
        inputs = {"y": lambda i: y[i], "p": lambda i: p[i], "t": lambda: t, "constant": float}
        functions = {name: getattr(ops, name) for name in (*_COMMON, "where_positive")}
        functions |= _ARITHMETIC
        values: list[Any] = []
        for name, *operands in self.nodes:
            if name in inputs:
                values.append(inputs[name](*operands))
                continue
            arguments = [values[i] for i in operands]
            function = functions.get(name)
            values.append(function(*arguments) if function else ops.other(name, *arguments))
        return [values[i] for i in self.results]


class _Recorder:
    """A recording under way: equal operations are noted once."""

    def __init__(self) -> None:
        # The index of each node, in the order of their recording, and of each constant by its digits.
        self.nodes: dict[Node, int] = {}
        self.constants: dict[str, int] = {}
        # Says what in the function cannot be recorded; empty if all can.
        self.failure = ""

    def node(self, *node: Any) -> "Recorded":
        """The number that an operation yields."""
        return Recorded(self.nodes.setdefault(node, len(self.nodes)))

    def index(self, x: Any) -> int:
        """Index of the node of a number or of a constant."""
        if isinstance(x, Recorded):
            return x.index
        value = _as_float(x)
        digits = value.hex()
        index = self.constants.get(digits)
        if index is None:
            # With their digits 0.0 and -0.0, which are equal, are two nodes.
            index = self.constants[digits] = len(self.nodes)
            self.nodes["constant", value, digits] = index
        return index

    def fail(self, words: str) -> _NeedsNumbersError:
        """The error to raise; the failure stays noted even if the function catches the error."""
        self.failure = words
        return _NeedsNumbersError(words)

    def recording(self, results: Sequence[Any]) -> Recording:
        """The operations that the results need."""
        ends = [self.index(result) for result in results]
        nodes = list(self.nodes)
        # Operands stand before the operation, so that one pass backwards meets all that is needed.
        needed = set(ends)
        for i in reversed(range(len(nodes))):
            if i in needed and nodes[i][0] not in _INPUTS:
                needed.update(nodes[i][1:])
        # The index of each needed node among the needed ones alone.
        places: dict[int, int] = {}
        used: list[Node] = []
        for i in sorted(needed):
            places[i] = len(used)
            name, *operands = nodes[i]
            if name == "constant":
                # Without its digits, which told 0.0 from -0.0.
                used.append((name, operands[0]))
            elif name in _INPUTS:
                used.append(nodes[i])
            else:
                used.append((name, *(places[j] for j in operands)))
        return Recording(tuple(used), tuple(places[i] for i in ends))


# Its `recorder` is the recording under way in this thread.
_current = local()


def _recorder() -> _Recorder:
    """The recording under way; an error if there is none."""
    recorder = getattr(_current, "recorder", None)
    if recorder is None:
        raise _NeedsNumbersError("was called with a number of another recording")
    return recorder


def _as_float(x: Any) -> float:
    """A plain number as a float; complex ones cannot be recorded."""
    if isinstance(x, complex | np.complexfloating):
        raise _recorder().fail("is complex")
    return float(x)


def _apply(name: str, *operands: Any) -> Any:
    """Note an operation; of constants alone it is computed."""
    if not any(isinstance(x, Recorded) for x in operands):
        values = [_as_float(x) for x in operands]
        if name == "where_positive":
            return values[1] if values[0] > 0 else values[2]
        function = _ARITHMETIC.get(name) or getattr(np, _NUMPY_NAMES.get(name, name))
        with np.errstate(all="ignore"):
            return float(function(*(np.float64(value) for value in values)))
    recorder = _recorder()
    return recorder.node(name, *(recorder.index(x) for x in operands))


def _either_side(name: str) -> tuple[Callable[[Any, Any], Any], Callable[[Any, Any], Any]]:
    """An operator, and the one that Python calls where the number is on the right."""
    of_arrays = getattr(np, _NUMPY_NAMES[name])

    # `other` is the one of the two that is not the number with the operator.
    def applied(other: Any, left: Any, right: Any) -> Any:
        if isinstance(other, np.ndarray | list | tuple):
            return of_arrays(left, right)
        if not isinstance(other, Real | Recorded | Condition | np.bool_ | complex):
            return NotImplemented
        return _apply(name, _number(left), _number(right))

    return (
        lambda self, other: applied(other, self, other),
        lambda self, other: applied(other, other, self),
    )


# NumPy's names of operations; others have the same name here as in NumPy.
_NUMPY_NAMES = NUMPY_NAMES | {
    "add": "add",
    "sub": "subtract",
    "mul": "multiply",
    "div": "true_divide",
    "pow": "power",
    "neg": "negative",
}


class _Protocols:
    """NumPy's protocols of a number or a condition; `RecordedArray` has its own."""

    # The older protocol for operators with an array on the left, of priority 0: any higher one does.
    # NumPy asks for it only where there is no `__array_ufunc__`.
    __array_priority__ = 1000.0
    __hash__ = None  # pyright: ignore[reportAssignmentType]

    def __array_ufunc__(self, ufunc: Any, method: str, *inputs: Any, **named: Any) -> Any:
        return _ufunc(ufunc, method, inputs, named)

    def __array_function__(self, function: Any, types: Any, args: Any, named: Any) -> Any:
        return _array_function(function, args, named)


class Recorded(_Protocols):
    """A number that notes what is done to it."""

    __slots__ = ("index",)

    def __init__(self, index: int) -> None:
        self.index = index

    __add__, __radd__ = _either_side("add")
    __sub__, __rsub__ = _either_side("sub")
    __mul__, __rmul__ = _either_side("mul")
    __truediv__, __rtruediv__ = _either_side("div")
    __pow__, __rpow__ = _either_side("pow")

    def __neg__(self) -> Any:
        return _apply("neg", self)

    def __pos__(self) -> Any:
        return self

    def __abs__(self) -> Any:
        return _absolute(self)

    def __gt__(self, other: Any) -> Any:
        return _compared(np.greater, self, other)

    def __lt__(self, other: Any) -> Any:
        return _compared(np.less, self, other)

    def __ge__(self, other: Any) -> Any:
        return _compared(np.greater_equal, self, other)

    def __le__(self, other: Any) -> Any:
        return _compared(np.less_equal, self, other)

    def __eq__(self, other: Any) -> Any:
        return _compared(np.equal, self, other)

    def __ne__(self, other: Any) -> Any:
        return _compared(np.not_equal, self, other)

    def __bool__(self) -> bool:
        raise _recorder().fail("branches on the state or the time")

    def __float__(self) -> float:
        raise _recorder().fail("needs plain numbers")

    __int__ = __index__ = __complex__ = __round__ = __float__  # pyright: ignore

    def __getattr__(self, name: str) -> Any:
        # NumPy's functions of arrays of objects call the method of their name.
        if name == "conjugate":
            return lambda: self
        function = _FUNCTIONS.get(name)
        if function is None or name.startswith("_"):
            raise AttributeError(name)
        return lambda *others: function(self, *others)


class Condition(_Protocols):
    """A comparison: `choose(a, b)` is a where it holds and b where it does not."""

    __slots__ = ("choose",)

    def __init__(self, choose: Callable[[Any, Any], Any]) -> None:
        self.choose = choose

    def __and__(self, other: Any) -> Any:
        return _both(self, other)

    def __or__(self, other: Any) -> Any:
        return _one_of(self, other)

    __rand__ = __and__
    __ror__ = __or__

    def __invert__(self) -> "Condition":
        return Condition(lambda a, b: self.choose(b, a))

    def __eq__(self, other: Any) -> Any:
        return _compared(np.equal, self, other)

    def __ne__(self, other: Any) -> Any:
        return _compared(np.not_equal, self, other)

    def __bool__(self) -> bool:
        raise _recorder().fail("branches on the state or the time")

    __float__ = Recorded.__float__
    __add__, __radd__ = _either_side("add")
    __sub__, __rsub__ = _either_side("sub")
    __mul__, __rmul__ = _either_side("mul")
    __truediv__, __rtruediv__ = _either_side("div")


class RecordedArray(np.ndarray):
    """An array of numbers that note what is done to them."""

    def __array_ufunc__(self, ufunc: Any, method: str, *inputs: Any, **named: Any) -> Any:
        return _ufunc(ufunc, method, inputs, named)

    def __array_function__(self, func: Any, types: Any, args: Any, kwargs: Any) -> Any:
        return _array_function(func, args, kwargs)


def _number(x: Any) -> Any:
    """A condition as 1 or 0; all else as it is."""
    return x.choose(1.0, 0.0) if isinstance(x, Condition) else x


def _compared(ufunc: Any, left: Any, right: Any) -> Any:
    """A number compared with anything, by NumPy's function of that comparison."""
    if isinstance(right, np.ndarray | list | tuple):
        return ufunc(left, right)
    if not isinstance(right, Real | Recorded | Condition | np.bool_):
        return NotImplemented
    return _FUNCTIONS[ufunc.__name__](left, right)


def _where_positive(x: Any, a: Any, b: Any) -> Any:
    """Take a where x > 0, b where not."""
    return _apply("where_positive", x, a, b)


def _greater(left: Any, right: Any) -> Any:
    """Whether left > right: a bool for constants, else a `Condition`."""
    difference = _apply("sub", _number(left), _number(right))
    if not isinstance(difference, Recorded):
        return difference > 0
    return Condition(lambda a, b: _where_positive(difference, a, b))


def _not(condition: Any) -> Any:
    return ~condition if isinstance(condition, Condition) else not condition


def _both(one: Any, other: Any) -> Any:
    """Conjunction of two conditions or bools."""
    if not isinstance(one, Condition):
        return other if one else False
    if not isinstance(other, Condition):
        return one if other else False
    return Condition(lambda a, b: one.choose(other.choose(a, b), b))


def _one_of(one: Any, other: Any) -> Any:
    """Disjunction, by De Morgan's law."""
    return _not(_both(_not(one), _not(other)))


def _where(condition: Any, a: Any, b: Any) -> Any:
    """`np.where` of numbers; a number that is no condition holds unless it is 0."""
    if not isinstance(condition, Condition):
        condition = _FUNCTIONS["not_equal"](condition, 0.0)
    if not isinstance(condition, Condition):
        return a if condition else b
    return condition.choose(_number(a), _number(b))


def _chosen(x: Any, above: Any, below: Any, between: Any) -> Any:
    """One of three numbers, by the sign of x; the last if x is 0 or NaN."""
    return _where_positive(x, above, _where_positive(_apply("neg", x), below, between))


def _absolute(x: Any) -> Any:
    return _where_positive(x, x, _apply("neg", x))


def _half_sum(a: Any, b: Any) -> Any:
    return _apply("mul", 0.5, _apply("add", a, b))


def _maximum(a: Any, b: Any) -> Any:
    # Half the sum is the number itself if both are equal, and NaN if one is NaN, as in NumPy.
    return _chosen(_apply("sub", a, b), a, b, _half_sum(a, b))


def _minimum(a: Any, b: Any) -> Any:
    return _chosen(_apply("sub", a, b), b, a, _half_sum(a, b))


def _zero_or_nan(x: Any) -> Any:
    """Zero, or NaN if x is NaN or infinite."""
    return _apply("mul", 0.0, x)


def _cbrt(x: Any) -> Any:
    # A power with a fractional exponent has no negative base.
    root = _apply("pow", _absolute(x), 1 / 3)
    return _where_positive(x, root, _apply("neg", root))


def _logaddexp(a: Any, b: Any) -> Any:
    # log(e^a + e^b) without overflow: the larger one plus log(1 + e^(-|a - b|)).
    apart = _apply("neg", _absolute(_apply("sub", a, b)))
    return _apply("add", _maximum(a, b), _apply("log1p", _apply("exp", apart)))


def _hypot(a: Any, b: Any) -> Any:
    squares = _apply("add", _apply("mul", a, a), _apply("mul", b, b))
    return _apply("sqrt", squares)


def _noted(name: str) -> Callable[..., Any]:
    """The function that notes an operation."""
    return lambda *operands: _apply(name, *operands)


# NumPy's elementwise functions, by name, in terms of recorded operations. A comparison asks whether
# a difference is positive, which NaN is not: with NaN, <=, >= and == hold, unlike in NumPy. If one
# operand is NaN, `fmax` and `fmin` are NaN; NumPy's give the other operand.
_FUNCTIONS: dict[str, Callable[..., Any]] = {
    **{name: _noted(name) for name in _COMMON},
    **{name: _noted(name) for name in ("tan", "sinh", "cosh", "tanh", "expm1", "log1p")},
    **{numpys: _noted(name) for name, numpys in _NUMPY_NAMES.items()},
    "divide": _noted("div"),
    "float_power": _noted("pow"),
    "positive": lambda x: x,
    "conjugate": lambda x: x,
    "square": lambda x: _apply("mul", x, x),
    "reciprocal": lambda x: _apply("div", 1.0, x),
    "exp2": lambda x: _apply("pow", 2.0, x),
    "log2": lambda x: _apply("div", _apply("log", x), math.log(2)),
    "log10": lambda x: _apply("div", _apply("log", x), math.log(10)),
    "cbrt": _cbrt,
    "absolute": _absolute,
    "fabs": _absolute,
    "sign": lambda x: _chosen(x, 1.0, -1.0, _zero_or_nan(x)),
    "heaviside": lambda x, at_zero: _chosen(x, 1.0, 0.0, _apply("add", at_zero, _zero_or_nan(x))),
    "maximum": _maximum,
    "minimum": _minimum,
    "fmax": _maximum,
    "fmin": _minimum,
    "hypot": _hypot,
    "logaddexp": _logaddexp,
    "deg2rad": lambda x: _apply("mul", x, math.pi / 180),
    "radians": lambda x: _apply("mul", x, math.pi / 180),
    "rad2deg": lambda x: _apply("mul", x, 180 / math.pi),
    "degrees": lambda x: _apply("mul", x, 180 / math.pi),
    "greater": _greater,
    "less": lambda a, b: _greater(b, a),
    "greater_equal": lambda a, b: _not(_greater(b, a)),
    "less_equal": lambda a, b: _not(_greater(a, b)),
    "equal": lambda a, b: _both(_not(_greater(a, b)), _not(_greater(b, a))),
    "not_equal": lambda a, b: _one_of(_greater(a, b), _greater(b, a)),
    "logical_and": _both,
    "logical_or": _one_of,
    "logical_not": _not,
    "bitwise_and": _both,
    "bitwise_or": _one_of,
    "invert": _not,
}
# Functions whose operands are conditions.
_LOGICAL = ("logical_and", "logical_or", "logical_not", "bitwise_and", "bitwise_or", "invert")


def _of_numbers(name: str, function: Callable[..., Any]) -> Callable[..., Any]:
    """A function of numbers, which takes conditions as 1 and 0."""
    if name in _LOGICAL:
        return function
    return lambda *operands: function(*(_number(x) for x in operands))


_FUNCTIONS = {name: _of_numbers(name, function) for name, function in _FUNCTIONS.items()}


def _is_array(x: Any) -> bool:
    """Whether it is an array or a sequence of one dimension or more."""
    return isinstance(x, np.ndarray | list | tuple) and np.ndim(_plain(x)) > 0


def _plain(x: Any) -> Any:
    """Anything as an array without protocols; of recorded numbers it is one of objects."""
    if isinstance(x, RecordedArray):
        return x.view(np.ndarray)
    if isinstance(x, Recorded | Condition):
        alone = np.empty((), dtype=object)
        alone[()] = x
        return alone
    return np.asarray(x)


def _wrapped(result: Any) -> Any:
    """An array of objects with protocols, another one as it is; a number alone as itself."""
    if not isinstance(result, np.ndarray):
        return result
    if result.ndim == 0:
        return result[()]
    return result.view(RecordedArray) if result.dtype == object else result


# Options of NumPy's functions, and their values where they ask for nothing. NumPy itself hands some of
# them over that the user did not give, such as `dtype` in `np.sum`.
_DEFAULT_OPTIONS = {"where": True, "dtype": None, "initial": np._NoValue}
# Stands for the default of an option that has none.
_NO_DEFAULT = object()


def _ufunc(ufunc: Any, method: str, inputs: tuple[Any, ...], named: dict[str, Any]) -> Any:
    """An elementwise function applied by a method, for NumPy's protocol `__array_ufunc__`.

    The method is "__call__", elementwise, or one such as "reduce", which `np.sum` takes of `np.add`,
    "accumulate" or "outer". `inputs` and `named` are the arguments; `out`, if given, is a tuple of
    one array, which takes the result.
    """
    options = {
        option: value
        for option, value in named.items()
        if option != "out" and value is not _DEFAULT_OPTIONS.get(option, _NO_DEFAULT)
    }
    if ufunc is np.matmul and method == "__call__" and not options:
        result = _matmul(*inputs)
    else:
        result = _applied(ufunc, method, inputs, options)
    out = named.get("out")
    if out is None:
        return _wrapped(result)
    out[0][...] = result
    return out[0]


def _applied(ufunc: Any, method: str, inputs: tuple[Any, ...], options: dict[str, Any]) -> Any:
    """The recorded equivalent of an elementwise function, applied by a method of NumPy's."""
    function = _FUNCTIONS.get(ufunc.__name__)
    if function is None or "where" in options or "dtype" in options:
        raise _recorder().fail("cannot be compiled")
    if method == "__call__" and not any(_is_array(x) for x in inputs):
        return function(*(_wrapped(_plain(x)) for x in inputs))
    # NumPy itself applies the function to arrays of objects, by any of its methods.
    of_objects = np.frompyfunc(function, ufunc.nin, 1)
    return getattr(of_objects, method)(*(_plain(x) for x in inputs), **options)


def _matmul(left: Any, right: Any) -> Any:
    """`np.matmul`, which is `np.dot` but for numbers alone and for stacks of matrices."""
    left = _plain(left)
    right = _plain(right)
    if {left.ndim, right.ndim} <= {1, 2}:
        return _product(left, right)
    return _wrapped(np.matmul(left.astype(object), right.astype(object)))


def _product(left: Any, right: Any) -> Any:
    """`np.dot` of arrays of any dimensions; `_combined` for a matrix of plain numbers and a vector."""
    left = _plain(left)
    right = _plain(right)
    if left.ndim == 2 and right.ndim == 1 and left.dtype != object:
        return _wrapped(_combined(left, right))
    if left.ndim == 1 and right.ndim == 2 and right.dtype != object:
        return _wrapped(_combined(right.T, left))
    return _wrapped(np.dot(left.astype(object), right.astype(object)))


def _combined(matrix: np.ndarray, vector: np.ndarray) -> np.ndarray:
    """A matrix of plain numbers times a vector. It adds terms from the left, and leaves out those of zeros."""
    if matrix.shape[1] != len(vector):
        raise ValueError(f"matmul: got shapes {matrix.shape} and {vector.shape}")
    rows = np.empty(len(matrix), dtype=object)
    for i, row in enumerate(matrix):
        total = None
        for j in np.flatnonzero(row).tolist():
            term = float(row[j]) * vector[j]
            total = term if total is None else total + term
        rows[i] = 0.0 if total is None else total
    return rows


def _norm(x: Any, order: Any = None, axis: Any = None, keepdims: bool = False) -> Any:
    """`np.linalg.norm` of a vector; of nothing else."""
    if order not in (None, 2) or axis is not None or keepdims or np.ndim(_plain(x)) != 1:
        raise _recorder().fail("cannot be compiled")
    return _FUNCTIONS["sqrt"](np.sum(_wrapped(_plain(x)) ** 2))


def _where_arrays(condition: Any, *choices: Any) -> Any:
    """`np.where` of numbers and arrays; with a condition alone it asks which elements hold."""
    if len(choices) != 2:
        raise _recorder().fail("branches on the state or the time")
    arguments = (condition, *choices)
    if not any(_is_array(x) for x in arguments):
        return _where(*(_wrapped(_plain(x)) for x in arguments))
    return _wrapped(np.frompyfunc(_where, 3, 1)(*(_plain(x) for x in arguments)))


def _clip(x: Any, low: Any = None, high: Any = None, **named: Any) -> Any:
    """`np.clip`, its bounds by their places or as `min` and `max`."""
    low = named.pop("min", low)
    high = named.pop("max", high)
    if any(value is not None for value in named.values()):
        raise _recorder().fail("cannot be compiled")
    x = x if low is None else np.maximum(x, low)
    return x if high is None else np.minimum(x, high)


def _extreme(ufunc: Any) -> Callable[..., Any]:
    """`np.max` or `np.min` of an array, from the function of two numbers."""

    def of_array(x: Any, axis: Any = None, **named: Any) -> Any:
        return ufunc.reduce(x, axis=axis, **named)

    return of_array


# NumPy's functions that are replaced here; `_array_function` calls all others as they are.
_ARRAY_FUNCTIONS: dict[Any, Callable[..., Any]] = {
    np.where: _where_arrays,
    np.clip: _clip,
    np.linalg.norm: _norm,
    np.dot: _product,
    np.max: _extreme(np.maximum),
    np.amax: _extreme(np.maximum),
    np.min: _extreme(np.minimum),
    np.amin: _extreme(np.minimum),
}


def _array_function(function: Any, args: Any, named: Any) -> Any:
    """One of NumPy's other functions: most move numbers about, or consist of elementwise ones."""
    recorded = _ARRAY_FUNCTIONS.get(function)
    if recorded:
        return recorded(*args, **named)
    args = tuple(_protocolled(x) for x in args)
    named = {name: _protocolled(x) for name, x in named.items()}
    # NumPy's own implementation of the protocol for arrays of objects; it takes the function apart
    # into elementwise ones, which come to `_ufunc`.
    array = np.empty(0, dtype=object).view(RecordedArray)
    result = np.ndarray.__array_function__(array, function, (RecordedArray,), args, named)
    if result is NotImplemented:
        raise _recorder().fail("cannot be compiled")
    return _wrapped(result)


def _protocolled(x: Any) -> Any:
    """Recorded numbers among a function's arguments as arrays of no dimension, sequences of them as arrays."""
    if isinstance(x, Recorded | Condition):
        return _plain(x).view(RecordedArray)
    if isinstance(x, tuple | list) and any(isinstance(entry, Recorded | Condition) for entry in x):
        array = np.empty(len(x), dtype=object)
        array[:] = x
        return array.view(RecordedArray)
    return x


def numbers_of(rates: Any) -> list[Any]:
    """Rates as a list of numbers of any kind, whatever holds them."""
    # Arrays of floats and integers, signed or not.
    if isinstance(rates, np.ndarray) and rates.dtype.kind in "fiu":
        return rates.ravel().tolist()
    if not isinstance(rates, np.ndarray):
        rates = list(rates) if hasattr(rates, "__iter__") else [rates]
    listed = rates.ravel().tolist() if isinstance(rates, np.ndarray) else rates
    return [
        rate.item() if isinstance(rate, np.generic | np.ndarray) and not rate.ndim else rate
        for rate in listed
    ]


def record(function: Callable[..., Any], dimension: int, parameters: int) -> Recording:
    """Record ``function(t, y, *p)``.

    `dimension` counts the components of y, `parameters` the numbers in p. An UntraceableError says, in
    one line, what cannot be recorded, and where if that is known.
    """
    # A function may record another one.
    before = getattr(_current, "recorder", None)
    recorder = _current.recorder = _Recorder()
    try:
        y = np.empty(dimension, dtype=object)
        y[:] = [recorder.node("y", i) for i in range(dimension)]
        p = [recorder.node("p", i) for i in range(parameters)]
        rates = function(recorder.node("t"), y.view(RecordedArray), *p)
        results = [_number(rate) for rate in numbers_of(rates)]
        if len(results) != dimension:
            raise _NeedsNumbersError(f"returns {len(results)} rates of {dimension}")
        recording = recorder.recording(results)
    except Exception as error:
        words = recorder.failure or "cannot be compiled"
        raise UntraceableError(_in_words(error, words)) from error
    finally:
        _current.recorder = before
    if recorder.failure:
        # The function caught the error.
        name = getattr(function, "__name__", "f")
        raise UntraceableError(f"{name} {recorder.failure}; use {_ADVICE}")
    return recording


def _in_words(error: Exception, words: str) -> str:
    """The expression that cannot be recorded, the reason, and the user's line with it."""
    frame = line_of(error)
    if frame is None:
        return f"f {words} ({type(error).__name__}: {error}); use {_ADVICE}"
    place = f"{frame.filename}:{frame.lineno}: {frame.line:.{_MAX_LINE_SHOWN}}"
    expression = f"{_segment(frame):.{_MAX_EXPRESSION_SHOWN}}"
    return f"{expression} {words}; use {_ADVICE} ({place})"


def _segment(frame: FrameSummary) -> str:
    """The expression of a line that raised an error."""
    # Columns count bytes. Code may come without them, and an expression over several lines has no end
    # in its first one: then all to the end of the line is taken.
    line = linecache.getline(frame.filename, frame.lineno or 0).encode()
    begin = getattr(frame, "colno", None)
    end = getattr(frame, "end_colno", None)
    if begin is None or end is None or getattr(frame, "end_lineno", None) != frame.lineno:
        end = None
    segment = line[begin or 0 : end].decode(errors="ignore").strip()
    return segment or frame.name


# Folders whose lines are no user's: of Python's own modules and of installed libraries.
_LIBRARIES = tuple({os.path.dirname(os.__file__), os.path.dirname(os.path.dirname(np.__file__))})
# Files of our own, whose lines are no user's.
_OURS = (__file__, os.path.join(os.path.dirname(__file__), "own_function.py"))


def line_of(error: BaseException, *skipped: str) -> FrameSummary | None:
    """The last line of a user's code on the way to an error.

    Lines of this package's two modules (`_OURS`) and of the files skipped do not count. A library's line
    is given where there is no other, and None where there is none at all.
    """
    lines = [
        line
        for line in extract_tb(error.__traceback__)
        if not line.filename.startswith((*_OURS, *skipped))
    ]
    users = [line for line in lines if not line.filename.startswith(_LIBRARIES)]
    return next(reversed(users or lines), None)
