"""Slow motion near the singular fixed point, rotation about the middle axis, at L_x = L_y = 0.

Coordinates: y = 1 - m, the complementary parameter of the elliptic functions of the polhode, which
is μ'δ of the paper, and L_z' = L_z + I₂/2. There E(m)/K(m) = 2/ln(16/y) up to terms of relative
order y ln y. The local equations (`lzasymp`, `muasymp`) neglect powers of y, and of L_z' all but its
own linear decay. They keep all powers of 1/ln(16/y). Such names are labels of the paper's LaTeX source;
`docs/misprints.md` lists what its formulas should read.
"""

from dataclasses import dataclass
from functools import cached_property
from math import e, exp, log, pi
from typing import Literal

from polhode.models.libraries import IMPORTS
from polhode.models.shape import Ellipsoid

Side = Literal["long", "short"]

# Relative error at which an integral is asked for: some ten times the least that `quad` takes.
_INTEGRAL_ERROR = 1e-13


@dataclass(frozen=True)
class Separatrix:
    """Local solution on one side of L² = 2EI₂.

    Every run that passes goes from the "long" side, where the polhodes encircle the longest axis
    (L² < 2EI₂), to the "short" side (L² > 2EI₂). One on each side, the critical trajectory, meets
    the singular point. The ellipsoid is triaxial.
    """

    ellipsoid: Ellipsoid
    side: Side

    @cached_property
    def _sorted(self) -> tuple[list[float], list[float]]:
        """Inertia and resistance, from the longest axis to the shortest."""
        body = self.ellipsoid
        order = self.ellipsoid.order
        return [body.inertia[axis] for axis in order], [body.resistance[axis] for axis in order]

    @cached_property
    def growth(self) -> float:
        """Rate 2W (`muasymp`) of y ln(16/y) + y, per unit of slow time, negative on the long side alone."""
        (i1, i2, i3), (x1, _, x3) = self._sorted
        size = 32 * pi / i2 * (x1 * (i2 - i1) / i1 + x3 * (i3 - i2) / i3)
        return size if self.side == "short" else -size

    @cached_property
    def decay(self) -> float:
        """Rate 8πX₂/I₂ at which L_z' decays, per unit of slow time."""
        return self.ellipsoid.damping[self.ellipsoid.order[1]]

    @cached_property
    def push(self) -> float:
        """Ŵ of `lzassol`: -Ŵ/ln(16/y) drives L_z'.

        Both sides have one Ŵ, as the exchange 1 ↔ 3 leaves it alone.
        """
        (i1, i2, i3), (x1, _, x3) = self._sorted
        return 8 * pi * (x3 - x1) * (i3 - i2) * (i2 - i1) / (i2 * (i3 - i1))

    def rates(self, complement: float, shift: float) -> tuple[float, float]:
        """Rates of y and of L_z' in slow time at y > 0 and L_z' (`muasymp`, `lzasymp`)."""
        logarithm = log(16 / complement)
        return self.growth / logarithm, -self.decay * shift - self.push / logarithm

    def time(self, complement: float) -> float:
        """Slow time since the separatrix at y ≥ 0.

        Negative on the long side, which comes before it.
        """
        # From `muasymp`, exactly: 2W t₂ = y ln(16/y) + y; `muassol` keeps the first term alone. It
        # is finite: the singular point is reached, and left, in a finite time.
        return _passed(complement) / self.growth

    def complement(self, time: float) -> float:
        """The y at a slow time since the separatrix, the inverse of `time`.

        It is found by Lambert's function (DLMF 4.13).

        Raises ValueError if the time has the wrong sign for the side, or lies beyond y = 1.
        """
        with IMPORTS:
            from scipy.special import lambertw

        passed = self.growth * time
        if not 0 <= passed <= _passed(1.0):
            low, high = sorted((0.0, self.time(1.0)))
            raise ValueError(
                f"time: got {time!r}, expected a number from {low!r} to {high!r} on the {self.side} side"
            )
        if passed == 0:
            return 0.0
        # With y = 16e exp(w), where w is Lambert's function, y ln(16/y) + y = -16e w exp(w). As y < 16, w < -1: the
        # branch is -1.
        return 16 * e * exp(float(lambertw(-passed / (16 * e), k=-1).real))

    def shift(self, complement: float, complement_start: float, shift_start: float) -> float:
        """L_z' at a y, from L_z' at the y of a start (`lzassol` with the exact y of `time`)."""
        with IMPORTS:
            from scipy.integrate import quad

        # Over the rate of y, the equation of L_z' is dL_z'/dy = -rate ln(16/y) L_z' - Ŵ/2W. As
        # ln(16/y) is the derivative of y ln(16/y) + y, exp(rate (y ln(16/y) + y)) is the integrating
        # factor.
        #
        # The integrand is positive, so that the error is asked for relative to the integral.
        # The decay of L_z' over 2W: without unit, of the sign of the side.
        rate = self.decay / self.growth
        exponent_end = _passed(complement)
        integral = quad(
            lambda y: exp(rate * (_passed(y) - exponent_end)),
            complement_start,
            complement,
            epsabs=0,
            epsrel=_INTEGRAL_ERROR,
        )
        start = exp(rate * (_passed(complement_start) - exponent_end))
        return start * shift_start - self.push / self.growth * integral[0]

    def critical(self, complement: float) -> float:
        """L_z' at y on the critical trajectory, the only one through y = L_z' = 0."""
        return self.shift(complement, 0.0, 0.0) if complement > 0 else 0.0

    def slow_state(self, complement: float, shift: float) -> tuple[float, float, float, float]:
        """Exact slow variables (L_x, L_y, L_z, E) of y and L_z', with L_x = L_y = 0."""
        i1, i2, i3 = self._sorted[0]
        encircled, opposite = (i3, i1) if self.side == "short" else (i1, i3)
        # y is (I_c - I_a)(L² - 2EI₂)/((I_c - I₂)(L² - 2EI_a)), where c is the axis encircled and a the
        # opposite one. So L² - 2EI₂ is this share of L² - 2EI_a.
        share = complement * (encircled - i2) / (encircled - opposite)
        momentum = shift - i2 / 2
        return 0.0, 0.0, momentum, momentum * momentum * (1 - share) / (2 * (i2 - share * opposite))


def _passed(complement: float) -> float:
    """2W t₂ = y ln(16/y) + y at the slow time t₂ since the separatrix."""
    return complement * (log(16 / complement) + 1) if complement > 0 else 0.0
