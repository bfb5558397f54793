"""A test problem of one's own: a function, start, end, and the solution there."""

from math import exp

from polhode.models.problem import Problem
from polhode.models.problems.classical import Classical


def decay(t, y, rate):
    """Rates, as SciPy's `solve_ivp` takes them."""
    return [-rate * y[0]]


DECAY = Classical(
    Problem.from_function(decay, [1.0], 3.0, [2.0], name="decay"),
    (exp(-6.0),),
    stiff=False,
    source="closed form",
)
