"""Markdown tables whose columns are formats: header to the text of a cell, its fields those of a row."""

from collections.abc import Iterable, Mapping, Sequence
from math import isnan
from string import Formatter
from typing import Any

from polhode.harness.common.text import duration, in_two_digits, markdown, scientific, short


def _two(value: float) -> str:
    return "–" if isnan(value) else in_two_digits(value)


# Formats of fields beside Python's own, as in "{seconds:time}".
WORDS = {"error": scientific, "time": duration, "number": short, "two": _two}


class _Cell(Formatter):
    def get_value(self, key: int | str, args: Sequence[Any], kwargs: Mapping[str, Any]) -> Any:
        row = args[0]
        return row[key] if isinstance(row, Mapping) else getattr(row, str(key))

    def format_field(self, value: Any, format_spec: str) -> str:
        return WORDS[format_spec](value) if format_spec in WORDS else super().format_field(value, format_spec)


def cells(rows: Iterable[Any], columns: Mapping[str, str]) -> list[list[str]]:
    """The text of every cell; rows are mappings, or have attributes."""
    return [[_Cell().vformat(text, (row,), {}) for text in columns.values()] for row in rows]


def table(rows: Iterable[Any], columns: Mapping[str, str], left: int = 1) -> str:
    """The rows as Markdown, all but the first `left` columns aligned right."""
    return markdown([*columns], cells(rows, columns), right=range(left, len(columns)))
