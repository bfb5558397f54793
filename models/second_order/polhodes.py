"""Polhodes of a triaxial ellipsoid on one side of L² = 2EI₂, at equispaced phases, and frequencies.

Body axes are permuted so that the polhode circles axis 3 and axis 2 is the intermediate one; with
i_j = 1/I_j, h = 2E/L² lies between i₃ and i₂, and y = ln((h - i₃)/(i₂ - h)) is the variable used
for it. The frequencies ν₁ and ν₂ are divided by l = |L|. A side is the region of h on one side of
L² = 2EI₂: on it the polhode circles the longest or the shortest axis. `docs/second-order.md`,
section 2, has the phases and frames; labels such as `eq:omg1` name the paper's equations.
"""

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from math import pi

import numpy as np

from polhode.models.libraries import IMPORTS
from polhode.models.shape import Ellipsoid

Array = np.ndarray

# Step in y of the sixth-order differences by which polhodes are differentiated. They err by the
# seventh derivative, below 1, times step⁶/140 = 5e-13, and by rounding over the step, of like size
# here. With semi-axes 1, 0.8 and 0.5 and |y| up to 6, derivatives by a step of 0.04 differ from
# these by 1e-11, the error of that longer step; by 0.01 they differ by 1e-12, which is rounding: a
# shorter step gains nothing. F₂ needs the generator to 1e-9 (`docs/second-order.md`, section 5): the errors are
# 1000 times less.
_STEP = 0.02
# Steps of these differences and the weights of their pairs.
_DIFFERENCES = ((1, 3 / 4), (2, -3 / 20), (3, 1 / 60))
# Sides of bodies that are cached. An estimate: one takes little memory, and is soon made anew.
_CACHED_SIDES = 256


@dataclass(frozen=True)
class SidedBody:
    """A triaxial body on one side of L² = 2EI₂, its axes permuted and turned so that z₃ > 0.

    Rows of `axes` are the permuted axes in the scene's body axes; 1/I, 8πX and the squared
    semi-axes, shape (3,), are in permuted order.
    """

    axes: Array
    inverse_inertia: Array
    drag: Array
    squares: Array

    @classmethod
    def of(cls, ellipsoid: Ellipsoid, momentum: Array) -> "SidedBody":
        """The side on which a body angular momentum, shape (3,), lies."""
        squares = momentum * momentum
        middle = ellipsoid.inertia[ellipsoid.order[1]]
        longest = bool(squares.sum() < (squares / ellipsoid.inertia).sum() * middle)
        return cls._of(ellipsoid, longest, bool(momentum[ellipsoid.order[0 if longest else 2]] < 0))

    @classmethod
    @lru_cache(maxsize=_CACHED_SIDES)
    def _of(cls, ellipsoid: Ellipsoid, longest: bool, below: bool) -> "SidedBody":
        inertia = np.array(ellipsoid.inertia)
        order = list(ellipsoid.order)
        # Whether the polhode circles the longest axis, and whether at its negative end.
        if longest:
            order.reverse()
        axes = np.eye(3)[order]
        # The permuted axes are made right-handed, and turned by half a turn about the first of them
        # where the polhode is at the negative end.
        axes[1] *= np.linalg.det(axes)
        if below:
            axes[1:] *= -1
        drag = 8 * pi * np.array(ellipsoid.resistance)[order]
        squares = np.array(ellipsoid.scaled_axes)[order] ** 2
        return cls(axes, 1 / inertia[order], drag, squares)

    def moduli(self, x: Array, x1: Array) -> tuple[Array, Array, Array]:
        """A², C² and 1 - m as `Polhodes` has them, from x and x1 = 1 - x."""
        i1, i2, i3 = self.inverse_inertia
        square1 = (i2 - i3) / (i1 - i3) * x
        square3 = 1 - square1
        # Rounding may take 1 - m beyond 1.
        return square1, square3, np.minimum(x1 / square3, 1)

    def normal(self, x: Array, x1: Array, phase: Array) -> Array:
        """Body components of n, shape (..., 3), from x, x1 = 1 - x and α.

        `eq:omg1`–`eq:omg3` give ω as a function of time. Here n = Iω/l, and α takes the place of
        the time: it grows by 2π each turn, so that no frequency is needed.
        """
        with IMPORTS:
            from scipy.special import ellipj, ellipkm1

        square1, square3, complement = self.moduli(x, x1)
        # α between -π and π; 2π are four quarter periods K.
        turns = np.remainder(phase + pi, 2 * pi) - pi
        sn, cn, dn, _ = ellipj(2 / pi * ellipkm1(complement) * turns, 1 - complement)
        # The sense in which n goes round: 1 around the axis of greatest inertia, -1 around the least.
        sense = np.sign(self.inverse_inertia[1] - self.inverse_inertia[2])
        z1 = np.sqrt(square1) * cn
        z2 = sense * np.sqrt(x) * sn
        z3 = np.sqrt(square3) * dn
        return np.stack([z1, z2, z3], axis=-1)


@dataclass(frozen=True)
class Polhodes:
    """Polhodes of m values of y, shape (m,).

    Each has an even number `nodes` of equispaced phases, in rad, from `phase`, shape (m,), on.
    """

    side: SidedBody
    y: Array
    phase: Array
    nodes: int

    @cached_property
    def x(self) -> Array:
        """(h - i₃)/(i₂ - i₃), shape (m,)."""
        return 1 / (1 + np.exp(-self.y))

    @cached_property
    def moduli(self) -> tuple[Array, Array, Array]:
        """A², C² and 1 - m, shape (m,) each.

        Squared amplitudes of z₁ and z₃, and the complementary parameter of sn, cn and dn.
        """
        return self.side.moduli(self.x, 1 / (1 + np.exp(self.y)))

    @cached_property
    def h(self) -> Array:
        """2E/L², shape (m,)."""
        _, i2, i3 = self.side.inverse_inertia
        return i3 + (i2 - i3) * self.x

    @cached_property
    def excess(self) -> Array:
        """1/I - h, shape (m, 3), exact where h comes near i₃."""
        i1, i2, i3 = self.side.inverse_inertia
        risen = (i2 - i3) * self.x
        return np.stack([i1 - i3 - risen, (i2 - i3) / (1 + np.exp(self.y)), -risen], axis=-1)

    @cached_property
    def slope(self) -> Array:
        """dh/dy, shape (m,)."""
        _, i2, i3 = self.side.inverse_inertia
        return (i2 - i3) * self.x / (1 + np.exp(self.y))

    @cached_property
    def rate(self) -> Array:
        """ν₁, shape (m,): dα/dt over l."""
        with IMPORTS:
            from scipy.special import ellipkm1

        _, i2, i3 = self.side.inverse_inertia
        square1, square3, complement = self.moduli
        # Euler's equation of z₂, whose rate is (i₁ - i₃) z₃z₁, gives the frequency of sn; sn takes 4K
        # for a turn of α.
        return pi / 2 * abs(i2 - i3) * np.sqrt(self.x * square3 / square1) / ellipkm1(complement)

    @cached_property
    def z(self) -> Array:
        """Body components of n, shape (m, a, 3)."""
        phases = self.phase[:, None] + 2 * pi / self.nodes * np.arange(self.nodes)
        return self.side.normal(self.x[:, None], 1 / (1 + np.exp(self.y))[:, None], phases)

    @cached_property
    def per_phase(self) -> Array:
        """∂z/∂α, shape (m, a, 3), by Euler's equations."""
        return np.cross(self.z, self.side.inverse_inertia * self.z) / self.rate[:, None, None]

    @cached_property
    def _turn(self) -> tuple[Array, Array]:
        """Turn of S about e₃ per α, shape (m,), and χ, shape (m, a)."""
        z = self.z
        dz = self.per_phase
        # `lag` is the turn of S₀ about e₃ per α. χ takes its oscillating part away, so that S turns
        # evenly: the mean of `lag` is the turn of S.
        lag = (z[..., 0] * dz[..., 1] - z[..., 1] * dz[..., 0]) / (1 + z[..., 2])
        spectrum = np.fft.fft(lag, axis=1)
        order = np.fft.fftfreq(self.nodes, 1 / self.nodes)
        # Neither the mean nor the Nyquist mode is integrated.
        order[[0, self.nodes // 2]] = np.inf
        return spectrum[:, 0].real / self.nodes, np.fft.ifft(1j * spectrum / order, axis=1).real

    turn = property(
        lambda polhodes: polhodes._turn[0], doc="Turn of S about e₃ per α, shape (m,): (h - ν₂)/ν₁."
    )
    lead = property(
        lambda polhodes: polhodes._turn[1], doc="χ, shape (m, a), of zero mean over the polhode."
    )

    @property
    def precession(self) -> Array:
        """ν₂, shape (m,): dβ/dt over l."""
        return self.h - self.rate * self.turn

    @cached_property
    def per_y(self) -> "Derivatives":
        """Derivatives with respect to y at fixed phases."""
        # In each pair the step forwards has the weight, the step backwards its negative.
        steps, weights = np.array(_DIFFERENCES).T
        steps = np.concatenate([steps, -steps])
        weights = np.concatenate([weights, -weights]) / _STEP
        y = (self.y + _STEP * steps[:, None]).ravel()
        phase = np.tile(self.phase, len(steps))
        shifted = replace(self, y=y, phase=phase)
        total = dict[str, Array]()
        for name in ("z", "lead", "rate", "turn"):
            values = getattr(shifted, name)
            total[name] = np.tensordot(
                weights, values.reshape(len(steps), -1, *values.shape[1:]), 1
            )
        # ν₂ = h - ν₁ times the turn of S per α.
        carried = total["rate"] * self.turn + self.rate * total["turn"]
        return Derivatives(total["z"], total["lead"], total["rate"], self.slope - carried)


@dataclass(frozen=True)
class Derivatives:
    """Derivatives with respect to y of z, χ, ν₁ and ν₂, shapes as in `Polhodes`."""

    z: Array
    lead: Array
    rate: Array
    precession: Array
