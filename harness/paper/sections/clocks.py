"""Rates of approach to the stable rotations and from large L, clocks, and the collapse on St*.

The approach from large L is the decay of L ≫ I. The collapse is the paper's claim that curves of
different bodies become one. A clock is a unit of time in which relaxation is measured: t/St, or
t/St*. St* = I St/(8πX) is the effective Stokes number of one of the body's axes, I its moment of
inertia and X its resistance. On the right clock all bodies relax alike. The printed rates are
`fixed_points.eigenvalues`. Rates are per unit of slow time t₂ = t/St unless another clock is named.
I and X are `Ellipsoid.inertia` and `resistance`, without unit. Indices a and c are of a spheroid's
symmetry axis, e of an axis across it: I_a, I_e, X_c, and Y_c for the resistance across it.

In figures, heights of panels are in inches, and widths of lines and sizes of marks and letters in
points. They and the limits of axes are chosen by eye.

Ends of the ranges for which a verdict holds are estimates where their reasons do not give them.
"""

from abc import abstractmethod
from dataclasses import dataclass
from functools import cache
from math import pi

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter

from polhode.harness.common.text import short
from polhode.harness.pages.figures.style import BLUE, GREEN, ORANGE, VERMILLION, square_decades
from polhode.harness.paper.drawing import draw_each, key_above, key_of, panels
from polhode.harness.paper.item import (
    Computed,
    Data,
    Experiment,
    Grid,
    Item,
    Number,
    Part,
    Range,
    Section,
    Table,
    Verdict,
    Word,
)
from polhode.harness.paper.runs import Run, axes_of, full_run, spheroid
from polhode.harness.paper.sections.pinch import Pinch
from polhode.harness.paper.tables import groups, joined, maxima, path, spread, worst
from polhode.models.forms.spheroid import Spheroid
from polhode.models.rotation import quaternion_from_euler
from polhode.models.scene import BodyStart, EulerStart, Scene
from polhode.models.scenes import aligned_start
from polhode.models.shape import Ellipsoid
from polhode.models.theory.fixed_points import eigenvalues

# Bodies whose z' is the axis of the stable rotation: tumbling, spinning, and about the shortest
# axis. The triaxial ones are examples: the paper's, a slender one, and one that is nearly oblate.
_BODIES = tuple(
    Ellipsoid(axes)
    for axes in (
        (2.0, 1.0, 1.0),
        (1.0, 1.0, 0.5),
        (1.0, 0.8, 0.5),
        (1.0, 0.55, 0.3),
        (1.0, 0.95, 0.5),
    )
)
# St of the full runs that decay to the stable rotation: so large that they follow the averaged
# rates. An estimate.
_DECAY_STOKES = 1e5
# Distance of their starts from the rotation: a tilt in rad, or an angular velocity in shear rates.
# An estimate: small enough for linear rates, and large beside the fast oscillation of order 1/St.
_START_OFFSET = 0.03
# Runs from large L: |L|/I_max at the start, the direction of L in body axes, and St. Estimates: L is
# large beside I also after two relaxation times (78 and 94 I_max), and has parts along and across the axis.
# St is so large that L hardly changes in a rotation of the body.
_LARGE = 800.0
_LARGE_DIRECTION = (0.6, 0.0, 0.8)
_LARGE_STOKES = 1e4
# The modes in which a start is off the rotation, in the order of `eigenvalues`: L tilted along x or
# along y, faster, wobbling.
_MODES = ("$L_x$", "$L_y$", "$L_z$", "wobble")
_TILTED_TO_X = 0
_FASTER = 2
_WOBBLE = 3


def displaced(body: Ellipsoid, mode: int) -> BodyStart | EulerStart:
    """Start at the rotation about z' along the vorticity, but off in one mode, a place in `_MODES`.

    The rotation itself has the angular velocity -½ ẑ, half the vorticity.
    """
    if mode == _WOBBLE:
        # L stays -½ I₃ ẑ, and z' is tilted away from it.
        return aligned_start(body, -body.inertia[2] / 2, _START_OFFSET)
    # z' = (sin θ sin φ, -sin θ cos φ, cos θ) is tilted to +x by φ = π/2, and to -y by φ = 0. Any ψ
    # would do, as 0.3.
    tilt = 0.0 if mode == _FASTER else _START_OFFSET
    azimuth = pi / 2 if mode == _TILTED_TO_X else 0.0
    spin = -0.5 - (_START_OFFSET if mode == _FASTER else 0.0)
    return BodyStart(quaternion_from_euler((tilt, azimuth, 0.3)), (0.0, 0.0, spin))


def amplitude(run: Run, mode: int) -> np.ndarray:
    """Distance of a run from the fixed point in a mode, shape (n,).

    It is in a component of L, or 2EI₃ - L² of a wobble. Both are in units of `Ellipsoid.inertia` and
    the shear rate. Only their decay counts.
    """
    # Modes 0 to 2 are the components of L.
    momentum = run.observables.angular_momentum
    energy = run.observables.slow[:, 3]
    inertia = run.scene.ellipsoid.inertia[2]
    if mode == _WOBBLE:
        # It is 0 where the body turns about an axis of moment I₃, the largest, and positive elsewhere.
        return 2 * energy * inertia - np.sum(momentum**2, axis=1)
    return np.abs(momentum[:, mode] + (inertia / 2 if mode == _FASTER else 0.0))


def fitted_rate(slow_times: np.ndarray, values: np.ndarray) -> float:
    """Rate of an exponential, per slow time, by least squares of the logarithm."""
    # A value of 0 has no logarithm: 1e-300 stands for it.
    return float(np.polyfit(slow_times, np.log(np.maximum(values, 1e-300)), 1)[0])


@cache
def decay_tables(grid: Grid) -> tuple[Part, ...]:
    """Rates of all modes of all bodies from full runs, and the decay of large L of two spheroids.

    `_rates` makes the first table, "", `_from_large` makes "large". Two items share them.
    """
    return (*_rates(grid), *_from_large(grid))


def _rates(grid: Grid) -> Computed:
    """The rate of each mode of each body, printed and measured, per slow time.

    `body` and `mode` are places in `_BODIES` and `_MODES`, `clock` is St*/St of z'. Rates of decay are
    negative. The number of rows of a run is an estimate: enough to follow the oscillation's envelope.
    """
    for number, body in enumerate(_BODIES):
        clock = body.inertia[2] / (8 * pi * body.resistance[2])
        for mode, printed in enumerate(eigenvalues(body, 2)):
            # A run lasts 1.5 relaxation times of the printed rate, an estimate. Then the offset is still
            # a fifth of what it was or more, far above the fast oscillation.
            slow_times = np.linspace(0.0, 1.5 / abs(printed), grid.of(4001, 1001))
            times = _DECAY_STOKES * slow_times
            run = full_run(Scene(body, _DECAY_STOKES, displaced(body, mode), times[-1]), times)
            # The fourth variable of a tumbling spheroid is its spin η about the symmetry axis, and the
            # wobble goes like η². Elsewhere it is E, or η + ½ of a spinning one, in which the wobble is linear.
            share = 0.5 if mode == _WOBBLE and body.symmetry_axis == 0 else 1.0
            measured = share * fitted_rate(slow_times, amplitude(run, mode))
            rates = {"printed": printed, "measured": measured}
            yield "", {"body": number, "mode": mode, **rates, "clock": clock}


def _from_large(grid: Grid) -> Computed:
    """From large L: squares of L along and across the axis, and the angle in rad by which L has turned.

    The spheroids are an oblate and a prolate one. The number of rows, 401, is an estimate: enough for a
    smooth curve. L is in units of `Ellipsoid.inertia` and the shear rate.
    """
    for kappa in (0.5, 2.0):
        body = spheroid(kappa)
        # Two relaxation times of the axis that is damped least.
        slow_times = np.linspace(0.0, 2.0 / min(body.damping), grid.of(401, 101))
        times = _LARGE_STOKES * slow_times
        momentum = _LARGE * np.array(_LARGE_DIRECTION)  # Over I_max, in body axes.
        omega = momentum / np.array(body.inertia) * max(body.inertia)
        # The orientation is any: the printed rates from large L do not depend on it.
        start = BodyStart((0.5, 0.5, 0.1, 0.7), tuple(omega))
        observables = full_run(Scene(body, _LARGE_STOKES, start, times[-1]), times).observables
        momentum = observables.angular_momentum
        axis = observables.rotation[:, 2]
        size = np.linalg.norm(momentum, axis=1)
        axial = np.einsum("ni,ni->n", momentum, axis) ** 2
        cosine = momentum @ momentum[0] / size / size[0]
        turned = np.arccos(np.clip(cosine, -1, 1))
        squares = {"axial": axial, "transverse": size**2 - axial}
        yield "large", {"kappa": kappa, "t2": slow_times, **squares, "turned": turned}


def large_decay(large: Table) -> list[float]:
    """Decay of L² from large L along and across the axis, over the printed rate, less one.

    `large` is the table of `_from_large`. The four numbers are two of each spheroid.
    """
    ratios = []
    for kappa, part in groups(large, "kappa"):
        body = spheroid(kappa)
        for name, axis in (("axial", 2), ("transverse", 0)):
            # The printed times are I/(16πX), half of the times of L itself.
            printed = -16 * pi * body.resistance[axis] / body.inertia[axis]
            ratios.append(fitted_rate(part.t2, part[name]) / printed - 1)
    return ratios


def on_clocks(table: Table) -> tuple[np.ndarray, ...]:
    """Relaxation rates of L_z of all bodies from the table of `_rates`, shape (5,) each, on three clocks.

    They are per t/St, per t/St* of the longest axis, and per t/St* of the axis along the vorticity,
    which is the shortest.
    """
    chosen = table[table.mode == _FASTER]
    rate = -chosen.measured
    # St*/St of the longest axis of each body.
    longest_clocks = []
    for body in _BODIES:
        axis = int(np.argmax(body.semi_axes))
        longest_clocks.append(body.inertia[axis] / (8 * pi * body.resistance[axis]))
    return rate, rate * np.array(longest_clocks), rate * chosen.clock


@dataclass(frozen=True)
class _Decay(Experiment):
    """Rates of approach, which two items share: the tables of `decay_tables`."""

    def compute(self, grid: Grid) -> Computed:
        """Rates of all modes of all bodies; decay of large L."""
        return decay_tables(grid)

    @abstractmethod
    def judge(self, data: Data) -> Verdict:
        """Compare the rates with the claim."""

    @abstractmethod
    def draw(self, data: Data) -> Figure:
        """Draw the rates."""


@dataclass(frozen=True)
class DecayRates(_Decay):
    """Measured against printed rates."""

    def judge(self, data: Data) -> Verdict:
        """How far measured rates are off the printed ones."""
        table = data[""]
        large = data["large"]
        # The worst of all bodies, for each mode.
        off = [worst(rows.measured / rows.printed - 1) for _, rows in groups(table, "mode")]
        turned = np.degrees(large.turned.max())
        from_large = worst(large_decay(large))
        bodies = ", ".join(map(axes_of, _BODIES))
        return Verdict(
            Word.CONFIRMED,
            f"Full runs at St = {short(_DECAY_STOKES)} that start {_START_OFFSET:g} off the stable "
            "rotation in L_x, L_y, L_z "
            f"or in the wobble approach it at the printed rates to {joined(off, '.1g')}. From |L| "
            f"= {_LARGE:g} I_max the parts of L² along and across the axis decay at the printed "
            f"rates to {from_large:.1g}, and L turns by {turned:.2g}°. This is for L ≫ I; "
            "docs/misprints.md treats L_z ≪ L.",
            f"Left: rates of {bodies}, whose z' turns along the vorticity; line: equal. Right: "
            f"squares of the parts of L along and across the axis of spheroids from |L| = {_LARGE:g} "
            "I_max.",
            [
                Number(
                    f"measured over printed rate, less one, worst of {len(table)}",
                    max(off),
                    Range.at_most(
                        5e-2, f"the start is {_START_OFFSET:g} off, where rates are not linear"
                    ),
                ),
                Number(
                    "decay from large L, measured over printed rate, less one, worst",
                    from_large,
                    Range.at_most(
                        1e-2, "corrections are of order I/L, 1e-3 at the start and 1e-2 at the end"
                    ),
                ),
                Number(
                    "angle by which L turns meanwhile",
                    turned,
                    Range(
                        0.0,
                        1.0,
                        "the claim: the cone keeps its orientation, to a degree in a figure",
                    ),
                    "degrees",
                ),
            ],
        )

    def draw(self, data: Data) -> Figure:
        """Measured against printed rates; decay from large L."""
        table = data[""]
        large = data["large"]
        figure, (left, right) = panels(1, 2, 3.2)
        draw_each(
            left,
            table,
            "mode",
            lambda rows: -rows.printed,
            lambda rows: -rows.measured,
            label=lambda mode: _MODES[int(mode)],
            linestyle="none",
            marker="o",
        )
        bounds = [0.8 * min(-table.printed), 1.2 * max(-table.printed)]
        left.plot(bounds, bounds, color="0.5", linewidth=0.8, zorder=0)
        left.set(
            xlabel="printed rate, per slow time",
            ylabel="rate of full runs",
            xscale="log",
            yscale="log",
        )
        for axis in (left.xaxis, left.yaxis):
            axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
            axis.set_major_formatter("{x:g}")
            axis.set_minor_formatter(NullFormatter())
        square_decades(left, fill=True)
        key_of(left)
        for kappa, line in ((0.5, "-"), (2.0, "--")):
            rows = large[large.kappa == kappa]
            for name, color in (("axial", BLUE), ("transverse", VERMILLION)):
                label = rf"$L^2$, {name}, $\kappa$ = {kappa:g}"
                share = rows[name] / rows[name][0]
                right.plot(rows.t2, share, color=color, linestyle=line, label=label)
        right.set(xlabel="slow time $t_2$", ylabel="over its start", yscale="log")
        key_of(right)
        return figure


@dataclass(frozen=True)
class EllipsoidClock(_Decay):
    """Which Stokes number makes relaxation the same for all bodies."""

    def judge(self, data: Data) -> Verdict:
        """How far rates differ on three clocks."""
        plain, longest, shortest = (spread(rates) for rates in on_clocks(data[""]))
        apart = Range(
            1.2, 10.0, "clearly more than by the right clock; the upper end is an estimate"
        )
        return Verdict(
            Word.MEASURED,
            "With the moment and the resistance of the axis that ends along the vorticity, the "
            "shortest, St* = I₃ St/(8πX₃) makes the relaxation of L_z the same for the five "
            f"bodies: the rates differ by a factor of {shortest:.3f}, by {plain:.2g} per St and by "
            f"{longest:.2g} with the longest axis, which is the symmetry axis of the paper's "
            "prolate spheroids.",
            f"Relaxation rates of L_z of {', '.join(map(axes_of, _BODIES))} from full runs, on three "
            "clocks, each over its mean.",
            [
                Number(
                    "largest over smallest rate per St* of the shortest axis",
                    shortest,
                    Range(1.0, 1.05, f"the same, but for a start that is {_START_OFFSET:g} off"),
                ),
                Number("the same per St* of the longest axis", longest, apart),
                Number("the same per St", plain, apart),
            ],
        )

    def draw(self, data: Data) -> Figure:
        """The rates on three clocks."""
        figure, (axes,) = panels(1, 1, 3.6)
        names = ("per St", "per St* of the longest axis", "per St* of the axis along $z$")
        places = np.arange(len(_BODIES))
        for rates, name, color in zip(
            on_clocks(data[""]), names, (BLUE, ORANGE, GREEN), strict=True
        ):
            axes.plot(places, rates / rates.mean(), color=color, marker="o", label=name)
        axes.set_xticks(places, [axes_of(body) for body in _BODIES])
        axes.set(xlabel="semi-axes", ylabel="relaxation rate of $L_z$ over its mean")
        key_of(axes)
        return figure


# The scenes of the paper's figure on the collapse (`steff`), whose captions give St*, L_z and E.
_STOKES_STAR = 2.071  # Effective Stokes number St* = I_a St/(8πX_c) of all of them.
_MOMENTUM = -1.0  # L_z over I_max at the start.
_ENERGY = 0.6  # E over I_max at the start.
_COLLAPSE_KAPPAS = (0.3, 0.5, 2.0, 3.33)  # Aspect ratios of the four spheroids.
# Scaled times t/St*: after the first one the curves should have become one, and runs last to the
# second. Estimates.
_LATE = 6.0
_END = 12.0
# Oscillation of L_z/I_max below which a spheroid counts as at rest by then: too small to see in the
# figure. An estimate.
_CALM = 0.01


def collapse_start(kappa: float) -> tuple[Ellipsoid, float, BodyStart]:
    """Spheroid, its Stokes number at `_STOKES_STAR`, and the start with L along z.

    L_z is `_MOMENTUM` and E is `_ENERGY`.
    """
    ellipsoid = spheroid(kappa)
    shape = Spheroid.of(ellipsoid)
    largest = max(ellipsoid.inertia)
    momentum = _MOMENTUM * largest
    energy = _ENERGY * largest
    axial = shape.axial_inertia
    equatorial = shape.equatorial_inertia
    # The square of the spin ω_a about the axis, from 2E = I_a ω_a² + (L² - I_a² ω_a²)/I_e. The part
    # of L along the axis, I_a ω_a, is |L| times the cosine of the angle between the two.
    spin2 = (momentum**2 - 2 * equatorial * energy) / (axial * (axial - equatorial))
    theta = float(np.arccos(np.sqrt(spin2) * axial / momentum))
    start = aligned_start(ellipsoid, momentum, theta)
    stokes_star_per_stokes = axial / (8 * pi * ellipsoid.resistance[2])
    stokes = _STOKES_STAR / stokes_star_per_stokes
    return ellipsoid, stokes, BodyStart(start.quaternion, start.angular_velocity)


def frequency(run: Table) -> float:
    """Angular frequency of L_z, in units of the shear rate, from its first settled maximum to its last.

    The column t2 of `run` is t/St*. Settled is the second half of the time up to `_LATE` and after. This
    is an estimate: L_z relaxes within 1 to 1.7 units of t/St*.
    """
    settled = run[run.t2 >= _LATE / 2]
    first, *between, last = maxima(settled.t2, settled.Lz)
    return float(2 * pi * (len(between) + 1) / (last - first) / _STOKES_STAR)


@dataclass(frozen=True)
class Collapse(Experiment):
    """Four spheroids at the same St*.

    The table "" has L_z and E over I_max against t/St* (column `t2`). "rates" has the relaxation rate
    of L_z at the node per slow time t/St (`t2`) and per t/St* (`star`).
    """

    def compute(self, grid: Grid) -> Computed:
        """L_z and E, and the rate at which L_z relaxes to the node on either clock."""
        # Some hundred rows in each period of the oscillation at the end, by which its frequency is told.
        scaled = np.linspace(0.0, _END, grid.of(401, 201))
        for kappa in _COLLAPSE_KAPPAS:
            ellipsoid, stokes, start = collapse_start(kappa)
            # The scene must cover the times; it is longer by one unit.
            scene = Scene(ellipsoid, stokes, start, (_END + 1) * _STOKES_STAR)
            run = full_run(scene, _STOKES_STAR * scaled)
            yield "", path(kappa, scaled, run.slow, ("Lz", "E"))
            rate = -eigenvalues(ellipsoid, int(np.argmax(ellipsoid.inertia)))[2]
            rates = {"t2": rate, "star": rate * _STOKES_STAR / stokes}
            yield "rates", {"kappa": kappa, "stokes": stokes, **rates}

    def judge(self, data: Data) -> Verdict:
        """Whether the late curves are one."""
        table = data[""]
        rates = data["rates"]
        plain = spread(rates.t2)
        star = spread(rates.star)
        late = {kappa: rows.Lz[rows.t2 >= _LATE] for kappa, rows in groups(table, "path")}
        # At the node, rotation about the axis of I_max, L_z is -½ I_max.
        waves = {kappa: worst(momentum + 0.5) for kappa, momentum in late.items()}
        prolate = [kappa for kappa in late if kappa > 1]
        apart = worst(late[prolate[0]] - late[prolate[1]])
        oblate = max(wave for kappa, wave in waves.items() if kappa < 1)
        prolate_waves = [waves[kappa] for kappa in prolate]
        return Verdict(
            Word.CORRECTED,
            "The relaxation rates of L_z at the node differ by a factor of "
            f"{plain:.2g} per St and {star:.2g} per St*: St* takes out part of the shape. It is "
            "the damping about the symmetry axis, while prolate spheroids end tumbling about "
            "another: they go on oscillating twice a turn, by "
            f"{prolate_waves[0]:.2g} and {prolate_waves[1]:.2g} I_max, and oblate ones by less "
            f"than {_CALM:g} I_max. The late curves are not one: the two prolate ones, of equal "
            f"frequency, differ in phase and so by {apart:.2g} I_max.",
            f"Full runs of spheroids at St* = {_STOKES_STAR:g} from L = (0, 0, {_MOMENTUM:g}) I_max, "
            f"E = {_ENERGY:g} I_max; I_max is I_e for prolate and I_a for oblate ones. The figure's "
            f"caption gives one St* and no St: with these St = {joined(rates.stokes, '.4g')} for "
            f"κ = {joined(rates.kappa)}.",
            self._numbers(data, min(prolate_waves), oblate, apart),
        )

    def _numbers(self, data: Data, prolate: float, oblate: float, apart: float) -> list[Number]:
        """Spreads of the rates, and late oscillations: their sizes, over I_max, and frequencies."""
        rates = data["rates"]
        plain = spread(rates.t2)
        star = spread(rates.star)
        visible = Range(
            0.05, 1.0, "to be seen in the figure, and no larger than L_z itself, some I_max"
        )
        numbers = [
            Number(
                "largest over smallest relaxation rate of L_z at the node, per St*",
                star,
                Range(1.3, plain, "the correction: no collapse, though nearer to one than per St"),
            ),
            Number("the same per St", plain),
            Number(
                f"oscillation of L_z after t/St* = {_LATE:g}, prolate",
                prolate,
                visible,
                "I_max",
            ),
            Number("difference of the two prolate curves there", apart, visible, "I_max"),
            Number(
                "oscillation there, oblate",
                oblate,
                Range(0.0, _CALM, "a spheroid that spins along the vorticity does not oscillate"),
                "I_max",
            ),
        ]
        for kappa, rows in groups(data[""], "path"):
            if kappa > 1:
                twice = Range.near(
                    1.0,
                    0.1,
                    "twice the angular velocity of the node, one half, to a tenth (an estimate)",
                )
                name = f"frequency of that oscillation, κ = {kappa:g}"
                numbers.append(Number(name, frequency(rows), twice, "γ̇"))
        return numbers

    def draw(self, data: Data) -> Figure:
        """L_z and E on the clock t/St*."""
        rates = data["rates"]
        stokes = dict(zip(rates.kappa.tolist(), rates.stokes.tolist(), strict=True))
        figure, (left, right) = panels(1, 2, 2.5)
        draw_each(
            left,
            data[""],
            "path",
            "t2",
            "Lz",
            label=lambda kappa: rf"$\kappa$ = {kappa:g}, St = {stokes[kappa]:.0f}",
        )
        draw_each(right, data[""], "path", "t2", "E")
        scaled = r"$t\dot\gamma/\mathrm{St}^*$"
        left.set(xlabel=scaled, ylabel="$L_z/I_{max}$")
        right.set(xlabel=scaled, ylabel="$E/I_{max}$")
        key_above(figure, left)
        return figure


CLOCKS_SECTION = Section(
    "clocks",
    "Rates, clocks and the pinch point",
    (
        Item(
            "spheroid-pinch",
            "Full and slow trajectories at the pinch point",
            "lsds, the pinch point",
            "Slow trajectories with L_x = L_y = 0 grind to a halt at the pinch point; full ones "
            "cross it within a neighbourhood of O(St^-1/2); with small L_x and L_y slow and full "
            "trajectories agree throughout.",
            Pinch(),
        ),
        Item(
            "spheroid-collapse",
            "Collapse on the effective Stokes number",
            "lsds, the effective Stokes number",
            "At the same St* = I_a St/(8πX_c), L_z and E of different spheroids approach their end "
            "alike; the long-time evolution is a function of t/St* alone.",
            Collapse(),
        ),
        Item(
            "decay-rates",
            "Rates of approach to the stable rotations, and from large L",
            "lsds, lsde, the eigenvalues",
            "Eigenvalues of the stable rotations: tumbling, spinning (κ < 1), about the shortest "
            "axis; from L ≫ I, L² and E decay as two exponentials with the times I_a/(16πX_c) and "
            "I_e/(16πY_c), and the cone keeps its orientation.",
            DecayRates(),
        ),
        Item(
            "ellipsoid-clock",
            "The effective Stokes number of an ellipsoid",
            "beyond",
            "The paper defines St* = I_a St/(8πX_c) for spheroids, about the symmetry axis, and "
            "says nothing of ellipsoids.",
            EllipsoidClock(),
        ),
    ),
)
