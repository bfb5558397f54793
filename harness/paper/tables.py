"""Tables of the items, made of their parts; and what is measured in them.

A part is a table's name and some of its rows (`polhode.harness.paper.item`). Intervals are at 95 %.
"""

from collections.abc import Iterable, Iterator, Sequence
from operator import itemgetter
from typing import Any

import numpy as np
from scipy.signal import find_peaks

from polhode.harness.common import fits
from polhode.harness.common.text import WORDING
from polhode.harness.paper.item import Computed, Table

# Columns of the slow variables, in the order of arrays of them, shape (n, 4).
SLOW = ("Lx", "Ly", "Lz", "E")


class Estimate(float):
    """A number with its interval at 95 %."""

    interval: tuple[float, float]

    def __new__(cls, value: float, interval: tuple[float, float]) -> "Estimate":  # noqa: D102
        estimate = super().__new__(cls, value)
        estimate.interval = interval
        return estimate


def tables_of(parts: Computed) -> dict[str, dict[str, np.ndarray]]:
    """Columns of each table, shape (n,), by the table's name.

    A table has the rows of its parts in their order. A single value in a part holds for all of the
    part's rows.
    """
    parts_by_name: dict[str, list[dict[str, np.ndarray]]] = {}
    for name, part in parts:
        arrays = np.broadcast_arrays(*map(np.atleast_1d, part.values()))
        parts_by_name.setdefault(name, []).append(dict(zip(part, arrays, strict=True)))
    tables = {}
    for name, table_parts in parts_by_name.items():
        tables[name] = {
            key: np.concatenate([*map(itemgetter(key), table_parts)]) for key in table_parts[0]
        }
    return tables


def path(
    number: float, times: np.ndarray, slow: np.ndarray, names: Sequence[str] = SLOW
) -> dict[str, Any]:
    """Values of a part of a table of paths, which `number` names.

    Columns are the number, the slow times t2, shape (n,), and the slow variables of `names`; `slow`
    has shape (n, 4).
    """
    return {"path": number, "t2": times, **{name: slow[:, SLOW.index(name)] for name in names}}


def groups(table: Table, key: str) -> Iterator[tuple[float, Table]]:
    """The parts of a table with equal values in a column, in the order in which they come."""
    for value in dict.fromkeys(table[key].tolist()):
        yield value, table[table[key] == value]


def by(table: Table, key: str) -> dict[float, Table]:
    """The parts of `groups` by their value."""
    return dict(groups(table, key))


def root_mean_squares(table: Table, key: str, name: str) -> tuple[np.ndarray, np.ndarray]:
    """The values of a column, `key`, and over the rows of each the root mean square of another, `name`."""
    parts = by(table, key)
    return np.array(list(parts)), np.array(
        [np.sqrt(np.mean(part[name] ** 2)) for part in parts.values()]
    )


def listed(form: str, rows: Iterable[Sequence[Any]], between: str = ", ") -> str:
    """A text for each row, with `between` after each but the last.

    `form` has fields such as ``{0:.2g}``: the places of a row's values, in Python's formats or in the
    formats of `polhode.harness.common.text`.
    """
    return between.join(WORDING.format(form, *row) for row in rows)


def joined(values: Iterable[float], spec: str = "g") -> str:
    """Numbers in one format of Python's, with commas."""
    return ", ".join(format(float(value), spec) for value in values)


def maxima(times: np.ndarray, values: np.ndarray, prominence: float | None = None) -> np.ndarray:
    """Times of the maxima of values at even times, both of shape (n,).

    A maximum is the top of the parabola through a row and its two neighbours. One that rises above
    its surroundings by less than `prominence`, in units of the values, does not count.
    """
    rows, _ = find_peaks(values, prominence=prominence)
    before = values[rows - 1]
    top = values[rows]
    after = values[rows + 1]
    bend = before - 2 * top + after
    # Two equal rows at the top may leave no bend.
    offset = np.divide(before - after, 2 * bend, out=np.zeros(len(rows)), where=bend != 0)
    return times[rows] + offset * (times[1] - times[0])


def worst(values: Sequence[float] | np.ndarray) -> float:
    """The largest absolute value."""
    return np.max(np.abs(values))


def spread(values: np.ndarray) -> float:
    """The largest value over the smallest, of positive values."""
    return values.max() / values.min()


def exponent(x: np.ndarray, y: np.ndarray) -> Estimate:
    """Exponent p of y ∝ x^p by least squares of logarithms, with its interval by Student's t."""
    slope, interval, _ = fits.power_law(x, y)
    return Estimate(slope, interval)


def mean(values: np.ndarray) -> Estimate:
    """The mean, with its interval by Student's distribution."""
    center, low, high = fits.mean_interval(values)
    return Estimate(center, (low, high))


def median(values: np.ndarray) -> Estimate:
    """The median, with its interval: two of the values, chosen by the binomial distribution."""
    center, low, high = fits.median_interval(values)
    return Estimate(center, (low, high))


def share(chosen: np.ndarray) -> Estimate:
    """The share of true values, with Wilson's interval."""
    return Estimate(float(np.mean(chosen)), fits.wilson(int(np.sum(chosen)), len(chosen)))
