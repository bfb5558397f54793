"""Compilation of vector fields: one field, written once, made into what each library calls.

Every function here keeps what it compiled, under the field's factory, for the life of the process.
"""

import os
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from polhode.models.operations import FLOAT, Field, Operations
from polhode.models.problem import Problem
from polhode.solvers.contract import Backend

FieldFactory = Callable[[Operations], Field]
Callback = Callable[[np.ndarray, Any, np.ndarray], None]

# Environment variable that names the folder for caches.
CACHE_VARIABLE = "POLHODE_CACHE"


def cache_folder(library: str = "") -> Path:
    """Folder of polhode's caches, or a library's: ``$POLHODE_CACHE``, else in ``$XDG_CACHE_HOME`` or ``~/.cache``."""
    own = os.environ.get(CACHE_VARIABLE)
    if own:
        return Path(own, library).absolute()
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache", library or "polhode")


@cache
def plain_field(factory: FieldFactory) -> Field:
    """The field in plain Python, over floats."""
    return factory(FLOAT)


@cache
def numba_callback(factory: FieldFactory, dimension: int) -> Callback:
    """The field as ``callback(y, p, out)``, compiled by numba; read-only arrays serve for y and p."""
    import numba

    inner = _numba_field(factory)
    vector = numba.types.Array(numba.float64, 1, "C", readonly=True)
    signature = numba.void(vector, vector, numba.float64[::1])

    @numba.njit(signature, **_FAST)
    def callback(y: Any, p: Any, out: Any) -> None:
        rates = inner(y, p)
        for i in range(dimension):
            out[i] = rates[i]

    return callback


@cache
def numba_residual(factory: FieldFactory, dimension: int) -> Callable[..., None]:
    """The mass form as ``residual(y, rates, mass, p, out)``: out = mass * rates - field(y, p)."""
    import numba

    inner = _numba_field(factory)
    vector = numba.types.Array(numba.float64, 1, "C", readonly=True)

    @numba.njit(numba.void(vector, vector, vector, vector, numba.float64[::1]), **_FAST)
    def residual(y: Any, rates: Any, mass: Any, p: Any, out: Any) -> None:
        driven = inner(y, p)
        for i in range(dimension):
            out[i] = mass[i] * rates[i] - driven[i]

    return residual


def array_callback(problem: Problem, backend: Backend, values: np.ndarray) -> tuple[Callback, Any]:
    """The field as ``callback(y, p, out)`` of a back end, and the parameters as it wants them."""
    if backend == "numba":
        return numba_callback(problem.field, problem.dimension), values
    field = plain_field(problem.field)

    def callback(y: np.ndarray, p: Any, out: np.ndarray) -> None:
        out[:] = field(y.tolist(), p)

    return callback, values.tolist()


def array_residual(problem: Problem, backend: Backend, values: np.ndarray) -> tuple[Callable[..., None], Callback, Any]:
    """The mass form as ``residual(y, rates, mass, p, out)``, the field as ``callback(y, p, out)``, and p."""
    callback, parameters = array_callback(problem, backend, values)
    if backend == "numba":
        return numba_residual(problem.field, problem.dimension), callback, parameters

    def residual(y: np.ndarray, rates: np.ndarray, mass: np.ndarray, p: Any, out: np.ndarray) -> None:
        callback(y, p, out)
        np.subtract(mass * rates, out, out=out)

    return residual, callback, parameters


@cache
def c_callback(factory: FieldFactory, dimension: int, parameters: int) -> Any:
    """The field as a numba ``cfunc`` of signature ``void(double *dy, double t, double *y, double *p)``."""
    import numba
    from numba.np.numpy_support import carray

    inner = _numba_field(factory)
    pointer = numba.types.CPointer(numba.float64)

    @numba.cfunc(numba.void(pointer, numba.float64, pointer, pointer), **_FAST)
    def callback(dy: Any, t: float, y: Any, p: Any) -> None:
        rates = inner(carray(y, dimension), carray(p, parameters))
        for i in range(dimension):
            dy[i] = rates[i]

    return callback


@cache
def counting_c_callback(factory: FieldFactory, dimension: int, parameters: int) -> Any:
    """`c_callback` that counts its calls: behind the parameters stands the address of an integer, as eight bytes."""
    import numba
    from numba.extending import intrinsic
    from numba.np.numpy_support import carray

    inner = _numba_field(factory)
    pointer, counter = numba.types.CPointer(numba.float64), numba.types.CPointer(numba.int64)

    @intrinsic
    def pointer_to(context: Any, address: Any) -> Any:
        def generate(target: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            return builder.inttoptr(arguments[0], target.get_value_type(signature.return_type))

        return counter(numba.int64), generate

    @numba.cfunc(numba.void(pointer, numba.float64, pointer, pointer), **_FAST)
    def callback(dy: Any, t: float, y: Any, p: Any) -> None:
        calls = pointer_to(carray(p, parameters + 1).view(np.int64)[parameters])  # pyright: ignore[reportCallIssue]
        calls[0] += 1
        rates = inner(carray(y, dimension), carray(p, parameters))
        for i in range(dimension):
            dy[i] = rates[i]

    return callback


@cache
def load_heyoka() -> Any:
    """Import heyoka: quiet, and with its cache where the user wants it.

    heyoka keeps compiled code on disk (`cache_folder`). It prints warnings about a cache that it cannot write on
    standard output, where tables go; hence the logger level.
    """
    import heyoka

    heyoka.set_logger_level_critical()
    heyoka.llvm_state.set_diskcache_path(str(cache_folder("heyoka")))
    return heyoka


@cache
def traced_system(factory: FieldFactory, dimension: int, parameters: int) -> list[tuple[Any, Any]]:
    """The field as heyoka expressions ``[(variable, rate), …]`` with p in ``heyoka.par``."""
    heyoka = load_heyoka()
    names = heyoka.make_vars(*(f"y{i:02d}" for i in range(dimension)))
    variables = list(names) if dimension > 1 else [names]
    rates = factory(_heyoka_operations())(variables, [heyoka.par[i] for i in range(parameters)])
    rates = [rate if isinstance(rate, heyoka.expression) else heyoka.expression(float(rate)) for rate in rates]
    return list(zip(variables, rates, strict=True))


@cache
def exact_jacobian(factory: FieldFactory, dimension: int, parameters: int) -> Callable[..., np.ndarray]:
    """The Jacobian ``jacobian(y, p) -> (d, d)`` by automatic differentiation of the traced field."""
    heyoka = load_heyoka()
    system = traced_system(factory, dimension, parameters)
    variables = [variable for variable, _ in system]
    tensors = heyoka.diff_tensors([rate for _, rate in system], diff_args=variables, diff_order=1)
    compiled = heyoka.cfunc(list(tensors.jacobian.ravel()), variables, compact_mode=False)
    shape = (dimension, dimension)

    def jacobian(y: np.ndarray, p: np.ndarray) -> np.ndarray:
        return compiled(np.ascontiguousarray(y), pars=p).reshape(shape)

    if parameters == 0:
        return lambda y, p: compiled(np.ascontiguousarray(y)).reshape(shape)
    return jacobian


def parameter_array(problem: Problem) -> np.ndarray:
    """Parameters of the explicit form as an array."""
    return np.array(problem.parameters, dtype=float)


# Only contraction of a*b + c is allowed: it changes the last bit, never the meaning.
_FAST: dict[str, Any] = {"error_model": "numpy", "fastmath": {"contract"}}


@cache
def _numba_field(factory: FieldFactory) -> Field:
    import math

    import numba

    where_positive = numba.njit(lambda x, a, b: a if x > 0 else b)
    compiled = numba.njit(**_FAST)
    return compiled(factory(Operations(math.sin, math.cos, math.sqrt, where_positive, compiled)))


@cache
def _heyoka_operations() -> Operations:
    heyoka = load_heyoka()
    return Operations(
        heyoka.sin,
        heyoka.cos,
        heyoka.sqrt,
        lambda x, a, b: heyoka.select(heyoka.gt(x, heyoka.expression(0.0)), a, b),
    )
