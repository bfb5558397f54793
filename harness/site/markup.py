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
# Powers of ten up to which a number is written out.
PLAIN = 5
# Columns beyond which a table is set smaller in print.
WIDE = 9
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
    origins : tuple of str
        When and on which machine that was measured, in sentences of plain text.
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
    origins: tuple[str, ...] = ()
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
    origins = "".join(f"<p class=note>{prose(origin)}</p>" for origin in page.origins)
    heading = f"<h2>Make it again</h2><ul>{commands}</ul>" if commands else "<h2>Where it comes from</h2>"
    made = f'<section class="made">{heading}{origins}</section>' if commands or origins else ""
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
    kind = '"sort wide"' if len(header) > WIDE else "sort"
    return scroll(f"<table class={kind}>{title}<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>")


def scroll(content: str, *, tall: bool = False) -> str:
    """A region wider than a phone's screen, which scrolls by itself; a tall one keeps its head in sight too."""
    kind = "scroll tall" if tall else "scroll"
    return f'<div class="{kind}" tabindex="0" role="region" aria-label="table">{content}</div>'


def prose(text: str) -> str:
    """Plain text as HTML: `code`, *words*, X_y and Lx with a subscript, x^y raised, numbers as people write them."""
    parts = re.split(r"`([^`]+)`", escape(text, quote=False))
    return "".join(f"<code>{part}</code>" if i % 2 else _notation(part) for i, part in enumerate(parts))


def _notation(text: str) -> str:
    text = re.sub(r"(?<![\w.-])([-−]?\d+(?:\.\d+)?)e([+-]?)0*(\d+)\b", _number, text)
    text = re.sub(r"\b([A-Z])_(max|min|[a-z]{1,2}\d?|\d)(?![a-z])", r"\1<sub>\2</sub>", text)
    text = re.sub(r"\b\d{4}-\d\d-\d\d\b", r"<span class=n>\g<0></span>", text)
    text = re.sub(r"\bL([xyz])\b", r"L<sub>\1</sub>", text)
    text = re.sub(r"(?<=\w)\^(?:\(([^()]*)\)|([-−]\w+(?:/\d+)?|\w+))", r"<sup>\1\2</sup>", text)
    return re.sub(r"(?<!\w)\*([^*\s][^*]*)\*", r"<em>\1</em>", text)


def _number(found: re.Match[str]) -> str:
    """A number that a line does not break: 1.7e+02 as 170, 1e-06 as 1e-6."""
    mantissa, sign, exponent = found.groups()
    digits = len(mantissa.partition(".")[2])
    if sign != "-" and digits <= int(exponent) <= PLAIN:
        return f"{float(found[0].replace('−', '-')):.0f}"
    return f"<span class=n>{mantissa}e{sign.strip('+')}{exponent}</span>"


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
