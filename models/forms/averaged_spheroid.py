"""Averaged form of a spheroid: the slow variables L and η = ω·p̂ alone, in slow time (`lxsmain`–`nsmain`).

Names such as `lxsmain` are labels of the paper's LaTeX source. The aspect ratio κ, the moments I_a, I_e and the
resistances X_c, Y_c are those of `polhode.models.shape`.
"""

from functools import partial
from math import sqrt

import numpy as np

from polhode.models.form import Form
from polhode.models.forms.spheroid import Spheroid, require_spheroid
from polhode.models.observables import Observables, observe_slow
from polhode.models.operations import Field, Operations
from polhode.models.problem import Problem
from polhode.models.scene import Scene, SlowStart


def field(ops: Operations) -> Field:
    """Averaged rates d(L_x, L_y, L_z, η)/dt₂ (`lxsmain`–`nsmain`); p = (I_a/I_e, 8πX_c/I_a, 8πY_c/I_e).

    L is in units of I_e. κ enters through I_a/I_e = 2/(κ² + 1) alone.
    """
    # The rates of L are those of `averaged`, with I and X in units of I_e: `decay` is its A, and `from_x`,
    # `from_y`, `from_z` are C/2, D/2, B/2. The fourth rate is that of η, where `averaged` has that of E.
    # The mean squares of L's body components over |L| are `along` for the symmetry axis and half of
    # `across` for either other axis. `high` and `low` are the shares κ²/(κ² + 1) and 1/(κ² + 1) of the
    # squared semi-axes, axial and equatorial, in their sum. The differences B - C and B - D have the factor
    # (2 along - across)/2 in common, which stands in `tilt`.

    def rhs(y, p):
        lx = y[0]
        ly = y[1]
        lz = y[2]
        spin = y[3]
        ratio = p[0]
        axial = p[1]
        equatorial = p[2]
        momentum2 = lx * lx + ly * ly + lz * lz
        along = ratio * ratio * spin * spin / momentum2
        across = 1 - along
        decay = axial * along + equatorial * across
        tilt = lz * (2 * along - across) / (4 * momentum2)
        low = 0.5 * ratio
        high = 1 - 0.5 * ratio
        even = 0.25 * ratio * axial * across
        from_x = even + equatorial * (0.5 * across * high + along * low)
        from_y = even + equatorial * (0.5 * across * low + along * high)
        from_z = 0.5 * (ratio * axial * along + equatorial * across)
        return (
            -lx * (decay + ratio * (axial - equatorial) * tilt),
            -ly * (decay + (ratio * (axial + equatorial) - 2 * equatorial) * tilt),
            -(decay * lz + (lx * lx * from_x + ly * ly * from_y + lz * lz * from_z) / momentum2),
            -axial * spin * (1 + 0.5 * ratio * lz / momentum2),
        )

    return rhs


def range_excess(states: np.ndarray, ratio: float) -> np.ndarray:
    """How far (L·p̂)² = (I_a η)² exceeds |L|², over the largest |L|², of states, shape (n, 4); `ratio` is I_a/I_e."""
    lx, ly, lz, spin = states.T
    momentum2 = lx * lx + ly * ly + lz * lz
    along = ratio * spin
    return np.maximum(along * along - momentum2, 0.0) / momentum2.max()


class AveragedSpheroid(Form):
    """State (L_x, L_y, L_z, η) in slow time, L in units of I_e; E follows by `EetaL`.

    Its error against the full forms falls like 1/St. The motions with η and with -η have the same L and E: a start
    given by L and E takes η ≥ 0.
    """

    name = "averaged-spheroid"
    summary = "first-order averaged slow variables L and spin of a spheroid"
    valid_for = "spheroids and spheres at large finite St, L not 0; no orientation"
    state = ("Lx/Ie", "Ly/Ie", "Lz/Ie", "eta")
    orientation = "none"
    averaged = True

    def check(self, scene: Scene) -> None:
        self.require_slow_motion(scene)
        require_spheroid(self, scene, "averaged")

    def problem(self, scene: Scene) -> Problem:
        self.check(scene)
        spheroid = Spheroid.of(scene.ellipsoid)
        momentum = scene.initial.angular_momentum[0] / spheroid.equatorial_inertia
        parameters = spheroid.inertia_ratio, spheroid.axial_damping, spheroid.equatorial_damping
        excess = partial(range_excess, ratio=spheroid.inertia_ratio)
        return self.slow_problem(
            scene, field, (*momentum.tolist(), initial_spin(scene)), parameters, excess
        )

    def observe(self, scene: Scene, states: np.ndarray) -> Observables:
        spheroid = Spheroid.of(scene.ellipsoid)
        return observe_slow(
            slow_variables(spheroid, states[:, :3] * spheroid.equatorial_inertia, states[:, 3])
        )


def slow_variables(spheroid: Spheroid, momentum: np.ndarray, spin: np.ndarray) -> np.ndarray:
    """Slow variables (L_x, L_y, L_z, E), shape (n, 4), of L, shape (n, 3), and η, shape (n,) (`EetaL`)."""
    axial = spheroid.axial_inertia
    equatorial = spheroid.equatorial_inertia
    energy = (np.sum(momentum**2, axis=1) - axial * (axial - equatorial) * spin**2) / (
        2 * equatorial
    )
    return np.column_stack([momentum, energy])


def initial_spin(scene: Scene) -> float:
    """η at the start, from the angular velocity, or from L and E (`EetaL`), which may miss the range by roundoff."""
    spheroid = Spheroid.of(scene.ellipsoid)
    if not isinstance(scene.start, SlowStart):
        return scene.angular_velocity[spheroid.axis]
    axial = spheroid.axial_inertia
    equatorial = spheroid.equatorial_inertia
    momentum2 = sum(component * component for component in scene.start.angular_momentum)
    energy2 = 2 * scene.start.energy
    if axial == equatorial:
        # A sphere's E follows from L, which says nothing of η, and no rate of L depends on η.
        return 0.0
    along2 = max(0.0, (momentum2 - energy2 * equatorial) * axial / (axial - equatorial))
    return sqrt(min(along2, momentum2)) / axial
