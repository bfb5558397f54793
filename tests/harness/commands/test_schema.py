"""The JSON Schemas of scene, study and sweep files: they know the files that come with polhode."""

import json
import tomllib
from pathlib import Path
from typing import Any

import pytest
from commandline import Run

from polhode.harness.ensembles.ensemble import BOUNDS, Ensemble
from polhode.harness.ensembles.sweep import parse_sweep
from polhode.models.files.scene_file import scene_table
from polhode.models.scenes import SCENES

ROOT = Path(__file__).parents[3]
SWEEP = {"name": "a", "title": "b", "shapes": [[1.0, 1.0, 2.0]], "stokes": 10.0, "time": 1.0}


def complaints(
    value: Any, schema: dict[str, Any], defs: dict[str, Any], where: str = ""
) -> list[str]:
    """What a value breaks of the keywords that these schemas use."""
    if "$ref" in schema:
        return complaints(value, defs[schema["$ref"].rpartition("/")[2]], defs, where)
    if "anyOf" in schema:
        tried = [complaints(value, each, defs, where) for each in schema["anyOf"]]
        return [] if [] in tried else tried[0]
    kinds = {
        "object": dict,
        "array": list,
        "string": str,
        "boolean": bool,
        "integer": int,
        "number": (int, float),
    }
    kind = schema.get("type")
    if kind == "null":
        return [] if value is None else [f"{where}: not null"]
    if kind and not isinstance(value, kinds[kind]):
        return [f"{where}: {value!r} is no {kind}"]
    found = [f"{where}: {value!r} is too small"] if value_below(value, schema) else []
    if kind == "object":
        properties = schema.get("properties", {})
        found += [
            f"{where}.{key} is missing" for key in schema.get("required", []) if key not in value
        ]
        if schema.get("additionalProperties") is False:
            found += [f"{where}.{key} is unknown" for key in value if key not in properties]
        for key in set(value) & set(properties):
            found += complaints(value[key], properties[key], defs, f"{where}.{key}")
    if kind == "array":
        if not schema.get("minItems", 0) <= len(value) <= schema.get("maxItems", len(value)):
            found.append(f"{where}: {len(value)} items")
        for each in value:
            found += complaints(each, schema.get("items", {}), defs, where)
    return found


def value_below(value: Any, schema: dict[str, Any]) -> bool:
    low, above = schema.get("minimum"), schema.get("exclusiveMinimum")
    return (low is not None and value < low) or (above is not None and value <= above)


@pytest.mark.parametrize("kind", ["scene", "study", "sweep"])
def test_files_that_come_with_polhode_fit_their_schema(kind: str, here: Run):
    schema = json.loads(here("schema", kind).stdout)
    files = {
        "scene": [scene_table(each.scene) for each in SCENES.values()],
        "study": [
            tomllib.loads(path.read_text())
            for path in (ROOT / "harness" / "studies").glob("*.toml")
        ],
        "sweep": [SWEEP],
    }[kind]
    assert files
    for content in files:
        assert complaints(content, schema, schema.get("$defs", {})) == []
    wrong = {**files[0], "stoke": 1.0}
    assert any("stoke is unknown" in line for line in complaints(wrong, schema, schema["$defs"]))


def test_defaults_of_a_sweep_are_those_that_are_taken(here: Run):
    fields = json.loads(here("schema", "sweep").stdout)["properties"]
    (ensemble,) = parse_sweep(SWEEP).ensembles
    for name in (*BOUNDS, "radius"):
        assert fields[name]["default"] == getattr(ensemble, name) == getattr(Ensemble, name)
