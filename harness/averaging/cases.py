"""The bodies and starts that the studies of averaging follow: the paper's, and those of the second order."""

from dataclasses import dataclass
from math import pi

import numpy as np

from polhode.models.rotation import Triple
from polhode.models.scene import BodyStart, EulerStart, Scene
from polhode.models.scenes import (
    NEAR_POLE_START,
    PAPER_ELLIPSOID,
    PAPER_START,
    PROLATE,
    SADDLE_START,
    SPHEROID_START,
    aligned_start,
)
from polhode.models.shape import Ellipsoid

# St of the paper's cases; those up to QUICK make a first look. A run over T = 5e5 in long double takes half a minute:
# only the paper's own figures are followed to the largest St.
STOKES, LARGEST_STOKES, QUICK = (1e2, 10**2.5, 1e3, 10**3.5, 1e4, 1e5), 1e6, 1e3

AGAINST = EulerStart((1.0, 0.3, 0.2), (-1.0, 0.5, -2.0))
GENTLE = EulerStart((1.5, 2.0, 0.2), (0.6, 0.4, -0.3))
# Starts of the second order's cases by name; the others are angular velocities at the orientation TILTED.
NAMED = {"paper": SPHEROID_START, "paper, ψ̇ = -1": PAPER_START, "against": AGAINST, "gentle": GENTLE}
TILTED = (0.8, 0.3, -0.4, 0.2)


@dataclass(frozen=True)
class Subject:
    """A body and a start, followed to one slow time at a range of Stokes numbers."""

    name: str
    semi_axes: Triple
    start: EulerStart | BodyStart
    slow_time: float
    stokes: tuple[float, ...]

    @property
    def family(self) -> str:
        """What the paper calls the shape: "spheroid" or "ellipsoid"."""
        return "ellipsoid" if Ellipsoid(self.semi_axes).kind == "triaxial" else "spheroid"

    @property
    def axes(self) -> str:
        """The semi-axes as a:b:c."""
        return ":".join(f"{axis:g}" for axis in self.semi_axes)

    def scene(self, stokes: float) -> Scene:
        """The case at one St."""
        return Scene(Ellipsoid(self.semi_axes), stokes, self.start, self.slow_time * stokes)


def paper_cases() -> list[Subject]:
    """The paper's cases: its two starts of each shape, and one start of each phase plane."""
    far = (*STOKES, LARGEST_STOKES)
    cases = [
        Subject("spheroid κ = 2", PROLATE, SPHEROID_START, 0.5, far),
        Subject("spheroid κ = 2, near the saddle", PROLATE, NEAR_POLE_START, 0.5, STOKES),
        Subject("ellipsoid (1, 0.8, 0.5)", PAPER_ELLIPSOID, PAPER_START, 0.5, far),
        Subject("ellipsoid (1, 0.8, 0.5), near the saddle", PAPER_ELLIPSOID, SADDLE_START, 0.5, STOKES),
    ]
    planes = {f"phase plane κ = {kappa:g}": (1.0, 1.0, kappa) for kappa in (2.0, 3.33, 0.5, 0.3)}
    planes |= {f"phase plane (1, {b:g}, {c:g})": (1.0, b, c) for b in (0.55, 0.75, 0.95) for c in (0.5, 0.3)}
    for name, axes in planes.items():
        body = Ellipsoid(axes)
        cases.append(Subject(name, axes, aligned_start(body, -max(body.inertia), pi / 4), 0.5, STOKES))
    return cases


def _spheroid(kappa: float, name: str, slow_time: float, lowest: float = 4.0) -> Subject:
    return Subject(name, (1.0, 1.0, kappa), NAMED[name], slow_time, _stokes(lowest, 5))


def _spinning(axes: Triple, spin: Triple, slow_time: float, points: int) -> Subject:
    name = f"ω = ({', '.join(f'{rate:g}' for rate in spin)})"
    return Subject(name, axes, BodyStart(TILTED, spin), slow_time, _stokes(4.0, points))


def _stokes(lowest: float, points: int) -> tuple[float, ...]:
    """Over two decades, in three digits."""
    return tuple(float(f"{10**exponent:.3g}") for exponent in np.linspace(lowest, lowest + 2, points).tolist())


# Cases of the second order away from resonances,
AWAY = (
    *(_spheroid(kappa, name, 0.1) for kappa in (0.1, 0.25, 0.5, 2.0) for name in ("paper", "against")),
    *(_spheroid(kappa, "gentle", 0.1) for kappa in (0.5, 2.0)),
    *(_spheroid(4.0, name, 0.05) for name in ("paper", "against")),
    *(_spheroid(10.0, name, 0.02, 4.5) for name in ("paper", "against")),
    _spinning((1.0, 0.8, 0.5), (0.3, 0.2, 1.5), 0.03, 5),
    _spinning((1.0, 0.8, 0.5), (0.6, 0.5, 1.0), 0.03, 5),
    _spinning((1.0, 0.8, 0.5), (1.5, 0.2, 0.1), 0.03, 5),
    _spinning((0.5, 1.0, 0.8), (-1.2, 0.5, 0.4), 0.03, 5),
    _spinning((1.0, 0.6, 0.4), (0.1, 0.1, -0.8), 0.03, 5),
    _spinning((1.0, 0.6, 0.4), (0.3, 0.2, 1.5), 0.03, 5),
    _spinning((1.0, 0.9, 0.3), (0.5, -0.4, -1.2), 0.03, 5),
    _spinning((1.0, 0.9, 0.3), (0.6, 0.5, 1.0), 0.03, 5),
)
# through resonances of polhode and precession,
RESONANT = (
    _spinning((1.0, 0.8, 0.5), (0.6, 0.5, 0.5), 0.1, 3),
    _spinning((1.0, 0.6, 0.4), (0.5, -0.4, -1.2), 0.05, 3),
    _spinning((1.0, 0.6, 0.4), (1.5, 0.6, 0.4), 0.03, 3),
    _spinning((1.0, 0.9, 0.3), (1.0, 0.6, 0.6), 0.03, 3),
    _spinning((1.0, 0.8, 0.5), (1.2, 0.5, 0.2), 0.1, 3),
)
# and up to L² = 2EI₂.
CROSSING = (
    Subject("paper, ψ̇ = -1", (1.0, 0.8, 0.5), PAPER_START, 0.1, _stokes(4.0, 3)),
    _spinning((1.0, 0.8, 0.5), (0.8, 0.5, 0.3), 0.1, 3),
    _spinning((1.0, 0.6, 0.4), (1.5, 0.6, 0.4), 0.1, 3),
)
