"""Programs in machine code: loops, branches and calls do what the same lines do in Python."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from polhode.solvers.machine_code.program import WIDE, Program, Same, compare, compiled, width
from polhode.solvers.machine_code.tracing import OPERATIONS


def newton() -> Program:
    """Square root of x by Newton's method, inside others."""
    program = Program("newton", "out", "x", "internal", "noinline")
    out, x = program.arguments
    root = program.cell(x)
    with program.repeat() as leave:
        better = 0.5 * (root[0] + x / root[0])
        leave(compare("oge", better, root[0]))
        root[0] = better
    out[0] = root[0]
    return program


@pytest.fixture(scope="module")
def rooted():
    """Sums of roots of the entries above a threshold, one for each row; entries by a computed index."""
    root = newton()
    program = Program("rooted", "sizes rows sums")
    sizes, rows, sums = program.arguments
    n, m, threshold = sizes.load(3)
    with program.times(n) as i:
        total, at = program.cell(0.0), program.room()
        with program.times(m) as j:
            entry = rows[i * m + j]
            with program.when(compare("ogt", entry, threshold)):
                program.call(root, at, entry + 1.0)
                total[0] = total[0] + at[0] + OPERATIONS.expm1(0.0 * entry)
        sums[i] = total[0]
    return compiled(root, program)[0]


@settings(max_examples=50, deadline=None, derandomize=True)
@given(
    n=st.integers(0, 4),
    m=st.integers(0, 5),
    seed=st.integers(0, 2**32 - 1),
    threshold=st.floats(0.0, 10.0),
)
def test_loops_and_branches(rooted, n: int, m: int, seed: int, threshold: float):
    rows, sums = np.random.default_rng(seed).uniform(0.0, 10.0, (n, m)), np.full(n + 1, -1.0)
    rooted(np.array([n, m, threshold]), rows, sums)
    expected = np.sum(np.where(rows > threshold, np.sqrt(rows + 1.0), 0.0), axis=1)
    assert sums[:n] == pytest.approx(expected, rel=1e-14)
    assert sums[n] == -1.0


@pytest.mark.parametrize(("how", "expected"), [("olt", 0.0), ("uge", 1.0)])
def test_what_nan_fulfils(how: str, expected: float):
    program = Program("asks", "x out")
    x, out = program.arguments
    out[0] = 0.0
    with program.when(compare(how, x[0], 1.0)):
        out[0] = 1.0
    (function,) = compiled(program)
    answer = np.empty(1)
    function(np.array([np.nan]), answer)
    assert answer[0] == expected


def test_equal_lines_of_a_block_are_one():
    """Loads and stores are not: memory changes between them."""
    program = Program("twice", "x")
    (x,) = program.arguments
    y = x[0]
    first, second = y + 1.0, y + 1.0
    assert first.name == second.name
    x[0] = first
    assert x[0].name != y.name


def test_lanes_beside_each_other():
    """A number of each lane, and one for all of them."""
    program = Program("wide", "x factors out")
    x, factors, out = program.arguments
    y = program.room(2, width())
    entries = y.of(1)
    lanes = float(width())
    with program.times(lanes) as k:
        entries[k] = x[k]
    y[1] = WIDE.expm1(Same(factors, width())[1] * y[0])
    with program.times(2 * lanes) as k:
        out[k] = entries[k]
    (function,) = compiled(program)
    given, answer = np.linspace(-60.0, 60.0, width()), np.empty((2, width()))
    function(given, np.array([0.0, 0.7]), answer)
    assert answer[0].tolist() == given.tolist()
    assert answer[1] == pytest.approx(np.expm1(0.7 * given), rel=2e-14)
    for factor in (1e-3, 1e-9):
        function(given, np.array([0.0, factor]), answer)
        assert answer[1] == pytest.approx(np.expm1(factor * given), rel=1e-15)
    function(np.full_like(given, np.nan), np.array([0.0, 1.0]), answer)
    assert np.isnan(answer).all()
