"""Fields in machine code: the same numbers as in plain Python, in any C signature; and what no field may do."""

import ctypes
import math
import pickle
from dataclasses import replace
from functools import cache
from math import inf
from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, given, settings, strategies as st

from oracle.accepting import accepting
from oracle.runs import Run, runs
from polhode.models.problem import Problem
from polhode.solvers import compile as compilation
from polhode.solvers.catalogue import solver
from polhode.solvers.compile import c_callback, compiled_callback, plain_field
from polhode.solvers.contract import Settings
from polhode.solvers.cyrk import Call, method_number
from polhode.solvers.machine_code.array_function import array_function
from polhode.solvers.machine_code.llvm import MachineCode, compile_file
from polhode.solvers.machine_code.tracing import FieldError, trace
from polhode.solvers.solve import solve

FORMS = {run.form: run for run in runs()}
FINITE = st.floats(-1e6, 1e6, allow_subnormal=False)
EXAMPLES = settings(max_examples=100, deadline=None, derandomize=True)


@cache
def strict(factory, dimension: int, parameters: int):
    """The field as ``callback(y, p, out)`` without contraction: every operation rounds as Python's does."""
    lines = trace(factory, dimension, parameters).replace(" contract", "")
    return array_function(lines, {"y": dimension, "p": parameters, "out": dimension})


def alone(lines: str) -> MachineCode:
    """The C callback of traced lines."""
    return compile_file(
        Path(compilation.__file__).with_name("callback.ll"), lines=lines, parameters=0, count=0
    )


def called(code: MachineCode):
    return code.function(
        ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_double, ctypes.c_void_p, ctypes.c_void_p)
    )


def in_python(factory, y, p) -> np.ndarray:
    """The rates over floats; what Python answers by an exception is no example."""
    try:
        return np.array(plain_field(factory)(list(y), list(p)), dtype=float)
    except (ArithmeticError, ValueError):
        assume(False)
        raise


def evaluated(function, y, p, size: int) -> np.ndarray:
    out = np.empty(size)
    function(np.array(y, dtype=float), np.array(p, dtype=float), out)
    return out


@pytest.mark.parametrize("name", FORMS)
@EXAMPLES
@given(data=st.data())
def test_every_operation_of_a_form_is_that_of_python(name: str, data):
    """Bit for bit, at states and parameters of any size."""
    problem = FORMS[name].problem
    d, n = problem.dimension, len(problem.parameters)
    # Series with coefficients by the hundred keep theirs.
    p = data.draw(st.lists(FINITE, min_size=n, max_size=n)) if n < 50 else problem.parameters
    y = data.draw(st.lists(FINITE, min_size=d, max_size=d))
    expected = in_python(problem.field, y, p)
    assert np.array_equal(evaluated(strict(problem.field, d, n), y, p, d), expected, equal_nan=True)


@pytest.mark.parametrize("name", FORMS)
def test_contraction_changes_the_last_bits_alone(name: str):
    problem = FORMS[name].problem
    d, n = problem.dimension, len(problem.parameters)
    rng = np.random.default_rng(3)
    for y in np.array(problem.start) * (1 + 0.02 * rng.standard_normal((20, d))):
        expected = in_python(problem.field, y.tolist(), problem.parameters)
        got = evaluated(compiled_callback(problem.field, d, n), y, problem.parameters, d)
        assert got == pytest.approx(expected, rel=1e-13, abs=1e-14 * np.abs(expected).max())


def every_operation(ops):
    sin, cos, sqrt, where_positive = ops.sin, ops.cos, ops.sqrt, ops.where_positive

    def rhs(y, p):
        a, b, c = y
        return (
            -a + b * 2 - 3 / c + (+b) - (1 - a) / 7,
            where_positive(a, sin(b), cos(c))
            + where_positive(1.0, a, b)
            + where_positive(-a * b, 0.25, sqrt(c * c)),
            a**2 + 2 * b**0 + np.float64(0.1) * c + sqrt(2.0) + sin(True * a) - p[0],
        )

    return rhs


@EXAMPLES
@given(y=st.tuples(FINITE, FINITE, FINITE), p=FINITE)
def test_every_operation_is_that_of_python(y, p):
    expected = in_python(every_operation, y, (p,))
    assert np.array_equal(evaluated(strict(every_operation, 3, 1), y, (p,), 3), expected)


EXPONENTS = (-16, -3, -1, 0, 1, 2, 3.0, 7, 16, 0.5, 1.5, 17, -2.25)


def powers(ops):
    def rhs(y, p):
        return (*(y[0] ** exponent for exponent in EXPONENTS), y[0] ** y[1], 1.7 ** y[1])

    return rhs


@EXAMPLES
@given(base=st.floats(1e-6, 1e6), exponent=st.floats(-20, 20))
def test_powers_are_those_of_python(base: float, exponent: float):
    d = len(EXPONENTS) + 2
    y = [base, exponent] + [0.0] * (d - 2)
    assert evaluated(compiled_callback(powers, d, 0), y, (), d) == pytest.approx(
        in_python(powers, y, ()), rel=1e-14
    )


def constant(ops):
    return lambda y, p: (1.5, 0.0 * y[1], -inf)


def test_constants_and_special_values():
    assert evaluated(compiled_callback(constant, 3, 0), (1, inf, 2), (), 3) == pytest.approx(
        (1.5, math.nan, -inf), nan_ok=True
    )


def repeating(ops):
    sin = ops.sin
    return lambda y, p: (sin(y[0] * p[0]) + sin(y[0] * p[0]) * sin(y[0] * p[0]),)


def test_equal_lines_are_written_once():
    assert trace(repeating, 1, 1).count("@llvm.sin") == 1


def comparing(ops):
    def rhs(y, p):
        return (y[0] if y[0] > 0 else -y[0],)

    return rhs


def branching(ops):
    def rhs(y, p):
        return (y[0] if y[0] else 1.0,)

    return rhs


def with_math(ops):
    def rhs(y, p):
        return (math.sin(y[0]),)

    return rhs


def with_numpy(ops):
    def rhs(y, p):
        return (np.sin(y[0]),)

    return rhs


def with_remainder(ops):
    def rhs(y, p):
        return (y[0] % 2.0,)

    return rhs


def with_inner(ops):
    def inner(x):
        return abs(x)

    return lambda y, p: (inner(y[0]),)


def beyond(ops):
    def rhs(y, p):
        return (p[3] * y[0],)

    return rhs


def unknown_power(ops):
    def rhs(y, p):
        return (y[0] ** "2",)

    return rhs


def unknown_operation(ops):
    tan = ops.tan
    return lambda y, p: (tan(y[0]),)


@pytest.mark.parametrize(
    ("factory", "line", "message"),
    [
        (unknown_operation, 1, "'Operations' object has no attribute 'tan': tan = ops.tan"),
        (
            comparing,
            2,
            r"a field cannot compare .*ops.where_positive.*: return \(y\[0\] if y\[0\] > 0 else -y\[0\],\)",
        ),
        (branching, 2, "a field cannot compare or branch; use ops.where_positive"),
        (with_math, 2, r"a field cannot use .*use ops.sin.*: return \(math.sin\(y\[0\]\),\)"),
        (with_numpy, 2, "a field cannot use this function; use those of ops"),
        (with_remainder, 2, "unsupported operand"),
        (with_inner, 2, "a field cannot use this function"),
        (beyond, 2, "index out of range"),
        (unknown_power, 2, "pow: got '2', expected a number"),
        (lambda ops: lambda y, p: (1.0, 2.0), 0, "got 2 rates, expected a tuple of 1"),
        (lambda ops: lambda y, p: 2 * y[0], 0, "got 'Number', expected a tuple of 1"),
        (lambda ops: lambda y, p: None, 0, "got 'NoneType', expected a tuple of 1"),
        (lambda ops: lambda y, p: ("1",), 0, "got the rate '1', expected a number"),
        (lambda ops: lambda t, y, p: (1.0,), 0, r"got rhs\(t, y, p\), expected rhs\(y, p\)"),
        (lambda ops: lambda t, y: (1.0,), 0, r"got rhs\(t, y\), expected rhs\(y, p\)"),
        (lambda ops: lambda y: (1.0,), 0, r"got rhs\(y\), expected rhs\(y, p\)"),
    ],
)
def test_what_no_field_may_do_is_refused_with_its_line(factory, line: int, message: str):
    where = rf"test_machine_code.py:{factory.__code__.co_firstlineno + line}: .*{message}"
    with pytest.raises(FieldError, match=where) as refusal:
        trace(factory, 1, 2)
    assert "\n" not in str(refusal.value)


COMPARING = Problem("comparing", comparing, (1.0,), 1.0)


@pytest.mark.parametrize("name", accepting(COMPARING))
def test_every_solver_refuses_it(name: str):
    with pytest.raises(ValueError, match=r"test_machine_code.py:\d+: .*where_positive"):
        solve(COMPARING, name, 1e-6)


def test_an_array_function_refuses_other_arrays():
    problem = Run("triaxial", "quaternion").problem
    y, p, out = np.array(problem.start), np.array(problem.parameters), np.empty(7)
    function = compiled_callback(problem.field, 7, len(p))
    function(pickle.loads(pickle.dumps(y)), p, out)
    read_only = out.copy()
    read_only.flags.writeable = False
    function(read_only, p, out)
    others = (
        1.0,
        None,
        y.tolist(),
        y[None],
        y[:-1],
        np.repeat(y, 2)[::2],
        y.astype("f4"),
        y.astype(">f8"),
        np.array(1.0),
    )
    for arguments in (
        (),
        (y, p),
        (y, p, out, out),
        (y, p, read_only),
        *((other, p, out) for other in others),
    ):
        with pytest.raises(TypeError, match="contiguous arrays of float64"):
            function(*arguments)


def test_the_mass_form_is_the_field_times_its_masses():
    problem = Run("triaxial", "quaternion").problem
    y, p, n = np.array(problem.start), np.array(problem.parameters), len(problem.parameters)
    slope, mass, out = np.arange(7.0), np.arange(1.0, 8.0), np.empty(7)
    sizes = {"y": 7, "slope": 7, "mass": 7, "p": n, "out": 7}
    array_function(trace(problem.field, 7, n, mass=True), sizes)(y, slope, mass, p, out)
    rates = in_python(problem.field, y.tolist(), p.tolist())
    assert out == pytest.approx(mass * slope - rates, rel=1e-14)


@pytest.mark.parametrize(("count", "expected"), [(False, 0), (True, 3)])
def test_a_callback_counts_where_it_is_asked_to(count: bool, expected: int):
    calls = np.zeros(1, dtype=np.int64)
    y, out, p = (
        np.array([0.3]),
        np.empty(1),
        np.append(2.0, np.array([calls.ctypes.data]).view(float)),
    )
    for _ in range(3):
        called(c_callback(repeating, 1, 1, count=count))(
            out.ctypes.data, 0.0, y.ctypes.data, p.ctypes.data
        )
    assert calls[0] == expected
    assert out[0] == pytest.approx(math.sin(0.6) + math.sin(0.6) ** 2, rel=1e-15)


@pytest.mark.parametrize("name", ["cyrk-vern8", "cyrk-radau"])
def test_a_run_is_that_of_the_field_in_python(name: str):
    """Bit for bit where nothing is contracted, to the tolerance where it is: steps follow the last bits."""
    problem, times = Run("triaxial", "quaternion").problem, np.linspace(0.0, 40.0, 9)
    d, p = problem.dimension, np.array(problem.parameters)
    field = plain_field(problem.field)

    @ctypes.CFUNCTYPE(
        None,
        ctypes.POINTER(ctypes.c_double),
        ctypes.c_double,
        ctypes.POINTER(ctypes.c_double),
        ctypes.c_void_p,
    )
    def in_python(out, t, y, parameters) -> None:
        for i, rate in enumerate(field(y[:d], problem.parameters)):
            out[i] = rate

    def run(code: MachineCode) -> np.ndarray:
        call = Call(code, method_number(solver(name).method), p, Settings(1e-8, "compiled"))
        result = call(0.0, times[-1], np.array(problem.start), times[1:], 10**6)
        rows = call.library.c_get_y_ptr(result)[: d * (len(times) - 1)]
        call.library.c_free(result)
        return np.array(rows)

    uncontracted = alone(trace(problem.field, d, len(p)).replace(" contract", ""))
    expected = run(MachineCode(ctypes.cast(in_python, ctypes.c_void_p).value or 0, in_python))
    assert np.array_equal(run(uncontracted), expected)
    assert run(c_callback(problem.field, d, len(p))) == pytest.approx(expected, abs=1e-8)


def test_numbers_next_to_zero_do_not_stall_a_run():
    """What has died out of a motion makes steps a hundred times longer; after the run arithmetic is as ever."""
    usual = replace(Run("triaxial", "quaternion").problem, invariant=None)
    settled = replace(usual, start=(0.8, 1e-310, 1e-311, 0.6, 1e-312, 1e-311, -0.5))
    paces = []
    for problem in (usual, settled):
        runs = [solve(problem, "cyrk-vern8", 1e-9) for _ in range(5)]
        paces.append(min(run.seconds for run in runs) / runs[0].work.steps)
    assert paces[1] < 5 * paces[0]
    assert 1e-300 * 1e-10 > 0.0
