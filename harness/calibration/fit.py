"""Fitting the laws: robust least squares in logarithms, with bootstrap over scenes."""

import tomllib
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import chain
from math import exp, log
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy.optimize import least_squares
from scipy.special import ndtri, stdtrit

from polhode.harness.calibration.samples import Sample, sample_of
from polhode.harness.calibration.training import lacking
from polhode.harness.common.machine import machine
from polhode.harness.common.store import Record
from polhode.harness.common.timing import Pace
from polhode.harness.picking.laws import (
    EPS,
    WANTS,
    CostLaw,
    ErrorLaw,
    Laws,
    MethodLaws,
    Stray,
    regime,
)
from polhode.harness.picking.pilot import over_whole_run
from polhode.harness.studies.cost import first_seconds
from polhode.models.catalogue import form as find_form
from polhode.models.files.scene_file import parse_scene
from polhode.models.form import FormNotValidError
from polhode.models.scene import Scene
from polhode.models.scenes import SCENES
from polhode.solvers.catalogue import solver as find_solver

Array = np.ndarray
Prior = dict[str, tuple[float, float]]

# Fewer scenes than this make no law, and fewer long ones none of their own.
LEAST_SCENES, LEAST_LONG = 3, 8
# Fewer runs than this say nothing of a machine's own factor for a method; how far errors stray by a
# form's other solvers counts as much as so many runs.
LEAST_RUNS, FEW_RUNS = 3, 30
# Residuals beyond these, in ln(time) and ln(error), are taken for disturbances and pull less.
SOFT_COST, SOFT_ERROR = 0.15, 1.0
# Resampled fits, and the quantiles that they give.
REPLICATES, SEED = 40, 1
LOW, MIDDLE, HIGH = 0.025, 0.5, 0.975
# Parameters that have a typical value are fitted in logarithms.
_TABLES = tomllib.loads(Path(__file__).with_name("priors.toml").read_text(encoding="utf-8"))
PRIORS: dict[str, Prior] = {}
for _law, _table in _TABLES.items():
    _means = {
        name: each["mean"] if "mean" in each else log(each["typical"])
        for name, each in _table.items()
    }
    PRIORS[_law] = {name: (mean, _table[name]["spread"]) for name, mean in _means.items()}
READABLE: dict[str, Callable[[float], float]] = {"offset": lambda x: float(x / log(10))}
READABLE |= {
    name: exp for table in _TABLES.values() for name, each in table.items() if "typical" in each
}
AVERAGED = "per_piece", "per_entering", "per_row"


def fit_laws(records: Iterable[Record], source: dict[str, Any], base: Laws | None = None) -> Laws:
    """Fit the laws of every method of which there are enough records, and time its first run on this machine.

    Of methods that `base` knows, only laws of errors that it lacks, and of long runs, are taken
    from the records.
    """
    records = list(records)
    pace = base.pace if base else Pace.usual(records)
    samples: dict[tuple[str, str], list[Sample]] = {}
    examples: dict[str, Scene] = {}
    for record in records:
        if sample := sample_of(record, pace):
            samples.setdefault((record["form"], record["solver"]), []).append(sample)
            scene = parse_scene(record["scene"])
            examples[record["form"]] = max(
                examples.get(record["form"], scene), scene, key=_compiles_most
            )
    samples = {method: runs for method, runs in samples.items() if _scenes(runs) >= LEAST_SCENES}
    known = {name for name in base.methods if not lacking(base, *name)} if base else set()
    firsts = first_seconds(examples, [name for name in samples if name not in known])
    methods = dict(base.methods) if base else {}
    for name, runs in samples.items():
        errors = fit_errors(runs, special(*name))
        if name in known:
            kept = {
                each: law
                for each, law in methods[name].errors.items()
                if not each.startswith("long")
            }
            methods[name] = replace(methods[name], errors=methods[name].errors | errors | kept)
        else:
            methods[name] = MethodLaws(
                *name, fit_cost(runs), errors, firsts[name], min(run.tolerance for run in runs)
            )
    usual = tuple(methods.values())
    for name in samples.keys() - known:
        methods[name] = replace(methods[name], errors=as_wide_as_alike(methods[name], usual))
    runs = [run for each in samples.values() for run in each]
    counts = {"scenes": _scenes(runs), "records": len(runs)}
    if base:
        return Laws(methods, base.source | {"added": counts | source})
    return Laws(methods, source | counts | {"sentinel_seconds": pace.sentinel})


def refit(laws: Laws, records: Iterable[Record]) -> Laws:
    """The same laws for another machine: every cost scaled by what records of that machine, of whatever study, say."""
    records = list(records)
    pace = Pace.usual(records)
    ratios: dict[tuple[str, str], list[float]] = {}
    for record in records:
        law = laws.methods.get((record["form"], record["solver"]))
        if law and (sample := sample_of(record, pace)):
            ratio = sample.seconds / law.cost.predict(sample.load, sample.tolerance).predicted
            ratios.setdefault((law.form, law.solver), []).append(ratio)
    if not ratios:
        return laws
    # A method's own factor is the median of measured over predicted; with few records that of its
    # solver, or of all.
    every, methods = [*chain(*ratios.values())], {}
    for name, law in laws.methods.items():
        alike = [
            ratio for (_, solver), each in ratios.items() if solver == law.solver for ratio in each
        ]
        known = next(
            each
            for each in (ratios.get(name, []), alike, every)
            if len(each) >= LEAST_RUNS or each is every
        )
        methods[name] = replace(
            law, cost=replace(law.cost, scale=law.cost.scale * float(np.median(known)))
        )
    here = {
        "machine": pace.machine or laws.source.get("machine"),
        "sentinel_seconds": pace.sentinel,
    }
    return Laws(methods, {**laws.source, **here, "refitted": sum(map(len, ratios.values()))})


def with_first_runs(laws: Laws) -> Laws:
    """The same laws with this machine's first runs, if they end, of each form on the scene that compiles most."""
    examples: dict[str, Scene] = {}
    for form in dict.fromkeys(form for form, _ in laws.methods):
        for each in sorted(SCENES.values(), key=lambda each: _compiles_most(each.scene)):
            with suppress(FormNotValidError):
                find_form(form).problem(each.scene)
                examples[form] = each.scene
    seconds = first_seconds(examples, [method for method in laws.methods if method[0] in examples])
    methods = {
        method: replace(law, compile_seconds=seconds.get(method) or law.compile_seconds)
        for method, law in laws.methods.items()
    }
    return Laws(methods, laws.source | {"first_runs": machine()})


def _compiles_most(scene: Scene) -> tuple[bool, float]:
    return scene.ellipsoid.kind == "triaxial", scene.time


def robust_fit(
    predicted: Callable[[Array], Array],
    measured: Array,
    prior: Prior,
    soft: float,
    weights: Array,
    start: Array,
) -> Array:
    """Parameters of least squares: residuals beyond `soft` pull less (soft L1), the prior counts as measurements do."""
    mean, spread = np.array(list(prior.values())).T
    count = len(measured)

    def residuals(x: Array) -> Array:
        return np.concatenate([predicted(x) - measured, soft * (x - mean) / spread])

    def loss(z: Array) -> Array:
        root = np.sqrt(1 + z[:count])
        rho = np.stack([z, np.ones_like(z), np.zeros_like(z)])
        rho[:, :count] = weights * np.stack([2 * (root - 1), 1 / root, -0.5 / root**3])
        return rho

    options: dict[str, Any] = {"loss": loss, "f_scale": soft, "x_scale": spread, "ftol": 1e-6}
    return least_squares(residuals, start, **options).x


def bootstrap(
    scenes: Sequence[str],
    predicted: Callable[[Array], Array],
    measured: Array,
    prior: Prior,
    soft: float,
) -> dict[str, Any]:
    """Fit a law, and fit it again to scenes drawn with replacement: its parameters, their intervals, and its stray."""
    # What one scene says of another is what a prediction is worth: strays are those of the scenes
    # left out, wider where there are few, by Student's t over the normal distribution. Source:
    # Efron and Tibshirani, An Introduction to the Bootstrap, sections 6.2 and 17.7.
    group, names = pd.factorize(np.array(scenes))
    count, random = len(names), np.random.default_rng(SEED)
    start = np.array([mean for mean, _ in prior.values()])
    x = robust_fit(predicted, measured, prior, soft, np.ones(len(group)), start)
    replicates, strays = [], []
    for _ in range(REPLICATES):
        weights = np.bincount(random.integers(count, size=count), minlength=count)[group].astype(
            float
        )
        replicates.append(robust_fit(predicted, measured, prior, soft, weights, x))
        strays.append((measured - predicted(replicates[-1]))[weights == 0])
    low, middle, high = np.quantile(np.concatenate(strays), (LOW, MIDDLE, HIGH)).tolist()
    wider = float(stdtrit(count - 1, HIGH) * np.sqrt(1 + 1 / count) / ndtri(HIGH))
    stray = Stray(middle + wider * (low - middle), middle, middle + wider * (high - middle))
    law: dict[str, Any] = {"stray": stray, "records": len(group), "intervals": {}}
    for name, value, *ends in zip(
        prior, x, *np.quantile(replicates, (LOW, HIGH), axis=0), strict=True
    ):
        plain = READABLE.get(name, float)
        law[name], law["intervals"][name] = plain(value), tuple(map(plain, ends))
    return law


def fit_cost(runs: Sequence[Sample]) -> CostLaw:
    """Fit the cost law of a method."""
    names = "samples", "rotations", "following", "damping_times", "pieces", "entered", "rows"
    samples, turns, following, stiff, *averaged = (
        np.array([getattr(r.load, name) for r in runs]) for name in names
    )
    logarithm = np.log([run.load.tolerance or run.tolerance for run in runs])
    measured = np.log([run.seconds for run in runs])
    # What no run has, none says anything of.
    prior = {
        name: each
        for name, each in PRIORS["cost"].items()
        if any(averaged[0]) or name not in AVERAGED
    }

    def predicted(x: Array) -> Array:
        fixed, per_sample, start, per_rotation, per_time, per_damping_time, *others = np.exp(x[:-2])
        work = np.exp(x[-2] * logarithm) * (start + per_rotation * turns + per_time * following)
        seconds = (
            fixed
            + per_sample * samples
            + work
            + per_damping_time * stiff * np.exp(x[-1] * logarithm)
        )
        return np.log(seconds + sum(map(np.multiply, others, averaged)))

    found = CostLaw(**bootstrap([run.scene for run in runs], predicted, measured, prior, SOFT_COST))
    counted = fit_steps(found, runs)
    usual, own = found.stray, counted.step_stray
    # Steps are worth counting where the time follows from them more closely.
    return counted if own and own.high - own.low < usual.high - usual.low else found


def fit_steps(found: CostLaw, runs: Sequence[Sample]) -> CostLaw:
    """The same law with what a step costs, beside what any run does, if enough runs have counted theirs."""
    counted = [run for run in runs if run.load.steps]
    if _scenes(counted) < LEAST_SCENES:
        return found
    rows = [
        (r.load.steps, found.fixed + found.per_sample * r.load.samples, r.tolerance, r.seconds)
        for r in counted
    ]
    steps, any_run, tolerances, measured = np.array(rows).T

    def predicted(x: Array) -> Array:
        return np.log(any_run + np.exp(x[0]) * tolerances ** x[1] * steps)

    law = bootstrap(
        [run.scene for run in counted], predicted, np.log(measured), PRIORS["steps"], SOFT_COST
    )
    values, intervals = (
        {name: law[name] for name in PRIORS["steps"]},
        found.intervals | law["intervals"],
    )
    return replace(found, step_stray=law["stray"], intervals=intervals, **values)


def special(form: str, solver: str) -> Prior:
    """What is expected of the errors of some methods before anything is measured."""
    if find_solver(solver).closed_form:
        return PRIORS["closed_form"]
    return PRIORS["whole_run"] if over_whole_run(find_form(form), solver) else {}


def fit_errors(runs: Sequence[Sample], special: Prior) -> dict[str, ErrorLaw]:
    """Fit the error laws of a method, of all wants and regimes of which there are enough runs."""
    laws = {}
    for want in WANTS:
        groups: dict[str, list[Sample]] = {}
        for run in runs:
            if want in run.errors:
                at = run.errors[want][0]
                groups.setdefault(regime(want, at.stiff, at.long), []).append(run)
        if _scenes(groups.get(f"long {want}", [])) < LEAST_LONG:
            groups.setdefault(want, []).extend(groups.pop(f"long {want}", []))
        for name, known in groups.items():
            if _scenes(known) >= LEAST_SCENES:
                laws[name] = fit_error(known, want, special)
    return laws


def as_wide_as_alike(law: MethodLaws, others: Sequence[MethodLaws]) -> dict[str, ErrorLaw]:
    """Laws of a method's errors; those of few runs stray upwards no less than by the form's other solvers."""
    found = {}
    for name, each in law.errors.items():
        alike = [
            other.errors[name].stray
            for other in others
            if other.form == law.form and name in other.errors
        ]
        usual = float(np.median([stray.high - stray.middle for stray in alike]))
        upper, share = each.stray.high - each.stray.middle, FEW_RUNS / (FEW_RUNS + each.records)
        upper += share * max(0.0, usual - upper)
        found[name] = replace(each, stray=replace(each.stray, high=each.stray.middle + upper))
    return found


def _scenes(runs: Sequence[Sample]) -> int:
    return len({run.scene for run in runs})


def fit_error(runs: Sequence[Sample], want: str, special: Prior) -> ErrorLaw:
    """Fit the law of the slow or the orientation error to runs that all have one."""
    at = [run.errors[want][0] for run in runs]
    looseness = np.log([run.tolerance / s.tolerance for run, s in zip(runs, at, strict=True)])
    pilots, turns = np.log([s.error for s in at]), np.log1p([s.rotations for s in at])
    stiff = np.log1p([s.stiffness for s in at])
    least = np.log([EPS * s.largest for s in at])
    measured = np.log([run.errors[want][1] for run in runs])

    def predicted(x: Array) -> Array:
        truncation = x[0] + x[1] * looseness + x[2] * pilots + x[3] * turns + x[4] * stiff
        return np.logaddexp(truncation, x[5] + least + x[6] * turns)

    prior = PRIORS["error"] | PRIORS[want] | special
    return ErrorLaw(
        **bootstrap([run.scene for run in runs], predicted, measured, prior, SOFT_ERROR)
    )
