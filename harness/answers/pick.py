"""`pick`: which form, which solver, at what tolerance, and what it will cost.

`race.py` makes the runs; here the request is checked, and the result becomes a `Recommendation`.

Seconds of asking leave compilation out: a process compiles a method once, whatever it is asked, and
`RankedRun.first_run_seconds` states it. So asking is comparable with the runs it chooses from, whose
seconds leave it out too. `SPENT` adds up the seconds that a thread has compiled for.
"""

from collections import Counter
from collections.abc import Sequence
from functools import lru_cache
from itertools import product
from math import inf, pi
from time import perf_counter

from polhode.harness import DEFAULT_SAMPLES
from polhode.harness.answers.averaging import NotKnownError
from polhode.harness.answers.race import TIED, Entry, Refusal, contenders, race
from polhode.harness.answers.recommendation import Excluded, RankedRun, Recommendation
from polhode.harness.answers.request import (
    NotAttainableError,
    check_answerable,
    check_request,
    rounded_up,
)
from polhode.harness.references.errors import magnitude
from polhode.harness.references.rotations import damping_times
from polhode.models.catalogue import FORMS
from polhode.models.scene import Scene
from polhode.models.spent import SPENT
from polhode.solvers.catalogue import SOLVERS


def pick(
    scene: Scene,
    error: float,
    want: str = "slow",
    samples: int = DEFAULT_SAMPLES,
    everything: bool = False,
    names: Sequence[tuple[str, str]] = (),
) -> Recommendation:
    """The answer of `polhode.harness.api.pick`; NotAttainableError if no method meets the error.

    `names` are methods, by form and solver, that are raced besides the usual ones. With `everything` all
    methods of the catalogues are raced. Raises ValueError for an error, or a `want`, that makes no sense.
    """
    check_request(error, want)
    check_answerable(scene, float(error), want)
    return _remembered(scene, float(error), want, samples, everything, tuple(names))


# The limit bounds memory alone.
@lru_cache(maxsize=1000)
def _remembered(
    scene: Scene,
    error: float,
    want: str,
    samples: int,
    everything: bool,
    names: tuple[tuple[str, str], ...],
) -> Recommendation:
    """The answer of `pick` to a request that has been checked; an equal request is raced once."""
    began = perf_counter() - SPENT.seconds["compilation"]
    methods, unfit = contenders(scene, want, everything, names)
    if not methods and not everything:
        # Libraries are missing: whatever there is takes part.
        methods, unfit = contenders(scene, want, everything=True, names=names)
    try:
        result = race(scene, error, want, samples, methods, _uncut(everything, names))
    except (NotKnownError, OverflowError) as failure:
        raise NotAttainableError(error, f"not attainable: {failure}") from None
    refusals = [*unfit, *result.refusals]
    if not result.entries:
        size = magnitude(scene.ellipsoid, scene.initial) if want == "slow" else pi
        raise NotAttainableError(error, f"not attainable: {_why_nothing(refusals, size)}")
    ranking = _ranked(result.entries)
    refused = []
    for refusal in refusals:
        form, solver = refusal.method
        form_name = FORMS.name_of(form) or ""
        solver_name = SOLVERS.name_of(solver) or ""
        refused.append(Excluded(form_name, solver_name, refusal.reason))
    return Recommendation(
        want,
        error,
        result.raced.turns,
        damping_times(scene),
        ranking,
        tuple(refused),
        scene,
        perf_counter() - SPENT.seconds["compilation"] - began,
    )


def _uncut(everything: bool, names: tuple[tuple[str, str], ...]) -> Sequence[tuple[str, str]]:
    """Methods that the user asks about, whatever they cost."""
    return list(product(FORMS, SOLVERS)) if everything else names


def forget() -> None:
    """Forget what was answered: the next question is asked anew."""
    _remembered.cache_clear()


def _ranked(entries: Sequence[Entry]) -> tuple[RankedRun, ...]:
    """Rows of the entries of a race, which come sorted, the quickest one first."""
    least = entries[0].seconds.predicted
    within_tie = [entry.seconds.predicted <= TIED * least for entry in entries]
    tied = sum(within_tie) > 1
    rows = []
    for entry, close in zip(entries, within_tie, strict=True):
        form = FORMS.name_of(entry.method.form)
        solver = SOLVERS.name_of(entry.method.solver)
        rows.append(
            RankedRun(
                form or "",
                solver or "",
                entry.tolerance,
                entry.error,
                entry.seconds,
                entry.first_run_seconds,
                tied and close,
                entry.reason,
            )
        )
    return tuple(rows)


def _why_nothing(refusals: Sequence[Refusal], size: float) -> str:
    """Why no method will do: the least error that one would do for, or the reason that most have.

    `size` is the largest error that means anything: the largest L or E over I_max, or π rad. Solvers
    that are not installed are named too, since installing one may be the remedy.
    """
    best = min(refusals, key=lambda refusal: refusal.least)
    absent = [
        refusal.reason for refusal in refusals if refusal.reason == refusal.method.solver.why_not
    ]
    if best.least == inf:
        reasons = [refusal.reason for refusal in refusals if refusal.reason not in absent]
        why = Counter(reasons or absent).most_common(1)[0][0]
    elif best.least >= size:
        why = f"errors grow as large as the motion itself: {best.reason}"
    else:
        method = f"{best.method.form.name} by {best.method.solver.name}"
        why = f"expected at least {rounded_up(best.least)} ({method}): {best.reason}"
    return "; ".join(dict.fromkeys((why, *absent)))
