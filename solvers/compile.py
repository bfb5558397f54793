"""Compilation of vector fields: one field, written once, made into what each library calls.

Every function here compiles once, whatever the number of threads that ask, and caches the latest
results under the field's factory; what was compiled of a function of the user's dies with it.
"""

import atexit
import math
import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from polhode.models.files.cached import cache_folder
from polhode.models.libraries import IMPORTS, need
from polhode.models.mass import in_rows, without_time
from polhode.models.once import once
from polhode.models.operations import FLOAT, Field, Operations
from polhode.models.own_function import OwnField
from polhode.models.problem import Factory, Problem
from polhode.models.recording import UntraceableError
from polhode.models.spent import spent_on
from polhode.solvers.contract import Backend
from polhode.solvers.machine_code import cached_code
from polhode.solvers.machine_code.array_function import array_function
from polhode.solvers.machine_code.derivatives import trace_jacobian
from polhode.solvers.machine_code.llvm import MachineCode, compile_file
from polhode.solvers.machine_code.tracing import FieldError, trace

_FOLDER = Path(__file__).parent
# Bytes of compiled code that heyoka may keep in memory, some fifty integrators. An estimate: what is
# dropped is read from disk, or compiled, again.
_MAX_HEYOKA_MEMORY = 20_000_000
# A quotient in a traced field (`machine_code.tracing`), by a number that is no constant.
_DIVISION = re.compile(r"= fdiv contract double \S+, (%v\d+)")
# An entry of a traced Jacobian, where it is written.
_ENTRY = re.compile(r"store double (\S+), ptr %out(\d+)")
# The same, or 0 where it is not finite: where the entry times 0 is NaN.
_FINITE_ENTRY = r"""%none\2 = fmul double \1, 0.0
%finite\2 = fcmp ord double %none\2, 0.0
%entry\2 = select i1 %finite\2, double \1, double 0.0
store double %entry\2, ptr %out\2"""
# ``callback(y, p, out)`` reads state and parameters, and fills `out`.
Callback = Callable[[np.ndarray, Any, np.ndarray], None]


def plain_field(factory: Factory) -> Field:
    """The field in plain Python, over floats."""
    return factory(FLOAT)


def check_field(problem: Problem) -> None:
    """Refuse a field that does what no field may do: a FieldError names the file and the line."""
    parameters = problem.mass_form.parameters if problem.mass_form else problem.parameters
    if parameters is not None and not problem.plain:
        trace(problem.field, problem.dimension, len(parameters))


def as_it_stands(problem: Problem) -> Problem:
    """The problem with its own function as of now, which may read names that change from one run to the next."""
    field = problem.field
    if not isinstance(field, OwnField) or field.frozen or field.plain:
        return problem
    try:
        anew = field.recorded_anew(problem.dimension, len(problem.field_parameters))
    except UntraceableError as error:
        raise FieldError(str(error)) from error
    return replace(problem, field=anew)


def as_plain(problem: Problem) -> Problem:
    """The problem of a user's function with the function as plain Python, and no time in its state."""
    field = problem.field
    if not isinstance(field, OwnField) or field.plain:
        return problem
    start = problem.start[: problem.dimension - problem.timed]
    form = problem.mass_form
    if form and problem.timed:
        form = replace(form, mass=in_rows(without_time(np.array(form.mass))))
    field = replace(field, recording=None, timed=False)
    return replace(problem, start=start, field=field, mass_form=form)


def frozen(problem: Problem) -> Problem:
    """The problem with its own function as of now, for all runs to come: none of them traces it again."""
    problem = as_it_stands(problem)
    if not isinstance(problem.field, OwnField):
        return problem
    return replace(problem, field=replace(problem.field, frozen=True))


@once()
def compiled_callback(factory: Factory, dimension: int, parameters: int) -> Callback:
    """The field as ``callback(y, p, out)`` in machine code, of contiguous arrays of float64."""
    return array_function(
        trace(factory, dimension, parameters), {"y": dimension, "p": parameters, "out": dimension}
    )


@once()
def denominators(factory: Factory, dimension: int, parameters: int) -> tuple[Callback, int] | None:
    """The field's divisors as ``callback(y, p, out)``, and their number; None if it has none."""
    lines = trace(factory, dimension, parameters)
    # All that the field computes, without the lines that write its rates.
    computed = [line for line in lines.splitlines() if "%out" not in line]
    divisors = sorted(set(_DIVISION.findall("\n".join(computed))))
    if not divisors:
        return None
    written = []
    for i, name in enumerate(divisors):
        written.append(f"%out{i} = getelementptr double, ptr %out, i64 {i}")
        written.append(f"store double {name}, ptr %out{i}")
    arrays = {"y": dimension, "p": parameters, "out": len(divisors)}
    return array_function("\n".join([*computed, *written]), arrays), len(divisors)


@once()
def c_callback(
    factory: Factory, dimension: int, parameters: int, *, count: bool = False
) -> MachineCode:
    """The field as the C function of `callback.ll`, which counts its calls if it is to."""
    lines = trace(factory, dimension, parameters)
    return compile_file(
        _FOLDER / "callback.ll", lines=lines, parameters=parameters, count=int(count)
    )


@once()
def c_jacobian(factory: Factory, dimension: int, parameters: int) -> MachineCode:
    """The field's Jacobian, column by column, as a C function of the arguments of `callback.ll`.

    An entry that is not finite counts as 0: it steers Newton's iteration alone, whose result the
    method checks, and CyRK's Radau would shorten its steps without end.
    """
    lines = _ENTRY.sub(_FINITE_ENTRY, trace_jacobian(factory, dimension, parameters))
    return compile_file(_FOLDER / "callback.ll", lines=lines, parameters=parameters, count=0)


def array_callback(problem: Problem, backend: Backend, values: Any) -> tuple[Callback, Any]:
    """The field as ``callback(y, p, out)`` of a back end, and the parameters as it wants them, an array or a list."""
    if problem.plain:
        raise ValueError(f"{problem.name}: a function in plain Python has the time: `plain_rates`")
    if backend == "numba":
        return compiled_callback(problem.field, problem.dimension, len(values)), values
    field = plain_field(problem.field)

    def callback(y: np.ndarray, p: Any, out: np.ndarray) -> None:
        out[:] = field(y.tolist(), p)

    return callback, values.tolist() if isinstance(values, np.ndarray) else values


def plain_rates(problem: Problem) -> Callable[[float, np.ndarray], Any]:
    """The user's function as ``rates(t, y)`` of the run's time, as it is, for whoever can call Python."""
    assert isinstance(problem.field, OwnField), "a function of the user's"
    return problem.field.rates(problem.field_parameters)


@once()
@spent_on("import")
def load_heyoka() -> Any:
    """Import heyoka: quiet, and with its cache of compiled code where the user wants it."""
    need("Taylor's method", "heyoka")
    with IMPORTS:
        import heyoka

    # It prints warnings about a cache that it cannot write on standard output, where tables go.
    heyoka.set_logger_level_critical()
    heyoka.llvm_state.set_memcache_limit(_MAX_HEYOKA_MEMORY)
    folder = cache_folder("heyoka")
    if cached_code.check(folder):
        atexit.register(cached_code.note, folder)
        heyoka.llvm_state.set_diskcache_path(str(folder))
        heyoka.llvm_state.set_diskcache_limit(cached_code.MAX_CODE_BYTES)
    else:
        heyoka.llvm_state.set_diskcache_enabled(False)
    return heyoka


def _variables(letter: str, count: int) -> list[Any]:
    """heyoka's variables y00, y01, …, which it sorts by name; of one alone it gives no list."""
    variables = load_heyoka().make_vars(*(f"{letter}{i:02d}" for i in range(count)))
    return list(variables) if count > 1 else [variables]


@once()
def traced_system(factory: Factory, dimension: int, parameters: int) -> list[tuple[Any, Any]]:
    """The field as heyoka expressions ``[(variable, rate), …]`` with p in ``heyoka.par``."""
    heyoka = load_heyoka()
    # Refuses what no field may do, and says where.
    trace(factory, dimension, parameters)
    variables = _variables("y", dimension)
    rates = factory(_heyoka_operations())(variables, [heyoka.par[i] for i in range(parameters)])
    rates = [
        rate if isinstance(rate, heyoka.expression) else heyoka.expression(float(rate))
        for rate in rates
    ]
    return list(zip(variables, rates, strict=True))


@dataclass(frozen=True)
class ParameterPlaces:
    """Places in ``heyoka.par`` of a system in units.

    They are in this order; the last two exist for a `timed` and for a paced system alone::

        | p: parameters | units: variables | offset | pace |

    There is a unit for each variable. The offset is the field's time at heyoka's time 0. The pace is
    the unit of heyoka's time, in the problem's.
    """

    parameters: int  # number of the field's parameters p
    variables: int  # number of heyoka's variables, a time not included
    timed: bool

    @property
    def units(self) -> slice:
        """Places of the units, one per variable."""
        return slice(self.parameters, self.parameters + self.variables)

    @property
    def offset(self) -> int:
        """Place of the offset, if `timed`."""
        return self.parameters + self.variables

    @property
    def pace(self) -> int:
        """Place of the pace, if the system is paced."""
        return self.offset + self.timed


@once()
def system_in_units(
    factory: Factory, dimension: int, parameters: int, *, timed: bool, paced: bool = False
) -> list[tuple[Any, Any]]:
    """As `traced_system`, of ``y[i] / unit[i]``; a field of time gets heyoka's own, which is no variable then.

    `ParameterPlaces` says what ``heyoka.par`` holds.
    """
    heyoka = load_heyoka()
    # Refuses what no field may do, and says where.
    trace(factory, dimension, parameters)
    variable_count = dimension - timed
    places = ParameterPlaces(parameters, variable_count, timed)
    values = _variables("y", variable_count)
    units = [heyoka.par[i] for i in range(places.units.start, places.units.stop)]
    state = [unit * value for unit, value in zip(units, values, strict=True)]
    pace = heyoka.par[places.pace] if paced else None
    if timed:
        time = heyoka.time if pace is None else pace * heyoka.time
        state.append(time + heyoka.par[places.offset])
    rates = factory(_heyoka_operations())(state, [heyoka.par[i] for i in range(parameters)])
    scaled = [rate / unit for rate, unit in zip(rates, units, strict=False)]
    if pace is not None:
        scaled = [pace * rate for rate in scaled]
    return list(zip(values, scaled, strict=True))


@once()
def tangent_system(factory: Factory, dimension: int, parameters: int) -> list[tuple[Any, Any]]:
    """The field as `traced_system`, and a tangent vector v beside it, v' = Jv with the exact Jacobian J."""
    heyoka = load_heyoka()
    system = traced_system(factory, dimension, parameters)
    tensors = heyoka.diff_tensors(
        [rate for _, rate in system], diff_args=[y for y, _ in system], diff_order=1
    )
    tangent = _variables("v", dimension)
    rates = (
        heyoka.sum([entry * v for entry, v in zip(row, tangent, strict=True)])
        for row in tensors.jacobian
    )
    return [*system, *zip(tangent, rates, strict=True)]


@once()
def exact_jacobian(factory: Factory, dimension: int, parameters: int) -> Callable[..., np.ndarray]:
    """The Jacobian ``jacobian(y, p) -> (d, d)`` by automatic differentiation of the traced field."""
    lines = trace_jacobian(factory, dimension, parameters)
    compiled = array_function(lines, {"y": dimension, "p": parameters, "out": dimension**2})

    def jacobian(y: np.ndarray, p: np.ndarray) -> np.ndarray:
        out = np.empty(dimension**2)
        compiled(np.ascontiguousarray(y), p, out)
        # It is written column by column.
        return out.reshape(dimension, dimension).T

    return jacobian


def parameter_array(problem: Problem) -> np.ndarray:
    """Parameters of the explicit form as an array."""
    return np.array(problem.parameters, dtype=float)


@once()
def _heyoka_operations() -> Operations:
    """Operations on heyoka's expressions, and on plain numbers, which heyoka's functions do not take."""
    heyoka = load_heyoka()

    def is_expression(x: Any) -> bool:
        return isinstance(x, heyoka.expression)

    def as_expression(x: Any) -> Any:
        return x if is_expression(x) else heyoka.expression(float(x))

    def function(name: str) -> Callable[[Any], Any]:
        return lambda x: getattr(heyoka if is_expression(x) else math, name)(x)

    exp = function("exp")
    log = function("log")
    zero = heyoka.expression(0.0)

    def where_positive(x: Any, a: Any, b: Any) -> Any:
        if not is_expression(x):
            return a if x > 0 else b
        return heyoka.select(heyoka.gt(x, zero), as_expression(a), as_expression(b))

    def other(name: str, *arguments: Any) -> Any:
        if not any(map(is_expression, arguments)):
            return getattr(math, name)(*arguments)
        # heyoka has no function for these two.
        if name == "expm1":
            return exp(arguments[0]) - 1.0
        if name == "log1p":
            return log(1.0 + arguments[0])
        return getattr(heyoka, name)(*arguments)

    return Operations(
        function("sin"),
        function("cos"),
        function("sqrt"),
        where_positive,
        exp=exp,
        log=log,
        other=other,
    )
