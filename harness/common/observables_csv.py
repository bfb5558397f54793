"""Observables as CSV."""

from collections.abc import Callable
from typing import IO, TYPE_CHECKING

if TYPE_CHECKING:
    import pandas as pd

# Rows between two notes on how much is written.
ROWS = 10_000
COLUMNS = ["t", "t2", "Lx", "Ly", "Lz", "E", *(f"R{i}{j}" for i in (1, 2, 3) for j in (1, 2, 3))]


def write_csv(file: IO[str], frame: "pd.DataFrame", advance: Callable[[float], None]) -> None:
    """Write `COLUMNS` in 17 significant digits, NaN as an empty cell; `advance` hears how much is done, from 0 to 1."""
    for first in range(0, max(1, len(frame)), ROWS):
        rows = frame.iloc[first : first + ROWS]
        rows.to_csv(file, index=False, header=first == 0, float_format="%.17g", lineterminator="\n")
        advance(first / max(1, len(frame)))
