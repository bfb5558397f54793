"""Inertia and resistance against 30-digit quadrature, down to thin shapes and next to symmetric ones."""

from functools import cache

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.special import elliprd

from polhode.models.shape import Ellipsoid, carlson_rd

SHAPES = [
    (1.0, 0.8, 0.5),
    (0.3, 1.0, 0.7),
    (1.0, 1.0, 1.0),
    (1.0, 1.0, 1e-3),
    (1e-3, 1e-3, 1.0),
    (1.0, 0.03, 1e-3),
    (1e-3, 1.0, 0.5),
    (1.0, 1 - 1e-9, 1 + 1e-9),
    (1.0, 1.0, 1 + 1e-9),
    (1.0, 1.0, 1 - 1e-9),
    (1.0, 1 - 1e-9, 0.5),
    (0.2, 0.2 * (1 + 1e-9), 1.0),
    (3.0, 2.0, 1.0),
]


@cache
def quadrature(axes):
    """Inertia and resistance (`gove`) in 30 digits, the β_i by their defining integrals in the logarithm of t."""
    with mpmath.workdps(30):
        exact = [mpmath.mpf(length) for length in axes]
        longest = max(exact)
        squares = [(length / longest) ** 2 for length in exact]
        volume = mpmath.sqrt(squares[0] * squares[1] * squares[2])

        def beta(i):
            def integrand(u):
                t = mpmath.exp(u)
                root = mpmath.sqrt((squares[0] + t) * (squares[1] + t) * (squares[2] + t))
                return volume * t / ((squares[i] + t) * root)

            knots = sorted({mpmath.log(square) for square in squares})
            return mpmath.quad(integrand, [-mpmath.inf, *knots, mpmath.inf])

        betas = [beta(i) for i in range(3)]
        inertia, resistance = [], []
        for j, k in ((1, 2), (2, 0), (0, 1)):
            both = squares[j] + squares[k]
            inertia.append(4 * mpmath.pi / 15 * volume * both)
            resistance.append(
                2 * volume * both / (3 * (squares[j] * betas[j] + squares[k] * betas[k]))
            )
        return inertia, resistance


@pytest.mark.parametrize("axes", SHAPES)
def test_inertia_and_resistance_to_thirteen_digits(axes):
    inertia, resistance = quadrature(axes)
    ellipsoid = Ellipsoid(axes)
    for ours, precise in zip(
        ellipsoid.inertia + ellipsoid.resistance, inertia + resistance, strict=True
    ):
        assert abs(ours / precise - 1) < 1e-13


def test_thirty_digits_are_thirty_digits():
    """The sphere and the prolate spheroid in elementary functions, so that the quadrature itself is checked."""
    _, sphere = quadrature((1.0, 1.0, 1.0))
    assert all(abs(x - 1) < 1e-25 for x in sphere)
    _, prolate = quadrature((1e-3, 1e-3, 1.0))
    with mpmath.workdps(30):
        kappa = 1 / mpmath.mpf(1e-3)
        root = kappa * mpmath.sqrt(kappa**2 - 1)
        axial = 2 * (1 - kappa**-2) ** mpmath.mpf(1.5) / 3 / (root - mpmath.acosh(kappa))
        assert abs(prolate[2] / axial - 1) < 1e-22


@settings(max_examples=50, deadline=None, derandomize=True)
@given(st.tuples(*[st.floats(1e-3, 1e3)] * 3), st.sampled_from([1e-6, 0.3, 1e6]))
def test_unit_and_order_of_the_semi_axes_do_not_matter(axes, unit):
    ellipsoid = Ellipsoid(axes)
    scaled = Ellipsoid(tuple(unit * length for length in axes))
    rolled = Ellipsoid((axes[1], axes[2], axes[0]))
    for quantity in ("inertia", "resistance", "damping"):
        original = np.array(getattr(ellipsoid, quantity))
        assert np.allclose(getattr(scaled, quantity), original, rtol=1e-13)
        assert np.allclose(np.roll(getattr(rolled, quantity), 1), original, rtol=1e-13)
    assert set(ellipsoid.order) == {0, 1, 2}
    assert np.all(np.diff([axes[i] for i in ellipsoid.order]) <= 0)


@pytest.mark.parametrize(
    ("axes", "kind", "axis"),
    [
        ((1, 1, 1), "sphere", None),
        ((1, 1, 2), "prolate", 2),
        ((3, 1, 1), "prolate", 0),
        ((1, 0.5, 1), "oblate", 1),
        ((1, 0.8, 0.5), "triaxial", None),
        ((1, 1 - 1e-9, 0.5), "triaxial", None),
        # Equal once they are scaled.
        ((1.2, 0.7, 0.1 * 7), "prolate", 0),
    ],
)
def test_kind(axes, kind, axis):
    ellipsoid = Ellipsoid(axes)
    assert (ellipsoid.kind, ellipsoid.symmetry_axis) == (kind, axis)
    if kind == "triaxial":
        assert ellipsoid.stokes_star_per_stokes is None
    else:
        assert ellipsoid.stokes_star_per_stokes == pytest.approx(1 / ellipsoid.damping[axis or 0])


@pytest.mark.parametrize(
    "axes", [(1, 1, 0), (1, -1, 1), (1, 1, float("nan")), (1, 1, float("inf")), (1, 1)]
)
def test_shapes_without_meaning_are_refused(axes):
    with pytest.raises(ValueError, match="semi_axes: got"):
        Ellipsoid(axes)


@settings(deadline=None, derandomize=True)
@given(*[st.floats(1e-12, 1.0)] * 3)
def test_carlson_rd_is_that_of_scipy_and_symmetric(x: float, y: float, z: float):
    assert carlson_rd(x, y, z) == pytest.approx(elliprd(x, y, z), rel=1.5e-15)
    assert carlson_rd(x, y, z) == carlson_rd(y, x, z)


# Leading orders of I/(8πX) of a spheroid as κ → ∞ and κ → 0, about the symmetry axis (St*/St) and
# about the equator.
LIMITS = {
    2: lambda kappa: 1 / (10 * kappa**2) if kappa > 1 else np.pi * kappa / 20,
    0: lambda kappa: (
        (2 * np.log(2 * kappa) - 1) / (20 * kappa**2) if kappa > 1 else np.pi * kappa / 40
    ),
}


@pytest.mark.parametrize("axis", LIMITS)
@pytest.mark.parametrize("extreme", [1e3, 1e-3])
def test_effective_stokes_number_of_fibres_and_disks(axis, extreme):
    """The printed St ln κ/κ² for κ → ∞ is the law of the equatorial axes, not of St*, which has no logarithm."""
    for kappa, left in ((extreme, 2e-3), (extreme**2, 2e-6)):
        ellipsoid = Ellipsoid((1.0, 1.0, kappa))
        assert 1 / ellipsoid.damping[axis] == pytest.approx(LIMITS[axis](kappa), rel=left)
        assert ellipsoid.stokes_star_per_stokes == 1 / ellipsoid.damping[2]
