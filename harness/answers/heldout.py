"""The held-out test of `pick`: random scenes, the first choice, and every method of the list, all measured.

The best of a scene is the quickest run that met the error: of the listed methods at tolerances by
tens, and of the first choice itself. The quickest ones, the first choice and the run by rules alone are
timed again, in turns (one after the other in each round), so that what disturbs one disturbs the others.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import partial
from math import floor, inf, isnan, log10, nan
from time import perf_counter
from typing import Any

import numpy as np
import pandas as pd

from polhode.harness.answers.pace import unseen
from polhode.harness.answers.pick import forget, pick
from polhode.harness.answers.questions import Question, questions
from polhode.harness.answers.race import contenders, why_not
from polhode.harness.answers.recommendation import Recommendation
from polhode.harness.answers.request import NotAttainableError
from polhode.harness.answers.rules import (
    LOOSEST,
    TIGHTEST,
    Method,
    first_tolerance,
    methods_for,
    rotations,
)
from polhode.harness.answers.statement import difference
from polhode.harness.answers.timed import plain_practice
from polhode.harness.common.files import digest
from polhode.harness.common.progress import Steps
from polhode.harness.common.store import Record, Store
from polhode.harness.common.timing import Timing
from polhode.harness.references.extended import ReferenceFailedError
from polhode.harness.references.reference import reference
from polhode.models.catalogue import form as find_form, reference_form
from polhode.models.form import Form
from polhode.models.observables import Observables
from polhode.models.scene import Scene
from polhode.models.spent import SPENT
from polhode.solvers.catalogue import solver as find_solver
from polhode.solvers.solve import solve

# The stratum whose scenes have another target of asking than the others.
LONG_STRATUM = "above 1 s"
# Strata and their upper edges, in seconds of the best run. The edges are set together with the targets
# below, not measured: the targets hold in each stratum, so that many quick scenes hide no slow one.
STRATA = {"below 10 ms": 0.01, "10 ms to 1 s": 1.0, LONG_STRATUM: inf}
# Most time of a first choice over the best run; the share of a stratum that must keep it; and the
# ratio that no first choice may exceed. These targets, and the ones of asking, are set, not measured.
NEAR = 1.5
SHARE_NEAR = 0.92
FAR = 5.0
# Longest time of asking, in the median of a stratum: in runs of the choice or in seconds, whichever is
# longer; in `LONG_STRATUM` a share of a run. The page names these targets beside what was
# measured; unlike those above they do not decide how the command exits.
ASKING_RUNS = 3.0
ASKING_SECONDS = 0.005
ASKING_SHARE = 0.1
# Seconds that a reference may take. An estimate: scenes whose references take longer are left out.
_REFERENCE_SECONDS = 120.0
# Uncertainty of a reference over the error requested, at most; an estimate.
_KNOWN = 0.3
# Decades from the error requested at which methods are measured: tolerances of ten times the error,
# the error, a tenth of it and so on. A method that needs a tighter one than the last counts as one that
# does not meet the error. The end is an estimate: about one in a hundred of the methods of reports/pick
# that met the error did so at the last tolerance only.
_DECADES = (1, 0, -1, -2, -3, -4, -5)
# A run is stopped after this multiple of the best time until then, or after these seconds if that is longer.
# Estimates: a run that was stopped is not the best, even if it was disturbed.
_STOP = 3.0
_STOP_SECONDS = 0.05
# The longest that a run may take until one has met the error, in seconds; an estimate.
_FIRST_SECONDS = 60.0
# The quickest runs that are timed again, and how often. Estimates: more take longer and are disturbed less.
_FINALISTS = 4
FINALIST_REPEATS = 5
# Seconds of a run from which on it is timed once. An estimate: what disturbs it is a small share of it.
TIMED_ONCE_FROM = 0.5
# Version of the rows in the store: rows of another one are measured anew.
_SCHEMA = 3


# Form, solver and tolerance, which name a run of a scene.
RunName = tuple[str, str, float]


@dataclass(frozen=True)
class Evaluation:
    """Result of the held-out test."""

    scenes: pd.DataFrame  # a row for each scene
    runs: pd.DataFrame  # a row for each run of the listed methods
    left_out: dict[str, str] = field(default_factory=dict)  # scenes without a reference, and why


def evaluate(store: Store, seed: int, count: int, quiet: bool = False) -> Evaluation:
    """Ask about random scenes, measure them into a store, and compare.

    `seed` and `count` name the scenes (`questions`). Scenes that the store holds are not measured again.
    """
    scenes = []
    runs = []
    left_out = dict[str, str]()
    bar = Steps("held-out", count, "scenes", quiet).over(questions(seed, count))
    for question in bar:
        content = {"held-out": question.name, "schema": _SCHEMA}
        row = store.made_once(digest(content), content, partial(measured, question))
        if "left_out" in row:
            left_out[question.name] = row["left_out"]
            continue
        runs += row.pop("runs")
        scenes.append(row)
    return Evaluation(pd.DataFrame(scenes), pd.DataFrame(runs), left_out)


def measured(question: Question) -> Record:
    """The answer of `pick` beside measured runs; a reason alone if there is no reference."""
    try:
        true = reference_of(question)
    except (ReferenceFailedError, ValueError) as reason:
        return {"left_out": str(reason)}
    track = Track(question, true)
    answer, refusal, asking = ask(question)
    runs = list(_measure(track))
    good = sorted((row for row in runs if row["met"]), key=lambda row: row["seconds"])
    names = [(row["form"], row["solver"], row["tolerance"]) for row in good[:_FINALISTS]]
    rules = _by_rules(question)
    first = None
    if answer:
        row = answer.ranking[0]
        first = row.form, row.solver, row.tolerance
        names.append(first)
    timed = track.in_turns([*dict.fromkeys([*names, rules])])
    able = [name for name in names if timed[name]["met"]]
    best = min(able, key=lambda name: timed[name]["seconds"]) if able else None
    nothing = {"seconds": nan, "seconds_spread": nan, "error": nan}
    # `pick` may refuse the error: it was right to, which counts as met, if no run met the error.
    row = timed[first] if first else nothing | {"met": best is None}
    best_row = timed[best] if best else nothing
    shortest = best_row["seconds"]
    scene = question.scene
    plain, _ = plain_practice(scene, question.error, question.want, question.samples)
    return {
        "scene": question.name,
        "stokes": scene.stokes,
        "time": scene.time,
        "semi_axes": " ".join(f"{axis:.6g}" for axis in scene.ellipsoid.semi_axes),
        "rotations": rotations(scene),
        "samples": question.samples,
        "want": question.want,
        "error_requested": question.error,
        "choice": " ".join(map(str, first)) if first else "",
        "seconds_predicted": answer.ranking[0].seconds.predicted if answer else nan,
        "seconds_low": answer.ranking[0].seconds.low if answer else nan,
        "seconds_high": answer.ranking[0].seconds.high if answer else nan,
        "error_predicted": answer.ranking[0].error.predicted if answer else nan,
        "seconds": row["seconds"],
        "seconds_spread": row["seconds_spread"],
        "error": row["error"],
        "met": row["met"],
        "best": " ".join(map(str, best)) if best else "",
        "best_seconds": shortest,
        "best_seconds_spread": best_row["seconds_spread"],
        "factor": row["seconds"] / shortest,
        "asking": asking,
        "plain": plain if plain < inf else nan,
        "rules": " ".join(map(str, rules)),
        "rules_met": timed[rules]["met"],
        "rules_factor": timed[rules]["seconds"] / shortest,
        "refusal": refusal,
        "runs": runs,
    }


def ask(question: Question) -> tuple[Recommendation | None, str, float]:
    """The answer of `pick`, or its refusal, and the seconds of asking a second time.

    The first time compiles and paces the methods. It also fills the caches that forms have of the scene,
    such as `path_of`: these seconds leave out the look ahead of forms, which seconds of runs include.
    """
    _recommended(question)
    forget()
    began = perf_counter()
    compiling = SPENT.seconds["compilation"]
    answer, refusal = _recommended(question)
    return answer, refusal, perf_counter() - began - (SPENT.seconds["compilation"] - compiling)


def _recommended(question: Question) -> tuple[Recommendation | None, str]:
    """The answer of `pick`, or None and why it refuses the error."""
    try:
        return pick(question.scene, question.error, question.want, question.samples), ""
    except NotAttainableError as reason:
        return None, str(reason)


class Track:
    """Runs of a question, and their true errors."""

    def __init__(self, question: Question, true: Observables) -> None:
        self.question = question
        self.true = true

    def run(self, form: str, solver: str, tolerance: float, limit: float = inf) -> Record:
        """One run: its seconds, its error, and whether it met the one requested.

        A run takes `limit` seconds at most. One that fails has infinite seconds and error.
        """
        question = self.question
        equations = find_form(form)
        seconds, observables = self.once(equations, solver, tolerance, question.scene, limit)
        if observables is None:
            return {"seconds": inf, "error": inf, "met": False}
        error = self.off(observables, self.true)
        return {
            "seconds": seconds,
            "error": error,
            "met": error <= question.error,
        }

    def once(
        self, form: Form, solver: str, tolerance: float, scene: Scene, limit: float
    ) -> tuple[float, Observables | None]:
        """Seconds from a scene to its observables, compilation left out, and these; inf and None if the run fails."""
        began = perf_counter()
        compiling = SPENT.seconds["compilation"]
        try:
            problem = form.problem(scene)
            times = np.linspace(0.0, problem.end, self.question.samples)
            run = solve(problem, find_solver(solver), tolerance, times, max_seconds=limit)
        except ValueError:
            return inf, None
        if not run.success:
            return inf, None
        observables = form.observe(scene, run.states)
        return perf_counter() - began - (SPENT.seconds["compilation"] - compiling), observables

    def off(self, a: Observables, b: Observables) -> float:
        """The largest difference of two runs, of L and E or of the orientation."""
        ellipsoid = self.question.scene.ellipsoid
        return difference(ellipsoid, a, b).largest.get(self.question.want, inf)

    def in_turns(self, names: list[RunName]) -> dict[RunName, Record]:
        """The runs of these names, the quickest of several in turns, and by how much these differ.

        `seconds_spread` is the longest time minus the shortest; NaN of a run that is timed once.
        """
        runs = {name: self.run(*name) | {"seconds_spread": nan} for name in names}
        long = [name for name in names if runs[name]["seconds"] >= TIMED_ONCE_FROM]
        seconds: dict[RunName, list[float]] = {name: [] for name in names}
        for number in range(FINALIST_REPEATS):
            # A form may have cached results of the scene itself: each round has a scene of its own.
            scene = unseen(self.question.scene, number + 1)
            for form, solver, tolerance in names:
                if (form, solver, tolerance) not in long:
                    again, _ = self.once(find_form(form), solver, tolerance, scene, inf)
                    seconds[form, solver, tolerance].append(again)
        for name in names:
            if name not in long:
                timing = Timing(tuple(seconds[name]))
                runs[name] |= {"seconds": timing.seconds, "seconds_spread": timing.spread}
        return runs


def _measure(track: Track) -> Iterator[Record]:
    """Runs of the listed methods, ever tighter until they meet the error."""
    question = track.question
    # The nearest power of ten.
    decade = floor(log10(question.error) + 0.5)
    # Before any run has met the error, a run may take `_FIRST_SECONDS`.
    best = _FIRST_SECONDS / _STOP
    methods, _ = contenders(question.scene, question.want)
    for form, solver in methods:
        if why_not(question.scene, question.want, Method(form, solver)):
            continue
        for shift in _DECADES:
            tolerance = min(LOOSEST, max(TIGHTEST, float(f"1e{decade + shift}")))
            limit = max(_STOP_SECONDS, _STOP * best)
            # The second run has compiled already.
            track.run(form.name, solver.name, tolerance, limit)
            row = track.run(form.name, solver.name, tolerance, limit)
            yield {
                "scene": question.name,
                "form": form.name,
                "solver": solver.name,
                "shift": shift,
                "tolerance": tolerance,
                **{name: row[name] for name in ("seconds", "error", "met")},
            }
            if row["met"]:
                best = min(best, row["seconds"])
            if row["met"] or row["seconds"] == inf or tolerance <= TIGHTEST:
                break


def _by_rules(question: Question) -> RunName:
    """The run that rules alone would choose, without a race."""
    method = methods_for(question.scene, question.error, question.want)[0]
    tolerance = first_tolerance(question.scene, method, question.error, question.want)
    return method.form.name, method.solver.name, tolerance


def reference_of(question: Question) -> Observables:
    """The true solution at the question's rows; ReferenceFailedError where it is not known well enough."""
    scene = question.scene
    solution = reference(scene, reference_form(scene), question.samples, _REFERENCE_SECONDS)
    uncertainty = solution.slow_uncertainty
    if question.want == "orientation":
        uncertainty = solution.orientation_uncertainty
    # The orientation's is None of a sphere, of which no question asks for it (`questions`).
    known = uncertainty is not None and uncertainty <= _KNOWN * question.error
    if solution.meaningful < question.samples or not known:
        raise ReferenceFailedError("its reference is not known well enough")
    return solution.observables


def stratum(seconds: float) -> str:
    """The stratum of a scene, by the seconds of its best run; "not attainable" where no run met the error."""
    if isnan(seconds):
        return "not attainable"
    return next(name for name, most in STRATA.items() if seconds < most)


def judged(scenes: Any) -> list[Record]:
    """Each stratum: how good first choices were, what asking took, and what rules alone would have done.

    `scenes` is the frame of `Evaluation`. Its `factor` is the ratio of the times of the first choice and of the
    best run. `met` is the share of scenes whose first choice met the error; a refusal counts as met if no run
    met the error. `near` is the share of scenes whose first choice met the error within `NEAR` times the best. `total`
    is asking and running over plain practice (`timed.py`), `within` the share of scenes
    whose first choice took seconds in the interval forecast.
    """
    rows = []
    groups = scenes.groupby(scenes["best_seconds"].map(stratum), sort=False)
    for name, group in groups:
        good = group["met"] & (group["factor"] <= NEAR)
        ruled = group["rules_met"].astype(bool) & (group["rules_factor"] <= NEAR)
        with_plain = group.dropna(subset=["plain"])
        plain_seconds = with_plain["plain"].sum()
        all_seconds = (with_plain["asking"] + with_plain["seconds"]).sum()
        # Plain practice may solve none of a stratum's scenes.
        total = all_seconds / plain_seconds if plain_seconds else nan
        rows.append(
            {
                "stratum": name,
                "scenes": len(group),
                "met": float(group["met"].mean()),
                "near": float(good.mean()),
                "farthest": float(group["factor"].max()),
                "asking": float(group["asking"].median()),
                "asking_runs": float((group["asking"] / group["seconds"]).median()),
                "total": float(total),
                "rules_met": float(group["rules_met"].mean()),
                "rules_near": float(ruled.mean()),
                "within": float(
                    (
                        (group["seconds"] >= group["seconds_low"])
                        & (group["seconds"] <= group["seconds_high"])
                    ).mean()
                ),
            }
        )
    return rows


def break_even(scenes: Any) -> float:
    """Seconds of the best run from which on asking and running cost less than plain practice; inf if never.

    `scenes` is the frame of `Evaluation`.
    The first scene, by the seconds of its best run, that saves time and from which on more than half of the
    scenes do.
    """
    with_plain = scenes.dropna(subset=["plain", "best_seconds", "seconds"]).sort_values(
        "best_seconds"
    )
    saves = (with_plain["asking"] + with_plain["seconds"] < with_plain["plain"]).to_numpy()
    for i in range(len(saves)):
        if saves[i:].mean() > 0.5 and saves[i]:
            return float(with_plain["best_seconds"].iloc[i])
    return inf
