"""The sections of the reproduction, in the paper's order; modules are imported on use."""

from functools import cache

from polhode.harness.paper.claims import section
from polhode.harness.paper.item import Item, Section

SECTIONS = ("periods", "limits", "spheroids", "ellipsoids", "rest", "appendix", "beyond")


@cache
def sections() -> tuple[Section, ...]:
    """All sections."""
    return tuple(map(section, SECTIONS))


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
