"""What the shear flow asks of a body: Jeffery's angular velocity (`jw1`–`jw3`)."""

from collections.abc import Callable

from polhode.models.operations import Operations
from polhode.models.shape import Ellipsoid


def shares(ellipsoid: Ellipsoid) -> tuple[float, ...]:
    """Shares b²/(b²+c²), c²/(b²+c²), and cyclic, of Jeffery's angular velocity (`jw1`–`jw3`)."""
    a2, b2, c2 = (length * length for length in ellipsoid.scaled_axes)
    return b2 / (b2 + c2), c2 / (b2 + c2), c2 / (c2 + a2), a2 / (c2 + a2), a2 / (a2 + b2), b2 / (a2 + b2)


def jeffery_angular_velocity(ops: Operations) -> Callable:
    """Jeffery's angular velocity in body axes from x = (t₁₁, t₂₁, t₃₁) and y = (t₁₂, t₂₂, t₃₂) (`jw1`–`jw3`)."""

    def spin(x, y, s):
        return (
            s[0] * y[1] * x[2] - s[1] * y[2] * x[1],
            s[2] * y[2] * x[0] - s[3] * y[0] * x[2],
            s[4] * y[0] * x[1] - s[5] * y[1] * x[0],
        )

    return spin
