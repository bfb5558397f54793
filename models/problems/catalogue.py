"""The test problems by name, those of plug-ins too."""

from importlib.resources import files
from typing import Any

from polhode.models.files.toml_file import read_toml
from polhode.models.problem import MassForm, Problem
from polhode.models.problems import fields
from polhode.models.problems.classical import Classical
from polhode.models.registry import imported, plug_ins


def _problems(table: dict[str, Any]) -> dict[str, Classical]:
    """The problems of a table of theirs, whose sources the others name in braces."""
    sources = table.pop("sources")
    return {key: _problem(key, entry, sources) for key, entry in table.items()}


def _problem(key: str, entry: dict[str, Any], sources: dict[str, str]) -> Classical:
    wanted = f"{key.replace('-', '_')}_field"
    if (field := getattr(fields, wanted, None)) is None:
        raise ValueError(f"[{key}]: got no {wanted} in fields.py")
    mass = MassForm(tuple(entry["mass"]), ()) if "mass" in entry else None
    parameters = None if mass else ()
    problem = Problem(entry["name"], field, tuple(entry["start"]), entry["end"], parameters, mass)
    source, hopeless = entry["source"].format(**sources), tuple(entry.get("hopeless", ()))
    return Classical(problem, tuple(entry["reference"]), entry["stiff"], source, hopeless)


PROBLEMS = read_toml(files("polhode.models.problems") / "problems.toml", _problems)
for _name, _target in plug_ins("problems").items():
    PROBLEMS.setdefault(_name, imported(_target))
