"""Section "Discussion", particles that start from rest: on the unit sphere, and the transient of order √St."""

from dataclasses import dataclass
from math import pi

import numpy as np
from matplotlib.axes import Axes
from scipy.integrate import cumulative_trapezoid
from scipy.signal import find_peaks

from polhode.harness.paper.item import Computed, Grid, Table
from polhode.harness.paper.runs import Run, full_run
from polhode.harness.paper.sections.slow_motion import NAMES
from polhode.models.observables import angular_velocity
from polhode.models.scene import EulerStart, Scene
from polhode.models.shape import Ellipsoid

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
    yield (
        "jeffery",
        {"t": times, **_path(full_run(Scene(ellipsoid, 0.0, start, float(times[-1])), times))},
    )


def draw_marks(axes: Axes, onset: Table) -> None:
    """Draw the onset at the largest St."""
    for name, line, text in (("turned", ":", "turned by 1 rad"), ("wiggle", "--", "first wiggle")):
        axes.axvline(
            np.mean(onset[name][-2:]), color="0.4", linestyle=line, linewidth=0.9, label=text
        )


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
        """Path of z', and its gyroscopic over its viscous terms."""
        times = np.linspace(0.0, self.time, grid.of(4001, 2001))
        run = full_run(Scene(self.ellipsoid, self.stokes, self.start, self.time), times)
        # Gyroscopic over viscous terms of `govg`, in order of magnitude: L²/I_min over the torque
        # at rest.
        momentum = np.linalg.norm(run.observables.angular_momentum, axis=1)
        torque = 8 * pi * max(self.ellipsoid.resistance) / 2
        ratio = self.stokes * momentum**2 / min(self.ellipsoid.inertia) / torque
        yield "", {"t": times, **_path(run), "ratio": ratio}
        yield from _jeffery_orbit(self.ellipsoid, self.start, 401)


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
            yield (
                "length",
                {"stokes": stokes, "length": arc_length(np.column_stack([*path.values()]))[-1]},
            )
        yield from _jeffery_orbit(self.ellipsoid, self.start, 201)


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
                yield (
                    "",
                    {
                        "stokes": stokes,
                        "scaled": scaled[::8],
                        **dict(zip(NAMES, run.slow[::8].T, strict=True)),
                    },
                )
            # Scaled times of the first radian and of the first wiggle of L_z, its weakest torque;
            # the speed at t = √St.
            speed = np.linalg.norm(angular_velocity(self.ellipsoid, run.observables), axis=1)
            turned = np.interp(ONSET, cumulative_trapezoid(speed, run.times, initial=0.0), scaled)
            torque = np.gradient(run.observables.angular_momentum[:, 2], run.times)
            weakest, _ = find_peaks(torque, prominence=WIGGLE * np.max(np.abs(torque)))
            found = {
                "turned": turned,
                "wiggle": scaled[weakest[0]],
                "speed": np.interp(1.0, scaled, speed),
            }
            yield "onset", {"stokes": stokes, **found}
