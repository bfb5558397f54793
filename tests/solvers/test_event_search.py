"""Events: passages that steps show and interpolants do not."""

import numpy as np
import pytest

from polhode.solvers.event_search import EventSearch, SoughtEvent


@pytest.mark.parametrize(("offset", "place"), [(1e-16, 1.0), (-1e-16, 2.0)])
def test_a_passage_within_rounding_of_an_interpolant_is_at_the_end_of_a_step(
    offset: float, place: float
):
    """From 1 to 2 the values change sign by rounding alone; those of the interpolant do not."""
    event = SoughtEvent("zero", lambda t, y: float(y[0]), 0, 0)
    search = EventSearch([event])
    search.begin(1.0, np.array([-1e-17]))
    search.through([2.0], [np.array([1e-17])], lambda time: np.array([offset]))
    assert event.times == [place]
