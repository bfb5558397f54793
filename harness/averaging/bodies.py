"""Random bodies and starts by kind: body i of a kind is always the same.

A test notices if another NumPy draws other numbers from a seed.

A "path" is the solution of the equations averaged to first order, in slow time t₂ = t/St. A "kick" is
the jump of L that a resonance of polhode and precession gives, which falls like 1/√St
(`docs/second-order.md`, `polhode.models.second_order.outline`). L² = 2EI₂ is the separatrix between
polhodes about the longest and about the shortest axis.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache
from math import inf, nan, sqrt

import numpy as np

from polhode.harness.answers.averaging import above_separatrix
from polhode.harness.answers.starts import settled
from polhode.models.catalogue import averaged_form, form as find_form
from polhode.models.form import FormNotValidError
from polhode.models.rotation import Triple
from polhode.models.scene import BodyStart, Scene
from polhode.models.second_order.outline import outline
from polhode.models.shape import Ellipsoid
from polhode.solvers.catalogue import available_like
from polhode.solvers.solve import solve

# Kinds of bodies, with the words that pages show. The place of a kind is part of its seed: new kinds go to the end.
KINDS = {
    "prolate": "spheroid, long along its axis",
    "oblate": "spheroid, flat along its axis",
    "near-spheroidal": "two semi-axes that differ by 0.1 to 5 %",
    "stays": "triaxial, on one side of L² = 2EI₂, no strong resonance",
    "resonance": "triaxial, on one side of L² = 2EI₂, through a strong resonance",
    "crosses": "triaxial, across L² = 2EI₂",
    "rest": "any shape, from rest",
    "settled": "any shape, near its steady rotation about the vorticity",
}
# Slow time of a run, the largest of `random_study.STUDIED_SLOW_TIMES`: both change together, as that module imports
# this one.
_LONGEST = 1.0
_SEED = 20261127  # Any number: another one gives other bodies.
# Least semi-axis over the longest one, as drawn; `_near` shortens it by up to 5 % more. An estimate: the study says
# nothing of more slender or flatter bodies.
_LEAST_AXIS = 0.15
# Largest ratio, below 1, of two semi-axes that count as different. An estimate; "near-spheroidal" has closer ones.
_LARGEST_RATIO = 0.95
# Least and largest log₁₀ of the relative difference of two semi-axes that hardly differ. The largest
# difference, 5 %, is where different ones begin (`_LARGEST_RATIO`); the least one is an estimate.
_NEAR_EXPONENTS = (-3.0, -1.3)
# A resonance is strong if its kick to L over I_max is at least this over √St. An estimate: with twice as much,
# some bodies would move from the kind "resonance" to "stays".
STRONG_KICK = 0.01
# St at which kicks are looked up. Any large one gives the same √St times the kick, as kicks fall like 1/√St.
_KICK_STOKES = 1e6
_KICK_DIGITS = 3  # Significant digits of a kick, as of measured numbers in the tables.
# Samples of the first-order path, on which crossings are looked for. An estimate: a crossing is known to one
# interval, 1/2000 of the run, and a path that returns within one interval does not count as crossing.
_PATH_SAMPLES = 2001
# Solver of that path, or one like it where its library is missing, and its tolerance: the solver's error moves a
# crossing by far less than an interval. A choice: the path is smooth, and any explicit solver serves.
_PATH_SOLVER = "cyrk-vern8"
_PATH_TOLERANCE = 1e-10
_DIGITS = 6  # Significant digits of all drawn numbers: a body is what its row in the table says.


@dataclass(frozen=True)
class Body:
    """A body and its start."""

    kind: str  # one of KINDS
    body: int  # its number within the kind, from 0 on
    semi_axes: Triple  # along the body axes 1, 2 and 3; the longest one is 1
    quaternion: tuple[float, float, float, float]  # w, x, y, z
    spin: Triple  # angular velocity about the body axes, in shear rates
    # Slow time of the first sample of the first-order path beyond L² = 2EI₂, NaN if there is none.
    crossing: float
    # √St times the strongest kick of a resonance along the path, over I_max. NaN if it was not looked up: it is for
    # the kinds "stays" and "resonance" alone, if the path does not cross.
    kick: float

    @property
    def crosses(self) -> bool:
        """Whether it crosses L² = 2EI₂ within the study's slow time."""
        return self.crossing < inf

    def scene(self, stokes: float, slow_time: float = _LONGEST) -> Scene:
        """Its scene at one St, up to a slow time t₂ = t/St."""
        start = BodyStart(self.quaternion, self.spin)
        return Scene(Ellipsoid(self.semi_axes), stokes, start, slow_time * stokes)


@cache
def drawn(kind: str, number: int) -> Body:
    """The body of that number of a kind: the first of its own random sequence that belongs to the kind."""
    draw = np.random.default_rng([_SEED, [*KINDS].index(kind), number])
    for body in _candidates(kind, number, draw):
        if _belongs(body):
            return body
    raise AssertionError("the sequence of candidates has no end")


def _candidates(kind: str, number: int, draw: np.random.Generator) -> Iterator[Body]:
    """Bodies with axes and start of a kind, without end; not all of them are of the kind."""
    axes_of = _AXES.get(kind, _any)
    start_of = _STARTS.get(kind, _isotropic)
    while True:
        axes = axes_of(draw)
        # The longest axis is 1, along any of the body's three.
        a, b, c = _rounded(draw.permutation(axes / axes.max()))
        quaternion, spin = start_of(draw, Ellipsoid((a, b, c)))
        w, x, y, z = _rounded(quaternion)
        omega_1, omega_2, omega_3 = _rounded(spin)
        start = (w, x, y, z), (omega_1, omega_2, omega_3)
        body = Body(kind, number, (a, b, c), *start, crossing=nan, kick=nan)
        body = replace(body, crossing=_crossing(body))
        if kind in ("stays", "resonance") and not body.crosses:
            body = replace(body, kick=_strongest_kick(body))
        yield body


def _belongs(body: Body) -> bool:
    """Whether a candidate is of its kind; only the kinds that crossings and kicks define refuse any.

    A candidate that crosses has NaN for a kick, and is neither "stays" nor "resonance".
    """
    if body.kind == "crosses":
        return body.crosses
    if body.kind == "stays":
        return body.kick < STRONG_KICK
    if body.kind == "resonance":
        return body.kick >= STRONG_KICK
    return True


def _crossing(body: Body) -> float:
    """Slow time of the first sample of the first-order path beyond L² = 2EI₂; NaN if there is none, or no path.

    The St may be any: the equations are in slow time and do not contain it.
    """
    scene = body.scene(_KICK_STOKES)
    if scene.ellipsoid.kind != "triaxial":
        return nan
    form = find_form(averaged_form(scene))
    try:
        problem = form.problem(scene)
    except FormNotValidError:
        return nan
    times = np.linspace(0.0, problem.end, _PATH_SAMPLES)
    # A run that ends early is looked at as far as it came.
    run = solve(problem, available_like(_PATH_SOLVER), _PATH_TOLERANCE, times)
    observables = form.observe(scene, run.states)
    excess = above_separatrix(scene.ellipsoid, observables)
    # The first sample whose excess of L² over 2EI₂ has another sign than the start's.
    other_side = np.flatnonzero(excess * excess[0] < 0)
    return float(times[other_side[0]]) if len(other_side) else nan


def _strongest_kick(body: Body) -> float:
    """√St times the strongest kick of a resonance on the first-order path, over I_max."""
    kicks = outline(body.scene(_KICK_STOKES)).kicks
    strongest = max((kick.size for kick in kicks), default=0.0)
    return float(f"{sqrt(_KICK_STOKES) * strongest:.{_KICK_DIGITS}g}")


def _log_uniform(
    draw: np.random.Generator, low: float, high: float, size: int | None = None
) -> np.ndarray:
    """Numbers between two limits, uniform in their logarithms; one number if `size` is None."""
    return np.exp(draw.uniform(np.log(low), np.log(high), size))


def _prolate(draw: np.random.Generator) -> np.ndarray:
    """Semi-axes of a spheroid whose odd axis is the longest."""
    across = _log_uniform(draw, _LEAST_AXIS, _LARGEST_RATIO)
    return np.array([across, across, 1.0])


def _oblate(draw: np.random.Generator) -> np.ndarray:
    """Semi-axes of a spheroid whose odd axis is the shortest."""
    return np.array([1.0, 1.0, _log_uniform(draw, _LEAST_AXIS, _LARGEST_RATIO)])


def _near(draw: np.random.Generator) -> np.ndarray:
    """Semi-axes of which two hardly differ."""
    # Half are nearly prolate, half nearly oblate: one of the two equal axes becomes shorter.
    axes = _prolate(draw) if draw.random() < 0.5 else _oblate(draw)
    axes[0] *= 1 - 10 ** draw.uniform(*_NEAR_EXPONENTS)
    return axes


def _triaxial(draw: np.random.Generator) -> np.ndarray:
    """Three different semi-axes, the shortest first."""
    while True:
        axes = np.sort(_log_uniform(draw, _LEAST_AXIS, 1.0, 3))
        if np.max(axes[:-1] / axes[1:]) <= _LARGEST_RATIO:
            return axes


def _any(draw: np.random.Generator) -> np.ndarray:
    """Semi-axes of any shape: half of them triaxial, a quarter of each kind of spheroid."""
    shapes = (_triaxial, _triaxial, _prolate, _oblate)
    return shapes[draw.integers(len(shapes))](draw)


# Semi-axes by kind, in any units and order; the kinds that are not here take any shape.
_AXES: dict[str, Callable[[np.random.Generator], np.ndarray]] = {
    "prolate": _prolate,
    "oblate": _oblate,
    "near-spheroidal": _near,
    "stays": _triaxial,
    "resonance": _triaxial,
    "crosses": _triaxial,
}


def _isotropic(draw: np.random.Generator, _: Ellipsoid) -> tuple[np.ndarray, np.ndarray]:
    """Isotropic orientation, and three standard normals of angular velocity."""
    quaternion = draw.normal(size=4)
    return quaternion / np.linalg.norm(quaternion), draw.normal(size=3)


def _rest(draw: np.random.Generator, ellipsoid: Ellipsoid) -> tuple[np.ndarray, np.ndarray]:
    """Isotropic orientation, at rest."""
    quaternion, _ = _isotropic(draw, ellipsoid)
    return quaternion, np.zeros(3)


# Starts by kind: a quaternion (w, x, y, z), shape (4,), and an angular velocity in body axes, shape (3,). The
# kinds that are not here start with an isotropic orientation.
_STARTS = {"rest": _rest, "settled": settled}


def _rounded(values: np.ndarray) -> list[float]:
    """The values in `_DIGITS` significant digits."""
    return [float(f"{value:.{_DIGITS}g}") for value in values]
