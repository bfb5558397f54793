"""Built-in scenes: the paper's, and hard cases for forms and solvers.

They stand in `scenes.toml` beside this module, whose head says what their numbers are.
"""

import tomllib
from dataclasses import dataclass
from math import cos, pi
from os.path import exists, isdir
from pathlib import Path
from typing import Any, cast

from polhode.models.registry import hint
from polhode.models.scene import BodyStart, EulerStart, Scene
from polhode.models.shape import Ellipsoid


@dataclass(frozen=True)
class NamedScene:
    """A scene, and in one line what is hard about it."""

    summary: str
    scene: Scene


def aligned_start(
    ellipsoid: Ellipsoid, momentum: float, theta: float, phi: float = 0.0
) -> EulerStart:
    """Start with L = `momentum` ẑ, in units of `Ellipsoid.inertia` times the shear rate: θ = theta, φ = phi, ψ = π/2.

    Angles are in rad. `momentum` may be negative, as the flow itself turns about -ẑ.
    """
    # With ψ = π/2 the axis x' stands in the plane of z' and ẑ: φ̇₀ = L_z/I₁ and ψ̇₀ = L_z cos θ₀
    # (1/I₃ - 1/I₁), so that θ₀ from 0 to π/2 covers all energies, from L²/2I₃ to L²/2I₁. The captions of
    # the paper print these rates with ψ₀ = 0, to which I₂ belongs, and for spheroids the other sign of ψ̇₀.
    i1, _, i3 = ellipsoid.inertia
    return EulerStart(
        (theta, phi, pi / 2), (0.0, momentum / i1, momentum * cos(theta) * (1 / i3 - 1 / i1))
    )


def _named(
    summary: str,
    semi_axes: list[float],
    stokes: float,
    time: float = 0.0,
    slow_time: float = 0.0,
    **start: Any,
) -> NamedScene:
    """A scene of one table of `scenes.toml`, where a start's orientation stands before its motion.

    A table has either `time`, in inverse shear rates, or `slow_time`, which is time over St; `start`
    are its other keys, which scene files have too.
    """
    kind = BodyStart if "quaternion" in start else EulerStart
    a, b, c = semi_axes
    # A start without motion, which has one field, is at rest.
    vectors = [tuple(vector) for vector in start.values()]
    duration = time or slow_time * stokes
    return NamedScene(summary, Scene(Ellipsoid((a, b, c)), stokes, kind(*vectors), duration))


_TABLES = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))
# By name, in the order of the file.
SCENES: dict[str, NamedScene] = {name: _named(**table) for name, table in _TABLES.items()}


def named_scene(name: str) -> Scene:
    """Built-in scene of the given name; raises ValueError, with the names there are, if there is none."""
    if name not in SCENES:
        raise ValueError(f"scene: got {name!r}, expected one of {', '.join(SCENES)}")
    return SCENES[name].scene


def find_scene(word: str) -> Scene:
    """The scene of a file if one has that name, else the built-in one; raises ValueError if there is neither.

    Raises as `read_scene` does if something is wrong with the file.
    """
    if exists(word) and not isdir(word):
        # Files are checked by pydantic, which built-in scenes do not need and which takes long to import.
        from polhode.models.files.scene_file import read_scene

        return read_scene(Path(word))
    if word in SCENES:
        return named_scene(word)
    if isdir(word):
        raise ValueError(f"scene: got {word!r}, a folder, expected a file or a built-in name")
    raise ValueError(
        f"scene: got {word!r}{hint(word, SCENES)}, expected a file or one of {', '.join(SCENES)}"
    )


# Starts and shapes that the paper's items, studies and tests share.
PAPER_START = cast(EulerStart, named_scene("paper").start)
SPHEROID_START = cast(EulerStart, named_scene("spheroid").start)
SADDLE_START = cast(EulerStart, named_scene("paper-saddle").start)
NEAR_POLE_START = cast(EulerStart, named_scene("near-pole").start)
# Semi-axes along x', y', z'.
PAPER_ELLIPSOID = named_scene("paper").ellipsoid.semi_axes
PROLATE = named_scene("spheroid").ellipsoid.semi_axes
