"""The claims and the words around what was measured: one file per section in sections/, with fields for the facts."""

import tomllib
from collections.abc import Iterator, Mapping
from functools import cache, partial
from importlib.resources import files
from math import inf
from typing import Any

import numpy as np

from polhode.harness.common.text import WORDING
from polhode.harness.paper.item import Data, Experiment, Item, Number, Section, Verdict, Word

Facts = Mapping[str, Any]
# What a row of numbers may say, the last two together.
BOUNDS, NEAR = {"value", "what", "each", "low", "high", "unit"}, {"near", "within"}


def section(name: str, experiments: Mapping[str, Experiment]) -> Section:
    """The section of a file of claims, its items in the file's order, each with the experiment that tests it."""
    title, entries = _entries()[name]
    if set(entries) != set(experiments):
        raise ValueError(f"sections/{name}.toml: got {', '.join(entries)}, expected {', '.join(experiments)}")
    return Section(name, title, tuple(_item(key, entry, experiments[key]) for key, entry in entries.items()))


@cache
def _entries() -> dict[str, tuple[str, dict[str, dict[str, Any]]]]:
    """Title and items of every section; an item that is `like` another has all that it does not say itself from it."""
    paths = [path for path in files("polhode.harness.paper.sections").iterdir() if path.name.endswith(".toml")]
    tables = {path.name.removesuffix(".toml"): tomllib.loads(path.read_text(encoding="utf-8")) for path in paths}
    known = {key: entry for table in tables.values() for key, entry in table.items() if isinstance(entry, dict)}
    if unknown := {entry["like"] for entry in known.values() if "like" in entry} - set(known):
        raise ValueError(f"like: got {', '.join(unknown)}, expected one of {', '.join(known)}")
    return {
        name: (
            table["title"],
            {
                key: known.get(entry.get("like", ""), {}) | entry
                for key, entry in table.items()
                if isinstance(entry, dict)
            },
        )
        for name, table in tables.items()
    }


def _item(name: str, entry: Mapping[str, Any], experiment: Experiment) -> Item:
    def verdict(data: Data) -> Verdict:
        return judged(entry, experiment.facts(data))

    return Item(name, entry["title"], entry["claim"], experiment.compute, experiment.figure, verdict)


def judged(entry: Mapping[str, Any], facts: Facts) -> Verdict:
    """The verdict of an item's entry on the facts."""
    say = partial(WORDING.vformat, args=(), kwargs=facts)
    numbers = [number for row in entry["numbers"] for number in _numbers(row, facts)]
    # What an item says beside the sentences that it shares with those that are `like` it.
    found = f"{entry['found']} {entry.get('also', '')}".rstrip()
    return Verdict(Word(entry["verdict"]), say(found), say(entry["caption"]), *numbers)


def _numbers(row: Mapping[str, Any], facts: Facts) -> Iterator[Number]:
    """The numbers of a row: one, or one for each value of a list of facts.

    Bounds are numbers or names of facts; the interval of a fact `x` is the fact `x_95`.
    """
    if wrong := set(row) - BOUNDS - (NEAR if set(row) >= NEAR else set()):
        expected = f"{', '.join(sorted(BOUNDS))}, or {' with '.join(sorted(NEAR))}"
        raise ValueError(f"numbers: got {', '.join(sorted(wrong))}, expected of {expected}")
    places = range(len(facts[row["each"]])) if "each" in row else [None]
    for place in places:

        def fact(name: Any, place: int | None = place) -> Any:
            found = facts[name] if isinstance(name, str) else name
            return found if place is None or not isinstance(found, list | tuple | np.ndarray) else found[place]

        what = WORDING.vformat(row["what"], (), {**facts, "each": fact(row.get("each"))})
        low, high = (fact(row.get(bound, default)) for bound, default in (("low", -inf), ("high", inf)))
        if "near" in row:
            middle = fact(row["near"])
            low, high = middle - row["within"], middle + row["within"]
        interval = f"{row['value']}_95"
        yield Number(
            what,
            float(fact(row["value"])),
            low,
            high,
            row.get("unit", ""),
            fact(interval if interval in facts else None),
        )
