"""Vector fields of the classical test problems; the numbers that belong to them stand in `problems.toml`."""

from collections.abc import Callable
from functools import wraps
from typing import Any

from polhode.models.operations import Field, Operations


def over_state(rates: Callable[[Operations, Any], tuple[Any, ...]]) -> Callable[[Operations], Field]:
    """The factory of a field without parameters: rates over numbers' operations and a state."""

    @wraps(rates)
    def factory(ops: Operations) -> Field:
        return lambda y, p: rates(ops, y)

    return factory


@over_state
def hires_field(ops, y):
    y1, y2, y3, y4, y5, y6, y7, y8 = y
    bound = 280 * y6 * y8
    return (
        -1.71 * y1 + 0.43 * y2 + 8.32 * y3 + 0.0007,
        1.71 * y1 - 8.75 * y2,
        -10.03 * y3 + 0.43 * y4 + 0.035 * y5,
        8.32 * y2 + 1.71 * y3 - 1.12 * y4,
        -1.745 * y5 + 0.43 * y6 + 0.43 * y7,
        -bound + 0.69 * y4 + 1.71 * y5 - 0.43 * y6 + 0.69 * y7,
        bound - 1.81 * y7,
        -bound + 1.81 * y7,
    )


@over_state
def robertson_field(ops, y):
    slow, back, fast = 0.04 * y[0], 1e4 * y[1] * y[2], 3e7 * y[1] * y[1]
    return back - slow, slow - back - fast, fast


@over_state
def robertson_dae_field(ops, y):
    slow, back, fast = 0.04 * y[0], 1e4 * y[1] * y[2], 3e7 * y[1] * y[1]
    return back - slow, slow - back - fast, y[0] + y[1] + y[2] - 1.0


@over_state
def oregonator_field(ops, y):
    y1, y2, y3 = y
    return 77.27 * (y2 + y1 * (1 - 8.375e-6 * y1 - y2)), (y3 - (1 + y1) * y2) / 77.27, 0.161 * (y1 - y3)


@over_state
def e5_field(ops, y):
    """In units of 1.76e-3, 1e-9, 1e-11 and 1e-9, so that no component hides below an absolute tolerance."""
    decay, meeting, back = 7.89e-10 * y[0], y[0] * y[2], y[1] * y[2]
    return (
        -decay - 1.1e-4 * meeting,
        1.76e6 * decay - 1.13e-2 * back,
        1.76e8 * decay - 19360.0 * meeting - 1.13 * back + 1.13e5 * y[3],
        193.6 * meeting - 1130.0 * y[3],
    )


@over_state
def brusselator_field(ops, y):
    reaction = y[0] * y[0] * y[1]
    return 1 + reaction - 4 * y[0], 3 * y[0] - reaction


@over_state
def van_der_pol_field(ops, y):
    return y[1], (1 - y[0] * y[0]) * y[1] - y[0]


@over_state
def stiff_van_der_pol_field(ops, y):
    return y[1], 1e6 * ((1 - y[0] * y[0]) * y[1] - y[0])


@over_state
def rigid_body_field(ops, y):
    return y[1] * y[2], -y[2] * y[0], -0.51 * y[0] * y[1]


@over_state
def lorenz_field(ops, y):
    return 10 * (y[1] - y[0]), y[0] * (28 - y[2]) - y[1], y[0] * y[1] - 8 * y[2] / 3


@over_state
def oscillators_field(ops, y):
    """Two oscillators, of frequencies 1 and 50, seen in coordinates that mix them."""
    slow, fast = 0.5 * (y[0] + y[1]), 1250.0 * (y[0] - y[1])
    return y[2], y[3], -slow - fast, fast - slow


def attraction(ops, y, i):
    """Acceleration of star i by the others; star j has the mass j + 1."""
    ax, ay = 0.0 * y[0], 0.0 * y[0]
    for j in range(7):
        if j != i:
            dx, dy = y[j] - y[i], y[7 + j] - y[7 + i]
            square = dx * dx + dy * dy
            weight = (j + 1.0) / (square * ops.sqrt(square))
            ax, ay = ax + weight * dx, ay + weight * dy
    return ax, ay


@over_state
def pleiades_field(ops, y):
    accelerations = [attraction(ops, y, i) for i in range(7)]
    return *y[14:], *(ax for ax, _ in accelerations), *(ay for _, ay in accelerations)


@over_state
def arenstorf_field(ops, y):
    moon, earth = 0.012277471, 1 - 0.012277471
    x, z, u, w = y
    near, far = x + moon, x - earth
    a, b = near * near + z * z, far * far + z * z
    a3, b3 = a * ops.sqrt(a), b * ops.sqrt(b)
    return u, w, x + 2 * w - earth * near / a3 - moon * far / b3, z - 2 * u - earth * z / a3 - moon * z / b3


@over_state
def kepler_field(ops, y):
    square = y[0] * y[0] + y[1] * y[1]
    cube = square * ops.sqrt(square)
    return y[2], y[3], -y[0] / cube, -y[1] / cube
