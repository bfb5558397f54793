"""The L_z–E planes of spheroids and of ellipsoids: slow trajectories in one, slow and full ones in several."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from polhode.harness.paper import planes
from polhode.harness.paper.item import Computed, Grid
from polhode.harness.paper.runs import axes_of, full_run, graded
from polhode.harness.paper.tables import path
from polhode.models.shape import Ellipsoid

# Share, as of `energy_at`, of starts on the upper parabola: rounding must not carry them out of the plane.
INSIDE = 1 - 1e-13
STOKES = (1e3, 1e4)
STARTS = tuple((momentum, theta) for momentum in (-0.7, 0.7) for theta in (0.4, 0.9, 1.4))


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


def name_of(body: Ellipsoid) -> str:
    """A body as the pages write it."""
    return axes_of(body) if body.kind == "triaxial" else f"κ = {body.semi_axes[2]:g}"
