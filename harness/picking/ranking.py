"""`pick`: which form, which solver, at what tolerance, and what it will cost, before anything is run in earnest."""

from collections.abc import Collection, Iterable
from contextlib import suppress
from dataclasses import replace
from functools import lru_cache
from math import inf, log10, pi

from polhode.harness import DEFAULT_SAMPLES
from polhode.harness.answers.interval import Interval
from polhode.harness.answers.request import (
    EPS,
    NotAttainableError,
    check_answerable,
    check_representable,
    check_request,
)
from polhode.harness.common.text import short
from polhode.harness.picking.candidate import SHARE, Candidate
from polhode.harness.picking.laws import ErrorLaw, Laws, MethodLaws, Sensitivity, load_laws
from polhode.harness.picking.load import held_back
from polhode.harness.picking.model_error import causes, check_averaging, model_errors, own_estimate
from polhode.harness.picking.pilot import Pilot, PilotFailedError, averages, form_sensitivity, pilot
from polhode.harness.picking.recommendation import Excluded, Recommendation, Way, outside_of_fit
from polhode.harness.picking.refusals import Refusal, Stage, UnfitError, too_far_off, why_nothing
from polhode.harness.picking.trials import with_trials
from polhode.harness.references.errors import attainable, magnitude
from polhode.models.catalogue import FORMS, form as find_form
from polhode.models.form import Form, FormNotValidError
from polhode.models.problem import Problem
from polhode.models.scene import Scene
from polhode.solvers.catalogue import SOLVERS, solver as find_solver
from polhode.solvers.contract import SolverNotValidError


def pick(
    scene: Scene,
    error: float,
    want: str = "slow",
    samples: int = DEFAULT_SAMPLES,
    laws: Laws | None = None,
) -> Recommendation:
    """What `polhode.harness.api.pick` answers, by laws of one's own if given; NotAttainableError if no way will do."""
    _check(scene, error, want)
    error = float(error)
    try:
        return (
            _recommended(scene, error, want, samples, laws)
            if laws
            else _remembered(scene, error, want, samples)
        )
    except PilotFailedError as failure:
        raise NotAttainableError(error, f"not attainable: {failure}") from None
    except OverflowError:
        long = f"the run of {short(scene.time)} inverse shear rates is too long"
        raise NotAttainableError(error, f"not attainable: {long}") from None


@lru_cache(maxsize=1000)
def _remembered(scene: Scene, error: float, want: str, samples: int) -> Recommendation:
    return _recommended(scene, error, want, samples, load_laws())


@lru_cache(maxsize=1000)
def first_way(
    scene: Scene,
    error: float,
    want: str,
    samples: int,
    form: str | None = None,
    solver: str | None = None,
) -> Way | None:
    """The first row of `pick` that is of this form and this solver, if given; None where it is not known."""
    _check(scene, error, want)
    solvers = [name for name in SOLVERS if solver in (None, name)]
    with suppress(PilotFailedError, OverflowError):
        # Of explicit methods the quaternion form always beats Euler angles, whose pilots would take
        # as long as all others together.
        known, stiff = map(find_form, FORMS), pilot(scene).stiff
        beaten = [
            each.name for each in known if each.angles and each.orientation == "full" and not stiff
        ]
        forms = [name for name in FORMS if name == form or not (form or name in beaten)]
        ways, _ = _candidates(scene, error, want, samples, load_laws(), forms, solvers)
        return min(ways, key=lambda way: way.seconds.mean, default=None)
    return None


def _recommended(scene: Scene, error: float, want: str, samples: int, laws: Laws) -> Recommendation:
    ways, refusals = _candidates(scene, error, want, samples, laws, FORMS, SOLVERS)
    found = pilot(scene)
    if not ways:
        largest = magnitude(scene.ellipsoid, found.observables) if want == "slow" else pi
        raise NotAttainableError(error, f"not attainable: {why_nothing(refusals, largest)}")
    excluded = tuple(Excluded(each.form, each.solver, each.reason) for each in refusals)
    ways.sort(key=lambda way: way.seconds.mean)
    tied = [way for way in ways if way.seconds.overlaps(ways[0].seconds)]
    if len(tied) > 1:
        same = "no significant difference in time"
        ways = [
            replace(way, tied=True, reason=f"{same}; {way.reason}") if way in tied else way
            for way in ways
        ]
    size = found.rotations, found.damping_times
    return Recommendation(want, error, *size, tuple(ways), excluded, outside_of_fit(scene))


def _check(scene: Scene, error: float, want: str) -> None:
    check_request(error, want)
    check_answerable(scene, float(error), want)


def _candidates(
    scene: Scene,
    error: float,
    want: str,
    samples: int,
    laws: Laws,
    forms: Iterable[str],
    solvers: Collection[str],
) -> tuple[list[Way], list[Refusal]]:
    found, candidates, refusals = pilot(scene), list[Candidate](), list[Refusal]()
    check_representable(
        error, attainable(scene.ellipsoid, found.observables) if want == "slow" else EPS
    )
    for form_name in forms:
        form = find_form(form_name)
        try:
            problem = _problem(form, scene, found, want)
            budget, model = _budget(form, found, error, want)
        except (FormNotValidError, PilotFailedError, UnfitError) as refusal:
            refusals += [Refusal.of(form_name, solver, refusal) for solver in solvers]
            continue
        for solver in solvers:
            try:
                find_solver(solver).check(problem)
                known = _laws(laws, form, solver, found, want)
                candidates.append(Candidate(form, solver, *known, budget, model, found, samples))
            except (SolverNotValidError, PilotFailedError, UnfitError) as refusal:
                refusals.append(Refusal.of(form_name, solver, refusal))
    tried = with_trials(candidates, want)
    refusals += [each for each in tried if isinstance(each, Refusal)]
    return [each for each in tried if isinstance(each, Way)], refusals


def _problem(form: Form, scene: Scene, found: Pilot, want: str) -> Problem:
    """The scene's problem in a form that takes it; the first of several reasons against it is the plainest one."""
    if want == "orientation" and form.orientation_of(scene) == "none":
        raise UnfitError("gives no orientation", Stage.FORM)
    if averages(form):
        check_averaging(found)
    return form.problem(scene)


def _budget(form: Form, found: Pilot, error: float, want: str) -> tuple[float, Interval | None]:
    """Error left for the solver, less than none if the model error may be too large, and that; none for a full form."""
    if not form.averaged:
        return error, None
    try:
        model = own_estimate(form, found.scene).get(want)
        if model is None or model.high > error / 2:
            model = model_errors(form, found)[want]
    except PilotFailedError as refusal:
        raise UnfitError(str(refusal), Stage.AVERAGING) from None
    if model is None:
        raise UnfitError("gives no orientation", Stage.FORM)
    if model.low >= error:
        raise too_far_off(model.high, error, SHARE, causes(form, found))
    return error - model.high, model


def _laws(
    laws: Laws, form: Form, solver: str, found: Pilot, want: str
) -> tuple[MethodLaws, ErrorLaw, Sensitivity]:
    """What is known of a method, of its error, and what this depends on in the scene."""
    method = find_solver(solver)
    if not method.available:
        raise UnfitError(str(method.why_not), Stage.LIBRARY)
    law = laws.methods.get((form.name, solver))
    if law is None:
        raise UnfitError("no law: not measured often enough", Stage.LAW)
    if held_back(form, solver, found):
        stability = "explicit: stability, not the tolerance, sets its steps"
        raise UnfitError(
            f"{stability} over {found.damping_times:.2g} damping times", Stage.STABILITY
        )
    sensitive = form_sensitivity(form, found, solver)
    at = sensitive.get(want)
    errors = law.error_law(want, at) if at else None
    if errors is None or at is None:
        raise UnfitError("no law of the error wanted: not measured often enough", Stage.LAW)
    if at.error == inf:
        chaotic = "the motion magnifies errors beyond all tolerances tried in trial runs: chaotic, or too long"
        raise UnfitError(chaotic, Stage.MOTION)
    turned, share = sensitive.get("orientation"), found.per_radian if want == "slow" else None
    phase = law.error_law("orientation", turned) if share and turned else None
    if turned and share and phase and turned.error < inf:
        # Once a motion has settled L and E are off by what its phase is, which grows faster than
        # errors of their own.
        phase = replace(phase, offset=phase.offset + log10(share), floor=phase.floor * share)
        if phase.predict(turned, at.tolerance).high > errors.predict(at, at.tolerance).high:
            return law, phase, turned
    return law, errors, at
