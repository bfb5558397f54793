"""HTML of pages that need nothing but the files beside them, so that no request leaves the folder; and of Markdown."""

import json
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache
from html import escape
from math import isfinite
from pathlib import Path, PurePosixPath
from typing import Any

from markdown_it import MarkdownIt
from markdown_it.token import Token
from markupsafe import Markup

from polhode.harness.pages.tables import templates

# Powers of ten up to which a number is written out.
_PLAIN = 5
# Columns beyond which a table is set smaller in print.
_WIDE = 9
FIGURES = "figures"
# Pages of the site that are no report's.
_OWN = ("index", "cost", "motion")


@dataclass(frozen=True)
class Page:
    """A page of the site: what it answers in a sentence, HTML, data of its scripts by element id, and their files."""

    title: str
    lead: str
    body: str
    data: dict[str, Any] = field(default_factory=dict)
    scripts: tuple[str, ...] = ("tables.js",)


def html(name: str, /, **fields: Any) -> str:
    """The template of that name with its fields."""
    environment = templates(Path(__file__).parent, autoescape=True)
    environment.filters |= {"prose": prose, "json": _json}
    return environment.get_template(f"{name}.html").render(fields)


def document(name: str, page: Page, menu: Mapping[str, str], foot: str) -> str:
    """The complete page of that file name; `menu` names the pages that every page links to."""
    # A page of a folder that holds several belongs to the entry of the folder.
    current = name if name in menu else name.partition("-")[0]
    return html("page", page=page, menu=menu, foot=foot, current=current)


def prose(text: str) -> Markup:
    """Plain text as HTML: `code`, and the rest in `notation`."""
    parts = re.split(r"`([^`]+)`", escape(text, quote=False))
    return Markup("").join(
        Markup(f"<code>{part}</code>" if i % 2 else notation(part)) for i, part in enumerate(parts)
    )


def notation(text: str) -> str:
    """Escaped text with X_y and Lx as subscripts, x^y raised, and numbers as people write them."""
    text = re.sub(r"(?<![\w.-])([-−]?\d+(?:\.\d+)?)e([+-]?)0*(\d+)\b", _number, text)
    text = re.sub(
        r"(?<![A-Za-z_])([A-Z])_(max|min|[a-z]{1,2}\d?|\d)(?![a-z])", r"\1<sub>\2</sub>", text
    )
    text = re.sub(r"\b\d{4}-\d\d-\d\d\b", r"<span class=n>\g<0></span>", text)
    text = re.sub(r"\bL([xyz])\b", r"L<sub>\1</sub>", text)
    return re.sub(
        r"(?<=\w)\^(?:\(([^()]*)\)|([-−]\w+(?:[/.]\d+)?|\w+(?:\.\d+)?))", r"<sup>\1\2</sup>", text
    )


def _number(match: re.Match[str]) -> str:
    """A number that a line does not break: 1.7e+02 as 170, 1e-06 as 1e-6."""
    mantissa, sign, exponent = match.groups()
    digits = len(mantissa.partition(".")[2])
    if sign != "-" and digits <= int(exponent) <= _PLAIN:
        return f"{float(match[0].replace('−', '-')):.0f}"
    return f"<span class=n>{mantissa}e{sign.strip('+')}{exponent}</span>"


def plain(value: Any) -> Any:
    """The value as JSON can hold it: numbers at four digits, None where they are not finite."""
    if isinstance(value, float):
        if not isfinite(value):
            return None
        return round(value) if value == round(value) else float(f"{value:.4g}")
    if isinstance(value, dict):
        return {key: plain(item) for key, item in value.items()}
    return [plain(item) for item in value] if isinstance(value, list | tuple) else value


def _json(value: Any) -> Markup:
    text = json.dumps(plain(value), separators=(",", ":"), ensure_ascii=False, allow_nan=False)
    return Markup(text.replace("<", "\\u003c"))


@dataclass
class Rendered:
    """Title, HTML and pictures, by their names on the site, of a Markdown page."""

    title: str
    body: str
    pictures: dict[str, Path] = field(default_factory=dict)


def page_name(path: Path) -> str:
    """Name on the site of `reports/NAME/README.md`: NAME, NAME_ where that is taken; of pages beside it, NAME-STEM."""
    name = path.parent.name + "_" * (path.parent.name in _OWN)
    return name if path.stem == "README" else f"{name}-{path.stem}"


def section(text: str, heading: str) -> str:
    """Text below a heading of the second level, down to the next heading; empty if there is none."""
    match = re.search(rf"^## {re.escape(heading)}\n(.*?)(?=^#|\Z)", text, re.MULTILINE | re.DOTALL)
    return match[1] if match else ""


def render(
    text: str, path: Path, addresses: Mapping[Path, str], drawn: Callable[[str], str] = lambda _: ""
) -> Rendered:
    """Render the Markdown of a file, to which links and pictures are relative.

    `addresses` holds the address on the site of each Markdown page; links elsewhere become plain text.
    `drawn` gives HTML in place of the picture of that name; where it is empty the picture stays.
    """
    tokens = _parser().parse(text)
    rendered = Rendered("", "")
    if tokens and tokens[0].tag == "h1":
        rendered.title = tokens[1].content
        tokens = tokens[3:]
    heading = rendered.title
    tables = 0
    for i, token in enumerate(tokens):
        if token.type == "heading_open":
            heading = tokens[i + 1].content
            # The anchor that GitHub makes of it.
            token.attrSet("id", re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-"))
        elif token.type in ("th_open", "td_open") and "right" in str(token.attrs.pop("style", "")):
            token.attrSet("class", "r")
            # Numbers in these cells do not break anyway.
            tokens[i + 1].meta["plain"] = True
        elif token.type == "table_open":
            columns = next(j for j, cell in enumerate(tokens[i:]) if cell.type == "thead_close")
            wide = sum(cell.type == "th_open" for cell in tokens[i : i + columns]) > _WIDE
            token.attrSet("class", "sort wide" if wide else "sort")
            tables += 1
            token.meta["label"] = f"Table {tables}: {heading}"
        elif token.type == "inline":
            children = token.children or []
            for child in children:
                child.type = "plain" if child.type == "text" and token.meta else child.type
            _links(children, path, addresses)
            if [child.type for child in children] == ["image"]:
                html = drawn(str(children[0].attrs["src"])) or _figure(children[0], path, rendered)
                token.children = [Token("html_inline", "", 0, content=html)]
                tokens[i - 1].hidden = tokens[i + 1].hidden = True
    rendered.body = _parser().renderer.render(tokens, _parser().options, {})
    return rendered


def _links(children: list[Token], path: Path, addresses: Mapping[Path, str]) -> None:
    """Point links at the pages of the site; those that lead elsewhere lose their tags."""
    kept = True
    for child in children:
        if child.type == "link_open":
            target, _, part = str(child.attrs["href"]).partition("#")
            address = addresses.get((path.parent / target).resolve(), "") if target else ""
            kept = bool(address or not target)
            child.attrSet("href", f"{address}#{part}" if part else address)
        if child.type.startswith("link_") and not kept:
            child.type = "text"


def _figure(picture: Token, path: Path, rendered: Rendered) -> str:
    source = path.parent / PurePosixPath(str(picture.attrs["src"]))
    if not source.is_file():
        return f"<p>{escape(picture.content)}</p>"
    name = f"{page_name(path)}-{source.stem}.webp"
    rendered.pictures[name] = source
    return f'<figure><img src="{FIGURES}/{name}" alt="{escape(picture.content)}"></figure>'


@cache
def _parser() -> MarkdownIt:
    parser = MarkdownIt("commonmark", {"html": False}).enable("table")

    def text(_: Any, tokens: list[Token], i: int, *__: Any) -> str:
        return notation(escape(tokens[i].content, quote=False))

    def table_open(renderer: Any, tokens: list[Token], i: int, options: Any, __: Any) -> str:
        # Wider than a phone's screen, it scrolls by itself; the label is the page's only one of
        # that name.
        region = f'<div class="scroll" tabindex="0" role="region" aria-label="{escape(tokens[i].meta["label"])}">'
        return region + renderer.renderToken(tokens, i, options, {})

    parser.add_render_rule("text", text)
    parser.add_render_rule(
        "plain", lambda _, tokens, i, *__: escape(tokens[i].content, quote=False)
    )
    parser.add_render_rule("table_open", table_open)
    parser.add_render_rule("table_close", lambda *_: "</table></div>")
    return parser
