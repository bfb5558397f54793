"""The sections of the reproduction, in the paper's order: one line each; modules are imported on use."""

from functools import cache
from importlib import import_module

from polhode.harness.paper.item import Item, Section

SECTIONS = (
    "polhode.harness.paper.sections.periods:SECTION",
    "polhode.harness.paper.sections.limits.euler_tops:SECTION",
    "polhode.harness.paper.sections.spheroids.motion:SECTION",
    "polhode.harness.paper.sections.ellipsoids.planes:SECTION",
    "polhode.harness.paper.sections.rest:SECTION",
    "polhode.harness.paper.sections.appendix.averages:SECTION",
    "polhode.harness.paper.sections.beyond.endings_and_basins:SECTION",
)


@cache
def sections() -> tuple[Section, ...]:
    """All sections."""
    parts = (target.partition(":") for target in SECTIONS)
    return tuple(getattr(import_module(module), attribute) for module, _, attribute in parts)


def items() -> tuple[Item, ...]:
    """All items, in order."""
    return tuple(item for section in sections() for item in section.items)


def find_items(names: tuple[str, ...]) -> tuple[Item, ...]:
    """Items, or all items of sections, of the given names, all of them without names; ValueError for unknown ones."""
    known = {item.name: (item,) for item in items()} | {section.name: section.items for section in sections()}
    for name in names:
        if name not in known:
            raise ValueError(f"item: got {name!r}, expected one of {', '.join(known)}")
    wanted = {item.name for name in names for item in known[name]}
    return tuple(item for item in items() if not names or item.name in wanted)


def section_of(item: Item) -> Section:
    """The section an item belongs to."""
    return next(section for section in sections() if item in section.items)
