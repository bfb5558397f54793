"""Slow variables in time, full against averaged: one start at several Stokes numbers.

Slow variables are (L_x, L_y, L_z, E) over the largest moment of inertia I_max: constant for the
free top, they change in the slow time t₂ = t/St. The full equations hold the oscillation within a
turn, the averaged ones do not. L² = 2EI₂, with the middle moment of inertia I₂, is the polhode
that parts those about the longest axis from those about the shortest one. The node is the stable
fixed point of the averaged equations, the saddle an unstable one. Items of the sections on
spheroids (`lsds`) and on ellipsoids use this experiment.

In figures, heights of panels are in inches, and widths of lines and sizes of marks and letters in
points. They and the limits of axes are chosen by eye.

Ends of the ranges for which a verdict holds are estimates where their reasons do not give them.
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
# Stokes numbers at which the error is measured, besides the figure's: enough at large St for an
# exponent. An estimate.
_MEASURED_STOKES = (1e3, 2e3, 1e4, 2e4, 5e4)
# St from which on the paper calls averaging accurate.
_CLAIMED_STOKES = 100.0
# Largest error of L and E that counts as accurate, over the largest change of a slow variable in the
# averaged run. If it is off by more than half of that change, a full run may be nearer to a state of
# another time.
ACCURATE = 0.5
# The same where "accurate" is read more strictly. The paper names no number: an estimate.
_ACCURATE_STRICT = 0.1
# Smallest St of full runs whose end is compared with the node. From here on the mean end is off by
# 1e-3 I_max at most, at smaller St by up to 0.3 I_max (column `end` of "errors").
_SETTLED_STOKES = 500.0
# Share of the run's time up to which a run that leaves a plateau counts as having left it. Later,
# its oscillation at the end may be taken for that. An estimate.
_PLATEAU_LEFT = 0.95

FALLS_LIKE_INVERSE = Range(
    -1.3,
    -0.8,
    "theory: first order, -1; a few St and one start leave the oscillation's phase in it",
)


@dataclass(frozen=True)
class SlowMotion(Experiment):
    """One start at several Stokes numbers, full and averaged.

    `slow_time` is how long it is followed, and `shown` are the St of the figure, of which 100 is
    one. `word` is the verdict if all numbers lie in their ranges. `constant` is the expected range
    of the error at the largest St times that St, over I_max. `relative` is the expected range of the
    error at St = 100 over the largest change of a slow variable. An item that does not give a range
    has the range of the spheroid's first start, without a reason.
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

        The error is the largest difference of full from averaged slow variables along the run, over
        I_max.

        Tables: "" has the paths that are drawn, named by their St, ∞ for the averaged one. "errors"
        has the largest error of L and E over I_max by St, also before and after L² = 2EI₂, and the
        distance of the `end` from the node. "averaged" has the distance of the averaged run's `end`
        from the node, and the slow time of its `crossing` of L² = 2EI₂.
        """
        # Errors are taken at `dense` times as many points as are drawn. Both numbers are estimates. At
        # the largest St there is only about one point in a turn, but thousands of turns, so that some
        # points lie near a turn's largest error.
        points = grid.of(601, 201)
        dense = grid.of(8, 4)
        slow_times = np.linspace(0.0, self.slow_time, dense * (points - 1) + 1)
        # St does not matter to the averaged equations: 1 makes time and slow time equal.
        scene = Scene(self.ellipsoid, 1.0, self.start, self.slow_time)
        averaged = averaged_run(scene, slow_times).slow
        crossing = self._crossing(slow_times, averaged)
        yield "", path(np.inf, slow_times[::dense], averaged[::dense])
        # The reduced grid has the last two of `_MEASURED_STOKES` alone.
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
        """Slow time at which L² = 2EI₂, NaN if it is not met.

        `averaged` has the slow variables at the slow times, shape (n, 4).
        """
        _, middle, largest = sorted(self.ellipsoid.inertia)
        # L² - 2EI₂ over I_max²: negative at a start on the long axis' side, positive at the node.
        beyond = np.sum(averaged[:, :3] ** 2, axis=1) - 2 * averaged[:, 3] * middle / largest
        met = self.ellipsoid.kind == "triaxial" and beyond[0] < 0 < beyond[-1]
        return float(np.interp(0.0, beyond, slow_times)) if met else np.nan

    def _end(self, slow: np.ndarray) -> float:
        """Distance from the node of the mean over the last tenth of a run, shape (n, 4).

        The mean leaves out the oscillation. The share of a tenth is an estimate.
        """
        return float(distance_from_node(self.ellipsoid, slow[-len(slow) // 10 :].mean(axis=0)))

    def judge(self, data: Data) -> Verdict:
        """How the error falls with St, and from which St on it is small."""
        sentence = f"{self._ends(data)} {self._accuracy(data)}{self._plateau(data)}"
        return Verdict(self.word, sentence, self.caption(data), self.numbers(data, data["errors"]))

    def numbers(self, data: Data, errors: Table) -> list[Number]:
        """The numbers on which the claim rests, from the tables; `errors` is the one of that name."""
        fitted = errors[errors.stokes >= self.fitted_from]
        slope = exponent(fitted.stokes, fitted.error)
        # The table has its St in increasing order.
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
                f"error at St = {_CLAIMED_STOKES:g}, over the largest change of a slow variable",
                self._relative(data)[_CLAIMED_STOKES],
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
            f"Averaged run and full runs from St = {_SETTLED_STOKES:g} on end at "
            f"(L_z, E)/I_max = ({node}). The largest error of L and E along the run is "
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
            f"of it asked for, from St = {short(_first_below(relative, _ACCURATE_STRICT))} on. "
            f"At St = {_CLAIMED_STOKES:g} the error is {relative[_CLAIMED_STOKES]:.2g} times that "
            "change."
        )

    def _plateau(self, data: Data) -> str:
        """When the runs leave the plateau at the saddle, in words; empty where there is none.

        On the plateau E is smallest. A run has left it at the last slow time at which E is less
        than halfway from there to the node.
        """
        if not self.plateau:
            return ""
        paths = by(data[""], "path")
        _, energy_at_node = fixed_point(self.ellipsoid, "stable node")
        halfway = (min(paths[np.inf].E) + energy_at_node) / 2
        left = {stokes: rows.t2[halfway > rows.E][-1] for stokes, rows in paths.items()}
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
        """Size of the mean over the run of full less averaged values, over I_max.

        It is the largest of the four slow variables.
        """
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
        figure, axes = panels(3, 2, 2.0)
        *variables, error_axes, key_axes = axes
        for panel, name in zip(variables, SLOW_LABELS, strict=True):
            self._draw_variable(panel, data, name)
        self._draw_errors(error_axes, data["errors"])
        # The last panel has the key of the first four alone.
        key_axes.axis("off")
        key_axes.legend(*variables[0].get_legend_handles_labels(), loc="center")
        return figure

    def _draw_errors(self, axes: Axes, errors: Table) -> None:
        """The largest error at each St, and the first order's slope through the last one."""
        style: dict[str, Any] = {
            "marker": "o",
            "color": BLUE,
            "markersize": 3.5,
            "label": "measured",
        }
        axes.plot(errors.stokes, errors.error, **style)
        draw_power(axes, errors.stokes, errors.error[-1], -1)
        axes.set(
            xlabel="Stokes number St",
            ylabel="largest error of L and E$/I_{max}$",
            xscale="log",
            yscale="log",
        )
        square_decades(axes, fill=True)
        key_of(axes)

    def _draw_variable(self, axes: Axes, data: Data, name: str) -> None:
        """One slow variable of all runs."""
        # The averaged run lies thin on the broad one at the largest St, which it would hide. Widths
        # are in points; curves of larger `zorder` lie above others.
        widths = {np.inf: 0.9, max(self.shown): 2.0}
        zorders = {np.inf: 5.0, max(self.shown): 2.9}
        for color, (stokes, rows) in zip(RUNS, groups(data[""], "path"), strict=False):
            axes.plot(
                rows.t2,
                rows[name],
                color=color,
                label=run_name(stokes),
                linewidth=widths.get(stokes, 0.7),
                zorder=zorders.get(stokes, 3.0),
            )
        crossing = data["averaged"].crossing[0]
        if np.isfinite(crossing):
            axes.axvline(crossing, color="0.4", linestyle=":", label="$L^2 = 2EI_2$ (averaged)")
        axes.set(xlabel=r"slow time $t_2 = t\dot\gamma/\mathrm{St}$", ylabel=SLOW_LABELS[name])


def order_of_damping(ellipsoid: Ellipsoid) -> str:
    """Why the largest error times St is of order 8πX/I, and the least and largest of these, in words.

    The full equations have St only in I St/(8πX), the effective Stokes number of an axis. So an
    error of first order is a number of order one over this.
    """
    damping = ellipsoid.damping
    return (
        f"of order 8πX/I, here {min(damping):.0f} to {max(damping):.0f}: St enters only as "
        "I St/(8πX); the ends are estimates"
    )


def _first_below(relative: dict[float, float], bound: float) -> float:
    """The smallest St from which on no error exceeds a bound; NaN if the last one does.

    `relative` has the errors by St, in increasing order of St. An error that is NaN exceeds it.
    """
    too_large = [stokes for stokes, error in relative.items() if not error <= bound]
    last = max(too_large, default=-np.inf)
    return min((stokes for stokes in relative if stokes > last), default=np.nan)
