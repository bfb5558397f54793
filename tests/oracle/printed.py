"""Printed formulas that several tests need; each is shown right, or its misprint shown, by a test."""

from math import pi

import numpy as np
from scipy.special import ellipe, ellipk

from .first_principles import CYCLIC, body


def jacobian(field, state, step=1e-3):
    """Derivative matrix of `field` at `state` by central differences of eighth order.

    The default of `step` is an estimate: truncation, of its eighth power, is far below rounding, 1e-16 over the step.
    """
    coefficients = (4 / 5, -1 / 5, 4 / 105, -1 / 280)
    state = np.asarray(state, dtype=float)
    shifts = step * np.eye(len(state))
    columns = [
        sum(
            w * (field(state + n * shift) - field(state - n * shift))
            for n, w in enumerate(coefficients, start=1)
        )
        / step
        for shift in shifts
    ]
    return np.array(columns).T


class Spheroid:
    """Spheroid with symmetry axis z' and the paper's names for its coefficients.

    These are I_e, I_a, Y_c and X_c: moments of inertia and resistances about equatorial axes (e, Y) and the axis.
    """

    def __init__(self, kappa):
        self.kappa = kappa
        self.shape = body((1, 1, kappa))
        _, self.ie, self.ia = self.shape.inertia
        _, self.yc, self.xc = self.shape.resistance

    def energy(self, momentum, eta):
        """E from L (3,) and the rate η about the axis: `EetaL`, shown right by `test_right_symmetric_top`."""
        return (momentum @ momentum - self.ia * (self.ia - self.ie) * eta**2) / (2 * self.ie)

    def slow(self, state):
        """`lxsmain`–`nsmain` for the state (L_x, L_y, L_z, η)."""
        x, y, z, eta = state
        size2 = x * x + y * y + z * z
        h2 = (self.ia * eta) ** 2 / size2
        g2 = 1 - h2
        xc, yc, ia, ie, k2 = self.xc, self.yc, self.ia, self.ie, self.kappa**2
        decay = xc * h2 / ia + yc * g2 / ie
        tilt = z / (2 * size2) * (2 * h2 - g2) / (2 * ie)
        spin_up = (
            x * x * (xc * g2 / 4 + yc * g2 * k2 / (2 * (k2 + 1)) + yc * h2 / (k2 + 1))
            + y * y * (xc * g2 / 4 + yc * g2 / (2 * (k2 + 1)) + yc * h2 * k2 / (k2 + 1))
            + z * z * (xc * h2 / 2 + yc * g2 / 2)
        ) / size2
        return (
            -8
            * pi
            * np.array(
                [
                    x * (decay + (xc * ie - yc * ia) * tilt),
                    y * (decay + (xc * ie + yc * ia - 2 * yc * ie) * tilt),
                    decay * z + spin_up,
                    xc * eta / ia * (1 + z * ia / (2 * size2)),
                ]
            )
        )


class Ellipsoid:
    """Triaxial ellipsoid with a > b > c and the paper's averages and slow equations."""

    def __init__(self, semi_axes):
        self.shape = body(semi_axes)

    def mean_squares(self, momentum2, energy, reading=lambda parameter: parameter):
        """⟨z_i²⟩ of `pz`; `reading` maps μδ to the parameter handed to the elliptic integrals."""
        order = [0, 1, 2] if momentum2 > 2 * energy * self.shape.inertia[1] else [2, 1, 0]
        i1, i2, i3 = self.shape.inertia[order]
        mu = (2 * energy * i3 - momentum2) / (momentum2 - 2 * energy * i1)
        delta = (i2 - i1) / (i3 - i2)
        ratio = ellipe(reading(mu * delta)) / ellipk(reading(mu * delta))
        squares = np.empty(3)
        squares[order] = (
            i1 / (delta * (i1 * mu + i3)) * (ratio + mu * delta - 1),
            i2 / (delta * (i1 * mu + i3)) * (1 - ratio) * (i3 - i1) / (i3 - i2),
            i3 / (i1 * mu + i3) * ratio,
        )
        return squares

    def coefficients(self, squares):
        """A, B, C, D and F, with C and D summed over both orders of (j, k)."""
        moments, drag, length2 = self.shape.inertia, self.shape.resistance, self.shape.semi_axes**2
        pairs = [(i, j, k) for i, j, k in CYCLIC] + [(i, k, j) for i, j, k in CYCLIC]
        weight = {(i, j, k): drag[i] * length2[k] / (length2[j] + length2[k]) for i, j, k in pairs}
        return (
            np.sum(drag * squares / moments),
            np.sum(drag * squares),
            sum(weight[i, j, k] * squares[j] for i, j, k in pairs),
            sum(weight[i, j, k] * squares[k] for i, j, k in pairs),
            np.sum(drag * squares / moments**2),
        )

    def slow(self, state):
        """`lxmain`–`emain` for the state (L_x, L_y, L_z, E)."""
        x, y, z, energy = state
        size2 = x * x + y * y + z * z
        a, b, c, d, f = self.coefficients(self.mean_squares(size2, energy))
        return (
            -8
            * pi
            * np.array(
                [
                    x * (a + z / (2 * size2) * (b - c)),
                    y * (a + z / (2 * size2) * (b - d)),
                    a * z + (b * z * z + c * x * x + d * y * y) / (2 * size2),
                    f * size2 + a * z / 2,
                ]
            )
        )
