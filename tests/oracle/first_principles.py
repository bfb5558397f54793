"""Rotation of a massive ellipsoid in simple shear flow, straight from the definitions.

NumPy and SciPy only; nothing of the project is imported and no printed formula of the paper is used
where a definition can be computed instead. The inputs are the vector equation (`ultima`), Stokes
flow around an ellipsoid (a single layer of stokeslets), rotation matrices built from elementary
rotations, and quadrature along the polhode.

Conventions: flow u = y x̂, time in inverse shear rates, slow time t₂ = t/St; row i of a rotation
matrix is body axis i in space components; L is in space axes; the semi-axes (a, b, c) belong to the
body axes (x', y', z'), in any order. Names such as `ultima` are labels of the paper's equations.
"""

from functools import cache
from typing import NamedTuple

import numpy as np
from scipy.integrate import solve_ivp

SHEAR = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
LEVI_CIVITA = np.array(
    [[[(i - j) * (j - k) * (k - i) / 2 for k in range(3)] for j in range(3)] for i in range(3)]
)
CYCLIC = ((0, 1, 2), (1, 2, 0), (2, 0, 1))


class Body(NamedTuple):
    """Semi-axes, moments of inertia and resistances, each of shape (3,), for one choice of the length unit."""

    semi_axes: np.ndarray
    inertia: np.ndarray
    resistance: np.ndarray


@cache
def body(semi_axes, length=None):
    """Body of the semi-axes (a tuple), all in units of `length` (default: the longest semi-axis)."""
    axes = np.asarray(semi_axes, dtype=float) / (max(semi_axes) if length is None else length)
    return Body(axes, inertia(axes), resistance(axes))


# --- shape -----------------------------------------------------------------------------------------------------------


def unit_sphere(order=120):
    """Nodes (n, 3) and weights (n,) of the product rule (Gauss–Legendre times trapezoid) on the unit sphere.

    n is twice the square of the order. The default order is an estimate, for bodies of moderate aspect ratios; the
    tests that compare with it show that it serves.
    """
    cosine, weight = np.polynomial.legendre.leggauss(order)
    azimuth = np.arange(2 * order) * np.pi / order
    sine = np.sqrt(1 - cosine**2)
    nodes = np.stack(
        [
            np.outer(sine, np.cos(azimuth)),
            np.outer(sine, np.sin(azimuth)),
            np.outer(cosine, np.ones_like(azimuth)),
        ],
        axis=-1,
    )
    return nodes.reshape(-1, 3), np.repeat(weight * np.pi / order, 2 * order)


def inertia(axes):
    """Moments ∫ (y² + z²) dV and cyclic of the solid ellipsoid of unit density."""
    # Exact: the integrand is of degree 2, and order 8 serves up to degree 15.
    nodes, weights = unit_sphere(8)
    second = np.prod(axes) * axes**2 * (weights @ nodes**2) / 5
    return second.sum() - second


def stokeslet_gradient(axes):
    """Tensor K[i, k, j, m]: gradient ∂_k u_i at the centre made by the force density f_j dS = A_jm y_m abc dΩ.

    A layer of that form makes a linear flow throughout the ellipsoid, so the gradient at the centre
    is the gradient on the surface. Viscosity is one.
    """
    nodes, weights = unit_sphere()
    y = nodes * axes
    distance = np.linalg.norm(y, axis=1)
    r = -y
    delta = np.eye(3)
    first = (
        np.einsum("ik,nj->nikj", delta, r)
        + np.einsum("jk,ni->nikj", delta, r)
        - np.einsum("ij,nk->nikj", delta, r)
    )
    third = np.einsum("ni,nj,nk->nikj", r, r, r)
    gradient = (
        first / distance[:, None, None, None] ** 3 - 3 * third / distance[:, None, None, None] ** 5
    )
    return np.prod(axes) / (8 * np.pi) * np.einsum("n,nikj,nm->ikjm", weights, gradient, y)


def resistance(axes):
    """Resistances X_i: the torque that turns the body about axis i at unit rate is 8π X_i."""
    tensor = stokeslet_gradient(axes)
    torque = np.empty(3)
    for i, j, k in CYCLIC:
        matrix = _pair_block(tensor, j, k)
        force_kj, force_jk = np.linalg.solve(matrix, [1.0, -1.0])
        torque[i] = (
            4 * np.pi / 3 * np.prod(axes) * (axes[j] ** 2 * force_kj - axes[k] ** 2 * force_jk)
        )
    return torque / (8 * np.pi)


def torque_free_angular_velocity(axes, gradient):
    """Torque-free angular velocity (3,) in the ambient linear flow u_i = gradient_ij x_j, all in body axes."""
    tensor = stokeslet_gradient(np.asarray(axes, dtype=float))
    omega = np.empty(3)
    for i, j, k in CYCLIC:
        matrix = np.zeros((3, 3))
        matrix[:2, :2] = _pair_block(tensor, j, k)
        matrix[:2, 2] = -1.0, 1.0
        matrix[2, :2] = axes[j] ** 2, -(axes[k] ** 2)
        omega[i] = np.linalg.solve(matrix, [-gradient[k, j], -gradient[j, k], 0.0])[2]
    return omega


def _pair_block(tensor, j, k):
    """Map from the force coefficients (A_kj, A_jk) to the gradients (∂_j u_k, ∂_k u_j)."""
    return np.array(
        [[tensor[k, j, k, j], tensor[k, j, j, k]], [tensor[j, k, k, j], tensor[j, k, j, k]]]
    )


def jeffery(semi_axes, rotation):
    """Jeffery's angular velocity in body axes, (b² G'₃₂ − c² G'₂₃)/(b² + c²) and cyclic with G' the shear in body axes.

    `rotation` has shape (..., 3, 3); the result (..., 3). A test compares it with
    `torque_free_angular_velocity`.
    """
    gradient = rotation @ SHEAR @ np.swapaxes(rotation, -1, -2)
    square = np.asarray(semi_axes) ** 2
    return np.stack(
        [
            (square[j] * gradient[..., k, j] - square[k] * gradient[..., j, k])
            / (square[j] + square[k])
            for _, j, k in CYCLIC
        ],
        axis=-1,
    )


# --- kinematics ------------------------------------------------------------------------------------------------------


def rotation_from_euler(theta, phi, psi):
    """Rotation matrix of the zxz Euler angles from three elementary rotations (`tiju`); the angles may be complex."""

    def about_z(angle):
        return np.array(
            [[np.cos(angle), np.sin(angle), 0], [-np.sin(angle), np.cos(angle), 0], [0, 0, 1]]
        )

    about_x = np.array(
        [[1, 0, 0], [0, np.cos(theta), np.sin(theta)], [0, -np.sin(theta), np.cos(theta)]]
    )
    return about_z(psi) @ about_x @ about_z(phi)


def body_rates(angles, rates):
    """Angular velocity in body axes from the derivative of the rotation matrix along (θ, φ, ψ) with the given rates."""
    # A complex step: nothing is subtracted, so that any step far below rounding does.
    step = 1e-30
    moved = rotation_from_euler(*(np.asarray(angles) + 1j * step * np.asarray(rates)))
    spin = (moved.imag / step) @ moved.real.T
    return np.array([spin[1, 2], spin[2, 0], spin[0, 1]])


def momentum_and_energy(shape, rotation, omega):
    """L in space axes, shape (..., 3), and E, shape (...,), for body-axis angular velocity `omega`."""
    momentum = np.einsum("...ij,...i->...j", rotation, shape.inertia * omega)
    return momentum, np.sum(shape.inertia * omega**2, axis=-1) / 2


# --- dynamics --------------------------------------------------------------------------------------------------------


def slow_rates(shape, rotation, omega):
    """St dL/dt in space axes and St dE/dt of `ultima`."""
    torque = -8 * np.pi * shape.resistance * (omega - jeffery(shape.semi_axes, rotation))
    return np.einsum("...ij,...i->...j", rotation, torque), np.sum(torque * omega, axis=-1)


def integrate(shape, stokes, angles, rates, times, tolerance=1e-11):
    """Solve `ultima` and return the rotation matrices (n, 3, 3) and body-axis angular velocities (n, 3) at `times`.

    The state is the rotation matrix and L in space axes: d t_ij/dt = −[ω×] t and dL/dt from
    `slow_rates`. `tolerance` is relative, of a step; a hundredth of it is the absolute one. The
    default is an estimate, near the least of double precision.
    """
    start = rotation_from_euler(*angles)
    omega = body_rates(angles, rates)

    def field(_, state):
        rotation, momentum = state[:9].reshape(3, 3), state[9:]
        omega = rotation @ momentum / shape.inertia
        return np.concatenate(
            [-np.cross(omega, rotation.T).T.ravel(), slow_rates(shape, rotation, omega)[0] / stokes]
        )

    state = np.concatenate([start.ravel(), momentum_and_energy(shape, start, omega)[0]])
    solution = solve_ivp(
        field,
        (0, times[-1]),
        state,
        method="DOP853",
        t_eval=times,
        rtol=tolerance,
        atol=tolerance * 1e-2,
    )
    assert solution.success
    rotation = solution.y[:9].T.reshape(-1, 3, 3)
    return rotation, np.einsum("nij,nj->ni", rotation, solution.y[9:].T) / shape.inertia


# --- the Euler top and averages over it ------------------------------------------------------------------------------


class Polhode(NamedTuple):
    """One closed polhode: body-axis momenta (n, 3), fractions of the period spent at each (n,), the period."""

    momentum: np.ndarray
    weight: np.ndarray
    period: float


def enclosed_axis(moments, momentum, energy):
    """Index of the principal axis that the polhode encircles (the odd one for a spheroid).

    Moments that agree to 1e-12 count as equal: to rounding.
    """
    low, middle, high = np.argsort(moments)
    if np.isclose(moments[low], moments[middle], rtol=1e-12):
        return high
    if np.isclose(moments[middle], moments[high], rtol=1e-12):
        return low
    return high if momentum**2 > 2 * energy * moments[middle] else low


def polhode(moments, momentum, energy, nodes=512):
    """Polhode over the angle about the axis it encloses; the time spent per angle is 1/(rate of the angle).

    The rate comes from Euler's equations dm/dt = m × ω; equispaced nodes make every quadrature
    spectrally accurate. The default of `nodes` is an estimate: near the separatrix it takes more.
    """
    i, j, k = CYCLIC[enclosed_axis(moments, momentum, energy)]
    angle = 2 * np.pi * np.arange(nodes) / nodes
    shape = np.sin(angle) ** 2 / moments[j] + np.cos(angle) ** 2 / moments[k] - 1 / moments[i]
    radius = np.sqrt((2 * energy - momentum**2 / moments[i]) / shape)
    m = np.empty((nodes, 3))
    m[:, j], m[:, k], m[:, i] = (
        radius * np.sin(angle),
        radius * np.cos(angle),
        np.sqrt(momentum**2 - radius**2),
    )
    turn = np.cross(m, m / moments)
    rate = (turn[:, j] * m[:, k] - m[:, j] * turn[:, k]) / radius**2
    per_angle = 1 / np.abs(rate)
    return Polhode(m, per_angle / per_angle.sum(), 2 * np.pi * per_angle.mean())


def aligned_frame(momentum):
    """Any rotation matrix whose third column is the direction of `momentum` (the columns of `fodij` are one choice)."""
    third = momentum / np.linalg.norm(momentum, axis=-1, keepdims=True)
    first = np.cross(np.eye(3)[np.argmin(np.abs(third), axis=-1)], third)
    first /= np.linalg.norm(first, axis=-1, keepdims=True)
    return np.stack([first, np.cross(third, first), third], axis=-1)


def euler_top_ensemble(moments, momentum, energy, phases=8, nodes=512):
    """Orientations of the Euler top with the given L (3,) and E, its body rates and weights of the long-time average.

    Uniform in time along the polhode and uniform in the precession angle about L. Returns rotations
    (n, 3, 3) in space axes, rotations in L-aligned axes, body rates (n, 3) and weights (n,) that
    add up to one, where n is `phases` times `nodes`. Eight phases are exact for harmonics of the
    precession angle up to the seventh; rates have some up to the third.
    """
    size = np.linalg.norm(momentum)
    curve = polhode(moments, size, energy, nodes)
    angle = 2 * np.pi * np.arange(phases) / phases
    turns = np.array([rotation_from_euler(0.0, value, 0.0) for value in angle])
    in_aligned = np.einsum("nij,pjk->npik", aligned_frame(curve.momentum), turns).reshape(-1, 3, 3)
    rates = np.repeat(curve.momentum / moments, phases, axis=0)
    weights = np.repeat(curve.weight / phases, phases)
    return in_aligned @ aligned_frame(momentum).T, in_aligned, rates, weights


def averaged_rates(shape, momentum, energy, nodes=512):
    """Rates of L (3,) and E in slow time, averaged over the Euler top by brute force."""
    rotation, _, omega, weights = euler_top_ensemble(
        shape.inertia, np.asarray(momentum, dtype=float), energy, nodes=nodes
    )
    torque, power = slow_rates(shape, rotation, omega)
    return weights @ torque, weights @ power
