"""Orientation of the body axes: zxz Euler angles, unit quaternions, the matrix t_ij (`tiju`).

Labels such as `tiju` stand in the paper's LaTeX source (`docs/misprints.md`). A quaternion is
(q0, q1, q2, q3) with the scalar part first.
"""

from math import atan2, cos, hypot, sin
from typing import Any

import numpy as np

from polhode.models.operations import FLOAT, Operations
from polhode.models.shape import Triple

Array = np.ndarray
Quaternion = tuple[float, float, float, float]

# Squares of numbers between this one and its inverse neither underflow nor overflow, which they do near
# 1e-154 and 1e154. The margin keeps the squares of components that are 1e-14 of the largest one. An estimate.
_SMALLEST_SIZE = 1e-140


def quaternion_from_euler(angles: Any, ops: Operations = FLOAT) -> Any:
    """Unit quaternion of the zxz Euler angles (θ, φ, ψ) in rad; rows of its matrix are the body axes (`tiju`)."""
    cos = ops.cos
    sin = ops.sin
    theta, phi, psi = angles
    c = cos(theta / 2)
    s = sin(theta / 2)
    plus = (phi + psi) / 2
    minus = (phi - psi) / 2
    return c * cos(plus), s * cos(minus), s * sin(minus), c * sin(plus)


def euler_from_quaternion(q: Quaternion) -> Triple:
    """Euler angles (θ, φ, ψ) in rad of a unit quaternion; φ = 0 is chosen where θ = 0 or π leaves one free.

    θ lies in [0, π], φ and ψ between -2π and 2π.
    """
    q0, q1, q2, q3 = q
    c = hypot(q0, q3)
    s = hypot(q1, q2)
    plus = atan2(q3, q0) if c > 0 else 0.0
    minus = atan2(q2, q1) if s > 0 else -plus
    if c == 0:
        plus = -minus
    return 2 * atan2(s, c), plus + minus, plus - minus


def angular_velocity_from_euler(
    angles: Any, rates: Any, ops: Operations = FLOAT
) -> tuple[Any, Any, Any]:
    """Body angular velocity (ω₁, ω₂, ω₃) of Euler angles and their rates (θ̇, φ̇, ψ̇) (`omg1def`–`omg3def`)."""
    cos = ops.cos
    sin = ops.sin
    theta, _, psi = angles
    dtheta, dphi, dpsi = rates
    return (
        dphi * sin(theta) * sin(psi) + dtheta * cos(psi),
        dphi * sin(theta) * cos(psi) - dtheta * sin(psi),
        dphi * cos(theta) + dpsi,
    )


def euler_rates_from_angular_velocity(angles: Triple, omega: Triple) -> Triple:
    """Rates (θ̇, φ̇, ψ̇) of Euler angles with sin θ ≠ 0 from the body angular velocity; inverts `omg1def`–`omg3def`."""
    theta, _, psi = angles
    across = omega[0] * sin(psi) + omega[1] * cos(psi)
    precession = across / sin(theta)
    return omega[0] * cos(psi) - omega[1] * sin(psi), precession, omega[2] - precession * cos(theta)


def make_third(q: Quaternion, axis: int) -> Quaternion:
    """Quaternion after the cyclic renaming of the body axes that makes `axis` (0, 1, 2) the third one."""
    if axis == 2:
        return q
    # The product with the quaternion (½, ±½, ±½, ±½): a third of a turn about (1, 1, 1).
    q0, q1, q2, q3 = (component / 2 for component in q)
    if axis == 0:
        return q0 - q1 - q2 - q3, q1 + q0 + q2 - q3, q2 + q0 + q3 - q1, q3 + q0 + q1 - q2
    return q0 + q1 + q2 + q3, q1 - q0 - q2 + q3, q2 - q0 - q3 + q1, q3 - q0 - q1 + q2


def matrix_from_euler(angles: Array) -> Array:
    """Matrices t_ij, shape (..., 3, 3), of zxz Euler angles (θ, φ, ψ) in rad, shape (..., 3) (`tiju`)."""
    st, sf, ss = np.moveaxis(np.sin(angles), -1, 0)
    ct, cf, cs = np.moveaxis(np.cos(angles), -1, 0)
    rows = [
        [cs * cf - sf * ss * ct, sf * cs + ss * cf * ct, st * ss],
        [-ss * cf - sf * cs * ct, -sf * ss + cs * cf * ct, st * cs],
        [st * sf, -st * cf, ct],
    ]
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))


def matrix_from_quaternion(q: Array) -> Array:
    """Matrices t_ij, shape (..., 3, 3), of quaternions, shape (..., 4); row i is body axis i in space components."""
    # The matrix is divided by the squared norm, so that its rows stay unit vectors where a solver let the norm
    # drift.
    q0, q1, q2, q3 = (q[..., i] for i in range(4))
    with np.errstate(over="ignore"):
        a = q0 * q0
        b = q1 * q1
        c = q2 * q2
        d = q3 * q3
        square = a + b + c + d
    if not ((square > _SMALLEST_SIZE**2) & (square < 1 / _SMALLEST_SIZE**2)).all():
        # Squares vanish or overflow. A quaternion of zeros has no matrix: its components become NaN.
        with np.errstate(invalid="ignore"):
            q = q / np.abs(q).max(axis=-1, keepdims=True)
        q0, q1, q2, q3 = (q[..., i] for i in range(4))
        a = q0 * q0
        b = q1 * q1
        c = q2 * q2
        d = q3 * q3
        square = a + b + c + d
    x = q1 * q2
    y = q1 * q3
    z = q2 * q3
    u = q0 * q1
    v = q0 * q2
    w = q0 * q3
    matrix = np.empty((*q.shape[:-1], 3, 3), dtype=square.dtype)
    matrix[..., 0, 0] = a + b - c - d
    matrix[..., 1, 1] = a - b + c - d
    matrix[..., 2, 2] = a - b - c + d
    matrix[..., 0, 1] = 2 * (x + w)
    matrix[..., 0, 2] = 2 * (y - v)
    matrix[..., 1, 0] = 2 * (x - w)
    matrix[..., 1, 2] = 2 * (z + u)
    matrix[..., 2, 0] = 2 * (y + v)
    matrix[..., 2, 1] = 2 * (z - u)
    return matrix / square[..., None, None]


def quaternion_from_matrix(matrices: Array) -> Array:
    """Unit quaternions, shape (..., 4), of matrices t_ij, shape (..., 3, 3), each of either sign."""
    t = np.moveaxis(np.asarray(matrices), (-2, -1), (0, 1))
    a = t[0, 0]
    b = t[1, 1]
    c = t[2, 2]
    x = t[1, 2] - t[2, 1]
    y = t[2, 0] - t[0, 2]
    z = t[0, 1] - t[1, 0]
    u = t[1, 2] + t[2, 1]
    v = t[2, 0] + t[0, 2]
    w = t[0, 1] + t[1, 0]
    # 4 q_i q_j: the row of the largest component is the quaternion but for its size.
    rows = [
        [1 + a + b + c, x, y, z],
        [x, 1 + a - b - c, w, v],
        [y, w, 1 - a + b - c, u],
        [z, v, u, 1 - a - b + c],
    ]
    products = np.moveaxis(np.array(rows), (0, 1), (-2, -1))
    largest = np.argmax(np.einsum("...ii->...i", products), axis=-1)[..., None, None]
    row = np.take_along_axis(products, largest, axis=-2)[..., 0, :]
    return row / np.linalg.norm(row, axis=-1, keepdims=True)
