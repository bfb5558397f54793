"""The layer of chaos along the separatrix of the Jeffery top's saddle: how wide it is, by bisection."""

from collections.abc import Callable
from dataclasses import dataclass
from math import acosh, pi

import numpy as np

from polhode.harness.paper.sections.limits.poincare import half_turn, orbit
from polhode.models.shape import Ellipsoid

# Beside ψ = 0, which some orbits never leave.
PSI = 1e-9
# Halvings down to the last digit.
HALVINGS = 52
# Distance, in rad, from the saddle at which its growth is measured.
BESIDE = 1e-4


@dataclass(frozen=True)
class Layer:
    """Values of θ - π/2 at ψ = 0, in rad, between libration and circulation.

    Up to the one every orbit stays between the saddles, from the other on every orbit stays on one side of θ = π/2.
    """

    turns: int  # half turns that the orbits were followed
    librating: float
    circulating: float

    @property
    def width(self) -> float:
        """In rad; below zero while orbits next to a sharp separatrix have not yet left the saddle."""
        return self.circulating - self.librating


def measure_layer(ellipsoid: Ellipsoid, turns: int) -> Layer:
    """Bisect, along θ at ψ = 0, for the ends of pure libration and of pure circulation.

    The section's own symmetry makes ψ = 0 a line that all of these orbits cross. A sharp separatrix gives two equal
    ends; orbits between them do both. Where the edge of a layer is frayed the bisection finds a place in the fringe, so
    that the width is a lower bound.
    """
    duration = turns * half_turn(ellipsoid)

    def circulates(offset: float) -> bool:
        _, psi = orbit(ellipsoid, pi / 2 + offset, PSI, duration)
        return bool(np.any(np.abs(np.diff(psi)) > 2))

    def librates(offset: float) -> bool:
        theta, _ = orbit(ellipsoid, pi / 2 + offset, PSI, duration)
        return bool(np.any((theta[1:] - pi / 2) * (theta[:-1] - pi / 2) < 0))

    return Layer(turns, _last(lambda offset: not circulates(offset)), _last(librates))


def _last(holds: Callable[[float], bool]) -> float:
    """Where a property that holds close to θ = π/2 is lost."""
    low, high = 0.0, 1.2
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        low, high = (middle, high) if holds(middle) else (low, middle)
    return (low + high) / 2


def saddle_growth(ellipsoid: Ellipsoid) -> float:
    """Exponent of the saddle (π/2, π/2) of the section, per half turn.

    The map next to it has determinant one and, by the reversal φ → -φ, equal diagonal elements cosh λ.
    """
    _, psi = orbit(ellipsoid, pi / 2, pi / 2 - BESIDE, 1.5 * half_turn(ellipsoid))
    return acosh((pi / 2 - abs(psi[0])) / BESIDE)
