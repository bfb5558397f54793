"""A number that is estimated, and the interval around it."""

from dataclasses import dataclass
from math import erf, exp, log, sqrt

# Standard deviations of a normal distribution from its middle to an end of its 95 % interval.
_TWO_SIDED = 1.96


@dataclass(frozen=True)
class Interval:
    """An estimate: the middle, and the ends of the interval that holds 95 % of the measurements."""

    predicted: float
    low: float
    high: float

    def overlaps(self, other: "Interval") -> bool:
        """Whether there is no significant difference."""
        return self.low <= other.high and other.low <= self.high

    @property
    def mean(self) -> float:
        """The average, if the logarithm is normal on either side of the middle."""
        above = log(self.high / self.predicted) / _TWO_SIDED
        below = log(self.predicted / self.low) / _TWO_SIDED
        upper = exp(above**2 / 2) * (1 + erf(above / sqrt(2))) / 2
        lower = exp(below**2 / 2) * (1 + erf(-below / sqrt(2))) / 2
        return self.predicted * (upper + lower)

    def plus(self, other: "Interval") -> "Interval":
        """The sum, the worst coming with the worst."""
        return Interval(
            self.predicted + other.predicted, self.low + other.low, self.high + other.high
        )
