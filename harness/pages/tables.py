"""Markdown tables whose columns are formats: header to the text of a cell, its fields those of a row."""

from collections.abc import Iterable, Mapping
from typing import Any

from polhode.harness.common.text import WORDING, markdown


def cells(rows: Iterable[Any], columns: Mapping[str, str]) -> list[list[str]]:
    """The text of every cell; rows are mappings, or have attributes."""
    return [[WORDING.vformat(text, (), row) for text in columns.values()] for row in rows]


def table(rows: Iterable[Any], columns: Mapping[str, str], left: int = 1) -> str:
    """The rows as Markdown, all but the first `left` columns aligned right."""
    return markdown([*columns], cells(rows, columns), right=range(left, len(columns)))
