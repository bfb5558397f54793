"""Slow motion of a spheroid: the L_z–E plane, L–E planes, and projections for finite L_x and L_y."""

from functools import partial
from itertools import product
from math import sqrt

import numpy as np

from polhode.harness.paper import planes
from polhode.harness.paper.item import Computed, Grid
from polhode.harness.paper.runs import graded, slow_run, spheroid
from polhode.harness.paper.sections.planes import plane_tables

BODY = spheroid(2.0)
RATIOS = (0.1, 1.0, 10.0)


def compute_l_planes(grid: Grid) -> Computed:
    """Slow trajectories with L_x = 0 or L_y = 0 and several ratios of L_xy to L_z, of either sign."""
    slow_times = graded(1.0, 1201)
    shares = grid.of((0.05, 0.3, 0.6, 0.9), (0.3, 0.9))
    for path, (zero, ratio, sign, share) in enumerate(product((0, 1), RATIOS, (-1.0, 1.0), shares)):
        start = np.array([0.0, 0.0, sign / sqrt(1 + ratio**2), planes.energy_at(BODY, 1.0, share)])
        start[1 - zero] = ratio / sqrt(1 + ratio**2)
        slow = slow_run(BODY, start.tolist(), slow_times).slow
        momentum, labels = np.linalg.norm(slow[:, :3], axis=1), {"zero": zero, "ratio": sign * ratio}
        yield "", {**labels, "path": path, **_thinned({"L": momentum, "E": slow[:, 3]})}
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
AZIMUTHS = {0.0: "$L_{x0} = 0$", 45.0: "$L_{x0} = L_{y0}$", 90.0: "$L_{y0} = 0$"}


def compute_projections(grid: Grid) -> Computed:
    """Slow trajectories from |L| = 2I_e/3, three energies, all directions of L."""
    slow_times = graded(1.0, 1201)
    for number, (energy, cosine) in enumerate(product(ENERGIES, grid.of((-0.95, -0.5, 0.1, 0.6, 0.95), (-0.6, 0.6)))):
        found = []
        for path, azimuth in enumerate(AZIMUTHS, start=len(AZIMUTHS) * number):
            sine, angle = sqrt(1 - cosine**2), np.radians(azimuth)
            direction = np.array([sine * np.sin(angle), sine * np.cos(angle), cosine]) * MOMENTUM
            slow = slow_run(BODY, (*direction, energy), slow_times).slow
            found.append(np.linalg.norm(slow[:, :2], axis=1))
            values = {"Lz": slow[:, 2], "Lxy": found[-1], "E": slow[:, 3]}
            yield "", {"E0": energy, "azimuth": azimuth, "path": path, **_thinned(values)}
            distance = planes.distance_from_node(BODY, slow[-1])
            yield "ends", {"E0": energy, "cosine": cosine, "azimuth": azimuth, "distance": distance}
        low, middle, high = found
        outside = np.maximum(np.minimum(low, high) - middle, middle - np.maximum(low, high))
        # Up to rounding.
        share = np.mean(outside <= 1e-9)
        yield "between", {"E0": energy, "cosine": cosine, "share": share, "outside": outside.max()}


ON_EDGE = 0.16


def compute_plane(grid: Grid) -> Computed:
    """Slow trajectories from both edges of the plane, and from close to the pinch point."""
    shares = (0.001, 0.05, 0.15, 0.3, 0.5, 0.7, 0.85, 0.95, 0.999)
    starts = [(momentum, share) for momentum in (-1.1, -0.06, 1.1) for share in shares[:: grid.of(1, 4)]]
    starts += [(-1.1, 1.0), (-0.06, 1.0)]
    return plane_tables(BODY, starts, grid.of(2001, 601), ON_EDGE, partial(planes.plane_steps, count=150))
