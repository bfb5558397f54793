"""The paper's first-order correction to a spheroid's slow motion (appendix B), corrected."""

from math import atan2

import numpy as np

from polhode.models.form import Form
from polhode.models.forms.averaged_spheroid import (
    AveragedSpheroid,
    field as averaged_field,
    slow_variables,
)
from polhode.models.forms.spheroid import Spheroid
from polhode.models.observables import Observables, observe_slow
from polhode.models.operations import Field, Operations
from polhode.models.problem import Problem
from polhode.models.scene import Scene

# Rounding of a start meant to have L along the vorticity stays below this share of L.
_ALIGNED = 1e-14


def field(ops: Operations) -> Field:
    """Averaged rates of (L_z, η) at L_x = L_y = 0, and of the phase Φ = ∫ L_z/I_e dt₂.

    The parameters p are as in `averaged_spheroid`.
    """
    averaged = ops.use(averaged_field)

    def rhs(y, p):
        # A zero of the kind of number that y has.
        zero = 0.0 * y[0]
        _, _, lz, spin = averaged((zero, zero, y[0], y[1]), p)
        return lz, spin, y[0] + zero

    return rhs


class CorrectedSpheroid(Form):
    """State (L_z, η, Φ) in slow time: averaged motion of L along z, phase of precession.

    To the slow L_z⁽⁰⁾ the observables add L_z⁽¹⁾/St with L_z⁽¹⁾ = -2πY_c Λ h̄² (I_e/L_z⁽⁰⁾) sin
    2(St Φ + φ₀) (`lzsfod2`, the phase taken along the slow solution, L_z signed); the slow solution
    starts at L_z(0) - L_z⁽¹⁾(0)/St. The error of L_z and E is then O(St⁻²).

    Not in the catalogue: L_x and L_y keep their O(1/St) error, as the paper's first-order
    correction leaves them at 0. As a whole the form has the order of `averaged-spheroid`.
    """

    name = "averaged-spheroid-corrected"
    state = ("Lz/Ie", "eta", "phase")
    orientation = "none"
    averaged = True

    def check(self, scene: Scene) -> None:
        AveragedSpheroid().check(scene)
        self.require_orientation(scene)
        lx, ly, lz = scene.initial.angular_momentum[0]
        if np.hypot(lx, ly) > _ALIGNED * abs(lz):
            raise self.refuse("the start has L off the vorticity axis", "averaged-spheroid")

    def problem(self, scene: Scene) -> Problem:
        self.check(scene)
        averaged = AveragedSpheroid().problem(scene)
        lz, spin = averaged.start[2:]
        shift = float(_correction(scene, np.array([lz]), np.array([spin]), np.array([0.0]))[0])
        return self.slow_problem(scene, field, (lz - shift, spin, 0.0), averaged.parameters or ())

    def observe(self, scene: Scene, states: np.ndarray) -> Observables:
        spheroid = Spheroid.of(scene.ellipsoid)
        lz, spin, phase = states.T
        corrected = (lz + _correction(scene, lz, spin, phase)) * spheroid.equatorial_inertia
        momentum = np.stack([np.zeros_like(corrected), np.zeros_like(corrected), corrected], axis=1)
        return observe_slow(slow_variables(spheroid, momentum, spin))


def _correction(scene: Scene, lz: np.ndarray, spin: np.ndarray, phase: np.ndarray) -> np.ndarray:
    """L_z⁽¹⁾/St in units of I_e, shape (n,)."""
    spheroid = Spheroid.of(scene.ellipsoid)
    # p̂ = (sin θ sin φ, -sin θ cos φ, cos θ), and φ turns at the rate L_z/I_e.
    x, y, _ = scene.initial_rotation[spheroid.axis]
    angle = scene.stokes * phase + atan2(x, -y)
    # h̄² is the sine squared of the angle between p̂ and L, as L·p̂ = I_a η; the damping is 8πY_c/I_e.
    across2 = 1 - (spheroid.inertia_ratio * spin / lz) ** 2
    amplitude = spheroid.equatorial_damping * spheroid.anisotropy * across2 / (4 * lz)
    return -amplitude * np.sin(2 * angle) / scene.stokes
