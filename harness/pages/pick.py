"""The pages of `pick`: its laws, and how they did on scenes held out; tables, figures and data from the records."""

import csv
from collections.abc import Iterable, Sequence
from math import inf
from pathlib import Path
from typing import Any

from polhode.harness.calibration.heldout import (
    CHEAP,
    FACTOR,
    MEETS,
    PREDICTED,
    Evaluation,
    Outcome,
    Prediction,
)
from polhode.harness.common.text import duration, markdown, scientific
from polhode.harness.pages.laws_figures import write_figures
from polhode.harness.picking.laws import Laws


def write_pages(folder: Path, laws: Laws, evaluation: Evaluation, command: str) -> Path:
    """Write the page, its figures and its tables into a folder and return the page's path."""
    folder.mkdir(parents=True, exist_ok=True)
    _write_rows(folder / "laws.csv", _law_rows(laws))
    _write_rows(folder / "scenes.csv", [_scene_row(outcome) for outcome in evaluation.outcomes])
    _write_rows(folder / "runs.csv", [_run_row(prediction) for prediction in evaluation.predictions])
    write_figures(folder, evaluation)
    page = folder / "README.md"
    page.write_text("\n".join(_lines(laws, evaluation, command)), encoding="utf-8")
    return page


def summary(evaluation: Evaluation) -> list[str]:
    """The evaluation in sentences, each with what was to be reached."""
    count = len(evaluation.outcomes)
    refused = sum(outcome.answer.recommendation is None for outcome in evaluation.outcomes)
    lines = [
        f"The first choice met the error on {evaluation.met:.1%} of {count} held-out scenes (to reach: {MEETS:.0%}).",
        f"It cost at most {FACTOR:g} times the best measured choice on {evaluation.cheap:.1%} (to reach: {CHEAP:.0%}).",
        f"The cost laws predicted {evaluation.predicted:.1%} of {len(evaluation.predictions)} held-out times "
        f"within a factor {FACTOR:g} (to reach: {PREDICTED:.0%}), the machine's pace reckoned with; "
        f"{evaluation.predicted_as_timed:.1%} as timed.",
        f"The slow error stayed below the upper end of its interval in {evaluation.bounded:.1%} of the runs "
        "(meant: 97.5%).",
    ]
    if refused:
        lines.append(
            f"{refused} requests were refused as not attainable; they count as met where no run measured met them."
        )
    return lines


def _lines(laws: Laws, evaluation: Evaluation, command: str) -> list[str]:
    source = laws.source
    machine = source.get("machine", {})
    return [
        "# What `pick` promises, and what measuring showed",
        "",
        f"Made by `{command}`. Do not edit: the next run overwrites this page.",
        "",
        f"The laws were fitted on {source['records']} runs of {source['scenes']} random scenes, on "
        f"{machine.get('processor', 'an unnamed processor')}; the scenes below are others, from another seed.",
        "",
        *(f"- {sentence}" for sentence in summary(evaluation)),
        "",
        "The best measured choice is the cheapest of all runs that met the error: compiled solvers on every form that "
        "accepts the scene, save those that cannot win it (explicit ones over very many damping times, low orders at "
        "tight tolerances, averaged forms without rotations to average over), at tolerances by tens, and the first "
        "choice itself. The five cheapest of them and the first choice were then timed once more, in turns; "
        "these times are compared.",
        "",
        "Predicted times hold for the pace at which the machine ran when the laws were fitted: a sentinel, a fixed "
        "piece of arithmetic timed before every batch of runs, tells by how much it is slower or faster now, and "
        "measured times are divided by that. Times of the first choice and the best one are as timed.",
        "",
        "![Predicted against measured times and errors of the held-out runs](predicted.png)",
        "",
        "![Error and cost of the first choice on each held-out scene](choices.png)",
        "",
        "## The scenes",
        "",
        "N rotations. – stands for what is not known: the error, where the first choice failed, falsely claimed "
        "success or has no reference to be compared with; the time, where it failed; N, error and time, where the "
        "request was refused. It is inf times over the best where it failed and another run met the error.",
        "",
        markdown(
            [
                "St",
                "shape",
                "N",
                "wanted",
                "error asked",
                "first choice",
                "error",
                "time",
                "over the best",
                "best choice",
            ],
            [_scene_cells(outcome) for outcome in evaluation.outcomes],
            right=(0, 2, 4, 6, 7, 8),
        ),
        "## Times by method",
        "",
        markdown(
            ["form", "solver", "runs", f"within {FACTOR:g}", "median ratio"],
            [list(row) for row in _by_method(evaluation.predictions)],
            right=(2, 3, 4),
        ),
        "## The laws",
        "",
        "Seconds = fixed + per sample · m + tol^exponent (start + per rotation · N + per time · F) "
        "+ per damping time · S tol^stiff exponent; N rotations, S damping times, F time spent following the flow. "
        "Brackets hold 95 % of the fits to resampled scenes, strays 95 % of measured over predicted. All numbers, "
        "those of the error laws too, are in [laws.csv](laws.csv); `harness/picking/laws.py` says what each means.",
        "",
        markdown(
            [
                "form",
                "solver",
                "runs",
                "fixed, µs",
                "exponent",
                "per rotation, µs",
                "per damping time, ns",
                "strays 95 %",
            ],
            [_law_cells(law) for law in laws.methods.values()],
            right=range(2, 8),
        ),
    ]


def _scene_cells(outcome: Outcome) -> list[str]:
    question, found = outcome.answer.question, outcome.answer.recommendation
    best = outcome.best
    chosen = "not attainable"
    if found is not None:
        row = found.ranking[0]
        chosen = f"{row.form}, {row.solver}, {row.tolerance:g}"
    return [
        f"{question.scene.stokes:.2g}",
        question.scene.ellipsoid.kind,
        "–" if found is None else f"{found.rotations:.3g}",
        question.want,
        scientific(question.error),
        chosen,
        scientific(outcome.error if outcome.error < inf else None),
        duration(None if outcome.first is None else outcome.first.get("seconds")),
        f"{outcome.factor:.2f}",
        "none" if best is None else f"{best['form']}, {best['solver']}, {best['tolerance']:g}",
    ]


def _law_cells(law: Any) -> list[str]:
    cost, intervals = law.cost, law.cost.intervals

    def cell(name: str, unit: float) -> str:
        low, high = intervals[name]
        return f"{getattr(cost, name) / unit:.2g} [{low / unit:.2g}, {high / unit:.2g}]"

    spread = cost.stray.around(1.0)
    return [
        law.form,
        law.solver,
        str(cost.records),
        cell("fixed", 1e-6),
        cell("exponent", 1.0),
        cell("per_rotation", 1e-6),
        cell("per_damping_time", 1e-9),
        f"{spread.low:.2f} … {spread.high:.2f}",
    ]


def _by_method(predictions: Sequence[Prediction]) -> Iterable[tuple[str, ...]]:
    groups: dict[tuple[str, str], list[Prediction]] = {}
    for prediction in predictions:
        groups.setdefault((prediction.record["form"], prediction.record["solver"]), []).append(prediction)
    for (form, solver), mine in sorted(groups.items()):
        ratios = sorted(each.measured / each.seconds.predicted for each in mine)
        share = sum(each.close for each in mine) / len(mine)
        yield form, solver, str(len(mine)), f"{share:.0%}", f"{ratios[len(ratios) // 2]:.2f}"


def _law_rows(laws: Laws) -> list[dict[str, Any]]:
    rows = []
    for law in laws.methods.values():
        for kind, one in {"cost": law.cost, **law.errors}.items():
            for name, (low, high) in one.intervals.items():
                head = {"form": law.form, "solver": law.solver, "law": kind, "runs": one.records, "parameter": name}
                rows.append({**head, "value": getattr(one, name), "low": low, "high": high})
    return rows


def _scene_row(outcome: Outcome) -> dict[str, Any]:
    question, found, best = outcome.answer.question, outcome.answer.recommendation, outcome.best or {}
    row = found.ranking[0] if found else None
    return {
        "scene": question.name,
        "stokes": question.scene.stokes,
        "time": question.scene.time,
        "semi_axes": " ".join(f"{axis:.6g}" for axis in question.scene.ellipsoid.semi_axes),
        "kind": question.scene.ellipsoid.kind,
        "rotations": found.rotations if found else None,
        "damping_times": found.damping_times if found else None,
        "samples": question.samples,
        "want": question.want,
        "error_asked": question.error,
        "form": row.form if row else None,
        "solver": row.solver if row else None,
        "tolerance": row.tolerance if row else None,
        "error_predicted": row.error.predicted if row else None,
        "error_high": row.error.high if row else None,
        "error": outcome.error if outcome.error < inf else None,
        "seconds_predicted": row.seconds.predicted if row else None,
        "seconds": outcome.first.get("seconds") if outcome.first else None,
        "met": outcome.met,
        "factor": outcome.factor,
        "best_form": best.get("form"),
        "best_solver": best.get("solver"),
        "best_tolerance": best.get("tolerance"),
        "best_seconds": best.get("seconds"),
        "refusal": outcome.answer.refusal,
    }


def _run_row(prediction: Prediction) -> dict[str, Any]:
    record, error = prediction.record, prediction.error
    return {
        "scene": record["scene_name"],
        "form": record["form"],
        "solver": record["solver"],
        "tolerance": record["tolerance"],
        "seconds": _short(record["seconds"]),
        "seconds_at_usual_pace": _short(prediction.measured),
        "seconds_predicted": _short(prediction.seconds.predicted),
        "slow_error": _short(prediction.measured_error),
        "slow_error_predicted": _short(error.predicted if error else None),
        "slow_error_high": _short(error.high if error else None),
    }


def _short(value: float | None) -> str:
    return "" if value is None else f"{value:.4g}"


def _write_rows(path: Path, rows: Sequence[dict[str, Any]]) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(rows[0]) if rows else ["none"])
        writer.writeheader()
        writer.writerows(rows)
