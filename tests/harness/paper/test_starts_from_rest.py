"""Starts from rest: the terms of the equation of motion, distances, peaks between rows."""

import numpy as np
import pytest

from polhode.harness.paper.runs import run_form, spheroid
from polhode.harness.paper.sections.rest import distance_from, terms_of
from polhode.harness.paper.tables import maxima
from polhode.models.catalogue import form as find_form
from polhode.models.scene import EulerStart, Scene


def test_the_two_terms_make_the_angular_acceleration():
    """I dω/dt is the sum of both, in body axes: neither is larger than the other and the change together."""
    scene = Scene(spheroid(10.0), 1e3, EulerStart((0.10472, 5.4978, 0.0)), 90.0)
    times = np.linspace(0.0, 90.0, 90_001)
    run = run_form(find_form("quaternion"), scene, times)
    gyroscopic, viscous = terms_of(run)
    inertia = np.array(scene.ellipsoid.inertia)
    momentum = np.einsum("nij,nj->ni", run.observables.rotation, run.observables.angular_momentum)
    acceleration = np.linalg.norm(np.gradient(momentum, times, axis=0), axis=1)
    inner = slice(10, -10)
    slack = 1e-3 * acceleration[inner].max()
    assert (np.abs(gyroscopic - viscous)[inner] < acceleration[inner] + slack).all()
    assert (acceleration[inner] < (gyroscopic + viscous)[inner] + slack).all()
    assert inertia.shape == (3,)
    assert viscous[0] == pytest.approx(acceleration[0], rel=1e-2)


def test_distance_from_a_line_of_segments():
    line = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0]])
    places = np.array([[0.5, 0.2, 0.0], [1.3, 0.5, 0.4], [-3.0, 0.0, 4.0]])
    assert distance_from(line, places) == pytest.approx([0.2, 0.5, 5.0])


def test_maxima_lie_between_rows():
    times = np.linspace(0.0, 20.0, 201)
    tops = maxima(times, np.cos(times - 1.234))
    assert tops == pytest.approx(1.234 + 2 * np.pi * np.arange(3), abs=1e-4)
    wiggly = np.sin(times) + 0.2 * np.sin(10 * times)
    assert len(maxima(times, wiggly, prominence=0.8)) == 3 < len(maxima(times, wiggly))
