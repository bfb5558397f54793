"""The L_z–E planes of spheroids and of ellipsoids; L–E planes of a spheroid, and projections for finite L_x and L_y."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import product
from math import sqrt

import numpy as np
from matplotlib.path import Path as Outline

from polhode.harness.paper import planes
from polhode.harness.paper.item import Computed, Grid
from polhode.harness.paper.runs import axes_of, full_run, graded, slow_run, spheroid
from polhode.harness.paper.tables import path
from polhode.models.shape import Ellipsoid

# Share, as of `energy_at`, of starts on the upper parabola: rounding must not carry them out of the
# plane.
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
        run = planes.plane_path(
            body, momentum, planes.energy_at(body, momentum, min(share, INSIDE)), times
        )
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
        for (name, body), (number, (momentum, theta)) in product(
            self.bodies.items(), enumerate(STARTS)
        ):
            # Eight relaxation times of the slowest rotation.
            slow_times = graded(8.0 / min(body.damping), 4 * (points - 1) + 1)
            slow = planes.aligned_scene(body, 1.0, momentum, theta, 1.0).initial.slow[0] / max(
                body.inertia
            )
            averaged = planes.plane_path(body, momentum, float(slow[3]), slow_times).slow
            before = averaged[:, 2] < 0 if momentum < 0 else averaged[:, 2] > planes.ABOVE_PINCH
            labels = {"body": name, "path": number}
            yield "", {**labels, "stokes": np.inf, "Lz": averaged[::4, 2], "E": averaged[::4, 3]}
            for stokes in STOKES:
                scene = planes.aligned_scene(body, stokes, momentum, theta, float(slow_times[-1]))
                full = full_run(scene, stokes * slow_times).slow
                yield "", {**labels, "stokes": stokes, "Lz": full[::4, 2], "E": full[::4, 3]}
                difference = np.abs(full[: len(averaged)][before] - averaged[before])
                yield (
                    "differences",
                    {
                        "body": name,
                        "stokes": stokes,
                        "path": number,
                        "difference": difference.max(),
                    },
                )


def name_of(body: Ellipsoid) -> str:
    """A body as the pages write it."""
    return axes_of(body) if body.kind == "triaxial" else f"κ = {body.semi_axes[2]:g}"


BODY = spheroid(2.0)
RATIOS = (0.1, 1.0, 10.0)


def compute_l_planes(grid: Grid) -> Computed:
    """Slow trajectories with L_x = 0 or L_y = 0 and several ratios of L_xy to L_z, of either sign."""
    slow_times = graded(1.0, 1201)
    shares = grid.of((0.05, 0.3, 0.6, 0.9), (0.3, 0.9))
    for index, (zero, ratio, sign, share) in enumerate(
        product((0, 1), RATIOS, (-1.0, 1.0), shares)
    ):
        start = np.array([0.0, 0.0, sign / sqrt(1 + ratio**2), planes.energy_at(BODY, 1.0, share)])
        start[1 - zero] = ratio / sqrt(1 + ratio**2)
        slow = slow_run(BODY, start.tolist(), slow_times).slow
        momentum, labels = (
            np.linalg.norm(slow[:, :3], axis=1),
            {"zero": zero, "ratio": sign * ratio},
        )
        yield "", {**labels, "path": index, **_thinned({"L": momentum, "E": slow[:, 3]})}
        distance = planes.distance_from_node(BODY, slow[-1])
        yield "ends", {**labels, "share": share, "distance": distance, "smallest": momentum.min()}


def share_of(energy: np.ndarray, momentum: np.ndarray) -> np.ndarray:
    """E as its share between the bounds, the inverse of `energy_at`."""
    return (2 * energy / momentum**2 - 1) / (max(BODY.inertia) / min(BODY.inertia) - 1)


def _thinned(values: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """A path at even steps, so that few points draw it smoothly."""
    index = planes.even_steps(np.stack(list(values.values()), axis=1), 90)
    return {name: column[index] for name, column in values.items()}


ENERGIES = (2 / 9, 0.305, 0.472)
MOMENTUM = 2 / 3
# Azimuths of L that the figure shows, and those whose path is held against the two limiting ones.
AZIMUTHS = {0.0: "$L_{x0} = 0$", 45.0: "$L_{x0} = L_{y0}$", 90.0: "$L_{y0} = 0$"}
BETWEEN = (15.0, 45.0, 75.0)


def compute_projections(grid: Grid) -> Computed:
    """Slow trajectories from |L| = 2I_e/3, three energies, all directions of L."""
    slow_times = graded(1.0, 1201)
    for energy, cosine in product(ENERGIES, grid.of((-0.95, -0.5, 0.1, 0.6, 0.95), (-0.6, 0.6))):
        found = {}
        for azimuth in sorted({*AZIMUTHS, *BETWEEN}):
            sine, angle = sqrt(1 - cosine**2), np.radians(azimuth)
            direction = np.array([sine * np.sin(angle), sine * np.cos(angle), cosine]) * MOMENTUM
            slow = slow_run(BODY, (*direction, energy), slow_times).slow
            labels = {"E0": energy, "cosine": cosine, "azimuth": azimuth}
            found[azimuth] = {
                "Lz": slow[:, 2],
                "Lxy": np.linalg.norm(slow[:, :2], axis=1),
                "E": slow[:, 3],
            }
            if azimuth in AZIMUTHS:
                yield "", {**labels, **_thinned(found[azimuth])}
            yield "ends", {**labels, "distance": planes.distance_from_node(BODY, slow[-1])}
        for azimuth, across in product(BETWEEN, ("E", "Lxy")):
            sides = [
                np.stack([found[each]["Lz"], found[each][across]], axis=1)
                for each in (azimuth, 0.0, 90.0)
            ]
            yield "between", {"azimuth": azimuth, "across": across, "outside": outside(*sides)}


def outside(inner: np.ndarray, first: np.ndarray, last: np.ndarray) -> float:
    """Farthest that a path lies outside what two others with the same ends enclose; points of a plane, shape (n, 2)."""
    edge = np.concatenate([first, last[::-1]])
    ways = inner[~Outline(edge).contains_points(inner)][:, None] - edge[:-1]
    along = np.diff(edge, axis=0)
    share = np.sum(ways * along, axis=-1) / np.maximum(
        np.sum(along**2, axis=-1), np.finfo(float).tiny
    )
    apart = np.linalg.norm(ways - share.clip(0.0, 1.0)[..., None] * along, axis=-1)
    return float(apart.min(axis=-1).max(initial=0.0))


ON_EDGE = 0.16


def compute_plane(grid: Grid) -> Computed:
    """Slow trajectories from both edges of the plane, and from close to the pinch point."""
    shares = (0.001, 0.05, 0.15, 0.3, 0.5, 0.7, 0.85, 0.95, 0.999)
    starts = [
        (momentum, share) for momentum in (-1.1, -0.06, 1.1) for share in shares[:: grid.of(1, 4)]
    ]
    starts += [(-1.1, 1.0), (-0.06, 1.0)]
    return plane_tables(
        BODY, starts, grid.of(2001, 601), ON_EDGE, partial(planes.plane_steps, count=150)
    )
