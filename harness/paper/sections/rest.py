"""Starts from rest: the path of the axis on the unit sphere, and the transient of order √St.

At first the flow's torque alone turns a particle with much inertia that starts at rest. Within a time
of order √St it has turned by one radian. A turn lasts from one maximum of the axis' z
component to the next. Columns x, y, z of tables are the direction of the axis z' in space axes.
`govg` is the paper's equation of motion. Its gyroscopic term is ω × Iω, its viscous one the torque
8πX(ω - Ω_J)/St, with Jeffery's angular velocity Ω_J.

In figures, heights of panels are in inches, and widths of lines and sizes of marks and letters in
points. They and the limits of axes are chosen by eye.

Ends of the ranges for which a verdict holds are estimates where their reasons do not give them.
"""

from dataclasses import dataclass
from math import pi
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.integrate import cumulative_trapezoid

from polhode.harness.pages.figures.style import (
    BLUE,
    GREEN,
    ORANGE,
    PURPLE,
    VERMILLION,
    power,
    square_decades,
)
from polhode.harness.paper.drawing import (
    BLACK,
    CYCLE,
    NODE,
    draw_each,
    draw_power,
    key_above,
    key_of,
    name_line,
    panels,
    unit_sphere,
)
from polhode.harness.paper.item import (
    Computed,
    Data,
    Experiment,
    Grid,
    Item,
    Number,
    Range,
    Section,
    Table,
    Verdict,
    Word,
)
from polhode.harness.paper.runs import Run, axes_of, full_run, run_form, spheroid
from polhode.harness.paper.sections.slow_motion import SLOW_LABELS
from polhode.harness.paper.tables import Estimate, by, exponent, maxima, spread, worst
from polhode.models.catalogue import form as find_form
from polhode.models.flow import jeffery_spin
from polhode.models.observables import angular_velocity
from polhode.models.scene import EulerStart, Scene
from polhode.models.shape import Ellipsoid

# Distance, in rad, at which a path counts as off the Jeffery orbit: an estimate.
_OFF_ORBIT = 0.1
# Rotation, in rad, of a particle since its start that marks the onset of inertia: any angle of
# order one would do.
_ONSET = 1.0
# A maximum of the torque along z, which is negative at first, counts as a wiggle if it stands out by
# this share of the largest torque. An estimate.
_WIGGLE = 0.02
# Smallest St of the fits of the transient: there corrections, of order 1/√St, are 1e-3.
_LARGE_STOKES = 5e5
# Computed rows for each row of a path on the sphere that is kept: dips of the viscous term are
# shorter than a kept row. An estimate.
_DENSE = 16
# Magnified views of the transient: up to this scaled time t/√St, and from this St on. By eye.
_EARLY = 2.0
_EARLY_STOKES = 5e3
# St of the transient that serve the fits of the onset alone, and are not drawn.
_FITTED_STOKES = (5e6, 5e7)
# Rows of the slow variables for each row that is kept: 500 rows draw a run smoothly.
_THINNED = 8


def _path(run: Run) -> dict[str, np.ndarray]:
    """Directions of z' in space axes, in columns x, y, z."""
    return dict(zip("xyz", run.observables.rotation[:, 2].T, strict=True))


def points(path: Table) -> np.ndarray:
    """Directions of z', shape (n, 3), of a table with the columns x, y, z."""
    return np.column_stack([path[name] for name in "xyz"])


def arc_length(path: np.ndarray) -> np.ndarray:
    """Length, in rad, of a path on the unit sphere, shape (n, 3), up to each of its points, shape (n,)."""
    steps = 2 * np.arcsin(np.clip(np.linalg.norm(np.diff(path, axis=0), axis=1) / 2, 0, 1))
    return np.concatenate([[0.0], np.cumsum(steps)])


def _jeffery_orbit(ellipsoid: Ellipsoid, start: EulerStart, count: int) -> Computed:
    """z' at St = 0 from the same orientation, for one Jeffery period of the longest and shortest axis.

    The table "jeffery" has `count` rows, at equal times `t` in inverse shear rates.
    """
    kappa = max(ellipsoid.semi_axes) / min(ellipsoid.semi_axes)
    times = np.linspace(0.0, 2 * pi * (kappa + 1 / kappa), count)
    yield (
        "jeffery",
        {"t": times, **_path(full_run(Scene(ellipsoid, 0.0, start, float(times[-1])), times))},
    )


def distance_from(line: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Least distance of each of n places from a line of straight segments, shape (n,).

    `places` has shape (n, 3), and `line` the m ends of the segments, shape (m, 3).
    """
    # `share` is the place of the foot of the perpendicular on each segment, 0 and 1 at its ends.
    sides = np.diff(line, axis=0)
    offsets = places[:, None] - line[:-1]
    share = np.sum(offsets * sides, axis=-1) / np.sum(sides**2, axis=-1)
    apart = offsets - share.clip(0.0, 1.0)[..., None] * sides
    return np.min(np.linalg.norm(apart, axis=-1), axis=1)


def turns(path: Table) -> np.ndarray:
    """Durations of turns, from one maximum of z to the next, of a table with the columns t and z."""
    return np.diff(maxima(path.t, path.z))


def terms_of(run: Run) -> tuple[np.ndarray, np.ndarray]:
    """Sizes of the gyroscopic and of the viscous term of `govg` at each row of a run, shape (n,) each.

    Both are in units of `Ellipsoid.inertia` and the shear rate.
    """
    scene = run.scene
    rotation = run.observables.rotation
    inertia = np.array(scene.ellipsoid.inertia)
    resistance = np.array(scene.ellipsoid.resistance)
    # All in body axes.
    momentum = np.einsum("nij,nj->ni", rotation, run.observables.angular_momentum)
    spin = momentum / inertia
    flow = jeffery_spin(scene.ellipsoid, rotation)
    gyroscopic = np.linalg.norm(np.cross(spin, inertia * spin), axis=1)
    viscous = np.linalg.norm(8 * pi * resistance / scene.stokes * (spin - flow), axis=1)
    return gyroscopic, viscous


@dataclass(frozen=True)
class Change:
    """The change from turns like a Jeffery orbit's to turns of a free top, by their durations."""

    time: float  # Start of the first short turn, in inverse shear rates.
    before: float  # Duration of the last long turn.
    after: float  # Duration of the first short one.
    # Share of this fall in the fall from the first turn to the last one, both in their logarithms.
    share: float
    durations: np.ndarray  # Durations of all turns.

    @classmethod
    def of(cls, path: Table) -> "Change":
        """The change along a path: at the first turn shorter than the geometric mean of first and last.

        `path` has the columns t and z.
        """
        tops = maxima(path.t, path.z)
        durations = np.diff(tops)
        border = np.sqrt(durations[0] * durations[-1])
        place = int(np.argmax(durations < border))
        before = float(durations[place - 1])
        after = float(durations[place])
        share = float(np.log(before / after) / np.log(durations[0] / durations[-1]))
        return cls(float(tops[place]), before, after, share, durations)


@dataclass(frozen=True)
class Sphere(Experiment):
    """A particle from rest, followed over many turns; `time` is in inverse shear rates.

    The column `viscous_larger` of the table "" is the time so far in which the viscous term of
    `govg` is larger than the gyroscopic one.
    """

    ellipsoid: Ellipsoid
    start: EulerStart
    time: float
    stokes: float = 1e3

    def compute(self, grid: Grid) -> Computed:
        """Path of z', and the time so far in which the viscous term is the larger one.

        The numbers of rows are estimates: 20 that are kept in an inverse shear rate.
        """
        kept = grid.of(12001, 6001)
        times = np.linspace(0.0, self.time, _DENSE * (kept - 1) + 1)
        scene = Scene(self.ellipsoid, self.stokes, self.start, self.time)
        # This form gives the whole rotation, of spheroids too, for which `full_run` would take one
        # that has the axis alone.
        run = run_form(find_form("quaternion"), scene, times)
        gyroscopic, viscous = terms_of(run)
        # The viscous term is the smaller one in dips that are shorter than a row that is kept.
        is_larger = (viscous > gyroscopic).astype(float)
        larger = cumulative_trapezoid(is_larger, times, initial=0.0)
        rows = {"t": times, **_path(run), "viscous_larger": larger}
        yield "", {name: column[::_DENSE] for name, column in rows.items()}
        yield from _jeffery_orbit(self.ellipsoid, self.start, 401)

    def judge(self, data: Data) -> Verdict:
        """How long turns take before and after the change, how sudden it is, and which terms rule."""
        table = data[""]
        change = Change.of(table)
        jeffery = turns(data["jeffery"])[0]
        turned = arc_length(points(table))[np.searchsorted(table.t, change.time)]
        first = change.durations[0] / jeffery
        last = change.durations[-1] / (4 * pi)
        # The last twentieth of the run has several turns; the share is an estimate.
        tilt = worst(table.z[table.t >= 0.95 * self.time])
        before = np.interp(change.time, table.t, table.viscous_larger)
        viscous = (table.viscous_larger[-1] - before) / (self.time - change.time)
        angles = ", ".join(f"{angle:.4g}" for angle in self.start.angles[:2])
        return Verdict(
            Word.SHARPENED,
            f"Turns like the Jeffery orbit's, the first {first:.2f} times as long, end at "
            f"t = {change.time:.3g} = {change.time / self.stokes**0.5:.2g} √St, when the axis has "
            f"run through {turned:.2g} rad. From one turn to the next their duration falls from "
            f"{change.before:.3g} to {change.after:.3g}: {100 * change.share:.0f} % of the whole "
            "change, in its logarithm, in a single turn, so that abrupt is the word. Later turns "
            f"take {last:.2f} times 4π, that of the final rotation, and |z| falls to {tilt:.1g}: "
            "the spiral goes to the plane of the flow. The sizes of the terms of `govg` show no "
            "such onset: after the change the viscous term is the larger one for "
            f"{100 * viscous:.0f} % of the time, as the gyroscopic one vanishes in planar "
            "tumbling.",
            f"Axis z' of {axes_of(self.ellipsoid)} from rest at (θ, φ) = ({angles}), "
            f"St = {self.stokes:g}, on the sphere up to three times the change of the turns, right up to "
            f"t = {self.time:g}; green: the Jeffery orbit of the same orientation; dot: start.",
            self._numbers(change, first, last, tilt, viscous),
        )

    def _numbers(
        self, change: Change, first: float, last: float, tilt: float, viscous: float
    ) -> list[Number]:
        """When and how the turns change, and how the particle ends."""
        return [
            Number("time at which the turns change", change.time, unit="1/γ̇"),
            Number(
                "the same over √St",
                change.time / self.stokes**0.5,
                Range(0.1, 10.0, "theory: of order √St"),
            ),
            Number(
                "share of the whole change of duration, in its logarithm, in one turn",
                change.share,
                Range(0.5, 1.0, "the claim: abrupt, more than half of it at once"),
                measure="the logarithm of the first turn's duration over the last one's",
            ),
            Number(
                "time of the first turn over that of the Jeffery orbit",
                first,
                Range.near(1.0, 0.2, "the claim: turns like Jeffery orbits, but for a fifth"),
            ),
            Number(
                "time of the last turn over that of the free top at -1/2, 4π",
                last,
                Range.near(
                    1.0, 0.2, f"the settled rotation at St = {self.stokes:g} is near its limit"
                ),
            ),
            Number(
                "|z| of the axis at the end, largest",
                tilt,
                Range.at_most(0.1, "the claim: the axis ends in the plane of the flow"),
            ),
            Number(
                "share of the time after the change in which the viscous term is the larger",
                viscous,
                measure=f"the time up to t = {self.time:g}",
            ),
        ]

    def draw(self, data: Data) -> Figure:
        """The path on the sphere, and z against time."""
        table = data[""]
        jeffery = data["jeffery"]
        onset = Change.of(table).time
        before = table[table.t <= onset]
        after = table[table.t >= onset]
        figure, (sphere, plain) = panels(1, 2, 3.2, spatial=[0], wspace=0.16)
        unit_sphere(sphere)
        # Later turns lie on each other, near the plane of the flow.
        close = after[after.t <= 3 * onset]
        sphere.plot(before.x, before.y, before.z, color=BLUE, linewidth=1.8, zorder=2.8)
        sphere.plot(close.x, close.y, close.z, color=ORANGE, linewidth=0.9, zorder=1.9)
        _draw_orbit(sphere, jeffery)
        plain.plot(before.t, before.z, color=BLUE, linewidth=1.1, label="before the change")
        plain.plot(after.t, after.z, color=ORANGE, linewidth=1.1, label="after it")
        plain.axvline(onset, color=NODE, linestyle=":", label="turns become short")
        name_line(plain, "Jeffery orbit (left)", color=GREEN, linestyle="--")
        plain.set(
            xlabel=r"time $t\dot\gamma$", ylabel="z component of the axis", ylim=(-1.05, 1.05)
        )
        key_above(figure, plain)
        return figure


def _draw_orbit(axes: Axes, jeffery: Table) -> None:
    """Draw the Jeffery orbit and its start on the sphere."""
    sphere: Any = axes  # Its methods for three dimensions are no part of Axes.
    style: dict[str, Any] = {"color": GREEN, "linestyle": "--", "linewidth": 1.3, "zorder": 4}
    sphere.plot(jeffery.x, jeffery.y, jeffery.z, label="Jeffery orbit", **style)
    dot = {"marker": "o", "color": BLACK, "markersize": 4, "zorder": 5}
    sphere.plot(jeffery.x[:1], jeffery.y[:1], jeffery.z[:1], **dot)


@dataclass(frozen=True)
class Transient(Experiment):
    """A particle from rest at several St, followed for some √St.

    `scaled` is t/√St, and `scaled_time` where it ends: twenty times the onset, an estimate. The
    table "onset" has, by St, the scaled times of the first radian and of the
    first wiggle, and the angular velocity, in shear rates, at t = √St.
    """

    ellipsoid: Ellipsoid
    start: EulerStart
    stokes: tuple[float, ...] = (50.0, 500.0, 5e3, 5e4, 5e5)
    scaled_time: float = 6.0

    def compute(self, grid: Grid) -> Computed:
        """Slow variables against t/√St, and the onset at each St."""
        scaled = np.linspace(0.0, self.scaled_time, grid.of(4001, 2001))
        for stokes in (*self.stokes, *_FITTED_STOKES):
            times = scaled * stokes**0.5
            run = full_run(Scene(self.ellipsoid, stokes, self.start, times[-1]), times)
            if stokes in self.stokes:
                columns = dict(zip(SLOW_LABELS, run.slow[::_THINNED].T, strict=True))
                yield "", {"stokes": stokes, "scaled": scaled[::_THINNED], **columns}
            # Scaled times of the first radian and of the first wiggle of L_z, where its torque is
            # weakest, and the speed at t = √St.
            speed = np.linalg.norm(angular_velocity(self.ellipsoid, run.observables), axis=1)
            angle = cumulative_trapezoid(speed, run.times, initial=0.0)
            torque = np.gradient(run.observables.angular_momentum[:, 2], run.times)
            weakest = maxima(scaled, torque, _WIGGLE * float(np.max(np.abs(torque))))
            onset = {
                "turned": np.interp(_ONSET, angle, scaled),
                "wiggle": weakest[0],
                "speed": np.interp(1.0, scaled, speed),
            }
            yield "onset", {"stokes": stokes, **onset}

    def judge(self, data: Data) -> Verdict:
        """How onset times and speeds scale with St."""
        onset = data["onset"]
        large = onset[onset.stokes >= _LARGE_STOKES]
        last = onset[-1]
        shown = onset[onset.stokes <= self.stokes[-1]]
        speed = exponent(large.stokes, large.speed)
        angles = ", ".join(f"{angle:g}" for angle in self.start.angles)
        between = f"from St = {self.stokes[0]:g} to {self.stokes[-1]:g}"
        return Verdict(
            Word.SHARPENED,
            f"At large St the particle has turned by one radian at t = {last.turned:.2f} √St, and "
            f"L_z wiggles first, its torque weakest, at {last.wiggle:.2f} √St. {between[0].upper()}"
            f"{between[1:]} these times are the same to a factor of {spread(shown.turned):.2g} and "
            f"{spread(shown.wiggle):.2g}, {shown.turned.min():.2g} … {shown.turned.max():.2g} √St "
            f"and {shown.wiggle.min():.2g} … {shown.wiggle.max():.2g} √St, later at small St. At "
            f"t = √St the angular velocity is still of order St^({speed:.2f}), not of order one as "
            "an earlier sentence of the paper has it.",
            f"Slow variables of {axes_of(self.ellipsoid)} from rest at (θ, φ, ψ) = ({angles}) "
            f"against t/√St; last three panels: early and scaled by √St and St, from St = {_EARLY_STOKES:g} "
            "on; dotted, where the particle has turned by one radian at the largest St; dashed, where the "
            "torque along the vorticity is weakest for the first time; fifth panel: both against St.",
            self._numbers(onset, speed),
        )

    def _numbers(self, onset: Table, speed: Estimate) -> list[Number]:
        """Exponents of the onset in St, and its times."""
        large = onset[onset.stokes >= _LARGE_STOKES]
        root = large.stokes**0.5
        last = onset[-1]
        shown = onset[onset.stokes <= self.stokes[-1]]
        turned = exponent(large.stokes, large.turned * root)
        wiggle = exponent(large.stokes, large.wiggle * root)
        between = f"from St = {self.stokes[0]:g} to {self.stokes[-1]:g}"
        same = Range(1.0, 2.0, "the claim: the same for all St; a factor of two over four decades")
        return [
            Number(
                f"exponent in St of the time of the first radian, St ≥ {_LARGE_STOKES:g}",
                float(turned),
                Range.near(0.5, 0.02, "the claim: √St; corrections are of order 1/√St"),
                interval=turned.interval,
            ),
            Number(
                "exponent of the time of the first wiggle",
                float(wiggle),
                Range.near(0.5, 0.05, "the claim: √St; the wiggle is read off rows"),
                interval=wiggle.interval,
            ),
            Number(
                "exponent of the angular velocity at t = √St",
                float(speed),
                Range.near(-0.5, 0.05, "the claim: O(St^-½)"),
                interval=speed.interval,
            ),
            Number(
                "time of the first radian over √St, largest St",
                last.turned,
                Range(0.1, 10.0, "a number of order one"),
                "1/γ̇",
            ),
            Number(
                "time of the first wiggle over √St, largest St",
                last.wiggle,
                Range(0.1, 10.0, "a number of order one"),
                "1/γ̇",
            ),
            Number(
                f"latest over earliest first radian, over √St, {between}",
                spread(shown.turned),
                same,
            ),
            Number(
                f"latest over earliest first wiggle, over √St, {between}",
                spread(shown.wiggle),
                same,
            ),
        ]

    def draw(self, data: Data) -> Figure:
        """Slow variables on the scaled time; onset times against St."""
        table = data[""]
        onset = data["onset"]
        figure, axes = panels(4, 2, 2.0)
        scaled = r"$t\dot\gamma/\mathrm{St}^{1/2}$"
        for name, place in (("Lx", 0), ("Ly", 1), ("Lz", 2), ("E", 3)):
            panel = axes[place]
            label = _stokes_label
            draw_each(panel, table, "stokes", "scaled", name, label=label, linewidth=0.8)
            _draw_marks(panel, onset)
            panel.set(xlabel=scaled, ylabel=SLOW_LABELS[name])
        self._draw_onsets(axes[4], onset)
        key_above(figure, axes[0])
        early = table[(table.stokes >= _EARLY_STOKES) & (table.scaled <= _EARLY)]
        for name, place in (("Ly", 5), ("Lz", 6), ("E", 7)):
            panel = axes[place]
            # L is of order St^-½, and E of order 1/St: in these units curves of all St are one.
            root = 1.0 if name == "E" else 0.5
            draw_each(
                panel,
                early,
                "stokes",
                "scaled",
                lambda rows, name=name, root=root: rows[name] * rows.stokes**root,
                # The colours that these St have in the first panels.
                colors=CYCLE[2:],
                linewidth=0.8,
            )
            _draw_marks(panel, onset)
            factor = r"$\mathrm{St}\," if name == "E" else r"$\mathrm{St}^{1/2}\,"
            panel.set(xlabel=scaled, ylabel=factor + SLOW_LABELS[name][1:])
        return figure

    def _draw_onsets(self, axes: Axes, onset: Table) -> None:
        """Onset times against St."""
        root = onset.stokes**0.5
        style: dict[str, Any] = {"linestyle": "none"}
        turned = onset.turned * root
        axes.plot(onset.stokes, turned, marker="o", color=BLUE, label="turned by 1 rad", **style)
        wiggle = onset.wiggle * root
        axes.plot(onset.stokes, wiggle, marker="s", color=NODE, label="first wiggle", **style)
        last = float(np.mean(onset.turned[-2:])) * root[-1]
        draw_power(axes, onset.stokes, last, 0.5)
        axes.set(
            xlabel="Stokes number St",
            ylabel=r"onset time $t\dot\gamma$",
            xscale="log",
            yscale="log",
        )
        square_decades(axes, fill=True)
        key_of(axes)


def _stokes_label(stokes: float) -> str:
    """A run in the legend."""
    return f"St = {power(stokes)}"


def _draw_marks(axes: Axes, onset: Table) -> None:
    """Draw the scaled times of the onset, as their means over the two largest St."""
    for name, line, text in (("turned", ":", "turned by 1 rad"), ("wiggle", "--", "first wiggle")):
        place = np.mean(onset[name][-2:])
        axes.axvline(place, color="0.4", linestyle=line, linewidth=0.9, label=text)


@dataclass(frozen=True)
class Short(Experiment):
    """A particle from rest until t = √St, up to St = 1e8."""

    ellipsoid: Ellipsoid
    start: EulerStart

    def compute(self, grid: Grid) -> Computed:
        """Paths of z' and their lengths; the Jeffery orbit of the same start."""
        scaled = np.linspace(0.0, 1.0, grid.of(401, 101))
        for stokes in np.geomspace(1e2, 1e8, 7).tolist():
            times = scaled * stokes**0.5
            path = _path(full_run(Scene(self.ellipsoid, stokes, self.start, times[-1]), times))
            # Every other row draws the path. Its length is taken from all rows.
            yield "", {"stokes": stokes, **{name: column[::2] for name, column in path.items()}}
            length = arc_length(np.column_stack([*path.values()]))[-1]
            yield "length", {"stokes": stokes, "length": length}
        yield from _jeffery_orbit(self.ellipsoid, self.start, 201)

    def judge(self, data: Data) -> Verdict:
        """To which length the paths tend, from which St on, and how far they leave the Jeffery orbit."""
        length = data["length"]
        jeffery = data["jeffery"]
        last = length.length[-1]
        at_million = length.length[length.stokes == 1e6][0]
        axis = points(by(data[""], "stokes")[1e8])
        # On the unit sphere small distances are angles in rad.
        distance = distance_from(points(jeffery), axis)
        # The length of the path is interpolated between the rows before and after it has left the
        # orbit.
        first_off = int(np.argmax(distance > _OFF_ORBIT))
        around = slice(first_off - 1, first_off + 1)
        left = np.interp(_OFF_ORBIT, distance[around], arc_length(axis)[around])
        turn = arc_length(points(jeffery))[-1]
        limit = Range.near(0.0, 5e-3, "corrections are of order 1/√St ≤ 3e-4, times some")
        return Verdict(
            Word.SHARPENED,
            f"The length tends to {last:.2f} rad, {last / turn:.2f} times that of the Jeffery "
            f"orbit; at St = 1e6 it is within {100 * abs(at_million / last - 1):.2g} % of that at "
            f"1e8, so that the paper's St of 1e8 is not needed. The axis is {_OFF_ORBIT:g} rad off the "
            f"orbit after {left:.2g} rad, {100 * left / turn:.0f} % of a turn, and "
            f"{distance.max():.2g} rad at most.",
            f"Axis z' of {axes_of(self.ellipsoid)} from rest until t = √St, for St from 1e2 to "
            "1e8, and the length of its path.",
            [
                Number(
                    "path length at St = 1e8",
                    last,
                    Range(0.1, 10.0, "a number of order one"),
                    "rad",
                ),
                Number("its relative change from St = 1e7", last / length.length[-2] - 1, limit),
                Number(
                    "path length at St = 1e6 over that at 1e8, less one",
                    at_million / last - 1,
                    Range.near(0.0, 0.02, "corrections are of order 1/√St = 1e-3, times some"),
                ),
                Number(
                    "largest distance from the Jeffery orbit at St = 1e8",
                    distance.max(),
                    Range(_OFF_ORBIT, pi, "the claim: the path leaves the orbit"),
                    "rad",
                ),
                Number(
                    f"path until it is {_OFF_ORBIT:g} rad off, over the length of the orbit",
                    left / turn,
                    Range(0.0, 0.5, "the claim: before a single turn"),
                ),
            ],
        )

    def draw(self, data: Data) -> Figure:
        """Paths on the sphere, and their lengths against St."""
        table = data[""]
        length = data["length"]
        figure, (sphere, plain) = panels(1, 2, 3.2, spatial=[0], wspace=0.16)
        unit_sphere(sphere)
        space: Any = sphere
        shown = by(table, "stokes")
        colors = (BLUE, ORANGE, VERMILLION, PURPLE)
        for color, stokes in zip(colors, length.stokes[::2], strict=True):
            rows = shown[stokes]
            label = _stokes_label(stokes)
            space.plot(rows.x, rows.y, rows.z, color=color, linewidth=1.4, label=label)
        _draw_orbit(sphere, data["jeffery"])
        key_above(figure, sphere)
        plain.plot(length.stokes, length.length, marker="o", color=BLUE)
        plain.set(
            xlabel="Stokes number St",
            ylabel=r"path length until $t = \mathrm{St}^{1/2}$, rad",
            xscale="log",
        )
        plain.set_ylim(bottom=0.0)
        return figure


_SPIRAL = (
    "From rest at St = 1000 the axis first spirals along turns like Jeffery orbits towards the "
    "plane of the flow, then changes abruptly to an Euler spiral, where inertia sets in."
)
_ROOT = (
    "Inertial effects set in after a time of O(St^½), the same for all St when scaled so, when the "
    "angular velocity is O(St^-½)."
)
_SHORT = (
    "Until t = St^½ the axis runs through a path whose length tends to a number of order one, which "
    "needs St of 1e8, and leaves the Jeffery orbit before a single turn."
)
# Bodies, starts (Euler angles in rad) and St come from the paper's figures. They give no duration:
# t = 600, in inverse shear rates, shows the change of the turns and many turns after it.
REST_SECTION = Section(
    "rest",
    "Starts from rest",
    (
        Item(
            "rest-needle",
            "From rest on the unit sphere, spheroid",
            "discussion, starts from rest",
            _SPIRAL,
            Sphere(spheroid(10.0), EulerStart((0.10472, 5.4978, 0.0)), 600.0),
        ),
        Item(
            "rest-blade",
            "From rest on the unit sphere, ellipsoid",
            "discussion, starts from rest",
            _SPIRAL,
            Sphere(Ellipsoid((0.1, 0.15, 1.0)), EulerStart((0.10472, 2.35619, 0.0)), 600.0),
        ),
        Item(
            "rest-transient-spheroid",
            "The St^½ transient of a spheroid",
            "discussion, starts from rest",
            _ROOT,
            Transient(spheroid(2.0), EulerStart((0.314, 0.52, 0.0))),
        ),
        Item(
            "rest-transient-ellipsoid",
            "The St^½ transient of an ellipsoid",
            "discussion, starts from rest",
            _ROOT,
            Transient(Ellipsoid((3.0, 2.0, 1.0)), EulerStart((0.314, 0.52, 1.05))),
        ),
        Item(
            "rest-short-spheroid",
            "From rest until St^½, spheroid",
            "discussion, starts from rest",
            _SHORT,
            Short(spheroid(2.0), EulerStart((0.78539, 2.35619, 0.0))),
        ),
        Item(
            "rest-short-ellipsoid",
            "From rest until St^½, ellipsoid",
            "discussion, starts from rest",
            _SHORT,
            Short(Ellipsoid((0.5, 0.55, 1.0)), EulerStart((0.78539, 2.35619, 0.0))),
        ),
    ),
)
