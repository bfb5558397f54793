"""Random questions from a seed: scenes of every kind, and what is requested of them."""

from dataclasses import dataclass
from math import acos, inf, pi, sqrt
from typing import Literal

import numpy as np

from polhode.models.rotation import Triple
from polhode.models.scene import BodyStart, EulerStart, Scene
from polhode.models.shape import Ellipsoid

Want = Literal["slow", "orientation"]

# A random number from 0 to 1 chooses the sort of a scene, by limits in this order: very many rotations
# below `_MANY_TURNS`, a slow time of order one at large St below `_LONG`, so that 0.3 of the scenes have
# it, planar starts in the next `_PLANAR`, and ordinary scenes in the remaining 0.42. The shares, decades
# and limits of this module are choices, so that each sort occurs; they are not measured.
_PLANAR = 0.08
# Shares of the ordinary scenes at St = 0 and St = inf.
_AT_ZERO = 0.08
_AT_INFINITY = 0.05
# Limits of the scenes of a slow time of order one, and of very many rotations.
_LONG = 0.5
_MANY_TURNS = 0.2
# Decades of these rotations, and of their slow time.
_TURNS = (3.7, 5.2)
_TURNS_SLOW_TIMES = (-1.5, 0.0)
# Share of the long ones that start from rest.
_LONG_FROM_REST = 0.1
# Decades of St and of the slow time of long ones.
_LONG_STOKES = (3.0, 8.0)
_LONG_SLOW_TIMES = (-1.5, 0.3)
# Rotations of the others, at most; one in ten has ten times more.
_MOST_ROTATIONS = 600.0
# Decades of their damping times, at most.
_MOST_DAMPING_TIMES = (4.7, 5.7)
# Rows of the output, one of these.
_SAMPLES = (51, 201, 501)
# Decades of the error.
_ERRORS = (-11.0, -2.0)


@dataclass(frozen=True)
class Question:
    """A scene, and what is requested: output at `samples` equispaced times, within an error."""

    name: str
    scene: Scene
    samples: int
    error: float
    want: Want


def questions(seed: int, count: int) -> list[Question]:
    """Random shapes, starts, Stokes numbers, durations, errors and wants; each has a generator of its own."""
    return [_question(f"{seed}-{i}", np.random.default_rng((seed, i))) for i in range(count)]


def _question(name: str, random: np.random.Generator) -> Question:
    sort = random.random()
    if sort < _MANY_TURNS:
        scene = _turning(random)
    elif sort < _LONG:
        scene = _long(random)
    elif sort < _LONG + _PLANAR:
        scene = _planar(random)
    else:
        scene = _ordinary(random)
    samples = int(random.choice(_SAMPLES))
    error = float(f"{10 ** random.uniform(*_ERRORS):.1e}")
    angle = random.random() < 0.4 and scene.ellipsoid.kind != "sphere"
    return Question(name, scene, samples, error, "orientation" if angle else "slow")


def _long(random: np.random.Generator) -> Scene:
    """A slow time of order one, whatever the Stokes number; some from rest."""
    stokes = 10 ** random.uniform(*_LONG_STOKES)
    slow_time = 10 ** random.uniform(*_LONG_SLOW_TIMES)
    size = 0.0 if random.random() < _LONG_FROM_REST else 1.0
    ellipsoid = Ellipsoid(_semi_axes(random))
    return Scene(ellipsoid, float(stokes), _start(random, size), float(slow_time * stokes))


def _turning(random: np.random.Generator) -> Scene:
    """Very many rotations, over whatever slow time they take."""
    start = _start(random, 1.0)
    speed = max(0.5, float(np.linalg.norm(start.angular_velocity)))
    time = 2 * pi / speed * 10 ** random.uniform(*_TURNS)
    stokes = time / 10 ** random.uniform(*_TURNS_SLOW_TIMES)
    return Scene(Ellipsoid(_semi_axes(random)), float(stokes), start, float(time))


def _ordinary(random: np.random.Generator) -> Scene:
    """Any scene that a user may ask for, within hundreds of rotations."""
    ellipsoid = Ellipsoid(_semi_axes(random))
    limit = random.random()
    stokes = float(10 ** random.uniform(-4, 6))
    if limit < _AT_ZERO:
        stokes = 0.0
    elif limit < _AT_ZERO + _AT_INFINITY:
        stokes = inf
    size = _speed(random) if stokes > 0 else 0.0
    time = _duration(random, ellipsoid, stokes, size)
    return Scene(ellipsoid, stokes, _start(random, size), time)


def _planar(random: np.random.Generator) -> Scene:
    """A start with body axis z' along the vorticity, z, and the spin about it: the motion is planar."""
    stokes = float(10 ** random.uniform(-4, 6))
    size = random.uniform(0.1, 3)
    half = random.uniform(0, pi)
    start = BodyStart((float(np.cos(half)), 0.0, 0.0, float(np.sin(half))), (0.0, 0.0, size))
    ellipsoid = Ellipsoid(_semi_axes(random))
    return Scene(ellipsoid, stokes, start, _duration(random, ellipsoid, stokes, size))


def _start(random: np.random.Generator, size: float) -> BodyStart:
    """Any orientation, all equally likely, and an angular velocity of normal components, times `size`."""
    angles = (acos(random.uniform(-1, 1)), random.uniform(0, 2 * pi), random.uniform(0, 2 * pi))
    x, y, z = (size * random.normal(size=3)).tolist()
    return BodyStart(EulerStart(angles).quaternion, (x, y, z))


def _semi_axes(random: np.random.Generator) -> Triple:
    kinds = ["triaxial", "near", "prolate", "oblate", "sphere"]
    family = random.choice(kinds, p=[0.45, 0.1, 0.2, 0.2, 0.05])
    middle, short = sorted(10 ** random.uniform(-1.0, 0.0, 2), reverse=True)
    axes = {
        "triaxial": (1.0, middle, short),
        "near": (1.0, 1 - 10 ** random.uniform(-6, -1.5), short),
        "prolate": (1.0, short, short),
        "oblate": (1.0, 1.0, short),
        "sphere": (1.0, 1.0, 1.0),
    }[str(family)]
    a, b, c = random.permutation(axes).tolist()
    return a, b, c


def _speed(random: np.random.Generator) -> float:
    """Size of the angular velocity: of order one, at rest, slow or fast."""
    kind = random.choice(["usual", "rest", "slow", "fast"], p=[0.7, 0.12, 0.09, 0.09])
    sizes = {
        "usual": 1.0,
        "rest": 0.0,
        "slow": 10 ** random.uniform(-2, -0.5),
        "fast": 10 ** random.uniform(0.5, 1.5),
    }
    return sizes[str(kind)]


def _duration(
    random: np.random.Generator, ellipsoid: Ellipsoid, stokes: float, size: float
) -> float:
    """Duration: a slow time where there is one, unless rotations or damping times become too many."""
    # √3 `size` is the root mean square of an angular velocity's length; the flow turns a body at 0.5. From
    # rest a body turns by its first radian in a time of order √St, which stands for the slow time.
    turns = _MOST_ROTATIONS * 10 ** random.uniform(-1, 0) * (10 if random.random() < 0.1 else 1)
    most = turns * 2 * pi / max(sqrt(3) * size, 0.5)
    if 0 < stokes < inf:
        damped = 10 ** random.uniform(*_MOST_DAMPING_TIMES)
        most = min(most, damped * stokes / max(ellipsoid.damping))
    if stokes < 30 or stokes == inf:
        return float(min(10 ** random.uniform(1, 2.5), most))
    slow = 10 ** random.uniform(0, 1.3) * sqrt(stokes)
    if size > 0:
        slow = 10 ** random.uniform(-1.7, -0.3) * stokes
    return float(min(slow, most))
