"""The Jeffery top: section points, the stretching against a neighbour, the layer, the saddle's exponent."""

from math import cosh, log, pi

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from polhode.harness.paper.jeffery_top import (
    half_turn,
    measure_layer,
    saddle_growth,
    section_points,
    stretching,
)
from polhode.models.shape import Ellipsoid

BODY = Ellipsoid((1.0, 0.9, 0.5))


def test_section_points_against_an_integration_of_the_rotation_matrix():
    """Rows of t_ij turn with Jeffery's angular velocity, written out; the section is an event of the integrator."""
    axes = np.array(BODY.semi_axes)

    def rates(_, entries):
        rotation = entries.reshape(3, 3)
        spin = np.zeros(3)
        for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
            shape = (axes[j] ** 2 - axes[k] ** 2) / (axes[j] ** 2 + axes[k] ** 2)
            strain = rotation[j, 0] * rotation[k, 1] + rotation[j, 1] * rotation[k, 0]
            spin[i] = -rotation[i, 2] / 2 + shape * strain / 2
        return np.cross(spin @ rotation, rotation).ravel()

    def section(_, entries):
        return entries[6]

    theta, psi = 1.2, 0.4
    c, s = np.cos, np.sin
    start = np.array(
        [
            [c(psi), c(theta) * s(psi), s(theta) * s(psi)],
            [-s(psi), c(theta) * c(psi), s(theta) * c(psi)],
            [0.0, -s(theta), c(theta)],
        ]
    )
    duration = 8 * half_turn(BODY)
    tight = {"rtol": 1e-12, "atol": 1e-12}
    run = solve_ivp(rates, (0.0, duration), start.ravel(), "DOP853", events=section, **tight)
    at_events = run.y_events[0][run.t_events[0] > 0.5].reshape(-1, 3, 3)
    ((found_theta, found_psi),) = section_points(BODY, [(theta, 0.0, psi)], duration)
    expected_psi = np.arctan2(at_events[:, 0, 2], at_events[:, 1, 2])
    assert len(found_theta) == len(at_events) > 7
    assert found_theta == pytest.approx(np.arccos(at_events[:, 2, 2]), abs=1e-4)
    assert np.sin(2 * found_psi) == pytest.approx(np.sin(2 * expected_psi), abs=2e-4)
    assert np.abs(found_psi).max() <= pi / 2


def test_neighbours_part_as_the_stretching_says():
    """Two orbits of a slender body, 1e-9 rad apart, in its chaotic sea."""
    body = Ellipsoid((0.05, 0.1, 1.0))
    turns = 12
    starts = [(1.5, 0.0, 1.4), (1.5, 0.0, 1.4 + 1e-9)]
    first, second = (
        np.array(points)[:, -1] for points in section_points(body, starts, turns * half_turn(body))
    )
    stretched = stretching(body, starts, [turns // 2, turns])
    assert stretched.shape == (2, 2)
    assert log(np.linalg.norm(first - second) / 1e-9) == pytest.approx(stretched[0, 1], abs=3.0)
    assert stretched[0, 1] > 5


def test_starts_beyond_the_lanes_are_stretched_as_if_alone():
    starts = [(0.3 + 0.05 * number, 0.2, 0.1) for number in range(19)]
    together = stretching(BODY, starts, [3])
    alone = stretching(BODY, starts[-1:], [3])
    assert together[-1] == pytest.approx(alone[0], abs=1e-9)


def test_a_body_close_to_a_spheroid_has_no_layer():
    """Both ends meet at the separatrix, to rounding; orbits on either side of it librate and circulate."""
    body = Ellipsoid((1.0, 2 / 2.1, 1 / 2.1))
    librating, circulating = measure_layer(body, 60)
    assert circulating - librating == pytest.approx(0.0, abs=1e-3)
    inside, outside = (
        section_points(body, [(pi / 2 + end, 0.0, 1e-9)], 60 * half_turn(body))[0]
        for end in (librating - 0.02, circulating + 0.02)
    )
    assert np.abs(np.diff(inside[1])).max() < 2
    assert np.min(outside[0]) > pi / 2


def test_growth_of_the_saddle_over_two_sections():
    """The second iterate of a map with the eigenvalues e^±λ has the trace 2 cosh 2λ."""
    offset = 1e-4
    start = (pi / 2, 0.0, pi / 2 - offset)
    ((_, psi),) = section_points(BODY, [start], 2.5 * half_turn(BODY))
    assert (pi / 2 - abs(psi[1])) / offset == pytest.approx(cosh(2 * saddle_growth(BODY)), rel=1e-4)
