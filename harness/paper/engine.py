"""Run items: compute what is not there yet, draw, write the pages."""

from collections.abc import Callable, Sequence
from pathlib import Path
from time import perf_counter

from polhode.harness.paper import store
from polhode.harness.paper.claims import section_of, sections
from polhode.harness.paper.drawing import save, style
from polhode.harness.paper.item import Grid, Item
from polhode.harness.paper.pages import write_pages


def run(
    items: Sequence[Item],
    folder: Path,
    report: Callable[[str], None],
    *,
    grid: Grid = Grid.FULL,
    force: bool = False,
    redraw: bool = False,
) -> list[str]:
    """Compute what today's code has not made, draw, write the pages; returns the names of the items that failed."""
    failed = []
    began = perf_counter()
    for number, item in enumerate(items, start=1):
        start = perf_counter()
        own = folder / section_of(item).name
        found = None if force else store.read(own, item)
        kept = found is not None and (redraw or found[1:] == (True, grid))
        try:
            data = found[0] if found and kept else store.write(own, item, grid, item.compute(grid))
            with style():
                save(item.figure(data), own, item.name)
            word = item.verdict(data).word
        except store.FAILURES as error:
            failed.append(item.name)
            report(f"[{number:2}/{len(items)}] {item.name:28} failed: {error}")
            continue
        how = "   kept " if kept else f"{perf_counter() - start:6.1f} s"
        report(f"[{number:2}/{len(items)}] {item.name:28} {how}  {word}")
    write_pages(folder, sections(), grid)
    report(f"{perf_counter() - began:.0f} s; index: {folder / 'README.md'}")
    return failed
