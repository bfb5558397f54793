"""Full forms with the angle ∫|ω| dt beside their state: what counts the rotations of a run."""

from polhode.models.forms import jeffery, quaternion
from polhode.models.operations import Field, Operations


def turning_field(ops: Operations) -> Field:
    """The field of the quaternion form, and |ω|."""
    full, sqrt = ops.use(quaternion.field), ops.sqrt

    def rhs(y, p):
        return *full(y, p), sqrt(y[4] * y[4] + y[5] * y[5] + y[6] * y[6])

    return rhs


def jeffery_turning_field(ops: Operations) -> Field:
    """The field of the form at St = 0, and |Ω_J|."""
    turning, sqrt = ops.use(jeffery.turning), ops.sqrt

    def rhs(y, p):
        rates, (w1, w2, w3) = turning(y, p)
        return *rates, sqrt(w1 * w1 + w2 * w2 + w3 * w3)

    return rhs
