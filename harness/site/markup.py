"""HTML: pages that need nothing but the files beside them, so that no request leaves the folder."""

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from html import escape
from math import isfinite
from pathlib import Path
from typing import Any

from polhode.harness.common.text import WORDING

# Powers of ten up to which a number is written out.
PLAIN = 5
# Nothing from elsewhere is ever loaded, whatever a page says: its policy sees to it.
SKELETON = Path(__file__).parent / "page.html"


@dataclass(frozen=True)
class Page:
    """A page of the site: what it answers in a sentence, HTML, data of its scripts by element id, and their files."""

    title: str
    lead: str
    body: str
    data: dict[str, Any] = field(default_factory=dict)
    scripts: tuple[str, ...] = ("tables.js",)


def document(name: str, page: Page, menu: Mapping[str, str], foot: str) -> str:
    """The complete page of that file name; `menu` names the pages that every page links to."""
    # A page of a folder that holds several belongs to the entry of the folder.
    current = name if name in menu else name.partition("-")[0]
    links = "".join(
        f'<a href="{other}.html"{" aria-current=page" if other == current else ""}>{escape(title)}</a>'
        for other, title in menu.items()
    )
    data = "".join(
        f'<script type="application/json" id="{key}">{_json(value)}</script>' for key, value in page.data.items()
    )
    scripts = "".join(f'<script src="{script}"></script>' for script in page.scripts)
    return (
        WORDING.format(
            SKELETON.read_text(encoding="utf-8").replace("\n", ""),
            name=escape(page.title.replace("`", "")),
            links=links,
            title=prose(page.title),
            lead=f'<p class="lead">{prose(page.lead)}</p>' if page.lead else "",
            page=page,
            foot=foot,
            data=data,
            scripts=scripts,
        )
        + "\n"
    )


def scroll(content: str, label: str) -> str:
    """A region wider than a phone's screen, which scrolls by itself; its label is the page's only one of that name."""
    return f'<div class="scroll" tabindex="0" role="region" aria-label="{escape(label)}">{content}</div>'


def prose(text: str) -> str:
    """Plain text as HTML: `code`, and the rest in `notation`."""
    parts = re.split(r"`([^`]+)`", escape(text, quote=False))
    return "".join(f"<code>{part}</code>" if i % 2 else notation(part) for i, part in enumerate(parts))


def notation(text: str) -> str:
    """Escaped text with X_y and Lx as subscripts, x^y raised, and numbers as people write them."""
    text = re.sub(r"(?<![\w.-])([-−]?\d+(?:\.\d+)?)e([+-]?)0*(\d+)\b", _number, text)
    text = re.sub(r"\b([A-Z])_(max|min|[a-z]{1,2}\d?|\d)(?![a-z])", r"\1<sub>\2</sub>", text)
    text = re.sub(r"\b\d{4}-\d\d-\d\d\b", r"<span class=n>\g<0></span>", text)
    text = re.sub(r"\bL([xyz])\b", r"L<sub>\1</sub>", text)
    return re.sub(r"(?<=\w)\^(?:\(([^()]*)\)|([-−]\w+(?:/\d+)?|\w+))", r"<sup>\1\2</sup>", text)


def _number(found: re.Match[str]) -> str:
    """A number that a line does not break: 1.7e+02 as 170, 1e-06 as 1e-6."""
    mantissa, sign, exponent = found.groups()
    digits = len(mantissa.partition(".")[2])
    if sign != "-" and digits <= int(exponent) <= PLAIN:
        return f"{float(found[0].replace('−', '-')):.0f}"
    return f"<span class=n>{mantissa}e{sign.strip('+')}{exponent}</span>"


def missing(what: str, command: str) -> str:
    """Say what is not there yet, and how to make it."""
    return f'<p class="missing">{escape(what)} not there yet; to make: <code>{escape(command)}</code></p>'


def plain(value: Any) -> Any:
    """The value as JSON can hold it: numbers at four digits, None where they are not finite."""
    if isinstance(value, float):
        return (round(value) if value == round(value) else float(f"{value:.4g}")) if isfinite(value) else None
    if isinstance(value, dict):
        return {key: plain(each) for key, each in value.items()}
    return [plain(each) for each in value] if isinstance(value, list | tuple) else value


def _json(value: Any) -> str:
    return json.dumps(plain(value), separators=(",", ":"), ensure_ascii=False, allow_nan=False).replace("<", "\\u003c")
