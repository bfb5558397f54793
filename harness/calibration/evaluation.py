"""The held-out test, judged: whether the first choices met the error and how dear they were, and how laws predicted."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import inf, log, nan
from typing import Any

import numpy as np
import pandas as pd

from polhode.harness.calibration.scenes import Question, Stratum
from polhode.harness.common.store import Record
from polhode.harness.picking.laws import Laws
from polhode.harness.picking.load import load_of
from polhode.harness.picking.pilot import PilotFailedError, form_sensitivity, pilot
from polhode.harness.picking.recommendation import Recommendation
from polhode.models.catalogue import form as find_form
from polhode.models.files.scene_file import parse_scene
from polhode.solvers.contract import Status

# Targets: shares of the scenes, of the scenes, and of the runs; and the factor that counts as
# close.
MEETS, CHEAP, PREDICTED = 0.975, 0.92, 0.92
FACTOR = 1.5
WAY = ("form", "solver", "tolerance")
# Columns of the runs; what is not known is NaN.
RUN_COLUMNS = (
    "scene",
    "form",
    "solver",
    "tolerance",
    "seconds",
    "seconds_at_usual_pace",
    "seconds_predicted",
)
RUN_COLUMNS += ("slow_error", "slow_error_predicted", "slow_error_high")


@dataclass(frozen=True)
class Answer:
    """What `pick` said about a held-out question; no recommendation where it said "not attainable"."""

    question: Question
    recommendation: Recommendation | None
    refusal: str
    stratum: Stratum = "short"
    seconds: float = nan

    def first_choice(self, records: Sequence[Record]) -> Record | None:
        """The record of the first row, if there is one."""
        if self.recommendation is None:
            return None
        row = self.recommendation.ranking[0]
        return next(
            (r for r in records if all(r[name] == getattr(row, name) for name in WAY)), None
        )


@dataclass(frozen=True)
class Evaluation:
    """What came of the held-out test; ways and questions only if `pick` is to be compared with other rules."""

    scenes: pd.DataFrame  # a row for each held-out scene (`judged`)
    runs: pd.DataFrame  # one for each run that the laws predicted (`predicted_runs`)
    ways: pd.DataFrame | None = None  # one for each way of each scene (`selection.runs_of`)
    questions: Mapping[str, Question] = field(default_factory=dict)
    left_out: Mapping[str, str] = field(default_factory=dict)  # other scenes, and why

    @property
    def shares(self) -> dict[str, float]:
        """Shares of the scenes with good first choices, and of the runs with good predictions."""
        known = self.runs.dropna(subset=["slow_error", "slow_error_high"])
        flags: dict[str, Any] = {
            "met": self.scenes["met"],
            "cheap": self.scenes["factor"].dropna() < FACTOR,
            # At the pace that the laws were fitted at.
            "predicted": close(self.runs["seconds_at_usual_pace"], self.runs),
            "predicted as timed": close(self.runs["seconds"], self.runs),
            "bounded": known["slow_error"] <= known["slow_error_high"],
        }
        return {name: float(flag.mean()) if len(flag) else 1.0 for name, flag in flags.items()}

    @property
    def reached(self) -> bool:
        """Whether the targets are."""
        shares = self.shares
        return (
            shares["met"] >= MEETS and shares["cheap"] >= CHEAP and shares["predicted"] >= PREDICTED
        )


def close(seconds: Any, runs: pd.DataFrame) -> Any:
    """Whether measured times of runs were predicted within `FACTOR`."""
    return np.abs(np.log(seconds / runs["seconds_predicted"])) <= log(FACTOR)


def miss(answer: Answer, first: Record, best: Record, met: bool, factor: float) -> str:
    """Why a first choice was none: what the laws said of it, and of the best way; empty if it was a good one."""
    found = answer.recommendation
    if found is None or (met and not factor >= FACTOR):
        return f"refused: {answer.refusal}" if found is None and best else ""
    want, row = answer.question.want, found.ranking[0]
    if not met:
        made = error_of(first, want)
        model = first.get(f"model_{want}_error") or 0.0
        part = "averaging" if model > made / 2 else "the solver"
        nobody = "" if best else "; no way measured met the one asked for"
        return f"the error, most of it of {part}, is {made / row.error.high:.2g} times its upper end{nobody}"
    same = [
        way for way in found.ranking if (way.form, way.solver) == (best["form"], best["solver"])
    ]
    if not same:
        reasons = {(each.form, each.solver): each.reason for each in found.excluded}
        return f"the best was excluded: {reasons.get((best['form'], best['solver']), 'not known')}"
    off = row.seconds.predicted / first["seconds"], same[0].seconds.predicted / best["seconds"]
    looser = best["tolerance"] / same[0].tolerance
    return (
        f"predicted over measured time is {off[0]:.2g} for the first choice and {off[1]:.2g} for the best way, "
        f"which met the error at {looser:.3g} times the tolerance foreseen"
    )


def judged(answer: Answer, finals: Sequence[Record]) -> Record:
    """What the last runs of a scene say of the answer: a refusal is right if nothing measured meets the error."""
    question, found, first = (
        answer.question,
        answer.recommendation,
        answer.first_choice(finals) or {},
    )
    row: Any = found.ranking[0] if found else None
    good = [r for r in finals if "seconds" in r and error_of(r, question.want) <= question.error]
    best = min(good, key=lambda record: record["seconds"], default={})
    error = error_of(first, question.want) if first else inf
    met = error <= question.error if found else not best
    # Nothing to compare with; a refusal is then right.
    factor = first.get("seconds", inf) / best["seconds"] if best else nan if found else 1.0
    scene = question.scene
    return {
        "scene": question.name,
        "stratum": answer.stratum,
        "pick_seconds": answer.seconds,
        "stokes": scene.stokes,
        "time": scene.time,
        "semi_axes": " ".join(f"{axis:.6g}" for axis in scene.ellipsoid.semi_axes),
        **{name: getattr(found, name, None) for name in ("rotations", "damping_times")},
        "samples": question.samples,
        "want": question.want,
        "error_asked": question.error,
        **{name: getattr(row, name, None) for name in WAY},
        "error_high": row and row.error.high,
        "seconds_predicted": row and row.seconds.predicted,
        "error": error if error < inf else None,
        "seconds": first.get("seconds"),
        "met": met,
        "factor": factor,
        **{f"best_{name}": best.get(name) for name in (*WAY, "seconds")},
        "refusal": answer.refusal,
        "miss": miss(answer, first, best, met, factor) if first or not found else "the run failed",
    }


def predicted_runs(records: Sequence[Record], laws: Laws) -> pd.DataFrame:
    """What the laws say of every run that reached its end, by a method with a law, beside what was measured."""
    found = []
    for record in records:
        law = laws.methods.get((record["form"], record["solver"]))
        if law is None or record["status"] != Status.REACHED_END or "seconds" not in record:
            continue
        form, tolerance = find_form(record["form"]), record["tolerance"]
        try:
            known = pilot(parse_scene(record["scene"]))
            load = load_of(form, record["solver"], known, record["samples"], tolerance)
        except PilotFailedError:
            continue
        sensitivity = form_sensitivity(form, known, record["solver"])["slow"]
        slow = law.error_law("slow", sensitivity) if sensitivity.error < inf else None
        error = slow.predict(sensitivity, tolerance) if slow else None
        head = record["scene_name"], record["form"], record["solver"], tolerance
        times = (
            record["seconds"],
            laws.pace.seconds(record),
            law.cost.predict(load, tolerance).predicted,
        )
        errors = record.get("solver_slow_error"), error and error.predicted, error and error.high
        found.append((*head, *times, *errors))
    return pd.DataFrame(found, columns=list(RUN_COLUMNS)).astype(
        dict.fromkeys(RUN_COLUMNS[3:], float)
    )


def error_of(record: Record, want: str) -> float:
    """Error of a record, of the kind wanted; inf for a run that failed."""
    error = record.get(f"{want}_error")
    return inf if error is None or record["status"] != Status.REACHED_END else float(error)
