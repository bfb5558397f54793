"""The Jeffery top's sections: the stretching against a neighbour, the saddle's exponent."""

from math import cosh, log, pi

import numpy as np
import pytest

from polhode.harness.paper.sections.limits import half_turn, orbit, saddle_growth, stretched_orbit
from polhode.models.shape import Ellipsoid

BODY = Ellipsoid((1.0, 0.9, 0.5))


def test_neighbours_part_as_the_stretching_says():
    """Two orbits of a slender body, 1e-9 rad apart, in its chaotic sea."""
    body = Ellipsoid((0.05, 0.1, 1.0))
    duration = 12 * half_turn(body)
    first, second = (
        np.array(orbit(body, 1.5, 1.4 + step, duration))[:, -1] for step in (0.0, 1e-9)
    )
    _, stretch = stretched_orbit(body, 1.5, 1.4, duration)
    assert log(np.linalg.norm(first - second) / 1e-9) == pytest.approx(stretch, abs=3.0)
    assert stretch > 6


def test_growth_of_the_saddle_over_two_sections():
    """The second iterate of a map with the eigenvalues e^±λ has the trace 2 cosh 2λ."""
    offset = 1e-4
    _, psi = orbit(BODY, pi / 2, pi / 2 - offset, 2.5 * half_turn(BODY))
    assert (pi / 2 - abs(psi[1])) / offset == pytest.approx(cosh(2 * saddle_growth(BODY)), rel=1e-4)
