"""What full forms share: the one vector equation (`ultima`), resolved along the body axes, and a quaternion's turning.

Parameters p of a full form: (alpha, beta, *shape), for a triaxial one (alpha, beta, gyro₁₋₃,
damping₁₋₃, share₁₋₆). Mass alpha stands on the angular velocity, factor beta on the torque: (1,
1/St) is the explicit form, (St, 1) the implicit one.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from polhode.models.flow import jeffery_angular_velocity, shares
from polhode.models.form import Form
from polhode.models.operations import Operations
from polhode.models.problem import Factory, Floats, MassForm, Problem
from polhode.models.scene import Scene
from polhode.models.shape import Ellipsoid


def body_parameters(ellipsoid: Ellipsoid) -> tuple[float, ...]:
    """Shape parameters of `angular_acceleration`: (I₂ - I₃)/I₁ and cyclic (`eulg`), damping rates, shares."""
    a, b, c = ellipsoid.scaled_axes
    gyro1 = (c - b) * (c + b) / (b * b + c * c)
    gyro2 = (a - c) * (a + c) / (c * c + a * a)
    gyro3 = (b - a) * (b + a) / (a * a + b * b)
    return gyro1, gyro2, gyro3, *ellipsoid.damping, *shares(ellipsoid)


def full_problem(
    form: Form,
    scene: Scene,
    field: Factory,
    start: Floats,
    inertial: tuple[bool, ...],
    shape: Floats,
    **known: Any,
) -> Problem:
    """Initial value problem in time t of a form of the full equations; `known` is what else there is to a `Problem`."""
    # At St = 0 there is no explicit form, at St = inf no implicit one, which has the mass St on the
    # inertial rows.
    mass = tuple(scene.stokes if row else 1.0 for row in inertial)
    explicit = (1.0, scene.torque_factor, *shape) if scene.stokes > 0 else None
    implicit = MassForm(mass, (scene.stokes, 1.0, *shape)) if scene.torque_factor > 0 else None
    return Problem(form.name, field, start, scene.time, explicit, implicit, **known)


def angular_acceleration(ops: Operations) -> Callable:
    """Mass times ω̇ in body axes (`govg`), from the flow and gradient directions in body axes and ω."""
    jeffery = ops.use(jeffery_angular_velocity)

    def acceleration(x, y, w, p):
        alpha = p[0]
        beta = p[1]
        w1, w2, w3 = w
        j1, j2, j3 = jeffery(x, y, (p[8], p[9], p[10], p[11], p[12], p[13]))
        return (
            alpha * p[2] * w2 * w3 - beta * p[5] * (w1 - j1),
            alpha * p[3] * w3 * w1 - beta * p[6] * (w2 - j2),
            alpha * p[4] * w1 * w2 - beta * p[7] * (w3 - j3),
        )

    return acceleration


def directions(ops: Operations) -> Callable:
    """Flow and gradient directions in body axes, (t₁₁, t₂₁, t₃₁) and (t₁₂, t₂₂, t₃₂), of a quaternion of any norm."""
    # Divided by |q|², so that the norm, which solvers let drift, does not enter the torque. At
    # loose tolerances over long runs this divides the errors by 10 to 100 and keeps runs from
    # blowing up that otherwise do; a term that restores the norm does no better, costs a third more
    # and bounds the step (paper's ellipsoid, St = 1e4 and 1e5).

    def of(q0, q1, q2, q3):
        scale = 1 / (q0 * q0 + q1 * q1 + q2 * q2 + q3 * q3)
        double = 2 * scale
        flow = (
            scale * (q0 * q0 + q1 * q1 - q2 * q2 - q3 * q3),
            double * (q1 * q2 - q0 * q3),
            double * (q1 * q3 + q0 * q2),
        )
        gradient = (
            double * (q1 * q2 + q0 * q3),
            scale * (q0 * q0 - q1 * q1 + q2 * q2 - q3 * q3),
            double * (q2 * q3 - q0 * q1),
        )
        return flow, gradient

    return of


def quaternion_rates(ops: Operations) -> Callable:
    """q̇ = ½ q∘(0, ω), ω in body axes."""

    def of(q0, q1, q2, q3, w1, w2, w3):
        return (
            -0.5 * (q1 * w1 + q2 * w2 + q3 * w3),
            0.5 * (q0 * w1 + q2 * w3 - q3 * w2),
            0.5 * (q0 * w2 + q3 * w1 - q1 * w3),
            0.5 * (q0 * w3 + q1 * w2 - q2 * w1),
        )

    return of


def norm_drift(states: np.ndarray) -> np.ndarray:
    """|q|² - 1 of states, shape (n, d), that begin with a quaternion."""
    return np.einsum("ij,ij->i", states[:, :4], states[:, :4]) - 1
