"""A confirmed run: a run, and a second one that agrees with it.

`meet` looks for a run that meets an error: it runs, runs again tighter, and stops when the two
agree; the tighter one is the answer. `confirm` confirms a run at a tolerance that the user gave by
a second one that costs less. Two runs that average never confirm each other: an estimate of the
theory is added to their difference, a kind of its own.

All decisions follow from counts and differences, none from a clock, so that the answer does not
depend on what else the machine does.
"""

from collections.abc import Iterator, Sequence
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
    SPLITTING,
    TIGHTEST,
    Method,
    first_available,
    first_tolerance,
    full_solver,
    steps_of,
    stiff,
)
from polhode.harness.answers.runs import Run, Runner, Watch, turns
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
from polhode.models.form import Form, FormNotValidError
from polhode.models.scene import Scene
from polhode.models.spent import SPENT
from polhode.solvers.catalogue import solver as find_solver
from polhode.solvers.contract import UNLIMITED, Solver, SolverNotValidError, Status
from polhode.solvers.solve import Interrupted, Solution

# Ratio of the tolerances of a tighter run and the run before: a third more steps at order 8.
_TIGHTER = 0.1
# The same of splitting, whose steps come in few sizes: 1.5 to 1.8 times the steps.
_TIGHTER_SPLITTING = 1 / 30
# Ratio of the tolerances of a looser second run and the run: 0.65 of its steps at order 8.
_LOOSER = 30.0
# From this tolerance on a second run is tighter: looser ones hold nothing.
_LOOSE = 1e-5
# Least ratio of the steps of the better run to the steps of the worse run of one method. At this
# ratio a method of order 6 errs by as much as its two runs differ, and by more below it.
_LEAST_STEP_RATIO = 1.15
# The same of splitting, where smaller factors hide errors up to 60 times the difference.
LEAST_STEP_RATIO_SPLITTING = 1.35
# The same along a track, where steps end at knots and both runs take the same between many of them: at
# 1.15, 14 of 200 random runs by explicit methods erred by more than they stated, at 1.7 one.
_LEAST_STEP_RATIO_TRACK = 1.7
# The tolerance of a last second run where others took too similar steps.
_FAR_TIGHTER = 1e-3
# Above this share of the largest L and E, or of π, differences do not grow with the tolerance.
_SATURATED = 0.03
# No run is credited with an error below this share of its tolerance: that would be luck.
_LEAST_ERROR_PER_TOLERANCE = 1e-3
# Runs of a method that look for an error, at most.
_MAX_RUNS = 6
# If two runs have not met an error, the next one is planned to have this share of it.
_PLANNED_SHARE = 0.3
# A tolerance is divided by this much at most for that.
_MAX_STRIDE = 1e4
# A tighter run has this share of the difference before; else tolerance no longer sets the errors.
_FALLING = 0.7
# A search ends when the difference has not fallen this often: once may be chance, near L² = 2EI₂.
_MAX_STALLS = 2
# Most steps of a second run: a multiple of the steps of the run, and an amount that costs little.
STEP_RATIO = 30
STEP_FLOOR = 20_000
# The tightest tolerance of a run that a tighter one confirms.
_LEAST_CONFIRMED = 1e-14
# An unlike run is tighter by this than equal errors ask for.
_UNLIKE_SHARE = 0.2
# Rounding of L and E in a step, in eps of the largest, that steps add up: DOP853 errs by 0.07 a step
# after 8e4 steps.
_ROUNDING_PER_STEP = 0.1
# The same of Verner's methods, whose coefficients round in one direction: they err by 0.6 to 0.8.
_ROUNDING_PER_STEP_VERNER = 1.0
# Explicit methods that confirm each other along tracks.
_ALONG_TRACKS = ("taylor", "cyrk-dop853", "dop853")
_VERNER = ("cyrk-vern8", "cyrk-vern7")
# Error per rotation and tolerance of a solver that states none.
_USUAL_ERROR_CONSTANT = 20.0


@dataclass(frozen=True)
class Answer:
    """A run at the user's rows, and the error that it states."""

    method: Method
    tolerance: float
    solution: Solution
    error: RunError


class Second(NamedTuple):
    """A second run worth trying, and what it confirms as."""

    kind: str
    method: Method
    tolerance: float


def confirm(
    runner: Runner, method: Method, tolerance: float, estimate: bool = True, watch: Watch = None
) -> Answer:
    """Run a method at a tolerance, and confirm the run by a second one if `estimate`."""
    run = runner.run(method, tolerance, watch=watch)
    if not estimate:
        return Answer(method, tolerance, runner.rows(run.solution), UNKNOWN)
    try:
        return _believed(runner, run, confirmation(runner, run))
    except KeyboardInterrupt:
        raise Interrupted(runner.rows(run.solution)) from None


def _believed(runner: Runner, run: Run, error: RunError) -> Answer:
    """The answer that a run is, its success taken from it where that is known to be false."""
    solution = runner.rows(run.solution)
    if words := doubt(runner, run, error):
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
    """Run the methods in turn until one meets an error; the best run of them where none does."""
    best = None
    smallest = inf
    for method in methods:
        answer = _meet(runner, method, error, want, estimate, watch)
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
    """Run a method ever tighter until it meets an error, or tolerance no longer sets its errors."""
    tolerance = first_tolerance(runner.scene, method, error, want)
    if not estimate or method.solver.closed_form or method.form.averaged:
        return confirm(runner, method, tolerance, estimate, watch)
    search = _Search(runner, method, error, want)
    for _ in range(_MAX_RUNS):
        run = _next_run(runner, method, tolerance, search.previous, watch)
        if run.success and search.previous is None and want == "slow":
            check_representable(error, attainable(runner.scene.ellipsoid, run.observables))
        stride = search.look(run)
        if stride == 1.0 or tolerance <= TIGHTEST:
            break
        tolerance = one_digit(max(TIGHTEST, stride * tolerance))
    return _believed(runner, *search.outcome())


class _Search:
    """Runs of a method, each tighter than the one before, and the best of them."""

    def __init__(self, runner: Runner, method: Method, error: float, want: str) -> None:
        self.runner = runner
        self.method = method
        self.error = error
        self.want = want
        self.in_pairs = _partner(runner, method) is None
        self.previous: Run | None = None  # The last one that others are compared with.
        self.last: Run | None = None
        self.best: tuple[Run, RunError] | None = None
        self.high = inf  # The upper end of the best one's error.
        self.stalls = 0

    def look(self, run: Run) -> float:
        """Look at a run: the ratio of the next tolerance to its own, 1 if the search is over."""
        before = self.previous if self.previous and self.previous.success else None
        self.last = run
        if not run.success:
            if before:
                return 1.0
            self.previous = run
            return _tighter(self.method)
        stated_error = self._stated(run, before)
        if stated_error is None:
            if before is None:
                self.previous = run
                return _tighter(self.method)
            # The steps hardly changed: the tolerance does not set them yet.
            return _FAR_TIGHTER
        self.previous = run
        interval = stated_error.of(self.want)
        if interval is None:
            return _tighter(self.method)
        if self.high < inf and interval.high > _FALLING * self.high:
            self.stalls += 1
        if interval.high < self.high:
            self.best = (run, stated_error)
            self.high = interval.high
        if interval.high <= self.error or self.stalls >= _MAX_STALLS:
            return 1.0
        planned = _PLANNED_SHARE * self.error / interval.high
        return min(_tighter(self.method), max(1 / _MAX_STRIDE, planned))

    def _stated(self, run: Run, before: Run | None) -> RunError | None:
        """The error of a run, from a second one by another method, or from the one before."""
        if not self.in_pairs:
            return confirmation(self.runner, run)
        if before and _sharpens(run, before):
            return _paired(self.runner, run, before)
        return None

    def outcome(self) -> tuple[Run, RunError]:
        """The best run and its error; where no run was compared, the last one that ended, confirmed by itself."""
        if self.best:
            return self.best
        run = self.last
        if self.previous and self.previous.success and not (run and run.success):
            run = self.previous
        assert run is not None
        return run, confirmation(self.runner, run)


def _paired(runner: Runner, run: Run, looser: Run) -> RunError:
    """The error of a run, from a looser one of the same method before it."""
    if not (run.averaged or looser.averaged):
        return _compared(runner, "tighter", run, looser)
    apart = averaging.with_estimate(runner, run, looser)
    return _stated(
        runner, "estimate", "hybrid", run, apart, f"estimate of its segments, and {looser.words}"
    )


def _next_run(
    runner: Runner, method: Method, tolerance: float, previous: Run | None, watch: Watch
) -> Run:
    """A run of a search; on Ctrl-C the one before is worth more than its beginning, if that has ended."""
    if not (previous and previous.success):
        return runner.run(method, tolerance, watch=watch)
    try:
        return runner.run(method, tolerance, _limit(previous), watch)
    except Interrupted:
        raise Interrupted(runner.rows(previous.solution)) from None


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
    tighter = one_digit(answer.tolerance * error / interval.high / 2)
    remedy = "no second run could confirm a tighter one"
    if stated_error.kind == "estimate" or form.averaged:
        remedy = "no full form takes such a start"
        if find_form(full).takes(scene) and form.name != full:
            remedy = f"do: --form {full}, whose error its tolerance alone sets"
    elif tighter > _LEAST_CONFIRMED:
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
    if run.method.solver.closed_form:
        scene = runner.scene
        observables = run.observables
        # Without inertia the flow alone turns the body, and L and E follow its orientation.
        apart = of_rounding(
            scene.ellipsoid, observables, turns(scene, observables), scene.stokes == 0
        )
        return _stated(runner, "closed form", "exact", run, apart, "closed form: rounding")
    if run.averaged:
        kind, family, apart, note = averaging.compared(runner, run)
        return _stated(runner, kind, family, run, apart, note)
    if run.solution.segments:
        run = _in_one(runner, run)
    why = "no second run came to its end"
    for second in _seconds(runner, run):
        second_run = runner.run(second.method, second.tolerance, _limit(run))
        if not second_run.success:
            continue
        better, worse = (run, second_run) if second.kind == "looser" else (second_run, run)
        if second.method == run.method and not _sharpens(better, worse):
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
    looser = min(1.0, _LOOSER * tolerance)
    if partner := _partner(runner, method):
        unlike = Second("unlike", partner, _equal_error_tolerance(run, partner))
        if steps_of(runner.scene, partner, unlike.tolerance) < _limit(run):
            yield unlike
    stroboscopic = method.solver.many_periods and method.solver.name not in SPLITTING
    if looser < _LOOSE and not stroboscopic:
        yield Second("looser", method, looser)
    if tighter < tolerance:
        yield Second("sharper", method, tighter)
    if looser >= _LOOSE or stroboscopic:
        yield Second("looser", method, looser)
    far = max(TIGHTEST, _FAR_TIGHTER * tolerance)
    if far < tighter:
        yield Second("sharper", method, far)


def _tighter(method: Method) -> float:
    """Ratio of the tolerances of a tighter run and of a run by a method."""
    return _TIGHTER_SPLITTING if method.solver.many_periods else _TIGHTER


def _partner(runner: Runner, method: Method) -> Method | None:
    """An unlike method, by which a second run tells more or costs less; None where there is none."""
    solver = method.solver
    form = method.form
    scene = runner.scene
    if solver.name in SPLITTING:
        return None
    if form.angles or not _is_ours(form):
        form = find_form(full_form(scene))
    partner = full_solver(scene, form)
    if solver.many_periods:
        # Its assumptions about the motion do not follow its tolerance.
        partner = find_solver(SPLITTING[0])
    elif scene.flow is not None and scene.flow.varies and not stiff(scene):
        # Between dense knots tighter runs of a method take the same steps.
        partner = first_available(tuple(name for name in _ALONG_TRACKS if name != solver.name))
    elif form is method.form and not stiff(scene) and _is_efficient(solver):
        partner = solver
    elif partner is solver and solver.order_by_tolerance:
        # Tighter runs of it do not take more steps.
        names = [name for name in EXPLICIT if name != solver.name]
        partner = first_available(tuple(names))
    same = partner is solver and form is method.form
    return Method(form, partner) if partner.available and not same else None


def _is_efficient(solver: Solver) -> bool:
    """Whether a solver is machine code of high order whose errors follow its tolerance."""
    compiled = _is_ours(solver) and solver.backends == ("compiled",)
    return compiled and not (solver.implicit or solver.low_order or solver.order_by_tolerance)


def _is_ours(thing: Form | Solver) -> bool:
    """Whether it comes with this package, so that tests hold what it claims."""
    return type(thing).__module__.startswith("polhode.")


def _equal_error_tolerance(run: Run, partner: Method) -> float:
    """The tolerance at which a partner errs by a share of what the run does."""
    if partner.solver.closed_form:
        return run.tolerance
    constant = getattr(run.method.solver, "error_constant", _USUAL_ERROR_CONSTANT)
    partner_constant = getattr(partner.solver, "error_constant", _USUAL_ERROR_CONSTANT)
    ratio = min(1.0, _UNLIKE_SHARE * constant / partner_constant)
    return max(TIGHTEST, ratio * run.tolerance)


def _in_one(runner: Runner, run: Run) -> Run:
    """A run in segments of the full equations as one run at the loosest tolerance of these."""
    form = find_form(full_form(runner.scene))
    tolerance = max(segment.tolerance for segment in run.solution.segments)
    return run._replace(method=Method(form, run.method.solver), tolerance=tolerance)


def _sharpens(better: Run, worse: Run) -> bool:
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


def _limit(run: Run) -> int:
    """Steps that a second run may take."""
    return STEP_FLOOR + STEP_RATIO * run.steps if run.steps else UNLIMITED


def _compared(runner: Runner, kind: str, run: Run, second: Run) -> RunError:
    """State the error of a run from its difference to a second one."""
    apart = difference(runner.scene.ellipsoid, run.observables, second.observables)
    return _stated(runner, kind, family(run), run, apart, f"{kind}: {second.words}")


def _stated(
    runner: Runner, kind: str, family_name: str, run: Run, apart: Difference, note: str
) -> RunError:
    rotations = 0.0 if run.method.form.averaged else turns(runner.scene, run.observables)
    ellipsoid = runner.scene.ellipsoid
    lucky = 0.0 if run.method.solver.closed_form else _LEAST_ERROR_PER_TOLERANCE * run.tolerance
    rounded = 0.0
    if family_name in ("explicit", "implicit"):
        verner = run.method.solver.name in _VERNER
        rounded = run.steps * (_ROUNDING_PER_STEP_VERNER if verner else _ROUNDING_PER_STEP)
    return stated(
        ellipsoid, kind, family_name, apart, run.observables, rotations, lucky, note, rounded
    )


def family(run: Run) -> str:
    """The family of a full run's solver, whose factors it shares."""
    solver = run.method.solver
    if solver.many_periods:
        return solver.name
    return "implicit" if solver.implicit else "explicit"
