"""St = ∞: no torque, Euler's equations (`eulg`), solved in closed form."""

from dataclasses import replace
from fractions import Fraction
from functools import partial

import numpy as np

from polhode.models.catalogue import reference_form
from polhode.models.forms.quaternion import Quaternion
from polhode.models.free_top.polhode import Rationals
from polhode.models.free_top.torque_free import TorqueFree
from polhode.models.problem import Problem
from polhode.models.scene import Scene
from polhode.models.shape import Ellipsoid


def relative_inertia(ellipsoid: Ellipsoid) -> Rationals:
    """Moments of inertia b² + c² and cyclic, of the scaled semi-axes a, b, c, without rounding."""
    a, b, c = (Fraction(length) ** 2 for length in ellipsoid.scaled_axes)
    return b + c, c + a, a + b


def closed_form(top: TorqueFree, times: np.ndarray) -> np.ndarray:
    """States (q₀, q₁, q₂, q₃, ω₁, ω₂, ω₃), shape (n, 7), at times of shape (n,)."""
    return np.concatenate(top.at(times), axis=1)


class EulerTop(Quaternion):
    """The quaternion form without torque, beta = 0; the closed form costs the same at any time."""

    name = "euler-top"
    summary = "St = inf: the torque-free top in closed form"
    valid_for = "St = inf, every ellipsoid; closed form (solver 'exact')"

    def check(self, scene: Scene) -> None:
        self.require_orientation(scene)
        if scene.torque_factor > 0:
            raise self.refuse(f"St = {scene.stokes:g} is finite", reference_form(scene))

    def state_of(self, scene: Scene) -> tuple[str, ...]:
        """Names of the components; without torque they need no time."""
        return self.state

    def problem(self, scene: Scene) -> Problem:
        self.check(scene)
        quaternion = self.require_orientation(scene).quaternion
        top = TorqueFree(relative_inertia(scene.ellipsoid), quaternion, scene.angular_velocity)
        # Without torque no flow matters.
        problem = super().problem(replace(scene, flow=None))
        return replace(problem, closed_form=partial(closed_form, top))
