"""Spheroids at large St: slow variables, the L_z–E plane, projections and L–E planes.

The claims stand in the paper's section `lsds`. κ is the ratio of the symmetry axis to the other
ones. I_a is the moment of inertia about the symmetry axis, I_e the one about an equatorial axis. I_e
is the larger one, I_max, if κ > 1. The plane's lower and upper parabola are E = L²/2I_max and E =
L²/2I_min. The stable node is on the lower one, the saddle on the upper one.

In figures, heights of panels are in inches, and widths of lines and sizes of marks and letters in
points. They and the limits of axes are chosen by eye.

Ends of the ranges for which a verdict holds are estimates where their reasons do not give them.
"""

from dataclasses import dataclass
from functools import partial
from itertools import product
from math import sqrt
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.path import Path as Outline

from polhode.harness.pages.figures.style import BLUE, ORANGE
from polhode.harness.paper import plane_drawing, planes
from polhode.harness.paper.drawing import (
    BLACK,
    BOUND,
    CYCLE,
    draw_broken,
    key_above,
    key_of,
    panels,
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
from polhode.harness.paper.runs import graded, slow_run, spheroid
from polhode.harness.paper.sections.planes import (
    PlanesOfBodies,
    plane_tables,
    reaching_node,
    reaching_pinch,
)
from polhode.harness.paper.sections.slow_motion import ACCURATE, SlowMotion, order_of_damping
from polhode.harness.paper.tables import by, groups, joined, worst
from polhode.models.scenes import NEAR_POLE_START, SPHEROID_START
from polhode.models.theory.fixed_points import fixed_points

_BODY = spheroid(2.0)  # The paper's, κ = 2, of all items but that on four spheroids.
# Slow time for which trajectories on the upper parabola are followed, before rounding carries them
# off it. An estimate.
_ON_EDGE = 0.16


@dataclass(frozen=True)
class Plane(Experiment):
    """Slow trajectories in the L_z–E plane of one spheroid."""

    def compute(self, grid: Grid) -> Computed:
        """Slow trajectories from both edges of the plane, and from close to the pinch point."""
        # Starts are pairs of L_z/I_max and the share, by `energy_at`, of E between its bounds. The last
        # two lie on the upper parabola. -1.1 is beyond the fixed points, which lie at -0.5 and
        # -0.2, and -0.06 between them and the pinch point. The values and the numbers of rows are
        # estimates.
        shares = (0.001, 0.05, 0.15, 0.3, 0.5, 0.7, 0.85, 0.95, 0.999)[:: grid.of(1, 4)]
        starts = [*product((-1.1, -0.06, 1.1), shares)]
        starts += [(-1.1, 1.0), (-0.06, 1.0)]
        # 150 points draw a trajectory smoothly.
        chosen = partial(planes.plane_steps, count=150)
        return plane_tables(_BODY, starts, grid.of(2001, 601), _ON_EDGE, chosen)

    def judge(self, data: Data) -> Verdict:
        """Ends of the trajectories."""
        ends = data["ends"]
        on_edge = ends.share == 1.0
        left = (ends.Lz0 < 0) & ~on_edge
        # Slow time to the pinch point over its bound (`plane_tables`).
        pinch = np.max((ends.end / ends.bound)[ends.Lz0 > 0])
        saddle, _ = planes.fixed_point(_BODY, "saddle")
        # L_z at the end of each path. Paths have the numbers of the rows of `ends`.
        end_momenta = {int(number): rows.Lz[-1] for number, rows in groups(data[""], "path")}
        off_saddle = worst(
            [momentum - saddle for number, momentum in end_momenta.items() if on_edge[number]]
        )
        return Verdict(
            Word.CORRECTED,
            "Every start with L_z < 0 off the upper parabola reaches the node, those on it reach "
            "the saddle. Starts with L_z > 0 meet the pinch point in a finite slow time, at most "
            f"{pinch:.2g} of the bound L_z/(4π min X). The saddle lies at (I_a/I_e)(-1/2, 1/8); "
            "the caption prints the node's place for it.",
            f"L_z–E plane of a prolate spheroid, κ = 2, with {len(end_momenta)} slow trajectories of "
            "L_x = L_y = 0; I_max = I_e.",
            [
                reaching_node(f"{np.sum(left)} starts with L_z < 0", ends.distance[left]),
                Number(
                    "distance from the saddle where starts on the upper parabola end",
                    off_saddle,
                    Range.at_most(2e-3, "what is left of the approach at the end of the run"),
                    "I_max",
                ),
                reaching_pinch(pinch),
            ],
        )

    def draw(self, data: Data) -> Figure:
        """The plane with its bounds, fixed points and trajectories."""
        figure, (axes,) = panels(1, 1, 4.4)
        plane_drawing.draw_frame(axes, _BODY, -1.0, 1.0)
        # Arrows where E first falls below these heights, over I_max: by eye.
        plane_drawing.draw_paths(axes, data[""], (0.6, 0.2))
        names = {"stable node": "stable node (tumbling)", "saddle": "saddle (spinning)"}
        plane_drawing.name_points(axes, names)
        plane_drawing.name_lines(axes, _BODY, "$L_z^2 = 2EI_a$ and $L_z^2 = 2EI_e$")
        axes.set(ylim=(0.0, 0.8))
        key_of(axes)
        return figure


@dataclass(frozen=True)
class SpheroidPlanes(PlanesOfBodies):
    """Full and slow trajectories of spheroids of several aspect ratios."""

    def expected(self, differences: planes.Differences) -> list[Number]:
        """That the differences fall as St grows, and as κ approaches one."""
        low, high = planes.PLANE_STOKES
        ratios = [differences[low][name] / differences[high][name] for name in self.bodies]
        # Bodies have their κ as names.
        by_kappa = differences[low]
        return [
            Number(
                f"largest difference at St = {high:g}, worst body",
                max(differences[high].values()),
                Range(0.0, 0.02, "too small to see in the plane"),
                "I_max",
            ),
            Number(
                f"difference at St = {low:g} over that at {high:g}, smallest",
                min(ratios),
                Range(5.0, 20.0, "theory: ten, the ratio of the two St, to first order"),
            ),
            Number(
                f"difference of κ = 3.33 over that of 2, St = {low:g}",
                by_kappa[3.33] / by_kappa[2.0],
                Range(1.2, 10.0, "the claim: larger; ten would be more than its share of κ - 1"),
            ),
            Number(
                f"difference of κ = 0.3 over that of 0.5, St = {low:g}",
                by_kappa[0.3] / by_kappa[0.5],
                Range(1.0, 10.0, "the claim: larger; ten would be more than its share of 1 - κ"),
            ),
        ]


# Energies of the starts of the projections, over I_e. The first is the lower bound, L²/2I_e = 2/9. The
# others are about a quarter and three quarters of the way to the upper one, L²/2I_a = 5/9. The
# shares are estimates.
_ENERGIES = (2 / 9, 0.305, 0.472)
_PROJECTED_MOMENTUM = 2 / 3  # |L| of these starts, over I_e.
# Azimuths of L in degrees, from L_y to L_x, with their names in the figure. Paths of _BETWEEN are
# compared with the paths of 0 and 90 degrees, the limiting ones. The azimuths are a choice.
_AZIMUTHS = {0.0: "$L_{x0} = 0$", 45.0: "$L_{x0} = L_{y0}$", 90.0: "$L_{y0} = 0$"}
_BETWEEN = (15.0, 45.0, 75.0)


@dataclass(frozen=True)
class Projections(Experiment):
    """Slow trajectories with L in any direction, seen in two planes."""

    def compute(self, grid: Grid) -> Computed:
        """Slow trajectories from |L| = 2I_e/3, three energies, several directions of L.

        The table "" has the paths, with `cosine` for L_z/|L| at the start. "ends" has their distance
        from the node. "between" has how far a path lies outside the two limiting ones, in the plane of
        L_z and `across`: E, or Lxy = √(L_x² + L_y²). All are over I_max = I_e.
        """
        # A slow time of 1 is some 36 relaxation times I_e/(8πX_e), X_e being the resistance to rotation
        # about an equatorial axis. The cosines and the 1201 rows are estimates.
        slow_times = graded(1.0, 1201)
        cosines = grid.of((-0.95, -0.5, 0.1, 0.6, 0.95), (-0.6, 0.6))
        for energy, cosine in product(_ENERGIES, cosines):
            paths = {}
            for azimuth in sorted({*_AZIMUTHS, *_BETWEEN}):
                sine = sqrt(1 - cosine**2)
                angle = np.radians(azimuth)
                direction = np.array([sine * np.sin(angle), sine * np.cos(angle), cosine])
                start = (*(direction * _PROJECTED_MOMENTUM), energy)
                slow = slow_run(_BODY, start, slow_times).slow
                # L_xy; below, `across` is the name of either column.
                across = np.linalg.norm(slow[:, :2], axis=1)
                paths[azimuth] = {"Lz": slow[:, 2], "Lxy": across, "E": slow[:, 3]}
                labels = {"E0": energy, "cosine": cosine, "azimuth": azimuth}
                if azimuth in _AZIMUTHS:
                    yield "", {**labels, **_thinned(paths[azimuth])}
                distance = planes.distance_from_node(_BODY, slow[-1])
                yield "ends", {**labels, "distance": distance}
            for azimuth, across in product(_BETWEEN, ("E", "Lxy")):
                path, first, last = (
                    np.stack([paths[angle]["Lz"], paths[angle][across]], axis=1)
                    for angle in (azimuth, 0.0, 90.0)
                )
                row = {"azimuth": azimuth, "across": across, "outside": outside(path, first, last)}
                yield "between", row

    def judge(self, data: Data) -> Verdict:
        """Ends of all starts, and how far paths leave the limiting ones."""
        ends = data["ends"]
        between = data["between"]
        # How far paths lie outside the limiting ones at most, in the plane of L_z and each column.
        aside = {across: between.outside[between.across == across].max() for across in ("E", "Lxy")}
        tangents = joined(np.tan(np.radians(_BETWEEN)), ".2g")
        cosines = joined(np.unique(ends.cosine))
        return Verdict(
            Word.SHARPENED,
            "Every start ends at the node, whatever L_x0/L_y0 and the cone angle. In the L_z–E "
            f"plane the paths from L_x0/L_y0 = {tangents} lie between those of the limiting cases "
            f"but for {aside['E']:.1g} I_max at most, less than the width of a printed line; in "
            f"the plane of L_z and L_xy, for {aside['Lxy']:.1g} I_max. Neither bound is exact.",
            f"Slow trajectories of κ = 2 from |L| = 2I_e/3, L_z/|L| = {cosines}, at three energies "
            "(I_aη₀/L₀ grows).",
            [
                reaching_node(f"{len(ends)} starts", ends.distance),
                Number(
                    "farthest that a path lies outside the limiting ones in the L_z–E plane",
                    aside["E"],
                    Range(
                        1e-5, 2e-3, "more than the averaged run errs by, less than a line is wide"
                    ),
                    "I_max",
                ),
                Number(
                    "the same in the plane of L_z and L_xy",
                    aside["Lxy"],
                    Range(1e-3, 1e-2, "enough to be seen, and no more"),
                    "I_max",
                ),
            ],
        )

    def draw(self, data: Data) -> Figure:
        """Both planes at each of the energies, a row of panels for each energy."""
        table = data[""]
        figure, axes = panels(3, 2, 1.9)
        node = planes.fixed_point(_BODY, "stable node")
        places = product(np.unique(table.E0), ("E", "Lxy"))
        for panel, (energy, across) in zip(axes, places, strict=True):
            self._draw_plane(panel, table[energy == table.E0], energy, across, node)
        plane_drawing.name_points(axes[0], {"stable node": "stable node"})
        key_above(figure, axes[0])
        return figure

    def _draw_plane(
        self, axes: Axes, table: Table, energy: float, across: str, node: tuple[float, float]
    ) -> None:
        """One plane at one energy: of L_z and the column `across`, with the `node` in (L_z, E)."""
        axes.set_xlabel("$L_z/I_{max}$")
        if across == "E":
            # The lower bound of E, somewhat beyond the largest |L_z| of the starts, 0.95 of |L| = 2/3.
            momentum = np.linspace(-0.7, 0.7, 101)
            axes.plot(momentum, momentum**2 / 2, color=BOUND, linewidth=0.8)
            title = f"$E_0/I_e$ = {energy:.3f}"
            axes.set(title=title, ylabel="$E/I_{max}$", ylim=(0.0, 1.1 * energy))
        else:
            axes.set_ylabel(r"$\sqrt{L_x^2+L_y^2}/I_{max}$")
        for color, (azimuth, rows) in zip(
            (BLUE, BLACK, ORANGE), groups(table, "azimuth"), strict=True
        ):
            style: dict[str, Any] = {"color": color, "linewidth": 0.8, "label": _AZIMUTHS[azimuth]}
            draw_broken(axes, rows.Lz, rows[across], rows.cosine, **style)
        # At the node L is along the vorticity: L_xy = 0.
        place = (node[0], node[1] if across == "E" else 0.0)
        plane_drawing.draw_point(axes, "stable node", place)


def outside(inner: np.ndarray, first: np.ndarray, last: np.ndarray) -> float:
    """Farthest that a path lies outside what two others with the same ends enclose.

    Each path has its points in a plane, shape (n, 2). The result is 0 if all points lie inside.
    """
    # Out along the one path and back along the other.
    edge = np.concatenate([first, last[::-1]])
    beyond = inner[~Outline(edge).contains_points(inner)]
    return float(planes.distances(beyond, edge).max(initial=0.0))


# Ratios of L_xy to |L_z| of the starts of the L–E planes. A choice.
_RATIOS = (0.1, 1.0, 10.0)


@dataclass(frozen=True)
class LPlanes(Experiment):
    """Slow trajectories in the plane of |L| and E."""

    def compute(self, grid: Grid) -> Computed:
        """Slow trajectories with L_x = 0 or L_y = 0 and several ratios of L_xy to L_z, of either sign.

        They start with |L| = I_e.
        `zero` is the place of the component that is zero: 0 for L_x, 1 for L_y. `energy_at` says
        what a `share` is. The table "" has the paths, with `ratio` for L_xy/L_z at the start. "ends"
        has the distance of their ends from the node, and the `smallest` |L| on the way, over I_max.
        """
        # A slow time of 1 is some 36 relaxation times, as in `Projections`. The shares and the 1201 rows
        # are estimates.
        slow_times = graded(1.0, 1201)
        shares = grid.of((0.05, 0.3, 0.6, 0.9), (0.3, 0.9))
        starts = product((0, 1), _RATIOS, (-1.0, 1.0), shares)
        for index, (zero, ratio, sign, share) in enumerate(starts):
            start = np.zeros(4)
            start[1 - zero] = ratio / sqrt(1 + ratio**2)
            start[2] = sign / sqrt(1 + ratio**2)
            start[3] = planes.energy_at(_BODY, 1.0, share)
            slow = slow_run(_BODY, start.tolist(), slow_times).slow
            momentum = np.linalg.norm(slow[:, :3], axis=1)
            labels = {"zero": zero, "ratio": sign * ratio}
            yield "", {**labels, "path": index, **_thinned({"L": momentum, "E": slow[:, 3]})}
            distance = planes.distance_from_node(_BODY, slow[-1])
            row = {"share": share, "distance": distance, "smallest": momentum.min()}
            yield "ends", {**labels, **row}

    def judge(self, data: Data) -> Verdict:
        """Ends of all starts."""
        ends = data["ends"]
        return Verdict(
            Word.SHARPENED,
            "Whatever the ratio of L_xy to L_z, its sign, and which of L_x and L_y is zero, every "
            "slow trajectory ends at the node: those with L_z > 0 pass the neighbourhood of L = 0 "
            "and come back. Only the ends were compared, not saddles or manifolds; the smallest "
            f"|L| on the way is {ends.smallest.min():.2g} I_max.",
            "L–E planes of κ = 2, E as its share between L²/2I_e and L²/2I_a, from |L| = I_e with "
            "L_x = 0 (left) and L_y = 0 (right); starts with L_z < 0 above, with L_z > 0 below; "
            "colours: L_xy/|L_z|; circles: starts.",
            [
                reaching_node(f"{len(ends)} starts", ends.distance),
                Number(
                    "largest distance at the end",
                    ends.distance.max(),
                    Range.at_most(planes.REACHED, "the distance that counts as reached"),
                    "I_max",
                ),
            ],
        )

    def draw(self, data: Data) -> Figure:
        """A plane for each sign of L_z and each component that is zero."""
        table = data[""]
        figure, axes = panels(2, 2, 2.1)
        for panel, (sign, zero) in zip(axes, product((-1.0, 1.0), (0, 1)), strict=True):
            rows = table[(table.zero == zero) & (np.sign(table.ratio) == sign)]
            # The first row of each path.
            starts = rows[np.unique(rows.path, return_index=True)[1]]
            starts_by_ratio = by(starts, "ratio")
            for color, (ratio, part) in zip(CYCLE, groups(rows, "ratio"), strict=False):
                label = f"$L_{{xy}}/|L_z|$ = {abs(ratio):g}"
                style: dict[str, Any] = {"color": color, "linewidth": 1.1, "label": label}
                draw_broken(panel, part.L, share_of(part.E, part.L), part.path, **style)
                start = starts_by_ratio[ratio]
                panel.plot(start.L, share_of(start.E, start.L), "o", color=color, markersize=3)
            for point in fixed_points(_BODY):
                along, height = planes.place_of(_BODY, point)
                share = float(share_of(np.array(height), np.array(along)))
                plane_drawing.draw_point(panel, point.stability, (abs(along), share))
            panel.set(
                xlabel="$|L|/I_{max}$",
                ylabel="E, share between bounds",
                title=f"$L_{'xy'[zero]} = 0$, from $L_z {'>' if sign > 0 else '<'} 0$",
                xlim=(0.0, 1.02),
                ylim=(-0.05, 1.05),
            )
        plane_drawing.name_points(axes[0], {"stable node": "stable node", "saddle": "saddle"})
        key_above(figure, axes[0])
        return figure


def share_of(energy: np.ndarray, momentum: np.ndarray) -> np.ndarray:
    """E as its share between the bounds, from E and |L| over I_max: the inverse of `energy_at`."""
    return (2 * energy / momentum**2 - 1) / (max(_BODY.inertia) / min(_BODY.inertia) - 1)


def _thinned(values: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """A path, its columns by name, at even steps in all of them: 90 points draw it smoothly."""
    index = planes.even_steps(np.stack(list(values.values()), axis=1), 90)
    return {name: column[index] for name, column in values.items()}


# Ranges of the error at St = 100 over the largest change of a slow variable.
_ACCURATE_AT_100 = Range(0.0, ACCURATE, "the claim: accurate for St ≳ 100")
_INACCURATE_AT_100 = Range(
    ACCURATE, 1.5, "the correction: not accurate at 100, by a factor below three"
)

# Slow times, 0.5 and 1, are long enough to end at the node. The second start lingers at the saddle:
# the errors of its full runs follow a power law only from St = 5000 on. "constant" is judged at the
# largest St, where the error times St is 36 and 46 I_max.
SPHEROIDS_SECTION = Section(
    "spheroids",
    "Spheroids at large St",
    (
        Item(
            "spheroid-slow-1",
            "Slow variables of a spheroid, first start",
            "lsds",
            "The slow solution predicts the full one accurately for St ≳ 100, and on average even "
            "at St = 50; the oscillation about it shrinks with growing St; all end at "
            "L_z = -I_e/2, E = I_e/8.",
            SlowMotion(
                _BODY,
                SPHEROID_START,
                0.5,
                constant=Range(20.0, 60.0, order_of_damping(_BODY)),
                relative=_ACCURATE_AT_100,
            ),
        ),
        Item(
            "spheroid-slow-2",
            "Slow variables of a spheroid, start near the saddle's stable manifold",
            "lsds",
            "The same accuracy for St ≳ 100, with an intermediate plateau while the run lingers "
            "near the spinning mode.",
            SlowMotion(
                _BODY,
                NEAR_POLE_START,
                1.0,
                word=Word.CORRECTED,
                fitted_from=5e3,
                constant=Range(20.0, 90.0, order_of_damping(_BODY)),
                relative=_INACCURATE_AT_100,
                plateau=True,
            ),
        ),
        Item(
            "spheroid-plane",
            "The L_z–E plane of a spheroid",
            "lsds, the phase plane",
            "With L_x = L_y = 0 and L_z < 0 almost all slow trajectories converge to the tumbling "
            "node of κ = 2; the upper parabola is the stable manifold of the saddle, which the "
            "caption puts at (-1/2, 1/8); from L_z > 0 they grind to a halt at the pinch point.",
            Plane(),
        ),
        Item(
            "spheroid-planes",
            "Full and slow trajectories of four spheroids",
            "lsds, the phase planes",
            "For a given St the deviation from the slow trajectories decreases as κ approaches "
            "one, and with growing St; κ = 3.33 at St = 1000 shows the largest oscillations.",
            # With 201 points of each trajectory, enough to draw it.
            SpheroidPlanes(tuple((kappa, spheroid(kappa)) for kappa in (2.0, 3.33, 0.5, 0.3)), 201),
        ),
        Item(
            "spheroid-projections",
            "Projections for finite L_x and L_y",
            "lsds, the projections",
            "From |L| = 2I_e/3 all slow trajectories end at the node, whatever L_x0/L_y0 and the "
            "cone angle; in the L_z–E plane each is bounded by the limiting cases L_x = 0 and "
            "L_y = 0.",
            Projections(),
        ),
        Item(
            "spheroid-l-planes",
            "The L–E planes",
            "lsds, the L–E planes",
            "The topology in the L–E plane does not depend on L_xy/L_z, nor on which of L_x and "
            "L_y is zero.",
            LPlanes(),
        ),
    ),
)
