"""Remarks of the paper in passing: drift of nearly circular bodies, frequencies, St* of spheroids.

They stand in the paper's sections `asympcase` and `numress`. A passage of φ = nπ is a time at which
the axis z' has no component along the flow. A half turn is half a Jeffery period of the longest and
the shortest axis. `polhode.harness.paper.jeffery_top` computes both.

In figures, heights of panels are in inches, and widths of lines and sizes of marks and letters in
points. They and the limits of axes are chosen by eye.

Ends of the ranges for which a verdict holds are estimates where their reasons do not give them.
"""

from dataclasses import dataclass
from math import pi

import numpy as np
from matplotlib.figure import Figure
from scipy.signal import find_peaks

from polhode.harness.pages.figures.style import BLUE, GREEN, ORANGE, VERMILLION, square_decades
from polhode.harness.paper import planes
from polhode.harness.paper.drawing import draw_each, key_above, panels
from polhode.harness.paper.item import (
    Computed,
    Data,
    Experiment,
    Grid,
    Item,
    Number,
    Range,
    Section,
    Verdict,
    Word,
)
from polhode.harness.paper.jeffery_top import half_turn, section_points
from polhode.harness.paper.runs import full_run, spheroid
from polhode.harness.paper.sections.ellipsoids import SIX_BODIES
from polhode.harness.paper.sections.planes import name_of
from polhode.harness.paper.tables import by, groups, joined
from polhode.models.shape import Ellipsoid

# Ratio of the two equatorial semi-axes of the body whose cross-section is nearly circular. The paper
# names none: an estimate.
_NEARLY_CIRCULAR = 1.02
# Starts of the orbits, at φ = 0: from near the vorticity axis to near the plane of the flow.
_DRIFT_STARTS = (0.5, 0.9, 1.2, 1.4, 1.5, 1.56)  # θ in rad.
_DRIFT_PSI = 0.3  # ψ in rad: any value, as θ varies.
# Half turns for which the orbits are followed: several drifts, of 7 to 70 half turns each. A quarter
# of them on the reduced grid.
_DRIFT_TURNS = 400


@dataclass(frozen=True)
class Drift(Experiment):
    """Slow drift of a body without inertia whose cross-section is nearly circular."""

    def compute(self, grid: Grid) -> Computed:
        """θ at each passage of φ = nπ, beside the spheroid's θ."""
        turns = grid.of(_DRIFT_TURNS, _DRIFT_TURNS // 4)
        bodies = {
            1.0: spheroid(2.0),
            _NEARLY_CIRCULAR: Ellipsoid((0.5, 0.5 * _NEARLY_CIRCULAR, 1.0)),
        }
        for ratio, body in bodies.items():
            starts = [(theta, 0.0, _DRIFT_PSI) for theta in _DRIFT_STARTS]
            paths = section_points(body, starts, turns * half_turn(body))
            for number, (theta, _) in enumerate(paths):
                rows = {"turn": np.arange(1, len(theta) + 1), "theta": theta}
                yield "", {"ratio": ratio, "orbit": number, **rows}

    def judge(self, data: Data) -> Verdict:
        """Whether θ drifts slowly between two limits, and whether orbits cross the flow–gradient plane."""
        table = data[""]
        bodies = by(table, "ratio")
        periods = []
        crossing = []
        for _, rows in groups(bodies[_NEARLY_CIRCULAR], "orbit"):
            # Each drift has one maximum of θ. Smaller ones, of less than a fifth of the range, are
            # the scatter of single passages. An estimate.
            peaks, _ = find_peaks(rows.theta, prominence=0.2 * np.ptp(rows.theta))
            if len(peaks) > 1:
                periods.append(float(np.mean(np.diff(rows.turn[peaks]))))
            crossing.append(rows.theta.min() < pi / 2 < rows.theta.max())
        steady = max(np.ptp(rows.theta) for _, rows in groups(bodies[1.0], "orbit"))
        limits = [
            (rows.theta.min(), rows.theta.max())
            for _, rows in groups(bodies[_NEARLY_CIRCULAR], "orbit")
        ]
        words = "; ".join(f"{low:.2f} … {high:.2f}" for low, high in limits)
        return Verdict(
            Word.SHARPENED,
            f"With equatorial axes in the ratio {_NEARLY_CIRCULAR:g} the angle θ at successive "
            f"passages of φ = nπ drifts between two limits ({words} rad), once in "
            f"{min(periods):.2g} to {max(periods):.2g} half turns, the faster the nearer to the "
            f"vorticity, where it is small. {sum(crossing)} of {len(crossing)} orbits cross the flow–gradient plane "
            "θ = π/2 on their way. Of the spheroid with the same long axis θ is the same at all "
            f"passages to {steady:.1g} rad, and none crosses.",
            f"θ at the passages of φ = nπ of a body without inertia, semi-axes (0.5, "
            f"{0.5 * _NEARLY_CIRCULAR:g}, 1), from ψ = {_DRIFT_PSI:g}; dotted: the spheroid (0.5, 0.5, 1); "
            "dashed: the flow–gradient plane.",
            self._numbers(periods, crossing, steady),
        )

    def _numbers(self, periods: list[float], crossing: list[bool], steady: float) -> list[Number]:
        """Period of the drift, crossings, and the spheroid beside it."""
        share = float(np.mean(crossing))
        return [
            Number(
                "period of the drift, in half turns, median of the orbits",
                float(np.median(periods)),
                Range(10.0, 1e3, "the claim: well separated, an order of magnitude or more"),
            ),
            Number(
                "share of the orbits that cross the flow–gradient plane",
                share,
                Range(0.1, 0.9, "the claim: certain subsets, neither none nor all"),
                measure=f"{len(_DRIFT_STARTS)} chosen starts",
            ),
            Number(
                "change of θ between passages, spheroid, largest",
                steady,
                Range.at_most(
                    1e-3,
                    "Jeffery orbits are closed; passages are interpolated, steps 0.4 apart",
                ),
                "rad",
            ),
        ]

    def draw(self, data: Data) -> Figure:
        """θ against the number of half turns."""
        bodies = by(data[""], "ratio")
        figure, (axes,) = panels(1, 1, 3.7)
        draw_each(axes, bodies[_NEARLY_CIRCULAR], "orbit", "turn", "theta", linewidth=0.9)
        style = {"linestyle": ":", "linewidth": 0.9}
        draw_each(axes, bodies[1.0], "orbit", "turn", "theta", **style)
        axes.axhline(pi / 2, color="0.4", linestyle="--", linewidth=0.8)
        axes.set(xlabel="half turns", ylabel=r"$\theta$ at $\phi = n\pi$, rad")
        return figure


# κ of the prolate spheroids; the complementary oblate ones have 1/κ. From nearly spherical to so
# slender that exponents have reached their limits.
_STAR_KAPPAS = (1.1, 2.0, 5.0, 10.0, 30.0, 100.0, 300.0)


@dataclass(frozen=True)
class StokesStar(Experiment):
    """The effective Stokes number St* = I_a St/(8πX_c) of complementary spheroids."""

    def compute(self, grid: Grid) -> Computed:
        """St*/St of prolate and oblate spheroids of the same eccentricity."""
        for kappa in _STAR_KAPPAS:
            values = {}
            for name, ratio in (("prolate", kappa), ("oblate", 1 / kappa)):
                body = spheroid(ratio)
                values[name] = body.inertia[2] / (8 * pi * body.resistance[2])
            yield "", {"kappa": kappa, **values}

    def judge(self, data: Data) -> Verdict:
        """Which one is larger, and how they scale."""
        table = data[""]
        ratio = table.oblate / table.prolate
        # Exponents between the last two κ.
        last = table[-1]
        before = table[-2]
        oblate = np.log(last.oblate / before.oblate) / np.log(last.kappa / before.kappa)
        squared = np.log(last.prolate / before.prolate) / np.log(last.kappa / before.kappa)
        return Verdict(
            Word.CORRECTED,
            f"St* of the oblate spheroid is the larger one at every κ, {ratio.min():.2g} to "
            f"{ratio.max():.2g} times that of the prolate one with the same eccentricity, from "
            f"κ = {table.kappa[0]:g} to {last.kappa:g}. St* of discs falls like κ, as printed "
            f"(exponent {oblate:.3f} in their axis ratio's inverse). St* of needles falls like "
            f"κ^({squared:.3f}), as κ^-2 does, with no logarithm: the printed ln κ/κ² belongs to "
            "the transverse resistance, and St* is defined by the axial one.",
            "St*/St of prolate spheroids (κ) and the complementary oblate ones (1/κ); right: its "
            "exponent between neighbouring points.",
            [
                Number(
                    "St* oblate over prolate, smallest",
                    ratio.min(),
                    Range(1.0, 1e4, "the claim: the oblate one is the larger"),
                ),
                Number(
                    "exponent of St* of discs in the aspect ratio's inverse",
                    oblate,
                    Range.near(-1.0, 0.05, "the claim: St* ≈ St κ"),
                ),
                Number(
                    "exponent of St* of needles in κ",
                    squared,
                    Range.near(-2.0, 0.05, "the correction: κ^-2; ln κ would add 0.2 here"),
                ),
            ],
        )

    def draw(self, data: Data) -> Figure:
        """St*/St against κ, and its local exponents."""
        table = data[""]
        figure, (left, right) = panels(1, 2, 3.6, width_ratios=[2, 3])
        middle = np.sqrt(table.kappa[1:] * table.kappa[:-1])
        for name, color in (("prolate", BLUE), ("oblate", ORANGE)):
            left.plot(table.kappa, table[name], marker="o", color=color, label=name)
            exponents = np.diff(np.log(table[name])) / np.diff(np.log(table.kappa))
            right.plot(middle, exponents, marker="o", color=color)
        kappa = r"$\kappa$ (prolate), $1/\kappa$ (oblate)"
        left.set(xlabel=kappa, ylabel=r"$\mathrm{St}^*/\mathrm{St}$", xscale="log", yscale="log")
        right.set(xlabel=kappa, ylabel="exponent between two points", xscale="log")
        square_decades(left)
        key_above(figure, left)
        return figure


# Trajectories whose swings are counted, from one of the starts of the sections' planes
# (`sections.planes`).
_WAVE_STOKES = 1e3  # St of the claim.
_WAVE_START = (-0.7, 0.9)  # L_z/I_max, and θ in rad.
_WAVE_SLOW_TIME = 0.05  # Slow time over which swings are counted, before they die out: an estimate.
_SPHEROID_KAPPAS = (2.0, 3.33)  # Aspect ratios: one that is nearer to a sphere, and the claim's.


@dataclass(frozen=True)
class Waves(Experiment):
    """Frequency and regularity of the fast oscillation of E about the slow trajectory."""

    def compute(self, grid: Grid) -> Computed:
        """Turning points of E of full runs of spheroids and of the six ellipsoids.

        A swing is the change of E from one turning point to the next, half a period. The table has,
        for each body, its angular frequency in shear rates, the median size of a swing over I_max,
        and its `scatter`: the median size of the logarithm of the ratio of a swing to the next one in
        the same direction.
        """
        bodies = [*map(spheroid, _SPHEROID_KAPPAS), *SIX_BODIES]
        # 800 rows in each inverse shear rate, so that every turning point shows. An estimate.
        slow_times = np.linspace(0.0, _WAVE_SLOW_TIME, grid.of(40001, 10001))
        for number, body in enumerate(bodies):
            scene = planes.aligned_scene(body, _WAVE_STOKES, *_WAVE_START, _WAVE_SLOW_TIME)
            energy = full_run(scene, _WAVE_STOKES * slow_times).slow[:, 3]
            turning = np.flatnonzero(np.diff(np.sign(np.diff(energy)))) + 1
            swings = np.abs(np.diff(energy[turning]))
            spacing = np.diff(slow_times[turning]) * _WAVE_STOKES
            # Swings of the same direction: every other one.
            scatter = np.median(np.abs(np.log(swings[2:] / swings[:-2])))
            row = {"body": number, "name": name_of(body)}
            waves = {"frequency": pi / np.mean(spacing), "scatter": scatter}
            yield "", {**row, **waves, "size": np.median(swings)}

    def judge(self, data: Data) -> Verdict:
        """Compare frequencies and irregularities."""
        table = data[""]
        count = len(_SPHEROID_KAPPAS)
        spheroids = table[:count]
        bodies = table[count:]
        # In the order (b, c) = (0.55, 0.5), (0.55, 0.3), (0.75, 0.5), … of `SIX_BODIES`.
        # So a row has one b, a column one c. b = 0.55 is near a prolate spheroid, 0.95 near an oblate
        # one, and 0.75, in places 2 and 3, between.
        columns = bodies.frequency.reshape(3, 2)
        growth = columns[2] / columns[0]
        monotone = bool(np.all(np.diff(columns, axis=0) > 0))
        triaxial = bodies.scatter[2:4]
        near_spheroids = bodies.scatter[[0, 1, 4, 5]]
        named = ", ".join(f"{row.frequency:.3g} ({row['name']})" for row in table)
        steady = "at each step" if monotone else "though not at each step"
        return Verdict(
            Word.SHARPENED,
            f"At St = {_WAVE_STOKES:g} the angular frequencies of the fast oscillation of E are "
            f"{named}. κ = 3.33 has {spheroids.frequency[1] / spheroids.frequency[0]:.2f} times the "
            f"frequency of κ = 2. From the top to the foot of a column of ellipsoids it grows by "
            f"factors of {joined(growth, '.2f')}, {steady}. Two swings that follow each other in "
            "the same direction differ by factors of "
            f"{joined(np.exp(near_spheroids), '.2f')} for the four near-spheroids and of "
            f"{joined(np.exp(triaxial), '.2f')} for the two bodies between.",
            "Angular frequency of the oscillation of E, and median factor between neighbouring "
            f"swings, from (L_z0/I_max, θ₀) = ({_WAVE_START[0]:g}, {_WAVE_START[1]:g}), St = "
            f"{_WAVE_STOKES:g}.",
            [
                Number(
                    "frequency of κ = 3.33 over that of 2",
                    spheroids.frequency[1] / spheroids.frequency[0],
                    Range(0.1, 1.0, "the claim: lower for the more anisotropic spheroid"),
                ),
                Number(
                    "frequency at the foot over that at the top of a column of ellipsoids, smaller",
                    float(growth.min()),
                    Range(1.0, 10.0, "the claim: it increases as the body grows fatter"),
                ),
                Number(
                    "irregularity of the bodies between over the near-spheroids', medians",
                    float(np.median(triaxial) / np.median(near_spheroids)),
                    Range(1.0, 100.0, "the claim: more irregular for the triaxial ellipsoid"),
                ),
            ],
        )

    def draw(self, data: Data) -> Figure:
        """Frequencies and irregularities of all bodies."""
        table = data[""]
        places = np.arange(len(table))
        figure, (left, right) = panels(1, 2, 2.6)
        left.bar(places, table.frequency, color=GREEN)
        right.bar(places, np.exp(table.scatter), color=VERMILLION)
        for axes in (left, right):
            axes.set_xticks(places, table.name.tolist(), rotation=45, ha="right", fontsize=8.5)
            axes.set_xlabel("body")
        left.set_ylabel(r"angular frequency$/\dot\gamma$")
        right.set_ylabel("median factor between swings")
        return figure


REMARKS_SECTION = Section(
    "remarks",
    "Remarks in passing",
    (
        Item(
            "near-circular-drift",
            "Drift of a body with a nearly circular cross-section",
            "asympcase, the Jeffery top",
            "When the cross-section is nearly circular, a fast rotation along nearly closed "
            "Jeffery orbits goes with a slow drift between two limiting orbits, which for some "
            "trajectories lie on either side of the flow–gradient plane; spheroids never cross it.",
            Drift(),
        ),
        Item(
            "stokes-star",
            "St* of complementary spheroids",
            "numress",
            "St* ≈ St ln κ/κ² for κ → ∞ and St* ≈ St κ for κ → 0, so that St* of an oblate "
            "spheroid is greater than that of the complementary prolate one.",
            StokesStar(),
        ),
        Item(
            "plane-waves",
            "Frequency and regularity of the fast oscillation",
            "numress and the planes of six ellipsoids",
            "Full trajectories of κ = 3.33 at St = 1000 oscillate with a lower frequency; down a "
            "column of the ellipsoids' planes, as the body grows fatter, the frequency increases; "
            "near-spheroids oscillate periodically, the triaxial bodies between irregularly.",
            Waves(),
        ),
    ),
)
