"""HTML of the site's interactive pages, and the notation of plain text."""

import json
import re
from dataclasses import dataclass, field
from html import escape
from math import isfinite
from pathlib import Path
from typing import Any

from markupsafe import Markup

from polhode.harness.pages.tables import templates

# Power of ten up to which a number with an exponent is written out, if its digits go so far: 1.7e+02 as 170.
# From 1e5 on zeros have to be counted.
_LARGEST_WRITTEN_OUT = 4
# Significant digits of the numbers in a page's data: more than a picture shows. Fewer make the page
# smaller.
DATA_DIGITS = 4


@dataclass(frozen=True)
class Page:
    """An interactive page; the template `interactive.html` joins body, data and scripts."""

    title: str
    lead: str  # Markdown: what the page answers, in a sentence
    body: str  # HTML
    # Data of the scripts, by the id of the element that holds it: anything that `plain` takes.
    data: dict[str, Any] = field(default_factory=dict)
    scripts: tuple[str, ...] = ()  # JavaScript files of this folder, in the order of loading


def html(name: str, /, **fields: Any) -> str:
    """The template `NAME.html` beside this module with its fields; a missing field is an error of Jinja's.

    Fields are escaped. Templates have the filters of `templates`, and of this module "prose" and
    "json".
    """
    environment = templates(Path(__file__).parent, autoescape=True)
    environment.filters |= {"prose": prose, "json": _json}
    return environment.get_template(f"{name}.html").render(fields)


def prose(text: str) -> Markup:
    """Plain text as HTML: `code` between backticks, and the rest in `notation`."""
    # Quotes may stand in text as they are. Parts at odd places stood between backticks.
    parts = re.split(r"`([^`]+)`", escape(text, quote=False))
    return Markup("").join(
        Markup(f"<code>{part}</code>" if i % 2 else notation(part)) for i, part in enumerate(parts)
    )


def notation(text: str) -> str:
    """Escaped text with X_y and Lx as subscripts, x^y raised, and numbers as people write them.

    Escaped text is what stands between tags of HTML; `test_notation` has examples. Class n of the
    style sheet (`site.css`) keeps numbers and dates in one line.
    """
    # Numbers with an exponent, but not within names such as rest-5e4.
    text = re.sub(r"(?<![\w.-])([-−]?\d+(?:\.\d+)?)e([+-]?)0*(\d+)\b", _number, text)
    # A capital has as subscript max, min, a digit, or one or two letters, perhaps with a digit:
    # I_max, L_z0.
    text = re.sub(
        r"(?<![A-Za-z_])([A-Z])_(max|min|[a-z]{1,2}\d?|\d)(?![a-z])", r"\1<sub>\2</sub>", text
    )
    text = re.sub(r"\b\d{4}-\d\d-\d\d\b", r"<span class=n>\g<0></span>", text)
    text = re.sub(r"\bL([xyz])\b", r"L<sub>\1</sub>", text)
    # The exponent stands in brackets, which go, or is one number or word; after a minus it may be a
    # quotient: St^(-0.5), St^p, St^-1/2.
    return re.sub(
        r"(?<=\w)\^(?:\(([^()]*)\)|([-−]\w+(?:[/.]\d+)?|\w+(?:\.\d+)?))", r"<sup>\1\2</sup>", text
    )


def _number(match: re.Match[str]) -> str:
    """A number that a line does not break: 1.7e+02 as 170, 1e-06 as 1e-6."""
    mantissa, sign, exponent = match.groups()
    # Written out if that is a whole number, and its exponent is not too large.
    digits = len(mantissa.partition(".")[2])
    if sign != "-" and digits <= int(exponent) <= _LARGEST_WRITTEN_OUT:
        return f"{float(match[0].replace('−', '-')):.0f}"
    return f"<span class=n>{mantissa}e{sign.strip('+')}{exponent}</span>"


def plain(value: Any) -> Any:
    """The value as JSON can hold it: numbers rounded to `DATA_DIGITS`, whole ones exact, None where not finite.

    Dictionaries, lists and tuples are gone through; other values, such as text, stay.
    """
    if isinstance(value, float):
        if not isfinite(value):
            return None
        return round(value) if value == round(value) else float(f"{value:.{DATA_DIGITS}g}")
    if isinstance(value, dict):
        return {key: plain(item) for key, item in value.items()}
    return [plain(item) for item in value] if isinstance(value, list | tuple) else value


def _json(value: Any) -> Markup:
    """`plain` data as JSON within a page: short, and without "<", which would end or begin an element."""
    text = json.dumps(plain(value), separators=(",", ":"), ensure_ascii=False, allow_nan=False)
    # Python writes 1e-05.
    text = re.sub(r"(?<=\de)-0(?=\d[,\]}])", "-", text)
    return Markup(text.replace("<", "\\u003c"))


def section(text: str, heading: str) -> str:
    """Text of a Markdown page below a heading of level two, down to the next heading; empty if none.

    Any line that begins with "#" counts as the next heading, even one within code.
    """
    match = re.search(rf"^## {re.escape(heading)}\n(.*?)(?=^#|\Z)", text, re.MULTILINE | re.DOTALL)
    return match[1] if match else ""
