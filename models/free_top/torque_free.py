"""The Euler top (St = ∞) in closed form: any inertia, any start, at a cost independent of the time.

The invariants come from the start in rational arithmetic: the distances from the separatrix L² = 2EI₂
and from the permanent rotations suffer no cancellation. The rest is long double.
"""

from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from polhode.models.free_top.elliptic import (
    PI,
    Long,
    LongArray,
    carlson_rf,
    jacobi,
    rounded,
    theta4_phase,
)
from polhode.models.free_top.polhode import Polhode, Rationals, exactly
from polhode.models.rotation import Quaternion, Triple


@dataclass(frozen=True)
class TorqueFree:
    """Torque-free rotation (`eulg`) from a given start, in closed form.

    Body angular velocity by Jacobi functions (`eq:omg1`–`eq:omg3`; Landau & Lifshitz, Mechanics,
    §37); precession by theta functions (`eq:prec1`, `eq:prec2`; Whittaker, Analytical Dynamics,
    §69). The Euler angles are singular where the polhode passes close to its axis. Instead of them
    their sum with the spin is used: the angle about L of the frame carried along by the
    shortest rotation from L to axis c (Celledoni, Fassò, Säfström & Zanna, SIAM J. Sci. Comput. 30
    (2008) 2084), regular for every start.
    """

    # Moments of inertia about the body axes, positive, in any unit and order. Their differences set the
    # motion, so rational numbers are best: in doubles they are off by 1e-13 for almost equal moments.
    inertia: Triple | Rationals
    quaternion: Quaternion  # of the start, q̇ = ½ q∘(0, ω); its norm is divided out
    # At the start, in body axes and any inverse unit of the requested times.
    angular_velocity: Triple

    @cached_property
    def _exact(self) -> tuple[tuple[Fraction, ...], tuple[Fraction, ...]]:
        """Inertia and ω as rational numbers."""
        return exactly(self.inertia), exactly(self.angular_velocity)

    @cached_property
    def _polhode(self) -> Polhode:
        """Constants of the motion, named in `Polhode`."""
        inertia, omega = self._exact
        momentum_squared = sum(
            ((i * w) ** 2 for i, w in zip(inertia, omega, strict=True)), Fraction(0)
        )
        twice_energy = sum((i * w * w for i, w in zip(inertia, omega, strict=True)), Fraction(0))
        return Polhode.of(inertia, momentum_squared, twice_energy)

    @property
    def is_permanent(self) -> bool:
        """Whether ω is constant in the body, exactly: L and ω are parallel."""
        (i1, i2, i3), (w1, w2, w3) = self._exact
        return (i3 - i2) * w2 * w3 == (i1 - i3) * w3 * w1 == (i2 - i1) * w1 * w2 == 0

    # As `Polhode.periods` says.
    period = property(
        lambda top: top._polhode.periods[0], doc="Period T of the body angular velocity in t."
    )
    precession_period = property(
        lambda top: top._polhode.periods[1], doc="T' of the mean precession about L in t."
    )

    def at(self, times: ArrayLike, *, dtype: DTypeLike = np.float64) -> tuple[NDArray, NDArray]:
        """Unit quaternions, shape (n, 4), and body angular velocities, shape (n, 3).

        The times are finite, since the start, shape (n,), and of either sign. Quaternions are
        continuous from the start. Results are rounded from long double to `dtype`.
        """
        t = np.asarray(times, dtype=Long)
        turn, omega = self._permanent(t) if self.is_permanent else self._wobbling(t)
        start = np.asarray(self.quaternion, dtype=Long)
        quaternion = _product(start / np.sqrt(np.sum(start**2)), turn)
        return quaternion.astype(dtype), omega.astype(dtype)

    def _permanent(self, t: LongArray) -> tuple[LongArray, LongArray]:
        """The same as `_wobbling` of a rotation about a fixed axis."""
        omega = np.asarray(self.angular_velocity, dtype=Long)
        speed = np.sqrt(rounded(sum((w * w for w in self._exact[1]), Fraction(0))))
        axis = omega / speed if speed > 0 else omega
        half = speed * t / 2
        turn = np.concatenate([np.cos(half)[:, None], np.sin(half)[:, None] * axis], axis=1)
        return turn, np.broadcast_to(omega, (len(t), 3))

    def _wobbling(self, t: LongArray) -> tuple[LongArray, LongArray]:
        """Rotation since the start, shape (n, 4), and ω, shape (n, 3), both in body axes."""
        polhode = self._polhode
        order = list(polhode.order)
        signs = self._signs()
        u0 = self._argument(signs * np.asarray(self.angular_velocity, dtype=Long)[order])
        # The start goes through the same functions as the times, so that what they have in common
        # drops out. It is row 0 of each array below.
        u = np.concatenate([[u0], u0 + polhode.sense * polhode.rate * t])
        # Half periods 2K passed: sn and cn change their signs in each, and the arguments stay small.
        half_turns = np.rint(u / (2 * polhode.quarter))
        reduced = u - (2 * polhode.quarter * half_turns if np.isfinite(polhode.quarter) else 0)
        sn, cn, dn = jacobi(reduced, polhode.m1)
        parity = 1 - 2 * np.mod(half_turns, 2)
        # `spin` is the angle about axis c of L in the body; `angle` is the periodic part of the
        # precession less `spin`.
        spin = np.arctan2(np.sqrt(1 + polhode.n) * sn, cn) + PI * half_turns
        angle = theta4_phase(reduced, polhode.m, polhode.m1, polhode.n) - spin
        carried = angle[1:] - angle[0] + polhode.precession * t
        omega = np.stack([parity * cn, parity * sn, dn], axis=1) * np.array(polhode.amplitudes)
        inertia = np.array([rounded(self._exact[0][axis]) for axis in order])
        # The rotation since the start: from the body at the start to the frame of L, about L by the
        # angle carried, and back to the body.
        upright = _shortest_to_third(omega * inertia / polhode.momentum)
        zero = np.zeros_like(t)
        about = np.stack([np.cos(carried / 2), zero, zero, np.sin(carried / 2)], axis=1)
        turn = _product(_product(upright[0] * np.array([1, -1, -1, -1]), about), upright[1:])
        back = np.argsort(order)
        vector = (signs * turn[:, 1:])[:, back]
        rates = (signs * omega[1:])[:, back]
        return np.concatenate([turn[:, :1], vector], axis=1), rates

    def _signs(self) -> LongArray:
        """Signs of the axes a, b, c that make ω_a and ω_c non-negative and leave the axes right-handed."""
        a, b, c = self._polhode.order
        sign_a = 1 if self.angular_velocity[a] >= 0 else -1
        sign_c = 1 if self.angular_velocity[c] >= 0 else -1
        handedness = 1 if (b - a) % 3 == 1 else -1
        return np.array([sign_a, handedness * sign_a * sign_c, sign_c], dtype=Long)

    def _argument(self, omega: LongArray) -> Long:
        """Argument u of the Jacobi functions at an ω about the axes a, b, c, shape (3,)."""
        # It lies in [−K, K], as ω_a ≥ 0 and ω_c > 0; well-conditioned for every amplitude (DLMF
        # §22.15).
        cn, sn, dn = (
            rate / amplitude
            for rate, amplitude in zip(omega, self._polhode.amplitudes, strict=True)
        )
        size = np.hypot(cn, sn)
        return sn / size * carlson_rf((cn / size) ** 2, dn**2, Long(1))


def _shortest_to_third(unit: LongArray) -> LongArray:
    """Quaternions, shape (n, 4), of the shortest rotations of unit vectors to the z axis.

    The vectors, shape (n, 3), have z ≥ 0.
    """
    x, y, z = unit.T
    unscaled = np.stack([1 + z, y, -x, np.zeros_like(x)], axis=1)
    return unscaled / np.sqrt(np.sum(unscaled**2, axis=1, keepdims=True))


def _product(left: LongArray, right: LongArray) -> LongArray:
    """Quaternion product, shapes (..., 4)."""
    a0, a1, a2, a3 = np.moveaxis(left, -1, 0)
    b0, b1, b2, b3 = np.moveaxis(right, -1, 0)
    components = [
        a0 * b0 - a1 * b1 - a2 * b2 - a3 * b3,
        a0 * b1 + a1 * b0 + a2 * b3 - a3 * b2,
        a0 * b2 - a1 * b3 + a2 * b0 + a3 * b1,
        a0 * b3 + a1 * b2 - a2 * b1 + a3 * b0,
    ]
    return np.stack(components, axis=-1)
