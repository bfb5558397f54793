"""The claims of the paper and the questions beyond it, in the paper's order."""

from functools import cache
from itertools import chain

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
from polhode.models.registry import hint

_SECTIONS = (
    periods.PERIODS_SECTION,
    limits.LIMITS_SECTION,
    spheroids.SPHEROIDS_SECTION,
    clocks.CLOCKS_SECTION,
    ellipsoids.ELLIPSOIDS_SECTION,
    rest.REST_SECTION,
    remarks.REMARKS_SECTION,
    appendix.APPENDIX_SECTION,
    beyond.BEYOND_SECTION,
)


def sections() -> tuple[Section, ...]:
    """All sections, in order."""
    return _SECTIONS


@cache
def items() -> tuple[Item, ...]:
    """All items, in order."""
    return tuple(chain.from_iterable(section.items for section in _SECTIONS))


def find_items(names: tuple[str, ...]) -> tuple[Item, ...]:
    """Items of the given names, all of the sections named; all items without names.

    Raises ValueError for a name that neither an item nor a section has.
    """
    chosen = {}
    groups = {item.name: (item,) for item in items()}
    groups |= {section.name: section.items for section in _SECTIONS}
    for name in names:
        if name not in groups:
            advice = hint(name, groups)
            raise ValueError(f"item: got {name!r}{advice}, expected one of {', '.join(groups)}")
        for item in groups[name]:
            chosen[item.name] = item
    return tuple(item for item in items() if not names or item.name in chosen)


def section_of(item: Item) -> Section:
    """The section an item belongs to."""
    return next(section for section in sections() if item in section.items)
