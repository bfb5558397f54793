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
    """The rows as Markdown, by one of `texts/tables.toml`; `fields` fill the headings.

    All columns but the first are right-aligned, unless the table says "right" or "left".
    """
    spec = _TABLES[name]
    columns = {WORDING.format(head, **fields): cell for head, cell in columns_of(name).items()}
    right = spec["right"] if "right" in spec else range(spec.get("left", 1), len(columns))
    return markdown([*columns], cells(rows, columns), right=right)


def columns_of(name: str) -> dict[str, str]:
    """Headings and cells of one of `texts/tables.toml`."""
    return {head: cell for head, cell in _TABLES[name].items() if head not in ("left", "right")}


@cache
def templates(folder: Path, **options: Any) -> Environment:
    """The templates of a folder; numbers by the formats of `WORDING` or Python's own: ``{{ x|form(".2f") }}``."""
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
    """Several values with commas."""
    return (
        ", ".join(map(str, value))
        if isinstance(value, Collection) and not isinstance(value, str)
        else value
    )


def fill(name: str, /, **fields: Any) -> str:
    """The text of that name with its fields."""
    return templates(_TEXTS).get_template(f"{name}.md").render(fields)


def lines_of(name: str, /, **fields: Any) -> list[str]:
    """The sentences of a text, which stand in a line each."""
    return fill(name, **fields).splitlines()


def bullets(sentences: Iterable[str]) -> str:
    """The sentences as a list."""
    return "\n".join(f"- {sentence}" for sentence in sentences)


def folded(lines: Iterable[str] | str, summary: str = "How this page was made") -> str:
    """The lines below a line that opens and closes them."""
    text = lines if isinstance(lines, str) else "\n".join(lines)
    return f"<details>\n<summary>{summary}</summary>\n\n{text.strip()}\n\n</details>"
