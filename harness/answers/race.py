"""A race: methods run a scene, or a shorter course like it, and the cheapest one that meets an error comes first.

Two runs by unlike solvers of the full equations that agree are the reference. Each method then runs
at one or two tolerances until its error is close to the one requested; what it costs follows from
its steps. A run whose steps cost more than `_CUT` times the best so far is cut. Methods that
average, and those that step over many rotations, are judged at the scene's own St by what confirms
their runs. No decision follows from how long a run took.
"""

import tomllib
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from functools import cache
from importlib.resources import files
from math import inf
from typing import NamedTuple

import numpy as np

from polhode.harness.answers.averaging import NotKnownError
from polhode.harness.answers.confirmed import confirmation
from polhode.harness.answers.forecast import Course, course_of
from polhode.harness.answers.interval import Interval
from polhode.harness.answers.pace import pace, seconds_of, steps_in
from polhode.harness.answers.request import one_digit
from polhode.harness.answers.rules import (
    EXPLICIT,
    IMPLICIT,
    LOOSEST,
    TIGHTEST,
    Method,
    first_tolerance,
    stiff,
)
from polhode.harness.answers.runs import Runner
from polhode.harness.answers.statement import difference
from polhode.harness.common.text import scientific, short
from polhode.models.catalogue import FORMS, form as find_form, reference_form
from polhode.models.form import FormNotValidError
from polhode.models.observables import Observables
from polhode.models.problem import Problem
from polhode.models.scene import Scene, SlowStart
from polhode.solvers.catalogue import SOLVERS, solver as find_solver
from polhode.solvers.contract import UNLIMITED, SolverNotValidError
from polhode.solvers.solve import solve

# A method is cut that costs more than this times the best one so far.
_CUT = 1.5
# Two runs are a reference if they differ by this share of the error requested.
_AGREE = 0.2
# The same where the tightest tolerances do not agree so well: rounding.
_AGREE_AT_LAST = 0.5
# Pairs of runs that look for a reference, at most.
_MAX_REFERENCES = 5
# The error that is attainable over the least difference of two unlike runs.
_REFUSED = 10.0
# Runs of a method in a race, at most.
_MAX_RUNS = 3
# Share of the error requested that a method is planned to have, and the least that will do.
_PLANNED = 0.5
_LEAST = 0.08
# A tolerance changes by this factor at most from one run to the next.
_STRIDE = 1e4
# Times of a course at which errors are compared, as shares of it: equispaced ones, and ones that grow
# from the start on by a constant ratio, since what damping leaves of an error lies there.
_TIMES = np.unique(np.concatenate([np.linspace(0, 1, 25), np.geomspace(1 / 4000, 1, 25)]))
# Index of the middle of a course.
_MIDDLE = int(np.searchsorted(_TIMES, 0.5))
# Steps that a run of a race may take before anything else is known of the scene.
_MAX_STEPS = 300_000
# Error of averaging to first and to second order, at St = 1, that few scenes stay below.
_LEAST_MODEL_ERROR = {"averaged": 3e-3, "averaged-spheroid": 3e-3, "averaged-second-order": 1e-3}
# A forecast error grows by at most this power of the rotations; beyond it the motion is chaotic.
_MOST_GROWTH = 4.0


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
    """A method that will not do, why, and the least error that it would do for, if that is why."""

    method: Method
    reason: str
    least: float = inf


class Result(NamedTuple):
    """Methods that meet an error, the quickest one first, those that do not, and what was raced on."""

    entries: list[Entry]
    refusals: list[Refusal]
    course: Course


@cache
def listed() -> tuple[tuple[str, str], ...]:
    """Names of the forms and solvers that are raced unless others are named."""
    text = files("polhode.harness.answers").joinpath("methods.toml").read_text(encoding="utf-8")
    return tuple(tuple(name.split()) for name in tomllib.loads(text)["within"])


def contenders(
    scene: Scene, want: str, everything: bool = False, names: Sequence[tuple[str, str]] = ()
) -> tuple[list[Method], list[Refusal]]:
    """Methods that take a scene and can run here: of the list, and of `names`, or of the catalogues."""
    pairs = [(form, solver) for form in FORMS for solver in SOLVERS] if everything else listed()
    methods, refusals = [], []
    for form, solver in dict.fromkeys((*pairs, *names)):
        method = Method(find_form(form), find_solver(solver))
        reason = why_not(scene, want, method)
        if reason:
            refusals.append(Refusal(method, reason))
        else:
            methods.append(method)
    return methods, refusals


def why_not(scene: Scene, want: str, method: Method) -> str:
    """Why a method cannot run a scene; empty if it can."""
    form, solver = method
    if want == "orientation" and form.orientation_of(scene) == "none":
        return "gives no orientation"
    try:
        problem = form.problem(scene)
    except FormNotValidError as refusal:
        return refusal.reason
    except ValueError as refusal:
        return str(refusal)
    if not solver.available:
        return str(solver.why_not)
    try:
        solver.check(problem)
    except SolverNotValidError as refusal:
        return refusal.reason
    if not form.averaged and not solver.implicit and not solver.closed_form and stiff(scene):
        return "explicit: stability, not the tolerance, sets its steps"
    return ""


def race(
    scene: Scene,
    error: float,
    want: str,
    samples: int,
    methods: Sequence[Method],
    uncut: Collection[tuple[str, str]] = (),
) -> Result:
    """Race methods that take a scene, for an error of what is wanted, at so many rows.

    Methods named in `uncut`, by form and solver, are followed whatever they cost.
    """
    heat = _Race(scene, error, want, samples)
    heat.uncut = [Method(find_form(form), find_solver(solver)) for form, solver in uncut]
    exact = [method for method in methods if method.solver.closed_form]
    own = [method for method in methods if method not in exact and heat.at_own_stokes(method)]
    full = [method for method in methods if method not in (*exact, *own)]
    for method in exact:
        heat.closed_form(method)
    own = [method for method in own if heat.may_average(method)]
    full = [method for method in full if heat.may_average(method)]
    if full:
        heat.find_reference()
        for method in full:
            heat.follow(method)
    for method in own:
        heat.judge(method)
    entries = sorted(heat.entries, key=lambda entry: entry.seconds.predicted)
    return Result(entries, heat.refusals, heat.course)


@dataclass(frozen=True)
class _Heat:
    """A run on the course."""

    steps: int
    observables: Observables


class _Race:
    """The runs of one race, and what came of them."""

    def __init__(self, scene: Scene, error: float, want: str, samples: int) -> None:
        self.scene, self.error, self.want, self.samples = scene, error, want, samples
        self.course = course_of(scene)
        self.entries: list[Entry] = []
        self.refusals: list[Refusal] = []
        self.reference: Observables | None = None
        self.apart = inf  # What the reference may be off by.
        self.uncut: list[Method] = []

    @property
    def best(self) -> float:
        """Seconds of the quickest method that meets the error."""
        return min((entry.seconds.predicted for entry in self.entries), default=inf)

    def at_own_stokes(self, method: Method) -> bool:
        """Whether no course shows what a method does on the scene: it averages, or steps over many rotations."""
        if isinstance(self.scene.start, SlowStart):
            return True
        averages = method.form.averaged or self.scene_problem(method).course is not None
        return not self.course.whole and (averages or method.solver.name == "stroboscopic")

    def may_average(self, method: Method) -> bool:
        """Whether St is large enough for a method that averages, or it does not."""
        if not method.form.averaged:
            return True
        least = _LEAST_MODEL_ERROR.get(method.form.name, 0.0) / self.scene.stokes
        if least <= self.error:
            return True
        why = f"St is too small: averaging errs by more than {scientific(least)}"
        self._refuse(method, why, least)
        return False

    def scene_problem(self, method: Method) -> Problem:
        """The problem of the scene itself."""
        return method.form.problem(self.scene)

    def requested(self, method: Method) -> float:
        """The error on the course that a method may have."""
        return self.error / self.course.growth(method, self.want)

    def run(self, method: Method, tolerance: float, max_steps: int) -> _Heat | None:
        """Run a method on the course; None if it does not reach the end."""
        problem = method.form.problem(self.course.scene)
        times = problem.end * _TIMES
        run = solve(problem, method.solver, tolerance, times, max_steps=max_steps)
        if not run.success:
            return None
        return _Heat(steps_in(run), method.form.observe(self.course.scene, run.states))

    def off(self, a: Observables, b: Observables) -> float:
        """The largest difference of two runs, of what is wanted."""
        return difference(self.scene.ellipsoid, a, b).largest.get(self.want, inf)

    def closed_form(self, method: Method) -> None:
        """Enter a method that evaluates a closed form."""
        seconds = pace(method, TIGHTEST).seconds(0, self.samples)
        error = Interval(0.0, 0.0, 0.0)
        reason = "closed form: neither time nor tolerance matter"
        self._enter(method, TIGHTEST, error, seconds, reason, self.course.spread)

    def find_reference(self) -> None:
        """Tighten two unlike methods until they agree; on the scene itself where its beginning tells nothing."""
        solvers = [find_solver(name) for name in (IMPLICIT if stiff(self.scene) else EXPLICIT)]
        form = find_form(reference_form(self.course.scene))
        pair = [Method(form, solver) for solver in solvers if solver.available][:2]
        if len(pair) < 2:
            return
        growth = self._agree(pair)
        if self.course.kind == "beginning" and growth > _MOST_GROWTH:
            self.course = replace(self.course, scene=self.scene, kind="scene", stretch=1.0)
            self.reference, self.apart = None, inf
            self._agree(pair)

    def _agree(self, pair: Sequence[Method]) -> float:
        """Run two methods ever tighter until they agree; the power of time with which their difference grows."""
        target = self.requested(pair[0])
        tolerances = [self._first(method, _AGREE * target / 2) for method in pair]
        growth = inf
        for _ in range(_MAX_REFERENCES):
            runs = [
                self.run(method, tolerance, _MAX_STEPS)
                for method, tolerance in zip(pair, tolerances, strict=True)
            ]
            stride = 0.1
            if runs[0] and runs[1]:
                apart, growth = self._apart(runs[0].observables, runs[1].observables)
                if apart < self.apart:
                    self.apart, self.reference = apart, runs[0].observables
                if self.apart <= _AGREE * target:
                    break
                stride = min(0.1, max(1 / _STRIDE, _AGREE / 2 * target / apart))
            if max(tolerances) <= TIGHTEST:
                break
            tolerances = [one_digit(max(TIGHTEST, stride * each)) for each in tolerances]
        if self.apart > _AGREE_AT_LAST * target:
            self.reference = None
        return growth

    def _apart(self, a: Observables, b: Observables) -> tuple[float, float]:
        """The largest difference of two runs, and the power of time with which it grows."""
        whole = self.off(a, b)
        before = self.off(a[: _MIDDLE + 1], b[: _MIDDLE + 1])
        return whole, float(np.log2(max(whole, 1e-99) / max(before, 1e-99)))

    def follow(self, method: Method) -> None:
        """Run a method on the course until its error is close to the one requested."""
        if self.reference is None:
            why = f"two unlike runs differ by {scientific(self.apart)} at the tightest tolerances"
            least = _REFUSED * self.apart * self.course.growth(method, self.want)
            self._refuse(method, f"{why}: chaotic, or rounding along the run", least)
            return
        budget = self.requested(method) - self.apart
        cost = pace(method, 1e-8)
        limit = _MAX_STEPS
        if self.best < inf and cost.step > 0 and method not in self.uncut:
            left = _CUT * self.best - cost.start - cost.row * self.samples
            limit = int(min(limit, max(20.0, left / cost.step / self.course.stretch)))
        tolerance = self._first(method, budget)
        met: tuple[float, float, int] | None = None  # Tolerance, error and steps.
        least, before = inf, ""
        for _ in range(_MAX_RUNS):
            heat = self.run(method, tolerance, limit)
            if heat is None:
                before = before or f"costs more than {_CUT:g} times the best, or fails"
                break
            error = self.off(heat.observables, self.reference)
            least = min(least, error)
            if error <= budget and (met is None or tolerance > met[0]):
                met = tolerance, error, heat.steps
            if error <= budget and (error >= _LEAST * budget or tolerance >= LOOSEST):
                break
            if met and error > budget:
                break
            if tolerance <= TIGHTEST:
                before = f"errs by {scientific(error)} at the tightest tolerance"
                break
            stride = _PLANNED * budget / max(error, 1e-99)
            stride = min(_STRIDE, max(1 / _STRIDE, stride))
            if error > budget:
                stride = min(0.3, stride)
            planned = self._power(method, min(LOOSEST, max(TIGHTEST, stride * tolerance)))
            if planned == tolerance:
                break
            tolerance = planned
        if met is None:
            growth = self.course.growth(method, self.want)
            why = before or f"a run at {short(tolerance)} errs by {scientific(least * growth)}"
            self._refuse(method, why, least * growth)
            return
        tolerance, error, steps = met
        growth = self.course.growth(method, self.want)
        steps_of_run = steps * self.course.stretch
        spread = self.course.spread
        predicted = growth * error
        interval = Interval(
            predicted, predicted / spread, min(self.error, growth * (error + self.apart) * spread)
        )
        seconds = pace(method, tolerance).seconds(steps_of_run, self.samples)
        if self.course.whole:
            reason = (
                f"its run at {short(tolerance)} takes {steps} steps and errs by {scientific(error)}"
            )
        else:
            reason = f"forecast from its {self.course.kind}, {scientific(1 / self.course.stretch)} of the run"
        self._enter(method, tolerance, interval, seconds, reason, spread)

    def judge(self, method: Method) -> None:
        """Run a method that averages at the scene's own St, and confirm the run."""
        bare = isinstance(self.scene.start, SlowStart)
        runner = Runner(self.scene, np.linspace(0.0, self.scene.time, 2))
        tolerance = first_tolerance(self.scene, method, self.error, self.want)
        cost = pace(method, tolerance)
        limit = int(min(UNLIMITED, max(2_000.0, _CUT * self.best / max(cost.step, 1e-9))))
        try:
            run = runner.run(method, tolerance, limit)
            if not run.success:
                self._refuse(method, f"costs more than {_CUT:g} times the best, or fails")
                return
            seconds = seconds_of(run.solution) + cost.row * self.samples
            if not bare and seconds > _CUT * self.best:
                self._refuse(method, f"costs more than {_CUT:g} times the best")
                return
            stated = confirmation(runner, run)
        except (SolverNotValidError, FormNotValidError, NotKnownError) as refusal:
            self._refuse(method, str(refusal))
            return
        error = stated.wanted(self.want)
        if error is None:
            self._refuse(method, stated.note)
        elif error.high > self.error:
            self._refuse(
                method, f"errs by up to {scientific(error.high)}: {stated.note}", 1.2 * error.high
            )
        else:
            self._enter(method, tolerance, error, seconds, stated.note, 1.25)

    def _first(self, method: Method, error: float) -> float:
        return self._power(method, first_tolerance(self.course.scene, method, error, self.want))

    @staticmethod
    def _power(method: Method, tolerance: float) -> float:
        """The tolerance in one digit; a power of ten where each one is compiled for."""
        if not method.solver.order_by_tolerance:
            return one_digit(tolerance)
        return max(TIGHTEST, float(f"1e{int(np.floor(np.log10(tolerance) + 1e-9))}"))

    def _enter(
        self,
        method: Method,
        tolerance: float,
        error: Interval,
        seconds: float,
        reason: str,
        spread: float,
    ) -> None:
        seconds = max(seconds, 1e-9)
        interval = Interval(seconds, seconds / spread, seconds * spread)
        self.entries.append(Entry(method, tolerance, error, interval, reason))

    def _refuse(self, method: Method, reason: str, least: float = inf) -> None:
        self.refusals.append(Refusal(method, reason, least))
