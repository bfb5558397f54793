"""The claims and the words around what was measured: one file per section in sections/, numbers as expressions."""

import sys
import tomllib
from collections.abc import Iterator, Mapping
from functools import cache
from importlib import import_module
from importlib.resources import files
from math import inf
from typing import Any

import numpy as np

from polhode.harness.paper.expressions import evaluated, names_of, worded
from polhode.harness.paper.figures import drawn
from polhode.harness.paper.item import Data, Item, Number, Parts, Section, Verdict, Word

SECTIONS = "polhode.harness.paper.sections"
# What a row of numbers may say, the last two together.
BOUNDS, NEAR = {"value", "what", "each", "low", "high", "unit"}, {"near", "within"}


def section(name: str) -> Section:
    """The section of a file of claims, its items in the file's order."""
    title, entries = _entries()[name]
    return Section(name, title, tuple(_item(key, entry) for key, entry in entries.items()))


@cache
def _entries() -> dict[str, tuple[str, dict[str, dict[str, Any]]]]:
    """Title and items of every section; an item that is `like` another has all that it does not say itself from it."""
    paths = [path for path in files(SECTIONS).iterdir() if path.name.endswith(".toml")]
    found = {path.name.removesuffix(".toml"): tomllib.loads(path.read_text(encoding="utf-8")) for path in paths}
    titles = {name: entries.pop("title") for name, entries in found.items()}
    known = {key: entry for entries in found.values() for key, entry in entries.items()}
    if unknown := {entry["like"] for entry in known.values() if "like" in entry} - set(known):
        raise ValueError(f"like: got {', '.join(unknown)}, expected one of {', '.join(known)}")

    def whole(entry: dict[str, Any]) -> dict[str, Any]:
        other = known.get(entry.get("like", ""), {})
        return other | entry | {"facts": other.get("facts", {}) | entry.get("facts", {})}

    return {
        name: (titles[name], {key: whole(entry) for key, entry in entries.items()}) for name, entries in found.items()
    }


def _item(name: str, entry: Mapping[str, Any]) -> Item:
    """An item whose experiment is given as "module: expression", of a module of the sections and in its names."""
    module, _, expression = entry["experiment"].partition(": ")
    place = import_module(f"{SECTIONS}.{module}")
    experiment = evaluated(expression, names_of(place) | {"Parts": Parts})
    kinds = [sys.modules[kind.__module__] for kind in reversed(type(experiment).__mro__)]

    def facts(data: Data) -> dict[str, Any]:
        rows = {table or "table": rows for table, rows in data.items()}
        return facts_of(entry, names_of(*kinds, place) | vars(experiment) | rows | {"self": experiment})

    described = entry.get("figure")
    figure = (lambda data: drawn(described, facts(data))) if described else experiment.figure

    def verdict(data: Data) -> Verdict:
        return judged(entry, facts(data))

    return Item(name, entry["title"], entry["claim"], experiment.compute, figure, verdict)


def facts_of(entry: Mapping[str, Any], names: Mapping[str, Any]) -> dict[str, Any]:
    """The names, and an item's facts, which are expressions over them, each of which may use those before."""
    facts = dict(names)
    for name, expression in entry["facts"].items():
        facts[name] = evaluated(expression, facts)
    return facts


def judged(entry: Mapping[str, Any], facts: dict[str, Any]) -> Verdict:
    """The verdict of an item's entry."""
    numbers = [number for row in entry["numbers"] for number in _numbers(row, facts)]
    # What an item says beside the sentences that it shares with those that are `like` it.
    found = f"{entry['found']} {entry.get('also', '')}".rstrip()
    return Verdict(Word(entry["verdict"]), worded(found, facts), worded(entry["caption"], facts), *numbers)


def _numbers(row: Mapping[str, Any], facts: dict[str, Any]) -> Iterator[Number]:
    """The numbers of a row: one, or one for each value of a list of facts.

    Bounds are numbers or expressions.
    """
    if wrong := set(row) - BOUNDS - (NEAR if set(row) >= NEAR else set()):
        expected = f"{', '.join(sorted(BOUNDS))}, or {' with '.join(sorted(NEAR))}"
        raise ValueError(f"numbers: got {', '.join(sorted(wrong))}, expected of {expected}")
    places = range(len(evaluated(row["each"], facts))) if "each" in row else [None]
    for place in places:

        def fact(expression: Any, place: int | None = place) -> Any:
            found = evaluated(expression, facts)
            return found if place is None or not isinstance(found, list | tuple | np.ndarray) else found[place]

        what = worded(row["what"], {**facts, "each": fact(row.get("each"))})
        low, high = (fact(row.get(bound, default)) for bound, default in (("low", -inf), ("high", inf)))
        if "near" in row:
            middle = fact(row["near"])
            low, high = middle - row["within"], middle + row["within"]
        value = fact(row["value"])
        yield Number(what, float(value), low, high, row.get("unit", ""), getattr(value, "interval", None))
