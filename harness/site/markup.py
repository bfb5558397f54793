"""HTML: pages that hold all they need, so that no request leaves them."""

import json
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import cache
from html import escape
from importlib.resources import files
from math import isfinite
from typing import Any

# Nothing from elsewhere is ever loaded, whatever a page says: the browser itself sees to it.
POLICY = "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; img-src 'self' file: data:"
MARK = (
    '<svg class="mark" viewBox="0 0 40 40" aria-hidden="true"><circle cx="20" cy="20" r="17"/>'
    '<ellipse cx="20" cy="20" rx="17" ry="6" transform="rotate(-28 20 20)"/>'
    '<ellipse cx="20" cy="20" rx="9" ry="3.2" transform="rotate(-28 20 20)"/></svg>'
)


@dataclass(frozen=True)
class Page:
    """A page of the site.

    Parameters
    ----------
    name : str
        File name without its ending.
    title : str
    lead : str
        What it answers, in a sentence of plain text.
    body : str
        HTML.
    made_by : tuple of str
        The commands that make what it shows.
    data : dict
        What its scripts read, by element id.
    scripts : tuple of str
        File names, in order.
    """

    name: str
    title: str
    lead: str
    body: str
    made_by: tuple[str, ...] = ()
    data: dict[str, Any] = field(default_factory=dict)
    scripts: tuple[str, ...] = ("tables.js",)


def document(page: Page, pages: Sequence[tuple[str, str]], foot: str) -> str:
    """The complete page; `pages` are (name, title) of all of them."""
    links = "".join(
        f'<a href="{name}.html"{" aria-current=page" if name == page.name else ""}>{escape(title)}</a>'
        for name, title in pages
    )
    data = "".join(
        f'<script type="application/json" id="{key}">{_json(value)}</script>' for key, value in page.data.items()
    )
    scripts = "".join(f"<script>{asset(name)}</script>" for name in page.scripts)
    commands = "".join(f"<li><code>{escape(command)}</code></li>" for command in page.made_by)
    made = f'<section class="made"><h2>Make it again</h2><ul>{commands}</ul></section>' if commands else ""
    return (
        f'<!doctype html><html lang="en"><head><meta charset="utf-8"><title>{escape(page.title)} · polhode</title>'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        '<link rel="icon" href="data:,">'
        f"<style>{asset('site.css')}</style></head><body>"
        '<a class="skip" href="#main">Skip to the content</a>'
        f'<header><a class="name" href="index.html">{MARK}polhode</a><nav aria-label="Pages">{links}</nav></header>'
        f'<main id="main"><h1>{escape(page.title)}</h1><p class="lead">{prose(page.lead)}</p>'
        "<noscript><p class=note>Tables work without scripts, diagrams do not.</p></noscript>"
        f"{page.body}{made}</main><footer>{foot}</footer>{data}{scripts}</body></html>\n"
    )


@cache
def asset(name: str) -> str:
    """Text of a file that lies beside this module."""
    return (files("polhode.harness.site") / name).read_text(encoding="utf-8")


def table(header: Sequence[str], rows: Iterable[Sequence[str]], right: Sequence[int] = (), caption: str = "") -> str:
    """A table of plain text that scrolls sideways on its own and sorts by a click on its header."""

    def cell(tag: str, position: int, text: str) -> str:
        return f"<{tag}{' class=r' if position in right else ''}>{text}</{tag}>"

    head = "".join(cell("th", i, prose(text)) for i, text in enumerate(header))
    body = "".join("<tr>" + "".join(cell("td", i, prose(text)) for i, text in enumerate(row)) + "</tr>" for row in rows)
    title = f"<caption>{escape(caption)}</caption>" if caption else ""
    return scroll(f"<table class=sort>{title}<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>")


def scroll(content: str) -> str:
    """A region wider than a phone's screen, which scrolls by itself."""
    return f'<div class="scroll" tabindex="0" role="region" aria-label="table">{content}</div>'


def prose(text: str) -> str:
    """Plain text as HTML; what stands between backquotes as code, X_y with a subscript."""
    marked = re.sub(r"`([^`]+)`", r"<code>\1</code>", escape(text, quote=False))
    return re.sub(r"\b([A-Z])_(max|min|[xyz0-9])(?![a-z])", r"\1<sub>\2</sub>", marked)


def bullets(sentences: Iterable[str]) -> str:
    """A list of plain sentences."""
    return "<ul>" + "".join(f"<li>{prose(sentence)}</li>" for sentence in sentences) + "</ul>"


def missing(what: str, command: str) -> str:
    """Say what is not there yet, and how to make it."""
    return f'<p class="missing">{escape(what)} not there yet; to make: <code>{escape(command)}</code></p>'


def chart(key: str, caption: str) -> str:
    """Place of a diagram drawn from the page's data of that key; `caption` is plain text."""
    return f'<figure class="chart" data-chart="{key}"><figcaption>{prose(caption)}</figcaption></figure>'


def plain(value: Any) -> Any:
    """The value as JSON can hold it: numbers at six digits, None where they are not finite."""
    if isinstance(value, float):
        return float(f"{value:.6g}") if isfinite(value) else None
    if isinstance(value, dict):
        return {key: plain(each) for key, each in value.items()}
    return [plain(each) for each in value] if isinstance(value, list | tuple) else value


def _json(value: Any) -> str:
    return json.dumps(plain(value), separators=(",", ":"), ensure_ascii=False, allow_nan=False).replace("</", "<\\/")
