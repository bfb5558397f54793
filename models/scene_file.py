"""Scene files: TOML, checked key by key before a scene is made."""

import reprlib
from math import inf, isfinite
from pathlib import Path
from typing import Annotated, Any, get_args

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from polhode.models.registry import hint, near
from polhode.models.scene import BodyStart, EulerStart, Scene, SlowStart, Start
from polhode.models.shape import Ellipsoid
from polhode.models.toml_file import read_toml

Finite = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Vector = Annotated[list[Finite], Field(min_length=3, max_length=3)]
FourVector = Annotated[list[Finite], Field(min_length=4, max_length=4)]


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True)


class ShapeTable(_Table):
    """``[shape]``."""

    semi_axes: Annotated[list[Positive], Field(min_length=3, max_length=3)]


class StartTable(_Table):
    """``[start]``: Euler angles or a quaternion, with their motion; or the slow variables alone."""

    euler_angles: Vector | None = None
    euler_rates: Vector | None = None
    quaternion: FourVector | None = None
    angular_velocity: Vector | None = None
    at_rest: bool = False
    angular_momentum: Vector | None = None
    energy: Annotated[float, Field(ge=0, allow_inf_nan=False)] | None = None

    @model_validator(mode="after")
    def _one_way_to_start(self) -> "StartTable":
        given = self.model_fields_set - ({"at_rest"} if not self.at_rest else set())
        if given not in _WAYS_TO_START:
            raise ValueError(f"got {sorted(given)}, expected one of {_WAYS_IN_WORDS}")
        return self

    def start(self) -> Start:
        """Start of the scene."""
        if self.angular_momentum is not None and self.energy is not None:
            return SlowStart(_triple(self.angular_momentum), self.energy)
        if self.euler_angles is not None:
            return EulerStart(_triple(self.euler_angles), _triple(self.euler_rates or _REST))
        assert self.quaternion is not None
        q0, q1, q2, q3 = self.quaternion
        return BodyStart((q0, q1, q2, q3), _triple(self.angular_velocity or _REST))


_REST = [0.0, 0.0, 0.0]
_WAYS_TO_START = (
    {"euler_angles", "euler_rates"},
    {"euler_angles", "at_rest"},
    {"quaternion", "angular_velocity"},
    {"quaternion", "at_rest"},
    {"angular_momentum", "energy"},
)
_WAYS_IN_WORDS = (
    "euler_angles + euler_rates, euler_angles + at_rest = true, quaternion + angular_velocity, "
    "quaternion + at_rest = true, angular_momentum + energy"
)


class SceneTable(_Table):
    """A whole scene file."""

    stokes: Annotated[float, Field(ge=0, allow_inf_nan=True)]
    slow_time: Positive | None = None
    time: Positive | None = None
    shape: ShapeTable
    start: StartTable

    @model_validator(mode="after")
    def _one_duration(self) -> "SceneTable":
        if (self.slow_time is None) == (self.time is None):
            got = "both" if self.time is not None else "neither"
            raise ValueError(f"got {got} of slow_time and time, expected exactly one")
        if self.time is None and self.stokes in (0, inf):
            raise ValueError(f"got slow_time at stokes = {self.stokes:g}, expected time, for slow time is t/St")
        return self

    def scene(self) -> Scene:
        """The scene; raises ValueError if a duration in slow time overflows."""
        a, b, c = self.shape.semi_axes
        time = self.time if self.time is not None else (self.slow_time or 0) * self.stokes
        if not (isfinite(time) and time > 0):
            got = f"{self.slow_time!r} at stokes = {self.stokes:g}"
            raise ValueError(f"slow_time: got {got}, expected a finite positive time t = slow_time * stokes")
        return Scene(Ellipsoid((a, b, c)), self.stokes, self.start.start(), time)


def read_scene(path: str | Path) -> Scene:
    """Read a scene file.

    Parameters
    ----------
    path : str or Path
        TOML; its keys are those of `SceneTable`.

    Raises
    ------
    ValueError
        In one line: the file, the key, the value and what was expected.
    OSError
        If the file cannot be read.
    """
    return read_toml(Path(path), parse_scene, where=str(path))


def parse_scene(table: dict[str, Any]) -> Scene:
    """Make a scene of the contents of a scene file.

    Raises
    ------
    ValueError
        In one line: the key, the value and what was expected.
    """
    try:
        return SceneTable.model_validate(table).scene()
    except ValidationError as error:
        raise ValueError(first_complaint(error, SceneTable)) from None


def first_complaint(error: ValidationError, model: type[BaseModel]) -> str:
    """The plainest complaint about the contents of a `model` in one line, and how many more there are.

    An unknown key comes first, for it may be the misspelt name of one that is missing.
    """
    complaints = sorted(error.errors(include_url=False), key=lambda each: each["type"] != "extra_forbidden")
    first = complaints[0]
    *above, last = first["loc"] or ("",)
    where = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in (*above, last)).lstrip(".")
    expected = first["msg"].removeprefix("Value error, ")
    if first["type"] == "missing":
        text = f"{where}: missing, expected a value"
    elif first["type"] == "extra_forbidden":
        keys = _keys(model, above)
        meant = near(str(last), keys)
        complaints = [each for each in complaints if not (each["type"] == "missing" and each["loc"] == (*above, meant))]
        text = f"{where}: unknown key, expected one of {', '.join(keys)}{_advice(model, above, str(last), keys)}"
    elif expected.startswith("got "):
        text = f"{where}: {expected}" if where else expected
    else:
        text = f"{where}: got {reprlib.repr(first['input'])}, {_in_our_words(expected)}"
    more = len(complaints) - 1
    return text + (f" (and {more} more)" if more else "")


def _advice(model: type[BaseModel], above: list[int | str], key: str, keys: list[str]) -> str:
    """What an unknown key is likely to be: one of another table, or a misspelt one."""
    if above and key in model.model_fields:
        return f" ({key} belongs above the first [table], not under [{above[0]}])"
    for name, field in model.model_fields.items():
        table = field.annotation
        if isinstance(table, type) and issubclass(table, BaseModel) and [name] != above and key in table.model_fields:
            return f" ({key} belongs under [{name}])"
    return hint(key, keys)


def _keys(model: Any, path: list[int | str]) -> list[str]:
    """Keys that the table at a path inside a model may have."""
    for part in path:
        if isinstance(part, str):
            model = model.model_fields[part].annotation
        while not hasattr(model, "model_fields"):
            model = get_args(model)[0]
    return list(model.model_fields)


_OUR_WORDS = (
    ("Input should be a valid number", "expected a number"),
    ("Input should be a valid integer", "expected a whole number"),
    ("Input should be a valid string", "expected a string"),
    ("Input should be a valid boolean", "expected true or false"),
    ("Input should be a valid list", "expected a list"),
    ("Input should be a valid dictionary", "expected a table"),
    ("Input should be a finite number", "expected a finite number"),
    ("Input should be '", "expected '"),
    ("Input should be", "expected a number"),
    ("List should have", "expected"),
    ("String should", "expected a string that should"),
)


def _in_our_words(message: str) -> str:
    message = message.replace(" after validation", "").split(" or instance of")[0]
    for theirs, ours in _OUR_WORDS:
        if message.startswith(theirs):
            return ours + message.removeprefix(theirs)
    return message


def _triple(values: list[float]) -> tuple[float, float, float]:
    x, y, z = values
    return x, y, z


def scene_table(scene: Scene) -> dict[str, Any]:
    """Contents of a scene file that `parse_scene` turns into the same scene again; equal scenes give equal contents."""
    match scene.start:
        case EulerStart():
            start = {"euler_angles": _floats(scene.start.angles), "euler_rates": _floats(scene.start.rates)}
        case BodyStart():
            velocity = _floats(scene.start.angular_velocity)
            start = {"quaternion": _floats(scene.start.quaternion), "angular_velocity": velocity}
        case SlowStart():
            momentum = _floats(scene.start.angular_momentum)
            start = {"angular_momentum": momentum, "energy": _float(scene.start.energy)}
    return {
        "stokes": _float(scene.stokes),
        "time": _float(scene.time),
        "shape": {"semi_axes": _floats(scene.ellipsoid.semi_axes)},
        "start": start,
    }


def _float(value: float) -> float:
    """A plain float, whatever number it was; -0.0 becomes 0.0."""
    return float(value) + 0.0


def _floats(values: tuple[float, ...]) -> list[float]:
    return [_float(value) for value in values]
