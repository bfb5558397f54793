"""A vector field from an ordinary Python function: recorded if possible, else called as it is."""

import inspect
import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, fields, replace
from operator import attrgetter, neg
from types import MethodType
from typing import Any
from weakref import WeakKeyDictionary, WeakMethod, ref

import numpy as np

from polhode.models.mass import Unmassed, is_singular
from polhode.models.operations import ARRAYS, FLOAT, Field, Operations
from polhode.models.recording import Recording, UntraceableError, line_of, numbers_of, record
from polhode.models.shape import require_numbers
from polhode.models.structure import Structure, structure_of

# The next two are estimates that bound the wait before a first run; docs/own-ode.md has the times of
# compilation that were measured.
#
# Components up to which a function is recorded: each operation becomes a line of machine code.
MAX_RECORDED = 200
# Components up to which the exact Jacobian is compiled, entry by entry. Beyond, solvers that can call
# Python do.
MAX_EXACT_JACOBIAN = 50
# Advice in messages about arguments that are no numbers.
INTO_A_CLOSURE = "what is no number goes into a closure: lambda t, y: f(t, y, table)"
# Largest deviation of a recording's rates from the function's, over the largest rate, at the start; a
# recording that deviates more is not used. An estimate, far above rounding and far below a rate that
# means something else.
_SAME_RATES = 1e-9
# Characters that a message shows of an argument, and of the rates at the start: it is to stay short.
_MAX_ARGUMENT_SHOWN = 60
_MAX_RATES_SHOWN = 100


@dataclass(frozen=True)
class OwnField:
    """The factory of a field that a function ``f(t, y, *parameters)`` makes.

    Its own time begins at 0 and goes forward, whatever the user's does.
    """

    function: Callable[..., Any]
    # Whether the time is the state's last component: of what is recorded and uses it.
    timed: bool
    t_start: float
    t_end: float
    # The operations that it computes, recorded when the problem was made, and anew when a run begins
    # (`recorded_anew`): names that it reads may mean something else later. None if it runs as plain
    # Python.
    recording: Recording | None = field(default=None, repr=False)
    # Why it is not recorded, in one line.
    plain_reason: str = field(default="", compare=False, repr=False)
    # Its Jacobian, as far as the user states it.
    structure: Structure | None = field(default=None, compare=False, repr=False)
    # Whether the recording stays, whatever the names that the function reads come to mean.
    frozen: bool = field(default=False, compare=False, repr=False)

    @property
    def plain(self) -> bool:
        """Whether it runs as plain Python."""
        return self.recording is None

    @property
    def branches(self) -> bool:
        """Whether it takes one of two values somewhere, as far as that is known."""
        return self.recording is not None and self.recording.branches

    @property
    def backwards(self) -> bool:
        """Whether the user's time goes backwards."""
        return self.t_end < self.t_start

    def time_at(self, elapsed: Any) -> Any:
        """The user's time, a number or an array, at times of the run; none beyond the end."""
        if self.backwards:
            return np.maximum(self.t_start - elapsed, self.t_end)
        return np.minimum(self.t_start + elapsed, self.t_end)

    def rates(self, parameters: Sequence[float]) -> Callable[[float, Any], Any]:
        """The function as ``rates(elapsed, y)`` of the run's time, in plain Python.

        From a start at 0 on, forwards, the two times are the same, and times beyond the end are passed on.
        """
        function = self.function
        begin = self.t_start
        end = self.t_end
        if self.backwards:
            return lambda t, y: -np.asarray(function(max(begin - t, end), y, *parameters))
        if begin:
            return lambda t, y: function(min(begin + t, end), y, *parameters)
        if parameters:
            return lambda t, y: function(t, y, *parameters)
        return function

    def __call__(self, ops: Operations) -> Field:
        """Bind the function to a kind of number; UntraceableError if it runs as plain Python and cannot."""
        if ops is FLOAT or (self.plain and ops is ARRAYS):
            return self._called
        if self.recording is None:
            raise UntraceableError(self.plain_reason)
        recording = self.recording
        backwards = self.backwards

        def rhs(y, p):
            # A recording that does not use the time never reads the NaN.
            time = self._time(ops, y[len(y) - 1]) if self.timed else math.nan
            rates = recording.evaluate(ops, y, p, time)
            if backwards:
                rates = map(neg, rates)
            return (*rates, *[1.0] * self.timed)

        return rhs

    def _called(self, y: Any, p: Any) -> tuple[Any, ...]:
        """The function itself; the time is in the state if it is `timed`, else the start's."""
        state = np.array([y[i] for i in range(len(y) - self.timed)], dtype=float)
        elapsed = float(y[len(state)]) if self.timed else 0.0
        rates = numbers_of(self.rates(tuple(p))(elapsed, state))
        return (*rates, *[1.0] * self.timed)

    def _time(self, ops: Operations, elapsed: Any) -> Any:
        """The user's time over any kind of number, as `time_at` has it over floats."""
        # A function of time need not have rates beyond the end. The term of 0 gives the end the kind of
        # number that `elapsed` has.
        if self.backwards:
            time = self.t_start - elapsed
            return ops.where_positive(time - self.t_end, time, self.t_end + 0.0 * elapsed)
        time = self.t_start + elapsed
        return ops.where_positive(self.t_end - time, time, self.t_end + 0.0 * elapsed)

    def recorded_anew(self, dimension: int, parameters: int) -> "OwnField":
        """The field as its names have it now.

        An UntraceableError says what cannot be recorded any more.
        """
        if self.frozen or self.recording is None:
            return self
        recording = record(self.function, dimension - self.timed, parameters)
        if recording.timed and not self.timed:
            name = getattr(self.function, "__name__", "f")
            raise UntraceableError(f"{name} uses the time, which was not used at the start")
        return replace(self, recording=recording)

    @property
    def better_plain(self) -> bool:
        """Whether solvers that can call Python had better do so: the Jacobian is the user's."""
        return self.structure is not None and self.structure.jacobian is not None

    def weakly(self, forget: Callable[[Any], None]) -> Any:
        """An object that equals this field, and dies with its function (`polhode.models.once`)."""
        try:
            return _WeakField(self, forget)
        except TypeError:
            # Some objects take no weak references.
            return self


# The attributes by which fields of one function are compared.
_REST = attrgetter(
    *(part.name for part in fields(OwnField) if part.compare and part.name != "function")
)


class _WeakField:
    """A field whose function may die."""

    __slots__ = ("_function", "_hash", "_rest")

    def __init__(self, field: OwnField, forget: Callable[[Any], None]) -> None:
        kind: Any = WeakMethod if isinstance(field.function, MethodType) else ref
        self._function = kind(field.function, lambda _: forget(self))
        self._hash = hash(field)
        self._rest = _REST(field)

    def __hash__(self) -> int:
        return self._hash

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, OwnField):
            return self is other
        return self._rest == _REST(other) and self._function() == other.function


# Functions that could not be recorded, and why: they are not tried again at every run.
_plain_functions: "WeakKeyDictionary[Any, str]" = WeakKeyDictionary()


def own_field(
    f: Callable[..., Any],
    y0: Sequence[float],
    span: tuple[float, float],
    parameters: Sequence[float],
    structure: tuple[Any, Any, Any, Any] = (None, None, None, None),
    mass: np.ndarray | None = None,
) -> tuple[tuple[float, ...], OwnField]:
    """The start and the factory of a function's field.

    `structure` is what `structure_of` takes but the dimension: the Jacobian, its pattern, and its
    numbers of diagonals below and above. `mass`, shape (d,) or (d, d), is M in ``M y' = f``. A singular
    one is the caller's to keep (`Problem.mass_form`). The start ends with the time 0 if the function
    is recorded and uses time.

    Raises ValueError as `Problem.from_function` does.
    """
    if not callable(f):
        raise ValueError(f"f: got {in_one_line(f)}, expected a function f(t, y)")
    start = _numbers("y0", y0)
    values = _numbers("parameters", parameters)
    if not start:
        raise ValueError("y0: got no numbers, expected one per component")
    for name, time in zip(("t_start", "t_end"), span, strict=True):
        require_numbers(name, time)
    if not (math.isfinite(span[0]) and math.isfinite(span[1]) and span[0] != span[1]):
        raise ValueError(
            f"t_end: got {span[1]!r}, expected a finite number other than {span[0]!r}, the start"
        )
    jacobian = structure_of(*structure, len(start))
    if mass is not None and not is_singular(mass):
        _check_signature(f, span[0], start, values)
        f = Unmassed(f, mass)
        jacobian = f.structure(jacobian)
    # Machine code is cached under the function; a method can be a key where its object cannot.
    key = f if f.__hash__ else f.__call__
    reason = _known_reason(key)
    if not reason:
        _check_signature(f, span[0], start, values)
    rates = _rates_at_start(f, start, values, span[0])
    recording = None
    if not reason:
        try:
            recording = _recorded(key, start, values, span[0], rates)
        except UntraceableError as error:
            reason = str(error)
    timed = recording is not None and recording.timed
    vector_field = OwnField(key, timed, float(span[0]), float(span[1]), recording, reason, jacobian)
    return (*start, 0.0) if timed else start, vector_field


def _rates_at_start(
    f: Callable[..., Any], start: tuple[float, ...], parameters: tuple[float, ...], time: float
) -> list[Any]:
    """The function's rates at the start, checked: finite numbers, one per component."""
    try:
        rates = numbers_of(f(time, np.array(start), *parameters))
    except Exception as error:
        raise ValueError(
            f"f: got {type(error).__name__} at the start: {error}{place_of(error)}"
        ) from error
    if rates == [None]:
        raise ValueError("f: got None, expected rates: does the function return them?")
    if len(rates) != len(start):
        raise ValueError(
            f"f: got {len(rates)} rates, expected {len(start)}, one per component of y0"
        )
    if not _all_finite(rates):
        more = ": real and imaginary parts are components of their own"
        more = more if any(isinstance(rate, complex) for rate in rates) else ""
        raise ValueError(
            f"f: got the rates {rates!s:.{_MAX_RATES_SHOWN}} at the start, expected finite numbers{more}"
        )
    return rates


def _known_reason(f: Callable[..., Any]) -> str:
    """Why a function could not be recorded before; empty if that is not known."""
    try:
        return _plain_functions.get(f, "")
    except TypeError:
        return ""


def _recorded(
    f: Callable[..., Any],
    start: tuple[float, ...],
    parameters: tuple[float, ...],
    time: float,
    rates: list[float],
) -> Recording:
    """The function recorded, and compared with itself at the start.

    UntraceableError if it cannot be.
    """
    if len(start) > MAX_RECORDED:
        raise UntraceableError(
            f"{getattr(f, '__name__', 'f')} has {len(start)} components, of which at most "
            f"{MAX_RECORDED} are compiled one by one"
        )
    try:
        recording = record(f, len(start), len(parameters))
        with np.errstate(all="ignore"):
            again = recording.evaluate(ARRAYS, start, parameters, np.float64(time))
        size = max(map(abs, rates))
        if not all(
            abs(rate - float(repeated)) <= _SAME_RATES * size
            for rate, repeated in zip(rates, again, strict=True)
        ):
            name = getattr(f, "__name__", "f")
            raise UntraceableError(f"{name} computes something else when it is recorded")
    except UntraceableError as error:
        # Some objects take no weak references.
        with suppress(TypeError):
            _plain_functions[f] = str(error)
        raise
    return recording


def _all_finite(rates: list[Any]) -> bool:
    try:
        return all(map(math.isfinite, rates))
    except TypeError:
        return False


def _check_signature(
    f: Callable[..., Any], time: float, start: tuple[float, ...], parameters: tuple[float, ...]
) -> None:
    """ValueError unless the function takes (t, y, *parameters), and calls its second argument neither t nor time."""
    try:
        signature = inspect.signature(f)
    except ValueError:
        # Functions of C have none: the rates at the start tell whether it can be called.
        return
    try:
        signature.bind(time, start, *parameters)
        if [*signature.parameters][1:2] in (["t"], ["time"]):
            raise TypeError("the time comes first")
    except TypeError as error:
        words = f"f(t, y{''.join(f', p{i}' for i in range(len(parameters)))})"
        got = f"{getattr(f, '__name__', 'f')}{signature}"
        raise ValueError(
            f"f: got {got}, expected {words}, with the {len(parameters)} parameters ({error})"
        ) from None


def place_of(error: BaseException, *skipped: str) -> str:
    """The user's line on the way to an error, with its file, in brackets.

    Empty if there is none.
    """
    line = line_of(error, *skipped)
    return f" ({line.filename}:{line.lineno}: {line.line})" if line else ""


def _numbers(name: str, values: Sequence[float]) -> tuple[float, ...]:
    """A sequence's numbers as floats; ValueError unless all are real and finite."""
    numbers = None
    with suppress(TypeError, ValueError, OverflowError):
        array = np.asarray(values)
        # Booleans, whole numbers, floats, and objects that become floats.
        if array.ndim == 1 and array.dtype.kind in "biufO":
            numbers = tuple(array.astype(float).tolist())
    if numbers is None or not all(map(math.isfinite, numbers)):
        expected = f"a sequence of finite numbers{_way_out(name, values)}"
        raise ValueError(f"{name}: got {in_one_line(values)}, expected {expected}")
    return numbers


def in_one_line(value: Any) -> str:
    """A value for messages, without line breaks and not longer than `_MAX_ARGUMENT_SHOWN`."""
    return " ".join(repr(value).split())[:_MAX_ARGUMENT_SHOWN]


def _way_out(name: str, values: Any) -> str:
    """Advice for values that are no numbers; empty if there is none."""
    if name == "y0" and _is_complex(values):
        return ": give real and imaginary parts as components of their own"
    if name == "y0" and np.ndim(values) > 1:
        return ": give y0.ravel(), and reshape y in the function"
    if name == "parameters" and not isinstance(values, float | int | str):
        # Tables and dictionaries are no numbers that solvers can vary.
        return f"; {INTO_A_CLOSURE}"
    return ""


def _is_complex(values: Any) -> bool:
    try:
        return np.asarray(values).dtype.kind == "c"
    except (TypeError, ValueError):
        return False
