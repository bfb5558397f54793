"""Rotation of ellipsoids in any linear flow, in long double: body axes and L in space axes, by extrapolation.

Nothing else of the package is used, so that the equations do not share its mistakes. They follow the
definitions. Each body axis turns with ω, and L changes by the torque -8π X_i (ω_i - ω_iJ). The
gradient in body axes, G = R A Rᵀ, gives ω₁J = (b² G₃₂ - c² G₂₃)/(b² + c²) and cyclic. Many bodies run side by side.

R has the body axes as its rows t_i. The semi-axes are a, b and c, A is the gradient of the flow's
velocity, X_i the rotational resistance, and ω_J Jeffery's angular velocity. A state of n bodies has the shape
(n, 4, 3): three body axes, then L, all in space axes. Time is in inverse shear rates. `reports/flows`
says what is compared with this integration.
"""

from collections.abc import Callable

import numpy as np

Array = np.ndarray

# Columns of the extrapolation, whose order is twice that, 16. An estimate: steps that
# turn a body by a twentieth of a turn at most then err by no more than rounding.
_COLUMNS = 8


class Bodies:
    """n bodies: semi-axes, inertia and resistance, shape (n, 3), and Stokes numbers, shape (n,).

    Semi-axes are in a unit of length l, moments of inertia in l⁵ times the body's density, and the
    resistances X_i in l³.
    """

    def __init__(self, semi_axes: Array, inertia: Array, resistance: Array, stokes: Array) -> None:
        self.squares = np.asarray(semi_axes, dtype=np.longdouble) ** 2
        self.inertia = np.asarray(inertia, dtype=np.longdouble)
        self.resistance = np.asarray(resistance, dtype=np.longdouble)
        self.stokes = np.asarray(stokes, dtype=np.longdouble)

    def jeffery(self, rotation: Array, gradient: Array) -> Array:
        """Jeffery's angular velocity in body axes, shape (n, 3)."""
        # The gradient in body axes; aa, bb and cc are squares of the semi-axes.
        inside = rotation @ gradient @ rotation.swapaxes(1, 2)
        aa, bb, cc = self.squares.T
        return np.stack(
            [
                (bb * inside[:, 2, 1] - cc * inside[:, 1, 2]) / (bb + cc),
                (cc * inside[:, 0, 2] - aa * inside[:, 2, 0]) / (cc + aa),
                (aa * inside[:, 1, 0] - bb * inside[:, 0, 1]) / (aa + bb),
            ],
            axis=1,
        )

    def rates(self, state: Array, gradient: Array) -> Array:
        """Rates of the body axes and of L behind them, shape (n, 4, 3)."""
        rotation = state[:, :3]
        momentum = state[:, 3]
        # `inside` is ω in body axes, `omega` in space axes, `slip` is ω - ω_J in body axes.
        inside = (rotation @ momentum[:, :, None])[:, :, 0] / self.inertia
        omega = (inside[:, None, :] @ rotation)[:, 0]
        slip = inside - self.jeffery(rotation, gradient)
        torque = -8 * _PI * self.resistance * slip / self.stokes[:, None]
        turning = np.cross(omega[:, None, :], rotation)
        return np.concatenate([turning, torque[:, None, :] @ rotation], axis=1)


# More digits than a double holds.
_PI = np.arctan(np.longdouble(1)) * 4


def run(
    bodies: Bodies,
    rotation: Array,
    omega: Array,
    gradient: Callable[[Array, int], Array],
    end: Array,
    steps: int,
    rows: int = 2,
) -> tuple[Array, Array]:
    """Matrices t_ij, shape (rows, n, 3, 3), and L, shape (rows, n, 3), at equispaced times from 0 to the ends.

    The starts are t_ij, shape (n, 3, 3), and body angular velocities, shape (n, 3). `end` has the ends,
    shape (n,), or one for all bodies, shape (1,). All bodies take the same number of equal steps, a multiple of
    rows - 1. ``gradient(t, i)`` gives A, shape (n, 3, 3), at times of shape (n,) within step i. A track
    of gradients needs i: where steps end at its knots, i tells which of two intervals a knot belongs to.
    """
    rotation = np.asarray(rotation, dtype=np.longdouble)
    momentum = np.asarray(omega, dtype=np.longdouble) * bodies.inertia
    momentum = momentum[:, None, :] @ rotation
    state = np.concatenate([rotation, momentum], axis=1)
    length = np.asarray(end, dtype=np.longdouble) / steps
    snapshots = [state]
    for i in range(steps):
        state = _step(bodies, state, gradient, i, length)
        if (i + 1) % (steps // (rows - 1)) == 0:
            snapshots.append(state)
    states = np.array(snapshots)
    return states[:, :, :3], states[:, :, 3]


def _step(
    bodies: Bodies,
    begin: Array,
    gradient: Callable[[Array, int], Array],
    number: int,
    length: Array,
) -> Array:
    """One step by the modified midpoint rule, extrapolated to substeps of length 0 (Gragg, Bulirsch, Stoer).

    Row j of the table has the rule with 2j substeps first, then extrapolations with the rows before.
    They rest on the rule's error, which is a series in the square of the substep. `number` is the step's,
    from 0 on, and `length` has the steps of all bodies, shape (n,). Hairer, Nørsett and Wanner, *Solving
    Ordinary Differential Equations I*, section II.9, derive it.
    """
    time = number * length

    def rates(state: Array, at: Array) -> Array:
        return bodies.rates(state, gradient(at, number))

    first = rates(begin, time)
    table: list[Array] = []
    for column in range(1, _COLUMNS + 1):
        substeps = 2 * column
        h = length / substeps
        # The substep beside states of shape (n, 4, 3).
        state_h = h[:, None, None]
        before = begin
        state = begin + state_h * first
        for k in range(1, substeps):
            following = before + 2 * state_h * rates(state, time + k * h)
            before = state
            state = following
        # Gragg's smoothing of the last two states.
        row = [(before + state + state_h * rates(state, time + length)) / 2]
        for k, above in enumerate(table, 1):
            ratio = (np.longdouble(column) / (column - k)) ** 2
            row.append(row[-1] + (row[-1] - above) / (ratio - 1))
        table = row
    return table[-1]
