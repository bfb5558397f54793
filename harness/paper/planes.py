"""Computation for the L_z–E phase planes: slow trajectories, fixed points, distances.

With L along the vorticity, L_x = L_y = 0, the averaged equations keep L_x and L_y at zero. Such a
slow trajectory lies in the plane of L_z and E, between the parabolas E = L_z²/2I_max and E =
L_z²/2I_min. With L_z > 0 it ends in the pinch point L = E = 0, with L_z < 0 in a fixed point,
nearly always the stable node.

Slow variables are (L_x, L_y, L_z, E) over the largest moment of inertia I_max; times are slow times
t/St. Sections import this module whole, so that a change of its code makes their data stale
(`dependencies.py`). `plane_drawing.py` draws.
"""

import numpy as np

from polhode.harness.paper.runs import Run, slow_run, slow_run_to_pinch
from polhode.models.scene import Scene
from polhode.models.scenes import aligned_start
from polhode.models.shape import Ellipsoid
from polhode.models.theory.fixed_points import FixedPoint, Stability, fixed_points

# St of the full trajectories that are compared with slow ones, the smaller one first. From 1000 on the
# paper calls the agreement good. Ten times that St shows how the differences fall.
PLANE_STOKES = (1e3, 1e4)
# Differences of full from slow trajectories, over I_max.
Differences = dict[float, dict[float, float]]
"""Largest differences by St and by the number that names a body."""
# L_z/I_max above which a trajectory with L_z > 0 is compared: near the pinch point averaging fails.
# An estimate.
ABOVE_PINCH = 0.2
# Distance from the node, as of `distance_from_node`, at which a trajectory has reached it. An
# estimate.
REACHED = 1e-2


def plane_path(ellipsoid: Ellipsoid, momentum: float, energy: float, slow_times: np.ndarray) -> Run:
    """Slow trajectory from L = `momentum` ẑ and E = `energy`, both over I_max.

    It has the rows of `slow_times`, which start at 0. One with L_z > 0 has only those before it
    meets the pinch point.
    """
    return plane_path_and_end(ellipsoid, momentum, energy, slow_times)[0]


def plane_path_and_end(
    ellipsoid: Ellipsoid, momentum: float, energy: float, slow_times: np.ndarray
) -> tuple[Run, float]:
    """The trajectory of `plane_path`, and the slow time at which it ends.

    That is the last of `slow_times`, or with L_z > 0 the time, between two rows, of the pinch
    point; NaN if the trajectory does not meet it.
    """
    slow = (0.0, 0.0, momentum, energy)
    if momentum > 0:
        return slow_run_to_pinch(ellipsoid, slow, slow_times)
    return slow_run(ellipsoid, slow, slow_times), float(slow_times[-1])


def energy_at(ellipsoid: Ellipsoid, momentum: float, share: float) -> float:
    """E/I_max of a body with |L|/I_max = `momentum`, by its place between the bounds of E.

    `share` 0 is the lower bound, L²/2I_max, and 1 the upper one, L²/2I_min.
    """
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
    """Scene from L = `momentum` ẑ, over I_max, with θ₀ = `theta`, φ₀ = `phi` and ψ₀ = π/2, in rad.

    It lasts for `slow_time`.
    """
    start = aligned_start(ellipsoid, momentum * max(ellipsoid.inertia), theta, phi)
    return Scene(ellipsoid, stokes, start, stokes * slow_time)


def place_of(ellipsoid: Ellipsoid, point: FixedPoint) -> tuple[float, float]:
    """L_z and E of a fixed point, over I_max."""
    # There ω = -½ ẑ: L_z = -I/2 and E = I/8 for the moment of inertia I about the vorticity.
    momentum = point.state[2] / max(ellipsoid.inertia)
    return momentum, -momentum / 4


def fixed_point(ellipsoid: Ellipsoid, stability: Stability) -> tuple[float, float]:
    """L_z and E, over I_max, of the first fixed point with this stability.

    Raises StopIteration if the body has none.
    """
    return next(
        place_of(ellipsoid, point)
        for point in fixed_points(ellipsoid)
        if point.stability == stability
    )


def distance_from_node(ellipsoid: Ellipsoid, slow: np.ndarray) -> np.ndarray:
    """Distance of n states from the stable node, shape (n,): the largest of the four differences.

    `slow` has the slow variables over I_max, shape (n, 4), or (4,) for one state.
    """
    return np.max(
        np.abs(slow - np.array([0.0, 0.0, *fixed_point(ellipsoid, "stable node")])), axis=-1
    )


def plane_steps(slow: np.ndarray, count: int) -> np.ndarray:
    """Indices of at most `count` points of a path in the L_z–E plane, to draw it.

    `slow` has the slow variables over I_max, shape (n, 4). Points are denser at small E, where the
    parabolas leave a path little room.
    """
    # Steps are even in L_z/√E, which is constant along the parabolas, and in ln E. Both are finite
    # at the pinch point since 1e-3 I_max is added to E, less than is seen in a figure.
    energy = slow[:, 3] + 1e-3
    return even_steps(np.stack([slow[:, 2] / np.sqrt(energy), np.log(energy)], axis=1), count)


def even_steps(path: np.ndarray, count: int) -> np.ndarray:
    """Indices of at most `count` points of a path, at about equal steps, with both ends.

    `path` has n points in d dimensions, shape (n, d).
    """
    # The length of the path up to each of its points, shape (n,). A step takes the first point from
    # its place on. Rounding may put the last place beyond the end; several steps may take the same
    # point.
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    return np.unique(
        np.searchsorted(length, np.linspace(0.0, length[-1], count)).clip(0, len(path) - 1)
    )


def distances(points: np.ndarray, line: np.ndarray) -> np.ndarray:
    """Distance of each of n points from a line of straight segments, shape (n,).

    `points` has shape (n, 2), and `line` the m ends of the segments, shape (m, 2).
    """
    # `offsets` has shape (n, m - 1, 2). `lengths` are the squares of the segments' lengths, kept
    # from 0. `share` is the place of a point's projection on a segment, from 0 at its start to 1 at
    # its end; for a projection beyond an end, the end itself is nearest.
    offsets = points[:, None] - line[:-1]
    sides = np.diff(line, axis=0)
    lengths = np.maximum(np.sum(sides**2, axis=-1), np.finfo(float).tiny)
    share = np.sum(offsets * sides, axis=-1) / lengths
    return np.linalg.norm(offsets - share.clip(0.0, 1.0)[..., None] * sides, axis=-1).min(axis=-1)
