"""The pages of the reproduction: one per section, and an index from claim to verdict."""

from collections.abc import Sequence
from pathlib import Path

from polhode.harness.common.files import PartialFile
from polhode.harness.common.text import markdown
from polhode.harness.paper import store
from polhode.harness.paper.item import Data, Grid, Item, Number, Section, Verdict, Word

NOTICE = "Made by `polhode paper`. Do not edit: the next run overwrites this page."


def write_pages(folder: Path, sections: Sequence[Section], grid: Grid) -> None:
    """Write the index and the pages of all sections from the data in the folder, whenever they were made."""
    found = {item.name: _usable(folder / section.name, item) for section in sections for item in section.items}
    data = {name: content[0] for name, content in found.items() if content is not None}
    stale = [name for name, content in found.items() if content is not None and not content[1]]
    for section in sections:
        lines = [f"# {section.title}", "", NOTICE, ""]
        for item in section.items:
            lines += _item_lines(section, item, data.get(item.name))
        _write(folder / f"{section.name}.md", lines)
    _write(folder / "README.md", _index(sections, data, stale, grid))


def _usable(folder: Path, item: Item) -> tuple[Data, bool] | None:
    """The item's data, and whether today's code made them; None where there are none that a verdict can be made of."""
    found = store.read(folder, item)
    if found is None:
        return None
    data, current, _ = found
    try:
        item.verdict(data)
    except (ArithmeticError, LookupError, TypeError, ValueError):
        # Older code kept other columns, or other rows.
        return None
    return data, current


def _write(path: Path, lines: Sequence[str]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    with PartialFile(path) as file:
        file.write("\n".join(lines).rstrip() + "\n")


def _item_lines(section: Section, item: Item, data: Data | None) -> list[str]:
    lines = [f"## {item.title}", "", f"**Claim.** {item.claim}", ""]
    if data is None:
        return [*lines, f"Not computed yet: `polhode paper {item.name}`.", ""]
    verdict = item.verdict(data)
    place = f"{section.name}/{item.name}"
    tables = ", ".join(f"[{name or 'data'}]({place}{'-' if name else ''}{name}.csv)" for name in data)
    return [
        *lines,
        f"**Verdict: {verdict.word}.** {verdict.sentence}",
        "",
        markdown(["measured", "value", "verdict holds for"], [_row(number) for number in verdict.numbers]),
        f"![{item.title}]({place}.png)",
        "",
        f"*{item.caption(data)}*",
        "",
        f"Reproduce: `polhode paper {item.name}`. Data: {tables}; also [SVG]({place}.svg).",
        "",
    ]


def _row(number: Number) -> list[str]:
    return _cells(number.what, measured(number), allowed(number))


def _cells(*texts: str) -> list[str]:
    """Table cells; the bars of |L| would end them."""
    return [text.replace("|", "\\|") for text in texts]


def measured(number: Number) -> str:
    """The value with its interval and unit."""
    text = f"{number.value:.4g}"
    if number.interval is not None:
        low, high = number.interval
        text += f" (95 %: {low:.3g} … {high:.3g})"
    return f"{text} {number.unit}".rstrip()


def allowed(number: Number) -> str:
    """The range in which the verdict holds."""
    low, high = number.low, number.high
    if low == -float("inf"):
        return "any value" if high == float("inf") else f"≤ {high:.4g}"
    return f"≥ {low:.4g}" if high == float("inf") else f"{low:.4g} … {high:.4g}"


def _index(sections: Sequence[Section], data: dict[str, Data], stale: Sequence[str], grid: Grid) -> list[str]:
    lines = [
        "# The paper, reproduced",
        "",
        NOTICE,
        "",
        'Every figure and table of "The orientation dynamics of a massive ellipsoid in simple shear flow" '
        "(Vishwanathan, Gudda and Subramanian), computed anew, and some questions beyond it. "
        "`polhode paper` makes all of it again, `polhode paper ITEM…` single ones.",
        "",
        *(f"- *{word}*: {word.meaning}." for word in Word),
        "",
    ]
    if grid is not Grid.FULL:
        lines += ["**Made on the reduced grid: a look, not a result.**", ""]
    if stale:
        lines += [f"Made by older code, to be computed again: {', '.join(stale)}.", ""]
    for section in sections:
        rows = [_index_row(section, item, data.get(item.name)) for item in section.items]
        lines += [f"## [{section.title}]({section.name}.md)", ""]
        lines += [markdown(["item", "claim", "verdict", "number", "what was found"], rows)]
    return lines


def _index_row(section: Section, item: Item, data: Data | None) -> list[str]:
    name = f"[{item.name}]({section.name}.md#{_anchor(item.title)})"
    if data is None:
        return _cells(name, item.claim, "not computed", "", "")
    verdict: Verdict = item.verdict(data)
    first = verdict.numbers[0]
    return _cells(name, item.claim, verdict.word, f"{first.what}: {measured(first)}", verdict.sentence)


def _anchor(title: str) -> str:
    kept = (letter for letter in title.lower() if letter.isalnum() or letter in " -_")
    return "".join(kept).replace(" ", "-")
