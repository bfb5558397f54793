"""Tables and texts of pages, from the formats of their columns and the templates in `texts`.

A template is Markdown with Jinja's fields; a missing field is an error. Filters are functions that
templates call, as in ``{{ rows|table("regimes-methods") }}``. A table of `texts/tables.toml` names its columns
by heading, each with the format of its cells.
"""

import tomllib
from collections.abc import Collection, Iterable
from functools import cache, partial
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from polhode.harness.common.text import FORMATS, WORDING, cells, markdown

_TEXTS = Path(__file__).parent / "texts"
_TABLES = tomllib.loads((_TEXTS / "tables.toml").read_text(encoding="utf-8"))


def table(rows: Iterable[Any], name: str, /, **fields: Any) -> str:
    """The rows as a Markdown table, by the columns of one of `texts/tables.toml`; `fields` fill the headings.

    Columns are right-aligned, but for the first. A table may say how many of the first columns are
    left-aligned ("left"), or give the places of those that are right-aligned ("right"). Headings must differ: a
    blank at the end of one makes it differ, and does not show on the page.

    Raises
    ------
    KeyError
        `texts/tables.toml` has no table of that name, or a mapping or `fields` lack a name.
    AttributeError
        An object lacks an attribute that the table names.
    """
    spec = _TABLES[name]
    columns = {WORDING.format(head, **fields): cell for head, cell in columns_of(name).items()}
    right = spec["right"] if "right" in spec else range(spec.get("left", 1), len(columns))
    return markdown([*columns], cells(rows, columns), right=right)


def columns_of(name: str) -> dict[str, str]:
    """Formats of cells by heading, of a table of `texts/tables.toml`; KeyError if there is none of that name."""
    return {head: cell for head, cell in _TABLES[name].items() if head not in ("left", "right")}


@cache
def templates(folder: Path, **options: Any) -> Environment:
    """The templates of a folder, with the filters of the house.

    Each name of `FORMATS` is a filter: ``{{ x|short }}``. "form" takes such a name or a format of
    Python: ``{{ x|form(".2f") }}``. `options` go to `jinja2.Environment`, but for
    the four that are set here.
    """
    options |= {
        "undefined": StrictUndefined,
        "trim_blocks": True,
        "lstrip_blocks": True,
        "keep_trailing_newline": True,
    }
    environment = Environment(loader=FileSystemLoader(folder), finalize=_listed, **options)
    environment.filters |= {
        name: partial(WORDING.format_field, format_spec=name) for name in FORMATS
    }
    environment.filters |= {
        "form": WORDING.format_field,
        "bullets": bullets,
        "lines": "\n".join,
        "folded": folded,
        "table": table,
    }
    return environment


def _listed(value: Any) -> Any:
    """The value of a field as a text shows it: several values joined by commas, or the one as it is."""
    return (
        ", ".join(map(str, value))
        if isinstance(value, Collection) and not isinstance(value, str)
        else value
    )


def fill(name: str, /, **fields: Any) -> str:
    """The text `texts/NAME.md` with its fields.

    A field may be a module, of which a text reads public constants: ``{{ limits.NEAR }}`` with `limits=heldout`.

    Raises
    ------
    jinja2.UndefinedError
        The text has a field that is not given.
    """
    return templates(_TEXTS).get_template(f"{name}.md").render(fields)


def lines_of(name: str, /, **fields: Any) -> list[str]:
    """The lines of a text, as `fill` makes it: each is a sentence or two about one thing."""
    return fill(name, **fields).splitlines()


def bullets(sentences: Iterable[str]) -> str:
    """The sentences as a list of Markdown."""
    return "\n".join(f"- {sentence}" for sentence in sentences)


def folded(lines: Iterable[str] | str, summary: str = "How this page was made") -> str:
    """The lines in HTML that a reader unfolds; `summary` is what stands there while they are folded."""
    text = lines if isinstance(lines, str) else "\n".join(lines)
    return f"<details>\n<summary>{summary}</summary>\n\n{text.strip()}\n\n</details>"
