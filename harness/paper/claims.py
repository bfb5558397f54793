"""The claims, words and figures around what was measured: one file per section in sections/, values as expressions.

Expressions are evaluated as Python: these files belong to the package. A figure is panels with axes
and curves.
"""

import sys
import tomllib
from collections.abc import Iterator, Mapping
from functools import cache
from importlib import import_module
from importlib.resources import files
from itertools import cycle
from math import inf
from types import ModuleType
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from polhode.harness.common.text import Wording
from polhode.harness.paper import drawing, planes, runs, tables
from polhode.harness.paper.item import Data, Item, Number, Section, Verdict, Word
from polhode.models import scenes

PLACE = "polhode.harness.paper.sections"
# In the paper's order.
SECTIONS = ("periods", "limits", "spheroids", "clocks", "ellipsoids", "rest", "appendix", "beyond")
# Modules whose names all expressions may use.
SHARED = (scenes, drawing, tables, runs, planes)
# What a row of numbers may say, the last two together; what a curve says beside its style.
BOUNDS, NEAR = {"value", "what", "each", "low", "high", "unit"}, {"near", "within"}
CURVE = {"when", "table", "by", "x", "y", "z", "label", "colors", "slope", "level", "broken"}
# What may differ from one curve to the next.
VARYING = {"linewidth", "zorder"}


@cache
def sections() -> tuple[Section, ...]:
    """All sections, their items in the order of their files."""
    found = {name: _entries()[name] for name in SECTIONS}
    return tuple(
        Section(name, title, tuple(_item(key, entry) for key, entry in entries.items()))
        for name, (title, entries) in found.items()
    )


def items() -> tuple[Item, ...]:
    """All items, in order."""
    return tuple(item for section in sections() for item in section.items)


def find_items(names: tuple[str, ...]) -> tuple[Item, ...]:
    """Items, or all items of sections, of the given names, all of them without names; ValueError for unknown ones."""
    known = {item.name: (item,) for item in items()} | {
        section.name: section.items for section in sections()
    }
    for name in names:
        if name not in known:
            raise ValueError(f"item: got {name!r}, expected one of {', '.join(known)}")
    wanted = {item.name for name in names for item in known[name]}
    return tuple(item for item in items() if not names or item.name in wanted)


def section_of(item: Item) -> Section:
    """The section an item belongs to."""
    return next(section for section in sections() if item in section.items)


def names_of(*modules: ModuleType) -> dict[str, Any]:
    """The names of the shared modules and of others; ValueError if one means two things."""
    names: dict[str, Any] = {}
    for module in (*SHARED, *modules):
        own = {name: value for name, value in vars(module).items() if not name.startswith("_")}
        if twice := [name for name in own.keys() & names if own[name] is not names[name]]:
            raise ValueError(
                f"{module.__name__}: got other values of {', '.join(twice)}, expected names of its own"
            )
        names |= own
    return names


def evaluated(expression: Any, names: dict[str, Any]) -> Any:
    """The value of an expression; what is none is its own value."""
    return eval(expression, names) if isinstance(expression, str) else expression


class _Words(Wording):
    """Fields of texts are expressions, which end at the first : or ! outside brackets."""

    def get_field(self, field_name: str, args: Any, kwargs: Any) -> tuple[Any, str]:
        return evaluated(field_name, kwargs), field_name


def worded(text: str, names: Mapping[str, Any]) -> str:
    """A text with its fields."""
    return _Words().vformat(text, (), names)


@cache
def _entries() -> dict[str, tuple[str, dict[str, dict[str, Any]]]]:
    """Title and items of every section; an item that is `like` another has all that it does not say itself from it."""
    paths = [path for path in files(PLACE).iterdir() if path.name.endswith(".toml")]
    found = {
        path.name.removesuffix(".toml"): tomllib.loads(path.read_text(encoding="utf-8"))
        for path in paths
    }
    titles = {name: entries.pop("title") for name, entries in found.items()}
    known = {key: entry for entries in found.values() for key, entry in entries.items()}
    if unknown := {entry["like"] for entry in known.values() if "like" in entry} - set(known):
        raise ValueError(f"like: got {', '.join(unknown)}, expected one of {', '.join(known)}")

    def whole(entry: dict[str, Any]) -> dict[str, Any]:
        other = whole(known[entry["like"]]) if "like" in entry else {}
        return other | entry | {"facts": other.get("facts", {}) | entry.get("facts", {})}

    return {
        name: (titles[name], {key: whole(own) for key, own in entries.items()})
        for name, entries in found.items()
    }


def _item(name: str, entry: Mapping[str, Any]) -> Item:
    """An item whose experiment is given as "module: expression", of a module of the sections and in its names."""
    # It is a function that computes, or settings with such a method.
    module, _, expression = entry["experiment"].partition(": ")
    place = import_module(f"{PLACE}.{module}")
    experiment = evaluated(expression, names_of(place))
    compute = getattr(experiment, "compute", experiment)
    kinds = [] if compute is experiment else type(experiment).__mro__[-2::-1]
    names = names_of(*(sys.modules[kind.__module__] for kind in kinds), place) | vars(experiment)

    def facts(data: Data) -> dict[str, Any]:
        rows = {table or "table": rows for table, rows in data.items()}
        return facts_of(entry, names | rows | {"self": experiment})

    own = name, entry["title"], entry["claim"], compute
    return Item(
        *own,
        lambda data: drawn(entry["figure"], facts(data)),
        lambda data: judged(entry, facts(data)),
    )


def facts_of(entry: Mapping[str, Any], names: Mapping[str, Any]) -> dict[str, Any]:
    """The names, and an item's facts, which are expressions over them, each of which may use those before."""
    facts = dict(names)
    for name, expression in entry.get("facts", {}).items():
        facts[name] = evaluated(expression, facts)
    return facts


def judged(entry: Mapping[str, Any], facts: dict[str, Any]) -> Verdict:
    """The verdict of an item's entry."""
    numbers = [number for row in entry["numbers"] for number in _numbers(row, facts)]
    # What an item says beside the sentences that it shares with those that are `like` it.
    found = f"{entry['found']} {entry.get('also', '')}".rstrip()
    return Verdict(
        Word(entry["verdict"]), worded(found, facts), worded(entry["caption"], facts), numbers
    )


def _numbers(row: Mapping[str, Any], facts: dict[str, Any]) -> Iterator[Number]:
    """The numbers of a row, bounds as numbers or expressions: one, or one for each value of a list of facts."""
    if wrong := set(row) - BOUNDS - (NEAR if set(row) >= NEAR else set()):
        expected = f"{', '.join(sorted(BOUNDS))}, or {' with '.join(sorted(NEAR))}"
        raise ValueError(f"numbers: got {', '.join(sorted(wrong))}, expected of {expected}")
    places = range(len(evaluated(row["each"], facts))) if "each" in row else [None]
    for place in places:

        def fact(expression: Any, place: int | None = place) -> Any:
            found = evaluated(expression, facts)
            return (
                found
                if place is None or not isinstance(found, list | tuple | np.ndarray)
                else found[place]
            )

        what = worded(row["what"], {**facts, "each": fact(row.get("each"))})
        low, high = (
            fact(row.get(bound, default)) for bound, default in (("low", -inf), ("high", inf))
        )
        if "near" in row:
            middle = fact(row["near"])
            low, high = middle - row["within"], middle + row["within"]
        value = fact(row["value"])
        yield Number(
            what, float(value), low, high, row.get("unit", ""), getattr(value, "interval", None)
        )


def drawn(entry: Mapping[str, Any], names: dict[str, Any]) -> Figure:
    """The figure of an entry: its size, a table for each of its axes, and a legend `below` all, of the first axes.

    A table with `each` stands for one of the axes for each value of a list.
    """
    figure, axes = drawing.panels(
        *(evaluated(part, names) for part in entry["panels"]), **entry.get("options", {})
    )
    panels = [
        (panel, value)
        for panel in entry["axes"]
        for value in evaluated(panel.get("each", (None,)), names)
    ]
    for own, (panel, value) in zip(axes, panels, strict=True):
        facts = facts_of(panel, {**names, "axes": own, "each": value})
        for curve in panel["curves"]:
            if isinstance(curve, str):
                evaluated(curve, facts)
            else:
                _draw(own, curve, facts)
        labels = {f"{side}label": panel[side] for side in "xy" if side in panel}
        scales = {f"{side}scale": "log" for side in panel.get("log", "")}
        own.set(
            **labels,
            title=worded(panel.get("title", ""), facts),
            **scales,
            **panel.get("limits", {}),
        )
        for call in panel.get("also", ()):
            evaluated(call, facts)
        if "legend" in panel:
            own.legend(**panel["legend"])
    if "below" in entry:
        figure.legend(
            *axes[0].get_legend_handles_labels(), loc="outside lower center", **entry["below"]
        )
    return figure


def _draw(axes: Axes, curve: Mapping[str, Any], names: dict[str, Any]) -> None:
    """Draw a curve of a table, or one for each value of a column `by`; x, y and z may name its columns, and `part`.

    One that has a condition is drawn `when` it holds.
    """
    if not evaluated(curve.get("when", True), names):
        return
    style = {key: value for key, value in curve.items() if key not in CURVE}
    style["color"] = getattr(drawing, style.get("color", ""), style.get("color"))
    table = evaluated(curve.get("table", "table"), names)
    if not len(table):
        raise ValueError(f"curve: got no rows of {curve.get('table', 'table')}, expected some")
    key, text = curve.get("by"), curve.get("label")
    parts = tables.groups(table, key) if key else [(None, table)]
    colors = cycle(evaluated(curve.get("colors", drawing.CYCLE), names))
    for color, (value, part) in zip(colors, parts, strict=False):
        own = {**names, "part": part, **{name: part[name] for name in part.dtype.names}}
        chosen = {**style, "label": text}
        if key:
            own[key] = value
            chosen |= {"label": text and worded(text, own), "color": style["color"] or color}
        chosen |= {name: evaluated(style[name], own) for name in VARYING & style.keys()}
        x, y, slope = (evaluated(curve.get(name), own) for name in ("x", "y", "slope"))
        if "slope" in curve:
            # A power law that has the value y at the last of the points x.
            law = {
                "color": drawing.BLACK,
                "linestyle": chosen.pop("line", ":"),
                "label": f"slope {slope:.3g}",
            }
            law |= {name: each for name, each in chosen.items() if each is not None}
            axes.plot(x, y * (x / x[-1]) ** slope, **law)
        elif "level" in curve:
            axes.axhline(evaluated(curve["level"], own), **chosen)
        elif "broken" in curve:
            drawing.draw_broken(axes, x, y, part[curve["broken"]], **chosen)
        else:
            axes.plot(x, y, *([evaluated(curve["z"], own)] if "z" in curve else []), **chosen)
