"""Section "Discussion", particles that start from rest: on the unit sphere, and the transient of order √St."""

from dataclasses import dataclass
from math import pi
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from scipy.integrate import cumulative_trapezoid
from scipy.signal import find_peaks

from polhode.harness.pages.figures.style import power
from polhode.harness.paper import drawing
from polhode.harness.paper.drawing import draw_law, draw_on_sphere, label, legend_in, panels, unit_sphere
from polhode.harness.paper.item import Computed, Data, Grid, Table
from polhode.harness.paper.runs import Run, full_run
from polhode.harness.paper.sections.slow_motion import NAMES
from polhode.harness.paper.tables import groups
from polhode.models.observables import angular_velocity
from polhode.models.scene import EulerStart, Scene
from polhode.models.shape import Ellipsoid

# Of four Stokes numbers, beside the green of the Jeffery orbit.
COLORS = (drawing.BLUE, drawing.ORANGE, drawing.VERMILLION, drawing.PURPLE)
# Distance, in rad, at which a path counts as off the Jeffery orbit.
APART = 0.1
# Rotation, in rad, of a particle since its start that marks the onset of inertia.
ONSET = 1.0
# Share of the largest torque by which a weakest one stands out.
WIGGLE = 0.02
# Smallest St of the fits of the transient.
LARGE = 5e5
# Scaled time up to which the magnified views go.
EARLY = 2.0
MARKS = ("turned by 1 rad", "first wiggle")


def _path(run: Run) -> dict[str, np.ndarray]:
    """Directions of z', in columns x, y, z."""
    return dict(zip("xyz", run.observables.rotation[:, 2].T, strict=True))


def points(path: Table) -> np.ndarray:
    """The same, shape (n, 3)."""
    return np.column_stack([path[name] for name in "xyz"])


def arc_length(path: np.ndarray) -> np.ndarray:
    """Length, in rad, of a path on the unit sphere up to each of its points, shape (n,)."""
    steps = 2 * np.arcsin(np.clip(np.linalg.norm(np.diff(path, axis=0), axis=1) / 2, 0, 1))
    return np.concatenate([[0.0], np.cumsum(steps)])


def _jeffery_orbit(ellipsoid: Ellipsoid, start: EulerStart, count: int) -> Computed:
    """z' at St = 0 from the same orientation, for the Jeffery period of the longest and the shortest axis."""
    kappa = max(ellipsoid.semi_axes) / min(ellipsoid.semi_axes)
    times = np.linspace(0.0, 2 * pi * (kappa + 1 / kappa), count)
    yield "jeffery", {"t": times, **_path(full_run(Scene(ellipsoid, 0.0, start, float(times[-1])), times))}


def _sphere_beside() -> tuple[Figure, Axes, Axes]:
    """A figure with a unit sphere on the left and plain axes on the right."""
    figure = Figure(figsize=(8.6, 3.9), layout=ConstrainedLayoutEngine(wspace=0.06))
    return figure, unit_sphere(figure.add_subplot(1, 2, 1, projection="3d")), figure.add_subplot(1, 2, 2)


def _draw_start(sphere: Axes, orbit: Table) -> None:
    """Draw the Jeffery orbit, and its first point, where all paths start."""
    draw_on_sphere(sphere, orbit, color=drawing.GREEN, linestyle="--", linewidth=1.3, zorder=4, label="Jeffery orbit")
    draw_on_sphere(sphere, orbit[:1], marker="o", color=drawing.BLACK, markersize=4, zorder=5)


def turns(path: Table) -> np.ndarray:
    """Times between one maximum of z and the next."""
    peaks, _ = find_peaks(path.z)
    return np.diff(path.t[peaks])


def onset_of(path: Table) -> float:
    """Time after which the gyroscopic terms stay larger than the viscous ones."""
    below = np.flatnonzero(path.ratio < 1.0)
    last = int(below[-1]) + 1 if len(below) else 0
    return float(path.t[min(last, len(path) - 1)])


@dataclass(frozen=True)
class Sphere:
    """A particle from rest at St = 1000, followed over many turns; the time is in inverse shear rates."""

    ellipsoid: Ellipsoid
    start: EulerStart
    time: float
    stokes: float = 1e3

    def compute(self, grid: Grid) -> Computed:
        """Path of z', its distance from the vorticity axis, and the turning rate over that of Jeffery's orbit."""
        times = np.linspace(0.0, self.time, grid.of(4001, 2001))
        run = full_run(Scene(self.ellipsoid, self.stokes, self.start, self.time), times)
        # Gyroscopic over viscous terms of `govg`, in order of magnitude: L²/I_min over the torque at rest.
        momentum = np.linalg.norm(run.observables.angular_momentum, axis=1)
        torque = 8 * pi * max(self.ellipsoid.resistance) / 2
        ratio = self.stokes * momentum**2 / min(self.ellipsoid.inertia) / torque
        yield "", {"t": times, **_path(run), "ratio": ratio}
        yield from _jeffery_orbit(self.ellipsoid, self.start, 401)

    def figure(self, data: Data) -> Figure:
        """The path on the sphere, and the tilt of the axis in time."""
        figure, sphere, axes = _sphere_beside()
        table, onset = data[""], onset_of(data[""])
        before, after = table[table.t <= onset], table[table.t >= onset]
        for part, color, width, text in (
            (before, drawing.BLUE, 1.8, "before the onset"),
            (after, drawing.ORANGE, 0.9, "after it"),
        ):
            draw_on_sphere(sphere, part[part.t <= 3 * onset], color=color, linewidth=width, zorder=1 + width)
            axes.plot(part.t, part.z, color=color, linewidth=1.1, label=text)
        _draw_start(sphere, data["jeffery"])
        axes.axvline(onset, color=drawing.NODE, linestyle=":", label="onset: gyroscopic terms exceed viscous ones")
        axes.plot([], [], color=drawing.GREEN, linestyle="--", label="Jeffery orbit (left)")
        label(axes, "time $t\\dot\\gamma$", "z component of the axis", ylim=(-1.05, 1.05)).legend(loc="upper right")
        return figure


@dataclass(frozen=True)
class Short:
    """A particle from rest until t = √St, up to St = 1e8."""

    ellipsoid: Ellipsoid
    start: EulerStart

    def compute(self, grid: Grid) -> Computed:
        """Paths of z' and their lengths; the Jeffery orbit of the same start."""
        scaled = np.linspace(0.0, 1.0, grid.of(401, 101))
        for stokes in np.geomspace(1e2, 1e8, 7).tolist():
            times = scaled * stokes**0.5
            path = _path(full_run(Scene(self.ellipsoid, stokes, self.start, times[-1]), times))
            yield "", {"stokes": stokes, **{name: column[::2] for name, column in path.items()}}
            yield "length", {"stokes": stokes, "length": arc_length(np.column_stack([*path.values()]))[-1]}
        yield from _jeffery_orbit(self.ellipsoid, self.start, 201)

    def figure(self, data: Data) -> Figure:
        """Paths on the sphere, and their lengths."""
        figure, sphere, axes = _sphere_beside()
        for color, (stokes, part) in zip(COLORS, list(groups(data[""], "stokes"))[::2], strict=True):
            draw_on_sphere(sphere, part, color=color, linewidth=1.4, label=f"St = {power(stokes)}")
        _draw_start(sphere, data["jeffery"])
        sphere.legend(loc="upper left", fontsize=7)
        axes.plot(data["length"].stokes, data["length"].length, "o-", color=drawing.BLUE)
        label(axes, "Stokes number St", "path length until $t = \\mathrm{St}^{1/2}$, rad", log="x").set_ylim(bottom=0.0)
        return figure


@dataclass(frozen=True)
class Transient:
    """A particle from rest at several St, followed for some √St."""

    ellipsoid: Ellipsoid
    start: EulerStart
    stokes: tuple[float, ...] = (50.0, 500.0, 5e3, 5e4, 5e5)
    scaled_time: float = 6.0

    def compute(self, grid: Grid) -> Computed:
        """Slow variables against t/√St, and the onset at each St."""
        scaled = np.linspace(0.0, self.scaled_time, grid.of(4001, 2001))
        for stokes in (*self.stokes, 5e6, 5e7):
            times = scaled * stokes**0.5
            run = full_run(Scene(self.ellipsoid, stokes, self.start, times[-1]), times)
            if stokes in self.stokes:
                yield "", {"stokes": stokes, "scaled": scaled[::8], **dict(zip(NAMES, run.slow[::8].T, strict=True))}
            yield "onset", {"stokes": stokes, **_onset_of(run, scaled)}

    def figure(self, data: Data) -> Figure:
        """Four variables as they are; three of them, scaled, at the largest St; the onset."""
        figure, axes = panels(3, 3, 3.2, 2.3)
        onset, wiggle = (float(np.mean(data["onset"][name][-2:])) for name in ("turned", "wiggle"))
        for place, (name, text) in zip((0, 1, 3, 4), NAMES.items(), strict=True):
            self._draw(axes[place], data[""], name, text, (onset, wiggle))
        early = data[""][(data[""].stokes >= 5e3) & (data[""].scaled <= EARLY)]
        for own, name, exponent_ in zip(axes[6:], ("Ly", "Lz", "E"), (0.5, 0.5, 1.0), strict=True):
            root = "\\mathrm{St}\\," if name == "E" else "\\mathrm{St}^{1/2}\\,"
            self._draw(own, early, name, f"${root}" + NAMES[name][1:], (onset, wiggle), exponent_)
        found, place = data["onset"], axes[2]
        for style, color, name, text in zip(
            "os", (drawing.BLUE, drawing.NODE), ("turned", "wiggle"), MARKS, strict=True
        ):
            place.plot(found.stokes, found[name] * found.stokes**0.5, style, color=color, label=text)
        draw_law(place, found.stokes, onset * found.stokes[-1] ** 0.5, 0.5)
        label(place, "Stokes number St", "onset time $t\\dot\\gamma$", log="xy").legend()
        legend_in(axes[5], axes[0])
        return figure

    def _draw(
        self, axes: Axes, table: Table, name: str, text: str, onset: tuple[float, float], scaling: float = 0.0
    ) -> None:
        colors = drawing.CYCLE[self.stokes.index(min(table.stokes)) :]
        for color, (stokes, part) in zip(colors, groups(table, "stokes"), strict=False):
            value, run = part[name] * part.stokes**scaling, f"St = {power(stokes)}"
            axes.plot(part.scaled, value, color=color, label=run, linewidth=0.8)
        for time, line, own in zip(onset, (":", "--"), MARKS, strict=True):
            axes.axvline(time, color="0.4", linestyle=line, linewidth=0.9, label=own)
        label(axes, "$t\\dot\\gamma/\\mathrm{St}^{1/2}$", text)


def _onset_of(run: Run, scaled: np.ndarray) -> dict[str, Any]:
    """Scaled times of the first radian, and of the first wiggle of L_z, its weakest torque; the speed at t = √St."""
    speed = np.linalg.norm(angular_velocity(run.scene.ellipsoid, run.observables), axis=1)
    turned = np.interp(ONSET, cumulative_trapezoid(speed, run.times, initial=0.0), scaled)
    torque = np.gradient(run.observables.angular_momentum[:, 2], run.times)
    weakest, _ = find_peaks(torque, prominence=WIGGLE * np.max(np.abs(torque)))
    return {"turned": turned, "wiggle": scaled[weakest[0]], "speed": np.interp(1.0, scaled, speed)}
