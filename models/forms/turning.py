"""Full forms with the angle ∫|ω| dt beside their state: what counts the rotations of a run."""

from collections.abc import Callable

from polhode.models.forms import jeffery, quaternion
from polhode.models.operations import Operations, WithRate


def _speed(ops: Operations) -> Callable:
    return lambda y, p: ops.sqrt(y[4] * y[4] + y[5] * y[5] + y[6] * y[6])


def _jeffery_speed(ops: Operations) -> Callable:
    """|Ω_J|."""
    turning, sqrt = ops.use(jeffery.turning), ops.sqrt

    def of(y, p):
        _, (w1, w2, w3) = turning(y, p)
        return sqrt(w1 * w1 + w2 * w2 + w3 * w3)

    return of


TURNING = WithRate(quaternion.field, _speed)
JEFFERY_TURNING = WithRate(jeffery.field, _jeffery_speed)
