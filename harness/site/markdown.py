"""The Markdown pages of `reports` as pages of the site."""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache
from html import escape
from pathlib import Path, PurePosixPath
from typing import Any

from markdown_it import MarkdownIt
from markdown_it.token import Token

from polhode.harness.site.markup import notation, scroll

# Columns beyond which a table is set smaller in print.
WIDE = 9
FIGURES = "figures"


@dataclass
class Rendered:
    """Title, HTML and pictures, by their names on the site, of a Markdown page."""

    title: str
    body: str
    pictures: dict[str, Path] = field(default_factory=dict)


def page_name(path: Path) -> str:
    """Name on the site of `reports/NAME/README.md`: NAME; of other pages beside it, NAME-STEM."""
    return path.parent.name if path.stem == "README" else f"{path.parent.name}-{path.stem}"


def section(text: str, heading: str) -> str:
    """What stands below a heading of the second level, down to the next heading; empty if there is none."""
    found = re.search(rf"^## {re.escape(heading)}\n(.*?)(?=^#|\Z)", text, re.MULTILINE | re.DOTALL)
    return found[1] if found else ""


def render(text: str, path: Path, known: Mapping[Path, str], drawn: Callable[[str], str] = lambda _: "") -> Rendered:
    """Render the Markdown of a file, to which links and pictures are relative.

    `known` holds the address on the site of each Markdown page; links elsewhere become plain text. `drawn` gives HTML
    in place of the picture of that name; where it is empty the picture stays.
    """
    tokens = _parser().parse(text)
    found = Rendered("", "")
    if tokens and tokens[0].tag == "h1":
        found.title, tokens = tokens[1].content, tokens[3:]
    heading, tables = found.title, 0
    for i, token in enumerate(tokens):
        if token.type == "heading_open":
            heading = tokens[i + 1].content
            token.attrSet("id", _slug(heading))
        elif token.type in ("th_open", "td_open") and "right" in str(token.attrs.pop("style", "")):
            token.attrSet("class", "r")
            # Numbers in these cells do not break anyway.
            tokens[i + 1].meta["plain"] = True
        elif token.type == "table_open":
            columns = next(j for j, other in enumerate(tokens[i:]) if other.type == "thead_close")
            wide = sum(other.type == "th_open" for other in tokens[i : i + columns]) > WIDE
            token.attrSet("class", "sort wide" if wide else "sort")
            tables += 1
            token.meta["label"] = f"Table {tables}: {heading}"
        elif token.type == "inline":
            children = token.children or []
            for child in children:
                child.type = "plain" if child.type == "text" and token.meta else child.type
            _links(children, path, known)
            if [child.type for child in children] == ["image"]:
                html = drawn(str(children[0].attrs["src"])) or _figure(children[0], path, found)
                token.children = [Token("html_inline", "", 0, content=html)]
                tokens[i - 1].hidden = tokens[i + 1].hidden = True
    found.body = _parser().renderer.render(tokens, _parser().options, {})
    return found


def _links(children: list[Token], path: Path, known: Mapping[Path, str]) -> None:
    """Point links at the pages of the site; those that lead elsewhere lose their tags."""
    kept = True
    for child in children:
        if child.type == "link_open":
            target, _, part = str(child.attrs["href"]).partition("#")
            address = known.get((path.parent / target).resolve(), "") if target else ""
            kept = bool(address or not target)
            child.attrSet("href", f"{address}#{part}" if part else address)
        if child.type.startswith("link_") and not kept:
            child.type = "text"


def _figure(picture: Token, path: Path, found: Rendered) -> str:
    source = path.parent / PurePosixPath(str(picture.attrs["src"]))
    if not source.is_file():
        return f"<p>{escape(picture.content)}</p>"
    name = f"{page_name(path)}-{source.stem}.webp"
    found.pictures[name] = source
    return f'<figure><img src="{FIGURES}/{name}" alt="{escape(picture.content)}"></figure>'


def _slug(heading: str) -> str:
    """Anchor of a heading, as GitHub makes it."""
    return re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")


@cache
def _parser() -> MarkdownIt:
    parser = MarkdownIt("commonmark", {"html": False}).enable("table")

    def text(_: Any, tokens: list[Token], i: int, *__: Any) -> str:
        return notation(escape(tokens[i].content, quote=False))

    def table_open(renderer: Any, tokens: list[Token], i: int, options: Any, __: Any) -> str:
        opening = scroll("\0", tokens[i].meta["label"]).partition("\0")[0]
        return opening + renderer.renderToken(tokens, i, options, {})

    parser.add_render_rule("text", text)
    parser.add_render_rule("plain", lambda _, tokens, i, *__: escape(tokens[i].content, quote=False))
    parser.add_render_rule("table_open", table_open)
    parser.add_render_rule("table_close", lambda *_: "</table></div>")
    return parser
