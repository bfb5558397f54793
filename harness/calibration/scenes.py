"""Random scenes from a seed: some to fit the laws on, others, from another seed, to hold out."""

from dataclasses import dataclass
from math import acos, inf, log10, pi, sqrt
from typing import Literal

import numpy as np

from polhode.models.rotation import Triple
from polhode.models.scene import BodyStart, EulerStart, Scene
from polhode.models.shape import Ellipsoid

Want = Literal["slow", "orientation"]
# Short: whatever a user may ask for, within hundreds of rotations. Long: t₂ of order one at large
# St, up to millions.
Stratum = Literal["short", "long"]
STRATA: tuple[Stratum, ...] = ("short", "long")

TRAINING_SEED = 1922

# Shares of special scenes: enough of each for laws of the forms that only they have.
PLANAR, AT_ZERO, AT_INFINITY = 0.08, 0.08, 0.05
# A run of more rotations than this would cost too much to measure by every method; one scene in ten
# has ten times more.
MOST_ROTATIONS = 600.0
# References are explicit: their cost grows with the number of damping times, T max(8πX/I)/St, held
# between these.
MOST_DAMPING_TIMES = (5e4, 5e5)
SAMPLES = (51, 201, 501)
# The long stratum: its place among the seeds, its Stokes numbers and slow times, log-uniform as its
# shorter axes are.
LONG = 0x5C
LONG_STOKES, LONG_SLOW_TIMES, SHORTEST, LONG_FROM_REST = (1e3, 1e8), (0.03, 2.0), 0.15, 0.1


@dataclass(frozen=True)
class Question:
    """A scene, and what is asked of it: output at so many equispaced times, within an error."""

    name: str
    scene: Scene
    samples: int
    error: float
    want: Want


def questions(seed: int, count: int, stratum: Stratum = "short") -> list[Question]:
    """Random questions: shapes, starts, Stokes numbers, durations, errors and wants."""
    # Each has its own generator, so that the first ones do not depend on how many are asked for.
    head, name = ((seed,), "random") if stratum == "short" else ((seed, LONG), "long")
    return [
        _question(f"{name}-{seed}-{i}", np.random.default_rng((*head, i)), stratum)
        for i in range(count)
    ]


def _question(name: str, random: np.random.Generator, stratum: Stratum) -> Question:
    drawn = _long if stratum == "long" else _planar if random.random() < PLANAR else _scene
    scene = drawn(random)
    samples = int(random.choice(SAMPLES))
    error = float(f"{10 ** random.uniform(-11, -2):.1e}")
    want: Want = (
        "orientation" if random.random() < 0.4 and scene.ellipsoid.kind != "sphere" else "slow"
    )
    return Question(name, scene, samples, error, want)


def _scene(random: np.random.Generator) -> Scene:
    ellipsoid, stokes = Ellipsoid(_semi_axes(random)), _stokes(random)
    quaternion = _oriented(random)
    size = _speed(random) if stokes > 0 else 0.0
    x, y, z = (size * random.normal(size=3)).tolist()
    return Scene(
        ellipsoid,
        stokes,
        BodyStart(quaternion, (x, y, z)),
        _duration(random, ellipsoid, stokes, size),
    )


def _long(random: np.random.Generator) -> Scene:
    """A run of St-scale: t₂ of order one, whatever the Stokes number; some from rest."""
    middle, short = sorted(10 ** random.uniform(log10(SHORTEST), 0, 2), reverse=True)
    spheroids: list[Triple] = [(1.0, short, short), (1.0, 1.0, short)]
    axes = (1.0, middle, short) if random.random() < 0.5 else spheroids[random.integers(2)]
    a, b, c = (float(axes[i]) for i in random.permutation(3))
    stokes, slow_time = (
        10 ** random.uniform(*np.log10(limits)) for limits in (LONG_STOKES, LONG_SLOW_TIMES)
    )
    size = 0.0 if random.random() < LONG_FROM_REST else 1.0
    x, y, z = (size * random.normal(size=3)).tolist()
    start = BodyStart(_oriented(random), (x, y, z))
    return Scene(Ellipsoid((a, b, c)), float(stokes), start, float(slow_time * stokes))


def _oriented(random: np.random.Generator) -> tuple[float, float, float, float]:
    """Any orientation, each as likely."""
    return EulerStart(
        (acos(random.uniform(-1, 1)), random.uniform(0, 2 * pi), random.uniform(0, 2 * pi))
    ).quaternion


def _planar(random: np.random.Generator) -> Scene:
    """A start with body axis z' along the vorticity."""
    stokes, size = 10 ** random.uniform(-4, 6), random.uniform(0.1, 3)
    half = random.uniform(0, pi)
    start = BodyStart((float(np.cos(half)), 0.0, 0.0, float(np.sin(half))), (0.0, 0.0, size))
    ellipsoid = Ellipsoid(_semi_axes(random))
    return Scene(ellipsoid, stokes, start, _duration(random, ellipsoid, stokes, size))


def _semi_axes(random: np.random.Generator) -> Triple:
    family = random.choice(
        ["triaxial", "near", "prolate", "oblate", "sphere"], p=[0.45, 0.1, 0.2, 0.2, 0.05]
    )
    middle, short = sorted(10 ** random.uniform(-1.0, 0.0, 2), reverse=True)
    axes = {
        "triaxial": (1.0, middle, short),
        "near": (1.0, 1 - 10 ** random.uniform(-6, -1.5), short),
        "prolate": (1.0, short, short),
        "oblate": (1.0, 1.0, short),
        "sphere": (1.0, 1.0, 1.0),
    }[str(family)]
    return tuple(random.permutation(axes).tolist())


def _stokes(random: np.random.Generator) -> float:
    limit = random.random()
    return (
        0.0
        if limit < AT_ZERO
        else inf
        if limit < AT_ZERO + AT_INFINITY
        else float(10 ** random.uniform(-4, 6))
    )


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
    rotations = MOST_ROTATIONS * 10 ** random.uniform(-1, 0) * (10 if random.random() < 0.1 else 1)
    most = rotations * 2 * pi / max(sqrt(3) * size, 0.5)
    if 0 < stokes < inf:
        low, high = (np.log10(number) for number in MOST_DAMPING_TIMES)
        most = min(most, 10 ** random.uniform(low, high) * stokes / max(ellipsoid.damping))
    if stokes < 30 or stokes == inf:
        return float(min(10 ** random.uniform(1, 2.5), most))
    slow = (
        10 ** random.uniform(-1.7, -0.3) * stokes
        if size > 0
        else 10 ** random.uniform(0, 1.3) * sqrt(stokes)
    )
    return float(min(slow, most))
