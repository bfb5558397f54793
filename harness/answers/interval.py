"""A number that is estimated, and the interval around it."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Interval:
    """An estimate: the middle, and the ends of the interval that holds 95 % of the measurements.

    Ends of stated errors come from fitted factors (`fitted.Factors`, whose shares are 2.5 % below and
    1.5 % above). Ends of raced times are a factor on either side (`forecast.RacedSegment.spread`).
    """

    # All three in the unit of what is estimated: an error over I_max or in rad, or seconds.
    predicted: float
    low: float
    high: float
