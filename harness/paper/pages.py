"""The pages of the reproduction: one per section, and an index with all claims and their verdicts.

`write_pages` reads the data that are in the folder and judges them; `reproduction.py` computes
them. The templates are `harness/pages/texts/paper.md` for the index and `paper-item.md` for an
item.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from itertools import chain
from math import floor, inf, isfinite, log10
from pathlib import Path

from polhode.harness.common.files import write_file
from polhode.harness.common.machine import provenance
from polhode.harness.common.store import Record
from polhode.harness.common.text import markdown, short
from polhode.harness.pages.tables import fill, folded
from polhode.harness.paper import store
from polhode.harness.paper.item import Grid, Item, Number, Section, Word

# Verdicts in the order of the index: first numbers outside their ranges, then corrections of the paper.
_INDEX_ORDER = (
    Word.NOT_CONFIRMED,
    Word.CORRECTED,
    Word.UNDECIDED,
    Word.CONFIRMED,
    Word.SHARPENED,
    Word.MEASURED,
)
# Significant digits of a value without an interval and of the ends of ranges, and the most of a value with an
# interval: a choice, enough to compare a value with its range.
_DIGITS = 4
# Unit of the last digit where neither value nor interval gives a finite size above 0. Any small one will
# do.
_UNIT_OF_NONE = 1e-12


def write_pages(folder: Path, sections: Sequence[Section]) -> None:
    """Write the index and a page for each section, from the data in the folder.

    Data of older code are shown too, if today's `judge` can read them: the index names them.
    """
    judgements: dict[str, store.Judged] = {}
    records: dict[str, list[Record]] = {}
    for section in sections:
        records[section.name] = []
        for item in section.items:
            judgement = store.judged(folder / section.name, item)
            judgements[item.name] = judgement
            if isinstance(judgement, store.Judgement):
                records[section.name].append(store.measured(folder / section.name, item))
    for section in sections:
        page = _section_page(section, judgements, records[section.name])
        write_file(folder / f"{section.name}.md", page)
    all_records = list(chain.from_iterable(records.values()))
    write_file(folder / "README.md", _index(sections, judgements, all_records))


def _section_page(
    section: Section, judgements: Mapping[str, store.Judged], records: Sequence[Record]
) -> str:
    """The page of a section."""
    descriptions = [_described(section, item, judgements[item.name]) for item in section.items]
    return "\n".join([f"# {section.title}", "", *descriptions, _made(records), ""])


def _made(records: Sequence[Record]) -> str:
    """The lines that say when, where and by what the data were made."""
    return folded(provenance("polhode paper", records))


def _described(section: Section, item: Item, judgement: store.Judged) -> str:
    """The text on an item on the page of its section; a `judgement` of words says why there is none."""
    if isinstance(judgement, str):
        claim = f"**Claim.** {item.claim}"
        return f"## {item.title}\n\n{claim}\n\n{judgement}: `polhode paper {item.name}`.\n"
    tables = [
        f"[{name or 'data'}]({section.name}/{store.file_name(item, name)})"
        for name in judgement.data
    ]
    rows = [
        _cells(number.name, measured(number), allowed(number), reason(number))
        for number in judgement.verdict.numbers
    ]
    return fill(
        "paper-item",
        item=item,
        verdict=judgement.verdict,
        numbers=markdown(["measured", "value", "verdict holds for", "because"], rows),
        place=f"{section.name}/{item.name}",
        tables=", ".join(tables),
    )


def _cells(*texts: str) -> list[str]:
    """Cells of a row of a table in Markdown, where a bar, as in |L|, would end a cell."""
    return [text.replace("|", "\\|") for text in texts]


def measured(number: Number) -> str:
    """A number's value as the pages write it, with interval and unit; of a share also the whole.

    An example is "0.57 (95 %: 0.55 … 0.59)". `last_unit` says to which digit both are written.
    """
    if abs(number.value) < number.floor:
        # Floors are powers of ten, so that one digit shows them exactly.
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
    """One unit of the last digit that is written of a number's value: a power of ten.

    The value has `_DIGITS` digits. With an interval it has no more than down to the first digit of
    the interval's width.
    """
    sizes = [abs(number.value) * 10.0 ** (1 - _DIGITS)]
    if number.interval is not None:
        low, high = number.interval
        sizes.append(high - low)
    largest = max((size for size in sizes if isfinite(size)), default=0.0)
    return 10.0 ** floor(log10(largest)) if largest > 0 else _UNIT_OF_NONE


def _multiple(value: float, unit: float) -> str:
    """A value rounded to a multiple of the unit of its last digit."""
    return short(round(value / unit) * unit) if isfinite(value) else short(value)


def allowed(number: Number) -> str:
    """The range in which the verdict holds: "0 … 1", "≤ 1"."""
    if number.expected is None:
        return "any value"
    low = number.expected.low
    high = number.expected.high
    if low == -inf:
        return f"≤ {_digits(high)}"
    if high == inf:
        return f"≥ {_digits(low)}"
    return f"{_digits(low)} … {_digits(high)}"


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
    """The index page: how many items have which verdict, remarks, and a row for each item."""
    judged = {
        name: judgement
        for name, judgement in judgements.items()
        if isinstance(judgement, store.Judgement)
    }
    counted = Counter(judgement.verdict.word for judgement in judged.values())
    counts = [f"{counted[word]} {word}" for word in Word if counted[word]]
    rows = []
    for section in sections:
        rows += [_index_row(section, item, judgements[item.name]) for item in section.items]
    return fill(
        "paper",
        count=len(judgements),
        counts=", ".join(counts),
        made=_made(records),
        remarks=_remarks(judged),
        items=markdown(["verdict", "section", "item", "claim", "number"], _by_verdict(rows)),
        sections=", ".join(f"[{section.title}]({section.name}.md)" for section in sections),
    )


def _remarks(judged: Mapping[str, store.Judgement]) -> str:
    """Names of the items whose data are coarse, or of older code, in sentences; empty for none."""
    coarse = [name for name, judgement in judged.items() if judgement.grid is not Grid.FULL]
    stale = [name for name, judgement in judged.items() if not judgement.is_current]
    remarks = ""
    if coarse:
        names = ", ".join(coarse)
        remarks += f"**Made on the reduced grid, a look, not a result: {names}.**\n\n"
    if stale:
        remarks += f"Made by older code, to be computed again: {', '.join(stale)}.\n\n"
    return remarks


def _by_verdict(rows: Sequence[list[str]]) -> list[list[str]]:
    """Rows of the index, whose first cell is the verdict, in the order of `_INDEX_ORDER`.

    Rows without a verdict, which say why there is none, come last. Rows of one verdict stay in the
    paper's order.
    """
    verdicts = [str(word) for word in _INDEX_ORDER]
    reasons = {row[0] for row in rows} - set(verdicts)
    order = [*verdicts, *sorted(reasons)]
    return sorted(rows, key=lambda row: order.index(row[0]))


def _index_row(section: Section, item: Item, judgement: store.Judged) -> list[str]:
    """Verdict, section, link, claim and first number of an item."""
    link = f"[{item.name}]({section.name}.md#{_anchor(item.title)})"
    if isinstance(judgement, str):
        return _cells(judgement, section.name, link, item.claim, "")
    first = judgement.verdict.numbers[0]
    number = f"{first.name}: {measured(first)}"
    return _cells(judgement.verdict.word, section.name, link, item.claim, number)


def _anchor(title: str) -> str:
    """The anchor that GitHub makes of a heading."""
    letters = [letter for letter in title.lower() if letter.isalnum() or letter in " -_"]
    return "".join(letters).replace(" ", "-")
