"""Particles that start from rest on the unit sphere: over many turns, and until t = √St."""

from dataclasses import dataclass
from math import pi

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from scipy.signal import find_peaks

from polhode.harness.pages.figures.style import power
from polhode.harness.paper.claims import Facts
from polhode.harness.paper.drawing import (
    BLACK,
    BLUE,
    GREEN,
    NODE,
    ORANGE,
    PURPLE,
    VERMILLION,
    draw_on_sphere,
    label,
    logarithmic,
    unit_sphere,
)
from polhode.harness.paper.item import Data, Grid, Table
from polhode.harness.paper.runs import Run, axes_of, full_run
from polhode.harness.paper.tables import columns, groups, stacked
from polhode.models.scene import EulerStart, Scene
from polhode.models.shape import Ellipsoid

# Of four Stokes numbers, beside the green of the Jeffery orbit.
COLORS = (BLUE, ORANGE, VERMILLION, PURPLE)
# Distance, in rad, at which a path counts as off the Jeffery orbit.
APART = 0.1


def _path(run: Run) -> dict[str, np.ndarray]:
    """Directions of z', in columns x, y, z."""
    return dict(zip("xyz", run.observables.rotation[:, 2].T, strict=True))


def _points(path: Table) -> np.ndarray:
    """The same, shape (n, 3)."""
    return np.column_stack([path[name] for name in "xyz"])


def _arc_length(path: np.ndarray) -> np.ndarray:
    """Length, in rad, of a path on the unit sphere up to each of its points, shape (n,)."""
    steps = 2 * np.arcsin(np.clip(np.linalg.norm(np.diff(path, axis=0), axis=1) / 2, 0, 1))
    return np.concatenate([[0.0], np.cumsum(steps)])


def _jeffery_orbit(ellipsoid: Ellipsoid, start: EulerStart, points: int) -> Table:
    """z' at St = 0 from the same orientation, for the Jeffery period of the longest and the shortest axis."""
    kappa = max(ellipsoid.semi_axes) / min(ellipsoid.semi_axes)
    times = np.linspace(0.0, 2 * pi * (kappa + 1 / kappa), points)
    return {"t": times, **_path(full_run(Scene(ellipsoid, 0.0, start, float(times[-1])), times))}


def _sphere_beside() -> tuple[Figure, Axes, Axes]:
    """A figure with a unit sphere on the left and plain axes on the right."""
    figure = Figure(figsize=(8.6, 3.9), layout=ConstrainedLayoutEngine(wspace=0.06))
    return figure, unit_sphere(figure.add_subplot(1, 2, 1, projection="3d")), figure.add_subplot(1, 2, 2)


def _draw_start(sphere: Axes, orbit: Table) -> None:
    """Draw the Jeffery orbit, and its first point, where all paths start."""
    draw_on_sphere(sphere, orbit, color=GREEN, linestyle="--", linewidth=1.3, zorder=4, label="Jeffery orbit")
    first = {name: column[:1] for name, column in orbit.items()}
    draw_on_sphere(sphere, first, marker="o", color=BLACK, markersize=4, zorder=5)


def _turns(path: Table) -> np.ndarray:
    """Times between one maximum of z and the next."""
    peaks, _ = find_peaks(path["z"])
    return np.diff(path["t"][peaks])


@dataclass(frozen=True)
class Sphere:
    """A particle from rest at St = 1000, followed over many turns; the time is in inverse shear rates."""

    ellipsoid: Ellipsoid
    start: EulerStart
    time: float
    stokes: float = 1e3

    def compute(self, grid: Grid) -> Data:
        """Path of z', its distance from the vorticity axis, and the turning rate over that of Jeffery's orbit."""
        times = np.linspace(0.0, self.time, grid.of(4001, 2001))
        run = full_run(Scene(self.ellipsoid, self.stokes, self.start, self.time), times)
        # Gyroscopic over viscous terms of `govg`, in order of magnitude: L²/I_min over the torque at rest.
        momentum = np.linalg.norm(run.observables.angular_momentum, axis=1)
        torque = 8 * pi * max(self.ellipsoid.resistance) / 2
        ratio = self.stokes * momentum**2 / min(self.ellipsoid.inertia) / torque
        orbit = _jeffery_orbit(self.ellipsoid, self.start, 401)
        return {"": {"t": times, **_path(run), "ratio": ratio}, "jeffery": orbit}

    def figure(self, data: Data) -> Figure:
        """The path on the sphere, and the tilt of the axis in time."""
        figure, sphere, axes = _sphere_beside()
        table, onset = data[""], self._onset(data)
        shown = table["t"] <= 3 * onset
        parts = ((table["t"] <= onset, BLUE, 1.8, "before the onset"), (table["t"] >= onset, ORANGE, 0.9, "after it"))
        for chosen, color, width, text in parts:
            part = {name: column[chosen & shown] for name, column in table.items()}
            draw_on_sphere(sphere, part, color=color, linewidth=width, zorder=1 + width)
            axes.plot(table["t"][chosen], table["z"][chosen], color=color, linewidth=1.1, label=text)
        _draw_start(sphere, data["jeffery"])
        axes.axvline(onset, color=NODE, linestyle=":", label="onset: gyroscopic terms exceed viscous ones")
        axes.plot([], [], color=GREEN, linestyle="--", label="Jeffery orbit (left)")
        label(axes, "time $t\\dot\\gamma$", "z component of the axis").legend(loc="upper right")
        axes.set_ylim(-1.05, 1.05)
        return figure

    def _onset(self, data: Data) -> float:
        """Time after which the gyroscopic terms stay larger than the viscous ones."""
        below = np.flatnonzero(data[""]["ratio"] < 1.0)
        last = int(below[-1]) + 1 if len(below) else 0
        return float(data[""]["t"][min(last, len(data[""]["t"]) - 1)])

    def facts(self, data: Data) -> Facts:
        """Turns before the onset, and the change of the path's shape."""
        table = data[""]
        onset = self._onset(data)
        turns, orbit = _turns(table), _turns(data["jeffery"])
        return {
            "axes": axes_of(self.ellipsoid),
            "angles": self.start.angles[:2],
            "stokes": self.stokes,
            "time": self.time,
            "onset": onset,
            "scaled": onset / self.stokes**0.5,
            "turned": _arc_length(_points(table))[np.searchsorted(table["t"], onset)],
            "first": turns[0] / orbit[0],
            "last": turns[-1] / (4 * pi),
            "tilt": np.max(np.abs(table["z"][table["t"] >= 0.95 * self.time])),
        }


@dataclass(frozen=True)
class Short:
    """A particle from rest until t = √St, up to St = 1e8."""

    ellipsoid: Ellipsoid
    start: EulerStart

    def compute(self, grid: Grid) -> Data:
        """Paths of z' and their lengths; the Jeffery orbit of the same start."""
        parts, rows = [], []
        scaled = np.linspace(0.0, 1.0, grid.of(401, 101))
        for stokes in np.geomspace(1e2, 1e8, 7).tolist():
            times = scaled * stokes**0.5
            path = _path(full_run(Scene(self.ellipsoid, stokes, self.start, times[-1]), times))
            parts.append(({"stokes": stokes}, {name: column[::2] for name, column in path.items()}))
            rows.append((stokes, _arc_length(_points(path))[-1]))
        orbit = _jeffery_orbit(self.ellipsoid, self.start, 201)
        return {"": stacked(parts), "length": columns("stokes length", rows), "jeffery": orbit}

    def figure(self, data: Data) -> Figure:
        """Paths on the sphere, and their lengths."""
        figure, sphere, axes = _sphere_beside()
        for color, (stokes, part) in zip(COLORS, list(groups(data[""], "stokes"))[::2], strict=True):
            draw_on_sphere(sphere, part, color=color, linewidth=1.4, label=f"St = {power(stokes)}")
        _draw_start(sphere, data["jeffery"])
        sphere.legend(loc="upper left", fontsize=7)
        axes.plot(data["length"]["stokes"], data["length"]["length"], "o-", color=BLUE)
        logarithmic(label(axes, "Stokes number St", "path length until $t = \\mathrm{St}^{1/2}$, rad"), "x")
        axes.set_ylim(bottom=0.0)
        return figure

    def facts(self, data: Data) -> Facts:
        """The length tends to a number of order one; how soon the path leaves the Jeffery orbit."""
        length = data["length"]["length"]
        path, orbit = _points(dict(groups(data[""], "stokes"))[1e8]), _points(data["jeffery"])
        distance = np.min(np.linalg.norm(path[:, None] - orbit[None], axis=2), axis=1)
        left, turn = _arc_length(path)[np.argmax(distance > APART)], _arc_length(orbit)[-1]
        return {
            "axes": axes_of(self.ellipsoid),
            "gap": APART,
            "length": length[-1],
            "change": length[-1] / length[-2] - 1,
            "turns": length[-1] / turn,
            "apart": distance.max(),
            "left": left,
            "share": left / turn,
            "percent": 100 * left / turn,
        }
