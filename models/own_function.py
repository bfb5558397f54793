"""A vector field from an ordinary function of Python: NumPy's and math's functions in it become those of any number."""

import builtins
import inspect
import math
import os
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, fields
from functools import partial
from operator import attrgetter
from traceback import FrameSummary, extract_tb
from types import CellType, CodeType, FunctionType, MethodType, ModuleType
from typing import Any
from weakref import WeakMethod, ref

import numpy as np

from polhode.models.operations import FLOAT, Field, Operations
from polhode.models.shape import require_numbers

LIBRARIES = (np, math)
# What a function may use, and what it does instead of branching.
BRANCHES = "np.heaviside, np.maximum, np.minimum or np.abs"
FUNCTIONS = (
    f"sin, cos, tan, sqrt, exp and log of NumPy or math, {BRANCHES}, "
    "in f or what it names, not in methods called"
)


class _Absent:
    """Stands for the time in a function that did not use it at the start."""

    def __repr__(self) -> str:
        return "the time, which was not used at the start"

    def _used(self, *others: Any, **named: Any) -> Any:
        raise TypeError(f"f uses {self!r}")

    __bool__ = __float__ = __neg__ = __pos__ = __abs__ = __array_ufunc__ = _used  # pyright: ignore
    __eq__ = __ne__ = __lt__ = __le__ = __gt__ = __ge__ = __pow__ = __rpow__ = _used  # pyright: ignore
    __add__ = __radd__ = __sub__ = __rsub__ = __mul__ = __rmul__ = __truediv__ = __rtruediv__ = (
        _used
    )


_ABSENT = _Absent()


@dataclass(frozen=True)
class OwnField:
    """The factory of a field that a function ``f(t, y, *parameters)`` makes."""

    function: Callable[..., Any]
    timed: bool  # whether it uses t, which then is the state's last component
    t_start: float
    # Beyond it a function of time need not have rates: it gets no later time. Infinite without t.
    t_end: float = math.inf
    # What it computes, traced when a run began: names that it reads may mean something else later.
    lines: str = field(default="", repr=False)
    # Whether it stays so, whatever those names come to mean.
    frozen: bool = field(default=False, compare=False, repr=False)

    @property
    def branches(self) -> bool:
        """Whether it takes one of two values somewhere, once it is traced."""
        return " select " in self.lines

    def __call__(self, ops: Operations) -> Field:
        """Bind the function to a kind of number."""
        target = (
            self.function.__call__
            if isinstance(self.function.__call__, MethodType)
            else self.function
        )
        function = self.function if ops is FLOAT else _rebound(target, _replacements(_own(ops)))

        def rhs(y, p):
            state = [y[i] for i in range(len(y) - self.timed)]
            parameters = [p[i] for i in range(len(p))]
            time = self._time(ops, y[len(state)]) if self.timed else _ABSENT
            rates = function(time, _array(state), *parameters)
            return (*_listed(rates), *[1.0] * self.timed)

        return rhs

    def _time(self, ops: Operations, elapsed: Any) -> Any:
        time = self.t_start + elapsed
        return ops.where_positive(self.t_end - time, time, self.t_end + 0.0 * elapsed)

    def weakly(self, forget: Callable[[Any], None]) -> Any:
        """What equals this field, and dies with its function (`polhode.models.once`)."""
        try:
            return _WeakField(self, forget)
        except TypeError:
            # Some objects take no weak references.
            return self


# What makes a field besides its function.
_REST = attrgetter(
    *(each.name for each in fields(OwnField) if each.compare and each.name != "function")
)


class _WeakField:
    """A field whose function may die."""

    __slots__ = ("_function", "_hash", "_rest")

    def __init__(self, field: OwnField, forget: Callable[[Any], None]) -> None:
        kind: Any = WeakMethod if isinstance(field.function, MethodType) else ref
        self._function = kind(field.function, lambda _: forget(self))
        self._hash, self._rest = hash(field), _REST(field)

    def __hash__(self) -> int:
        return self._hash

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, OwnField):
            return self is other
        return self._rest == _REST(other) and self._function() == other.function


def own_field(
    f: Callable[..., Any],
    y0: Sequence[float],
    span: tuple[float, float],
    parameters: Sequence[float],
) -> tuple[tuple[float, ...], OwnField]:
    """The start and the factory of a function's field; raises ValueError as `Problem.from_function` does."""
    start, given = _numbers("y0", y0), _numbers("parameters", parameters)
    if not start:
        raise ValueError("y0: got no numbers, expected one per component")
    for name, time in zip(("t_start", "t_end"), span, strict=True):
        require_numbers(name, time)
    if not (math.isfinite(span[0]) and span[0] < span[1] < math.inf):
        raise ValueError(f"t_end: got {span[1]!r}, expected a finite number above {span[0]!r}")
    try:
        inspect.signature(f).bind(*span[:1], start, *given)
        if [*inspect.signature(f).parameters][1:2] in (["t"], ["time"]):
            raise TypeError("the time comes first")
    except TypeError as error:
        words = f"f(t, y{''.join(f', p{i}' for i in range(len(given)))})"
        got = f"{getattr(f, '__name__', 'f')}{inspect.signature(f)}"
        raise ValueError(
            f"f: got {got}, expected {words}, with the {len(given)} parameters ({error})"
        ) from None
    timed = _uses_time(f, start, given)
    try:
        rates = _listed(f(span[0], np.array(start), *given))
    except Exception as error:
        raise ValueError(
            f"f: got {type(error).__name__} at the start: {error}{place_of(error)}"
        ) from error
    if len(rates) != len(start):
        raise ValueError(
            f"f: got {len(rates)} rates, expected {len(start)}, one per component of y0"
        )
    if not all(isinstance(rate, float | int) and math.isfinite(rate) for rate in rates):
        raise ValueError(f"f: got the rates {rates} at the start, expected finite numbers")
    # What is compiled is kept under the function; a method can be a key where its object cannot.
    key = f if f.__hash__ else f.__call__
    return (*start, 0.0) if timed else start, OwnField(
        key, timed, span[0], span[1] if timed else math.inf
    )


def line_of(error: BaseException, *skipped: str) -> FrameSummary | None:
    """The last line of a user's code on the way to an error: outside this file, NumPy and the files skipped."""
    ours = (__file__, os.path.dirname(np.__file__), *skipped)
    lines = reversed(extract_tb(error.__traceback__))
    return next((each for each in lines if not each.filename.startswith(ours)), None)


def place_of(error: BaseException, *skipped: str) -> str:
    """That line with its file, in brackets; empty if there is none."""
    line = line_of(error, *skipped)
    return f" ({line.filename}:{line.lineno}: {line.line})" if line else ""


def _numbers(name: str, values: Sequence[float]) -> tuple[float, ...]:
    try:
        found = (
            tuple(np.array(values, dtype=float, ndmin=1).tolist()) if np.ndim(values) == 1 else None
        )
    except (TypeError, ValueError):
        found = None
    if found is None or not all(map(math.isfinite, found)):
        raise ValueError(f"{name}: got {values!r:.60}, expected a sequence of finite numbers")
    return found


def _uses_time(
    f: Callable[..., Any], start: tuple[float, ...], parameters: tuple[float, ...]
) -> bool:
    try:
        return any(rate is _ABSENT for rate in _listed(f(_ABSENT, np.array(start), *parameters)))
    except Exception:
        return True


def _listed(rates: Any) -> list[Any]:
    """The rates as a list of Python's numbers, whatever held them."""
    if not isinstance(rates, np.ndarray):
        rates = list(rates) if hasattr(rates, "__iter__") else [rates]
    found = rates.ravel().tolist() if isinstance(rates, np.ndarray) else rates
    return [
        rate.item() if isinstance(rate, np.generic | np.ndarray) and not rate.ndim else rate
        for rate in found
    ]


def _array(state: list[Any]) -> np.ndarray:
    """An array of numbers of any kind."""
    return np.array(
        state, dtype=float if all(isinstance(each, float) for each in state) else object
    )


def _own(ops: Operations) -> dict[str, Any]:
    arrays = {name: _of_any_type(getattr(np, name)) for name in ("zeros", "empty", "ones")}
    own: dict[str, Any] = {
        name: _of_one(getattr(ops, name)) for name in ("sin", "cos", "sqrt", "exp")
    }
    own["log"] = lambda x, *base: ops.log(x) / math.log(*base) if base else ops.log(x)
    own["tan"] = lambda x: ops.sin(x) / ops.cos(x)
    own["abs"] = own["absolute"] = lambda x: ops.where_positive(x, x, -x)

    def chosen(x: Any, above: Any, below: Any, else_: Any) -> Any:
        return ops.where_positive(x, above, ops.where_positive(-x, below, else_))

    # What is no number stays none, as in NumPy.
    own["maximum"] = lambda a, b: chosen(a - b, a, b, 0.5 * (a + b))
    own["minimum"] = lambda a, b: chosen(a - b, b, a, 0.5 * (a + b))
    own["heaviside"] = lambda x, at_zero: chosen(x, 1.0, 0.0, at_zero + 0.0 * x)
    return {**arrays, **{name: _each(function) for name, function in own.items()}}


def _of_any_type(make: Callable[..., Any]) -> Callable[..., Any]:
    return lambda shape, *_, **__: make(shape, dtype=object)


def _of_one(function: Callable[..., Any]) -> Callable[..., Any]:
    return lambda x: function(x)


def _each(function: Callable[..., Any]) -> Callable[..., Any]:
    """A function of numbers, for arrays component by component."""

    def of_any(*given: Any) -> Any:
        if not any(isinstance(each, np.ndarray | list | tuple) for each in given):
            return function(*given)
        return np.vectorize(function, otypes=[object])(
            *(np.array(each, dtype=object) for each in given)
        )

    return of_any


class _Library:
    """A library with functions of another kind of number."""

    def __init__(self, module: ModuleType, own: dict[str, Any]) -> None:
        self._module, self._own = module, own

    def __getattr__(self, name: str) -> Any:
        return self._own[name] if name in self._own else getattr(self._module, name)


def _replacements(own: dict[str, Any]) -> dict[int, Any]:
    """What stands in the place of the libraries and their functions, by the identity of these."""
    pairs = ((library, name) for library in LIBRARIES for name in own if hasattr(library, name))
    functions = {id(getattr(library, name)): own[name] for library, name in pairs}
    return functions | {id(library): _Library(library, own) for library in LIBRARIES}


def _rebound(value: Any, known: dict[int, Any]) -> Any:
    """A function, method or `partial`, and the functions that it names, with others in the place of those known."""
    if id(value) in known:
        return known[id(value)]
    if isinstance(value, MethodType):
        return MethodType(_rebound(value.__func__, known), value.__self__)
    if isinstance(value, partial):
        named = {name: _rebound(each, known) for name, each in value.keywords.items()}
        return partial(
            _rebound(value.func, known), *(_rebound(each, known) for each in value.args), **named
        )
    if not isinstance(value, FunctionType):
        return value
    names, cells = {"__builtins__": builtins}, tuple(CellType() for _ in value.__closure__ or ())
    defaults = tuple(_rebound(each, known) for each in value.__defaults__ or ())
    made = known[id(value)] = FunctionType(value.__code__, names, value.__name__, defaults, cells)
    made.__kwdefaults__ = {
        name: _rebound(each, known) for name, each in (value.__kwdefaults__ or {}).items()
    }
    for cell, their in zip(cells, value.__closure__ or (), strict=True):
        with suppress(ValueError):  # Nothing is in it yet.
            cell.cell_contents = _rebound(their.cell_contents, known)
    # Comprehensions and functions within it have code of their own.
    codes = [value.__code__]
    for code in codes:
        codes += [each for each in code.co_consts if isinstance(each, CodeType)]
    used = {name for code in codes for name in code.co_names}
    for name, each in value.__globals__.items():
        names.setdefault(name, _rebound(each, known) if name in used else known.get(id(each), each))
    return made
