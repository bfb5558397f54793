"""A confirmed run: a run, and a second one that agrees with it.

`meet` looks for a run that meets an error: it runs, runs again tighter, and stops when the two
agree; the tighter one is the answer. `confirm` confirms a run at a tolerance that the user gave by
a second one, which costs less wherever a looser one tells anything. Two runs that average never
confirm each other: an estimate of the theory does, a kind of its own.

All decisions follow from counts and differences, none from a clock, so that the answer does not
depend on what else the machine does.

A second run is `looser`, `sharper` (a tighter one) or `unlike` (of another solver or form); the table
in docs/method.md, "How `solve` answers", says when. A method of `many_periods` takes steps that hold
many rotations, such as splitting. Runs *along a track* have a flow that changes at given times, knots.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from math import inf, pi
from time import perf_counter
from typing import NamedTuple

import numpy as np

from polhode.harness.answers import averaging
from polhode.harness.answers.doubt import doubt
from polhode.harness.answers.request import check_representable, one_digit
from polhode.harness.answers.rules import (
    EXPLICIT,
    IMPLICIT,
    SPLITTING,
    TIGHTEST,
    Method,
    first_available,
    first_tolerance,
    flow_rate,
    full_solver,
    is_efficient,
    is_ours,
    steps_of,
    stiff,
)
from polhode.harness.answers.runs import TIGHTER, Run, Runner, Watch, turns
from polhode.harness.answers.statement import (
    UNKNOWN,
    Difference,
    RunError,
    difference,
    of_rounding,
    stated,
)
from polhode.harness.common.text import scientific, short
from polhode.harness.references.errors import attainable, magnitude
from polhode.models.catalogue import form as find_form, full_form
from polhode.models.form import FormNotValidError
from polhode.models.scene import Scene
from polhode.models.spent import SPENT
from polhode.solvers.catalogue import solver as find_solver
from polhode.solvers.contract import SolverNotValidError, Status
from polhode.solvers.solve import Interrupted, Solution

# The factors of statements are fitted with the numbers below as they are: if one of them changes, the fit must be
# made anew (`polhode validate --errors N --fit`).

# Ratio of the tolerances of a looser second run and the run: 0.65 of its steps at order 8. Splitting,
# whose steps come in few sizes, is tightened by as much: 1.5 to 1.8 times the steps.
LOOSER = 30.0
# The loosest tolerance of a second run: looser ones hold nothing, so where it would be looser the second run
# is tighter than the first. An estimate.
_LOOSE = 1e-5
# Least ratio of the steps of the better run to the steps of the worse run of one method. With it the better run
# of a method of order 5 errs by as much as the two differ, that of order 6 by three quarters of it. With a smaller
# ratio it errs by more.
_LEAST_STEP_RATIO = 1.15
# The same of splitting, where smaller factors hide errors up to 60 times the difference.
LEAST_STEP_RATIO_SPLITTING = 1.35
# The same along a track, where steps end at knots and both runs take the same between many of them: at
# 1.15, 14 of 200 random runs by explicit methods erred by more than they stated, at 1.7 one.
_LEAST_STEP_RATIO_TRACK = 1.7
# Above this share of the largest L and E, or of π, differences do not grow with the tolerance. Errors
# end at the size of the motion itself. An estimate.
_SATURATED = 0.03
# No full run is credited with an error below this share of its tolerance: that would be luck. With
# 1e-3 the upper end of stiff runs' orientations is 16 times the error in the median, not 11.
_LEAST_ERROR_PER_TOLERANCE = 0.05
# Runs of a method that look for an error, at most. An estimate: each is tighter by a factor of
# ten at least.
_MAX_RUNS = 6
# Share of the error that the next run is planned to have, where two have not met it: below 1, since
# the forecast of the error may be off. An estimate.
PLANNED_SHARE = 0.3
# The tolerances of two runs differ by this factor at most: errors are taken to follow the tolerance in
# proportion, which holds over a few decades. An estimate.
MAX_STRIDE = 1e4
# Rounding in a step that steps add up: of L and E in eps of the largest, of the orientation in eps of π times the
# rotations. DOP853 errs by 0.04 to 0.27 in L and E after 3e4 to 8e4 steps at the tightest tolerance, and by 0.1 at
# most in the orientation, where roundings of L cancel, on 39 random scenes of hundreds of rotations.
_ROUNDING_PER_STEP = {"slow": 0.3, "orientation": 0.1}
# The same of Verner's methods, whose coefficients round in one direction: they err by 0.6 to 0.8.
_ROUNDING_PER_STEP_VERNER = {"slow": 1.0, "orientation": 1.0}
# Explicit methods that confirm each other along tracks.
_ALONG_TRACKS = ("taylor", "cyrk-dop853", "dop853")
_VERNER = ("cyrk-vern8", "cyrk-vern7")


@dataclass(frozen=True)
class Answer:
    """A run at the user's rows, and the error that it states."""

    method: Method
    tolerance: float
    solution: Solution
    error: RunError


class Second(NamedTuple):
    """A second run worth trying, and what it confirms as, a kind of the table in docs/method.md."""

    kind: str
    method: Method
    tolerance: float


def confirm(
    runner: Runner, method: Method, tolerance: float, estimate: bool = True, watch: Watch = None
) -> Answer:
    """Run a method at a tolerance, and confirm the run by a second one if `estimate`.

    Raises Interrupted on Ctrl-C, with the rows that are finished.
    """
    run = runner.run(method, tolerance, watch=watch)
    if not estimate:
        return Answer(method, tolerance, runner.rows(run.solution), UNKNOWN)
    return _believed(runner, run, _confirmed(runner, run))


@contextmanager
def _kept(runner: Runner, run: Run) -> Iterator[None]:
    """Keep a run, which has ended, on Ctrl-C in what is done beside it."""
    try:
        yield
    except KeyboardInterrupt:
        raise Interrupted(runner.rows(run.solution)) from None


def _confirmed(runner: Runner, run: Run) -> RunError:
    """The confirmation of a run."""
    with _kept(runner, run):
        return confirmation(runner, run)


def _believed(runner: Runner, run: Run, error: RunError) -> Answer:
    """The answer that a run is, its success taken from it where that is known to be false."""
    with _kept(runner, run):
        solution = runner.rows(run.solution)
        words = doubt(runner, run, error)
    if words:
        solution = replace(solution, status=Status.FALSE_SUCCESS, message=words)
    return Answer(run.method, run.tolerance, solution, error)


def meet(
    runner: Runner,
    methods: Sequence[Method],
    error: float,
    want: str,
    estimate: bool = True,
    watch: Watch = None,
) -> Answer:
    """Run the methods in turn until one meets an error; the best run of them where none does.

    Raises NotAttainableError (`request.py`) for an error of L and E below the rounding of the run. Raises
    Interrupted on Ctrl-C: with the rows of the best run of the methods before, of the last one of this method
    that ended, or of the first one as far as it came.
    """
    best = None
    smallest = inf
    for method in methods:
        try:
            answer = _meet(runner, method, error, want, estimate, watch)
        except Interrupted:
            if best is None:
                raise
            raise Interrupted(best.solution) from None
        interval = answer.error.of(want)
        high = interval.high if interval and answer.solution.success else inf
        if best is None or high < smallest or not best.solution.success:
            best = answer
            smallest = high
        if smallest <= error or not estimate:
            break
    assert best is not None
    return best


def _meet(
    runner: Runner, method: Method, error: float, want: str, estimate: bool, watch: Watch
) -> Answer:
    """Run a method ever tighter until it meets an error, or until no tolerance is left."""
    tolerance = first_tolerance(runner.scene, method, error, want)
    if not estimate or method.solver.closed_form or method.form.averaged:
        return confirm(runner, method, tolerance, estimate, watch)
    # Two runs of the search confirm each other, unless a method is confirmed by an unlike one, or
    # (`hybrid`) by estimates of its segments.
    in_pairs = method.form.name != "hybrid" and _partner(runner, method) is None
    run: Run | None = None
    before: Run | None = None  # The last one that reached its end.
    best: tuple[Run, RunError] | None = None
    smallest = inf
    stuck = False  # Whether a run took about as many steps as a looser one.
    for _ in range(_MAX_RUNS):
        run = _next_run(runner, method, tolerance, before, watch)
        if before and not run.success:
            break
        if before is None and run.success and want == "slow":
            check_representable(error, attainable(runner.scene.ellipsoid, run.observables))
        stated_error = _stated_in_search(runner, run, before, in_pairs)
        if stuck and stated_error is UNKNOWN and run.success:
            stated_error = _confirmed(runner, run)
        interval = stated_error.of(want)
        stride = _tighter(method)
        if interval:
            if interval.high < smallest:
                best = run, stated_error
                smallest = interval.high
            stride = min(stride, max(1 / MAX_STRIDE, PLANNED_SHARE * error / interval.high))
        elif before:
            # The steps hardly changed: the tolerance does not set them yet, or stability does.
            stride = 1 / MAX_STRIDE
            stuck = True
        before = run if run.success else None
        if smallest <= error or tolerance <= TIGHTEST:
            break
        tolerance = one_digit(max(TIGHTEST, stride * tolerance))
    if best is None:
        last = before or run
        assert last
        best = last, _confirmed(runner, last)
    return _believed(runner, *best)


def _stated_in_search(runner: Runner, run: Run, before: Run | None, in_pairs: bool) -> RunError:
    """The error of a run, from the looser one before it, or from a second run of its own."""
    if run.success and not in_pairs:
        return _confirmed(runner, run)
    if run.success and before and sharpens(run, before):
        return _compared(runner, "tighter", run, before)
    return UNKNOWN


def _next_run(
    runner: Runner, method: Method, tolerance: float, previous: Run | None, watch: Watch
) -> Run:
    """A run of a search; on Ctrl-C the one before is worth more than its beginning, if that has ended."""
    if previous is None:
        return runner.run(method, tolerance, watch=watch)
    with _kept(runner, previous):
        return runner.run(method, tolerance, previous.limit, watch)


def advised(answer: Answer, scene: Scene, error: float, want: str) -> RunError:
    """The error of an answer, with advice if it is not confirmed to be below the requested one."""
    stated_error = answer.error
    interval = answer.error.of(want)
    if not answer.solution.success or (interval and interval.high <= error):
        return stated_error
    head = f"the requested error, {short(error)},"
    if interval is None:
        return replace(stated_error, advice=f"{head} is not confirmed: {stated_error.note}")
    sure = "was probably missed" if interval.predicted > error else "may have been missed"
    size = f"about {scientific(interval.predicted)}, at most {scientific(interval.high)}"
    form = answer.method.form
    full = full_form(scene)
    # Half of what proportion asks for, since the advice is to suffice.
    tighter = one_digit(answer.tolerance * error / interval.high / 2)
    remedy = "no second run could confirm a tighter one"
    if stated_error.kind == "estimate" or form.averaged:
        remedy = "no full form takes such a start"
        if find_form(full).takes(scene) and form.name != full:
            remedy = f"do: --form {full}, whose error its tolerance alone sets"
    elif tighter > TIGHTEST:
        remedy = f"do: --tolerance {short(tighter)}"
    return replace(stated_error, advice=f"{head} {sure}: it is {size}; {remedy}")


def confirmation(runner: Runner, run: Run) -> RunError:
    """The error of a run that has ended, from a second one that costs less."""
    if not run.success:
        return RunError(None, None, "the run did not reach its end")
    began = perf_counter()
    before = SPENT.seconds["compilation"]
    try:
        with np.errstate(all="ignore"):
            stated_error = _confirmation(runner, run)
    except (FormNotValidError, SolverNotValidError, averaging.NotKnownError) as failure:
        stated_error = RunError(None, None, f"not confirmed: {failure}")
    compilation = SPENT.seconds["compilation"] - before
    return replace(stated_error, seconds=perf_counter() - began - compilation)


def _confirmation(runner: Runner, run: Run) -> RunError:
    """The error of a run that reached its end; raises where a second run, or an estimate, is refused."""
    if run.method.solver.closed_form:
        scene = runner.scene
        observables = run.observables
        # Without inertia the flow alone turns the body, and L and E follow its orientation.
        rate = flow_rate(scene) if scene.stokes == 0 else 0.0
        apart = of_rounding(scene.ellipsoid, observables, turns(scene, observables), rate)
        return _stated(runner, run, "closed form", "exact", apart, "closed form: rounding")
    if run.averaged:
        return _stated(runner, run, *averaging.compared(runner, run))
    if run.solution.segments:
        run = _in_one(runner, run)
    why = "no second run came to its end"
    for second in _seconds(runner, run):
        second_run = runner.run(second.method, second.tolerance, run.limit)
        if not second_run.success:
            continue
        better, worse = (run, second_run) if second.kind == "looser" else (second_run, run)
        if second.method == run.method and not sharpens(better, worse):
            why = "second runs took too similar steps"
            continue
        if second.kind == "looser" and _saturated(runner, run, second_run):
            continue
        return _compared(runner, second.kind, run, second_run)
    return RunError(None, None, f"not confirmed: {why}")


def _seconds(runner: Runner, run: Run) -> Iterator[Second]:
    """Second runs of a full run, the most telling one first."""
    method = run.method
    tolerance = run.tolerance
    tighter = max(TIGHTEST, _tighter(method) * tolerance)
    looser = min(1.0, LOOSER * tolerance)
    if partner := _partner(runner, method):
        unlike = Second("unlike", partner, _equal_error_tolerance(run, partner))
        if steps_of(runner.scene, partner, unlike.tolerance) < run.limit:
            yield unlike
    stroboscopic = method.solver.many_periods and method.solver.name not in SPLITTING
    if looser < _LOOSE and not stroboscopic:
        yield Second("looser", method, looser)
    if tighter < tolerance:
        yield Second("sharper", method, tighter)
    if looser >= _LOOSE or stroboscopic:
        yield Second("looser", method, looser)
    far = max(TIGHTEST, tolerance / MAX_STRIDE)
    if far < tighter:
        yield Second("sharper", method, far)
    implicit = Method(method.form, first_available(IMPLICIT))
    explicit = not (method.solver.implicit or method.solver.many_periods)
    if explicit and implicit.solver.takes(runner.problem(method.form)):
        # Stability sets the steps of the method, whatever the tolerance.
        yield Second("unlike", implicit, tighter)


def _tighter(method: Method) -> float:
    """Ratio, below 1, of the tolerances of a tighter run and of a run by a method.

    Steps of `many_periods` come in few sizes, so such a run is tightened by more.
    """
    return 1 / LOOSER if method.solver.many_periods else TIGHTER


def _partner(runner: Runner, method: Method) -> Method | None:
    """An unlike method, by which a second run tells more or costs less; None where there is none."""
    solver = method.solver
    form = method.form
    scene = runner.scene
    if solver.name in SPLITTING:
        return None
    if form.angles or not is_ours(form):
        form = find_form(full_form(scene))
    partner = full_solver(scene, form)
    if solver.many_periods:
        # Its assumptions about the motion do not follow its tolerance.
        partner = find_solver(SPLITTING[0])
    elif scene.flow is not None and scene.flow.varies and not stiff(scene):
        # Between dense knots tighter runs of a method take the same steps.
        partner = first_available(tuple(name for name in _ALONG_TRACKS if name != solver.name))
    elif form is method.form and not stiff(scene) and is_efficient(solver):
        partner = solver
    elif partner is solver and solver.order_by_tolerance:
        # Tighter runs of it do not take more steps.
        names = [name for name in EXPLICIT if name != solver.name]
        partner = first_available(tuple(names))
    same = partner is solver and form is method.form
    return Method(form, partner) if partner.available and not same else None


def _equal_error_tolerance(run: Run, partner: Method) -> float:
    """The tolerance at which a partner errs by a share, `TIGHTER`, of what the run does.

    A solver's `error_constant` bounds its error over rotations and tolerance: the ratio of two constants
    converts one solver's tolerance to the other's.
    """
    if partner.solver.closed_form:
        return run.tolerance
    partner_constant = getattr(partner.solver, "error_constant", 1.0)
    constant = getattr(run.method.solver, "error_constant", partner_constant)
    return max(TIGHTEST, min(1.0, TIGHTER * constant / partner_constant) * run.tolerance)


def _in_one(runner: Runner, run: Run) -> Run:
    """A run in segments of the full equations as one run at the loosest tolerance of these.

    `hybrid` may have found no segment to average: its run is then one by the full form, and confirmed
    as one.
    """
    form = find_form(full_form(runner.scene))
    tolerance = max(segment.tolerance for segment in run.solution.segments)
    return run._replace(method=Method(form, run.method.solver), tolerance=tolerance)


def sharpens(better: Run, worse: Run) -> bool:
    """Whether a run took clearly more steps than another, or if these are not reported, differs at all."""
    if not (better.steps and worse.steps):
        return bool(np.any(better.observables.energy != worse.observables.energy))
    least = _LEAST_STEP_RATIO
    if better.method.solver.many_periods:
        least = LEAST_STEP_RATIO_SPLITTING
    elif better.solution.problem.parameter_table is not None:
        least = _LEAST_STEP_RATIO_TRACK
    return better.steps >= least * worse.steps


def _saturated(runner: Runner, run: Run, second: Run) -> bool:
    """Whether two runs are so far apart that nothing follows for the better one."""
    ellipsoid = runner.scene.ellipsoid
    size = {"slow": magnitude(ellipsoid, run.observables), "orientation": pi}
    apart = difference(ellipsoid, run.observables, second.observables).largest
    return any(value > _SATURATED * size[want] for want, value in apart.items())


def _compared(runner: Runner, kind: str, run: Run, second: Run) -> RunError:
    """State the error of a run from its difference to a second one; `family` names its factors."""
    apart = difference(runner.scene.ellipsoid, run.observables, second.observables)
    return _stated(runner, run, kind, family(run), apart, f"{kind}: {second.words}")


def _stated(
    runner: Runner, run: Run, kind: str, family_name: str, apart: Difference, note: str
) -> RunError:
    """State the error of a run of a family from its differences from a second one.

    `lucky` is the least difference that a full run is credited with, `rounded` the rounding of its steps
    in eps. Closed forms and averaged runs have neither; runs of `many_periods` have the first alone.
    """
    rotations = 0.0 if run.method.form.averaged else turns(runner.scene, run.observables)
    ellipsoid = runner.scene.ellipsoid
    follows_tolerance = not (run.averaged or run.method.solver.closed_form)
    lucky = _LEAST_ERROR_PER_TOLERANCE * run.tolerance if follows_tolerance else 0.0
    rounded: dict[str, float] = {}
    if family_name in ("explicit", "implicit"):
        verner = run.method.solver.name in _VERNER
        per_step = _ROUNDING_PER_STEP_VERNER if verner else _ROUNDING_PER_STEP
        rounded = {want: run.steps * amount for want, amount in per_step.items()}
    return stated(
        ellipsoid, kind, family_name, apart, run.observables, rotations, lucky, note, rounded
    )


def family(run: Run) -> str:
    """The family of a full run's solver, whose factors it shares."""
    solver = run.method.solver
    if solver.many_periods:
        return solver.name
    return "implicit" if solver.implicit else "explicit"
