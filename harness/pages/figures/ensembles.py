"""What became of an ensemble, as a picture: moments of orientation, distribution of L_z, arrivals."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from polhode.harness.ensembles.ensemble import Ensemble
from polhode.harness.ensembles.statistics import SECOND, SLOW_NAMES, Statistics
from polhode.harness.ensembles.summary import arrived, means, snapshot_times
from polhode.harness.pages.figures.style import power

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Components of a moment, and Stokes numbers from the smallest to the largest.
DASHES, COLOURS = ("-", "--", ":"), "viridis"
# 95 % of a normal variable lie within so many standard deviations.
STANDARD = 1.96


def picture(found: Sequence[tuple[Ensemble, Statistics]]) -> Any:
    """Ensembles of one shape in a row of panels, a colour for each Stokes number; bands hold 95 %."""
    import matplotlib as mpl
    import matplotlib.pyplot as plt

    figure, panels = plt.subplots(1, 3, figsize=(13, 3.8), layout="constrained")
    shades = mpl.colormaps[COLOURS](np.linspace(0.05, 0.85, len(found)))
    slow = all(ensemble.slow_time is not None and np.isfinite(ensemble.stokes) for ensemble, _ in found)
    for (ensemble, statistics), shade in zip(sorted(found, key=lambda each: each[0].stokes), shades, strict=True):
        unit = ensemble.stokes if slow else 1.0
        _moments(panels[0], ensemble, statistics, unit, shade)
        _distribution(panels[1], ensemble, statistics, shade)
        for k, attractor in enumerate(ensemble.attractors):
            shares = arrived(statistics, k)
            times = np.linspace(0.0, ensemble.time, ensemble.samples) / unit
            name = f"{attractor.rotation}, St = {power(ensemble.stokes)}"
            panels[2].plot(times, [each.value for each in shares], color=shade, ls=DASHES[k % 3], label=name)
            ends = [[getattr(each, end) for each in shares] for end in ("low", "high")]
            panels[2].fill_between(times, *ends, color=shade, alpha=0.2, linewidth=0)
    for axes, title in zip(panels, ("Orientation in time", "Distribution of $L_z$", "Arrived"), strict=True):
        axes.set_title(title, loc="left")
        axes.grid(True, linewidth=0.4, alpha=0.5)
        if axes is not panels[1]:
            axes.set_xlabel("slow time $t_2 = t/\\mathrm{St}$" if slow else "time, in inverse shear rates")
        if axes.get_legend_handles_labels()[1]:
            axes.legend(fontsize=7, frameon=False)
    panels[2].set_ylabel("fraction of the particles")
    panels[2].set_ylim(0, 1.02)
    return figure


def _moments(axes: "Axes", ensemble: Ensemble, statistics: Statistics, unit: float, shade: Any) -> None:
    """Mean squares of the direction of the last axis, the shortest of a triaxial shape; else means of L."""
    oriented = bool(ensemble.layout.axes)
    mean, error = means(statistics, "second" if oriented else "slow")
    for i, name in enumerate("xyz"):
        place = (slice(None), -1, SECOND.index((i, i))) if oriented else (slice(None), SLOW_NAMES.index(f"L{name}"))
        times, label = np.array(snapshot_times(ensemble)) / unit, f"$p_{name}^2$" if oriented else f"$L_{name}$"
        name = f"{label}, St = {power(ensemble.stokes)}"
        axes.plot(times, mean[place], color=shade, ls=DASHES[i], label=name)
        band = STANDARD * error[place]
        axes.fill_between(times, mean[place] - band, mean[place] + band, color=shade, alpha=0.2, linewidth=0)
    axes.set_ylabel("mean of the axis' squared components" if oriented else "mean of L over $I_{max}$")


def _distribution(axes: "Axes", ensemble: Ensemble, statistics: Statistics, shade: Any) -> None:
    """Histograms of L_z at the start, after about a fifth of the run, and at the end."""
    edges, fifth = ensemble.layout.edges("Lz"), -(-(ensemble.snapshots - 1) // 5)
    for snapshot, when, line in (
        (0, "start", ":"),
        (fifth, f"{fifth / (ensemble.snapshots - 1):.0%}", "--"),
        (-1, "end", "-"),
    ):
        counts = statistics.histograms[snapshot, SLOW_NAMES.index("Lz"), 1:-1]
        share = counts / max(statistics.finished, 1) / np.diff(edges)
        axes.stairs(share, edges, color=shade, ls=line, label=f"{when}, St = {power(ensemble.stokes)}")
    axes.set_xlabel("$L_z$ over $I_{max}$")
    axes.set_ylabel("density of particles")
    axes.set_yscale("symlog", linthresh=0.1)
    axes.set_ylim(bottom=0)
