"""Common parts of the L_z–E phase planes: slow trajectories with L along the vorticity, and fixed points."""

import numpy as np

from polhode.harness.paper.runs import Run, slow_run, slow_run_to_pinch
from polhode.models.scene import Scene
from polhode.models.scenes import aligned_start
from polhode.models.shape import Ellipsoid
from polhode.models.theory.fixed_points import FixedPoint, Stability, fixed_points

# St of the full trajectories in the planes, the smaller one first.
PLANE_STOKES = (1e3, 1e4)
Differences = dict[float, dict[float, float]]
"""Largest differences by St and by the number that names a body."""
# L_z/I_max above which a trajectory with L_z > 0 counts as away from the pinch point.
ABOVE_PINCH = 0.2
# Distance from the node, over I_max, at which a trajectory has reached it.
REACHED = 1e-2


def plane_path(ellipsoid: Ellipsoid, momentum: float, energy: float, slow_times: np.ndarray) -> Run:
    """Slow trajectory from L = momentum ẑ and E, over I_max; one with L_z > 0 ends in the pinch point, L = E = 0."""
    return plane_path_and_end(ellipsoid, momentum, energy, slow_times)[0]


def plane_path_and_end(
    ellipsoid: Ellipsoid, momentum: float, energy: float, slow_times: np.ndarray
) -> tuple[Run, float]:
    """The same, and the slow time at which it ends: between rows where it meets the pinch point."""
    slow = (0.0, 0.0, momentum, energy)
    if momentum > 0:
        return slow_run_to_pinch(ellipsoid, slow, slow_times)
    return slow_run(ellipsoid, slow, slow_times), float(slow_times[-1])


def energy_at(ellipsoid: Ellipsoid, momentum: float, share: float) -> float:
    """E over I_max between the bounds L²/2I_max (share 0) and L²/2I_min (share 1); L over I_max."""
    ratio = max(ellipsoid.inertia) / min(ellipsoid.inertia)
    return momentum**2 / 2 * (1 + share * (ratio - 1))


def aligned_scene(
    ellipsoid: Ellipsoid,
    stokes: float,
    momentum: float,
    theta: float,
    slow_time: float,
    phi: float = 0.0,
) -> Scene:
    """Scene from L = momentum ẑ (over I_max) with θ₀ = theta, φ₀ = phi, ψ₀ = π/2."""
    start = aligned_start(ellipsoid, momentum * max(ellipsoid.inertia), theta, phi)
    return Scene(ellipsoid, stokes, start, stokes * slow_time)


def place_of(ellipsoid: Ellipsoid, point: FixedPoint) -> tuple[float, float]:
    """L_z and E of a fixed point, over I_max; there E = -L_z/4."""
    momentum = point.state[2] / max(ellipsoid.inertia)
    return momentum, -momentum / 4


def fixed_point(ellipsoid: Ellipsoid, stability: Stability) -> tuple[float, float]:
    """L_z and E, over I_max, of the fixed point of a stability."""
    return next(
        place_of(ellipsoid, point)
        for point in fixed_points(ellipsoid)
        if point.stability == stability
    )


def distance_from_node(ellipsoid: Ellipsoid, slow: np.ndarray) -> np.ndarray:
    """Largest difference of slow variables over I_max from the stable node, shape (n,)."""
    return np.max(
        np.abs(slow - np.array([0.0, 0.0, *fixed_point(ellipsoid, "stable node")])), axis=-1
    )


def plane_steps(slow: np.ndarray, count: int) -> np.ndarray:
    """Indices of at most count points of a path in the L_z–E plane, denser at small E; slow has shape (n, 4)."""
    # Steps are even in L_z/√E and ln E, which are finite at the pinch point by 1e-3 I_max, less than is
    # seen in a figure.
    energy = slow[:, 3] + 1e-3
    return even_steps(np.stack([slow[:, 2] / np.sqrt(energy), np.log(energy)], axis=1), count)


def even_steps(path: np.ndarray, count: int) -> np.ndarray:
    """Indices of at most count points of a path, shape (n, d), at about equal steps along it; both ends included."""
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    return np.unique(
        np.searchsorted(length, np.linspace(0.0, length[-1], count)).clip(0, len(path) - 1)
    )


def distances(points: np.ndarray, line: np.ndarray) -> np.ndarray:
    """Distance of each point from a line of straight segments; shapes (n, 2) and (m, 2)."""
    offsets = points[:, None] - line[:-1]
    sides = np.diff(line, axis=0)
    lengths = np.maximum(np.sum(sides**2, axis=-1), np.finfo(float).tiny)
    share = np.sum(offsets * sides, axis=-1) / lengths
    return np.linalg.norm(offsets - share.clip(0.0, 1.0)[..., None] * sides, axis=-1).min(axis=-1)
