"""Planar motion: a principal axis stays along the vorticity, described by one angle and its rate."""

from dataclasses import dataclass
from math import atan2, hypot

import numpy as np

from polhode.models.catalogue import full_form
from polhode.models.form import Form
from polhode.models.forms.motion import full_problem
from polhode.models.observables import Observables
from polhode.models.operations import Field, Operations
from polhode.models.problem import Problem
from polhode.models.rotation import matrix_from_euler
from polhode.models.scene import Scene

# Rounding of a start that is meant to be planar, such as cos(π/2) = 6e-17, stays below; a larger
# component is taken for meant. An estimate. It bounds components of the body's axes, and those of ω across
# the vorticity: in shear rates, or over |φ̇| if that is above 1.
_PLANAR = 1e-14


def field(ops: Operations) -> Field:
    """Rates of (φ, φ̇); p = (alpha, beta, 8πX_k/I_k, δ), with δ = (l_i² - l_j²)/(l_i² + l_j²) (`ultima`, `jw1`–`jw3`).

    Body axis k is along z, and φ is the angle from the flow to the in-plane axis i. Jeffery's rate
    -(1 - δ cos 2φ)/2 does not depend on the length along z.
    """
    cos = ops.cos

    def rhs(y, p):
        phi = y[0]
        dphi = y[1]
        beta = p[1]
        damping = p[2]
        anisotropy = p[3]
        return dphi, -beta * damping * (dphi + 0.5 - 0.5 * anisotropy * cos(2 * phi))

    return rhs


@dataclass(frozen=True)
class Plane:
    """A planar start."""

    angle: float  # φ of an in-plane principal axis, in rad
    rate: float  # φ̇, in shear rates
    inertia: float  # I_k, of the rotation about z
    damping: float  # 8πX_k/I_k, in units of (shear rate)/St
    anisotropy: float  # δ of `field`


class Tumbling(Form):
    """State (φ, φ̇): the in-plane angle of a principal axis.

    A spheroid may have its symmetry axis along the vorticity or in the plane: any axis across it is a
    principal axis. Small deviations from the plane may grow in reality; this
    form keeps to the plane.
    """

    name = "tumbling"
    summary = "planar motion about a principal axis along the vorticity: one angle and its rate"
    valid_for = "starts with a principal axis and ω along the vorticity; at St = 0 in its implicit form alone"
    state = ("phi", "dphi")
    orientation = "full"

    def check(self, scene: Scene) -> None:
        self._plane(scene)

    def problem(self, scene: Scene) -> Problem:
        plane = self._plane(scene)
        start = (plane.angle, plane.rate)
        shape = (plane.damping, plane.anisotropy)
        return full_problem(self, scene, field, start, (False, True), shape, periodic=(0,))

    def observe(self, scene: Scene, states: np.ndarray) -> Observables:
        """Observables: the start turned about z."""
        plane = self._plane(scene)
        turn = states[:, 0] - plane.angle
        zero = np.zeros_like(turn)
        turned = matrix_from_euler(np.stack([zero, turn, zero], axis=1))
        along = plane.inertia * states[:, 1]
        momentum = np.stack([zero, zero, along], axis=1)
        energy = 0.5 * along * states[:, 1]
        return Observables(momentum, energy, scene.initial_rotation @ turned)

    def _plane(self, scene: Scene) -> Plane:
        """The scene's planar start; raises FormNotValidError if it is not planar."""
        self.require_flow(scene)
        self.require_orientation(scene)
        rotation = scene.initial_rotation
        ellipsoid = scene.ellipsoid
        x, y, rate = (
            float(component) for component in rotation.T @ np.array(scene.angular_velocity)
        )
        if hypot(x, y) > _PLANAR * max(1.0, abs(rate)):
            condition = f"the angular velocity leaves the vorticity axis by {hypot(x, y):.1e}"
            raise self.refuse(condition, full_form(scene))
        if (axes := _principal_axes(scene)) is None:
            raise self.refuse("no principal axis lies along the vorticity", full_form(scene))
        upright, first, second = axes
        a = ellipsoid.scaled_axes[first]
        b = ellipsoid.scaled_axes[second]
        return Plane(
            angle=atan2(rotation[first, 1], rotation[first, 0]),
            rate=rate,
            inertia=ellipsoid.inertia[upright],
            damping=ellipsoid.damping[upright],
            anisotropy=(a - b) * (a + b) / (a * a + b * b),
        )


def _principal_axes(scene: Scene) -> tuple[int, int, int] | None:
    """Body axes along the vorticity, along the angle φ, and the third one, up to symmetry; None if there are none."""
    rotation = scene.initial_rotation
    symmetry = scene.ellipsoid.symmetry_axis
    inplane = np.hypot(rotation[:, 0], rotation[:, 1])
    if symmetry is not None and abs(rotation[symmetry, 2]) <= _PLANAR:
        return (symmetry + 1) % 3, symmetry, (symmetry + 2) % 3
    if scene.ellipsoid.kind == "sphere":
        first = int(np.argmax(inplane))
        return (first + 2) % 3, first, (first + 1) % 3
    for axis in range(3) if symmetry is None else (symmetry,):
        if inplane[axis] <= _PLANAR:
            return axis, (axis + 1) % 3, (axis + 2) % 3
    return None
