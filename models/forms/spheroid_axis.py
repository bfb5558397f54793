"""Spheroid in space axes: angular momentum and symmetry axis. No angle, no singularity, six equations."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from polhode.models.form import Form
from polhode.models.forms.motion import full_problem
from polhode.models.forms.spheroid import Spheroid, axis_drift, axis_rotation, require_spheroid
from polhode.models.observables import Observables
from polhode.models.operations import FLOAT, Field, Operations, polynomial
from polhode.models.problem import Factory, Part, Parts, Problem
from polhode.models.scene import Scene

# The parameters p of `field` and of its parts: names in the functions, and what they mean.
#
#     p[0]     (alpha)     mass of L, on the left of the equations alone;
#     p[1]     beta        factor of the torque;
#     p[2]     damping     8πY_c/I_e, of L across p̂;
#     p[3]     excess      8π(X_c - Y_c)/I_e, the surplus of the damping along p̂;
#     p[4]     flattening  I_e/I_a - 1;
#     p[5]     anisotropy  Λ;
#     p[6:9]               half the vorticity h, in any other flow than shear;
#     p[9:14]              its rate of strain S₁₁, S₂₂, S₂₃, S₃₁, S₁₂, less S₃₃ on the diagonal.
#
# The state y is (L_x, L_y, L_z) over I_e, then (p_x, p_y, p_z).


def _field(ops: Operations, slip: Factory) -> Field:
    """dL/dt and dp̂/dt of `ultima` in space axes; `slip` makes ω - Ω_J in a kind of flow."""
    # Mass alpha stands on L and appears nowhere else: torque-free, L is constant. With ω = L/I_e +
    # (1/I_a - 1/I_e)(L·p̂)p̂ and w = ω - Ω_J the torque is -8π(Y_c w + (X_c - Y_c)(w·p̂)p̂). The
    # state holds L/I_e, of order one like p̂ whatever the shape, so that one tolerance suits both.
    # Products of two components of p̂ are divided by |p̂|², which solvers let drift. This takes the
    # error of L and E from 0.1 and more to 1e-3: at St = 100 and kappa = 2 over 10⁴ time units, by
    # RK45, LSODA and DOP853 at tolerance 1e-6. A term that restores the norm does no better.
    slip_of = ops.use(slip)

    def rhs(y, p):
        lx = y[0]
        ly = y[1]
        lz = y[2]
        px = y[3]
        py = y[4]
        pz = y[5]
        beta = p[1]
        damping = p[2]
        excess = p[3]
        flattening = p[4]
        scale = 1 / (px * px + py * py + pz * pz)
        # ω is L/I_e and `spin` times p̂.
        spin = scale * flattening * (lx * px + ly * py + lz * pz)
        wx, wy, wz = slip_of((lx, ly, lz), (px, py, pz), spin, scale, p)
        axial = scale * excess * (wx * px + wy * py + wz * pz)
        return (
            -beta * (damping * wx + axial * px),
            -beta * (damping * wy + axial * py),
            -beta * (damping * wz + axial * pz),
            ly * pz - lz * py,
            lz * px - lx * pz,
            lx * py - ly * px,
        )

    return rhs


def _slip_in_shear(ops: Operations) -> Callable:
    """ω - Ω_J in simple shear: Ω_J = -ẑ/2 + Λ p̂×(E p̂), where E p̂ = (p_y, p_x, 0)/2."""

    def slip(momentum, axis, spin, scale, p):
        lx, ly, lz = momentum
        px, py, pz = axis
        anisotropy = p[5]
        half = scale * 0.5 * anisotropy
        wx = lx + spin * px + half * px * pz
        wy = ly + spin * py - half * py * pz
        wz = lz + spin * pz + 0.5 - half * (px * px - py * py)
        return wx, wy, wz

    return slip


def _slip_in_any_flow(ops: Operations) -> Callable:
    """ω - Ω_J in a linear flow: Ω_J = h + Λ p̂×(S p̂)."""

    def slip(momentum, axis, spin, scale, p):
        lx, ly, lz = momentum
        px, py, pz = axis
        anisotropy = p[5]
        hx = p[6]
        hy = p[7]
        hz = p[8]
        strained = scale * anisotropy
        ex, ey, ez = _strain_on(axis, (p[9], p[10], p[11], p[12], p[13]))
        wx = lx + spin * px - hx - strained * (py * ez - pz * ey)
        wy = ly + spin * py - hy - strained * (pz * ex - px * ez)
        wz = lz + spin * pz - hz - strained * (px * ey - py * ex)
        return wx, wy, wz

    return slip


def _strain_on(axis: Any, strain: Any) -> tuple[Any, Any, Any]:
    """S p̂, of S₁₁, S₂₂, S₂₃, S₃₁, S₁₂, where S₃₃ = 0."""
    px, py, pz = axis
    s11, s22, s23, s31, s12 = strain
    return (
        s11 * px + s12 * py + s31 * pz,
        s12 * px + s22 * py + s23 * pz,
        s31 * px + s23 * py,
    )


def field(ops: Operations) -> Field:
    """`_field` in simple shear."""
    return _field(ops, _slip_in_shear)


def field_in_any_flow(ops: Operations) -> Field:
    """`_field` in a linear flow."""
    return _field(ops, _slip_in_any_flow)


# Largest angle of `rotation`, in rad: half a turn, and a little more, which reaches every moment from the nearest
# whole turn. The polynomials below are made for it; with a larger one they would need more terms.
_REACH = 3.4
# sin θ/θ and (1 - cos θ)/θ² as polynomials of x = θ², lowest power first. They are the nearest ones for
# 0 <= x <= _REACH², within 2.2e-16 there. They are close to Taylor's, 1/(2k + 1)! and 1/(2k + 2)!
# with signs that alternate.
_SINE = (
    1.0,
    -0.16666666666666666,
    0.008333333333333285,
    -0.0001984126984125573,
    2.7557319222422075e-06,
    -2.5052108297380684e-08,
    1.6059040986523186e-10,
    -7.647107505284836e-13,
    2.8107694690976557e-15,
    -8.169600567855619e-18,
    1.7456663177824304e-20,
)
_COSINE = (
    0.5,
    -0.041666666666666664,
    0.0013888888888888868,
    -2.480158730158138e-05,
    2.755731922332951e-07,
    -2.08767569509105e-09,
    1.1470744401720644e-11,
    -4.779453745482048e-14,
    1.5616322922037551e-16,
    -4.088932806344013e-19,
    8.0112940727271335e-22,
)


def rotation_constants(p: Any, h: Any, ops: Operations = FLOAT) -> tuple[Any, ...]:
    """Constants of `rotation`: the time h alone."""
    return (h,)


def rotation(ops: Operations) -> Field:
    """Exact flow of dp̂/dt = (L/I_e) × p̂ at fixed L, for angles θ = |L|h/I_e up to 3.4 rad: the torque-free motion."""
    # With l = hL/I_e, p̂ becomes p̂ + (sin θ/θ) l×p̂ + ((1 - cos θ)/θ²) l×(l×p̂). As θ² = l·l,
    # neither a root nor a trigonometric function is needed, and l = 0 is nothing special.

    def advance(y, c):
        lx = y[0]
        ly = y[1]
        lz = y[2]
        px = y[3]
        py = y[4]
        pz = y[5]
        time = c[0]
        # The components of l, and x = θ².
        kx = time * lx
        ky = time * ly
        kz = time * lz
        x = kx * kx + ky * ky + kz * kz
        # u = l × p̂ and v = l × u.
        sine = polynomial(_SINE, x)
        cosine = polynomial(_COSINE, x)
        ux = ky * pz - kz * py
        uy = kz * px - kx * pz
        uz = kx * py - ky * px
        vx = ky * uz - kz * uy
        vy = kz * ux - kx * uz
        vz = kx * uy - ky * ux
        return (
            lx,
            ly,
            lz,
            px + sine * ux + cosine * vx,
            py + sine * uy + cosine * vy,
            pz + sine * uz + cosine * vz,
        )

    return advance


def relaxation_constants(p: Any, h: Any, ops: Operations = FLOAT) -> tuple[Any, ...]:
    """Constants of `relaxation`, from the shares of its way that L goes along and across p̂ in a time h.

    - c[0]: the share across p̂;
    - c[1]: half of it, with which L_z relaxes to -½;
    - c[2]: Λ/2 times the share across, for the strain;
    - c[3]: the share across less the share along p̂, for L·p̂;
    - c[4]: half of how much less Ω_J·p̂ counts along p̂ than across, for p_z;
    - c[5], c[6]: c[4] - c[2] and c[4] + c[2], for the x and y components.
    """
    across, along, to_axial_spin = _relaxed(p, h, ops)
    strain = 0.5 * p[5] * across
    flow = 0.5 * (across - along / to_axial_spin)
    return across, 0.5 * across, strain, across - along, flow, flow - strain, flow + strain


def _relaxed(p: Any, h: Any, ops: Operations) -> tuple[Any, Any, Any]:
    """Shares of its way that L goes across and along p̂ in a time h, and I_e/I_a."""
    beta = p[1]
    damping = p[2]
    excess = p[3]
    to_axial_spin = 1 + p[4]
    across = -ops.expm1(-beta * damping * h)
    along = -ops.expm1(-beta * (damping + excess) * to_axial_spin * h)
    return across, along, to_axial_spin


def relaxation(ops: Operations) -> Callable[..., tuple[Any, ...]]:
    """Exact flow of dL/dt of `field` at fixed p̂, |p̂| = 1, with mass 1 on L."""
    # Across p̂, L/I_e relaxes at the rate βY = 8πY_c/(St I_e) towards the part of Ω_J across p̂. Along
    # p̂ it relaxes at the rate 8πX_c/(St I_a) towards (I_a/I_e) Ω_J·p̂, where the spheroid rotates with
    # the flow: Ω_J·p̂ = -p_z/2. With the shares a across and b along p̂, L gains
    #
    #     a (Ω_J - L) + [(a - b) L·p̂ + (b I_a/I_e - a) Ω_J·p̂] p̂.
    #
    # `before` is a state of the same L·p̂, known earlier. `gains` is what L has gained since some
    # time, which advances in place of L.

    def advance(y, c, before=None, gains=None):
        lx = y[0]
        ly = y[1]
        lz = y[2]
        px = y[3]
        py = y[4]
        pz = y[5]
        gx, gy, gz = (lx, ly, lz) if gains is None else gains
        across = c[0]
        half = c[1]
        strain = c[2]
        across_less_along = c[3]
        flow = c[4]
        flow_less_strain = c[5]
        flow_and_strain = c[6]
        at = y if before is None else before
        axial = across_less_along * (lx * at[3] + ly * at[4] + lz * at[5])
        return (
            (gx - across * lx) + (flow_less_strain * pz + axial) * px,
            (gy - across * ly) + (flow_and_strain * pz + axial) * py,
            (gz - across * lz - half) + strain * (px * px - py * py) + (flow * pz + axial) * pz,
            px,
            py,
            pz,
        )

    return advance


def relaxation_constants_in_any_flow(p: Any, h: Any, ops: Operations = FLOAT) -> tuple[Any, ...]:
    """Constants of `relaxation_in_any_flow`, from the shares of L's way in a time h.

    - c[0]: the share across p̂;
    - c[1]: the share across less the share along p̂, for L·p̂;
    - c[2:5]: the share across times the flow's vector h;
    - c[5:8]: how much less Ω_J·p̂ counts along p̂ than across, times h;
    - c[8:13]: the share across times Λ S, in the order of S in p.
    """
    across, along, to_axial_spin = _relaxed(p, h, ops)
    hx = p[6]
    hy = p[7]
    hz = p[8]
    flow = across - along / to_axial_spin
    strain = p[5] * across
    return (
        across,
        across - along,
        across * hx,
        across * hy,
        across * hz,
        flow * hx,
        flow * hy,
        flow * hz,
        strain * p[9],
        strain * p[10],
        strain * p[11],
        strain * p[12],
        strain * p[13],
    )


def relaxation_in_any_flow(ops: Operations) -> Callable[..., tuple[Any, ...]]:
    """As `relaxation`, in a linear flow: along p̂ the spheroid rotates with h·p̂."""

    def advance(y, c, before=None, gains=None):
        lx = y[0]
        ly = y[1]
        lz = y[2]
        px = y[3]
        py = y[4]
        pz = y[5]
        gx, gy, gz = (lx, ly, lz) if gains is None else gains
        across = c[0]
        across_less_along = c[1]
        # Shares of h, across p̂ and along it.
        hx = c[2]
        hy = c[3]
        hz = c[4]
        flow_x = c[5]
        flow_y = c[6]
        flow_z = c[7]
        at = y if before is None else before
        ex, ey, ez = _strain_on((px, py, pz), (c[8], c[9], c[10], c[11], c[12]))
        axial = across_less_along * (lx * at[3] + ly * at[4] + lz * at[5])
        axial = axial - (flow_x * px + flow_y * py + flow_z * pz)
        return (
            (gx - across * lx + hx) + (py * ez - pz * ey) + axial * px,
            (gy - across * ly + hy) + (pz * ex - px * ez) + axial * py,
            (gz - across * lz + hz) + (px * ey - py * ex) + axial * pz,
            px,
            py,
            pz,
        )

    return advance


def _both(
    ops: Operations, relaxation: Callable[[Operations], Callable[..., Sequence[Any]]]
) -> Callable[..., Sequence[Any]]:
    """`rotation`, then a relaxation, which need not wait for all of it: L·p̂ stays the same."""
    turn = rotation(ops)
    relax = relaxation(ops)
    return lambda y, fast, slow, gains=None: relax(turn(y, fast), slow, y, gains)


def both(ops: Operations) -> Callable[..., Sequence[Any]]:
    """`_both` in simple shear."""
    return _both(ops, relaxation)


def both_in_any_flow(ops: Operations) -> Callable[..., Sequence[Any]]:
    """`_both` in a linear flow."""
    return _both(ops, relaxation_in_any_flow)


def rotation_rate(ops: Operations) -> Callable[[Any, Any], Any]:
    """|L|/I_e, the rate in rad per unit of time at which p̂ goes round L."""
    sqrt = ops.sqrt
    return lambda y, p: sqrt(y[0] * y[0] + y[1] * y[1] + y[2] * y[2])


def relaxation_rate(p: Sequence[float]) -> float:
    """The larger one of L's rates of relaxation across and along p̂, in shear rates."""
    beta = p[1]
    damping = p[2]
    excess = p[3]
    to_axial_spin = 1 + p[4]
    return beta * max(damping, (damping + excess) * to_axial_spin)


def forgetting_rate(p: Sequence[float]) -> float:
    """The rate, in shear rates, at which L_y decays beside L_z (`lxsmain`–`nsmain`) once the motion has settled.

    It is the rate of a rod that tumbles, κ → ∞, or of a disc that spins, κ → 0; an estimate in between.
    """
    beta = p[1]
    damping = p[2]
    excess = p[3]
    to_axial_spin = 1 + p[4]
    across = beta * damping
    along = beta * (damping + excess) * to_axial_spin
    # I_a/I_e, below 1 for a prolate spheroid, which tumbles at L_z = -I_e/2; an oblate one spins at
    # L_z = -I_a/2.
    ratio = 1 / to_axial_spin
    return 0.5 * ratio * (across + along) if ratio < 1 else across * (2 / ratio - 1)


def slow_quantities(y: Any) -> tuple[Any, ...]:
    """L and L·p̂, which are constant while p̂ goes round L."""
    return y[0], y[1], y[2], y[0] * y[3] + y[1] * y[4] + y[2] * y[5]


def restored(y: Any) -> tuple[Any, ...]:
    """The state with p̂ of length one, if it nearly is."""
    # One step of Newton's method for 1/|p̂|: (3 - |p̂|²)/2.
    lx, ly, lz, px, py, pz = y
    scale = (1.5 - 0.5 * pz * pz) - 0.5 * (px * px + py * py)
    return lx, ly, lz, scale * px, scale * py, scale * pz


PARTS = Parts(
    fast=Part(rotation_constants, rotation),
    slow=Part(relaxation_constants, relaxation),
    rate=rotation_rate,
    strength=relaxation_rate,
    forgetting=forgetting_rate,
    reach=_REACH,
    moving=(3, 6),  # p̂
    slow_quantities=slow_quantities,
    both=both,
    restored=restored,
)
_PARTS_IN_ANY_FLOW = replace(
    PARTS,
    slow=Part(relaxation_constants_in_any_flow, relaxation_in_any_flow),
    both=both_in_any_flow,
)


_PARTS: dict[Factory, Parts] = {field: PARTS, field_in_any_flow: _PARTS_IN_ANY_FLOW}


def parameters(spheroid: Spheroid) -> tuple[float, float, float, float]:
    """Shape parameters of `field`: `damping`, `excess`, `flattening`, `anisotropy`."""
    # 8πX_c/I_e, and I_e/I_a - 1 = Λ I_e/I_a.
    axial = spheroid.axial_damping * spheroid.inertia_ratio
    return (
        spheroid.equatorial_damping,
        axial - spheroid.equatorial_damping,
        spheroid.anisotropy / spheroid.inertia_ratio,
        spheroid.anisotropy,
    )


class SpheroidAxis(Form):
    """State (L, p̂) in space axes, L in units of I_e; the spin about p̂ is known by its rate alone, through L·p̂."""

    name = "spheroid-axis"
    summary = "angular momentum and symmetry axis of a spheroid in space axes; no singularity"
    valid_for = "spheroids about any body axis, and spheres; at St = 0 in its implicit form alone"
    state = ("Lx/Ie", "Ly/Ie", "Lz/Ie", "px", "py", "pz")
    orientation = "axis"
    any_flow = True

    def check(self, scene: Scene) -> None:
        require_spheroid(self, scene, "quaternion")
        self.require_orientation(scene)

    def problem(self, scene: Scene) -> Problem:
        self.check(scene)
        spheroid = Spheroid.of(scene.ellipsoid)
        momentum = scene.initial.angular_momentum[0] / spheroid.equatorial_inertia
        start = *momentum.tolist(), *scene.initial_rotation[spheroid.axis].tolist()
        inertial = (True,) * 3 + (False,) * 3
        shape = parameters(spheroid)
        problem = full_problem(
            self,
            scene,
            field,
            start,
            inertial,
            shape,
            in_any_flow=field_in_any_flow,
            invariant=axis_drift,
        )
        # Along a track the slow part has no closed flow.
        return replace(problem, parts=_PARTS.get(problem.field))

    def observe(self, scene: Scene, states: np.ndarray) -> Observables:
        spheroid = Spheroid.of(scene.ellipsoid)
        momentum = states[:, :3] * spheroid.equatorial_inertia
        axis = states[:, 3:6]
        direction = axis / np.linalg.norm(axis, axis=1, keepdims=True)
        axial = np.sum(momentum * direction, axis=1)
        across = momentum - axial[:, None] * direction
        energy = (
            axial**2 / spheroid.axial_inertia
            + np.sum(across**2, axis=1) / spheroid.equatorial_inertia
        )
        return Observables(momentum, 0.5 * energy, axis_rotation(spheroid.axis, direction))
