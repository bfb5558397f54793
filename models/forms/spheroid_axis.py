"""Spheroid in space axes: angular momentum and symmetry axis. No angle, no singularity, six equations."""

import numpy as np

from polhode.models.form import Form
from polhode.models.forms.motion import full_problem
from polhode.models.forms.spheroid import Spheroid, axis_rotation, require_spheroid
from polhode.models.observables import Observables
from polhode.models.operations import Field, Operations
from polhode.models.problem import Problem
from polhode.models.scene import Scene


def field(ops: Operations) -> Field:
    """dL/dt and dp̂/dt of `ultima` in space axes; p = (alpha, beta, 8πY_c/I_e, 8π(X_c - Y_c)/I_e, I_e/I_a - 1, Λ).

    Mass alpha stands on L and appears nowhere else: torque-free, L is constant. With ω = L/I_e + (1/I_a - 1/I_e)(L·p̂)p̂,
    w = ω - Ω_J and Ω_J = -ẑ/2 + Λ p̂×(E p̂), where E p̂ = (p_y, p_x, 0)/2, the torque is
    -8π(Y_c w + (X_c - Y_c)(w·p̂)p̂). The state holds L/I_e, of order one like p̂ whatever the shape, so that one tolerance
    suits both. Products of two components of p̂ are divided by |p̂|², which solvers let drift: over 10⁴ time units at
    St = 100 and tolerance 1e-6 (kappa = 2; RK45, LSODA, DOP853) this takes the error of L and E from 0.1 and more to
    1e-3; a term that restores the norm does no better.
    """

    def rhs(y, p):
        lx, ly, lz, px, py, pz = y[0], y[1], y[2], y[3], y[4], y[5]
        scale = 1 / (px * px + py * py + pz * pz)
        spin = scale * p[4] * (lx * px + ly * py + lz * pz)
        half = scale * 0.5 * p[5]
        wx = lx + spin * px + half * px * pz
        wy = ly + spin * py - half * py * pz
        wz = lz + spin * pz + 0.5 - half * (px * px - py * py)
        axial = scale * p[3] * (wx * px + wy * py + wz * pz)
        beta = p[1]
        return (
            -beta * (p[2] * wx + axial * px),
            -beta * (p[2] * wy + axial * py),
            -beta * (p[2] * wz + axial * pz),
            ly * pz - lz * py,
            lz * px - lx * pz,
            lx * py - ly * px,
        )

    return rhs


def parameters(spheroid: Spheroid) -> tuple[float, float, float, float]:
    """Shape parameters of `field`."""
    axial = spheroid.axial_damping * spheroid.inertia_ratio
    return (
        spheroid.equatorial_damping,
        axial - spheroid.equatorial_damping,
        spheroid.anisotropy / spheroid.inertia_ratio,
        spheroid.anisotropy,
    )


def norm_drift(states: np.ndarray) -> np.ndarray:
    """|p̂|² - 1 of states, shape (n, 6)."""
    return np.sum(states[:, 3:] ** 2, axis=1) - 1


class SpheroidAxis(Form):
    """State (L, p̂) in space axes, L in units of I_e; the spin about p̂ is known by its rate alone, through L·p̂."""

    name = "spheroid-axis"
    summary = "angular momentum and symmetry axis of a spheroid in space axes; no singularity"
    valid_for = "spheroids about any body axis, and spheres; at St = 0 in its implicit form alone"
    state = ("Lx/Ie", "Ly/Ie", "Lz/Ie", "px", "py", "pz")
    orientation = "axis"

    def check(self, scene: Scene) -> None:
        """Refuse triaxial ellipsoids and starts without orientation."""
        require_spheroid(self, scene, "quaternion")
        self.require_orientation(scene)

    def problem(self, scene: Scene) -> Problem:
        """Initial value problem in time t."""
        self.check(scene)
        spheroid = Spheroid.of(scene.ellipsoid)
        momentum = scene.initial.angular_momentum[0] / spheroid.equatorial_inertia
        start = *momentum.tolist(), *scene.initial_rotation[spheroid.axis].tolist()
        inertial, shape = (True,) * 3 + (False,) * 3, parameters(spheroid)
        return full_problem(self, scene, field, start, inertial, shape, invariant=norm_drift)

    def observe(self, scene: Scene, states: np.ndarray) -> Observables:
        """Observables; p̂ is normalised first, and is all that is known of the rotation."""
        spheroid = Spheroid.of(scene.ellipsoid)
        momentum = states[:, :3] * spheroid.equatorial_inertia
        direction = states[:, 3:] / np.linalg.norm(states[:, 3:], axis=1, keepdims=True)
        axial = np.sum(momentum * direction, axis=1)
        across = momentum - axial[:, None] * direction
        energy = axial**2 / spheroid.axial_inertia + np.sum(across**2, axis=1) / spheroid.equatorial_inertia
        return Observables(momentum, 0.5 * energy, axis_rotation(spheroid.axis, direction))
