"""Run items: compute what is not there yet, draw, write the pages."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter

from polhode.harness.paper import store
from polhode.harness.paper.catalogue import sections
from polhode.harness.paper.drawing import save, style
from polhode.harness.paper.item import Data, Grid, Item, Section, Verdict
from polhode.harness.paper.pages import write_pages


@dataclass(frozen=True)
class Settings:
    """What to do with data that are there.

    Parameters
    ----------
    grid : Grid
    force : bool
        Compute again even what is there.
    redraw : bool
        Take what is there, whatever code made it.
    """

    grid: Grid = Grid.FULL
    force: bool = False
    redraw: bool = False


def run(items: Sequence[Item], folder: Path, settings: Settings, tell: Callable[[str], None]) -> list[str]:
    """Compute, draw and write the pages of all items; those that fail are told and do not stop the others.

    Returns
    -------
    list of str
        Names of the items that failed.
    """
    failed = []
    began = perf_counter()
    for number, item in enumerate(items, start=1):
        start = perf_counter()
        try:
            verdict, fresh = _one(item, folder / section_of(item).name, settings)
        except (ArithmeticError, RuntimeError, ValueError) as error:
            failed.append(item.name)
            tell(f"[{number:2}/{len(items)}] {item.name:28} failed: {error}")
            continue
        how = f"{perf_counter() - start:6.1f} s" if fresh else "   kept "
        tell(f"[{number:2}/{len(items)}] {item.name:28} {how}  {verdict.word}")
    write_pages(folder, sections(), settings.grid)
    tell(f"{perf_counter() - began:.0f} s; index: {folder / 'README.md'}")
    return failed


def section_of(item: Item) -> Section:
    """The section an item belongs to."""
    return next(section for section in sections() if item in section.items)


def _one(item: Item, folder: Path, settings: Settings) -> tuple[Verdict, bool]:
    kept = _kept(item, folder, settings)
    if kept is None:
        store.write(folder, item, settings.grid, item.compute(settings.grid))
    found = store.read(folder, item)
    if found is None:
        raise RuntimeError(f"the data in {folder} cannot be read back")
    with style():
        save(item.figure(found[0]), folder, item.name)
    return item.verdict(found[0]), kept is None


def _kept(item: Item, folder: Path, settings: Settings) -> Data | None:
    found = None if settings.force else store.read(folder, item)
    if found is None:
        return None
    data, current, grid = found
    return data if settings.redraw or (current and grid is settings.grid) else None
