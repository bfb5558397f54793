"""Observables as CSV."""

from collections.abc import Callable
from typing import IO, TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np

# Rows between two notes on how much is written.
ROWS = 10_000
COLUMNS = ["t", "t2", "Lx", "Ly", "Lz", "E", *(f"R{i}{j}" for i in (1, 2, 3) for j in (1, 2, 3))]
# On demand: ω in space axes.
OMEGA = ["wx", "wy", "wz"]


def write_csv(file: IO[str], table: "np.ndarray", advance: Callable[[float], None]) -> None:
    """Write `COLUMNS`, and `OMEGA` if the table has them, in 17 significant digits, NaN as an empty cell.

    `advance` hears how much is done, from 0 to 1.
    """
    file.write(",".join([*COLUMNS, *OMEGA][: table.shape[1]]) + "\n")
    for first in range(0, len(table), ROWS):
        rows = table[first : first + ROWS].tolist()
        file.writelines(",".join("" if x != x else f"{x:.17g}" for x in row) + "\n" for row in rows)
        advance(first / len(table))
