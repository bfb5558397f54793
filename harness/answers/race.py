"""A race: methods run a scene, or a segment of it, and the cheapest one that meets an error comes first.

A confirmed run of the usual full method is the reference. Each other method runs at one or two
tolerances until its error is close to the one requested; what it costs follows from its steps. A
run whose steps cost more than `TIED` times the best so far is cut. Methods that average run the
scene itself. A full run of the scene, if the race has one, measures their error; else it is stated as
`solve` states it. At the end the first one of the forecasts runs the scene itself too. No
decision follows from how long a full run took.

The words:

- a method *follows* on a segment (`Heat.follow`) if its error is measured there against the reference;
- its tolerance is *searched* (`Heat.search`) by full runs of the scene itself;
- it is *judged* (`Heat.judge`) if it averages;
- *whole* means that the segment is the scene itself;
- *apart* is the difference of two runs.
"""

import tomllib
from collections.abc import Collection, Sequence
from functools import cache
from importlib.resources import files
from itertools import product
from math import inf
from typing import NamedTuple

from polhode.harness.answers.averaging import NotKnownError, oriented
from polhode.harness.answers.averaging_laws import ORDER_TWO, ORDERS, few_error
from polhode.harness.answers.confirmed import PLANNED_SHARE, confirmation
from polhode.harness.answers.fitted import PACED_TOLERANCE
from polhode.harness.answers.forecast import RacedSegment, beginning_of, raced_segment
from polhode.harness.answers.interval import Interval
from polhode.harness.answers.pace import Pace, pace, steps_in
from polhode.harness.answers.rules import (
    AVERAGED_FROM,
    IMPLICIT,
    LOOSEST,
    SPLITTING,
    TIGHTEST,
    Method,
    cheapest_full,
    first_tolerance,
    full_method,
    rounded,
    rounding_less,
    splits,
    steps_of,
    stiff,
)
from polhode.harness.answers.runs import MAX_STEPS, Run, Runner
from polhode.harness.answers.segment import KNOWN_SHARE, Remembering, Segment, in_tables
from polhode.harness.answers.statement import difference
from polhode.harness.answers.tolerances import Known, loosest, planned
from polhode.harness.common.text import scientific, short
from polhode.harness.references.rotations import damping_times
from polhode.models.catalogue import FORMS, form as find_form
from polhode.models.form import FormNotValidError
from polhode.models.hybrid.plan import ERROR_PER_TOLERANCE, foreseen
from polhode.models.scene import Scene, SlowStart
from polhode.solvers.catalogue import SOLVERS, solver as find_solver
from polhode.solvers.contract import SolverNotValidError

# A factor of two in a number called an estimate changes which methods are run and how often, and so
# the time of asking and at times the choice. `polhode validate --ablation` measures what such parts buy.

# Methods whose times differ by less than this factor are tied: other work on the machine may change
# their order. A method that costs more than this times the best one so far is cut. An estimate: a smaller
# factor would let repeated questions have different answers.
TIED = 1.2
# Why a method is cut.
_TOO_DEAR = f"costs more than {TIED:g} times the best, or fails"
# A run by `hybrid` of a larger share by the full equations is not made: a full run is tied with it.
_MOST_IN_FULL = 1 / TIED
# Runs of a method in a race, at most: the first one, and one at the tolerance that is planned by it.
_MAX_RUNS = 2
# A method whose error is at least this share of the one requested is not run again at a looser
# tolerance: at order 8 that would spare some quarter of its steps at most. The share is an estimate.
_LEAST_SHARE = 0.08
# A run that averages and states more than this multiple of the error requested is not made again: at the
# tolerance that would meet it, `hybrid` runs the full equations nearly everywhere. An estimate.
_HOPELESS = 1e3
# Steps of a full run from which on forms with tables of a triaxial shape are raced: the tables, which are
# kept, take longer than such a run, and a run by `hybrid` a quarter of it. An estimate.
_TABLED_FROM = 15_000
# Steps of splitting up to which it comes first: it takes some 10 ms. An estimate.
_FEW_STEPS = 60_000
# The most steps of a run whose tolerance is searched after the race: they take an explicit method about a
# second. An estimate.
_SETTLED_STEPS = 2_000_000
# Steps of a run in such a search, at most: its tightest run takes several times as many. An estimate.
_MOST_STEPS = 10_000_000
# Damping times from which on implicit methods take part. An estimate: with fewer of them accuracy sets the steps.
_IMPLICIT_FROM = 100.0
# A paced run of few steps may come out at 0 s: quotients of seconds need a positive number.
_LEAST_SECONDS = 1e-9


class Entry(NamedTuple):
    """A method that meets an error: at which tolerance, with what error, in what time, and how that is known."""

    method: Method
    tolerance: float
    error: Interval
    seconds: Interval
    reason: str
    # Steps of the run, where they and the error are forecast from another scene; 0 where they were seen.
    forecast: float = 0.0

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


class _Followed(NamedTuple):
    """A run on a segment that meets the budget."""

    tolerance: float
    error: float  # on the segment
    steps: int


class _Accepted(NamedTuple):
    """A run of the scene itself, of a method that averages, that meets the error."""

    tolerance: float
    error: Interval
    seconds: float
    note: str  # how the error is known


class Result(NamedTuple):
    """Methods that meet an error, the quickest one first, those that do not, and what was raced on."""

    entries: list[Entry]
    refusals: list[Refusal]
    raced: RacedSegment


@cache
def listed() -> tuple[tuple[str, str], ...]:
    """Names of the forms and solvers that are raced unless others are named.

    They are the keys of the table `within` in `methods.toml`; its numbers say how often each was near the best.
    """
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
    if not looking_ahead and in_tables(form) and scene.ellipsoid.kind == "triaxial":
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


def _averages(method: Method) -> bool:
    """Whether no part of a run shows what the method does on all of it.

    The error of averaging is one of the model: it depends on St and grows along the slow motion, so a
    surrogate or a beginning does not have it.
    """
    return method.form.averaged or in_tables(method.form) or method.solver.name == "stroboscopic"


def _splits(method: Method) -> bool:
    """Whether a method is a splitting."""
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

    The error is over I_max or in rad, as `want` says: "slow" or "orientation". Methods named in `uncut`, by
    form and solver, are raced whatever they cost. Raises NotKnownError for a start with L = 0 and no
    orientation.
    """
    heat = Heat(scene, error, want, samples)
    heat.uncut = [Method(find_form(form), find_solver(solver)) for form, solver in uncut]
    for method in sorted(methods, key=heat.turn):
        heat.enter(method)
    heat.settle()
    heat.look_again()
    entries = sorted(heat.entries, key=_seconds)
    return Result(entries, heat.refusals, heat.raced)


def _seconds(entry: Entry) -> float:
    return entry.seconds.predicted


def _uncut(runner: Runner, method: Method, tolerance: float, limit: int) -> Run | None:
    """A run that has ended within so many steps; None if it was cut, failed, or may take none."""
    if not limit:
        return None
    run = runner.run(method, tolerance, limit)
    return run if run.success else None


class Heat:
    """The runs of one race, and what comes of them."""

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
        # The segment as it is planned. `self.segment.raced` becomes the scene itself where this one tells nothing.
        self.raced = raced_segment(scene)
        # The usual method, which makes the reference. For an orientation, too, the rounding of L and E chooses it:
        # the bound of an orientation's rounding is far above what rounding makes.
        self.usual = rounding_less(scene, full_method(self.raced.scene), error, "slow")
        first = cheapest_full(oriented(scene))
        # Steps that a full run is expected to take.
        self.steps = steps_of(scene, first, first_tolerance(scene, first, error, want))
        self.segment = Segment(self.raced, self.usual, error, want)
        # The beginning of the scene, on which splitting is raced; made when it is needed.
        self._splitting: Segment | None = None
        # All runs of the scene itself. `truth` is the one of the smallest known error; None without one.
        self.itself = Remembering(scene)
        self.truth: Known | None = None
        # Methods that were judged and refused, each with the tolerance of its first such run.
        self.doubted: dict[Method, float] = {}

    def turn(self, method: Method) -> int:
        """Place of a method in the order of the race, 0 the first.

        Those come first that cost little and tell when to cut others. 0: closed forms, and splitting,
        where it suits the scene and takes few steps: the error of averaging is measured against it. 1:
        averaged forms that need no tables of a triaxial shape. 2: splitting of more steps. 3: the usual
        solver. 4: all others. 5: methods that average and need tables, or many rotations.
        """
        spheroid = self.scene.ellipsoid.symmetry_axis is not None
        if method.solver.closed_form:
            return 0
        if method.form.averaged and (spheroid or not in_tables(method.form)):
            return 1
        if _averages(method):
            return 5
        if splits(self.scene) and _splits(method):
            return 2 if self.steps > _FEW_STEPS else 0
        return 3 if method.solver is self.usual.solver else 4

    def enter(self, method: Method) -> None:
        """Race a method, unless it is out of the question.

        It is judged if it averages, or if no full run can follow the start. Splitting is searched on the scene
        itself where that is short enough. All others follow on a segment.
        """
        if self.is_out(method):
            return
        if in_tables(method.form) and (reason := why_not(self.scene, self.want, method)):
            self._refuse(method, reason)
        elif method.solver.closed_form:
            self.closed_form(method)
        else:
            if self.bare or (_averages(method) and not self.segment.raced.whole):
                self.judge(method)
            elif _splits(method) and self.steps <= _SETTLED_STEPS and not self.segment.raced.whole:
                # The beginning of a run by splitting takes more steps a rotation.
                first = first_tolerance(self.scene, method, self.error, self.want)
                limit = self.limit(method, pace(method, first), 1.0, most=_MOST_STEPS)
                if not limit or not self.search(method, first, limit):
                    self._refuse(method, _TOO_DEAR)
            else:
                self.follow(method, self.segment_of(method))

    def segment_of(self, method: Method) -> Segment:
        """The segment to race a method on: the beginning for splitting, whose steps are few."""
        if not _splits(method) or self.raced.whole:
            return self.segment
        if self._splitting is None:
            beginning = beginning_of(self.scene)
            self._splitting = Segment(beginning, method, self.error, self.want)
        return self._splitting

    def is_out(self, method: Method) -> bool:
        """Refuse a method that averages where St is too small, or the run too short."""
        if self.bare or method in self.uncut or not _averages(method):
            return False
        tabled = in_tables(method.form)
        least = 0.0
        # L of a sphere obeys a linear equation, and averaging is exact.
        sphere = self.scene.ellipsoid.kind == "sphere"
        if (method.form.averaged or tabled) and not sphere:
            least = few_error(ORDERS.get(method.form.name, ORDER_TWO), self.scene.stokes)
        if least > self.error and self.truth is None:
            why = f"St is too small: averaging mostly errs by more than {scientific(least)}"
            self._refuse(method, why, least)
            return True
        enough = AVERAGED_FROM
        if tabled and self.scene.ellipsoid.kind == "triaxial":
            enough = _TABLED_FROM
        if (tabled or not self.segment.raced.whole) and self.steps < enough:
            why = f"a full run takes some {self.steps:.1g} steps: too few to average"
            self._refuse(method, why)
            return True
        return False

    @property
    def best(self) -> float:
        """Seconds of the quickest method so far that meets the error; inf before there is one."""
        return min((entry.seconds.predicted for entry in self.entries), default=inf)

    def limit(self, method: Method, cost: Pace, ratio: float, most: int = MAX_STEPS) -> int:
        """Steps, `most` at most, that a run of a segment may take without being cut.

        The segment's rotations are 1/`ratio` of the scene's. 0: to start a run costs too much already.
        """
        if self.best == inf or cost.step == 0 or method in self.uncut or method.form.averaged:
            return most
        left = TIED * self.best - cost.start - cost.row * self.samples
        return int(min(most, max(0.0, left / cost.step / ratio)))

    def closed_form(self, method: Method) -> None:
        """Enter a method that evaluates a closed form."""
        seconds = pace(method, TIGHTEST).seconds(0, self.samples)
        error = Interval(0.0, 0.0, 0.0)
        reason = "closed form: neither time nor tolerance matter"
        self._enter(method, TIGHTEST, error, seconds, reason, self.raced)

    def follow(self, method: Method, segment: Segment) -> None:
        """Run a method on a segment until its error is close to the one requested.

        `met` is the run of the loosest tolerance that met the budget, and `least` the smallest error
        seen, of which a refusal tells.
        """
        cost = pace(method, PACED_TOLERANCE)
        met: _Followed | None = None
        least = inf
        why = ""
        tolerance = rounded(
            method, first_tolerance(segment.raced.scene, method, segment.budget, self.want)
        )
        limit = self.limit(method, cost, segment.raced.ratio)
        for _ in range(_MAX_RUNS):
            run = _uncut(segment.runner, method, tolerance, limit)
            if run is None:
                why = why or _TOO_DEAR
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
            if error <= budget and (met is None or tolerance > met.tolerance):
                met = _Followed(tolerance, error, steps_in(run.solution))
            if error <= budget and (error >= _LEAST_SHARE * budget or tolerance >= LOOSEST):
                break
            if met and error > budget:
                break
            if tolerance <= TIGHTEST:
                why = f"errs by {scientific(error)} at the tightest tolerance"
                break
            next_tolerance = planned(method, tolerance, error, PLANNED_SHARE * budget)
            if next_tolerance == tolerance:
                break
            tolerance = next_tolerance
        growth = segment.raced.growth(self.want)
        if met is None:
            why = why or f"a run at {short(tolerance)} errs by {scientific(least * growth)}"
            self._refuse(method, why, growth * least / KNOWN_SHARE)
            return
        self._enter_followed(method, segment, met)

    def _enter_followed(self, method: Method, segment: Segment, followed: _Followed) -> None:
        """Enter a method by its run on a segment: what the scene's own run is forecast to err and to take."""
        tolerance, error, steps = followed
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
        self._enter(method, tolerance, interval, seconds, reason, raced, steps * raced.ratio)

    def settle(self) -> None:
        """Look for the tolerance of the quickest method on the scene itself, where its entry is a forecast.

        A forecast tells which methods are quick. Its error is often off by a factor of ten, since what
        rotations add up depends on their phases. A run that is too long for that keeps its forecast,
        and so does one whose steps the tolerance does not set.
        """
        forecasts = [entry for entry in self.entries if entry.forecast]
        quickest = min(forecasts, key=_seconds, default=None)
        if quickest is None or quickest.seconds.low > self.best:
            return
        if quickest.forecast > _SETTLED_STEPS:
            return
        self.entries.remove(quickest)
        if not self.search(quickest.method, quickest.tolerance, _MOST_STEPS):
            self.entries.append(quickest)

    def look_again(self) -> None:
        """Hold runs that were refused by what they state of themselves against a full run that was made since."""
        if self.truth is None:
            return
        for method, tolerance in self.doubted.items():
            run = self.itself.runs[method, tolerance]
            error, note = self._stated(run)
            if error and error.high <= self.error:
                self.refusals = [refusal for refusal in self.refusals if refusal.method != method]
                seconds = self.itself.paid(run, self.samples)
                self._enter(method, tolerance, error, seconds, note, self.raced.of_the_whole())

    def search(self, method: Method, tolerance: float, max_steps: int) -> bool:
        """Look for the tolerance of a method by runs of the scene itself, and enter or refuse it.

        Returns whether the runs tell anything; if not, the method is neither entered nor refused.
        """
        runner = self.itself
        tolerance = rounded(method, tolerance)
        found = loosest(runner, method, tolerance, self.error, self.want, max_steps)
        if found is None:
            return False
        if self.truth is None or found.tightest.error < self.truth.error:
            self.truth = found.tightest
        error = found.error
        how = "errs" if found.made else "would err"
        words = f"its run at {short(found.tolerance)} {how} by about {scientific(error)}"
        if error > self.error:
            self._refuse(method, words, error / KNOWN_SHARE)
        else:
            whole = self.raced.of_the_whole()
            spread = whole.spread
            interval = Interval(error, error / spread, min(self.error, error * spread))
            seconds = pace(method, found.tolerance).seconds(found.steps, self.samples)
            self._enter(method, found.tolerance, interval, seconds, words, whole)
        return True

    def judge(self, method: Method) -> None:
        """Run a method on the scene itself, and state its error.

        Stroboscopic averaging and `hybrid` follow their tolerance: they run again at the planned
        tolerance, `_MAX_RUNS` times at most. The error of averaging does not depend on it.
        """
        tolerance = rounded(method, first_tolerance(self.scene, method, self.error, self.want))
        hybrid = method.form.name == "hybrid" and method not in self.uncut
        if hybrid and _in_full(self.scene, tolerance) > _MOST_IN_FULL:
            self._refuse(method, "runs nearly all of the scene by the full equations")
            return
        follows = method.solver.many_periods or method.form.name == "hybrid"
        accepted: _Accepted | None = None
        why = ""
        least = inf
        for _ in range(_MAX_RUNS):
            try:
                run, seconds = self._judged(method, tolerance)
                error, note = self._stated(run)
            except (SolverNotValidError, FormNotValidError, NotKnownError) as failure:
                why = why or getattr(failure, "reason", "") or str(failure)
                break
            if error is None:
                why = note
                break
            if error.high <= self.error:
                accepted = _Accepted(tolerance, error, seconds, note)
            else:
                self.doubted[method] = self.doubted.get(method, tolerance)
                why = f"errs by up to {scientific(error.high)}: {note}"
                least = error.high / KNOWN_SHARE
                if seconds >= self.best:
                    # A tighter run costs more.
                    break
            next_tolerance = planned(method, tolerance, error.high, PLANNED_SHARE * self.error)
            close = _LEAST_SHARE * self.error <= error.high <= self.error
            hopeless = error.high > _HOPELESS * self.error
            if close or hopeless or not follows or next_tolerance == tolerance:
                break
            tolerance = next_tolerance
        if accepted:
            self.doubted.pop(method, None)
            self._enter(method, *accepted, self.raced.of_the_whole())
        else:
            self._refuse(method, why, least)

    def _judged(self, method: Method, tolerance: float) -> tuple[Run, float]:
        """A run of the scene itself, and its seconds; raises NotKnownError if it is cut."""
        cost = pace(method, tolerance)
        limit = self.limit(method, cost, 1.0)
        run = _uncut(self.itself, method, tolerance, limit)
        if run is None:
            raise NotKnownError(_TOO_DEAR)
        seconds = self.itself.paid(run, self.samples)
        cut = seconds > TIED * self.best and method not in self.uncut
        if cut and not self.bare:
            raise NotKnownError(_TOO_DEAR)
        return run, seconds

    def _stated(self, run: Run) -> tuple[Interval | None, str]:
        """The error of a run of the scene itself, None if nothing tells it, and how it is known.

        A full run of the scene tells it if its own error is small enough; else a second run or an estimate does,
        as in `solve`.
        """
        if self.truth is None or self.truth.error > KNOWN_SHARE * self.error:
            stated = confirmation(self.itself, run)
            return stated.of(self.want), stated.note
        apart = difference(self.scene.ellipsoid, run.observables, self.truth.run.observables)
        error = apart.largest.get(self.want, inf)
        spread = self.raced.of_the_whole().spread
        high = spread * (error + self.truth.error)
        return Interval(error, error / spread, high), f"differs from {self.truth.run.words}"

    def _enter(
        self,
        method: Method,
        tolerance: float,
        error: Interval,
        seconds: float,
        reason: str,
        raced: RacedSegment,
        steps: float = 0.0,
    ) -> None:
        """Add an entry; `steps` are the run's steps, if they are forecast from another scene."""
        seconds = max(seconds, _LEAST_SECONDS)
        interval = Interval(seconds, seconds / raced.spread, seconds * raced.spread)
        self.entries.append(
            Entry(method, tolerance, error, interval, reason, 0.0 if raced.whole else steps)
        )

    def _refuse(self, method: Method, reason: str, least: float = inf) -> None:
        """Add a refusal.

        Callers divide the error that a run had by `KNOWN_SHARE`: an error requested must be larger than
        that, since part of it goes to the reference.
        """
        self.refusals.append(Refusal(method, reason, least))


def _in_full(scene: Scene, tolerance: float) -> float:
    """The share of a run by `hybrid` that its plan leaves to the full equations."""
    segments = foreseen(scene, ERROR_PER_TOLERANCE * tolerance)
    full = sum(segment.end - segment.start for segment in segments if not segment.second_order)
    return full / scene.slow_time
