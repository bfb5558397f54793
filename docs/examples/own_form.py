"""A form of one's own: the flow and gradient directions in body axes instead of a quaternion, nine equations."""

import numpy as np

from polhode import solve
from polhode.models.form import Form
from polhode.models.forms.motion import angular_acceleration, body_parameters, full_problem
from polhode.models.observables import Observables, observe_body
from polhode.models.operations import Field, Operations
from polhode.models.problem import Problem
from polhode.models.scene import Scene


def field(ops: Operations) -> Field:
    """Directions fixed in space turn backwards in body axes, ẋ = x × ω; ω̇ as in the forms of the catalogue."""
    acceleration = ops.use(angular_acceleration)

    def rhs(y, p):
        a1, a2, a3 = acceleration((y[0], y[1], y[2]), (y[3], y[4], y[5]), (y[6], y[7], y[8]), p)
        x1, x2, x3 = y[1] * y[8] - y[2] * y[7], y[2] * y[6] - y[0] * y[8], y[0] * y[7] - y[1] * y[6]
        y1, y2, y3 = y[4] * y[8] - y[5] * y[7], y[5] * y[6] - y[3] * y[8], y[3] * y[7] - y[4] * y[6]
        return x1, x2, x3, y1, y2, y3, a1, a2, a3

    return rhs


class Directions(Form):
    """State (x̂, ŷ, ω) in body axes; nothing holds the directions to length one and at right angles."""

    name = "directions"
    summary = "flow and gradient directions in body axes and body angular velocity; no singularity"
    valid_for = "every scene; at St = 0 in its implicit form alone"
    state = ("x1", "x2", "x3", "y1", "y2", "y3", "w1", "w2", "w3")
    orientation = "full"

    def check(self, scene: Scene) -> None:
        """Refuse a start without orientation."""
        self.require_orientation(scene)

    def problem(self, scene: Scene) -> Problem:
        """Initial value problem in time t."""
        self.require_orientation(scene)
        flow, gradient = scene.initial_rotation[:, 0], scene.initial_rotation[:, 1]
        start = *flow.tolist(), *gradient.tolist(), *scene.angular_velocity
        inertial, shape = (False,) * 6 + (True,) * 3, body_parameters(scene.ellipsoid)
        return full_problem(self, scene, field, start, inertial, shape)

    def observe(self, scene: Scene, states: np.ndarray) -> Observables:
        """Observables; the directions, drifted by now, are put at right angles first."""
        x = states[:, :3] / np.linalg.norm(states[:, :3], axis=1, keepdims=True)
        z = np.cross(x, states[:, 3:6])
        z /= np.linalg.norm(z, axis=1, keepdims=True)
        return observe_body(
            scene.ellipsoid, np.stack([x, np.cross(z, x), z], axis=2), states[:, 6:]
        )


if __name__ == "__main__":
    exact = solve("paper", form="quaternion", solver="taylor", tolerance=1e-15)
    for tolerance in (1e-6, 1e-9, 1e-12):
        own = solve("paper", form=Directions(), solver="cyrk-vern8", tolerance=tolerance)
        error = np.max(np.abs(own.observables.slow - exact.observables.slow)) / max(
            own.scene.ellipsoid.inertia
        )
        print(
            f"tolerance {tolerance:g}: {own.status}, {own.work.steps} steps, {own.seconds:.1e} s, error {error:.1e}"
        )
