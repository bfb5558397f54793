"""Poincaré sections of the Jeffery top (St = 0), and how neighbouring orbits part."""

from math import pi

import numpy as np

from polhode.models.flow import jeffery_angular_velocity, shares
from polhode.models.forms.jeffery import field as jeffery_field
from polhode.models.operations import Field, Operations, numpy_operations
from polhode.models.problem import Problem
from polhode.models.rotation import matrix_from_quaternion, quaternion_from_euler
from polhode.models.shape import Ellipsoid
from polhode.solvers.solve import solve

TOLERANCE = 1e-12
# Sampling step, in inverse shear rates, of the orbits.
STEP = 0.2


class Dual:
    """A number and its derivative along a direction: one field gives its own tangent equations."""

    __array_ufunc__ = None

    def __init__(self, value: object, slope: object) -> None:
        self.value, self.slope = value, slope

    def __add__(self, other: object) -> "Dual":
        value, slope = _parts(other)
        return Dual(self.value + value, self.slope + slope)

    __radd__ = __add__

    def __neg__(self) -> "Dual":
        return Dual(-self.value, -self.slope)  # pyright: ignore[reportOperatorIssue]

    def __sub__(self, other: object) -> "Dual":
        value, slope = _parts(other)
        return Dual(self.value - value, self.slope - slope)

    def __mul__(self, other: object) -> "Dual":
        value, slope = _parts(other)
        return Dual(self.value * value, self.value * slope + self.slope * value)

    __rmul__ = __mul__

    def __rtruediv__(self, other: object) -> "Dual":
        value = 1.0 / self.value  # pyright: ignore[reportOperatorIssue]
        return Dual(value, -value * value * self.slope) * other


def _parts(number: object) -> tuple:
    return (number.value, number.slope) if isinstance(number, Dual) else (number, 0.0)


def tangent_field(ops: Operations) -> Field:
    """Jeffery's equations with one tangent vector of unit length and the logarithm of its stretching.

    State (q, u, s): u' = Ju - gu, s' = g = u·Ju/u² with the Jacobian J of `jeffery`; all components stay of order one.
    Without the division by u² the unit length would be unstable wherever the tangent shrinks.
    """
    base = jeffery_field(ops)

    def rhs(y, p):  # noqa: ANN001, ANN202
        rates = base([Dual(y[i], y[4 + i]) for i in range(4)], [Dual(p[i], 0.0) for i in range(6)])
        push = [rate.slope for rate in rates]
        length2 = y[4] * y[4] + y[5] * y[5] + y[6] * y[6] + y[7] * y[7]
        along = (push[0] * y[4] + push[1] * y[5] + push[2] * y[6] + push[3] * y[7]) / length2
        turned = [push[i] - along * y[4 + i] for i in range(4)]
        return *(rate.value for rate in rates), *turned, along

    return rhs


def section_points(ellipsoid: Ellipsoid, times: np.ndarray, orientation: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """θ and ψ in rad where φ = nπ, from quaternions, shape (n, 4), at times of shape (n,), by cubic interpolation.

    φ = nπ is where the flow component t₃₁ of z' vanishes; ψ is given from -π/2 to π/2, its symmetry taken out.
    """
    q0, q1, q2, q3 = orientation.T
    height = q1 * q3 + q0 * q2
    before = np.flatnonzero(height[:-1] * height[1:] < 0)
    step = (times[before + 1] - times[before])[:, None]
    values, slopes = zip(*(_with_rates(ellipsoid, orientation[index]) for index in (before, before + 1)), strict=True)

    def at(place: np.ndarray, row: int | slice, column: int) -> np.ndarray:
        u = place[:, None]
        ends = [array[:, row, column].reshape(len(u), -1) for array in (*values, *slopes)]
        value = (1 + 2 * u) * (1 - u) ** 2 * ends[0] + u * (1 - u) ** 2 * step * ends[2]
        return value + u * u * (3 - 2 * u) * ends[1] + u * u * (u - 1) * step * ends[3]

    place = height[before] / (height[before] - height[before + 1])
    for _ in range(4):
        shift, nudge = at(place, 2, 0)[:, 0], at(place + 1e-6, 2, 0)[:, 0]
        place = np.clip(place - 1e-6 * shift / (nudge - shift), 0.0, 1.0)
    vorticity = at(place, slice(None), 2)
    theta = np.arccos(np.clip(vorticity[:, 2] / np.linalg.norm(vorticity, axis=1), -1, 1))
    psi = np.arctan2(vorticity[:, 0], vorticity[:, 1])
    return theta, (psi + pi / 2) % pi - pi / 2


def _with_rates(ellipsoid: Ellipsoid, orientation: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """t_ij and its rates, shape (n, 3, 3): each column c of t_ij, a space axis in body axes, obeys c' = c × ω."""
    rotation = matrix_from_quaternion(orientation)
    jeffery = jeffery_angular_velocity(numpy_operations())
    omega = np.stack(jeffery(rotation[:, :, 0].T, rotation[:, :, 1].T, shares(ellipsoid)), axis=1)
    return rotation, np.cross(rotation, omega[:, :, None], axis=1)


def chaos_border(turns: float) -> float:
    """Stretching, as a logarithm, above which an orbit of so many half turns counts as chaotic.

    Neighbours of a regular orbit part linearly in time, so that their stretching grows like the logarithm of the turns.
    """
    return 3 * float(np.log(turns))


def half_turn(ellipsoid: Ellipsoid) -> float:
    """Half a Jeffery period of the longest and the shortest axis, the slowest turn, in inverse shear rates."""
    kappa = max(ellipsoid.semi_axes) / min(ellipsoid.semi_axes)
    return pi * (kappa + 1 / kappa)


def stretched_orbit(
    ellipsoid: Ellipsoid, theta: float, psi: float, duration: float
) -> tuple[tuple[np.ndarray, np.ndarray], float]:
    """Section points, θ and ψ, of the orbit from φ = 0, and the logarithm of its stretching."""
    start = (*quaternion_from_euler((theta, 0.0, psi)), 0.5, -0.5, 0.5, -0.5, 0.0)
    times = np.linspace(0.0, duration, int(duration / STEP) + 2)
    problem = Problem("jeffery-tangent", tangent_field, start, duration, shares(ellipsoid))
    states = _solved(problem, times, TOLERANCE)
    return section_points(ellipsoid, times, states[:, :4]), float(states[-1, 8])


def orbit(ellipsoid: Ellipsoid, theta: float, psi: float, duration: float) -> tuple[np.ndarray, np.ndarray]:
    """The same section points alone, as precisely as double precision allows."""
    times = np.linspace(0.0, duration, int(duration / (2 * STEP)) + 2)
    start = tuple(quaternion_from_euler((theta, 0.0, psi)))
    problem = Problem("jeffery", jeffery_field, start, duration, shares(ellipsoid))
    return section_points(ellipsoid, times, _solved(problem, times, 1e-15))


def _solved(problem: Problem, times: np.ndarray, tolerance: float) -> np.ndarray:
    solution = solve(problem, "taylor", tolerance, times)
    if not solution.success:
        raise RuntimeError(f"the run of {problem.name!r} ended with {solution.status}")
    return solution.states
