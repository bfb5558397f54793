"""Averaged form of a triaxial ellipsoid: the slow variables L and E alone, in slow time (`lxmain`–`emain`)."""

from functools import partial
from itertools import permutations
from math import pi

import numpy as np

from polhode.models.form import Form
from polhode.models.observables import Observables, observe_slow
from polhode.models.operations import Field, Operations
from polhode.models.problem import Problem
from polhode.models.scene import Scene
from polhode.models.shape import Ellipsoid

# Steps of the arithmetic-geometric mean besides the first. Six leave an error of 3e-22 at 1 - m = 1e-20,
# below a rounding of long double, and a smaller error at any smaller m.
_AGM_STEPS = 6
# Starts whose energy is nearer than this share to L² = 2EI₂ are moved so far off it: on it the sum of
# `mean_squares` does not converge. An estimate, far above rounding: a run leaves so narrow a layer at once.
# A start with a smaller share of L² off the middle axis rotates about that axis.
_SEPARATRIX_WIDTH = 1e-12


def mean_squares(ops: Operations):
    """Means ⟨z_i²⟩ of the squared body components of L/|L| over the Euler top (`pz`), axes sorted by inertia."""
    # m is the parameter of the elliptic functions, K and E are their complete integrals, and c_n half
    # the differences of the arithmetic-geometric mean: ⟨sn²⟩ = (1 - E/K)/m = 1/2 + Σ 2ⁿ⁻¹ c_n²/m, n ≥ 1
    # (DLMF 19.8.6). The sum has positive terms only and stays exact as m → 0 and m → 1. In the code
    # `mean` and `geometric` are the numbers of that mean, `square` is c_n²/m and `weight` 2ⁿ⁻¹. As
    # c_(n+1) is c_n² over four times the next `mean`, square becomes m square²/(16 mean²). Arguments are
    # L², 2E and the moments of inertia, from the least to the greatest, in any one unit.
    where_positive = ops.where_positive
    sqrt = ops.sqrt

    def means(momentum2, energy2, i1, i2, i3):
        # `near` is the inertia of the axis that the polhode encircles, the greatest one where L² >
        # 2EI₂ and the least one elsewhere; `far` belongs to the opposite axis. `short` is 0 at rotation
        # about the near axis, and `long` would be at rotation about the far one.
        beyond = momentum2 - energy2 * i2
        near = where_positive(beyond, i3, i1)
        far = where_positive(beyond, i1, i3)
        short = energy2 * near - momentum2
        long = momentum2 - energy2 * far
        m = (i2 - far) * short / ((near - i2) * long)
        complement = (near - far) * beyond / ((near - i2) * long)

        root = sqrt(complement)
        mean = 0.5 * (1 + root)
        geometric = sqrt(root)
        square = m / (16 * mean * mean)
        weight = 1.0
        sn2 = 0.5 + square
        for _ in range(_AGM_STEPS):
            mean, geometric = 0.5 * (mean + geometric), sqrt(mean * geometric)
            square = m * square * square / (16 * mean * mean)
            weight = 2 * weight
            sn2 = sn2 + weight * square

        # Along the polhode L over |L| has cn, sn and dn as factors of its components.
        z_far = far * short / ((near - far) * momentum2) * (1 - sn2)
        z_middle = i2 * short / ((near - i2) * momentum2) * sn2
        z_near = near * long / ((near - far) * momentum2) * (1 - m * sn2)
        return (
            where_positive(beyond, z_far, z_near),
            z_middle,
            where_positive(beyond, z_near, z_far),
        )

    return means


def field(ops: Operations) -> Field:
    """Averaged rates d(L_x, L_y, L_z, E)/dt₂ (`lxmain`–`emain`); p as from `coefficients`."""
    # The paper's A, B, C, D and F are sums of p over the axes, weighted with the mean squares of L's
    # body components. p[0:3] is the inertia; p[3:6], p[6:9], p[9:12], p[12:15] and p[15:18] are summed
    # for A, B, C, D and F.
    #
    # A damps L, and F L² dissipates E, as in a fluid at rest. The rest is the flow's: B to D turn and
    # drive L, and -½ A L_z, with L_z < 0 as the fluid turns, drives E.
    means = ops.use(mean_squares)

    def rhs(y, p):
        lx = y[0]
        ly = y[1]
        lz = y[2]
        energy = y[3]
        momentum2 = lx * lx + ly * ly + lz * lz
        z1, z2, z3 = means(momentum2, 2 * energy, p[0], p[1], p[2])
        a = p[3] * z1 + p[4] * z2 + p[5] * z3
        b = p[6] * z1 + p[7] * z2 + p[8] * z3
        c = p[9] * z1 + p[10] * z2 + p[11] * z3
        d = p[12] * z1 + p[13] * z2 + p[14] * z3
        f = p[15] * z1 + p[16] * z2 + p[17] * z3
        tilt = lz / (2 * momentum2)
        return (
            -lx * (a + tilt * (b - c)),
            -ly * (a + tilt * (b - d)),
            -(a * lz + (b * lz * lz + c * lx * lx + d * ly * ly) / (2 * momentum2)),
            -(f * momentum2 + 0.5 * a * lz),
        )

    return rhs


def coefficients(ellipsoid: Ellipsoid) -> tuple[float, ...]:
    """Inertia sorted upwards, then 8π times the coefficients of ⟨z_i²⟩ in A, B, C, D, F (below `pz`), over I_max.

    With i, j, k all different, these are 8π times X_i/I_i in A, X_i in B and X_i/I_i² in F. In C the
    coefficient of ⟨z_j²⟩ is the sum of X_i l_k²/(l_j² + l_k²) over both i; in D this sum belongs to ⟨z_k²⟩.
    The fractions are the shares of Jeffery's angular velocity about axis i.
    """
    unit = max(ellipsoid.inertia)
    axes = ellipsoid.order
    squares = [ellipsoid.scaled_axes[axis] ** 2 for axis in axes]
    inertia = [ellipsoid.inertia[axis] / unit for axis in axes]
    drag = [8 * pi * ellipsoid.resistance[axis] / unit for axis in axes]
    of_c = [0.0] * 3
    of_d = [0.0] * 3
    for i, j, k in permutations(range(3)):
        share = drag[i] * squares[k] / (squares[j] + squares[k])
        of_c[j] += share
        of_d[k] += share
    of_a = [x / i for x, i in zip(drag, inertia, strict=True)]
    of_f = [x / i for x, i in zip(of_a, inertia, strict=True)]
    return *inertia, *of_a, *drag, *of_c, *of_d, *of_f


def range_excess(states: np.ndarray, least: float) -> np.ndarray:
    """How far L² of states, shape (n, 4), in units of I_max, lies outside `least` 2E … 2E, over the largest 2E."""
    lx, ly, lz, energy = states.T
    momentum2 = lx * lx + ly * ly + lz * lz
    energy2 = 2 * energy
    outside = np.maximum(momentum2 - energy2, least * energy2 - momentum2)
    return np.maximum(outside, 0.0) / max(energy2.max(), -energy2.min())


class Averaged(Form):
    """State (L_x, L_y, L_z, E) in slow time, in units of the largest moment of inertia, so that it is of order one.

    Its error against the full forms falls like 1/St.
    """

    name = "averaged"
    summary = "first-order averaged slow variables L and E of a triaxial ellipsoid"
    valid_for = (
        "triaxial ellipsoids at large finite St, L not 0, not about the middle axis; no orientation"
    )
    state = ("Lx/Imax", "Ly/Imax", "Lz/Imax", "E/Imax")
    orientation = "none"
    averaged = True

    def check(self, scene: Scene) -> None:
        """Refuse other flows than shear, equal axes, St = 0 and inf, L = 0, and rotation about the middle axis."""
        self.require_slow_motion(scene)
        if scene.ellipsoid.kind != "triaxial":
            axes = [*map(float, scene.ellipsoid.semi_axes)]
            raise self.refuse(f"two semi-axes of {axes} are equal", "averaged-spheroid")
        # L in body axes, over its largest component so that no square underflows.
        in_body = scene.initial.rotation[0] @ scene.initial.angular_momentum[0]
        in_body = in_body / np.abs(in_body).max()
        shares = in_body**2 / np.sum(in_body**2)
        # A start by L and E alone has no axis, but NaN, with which no comparison holds.
        if 1 - shares[scene.ellipsoid.order[1]] < _SEPARATRIX_WIDTH:
            raise self.refuse(
                "the start rotates about the middle axis, and lingers there", "quaternion"
            )

    def problem(self, scene: Scene) -> Problem:
        self.check(scene)
        unit = max(scene.ellipsoid.inertia)
        *momentum, energy = (scene.initial.slow[0] / unit).tolist()
        # The energy on L² = 2EI₂.
        separatrix = sum(component * component for component in momentum) / (
            2 * sorted(scene.ellipsoid.inertia)[1] / unit
        )
        if abs(energy - separatrix) < _SEPARATRIX_WIDTH * separatrix:
            energy = separatrix * (1 - _SEPARATRIX_WIDTH)
        start = (*momentum, energy)
        excess = partial(range_excess, least=min(scene.ellipsoid.inertia) / unit)
        return self.slow_problem(scene, field, start, coefficients(scene.ellipsoid), excess)

    def observe(self, scene: Scene, states: np.ndarray) -> Observables:
        return observe_slow(states * max(scene.ellipsoid.inertia))
