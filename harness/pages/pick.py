"""The page of `pick`: its laws, and how they did on scenes held out; tables, figures and data from the records."""

from collections.abc import Iterable, Sequence
from math import inf, log10
from pathlib import Path
from typing import TYPE_CHECKING, Any

from polhode.harness.calibration.evaluation import (
    CHEAP,
    FACTOR,
    MEETS,
    PREDICTED,
    Evaluation,
    HeldOutScene,
    Prediction,
)
from polhode.harness.common.text import duration, markdown, scientific
from polhode.harness.pages.style import family_colour
from polhode.harness.pages.work_precision import save
from polhode.harness.picking.laws import Interval, Laws, MethodLaws
from polhode.solvers.catalogue import solver as find_solver

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SCENES_HEADER = ["St", "shape", "N", "wanted", "error asked", "first choice", "error", "time", "over the best"]
SCENES_HEADER += ["best choice"]
LAWS_HEADER = ["form", "solver", "runs", "fixed, µs", "exponent", "per rotation, µs", "per damping time, ns"]
LAWS_HEADER += ["strays 95 %"]


def write_pages(folder: Path, laws: Laws, evaluation: Evaluation, command: str) -> Path:
    """Write the page, its figures and its tables into a folder and return the page's path."""
    import pandas as pd

    folder.mkdir(parents=True, exist_ok=True)
    pd.DataFrame(_law_rows(laws)).to_csv(folder / "laws.csv", index=False)
    pd.DataFrame(map(_scene_row, evaluation.scenes), dtype=object).to_csv(folder / "scenes.csv", index=False)
    pd.DataFrame(map(_run_row, evaluation.predictions)).to_csv(folder / "runs.csv", index=False)
    _write_figures(folder, evaluation)
    page = folder / "README.md"
    page.write_text("\n".join(_lines(laws, evaluation, command)), encoding="utf-8")
    return page


def summary(evaluation: Evaluation) -> list[str]:
    """The evaluation in sentences, each with its target."""
    count = len(evaluation.scenes)
    refused = sum(scene.answer.recommendation is None for scene in evaluation.scenes)
    lines = [
        f"The first choice met the error on {evaluation.met:.1%} of {count} held-out scenes (target: {MEETS:.0%}).",
        f"It cost at most {FACTOR:g} times the best measured choice on {evaluation.cheap:.1%} (target: {CHEAP:.0%}).",
        f"The cost laws predicted {evaluation.predicted:.1%} of {len(evaluation.predictions)} held-out times "
        f"within a factor {FACTOR:g} (target: {PREDICTED:.0%}) after correcting for the machine's speed; "
        f"{evaluation.predicted_as_timed:.1%} as timed.",
        f"The slow error stayed below the upper end of its interval in {evaluation.bounded:.1%} of the runs "
        "(target: 97.5%).",
    ]
    if refused:
        lines.append(
            f"{refused} requests were refused as not attainable; they count as met if no measured run met them."
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
        "accepts the scene, at tolerances by tens, and the first choice itself, except combinations that cannot win "
        "(explicit solvers over very many damping times, low orders at tight tolerances, averaged forms without "
        "rotations to average over). The five cheapest and the first choice were then timed once more, in turns; "
        "these times are compared.",
        "",
        "Predicted times hold for the machine's speed when the laws were fitted. A fixed piece of arithmetic, timed "
        "before every batch of runs, measures the speed, and measured times are corrected by it. Times of the first "
        "choice and the best one are as timed.",
        "",
        "![Predicted against measured times and errors of the held-out runs](predicted.png)",
        "",
        "![Error and cost of the first choice on each held-out scene](choices.png)",
        "",
        "## The scenes",
        "",
        "N: rotations. – stands for what is not known: the error, if the first choice failed, falsely claimed success "
        "or has no reference; the time, if it failed; N, error and time, if the request was refused. *Over the best* "
        "is inf if the first choice failed and another run met the error.",
        "",
        markdown(SCENES_HEADER, list(map(_scene_cells, evaluation.scenes)), right=(0, 2, 4, 6, 7, 8)),
        "## Times by method",
        "",
        markdown(
            ["form", "solver", "runs", f"within {FACTOR:g}", "median ratio"],
            list(_by_method(evaluation.predictions)),
            right=(2, 3, 4),
        ),
        "## The laws",
        "",
        "Seconds = fixed + per sample · m + tol^exponent (start + per rotation · N + per time · F) "
        "+ per damping time · S tol^stiff exponent; N rotations, S damping times, F time spent following the flow. "
        "Brackets hold 95 % of the fits to resampled scenes, strays 95 % of measured over predicted. All numbers, "
        "those of the error laws too, are in [laws.csv](laws.csv); `harness/picking/laws.py` says what each means.",
        "",
        markdown(LAWS_HEADER, list(map(_law_cells, laws.methods.values())), right=range(2, 8)),
    ]


def _scene_cells(scene: HeldOutScene) -> list[str]:
    question, found, best = scene.answer.question, scene.answer.recommendation, scene.best
    row = found.ranking[0] if found else None
    return [
        f"{question.scene.stokes:.2g}",
        question.scene.ellipsoid.kind,
        f"{found.rotations:.3g}" if found else "–",
        question.want,
        scientific(question.error),
        f"{row.form}, {row.solver}, {row.tolerance:g}" if row else "not attainable",
        scientific(scene.error if scene.error < inf else None),
        duration((scene.first or {}).get("seconds")),
        f"{scene.factor:.2f}",
        f"{best['form']}, {best['solver']}, {best['tolerance']:g}" if best else "none",
    ]


def _law_cells(law: MethodLaws) -> list[str]:
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


def _by_method(predictions: Sequence[Prediction]) -> Iterable[list[str]]:
    groups: dict[tuple[str, str], list[Prediction]] = {}
    for prediction in predictions:
        groups.setdefault((prediction.record["form"], prediction.record["solver"]), []).append(prediction)
    for (form, solver), mine in sorted(groups.items()):
        ratios = sorted(each.measured / each.seconds.predicted for each in mine)
        share = sum(each.close for each in mine) / len(mine)
        yield [form, solver, str(len(mine)), f"{share:.0%}", f"{ratios[len(ratios) // 2]:.2f}"]


def _law_rows(laws: Laws) -> list[dict[str, Any]]:
    rows = []
    for law in laws.methods.values():
        for kind, one in {"cost": law.cost, **law.errors}.items():
            for name, (low, high) in one.intervals.items():
                head = {"form": law.form, "solver": law.solver, "law": kind, "runs": one.records, "parameter": name}
                rows.append({**head, "value": getattr(one, name), "low": low, "high": high})
    return rows


def _scene_row(scene: HeldOutScene) -> dict[str, Any]:
    question, found, best = scene.answer.question, scene.answer.recommendation, scene.best or {}
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
        "error": scene.error if scene.error < inf else None,
        "seconds_predicted": row.seconds.predicted if row else None,
        "seconds": scene.first.get("seconds") if scene.first else None,
        "met": scene.met,
        "factor": scene.factor,
        "best_form": best.get("form"),
        "best_solver": best.get("solver"),
        "best_tolerance": best.get("tolerance"),
        "best_seconds": best.get("seconds"),
        "refusal": scene.answer.refusal,
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


def _write_figures(folder: Path, evaluation: Evaluation) -> None:
    """Write `predicted.png` and `choices.png` into a folder."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, 2, figsize=(11.0, 5.0))
    times = [(p.seconds, p.measured, p.record["solver"]) for p in evaluation.predictions]
    _against(axes[0], times, "measured time of a warm run, s", "predicted, s", FACTOR)
    errors = [
        (p.error, p.measured_error, p.record["solver"])
        for p in evaluation.predictions
        if p.error is not None and p.measured_error
    ]
    _against(
        axes[1], errors, "measured slow error of the solver, over I_max", "predicted, middle of the interval", 10.0
    )
    axes[0].legend(frameon=False, fontsize=8, loc="upper left", markerscale=2)
    figure.tight_layout()
    save(figure, folder, "predicted")

    figure, axes = plt.subplots(1, 2, figsize=(11.0, 4.6))
    _choices(axes[0], axes[1], evaluation.scenes)
    figure.tight_layout()
    save(figure, folder, "choices")


def _against(axes: "Axes", points: Sequence[tuple[Interval, float, str]], x: str, y: str, band: float) -> None:
    groups: dict[str, list[tuple[float, float]]] = {}
    for predicted, measured, solver in points:
        groups.setdefault(find_solver(solver).family, []).append((measured, predicted.predicted))
    for library, pairs in groups.items():
        axes.loglog(
            *zip(*pairs, strict=True), ".", markersize=2.5, alpha=0.5, color=family_colour(library), label=library
        )
    values = [value for pairs in groups.values() for pair in pairs for value in pair if value > 0]
    ends = 10 ** (log10(min(values)) - 0.2), 10 ** (log10(max(values)) + 0.2)
    axes.plot(ends, ends, color="0.3", linewidth=0.9)
    for factor in (band, 1 / band):
        axes.plot(ends, [end * factor for end in ends], color="0.3", linewidth=0.7, linestyle=":")
    axes.set(xlim=ends, ylim=ends, xlabel=f"{x} (dotted: factor {band:g})", ylabel=y)
    axes.grid(True, which="major", linewidth=0.4, alpha=0.5)


def _choices(left: "Axes", right: "Axes", scenes: Sequence[HeldOutScene]) -> None:
    """Draw error over the error asked for, and time over the best one, of the first choices, sorted."""
    margins = sorted(scene.error / scene.answer.question.error for scene in scenes if scene.error < inf)
    left.semilogy(range(1, len(margins) + 1), margins, "o", markersize=4, color="#0072B2")
    left.axhline(1.0, color="#D55E00", linewidth=1.0)
    left.set(xlabel="held-out scene, sorted", ylabel="error of the first choice over the error asked for")
    factors = sorted(scene.factor for scene in scenes if scene.factor < inf)
    right.plot(range(1, len(factors) + 1), factors, "o", markersize=4, color="#0072B2")
    right.axhline(FACTOR, color="#D55E00", linewidth=1.0)
    right.set(xlabel="held-out scene, sorted", ylabel="time of the first choice over the best one measured")
    for axes in (left, right):
        axes.grid(True, which="major", linewidth=0.4, alpha=0.5)
