"""The test problems by name, also from plug-ins."""

from importlib.resources import files
from typing import Any

from polhode.models.files.toml_file import read_toml
from polhode.models.problem import MassForm, Problem
from polhode.models.problems.classical import Classical
from polhode.models.problems.fields import FIELDS
from polhode.models.registry import imported, plug_ins


def _problems(table: dict[str, Any]) -> dict[str, Classical]:
    """The problems of the contents of `problems.toml`, by name; `sources` has what they name in braces."""
    sources = table.pop("sources")
    return {key: _problem(key, entry, sources) for key, entry in table.items()}


def _problem(key: str, entry: dict[str, Any], sources: dict[str, str]) -> Classical:
    mass = MassForm(tuple(entry["mass"]), ()) if "mass" in entry else None
    problem = Problem(
        entry["name"], FIELDS[key], tuple(entry["start"]), entry["end"], None if mass else (), mass
    )
    source = entry["source"].format(**sources)
    hopeless = tuple(entry.get("hopeless", ()))
    reference = tuple(entry["reference"])
    ratio = entry.get("atol_per_rtol", 1.0)
    return Classical(problem, reference, entry["stiff"], source, hopeless, ratio)


# By name. A plug-in adds problems, and replaces none.
PROBLEMS = read_toml(files("polhode.models.problems") / "problems.toml", _problems)
for _name, _target in plug_ins("problems").items():
    PROBLEMS.setdefault(_name, imported(_target))
