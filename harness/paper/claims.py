"""The claims of the paper and the questions beyond it, in the paper's order."""

from functools import cache

from polhode.harness.paper.item import Item, Section
from polhode.harness.paper.sections import (
    appendix,
    beyond,
    clocks,
    ellipsoids,
    limits,
    periods,
    remarks,
    rest,
    spheroids,
)

_SECTIONS = (
    periods.SECTION,
    limits.SECTION,
    spheroids.SECTION,
    clocks.SECTION,
    ellipsoids.SECTION,
    rest.SECTION,
    remarks.SECTION,
    appendix.SECTION,
    beyond.SECTION,
)


def sections() -> tuple[Section, ...]:
    """All sections, in order."""
    return _SECTIONS


@cache
def items() -> tuple[Item, ...]:
    """All items, in order."""
    return tuple(item for section in _SECTIONS for item in section.items)


def find_items(names: tuple[str, ...]) -> tuple[Item, ...]:
    """Items of the given names, all of the sections named; all items without names.

    Raises ValueError for a name that neither an item nor a section has.
    """
    chosen = {}
    groups = {item.name: (item,) for item in items()}
    groups |= {section.name: section.items for section in _SECTIONS}
    for name in names:
        if name not in groups:
            raise ValueError(f"item: got {name!r}, expected one of {', '.join(groups)}")
        for item in groups[name]:
            chosen[item.name] = item
    return tuple(item for item in items() if not names or item.name in chosen)


def section_of(item: Item) -> Section:
    """The section an item belongs to."""
    return next(section for section in sections() if item in section.items)
