"""Numbers that `polhode validate --errors N --fit` fits to runs of known errors.

The file beside this module holds them, and the command that wrote it. The orders in "steps" alone are
set by hand: a fit copies them.

Keys of the file, from the outermost in:

- "factors": kind of confirmation ("tighter", "looser", "sharper", "unlike", "estimate", "closed form", as
  `docs/method.md` describes them), family of methods, want ("slow", of L and E, or "orientation");
- "growth": family ("explicit", "implicit", "splitting"), want;
- "steps": family ("explicit", "splitting").

`coverage._USUAL` names the usual solver of a family.
"""

import json
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

FITTED_FILE = Path(__file__).with_name("fitted.json")
# Tolerance for which the file states steps per rotation. The value is an estimate: `StepsPerTurn.at` goes
# from any one to others. Another one asks for a new fit, as the file's steps are for this one.
PACED_TOLERANCE = 1e-8


class Factors(NamedTuple):
    """The true error over the difference of two runs, from the runs of a fit.

    The fit takes off the true error what a statement adds for rounding (`coverage._fitted_factors`).
    """

    low: float  # 2.5 % of the runs lie below it
    middle: float  # the median
    # The largest of these: 1.3 times the value that 98.5 % of the runs stay below, 1.3 times the median, and the value
    # that 97.5 % of the runs of each sort of scene stay below. Of an estimate scenes count, not runs.
    high: float


class Growth(NamedTuple):
    """Bound of error over tolerance that four of five runs keep: an amount, and a power of the rotations."""

    amount: float
    power: float

    def after(self, turns: float) -> float:
        """Error over tolerance after `turns` rotations."""
        return self.amount * (1 + turns) ** self.power


class StepsPerTurn(NamedTuple):
    """Steps that a solver takes in a rotation at `PACED_TOLERANCE`, in the median, and its order.

    Nobody fits the order: it is 8 for `cyrk-vern8`, and 6 for `splitting`, as in the law of its steps.
    """

    steps: float
    order: float

    def at(self, tolerance: float) -> float:
        """Steps a rotation at a tolerance."""
        return self.steps * (PACED_TOLERANCE / tolerance) ** (1 / self.order)


@cache
def _fitted() -> dict[str, Any]:
    """The contents of the file, read once."""
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
    """Growth of the errors of the usual solver of a family: "explicit", "implicit" or "splitting".

    `want` says what errors: "slow", of L and E over I_max, or "orientation", in rad.
    """
    return Growth(*_fitted()["growth"][family][want])


def steps_per_turn(family: str) -> StepsPerTurn:
    """Steps of the usual solver of a family, "explicit" or "splitting"; no others are fitted (KeyError)."""
    return StepsPerTurn(*_fitted()["steps"][family])


def forget() -> None:
    """Forget what was read: the file has changed."""
    _fitted.cache_clear()
    factors.cache_clear()
