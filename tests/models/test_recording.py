"""Functions recorded by NumPy's protocols compute what they do; what cannot be recorded is named with its line."""

import math

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.sparse import csr_matrix
from scipy.special import j0

from polhode import Problem
from polhode.models.operations import ARRAYS
from polhode.models.recording import UntraceableError, record
from polhode.solvers.compile import compiled_callback, exact_jacobian, traced_system

A = np.array([[1.0, 0.0], [2.0, 3.0]])
SPARSE = csr_matrix(A)
TABLE = np.linspace(0, 10, 11)
SPLINE = CubicSpline(TABLE, TABLE)


def assigned(t, y):
    rates = np.zeros_like(y)
    rates[0] = y[1]
    rates[1] -= 2 * y[0]
    return rates


def in_place(t, y):
    rates = -y.copy()
    rates *= t
    return np.multiply(rates, 2, out=np.empty_like(y))


RECORDED = [
    lambda t, y: np.tanh(y) * t,
    lambda t, y: [np.sinh(y[0]), np.cosh(y[1])],
    lambda t, y: [np.arctan2(y[0], 2.0), np.hypot(*y)],
    lambda t, y: [np.arcsin(0.4 * y[0]), np.arccos(0.4 * y[1])],
    lambda t, y: [np.arctan(y[0]), np.arcsinh(y[1])],
    lambda t, y: [np.arccosh(3.5 + y[0]), np.arctanh(0.4 * y[1])],
    lambda t, y: [np.expm1(y[0]), np.log1p(3 + y[1])],
    lambda t, y: [np.exp2(y[0]), np.log2(3 + y[1]) + np.log10(3 + y[0])],
    lambda t, y: [np.cbrt(y[0]), np.square(y[1]) + np.reciprocal(y[1])],
    lambda t, y: [np.power(np.abs(y[0]), 1.5), 2.0 ** y[1]],
    lambda t, y: [np.tan(y[0]), np.logaddexp(*y)],
    lambda t, y: [abs(y[0]), np.fabs(y[1])],
    lambda t, y: np.sign(y) * np.heaviside(y, 0.5),
    lambda t, y: np.where(y > 0.5, y, -y),
    lambda t, y: [np.where(y[0] > 0.5, 1.0, -1.0) * y[1], (y[0] <= 0.5) * y[1]],
    lambda t, y: np.where((y > 0.0) & (t < 3) | ~(y > -1), y, 0 * y),
    lambda t, y: [np.where(y[0] != 0, 1.0, 2.0), np.where(y[0] == y[0], y[1], 2.0)],
    lambda t, y: np.clip(y, 0, 0.5) + np.minimum(y, 0.2),
    lambda t, y: [np.max(y), y.min()],
    lambda t, y: [y.sum() + np.sum(y**2), y.mean() + np.mean(y)],
    lambda t, y: -y / np.linalg.norm(y) ** 3,
    lambda t, y: A @ y + np.dot(A, y) + A.dot(y) + y.dot(A) + np.einsum("ij,j->i", A, y),
    lambda t, y: (np.stack([A, 2 * A]) @ np.stack([y, 3 * y])[:, :, None])[1, :, 0],
    lambda t, y: np.concatenate([y[1:], [y[0]]]) + np.hstack((y[1], y[0])) + np.roll(y, 1),
    lambda t, y: np.append(np.diff(y), np.cumsum(y)[0]),
    lambda t, y: np.exp(np.array([y[1], -np.sin(y[0])])) + np.asarray(y),
    lambda t, y: [np.float64(2) * y[0], y[1] / np.float64(3)],
    lambda t, y: np.arange(2) * y[0] + np.cross([1, 2, 3.0], [y[0], y[1], 0.0])[:2],
    assigned,
    in_place,
]


@pytest.mark.parametrize("f", RECORDED)
def test_a_recording_computes_what_the_function_does(f):
    recording = record(f, 2, 0)
    for state in np.random.default_rng(1).uniform(-2, 2, (20, 2)):
        rates = recording.evaluate(ARRAYS, state, (), np.float64(0.3))
        expected = np.asarray(f(0.3, state), dtype=float)
        np.testing.assert_allclose(np.array(rates, dtype=float), expected, rtol=1e-12, atol=1e-14)


@pytest.mark.parametrize("f", RECORDED)
def test_so_do_machine_code_its_derivatives_and_heyoka(f):
    problem = Problem.from_function(f, [0.6, 0.3], 1.0)
    d = problem.dimension
    state = np.array([0.7, 0.4, 0.25])[:d]
    time = state[2] if d == 3 else 0.0
    out, parameters = np.empty(d), np.empty(0)
    compiled_callback(problem.field, d, 0)(state, parameters, out)
    np.testing.assert_allclose(out[:2], np.asarray(f(time, state[:2])), rtol=1e-12, atol=1e-14)
    jacobian = exact_jacobian(problem.field, d, 0)(state, parameters)
    for j in range(2):
        step = np.where(np.arange(2) == j, 1e-6, 0.0)
        above, below = (np.asarray(f(time, state[:2] + s * step)) for s in (1, -1))
        np.testing.assert_allclose(jacobian[:2, j], (above - below) / 2e-6, rtol=1e-6, atol=1e-7)
    import heyoka

    system = traced_system(problem.field, d, 0)
    evaluate = heyoka.cfunc([rate for _, rate in system], [y for y, _ in system])
    np.testing.assert_allclose(evaluate(state), out, rtol=1e-12, atol=1e-14)


def branching(t, y):
    if y[0] > 0:
        return [1.0, y[0]]
    return [0.0, y[1]]


def swallowed(t, y):
    try:
        return [math.sin(y[0]), y[1]]
    except TypeError:
        return [y[0], y[1]]


def into_floats(t, y):
    rates = np.zeros(2)
    rates[0] = y[1]
    return rates


@pytest.mark.parametrize(
    ("f", "words"),
    [
        (lambda t, y: [np.interp(t, TABLE, TABLE), y[0]], r"np.interp\(t, TABLE, TABLE\) "),
        (lambda t, y: [SPLINE(t), y[0]], r"SPLINE\(t\) "),
        (lambda t, y: SPARSE @ y, "SPARSE @ y "),
        (lambda t, y: j0(y), r"j0\(y\) cannot be compiled"),
        (lambda t, y: np.linalg.solve(A, y), r"np.linalg.solve\(A, y\) "),
        (lambda t, y: [math.sin(y[0]), 0.0], r"math.sin\(y\[0\]\) needs plain numbers"),
        (lambda t, y: [max(y[0], 0.0), 0.0], r"max\(y\[0\], 0.0\) branches on the state"),
        (lambda t, y: [y[0] % 2, 0.0], r"y\[0\] % 2 "),
        (lambda t, y: [(1j * y[0]).real, 0.0], r"1j \* y\[0\] is complex"),
        (branching, r"y\[0\] > 0 branches on the state"),
        (into_floats, r"rates\[0\] needs plain numbers"),
        (swallowed, "swallowed needs plain numbers"),
        (lambda t, y: [y[0]], ".*returns 1 rates of 2"),
    ],
)
def test_what_cannot_be_recorded_is_named_with_its_line(f, words):
    with pytest.raises(UntraceableError, match="^" + words) as caught:
        record(f, 2, 0)
    text = str(caught.value)
    assert "\n" not in text
    assert "site-packages" not in text
    assert "dtype" not in text
    if f is not swallowed and "returns" not in words:
        assert "test_recording.py:" in text
