"""St = 0: the particle turns with Jeffery's angular velocity (`jw1`–`jw3`); spheroids in closed form."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from math import hypot, pi

import numpy as np

from polhode.models.flow import (
    gyration,
    jeffery_angular_velocity,
    jeffery_in_any_flow,
    jeffery_spin,
    shares,
)
from polhode.models.form import Form
from polhode.models.forms.motion import (
    directions,
    in_its_flow,
    norm_drift,
    quaternion_rates,
    space_axes,
)
from polhode.models.forms.spheroid import Spheroid
from polhode.models.free_top.elliptic import PI
from polhode.models.libraries import IMPORTS
from polhode.models.observables import Observables, observe_body
from polhode.models.operations import ARRAYS, Field, Operations, WithRate
from polhode.models.problem import Factory, Problem
from polhode.models.rotation import (
    Quaternion,
    make_third,
    matrix_from_quaternion,
    quaternion_from_euler,
)
from polhode.models.scene import Scene


def turning(ops: Operations) -> Callable:
    """q̇ = ½ q∘(0, Ω_J), and Ω_J, in simple shear; p = shares of Jeffery's angular velocity."""
    directions_of = ops.use(directions)
    rates = ops.use(quaternion_rates)
    jeffery = ops.use(jeffery_angular_velocity)

    def of(y, p):
        flow, gradient = directions_of(y[0], y[1], y[2], y[3])
        w1, w2, w3 = jeffery(flow, gradient, p)
        return rates(y[0], y[1], y[2], y[3], w1, w2, w3), (w1, w2, w3)

    return of


def turning_in_any_flow(ops: Operations) -> Callable:
    """As `turning`, in a linear flow; p = `gyration` and the flow's numbers (`polhode.models.flow`)."""
    axes_of = ops.use(space_axes)
    rates = ops.use(quaternion_rates)
    jeffery = ops.use(jeffery_in_any_flow)

    def of(y, p):
        x1, x2, x3, scale = axes_of(y[0], y[1], y[2], y[3])
        gyro = (p[0], p[1], p[2])
        flow = (p[3], p[4], p[5], p[6], p[7], p[8], p[9], p[10])
        w1, w2, w3 = jeffery(x1, x2, x3, scale, gyro, flow)
        return rates(y[0], y[1], y[2], y[3], w1, w2, w3), (w1, w2, w3)

    return of


def field(ops: Operations) -> Field:
    """q̇ of `turning`."""
    rates = ops.use(turning)
    return lambda y, p: rates(y, p)[0]


def field_in_any_flow(ops: Operations) -> Field:
    """q̇ of `turning_in_any_flow`."""
    rates = ops.use(turning_in_any_flow)
    return lambda y, p: rates(y, p)[0]


@dataclass(frozen=True)
class JefferyOrbit:
    """Jeffery orbit of a spheroid in closed form, spin included.

    The symmetry axis follows a spherical ellipse (`phitraj`, and `thetraj` with the exponent 1/2):
    p̂ ∝ (-s κ sin τ, -s cos τ, z) with τ = τ₀ + t/(κ + 1/κ). s/z is the orbit constant. The spin
    angle obeys ψ̇ = ½ Λ cos θ cos 2φ. It is an elliptic integral of the third kind in τ, here in
    Carlson's form (DLMF 19.25.5, 19.25.14).
    """

    axial: float  # semi-axes in any common unit
    equatorial: float
    axis: int  # of symmetry: 0, 1, 2
    quaternion: Quaternion  # at t = 0, of unit norm

    @property
    def aspect_ratio(self) -> float:
        """Aspect ratio kappa."""
        return self.axial / self.equatorial

    @cached_property
    def _ellipse(self) -> tuple[float, float, np.longdouble]:
        """s, z and τ₀ of the symmetry axis at the start."""
        px, py, pz = matrix_from_quaternion(np.array(self.quaternion))[self.axis].tolist()
        sine = px / self.aspect_ratio
        return hypot(sine, py), pz, np.arctan2(np.longdouble(-sine), np.longdouble(-py))

    def at(self, times: np.ndarray) -> np.ndarray:
        """Unit quaternions, shape (n, 4), at times of shape (n,), in inverse shear rates.

        The phase is carried in long double.
        """
        s, z, start = self._ellipse
        ratio = np.longdouble(self.axial) / np.longdouble(self.equatorial)
        tau = np.concatenate([[start], start + times.astype(np.longdouble) / (ratio + 1 / ratio)])
        half_turns = np.rint(tau / PI)
        rest = (tau - half_turns * PI).astype(float)
        turns = half_turns.astype(float)
        kappa = self.aspect_ratio
        sine = np.sin(rest)
        cosine = np.cos(rest)
        # Four half turns of φ, which is 4π, leave a quaternion as it is.
        phi = -(np.mod(turns, 4) * pi + np.arctan2(kappa * sine, cosine))
        theta = np.arctan2(s * np.hypot(kappa * sine, cosine), z)
        angles = theta, phi, self._spin(turns, sine, cosine)
        q = np.stack(quaternion_from_euler(angles, ARRAYS), axis=1)
        given = np.array(make_third(self.quaternion, self.axis))
        q = _turned_about_third(q, given)[1:]
        if self.axis == 2:
            return q
        # The way back: the cyclic renaming that makes axis 1 the third one is the inverse of the one for axis 0.
        return np.stack(make_third(tuple(q.T), 1 - self.axis), axis=1)

    def _spin(self, turns: np.ndarray, sine: np.ndarray, cosine: np.ndarray) -> np.ndarray:
        """Spin angle ψ, up to a constant, at τ = turns π + rest with |rest| ≤ π/2."""
        s, z, _ = self._ellipse
        kappa = self.aspect_ratio
        size = hypot(z, s)
        shape = kappa, (s / size) ** 2, (z / size) ** 2
        # A half turn has two quarters, each with the integral from 0 to π/2.
        integral = 2 * turns * _spin_integral(np.array(1.0), np.array(0.0), *shape)
        integral += _spin_integral(sine, cosine, *shape)
        return -(1 - kappa) * (1 + kappa) * z / (2 * kappa * size) * integral


def _spin_integral(
    sine: np.ndarray, cosine: np.ndarray, kappa: float, across: float, along: float
) -> np.ndarray:
    """∫ (cos² - κ² sin²)/(w √(along + across w)) dτ from 0 to τ, with w = cos² + κ² sin² and along + across = 1."""
    with IMPORTS:
        from scipy.special import elliprf, elliprj

    # `x`, `y` and `weight` are written as sums of positive terms. For a thin disc 1 - k² sin², with
    # k² = 1 - κ², would lose digits to cancellation. The result is a difference of two integrals.
    x = cosine**2
    weight = cosine**2 + (kappa * sine) ** 2
    y = along + across * weight
    return sine * elliprf(x, y, 1.0) - 2 * kappa**2 / 3 * sine**3 * elliprj(x, y, 1.0, weight)


def _turned_about_third(q: np.ndarray, given: np.ndarray) -> np.ndarray:
    """Quaternions, shape (n, 4), all turned about the third body axis by the angle that makes the first one `given`."""
    # The turn by an angle ψ multiplies q from the right by (cos ψ/2, 0, 0, sin ψ/2). With q₀ the first
    # quaternion here, c and s are the scalar and the third component of q₀⁻¹ `given`. The other two
    # are rounding.
    c = float(q[0] @ given)
    s = float(q[0] @ np.array([given[3], -given[2], given[1], -given[0]]))
    size = hypot(c, s)
    c = c / size
    s = s / size
    q0, q1, q2, q3 = q.T
    return np.stack([c * q0 - s * q3, c * q1 + s * q2, c * q2 - s * q1, c * q3 + s * q0], axis=1)


def _speed(turning: Factory) -> Factory:
    """The factory of |Ω_J|, in shear rates, of `turning` or `turning_in_any_flow`."""

    def speed(ops: Operations) -> Callable:
        rates = ops.use(turning)
        sqrt = ops.sqrt

        def of(y, p):
            _, (w1, w2, w3) = rates(y, p)
            return sqrt(w1 * w1 + w2 * w2 + w3 * w3)

        return of

    return speed


# The fields with the angle ∫|Ω_J| dt beside the state, by which `harness/references/rotations.py`
# counts the rotations of a run. They are made once, at import: compiled code is cached by the factory,
# and a factory with a new `_speed` would not equal an earlier one.
_WITH_ANGLE: dict[Factory, WithRate] = {
    field: WithRate(field, _speed(turning)),
    field_in_any_flow: WithRate(field_in_any_flow, _speed(turning_in_any_flow)),
}


def with_angle(field: Factory) -> WithRate:
    """One of this module's fields with the angle ∫|Ω_J| dt beside the state."""
    return _WITH_ANGLE[field]


class Jeffery(Form):
    """State (q₀, q₁, q₂, q₃): inertia is gone, the angular velocity follows from the orientation."""

    name = "jeffery"
    summary = "St = 0: orientation alone, with Jeffery's angular velocity; closed form for spheroids in simple shear"
    valid_for = "St = 0, every ellipsoid; closed form (solver 'exact') for spheroids and spheres in simple shear"
    state = ("q0", "q1", "q2", "q3")
    orientation = "full"
    any_flow = True

    def check(self, scene: Scene) -> None:
        self.require_orientation(scene)
        if scene.stokes > 0:
            raise self.refuse(f"St = {scene.stokes:g} is not 0", "quaternion")

    def problem(self, scene: Scene) -> Problem:
        self.check(scene)
        start = self.require_orientation(scene).quaternion
        shape = gyration(scene.ellipsoid)
        factory, flow, table = in_its_flow(scene, field, field_in_any_flow, len(shape))
        parameters = shares(scene.ellipsoid) if scene.flow is None else (*shape, *flow)
        axes = scene.ellipsoid.scaled_axes
        closed_form = None
        if scene.flow is None and scene.ellipsoid.kind != "triaxial":
            axis = Spheroid.of(scene.ellipsoid).axis
            closed_form = JefferyOrbit(axes[axis], axes[(axis + 1) % 3], axis, start).at
        return Problem(
            self.name,
            factory,
            start if table is None else (*start, 0.0),
            scene.time,
            parameters,
            closed_form=closed_form,
            invariant=norm_drift,
            parameter_table=table,
        )

    def observe(self, scene: Scene, states: np.ndarray) -> Observables:
        """Observables, with L and E from Jeffery's angular velocity; quaternions are normalised first."""
        rotation = matrix_from_quaternion(states[:, :4])
        # Along a track the last component of a state is the time (`motion.AlongTrack`). In a constant
        # flow it is q₃, which `Flow.numbers_at` ignores.
        numbers = None if scene.flow is None else scene.flow.numbers_at(states[:, -1])
        spin = jeffery_spin(scene.ellipsoid, rotation, numbers)
        return observe_body(scene.ellipsoid, rotation, spin)
