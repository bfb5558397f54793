"""The paper's claims and what became of them."""

import shutil
from html import escape
from pathlib import Path

from polhode.harness.paper.catalogue import sections
from polhode.harness.paper.item import Data, Item, Section, Verdict, Word
from polhode.harness.paper.pages import allowed, measured
from polhode.harness.site.markup import Page, missing, prose, scroll, table
from polhode.harness.site.sources import Sources

LEAD = (
    "What “The orientation dynamics of a massive ellipsoid in simple shear flow” claims, computed anew: figure, "
    "numbers, verdict."
)
FIGURES = "figures"


def paper_page(sources: Sources) -> Page:
    """One block per item, by section."""
    found = sources.paper
    if not found:
        return Page("paper", "The paper's claims", LEAD, missing("The reproduction of the paper is", "polhode paper"))
    items = [item for section in sections() for item in section.items if item.name in found]
    verdicts = {item.name: item.verdict(found[item.name]) for item in items}
    counts = {word: sum(verdict.word is word for verdict in verdicts.values()) for word in Word}
    key = "".join(
        f'<span class="word {_class(word)}">{word}: {count}</span> {escape(word.meaning)}<br>'
        for word, count in counts.items()
    )
    rows = "".join(_line(item, verdicts[item.name]) for item in items)
    contents = f"<table class=contents><tbody>{rows}</tbody></table>"
    parts = [f"<p>{key}</p>", f"<details><summary>All {len(verdicts)} items</summary>{scroll(contents)}</details>"]
    for section in sections():
        parts.append(f"<h2>{escape(section.title)}</h2>")
        parts += [_item(sources.folder, section, item, found.get(item.name)) for item in section.items]
    return Page("paper", "The paper's claims", LEAD, "".join(parts), ("polhode paper",))


def _line(item: Item, verdict: Verdict) -> str:
    word = f'<span class="word {_class(verdict.word)}">{verdict.word}</span>'
    return f'<tr><td><a href="#{item.name}">{prose(item.title)}</a></td><td>{word}</td></tr>'


def _item(folder: Path, section: Section, item: Item, data: Data | None) -> str:
    claim = f"<h3>{prose(item.title)}</h3><p><b>Claim.</b> {prose(item.claim)}</p>"
    title = f'<article class="claim" id="{item.name}">{claim}'
    if data is None:
        return title + missing("This item is", f"polhode paper {item.name}") + "</article>"
    verdict = item.verdict(data)
    rows = [[number.what, measured(number), allowed(number)] for number in verdict.numbers]
    picture = (
        f'<figure><img src="{FIGURES}/{item.name}.png" alt="{escape(item.title)}">'
        f"<figcaption>{prose(verdict.caption)}</figcaption></figure>"
        if picture_of(folder, section, item).is_file()
        else missing("Its figure is", f"polhode paper {item.name}")
    )
    return (
        f'{title}<p><span class="word {_class(verdict.word)}">{verdict.word}</span> {prose(verdict.sentence)}</p>'
        f"{table(['measured', 'value', 'verdict holds for'], rows)}{picture}"
        f"<p class=note><code>polhode paper {item.name}</code></p></article>"
    )


def _class(word: Word) -> str:
    return str(word).replace(" ", "-")


def picture_of(folder: Path, section: Section, item: Item) -> Path:
    """Where an item's figure lies."""
    return folder / "paper" / section.name / f"{item.name}.png"


def copy_figures(sources: Sources, out: Path) -> None:
    """Copy the items' figures beside the pages."""
    (out / FIGURES).mkdir(parents=True, exist_ok=True)
    for section in sections():
        for item in section.items:
            picture = picture_of(sources.folder, section, item)
            if item.name in sources.paper and picture.is_file():
                shutil.copyfile(picture, out / FIGURES / picture.name)
