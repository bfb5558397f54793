"""One vector field, many kinds of numbers: floats, arrays, mpmath's, LLVM's and heyoka's give the same rates."""

import mpmath
import numpy as np
import pytest

from polhode.models.catalogue import FORMS, form
from polhode.models.operations import ARRAYS, FLOAT, Operations
from polhode.models.scene import BodyStart, EulerStart, Scene
from polhode.models.shape import Ellipsoid
from polhode.models.theory.spheroid_correction import CorrectedSpheroid
from polhode.solvers.compile import compiled_callback, traced_system

MPMATH = Operations(
    mpmath.sin,
    mpmath.cos,
    mpmath.sqrt,
    lambda x, a, b: a if x > 0 else b,
    exp=mpmath.exp,
    log=mpmath.log,
)


def problem_of(name):
    """A problem of the form whose fields have no zero entries."""
    start = EulerStart((1.0, 0.5, 0.3), (1.0, 1.0, -1.0))
    for axes in ((1.0, 0.8, 0.5), (1.0, 1.0, 0.6)):
        for stokes in (3.0, 1e3, 0.0, np.inf):
            for candidate in (start, BodyStart((1.0, 0.0, 0.0, 0.2), (0.0, 0.0, -1.0))):
                try:
                    return form(name).problem(Scene(Ellipsoid(axes), stokes, candidate, 1.0))
                except ValueError:
                    continue
    raise AssertionError(name)


def problems():
    aligned = BodyStart((1.0, 0.0, 0.0, 0.2), (0.0, 0.0, -1.0))
    yield "corrected", CorrectedSpheroid().problem(Scene(Ellipsoid((1, 1, 2)), 9.0, aligned, 1.0))
    for name in FORMS:
        yield name, problem_of(name)


CASES = [pytest.param(problem, id=name) for name, problem in problems()]


@pytest.mark.parametrize("problem", CASES)
def test_every_kind_of_number_gives_the_same_rates(problem):
    import heyoka

    rng = np.random.default_rng(7)
    states = np.array(problem.start) * (1 + 0.02 * rng.standard_normal((8, problem.dimension)))
    parameters = np.array(problem.parameters)
    plain = np.array(
        [problem.field(FLOAT)(state.tolist(), parameters.tolist()) for state in states]
    )
    assert plain.shape == states.shape
    scale = np.max(np.abs(plain), axis=0) + 1e-3 * np.max(np.abs(plain))

    arrays = problem.field(ARRAYS)(states.T, parameters)
    assert np.all(
        np.abs(np.array([np.broadcast_to(row, 8) for row in arrays]).T - plain) < 1e-14 * scale
    )

    compiled = compiled_callback(problem.field, problem.dimension, len(parameters))
    out = np.empty(problem.dimension)
    for state, rates in zip(states, plain, strict=True):
        compiled(state, parameters, out)
        assert np.all(np.abs(out - rates) < 1e-13 * scale)

    system = traced_system(problem.field, problem.dimension, len(parameters))
    function = heyoka.cfunc(
        [rate for _, rate in system], [variable for variable, _ in system], compact_mode=True
    )
    for state, rates in zip(states, plain, strict=True):
        assert np.all(np.abs(function(state, pars=parameters) - rates) < 1e-13 * scale)

    with mpmath.workdps(40):
        for state, rates in zip(states, plain, strict=True):
            precise = problem.field(MPMATH)(
                [mpmath.mpf(y) for y in state], [mpmath.mpf(p) for p in parameters]
            )
            assert all(isinstance(rate, mpmath.mpf) for rate in precise)
            assert np.all(np.abs([float(rate) for rate in precise] - rates) < 1e-12 * scale)
