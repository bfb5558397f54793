"""The L_z–E planes of spheroids and of ellipsoids: slow trajectories in one, slow and full ones in several."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from matplotlib.figure import Figure

from polhode.harness.paper import planes
from polhode.harness.paper.drawing import AVERAGED, BLUE, common_legend, draw_broken, label, panels
from polhode.harness.paper.item import Computed, Data, Grid
from polhode.harness.paper.runs import axes_of, full_run, graded
from polhode.harness.paper.tables import by, groups, path
from polhode.models.shape import Ellipsoid
from polhode.models.theory.fixed_points import fixed_points

# Share, as of `energy_at`, of starts on the upper parabola: rounding must not carry them out of the plane.
INSIDE = 1 - 1e-13
STOKES = (1e3, 1e4)
STARTS = tuple((momentum, theta) for momentum in (-0.7, 0.7) for theta in (0.4, 0.9, 1.4))
POINTS = {"stable node": "stable node", "saddle": "saddle", "singular": "singular point"}


def plane_tables(
    body: Ellipsoid,
    starts: Sequence[tuple[float, float]],
    points: int,
    on_edge: float,
    kept: Callable[[np.ndarray], np.ndarray],
) -> Computed:
    """Slow trajectories from L_z/I_max and shares as of `energy_at`, thinned to the points kept, and where they end."""
    slow_times = graded(1.0, points)
    for number, (momentum, share) in enumerate(starts):
        # From the upper parabola, before rounding carries them off.
        times = slow_times[slow_times <= on_edge] if share == 1.0 else slow_times
        run = planes.plane_path(body, momentum, planes.energy_at(body, momentum, min(share, INSIDE)), times)
        chosen = kept(run.slow)
        yield "", path(number, run.times[chosen], run.slow[chosen], ("Lz", "E"))
        last = planes.distance_from_node(body, run.slow[-1])
        # By L_z/(4π min X) a trajectory with L_z > 0 has reached the pinch point.
        bound = momentum * max(body.inertia) / (4 * np.pi * min(body.resistance))
        ends = {"distance": last, "end": run.times[-1], "bound": bound}
        yield "ends", {"path": number, "Lz0": momentum, "share": share, **ends}


@dataclass(frozen=True)
class Planes:
    """Slow and full trajectories of several bodies, by the numbers that name them in the tables."""

    bodies: Mapping[float, Ellipsoid]
    points: int
    # Pairs of bodies of which the first differs more at the smallest St.
    orders: tuple[tuple[tuple[float, float], ...], ...]

    def compute(self, grid: Grid) -> Computed:
        """Trajectories, and the largest differences, while L_z of a start with L_z > 0 is above the pinch point."""
        points = grid.of(self.points, 101)
        for (name, body), (number, (momentum, theta)) in product(self.bodies.items(), enumerate(STARTS)):
            # Eight relaxation times of the slowest rotation.
            slow_times = graded(8.0 / min(body.damping), 4 * (points - 1) + 1)
            slow = planes.aligned_scene(body, 1.0, momentum, theta, 1.0).initial.slow[0] / max(body.inertia)
            averaged = planes.plane_path(body, momentum, float(slow[3]), slow_times).slow
            before = averaged[:, 2] < 0 if momentum < 0 else averaged[:, 2] > planes.ABOVE_PINCH
            labels = {"body": name, "path": number}
            yield "", {**labels, "stokes": np.inf, "Lz": averaged[::4, 2], "E": averaged[::4, 3]}
            for stokes in STOKES:
                scene = planes.aligned_scene(body, stokes, momentum, theta, float(slow_times[-1]))
                full = full_run(scene, stokes * slow_times).slow
                yield "", {**labels, "stokes": stokes, "Lz": full[::4, 2], "E": full[::4, 3]}
                difference = np.abs(full[: len(averaged)][before] - averaged[before])
                yield "differences", {"body": name, "stokes": stokes, "path": number, "difference": difference.max()}

    def figure(self, data: Data) -> Figure:
        """A plane of the most eccentric body; below, the largest differences of all bodies, one bar per start."""
        figure, axes = panels(2, len(STOKES), 4.4, 2.9)
        differences = by(data["differences"], "stokes")
        worst = {name: np.max(part.difference) for name, part in groups(differences[STOKES[0]], "body")}
        widest = max(worst, key=lambda name: worst[name])
        part, first = by(data[""], "body")[widest], self.bodies[widest]
        for own, stokes in zip(axes, STOKES, strict=False):
            planes.draw_frame(own, first, -0.8, 0.8, title=f"{name_of(first)}, St = {stokes:g}")
            for wanted, color, text in ((stokes, BLUE, "full"), (np.inf, AVERAGED, "averaged")):
                draw_broken(own, part[part.stokes == wanted], "Lz", "E", linewidth=0.9, color=color, label=text)
            own.set_ylim(0.0, 1.05 * max(part.E))
        for own, stokes in zip(axes[len(STOKES) :], STOKES, strict=True):
            for place, (_, found) in enumerate(groups(differences[stokes], "body")):
                own.bar(place + np.linspace(-0.3, 0.3, len(found)), found.difference, 0.1, color=BLUE)
            own.set_xticks(range(len(self.bodies)), [*map(name_of, self.bodies.values())], fontsize=6.5, rotation=15)
            label(own, "body, one bar per start", "largest difference$/I_{max}$", f"St = {stokes:g}")
        planes.name_points(axes[0], {point.stability: POINTS[point.stability] for point in fixed_points(first)})
        planes.name_lines(axes[0], first, "bounds of $L_z^2/2E$")
        common_legend(figure, axes[0])
        return figure


def name_of(body: Ellipsoid) -> str:
    """A body as the pages write it."""
    return axes_of(body) if body.kind == "triaxial" else f"κ = {body.semi_axes[2]:g}"
