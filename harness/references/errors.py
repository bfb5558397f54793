"""Errors of one solution, "found", against a reference at the same times.

Matrices t_ij have the body axis i, in space axes, as row i.
"""

from dataclasses import dataclass, replace
from math import inf

import numpy as np

from polhode.models.flow import dissipation
from polhode.models.libraries import IMPORTS
from polhode.models.observables import Observables, angular_velocity, completed
from polhode.models.scene import Scene
from polhode.models.shape import Ellipsoid

# Largest angle, in rad, at which a difference of orientation splits into phase and shape. The split is of
# first order: terms of the square, here a tenth of the angle, are left out. An estimate: twice the angle
# would leave out twice as large a part.
_SPLIT_LIMIT = 0.3
# Samples resolve the power of the torque under the conditions of the next three numbers. All are estimates:
# where they are too large, an error of the quadrature counts as one of the solution.
# Largest angle, in rad, by which a body turns between two samples.
_LARGEST_TURN = 0.5
# Largest difference between the residuals by all samples and by half of them, as a share of the residual.
_RESOLVED = 0.2
# Part of that difference, over I_max, that rounding makes.
_ROUNDING = 1e-13
# Smallest number of intervals of which every second sample still carries a spline. An estimate.
_LEAST_INTERVALS = 16


@dataclass(frozen=True)
class Errors:
    """Errors along a run: each is the largest over the samples, and None where it cannot be known.

    Errors of L and E (`slow`) are over I_max, the largest moment of inertia. Angles are in rad. The
    orientation error is the geodesic angle on SO(3) for a triaxial ellipsoid, and the angle between symmetry
    axes for a spheroid. It is None for a sphere or where a form gives no orientation. Up to `_SPLIT_LIMIT` it
    splits, to first order, into a phase along the motion and a shape across it.
    """

    slow: float
    worst_sample: int  # index of the sample with the largest error of L and E
    slow_each: tuple[float, ...]  # |ΔL_x|, |ΔL_y|, |ΔL_z| and |ΔE|
    orientation: float | None = None
    phase: float | None = None  # too early or too late on the same orbit
    shape: float | None = None  # another orbit
    balance: float | None = None  # residual of the energy balance over I_max (`balance_residual`)


def errors(
    ellipsoid: Ellipsoid, found: Observables, reference: Observables, scene: Scene | None = None
) -> Errors:
    """Errors of observables at the same n times.

    The scene that was solved is needed for `Errors.balance` alone. Then the samples must be equispaced over
    its duration. Raises ValueError if the numbers of samples differ.
    """
    if len(found.energy) != len(reference.energy):
        raise ValueError(f"samples: got {len(found.energy)}, expected {len(reference.energy)}")
    with np.errstate(over="ignore", invalid="ignore"):
        # Columns: L_x, L_y, L_z and E.
        difference = np.abs(found.slow - reference.slow) / max(ellipsoid.inertia)
    difference = np.where(np.isnan(difference), inf, difference)
    component_errors = np.max(difference, axis=0)
    worst = int(np.argmax(np.max(difference, axis=1)))
    slow = Errors(float(np.max(component_errors)), worst, tuple(component_errors.tolist()))
    angle = orientation_difference(ellipsoid, found.rotation, reference.rotation)
    if angle is None:
        return slow
    phase = None
    shape = None
    if np.max(angle) <= _SPLIT_LIMIT:
        along, across = phase_and_shape(ellipsoid, found, reference)
        phase = float(np.max(np.abs(along)))
        shape = float(np.max(across))
    balance = None if scene is None else balance_residual(scene, found, reference)
    return replace(
        slow, orientation=float(np.max(angle)), phase=phase, shape=shape, balance=balance
    )


def orientation_difference(
    ellipsoid: Ellipsoid, found: np.ndarray, reference: np.ndarray
) -> np.ndarray | None:
    """Angle in rad, shape (n,), between two sequences of matrices t_ij, shape (n, 3, 3).

    None for a sphere, and where no matrix is known. A matrix of NaN counts as turned by π.
    """
    # Computed from the length of the chord, which keeps small angles exact. The chord is 2√2 sin(angle/2) in
    # the Frobenius norm on SO(3), and 2 sin(angle/2) between unit vectors. Quaternions q and -q give the same
    # matrix. Rounding may take half a chord beyond 1.
    if ellipsoid.kind == "sphere":
        return None
    if ellipsoid.kind == "triaxial":
        apart = (found - reference).astype(float)
        half_chord = np.sqrt(np.einsum("nij,nij->n", apart, apart) / 8)
    else:
        axis = ellipsoid.symmetry_axis
        apart = (found[:, axis] - reference[:, axis]).astype(float)
        half_chord = np.sqrt(np.einsum("ni,ni->n", apart, apart) / 4)
    lost = np.isnan(half_chord)
    if lost.all():
        return None
    angle = 2 * np.arcsin(np.minimum(half_chord, 1))
    angle[lost] = np.pi
    return angle


def phase_and_shape(
    ellipsoid: Ellipsoid, found: Observables, reference: Observables
) -> tuple[np.ndarray, np.ndarray]:
    """Parts of a difference of orientation, shape (n,) each, in rad: along the reference's motion, and across it.

    The first one, the phase, is positive where the solution is ahead. The second one is a size.
    """
    # To first order the difference is a rotation vector δ in space axes, t_found = t_reference(1 - [δ]×),
    # where [δ]× v = δ × v: `offset`. Its part δ·ω/|ω| lies along the motion. For a spheroid `offset` is the
    # difference of the symmetry axes, and `velocity` has the direction of the axis' velocity. At rest the
    # whole difference is shape.
    if ellipsoid.kind == "triaxial":
        product = np.einsum(
            "nij,nik->njk", reference.rotation, found.rotation - reference.rotation
        ).astype(float)
        skew = 0.5 * (np.swapaxes(product, 1, 2) - product)
        offset = np.stack([skew[:, 2, 1], skew[:, 0, 2], skew[:, 1, 0]], axis=1)
        velocity = angular_velocity(ellipsoid, reference).astype(float)
    else:
        direction = reference.rotation[:, ellipsoid.symmetry_axis].astype(float)
        offset = found.rotation[:, ellipsoid.symmetry_axis].astype(float) - direction
        velocity = np.cross(reference.angular_momentum.astype(float), direction)
    speed = np.linalg.norm(velocity, axis=1, keepdims=True)
    along = np.divide(velocity, speed, out=np.zeros_like(velocity), where=speed > 0)
    phase = np.sum(offset * along, axis=1)
    return phase, np.linalg.norm(offset - phase[:, None] * along, axis=1)


def magnitude(ellipsoid: Ellipsoid, observables: Observables) -> float:
    """The largest of |L_x|, |L_y|, |L_z| and E over I_max."""
    return float(np.max(np.abs(observables.slow))) / max(ellipsoid.inertia)


def attainable(ellipsoid: Ellipsoid, observables: Observables) -> float:
    """Smallest error of L and E over I_max that double precision can hold: eps times their `magnitude`."""
    return float(np.finfo(float).eps) * magnitude(ellipsoid, observables)


def statistics_distance(ellipsoid: Ellipsoid, found: Observables, reference: Observables) -> float:
    """Largest distance (Wasserstein's W₁) between the distributions of an observable over the two runs.

    Distributions can be compared where chaos forbids to compare trajectories. The observables are the squares
    of the known entries of t_ij, L_z and E. The last two are in units of the reference's largest value.
    """
    axes = range(3) if ellipsoid.kind == "triaxial" else [ellipsoid.symmetry_axis or 0]

    def columns(observables: Observables) -> np.ndarray:
        """Squares of the entries of the known body axes, then L_z and E: a column each."""
        entries = observables.rotation[:, list(axes)].reshape(len(observables.energy), -1) ** 2
        return np.column_stack(
            [entries, observables.angular_momentum[:, 2], observables.energy]
        ).astype(float)

    found_columns = columns(found)
    reference_columns = columns(reference)
    # The unit of each column: 1, but for L_z and E, the last two.
    scale = np.ones(reference_columns.shape[1])
    scale[-2:] = np.max(np.abs(reference_columns[:, -2:]), axis=0)
    # Quantiles at the middles of n equal shares: W₁ is the mean distance of like quantiles.
    levels = (np.arange(len(found_columns)) + 0.5) / len(found_columns)
    found_quantiles = np.quantile(found_columns, levels, axis=0)
    reference_quantiles = np.quantile(reference_columns, levels, axis=0)
    moved = np.mean(np.abs(found_quantiles - reference_quantiles), axis=0)
    return float(np.nanmax(np.divide(moved, scale, out=np.zeros_like(moved), where=scale > 0)))


def balance_residual(scene: Scene, found: Observables, reference: Observables) -> float | None:
    """Largest residual over I_max of E(t) - E(0) - (1/St)∫P dt along a run.

    P is the power of the viscous torque. The samples are equispaced over the scene's duration. None where the
    residual cannot be known: without orientation, at St = 0, where E has no balance of its own, or where the
    samples do not resolve the power.
    """
    # The exact residual of the reference is 0. The quadratures of the two solutions over the same samples err
    # nearly alike. So the difference of the two residuals is measured, in which these errors cancel.
    intervals = len(found.energy) - 1
    if scene.stokes == 0 or intervals < _LEAST_INTERVALS:
        return None
    ellipsoid = scene.ellipsoid
    unit = max(scene.ellipsoid.inertia)
    # A form of a spheroid may give the symmetry axis alone: `completed` adds the other rows.
    completions = (completed(ellipsoid, run.rotation) for run in (found, reference))
    rotations = [rotation for rotation in completions if rotation is not None]
    if len(rotations) < 2 or not np.isfinite(rotations).all():
        return None
    found_rotation, reference_rotation = rotations
    found_omega = body_angular_velocity(ellipsoid, found, found_rotation)
    reference_omega = body_angular_velocity(ellipsoid, reference, reference_rotation)
    fastest = float(np.max(np.linalg.norm(reference_omega, axis=1)))
    if fastest * scene.time / intervals > _LARGEST_TURN:
        return None
    times = np.linspace(0.0, scene.time, intervals + 1)
    flow = None if scene.flow is None else scene.flow.numbers_at(times)
    found_power = dissipation(ellipsoid, found_rotation, found_omega, flow)
    power = found_power - dissipation(ellipsoid, reference_rotation, reference_omega, flow)
    # `torque_factor` is 1/St.
    power = power * scene.torque_factor / unit
    energy = (found.energy - reference.energy).astype(float) / unit
    # Every other sample. If the number of intervals is odd, the last one is left out.
    even = slice(0, intervals // 2 * 2 + 1, 2)
    fine = _residual(times, energy, power)
    coarse = _residual(times[even], energy[even], power[even])
    largest = float(np.max(np.abs(fine)))
    resolved = np.max(np.abs(fine[even] - coarse)) <= _RESOLVED * largest + _ROUNDING
    return largest if resolved else None


def body_angular_velocity(
    ellipsoid: Ellipsoid, observables: Observables, rotation: np.ndarray
) -> np.ndarray:
    """Angular velocity in body axes, shape (n, 3), from L and the complete rotation."""
    momentum = np.einsum("nij,nj->ni", rotation, observables.angular_momentum.astype(float))
    return momentum / np.array(ellipsoid.inertia)


def _residual(times: np.ndarray, energy: np.ndarray, rate: np.ndarray) -> np.ndarray:
    """Energy less its start and less the work done until each time, shape (n,).

    The work is the integral of a spline of `rate`.
    """
    with IMPORTS:
        from scipy.interpolate import CubicSpline

    work = CubicSpline(times, rate).antiderivative()(times)
    return energy - energy[0] - work
