"""Section "Discussion", particles that start from rest: the transient of order √St, and all items."""

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.signal import find_peaks

from polhode.harness.common.fits import power_law
from polhode.harness.pages.figures.style import power
from polhode.harness.paper.claims import Facts, section
from polhode.harness.paper.drawing import BLUE, CYCLE, NODE, draw_groups, draw_law, label, logarithmic, panels
from polhode.harness.paper.item import Data, Grid, Table
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

    def facts(self, data: Data) -> Facts:
        """Exponents of the onset, and its range over the Stokes numbers shown."""
        found = {name: column[data["onset"]["stokes"] >= LARGE] for name, column in data["onset"].items()}
        shown = {name: column[data["onset"]["stokes"] <= self.stokes[-1]] for name, column in data["onset"].items()}
        root, facts = found["stokes"] ** 0.5, {}
        for name in ("turned", "wiggle"):
            ends = shown[name].min(), shown[name].max()
            facts |= {name: found[name][-1], f"{name}_range": ends, f"{name}_ratio": ends[1] / ends[0]}
            facts[f"{name}_exponent"] = power_law(found["stokes"], found[name] * root)[0]
        return facts | {
            "axes": axes_of(self.ellipsoid),
            "angles": self.start.angles,
            "stokes": (self.stokes[0], self.stokes[-1]),
            "large": LARGE,
            "speed_exponent": power_law(found["stokes"], found["speed"])[0],
        }


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


SECTION = section(
    "rest",
    {
        "rest-needle": Sphere(spheroid(10.0), EulerStart((0.10472, 5.4978, 0.0)), 600.0),
        "rest-blade": Sphere(Ellipsoid((0.1, 0.15, 1.0)), EulerStart((0.10472, 2.35619, 0.0)), 600.0),
        "rest-transient-spheroid": Transient(spheroid(2.0), EulerStart((0.314, 0.52, 0.0))),
        "rest-transient-ellipsoid": Transient(Ellipsoid((3.0, 2.0, 1.0)), EulerStart((0.314, 0.52, 1.05))),
        "rest-short-spheroid": Short(spheroid(2.0), EulerStart((0.78539, 2.35619, 0.0))),
        "rest-short-ellipsoid": Short(Ellipsoid((0.5, 0.55, 1.0)), EulerStart((0.78539, 2.35619, 0.0))),
    },
)
