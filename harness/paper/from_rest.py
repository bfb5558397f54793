"""Section "Discussion": particles that start from rest, and the transient of order √St."""

from dataclasses import dataclass
from math import pi

import numpy as np
from matplotlib.figure import Figure

from polhode.harness.paper.drawing import (
    BLACK,
    BLUE,
    CYCLE,
    GREEN,
    NODE,
    ORANGE,
    PURPLE,
    VERMILLION,
    groups,
    label,
    logarithmic,
    panels,
    power,
    unit_sphere,
)
from polhode.harness.paper.item import Data, Grid, Item, Number, Section, Verdict, Word
from polhode.harness.paper.planes import columns, stacked
from polhode.harness.paper.runs import Run, full_run, power_law, spheroid
from polhode.harness.paper.slow_motion import NAMES
from polhode.models.catalogue import form as find_form
from polhode.models.scene import EulerStart, Scene
from polhode.models.shape import Ellipsoid
from polhode.solvers.solve import solve

# Rotation, in rad, of a particle since its start that marks the onset of inertia.
ONSET = 1.0
# Smallest St of the fits of the transient.
LARGE = 5e5
# Of four Stokes numbers, beside the green of the Jeffery orbit.
COLORS = (BLUE, ORANGE, VERMILLION, PURPLE)


def axis_path(run: Run, axis: int = 2) -> np.ndarray:
    """Directions of a body axis, shape (n, 3)."""
    return run.observables.rotation[:, axis]


def arc_length(path: np.ndarray) -> np.ndarray:
    """Length, in rad, of a path on the unit sphere up to each of its points, shape (n,)."""
    steps = 2 * np.arcsin(np.clip(np.linalg.norm(np.diff(path, axis=0), axis=1) / 2, 0, 1))
    return np.concatenate([[0.0], np.cumsum(steps)])


def jeffery_path(ellipsoid: Ellipsoid, start: EulerStart, times: np.ndarray, axis: int = 2) -> np.ndarray:
    """The body axis at St = 0 from the same orientation, shape (n, 3)."""
    scene = Scene(ellipsoid, 0.0, start, float(times[-1]))
    form = find_form("jeffery")
    return form.observe(scene, solve(form.problem(scene), "taylor", 1e-12, times).states).rotation[:, axis]


@dataclass(frozen=True)
class Sphere:
    """A particle from rest at St = 1000, followed over many turns.

    Parameters
    ----------
    ellipsoid : Ellipsoid
    start : EulerStart
    time : float
        In inverse shear rates.
    """

    ellipsoid: Ellipsoid
    start: EulerStart
    time: float
    stokes: float = 1e3

    def compute(self, grid: Grid) -> Data:
        """Path of z', its distance from the vorticity axis, and the turning rate over that of Jeffery's orbit."""
        times = np.linspace(0.0, self.time, grid.of(4001, 2001))
        run = full_run(Scene(self.ellipsoid, self.stokes, self.start, self.time), times)
        path = axis_path(run)
        kappa = max(self.ellipsoid.semi_axes) / min(self.ellipsoid.semi_axes)
        turn = np.linspace(0.0, 2 * pi * (kappa + 1 / kappa), 401)
        orbit = jeffery_path(self.ellipsoid, self.start, turn)
        ratio = self._inertia_over_drag(run)
        names = ("x", "y", "z")
        return {
            "": {"t": times, **dict(zip(names, path.T, strict=True)), "ratio": ratio},
            "jeffery": {"t": turn, **dict(zip(names, orbit.T, strict=True))},
        }

    def _inertia_over_drag(self, run: Run) -> np.ndarray:
        """Gyroscopic over viscous terms of `govg`, in order of magnitude: L²/I_min over the torque at rest."""
        momentum = np.linalg.norm(run.observables.angular_momentum, axis=1)
        return self.stokes * momentum**2 / min(self.ellipsoid.inertia) / (8 * pi * max(self.ellipsoid.resistance) / 2)

    def figure(self, data: Data) -> Figure:
        """The path on the sphere, and the tilt of the axis in time."""
        figure = Figure(figsize=(8.6, 3.9), layout="constrained")
        sphere = unit_sphere(figure.add_subplot(1, 2, 1, projection="3d"))
        table, orbit = data[""], data["jeffery"]
        sphere.plot(table["x"], table["y"], table["z"], color=BLUE, linewidth=0.6)
        sphere.plot(orbit["x"], orbit["y"], orbit["z"], color=GREEN, linestyle="--", linewidth=1.3)
        sphere.plot(table["x"][:1], table["y"][:1], table["z"][:1], "o", color=BLACK, markersize=4)
        axes = figure.add_subplot(1, 2, 2)
        axes.plot(table["t"], table["z"], color=BLUE, linewidth=0.8, label="z component of the axis")
        axes.axvline(self._onset(data), color=NODE, linestyle=":", label="gyroscopic terms exceed viscous ones")
        axes.plot([], [], color=GREEN, linestyle="--", label="Jeffery orbit (left)")
        label(axes, "time $t\\dot\\gamma$", "z component of the axis").legend(loc="lower right")
        axes.set_ylim(-1.35, 1.05)
        return figure

    def _onset(self, data: Data) -> float:
        """Time after which the gyroscopic terms stay larger than the viscous ones."""
        below = np.flatnonzero(data[""]["ratio"] < 1.0)
        last = int(below[-1]) + 1 if len(below) else 0
        return float(data[""]["t"][min(last, len(data[""]["t"]) - 1)])

    def verdict(self, data: Data) -> Verdict:
        """Turns before the onset, and the change of the path's shape."""
        table = data[""]
        onset = self._onset(data)
        path = np.column_stack([table["x"], table["y"], table["z"]])
        turned = float(arc_length(path)[np.searchsorted(table["t"], onset)])
        numbers = (
            Number("time after which gyroscopic terms stay above viscous ones", onset, low=0.0, unit="1/γ̇"),
            Number("the same over √St", onset / self.stokes**0.5, 0.2, 20.0),
            Number("path length up to then", turned, low=pi, unit="rad"),
        )
        sentence = (
            f"Gyroscopic terms stay above viscous ones from t = {onset:.3g} = {onset / self.stokes**0.5:.2g} √St on; "
            f"by then the axis has run through {turned:.2g} rad along Jeffery-like turns."
        )
        return Verdict(Word.SHARPENED, sentence, numbers)

    def caption(self, data: Data) -> str:
        """What the figure shows."""
        axes = ", ".join(f"{length:g}" for length in self.ellipsoid.semi_axes)
        return (
            f"Axis z' of ({axes}) from rest at (θ, φ) = ({self.start.angles[0]:.4g}, {self.start.angles[1]:.4g}), St = "
            f"{self.stokes:g}, t up to {self.time:g}; green: the Jeffery orbit of the same orientation; dot: start."
        )


@dataclass(frozen=True)
class Transient:
    """A particle from rest at several St, followed for some √St.

    Parameters
    ----------
    ellipsoid : Ellipsoid
    start : EulerStart
    """

    ellipsoid: Ellipsoid
    start: EulerStart
    stokes: tuple[float, ...] = (50.0, 500.0, 5e3, 5e4, 5e5)
    scaled_time: float = 6.0

    def compute(self, grid: Grid) -> Data:
        """Slow variables against t/√St, and the onset at each St."""
        scaled = np.linspace(0.0, self.scaled_time, grid.of(4001, 2001))
        parts, rows = [], []
        for stokes in (*self.stokes, 5e6, 5e7):
            times = scaled * stokes**0.5
            run = full_run(Scene(self.ellipsoid, stokes, self.start, times[-1]), times)
            if stokes in self.stokes:
                values = dict(zip(NAMES, run.slow[::8].T, strict=True))
                parts.append(({"stokes": stokes}, {"scaled": scaled[::8], **values}))
            rows.append((stokes, *onset_of(run, scaled)))
        return {"": stacked(parts), "onset": columns("stokes turned wiggle speed", rows)}

    def figure(self, data: Data) -> Figure:
        """Four variables, and the onset."""
        figure, axes = panels(2, 3, 3.2, 2.4)
        onset = float(np.mean(data["onset"]["turned"][-2:]))
        for place, (name, text) in zip((0, 1, 3, 4), NAMES.items(), strict=True):
            own = axes[place]
            for color, (stokes, part) in zip(CYCLE, groups(data[""], "stokes"), strict=False):
                own.plot(part["scaled"], part[name], color=color, linewidth=0.8, label=f"St = {power(stokes)}")
            own.axvline(onset, color="0.4", linestyle=":", label="turned by 1 rad")
            label(own, "$t\\dot\\gamma/\\mathrm{St}^{1/2}$", text)
        found = data["onset"]
        for color, marker, name, text in (
            (BLUE, "o", "turned", "turned by 1 rad"),
            (NODE, "s", "wiggle", "first wiggle"),
        ):
            axes[2].plot(found["stokes"], found[name] * found["stokes"] ** 0.5, marker, color=color, label=text)
        axes[2].plot(found["stokes"], onset * found["stokes"] ** 0.5, "k:", label="slope 1/2")
        logarithmic(label(axes[2], "Stokes number St", "onset time $t\\dot\\gamma$")).legend()
        axes[5].axis("off")
        handles, names = axes[0].get_legend_handles_labels()
        axes[5].legend(handles, names, loc="center")
        return figure

    def verdict(self, data: Data) -> Verdict:
        """Exponent of the onset."""
        found = {name: column[data["onset"]["stokes"] >= LARGE] for name, column in data["onset"].items()}
        root = found["stokes"] ** 0.5
        turned, wiggle = (power_law(found["stokes"], found[name] * root).exponent for name in ("turned", "wiggle"))
        speed = power_law(found["stokes"], found["speed"]).exponent
        numbers = (
            Number.near(f"exponent in St of the time of the first radian, St ≥ {LARGE:g}", turned, 0.5, 0.02),
            Number.near("exponent of the time of the first wiggle", wiggle, 0.5, 0.05),
            Number.near("exponent of the angular velocity at t = √St", speed, -0.5, 0.05),
            Number("time of the first radian over √St, largest St", float(found["turned"][-1]), 0.1, 1.0, "1/γ̇"),
            Number("time of the first wiggle over √St, largest St", float(found["wiggle"][-1]), 0.1, 2.0, "1/γ̇"),
        )
        sentence = (
            f"At large St the particle has turned by one radian at t = {found['turned'][-1]:.2f} √St, and the power of "
            f"the torque falls for the first time, the first wiggle, at {found['wiggle'][-1]:.2f} √St. At t = √St the "
            f"angular velocity is still of order St^({speed:.2f}), not of order one as an earlier sentence of the "
            f"paper has it. At St = 50 it takes {data['onset']['turned'][0]:.2g} √St."
        )
        return Verdict(Word.SHARPENED, sentence, numbers)

    def caption(self, data: Data) -> str:
        """What the figure shows."""
        axes = ", ".join(f"{length:g}" for length in self.ellipsoid.semi_axes)
        angles = ", ".join(f"{value:g}" for value in self.start.angles)
        return (
            f"Slow variables of ({axes}) from rest at (θ, φ, ψ) = ({angles}) against t/√St; dotted, where the particle "
            "has turned by one radian at the largest St; right, the onset against St."
        )


def onset_of(run: Run, scaled: np.ndarray) -> tuple[float, float, float]:
    """Scaled times of the first radian and of the first wiggle, and the angular velocity at t = √St."""
    speed = angular_speed(run)
    steps = np.diff(run.times) * (speed[1:] + speed[:-1]) / 2
    turned = float(np.interp(ONSET, np.concatenate([[0.0], np.cumsum(steps)]), scaled))
    power_ = np.gradient(run.observables.energy, run.times)
    falling = np.flatnonzero((np.diff(power_) < 0) & (scaled[1:] > 3 * (scaled[1] - scaled[0])))
    return turned, float(scaled[falling[0]]), float(np.interp(1.0, scaled, speed))


def angular_speed(run: Run) -> np.ndarray:
    """|ω| in units of the shear rate, shape (n,), from L and the orientation; a spheroid's axis is enough."""
    momentum, rotation = run.observables.angular_momentum, run.observables.rotation
    inertia = np.array(run.scene.ellipsoid.inertia)
    axial = np.einsum("nj,nj->n", rotation[:, 2], momentum)
    if run.scene.ellipsoid.kind == "triaxial":
        return np.linalg.norm(np.einsum("nij,nj->ni", rotation, momentum) / inertia, axis=1)
    across = np.linalg.norm(momentum - axial[:, None] * rotation[:, 2], axis=1)
    return np.hypot(axial / inertia[2], across / inertia[0])


@dataclass(frozen=True)
class Short:
    """A particle from rest until t = √St, up to St = 1e8.

    Parameters
    ----------
    ellipsoid : Ellipsoid
    start : EulerStart
    """

    ellipsoid: Ellipsoid
    start: EulerStart

    def compute(self, grid: Grid) -> Data:
        """Paths of z' and their lengths; the Jeffery orbit of the same start."""
        parts, rows = [], []
        scaled = np.linspace(0.0, 1.0, grid.of(401, 101))
        for stokes in np.geomspace(1e2, 1e8, 7).tolist():
            times = scaled * stokes**0.5
            path = axis_path(full_run(Scene(self.ellipsoid, stokes, self.start, times[-1]), times))
            parts.append(({"stokes": stokes}, dict(zip("xyz", path[::2].T, strict=True))))
            rows.append((stokes, arc_length(path)[-1]))
        kappa = max(self.ellipsoid.semi_axes) / min(self.ellipsoid.semi_axes)
        turn = np.linspace(0.0, 2 * pi * (kappa + 1 / kappa), 201)
        orbit = jeffery_path(self.ellipsoid, self.start, turn)
        return {
            "": stacked(parts),
            "length": columns("stokes length", rows),
            "jeffery": {"t": turn, **dict(zip("xyz", orbit.T, strict=True))},
        }

    def figure(self, data: Data) -> Figure:
        """Paths on the sphere, and their lengths."""
        figure = Figure(figsize=(8.6, 3.9), layout="constrained")
        sphere = unit_sphere(figure.add_subplot(1, 2, 1, projection="3d"))
        orbit = data["jeffery"]
        sphere.plot(
            orbit["x"], orbit["y"], orbit["z"], color=GREEN, linestyle="--", linewidth=1.2, label="Jeffery orbit"
        )
        for color, (stokes, part) in zip(COLORS, list(groups(data[""], "stokes"))[::2], strict=True):
            sphere.plot(part["x"], part["y"], part["z"], color=color, linewidth=1.4, label=f"St = {power(stokes)}")
        sphere.plot(orbit["x"][:1], orbit["y"][:1], orbit["z"][:1], "o", color=BLACK, markersize=4)
        sphere.legend(loc="upper left", fontsize=7)
        axes = figure.add_subplot(1, 2, 2)
        axes.plot(data["length"]["stokes"], data["length"]["length"], "o-", color=BLUE)
        logarithmic(label(axes, "Stokes number St", "path length until $t = \\mathrm{St}^{1/2}$, rad"), "x")
        axes.set_ylim(bottom=0.0)
        return figure

    def verdict(self, data: Data) -> Verdict:
        """The length tends to a number of order one, less than a turn."""
        length = data["length"]["length"]
        path = [np.column_stack([part[name] for name in "xyz"]) for _, part in groups(data[""], "stokes")][-1]
        orbit = np.column_stack([data["jeffery"][name] for name in "xyz"])
        apart = float(np.max(np.min(np.linalg.norm(path[:, None] - orbit[None], axis=2), axis=1)))
        numbers = (
            Number("path length at St = 1e8", float(length[-1]), 0.1, 10.0, "rad"),
            Number("its relative change from St = 1e7", float(length[-1] / length[-2] - 1), -5e-3, 5e-3),
            Number("largest distance from the Jeffery orbit at St = 1e8", apart, low=0.01, unit="rad"),
        )
        sentence = (
            f"The length tends to {length[-1]:.3f} rad, about that of a whole turn; on it the axis leaves the Jeffery "
            f"orbit by {apart:.2g} rad."
        )
        return Verdict(Word.SHARPENED, sentence, numbers)

    def caption(self, data: Data) -> str:
        """What the figure shows."""
        axes = ", ".join(f"{length:g}" for length in self.ellipsoid.semi_axes)
        return f"Axis z' of ({axes}) from rest until t = √St, for St from 1e2 to 1e8, and the length of its path."


NEEDLE = Sphere(spheroid(10.0), EulerStart((0.10472, 5.4978, 0.0)), 600.0)
BLADE = Sphere(Ellipsoid((0.1, 0.15, 1.0)), EulerStart((0.10472, 2.35619, 0.0)), 600.0)
SPHEROID_TRANSIENT = Transient(spheroid(2.0), EulerStart((0.314, 0.52, 0.0)))
ELLIPSOID_TRANSIENT = Transient(Ellipsoid((3.0, 2.0, 1.0)), EulerStart((0.314, 0.52, 1.05)))
SPHEROID_SHORT = Short(spheroid(2.0), EulerStart((0.78539, 2.35619, 0.0)))
ELLIPSOID_SHORT = Short(Ellipsoid((0.5, 0.55, 1.0)), EulerStart((0.78539, 2.35619, 0.0)))


def _item(name: str, title: str, claim: str, source: Sphere | Transient | Short) -> Item:
    return Item(name, title, claim, source.compute, source.figure, source.verdict, source.caption)


SPIRAL = (
    "From rest at St = 1000 the axis first spirals along turns like Jeffery orbits towards the plane of the flow, then "
    "changes abruptly to an Euler spiral."
)
SCALING = (
    "Inertial effects set in after a time of O(St^½), the same for all St when scaled so, when the angular velocity is "
    "O(St^-½)."
)
LENGTH = (
    "Until t = St^½ the axis runs through a path whose length tends to a number of order one, and leaves the Jeffery "
    "orbit before a single turn."
)

SECTION = Section(
    "rest",
    "Starts from rest",
    (
        _item("rest-needle", "From rest on the unit sphere, spheroid", SPIRAL, NEEDLE),
        _item("rest-blade", "From rest on the unit sphere, ellipsoid", SPIRAL, BLADE),
        _item("rest-transient-spheroid", "The St^½ transient of a spheroid", SCALING, SPHEROID_TRANSIENT),
        _item("rest-transient-ellipsoid", "The St^½ transient of an ellipsoid", SCALING, ELLIPSOID_TRANSIENT),
        _item("rest-short-spheroid", "From rest until St^½, spheroid", LENGTH, SPHEROID_SHORT),
        _item("rest-short-ellipsoid", "From rest until St^½, ellipsoid", LENGTH, ELLIPSOID_SHORT),
    ),
)
