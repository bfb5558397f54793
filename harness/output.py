"""Observables as CSV: written beside the goal, renamed when complete, kept as FILE.partial otherwise."""

import os
from math import isinf
from pathlib import Path
from typing import IO

import numpy as np

from polhode.models.observables import Observables
from polhode.models.scene import Scene

COLUMNS = ["t", "t2", "Lx", "Ly", "Lz", "E", *(f"R{i}{j}" for i in (1, 2, 3) for j in (1, 2, 3))]


class PartialFile:
    """A file that appears under its name only when the block succeeds; until then, and else, it is FILE.partial.

    Raises
    ------
    OSError
        At once, if the file cannot be written.
    """

    def __init__(self, path: Path) -> None:
        if path.is_dir():
            raise IsADirectoryError(21, "is a folder, expected a file name", str(path))
        self._path, self._partial = path, path.with_name(path.name + ".partial")
        self._file = self._partial.open("w", encoding="utf-8", newline="")

    def __enter__(self) -> IO[str]:
        return self._file

    def __exit__(self, failure: type[BaseException] | None, *details: object) -> None:
        self._file.close()
        if failure is None:
            os.replace(self._partial, self._path)


def write_rows(file: IO[str], scene: Scene, times: np.ndarray, observables: Observables) -> None:
    """Write header and rows in 17 significant digits; `times` are in units of the inverse shear rate.

    Slow time is empty at St = 0 and 0 at St = inf; rows of the rotation that a form does not know are empty.
    """
    file.write(",".join(COLUMNS) + "\n")
    table = np.column_stack([observables.slow, observables.rotation.reshape(len(times), 9)])
    for time, row in zip(times.tolist(), table.tolist(), strict=True):
        slow_time = "" if scene.stokes == 0 else "0" if isinf(scene.stokes) else f"{time / scene.stokes:.17g}"
        values = ("" if value != value else f"{value:.17g}" for value in row)
        file.write(f"{time:.17g},{slow_time},{','.join(values)}\n")
