"""The torque as a perturbation of the Euler top, on the torus of polhode phase α and precession phase β.

Q carries the frame of L (e₃ = n = L/l) to space, S the body (`polhode.models.second_order.polhodes`) to the frame of L:
R = QS, S = R_z(β + χ)S₀(z), S₀ the least rotation that carries the body vector z = Rᵀn to e₃. Unperturbed,
dα/dt = lν₁(h) and dβ/dt = lν₂(h).

Arrays have shape (m, a, b, …): m states, a equal polhode phases and b equal precession phases counted from the state's
own, which is entry (0, 0).
"""

from dataclasses import dataclass
from functools import cached_property
from math import pi

import numpy as np

from polhode.models.second_order.polhodes import Polhodes, SidedBody

Array = np.ndarray

# The torque holds |k₂| <= 3 in space, so that eight precession phases resolve it.
PRECESSIONS = 8
_UNITS, _UPSIDE = np.eye(3), np.array([[1.0], [1.0], [-1.0]])


@dataclass(frozen=True)
class Torus:
    """The perturbation at m states, over all phases."""

    polhode: Polhodes
    size: Array  # l = |L|, shape (m,)
    precession: Array  # β of the states, shape (m,)
    flow: Array  # the flow's directions x and y in the frame of L, shape (m, 3) each
    gradient: Array

    @cached_property
    def rotation(self) -> Array:
        """S, shape (m, a, b, 3, 3)."""
        turn = self.precession[:, None, None] + 2 * pi / PRECESSIONS * np.arange(PRECESSIONS)
        return carried(self.polhode.z[:, :, None], turn + self.polhode.lead[:, :, None])

    @cached_property
    def perturbation(self) -> Array:
        """Rates in slow time of (L in its frame, y, α, β), shape (m, a, b, 6)."""
        p, side, size = self.polhode, self.polhode.side, self.size[:, None, None]
        flow, gradient, slope = (each[:, None, None] for each in (self.flow, self.gradient, self.polhode.slope))
        x, y = (np.einsum("...ij,...i->...j", self.rotation, each) for each in (flow, gradient))
        # τ in body axes (`ultima`, `jw1`–`jw3`).
        tau = side.drag * (turning(side, x, y) - side.inverse_inertia * (size * p.z)[:, :, None])
        z, dz, yz = p.z[:, :, None], p.along[:, :, None], p.beside.z[:, :, None]
        rate_l = np.einsum("mabij,mabj->mabi", self.rotation, tau)
        rate_y = 2 / (size * slope) * np.sum(p.beyond[:, None, None] * z * tau, axis=-1)
        across = np.sum(tau * dz, axis=-1) / size - rate_y * np.sum(yz * dz, axis=-1)
        rate_a = across / np.sum(dz * dz, axis=-1)
        rate_b = -rate_a * p.turn[:, None, None] - rate_y * self.turn_beside[:, :, None]
        return np.concatenate([rate_l, np.stack([rate_y, rate_a, rate_b], axis=-1)], axis=-1)

    @cached_property
    def turn_beside(self) -> Array:
        """Turn of S about e₃ per y, shape (m, a)."""
        z, dz = self.polhode.z, self.polhode.beside.z
        return self.polhode.beside.lead + (z[..., 0] * dz[..., 1] - z[..., 1] * dz[..., 0]) / (1 + z[..., 2])

    @cached_property
    def inverses(self) -> tuple[Array, Array]:
        """1/D² and 1/D of D = k₁ν₁ + k₂ν₂, shape (m, a, b) each."""
        # Zero for the mean, for Nyquist modes and for k₁ + k₂ odd.
        p, nodes = self.polhode, self.polhode.nodes
        k1 = np.fft.fftfreq(nodes, 1 / nodes)[:, None]
        k2 = np.fft.fftfreq(PRECESSIONS, 1 / PRECESSIONS)
        divisor = k1 * p.rate[:, None, None] + k2 * p.precession[:, None, None]
        left_out = ((k1 + k2) % 2 != 0) | (k1 == -(nodes // 2)) | (k2 == -(PRECESSIONS // 2)) | ((k1 == 0) & (k2 == 0))
        once = np.where(left_out, 0, 1 / np.where(left_out, 1, divisor))
        return once**2, once

    @cached_property
    def spectrum(self) -> Array:
        """Fourier coefficients of `perturbation`, shape (m, a, b, 6)."""
        return np.fft.fft2(self.perturbation, axes=(1, 2), norm="forward")

    @cached_property
    def generator_spectrum(self) -> Array:
        """Fourier coefficients of the generator U of (L, y, α, β), shape (m, a, b, 6)."""
        p, size = self.polhode, self.size[:, None, None, None]
        twice, once = (each[..., None] for each in self.inverses)
        u = -1j * self.spectrum * once / size
        rates = np.stack([p.rate, p.precession], axis=-1)[:, None, None]
        changes = np.stack([p.beside.rate, p.beside.precession], axis=-1)[:, None, None]
        growth, rise = self.spectrum[..., 2:3] / size, self.spectrum[..., 3:4]
        u[..., 4:] -= (rates * growth + changes * rise) * twice / size
        return u

    @cached_property
    def ambient(self) -> tuple[Array, Array]:
        """The generator as changes of L and turns of R, in the frame of L, shapes (m, a, b, 3), over all phases."""
        p, u = self.polhode, np.fft.ifft2(self.generator_spectrum, axes=(1, 2), norm="forward").real
        z, dz, yz = (part[:, :, None] for part in (p.z, p.along, p.beside.z))
        turn = u[..., 4:5] * (np.cross(dz, z) + p.turn[:, None, None, None] * z)
        turn = turn + u[..., 3:4] * (np.cross(yz, z) + self.turn_beside[..., None, None] * z) + u[..., 5:6] * z
        turned = np.einsum("mabij,mabj->mabi", self.rotation, turn)
        over = 1 / self.size[:, None, None]
        tilt = np.stack([-u[..., 1] * over, u[..., 0] * over, np.zeros_like(u[..., 0])], axis=-1)
        return u[..., :3], turned + tilt


def carried(z: Array, turn: Array) -> Array:
    """S, shape (..., 3, 3): the least rotation, then a turn about e₃."""
    first, second, third = np.moveaxis(least_rotation(z), -2, 0)
    cos, sin = np.cos(turn)[..., None], np.sin(turn)[..., None]
    rows = cos * first - sin * second, sin * first + cos * second, third
    return np.stack(np.broadcast_arrays(*rows), axis=-2)


def least_rotation(z: Array) -> Array:
    """Rotations, shape (..., 3, 3), about an axis normal to e₃ that carry z, shape (..., 3), z₃ > -1, to e₃."""
    up = z + _UNITS[2]
    return _UPSIDE * (_UNITS - up[..., :, None] * (up / up[..., 2:])[..., None, :])


def turning(side: SidedBody, x: Array, y: Array) -> Array:
    """Angular velocity of the flow that drives the body, shape (..., 3), from its x and y in body axes; bilinear."""
    return turned(side, x[..., None] * y[..., None, :])


def turned(side: SidedBody, tensor: Array) -> Array:
    """`turning` of a tensor x⊗y in body axes, shape (..., 3, 3)."""
    s, pairs = side.squares, ((1, 2), (2, 0), (0, 1))
    return np.stack([(s[j] * tensor[..., k, j] - s[k] * tensor[..., j, k]) / (s[j] + s[k]) for j, k in pairs], axis=-1)
