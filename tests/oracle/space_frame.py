"""Rotation of ellipsoids in any linear flow, in long double: body axes and L in space axes, by extrapolation.

NumPy alone; nothing of the project is imported. The equations are those of the definitions: each body
axis turns with ω, L changes by the torque -8π X_i (ω_i - ω_iJ), and ω_iJ follows from the gradient in
body axes, G = R A Rᵀ, as ω₁J = (b² G₃₂ - c² G₂₃)/(b² + c²) and cyclic. Many bodies run side by side.
"""

import numpy as np

# Columns of the extrapolation: order 16, whose steps of some tenths of a radian err by rounding.
_COLUMNS = 8


class Bodies:
    """n bodies: squares of the semi-axes, inertia and resistance, shape (n, 3), and Stokes numbers, shape (n,)."""

    def __init__(self, semi_axes, inertia, resistance, stokes):
        self.squares = np.asarray(semi_axes, dtype=np.longdouble) ** 2
        self.inertia = np.asarray(inertia, dtype=np.longdouble)
        self.resistance = np.asarray(resistance, dtype=np.longdouble)
        self.stokes = np.asarray(stokes, dtype=np.longdouble)

    def jeffery(self, rotation, gradient):
        """Jeffery's angular velocity in body axes, shape (n, 3)."""
        turned = np.einsum("nij,njk->nik", rotation, gradient)
        inside = np.einsum("nij,nkj->nik", turned, rotation)
        a, b, c = self.squares.T
        return np.stack(
            [
                (b * inside[:, 2, 1] - c * inside[:, 1, 2]) / (b + c),
                (c * inside[:, 0, 2] - a * inside[:, 2, 0]) / (c + a),
                (a * inside[:, 1, 0] - b * inside[:, 0, 1]) / (a + b),
            ],
            axis=1,
        )

    def rates(self, rotation, momentum, gradient):
        """Rates of the body axes, shape (n, 3, 3), and of L, shape (n, 3)."""
        inside = np.einsum("nij,nj->ni", rotation, momentum) / self.inertia
        omega = np.einsum("nij,ni->nj", rotation, inside)
        torque = -8 * np.longdouble(np.pi) * self.resistance
        torque = torque * (inside - self.jeffery(rotation, gradient)) / self.stokes[:, None]
        turning = np.cross(omega[:, None, :], rotation)
        return turning, np.einsum("nij,ni->nj", rotation, torque)


def run(bodies, rotation, omega, gradient, end, steps):
    """Matrices t_ij and L at the ends, of starts t_ij, shape (n, 3, 3), and body angular velocities, shape (n, 3).

    `gradient(t)` gives A, shape (n, 3, 3), at times of shape (n,); `end` holds a time of each body;
    all take the same number of equal steps.
    """
    rotation = np.asarray(rotation, dtype=np.longdouble)
    momentum = np.asarray(omega, dtype=np.longdouble) * bodies.inertia
    momentum = np.einsum("nij,ni->nj", rotation, momentum)
    length = np.asarray(end, dtype=np.longdouble) / steps
    for i in range(steps):
        rotation, momentum = _step(bodies, rotation, momentum, gradient, i * length, length)
    return rotation, momentum


def _step(bodies, rotation, momentum, gradient, time, length):
    """One step by the modified midpoint rule with 2, 4, … substeps, extrapolated to none (Gragg, Bulirsch, Stoer)."""

    def rates(state, at):
        turning, torque = bodies.rates(state[:, :3], state[:, 3], gradient(at))
        return np.concatenate([turning, torque[:, None]], axis=1)

    begin = np.concatenate([rotation, momentum[:, None]], axis=1)
    first = rates(begin, time)
    table = []
    for column in range(1, _COLUMNS + 1):
        count = 2 * column
        h = length / count
        wide = h[:, None, None]
        before, state = begin, begin + wide * first
        for k in range(1, count):
            before, state = state, before + 2 * wide * rates(state, time + k * h)
        end = (before + state + wide * rates(state, time + length)) / 2
        row = [end]
        for k, above in enumerate(table, 1):
            ratio = np.longdouble(column / (column - k)) ** 2
            row.append(row[-1] + (row[-1] - above) / (ratio - 1))
        table = row
    return table[-1][:, :3], table[-1][:, 3]
