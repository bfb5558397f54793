"""Observables as CSV."""

from collections.abc import Callable
from math import isinf
from typing import IO

import numpy as np

from polhode.models.observables import Observables
from polhode.models.scene import Scene

# Rows between two notes on how much is written.
ROWS = 1000
COLUMNS = ["t", "t2", "Lx", "Ly", "Lz", "E", *(f"R{i}{j}" for i in (1, 2, 3) for j in (1, 2, 3))]


def write_header(file: IO[str]) -> None:
    """Write the names of the columns."""
    file.write(",".join(COLUMNS) + "\n")


def write_rows(
    file: IO[str],
    scene: Scene,
    times: np.ndarray,
    observables: Observables,
    tell: Callable[[float], None] = lambda done: None,
) -> None:
    """Write rows in 17 significant digits; `times` are in units of the inverse shear rate.

    Slow time is empty at St = 0 and 0 at St = inf; rows of the rotation that a form does not know are empty.
    `tell` hears now and then how much is done, from 0 to 1.
    """
    table = np.column_stack([observables.slow, observables.rotation.reshape(len(times), 9)])
    for index, (time, row) in enumerate(zip(times.tolist(), table.tolist(), strict=True)):
        if index % ROWS == 0:
            tell(index / len(times))
        slow_time = "" if scene.stokes == 0 else "0" if isinf(scene.stokes) else f"{time / scene.stokes:.17g}"
        values = ("" if value != value else f"{value:.17g}" for value in row)
        file.write(f"{time:.17g},{slow_time},{','.join(values)}\n")
