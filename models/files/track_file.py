"""Tracks: CSV files of the velocity gradient A_ij = ∂u_i/∂x_j along a particle's path.

The first column is the time, in inverse reference rates, and the others are A's entries in reference rates
(`polhode.models.flow.Flow`).
"""

import csv
from pathlib import Path

from polhode.models.flow import Flow

TRACK_COLUMNS = ["t", *(f"A{i}{j}" for i in (1, 2, 3) for j in (1, 2, 3))]


def read_track(path: Path) -> Flow:
    """The flow of a file with the columns t, A11, A12, … A33; what is wrong is said in one line.

    Raises
    ------
    ValueError
        If the file cannot be read, its columns are others, or the numbers are no track.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")
    except FileNotFoundError:
        raise ValueError(f"flow.track: got {str(path)!r}, expected a file: there is none") from None
    except (OSError, UnicodeDecodeError) as error:
        raise ValueError(f"flow.track: got {str(path)!r}, expected a CSV file: {error}") from None
    reader = csv.reader(text.splitlines())
    # Blank lines count as lines: `reader.line_num` is the number in the file of a row's last line.
    rows = [(reader.line_num, row) for row in reader if row]
    header = [name.strip() for name in rows[0][1]] if rows else []
    if header != TRACK_COLUMNS:
        # Messages show the first 60 characters of a row.
        got = ",".join(header)
        expected = ",".join(TRACK_COLUMNS)
        raise ValueError(f"flow.track: {path}: got the columns {got:.60}, expected {expected}")
    numbers = [_numbers(path, line, row) for line, row in rows[1:]]
    times = [row[0] for row in numbers]
    try:
        return Flow.track(times, [(row[1:4], row[4:7], row[7:]) for row in numbers])
    except ValueError as error:
        raise ValueError(f"{error} ({path})") from None


def _numbers(path: Path, line: int, row: list[str]) -> list[float]:
    """The numbers of a row; raises ValueError, with the file and the line, if it has others."""
    if len(row) != len(TRACK_COLUMNS):
        raise ValueError(
            f"flow.track: {path}:{line}: got {len(row)} columns, expected {len(TRACK_COLUMNS)}"
        )
    try:
        return [float(cell) for cell in row]
    except ValueError:
        got = ",".join(row)
        raise ValueError(f"flow.track: {path}:{line}: got {got:.60}, expected numbers") from None


def track_text(flow: Flow) -> str:
    """Contents of the file of a track."""
    lines = [",".join(TRACK_COLUMNS)]
    for time, (x, y, z) in zip(flow.knots, flow.gradients, strict=True):
        lines.append(",".join(repr(number) for number in (time, *x, *y, *z)))
    return "\n".join(lines) + "\n"
