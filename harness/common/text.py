"""Numbers and tables as people read them: one convention for tables, figures, terminal and site.

Powers of ten are plain: 1e-4, neither 1e-04 nor 0.0001 nor 10⁻⁴; a number below 1e-3 or from 1e5 on
has an exponent, a measured size in two digits (`scientific`) always has one.
Fields of texts have the functions as formats, as in "{seconds:time}": `WORDING`.
"""

import sys
import textwrap
from collections.abc import Collection, Iterable, Mapping, Sequence
from decimal import Decimal
from functools import partial
from itertools import zip_longest
from math import inf, isnan
from shutil import get_terminal_size
from string import Formatter
from typing import IO, Any

# Least width, in letters, to which a column is narrowed so that its cells are wrapped. An estimate: it
# holds the longest names, and some three words.
_NARROWEST = 24
# Blanks between two columns on a terminal.
_GAP = "  "
# Dashes that Markdown asks for at least below each cell of a header.
_LEAST_RULE = 3
# Numbers below this have a digit behind the point. Larger ones round to 10 or more, and have two digits
# without it.
_TWO_DIGITS_FROM = 9.95
# Units of time, each in seconds.
_UNITS = ((1.0, "s"), (1e-3, "ms"), (1e-6, "µs"), (1e-9, "ns"))
# Numbers outside these bounds are written with an exponent.
_PLAIN_FROM = Decimal("1e-3")
_PLAIN_BELOW = Decimal("1e5")


def aligned(header: Sequence[str], rows: Sequence[Sequence[Any]]) -> str:
    """A table for the terminal: columns aligned to the left, two blanks between them."""
    cells = _as_text(header, rows)
    widths = _widths(cells)
    lines = [_GAP.join(map(str.ljust, row, widths)).rstrip() for row in cells]
    return "\n".join(lines)


def on_terminal(
    header: Sequence[str], rows: Sequence[Sequence[Any]], spare: Sequence[int] = ()
) -> str:
    """As `aligned`, and no wider than the standard output, if that is a terminal.

    While the table is too wide, the columns with the indices `spare` are left out one by one; then wide
    columns are wrapped.
    """
    cells = _as_text(header, rows)
    # Each column counts with the gap before it; the first one has none.
    gap = len(_GAP)
    room = get_terminal_size().columns + gap if sys.stdout.isatty() else inf
    for i in sorted(spare, reverse=True):
        if sum(gap + width for width in _widths(cells)) > room:
            cells = [row[:i] + row[i + 1 :] for row in cells]
    widths = _widths(cells)
    # The widest column gives one place at a time, so that two wide ones share the room.
    while sum(gap + width for width in widths) > room and max(widths) > _NARROWEST:
        widths[widths.index(max(widths))] -= 1
    wrap = partial(textwrap.wrap, break_on_hyphens=False)
    lines = []
    for row in cells[1:]:
        wrapped = [wrap(cell, max(1, width)) for cell, width in zip(row, widths, strict=True)]
        lines += zip_longest(*wrapped, fillvalue="")
    return aligned(cells[0], lines)


def _as_text(header: Sequence[str], rows: Sequence[Sequence[Any]]) -> list[list[str]]:
    """Header and rows, every cell as text."""
    return [[*map(str, row)] for row in (header, *rows)]


def _widths(cells: Sequence[Sequence[str]]) -> list[int]:
    """The width of each column, in letters."""
    return [max(map(len, column)) for column in zip(*cells, strict=True)]


def fitting(text: str, stream: IO[str] | None = None, width: int | None = None) -> str:
    """Sentences for a stream, by default the standard output: no line longer than a terminal is wide, if it is one.

    With a `width` no line is longer than that.
    """
    if width is None:
        if not (stream or sys.stdout).isatty():
            return text
        width = get_terminal_size().columns
    return "\n".join(
        textwrap.fill(line, width, break_on_hyphens=False) for line in text.splitlines()
    )


def command_on_terminal(words: Sequence[str]) -> str:
    """A command of the shell; lines that a narrow terminal breaks end in a backslash, for pasting."""
    room = get_terminal_size().columns - len(" \\") if sys.stdout.isatty() else inf
    lines = [words[0]]
    for word in words[1:]:
        if len(lines[-1]) + 1 + len(word) <= room:
            lines[-1] += f" {word}"
        else:
            lines.append(f"  {word}")
    return " \\\n".join(lines)


def markdown(
    header: Sequence[str], rows: Sequence[Sequence[Any]], right: Sequence[int] = ()
) -> str:
    """A Markdown table, columns aligned in the source too; `right` are the indices of right-aligned columns."""
    cells = _as_text(header, rows)
    widths = [max(_LEAST_RULE, width) for width in _widths(cells)]
    sides = [str.rjust if i in right else str.ljust for i in range(len(widths))]

    def line(row: Sequence[str]) -> str:
        return (
            "| "
            + " | ".join(side(cell, w) for side, cell, w in zip(sides, row, widths, strict=True))
            + " |"
        )

    rule = ["-" * (w - 1) + ":" if i in right else "-" * w for i, w in enumerate(widths)]
    return "\n".join([line(cells[0]), line(rule), *(line(row) for row in cells[1:])]) + "\n"


def scientific(value: float | None) -> str:
    """An error or another measured size, in two digits: 1.3e-7; a dash where there is none."""
    if value is None or isnan(value):
        return "–"
    mantissa, _, exponent = f"{value:.1e}".partition("e")
    return f"{mantissa}e{int(exponent)}" if exponent else mantissa


def short(value: float) -> str:
    """A number that somebody chose, in as few characters as it takes, six digits at most: 1000, 0.5, 1e-8."""
    return _plain(f"{value:.6g}")


def in_full(value: float) -> str:
    """A number in all digits that it has: 0.01, 1e-6."""
    return _plain(repr(float(value)))


def in_two_digits(value: float) -> str:
    """A number that was interpolated or fitted, in the digits that mean something: 5900, not 5.9e+03."""
    return _plain(f"{value:.2g}")


def _plain(number: str) -> str:
    """A number's digits, with an exponent below 1e-3 and from 1e5 on."""
    exact = Decimal(number).normalize()
    if not exact.is_finite():
        return number
    ordinary = exact.is_zero() or _PLAIN_FROM <= abs(exact) < _PLAIN_BELOW
    return f"{exact:f}" if ordinary else f"{exact:e}".replace("e+", "e")


def percent(share: float, spec: str = ".0%") -> str:
    """A share in per cent: 98 %, or 98.3 % by the format ".1%"."""
    return format(share, spec).replace("%", " %")


def factor(value: float) -> str:
    """How many times as much: ×1.2, ×34."""
    return f"×{value:.{1 if value < _TWO_DIGITS_FROM else 0}f}"


def duration(seconds: float | None) -> str:
    """A duration with its unit, with one digit behind the point below ten of it; a dash where there is none."""
    if seconds is None or isnan(seconds):
        return "–"
    if seconds == 0:
        return "0 s"
    # A value that rounds to 1000 of a unit is written as 1.0 of the next.
    size, unit = next((entry for entry in _UNITS if seconds >= 0.9995 * entry[0]), _UNITS[-1])
    value = seconds / size
    if value >= _PLAIN_BELOW:
        return f"{scientific(value)} {unit}"
    return f"{value:.{1 if value < _TWO_DIGITS_FROM else 0}f} {unit}"


# Formats of fields beside Python's own.
FORMATS = {"error": scientific, "time": duration, "short": short, "two": in_two_digits}


class Wording(Formatter):
    """Fields of a mapping, or attributes of anything else; lists come with commas."""

    def get_value(self, key: int | str, args: Sequence[Any], kwargs: Any) -> Any:
        """An entry of a mapping, or an attribute."""
        if isinstance(key, int) or isinstance(kwargs, Mapping):
            return super().get_value(key, args, kwargs)
        return getattr(kwargs, key)

    def format_field(self, value: Any, format_spec: str) -> str:
        """One value, a dash for NaN, or several with commas."""
        if isinstance(value, Collection) and not isinstance(value, str):
            return ", ".join(self.format_field(item, format_spec) for item in value)
        if isinstance(value, float) and isnan(value):
            return "–"
        if format_spec.endswith("%"):
            return percent(float(value), format_spec)
        return FORMATS[format_spec](value) if format_spec in FORMATS else format(value, format_spec)


WORDING = Wording()


def cells(rows: Iterable[Any], columns: Mapping[str, str]) -> list[list[str]]:
    """The text of every cell, row by row.

    Rows are mappings, or have attributes; `columns` gives the text of a cell by its column's title, with fields as in
    ``"{seconds:time}"``.
    """

    def texts(row: Any) -> list[str]:
        return [WORDING.vformat(text, (), row) for text in columns.values()]

    return [*map(texts, rows)]
