"""The test problems by name, those of plug-ins too."""

import re
from dataclasses import dataclass
from importlib.resources import files
from typing import Any

from polhode.models.files.toml_file import read_toml
from polhode.models.operations import Field, Operations
from polhode.models.problem import MassForm, Problem
from polhode.models.problems.classical import Classical
from polhode.models.registry import imported, plug_ins


@dataclass(frozen=True)
class Formulas:
    """The factory of a field given as expressions, as the head of `problems.toml` has them."""

    terms: tuple[tuple[str, str], ...]
    rates: str

    def __call__(self, ops: Operations) -> Field:
        """The field over numbers of a kind."""
        terms = (*self.terms, ("rates", self.rates))
        numbers = sorted(set(re.findall(r"\by(\d+)\b", " ".join(text for _, text in terms))))
        lines = [f"y{i} = y[{int(i) - 1}]" for i in numbers] + [
            f"{name} = ({text})" for name, text in terms
        ]
        names: dict[str, Any] = {"sqrt": ops.sqrt}
        exec("\n    ".join(["def rhs(y, p):", *lines, "return rates"]), names)
        return names["rhs"]


def _problems(table: dict[str, Any]) -> dict[str, Classical]:
    """The problems of a table of theirs, whose sources the others name in braces."""
    sources = table.pop("sources")
    return {key: _problem(entry, sources) for key, entry in table.items()}


def _problem(entry: dict[str, Any], sources: dict[str, str]) -> Classical:
    field = Formulas(tuple(entry.get("terms", {}).items()), entry["rates"])
    mass = MassForm(tuple(entry["mass"]), ()) if "mass" in entry else None
    problem = Problem(
        entry["name"], field, tuple(entry["start"]), entry["end"], None if mass else (), mass
    )
    source = entry["source"].format(**sources)
    hopeless = tuple(entry.get("hopeless", ()))
    reference = tuple(entry["reference"])
    ratio = entry.get("atol_per_rtol", 1.0)
    return Classical(problem, reference, entry["stiff"], source, hopeless, ratio)


PROBLEMS = read_toml(files("polhode.models.problems") / "problems.toml", _problems)
for _name, _target in plug_ins("problems").items():
    PROBLEMS.setdefault(_name, imported(_target))
