"""Trials: the first ways of a ranking are run, so that their tolerances follow from errors made on this very scene.

A law's upper end holds for 97.5 % of like scenes, whose errors scatter a hundredfold; a trial shows
the one error that counts, at the run's own output times, as its distance from a yardstick: a run
whose own error, by its law, is a small share of what is asked for. Where rounding may be too large
for that, two runs of unrelated methods that agree do as well. Where a run would take long, laws
alone decide.
"""

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import astuple, dataclass, field, replace
from functools import lru_cache
from math import inf, pi, sqrt
from typing import NamedTuple

import numpy as np

from polhode.harness.answers.interval import Interval
from polhode.harness.common.text import scientific
from polhode.harness.picking.candidate import LOOSEST, Candidate
from polhode.harness.picking.pilot import InPieces, PilotFailedError, averages, pilot_solver
from polhode.harness.picking.recommendation import Way
from polhode.harness.picking.refusals import Refusal, Stage, UnfitError, one_digit, one_digit_up
from polhode.harness.references.errors import errors
from polhode.harness.references.rotations import STIFF
from polhode.models.catalogue import full_form, reference_form
from polhode.models.form import Form
from polhode.models.observables import Observables
from polhode.models.scene import Scene
from polhode.solvers.catalogue import solver as find_solver
from polhode.solvers.contract import Status, Work
from polhode.solvers.solve import Solution, solve

# What the pieces of a run state over its error, in the median of random starts (`polhode accuracy
# --order hybrid`).
STATED_OVER = 8.0
# Seconds that a run may be expected to take to be tried, if the quickest one expected takes longer
# as long as that, up to a limit, which is another one where laws alone would refuse the scene; ways
# that are, and tolerances of each.
MOST_SECONDS, PATIENT, REFUSED, WAYS, TOLERANCES = 0.02, 0.2, 0.8, 4, 4
# Errors of stiff runs are foreseen less well, and times too long: even a way that laws promise is
# tried there, so many times as many ways are, and trials may be expected to take so many times as
# long.
STIFF_WAYS, STIFF_TRIALS = 2, 4.0
# Seconds that a method may take to compile to be tried, or to be a yardstick.
COMPILED = 1.0
# How many times as long a yardstick and all together may take, and any run before it is given up.
YARDSTICK, ALL, OVERRUN = 2.0, 3.0, 8.0
# A run that takes so many times as long as expected is tried again so much looser: where rounding
# rules, the errors of loose runs are no larger.
LONGER, LOOSER = 3.0, 30.0
# Tolerances of Taylor's method so far apart are of two orders. A method over many periods, far
# quicker than any other, is held against its own run at such a share of the tolerance where no
# other will do.
APART, OWN = 8.0, 0.01
# Shares of what the solver may err by: what the yardstick may be off by, what a trial may make, and
# what its next tolerance aims at, which is worth another run if it is looser by the factor, and is
# at most so far from the last one. Where no law promises that, another yardstick will do, by a
# method of another family or another order of Taylor's that steps and rounds in another way, if a
# trial is closer to it.
UNSURE, MET, AIM, WORTH, FAR = 0.1, 0.75, 0.55, 2.0, 1e3
UNLIKE, UNLIKE_MET = ("CyRK", "heyoka", "polhode"), 0.4
# What the pieces of a run state is an upper end: one far tighter is a yardstick if it is this share
# of the error asked for. Where that shows nothing, trials are taken at their pieces' word.
STATED = 0.5
# Damping times up to which no implicit method is tried.
SOFT = STIFF / 10
NOTHING, SHOWN = Interval(0.0, 0.0, 0.0), "a trial run errs by"


class Yardstick(NamedTuple):
    """What a run close to the true one gave, if any, and the share of its budget that a trial may be off from it."""

    true: Observables | None
    met: float
    tightest: float = 0.0  # tolerance of a trial that steps in another way


AT_WORD = Yardstick(None, 1.0)


def with_trials(candidates: Sequence[Candidate], want: str) -> list[Way | Refusal]:
    """What is expected of candidates, of the first ones by trials: of `WAYS` at most, until none may be quicker."""
    by_law, tried, poor, settled = (
        [_expected(each) for each in candidates],
        0,
        set[str](),
        set[int](),
    )
    found = [*by_law]
    hopeless = _quickest(found) == inf
    limit = REFUSED if hopeless else max(MOST_SECONDS, min(_quickest(found), PATIENT))
    stiff, most = bool(candidates) and candidates[0].found.stiff, WAYS
    if stiff:
        limit, most = max(limit, min(STIFF_TRIALS * limit, PATIENT)), STIFF_WAYS * WAYS
    trials = Trials([each for each in candidates if _soon_compiled(each)], want, limit, ALL * limit)
    hopes = [
        (hope, place)
        for place, each in enumerate(candidates)
        if (hope := _worth_trying(each, limit))
    ]
    while hopes:
        # The surest ones first until one will do, then the quickest ones.
        sure = _quickest(found) == inf
        hopes.sort(key=lambda each: each[0].error.predicted if sure else each[0].seconds.mean)
        hope, place = hopes.pop(0)
        candidate, later = candidates[place], hope.seconds.mean - _quickest(found)
        if tried == most or later > 0 or (later == 0 and not stiff):
            continue
        if candidate.doubtful:
            candidate = replace(candidate, budget=candidate.asked, model=None)
        if hope.form not in poor and (yardstick := trials.yardstick(candidate)):
            tried, shown, others = tried + 1, None, _quickest([*found[:place], *found[place + 1 :]])
            known = len(trials.misses)
            with suppress(PilotFailedError, UnfitError):
                shown = trials.tried(candidate, hope.tolerance, by_law[place], yardstick, others)
                if not shown and yardstick.tightest and candidate.states_its_error:
                    shown = trials.tried(candidate, hope.tolerance, by_law[place], AT_WORD, others)
            found[place] = shown or found[place]
            if shown:
                settled.add(place)
            # What laws did not foresee of one solver they did not of the others on the same
            # equations.
            for i, each in enumerate(candidates if len(trials.misses) > known else ()):
                if (
                    each.form.name == hope.form
                    and i not in settled
                    and (excess := trials.excess(each)) > 1
                ):
                    found[i] = _expected(each.worse(excess))
            # What these err by is their own: if a trial finds no tolerance, it will by no solver.
            if averages(candidate.form) and not (isinstance(shown, Way) and SHOWN in shown.reason):
                poor.add(hope.form)
    return found


def _quickest(found: Sequence[Way | Refusal]) -> float:
    return min((way.seconds.mean for way in found if isinstance(way, Way)), default=inf)


def _expected(candidate: Candidate) -> Way | Refusal:
    try:
        return candidate.expected()
    except (PilotFailedError, UnfitError) as refusal:
        return Refusal.of(candidate.form.name, candidate.solver, refusal)


def _worth_trying(candidate: Candidate, limit: float) -> Way | None:
    """The way that is hoped for, if the whole of the scene can be tried soon by a method that may come first."""
    form, found, solver = candidate.form, candidate.found, find_solver(candidate.solver)
    soft = solver.implicit and not form.averaged and found.damping_times <= SOFT
    slow = soft or (form.angles and not found.stiff)
    hope = (
        candidate.hoped()
        if _soon_compiled(candidate) and not (slow or solver.closed_form)
        else None
    )
    return hope if hope and hope.seconds.predicted < limit else None


def _soon_compiled(candidate: Candidate) -> bool:
    return candidate.laws.compile_seconds < COMPILED


class Run(NamedTuple):
    """How a run ended, its work, if it is of one piece, and what it gave, if it came to its end."""

    status: Status
    work: Work | None
    seen: Observables | None
    stated: dict[str, float]  # what its pieces say of its errors


@dataclass
class Trials:
    """Runs of candidates to be tried, each expected to take no longer than a limit, all of them than what is left."""

    candidates: Sequence[Candidate]
    want: str
    limit: float
    left: float
    paid: set[tuple[str, str, float]] = field(default_factory=set)
    # Tightest tolerances that missed on full equations, be it in pieces, and the errors there.
    misses: list[tuple[Candidate, float, float]] = field(default_factory=list)

    def tried(
        self,
        candidate: Candidate,
        tolerance: float,
        expected: Way | Refusal,
        yardstick: Yardstick,
        quickest: float,
    ) -> Way | Refusal | None:
        """A candidate at the loosest tolerance tried at which it meets the error; None if trials say nothing."""
        # The loosest tolerances that took too long and that met the error, and the tightest one
        # that missed it.
        late, best, made, counted, missed, least = 0.0, 0.0, inf, None, inf, inf
        for _ in range(TOLERANCES):
            seconds = candidate.way(tolerance, NOTHING, "").seconds.predicted
            wanted = tolerance >= yardstick.tightest and (
                best or missed == inf or seconds <= quickest
            )
            run = self.run(candidate, tolerance, seconds) if wanted else None
            if run is None:
                break
            error = (
                run.stated[self.want]
                if yardstick.true is None
                else self.error(candidate, run, yardstick.true)
            )
            if error == 0 < yardstick.tightest:
                # The same run, made twice.
                break
            took = OVERRUN * seconds if run.status is Status.TIME_LIMIT else 0.0
            if error <= yardstick.met * candidate.budget:
                best, made, counted = tolerance, error, run.work
                took = candidate.way(tolerance, NOTHING, "", counted).seconds.predicted
            elif not took:
                missed, least = tolerance, error
            # Of no error at all the root of a low order would be no number any more.
            step = (AIM / MET * yardstick.met * candidate.budget / max(error, 1e-99)) ** (
                1 / candidate.law.order
            )
            late = tolerance if took > LONGER * seconds else late
            aimed = tolerance * (LOOSER if late == tolerance else min(FAR, max(1 / FAR, step)))
            if not max(late, best) < aimed < missed:
                aimed = sqrt(max(late, best) * missed) if missed < inf else best
            tolerance = one_digit(min(LOOSEST, max(aimed, yardstick.tightest)))
            if not max(WORTH * max(late, best), candidate.tightest) <= tolerance < missed:
                break
        if best:
            unsure = UNSURE * candidate.budget if yardstick.met == MET else candidate.budget - made
            own = Interval(made, max(0.0, made - unsure), made + unsure)
            words = f"{SHOWN} {scientific(made)}"
            if yardstick.true is None:
                own, words = (
                    Interval(made / STATED_OVER, 0.0, made),
                    f"{words} at most, as its pieces state",
                )
            return candidate.way(best, own, words, counted)
        # Of rounding, which another yardstick shows as well, nothing follows for other tolerances.
        if yardstick.met == MET and least < inf and not candidate.form.averaged:
            self.misses.append((candidate, missed, least))
        if not isinstance(expected, Way):
            return None
        if yardstick.met == MET and candidate.budget < least < inf and missed <= expected.tolerance:
            why = f"a trial run at {scientific(missed)} errs by {scientific(least)}"
            return Refusal(expected.form, expected.solver, why, Stage.ERROR)
        seconds = Interval(*(OVERRUN * each for each in astuple(expected.seconds)))
        return replace(expected, seconds=seconds) if late >= expected.tolerance else None

    def excess(self, candidate: Candidate) -> float:
        """By how much, with `AIM`, errors of its form exceed the upper end of a law."""
        # In pieces the tolerance means the same by every solver, so that the law is the candidate's
        # own.
        alike = [each for each in self.misses if each[0].form.name == candidate.form.name]
        own = candidate if isinstance(candidate.form, InPieces) else None
        ways = ((own or tried, at, least) for tried, at, least in alike)
        return max(
            (least / AIM / way.law.predict(way.at, at).high for way, at, least in ways), default=1.0
        )

    def yardstick(self, candidate: Candidate) -> Yardstick | None:
        """A run close to the true one, of the same averaged form, a full one or one in pieces; None if none is."""
        for each, way, met in self._yardsticks(candidate):
            seconds = way.seconds.predicted
            run = (
                self.run(each, way.tolerance, seconds) if seconds < YARDSTICK * self.limit else None
            )
            sure = (
                each is not candidate
                or not run
                or run.stated[self.want] <= STATED * candidate.budget
            )
            if run and run.seen and sure:
                alike = met == UNLIKE_MET and each.solver == candidate.solver
                # As tight as errors are twice those of the tighter run.
                apart = 2 ** (1 / each.law.order) if each is candidate else APART
                return Yardstick(
                    run.seen, met, one_digit_up(apart * way.tolerance) if alike else 0.0
                )
        return AT_WORD if candidate.states_its_error else None

    def _yardsticks(self, candidate: Candidate) -> Iterator[tuple[Candidate, Way, float]]:
        scene, same = candidate.found.scene, bool(candidate.model)
        forms = {candidate.form.name} if same else {reference_form(scene), full_form(scene)}
        if candidate.form.averaged and not same:
            forms |= {each.form.name for each in self.candidates if isinstance(each.form, InPieces)}
        able = [replace(each, model=None) for each in self.candidates if each.form.name in forms]
        # By the pilot's solver if that will do, else by the one that is soonest compiled; in pieces
        # at last.
        usual = pilot_solver(scene)
        able.sort(
            key=lambda e: (isinstance(e.form, InPieces), e.solver != usual, e.laws.compile_seconds)
        )
        for each in able:
            with suppress(PilotFailedError, UnfitError):
                yield each, replace(each, budget=UNSURE * candidate.budget).expected(), MET
        # Of two runs that average alike nothing follows where no law bounds either.
        able = [each for each in able if not isinstance(each.form, InPieces)]
        families = {*UNLIKE} - {find_solver(candidate.solver).family}
        unlike = [each for each in able if find_solver(each.solver).family in families]
        taylor = [each for each in able if find_solver(each.solver).order_by_tolerance]
        exact = ((each, each.by_law(each.tightest)) for each in taylor)
        for rows, first in (
            (_hopes(unlike, UNSURE * candidate.budget), _until_seen),
            # Near double precision the one that rounds least, before those that may round as much
            # as a trial may err.
            (exact, lambda row: row[1].error.predicted),
            (_hopes(unlike, candidate.budget), _until_seen),
        ):
            ways = sorted(((each, way) for each, way in rows if way), key=first)
            yield from ((each, way, UNLIKE_MET) for each, way in ways)
        alone = find_solver(candidate.solver).many_periods or candidate.states_its_error
        own = candidate.hoped() if alone else None
        if (
            own
            and (way := candidate.by_law(one_digit(OWN * own.tolerance)))
            and way.tolerance >= candidate.tightest
        ):
            yield candidate, way, UNLIKE_MET

    def run(self, candidate: Candidate, tolerance: float, seconds: float) -> Run | None:
        """A run that is expected to take so long; None if that is more than what is left. It is paid for once."""
        way = candidate.form.name, candidate.solver, tolerance
        if way not in self.paid:
            if seconds > self.left:
                return None
            self.left -= seconds
            self.paid.add(way)
        most = OVERRUN * max(MOST_SECONDS, float(f"{seconds:.0e}"))
        return _run(
            candidate.form,
            candidate.found.scene,
            tolerance,
            candidate.solver,
            candidate.samples,
            most,
        )

    def error(self, candidate: Candidate, run: Run, true: Observables) -> float:
        """What a run errs by, inf for one that fails."""
        if run.seen is None:
            return inf
        error = getattr(errors(candidate.found.scene.ellipsoid, run.seen, true), self.want)
        return inf if error is None else error


def _hopes(
    candidates: Sequence[Candidate], budget: float
) -> Iterator[tuple[Candidate, Way | None]]:
    for each in candidates:
        yield each, replace(each, budget=budget).hoped(lucky=False)


def _until_seen(row: tuple[Candidate, Way]) -> float:
    candidate, way = row
    return way.seconds.predicted + candidate.laws.compile_seconds


@lru_cache(maxsize=64)
def _run(
    form: Form, scene: Scene, tolerance: float, solver: str, samples: int, seconds: float
) -> Run:
    problem = form.problem(scene)
    run = solve(
        problem, solver, tolerance, np.linspace(0.0, problem.end, samples), max_seconds=seconds
    )
    seen = form.observe(scene, run.states) if run.success else None
    stated = said_by_pieces(run) if run.success else {"slow": inf, "orientation": inf}
    return Run(run.status, None if isinstance(form, InPieces) else run.work, seen, stated)


def said_by_pieces(found: Solution) -> dict[str, float]:
    """Errors that a run's pieces state."""
    angle = sum(each.angle for each in found.stages)
    return {"slow": sum(each.error for each in found.stages), "orientation": min(pi, angle)}
