"""Section "Discussion", particles that start from rest: the transient of order √St, and all items."""

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.signal import find_peaks

from polhode.harness.common.fits import power_law
from polhode.harness.pages.figures.style import power
from polhode.harness.paper.drawing import BLUE, CYCLE, NODE, draw_groups, draw_law, label, logarithmic, panels
from polhode.harness.paper.item import Data, Grid, Item, Number, Section, Table, Verdict, Word
from polhode.harness.paper.runs import Run, axes_of, full_run, spheroid
from polhode.harness.paper.sections.rest.spheres import Short, Sphere
from polhode.harness.paper.slow_motion import NAMES
from polhode.harness.paper.tables import columns, stacked
from polhode.models.scene import EulerStart, Scene
from polhode.models.shape import Ellipsoid

# Rotation, in rad, of a particle since its start that marks the onset of inertia.
ONSET = 1.0
# Share of the largest torque by which a weakest one stands out.
WIGGLE = 0.02
# Smallest St of the fits of the transient.
LARGE = 5e5
# Scaled time up to which the magnified views go.
EARLY = 2.0


@dataclass(frozen=True)
class Transient:
    """A particle from rest at several St, followed for some √St."""

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
            rows.append((stokes, *_onset_of(run, scaled)))
        return {"": stacked(parts), "onset": columns("stokes turned wiggle speed", rows)}

    def figure(self, data: Data) -> Figure:
        """Four variables as they are; three of them, scaled, at the largest St; the onset."""
        figure, axes = panels(3, 3, 3.2, 2.3)
        onset, wiggle = (float(np.mean(data["onset"][name][-2:])) for name in ("turned", "wiggle"))
        for place, (name, text) in zip((0, 1, 3, 4), NAMES.items(), strict=True):
            self._draw(axes[place], data[""], name, text, (onset, wiggle))
        for own, name in zip(axes[6:], ("Ly", "Lz", "E"), strict=True):
            root = "\\mathrm{St}\\," if name == "E" else "\\mathrm{St}^{1/2}\\,"
            large = {key: column[data[""]["stokes"] >= 5e3] for key, column in data[""].items()}
            early = {key: column[large["scaled"] <= EARLY] for key, column in large.items()}
            scaled = early | {name: early[name] * early["stokes"] ** (1.0 if name == "E" else 0.5)}
            self._draw(own, scaled, name, f"${root}" + NAMES[name][1:], (onset, wiggle))
        found = data["onset"]
        for color, marker, name, text in (
            (BLUE, "o", "turned", "turned by 1 rad"),
            (NODE, "s", "wiggle", "first wiggle"),
        ):
            axes[2].plot(found["stokes"], found[name] * found["stokes"] ** 0.5, marker, color=color, label=text)
        draw_law(axes[2], found["stokes"], onset * found["stokes"][-1] ** 0.5, 0.5)
        logarithmic(label(axes[2], "Stokes number St", "onset time $t\\dot\\gamma$")).legend()
        axes[5].axis("off")
        handles, names = axes[0].get_legend_handles_labels()
        axes[5].legend(handles, names, loc="center")
        return figure

    def _draw(self, axes: Axes, table: Table, name: str, text: str, onset: tuple[float, float]) -> None:
        colors = CYCLE[self.stokes.index(min(table["stokes"])) :]
        draw_groups(
            axes, table, "stokes", f"scaled {name}", lambda stokes: f"St = {power(stokes)}", colors, linewidth=0.8
        )
        for time, line, own in zip(onset, (":", "--"), ("turned by 1 rad", "first wiggle"), strict=True):
            axes.axvline(time, color="0.4", linestyle=line, linewidth=0.9, label=own)
        label(axes, "$t\\dot\\gamma/\\mathrm{St}^{1/2}$", text)

    def verdict(self, data: Data) -> Verdict:
        """Exponent of the onset, and its range over the Stokes numbers shown."""
        found = {name: column[data["onset"]["stokes"] >= LARGE] for name, column in data["onset"].items()}
        shown = {name: column[data["onset"]["stokes"] <= self.stokes[-1]] for name, column in data["onset"].items()}
        between = f"from St = {self.stokes[0]:g} to {self.stokes[-1]:g}"
        root = found["stokes"] ** 0.5
        turned, wiggle = (power_law(found["stokes"], found[name] * root)[0] for name in ("turned", "wiggle"))
        speed, *_ = power_law(found["stokes"], found["speed"])
        angles = ", ".join(f"{value:g}" for value in self.start.angles)
        return Verdict(
            Word.SHARPENED,
            f"At large St the particle has turned by one radian at t = {found['turned'][-1]:.2f} √St, and L_z wiggles "
            f"first, its torque weakest, at {found['wiggle'][-1]:.2f} √St. {between[0].upper() + between[1:]} these "
            f"times are nearly the same, {_range(shown['turned'])} √St and {_range(shown['wiggle'])} √St, later at "
            f"small St. At t = √St the angular velocity is still of order St^({speed:.2f}), not of order one as an "
            "earlier sentence of the paper has it.",
            f"Slow variables of {axes_of(self.ellipsoid)} from rest at (θ, φ, ψ) = ({angles}) against t/√St; below, "
            "early and scaled by √St and St, from St = 5000 on; dotted, where the particle has turned by one radian at "
            "the largest St; dashed, where the torque along the vorticity is weakest for the first time; right, both "
            "against St.",
            Number.near(f"exponent in St of the time of the first radian, St ≥ {LARGE:g}", turned, 0.5, 0.02),
            Number.near("exponent of the time of the first wiggle", wiggle, 0.5, 0.05),
            Number.near("exponent of the angular velocity at t = √St", speed, -0.5, 0.05),
            Number("time of the first radian over √St, largest St", float(found["turned"][-1]), 0.1, 1.0, "1/γ̇"),
            Number("time of the first wiggle over √St, largest St", float(found["wiggle"][-1]), 0.1, 2.0, "1/γ̇"),
            *(
                Number(f"latest over earliest {text}, over √St, {between}", max(shown[name]) / min(shown[name]), 1, 2)
                for name, text in (("turned", "first radian"), ("wiggle", "first wiggle"))
            ),
        )


def _onset_of(run: Run, scaled: np.ndarray) -> tuple[float, float, float]:
    """Scaled times of the first radian and of the first wiggle, and the angular velocity at t = √St.

    L_z falls from 0; it wiggles first where the torque that drives it down is weakest for the first time.
    """
    speed = _angular_speed(run)
    steps = np.diff(run.times) * (speed[1:] + speed[:-1]) / 2
    turned = float(np.interp(ONSET, np.concatenate([[0.0], np.cumsum(steps)]), scaled))
    torque = np.gradient(run.observables.angular_momentum[:, 2], run.times)
    weakest, _ = find_peaks(torque, prominence=WIGGLE * np.max(np.abs(torque)))
    return turned, float(scaled[weakest[0]]), float(np.interp(1.0, scaled, speed))


def _angular_speed(run: Run) -> np.ndarray:
    """|ω| in units of the shear rate, shape (n,), from L and the orientation; a spheroid's axis is enough."""
    momentum, rotation = run.observables.angular_momentum, run.observables.rotation
    inertia = np.array(run.scene.ellipsoid.inertia)
    axial = np.einsum("nj,nj->n", rotation[:, 2], momentum)
    if run.scene.ellipsoid.kind == "triaxial":
        return np.linalg.norm(np.einsum("nij,nj->ni", rotation, momentum) / inertia, axis=1)
    across = np.linalg.norm(momentum - axial[:, None] * rotation[:, 2], axis=1)
    return np.hypot(axial / inertia[2], across / inertia[0])


def _range(values: np.ndarray) -> str:
    return f"{values.min():.2g} … {values.max():.2g}"


NEEDLE = Sphere(spheroid(10.0), EulerStart((0.10472, 5.4978, 0.0)), 600.0)
BLADE = Sphere(Ellipsoid((0.1, 0.15, 1.0)), EulerStart((0.10472, 2.35619, 0.0)), 600.0)
SPHEROID_TRANSIENT = Transient(spheroid(2.0), EulerStart((0.314, 0.52, 0.0)))
ELLIPSOID_TRANSIENT = Transient(Ellipsoid((3.0, 2.0, 1.0)), EulerStart((0.314, 0.52, 1.05)))
SPHEROID_SHORT = Short(spheroid(2.0), EulerStart((0.78539, 2.35619, 0.0)))
ELLIPSOID_SHORT = Short(Ellipsoid((0.5, 0.55, 1.0)), EulerStart((0.78539, 2.35619, 0.0)))


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
        Item.of(NEEDLE, "rest-needle", "From rest on the unit sphere, spheroid", SPIRAL),
        Item.of(BLADE, "rest-blade", "From rest on the unit sphere, ellipsoid", SPIRAL),
        Item.of(SPHEROID_TRANSIENT, "rest-transient-spheroid", "The St^½ transient of a spheroid", SCALING),
        Item.of(ELLIPSOID_TRANSIENT, "rest-transient-ellipsoid", "The St^½ transient of an ellipsoid", SCALING),
        Item.of(SPHEROID_SHORT, "rest-short-spheroid", "From rest until St^½, spheroid", LENGTH),
        Item.of(ELLIPSOID_SHORT, "rest-short-ellipsoid", "From rest until St^½, ellipsoid", LENGTH),
    ),
)
