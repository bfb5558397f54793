"""A race: methods run a scene, or a segment of it, and the cheapest one that meets an error comes first.

A confirmed run of the usual full method is the reference. Each other method runs at one to three
tolerances until its error is close to the one requested; what it costs follows from its steps. A
run whose steps cost more than `_CUT` times the best so far is cut. Methods that average run the
scene itself and are confirmed as runs of `solve` are. No decision follows from how long a full run
took.

The words: a method *follows* on a segment (`_Race.follow`) if its error is measured there against the
reference, and is *judged* (`_Race.judge`) if it runs the scene itself and a second run states its
error. *Whole* means that the segment is the scene itself. *Apart* is what two runs differ by.
"""

import tomllib
from collections.abc import Collection, Sequence
from functools import cache
from importlib.resources import files
from itertools import product
from math import floor, inf, log10
from time import thread_time
from typing import NamedTuple

import numpy as np

from polhode.harness.answers.averaging import NotKnownError, oriented
from polhode.harness.answers.averaging_laws import ORDER_TWO, ORDERS, few_error
from polhode.harness.answers.confirmed import MAX_STRIDE, PLANNED_SHARE, confirmation, meet
from polhode.harness.answers.fitted import PACED_TOLERANCE
from polhode.harness.answers.forecast import RacedSegment, beginning_of, raced_segment
from polhode.harness.answers.interval import Interval
from polhode.harness.answers.pace import Pace, around, pace, seconds_of, steps_in
from polhode.harness.answers.request import NotAttainableError, one_digit
from polhode.harness.answers.rules import (
    AVERAGED_FROM,
    IMPLICIT,
    LOOSEST,
    SPLITTING,
    TABLED_FROM,
    TIGHTEST,
    Method,
    cheapest_full,
    first_tolerance,
    full_method,
    splits,
    steps_of,
    stiff,
)
from polhode.harness.answers.runs import MAX_STEPS, Run, Runner, Watch
from polhode.harness.answers.statement import INNER, RunError, difference
from polhode.harness.common.text import scientific, short
from polhode.harness.references.rotations import damping_times
from polhode.models.catalogue import FORMS, form as find_form
from polhode.models.form import Form, FormNotValidError
from polhode.models.observables import Observables
from polhode.models.scene import Scene, SlowStart
from polhode.solvers.catalogue import SOLVERS, solver as find_solver
from polhode.solvers.contract import UNLIMITED, SolverNotValidError

# A method is cut that costs more than this times the best one so far: the held-out test counts a
# first choice as near the best up to the same factor (`heldout.NEAR`).
_CUT = 1.5
# Runs of a method in a race, at most; an estimate.
_MAX_RUNS = 3
# A method whose error is at least this share of the one requested is not run again at a looser
# tolerance: at order 8 that would spare some quarter of its steps at most. The share is an estimate.
_LEAST_SHARE = 0.08
# The error of a reference is at most this share of the one requested, so that the other half is left
# to the methods; an estimate.
_KNOWN = 0.5
# Damping times from which on implicit methods take part; an estimate.
_IMPLICIT_FROM = 100.0
# A difference that grows by a larger power of time tells of chaos: without chaos the power is 2 at
# most, that of the orientation (`forecast.RacedSegment.growth`). The margin is an estimate.
_MOST_GROWTH = 4.0
# Index in `INNER`, the compared times, of the middle of a segment.
_MIDDLE = int(np.searchsorted(INNER, 0.5))


class Entry(NamedTuple):
    """A method that meets an error: at which tolerance, with what error, in what time, and how that is known."""

    method: Method
    tolerance: float
    error: Interval
    seconds: Interval
    reason: str

    @property
    def first_run_seconds(self) -> float:
        """Seconds of a run, and of what the method took to compile in this process."""
        return self.seconds.predicted + pace(self.method, self.tolerance).compilation


class Refusal(NamedTuple):
    """A method that will not do, why, and the least error that it would do for, if that is why.

    The error is of L and E over I_max, or of the orientation in rad; inf if no error would help.
    """

    method: Method
    reason: str
    least: float = inf


class Result(NamedTuple):
    """Methods that meet an error, the quickest one first, those that do not, and what was raced on."""

    entries: list[Entry]
    refusals: list[Refusal]
    raced: RacedSegment


@cache
def listed() -> tuple[tuple[str, str], ...]:
    """Names of the forms and solvers that are raced unless others are named."""
    text = files("polhode.harness.answers").joinpath("methods.toml").read_text(encoding="utf-8")
    return tuple(tuple(name.split()) for name in tomllib.loads(text)["within"])


def contenders(
    scene: Scene, want: str, everything: bool = False, names: Sequence[tuple[str, str]] = ()
) -> tuple[list[Method], list[Refusal]]:
    """Methods that may take a scene and can run here: of the list, and of `names`, or of the catalogues."""
    pairs = list(product(FORMS, SOLVERS)) if everything else listed()
    methods = []
    refusals = []
    for form, solver in dict.fromkeys((*pairs, *names)):
        method = Method(find_form(form), find_solver(solver))
        reason = why_not(scene, want, method, looking_ahead=False)
        if reason:
            refusals.append(Refusal(method, reason))
        else:
            methods.append(method)
    return methods, refusals


def why_not(scene: Scene, want: str, method: Method, looking_ahead: bool = True) -> str:
    """Why a method cannot run a scene; empty if it can, or if only a look ahead along the run would tell."""
    form, solver = method
    if want == "orientation" and form.orientation_of(scene) == "none":
        return "gives no orientation"
    if not solver.available:
        return str(solver.why_not)
    if not looking_ahead and _in_tables(form) and scene.ellipsoid.kind == "triaxial":
        return ""
    try:
        problem = form.problem(scene)
    except FormNotValidError as refusal:
        return refusal.reason
    except ValueError as refusal:
        return str(refusal)
    try:
        solver.check(problem)
    except SolverNotValidError as refusal:
        return refusal.reason
    if form.averaged or solver.closed_form:
        return ""
    if stiff(scene) and not solver.implicit:
        return "explicit: stability, not the tolerance, sets its steps"
    if not stiff(scene) and solver.name in IMPLICIT and damping_times(scene) < _IMPLICIT_FROM:
        return "implicit: accuracy, not stability, sets the steps"
    return ""


def _in_tables(form: Form) -> bool:
    """Whether a form needs tables of the shape."""
    return form.name in ("averaged-second-order", "hybrid")


def _averages(method: Method) -> bool:
    """Whether no part of a run shows what the method does on all of it.

    The error of averaging is one of the model: it depends on St and grows along the slow motion, so a
    surrogate or a beginning does not have it.
    """
    return method.form.averaged or _in_tables(method.form) or method.solver.name == "stroboscopic"


def _splits(method: Method) -> bool:
    return method.solver.name in SPLITTING


def race(
    scene: Scene,
    error: float,
    want: str,
    samples: int,
    methods: Sequence[Method],
    uncut: Collection[tuple[str, str]] = (),
) -> Result:
    """Race methods that take a scene, for an error of L and E or of the orientation, at `samples` rows.

    Methods named in `uncut`, by form and solver, are followed whatever they cost.
    """
    heat = _Race(scene, error, want, samples)
    heat.uncut = [Method(find_form(form), find_solver(solver)) for form, solver in uncut]
    for method in sorted(methods, key=heat.turn):
        heat.enter(method)
    entries = sorted(heat.entries, key=lambda entry: entry.seconds.predicted)
    return Result(entries, heat.refusals, heat.raced)


class _Remembering(Runner):
    """A runner that makes no run twice."""

    def __init__(self, scene: Scene) -> None:
        super().__init__(scene, INNER * scene.time)
        self.runs: dict[tuple[Method, float], Run] = {}

    def run(
        self, method: Method, tolerance: float, max_steps: int = UNLIMITED, watch: Watch = None
    ) -> Run:
        """Run a method, or return its run."""
        key = method, tolerance
        if key not in self.runs or not self.runs[key].success:
            self.runs[key] = super().run(method, tolerance, max_steps, watch)
        return self.runs[key]


class _Segment:
    """The segment that methods are raced on, and a confirmed run of it, the reference."""

    def __init__(self, raced: RacedSegment, usual: Method, error: float, want: str) -> None:
        self.raced = raced
        self.usual = usual
        self.want = want
        # The error on the segment that a method may have, so that the run's is below the one requested.
        self.budget = error / raced.growth(want) / raced.spread
        self.runner = _Remembering(raced.scene)
        self.reference: Observables | None = None
        self.apart = inf  # What the reference is off by, about.
        self.most = inf  # What it is off by, at most.
        self.looked = False  # Whether the reference has been looked for.

    def find_reference(self) -> None:
        """Run the usual method until its error is confirmed; on the scene itself where its beginning tells nothing."""
        if self.looked:
            return
        self.looked = True
        growth = self._confirm()
        if self.raced.whole or (self.reference and growth <= _MOST_GROWTH):
            return
        whole = self.raced.of_the_whole()
        steps = steps_of(whole.scene, self.usual, PACED_TOLERANCE)
        if self.reference or steps <= MAX_STEPS:
            self.budget *= self.raced.growth(self.want) * self.raced.spread / whole.spread
            self.raced = whole
            self.runner = _Remembering(whole.scene)
            self._confirm()

    def _confirm(self) -> float:
        """Look for the reference; the power of time with which the difference of its two runs grows.

        The power is log2 of the largest difference in the run over the largest in its first half. It
        is 0 where the usual method states no error.
        """
        self.reference = None
        self.apart = inf
        try:
            answer = meet(self.runner, [self.usual], self.budget, self.want)
        except NotAttainableError:
            return 0.0
        interval = answer.error.of(self.want)
        if not (interval and answer.solution.success):
            return 0.0
        self.apart = interval.predicted
        self.most = interval.high
        if self.apart <= _KNOWN * self.budget:
            form = answer.method.form
            self.reference = form.observe(self.raced.scene, answer.solution.states)
        values = getattr(answer.error.difference, self.want)
        # Differences may be 0: 1e-99 keeps quotient and logarithm finite.
        before = max(float(values[: _MIDDLE + 1].max()), 1e-99)
        return float(np.log2(max(float(values.max()), 1e-99) / before))

    def error(self, run: Run) -> float:
        """The error of a run on the segment, of L and E or of the orientation."""
        assert self.reference
        ellipsoid = self.raced.scene.ellipsoid
        return difference(ellipsoid, run.observables, self.reference).largest.get(self.want, inf)


class _Race:
    """The runs of one race, and what came of them."""

    def __init__(self, scene: Scene, error: float, want: str, samples: int) -> None:
        self.scene = scene
        self.error = error
        self.want = want
        self.samples = samples
        # Whether the start is L and E alone: then no full run is there to compare with.
        self.bare = isinstance(scene.start, SlowStart)
        self.entries: list[Entry] = []
        self.refusals: list[Refusal] = []
        self.uncut: list[Method] = []
        self.raced = raced_segment(scene)
        self.usual = full_method(self.raced.scene)
        first = cheapest_full(oriented(scene))
        # Steps that a full run is expected to take.
        self.steps = steps_of(scene, first, first_tolerance(scene, first, error, want))
        self.segment = _Segment(self.raced, self.usual, error, want)
        # The beginning of the scene, on which splitting is raced; made when it is needed.
        self._splitting: _Segment | None = None

    def turn(self, method: Method) -> int:
        """Place of a method in the order of the race, 0 the first.

        Those come first that cost little and tell when to cut others. 0: closed forms. 1: averaged forms
        that need no tables of a triaxial shape. 2: splitting, where it suits the scene. 3: the usual
        solver. 4: all others. 5: methods that average and need tables, or many rotations.
        """
        spheroid = self.scene.ellipsoid.symmetry_axis is not None
        if method.solver.closed_form:
            return 0
        if method.form.averaged and (spheroid or not _in_tables(method.form)):
            return 1
        if _averages(method):
            return 5
        if splits(self.scene) and _splits(method):
            return 2
        return 3 if method.solver is self.usual.solver else 4

    def enter(self, method: Method) -> None:
        """Race a method, unless it is out of the question."""
        if self.is_out(method):
            return
        if _in_tables(method.form) and (reason := why_not(self.scene, self.want, method)):
            self._refuse(method, reason)
        elif method.solver.closed_form:
            self.closed_form(method)
        else:
            # The beginning of a run by splitting takes more steps a rotation.
            itself = _averages(method) or (_splits(method) and self.steps <= MAX_STEPS)
            if self.bare or (itself and not self.segment.raced.whole):
                self.judge(method)
            else:
                self.follow(method, self.segment_of(method))

    def segment_of(self, method: Method) -> _Segment:
        """The segment to race a method on: the beginning for splitting, whose steps are few."""
        if not _splits(method) or self.raced.whole:
            return self.segment
        if self._splitting is None:
            beginning = beginning_of(self.scene)
            self._splitting = _Segment(beginning, method, self.error, self.want)
        return self._splitting

    def is_out(self, method: Method) -> bool:
        """Refuse a method that averages where St is too small, or the run too short."""
        if self.bare or method in self.uncut or not _averages(method):
            return False
        tabled = _in_tables(method.form)
        least = 0.0
        if method.form.averaged or tabled:
            least = few_error(ORDERS.get(method.form.name, ORDER_TWO), self.scene.stokes)
        if least > self.error:
            why = f"St is too small: averaging mostly errs by more than {scientific(least)}"
            self._refuse(method, why, least)
            return True
        enough = AVERAGED_FROM
        if tabled and self.scene.ellipsoid.kind == "triaxial":
            enough = TABLED_FROM
        if (tabled or not self.segment.raced.whole) and self.steps < enough:
            why = f"a full run takes some {self.steps:.1g} steps: too few to average"
            self._refuse(method, why)
            return True
        return False

    @property
    def best(self) -> float:
        """Seconds of the quickest method that meets the error."""
        return min((entry.seconds.predicted for entry in self.entries), default=inf)

    def limit(self, method: Method, cost: Pace, ratio: float) -> int:
        """Steps that a run of a segment may take, whose rotations are 1/`ratio` of the scene's, without being cut."""
        if self.best == inf or cost.step == 0 or method in self.uncut:
            return MAX_STEPS
        left = _CUT * self.best - cost.start - cost.row * self.samples
        return int(min(MAX_STEPS, max(1.0, left / cost.step / ratio)))

    def closed_form(self, method: Method) -> None:
        """Enter a method that evaluates a closed form."""
        seconds = pace(method, TIGHTEST).seconds(0, self.samples)
        error = Interval(0.0, 0.0, 0.0)
        reason = "closed form: neither time nor tolerance matter"
        self._enter(method, TIGHTEST, error, seconds, reason, self.raced.spread)

    def follow(self, method: Method, segment: _Segment) -> None:
        """Run a method on a segment until its error is close to the one requested.

        `met` is the run of the loosest tolerance that met the budget, and `least` the smallest error
        seen, of which a refusal tells.
        """
        cost = pace(method, PACED_TOLERANCE)
        met: tuple[float, float, int] | None = None  # Tolerance, error and steps.
        least = inf
        why = ""
        tolerance = _rounded(
            method, first_tolerance(segment.raced.scene, method, segment.budget, self.want)
        )
        for _ in range(_MAX_RUNS):
            limit = self.limit(method, cost, segment.raced.ratio)
            run = segment.runner.run(method, tolerance, limit)
            if not run.success:
                why = why or f"costs more than {_CUT:g} times the best, or fails"
                break
            segment.find_reference()
            if segment.reference is None:
                why = f"two runs differ by {scientific(segment.apart)} at the tightest tolerances"
                why = f"{why}: chaotic, or rounding along the run"
                least = segment.most
                break
            error = segment.error(run)
            budget = segment.budget - segment.apart
            least = min(least, error + segment.apart)
            if error <= budget and (met is None or tolerance > met[0]):
                met = tolerance, error, steps_in(run.solution)
            if error <= budget and (error >= _LEAST_SHARE * budget or tolerance >= LOOSEST):
                break
            if met and error > budget:
                break
            if tolerance <= TIGHTEST:
                why = f"errs by {scientific(error)} at the tightest tolerance"
                break
            planned = _planned(method, tolerance, error, budget)
            if planned == tolerance:
                break
            tolerance = planned
        growth = segment.raced.growth(self.want)
        if met is None:
            why = why or f"a run at {short(tolerance)} errs by {scientific(least * growth)}"
            self._refuse(method, why, growth * least / _KNOWN)
            return
        self._enter_followed(method, segment, *met)

    def _enter_followed(
        self, method: Method, segment: _Segment, tolerance: float, error: float, steps: int
    ) -> None:
        raced = segment.raced
        growth = raced.growth(self.want)
        spread = raced.spread
        predicted = growth * error
        high = min(self.error, spread * growth * (error + segment.apart))
        seconds = pace(method, tolerance).seconds(steps * raced.ratio, self.samples)
        if raced.whole:
            reason = (
                f"its run at {short(tolerance)} takes {steps} steps and errs by {scientific(error)}"
            )
        else:
            share = scientific(1 / raced.ratio)
            reason = f"forecast from its {raced.kind}, {share} of the run"
        interval = Interval(predicted, predicted / spread, high)
        self._enter(method, tolerance, interval, seconds, reason, spread)

    def judge(self, method: Method) -> None:
        """Run a method on the scene itself, and confirm the run.

        Splitting, stroboscopic averaging and `hybrid` follow their tolerance: they run again at the
        planned tolerance, `_MAX_RUNS` times at most. The error of averaging does not depend on it.
        """
        runner = Runner(self.scene, np.array([0.0, self.scene.time]))
        tolerance = _rounded(method, first_tolerance(self.scene, method, self.error, self.want))
        follows = method.solver.many_periods or method.form.name == "hybrid"
        good: tuple[float, Interval, float, str] | None = None
        why = ""
        least = inf
        for _ in range(_MAX_RUNS):
            try:
                seconds, stated = self._judged(runner, method, tolerance)
            except (SolverNotValidError, FormNotValidError, NotKnownError) as failure:
                why = why or getattr(failure, "reason", "") or str(failure)
                break
            error = stated.of(self.want)
            if error is None:
                why = stated.note
                break
            if error.high <= self.error:
                good = tolerance, error, seconds, stated.note
            else:
                why = f"errs by up to {scientific(error.high)}: {stated.note}"
                least = error.high / _KNOWN
            planned = _planned(method, tolerance, error.high, self.error)
            close = _LEAST_SHARE * self.error <= error.high <= self.error
            if close or not follows or planned == tolerance:
                break
            tolerance = planned
        if good:
            self._enter(method, *good, self.raced.spread)
        else:
            self._refuse(method, why, least)

    def _judged(self, runner: Runner, method: Method, tolerance: float) -> tuple[float, RunError]:
        """Seconds of a run of the scene itself, and what it states; raises NotKnownError if it is cut."""
        cost = pace(method, tolerance)
        began = thread_time()
        run = runner.run(method, tolerance, self.limit(method, cost, 1.0))
        processor = thread_time() - began
        if _splits(method):
            seconds = cost.seconds(steps_in(run.solution), self.samples)
        else:
            seconds = seconds_of(run.solution, processor) + cost.row * self.samples
        if _in_tables(method.form):
            seconds += around(method.form, self.scene, run.solution)
        cut = seconds > _CUT * self.best and method not in self.uncut
        if not run.success or (cut and not self.bare):
            raise NotKnownError(f"costs more than {_CUT:g} times the best, or fails")
        return seconds, confirmation(runner, run)

    def _enter(
        self,
        method: Method,
        tolerance: float,
        error: Interval,
        seconds: float,
        reason: str,
        spread: float,
    ) -> None:
        # A paced run of few steps may come out at 0 s: quotients of seconds need a positive number.
        seconds = max(seconds, 1e-9)
        interval = Interval(seconds, seconds / spread, seconds * spread)
        self.entries.append(Entry(method, tolerance, error, interval, reason))

    def _refuse(self, method: Method, reason: str, least: float = inf) -> None:
        # Callers divide the error that a run had by `_KNOWN`: an error requested must be larger than
        # that, since part of it goes to the reference.
        self.refusals.append(Refusal(method, reason, least))


def _planned(method: Method, tolerance: float, error: float, budget: float) -> float:
    """The tolerance at which a method is planned to have its share of an error, from a run at another one.

    Errors are taken to be proportional to the tolerance, up to `MAX_STRIDE`.
    """
    stride = PLANNED_SHARE * budget / max(error, 1e-99)
    stride = min(MAX_STRIDE, max(1 / MAX_STRIDE, stride))
    return _rounded(method, min(LOOSEST, max(TIGHTEST, stride * tolerance)))


def _rounded(method: Method, tolerance: float) -> float:
    """The tolerance in one digit; a power of ten where each one is compiled for.

    1e-9 keeps the floor of a logarithm at -5 where rounding makes it a little less than -5.
    """
    if not method.solver.order_by_tolerance:
        return one_digit(tolerance)
    return max(TIGHTEST, float(f"1e{floor(log10(tolerance) + 1e-9)}"))
