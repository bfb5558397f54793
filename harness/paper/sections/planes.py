"""The L_z–E planes of spheroids and of ellipsoids: slow trajectories, and full ones beside them.

With L along the vorticity, L_x = L_y = 0, the averaged equations keep it there. So their trajectories
lie in the plane of L_z and E. In it E is between L_z²/2I_max, the lower parabola, and
L_z²/2I_min, the upper one. A trajectory with L_z > 0 ends in the pinch point L = 0, one with L_z < 0
in a fixed point, nearly always the stable node. The node is on the lower parabola, the saddle on
the upper one.
`polhode.harness.paper.planes` computes paths, `plane_drawing` draws them.

In figures, heights of panels are in inches, and widths of lines and sizes of marks and letters in
points. They and the limits of axes are chosen by eye.

Ends of the ranges for which a verdict holds are estimates where their reasons do not give them.
"""

from abc import abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from polhode.harness.pages.figures.style import BLUE
from polhode.harness.paper import plane_drawing, planes
from polhode.harness.paper.drawing import AVERAGED, draw_broken, key_above, panels
from polhode.harness.paper.item import (
    Computed,
    Data,
    Experiment,
    Grid,
    Number,
    Range,
    Table,
    Verdict,
    Word,
)
from polhode.harness.paper.planes import PLANE_STOKES, Differences
from polhode.harness.paper.runs import axes_of, full_run, graded
from polhode.harness.paper.tables import by, groups, path
from polhode.models.shape import Ellipsoid
from polhode.models.theory.fixed_points import fixed_points

# Share, as of `energy_at`, of starts on the upper parabola: rounding must not carry them out of the
# plane. An estimate: hundreds of roundings of E.
_INSIDE = 1 - 1e-13
# L_z/I_max and θ₀, in rad, of the starts of the planes. L_z lies on both sides of the pinch point, and
# beyond the fixed points of L_z < 0, the farthest of which is at -0.5. θ₀ sets E between its bounds.
# The values are estimates.
_STARTS = tuple(product((-0.7, 0.7), (0.4, 0.9, 1.4)))


def reaching_node(starts: str, distances: np.ndarray) -> Number:
    """The share of starts, named in words, that reach the node, from the distances where they end."""
    return Number(
        f"share of the {starts} that reach the node",
        float(np.mean(distances < planes.REACHED)),
        Range(1.0, 1.0, "the claim: all of them"),
        measure="a grid of starts, not of random ones",
    )


def reaching_pinch(longest: float) -> Number:
    """The longest slow time to the pinch point, over L_z/(4π min X)."""
    return Number(
        "slow time to the pinch point from L_z > 0, over L_z/(4π min X), longest",
        longest,
        Range(0.0, 1.0, "no torque along L is weaker than that of the smallest X"),
    )


def plane_tables(
    body: Ellipsoid,
    starts: Sequence[tuple[float, float]],
    points: int,
    on_edge: float,
    chosen: Callable[[np.ndarray], np.ndarray],
) -> Computed:
    """Slow trajectories from L_z/I_max and shares as of `energy_at`, and where they end.

    Each has `points` rows up to a slow time of 1, some 25 relaxation times I/(8πX) or more. The table
    "" has those rows whose indices `chosen` gives from the slow variables, shape (n, 4). A trajectory
    on the upper parabola, share 1, is followed up to the slow time `on_edge`: later, rounding carries
    it off. The table "ends" has the `distance` of each end from the node over I_max, the slow time of
    the `end`, and for L_z > 0 its `bound`.
    """
    slow_times = graded(1.0, points)
    for number, (momentum, share) in enumerate(starts):
        times = slow_times[slow_times <= on_edge] if share == 1.0 else slow_times
        energy = planes.energy_at(body, momentum, min(share, _INSIDE))
        run, end = planes.plane_path_and_end(body, momentum, energy, times)
        index = chosen(run.slow)
        yield "", path(number, run.times[index], run.slow[index], ("Lz", "E"))
        last = planes.distance_from_node(body, run.slow[-1])
        # The flow's vorticity drives the body to -½ about z, and its strain has no mean torque along z.
        # While L_z > 0 it falls by 4π min X or more per slow time, and is 0 by L_z/(4π min X).
        bound = momentum * max(body.inertia) / (4 * np.pi * min(body.resistance))
        ends = {"distance": last, "end": end, "bound": bound}
        yield "ends", {"path": number, "Lz0": momentum, "share": share, **ends}


def name_of(body: Ellipsoid) -> str:
    """A body as the pages write it."""
    return axes_of(body) if body.kind == "triaxial" else f"κ = {body.semi_axes[2]:g}"


@dataclass(frozen=True)
class PlanesOfBodies(Experiment):
    """Slow and full trajectories of several bodies.

    Tables: "" has the trajectories, ∞ being the St of slow ones. "differences" has the largest
    difference of each full trajectory from the slow one in any of the slow variables. All are over
    I_max.
    """

    named: tuple[tuple[float, Ellipsoid], ...]  # Bodies, each after its number in the tables.
    points: int  # Of each trajectory that is drawn. Differences are taken at four times as many.

    @property
    def bodies(self) -> dict[float, Ellipsoid]:
        """The bodies by the numbers that name them."""
        return dict(self.named)

    def compute(self, grid: Grid) -> Computed:
        """Trajectories, and the largest differences.

        With L_z > 0 at the start these count while L_z is above `planes.ABOVE_PINCH`.
        """
        points = grid.of(self.points, 101)
        for (name, body), (number, (momentum, theta)) in product(
            self.bodies.items(), enumerate(_STARTS)
        ):
            # Eight relaxation times of the slowest rotation, by estimate: e⁻⁸ of it is left.
            slow_times = graded(8.0 / min(body.damping), 4 * (points - 1) + 1)
            # Only the start of this scene is used: St and slow time do not matter.
            aligned = planes.aligned_scene(body, 1.0, momentum, theta, 1.0)
            energy = float(aligned.initial.slow[0, 3] / max(body.inertia))
            averaged = planes.plane_path(body, momentum, energy, slow_times).slow
            before = averaged[:, 2] < 0 if momentum < 0 else averaged[:, 2] > planes.ABOVE_PINCH
            labels = {"body": name, "path": number}
            # Every fourth row is one of the `points`.
            yield "", {**labels, "stokes": np.inf, "Lz": averaged[::4, 2], "E": averaged[::4, 3]}
            for stokes in PLANE_STOKES:
                scene = planes.aligned_scene(body, stokes, momentum, theta, float(slow_times[-1]))
                full = full_run(scene, stokes * slow_times).slow
                yield "", {**labels, "stokes": stokes, "Lz": full[::4, 2], "E": full[::4, 3]}
                difference = np.abs(full[: len(averaged)][before] - averaged[before]).max()
                yield "differences", {**labels, "stokes": stokes, "difference": difference}

    @abstractmethod
    def expected(self, differences: Differences) -> list[Number]:
        """Numbers of a claim about the largest difference of each body at each St."""

    def judge(self, data: Data) -> Verdict:
        """How the largest differences depend on St and on the body."""
        low, high = PLANE_STOKES
        worst = _largest(data)
        named = ", ".join(
            f"{worst[low][name]:.2g} ({name_of(body).strip('()')})"
            for name, body in self.bodies.items()
        )
        ratios = [worst[low][name] / worst[high][name] for name in self.bodies]
        starts = ", ".join(f"({momentum:g}, {theta:g})" for momentum, theta in _STARTS)
        return Verdict(
            Word.SHARPENED,
            f"At St = {low:g} the largest difference is up to {max(worst[low].values()):.2g} "
            f"I_max: {named}; at St = {high:g} it is smaller by a factor of {min(ratios):.2g} to "
            f"{max(ratios):.2g}.",
            "Above: slow (black) and full (blue) trajectories of the body with the largest "
            f"difference, from (L_z0/I_max, θ₀) = {starts}, ψ₀ = π/2, with L along the vorticity; "
            "below: the largest difference of each start of every body. Those of starts with "
            f"L_z > 0 count as far as L_z = {planes.ABOVE_PINCH:g} I_max; slow trajectories end at "
            "the pinch point.",
            self.expected(worst),
        )

    def draw(self, data: Data) -> Figure:
        """Planes of the body with the largest difference; bars of all differences."""
        worst = _largest(data)
        # The body with the largest difference at the smaller St.
        low = PLANE_STOKES[0]
        name = max(worst[low], key=worst[low].__getitem__)
        body = self.bodies[name]
        table = data[""][data[""].body == name]
        slow = table[np.isinf(table.stokes)]
        figure, axes = panels(2, 2, 2.1)
        for panel, stokes in zip(axes[:2], PLANE_STOKES, strict=True):
            # Somewhat beyond the starts at ±0.7.
            plane_drawing.draw_frame(panel, body, -0.8, 0.8)
            full = table[table.stokes == stokes]
            style: dict[str, Any] = {"linewidth": 0.9}
            draw_broken(panel, full.Lz, full.E, full.path, color=BLUE, label="full", **style)
            draw_broken(
                panel, slow.Lz, slow.E, slow.path, color=AVERAGED, label="averaged", **style
            )
            title = f"{name_of(body)}, St = {stokes:g}"
            panel.set(title=title, ylim=(0.0, 1.05 * max(table.E)))
        points = {
            point.stability: plane_drawing.POINTS[point.stability] for point in fixed_points(body)
        }
        plane_drawing.name_points(axes[0], points)
        plane_drawing.name_lines(axes[0], body, "bounds of $L_z^2/2E$")
        differences = by(data["differences"], "stokes")
        for panel, stokes in zip(axes[2:], PLANE_STOKES, strict=True):
            self._draw_differences(panel, differences[stokes])
            panel.set_title(f"St = {stokes:g}")
        key_above(figure, axes[0])
        return figure

    def _draw_differences(self, axes: Axes, differences: Table) -> None:
        """A group of bars for each body, one for each start."""
        for place, (_, rows) in enumerate(groups(differences, "body")):
            # Bodies are 1 apart. The bars of one, each 0.1 wide, take 0.7 of that.
            offsets = np.linspace(-0.3, 0.3, len(rows))
            axes.bar(place + offsets, rows.difference, 0.1, color=BLUE)
        names = [name_of(body) for body in self.bodies.values()]
        axes.set_xticks(range(len(names)), names, fontsize=8.5, rotation=30, ha="right")
        axes.set(xlabel="body, one bar per start", ylabel="largest difference$/I_{max}$")


def _largest(data: Data) -> Differences:
    """The largest difference by St and body."""
    return {
        stokes: {name: float(np.max(rows.difference)) for name, rows in groups(part, "body")}
        for stokes, part in groups(data["differences"], "stokes")
    }
