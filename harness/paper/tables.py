"""Tables of the items, made of rows, of paths or of labelled parts; and what is measured in them."""

from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np

from polhode.harness.common import fits
from polhode.harness.common.text import WORDING
from polhode.harness.paper.item import Table

SLOW = ("Lx", "Ly", "Lz", "E")


class Estimate(float):
    """A number with its interval at 95 %."""

    interval: tuple[float, float]

    def __new__(cls, value: float, interval: tuple[float, float]) -> "Estimate":  # noqa: D102
        made = super().__new__(cls, value)
        made.interval = interval
        return made


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


def groups(table: Table, key: str) -> Iterator[tuple[float, Table]]:
    """The parts of a table with equal values in a column, in the order in which they come."""
    for value in dict.fromkeys(table[key].tolist()):
        yield value, table[table[key] == value]


def by(table: Table, key: str) -> dict[float, Table]:
    """The same by value."""
    return dict(groups(table, key))


def root_mean_squares(table: Table, key: str, name: str) -> tuple[np.ndarray, np.ndarray]:
    """The values of a key, and the root mean square of a column over the rows of each."""
    parts = by(table, key)
    return np.array(list(parts)), np.array([np.sqrt(np.mean(part[name] ** 2)) for part in parts.values()])


def listed(form: str, rows: Iterable[Sequence[Any]], between: str = ", ") -> str:
    """A text for each row, whose fields are its numbers."""
    return between.join(WORDING.format(form, *row) for row in rows)


def worst(values: Sequence[float] | np.ndarray) -> float:
    """The largest size."""
    return np.max(np.abs(values))


def spread(values: np.ndarray) -> float:
    """The largest value over the smallest."""
    return values.max() / values.min()


def exponent(x: np.ndarray, y: np.ndarray) -> Estimate:
    """Of a power law."""
    slope, interval, _ = fits.power_law(x, y)
    return Estimate(slope, interval)


def mean(values: np.ndarray) -> Estimate:
    """The mean, with its interval by Student's distribution."""
    found, low, high = fits.mean_interval(values)
    return Estimate(found, (low, high))


def share(chosen: np.ndarray) -> Estimate:
    """The share of rows for which something holds."""
    return Estimate(float(np.mean(chosen)), fits.wilson(int(np.sum(chosen)), len(chosen)))
