"""St = ∞: no torque, Euler's equations (`eulg`), solved in closed form."""

from functools import partial

import numpy as np

from polhode.models.form import Form
from polhode.models.forms.motion import body_parameters
from polhode.models.forms.quaternion import field, norm_drift
from polhode.models.free_top.torque_free import TorqueFree
from polhode.models.observables import Observables, observe_quaternion
from polhode.models.problem import Problem
from polhode.models.scene import Scene


def closed_form(top: TorqueFree, times: np.ndarray) -> np.ndarray:
    """States (q₀, q₁, q₂, q₃, ω₁, ω₂, ω₃), shape (n, 7), at times of shape (n,)."""
    return np.concatenate(top.at(times), axis=1)


class EulerTop(Form):
    """State (q₀, q₁, q₂, q₃, ω₁, ω₂, ω₃), as the quaternion form's; the closed form costs the same at any time.

    Numerical solvers get the quaternion form's field with beta = 0.
    """

    name = "euler-top"
    summary = "St = inf: the torque-free top in closed form"
    valid_for = "St = inf, every ellipsoid; closed form (solver 'exact')"
    state = ("q0", "q1", "q2", "q3", "w1", "w2", "w3")
    orientation = "full"

    def check(self, scene: Scene) -> None:
        """Refuse finite St and starts without orientation."""
        if scene.torque_factor > 0:
            raise self.refuse(f"St = {scene.stokes:g} is finite", "jeffery" if scene.stokes == 0 else "quaternion")
        self.require_orientation(scene)

    def problem(self, scene: Scene) -> Problem:
        """Initial value problem in time t."""
        self.check(scene)
        quaternion = self.require_orientation(scene).quaternion
        top = TorqueFree(scene.ellipsoid.inertia, quaternion, scene.angular_velocity)
        return Problem(
            name=self.name,
            field=field,
            start=(*quaternion, *scene.angular_velocity),
            end=scene.time,
            parameters=(1.0, 0.0, *body_parameters(scene.ellipsoid)),
            closed_form=partial(closed_form, top),
            invariant=norm_drift,
        )

    def observe(self, scene: Scene, states: np.ndarray) -> Observables:
        """Observables; quaternions are normalised first."""
        return observe_quaternion(scene.ellipsoid, states[:, :4], states[:, 4:])
