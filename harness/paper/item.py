"""What an item of the paper's reproduction is: a claim, the data that test it, a figure, a verdict."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from math import inf
from typing import Any, TypeVar

from matplotlib.figure import Figure

T = TypeVar("T")

Part = tuple[str, Mapping[str, Any]]
"""The name of a table, "" of the first one, and values by column: some rows' numbers or words, or one for all rows."""
Computed = Iterable[Part]
"""The parts of an item's tables, as they are computed."""
Table = Any
"""A record array, as it is read: `table.stokes` is a column, `table[chosen]` a table of some rows."""
Data = Mapping[str, Table]


class Grid(StrEnum):
    """How fine to compute: in full for the report, reduced for the tests and for a first look."""

    FULL = "full"
    REDUCED = "reduced"

    def of(self, full: T, reduced: T) -> T:
        """The choice that belongs to this grid."""
        return full if self is Grid.FULL else reduced


class Word(StrEnum):
    """What became of a claim; `texts/paper.md` says what each means."""

    CONFIRMED = "confirmed"
    SHARPENED = "sharpened"
    CORRECTED = "corrected"
    MEASURED = "measured"
    UNDECIDED = "undecided"
    NOT_CONFIRMED = "not confirmed"


@dataclass(frozen=True)
class Number:
    """A measured number and the range, both ends included, in which the verdict holds."""

    what: str
    value: float
    low: float = -inf
    high: float = inf
    unit: str = ""  # empty for pure numbers
    interval: tuple[float, float] | None = None  # at 95 %, where the measurement has one

    @property
    def holds(self) -> bool:
        """Whether the value lies in the range; NaN does not."""
        return self.low <= self.value <= self.high


@dataclass(frozen=True)
class Verdict:
    """What the data say about a claim, and the caption of their figure."""

    earned: Word
    sentence: str
    caption: str
    numbers: Sequence[Number]

    @property
    def word(self) -> Word:
        """The one earned, if every number lies in its range."""
        return self.earned if all(number.holds for number in self.numbers) else Word.NOT_CONFIRMED


@dataclass(frozen=True)
class Item:
    """A figure or table of the paper, or a question beyond it; the claim is the paper's, in our words."""

    name: str
    title: str
    claim: str
    compute: Callable[[Grid], Computed]
    figure: Callable[[Data], Figure]
    verdict: Callable[[Data], Verdict]


@dataclass(frozen=True)
class Section:
    """A section of the paper: one page, and a folder for figures and data."""

    name: str
    title: str
    items: tuple[Item, ...]
