"""Tables and texts of pages: tables by the formats of their columns, texts from the Markdown files in `texts`."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from polhode.harness.common.text import WORDING, markdown

TEXTS = Path(__file__).parent / "texts"


def cells(rows: Iterable[Any], columns: Mapping[str, str]) -> list[list[str]]:
    """The text of every cell; rows are mappings, or have attributes."""
    return [[WORDING.vformat(text, (), row) for text in columns.values()] for row in rows]


def table(rows: Iterable[Any], columns: Mapping[str, str], left: int = 1) -> str:
    """The rows as Markdown, all but the first `left` columns aligned right."""
    return markdown([*columns], cells(rows, columns), right=range(left, len(columns)))


def fill(name: str, **fields: Any) -> str:
    """The text of that name with its fields: numbers by their formats, several lines as a list of them."""
    lines = {key: "\n".join(value) if isinstance(value, list) else value for key, value in fields.items()}
    return WORDING.vformat((TEXTS / f"{name}.md").read_text(encoding="utf-8"), (), lines)


def bullets(sentences: Iterable[str]) -> str:
    """The sentences as a list."""
    return "\n".join(f"- {sentence}" for sentence in sentences)
