"""The figures of `pick`'s page: predicted against measured, and how the first choices did."""

from collections.abc import Sequence
from math import inf, log10
from pathlib import Path
from typing import TYPE_CHECKING

from polhode.harness.calibration.heldout import FACTOR, Evaluation, Outcome
from polhode.harness.pages.work_precision import IMPLICIT, save
from polhode.harness.picking.laws import Interval
from polhode.solvers.catalogue import solver as find_solver

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def write_figures(folder: Path, evaluation: Evaluation) -> None:
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
    _choices(axes[0], axes[1], evaluation.outcomes)
    figure.tight_layout()
    save(figure, folder, "choices")


def _against(axes: "Axes", points: Sequence[tuple[Interval, float, str]], x: str, y: str, band: float) -> None:
    groups: dict[str, list[tuple[float, float]]] = {}
    for predicted, measured, solver in points:
        groups.setdefault(find_solver(solver).family, []).append((measured, predicted.predicted))
    for library, pairs in groups.items():
        axes.loglog(*zip(*pairs, strict=True), ".", markersize=2.5, alpha=0.5, color=IMPLICIT[library], label=library)
    values = [value for pairs in groups.values() for pair in pairs for value in pair if value > 0]
    ends = 10 ** (log10(min(values)) - 0.2), 10 ** (log10(max(values)) + 0.2)
    axes.plot(ends, ends, color="0.3", linewidth=0.9)
    for factor in (band, 1 / band):
        axes.plot(ends, [end * factor for end in ends], color="0.3", linewidth=0.7, linestyle=":")
    axes.set(xlim=ends, ylim=ends, xlabel=f"{x} (dotted: factor {band:g})", ylabel=y)
    axes.grid(True, which="major", linewidth=0.4, alpha=0.5)


def _choices(left: "Axes", right: "Axes", outcomes: Sequence[Outcome]) -> None:
    """Draw error over the error asked for, and time over the best one, of the first choices, sorted."""
    margins = sorted(outcome.error / outcome.answer.question.error for outcome in outcomes if outcome.error < inf)
    left.semilogy(range(1, len(margins) + 1), margins, "o", markersize=4, color="#0072B2")
    left.axhline(1.0, color="#D55E00", linewidth=1.0)
    left.set(xlabel="held-out scene, sorted", ylabel="error of the first choice over the error asked for")
    factors = sorted(outcome.factor for outcome in outcomes if outcome.factor < inf)
    right.plot(range(1, len(factors) + 1), factors, "o", markersize=4, color="#0072B2")
    right.axhline(FACTOR, color="#D55E00", linewidth=1.0)
    right.set(xlabel="held-out scene, sorted", ylabel="time of the first choice over the best one measured")
    for axes in (left, right):
        axes.grid(True, which="major", linewidth=0.4, alpha=0.5)
