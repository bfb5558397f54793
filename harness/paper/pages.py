"""Items computed and drawn, and their pages: one per section, and an index from claim to verdict."""

import os
from collections import Counter
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass
from functools import partial
from itertools import chain
from math import floor, isfinite, log10
from pathlib import Path
from time import perf_counter

from polhode.harness.common.files import write_file
from polhode.harness.common.machine import provenance
from polhode.harness.common.store import Record
from polhode.harness.common.text import duration, markdown, short
from polhode.harness.ensembles import engines
from polhode.harness.pages.tables import fill, folded
from polhode.harness.paper import store
from polhode.harness.paper.claims import find_items, section_of, sections
from polhode.harness.paper.drawing import save, style
from polhode.harness.paper.item import Data, Grid, Item, Number, Section, Word

# Verdicts in the order of the index: first what does not hold as it is printed.
_FIRST_WORDS = (
    Word.NOT_CONFIRMED,
    Word.CORRECTED,
    Word.UNDECIDED,
    Word.CONFIRMED,
    Word.SHARPENED,
    Word.MEASURED,
)
# Variables that libraries of linear algebra read when they are loaded. Threads of several processes
# wait for each other on the same cores: 90 times the wall time of one thread each.
_THREAD_VARIABLES = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
# Digits that the pages write of a value without an interval.
_DIGITS = 4


def write_pages(folder: Path, sections: Sequence[Section]) -> None:
    """Write the index and the pages of all sections from the data in the folder, whenever they were made."""
    judgements = {}
    records = {}
    for section in sections:
        for item in section.items:
            judgements[item.name] = store.judged(folder / section.name, item)
        records[section.name] = [
            store.measured(folder / section.name, item)
            for item in section.items
            if not isinstance(judgements[item.name], str)
        ]
    for section in sections:
        parts = [_described(section, item, judgements[item.name]) for item in section.items]
        lines = [f"# {section.title}", "", *parts, _made(records[section.name]), ""]
        write_file(folder / f"{section.name}.md", "\n".join(lines))
    index = _index(sections, judgements, [*chain.from_iterable(records.values())])
    write_file(folder / "README.md", index)


def _made(records: Sequence[Record]) -> str:
    """The lines that say when, where and by what the data were made."""
    return folded(provenance("polhode paper", records))


def _described(section: Section, item: Item, judgement: store.Judged) -> str:
    """The text on an item on the page of its section."""
    if isinstance(judgement, str):
        return f"## {item.title}\n\n**Claim.** {item.claim}\n\n{judgement}: `polhode paper {item.name}`.\n"
    data, verdict, *_ = judgement
    files = [f"[{name or 'data'}]({section.name}/{store.file_name(item, name)})" for name in data]
    rows = [
        _cells(number.what, measured(number), allowed(number), reason(number))
        for number in verdict.numbers
    ]
    numbers = markdown(["measured", "value", "verdict holds for", "because"], rows)
    place = f"{section.name}/{item.name}"
    return fill(
        "paper-item",
        item=item,
        verdict=verdict,
        numbers=numbers,
        place=place,
        tables=", ".join(files),
    )


def _cells(*texts: str) -> list[str]:
    """Table cells; the bars of |L| would end them."""
    return [text.replace("|", "\\|") for text in texts]


def measured(number: Number) -> str:
    """The value with its interval and unit; a share with what it is a share of.

    The last digit of a value with an interval is the first one of the interval's width.
    """
    if abs(number.value) < number.floor:
        text = f"below {_digits(number.floor, 1)}"
    elif number.interval is None:
        text = _digits(number.value)
    else:
        unit = last_unit(number)
        low, high = (_multiple(end, unit) for end in number.interval)
        text = f"{_multiple(number.value, unit)} (95 %: {low} … {high})"
    text = f"{text} {number.unit}".rstrip()
    return f"{text} of {number.measure}" if number.measure else text


def last_unit(number: Number) -> float:
    """One unit of the last digit that is written of a value.

    Without an interval the value has `_DIGITS` digits; 1e-12 stands for values of 0 or infinity.
    """
    sizes = [abs(number.value) * 10.0 ** (1 - _DIGITS)]
    if number.interval is not None:
        sizes.append(number.interval[1] - number.interval[0])
    largest = max((size for size in sizes if isfinite(size)), default=0.0)
    return 10.0 ** floor(log10(largest)) if largest > 0 else 1e-12


def _multiple(value: float, unit: float) -> str:
    """A value rounded to a multiple of the unit of its last digit."""
    return short(round(value / unit) * unit) if isfinite(value) else short(value)


def allowed(number: Number) -> str:
    """The range in which the verdict holds."""
    if number.expected is None:
        return "any value"
    low = number.expected.low
    high = number.expected.high
    if low == -float("inf"):
        return f"≤ {_digits(high)}"
    return f"≥ {_digits(low)}" if high == float("inf") else f"{_digits(low)} … {_digits(high)}"


def reason(number: Number) -> str:
    """Why the range has its ends; empty where there is none."""
    return number.expected.reason if number.expected else ""


def _digits(value: float, count: int = _DIGITS) -> str:
    """A value in `count` significant digits."""
    return short(float(f"{value:.{count}g}"))


def _index(
    sections: Sequence[Section],
    judgements: Mapping[str, store.Judged],
    records: Sequence[Record],
) -> str:
    """The index page: counts of verdicts, what is stale or coarse, and a row for each item."""
    computed = {
        name: content for name, content in judgements.items() if not isinstance(content, str)
    }
    words = Counter(content[1].word for content in computed.values())
    stale = [name for name, content in computed.items() if not content[2]]
    coarse = [name for name, content in computed.items() if content[3] is not Grid.FULL]
    remarks = (
        f"**Made on the reduced grid, a look, not a result: {', '.join(coarse)}.**\n\n"
        if coarse
        else ""
    )
    if stale:
        remarks += f"Made by older code, to be computed again: {', '.join(stale)}.\n\n"
    rows = []
    for section in sections:
        rows += [_index_row(section, item, judgements[item.name]) for item in section.items]
    # Verdicts that say the most first; in the paper's order among each other.
    order = [*map(str, _FIRST_WORDS), *sorted({row[0] for row in rows} - set(_FIRST_WORDS))]
    rows.sort(key=lambda row: order.index(row[0]))
    return fill(
        "paper",
        count=len(judgements),
        counts=", ".join(f"{words[word]} {word}" for word in Word if words[word]),
        made=_made(records),
        remarks=remarks,
        items=markdown(["verdict", "section", "item", "claim", "number"], rows),
        sections=", ".join(f"[{section.title}]({section.name}.md)" for section in sections),
    )


def _index_row(section: Section, item: Item, judgement: store.Judged) -> list[str]:
    """Verdict, section, link, claim and first number of an item."""
    # The anchor that GitHub makes of a heading.
    anchor = "".join(
        letter for letter in item.title.lower() if letter.isalnum() or letter in " -_"
    ).replace(" ", "-")
    name = f"[{item.name}]({section.name}.md#{anchor})"
    if isinstance(judgement, str):
        return _cells(judgement, section.name, name, item.claim, "")
    first = judgement[1].numbers[0]
    number = f"{first.what}: {measured(first)}"
    return _cells(judgement[1].word, section.name, name, item.claim, number)


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
    """Compute what today's code has not made, draw, write the pages; returns the names of the items that failed.

    With several processes as many items are computed at a time, each found again by its name, the
    longest ones first.
    """
    began = perf_counter()
    data: dict[str, Data] = {}
    for item in items:
        stored = None if force else store.read(folder / section_of(item).name, item)
        if stored is not None and (redraw or stored[1:] == (True, grid)):
            data[item.name] = stored[0]
    missing = [item for item in items if item.name not in data]
    report(_ahead(items, missing, processes))
    if processes == 1:
        computed = _in_turn(missing, folder, grid, report)
    else:
        missing.sort(key=lambda item: -item.experiment.seconds)
        computed = _side_by_side(missing, folder, grid, processes, report)
    failed = []
    by_name = {item.name: item for item in items}
    # Ctrl-C while a figure is drawn ends the processes too.
    with closing(computed):
        for number, outcome in enumerate(chain(_cached(data), computed), start=1):
            item = by_name[outcome.name]
            failure, words = _drawn(item, outcome, folder, svg)
            if failure:
                failed.append(item.name)
                words = f"failed: {failure}"
            took = " cached " if outcome.seconds is None else f"{outcome.seconds:6.1f} s"
            report(f"[{number:2}/{len(items)}] {item.name:28} {took}  {words}")
    write_pages(folder, sections())
    report(f"{perf_counter() - began:.0f} s; index: {folder / 'README.md'}")
    return failed


@dataclass(frozen=True)
class _Outcome:
    """The data of an item, or why there are none, and the seconds that they took; None if they were there."""

    name: str
    data: Data | None
    seconds: float | None = None
    failure: str = ""


def _drawn(item: Item, outcome: _Outcome, folder: Path, svg: bool) -> tuple[str, str]:
    """Draw the item's figure; how that or the computation failed, and the word of its verdict."""
    if outcome.data is None:
        return outcome.failure, ""
    try:
        with style():
            save(
                item.experiment.draw(outcome.data),
                folder / section_of(item).name,
                item.name,
                svg=svg,
            )
        return "", str(item.experiment.judge(outcome.data).word)
    except store.ITEM_FAILURES as error:
        return str(error), ""


def _cached(data: Mapping[str, Data]) -> Iterator[_Outcome]:
    """Outcomes of items whose data were read from the folder, by name."""
    for name, tables in data.items():
        yield _Outcome(name, tables)


def _in_turn(
    items: Sequence[Item], folder: Path, grid: Grid, report: Callable[[str], None]
) -> Generator[_Outcome, None, None]:
    """Outcomes of items that are computed here, one after the other."""
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
    """Outcomes of `count` processes as they come; closing the generator ends what is under way at once."""
    starts: dict[str, float] = {}

    def begun() -> Iterator[str]:
        for item in items:
            report(_begun(item))
            starts[item.name] = perf_counter()
            yield item.name

    compute = partial(_computed_by_name, folder=folder, grid=grid)
    outcomes = engines.processes(count, compute, begun(), ahead=0)
    with _single_threaded_children(), closing(outcomes):
        for name, outcome, message in outcomes:
            yield outcome or _Outcome(name, None, perf_counter() - starts[name], message)


def _ahead(items: Sequence[Item], missing: Sequence[Item], processes: int) -> str:
    """How many items are computed, and about how long that takes."""
    counts = f"{len(items)} items, {len(missing)} to compute"
    if not missing:
        return counts
    seconds = [item.experiment.seconds for item in missing]
    expected = max(max(seconds), sum(seconds) / processes)
    return f"{counts}, {processes} at a time, in some {duration(expected)}"


def _begun(item: Item) -> str:
    """The line that says that an item is begun, and about how long it takes."""
    return f"        {item.name} … (about {duration(item.experiment.seconds)})"


@contextmanager
def _single_threaded_children() -> Iterator[None]:
    """Let processes that are spawned here use one thread for linear algebra: each has a core of its own."""
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
    """The same as `_computed` in another process, to which a name is sent and no item."""
    (item,) = find_items((name,))
    return _computed(item, folder, grid)


def _computed(item: Item, folder: Path, grid: Grid) -> _Outcome:
    """Compute an item and write its data; a failure is an outcome too."""
    start = perf_counter()
    try:
        parts = item.experiment.compute(grid)
        data = store.write(folder / section_of(item).name, item, grid, parts)
    except store.ITEM_FAILURES as error:
        return _Outcome(item.name, None, perf_counter() - start, str(error))
    return _Outcome(item.name, data, perf_counter() - start)
