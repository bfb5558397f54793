"""Slow variables in time, full against averaged: the figures of one start at several Stokes numbers."""

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes

from polhode.harness.paper.item import Computed, Grid
from polhode.harness.paper.planes import distance_from_node
from polhode.harness.paper.runs import averaged_run, full_run
from polhode.harness.paper.tables import path
from polhode.models.scene import EulerStart, Scene
from polhode.models.shape import Ellipsoid

NAMES = {"Lx": "$L_x/I_{max}$", "Ly": "$L_y/I_{max}$", "Lz": "$L_z/I_{max}$", "E": "$E/I_{max}$"}
# Stokes numbers at which the error is measured beside those of the figure.
MEASURED = (1e3, 2e3, 1e4, 2e4, 5e4)
# Largest slow error at St = 100 that counts as accurate, over the largest change of a slow variable
# in the averaged run: beyond half of it a full run is nearer to a state of another time.
ACCURATE = 0.5


@dataclass(frozen=True)
class SlowMotion:
    """One start, several Stokes numbers."""

    ellipsoid: Ellipsoid
    start: EulerStart
    slow_time: float
    shown: tuple[float, ...] = (50.0, 100.0, 500.0, 5e3)

    def compute(self, grid: Grid) -> Computed:
        """Runs of the figure, and the largest error at each St."""
        points, dense = grid.of(601, 201), grid.of(8, 4)
        slow_times = np.linspace(0.0, self.slow_time, dense * (points - 1) + 1)
        averaged = averaged_run(
            Scene(self.ellipsoid, 1.0, self.start, self.slow_time), slow_times
        ).slow
        # Slow time at which L² = 2EI₂; NaN if it is not met.
        _, middle, largest = sorted(self.ellipsoid.inertia)
        beyond = np.sum(averaged[:, :3] ** 2, axis=1) - 2 * averaged[:, 3] * middle / largest
        met = self.ellipsoid.kind == "triaxial" and beyond[0] < 0 < beyond[-1]
        crossing = float(np.interp(0.0, beyond, slow_times)) if met else np.nan
        yield "", path(np.inf, slow_times[::dense], averaged[::dense])
        for stokes in sorted({*self.shown, *MEASURED[grid.of(0, -2) :]}):
            scene = Scene(self.ellipsoid, stokes, self.start, stokes * self.slow_time)
            full = full_run(scene, stokes * slow_times).slow
            error = np.max(np.abs(full - averaged), axis=1)
            late = slow_times > crossing
            parts = {"before": error[~late].max(), "after": error[late].max(initial=0.0)}
            yield (
                "errors",
                {"stokes": stokes, "error": error.max(), "end": self._end(full), **parts},
            )
            if stokes in self.shown:
                yield "", path(stokes, slow_times[::dense], full[::dense])
        yield "averaged", {"end": self._end(averaged), "crossing": crossing}

    def _end(self, slow: np.ndarray) -> float:
        """Distance from the node of the mean over the last tenth of a run."""
        return float(distance_from_node(self.ellipsoid, slow[-len(slow) // 10 :].mean(axis=0)))


def draw_crossing(axes: Axes, slow_time: float) -> None:
    """Draw where the averaged run meets L² = 2EI₂, if it does."""
    if np.isfinite(slow_time):
        axes.axvline(slow_time, color="0.4", linestyle=":", label="$L^2 = 2EI_2$ (averaged)")
