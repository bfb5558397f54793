"""Euler-angle form: the paper's second-order system `fth`–`fps` as six first-order equations."""

from collections.abc import Callable
from math import sin

import numpy as np

from polhode.models.form import Form
from polhode.models.forms.motion import (
    driven_acceleration,
    full_problem,
    parameters_of,
    velocity_in_any_flow,
    velocity_in_shear,
)
from polhode.models.observables import Observables, observe_body
from polhode.models.operations import ARRAYS, Field, Operations
from polhode.models.problem import Factory, Problem
from polhode.models.rotation import (
    angular_velocity_from_euler,
    euler_rates_from_angular_velocity,
    matrix_from_euler,
)
from polhode.models.scene import EulerStart, Scene

# Least |sin θ|. `EulerAngles` says what a passage at a distance costs, whatever the tolerance. A larger limit
# would end more runs, a smaller one lose more digits.
POLE_LIMIT = 1e-5
# The limit as messages write it.
IN_WORDS = np.format_float_scientific(POLE_LIMIT, exp_digits=1, trim="-")


def guarded_sine(ops: Operations):
    """sin θ, and NaN where |sin θ| < `POLE_LIMIT`: no solver then gets past the pole unnoticed."""
    sin = ops.sin
    where_positive = ops.where_positive
    limit2 = POLE_LIMIT * POLE_LIMIT
    nowhere = float("nan")

    def sine(theta):
        s = sin(theta)
        return where_positive(s * s - limit2, s, nowhere)

    return sine


def _field(ops: Operations, axes: Factory, velocity: Factory) -> Field:
    """Rates of (θ, φ, ψ, θ̇, φ̇, ψ̇) (`fth`–`fps`, solved for the accelerations); p as in `motion`."""
    sin = ops.sin
    cos = ops.cos
    sine = ops.use(guarded_sine)
    acceleration = ops.use(driven_acceleration)
    axes_of = ops.use(axes)
    velocity_of = ops.use(velocity)

    # Sines and cosines are st and ct of θ, sf and cf of φ, ss and cs of ψ. `across` is φ̇ sin θ, the
    # part of φ̇ across the body axis z', in the plane that ψ turns.
    def rhs(y, p):
        theta = y[0]
        phi = y[1]
        psi = y[2]
        dtheta = y[3]
        dphi = y[4]
        dpsi = y[5]
        st = sine(theta)
        ct = cos(theta)
        sf = sin(phi)
        cf = cos(phi)
        ss = sin(psi)
        cs = cos(psi)
        across = dphi * st
        omega = (across * ss + dtheta * cs, across * cs - dtheta * ss, dphi * ct + dpsi)
        jeffery = velocity_of(*axes_of(st, ct, sf, cf, ss, cs), p)
        a1, a2, a3 = acceleration(omega, jeffery, p)
        alpha = p[0]
        # ω̇ times alpha is known; the derivatives of ω in the angles give the accelerations.
        ddphi = (a1 * ss + a2 * cs + alpha * dtheta * (dpsi - dphi * ct)) / st
        return (
            dtheta,
            dphi,
            dpsi,
            a1 * cs - a2 * ss - alpha * dpsi * across,
            ddphi,
            a3 - ddphi * ct + alpha * dtheta * across,
        )

    return rhs


def _directions(ops: Operations) -> Callable:
    """Flow and gradient directions in body axes, of the angles' sines and cosines."""

    def of(st, ct, sf, cf, ss, cs):
        flow = (cs * cf - sf * ss * ct, -ss * cf - sf * cs * ct, st * sf)
        gradient = (sf * cs + ss * cf * ct, -sf * ss + cs * cf * ct, -st * cf)
        return flow, gradient

    return of


def _space_axes(ops: Operations) -> Callable:
    """All three space axes in body axes, and their scale."""
    directions = ops.use(_directions)

    def of(st, ct, sf, cf, ss, cs):
        return *directions(st, ct, sf, cf, ss, cs), (st * ss, st * cs, ct), 1.0

    return of


def field(ops: Operations) -> Field:
    """`_field` in simple shear."""
    return _field(ops, _directions, velocity_in_shear)


def field_in_any_flow(ops: Operations) -> Field:
    """`_field` in a linear flow."""
    return _field(ops, _space_axes, velocity_in_any_flow)


def require_distance_from_pole(form: Form, theta: float, instead: str) -> None:
    """Raise FormNotValidError if a start is too close to θ = 0 or π: |sin θ| < `POLE_LIMIT`."""
    sine = abs(sin(theta))
    if not sine >= POLE_LIMIT:
        condition = (
            f"the start has |sin θ| = {sine:.1e} < {IN_WORDS}, where the angles are ill-conditioned"
        )
        raise form.refuse(condition, instead)


class EulerAngles(Form):
    """State (θ, φ, ψ, θ̇, φ̇, ψ̇): the form the paper integrates.

    A passage of θ = 0 or π at a distance δ turns φ and ψ by about π each within a time δ/θ̇.
    Rounding then costs about 1e-15/δ rad, the median of torque-free tops, and at worst twenty times
    as much. Smaller steps do not help: the error is in the state. Nothing shows the error
    afterwards: with viscous torque neither L nor E is conserved. Hence the vector field itself ends
    at |sin θ| = `POLE_LIMIT`, where it is NaN. Every solver stops there with a failure (`non_finite` or
    `step_underflow`) instead of going on with digits lost. A run at a tolerance looser than the limit
    may step over it, and is then wrong by its tolerance anyway.
    """

    name = "euler-angles"
    summary = "the paper's Euler angles and their rates; singular at θ = 0 and π"
    valid_for = (
        f"every ellipsoid as long as |sin θ| ≥ {IN_WORDS}; at St = 0 in its implicit form alone"
    )
    state = ("theta", "phi", "psi", "dtheta", "dphi", "dpsi")
    orientation = "full"
    any_flow = True
    angles = True

    def check(self, scene: Scene) -> None:
        require_distance_from_pole(self, self.require_orientation(scene).angles[0], "quaternion")

    def problem(self, scene: Scene) -> Problem:
        self.check(scene)
        start = self.require_orientation(scene)
        rates = euler_rates_from_angular_velocity(start.angles, scene.angular_velocity)
        if isinstance(start, EulerStart) and scene.stokes > 0:
            rates = start.rates
        start = *start.angles, *rates
        inertial = (False,) * 3 + (True,) * 3
        shape = parameters_of(scene)
        return full_problem(
            self,
            scene,
            field,
            start,
            inertial,
            shape,
            in_any_flow=field_in_any_flow,
            periodic=(1, 2),
        )

    def observe(self, scene: Scene, states: np.ndarray) -> Observables:
        omega = angular_velocity_from_euler(states[:, :3].T, states[:, 3:6].T, ARRAYS)
        return observe_body(
            scene.ellipsoid, matrix_from_euler(states[:, :3]), np.stack(omega, axis=1)
        )
