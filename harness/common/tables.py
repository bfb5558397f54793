"""Rows of a dataclass as CSV, written and read back."""

import csv
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import astuple, fields
from io import StringIO
from pathlib import Path
from typing import Any, TypeVar, get_args, get_type_hints

from polhode.harness.common.files import PartialFile, read_file

Entry = TypeVar("Entry")


def write_table(path: Path, kind: type, rows: Iterable[Any], columns: Sequence[str] = ()) -> None:
    """Write rows in full precision, columns named as the fields unless otherwise given; a tuple takes several."""
    with PartialFile(path, summed=True) as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(columns or [field.name for field in fields(kind)])
        for row in rows:
            writer.writerow(
                [cell for value in astuple(row) for cell in (value if isinstance(value, tuple) else [value])]
            )


def read_table(path: Path, kind: type[Entry], columns: Sequence[str] = ()) -> list[Entry]:
    """Rows as `write_table` wrote them; raises ValueError if the file is missing, damaged, or has others."""
    expected = list(columns or [field.name for field in fields(kind)])  # pyright: ignore[reportArgumentType]
    try:
        head, *lines = list(csv.reader(StringIO(read_file(path).decode(), newline=""))) or [[]]
    except OSError as error:
        raise ValueError(f"{path}: {error.strerror}, expected a table of {', '.join(expected)}") from None
    if head != expected:
        raise ValueError(f"{path}: got the columns {', '.join(head)}, expected {', '.join(expected)}")
    hints = get_type_hints(kind).values()
    rows = map(iter, lines)
    return [kind(*(_value(hint, row) for hint in hints)) for row in rows]


def _value(hint: Any, cells: Iterator[str]) -> Any:
    parts = get_args(hint)
    return tuple(part(next(cells)) for part in parts) if parts else hint(next(cells))
