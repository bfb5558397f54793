"""Numbers that `polhode validate --errors N --fit` fits to runs of known errors.

The file beside this module holds them, and the command that wrote it.
"""

import json
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

FITTED_FILE = Path(__file__).with_name("fitted.json")
# Tolerance for which paces are stated.
PACED_TOLERANCE = 1e-8


class Factors(NamedTuple):
    """The true error over the difference of two runs: below it in 2.5 %, 50 % and 98.5 % of the runs fitted."""

    low: float
    middle: float
    high: float


class Growth(NamedTuple):
    """Bound of error over tolerance that four of five runs keep: an amount, and a power of the rotations."""

    amount: float
    power: float

    def after(self, turns: float) -> float:
        """Error over tolerance after `turns` rotations."""
        return self.amount * (1 + turns) ** self.power


class StepsPerTurn(NamedTuple):
    """Steps that a solver takes in a rotation at `PACED_TOLERANCE`, in the median, and its order."""

    steps: float
    order: float

    def at(self, tolerance: float) -> float:
        """Steps a rotation at a tolerance."""
        return self.steps * (PACED_TOLERANCE / tolerance) ** (1 / self.order)


@cache
def _fitted() -> dict[str, Any]:
    return json.loads(FITTED_FILE.read_text(encoding="utf-8"))


@cache
def factors() -> dict[str, dict[str, dict[str, Factors]]]:
    """Factors by kind of confirmation, family of methods, and what the error is of."""
    return {
        kind: {
            family: {want: Factors(*numbers) for want, numbers in wants.items()}
            for family, wants in families.items()
        }
        for kind, families in _fitted()["factors"].items()
    }


def growth(family: str, want: str) -> Growth:
    """Growth of the errors of a family's usual solver."""
    return Growth(*_fitted()["growth"][family][want])


def steps_per_turn(family: str) -> StepsPerTurn:
    """Steps of a family's usual solver."""
    return StepsPerTurn(*_fitted()["steps"][family])


def forget() -> None:
    """Forget what was read: the file has changed."""
    _fitted.cache_clear()
    factors.cache_clear()
