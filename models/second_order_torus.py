"""The torque as a perturbation of the Euler top, on the torus of polhode phase α and precession phase β.

Body axes are permuted so that the polhode circles axis 3 and axis 2 is the intermediate one; with i_j = 1/I_j,
h = 2E/L² lies between i₃ and i₂, and y = ln((h - i₃)/(i₂ - h)) is the variable used for it. Q carries the frame of L
(e₃ = n = L/l) to space, S the body to the frame of L: R = QS, S = R_z(β + χ)S₀(z), S₀ the least rotation that carries
the body vector z = Rᵀn to e₃. Unperturbed, dα/dt = lν₁(h) and dβ/dt = lν₂(h).

Arrays have shape (m, a, b, …): m states, a equal polhode phases and b equal precession phases counted from the state's
own, which is entry (0, 0).
"""

from dataclasses import dataclass, replace
from functools import cached_property
from math import pi

import numpy as np

from polhode.models.shape import Ellipsoid

Array = np.ndarray

# The torque holds |k₂| <= 3 in space, so that eight precession phases resolve it.
PRECESSIONS = 8
# Step in y of the sixth-order differences by which polhodes are differentiated.
STEP = 0.02
# Divisors below this share of ν₂ are not divided by; whether their modes matter is asked beforehand.
SMALLEST_DIVISOR = 1e-3
DIFFERENCES = ((1, 3 / 4), (2, -3 / 20), (3, 1 / 60))


@dataclass(frozen=True)
class Side:
    """A triaxial body on one side of L² = 2EI₂, its axes permuted and turned so that z₃ > 0.

    Parameters
    ----------
    axes : ndarray, shape (3, 3)
        Rows are the permuted axes in the scene's body axes; a rotation.
    inverse_inertia, drag, squares : ndarray, shape (3,)
        1/I, 8πX and the squared semi-axes, in permuted order.
    """

    axes: Array
    inverse_inertia: Array
    drag: Array
    squares: Array

    @classmethod
    def of(cls, ellipsoid: Ellipsoid, momentum: Array) -> "Side":
        """The side on which a body angular momentum, shape (3,), lies."""
        inertia = np.array(ellipsoid.inertia)
        order = list(ellipsoid.order)
        if np.sum(momentum**2) < np.sum(momentum**2 / inertia) * inertia[order[1]]:
            order.reverse()
        axes = np.eye(3)[order]
        axes[1] *= np.linalg.det(axes)
        if momentum[order[2]] < 0:
            axes[1:] *= -1
        return cls(
            axes,
            1 / inertia[order],
            8 * pi * np.array(ellipsoid.resistance)[order],
            np.array(ellipsoid.scaled_axes)[order] ** 2,
        )

    def share(self, h: Array) -> Array:
        """(h - i₃)/(i₂ - i₃), from 0 at the permanent axis to 1 on the separatrix."""
        _, i2, i3 = self.inverse_inertia
        return (h - i3) / (i2 - i3)


@dataclass(frozen=True)
class Polhode:
    """Polhodes of m values of y at a phases each, which start at `phase`.

    Parameters
    ----------
    side : Side
    y, phase : ndarray, shape (m,)
    nodes : int
        Even number a of phases.
    """

    side: Side
    y: Array
    phase: Array
    nodes: int

    @cached_property
    def x(self) -> Array:
        """(h - i₃)/(i₂ - i₃), shape (m,)."""
        return 1 / (1 + np.exp(-self.y))

    @cached_property
    def moduli(self) -> tuple[Array, Array, Array]:
        """A², C² and 1 - m, shape (m,) each: squared amplitudes of z₁ and z₃, complementary parameter of sn, cn, dn."""
        i1, i2, i3 = self.side.inverse_inertia
        a2 = (i2 - i3) / (i1 - i3) * self.x
        c2 = 1 - a2
        return a2, c2, 1 / (1 + np.exp(self.y)) / c2

    @cached_property
    def h(self) -> Array:
        """2E/L², shape (m,)."""
        _, i2, i3 = self.side.inverse_inertia
        return i3 + (i2 - i3) * self.x

    @cached_property
    def slope(self) -> Array:
        """dh/dy, shape (m,)."""
        _, i2, i3 = self.side.inverse_inertia
        return (i2 - i3) * self.x / (1 + np.exp(self.y))

    @cached_property
    def rate(self) -> Array:
        """ν₁, shape (m,): dα/dt over l."""
        from scipy.special import ellipkm1

        _, i2, i3 = self.side.inverse_inertia
        a2, c2, complement = self.moduli
        return pi / 2 * abs(i2 - i3) * np.sqrt(self.x * c2 / a2) / ellipkm1(complement)

    @cached_property
    def z(self) -> Array:
        """Body components of n, shape (m, a, 3) (`eq:omg1`–`eq:omg3` over the frequency)."""
        from scipy.special import ellipj, ellipkm1

        _, i2, i3 = self.side.inverse_inertia
        a2, c2, complement = self.moduli
        phases = self.phase[:, None] + 2 * pi / self.nodes * np.arange(self.nodes)
        turns = np.remainder(phases + pi, 2 * pi) - pi
        sn, cn, dn, _ = ellipj(2 / pi * ellipkm1(complement)[:, None] * turns, (1 - complement)[:, None])
        sizes = np.sqrt(a2), np.sign(i2 - i3) * np.sqrt(self.x), np.sqrt(c2)
        return np.stack([size[:, None] * part for size, part in zip(sizes, (cn, sn, dn), strict=True)], axis=-1)

    @cached_property
    def along(self) -> Array:
        """∂z/∂α, shape (m, a, 3), by Euler's equations."""
        return np.cross(self.z, self.side.inverse_inertia * self.z) / self.rate[:, None, None]

    @cached_property
    def _precession(self) -> tuple[Array, Array]:
        """ν₂, shape (m,), and χ, shape (m, a)."""
        z, dz = self.z, self.along
        lag = (z[..., 0] * dz[..., 1] - z[..., 1] * dz[..., 0]) / (1 + z[..., 2])
        spectrum = np.fft.fft(self.h[:, None] - self.rate[:, None] * lag, axis=1)
        mean = spectrum[:, 0].real / self.nodes
        order = np.fft.fftfreq(self.nodes, 1 / self.nodes)
        order[[0, self.nodes // 2]] = np.inf
        return mean, np.fft.ifft(-1j * spectrum / order, axis=1).real / self.rate[:, None]

    @property
    def precession(self) -> Array:
        """ν₂, shape (m,): dβ/dt over l."""
        return self._precession[0]

    @property
    def lead(self) -> Array:
        """χ, shape (m, a), of zero mean over the polhode."""
        return self._precession[1]

    @cached_property
    def beside(self) -> "Derivatives":
        """Derivatives with respect to y at fixed phases."""
        total = Derivatives(0 * self.z, 0 * self.lead, 0 * self.rate, 0 * self.rate)
        for steps, weight in DIFFERENCES:
            up = replace(self, y=self.y + steps * STEP)
            down = replace(self, y=self.y - steps * STEP)
            total = Derivatives(
                total.z + weight / STEP * (up.z - down.z),
                total.lead + weight / STEP * (up.lead - down.lead),
                total.rate + weight / STEP * (up.rate - down.rate),
                total.precession + weight / STEP * (up.precession - down.precession),
            )
        return total


@dataclass(frozen=True)
class Derivatives:
    """Derivatives with respect to y of z, χ, ν₁ and ν₂, shapes as in `Polhode`."""

    z: Array
    lead: Array
    rate: Array
    precession: Array


@dataclass(frozen=True)
class Torus:
    """The perturbation at m states, over all phases.

    Parameters
    ----------
    polhode : Polhode
    size : ndarray, shape (m,)
        l = |L|.
    precession : ndarray, shape (m,)
        β of the states.
    flow, gradient : ndarray, shape (m, 3)
        The flow's directions x and y in the frame of L.
    """

    polhode: Polhode
    size: Array
    precession: Array
    flow: Array
    gradient: Array

    @cached_property
    def rotation(self) -> Array:
        """S, shape (m, a, b, 3, 3)."""
        z = self.polhode.z
        least = least_rotation(z)
        turn = self.precession[:, None, None] + 2 * pi / PRECESSIONS * np.arange(PRECESSIONS)
        turn = turn + self.polhode.lead[:, :, None]
        cos, sin = np.cos(turn)[..., None], np.sin(turn)[..., None]
        first, second = least[:, :, None, 0], least[:, :, None, 1]
        third = np.broadcast_to(least[:, :, None, 2], (*turn.shape, 3))
        return np.stack([cos * first - sin * second, sin * first + cos * second, third], axis=-2)

    @cached_property
    def body_torque(self) -> Array:
        """τ in body axes, shape (m, a, b, 3)."""
        wide = (slice(None), None, None)
        momentum = (self.size[:, None, None] * self.polhode.z)[:, :, None]
        return torque(self.polhode.side, self.rotation, momentum, self.flow[wide], self.gradient[wide])

    @cached_property
    def perturbation(self) -> Array:
        """Rates in slow time of (L in its frame, y, α, β), shape (m, a, b, 6)."""
        p, tau = self.polhode, self.body_torque
        size, slope = self.size[:, None, None], p.slope[:, None, None]
        i, h = p.side.inverse_inertia, p.h[:, None, None]
        z, dz, yz = p.z[:, :, None], p.along[:, :, None], p.beside.z[:, :, None]
        rate_l = np.einsum("mabij,mabj->mabi", self.rotation, tau)
        rate_y = 2 / (size * slope) * np.sum((i - h[..., None]) * z * tau, axis=-1)
        across = np.sum(tau * dz, axis=-1) / size - rate_y * np.sum(yz * dz, axis=-1)
        rate_a = across / np.sum(dz * dz, axis=-1)
        rate_b = -rate_a * self.turn_along[:, :, None] - rate_y * self.turn_beside[:, :, None]
        return np.concatenate([rate_l, np.stack([rate_y, rate_a, rate_b], axis=-1)], axis=-1)

    @property
    def turn_along(self) -> Array:
        """Turn of S about e₃ per α, shape (m, 1)."""
        p = self.polhode
        return ((p.h - p.precession) / p.rate)[:, None]

    @cached_property
    def turn_beside(self) -> Array:
        """Turn of S about e₃ per y, shape (m, a)."""
        z, dz = self.polhode.z, self.polhode.beside.z
        return self.polhode.beside.lead + (z[..., 0] * dz[..., 1] - z[..., 1] * dz[..., 0]) / (1 + z[..., 2])

    @cached_property
    def divisors(self) -> Array:
        """k₁ν₁ + k₂ν₂, shape (m, a, b), infinite for the mean, for Nyquist modes and for k₁ + k₂ odd."""
        k1 = np.fft.fftfreq(self.polhode.nodes, 1 / self.polhode.nodes)[:, None]
        k2 = np.fft.fftfreq(PRECESSIONS, 1 / PRECESSIONS)
        value = k1 * self.polhode.rate[:, None, None] + k2 * self.polhode.precession[:, None, None]
        left_out = ((k1 + k2) % 2 != 0) | ((k1 == 0) & (k2 == 0))
        left_out |= (k1 == -(self.polhode.nodes // 2)) | (k2 == -(PRECESSIONS // 2))
        left_out = left_out | (np.abs(value) < SMALLEST_DIVISOR * self.polhode.precession[:, None, None])
        return np.where(left_out, np.inf, value)

    @cached_property
    def spectrum(self) -> Array:
        """Fourier coefficients of `perturbation`, shape (m, a, b, 6)."""
        return np.fft.fft2(self.perturbation, axes=(1, 2), norm="forward")

    @cached_property
    def generator_spectrum(self) -> Array:
        """Fourier coefficients of the generator U of (L, y, α, β), shape (m, a, b, 6)."""
        p, over = self.polhode, -1j / (self.divisors[..., None] * self.size[:, None, None, None])
        u = self.spectrum * over
        growth = u[..., 2:3] / self.size[:, None, None, None]
        rates = np.stack([p.rate, p.precession], axis=-1)[:, None, None]
        changes = np.stack([p.beside.rate, p.beside.precession], axis=-1)[:, None, None]
        drift = self.size[:, None, None, None] * (rates * growth + changes * u[..., 3:4])
        u[..., 4:] += drift * over
        return u

    @cached_property
    def ambient(self) -> tuple[Array, Array]:
        """The generator as changes of L and turns of R, in the frame of L, shapes (m, a, b, 3), over all phases."""
        return self._ambient(np.fft.ifft2(self.generator_spectrum, axes=(1, 2), norm="forward").real)

    @cached_property
    def ambient_here(self) -> tuple[Array, Array]:
        """The generator at the states themselves: changes of L and turns of R, in the frame of L, shapes (m, 3)."""
        change, turn = self._ambient(self.generator_spectrum.sum(axis=(1, 2)).real[:, None, None])
        return change[:, 0, 0], turn[:, 0, 0]

    def _ambient(self, u: Array) -> tuple[Array, Array]:
        a, b = u.shape[1:3]
        p = self.polhode
        z, dz, yz = (part[:, :a, None] for part in (p.z, p.along, p.beside.z))
        turn = u[..., 4:5] * (np.cross(dz, z) + self.turn_along[:, :, None, None] * z)
        turn = turn + u[..., 3:4] * (np.cross(yz, z) + self.turn_beside[:, :a, None, None] * z) + u[..., 5:6] * z
        turned = np.einsum("mabij,mabj->mabi", self.rotation[:, :a, :b], turn)
        over = 1 / self.size[:, None, None]
        tilt = np.stack([-u[..., 1] * over, u[..., 0] * over, np.zeros_like(u[..., 0])], axis=-1)
        return u[..., :3], turned + tilt


def least_rotation(z: Array) -> Array:
    """Rotations, shape (..., 3, 3), about an axis normal to e₃ that carry z, shape (..., 3), z₃ > -1, to e₃."""
    x, y, c = np.moveaxis(z, -1, 0)
    k = 1 / (1 + c)
    rows = [[1 - k * x * x, -k * x * y, -x], [-k * x * y, 1 - k * y * y, -y], [x, y, c]]
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))


def torque(side: Side, rotation: Array, momentum: Array, flow: Array, gradient: Array) -> Array:
    """Torque in body axes, shape (..., 3) (`ultima`, `jw1`–`jw3`).

    Parameters
    ----------
    side : Side
    rotation : ndarray, shape (..., 3, 3)
        Body to frame.
    momentum : ndarray, shape (..., 3)
        L in body axes.
    flow, gradient : ndarray, shape (..., 3)
        The flow's x and y in the frame.
    """
    x = np.einsum("...ij,...i->...j", rotation, flow)
    y = np.einsum("...ij,...i->...j", rotation, gradient)
    squares = side.squares
    spin = [
        (squares[j] * x[..., k] * y[..., j] - squares[k] * x[..., j] * y[..., k]) / (squares[j] + squares[k])
        for j, k in ((1, 2), (2, 0), (0, 1))
    ]
    return side.drag * (np.stack(spin, axis=-1) - side.inverse_inertia * momentum)
