"""Tables and texts of pages, from the formats of their columns and the Markdown files in `texts`."""

import tomllib
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

from polhode.harness.common.files import write_file
from polhode.harness.common.machine import header
from polhode.harness.common.store import Record
from polhode.harness.common.text import WORDING, markdown

TEXTS = Path(__file__).parent / "texts"


def cells(rows: Iterable[Any], columns: Mapping[str, str]) -> list[list[str]]:
    """The text of every cell; rows are mappings, or have attributes."""
    return [[WORDING.vformat(text, (), row) for text in columns.values()] for row in rows]


def table(rows: Iterable[Any], columns: str | Mapping[str, str], left: int = 1, **fields: Any) -> str:
    """The rows as Markdown, all but the first `left` columns aligned right; a name is one of `texts/tables.toml`."""
    if isinstance(columns, str):
        known = _tables()[columns]
        columns, left = {WORDING.format(head, **fields): cell for head, cell in known["columns"].items()}, known["left"]
    return markdown([*columns], cells(rows, columns), right=range(left, len(columns)))


@cache
def _tables() -> dict[str, dict[str, Any]]:
    return tomllib.loads((TEXTS / "tables.toml").read_text(encoding="utf-8"))


def fill(name: str, **fields: Any) -> str:
    """The text of that name with its fields: numbers by their formats, several lines as a list of them."""
    lines = {key: "\n".join(value) if isinstance(value, list) else value for key, value in fields.items()}
    return WORDING.vformat((TEXTS / f"{name}.md").read_text(encoding="utf-8"), (), lines)


def lines_of(name: str, **fields: Any) -> list[str]:
    """The sentences of a text, which stand in a line each."""
    return fill(name, **fields).splitlines()


def bullets(sentences: Iterable[str]) -> str:
    """The sentences as a list."""
    return "\n".join(f"- {sentence}" for sentence in sentences)


def write(path: Path, name: str, title: str, command: str, records: Sequence[Record], **fields: Any) -> Path:
    """Write the page of the text of that name, its head from the records that were measured; returns its path."""
    write_file(path, fill(name, header=header(title, command, records), **fields))
    return path
