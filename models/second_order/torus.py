"""The torque as a perturbation of the Euler top, on the torus of phases α and β.

α is the polhode phase and β the precession phase. `Torus` follows section 3 of
docs/second-order.md: rotations, torque, perturbation, its spectrum, the generator, and the latter
as changes of L and R. The functions behind it are in the page's order too.

Q carries the frame of L (e₃ = n = L/l) to space, S the body
(`polhode.models.second_order.polhodes`) to the frame of L: R = QS, S = R_z(β + χ)S₀(z), S₀ the
least rotation that carries the body vector z = Rᵀn to e₃. Unperturbed, dα/dt = lν₁(h) and dβ/dt =
lν₂(h).

Arrays have shape (…, m, a, b): m states, a equispaced polhode phases and b equispaced precession phases
counted from the state's own, which is entry (0, 0). Leading axes stand for several L and flows of
each polhode; vectors are triples of such arrays.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import pi
from typing import Any

import numpy as np

from polhode.models.second_order.polhodes import Polhodes, SidedBody
from polhode.models.second_order.spheroid import Triple, cross, dot, plus

Array = np.ndarray

# The torque holds |k₂| <= 3 in space, so that eight precession phases resolve it.
_PRECESSIONS = 8
_UNITS = np.eye(3)
# Signs of the rows that turn the reflection of z to -e₃ into the rotation of z to e₃.
_REFLECTED = np.array([[1.0], [1.0], [-1.0]])


@dataclass(frozen=True)
class Torus:
    """The perturbation at m states, over all phases."""

    polhode: Polhodes
    size: Array  # l = |L|, shape (..., m)
    precession: Array  # β of the states, shape (m,)
    flow: Array  # the flow's directions x and y in the frame of L, shape (..., m, 3) each
    gradient: Array

    @cached_property
    def rotation(self) -> Array:
        """S, shape (m, a, b, 3, 3)."""
        turn = self.precession[:, None, None] + 2 * pi / _PRECESSIONS * np.arange(_PRECESSIONS)
        return carried(self.polhode.z[:, :, None], turn + self.polhode.lead[:, :, None])

    @cached_property
    def rows(self) -> Array:
        """The rows of S, shape (3, 3, m, a, b)."""
        return np.ascontiguousarray(np.moveaxis(self.rotation, (-2, -1), (0, 1)))

    @cached_property
    def polhodes(self) -> tuple[Triple, Triple, Triple]:
        """n in body axes and its changes per α and per y."""
        p = self.polhode
        z, z_per_phase, z_per_y = (
            tuple(np.moveaxis(rows, -1, 0)[..., None].copy())
            for rows in (p.z, p.per_phase, p.per_y.z)
        )
        return z, z_per_phase, z_per_y

    @cached_property
    def momentum(self) -> Triple:
        """L in body axes."""
        return tuple(self.size[..., None, None] * component for component in self.polhodes[0])

    @cached_property
    def driven(self) -> tuple[Triple, Triple, Triple]:
        """The flow's x and y and the torque τ in body axes (`ultima`, `jw1`–`jw3`)."""
        x, y = (
            times(self.rows.swapaxes(0, 1), over_phases(direction))
            for direction in (self.flow, self.gradient)
        )
        return x, y, self.torque(self.momentum, turning(self.polhode.side, x, y))

    def torque(self, momentum: Triple, flow_velocity: Triple) -> Triple:
        """The torque in body axes: drag · (Jeffery's angular velocity - ω), with ω = L/I."""
        drag = self.polhode.side.drag.tolist()
        inverse = self.polhode.side.inverse_inertia.tolist()
        return tuple(
            d * (w - i * m)
            for d, w, i, m in zip(drag, flow_velocity, inverse, momentum, strict=True)
        )

    @cached_property
    def perturbation(self) -> Array:
        """Rates in slow time of (L in its frame, y, α, β), shape (6, ..., m, a, b)."""
        p = self.polhode
        size = self.size[..., None, None]
        z, z_per_phase, z_per_y = self.polhodes
        *_, tau = self.driven
        factors = p.excess.T[..., None]
        excess_z = [factor[:, None] * part for factor, part in zip(factors, z, strict=True)]
        slope = p.slope[:, None, None]
        rate_y, rate_a = polhode_rates(size, slope, excess_z, (z_per_phase, z_per_y), tau)
        # β makes up for the turn of S about e₃ that the changes of α and y bring.
        rate_b = -rate_a * p.turn[:, None, None] - rate_y * self.turn_per_y[:, :, None]
        return np.stack([*times(self.rows, tau), rate_y, rate_a, rate_b])

    @cached_property
    def turn_per_y(self) -> Array:
        """Turn of S about e₃ per y, shape (m, a)."""
        z = self.polhode.z
        derivatives = self.polhode.per_y
        dz = derivatives.z
        return derivatives.lead + (z[..., 0] * dz[..., 1] - z[..., 1] * dz[..., 0]) / (
            1 + z[..., 2]
        )

    @cached_property
    def spectrum(self) -> Array:
        """Fourier coefficients of `perturbation`, shape (6, ..., m, a, b)."""
        return np.fft.fft2(self.perturbation, norm="forward")

    @cached_property
    def inverses(self) -> tuple[Array, Array]:
        """1/D and 1/D² of D = k₁ν₁ + k₂ν₂, shape (m, a, b) each."""
        # Zero for the mean, for Nyquist modes and for k₁ + k₂ odd, which the polhode's symmetry rules out.
        p = self.polhode
        nodes = self.polhode.nodes
        k1 = np.fft.fftfreq(nodes, 1 / nodes)[:, None]
        k2 = np.fft.fftfreq(_PRECESSIONS, 1 / _PRECESSIONS)
        divisor = k1 * p.rate[:, None, None] + k2 * p.precession[:, None, None]
        left_out = (
            ((k1 + k2) % 2 != 0)
            | (k1 == -(nodes // 2))
            | (k2 == -(_PRECESSIONS // 2))
            | ((k1 == 0) & (k2 == 0))
        )
        inverse = np.where(left_out, 0, 1 / np.where(left_out, 1, divisor))
        return inverse, inverse**2

    @cached_property
    def generator(self) -> Array:
        """The generator U of (L, y, α, β), shape (6, ..., m, a, b)."""
        p = self.polhode
        size = self.size[..., None, None]
        inverse, inverse_square = self.inverses
        u = self.spectrum * (-1j * inverse / size)
        # A change of l or of y changes the rates of both angles: P^l is the change of L along itself.
        relative_growth = self.spectrum[2] / size
        rate_of_y = self.spectrum[3]
        inverse_square = inverse_square / size
        frequencies = (p.rate, p.per_y.rate), (p.precession, p.per_y.precession)
        for angle, (rate, per_y) in zip(u[4:], frequencies, strict=True):
            change = rate[:, None, None] * relative_growth + per_y[:, None, None] * rate_of_y
            angle -= change * inverse_square
        return np.fft.ifft2(u, norm="forward").real

    @cached_property
    def ambient(self) -> tuple[Triple, Triple]:
        """The generator as changes of L and turns of R, in the frame of L."""
        p = self.polhode
        u = self.generator
        z, z_per_phase, z_per_y = self.polhodes
        # Turns of R, in body axes, per y, α and β.
        turn = (
            plus(cross(z_per_y, z), self.turn_per_y[..., None], z),
            plus(cross(z_per_phase, z), p.turn[:, None, None], z),
            z,
        )
        turned = times(self.rows, times(zip(*turn, strict=True), tuple(u[3:])))
        over = 1 / self.size[..., None, None]
        return tuple(u[:3]), (turned[0] - u[1] * over, turned[1] + u[0] * over, turned[2])


def least_rotation(z: Array) -> Array:
    """Rotations, shape (..., 3, 3), about axes normal to e₃ that carry z, shape (..., 3), to e₃.

    z₃ > -1.
    """
    # With u = z + e₃, u·u is 2(1 + z₃) = 2u₃: the matrix 1 - uuᵀ/u₃ reflects z to -e₃.
    up = z + _UNITS[2]
    return _REFLECTED * (_UNITS - up[..., :, None] * (up / up[..., 2:])[..., None, :])


def carried(z: Array, turn: Array) -> Array:
    """S, shape (..., 3, 3): the least rotation, then a turn about e₃."""
    first, second, third = np.moveaxis(least_rotation(z), -2, 0)
    cos = np.cos(turn)[..., None]
    sin = np.sin(turn)[..., None]
    rows = cos * first - sin * second, sin * first + cos * second, third
    return np.stack(np.broadcast_arrays(*rows), axis=-2)


def turning(side: SidedBody, x: Triple, y: Triple) -> Triple:
    """Angular velocity of the flow that drives the body, bilinear in its x and y in body axes."""
    return turned(side, lambda k, j: x[k] * y[j])


def turned(side: SidedBody, tensor: Callable[[int, int], Any]) -> Triple:
    """`turning` of the components of a tensor x⊗y in body axes."""
    s = side.squares.tolist()
    pairs = ((1, 2), (2, 0), (0, 1))
    return tuple((s[j] * tensor(k, j) - s[k] * tensor(j, k)) / (s[j] + s[k]) for j, k in pairs)


def polhode_rates(
    size: Any, slope: Array, excess_z: Sequence[Any], changes: tuple[Triple, Triple], tau: Triple
) -> tuple[Array, Array]:
    """Rates of y and α in slow time that a torque in body axes makes, at l = `size`.

    `slope` is dh/dy, `excess_z` is (1/I - h) z, and `changes` are ∂z/∂α and ∂z/∂y.
    """
    z_per_phase, z_per_y = changes
    # h' = 2(ω·τ - h L·τ)/l², and the rest of the change of z, τ/l across it, is along the polhode.
    rate_y = 2 / (size * slope) * dot(excess_z, tau)
    along = dot(tau, z_per_phase) / size - rate_y * dot(z_per_y, z_per_phase)
    rate_a = along / dot(z_per_phase, z_per_phase)
    return rate_y, rate_a


def over_phases(vectors: Array) -> Triple:
    """Vectors, shape (..., m, 3), as a triple that is the same over all phases."""
    return tuple(np.moveaxis(vectors, -1, 0)[..., None, None])


def times(matrix: Iterable[Triple], v: Triple) -> Triple:
    """A matrix, given by its rows, times v."""
    return tuple(dot(row, v) for row in matrix)
