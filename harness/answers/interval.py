"""A number that is estimated, and the interval around it."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Interval:
    """An estimate: the middle, and the ends of the interval that holds 95 % of the measurements."""

    predicted: float
    low: float
    high: float
