"""Requests that a run can meet: the error, what it is of, the tolerance."""

from math import ceil, floor, inf, log10

import numpy as np

from polhode.harness.common.text import in_full
from polhode.harness.references.errors import attainable
from polhode.models.scene import MAX_NUMBER, Scene, SlowStart
from polhode.models.shape import require_numbers

WANTS = ("slow", "orientation")
# Relative distance of neighbouring doubles near 1: what rounding makes of a number is about this much.
EPS = float(np.finfo(float).eps)
# A tighter tolerance is lost in the rounding of double precision, half an ulp.
_LEAST_TOLERANCE = 1e-16
# A looser tolerance holds nothing: it would allow errors of the size of the state.
_LARGEST_TOLERANCE = 1.0
# Relative slack of a number that is rounded to few digits: it stays where it is if it has no more of them, though
# rounding put it a little above (first) or below (second). Any number between an ulp and the last digit serves.
_CEIL_SLACK = 1e-12
_DIGIT_SLACK = 1e-9


class NotAttainableError(ValueError):
    """No run in double precision holds the error requested; the reason says why, and what to expect instead."""

    def __init__(self, error: float, reason: str) -> None:
        super().__init__(error, reason)
        self.error = error
        self.reason = reason

    def __str__(self) -> str:
        """The message: what was requested and the reason."""
        return f"error: got {float(self.error)!r}, {self.reason}"


def check_request(error: float, want: str) -> None:
    """Raise ValueError for an error that is no positive number or too large, or for an unknown `want`."""
    require_numbers("error", error)
    if not 0 < float(error) <= MAX_NUMBER:
        raise ValueError(
            f"error: got {float(error)!r}, expected a finite positive number of at most {MAX_NUMBER:g}"
        )
    if want not in WANTS:
        raise ValueError(f"want: got {want!r}, expected 'slow' or 'orientation'")


def check_tolerance(tolerance: float) -> None:
    """Raise ValueError for a tolerance that is of no use in double precision."""
    require_numbers("tolerance", tolerance)
    if not _LEAST_TOLERANCE <= tolerance <= _LARGEST_TOLERANCE:
        least = f"{_LEAST_TOLERANCE:g}, the rounding of double precision,"
        expected = f"a number from {least} to {_LARGEST_TOLERANCE:g}"
        raise ValueError(f"tolerance: got {tolerance}, expected {expected}")


def check_answerable(scene: Scene, error: float, want: str) -> None:
    """Raise ValueError if a scene has no orientation, NotAttainableError if double precision cannot hold the error."""
    if want == "slow":
        check_representable(error, attainable(scene.ellipsoid, scene.initial))
    elif isinstance(scene.start, SlowStart):
        raise ValueError("want: got 'orientation' for a start by L and E alone, expected 'slow'")
    elif scene.ellipsoid.kind == "sphere":
        raise ValueError("want: got 'orientation' for a sphere, which has none, expected 'slow'")
    else:
        check_representable(error, EPS)


def check_representable(error: float, least: float) -> None:
    """Raise NotAttainableError for an error below the least that double precision can hold."""
    if error < least:
        expected = f"expected at least {rounded_up(least)}"
        raise NotAttainableError(error, f"not attainable in double precision, {expected}")


def rounded_up(value: float) -> str:
    """A positive number in two digits that is no smaller."""
    unit = 10.0 ** (floor(log10(value)) - 1)
    return in_full(float(f"{ceil(value / unit * (1 - _CEIL_SLACK)) * unit:.1e}"))


def one_digit(tolerance: float) -> float:
    """The tolerance at one digit, never looser: solvers that compile for a tolerance do so for few."""
    if not 0 < tolerance < inf:
        return tolerance
    power = floor(log10(tolerance))
    # The quotient of 3e-7 may come out a little below 3.
    digit = floor(tolerance / 10.0**power * (1 + _DIGIT_SLACK))
    return float(f"{digit}e{power}")
