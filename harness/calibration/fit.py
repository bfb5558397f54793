"""Fitting the laws: robust least squares in logarithms, with bootstrap over scenes."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from math import inf, log
from typing import Any

import numpy as np

from polhode.harness.calibration.least_squares import Misfit, bootstrap
from polhode.harness.common.store import Record
from polhode.harness.common.timing import Pace
from polhode.harness.picking.laws import (
    EPS,
    WANTS,
    CostLaw,
    ErrorLaw,
    Laws,
    Load,
    MethodLaws,
    Sensitivity,
    Stray,
    regime,
)
from polhode.harness.picking.load import held_back, load_of
from polhode.harness.picking.pilot import Pilot, PilotFailedError, form_sensitivity, pilot
from polhode.harness.studies.first_runs import first_seconds
from polhode.models.catalogue import form as find_form
from polhode.models.scene import Scene
from polhode.models.scene_file import parse_scene
from polhode.solvers.contract import Status

Array = np.ndarray

# Fewer scenes than this make no law.
LEAST_SCENES = 3
# Fewer runs than this say nothing of a machine's own factor for a method.
LEAST_RUNS = 3
# Residuals beyond these, in ln(time) and ln(error), are taken for disturbances and pull less.
SOFT_COST, SOFT_ERROR = 0.15, 1.0
# An error of this share of what is measured, or more, tells no law.
SANE = 0.1
# An error of this share of the tolerance is as good as none: how much smaller it is would only pull the law off.
LUCKY = 1e-3


@dataclass(frozen=True)
class Sample:
    """One measured run, in the laws' terms."""

    scene: str
    tolerance: float
    load: Load
    seconds: float
    slow: tuple[Sensitivity, float] | None
    orientation: tuple[Sensitivity, float] | None

    def of(self, want: str) -> tuple[Sensitivity, float] | None:
        """Sensitivity and error of what is wanted."""
        return self.slow if want == "slow" else self.orientation


class Pilots:
    """Pilots of the scenes of records, each run once."""

    def __init__(self) -> None:
        self._found: dict[str, Pilot | None] = {}

    def of(self, record: Record) -> Pilot | None:
        """Pilot of a record's scene; None where it fails."""
        name = record["scene_name"] + repr(record["scene"])
        if name not in self._found:
            try:
                self._found[name] = pilot(parse_scene(record["scene"]))
            except PilotFailedError:
                self._found[name] = None
        return self._found[name]


def sample_of(record: Record, pilot: Pilot, pace: Pace) -> Sample | None:
    """A record in the laws' terms, at one pace; None for a run that failed, or whose pilot did."""
    if record["status"] != Status.REACHED_END or "seconds" not in record:
        return None
    form = find_form(record["form"])
    try:
        load = load_of(form, record["solver"], pilot, record["samples"])
    except PilotFailedError:
        return None
    try:
        found = (None, None) if held_back(form, record["solver"], pilot) else form_sensitivity(form, pilot)
    except PilotFailedError:
        found = None, None
    pairs = []
    for want, sensitivity in zip(WANTS, found, strict=True):
        error, uncertainty = record.get(f"solver_{want}_error"), _uncertainty(record, want)
        if sensitivity is None or error is None or not error < SANE * sensitivity.largest or sensitivity.error == inf:
            pairs.append(None)
            continue
        # Below the reference's uncertainty, below rounding, and far below the tolerance all errors are alike.
        least = max(uncertainty, EPS * sensitivity.largest / 10, LUCKY * record["tolerance"])
        pairs.append((sensitivity, max(error, least)))
    return Sample(
        record["scene_name"],
        record["tolerance"],
        load,
        pace.seconds(record),
        pairs[0],
        pairs[1],
    )


def _uncertainty(record: Record, want: str) -> float:
    value = record.get(f"solver_{want}_uncertainty", record.get(f"{want}_uncertainty"))
    return 0.0 if value is None else float(value)


def fit_laws(records: Iterable[Record], source: dict[str, Any]) -> Laws:
    """Fit the laws of every method of which there are enough records, and time its first run on this machine."""
    pilots, records = Pilots(), list(records)
    pace = Pace.usual(records)
    samples: dict[tuple[str, str], list[Sample]] = {}
    examples: dict[str, Scene] = {}
    for record in records:
        method = record["form"], record["solver"]
        found = pilots.of(record)
        sample = sample_of(record, found, pace) if found else None
        if found and sample:
            samples.setdefault(method, []).append(sample)
            examples.setdefault(record["form"], found.scene)
    samples = {method: runs for method, runs in samples.items() if len({run.scene for run in runs}) >= LEAST_SCENES}
    firsts = first_seconds(examples, samples)
    methods = {}
    for (form, solver), runs in samples.items():
        methods[form, solver] = MethodLaws(
            form=form,
            solver=solver,
            cost=fit_cost(runs),
            errors=fit_errors(runs, solver == "exact"),
            compile_seconds=firsts[form, solver],
            tightest=min(run.tolerance for run in runs),
        )
    scenes = {run.scene for runs in samples.values() for run in runs}
    count = sum(len(runs) for runs in samples.values())
    return Laws(methods, {**source, "scenes": len(scenes), "records": count, "sentinel_seconds": pace.sentinel})


def refit(laws: Laws, records: Iterable[Record]) -> Laws:
    """The same laws for another machine: every cost scaled by what records of that machine, of whatever study, say.

    A method's own factor is the median of measured over predicted; methods without `LEAST_RUNS` records get the median
    of all.
    """
    pilots, records = Pilots(), list(records)
    pace = Pace.usual(records)
    ratios: dict[tuple[str, str], list[float]] = {}
    for record in records:
        law, found = laws.methods.get((record["form"], record["solver"])), pilots.of(record)
        sample = sample_of(record, found, pace) if law and found else None
        if law and sample:
            ratio = sample.seconds / law.cost.predict(sample.load, sample.tolerance).predicted
            ratios.setdefault((law.form, law.solver), []).append(ratio)
    if not ratios:
        return laws
    usual = float(np.median([ratio for each in ratios.values() for ratio in each]))
    methods = {}
    for name, law in laws.methods.items():
        own = ratios.get(name, [])
        factor = float(np.median(own)) if len(own) >= LEAST_RUNS else usual
        methods[name] = replace(law, cost=replace(law.cost, scale=law.cost.scale * factor))
    here = {"machine": pace.machine or laws.source.get("machine"), "sentinel_seconds": pace.sentinel}
    return Laws(methods, {**laws.source, **here, "refitted": sum(map(len, ratios.values()))})


# Parameters with what is expected of them before anything is measured, mean and standard deviation: it decides only
# what the measurements leave open. Those of the first kind are fitted in logarithms.
COST_PRIOR = {
    "fixed": (log(1e-4), 2.0),
    "per_sample": (log(1e-7), 2.0),
    "start": (log(1e-5), 3.0),
    "per_rotation": (log(1e-6), 3.0),
    "per_time": (log(1e-7), 3.0),
    "per_damping_time": (log(1e-8), 4.0),
    "exponent": (-0.12, 0.1),
    "stiff_exponent": (-0.02, 0.05),
}
ERROR_PRIOR = {
    "offset": (0.0, 5.0),
    "order": (1.0, 0.15),
    "gain": (1.0, 0.1),
    "growth": (0.0, 0.2),
    "stiffness": (0.0, 0.3),
    "floor": (0.0, 2.0),
}
# Rounding changes L, whose changes turn into an angle that grows with every rotation.
FLOOR_GROWTH = {"slow": (0.7, 0.3), "orientation": (1.7, 0.3)}
# A closed form has rounding alone.
NO_TRUNCATION = {"offset": (-300.0, 1e-6), "order": (1.0, 1e-6)}


def fit_cost(runs: Sequence[Sample]) -> CostLaw:
    """Fit the cost law of a method."""
    load = np.array([[r.load.rotations, r.load.following, r.load.damping_times, r.load.samples] for r in runs])
    turns, following, stiff, samples = load.T
    logarithm = np.log([run.tolerance for run in runs])
    measured = np.log([run.seconds for run in runs])

    def predicted(x: Array) -> Array:
        c = np.exp(x[:6])
        work = np.exp(x[6] * logarithm) * (c[2] + c[3] * turns + c[4] * following)
        return np.log(c[0] + c[1] * samples + work + c[5] * stiff * np.exp(x[7] * logarithm))

    fit = bootstrap([run.scene for run in runs], Misfit(measured, predicted, COST_PRIOR, SOFT_COST))
    values, intervals = fit.in_words(6)
    return CostLaw(**values, stray=Stray(*fit.strays), records=len(runs), intervals=intervals)


def fit_errors(runs: Sequence[Sample], closed_form: bool = False) -> dict[str, ErrorLaw]:
    """Fit the error laws of a method, of all wants and regimes of which there are enough runs."""
    laws = {}
    for want in WANTS:
        for stiff in (False, True):
            known = [run for run in runs if (found := run.of(want)) is not None and found[0].stiff == stiff]
            if len({run.scene for run in known}) >= LEAST_SCENES:
                laws[regime(want, stiff)] = fit_error(known, want, closed_form)
    return laws


def fit_error(runs: Sequence[Sample], want: str, closed_form: bool = False) -> ErrorLaw:
    """Fit the law of the slow or the orientation error to runs that all have one."""
    known = [(run, found) for run in runs if (found := run.of(want)) is not None]
    at = [found[0] for _, found in known]
    looseness = np.log([run.tolerance / s.tolerance for run, s in zip(runs, at, strict=True)])
    pilots, turns = np.log([s.error for s in at]), np.log1p([s.rotations for s in at])
    stiff = np.log1p([s.stiffness for s in at])
    least = np.log([EPS * s.largest for s in at])
    measured = np.log([found[1] for _, found in known])

    def predicted(x: Array) -> Array:
        truncation = x[0] + x[1] * looseness + x[2] * pilots + x[3] * turns + x[4] * stiff
        return np.logaddexp(truncation, x[5] + least + x[6] * turns)

    prior = ERROR_PRIOR | {"floor_growth": FLOOR_GROWTH[want]} | (NO_TRUNCATION if closed_form else {})
    fit = bootstrap([run.scene for run in runs], Misfit(measured, predicted, prior, SOFT_ERROR))
    values, intervals = fit.in_words(0)
    for table in (values, intervals):
        table["offset"] = np.divide(table["offset"], log(10)).tolist()
        table["floor"] = np.exp(table["floor"]).tolist()
    return ErrorLaw(**values, stray=Stray(*fit.strays), records=len(runs), intervals=intervals)
