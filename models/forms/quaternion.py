"""Quaternion form: orientation as a unit quaternion, angular velocity in body axes. No singularity, any scene."""

from collections.abc import Callable

import numpy as np

from polhode.models.form import Form
from polhode.models.forms import motion
from polhode.models.observables import Observables, observe_body
from polhode.models.operations import Field, Operations, WithRate
from polhode.models.problem import Factory, Problem
from polhode.models.rotation import matrix_from_quaternion
from polhode.models.scene import Scene


def _field(ops: Operations, axes: Factory, velocity: Factory) -> Field:
    """q̇ = ½ q∘(0, ω) and the vector equation `ultima` in body axes; p as in `polhode.models.forms.motion`."""
    axes_of = ops.use(axes)
    velocity_of = ops.use(velocity)
    rates = ops.use(motion.quaternion_rates)
    acceleration = ops.use(motion.driven_acceleration)

    def rhs(y, p):
        axes = axes_of(y[0], y[1], y[2], y[3])
        turning = rates(y[0], y[1], y[2], y[3], y[4], y[5], y[6])
        return *turning, *acceleration((y[4], y[5], y[6]), velocity_of(*axes, p), p)

    return rhs


def field(ops: Operations) -> Field:
    """`_field` in simple shear."""
    return _field(ops, motion.directions, motion.velocity_in_shear)


def field_in_any_flow(ops: Operations) -> Field:
    """`_field` in a linear flow."""
    return _field(ops, motion.space_axes, motion.velocity_in_any_flow)


def _speed(ops: Operations) -> Callable:
    """|ω|, in shear rates."""
    return lambda y, p: ops.sqrt(y[4] * y[4] + y[5] * y[5] + y[6] * y[6])


def with_angle(field: Factory) -> WithRate:
    """The field with the angle ∫|ω| dt beside the state, which counts the rotations of a run."""
    return WithRate(field, _speed)


class Quaternion(Form):
    """State (q₀, q₁, q₂, q₃, ω₁, ω₂, ω₃): seven equations, four of them of unit norm.

    Solvers let the norm drift, by up to 1e-2 in |q|² over 10⁴ time units at tolerance 1e-6 (LSODA,
    RK45). The field divides it out of the torque (`polhode.models.forms.motion`), and `observe` out
    of the result. A term k(1 - |q|²)q beside that was tried at St = 1e2, 1e4 and 1e6. k = 0.1 takes
    the drift down to 1e-5 and changes the errors of L, E and orientation by factors of two, up or
    down. k = 1 and 10 cost up to forty times the steps, as a tighter tolerance would. Hence there is
    none, and the norm is only watched, as an invariant.
    """

    name = "quaternion"
    summary = "unit quaternion and body angular velocity; no singularity"
    valid_for = "every scene; at St = 0 in its implicit form alone"
    state = ("q0", "q1", "q2", "q3", "w1", "w2", "w3")
    orientation = "full"
    any_flow = True

    def check(self, scene: Scene) -> None:
        self.require_orientation(scene)

    def problem(self, scene: Scene) -> Problem:
        start = *self.require_orientation(scene).quaternion, *scene.angular_velocity
        inertial = (False,) * 4 + (True,) * 3
        shape = motion.parameters_of(scene)
        return motion.full_problem(
            self,
            scene,
            field,
            start,
            inertial,
            shape,
            in_any_flow=field_in_any_flow,
            invariant=motion.norm_drift,
        )

    def observe(self, scene: Scene, states: np.ndarray) -> Observables:
        return observe_body(scene.ellipsoid, matrix_from_quaternion(states[:, :4]), states[:, 4:7])
