"""Trials: the first ways of a ranking are run, so that their tolerances follow from errors made on this very scene.

A law's upper end holds for 97.5 % of like scenes, whose errors scatter a hundredfold; a trial shows the one error that
counts, at the run's own output times, as its distance from a yardstick: a run whose own error, by its law, is a small
share of what is asked for. Where rounding may be too large for that, two runs of unrelated methods that agree do as
well. Where a run would take long, laws alone decide.
"""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import lru_cache
from math import exp, inf, sqrt
from typing import NamedTuple

from polhode.harness.common.text import scientific
from polhode.harness.picking.laws import STIFF, ErrorLaw, Interval, Load, MethodLaws, Sensitivity
from polhode.harness.picking.load import load_of
from polhode.harness.picking.model_error import causes
from polhode.harness.picking.pilot import InPieces, Pilot, PilotFailedError, averages, follow, pilot_solver
from polhode.harness.picking.recommendation import Way
from polhode.harness.picking.refusals import Refusal, Stage, UnfitError, one_digit, one_digit_up, too_far_off, too_tight
from polhode.harness.references.errors import errors
from polhode.models.catalogue import full_form, reference_form
from polhode.models.form import Form
from polhode.models.observables import Observables
from polhode.models.scene import Scene
from polhode.solvers.catalogue import solver as find_solver
from polhode.solvers.contract import Work

# Laws were fitted between these tolerances.
LOOSEST, TIGHTEST = 1e-3, 1e-15
# So much tighter than its tightest measured run a method may be asked to be.
BEYOND = 1e3
# Seconds that a run may be expected to take to be tried, if the quickest one expected takes longer as long as that, up
# to a limit; ways that are, tolerances of each, and how many times as long a yardstick may take.
MOST_SECONDS, PATIENT, WAYS, TOLERANCES, YARDSTICK = 0.02, 0.2, 4, 4, 2.0
# Shares of what the solver may err by: what the yardstick may be off by, what a trial may make, and what its next
# tolerance aims at, which is worth another run if it is looser by the factor, and is at most so far from the last one.
# Where no law promises that, another yardstick will do, by a method that steps and rounds like no other, if a trial is
# closer to it.
UNSURE, MET, AIM, WORTH, FAR = 0.1, 0.75, 0.55, 2.0, 1e3
UNLIKE, UNLIKE_MET = "taylor", 0.4
# Damping times up to which no implicit method is tried.
SOFT = STIFF / 10
# An averaged form whose model error leaves its solver less than this share of the error asked for is not expected to
# meet it.
SHARE = 0.05


@dataclass(frozen=True, eq=False)
class Candidate:
    """A method that takes a scene: its laws, and what its solver may err by, beside a model error."""

    form: Form
    solver: str
    laws: MethodLaws
    law: ErrorLaw
    at: Sensitivity
    budget: float
    model: Interval | None
    found: Pilot
    samples: int

    @property
    def tightest(self) -> float:
        """The tightest tolerance that it may be asked for."""
        return max(TIGHTEST, self.laws.tightest / BEYOND)

    @property
    def asked(self) -> float:
        """The error asked for."""
        return self.budget + (self.model.high if self.model else 0.0)

    @property
    def doubtful(self) -> bool:
        """Whether the model error may be too large: a trial against the full equations shows."""
        return self.budget < SHARE * self.asked

    def expected(self) -> Way:
        """The way to run it by its laws alone; raises UnfitError if no tolerance will do."""
        if self.model and self.doubtful:
            raise too_far_off(self.model.high, self.asked, SHARE, causes(self.form, self.found))
        tolerance = self._tolerance(self.law.stray.high)
        if tolerance < self.tightest:
            raise too_tight(self.law, self.at, one_digit_up(self.tightest), self.asked, self.budget)
        own = self.law.predict(self.at, tolerance)
        return self.way(tolerance, own, f"97.5 % of like runs stay below {scientific(own.high)}")

    def hoped(self) -> Way | None:
        """The way to run it if it errs as the middle one of like scenes does, and rounds as the luckiest one does."""
        if self.doubtful:
            return replace(self, budget=SHARE * self.asked, model=None).hoped()
        tolerance, stray = self._tolerance(self.law.stray.middle), self.law.stray
        if tolerance < self.tightest and self.law.rounding(self.at) * exp(stray.low) < self.budget:
            tolerance = replace(self, law=replace(self.law, floor=0.0))._tolerance(stray.middle)
        return None if tolerance < self.tightest else self.way(tolerance, self.law.predict(self.at, tolerance), "")

    def _tolerance(self, stray: float) -> float:
        return one_digit(min(LOOSEST, self.law.tolerance(self.at, self.budget, stray)))

    def way(self, tolerance: float, own: Interval, error: str, work: Work | None = None) -> Way:
        """The method at a tolerance, with its solver's own error, what is known of it in words, and a trial's work."""
        if work and work.steps and find_solver(self.solver).many_periods:
            load = Load(work.steps + (work.rejected or 0), work.inner or 0, 0.0, self.samples)
        else:
            load = load_of(self.form, self.solver, self.found, self.samples, tolerance)
            load = replace(load, steps=work and work.steps)
        seconds = self.laws.cost.predict(load, tolerance)
        first_run = self.laws.compile_seconds + seconds.predicted
        whole = own.plus(self.model) if self.model else own
        return Way(self.form.name, self.solver, tolerance, whole, seconds, first_run, False, self._reason(error))

    def _reason(self, error: str) -> str:
        if find_solver(self.solver).closed_form:
            return "closed form: neither time nor tolerance matter"
        if self.form.averaged:
            known = f"model error {scientific(self.model.predicted)}" if self.model else error
            return f"averaged: costs the same at every St; {known}"
        if self.found.damping_times > STIFF:
            return f"implicit: {self.found.damping_times:.2g} damping times would hold an explicit method back"
        return f"full equations over {self.found.rotations:.3g} rotations; {error}"


class Yardstick(NamedTuple):
    """What a run close to the true one gave, and the share of its budget that a trial may be off from it."""

    true: Observables
    met: float


def with_trials(candidates: Sequence[Candidate], want: str) -> list[Way | Refusal]:
    """What is expected of candidates, of the first ones by trials: of `WAYS` at most, until none may be quicker."""
    found, tried, poor = [_expected(each) for each in candidates], 0, set[str]()
    limit = max(MOST_SECONDS, min(_quickest(found), PATIENT))
    hopes = [(hope, place) for place, each in enumerate(candidates) if (hope := _worth_trying(each, limit))]
    for hope, place in sorted(hopes, key=lambda each: each[0].seconds.predicted):
        candidate = candidates[place]
        if tried == WAYS or hope.seconds.predicted >= _quickest(found):
            break
        if candidate.doubtful:
            candidate = replace(candidate, budget=candidate.asked, model=None)
        if hope.form not in poor and (yardstick := _yardstick(candidate, candidates, limit)):
            tried, shown, others = tried + 1, None, _quickest([*found[:place], *found[place + 1 :]])
            with suppress(PilotFailedError):
                shown = _tried(candidate, hope.tolerance, found[place], yardstick, want, others)
            found[place] = shown or found[place]
            # What these err by is their own: if a trial finds no tolerance, it will by no solver.
            if not isinstance(shown, Way) and averages(candidate.form):
                poor.add(hope.form)
    return found


def _quickest(found: Sequence[Way | Refusal]) -> float:
    return min((way.seconds.predicted for way in found if isinstance(way, Way)), default=inf)


def _expected(candidate: Candidate) -> Way | Refusal:
    try:
        return candidate.expected()
    except (PilotFailedError, UnfitError) as refusal:
        return Refusal.of(candidate.form.name, candidate.solver, refusal)


def _worth_trying(candidate: Candidate, limit: float) -> Way | None:
    """The way that is hoped for, if the whole of the scene can be tried soon by a method that may come first."""
    form, found, solver = candidate.form, candidate.found, find_solver(candidate.solver)
    slow = form.angles or (solver.implicit and not form.averaged and found.damping_times <= SOFT)
    with suppress(PilotFailedError):
        hope = None if slow or solver.closed_form else candidate.hoped()
        return hope if hope and hope.seconds.predicted < limit else None
    return None


def _tried(
    candidate: Candidate, tolerance: float, expected: Way | Refusal, yardstick: Yardstick, want: str, quickest: float
) -> Way | Refusal | None:
    """A candidate at the loosest tolerance tried at which it meets the error; None if trials say nothing."""
    best, made, counted, missed, least = 0.0, inf, None, inf, inf
    for _ in range(TOLERANCES):
        error, work = _error(candidate, tolerance, yardstick.true, want)
        if error <= yardstick.met * candidate.budget:
            best, made, counted = tolerance, error, work
        else:
            missed, least = tolerance, error
        # Of no error at all the root of a low order would be no number any more.
        step = (AIM / MET * yardstick.met * candidate.budget / max(error, 1e-99)) ** (1 / candidate.law.order)
        aimed = tolerance * min(FAR, max(1 / FAR, step))
        if not best < aimed < missed:
            aimed = sqrt(best * missed) if missed < inf else best
        tolerance = one_digit(min(LOOSEST, aimed))
        if tolerance < max(WORTH * best, candidate.tightest):
            break
        if not best and candidate.way(tolerance, Interval(0.0, 0.0, 0.0), "").seconds.predicted > quickest:
            break
    if best:
        unsure = UNSURE * candidate.budget if yardstick.met == MET else candidate.budget - made
        own = Interval(made, max(0.0, made - unsure), made + unsure)
        return candidate.way(best, own, f"a trial run errs by {scientific(made)}", counted)
    sure = yardstick.met == MET and candidate.budget < least < inf
    if sure and isinstance(expected, Way) and missed <= expected.tolerance:
        why = f"a trial run at {scientific(missed)} errs by {scientific(least)}"
        return Refusal(expected.form, expected.solver, why, Stage.ERROR)
    return None


def _yardstick(candidate: Candidate, others: Sequence[Candidate], limit: float) -> Yardstick | None:
    """A run close enough to the true one, of the same averaged form, a full one or one in pieces; None if none is."""
    found = candidate.found
    full = {reference_form(found.scene), full_form(found.scene)}
    forms = {candidate.form.name} if candidate.form.averaged and candidate.model else full
    able = [each for each in others if each.form.name in forms]
    # By the pilot's solver if that will do, else by the one that is soonest compiled.
    able.sort(key=lambda each: (each.solver != pilot_solver(found.scene), each.laws.compile_seconds))
    unlike = [each for each in able if each.solver == UNLIKE != candidate.solver]
    doubted = candidate.form.averaged and not candidate.model
    pieces = [each for each in others if doubted and isinstance(each.form, InPieces)]
    for met, unsure, those in ((MET, UNSURE, [*able, *pieces]), (UNLIKE_MET, 1.0, unlike)):
        for each in those:
            with suppress(PilotFailedError, UnfitError):
                way = replace(each, budget=unsure * candidate.budget, model=None).expected()
                if way.seconds.predicted < YARDSTICK * limit:
                    return Yardstick(_run(each.form, found.scene, way.tolerance, way.solver, each.samples)[1], met)
    return None


def _error(candidate: Candidate, tolerance: float, true: Observables, want: str) -> tuple[float, Work | None]:
    """What a candidate errs by, inf for a run that fails, and its work."""
    scene = candidate.found.scene
    with suppress(PilotFailedError):
        work, seen = _run(candidate.form, scene, tolerance, candidate.solver, candidate.samples)
        error = getattr(errors(scene.ellipsoid, seen, true), want)
        return inf if error is None else error, work
    return inf, None


@lru_cache(maxsize=64)
def _run(form: Form, scene: Scene, tolerance: float, solver: str, samples: int) -> tuple[Work | None, Observables]:
    """The work of a run, if that is of one piece, and what it gave."""
    run = follow(form, scene, tolerance, solver, samples)
    return None if isinstance(form, InPieces) else run.work, form.observe(scene, run.states)
