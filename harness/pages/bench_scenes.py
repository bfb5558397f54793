"""What was run: the scenes of a study's records as a table."""

import json
from collections.abc import Iterable, Sequence
from math import isfinite

from polhode.harness.common.store import Record
from polhode.harness.common.text import markdown, short
from polhode.models.scene import Scene
from polhode.models.scene_file import parse_scene, scene_table

# Keys of a scene file's start, as the page calls them.
START = {
    "euler_angles": "(θ, φ, ψ) = {}",
    "euler_rates": "at the rates {}",
    "quaternion": "quaternion {}",
    "angular_velocity": "angular velocity {} in the body",
    "angular_momentum": "angular momentum {}",
    "energy": "energy {}",
}


def scenes_section(records: Sequence[Record]) -> list[str]:
    """Lines of the section that tells semi-axes, start, St, duration, samples and forms of each scene."""
    groups: dict[tuple[str, str], list[tuple[Record, Scene]]] = {}
    for record in records:
        scene = parse_scene(record["scene"])
        content = scene_table(scene)
        body = json.dumps([content["shape"], content["start"]], sort_keys=True)
        groups.setdefault((record["scene_name"], body), []).append((record, scene))
    return [
        "## The scenes",
        "",
        markdown(["scene", "semi-axes", "start", "St", "duration", "samples", "forms"], [*map(_row, groups.values())]),
        "Semi-axes along the body's axes x', y', z', in any common unit; angles in rad; rates in units of the shear "
        "rate, times t in inverse shear rates; t₂ = t/St.",
        "",
    ]


def _row(runs: Sequence[tuple[Record, Scene]]) -> list[str]:
    records, scenes = zip(*runs, strict=True)
    content = scene_table(scenes[0])
    start = ", ".join(
        words.format(_numbers(content["start"][key])) for key, words in START.items() if key in content["start"]
    )
    forms = dict.fromkeys(record["form"] for record in records)
    return [
        records[0]["scene_name"],
        _numbers(content["shape"]["semi_axes"]),
        start,
        _listed(scene.stokes for scene in scenes),
        _durations(scenes),
        _listed(record["samples"] for record in records),
        ", ".join(forms),
    ]


def _durations(scenes: Sequence[Scene]) -> str:
    """Slow time, if all scenes have one in common, and time."""
    slow = {short(scene.slow_time) for scene in scenes}
    time = f"t = {_listed(scene.time for scene in scenes)}"
    common = len(slow) == 1 and all(isfinite(scene.slow_time) and scene.slow_time > 0 for scene in scenes)
    return f"t₂ = {slow.pop()}, {time}" if common else time


def _numbers(values: float | Sequence[float]) -> str:
    return short(values) if isinstance(values, float | int) else f"({', '.join(map(short, values))})"


def _listed(values: Iterable[float]) -> str:
    """Different values in growing order."""
    return ", ".join(map(short, sorted(set(values))))
