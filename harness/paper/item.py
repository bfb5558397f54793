"""An item of the paper's reproduction: a claim, the data that test it, a figure, a verdict."""

from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from math import inf
from typing import Any, ClassVar, TypeVar

from matplotlib.figure import Figure

T = TypeVar("T")

Part = tuple[str, Mapping[str, Any]]
"""Rows of a table: the table's name, "" for the first one, and the rows' values by column.

A column has a value for each row, or one value for all of them.
"""
Computed = Iterable[Part]
"""The parts of an item's tables, as they are computed."""
Table = Any
"""A record array: `table.stokes` is a column, `table[mask]` a table of some rows."""
Data = Mapping[str, Table]
"""The tables of an item by name, as they are read from their files."""


class Grid(StrEnum):
    """How fine to compute: in full for the report, reduced for the tests and for a first look.

    Reduced counts of rows, starts and runs are estimates, for seconds instead of minutes. The tests
    check that every number still lies in the range that its verdict needs.
    """

    FULL = "full"
    REDUCED = "reduced"

    def of(self, full: T, reduced: T) -> T:
        """The choice that belongs to this grid."""
        return full if self is Grid.FULL else reduced


class Word(StrEnum):
    """The outcome of a claim; `harness/pages/texts/paper.md` says what each word means."""

    CONFIRMED = "confirmed"
    SHARPENED = "sharpened"
    CORRECTED = "corrected"
    MEASURED = "measured"
    UNDECIDED = "undecided"
    NOT_CONFIRMED = "not confirmed"


@dataclass(frozen=True)
class Range:
    """Values for which a verdict holds, both ends included, and why these ends."""

    low: float
    high: float
    reason: str

    @classmethod
    def near(cls, value: float, within: float, reason: str) -> "Range":
        """Values that differ from one by no more than a distance."""
        return cls(value - within, value + within, reason)

    @classmethod
    def at_most(cls, high: float, reason: str) -> "Range":
        """Values up to a bound."""
        return cls(-inf, high, reason)

    @classmethod
    def at_least(cls, low: float, reason: str) -> "Range":
        """Values from a bound on."""
        return cls(low, inf, reason)

    def __contains__(self, value: float) -> bool:
        """Whether a value lies in the range; NaN does not."""
        return self.low <= value <= self.high


@dataclass(frozen=True)
class Number:
    """A measured number, and the range that its item's verdict needs."""

    name: str
    value: float
    expected: Range | None = None  # None: the number informs, and no verdict depends on it.
    unit: str = ""  # Empty for pure numbers.
    interval: tuple[float, float] | None = None  # At 95 %, where the measurement has one.
    measure: str = ""  # Of a share: of what, and how that was drawn.
    # Smaller values are errors of the computation itself: "below …" on the page.
    floor: float = 0.0

    @property
    def holds(self) -> bool:
        """Whether the value lies in the range that the verdict needs."""
        return self.expected is None or self.value in self.expected


@dataclass(frozen=True)
class Verdict:
    """The answer of the data to a claim, and the caption of their figure."""

    earned: Word
    sentence: str
    caption: str
    numbers: Sequence[Number]  # at least one; the index shows the first

    @property
    def word(self) -> Word:
        """The word that the data earn: `earned` if every number lies in its range."""
        return self.earned if all(number.holds for number in self.numbers) else Word.NOT_CONFIRMED


class Experiment(ABC):
    """How one claim, or several of one kind, are tested.

    Its settings are the fields of a frozen dataclass; they and the code that `compute` uses decide
    whether data in the report's folder are still today's (`harness/paper/dependencies.py`).
    """

    # About how long `compute` takes on one core: of items that wait, the longest is begun first. Short ones
    # keep the default.
    seconds: ClassVar[float] = 1.0

    @abstractmethod
    def compute(self, grid: Grid) -> Computed:
        """Compute the tables, part by part."""

    @abstractmethod
    def judge(self, data: Data) -> Verdict:
        """Compare the tables with the claim."""

    @abstractmethod
    def draw(self, data: Data) -> Figure:
        """Draw the tables."""


@dataclass(frozen=True)
class Item:
    """A claim of the paper, or a question beyond it, and the experiment that tests it."""

    name: str
    title: str
    source: str  # Label or place in the paper; "beyond" where the paper says nothing.
    claim: str  # The paper's statement in our words.
    experiment: Experiment


@dataclass(frozen=True)
class Section:
    """A section of the paper: one page, and a folder for figures and data."""

    name: str
    title: str
    items: tuple[Item, ...]
