"""Numbers and tables as people read them."""

import re
import sys
import textwrap
from collections.abc import Sequence
from math import isnan
from shutil import get_terminal_size
from typing import Any

# Least width of a column that is wrapped.
NARROWEST = 30


def aligned(header: Sequence[str], rows: Sequence[Sequence[Any]]) -> str:
    """A table for the terminal: columns aligned, two spaces between them."""
    cells = [[str(cell) for cell in row] for row in (header, *rows)]
    widths = [max(len(row[i]) for row in cells) for i in range(len(header))]
    lines = ("  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in cells)
    return "\n".join(lines)


def on_terminal(header: Sequence[str], rows: Sequence[Sequence[Any]]) -> str:
    """As `aligned`, the last column wrapped where the standard output is a terminal too narrow for it."""
    if not sys.stdout.isatty():
        return aligned(header, rows)
    before = sum(2 + max(len(str(row[i])) for row in (header, *rows)) for i in range(len(header) - 1))
    width = max(NARROWEST, get_terminal_size().columns - before)
    wrapped: list[list[Any]] = []
    for *first, last in rows:
        lines = textwrap.wrap(str(last), width) or [""]
        wrapped += [[*first, lines[0]], *([*("" for _ in first), line] for line in lines[1:])]
    return aligned(header, wrapped)


def markdown(header: Sequence[str], rows: Sequence[Sequence[Any]], right: Sequence[int] = ()) -> str:
    """A Markdown table, columns aligned in the source too; `right` are the indices of right-aligned columns."""
    cells = [[str(cell) for cell in row] for row in (header, *rows)]
    widths = [max(3, *(len(row[i]) for row in cells)) for i in range(len(header))]

    def line(row: Sequence[str]) -> str:
        padded = [
            cell.rjust(w) if i in right else cell.ljust(w) for i, (cell, w) in enumerate(zip(row, widths, strict=True))
        ]
        return "| " + " | ".join(padded) + " |"

    rule = ["-" * (w - 1) + ":" if i in right else "-" * w for i, w in enumerate(widths)]
    return "\n".join([line(cells[0]), line(rule), *(line(row) for row in cells[1:])]) + "\n"


def scientific(value: float | None) -> str:
    """A number in two digits, as 1.3e-7; a dash where there is none."""
    if value is None or isnan(value):
        return "–"
    mantissa, exponent = f"{value:.1e}".split("e")
    return f"{mantissa}e{int(exponent)}"


def bracketed(value: float | None, known: bool | None) -> str:
    """A number as `scientific`, in brackets where the reference cannot tell it (`references.uncertainty`)."""
    text = scientific(value)
    return f"({text})" if known is False else text


def short(value: float) -> str:
    """A number in as few characters as tell it, in six digits at most: 1000, 0.5, 1e-8."""
    return _brief_exponent(f"{value:g}")


def in_full(value: float) -> str:
    """A number in all digits that it has: 0.01, 1e-6."""
    return _brief_exponent(repr(value)).removesuffix(".0")


def _brief_exponent(number: str) -> str:
    return re.sub(r"e([+-])0*", lambda sign: "e" + sign[1].strip("+"), number)


def in_two_digits(value: float) -> str:
    """A number that was interpolated or fitted, such as an St, in the digits that mean something: 5900, not 5.9e+03."""
    return short(float(f"{value:.2g}"))


def duration(seconds: float | None) -> str:
    """A duration in two digits with its unit; a dash where there is none."""
    if seconds is None or isnan(seconds):
        return "–"
    if seconds == 0:
        return "0 s"
    for unit, factor in (("s", 1.0), ("ms", 1e-3), ("µs", 1e-6), ("ns", 1e-9)):
        if seconds >= factor or unit == "ns":
            value = seconds / factor
            return f"{value:.0f} {unit}" if value >= 9.95 else f"{value:.1f} {unit}"
    raise AssertionError(seconds)
