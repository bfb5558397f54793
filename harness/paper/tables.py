"""Tables of the items: columns of equal length, made of rows, of paths or of labelled parts, and taken apart again."""

from collections.abc import Iterator, Sequence

import numpy as np

from polhode.harness.paper.item import Table

SLOW = ("Lx", "Ly", "Lz", "E")


def columns(names: str, rows: Sequence[Sequence[float]]) -> dict[str, np.ndarray]:
    """Table of rows, with the names of its columns in one string."""
    return dict(zip(names.split(), np.array(rows, dtype=float).T, strict=True))


def stacked(parts: Sequence[tuple[dict[str, float], dict[str, np.ndarray]]]) -> dict[str, np.ndarray]:
    """One table of many parts, each with labels that are repeated in all its rows."""
    labels, values = parts[0]
    sizes = [len(next(iter(own.values()))) for _, own in parts]
    table = {name: np.repeat([given[name] for given, _ in parts], sizes) for name in labels}
    return table | {name: np.concatenate([own[name] for _, own in parts]) for name in values}


def path_table(
    runs: Sequence[tuple[float, np.ndarray, np.ndarray]], wanted: Sequence[str] = SLOW
) -> dict[str, np.ndarray]:
    """Table of paths: a number that names each, its slow times, its slow variables, shape (n, 4)."""
    return stacked(
        [
            ({"path": number}, {"t2": times, **{name: slow[:, SLOW.index(name)] for name in wanted}})
            for number, times, slow in runs
        ]
    )


def groups(table: Table, key: str) -> Iterator[tuple[float, dict[str, np.ndarray]]]:
    """The parts of a table with equal values in a column, in the order in which they come."""
    for value in dict.fromkeys(table[key].tolist()):
        chosen = table[key] == value
        yield value, {name: column[chosen] for name, column in table.items()}


def root_mean_squares(table: Table, key: str, name: str) -> tuple[np.ndarray, np.ndarray]:
    """The values of a key, and the root mean square of a column over the rows of each."""
    parts = list(groups(table, key))
    return np.array([value for value, _ in parts]), np.array([np.sqrt(np.mean(part[name] ** 2)) for _, part in parts])
