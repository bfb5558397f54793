"""The pages of `pick`: how it did on scenes held out, beside other rules; CSVs."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from math import inf
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

from polhode.harness.calibration import evaluation as asked
from polhode.harness.calibration.evaluation import FACTOR, Evaluation
from polhode.harness.calibration.scenes import Question
from polhode.harness.calibration.selection import (
    CUTOFF,
    FEATURES,
    PENALTY,
    PICK,
    features,
    pays_from,
    scores,
)
from polhode.harness.common.files import write_file
from polhode.harness.common.fits import wilson
from polhode.harness.common.text import percent
from polhode.harness.pages.figures.work_precision import save
from polhode.harness.pages.tables import fill, lines_of
from polhode.harness.picking.laws import Laws

# Times over the best, named on the axis.
TICKS = (0.2, 0.5, 1, 1.5, 2, 3, 5, 10, 20, 50, 100)
COLOURS = {"short": "#0072B2", "long": "#D55E00"}


def write_pages(folder: Path, laws: Laws, evaluation: Evaluation, command: str) -> Path:
    """Write the page, its figures and its tables into a folder and return the page's path."""
    parameters = [
        (law.form, law.solver, kind, one.records, name, getattr(one, name), low, high)
        for law in laws.methods.values()
        for kind, one in {"cost": law.cost, **law.errors}.items()
        for name, (low, high) in one.intervals.items()
    ]
    columns = ["form", "solver", "law", "runs", "parameter", "value", "low", "high"]
    tables = {name: getattr(evaluation, name) for name in ("scenes", "runs", "ways")}
    tables["laws"] = pd.DataFrame(parameters, columns=columns)
    for name, rows in tables.items():
        if rows is not None:
            write_file(
                folder / f"{name}.csv", rows.to_csv(index=False, float_format="%.4g"), summed=True
            )
    ways, scenes = evaluation.ways, evaluation.scenes
    if ways is not None:
        write_aslib(folder / "aslib", evaluation.questions, ways)
    _write_figures(folder, evaluation)
    page = fill(
        "pick",
        command=command,
        summary=summary(evaluation),
        scores=[] if ways is None else scores(ways).to_dict("records"),
        cutoff=CUTOFF,
        counts=PENALTY * CUTOFF,
        count=len(scenes),
        unmet=len(scenes) - scenes["best_seconds"].count(),
        asking=scenes["pick_seconds"].median(),
        longest=scenes["pick_seconds"].max(),
        pays=inf if ways is None else pays_from(scenes, ways),
        missed=[
            f"{name}: {why}."
            for name, why in zip(scenes["scene"], scenes["miss"], strict=True)
            if why
        ],
        source=laws.source,
    )
    return write_file(folder / "README.md", page)


def summary(evaluation: Evaluation) -> list[str]:
    """The evaluation in sentences, each with its target."""
    factors = evaluation.scenes["factor"].dropna()
    useful = factors[factors < inf]
    ways = [] if evaluation.ways is None else scores(evaluation.ways).to_dict("records")
    return lines_of(
        "pick-summary",
        asked=asked,
        wilson=wilson,
        scenes=evaluation.scenes,
        shares=evaluation.shares,
        count=len(evaluation.scenes),
        compared=len(factors),
        useful=len(useful),
        dearest=useful.max(),
        runs=len(evaluation.runs),
        ways=[way for way in ways if way["way"] == PICK],
        refused=(evaluation.scenes["refusal"] != "").sum(),
        left_out=_counted(evaluation.left_out.values()),
    )


def _counted(reasons: Iterable[str]) -> str:
    return "; ".join(f"{count} × {reason}" for reason, count in Counter(reasons).most_common())


def _write_figures(folder: Path, evaluation: Evaluation) -> None:
    """Write `choices.png`, a point for each scene, and `predicted.png`, one for each run, into a folder."""
    scenes: Any = evaluation.scenes
    figure, axes = plt.subplots(figsize=(8.0, 4.2))
    for stratum, mine in scenes.groupby("stratum"):
        # Where no way met the error there is nothing to compare with.
        shown = mine[(mine["factor"].fillna(1.0) < inf) & (mine["error"] > 0)].fillna(
            {"factor": 1.0}
        )
        axes.loglog(
            shown["error"] / shown["error_asked"],
            shown["factor"],
            "o",
            color=COLOURS[stratum],
            label=stratum,
        )
    axes.axvline(1.0, color="0.3", linewidth=0.8)
    axes.axhline(FACTOR, color="0.3", linewidth=0.8, linestyle=":")
    axes.set(title="First choices: error met left of the line, near the best below the dots")
    axes.set(xlabel="error over the one asked for", ylabel="time over the best measured")
    axes.set_yticks(TICKS, map(str, TICKS))
    ended = scenes["factor"][scenes["factor"] < inf]
    if len(ended):
        # A first choice that misses the error may be quicker than all that meet it.
        axes.set_ylim(min(0.9, min(ended) / 1.2), 1.2 * max(ended))
    axes.minorticks_off()
    axes.legend(frameon=False, title="stratum")
    figure.tight_layout()
    save(figure, folder, "choices")

    runs: Any = evaluation.runs
    figure, (left, right) = plt.subplots(1, 2, figsize=(8.0, 4.0))
    times = left, "times", "seconds", "seconds_at_usual_pace", "s", FACTOR
    errors = right, "slow errors", "slow_error", "slow_error", "$I_{max}$", 10.0
    for axes, name, what, measured, unit, band in (times, errors):
        known = runs[(runs[measured] > 0) & (runs[f"{what}_predicted"] > 0)]
        predicted, ratio = known[f"{what}_predicted"], known[measured] / known[f"{what}_predicted"]
        axes.loglog(
            predicted, ratio, ".", markersize=2, alpha=0.4, color="#0072B2", rasterized=True
        )
        for line, style in ((1.0, "-"), (band, ":"), (1 / band, ":")):
            axes.axhline(line, color="0.2", linewidth=0.9, linestyle=style)
        within = np.mean(np.abs(np.log(ratio)) <= np.log(band)) if len(ratio) else 1.0
        axes.set(title=f"{percent(within)} of {name} within {band:g} ×")
        axes.set(xlabel=f"predicted, {unit}", ylabel="measured over predicted")
    figure.tight_layout()
    save(figure, folder, "predicted")


def write_aslib(folder: Path, questions: Mapping[str, Question], runs: Any) -> None:
    """Write the scenario in ASlib's format, version 4.0: a description and five tables."""
    algorithms = runs[runs["algorithm"].str.contains("/")]
    names = sorted(set(algorithms["algorithm"]))
    most = float(algorithms["seconds"].replace(inf, np.nan).max())
    description = fill("pick-aslib", cutoff=CUTOFF * most, features=FEATURES, algorithms=names)
    write_file(folder / "description.txt", description)
    solved = []
    for row in algorithms.itertuples():
        time, otherwise = (f"{row.seconds:.6g}", "other") if row.seconds < inf else ("?", "timeout")
        solved.append((row.instance, 1, row.algorithm, time, "ok" if row.met else otherwise))
    head = ("instance_id STRING", "repetition NUMERIC", "algorithm STRING", "runtime NUMERIC")
    _arff(
        folder,
        "algorithm_runs",
        (*head, "runstatus {ok, timeout, memout, not_applicable, crash, other}"),
        solved,
    )
    numeric = [f"{name} NUMERIC" for name in FEATURES]
    values = [
        (name, 1, *(f"{value:.6g}" for value in features(each))) for name, each in questions.items()
    ]
    _arff(folder, "feature_values", (*head[:2], *numeric), values)
    status = "scene {ok, timeout, memout, presolved, crash, other}"
    _arff(folder, "feature_runstatus", (*head[:2], status), [(name, 1, "ok") for name in questions])
    _arff(
        folder, "feature_costs", (*head[:2], "scene NUMERIC"), [(name, 1, 0) for name in questions]
    )
    _arff(
        folder,
        "cv",
        (*head[:2], "fold NUMERIC"),
        [(name, 1, i % 10 + 1) for i, name in enumerate(questions)],
    )


def _arff(
    folder: Path, name: str, attributes: Sequence[str], rows: Sequence[Sequence[Any]]
) -> None:
    write_file(
        folder / f"{name}.arff", fill("pick-arff", name=name, attributes=attributes, rows=rows)
    )
