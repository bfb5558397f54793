"""The work of `polhode paper`: compute items whose data are not today's, draw all, write the pages.

Items are computed here one after the other, or several at a time in processes of their own. Their
figures are drawn here, as their data come. An item that fails does not stop the others.
"""

import os
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass
from functools import partial
from itertools import chain
from pathlib import Path
from time import perf_counter

from polhode.harness.common.text import duration
from polhode.harness.ensembles import engines
from polhode.harness.paper import claims, store
from polhode.harness.paper.drawing import save, style
from polhode.harness.paper.item import Data, Grid, Item
from polhode.harness.paper.pages import write_pages

# Variables that libraries of linear algebra read when they are loaded. In several processes at a
# time, one thread each is far faster than their usual number, which wait for each other on the same
# cores.
_THREAD_VARIABLES = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")


@dataclass(frozen=True)
class _Outcome:
    """The result for one item: its data, or why there are none."""

    name: str
    data: Data | None
    seconds: float | None = None  # Of the computation; None if the data were in the folder.
    failure: str = ""


def run(
    items: Sequence[Item],
    folder: Path,
    report: Callable[[str], None],
    *,
    grid: Grid = Grid.FULL,
    force: bool = False,
    redraw: bool = False,
    svg: bool = False,
    processes: int = 1,
) -> list[str]:
    """Compute what is not there, draw, write the pages.

    Parameters
    ----------
    items
        Items to make; the pages show all items.
    folder
        Where pages, figures and data are, and are written.
    report
        Takes the lines that say how far the work is.
    grid
        How fine to compute. Data on another grid are computed again.
    force
        Compute all items, even those whose data are today's.
    redraw
        Compute only items without data: take those of other code, or of another grid, as they are.
    svg
        Write figures as SVG too.
    processes
        How many items are computed at a time, each in a process; 1 computes them in this process.

    Returns
    -------
    list[str]
        Names of the items that failed.
    """
    began = perf_counter()
    cached = {} if force else _cached_data(items, folder, grid, redraw=redraw)
    missing = [item for item in items if item.name not in cached]
    report(_ahead(items, missing, processes))
    if processes == 1:
        computed = _in_turn(missing, folder, grid, report)
    else:
        # The longest first, so that none of them is left to run alone at the end.
        missing.sort(key=lambda item: -item.experiment.seconds)
        computed = _side_by_side(missing, folder, grid, processes, report)
    by_name = {item.name: item for item in items}
    failed = []
    # Ctrl-C while a figure is drawn ends the processes too.
    with closing(computed):
        for number, outcome in enumerate(chain(_cached_outcomes(cached), computed), start=1):
            failure, verdict = _drawn(by_name[outcome.name], outcome, folder, svg=svg)
            if failure:
                failed.append(outcome.name)
            words = f"failed: {failure}" if failure else verdict
            took = " cached " if outcome.seconds is None else f"{outcome.seconds:6.1f} s"
            report(f"[{number:2}/{len(items)}] {outcome.name:28} {took}  {words}")
    write_pages(folder, claims.sections())
    report(f"{perf_counter() - began:.0f} s; index: {folder / 'README.md'}")
    return failed


def _cached_data(
    items: Sequence[Item], folder: Path, grid: Grid, *, redraw: bool
) -> dict[str, Data]:
    """Data, by name, of items that need not be computed: with `redraw`, of all that have any."""
    cached = {}
    for item in items:
        stored = store.read(_section_folder(folder, item), item)
        if stored is None:
            continue
        if redraw or (stored.is_current and stored.grid is grid):
            cached[item.name] = stored.data
    return cached


def _section_folder(folder: Path, item: Item) -> Path:
    """The folder of an item's data and figure."""
    return folder / claims.section_of(item).name


def _drawn(item: Item, outcome: _Outcome, folder: Path, *, svg: bool) -> tuple[str, str]:
    """Draw the item's figure and judge its data.

    Returns two texts, of which one is empty: why the item failed, and the word of its verdict.
    """
    if outcome.data is None:
        return outcome.failure, ""
    try:
        with style():
            figure = item.experiment.draw(outcome.data)
            save(figure, _section_folder(folder, item), item.name, svg=svg)
        return "", str(item.experiment.judge(outcome.data).word)
    except store.ITEM_FAILURES as error:
        return str(error), ""


def _cached_outcomes(cached: Mapping[str, Data]) -> Iterator[_Outcome]:
    """Outcomes of items whose data were in the folder."""
    for name, data in cached.items():
        yield _Outcome(name, data)


def _in_turn(
    items: Sequence[Item], folder: Path, grid: Grid, report: Callable[[str], None]
) -> Generator[_Outcome, None, None]:
    """Outcomes of items that are computed in this process, one after the other."""
    for item in items:
        report(_begun(item))
        yield _computed(item, folder, grid)


def _side_by_side(
    items: Sequence[Item],
    folder: Path,
    grid: Grid,
    count: int,
    report: Callable[[str], None],
) -> Generator[_Outcome, None, None]:
    """Outcomes of `count` processes, as they come.

    Closing the generator ends at once what is under way.
    """
    # By name, to say how long a process took that gave no outcome, as one that was killed.
    starts: dict[str, float] = {}

    def names() -> Iterator[str]:
        """Name each item when a process is free for it."""
        for item in items:
            report(_begun(item))
            starts[item.name] = perf_counter()
            yield item.name

    compute = partial(_computed_by_name, folder=folder, grid=grid)
    # No item waits ahead of a free process: `names` reports an item when it is begun.
    outcomes = engines.processes(count, compute, names(), ahead=0)
    with _single_threaded_children(), closing(outcomes):
        for name, outcome, message in outcomes:
            yield outcome or _Outcome(name, None, perf_counter() - starts[name], message)


def _ahead(items: Sequence[Item], missing: Sequence[Item], processes: int) -> str:
    """The first line of the report: how many items are computed, and about how long that takes."""
    counts = f"{len(items)} items, {len(missing)} to compute"
    if not missing:
        return counts
    seconds = [item.experiment.seconds for item in missing]
    # The processes share the work, but none of them the longest item.
    expected = max(max(seconds), sum(seconds) / processes)
    return f"{counts}, {processes} at a time, in some {duration(expected)}"


def _begun(item: Item) -> str:
    """The line that says that an item is begun, and about how long it takes."""
    return f"        {item.name} … (about {duration(item.experiment.seconds)})"


@contextmanager
def _single_threaded_children() -> Iterator[None]:
    """Let processes that are spawned here use one thread each for linear algebra."""
    before = {name: os.environ.get(name) for name in _THREAD_VARIABLES}
    os.environ.update(dict.fromkeys(_THREAD_VARIABLES, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def _computed_by_name(name: str, folder: Path, grid: Grid) -> _Outcome:
    """`_computed` in another process: only an item's name is sent there."""
    (item,) = claims.find_items((name,))
    return _computed(item, folder, grid)


def _computed(item: Item, folder: Path, grid: Grid) -> _Outcome:
    """Compute an item, write its data and read them back; a failure is an outcome too."""
    start = perf_counter()
    try:
        parts = item.experiment.compute(grid)
        data = store.write(_section_folder(folder, item), item, grid, parts)
    except store.ITEM_FAILURES as error:
        return _Outcome(item.name, None, perf_counter() - start, str(error))
    return _Outcome(item.name, data, perf_counter() - start)
