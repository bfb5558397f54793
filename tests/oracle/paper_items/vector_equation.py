"""The vector equation of a massive ellipsoid in shear, and its averages, by code that shares nothing with the project.

NumPy, SciPy and numba only. The state of a full run is the rotation matrix, row by row (row i is body axis i in space
components), and L in space components, 12 numbers. The averaged equations are means over the torque-free motion by
quadrature. Flow u = y x̂, times in inverse shear rates, lengths in units of the longest semi-axis; density and
viscosity are 1. Slow times are times over St. Names such as `gove` are labels of the paper's equations.
"""

from functools import cache

import numba
import numpy as np
from scipy.integrate import quad, solve_ivp


class Body:
    """Semi-axes, moments of inertia and resistances, each of shape (3,), from their definitions.

    A turn about body axis i at unit rate meets the torque 8π X_i, where X are the resistances. `damping` is 8π X/I,
    the rates of decay in slow time; `largest` is I_max.
    """

    def __init__(self, axes):
        self.axes = np.array(axes, dtype=float) / max(axes)
        volume = 4 * np.pi / 3 * np.prod(self.axes)
        squares = self.axes**2
        self.inertia = volume / 5 * (squares.sum() - squares)
        beta = [integral(tuple(squares), square) for square in squares]
        weights = [squares[j] * beta[j] + squares[k] * beta[k] for _, j, k in CYCLIC]
        sums = squares.sum() - squares
        self.resistance = 2 / 3 * np.prod(self.axes) * sums / np.array(weights)
        self.damping = 8 * np.pi * self.resistance / self.inertia
        self.largest = self.inertia.max()


CYCLIC = ((0, 1, 2), (1, 2, 0), (2, 0, 1))


@cache
def integral(squares, square):
    """abc ∫₀^∞ dt/((l² + t) Δ) of `gove` for l² = `square`, with t = l_min² s/(1 - s) to reach a finite interval.

    Δ = √((a² + t)(b² + t)(c² + t)). The quadrature's tolerance is far above rounding, and below that of any run.
    """
    scale = min(squares)

    def value(s):
        t = scale * s / (1 - s)
        root = np.sqrt((squares[0] + t) * (squares[1] + t) * (squares[2] + t))
        return scale / (1 - s) ** 2 / ((square + t) * root)

    found = quad(value, 0, 0.5, epsabs=0, epsrel=1e-13, limit=400)[0]
    # Toward s = 1 the integrand is smooth in w = √(1 - s).
    found += quad(
        lambda w: 2 * w * value(1 - w * w), 1e-12, np.sqrt(0.5), epsabs=0, epsrel=1e-13, limit=400
    )[0]
    return np.sqrt(np.prod(squares)) * found


@numba.njit
def jeffery(axes, t, spin):
    """Jeffery's angular velocity in body axes, from the shear in body axes."""
    for i in range(3):
        j = (i + 1) % 3
        k = (i + 2) % 3
        # Shear in body axes: component (k, j) is t_kx t_jy.
        kj = t[3 * k] * t[3 * j + 1]
        jk = t[3 * j] * t[3 * k + 1]
        spin[i] = (axes[j] ** 2 * kj - axes[k] ** 2 * jk) / (axes[j] ** 2 + axes[k] ** 2)


@numba.njit
def turn(t, w, out):
    """Rates of the rows of a rotation matrix: body axis i moves with Ω × axis, Ω = Σ w_j axis_j."""
    x = w[0] * t[0] + w[1] * t[3] + w[2] * t[6]
    y = w[0] * t[1] + w[1] * t[4] + w[2] * t[7]
    z = w[0] * t[2] + w[1] * t[5] + w[2] * t[8]
    for i in range(3):
        a = t[3 * i]
        b = t[3 * i + 1]
        c = t[3 * i + 2]
        out[3 * i] = y * c - z * b
        out[3 * i + 1] = z * a - x * c
        out[3 * i + 2] = x * b - y * a


@numba.njit
def full_rates(_, y, axes, inertia, damping):
    """Rates of the state (t_ij, L); `damping` is 8π X/St."""
    out = np.empty(12)
    w = np.empty(3)
    flow = np.empty(3)
    for i in range(3):
        w[i] = (y[3 * i] * y[9] + y[3 * i + 1] * y[10] + y[3 * i + 2] * y[11]) / inertia[i]
    jeffery(axes, y, flow)
    turn(y, w, out)
    for c in range(3):
        out[9 + c] = 0.0
    for i in range(3):
        torque = -damping[i] * (w[i] - flow[i])
        for c in range(3):
            out[9 + c] += y[3 * i + c] * torque
    return out


@numba.njit
def free_rates(_, y, axes):
    """Rates of t_ij without inertia."""
    out = np.empty(9)
    flow = np.empty(3)
    jeffery(axes, y, flow)
    turn(y, flow, out)
    return out


def rows(theta, phi, psi):
    """Rotation matrix of zxz Euler angles, in rad, from three turns; they may be complex."""

    def about_z(angle):
        c, s = np.cos(angle), np.sin(angle)
        return np.array([[c, s, 0], [-s, c, 0], [0, 0, 1.0]])

    c, s = np.cos(theta), np.sin(theta)
    return about_z(psi) @ np.array([[1, 0, 0], [0, c, s], [0, -s, c]]) @ about_z(phi)


def rows_of(quaternion):
    """Rotation matrix of a quaternion that turns space axes into body axes (Rodrigues)."""
    q = np.array(quaternion) / np.linalg.norm(quaternion)
    cross = np.array([[0, -q[3], q[2]], [q[3], 0, -q[1]], [-q[2], q[1], 0]])
    return (np.eye(3) + 2 * (q[0] * cross + cross @ cross)).T


def spin_of(angles, rates):
    """Angular velocity in body axes from Euler angles and their rates: the matrix's derivative by complex steps."""
    # Nothing is subtracted, so that any step far below rounding does.
    step = 1e-30
    moved = rows(*(np.array(angles) + 1j * step * np.array(rates)))
    skew = (moved.imag / step) @ moved.real.T
    return np.array([skew[1, 2], skew[2, 0], skew[0, 1]])


class Run:
    """A full run: times, rotation (n, 3, 3), L (n, 3), E (n,), ω (n, 3); L and E as `slow` over I_max (n, 4).

    It starts at time 0 from a rotation and a `spin`, ω in body axes. `tolerance` is relative, of a step; a hundredth
    of it is the absolute one. The default is near the least of double precision. AssertionError if the run fails.
    """

    def __init__(self, body, stokes, rotation, spin, times, tolerance=1e-12, method="DOP853"):
        momentum = rotation.T @ (body.inertia * spin)
        damping = 8 * np.pi * body.resistance / stokes
        solution = solve_ivp(
            full_rates,
            (0.0, times[-1]),
            np.concatenate([rotation.ravel(), momentum]),
            method,
            t_eval=times,
            args=(body.axes, body.inertia, damping),
            rtol=tolerance,
            atol=tolerance * 1e-2,
        )
        assert solution.success, solution.message
        self.body = body
        self.times = times
        self.rotation = solution.y[:9].T.reshape(-1, 3, 3)
        self.momentum = solution.y[9:].T
        self.spin = np.einsum("nij,nj->ni", self.rotation, self.momentum) / body.inertia
        self.energy = np.sum(body.inertia * self.spin**2, axis=1) / 2
        self.slow = np.column_stack([self.momentum, self.energy]) / body.largest


def aligned(body, momentum, theta, phi=0.0):
    """Rotation and ω in body axes with L = momentum I_max along z and the angles (θ, φ, π/2), in rad."""
    rotation = rows(theta, phi, np.pi / 2)
    return rotation, rotation @ np.array([0, 0, momentum * body.largest]) / body.inertia


# --- averages over the torque-free motion ----------------------------------------------------------------------------


def ensemble(body, momentum, energy, phases=4, most=1 << 17):
    """Rotations, ω in body axes and weights, uniform in time along the polhode and in the angle of precession.

    Shapes (n, 3, 3), (n, 3) and (n,); weights add up to 1. The torque has harmonics up to the third in the angle of
    precession, whose means four `phases` give exactly. The number of nodes along the polhode follows from how near the
    separatrix is, by estimate; `most` bounds memory. The polhode of a spheroid has few harmonics: 16 nodes are exact.
    """
    size = np.linalg.norm(momentum)
    low, middle, high = np.argsort(body.inertia)
    i1, i2, i3 = body.inertia[[low, middle, high]]
    spheroid = np.isclose(i1, i2, rtol=1e-12) or np.isclose(i2, i3, rtol=1e-12)
    if np.isclose(i1, i2, rtol=1e-12):
        around = high
    elif np.isclose(i2, i3, rtol=1e-12):
        around = low
    else:
        around = high if size**2 > 2 * energy * i2 else low
    # How near the separatrix is, as a share of the way there.
    distance = abs((size**2 - 2 * energy * i2) / (2 * energy * (i3 - i1))) + 1e-300
    # Near it the time along the polhode peaks within √distance of the middle axis. Half of the
    # peak's width in its logarithm is taken up by tan(angle) = √√distance tan(even angle).
    focus = 1.0 if spheroid else distance**0.25
    nodes = 16 if spheroid else int(min(most, max(128, 60 / focus)))
    i, j, k = CYCLIC[around]
    even = 2 * np.pi * (np.arange(nodes) + 0.5) / nodes
    # The angle from the axis next to which the peaks lie.
    aside = np.arctan2(focus * np.sin(even), np.cos(even))
    denser = focus / (np.cos(even) ** 2 + (focus * np.sin(even)) ** 2)
    angle = aside + np.pi / 2 if j == middle else aside
    inertia = body.inertia
    shape = np.sin(angle) ** 2 / inertia[j] + np.cos(angle) ** 2 / inertia[k] - 1 / inertia[i]
    radius2 = np.clip((2 * energy - size**2 / inertia[i]) / shape, 0, size**2)
    m = np.empty((nodes, 3))
    m[:, j] = np.sqrt(radius2) * np.sin(angle)
    m[:, k] = np.sqrt(radius2) * np.cos(angle)
    m[:, i] = np.sqrt(size**2 - radius2)
    # dm/dt = m × ω gives the rate of the angle; what it goes to zero with cancels for round bodies.
    turning = m[:, i] * (
        np.sin(angle) ** 2 * (1 / inertia[j] - 1 / inertia[i])
        + np.cos(angle) ** 2 * (1 / inertia[k] - 1 / inertia[i])
    )
    # The momentum of a spheroid turns evenly, or stands still.
    weight = np.ones(nodes) if spheroid else denser / np.abs(turning)
    weight /= weight.sum()
    unit = m / size
    # A frame whose third axis is L, for each node: columns are space axes in body axes.
    helper = np.eye(3)[np.argmin(np.abs(unit), axis=1)]
    first = np.cross(helper, unit)
    first /= np.linalg.norm(first, axis=1)[:, None]
    second = np.cross(unit, first)
    third = momentum / size
    across = np.cross(np.eye(3)[np.argmin(np.abs(third))], third)
    across /= np.linalg.norm(across)
    space = np.array([across, np.cross(third, across), third])
    found = []
    for angle in 2 * np.pi * np.arange(phases) / phases:
        c, s = np.cos(angle), np.sin(angle)
        frame = np.stack([c * first + s * second, -s * first + c * second, unit], axis=2)
        found.append(frame @ space)
    rotation = np.concatenate(found)
    return rotation, np.tile(m / inertia, (phases, 1)), np.tile(weight / phases, phases)


def averaged_rates(body, slow, **options):
    """Rates of L and E per slow time, all over I_max, from L and E over I_max, shape (4,) each.

    `options` are those of `ensemble`.
    """
    momentum = slow[:3] * body.largest
    rotation, spin, weight = ensemble(body, momentum, slow[3] * body.largest, **options)
    gradient = np.einsum("ni,nj->nij", rotation[:, :, 0], rotation[:, :, 1])
    square = body.axes**2
    flow = np.stack(
        [
            (square[j] * gradient[:, k, j] - square[k] * gradient[:, j, k])
            / (square[j] + square[k])
            for _, j, k in CYCLIC
        ],
        axis=1,
    )
    torque = -8 * np.pi * body.resistance * (spin - flow)
    change = np.einsum("n,nij,ni->j", weight, rotation, torque)
    power = weight @ np.sum(torque * spin, axis=1)
    return np.array([*change, power]) / body.largest


def averaged(body, start, times, tolerance=1e-10, event=None, method="DOP853"):
    """Averaged trajectory from L and E over I_max at slow times, as `solve_ivp` returns it: `y` has shape (4, n).

    It starts at slow time 0 and ends at a terminal event, if one is given. `tolerance` is relative, of a step; a tenth
    of it is the absolute one. The default is an estimate. AssertionError if the run fails.
    """
    solution = solve_ivp(
        lambda _, y: averaged_rates(body, y),
        (0.0, times[-1]),
        np.array(start, dtype=float),
        method,
        t_eval=times,
        rtol=tolerance,
        atol=tolerance * 1e-1,
        events=event,
        dense_output=event is not None,
    )
    assert solution.success, solution.message
    return solution
