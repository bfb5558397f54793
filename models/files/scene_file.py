"""Scene files: TOML, checked key by key before a scene is made, and the way back.

Each class is a table of the file, its fields the keys. pydantic checks keys, types and ranges; the
validators check which keys may stand together. Their errors become one line in `toml_file.checked`.
"""

import warnings
from functools import partial
from math import hypot, inf, isfinite, pi
from pathlib import Path
from typing import Annotated, Any, ClassVar

from pydantic import BaseModel, ConfigDict, Field, model_validator

from polhode.models.files.toml_file import checked, read_toml
from polhode.models.files.track_file import read_track
from polhode.models.flow import Flow
from polhode.models.registry import Question
from polhode.models.scene import BodyStart, EulerStart, Scene, SlowStart, Start
from polhode.models.shape import Ellipsoid

Finite = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Vector = Annotated[list[Finite], Field(min_length=3, max_length=3)]
# The rows of a 3 by 3 matrix, one behind the other.
NineVector = Annotated[list[Finite], Field(min_length=9, max_length=9)]
FourVector = Annotated[list[Finite], Field(min_length=4, max_length=4)]
SemiAxes = Annotated[list[Positive], Field(min_length=3, max_length=3)]
# Largest distance of a quaternion's norm from 1 without a warning, by estimate: components typed
# with two digits lie within it. A larger distance is no rounding, and may be a mistake.
_UNIT_WITHIN = 0.01


class Table(BaseModel):
    """A table of a file: nothing in it that it does not know, nothing converted."""

    model_config = ConfigDict(extra="forbid", strict=True)


class ShapeTable(Table):
    """``[shape]``."""

    semi_axes: SemiAxes  # along x', y', z', in any common unit


class StartTable(Table):
    """``[start]``: Euler angles or a quaternion, with their motion; or the slow variables alone."""

    euler_angles: Vector | None = None  # θ, φ, ψ in rad
    euler_rates: Vector | None = None  # rad in an inverse shear rate
    quaternion: FourVector | None = None  # real part first; any norm but 0
    angular_velocity: Vector | None = None  # along the body axes, in units of the shear rate
    at_rest: bool = False
    # In space axes, in units of (density) l⁵ (shear rate), l the longest semi-axis, as in `Observables`. The key of
    # the same name in a sweep file is over the largest moment of inertia; this one is not.
    angular_momentum: Vector | None = None
    # In units of (density) l⁵ (shear rate)².
    energy: Annotated[float, Field(ge=0, allow_inf_nan=False)] | None = None

    @model_validator(mode="after")
    def _one_way_to_start(self) -> "StartTable":
        # `at_rest = false` says nothing.
        given = self.model_fields_set - ({"at_rest"} if not self.at_rest else set())
        if given not in map(set, _WAYS_TO_START):
            ways = ", ".join(" + ".join(way) for way in _WAYS_TO_START).replace(
                "at_rest", "at_rest = true"
            )
            raise ValueError(f"got {sorted(given)}, expected one of {ways}")
        return self

    def start(self) -> Start:
        """Start of the scene; warns of angles and quaternions that look like mistakes."""
        if self.angular_momentum is not None and self.energy is not None:
            return SlowStart(_triple(self.angular_momentum), self.energy)
        if self.euler_angles is not None:
            if max(map(abs, self.euler_angles)) > 2 * pi:
                words = f"start.euler_angles: got {self.euler_angles} rad, beyond 2π; were degrees meant?"
                warnings.warn(words, Question, stacklevel=2)
            return EulerStart(_triple(self.euler_angles), _triple(self.euler_rates or _REST))
        assert self.quaternion is not None
        q0, q1, q2, q3 = self.quaternion
        # `BodyStart` refuses a norm of 0, which needs no warning besides.
        if (norm := hypot(*self.quaternion)) > 0 and abs(norm - 1) > _UNIT_WITHIN:
            words = f"start.quaternion: got {self.quaternion} of norm {norm:.3g}, which is divided out; was 1 meant?"
            warnings.warn(words, Question, stacklevel=2)
        return BodyStart((q0, q1, q2, q3), _triple(self.angular_velocity or _REST))


# Rates or angular velocity of a start at rest.
_REST = [0.0, 0.0, 0.0]
# Sets of keys of `[start]` that may stand together.
_WAYS_TO_START = (
    ("euler_angles", "euler_rates"),
    ("euler_angles", "at_rest"),
    ("quaternion", "angular_velocity"),
    ("quaternion", "at_rest"),
    ("angular_momentum", "energy"),
)


def one_duration(table: Any) -> Any:
    """The table; raises ValueError unless it gives its duration once, as `slow_time` or as `time`."""
    if (table.slow_time is None) == (table.time is None):
        got = "both" if table.time is not None else "neither"
        raise ValueError(f"got {got} of slow_time and time, expected exactly one")
    return table


class FlowTable(Table):
    """``[flow]``: a linear flow other than simple shear, constant or along a track.

    `gradient` is A_ij = ∂u_i/∂x_j; `track` names a CSV file of gradients in time, beside the scene
    file; `times` and `gradients`, nine numbers each, are the same in place.
    """

    # Entries in units of the shear rate.
    gradient: Annotated[list[Vector], Field(min_length=3, max_length=3)] | None = None
    track: str | None = None
    times: Annotated[list[Finite], Field(min_length=2)] | None = None  # inverse shear rates
    gradients: list[NineVector] | None = None

    # Sets of fields that may be given together.
    ways: ClassVar[tuple[str, ...]] = ("gradient", "track", "times + gradients")

    @model_validator(mode="after")
    def _one_way(self) -> "FlowTable":
        given = self.model_fields_set
        if given not in [set(way.split(" + ")) for way in self.ways]:
            got = " and ".join(sorted(given)) or "neither"
            raise ValueError(f"got {got}, expected one of {', '.join(self.ways)}")
        return self

    def flow(self, folder: Path = Path()) -> Flow:
        """The flow; `folder` holds the file of a track.

        Raises ValueError as `Flow` and `read_track` do.
        """
        if self.track is not None:
            return read_track(folder / self.track)
        if self.times is not None:
            rows = self.gradients or []
            return Flow.track(self.times, [(row[:3], row[3:6], row[6:]) for row in rows])
        assert self.gradient is not None
        x, y, z = (_triple(row) for row in self.gradient)
        return Flow((x, y, z))


class SceneTable(Table):
    """A whole scene file."""

    # inf is allowed. NaN is not: it is not greater than or equal to 0.
    stokes: Annotated[float, Field(ge=0, allow_inf_nan=True)]
    slow_time: Positive | None = None  # duration t/St, in inverse shear rates
    time: Positive | None = None  # duration t, in inverse shear rates
    shape: ShapeTable
    start: StartTable
    flow: FlowTable | None = None

    @model_validator(mode="after")
    def _one_duration(self) -> "SceneTable":
        one_duration(self)
        if self.time is None and self.stokes in (0, inf):
            raise ValueError(
                f"got slow_time at stokes = {self.stokes:g}, expected time, for slow time is t/St"
            )
        return self

    def scene(self, folder: Path = Path()) -> Scene:
        """The scene; `folder` holds its file, and the file of a track.

        Raises ValueError if

        - slow_time * stokes overflows or underflows;
        - the flow is not valid, or the file of its track cannot be read (`FlowTable.flow`);
        - the shape is too thin (`Ellipsoid`);
        - the quaternion is 0, or a number of the start is too large (`EulerStart`, `BodyStart`, `SlowStart`);
        - St or the duration is out of range, a track is shorter than the run, or the shape cannot have the
          angular momentum and energy of the start (`Scene`).

        Warns as `StartTable.start` does.
        """
        a, b, c = self.shape.semi_axes
        time = self.time if self.time is not None else (self.slow_time or 0) * self.stokes
        if not (isfinite(time) and time > 0):
            got = f"{self.slow_time!r} at stokes = {self.stokes:g}"
            raise ValueError(
                f"slow_time: got {got}, expected a finite positive time t = slow_time * stokes"
            )
        flow = self.flow.flow(folder) if self.flow else None
        return Scene(Ellipsoid((a, b, c)), self.stokes, self.start.start(), time, flow)


def read_scene(path: str | Path) -> Scene:
    """Read a scene file: TOML with the keys of `SceneTable`; raises as `read_toml` does."""
    parse = partial(parse_scene, folder=Path(path).parent)
    return read_toml(Path(path), parse, where=str(path))


def parse_scene(table: dict[str, Any], folder: Path = Path()) -> Scene:
    """Make a scene of the contents of a scene file, which lies in a folder; raises ValueError as `checked` does."""
    return checked(SceneTable, table).scene(folder)


def _triple(values: list[float]) -> tuple[float, float, float]:
    x, y, z = values
    return x, y, z


def scene_table(scene: Scene) -> dict[str, Any]:
    """Contents of a scene file that `parse_scene` turns into the same scene again; equal scenes give equal contents."""
    match scene.start:
        case EulerStart(angles, rates):
            start = {"euler_angles": angles, "euler_rates": rates}
        case BodyStart(quaternion, velocity):
            start = {"quaternion": quaternion, "angular_velocity": velocity}
        case SlowStart(momentum, energy):
            start = {"angular_momentum": momentum, "energy": energy}
    shape = {"semi_axes": scene.ellipsoid.semi_axes}
    table = {"stokes": scene.stokes, "time": scene.time, "shape": shape, "start": start}
    if scene.flow is not None:
        table["flow"] = flow_table(scene.flow)
    return plain(table)


def flow_table(flow: Flow) -> dict[str, Any]:
    """Contents of ``[flow]``."""
    if not flow.varies:
        return {"gradient": flow.gradient}
    rows = tuple((*x, *y, *z) for x, y, z in flow.gradients)
    return {"times": flow.knots, "gradients": rows}


def plain(value: Any) -> Any:
    """The same with each number a float and each tuple a list, as TOML and JSON write them.

    -0.0 becomes 0.0, so that equal scenes have equal contents.
    """
    if isinstance(value, dict):
        return {name: plain(part) for name, part in value.items()}
    if isinstance(value, tuple):
        return [plain(part) for part in value]
    # The sum of -0.0 and 0.0 is 0.0.
    return float(value) + 0.0
