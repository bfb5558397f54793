"""The held-out test, judged: whether the first choices met the error and how dear they were, and how laws predicted."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import inf, log

from polhode.harness.calibration.fit import pilot_of
from polhode.harness.calibration.scenes import Question
from polhode.harness.common.store import Record
from polhode.harness.picking.laws import Interval, Laws
from polhode.harness.picking.load import load_of
from polhode.harness.picking.pilot import PilotFailedError, form_sensitivity
from polhode.harness.picking.ranking import Recommendation
from polhode.models.catalogue import form as find_form
from polhode.solvers.contract import Status

# Targets: shares of the scenes, of the scenes, and of the runs; and the factor that counts as close.
MEETS, CHEAP, PREDICTED = 0.95, 0.9, 0.9
FACTOR = 1.5


@dataclass(frozen=True)
class Answer:
    """What `pick` said about a held-out question; no recommendation where it said "not attainable"."""

    question: Question
    recommendation: Recommendation | None
    refusal: str

    def first_choice(self, records: Sequence[Record]) -> Record | None:
        """The record of the first row, if there is one."""
        if self.recommendation is None:
            return None
        row = self.recommendation.ranking[0]
        wanted = row.form, row.solver, row.tolerance
        return next((r for r in records if (r["form"], r["solver"], r["tolerance"]) == wanted), None)


@dataclass(frozen=True)
class HeldOutScene:
    """One scene measured: records of the first choice, and of the cheapest run that meets the error."""

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
        return (self.first or {}).get("seconds", inf) / self.best["seconds"]


@dataclass(frozen=True)
class Prediction:
    """A measured run and what the laws say of its time and of its solver's slow error, where they do."""

    record: Record
    measured: float  # wall time in s, at the pace that the machine had when the laws were fitted
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
    """The held-out scenes, and predictions of the runs that reached their end by a method with a law."""

    scenes: tuple[HeldOutScene, ...]
    predictions: tuple[Prediction, ...]

    @property
    def met(self) -> float:
        """Share of the scenes on which the first choice meets the error."""
        return _share(scene.met for scene in self.scenes)

    @property
    def cheap(self) -> float:
        """Share of the scenes on which it costs at most `FACTOR` times the best choice measured."""
        return _share(scene.factor <= FACTOR for scene in self.scenes)

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
        return _share(
            p.measured_error <= p.error.high for p in self.predictions if p.error and p.measured_error is not None
        )

    @property
    def reached(self) -> bool:
        """Whether all three shares are what they are to be."""
        return self.met >= MEETS and self.cheap >= CHEAP and self.predicted >= PREDICTED


def evaluation(
    answers: Sequence[Answer], finals: Sequence[Sequence[Record]], records: Sequence[Record], laws: Laws
) -> Evaluation:
    """Compare answers with the records of their finals, and the laws with all others."""
    scenes = []
    for answer, mine in zip(answers, finals, strict=True):
        question = answer.question
        good = [r for r in mine if "seconds" in r and error_of(r, question.want) <= question.error]
        best = min(good, key=lambda record: record["seconds"], default=None)
        scenes.append(HeldOutScene(answer, answer.first_choice(mine), best))
    return Evaluation(tuple(scenes), tuple(predictions(records, laws)))


def predictions(records: Sequence[Record], laws: Laws) -> list[Prediction]:
    """Predictions of all records of runs that reached their end, by the laws."""
    found = []
    for record in records:
        law = laws.methods.get((record["form"], record["solver"]))
        if law is None or record["status"] != Status.REACHED_END or "seconds" not in record:
            continue
        known, form, tolerance = pilot_of(record), find_form(record["form"]), record["tolerance"]
        if known is None:
            continue
        try:
            load = load_of(form, record["solver"], known, record["samples"])
        except PilotFailedError:
            continue
        sensitivity = form_sensitivity(form, known)[0]
        slow = law.error_law("slow", sensitivity) if sensitivity.error < inf else None
        error = slow.predict(sensitivity, tolerance) if slow else None
        seconds, measured = law.cost.predict(load, tolerance), laws.pace.seconds(record)
        found.append(Prediction(record, measured, seconds, error, record.get("solver_slow_error")))
    return found


def error_of(record: Record, want: str) -> float:
    """Error of a record, of the kind wanted; inf for a run that failed."""
    error = record.get(f"{want}_error")
    return inf if error is None or record["status"] != Status.REACHED_END else float(error)


def _share(flags: Iterable[bool]) -> float:
    known = list(flags)
    return sum(known) / len(known) if known else 1.0
