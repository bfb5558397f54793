"""Euler-angle form of a spheroid: `fsptho`–`fpsso`, corrected, for oblate and prolate shapes alike."""

from collections.abc import Callable

import numpy as np

from polhode.models.form import Form
from polhode.models.forms.euler_angles import IN_WORDS, guarded_sine, require_distance_from_pole
from polhode.models.forms.motion import full_problem
from polhode.models.forms.spheroid import Spheroid, axis_rotation, require_spheroid
from polhode.models.observables import Observables
from polhode.models.operations import Field, Operations
from polhode.models.problem import Factory, Problem
from polhode.models.rotation import (
    Triple,
    euler_from_quaternion,
    euler_rates_from_angular_velocity,
    make_third,
)
from polhode.models.scene import BodyStart, EulerStart, Scene


def _field(ops: Operations, slip: Factory) -> Field:
    """Rates of (θ, φ, θ̇, φ̇, ω₃); p = (alpha, beta, I_a/I_e, 8πX_c/I_a, 8πY_c/I_e, Λ), and a flow's numbers."""
    # From `ultima` in the axes of the line of nodes (ψ = 0), and from `spheroid_wj1`–`spheroid_wj3`.
    # These axes turn with (θ̇, φ̇ sin θ, φ̇ cos θ), the body with (θ̇, φ̇ sin θ, ω₃). As printed,
    # `fsptho`–`fpsso` have misprints.
    cos = ops.cos
    sine = ops.use(guarded_sine)
    slip_of = ops.use(slip)

    def rhs(y, p):
        theta = y[0]
        phi = y[1]
        dtheta = y[2]
        dphi = y[3]
        spin = y[4]
        alpha = p[0]
        beta = p[1]
        inertia_ratio = p[2]
        axial = p[3]
        equatorial = p[4]
        st = sine(theta)
        ct = cos(theta)
        gyration = alpha * (inertia_ratio * spin - dphi * ct)
        slip_theta, slip_phi, slip_spin = slip_of(st, ct, phi, dtheta, dphi, spin, p)
        return (
            dtheta,
            dphi,
            -gyration * dphi * st - beta * equatorial * slip_theta,
            (gyration - alpha * dphi * ct) * dtheta / st - beta * equatorial * slip_phi,
            -beta * axial * slip_spin,
        )

    return rhs


def _slip_in_shear(ops: Operations) -> Callable:
    """(θ̇, φ̇, ω₃) less their values at Jeffery's angular velocity, in simple shear."""
    sin = ops.sin
    cos = ops.cos

    def slip(st, ct, phi, dtheta, dphi, spin, p):
        anisotropy = p[5]
        return (
            dtheta + 0.5 * anisotropy * st * ct * sin(2 * phi),
            dphi + 0.5 + 0.5 * anisotropy * cos(2 * phi),
            spin + 0.5 * ct,
        )

    return slip


def _slip_in_any_flow(ops: Operations) -> Callable:
    """(θ̇, φ̇, ω₃) less their values at Jeffery's angular velocity, in a linear flow."""
    sin = ops.sin
    cos = ops.cos

    def slip(st, ct, phi, dtheta, dphi, spin, p):
        anisotropy = p[5]
        h1 = p[6]
        h2 = p[7]
        h3 = p[8]
        s11 = p[9]
        s22 = p[10]
        s23 = p[11]
        s31 = p[12]
        s12 = p[13]
        sf = sin(phi)
        cf = cos(phi)
        # a is the symmetry axis. m is across it and across the line of nodes, (cos φ, sin φ, 0).
        a1 = st * sf
        a2 = -st * cf
        a3 = ct
        m1 = -sf * ct
        m2 = cf * ct
        m3 = st
        # S times the symmetry axis.
        u1 = s11 * a1 + s12 * a2 + s31 * a3
        u2 = s12 * a1 + s22 * a2 + s23 * a3
        u3 = s31 * a1 + s23 * a2
        about_nodes = h1 * cf + h2 * sf - anisotropy * (m1 * u1 + m2 * u2 + m3 * u3)
        across = h1 * m1 + h2 * m2 + h3 * m3 + anisotropy * (cf * u1 + sf * u2)
        return (
            dtheta - about_nodes,
            dphi - across / st,
            spin - (h1 * a1 + h2 * a2 + h3 * a3),
        )

    return slip


def field(ops: Operations) -> Field:
    """`_field` in simple shear."""
    return _field(ops, _slip_in_shear)


def field_in_any_flow(ops: Operations) -> Field:
    """`_field` in a linear flow."""
    return _field(ops, _slip_in_any_flow)


class SpheroidAngles(Form):
    """State (θ, φ, θ̇, φ̇, ω₃) of the symmetry axis, whichever body axis it is.

    The spin angle ψ says nothing about a spheroid and is left out. The state has ω₃ = ψ̇ + φ̇ cos θ
    in place of ψ̇. The equation of ω₃, `fpsso`, is regular at θ = 0 and π, the equation of ψ̇ is not.
    Near θ = 0 and π the form ends as `EulerAngles` does.
    """

    name = "spheroid-angles"
    summary = "the paper's angles of a spheroid's symmetry axis; singular at θ = 0 and π"
    valid_for = (
        f"spheroids about any body axis, and spheres, as long as |sin θ| ≥ {IN_WORDS} for the symmetry axis; "
        "at St = 0 in its implicit form alone"
    )
    state = ("theta", "phi", "dtheta", "dphi", "w3")
    orientation = "axis"
    any_flow = True
    angles = True

    def check(self, scene: Scene) -> None:
        require_spheroid(self, scene, "euler-angles")
        angles = _angles(scene, self.require_orientation(scene))
        require_distance_from_pole(self, angles[0], "spheroid-axis")

    def problem(self, scene: Scene) -> Problem:
        self.check(scene)
        spheroid = Spheroid.of(scene.ellipsoid)
        given = self.require_orientation(scene)
        w1, w2, w3 = (scene.angular_velocity[(spheroid.axis + shift) % 3] for shift in (1, 2, 3))
        angles = _angles(scene, given)
        dtheta, dphi, _ = euler_rates_from_angular_velocity(angles, (w1, w2, w3))
        if spheroid.axis == 2 and isinstance(given, EulerStart) and scene.stokes > 0:
            dtheta, dphi, _ = given.rates
        start = (*angles[:2], dtheta, dphi, w3)
        inertial = (False, False, True, True, True)
        damping = spheroid.axial_damping, spheroid.equatorial_damping
        shape = (spheroid.inertia_ratio, *damping, spheroid.anisotropy)
        return full_problem(
            self, scene, field, start, inertial, shape, in_any_flow=field_in_any_flow, periodic=(1,)
        )

    def observe(self, scene: Scene, states: np.ndarray) -> Observables:
        spheroid = Spheroid.of(scene.ellipsoid)
        theta, phi, dtheta, dphi, spin = states[:, :5].T
        st = np.sin(theta)
        ct = np.cos(theta)
        sf = np.sin(phi)
        cf = np.cos(phi)
        nodes = np.stack([cf, sf, np.zeros_like(cf)], axis=1)
        across = np.stack([-sf * ct, cf * ct, st], axis=1)
        axis = np.stack([st * sf, -st * cf, ct], axis=1)
        # Components of L along the line of nodes, across it, and along the symmetry axis.
        first = spheroid.equatorial_inertia * dtheta
        second = spheroid.equatorial_inertia * dphi * st
        third = spheroid.axial_inertia * spin
        momentum = first[:, None] * nodes + second[:, None] * across + third[:, None] * axis
        energy = 0.5 * (first * dtheta + second * dphi * st + third * spin)
        return Observables(momentum, energy, axis_rotation(spheroid.axis, axis))


def _angles(scene: Scene, start: EulerStart | BodyStart) -> Triple:
    """Euler angles of the body axes, renamed so that the third one is the symmetry axis."""
    axis = Spheroid.of(scene.ellipsoid).axis
    return start.angles if axis == 2 else euler_from_quaternion(make_third(start.quaternion, axis))
