"""Orbits of the Jeffery top, the ellipsoid without inertia: Poincaré sections, stretching, layers of chaos.

Euler angles are θ, φ, ψ; z' is the axis that θ and φ give, and ψ turns the body about it. The
section is φ = nπ: a section point is θ and ψ of an orbit whenever z' lies in the plane of φ = 0. An
orbit librates if z' passes θ = π/2 from one section point to the next, and circulates if ψ goes
through ±π/2. The separatrix of the saddles (π/2, ±π/2) parts both kinds; it may be a layer in which
orbits do both, and are chaotic. Flow x, gradient y and vorticity z are the space axes.
`polhode.harness.paper.sections.limits` makes the paper's items of these. Orbits run side by side,
one in each SIMD lane of a Taylor integrator.
"""

from collections.abc import Sequence
from copy import deepcopy
from math import acosh, pi, sqrt
from typing import Any

import numpy as np

from polhode.models.catalogue import form as find_form
from polhode.models.flow import jeffery_spin, shares
from polhode.models.forms.jeffery import field
from polhode.models.once import OncePerThread, once
from polhode.models.rotation import matrix_from_quaternion, quaternion_from_euler
from polhode.models.scene import EulerStart, Scene
from polhode.models.shape import Ellipsoid, Triple
from polhode.solvers.compile import load_heyoka, tangent_system
from polhode.solvers.ensembles.taylor_batch import run_batches

# Sampling step, in inverse shear rates, between which section points are interpolated: the
# interpolation errs by 1e-4 at most, against events of an integrator (test_layer.py).
_STEP = 0.4
_TOLERANCE = 1e-15  # Of the orbits of section points: as tight as double precision allows.
# Tolerance of the tangents, an estimate: a percent of their growth is enough, far more than this.
_TANGENT_TOLERANCE = 1e-12
# Sizes of the form `jeffery`.
_DIMENSION = 4  # Numbers of a state, a unit quaternion.
_PARAMETERS = 6  # Those of its field: `polhode.models.flow.shares`.
# Halvings of the interval between two rows in which a section point is looked for: 2^-50 of it is
# rounding.
_ROOT_HALVINGS = 50
# ψ in rad of starts at ψ = 0: beside it, as some orbits never leave ψ = 0 itself. Small beside the
# width of 1e-4 of the one layer that is measured; an estimate.
PSI = 1e-9
# The search for ends of a layer covers this interval, in rad from θ = π/2. Both separatrices that are
# measured lie in it, at 0.27 and 0.78 (reports/paper/limits.md).
_SEARCHED = (0.0, 1.2)
# Orbits that each round of the search for one end of a layer takes: those for both ends run side by
# side, two for each of up to 8 SIMD lanes.
_PROBES = 8
# Rounds that narrow 1.2 rad down to the last digit, each by a factor of `_PROBES` + 1: 1.2/9^17 is
# 7e-17.
_ROUNDS = 17
# Jump of ψ, in rad, from one section point to the next, of an orbit that circulates: ψ is taken
# modulo π, so that it jumps by about π where it goes through ±π/2. Between that and the smaller
# steps of an orbit that librates, an estimate.
_CIRCULATES = 2.0
# Distance, in rad, from the saddle at which its growth is measured: the map next to the saddle is
# linear but for terms of relative order 1e-4 (test_layer.py measures it over two sections).
_TINY = 1e-4


def half_turn(ellipsoid: Ellipsoid) -> float:
    """Half a Jeffery period of the longest and the shortest axis, the slowest turn, in inverse shear rates."""
    kappa = max(ellipsoid.semi_axes) / min(ellipsoid.semi_axes)
    return pi * (kappa + 1 / kappa)


def chaos_border(turns: float) -> float:
    """Logarithm of the stretching above which an orbit is chaotic, after a number of half turns.

    The tangent of a regular orbit grows about linearly, so that the logarithm is about log(turns).
    The tangent of a chaotic orbit grows exponentially. The factor 3 between both is an estimate: for
    the slender body of reports/paper/limits.md, after 120 half turns, the border is 14, and medians
    are 3 for regular orbits and 116 for chaotic ones.
    """
    return 3 * float(np.log(turns))


def stretching(
    ellipsoid: Ellipsoid, angles: Sequence[Triple], half_turns: Sequence[int]
) -> np.ndarray:
    """Logarithm of the stretching of a tangent of each orbit.

    The tangent leads to the body turned a little about its axis (1, 1, 1). After each half turn its
    length is noted, and brought back to one so that it never overflows.

    Parameters
    ----------
    ellipsoid
        The body.
    angles
        Euler angles (θ, φ, ψ), in rad, at which the n orbits start.
    half_turns
        Numbers of half turns after which the stretching is noted, in increasing order.

    Returns
    -------
    ndarray
        Natural logarithms of the length, shape (n, `len(half_turns)`).

    Raises
    ------
    RuntimeError
        A run failed.
    """
    lanes = _tangent_integrator().batch_size
    quaternions = np.array([quaternion_from_euler(start) for start in angles])
    logarithms = np.empty((len(angles), len(half_turns)))
    for first in range(0, len(angles), lanes):
        batch = slice(first, first + lanes)
        logarithms[batch] = _batch_stretching(ellipsoid, quaternions[batch], half_turns)
    return logarithms


def _batch_stretching(
    ellipsoid: Ellipsoid, quaternions: np.ndarray, half_turns: Sequence[int]
) -> np.ndarray:
    """`stretching` of up to as many orbits as there are lanes, from quaternions, shape (n, 4)."""
    integrator = _tangent_integrator()
    lanes = integrator.batch_size
    # Fewer orbits than lanes are repeated to fill these; the result leaves the copies out.
    integrator.state[:_DIMENSION] = np.resize(quaternions, (lanes, _DIMENSION)).T
    tangents = _turned_aside(quaternions)
    integrator.state[_DIMENSION:] = np.resize(tangents, (lanes, _DIMENSION)).T
    integrator.pars[:] = np.array(shares(ellipsoid))[:, None]
    integrator.set_time(0.0)
    duration = half_turn(ellipsoid)
    logarithms = np.empty((len(quaternions), len(half_turns)))
    # The logarithm of each lane's stretching so far.
    stretched = np.zeros(lanes)
    for turn in range(1, half_turns[-1] + 1):
        integrator.propagate_until(turn * duration)
        length = np.linalg.norm(integrator.state[_DIMENSION:], axis=0)
        integrator.state[_DIMENSION:] /= length
        stretched += np.log(length)
        if turn in half_turns:
            logarithms[:, half_turns.index(turn)] = stretched[: len(quaternions)]
    if not np.isfinite(stretched).all():
        raise RuntimeError("the run of an orbit and its tangent failed, expected finite lengths")
    return logarithms


def _turned_aside(quaternions: np.ndarray) -> np.ndarray:
    """Unit tangents q (0, 1, 1, 1)/√3 of unit quaternions, shape (n, 4) each.

    They are the directions in which q changes when the body turns about its axis (1, 1, 1).
    """
    q0, q1, q2, q3 = quaternions.T
    parts = (-q1 - q2 - q3, q0 + q2 - q3, q0 + q3 - q1, q0 + q1 - q2)
    return np.stack(parts, axis=1) / sqrt(3)


def section_points(
    ellipsoid: Ellipsoid, angles: Sequence[Triple], duration: float
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Section points of orbits.

    The orbits are as precise as double precision allows; points are interpolated between their
    rows (`_STEP`). ψ is taken modulo π: a half turn about z' leaves the ellipsoid unchanged.

    Parameters
    ----------
    ellipsoid
        The body.
    angles
        Euler angles (θ, φ, ψ), in rad, at which the orbits start, with φ = 0.
    duration
        Time for which they are followed, in inverse shear rates.

    Returns
    -------
    list of tuples
        For each orbit θ and ψ at its section points after the start, in rad, in the order of time;
        ψ from -π/2 to π/2.

    Raises
    ------
    RuntimeError
        An orbit's run failed.
    """
    times = np.linspace(0.0, duration, int(duration / _STEP) + 2)
    # The scene gives the equations alone: `run_batches` takes the starts from `quaternions`.
    scene = Scene(ellipsoid, 0.0, EulerStart((1.0, 0.0, 0.0)), duration)
    quaternions = np.array([quaternion_from_euler(start) for start in angles])
    problem = find_form("jeffery").problem(scene)
    # States have the shape (times, orbits, 4).
    states, _ = run_batches(problem, quaternions, times, _TOLERANCE)
    if not np.isfinite(states).all():
        raise RuntimeError("an orbit's run failed, expected it to reach its end")
    return [_points_of(ellipsoid, times, states[:, number]) for number in range(len(angles))]


def _points_of(
    ellipsoid: Ellipsoid, times: np.ndarray, orientation: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """θ and ψ at the section points of one orbit, from quaternions at the times, shape (n, 4).

    Between two rows the matrix t_ij is a cubic polynomial of time.
    """
    # φ = nπ is where the flow component t₃₁ of z' vanishes. The start, where it does, is none.
    q0, q1, q2, q3 = orientation.T
    flow = q1 * q3 + q0 * q2
    changes = np.flatnonzero(flow[1:-1] * flow[2:] <= 0) + 1
    pairs = np.stack([orientation[changes], orientation[changes + 1]], axis=1)
    rotation = matrix_from_quaternion(pairs.reshape(-1, _DIMENSION))
    # Each column c of t_ij, a space axis in body axes, has the rate c × ω.
    spin = jeffery_spin(ellipsoid, rotation)
    rates = np.cross(rotation, spin[:, :, None], axis=1)
    # t_ij and its change in a step, at the two rows around each section point: shape (number of
    # section points, 2, 3, 3). [:, :, 2, 0] is t₃₁, and [:, :, :, 2] is the vorticity axis.
    values = rotation.reshape(-1, 2, 3, 3)
    slopes = rates.reshape(-1, 2, 3, 3) * (times[1] - times[0])
    # Bisection for the place of each section point, as a share of its step.
    low = np.zeros(len(changes))
    high = np.ones(len(changes))
    at_low = values[:, 0, 2, 0]
    for _ in range(_ROOT_HALVINGS):
        middle = (low + high) / 2
        at_middle = _cubic(middle, values[:, :, 2, 0], slopes[:, :, 2, 0])
        left = at_low * at_middle <= 0
        high = np.where(left, middle, high)
        low = np.where(left, low, middle)
    # The vorticity axis z in body axes is (sin θ sin ψ, sin θ cos ψ, cos θ).
    place = ((low + high) / 2)[:, None]
    vorticity = _cubic(place, values[:, :, :, 2], slopes[:, :, :, 2])
    theta = np.arccos(np.clip(vorticity[:, 2] / np.linalg.norm(vorticity, axis=1), -1, 1))
    psi = np.arctan2(vorticity[:, 0], vorticity[:, 1])
    return theta, (psi + pi / 2) % pi - pi / 2


def _cubic(place: np.ndarray, values: np.ndarray, slopes: np.ndarray) -> np.ndarray:
    """Hermite's cubic at places in [0, 1], from values and slopes at both ends.

    `values` and `slopes` have shape (n, 2, …), and `place` one that fits to (n, …).
    """
    change = values[:, 1] - values[:, 0]
    square = 3 * change - 2 * slopes[:, 0] - slopes[:, 1]
    cube = slopes[:, 0] + slopes[:, 1] - 2 * change
    return values[:, 0] + place * (slopes[:, 0] + place * (square + place * cube))


def measure_layer(ellipsoid: Ellipsoid, turns: int) -> tuple[float, float]:
    """Ends of pure libration and of pure circulation along θ at ψ = 0, which all orbits cross: θ - π/2 in rad.

    Orbits are tried from θ = π/2 on, each for a number of half turns (`turns`). The first end is the
    first orbit that circulates at some time, the second is the last one that librates at some time.
    The edges may be frayed: then rounding decides where they are found (`orbits_across` measures the
    width). The first end is the larger one while orbits next to a sharp separatrix have not yet
    left the saddle.

    Raises
    ------
    RuntimeError
        An orbit's run failed.
    """
    duration = turns * half_turn(ellipsoid)
    # Intervals that hold the end of pure libration and the end of pure circulation. Each round tries
    # orbits in both, and keeps of each the part, between two neighbouring probes, that holds the end.
    libration = _SEARCHED
    circulation = _SEARCHED
    for _ in range(_ROUNDS):
        offsets = np.concatenate([_probes(libration), _probes(circulation)])
        starts = [(pi / 2 + float(offset), 0.0, PSI) for offset in offsets]
        points = section_points(ellipsoid, starts, duration)
        # The part of the first interval before the first probe that circulates.
        circulating = [_circulates(psi) for _, psi in points[:_PROBES]]
        first = circulating.index(True) if any(circulating) else _PROBES
        bounds = [libration[0], *offsets[:_PROBES], libration[1]]
        libration = (bounds[first], bounds[first + 1])
        # The part of the second interval after the last probe that librates.
        librating = [_librates(theta) for theta, _ in points[_PROBES:]]
        last = _PROBES - librating[::-1].index(True) if any(librating) else 0
        bounds = [circulation[0], *offsets[_PROBES:], circulation[1]]
        circulation = (bounds[last], bounds[last + 1])
    # The middle of each interval.
    return sum(libration) / 2, sum(circulation) / 2


def orbits_across(
    ellipsoid: Ellipsoid, turns: int, window: tuple[float, float], count: int
) -> dict[str, np.ndarray]:
    """Whether orbits that start at even distances across a window librate, and circulate, at some time.

    Parameters
    ----------
    ellipsoid
        The body.
    turns
        Half turns for which orbits are followed.
    window
        Least and largest θ - π/2 of the starts, in rad. All are at ψ = 0.
    count
        Number of starts: the middles of as many equal parts of the window.

    Returns
    -------
    dict
        Columns of the length `count`: `offset` is θ - π/2 in rad; `librates` and `circulates` are 1
        if the orbit does so, else 0.

    Raises
    ------
    RuntimeError
        An orbit's run failed.
    """
    low, high = window
    offsets = low + (high - low) * (np.arange(count) + 0.5) / count
    starts = [(pi / 2 + offset, 0.0, PSI) for offset in offsets.tolist()]
    points = section_points(ellipsoid, starts, turns * half_turn(ellipsoid))
    librates = np.array([_librates(theta) for theta, _ in points], float)
    circulates = np.array([_circulates(psi) for _, psi in points], float)
    return {"offset": offsets, "librates": librates, "circulates": circulates}


def _probes(interval: tuple[float, float]) -> np.ndarray:
    """`_PROBES` offsets that part an interval evenly, without its ends."""
    return np.linspace(*interval, _PROBES + 2)[1:-1]


def _circulates(psi: np.ndarray) -> bool:
    """Whether an orbit circulates at some time, from ψ in rad at its section points in their order."""
    return bool(np.any(np.abs(np.diff(psi)) > _CIRCULATES))


def _librates(theta: np.ndarray) -> bool:
    """Whether an orbit librates at some time, from θ in rad at its section points in their order."""
    return bool(np.any((theta[1:] - pi / 2) * (theta[:-1] - pi / 2) < 0))


def saddle_growth(ellipsoid: Ellipsoid) -> float:
    """Exponent of the saddle (π/2, π/2) of the section, per half turn; RuntimeError if the orbit's run fails."""
    # The map next to it has determinant one and, by the reversal φ → -φ, equal diagonal elements
    # cosh λ. So the first section point from ψ = π/2 - δ lies at a distance of δ cosh λ. It comes
    # after about one half turn, within the 1.5 that are followed.
    start = (pi / 2, 0.0, pi / 2 - _TINY)
    ((_, psi),) = section_points(ellipsoid, [start], 1.5 * half_turn(ellipsoid))
    return acosh((pi / 2 - abs(float(psi[0]))) / _TINY)


@OncePerThread
def _tangent_integrator() -> Any:
    """An integrator of each thread's own for orbits with their tangents: it holds the state of a run."""
    return deepcopy(_compiled())


@once()
def _compiled() -> Any:
    """The integrator that threads copy: in each lane a quaternion and its tangent, four numbers each."""
    heyoka = load_heyoka()
    lanes = heyoka.recommended_simd_size()
    system = tangent_system(field, _DIMENSION, _PARAMETERS)
    start = np.zeros((len(system), lanes))
    return heyoka.taylor_adaptive_batch(system, start, tol=_TANGENT_TOLERANCE)
