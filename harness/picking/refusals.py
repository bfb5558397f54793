"""Why a method will not do for a scene, in words; and what to say where none will."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from math import floor, inf, log10

from polhode.harness.answers.request import one_digit, rounded_up
from polhode.harness.common.text import in_full
from polhode.harness.picking.laws import ErrorLaw, Sensitivity
from polhode.models.form import FormNotValidError
from polhode.solvers.contract import SolverNotValidError


class Stage(IntEnum):
    """What a method was refused for, in the order in which it is asked: of many refusals, the last ones say most."""

    FORM = 0
    AVERAGING = 1
    SOLVER = 2
    LIBRARY = 3
    LAW = 4
    STABILITY = 5
    MOTION = 6
    ERROR = 7


class UnfitError(Exception):
    """A method will not do; `least` is the smallest error that it would do for, if the error is what it fails."""

    def __init__(self, reason: str, stage: Stage, least: float = inf) -> None:
        super().__init__(reason)
        self.reason, self.stage, self.least = reason, stage, least


@dataclass(frozen=True)
class Refusal:
    """A method that will not do: the reason in words, its stage, and the least error it would do for."""

    form: str
    solver: str
    reason: str
    stage: Stage
    least: float = inf

    @classmethod
    def of(cls, form: str, solver: str, refusal: Exception) -> "Refusal":
        """What an exception says."""
        match refusal:
            case UnfitError():
                return cls(form, solver, refusal.reason, refusal.stage, refusal.least)
            case FormNotValidError():
                return cls(form, solver, refusal.reason, Stage.FORM)
            case SolverNotValidError():
                return cls(form, solver, refusal.reason, Stage.SOLVER)
            case _:
                return cls(form, solver, str(refusal), Stage.MOTION)


def why_nothing(refusals: Sequence[Refusal], largest: float = inf) -> str:
    """Why no method will do: what those that came furthest were refused for, and what is not installed."""
    furthest = max(refusal.stage for refusal in refusals)
    last = [refusal for refusal in refusals if refusal.stage is furthest]
    best = min(last, key=lambda refusal: refusal.least)
    # To ask for an error larger than what it is of would be to ask for nothing.
    if largest <= best.least < inf:
        why = f"errors grow as large as the motion itself: {best.reason}"
    elif best.least < inf:
        why = f"expected at least {rounded_up(best.least)} ({best.form} by {best.solver}): {best.reason}"
    else:
        why = Counter(refusal.reason for refusal in last).most_common(1)[0][0]
    if furthest is Stage.LAW:
        why = f"what takes the scene has {why}; `polhode calibrate` measures"
    absent = dict.fromkeys(refusal.reason for refusal in refusals if refusal.stage is Stage.LIBRARY)
    return why if furthest is Stage.LIBRARY else "; ".join((why, *absent))


def too_far_off(model: float, error: float, share: float, causes: Sequence[str]) -> UnfitError:
    """What to raise where a model error leaves the solver less than a share of the error asked for."""
    made, asked = apart(model, error)
    relation = "exceeds" if model > error else f"leaves the solver less than {100 * share:g} % of"
    because = f": {'; '.join(causes)}" if causes else ""
    return UnfitError(
        f"model error up to {made} {relation} {asked}{because}",
        Stage.AVERAGING,
        model / (1 - share),
    )


def too_tight(
    law: ErrorLaw, sensitivity: Sensitivity, tightest: float, error: float, budget: float
) -> UnfitError:
    """What to raise where a method at its tightest tolerance exceeds the error asked for, `budget` of it its own."""
    least = law.predict(sensitivity, tightest).high + (error - budget)
    made, asked = apart(least, error)
    rounding = law.tolerance(sensitivity, budget) == 0
    why = (
        "rounding along the run"
        if rounding
        else f"{in_full(tightest)}, the tightest tolerance known to work,"
    )
    return UnfitError(f"{why} leaves errors up to {made}, above {asked}", Stage.ERROR, least)


def apart(one: float, other: float) -> tuple[str, str]:
    """Two different numbers in as many digits as distinguish them, two at least."""
    pairs = ((float(f"{one:.{digits}g}"), float(f"{other:.{digits}g}")) for digits in range(2, 18))
    first, second = next((pair for pair in pairs if pair[0] != pair[1]), (one, other))
    return in_full(first), in_full(second)


def one_digit_up(tolerance: float) -> float:
    """The tolerance at one digit, never tighter."""
    below = one_digit(tolerance)
    return below if tolerance <= below * (1 + 1e-9) else below + 10.0 ** floor(log10(tolerance))
