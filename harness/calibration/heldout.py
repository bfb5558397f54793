"""The held-out evaluation: `pick` asked about scenes that no law was fitted on, and then measured."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from math import inf, log
from pathlib import Path

from polhode.harness.calibration.fit import Pilots
from polhode.harness.calibration.scenes import HELD_OUT_SCENES, HELD_OUT_SEED, Question, questions
from polhode.harness.calibration.training import Collection, fast_solvers, forms_for, solvers_for, study
from polhode.harness.common.store import Record, Store
from polhode.harness.picking.laws import Interval, Laws
from polhode.harness.picking.load import load_of
from polhode.harness.picking.pilot import PilotFailedError, form_sensitivity, pilot
from polhode.harness.picking.ranking import NotAttainableError, Recommendation, pick
from polhode.harness.studies.case import Case
from polhode.harness.studies.runner import Runner
from polhode.harness.studies.study import Study
from polhode.models.catalogue import form as find_form
from polhode.solvers.contract import Status

# Every fast method is measured at tolerances by tens, from ten times the error asked for, to find the best choice.
DECADES = (1, 0, -1, -2, -3, -4, -5)
LOOSEST, TIGHTEST = -3, -14
# So many of the cheapest that meet the error, and the first choice, are timed once more, in turns: the cheapest of a
# hundred noisy times is the luckiest one, and what disturbed the first choice did not disturb the others.
FINALISTS, FINAL = 5, "-final"
# What is to be reached: shares of the scenes, of the scenes, and of the runs; and the factor that counts as close.
MEETS, CHEAP, PREDICTED = 0.95, 0.9, 0.9
FACTOR = 1.5


@dataclass(frozen=True)
class Answer:
    """What `pick` said about a held-out question; no recommendation where it said "not attainable"."""

    question: Question
    recommendation: Recommendation | None
    refusal: str


@dataclass(frozen=True)
class Outcome:
    """What measuring one held-out scene showed.

    Parameters
    ----------
    answer : Answer
    first : dict or None
        Record of the first choice.
    best : dict or None
        The cheapest record that meets the error, the first choice included.
    """

    answer: Answer
    first: Record | None
    best: Record | None

    @property
    def error(self) -> float:
        """Error of the first choice; inf if it failed."""
        return inf if self.first is None else error_of(self.first, self.answer.question.want)

    @property
    def met(self) -> bool:
        """Whether the first choice meets the error; a refusal does if nothing measured meets it either."""
        return self.best is None if self.answer.recommendation is None else self.error <= self.answer.question.error

    @property
    def factor(self) -> float:
        """Time of the first choice over that of the best one; 1 where nothing meets the error."""
        if self.best is None:
            return 1.0
        mine = inf if self.first is None else self.first.get("seconds", inf)
        return mine / self.best["seconds"]


@dataclass(frozen=True)
class Prediction:
    """A measured run and what the laws said of it before.

    Parameters
    ----------
    record : dict
    measured : float
        Its wall time in seconds, at the pace that the machine had when the laws were fitted.
    seconds, error : Interval
        What the laws say of its time and of its solver's slow error; no error where they are silent.
    measured_error : float, optional
    """

    record: Record
    measured: float
    seconds: Interval
    error: Interval | None
    measured_error: float | None

    @property
    def close(self) -> bool:
        """Whether the time was predicted within the factor."""
        return self._within(self.measured)

    @property
    def close_as_timed(self) -> bool:
        """The same without regard to the machine's pace."""
        return self._within(self.record["seconds"])

    def _within(self, seconds: float) -> bool:
        return abs(log(seconds / self.seconds.predicted)) <= log(FACTOR)


@dataclass(frozen=True)
class Evaluation:
    """The held-out evaluation.

    Parameters
    ----------
    outcomes : tuple of Outcome
        One for each scene.
    predictions : tuple of Prediction
        One for each run that reached its end by a method with a law.
    """

    outcomes: tuple[Outcome, ...]
    predictions: tuple[Prediction, ...]

    @property
    def met(self) -> float:
        """Share of the scenes on which the first choice meets the error."""
        return _share(outcome.met for outcome in self.outcomes)

    @property
    def cheap(self) -> float:
        """Share of the scenes on which it costs at most `FACTOR` times the best choice measured."""
        return _share(outcome.factor <= FACTOR for outcome in self.outcomes)

    @property
    def predicted(self) -> float:
        """Share of the runs whose time was predicted within `FACTOR`."""
        return _share(prediction.close for prediction in self.predictions)

    @property
    def predicted_as_timed(self) -> float:
        """The same without regard to the machine's pace."""
        return _share(prediction.close_as_timed for prediction in self.predictions)

    @property
    def bounded(self) -> float:
        """Share of the runs whose solver error stays below the end of its interval."""
        known = [p for p in self.predictions if p.error is not None and p.measured_error is not None]
        return _share(p.measured_error <= p.error.high for p in known if p.error and p.measured_error is not None)

    @property
    def reached(self) -> bool:
        """Whether all three shares are what they are to be."""
        return self.met >= MEETS and self.cheap >= CHEAP and self.predicted >= PREDICTED


def evaluate(
    path: Path, laws: Laws, count: int = HELD_OUT_SCENES, quiet: bool = False, seed: int = HELD_OUT_SEED
) -> Evaluation:
    """Ask `pick` about the held-out scenes, measure them into the store at a path, and compare."""
    answers = [answer(question, laws) for question in questions(seed, count)]
    with Store(path) as store:
        runner = Runner(store, quiet)
        records = runner.run(Collection("held-out", tuple(s for a in answers for s in studies(a))))
        last = runner.run(Finals(tuple(tuple(finalists(a, records)) for a in answers)))
    return judge(answers, records, last, laws)


@dataclass(frozen=True)
class Finals:
    """The cases to time once more, those of a scene in turns."""

    scenes: tuple[tuple[Case, ...], ...]
    name: str = "finals"

    def batches(self) -> Iterator[list[Case]]:
        """A batch for each scene."""
        return map(list, self.scenes)


def finalists(answer: Answer, records: Sequence[Record]) -> list[Case]:
    """The first choice and the cheapest runs that meet the error, to be timed once more; without what failed."""
    question = answer.question
    mine = [record for record in records if record["scene_name"] == question.name and "seconds" in record]
    good = sorted((r for r in mine if error_of(r, question.want) <= question.error), key=lambda r: r["seconds"])
    first = _first(answer, mine)
    chosen = good[:FINALISTS] if first is None else [first, *(r for r in good[:FINALISTS] if r is not first)]
    return [
        Case(
            question.name + FINAL,
            question.scene,
            record["form"],
            record["solver"],
            record["tolerance"],
            record["samples"],
            record["max_seconds"],
        )
        for record in chosen
    ]


def answer(question: Question, laws: Laws) -> Answer:
    """Ask `pick`."""
    try:
        found = pick(question.scene, question.error, question.want, question.samples, laws)
    except NotAttainableError as refusal:
        return Answer(question, None, str(refusal))
    return Answer(question, found, "")


def studies(answer: Answer) -> list[Study]:
    """What is measured of a held-out scene: the first choice, and every fast method at tolerances by tens."""
    question = answer.question
    rotations = pilot(question.scene).rotations
    parts = []
    if answer.recommendation is not None:
        first = answer.recommendation.ranking[0]
        parts.append(study(question, [first.form], [first.solver], (first.tolerance,), rotations))
    forms = forms_for(question.scene, rotations)
    decade = round(log(question.error) / log(10))
    for power in sorted({min(LOOSEST, max(TIGHTEST, decade + shift)) for shift in DECADES}, reverse=True):
        solvers = [name for name in solvers_for(question.scene, _row(power)) if name in fast_solvers()]
        parts.append(study(question, forms, solvers, (float(f"1e{power}"),), rotations))
    return parts


def judge(answers: Sequence[Answer], records: Sequence[Record], last: Sequence[Record], laws: Laws) -> Evaluation:
    """Compare answers with the finals' records, and the laws with all others."""
    outcomes = []
    for each in answers:
        mine = [record for record in last if record["scene_name"] == each.question.name + FINAL]
        good = [r for r in mine if "seconds" in r and error_of(r, each.question.want) <= each.question.error]
        best = min(good, key=lambda record: record["seconds"], default=None)
        outcomes.append(Outcome(each, _first(each, mine), best))
    return Evaluation(tuple(outcomes), tuple(predictions(records, laws)))


def predictions(records: Sequence[Record], laws: Laws) -> list[Prediction]:
    """Predictions of all records of runs that reached their end, by the laws."""
    pilots, found = Pilots(), []
    for record in records:
        law = laws.methods.get((record["form"], record["solver"]))
        if law is None or record["status"] != Status.REACHED_END or "seconds" not in record:
            continue
        known = pilots.of(record)
        if known is None:
            continue
        form, tolerance = find_form(record["form"]), record["tolerance"]
        try:
            load = load_of(form, record["solver"], known, record["samples"])
        except PilotFailedError:
            continue
        seconds = law.cost.predict(load, tolerance)
        sensitivity = form_sensitivity(form, known)[0]
        slow = law.error_law("slow", sensitivity) if sensitivity.error < inf else None
        error = slow.predict(sensitivity, tolerance) if slow else None
        found.append(Prediction(record, laws.pace.seconds(record), seconds, error, record.get("solver_slow_error")))
    return found


def error_of(record: Record, want: str) -> float:
    """Error of a record, of the kind wanted; inf for a run that failed."""
    error = record.get(f"{want}_error")
    return inf if error is None or record["status"] != Status.REACHED_END else float(error)


def _first(answer: Answer, records: Sequence[Record]) -> Record | None:
    if answer.recommendation is None:
        return None
    row = answer.recommendation.ranking[0]
    wanted = row.form, row.solver, row.tolerance
    return next((r for r in records if (r["form"], r["solver"], r["tolerance"]) == wanted), None)


def _row(power: int) -> int:
    """Row of the training ladder in which a tolerance of 10^power stands."""
    return (-power - 3) // 3


def _share(flags: Iterable[bool]) -> float:
    known = list(flags)
    return sum(known) / len(known) if known else 1.0
