"""Slow variables in time, full against averaged: one start at several Stokes numbers.

Slow variables are (L_x, L_y, L_z, E) over the largest moment of inertia I_max: constant for the
free top, they change in the slow time t₂ = t/St. Items of the sections on spheroids (`lsds`) and on
ellipsoids use this experiment.
"""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from polhode.harness.common.text import short
from polhode.harness.pages.figures.style import BLUE, square_decades
from polhode.harness.paper.drawing import RUNS, draw_power, key_of, panels, run_name
from polhode.harness.paper.item import (
    Computed,
    Data,
    Experiment,
    Grid,
    Number,
    Range,
    Table,
    Verdict,
    Word,
)
from polhode.harness.paper.planes import distance_from_node, fixed_point
from polhode.harness.paper.runs import averaged_run, axes_of, full_run
from polhode.harness.paper.tables import by, exponent, groups, joined, path
from polhode.models.scene import EulerStart, Scene
from polhode.models.shape import Ellipsoid

SLOW_LABELS = {
    "Lx": "$L_x/I_{max}$",
    "Ly": "$L_y/I_{max}$",
    "Lz": "$L_z/I_{max}$",
    "E": "$E/I_{max}$",
}
# Stokes numbers at which the error is measured, besides the figure's.
_MEASURED_STOKES = (1e3, 2e3, 1e4, 2e4, 5e4)
# Largest error of L and E that counts as accurate, over the largest change of a slow variable in
# the averaged run: beyond half of it a full run is nearer to a state of another time.
ACCURATE = 0.5
# The same where "accurate" is read more strictly.
_ACCURATE_STRICT = 0.1
# Smallest St of full runs whose end is compared with the node.
_SETTLED_STOKES = 500.0
# Share of the run's time up to which a run that leaves a plateau counts as having left it.
_PLATEAU_LEFT = 0.95

FALLS_LIKE_INVERSE = Range(
    -1.3,
    -0.8,
    "theory: first order, -1; a few St and one start leave the oscillation's phase in it",
)


@dataclass(frozen=True)
class SlowMotion(Experiment):
    """One start at several Stokes numbers, full and averaged.

    `constant` is the expected range of the largest error times St. `relative` is the expected range
    of the error at St = 100 over the largest change of a slow variable.
    """

    ellipsoid: Ellipsoid
    start: EulerStart
    slow_time: float
    shown: tuple[float, ...] = (50.0, 100.0, 500.0, 5e3)
    word: Word = field(default=Word.SHARPENED, repr=False)
    fitted_from: float = field(default=500.0, repr=False)  # Smallest St of the fitted exponent.
    constant: Range = field(default_factory=lambda: Range(20.0, 60.0, ""), repr=False)
    relative: Range = field(default_factory=lambda: Range(0.0, ACCURATE, ""), repr=False)
    plateau: bool = field(default=False, repr=False)  # Whether the run lingers at the saddle.

    def compute(self, grid: Grid) -> Computed:
        """Runs of the figure, and the largest error at each St.

        Tables: "" has the paths that are drawn, named by their St, ∞ for the averaged one. "errors"
        has the largest error of L and E over I_max by St, also before and after L² = 2EI₂, and the
        distance of the `end` from the node. "averaged" has the distance of the averaged run's `end`
        from the node, and the slow time of its `crossing` of L² = 2EI₂.
        """
        # Errors are taken at `dense` times as many points as are drawn.
        points = grid.of(601, 201)
        dense = grid.of(8, 4)
        slow_times = np.linspace(0.0, self.slow_time, dense * (points - 1) + 1)
        scene = Scene(self.ellipsoid, 1.0, self.start, self.slow_time)
        averaged = averaged_run(scene, slow_times).slow
        crossing = self._crossing(slow_times, averaged)
        yield "", path(np.inf, slow_times[::dense], averaged[::dense])
        for stokes in sorted({*self.shown, *_MEASURED_STOKES[grid.of(0, -2) :]}):
            scene = Scene(self.ellipsoid, stokes, self.start, stokes * self.slow_time)
            full = full_run(scene, stokes * slow_times).slow
            error = np.max(np.abs(full - averaged), axis=1)
            late = slow_times > crossing
            row = {"stokes": stokes, "error": error.max(), "end": self._end(full)}
            parts = {"before": error[~late].max(), "after": error[late].max(initial=0.0)}
            yield "errors", {**row, **parts}
            if stokes in self.shown:
                yield "", path(stokes, slow_times[::dense], full[::dense])
        yield "averaged", {"end": self._end(averaged), "crossing": crossing}

    def _crossing(self, slow_times: np.ndarray, averaged: np.ndarray) -> float:
        """Slow time at which L² = 2EI₂; NaN if it is not met."""
        _, middle, largest = sorted(self.ellipsoid.inertia)
        beyond = np.sum(averaged[:, :3] ** 2, axis=1) - 2 * averaged[:, 3] * middle / largest
        met = self.ellipsoid.kind == "triaxial" and beyond[0] < 0 < beyond[-1]
        return float(np.interp(0.0, beyond, slow_times)) if met else np.nan

    def _end(self, slow: np.ndarray) -> float:
        """Distance from the node of the mean over the last tenth of a run."""
        return float(distance_from_node(self.ellipsoid, slow[-len(slow) // 10 :].mean(axis=0)))

    def judge(self, data: Data) -> Verdict:
        """How the error falls with St, and from which St on it is small."""
        errors = data["errors"]
        sentence = f"{self._ends(data)} {self._accuracy(data)}{self._plateau(data)}"
        return Verdict(self.word, sentence, self.caption(data), self.numbers(data, errors))

    def numbers(self, data: Data, errors: Table) -> list[Number]:
        """The numbers that the claim rests on."""
        late = errors[errors.stokes >= self.fitted_from]
        slope = exponent(late.stokes, late.error)
        largest = errors.stokes[-1]
        settled = errors[errors.stokes >= _SETTLED_STOKES]
        lowest = min(self.shown)
        return [
            Number(
                f"exponent of the error of L and E in St, St ≥ {self.fitted_from:g}",
                float(slope),
                FALLS_LIKE_INVERSE,
                interval=slope.interval,
            ),
            Number(
                f"error × St at St = {short(largest)}",
                errors.error[-1] * largest,
                self.constant,
                "I_max",
            ),
            Number(
                "error at St = 100, over the largest change of a slow variable",
                self._relative(data)[100.0],
                self.relative,
            ),
            Number(
                f"mean difference over the run, St = {short(lowest)}",
                self._mean_difference(data, lowest),
                unit="I_max",
            ),
            Number(
                "distance of the averaged end from the node",
                data["averaged"].end[0],
                Range.at_most(2e-3, "what is left of the approach at the end of the run"),
            ),
            Number(
                f"the same of the mean full end, St ≥ {_SETTLED_STOKES:g}",
                settled.end.max(),
                Range.at_most(
                    1e-2, "the oscillation's mean is off by order 1/St ≤ 2e-3, times some"
                ),
            ),
        ]

    def caption(self, data: Data) -> str:
        """The caption of the figure."""
        start = ", ".join(f"{value:.4g}" for value in (*self.start.angles, *self.start.rates))
        crossing = data["averaged"].crossing[0]
        met = f" L² = 2EI₂ at t₂ = {crossing:.3g}." if np.isfinite(crossing) else ""
        return (
            f"Slow variables of the ellipsoid with semi-axes {axes_of(self.ellipsoid)} from "
            f"(θ, φ, ψ, θ̇, φ̇, ψ̇) = ({start}), full at St = {joined(self.shown)} and averaged; "
            f"below, the largest difference along the run.{met}"
        )

    def _ends(self, data: Data) -> str:
        """The ends of the runs, and the errors along them, in words."""
        errors = data["errors"]
        largest = errors.stokes[-1]
        node = joined(fixed_point(self.ellipsoid, "stable node"), ".3g")
        shown = ", ".join(
            f"{row.error:.2g} at St = {row.stokes:g}" for row in errors if row.stokes in self.shown
        )
        lowest = min(self.shown)
        return (
            "Averaged run and full runs from St = 500 on end at (L_z, E)/I_max = "
            f"({node}). The largest error of L and E along the run is "
            f"{errors.error[-1] * largest:.2g}/St at St = {short(largest)}, and {shown}; at St = "
            f"{short(lowest)} the mean difference over the run is "
            f"{self._mean_difference(data, lowest):.2g} I_max."
        )

    def _accuracy(self, data: Data) -> str:
        """From which St on averaging counts as accurate, in words."""
        relative = self._relative(data)
        return (
            "Accurate is taken as an error of at most half of the largest change of a slow "
            f"variable in the averaged run, here {self._change(data):.2g} I_max: so it is from "
            f"St = {short(_first_below(relative, ACCURATE))} on, of those measured; were a tenth "
            f"of it asked for, from St = {short(_first_below(relative, _ACCURATE_STRICT))} on. At "
            f"St = 100 the error is {relative[100.0]:.2g} times that change."
        )

    def _plateau(self, data: Data) -> str:
        """When the runs leave the plateau at the saddle; empty where there is none."""
        if not self.plateau:
            return ""
        paths = by(data[""], "path")
        end = fixed_point(self.ellipsoid, "stable node")[1]
        middle = (min(paths[np.inf].E) + end) / 2
        left = {stokes: rows.t2[middle > rows.E][-1] for stokes, rows in paths.items()}
        limit = _PLATEAU_LEFT * self.slow_time
        leaving = ", ".join(
            f"at t₂ = {left[stokes]:.2f} (St = {stokes:g})"
            for stokes in self.shown
            if left[stokes] < limit
        )
        staying = " and ".join(f"{stokes:g}" for stokes in self.shown if left[stokes] >= limit)
        return (
            " The plateau at the saddle is left, E halfway to its end, at t₂ = "
            f"{left[np.inf]:.2f} (averaged), {leaving}; at St = {staying} not before the end of "
            "the run."
        )

    def _mean_difference(self, data: Data, stokes: float) -> float:
        """The mean over the run of full less averaged values, the largest of the four slow variables."""
        paths = by(data[""], "path")
        return max(abs(np.mean(paths[stokes][name] - paths[np.inf][name])) for name in SLOW_LABELS)

    def _change(self, data: Data) -> float:
        """The largest range of a slow variable, over I_max, in the averaged run."""
        averaged = by(data[""], "path")[np.inf]
        return max(np.ptp(averaged[name]) for name in SLOW_LABELS)

    def _relative(self, data: Data) -> dict[float, float]:
        """The largest error at each St over the largest change of a slow variable."""
        errors = data["errors"]
        return dict(zip(errors.stokes.tolist(), errors.error / self._change(data), strict=True))

    def draw(self, data: Data) -> Figure:
        """Slow variables against slow time; the largest error against St."""
        errors = data["errors"]
        figure, axes = panels(3, 2, 2.0)
        for name, place in (("Lx", 0), ("Ly", 1), ("Lz", 2), ("E", 3)):
            self._draw_variable(axes[place], data, name)
        style: dict[str, Any] = {
            "marker": "o",
            "color": BLUE,
            "markersize": 3.5,
            "label": "measured",
        }
        axes[4].plot(errors.stokes, errors.error, **style)
        draw_power(axes[4], errors.stokes, errors.error[-1], -1)
        axes[4].set(
            xlabel="Stokes number St",
            ylabel="largest error of L and E$/I_{max}$",
            xscale="log",
            yscale="log",
        )
        square_decades(axes[4], fill=True)
        key_of(axes[4])
        axes[5].axis("off")
        axes[5].legend(*axes[0].get_legend_handles_labels(), loc="center")
        return figure

    def _draw_variable(self, axes: Axes, data: Data, name: str) -> None:
        """One slow variable of all runs."""
        # The averaged run lies thin on the broad one at the largest St, which it would hide.
        widths = {np.inf: 0.9, max(self.shown): 2.0}
        heights = {np.inf: 5.0, max(self.shown): 2.9}
        for color, (stokes, rows) in zip(RUNS, groups(data[""], "path"), strict=False):
            axes.plot(
                rows.t2,
                rows[name],
                color=color,
                label=run_name(stokes),
                linewidth=widths.get(stokes, 0.7),
                zorder=heights.get(stokes, 3.0),
            )
        crossing = data["averaged"].crossing[0]
        if np.isfinite(crossing):
            axes.axvline(crossing, color="0.4", linestyle=":", label="$L^2 = 2EI_2$ (averaged)")
        axes.set(xlabel=r"slow time $t_2 = t\dot\gamma/\mathrm{St}$", ylabel=SLOW_LABELS[name])


def _first_below(relative: dict[float, float], bound: float) -> float:
    """The smallest St from which on no error exceeds a bound."""
    too_large = [stokes for stokes, error in relative.items() if not error <= bound]
    last = max(too_large, default=-np.inf)
    return min((stokes for stokes in relative if stokes > last), default=np.nan)
