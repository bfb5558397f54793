"""Random questions from a seed: scenes of every kind, and what is requested of them."""

from dataclasses import dataclass
from math import acos, inf, pi, sqrt
from typing import Literal

import numpy as np

from polhode.models.rotation import Triple
from polhode.models.scene import BodyStart, EulerStart, Scene
from polhode.models.shape import Ellipsoid

Want = Literal["slow", "orientation"]

# A random number from 0 to 1 chooses the sort of a scene, by limits in this order. Below `_MANY_TURNS` a
# scene has very many rotations. Below `_LONG` it has a slow time of order one at large St, so that 0.3 of the
# scenes have it. In the next `_PLANAR` the start is planar. The remaining 0.42 are ordinary scenes. The shares, decades
# and limits of this module are choices, so that each sort occurs; they are not measured.
# "Decades" are the least and the largest log₁₀ of a number that is drawn.
_PLANAR = 0.08
# Shares of the ordinary scenes at St = 0 and St = inf.
_AT_ZERO = 0.08
_AT_INFINITY = 0.05
# Limits of the scenes of a slow time of order one, and of very many rotations.
_LONG = 0.5
_MANY_TURNS = 0.2
# Decades of these rotations, and of their slow time t₂ = t/St.
_TURNS = (3.7, 5.2)
_TURNS_SLOW_TIMES = (-1.5, 0.0)
# Share of the long ones that start from rest.
_LONG_FROM_REST = 0.1
# Decades of St and of the slow time of long ones.
_LONG_STOKES = (3.0, 8.0)
_LONG_SLOW_TIMES = (-1.5, 0.3)
# Decades of St of planar starts, and of the ordinary scenes that are not at 0 or inf.
_ANY_STOKES = (-4.0, 6.0)
# Sizes of the angular velocity of planar starts, in shear rates.
_PLANAR_SPEEDS = (0.1, 3.0)
# Rotations of the others, at most: this number times a power of ten of these decades. The share
# `_FAR_SHARE` of these scenes has ten times as many.
_MOST_ROTATIONS = 600.0
_ROTATIONS_BELOW_MOST = (-1.0, 0.0)
_FAR_SHARE = 0.1
# Decades of their damping times, at most.
_MOST_DAMPING_TIMES = (4.7, 5.7)
# St from which on a run's duration follows from a slow time; below, and at inf, decades of its time.
_SLOW_TIME_FROM = 30.0
_SHORT_TIMES = (1.0, 2.5)
# Decades of the slow time of a body that turns, and of the time over √St of one that starts from rest.
_SLOW_TIMES = (-1.7, -0.3)
_TIMES_FROM_REST = (0.0, 1.3)
# Angular velocity, in shear rates, at which the flow turns a body.
_FLOW_SPEED = 0.5
# Share of the questions that ask for the orientation, where there is one.
_ORIENTATION_SHARE = 0.4
# Kinds of shapes with their shares. "near" has two semi-axes that differ by a power of ten of the decades below,
# relative to the longer one. The other semi-axes have decades of their own; the longest is 1.
_SHAPES = {"triaxial": 0.45, "near": 0.1, "prolate": 0.2, "oblate": 0.2, "sphere": 0.05}
_NEAR_DIFFERENCES = (-6.0, -1.5)
_AXES = (-1.0, 0.0)
# Sorts of angular velocities with their shares, and the decades of the slow and the fast ones over usual ones.
_SPEEDS = {"usual": 0.7, "rest": 0.12, "slow": 0.09, "fast": 0.09}
_SLOW_SPEEDS = (-2.0, -0.5)
_FAST_SPEEDS = (0.5, 1.5)
# Rows of the output, one of these.
_SAMPLES = (51, 201, 501)
# Decades of the error, of L and E over I_max or of the orientation in rad.
_ERRORS = (-11.0, -2.0)


@dataclass(frozen=True)
class Question:
    """A scene, and what is requested: output at `samples` equispaced times, within an error."""

    name: str
    scene: Scene
    samples: int
    error: float  # of L and E over I_max, or of the orientation in rad
    want: Want


def questions(seed: int, count: int) -> list[Question]:
    """Random shapes, starts, Stokes numbers, durations, errors and wants; each has a generator of its own."""
    return [_question(f"{seed}-{i}", np.random.default_rng((seed, i))) for i in range(count)]


def _question(name: str, random: np.random.Generator) -> Question:
    """A random question under a name."""
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
    oriented = random.random() < _ORIENTATION_SHARE and scene.ellipsoid.kind != "sphere"
    return Question(name, scene, samples, error, "orientation" if oriented else "slow")


def _long(random: np.random.Generator) -> Scene:
    """A slow time of order one, whatever the Stokes number; some from rest."""
    stokes = 10 ** random.uniform(*_LONG_STOKES)
    slow_time = 10 ** random.uniform(*_LONG_SLOW_TIMES)
    size = 0.0 if random.random() < _LONG_FROM_REST else 1.0
    ellipsoid = Ellipsoid(_semi_axes(random))
    return Scene(ellipsoid, float(stokes), _start(random, size), float(slow_time * stokes))


def _turning(random: np.random.Generator) -> Scene:
    """Very many rotations, over a slow time that is drawn too: St follows from both."""
    start = _start(random, 1.0)
    speed = max(_FLOW_SPEED, float(np.linalg.norm(start.angular_velocity)))
    time = 2 * pi / speed * 10 ** random.uniform(*_TURNS)
    stokes = time / 10 ** random.uniform(*_TURNS_SLOW_TIMES)
    return Scene(Ellipsoid(_semi_axes(random)), float(stokes), start, float(time))


def _ordinary(random: np.random.Generator) -> Scene:
    """Any scene that a user may ask for, mostly within hundreds of rotations."""
    ellipsoid = Ellipsoid(_semi_axes(random))
    limit = random.random()
    stokes = float(10 ** random.uniform(*_ANY_STOKES))
    if limit < _AT_ZERO:
        stokes = 0.0
    elif limit < _AT_ZERO + _AT_INFINITY:
        stokes = inf
    size = _speed(random) if stokes > 0 else 0.0
    time = _duration(random, ellipsoid, stokes, size)
    return Scene(ellipsoid, stokes, _start(random, size), time)


def _planar(random: np.random.Generator) -> Scene:
    """A start with body axis z' along the vorticity, z, and the spin about it: the motion is planar."""
    stokes = float(10 ** random.uniform(*_ANY_STOKES))
    size = random.uniform(*_PLANAR_SPEEDS)
    # The quaternion of a turn about z has half of its angle.
    half_angle = random.uniform(0, pi)
    quaternion = (float(np.cos(half_angle)), 0.0, 0.0, float(np.sin(half_angle)))
    start = BodyStart(quaternion, (0.0, 0.0, size))
    ellipsoid = Ellipsoid(_semi_axes(random))
    return Scene(ellipsoid, stokes, start, _duration(random, ellipsoid, stokes, size))


def _start(random: np.random.Generator, size: float) -> BodyStart:
    """Any orientation, all equally likely, and an angular velocity of normal components, times `size`."""
    angles = (acos(random.uniform(-1, 1)), random.uniform(0, 2 * pi), random.uniform(0, 2 * pi))
    x, y, z = (size * random.normal(size=3)).tolist()
    return BodyStart(EulerStart(angles).quaternion, (x, y, z))


def _semi_axes(random: np.random.Generator) -> Triple:
    """Semi-axes of a random shape along the body axes, in random order; the longest is 1."""
    kind = random.choice([*_SHAPES], p=[*_SHAPES.values()])
    middle, short = sorted(10 ** random.uniform(*_AXES, 2), reverse=True)
    # Each entry is drawn, whichever counts: so the numbers drawn afterwards do not depend on the kind.
    axes = {
        "triaxial": (1.0, middle, short),
        "near": (1.0, 1 - 10 ** random.uniform(*_NEAR_DIFFERENCES), short),
        "prolate": (1.0, short, short),
        "oblate": (1.0, 1.0, short),
        "sphere": (1.0, 1.0, 1.0),
    }[str(kind)]
    a, b, c = random.permutation(axes).tolist()
    return a, b, c


def _speed(random: np.random.Generator) -> float:
    """Size of the angular velocity: of order one, at rest, slow or fast."""
    kind = random.choice([*_SPEEDS], p=[*_SPEEDS.values()])
    sizes = {
        "usual": 1.0,
        "rest": 0.0,
        "slow": 10 ** random.uniform(*_SLOW_SPEEDS),
        "fast": 10 ** random.uniform(*_FAST_SPEEDS),
    }
    return sizes[str(kind)]


def _duration(
    random: np.random.Generator, ellipsoid: Ellipsoid, stokes: float, size: float
) -> float:
    """Duration: a slow time where there is one, unless rotations or damping times become too many."""
    # √3 `size` is the root mean square of an angular velocity's length. From rest a body turns by its first
    # radian in a time of order √St, which stands for the slow time.
    turns = _MOST_ROTATIONS * 10 ** random.uniform(*_ROTATIONS_BELOW_MOST)
    if random.random() < _FAR_SHARE:
        turns = turns * 10
    most = turns * 2 * pi / max(sqrt(3) * size, _FLOW_SPEED)
    if 0 < stokes < inf:
        damping_times = 10 ** random.uniform(*_MOST_DAMPING_TIMES)
        most = min(most, damping_times * stokes / max(ellipsoid.damping))
    if stokes < _SLOW_TIME_FROM or stokes == inf:
        return float(min(10 ** random.uniform(*_SHORT_TIMES), most))
    time = 10 ** random.uniform(*_TIMES_FROM_REST) * sqrt(stokes)
    if size > 0:
        time = 10 ** random.uniform(*_SLOW_TIMES) * stokes
    return float(min(time, most))
