"""Scene files: what they may say, and the message where they say something else."""

import copy
import json
import tomllib
from fractions import Fraction
from math import inf
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from commandline import SCENE
from hypothesis import given, settings, strategies as st

from polhode.models.files.scene_file import parse_scene, read_scene, scene_table
from polhode.models.scene import BodyStart, EulerStart, Scene, SlowStart
from polhode.models.scenes import SCENES, named_scene
from polhode.models.shape import Ellipsoid

GOOD: dict[str, Any] = {
    "stokes": 1000.0,
    "slow_time": 0.5,
    "shape": {"semi_axes": [1.0, 0.8, 0.5]},
    "start": {"euler_angles": [1.0, 0.5, 0.0], "euler_rates": [1.0, 1.0, -1.0]},
}
GONE = object()


def changed(path: str, value: Any) -> dict[str, Any]:
    """The good table with one entry set, or removed."""
    table = copy.deepcopy(GOOD)
    *above, last = path.split(".")
    inner = table
    for part in above:
        inner = inner[part]
    if value is GONE:
        del inner[last]
    else:
        inner[last] = value
    return table


def test_the_manuals_scene(tmp_path: Path):
    path = tmp_path / "scene.toml"
    path.write_text(SCENE, encoding="utf-8")
    start = EulerStart((1.0471975511965976, 0.5235987755982988, 0.0), (1.0, 1.0, -1.0))
    assert read_scene(path) == Scene(Ellipsoid((1.0, 0.8, 0.5)), 1000.0, start, 500.0)


@pytest.mark.filterwarnings("ignore::polhode.models.registry.Question")
@pytest.mark.parametrize(
    ("start", "expected"),
    [
        ({"euler_angles": [1, 2, 3], "at_rest": True}, EulerStart((1, 2, 3), (0, 0, 0))),
        ({"quaternion": [0, 0, 2, 0], "at_rest": True}, BodyStart((0, 0, 1, 0), (0, 0, 0))),
        (
            {"quaternion": [1, 0, 0, 0], "angular_velocity": [1, 2, 3]},
            BodyStart((1, 0, 0, 0), (1, 2, 3)),
        ),
        ({"angular_momentum": [0.1, 0.2, 0.3], "energy": 0.15}, SlowStart((0.1, 0.2, 0.3), 0.15)),
        ({"angular_momentum": [0, 0, 0], "energy": 0}, SlowStart((0, 0, 0), 0)),
    ],
    ids=["at rest", "quaternion at rest", "quaternion", "L and E", "no motion"],
)
def test_other_starts(start: dict[str, Any], expected: object):
    assert parse_scene(changed("start", start)).start == expected


@pytest.mark.parametrize(("stokes", "slow_time"), [(0.0, inf), (0.1, 50.0), (inf, 0.0)])
def test_time_stands_for_slow_time(stokes: float, slow_time: float):
    table = {**changed("slow_time", GONE), "stokes": stokes, "time": 5}
    scene = parse_scene(table)
    assert (scene.time, scene.slow_time) == (5.0, slow_time)


# Where, what is put there, and what the line must say.
BAD = [
    ("stokes", GONE, "stokes: missing, expected a value"),
    ("stokes", "x", "stokes: got 'x', expected a number"),
    ("stokes", True, "stokes: got True, expected a number"),
    ("stokes", [1.0], "stokes: got [1.0], expected a number"),
    ("stokes", -1, "stokes: got -1, expected a number greater than or equal to 0"),
    ("stokes", float("nan"), "stokes: got nan, expected a number greater than or equal to 0"),
    ("stokes", 10**400, "expected a number"),
    ("stokes", 0, "got slow_time at stokes = 0, expected time"),
    ("stokes", inf, "got slow_time at stokes = inf, expected time"),
    ("slow_time", GONE, "got neither of slow_time and time, expected exactly one"),
    ("time", 3.0, "got both of slow_time and time, expected exactly one"),
    ("slow_time", 0.0, "slow_time: got 0.0, expected a number greater than 0"),
    ("slow_time", -0.5, "slow_time: got -0.5, expected a number greater than 0"),
    ("slow_time", inf, "slow_time: got inf, expected a finite number"),
    ("slow_time", 1e308, "slow_time: got 1e+308 at stokes = 1000, expected a finite positive time"),
    ("shape", GONE, "shape: missing, expected a value"),
    ("shape", 3.0, "shape: got 3.0, expected a table"),
    ("shape.semi_axes", GONE, "shape.semi_axes: missing, expected a value"),
    ("shape.semi_axes", 3.0, "shape.semi_axes: got 3.0, expected a list"),
    ("shape.semi_axes", "1 2 3", "shape.semi_axes: got '1 2 3', expected a list"),
    (
        "shape.semi_axes",
        [1.0, 0.8],
        "shape.semi_axes: got [1.0, 0.8], expected at least 3 items, not 2",
    ),
    (
        "shape.semi_axes",
        [1, 2, 3, 4],
        "shape.semi_axes: got [1, 2, 3, 4], expected at most 3 items, not 4",
    ),
    (
        "shape.semi_axes",
        [1.0, -0.8, 0.5],
        "shape.semi_axes[1]: got -0.8, expected a number greater than 0",
    ),
    (
        "shape.semi_axes",
        [1.0, 0.8, 0.0],
        "shape.semi_axes[2]: got 0.0, expected a number greater than 0",
    ),
    (
        "shape.semi_axes",
        [float("nan"), 1, 1],
        "shape.semi_axes[0]: got nan, expected a finite number",
    ),
    ("shape.semi_axes", [1.0, "a", 0.5], "shape.semi_axes[1]: got 'a', expected a number"),
    (
        "shape.semi_axes",
        [1.0, 1, 1e-80],
        "semi_axes: got [1.0, 1.0, 1e-80], expected shortest / longest of at least 1e-70",
    ),
    ("shape.colour", "red", "shape.colour: unknown key, expected one of semi_axes"),
    (
        "viscosity",
        1.0,
        "viscosity: unknown key, expected one of stokes, slow_time, time, shape, start",
    ),
    ("start", GONE, "start: missing, expected a value"),
    (
        "start.euler_rates",
        GONE,
        "start: got ['euler_angles'], expected one of euler_angles + euler_rates",
    ),
    ("start.energy", 1.0, "start: got ['energy', 'euler_angles', 'euler_rates'], expected one of"),
    ("start.at_rest", 1, "start.at_rest: got 1, expected true or false"),
    (
        "start.euler_rate",
        [1, 1, 1],
        "start.euler_rate: unknown key, expected one of euler_angles, euler_rates,",
    ),
    ("start.euler_angles", [inf, 0, 0], "start.euler_angles[0]: got inf, expected a finite number"),
    (
        "start",
        {"quaternion": [0, 0, 0, 0], "at_rest": True},
        "start.quaternion: got [0.0, 0.0, 0.0, 0.0], expected",
    ),
    (
        "start",
        {"quaternion": [1, 0, 0], "at_rest": True},
        "start.quaternion: got [1, 0, 0], expected at least 4 items",
    ),
    (
        "start",
        {"angular_momentum": [1, 0, 0], "energy": -1},
        "start.energy: got -1, expected a number greater than or",
    ),
    (
        "start",
        {"angular_momentum": [1, 0, 0], "energy": 0},
        "start: got L² / 2E = inf, expected a value from 0.298",
    ),
    (
        "start",
        {"angular_momentum": [0, 0, 0], "energy": 1},
        "start: got L² / 2E = 0.0, expected a value from 0.298",
    ),
    (
        "start",
        {"angular_momentum": [1, 0, 0], "energy": 2},
        "start: got L² / 2E = 0.25, expected a value from 0.298",
    ),
    (
        "start",
        {"angular_momentum": [1, 0, 0], "energy": 0.9},
        "expected a value from 0.2982418625807911 to 0.5495",
    ),
]


@pytest.mark.parametrize(
    ("path", "value", "line"), BAD, ids=[f"{row[0]}-{row[2][:40]}" for row in BAD]
)
def test_bad_values_are_named_with_what_was_expected(path: str, value: object, line: str):
    with pytest.raises(ValueError, match="expected") as refusal:
        parse_scene(changed(path, value))
    assert line in str(refusal.value)
    assert "\n" not in str(refusal.value)


# What is written in place of what, and what the line must say besides naming it.
MISSPELT = [
    (
        "stokes",
        "stoke",
        "stoke: unknown key, expected one of stokes, slow_time, .* \\(did you mean 'stokes'\\?\\)$",
    ),
    ("stokes", "Stokes", "Stokes: unknown key, .* \\(did you mean 'stokes'\\?\\)$"),
    ("slow_time", "slow-time", "slow-time: unknown key, .* \\(did you mean 'slow_time'\\?\\)$"),
    ("[shape]", "[shpae]", "shpae: unknown key, .* \\(did you mean 'shape'\\?\\)$"),
    ("[start]", "[Start]", "Start: unknown key, .* \\(did you mean 'start'\\?\\)$"),
    (
        "semi_axes",
        "semi_axis",
        "shape.semi_axis: unknown key, .* \\(did you mean 'semi_axes'\\?\\)$",
    ),
    ("semi_axes", "axes", "shape.axes: unknown key, .* \\(did you mean 'semi_axes'\\?\\)$"),
    (
        "euler_angles",
        "euler_angels",
        "start.euler_angels: unknown key, .* \\(did you mean 'euler_angles'\\?\\)$",
    ),
    ("euler_rates", "rates", "start.rates: unknown key, .* \\(did you mean 'euler_rates'\\?\\)$"),
    (
        "[shape]\n",
        "[shape]\ntime = 3.0\n",
        "shape.time: unknown key, .* \\(time belongs above the first \\[table\\], not under",
    ),
    (
        "[shape]\n",
        "",
        "semi_axes: unknown key, .* \\(semi_axes belongs under \\[shape\\]\\) \\(and 1 more\\)$",
    ),
    (
        "stokes",
        "viscosity",
        "viscosity: unknown key, expected one of stokes, .*, start, flow \\(and 1 more\\)$",
    ),
]


@pytest.mark.parametrize(
    ("written", "instead", "line"), MISSPELT, ids=[row[1] or "no table" for row in MISSPELT]
)
def test_a_misspelt_key_is_named_with_the_one_it_may_mean(written: str, instead: str, line: str):
    text = SCENE.replace(written, instead, 1)
    assert text != SCENE
    with pytest.raises(ValueError, match=f"^{line}"):
        parse_scene(tomllib.loads(text))


def test_several_complaints_are_counted():
    with pytest.raises(ValueError, match=r"^stokes: missing, expected a value \(and 2 more\)$"):
        parse_scene({"slow_time": 1.0})


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("semi_axes", [(1.0, 0.8, 0.5), (1.0, 1.0, 2.0), (1.0, 1.0, 1.0)])
def test_l_and_e_of_a_rotation_about_a_principal_axis_are_possible(semi_axes, axis: int):
    inertia = Ellipsoid(semi_axes).inertia
    momentum = [0.0, 0.0, inertia[axis] * 0.7]
    table = changed("start", {"angular_momentum": momentum, "energy": 0.5 * inertia[axis] * 0.7**2})
    table["shape"]["semi_axes"] = list(semi_axes)
    assert parse_scene(table).initial.energy == 0.5 * inertia[axis] * 0.7**2


@settings(max_examples=50, deadline=None)
@given(st.tuples(*3 * [st.floats(-1, 1)]).filter(lambda velocity: max(map(abs, velocity)) > 1e-3))
def test_no_rotation_has_l_and_e_that_are_refused(velocity: tuple[float, float, float]):
    ellipsoid = Ellipsoid((1.0, 0.8, 0.5))
    momentum = np.array(ellipsoid.inertia) * velocity
    start = SlowStart(tuple(momentum.tolist()), float(momentum @ velocity) / 2)
    assert Scene(ellipsoid, 10.0, start, 1.0).start == start


def same(scene: Scene, other: Scene) -> bool:
    return scene == other and json.dumps(scene_table(scene)) == json.dumps(scene_table(other))


QUATERNIONS = np.random.default_rng(1).normal(size=(20, 4)).tolist()
TURNED = [
    Scene(Ellipsoid((1.0, 0.8, 0.5)), 10.0, BodyStart(tuple(each)), 5.0) for each in QUATERNIONS
]


@pytest.mark.parametrize("scene", [*map(named_scene, SCENES), *TURNED])
def test_the_table_of_a_scene_makes_the_same_scene(scene: Scene):
    assert same(parse_scene(scene_table(scene)), scene)


def test_equal_numbers_of_other_types_give_equal_tables():
    as_floats = Scene(
        Ellipsoid((1.0, 2.0, 3.0)), 1000.0, EulerStart((1.0, 0.0, 2.0), (0.0, 0.0, 1.0)), 5.0
    )
    whole = Scene(Ellipsoid((1, 2, 3)), 1000, EulerStart((1, -0.0, 2), (0, 0, 1)), 5)
    of_numpy = Scene(
        Ellipsoid(tuple(np.array([1, 2, 3]))),
        np.float32(1000),
        EulerStart((np.int64(1), 0, 2), (0, 0, 1)),
        np.float64(5),
    )
    of_python = Scene(
        Ellipsoid((Fraction(1), 2, 3)),
        Fraction(1000),
        EulerStart((1, 0, 2), (0, 0, 1)),
        Fraction(5),
    )
    tables = {json.dumps(scene_table(scene)) for scene in (as_floats, whole, of_numpy, of_python)}
    assert len(tables) == 1
