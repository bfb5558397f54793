"""The ambient flow, and how it turns a body: Jeffery's angular velocity, and the power of its torque.

Simple shear u = y x̂ has equations of its own (`jw1`–`jw3`). Any other linear flow has eight numbers, in
space axes: half its vorticity h₁, h₂, h₃, and its rate of strain S₁₁, S₂₂, S₂₃, S₃₁, S₁₂. S₃₃ is subtracted
from the diagonal, as a multiple of the unit matrix turns nothing.

`docs/flows.md` has the equations. Labels such as `jw1` stand in the paper's LaTeX source;
`docs/misprints.md` says what those formulas should read. t_ij is component j, in space, of body axis i.
"""

from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from math import isfinite, pi, sqrt
from typing import Any

import numpy as np

from polhode.models.former import Former
from polhode.models.libraries import IMPORTS
from polhode.models.operations import ARRAYS, Operations
from polhode.models.shape import Ellipsoid, require_numbers

Triple = tuple[float, float, float]
Matrix = tuple[Triple, Triple, Triple]

# A trace up to this share of the gradient's norm is rounding. An estimate: entries that are written
# with 13 digits stay below it. Such a trace turns nothing.
_TRACE_ROUNDING = 1e-12
# A track covers a run that exceeds it by this share of its length: times are rounded, as entries are.
_TIME_ROUNDING = 1e-12
# Least ratio of a gap between knots to its neighbour. An estimate: of the slope over a gap that is so
# short beside the other one, rounding leaves seven digits.
_LEAST_GAP_RATIO = 1e-9
# The largest entry of a gradient, in units of the reference rate, as `polhode.models.scene` has it for
# angular velocities: nothing that is computed of it overflows.
_LARGEST_ENTRY = 1e30


@dataclass(frozen=True)
class Flow:
    """A linear ambient flow u_i = A_ij x_j, in space axes, constant or along a track in time.

    Parameters
    ----------
    gradient : sequence of 3 sequences of 3 float
        A_ij = ∂u_i/∂x_j in units of the reference rate to which St and t refer, of trace zero; of a
        track that at its first knot.
    knots : tuple of float, optional
        Times of a track in units of the inverse reference rate, increasing; `Flow.track` makes one.
    gradients : tuple of matrices, optional
        The gradients at these times.

    Raises
    ------
    ValueError
        If an entry of the gradient is not a finite number of a size up to 1e30, or its trace is not zero to
        1e-12 of the norm. The times and gradients of a track are checked by `Flow.track` alone.

    Examples
    --------
    >>> Flow([[0, 1, 0], [0.5, 0, 0], [0, 0, 0]]) == Flow.planar(0.5)
    True
    """

    gradient: Matrix
    knots: tuple[float, ...] = field(default=(), repr=False)
    gradients: tuple[Matrix, ...] = field(default=(), repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "gradient", checked_gradient("flow.gradient", self.gradient))

    @classmethod
    def shear(cls) -> "Flow":
        """Simple shear u = y x̂: A₁₂ = 1."""
        return cls.planar(0.0)

    @classmethod
    def planar(cls, alpha: float) -> "Flow":
        """Planar flow A₁₂ = 1, A₂₁ = `alpha`: -1 is rigid rotation, 0 simple shear, 1 planar extension."""
        return cls(((0.0, 1.0, 0.0), (alpha, 0.0, 0.0), (0.0, 0.0, 0.0)))

    @classmethod
    def extension(cls) -> "Flow":
        """Axial extension along x at unit rate: A = diag(1, -½, -½)."""
        return cls(((1.0, 0.0, 0.0), (0.0, -0.5, 0.0), (0.0, 0.0, -0.5)))

    @classmethod
    def track(cls, times: Any, gradients: Any) -> "Flow":
        """The flow along a particle's path: gradients, shape (n, 3, 3), at n increasing times.

        Between the times, the knots, it is SciPy's `CubicSpline` through them. Its error falls as the fourth
        power of their distance, and its second derivative is continuous. Raises ValueError if the
        numbers of times and gradients differ, or some of them are no track's.
        """
        knots = _checked_knots(times)
        gradients = _listed(gradients)
        if len(gradients) != len(knots):
            raise ValueError(
                f"flow.track: got {len(gradients)} gradients at {len(knots)} times, expected one at each"
            )
        matrices = tuple(
            checked_gradient(f"flow.track at t = {time:g}", matrix)
            for time, matrix in zip(knots, gradients, strict=True)
        )
        return cls(matrices[0], knots, matrices)

    def __repr__(self) -> str:
        """The gradient, or how many there are along a track and from when to when."""
        if not self.varies:
            return f"Flow(gradient={self.gradient})"
        begin = self.knots[0]
        end = self.knots[-1]
        return f"<Flow: {len(self.knots)} gradients along a track from t = {begin:g} to {end:g}>"

    @property
    def words(self) -> str:
        """The flow in words, for messages."""
        if self.varies:
            return f"the track of {len(self.knots)} gradients"
        return f"the flow {[list(row) for row in self.gradient]}"

    @property
    def varies(self) -> bool:
        """Whether it is a track."""
        return bool(self.knots)

    def covers(self, time: float) -> bool:
        """Whether it is known from 0 to a time."""
        if not self.varies:
            return True
        slack = _TIME_ROUNDING * (self.knots[-1] - self.knots[0])
        return self.knots[0] <= slack and time <= self.knots[-1] + slack

    def after(self, elapsed: float) -> "Flow":
        """The same flow, its time counted from a later moment."""
        if not self.varies or not elapsed:
            return self
        return replace(self, knots=tuple(knot - elapsed for knot in self.knots))

    @cached_property
    def cubics(self) -> np.ndarray:
        """Coefficients of `numbers` from each knot to the next, shape (n - 1, 4, 8), lowest power first."""
        with IMPORTS:
            from scipy.interpolate import CubicSpline

        spline = CubicSpline(np.array(self.knots), flow_numbers(np.array(self.gradients)))
        return np.ascontiguousarray(np.moveaxis(spline.c[::-1], 1, 0))

    # The name of version 0.1 for `interval`; its use warns.
    segment = Former("interval")

    def interval(self, time: float) -> int:
        """Index of the knot from which a time's cubic begins; the outermost cubics go on beyond the ends."""
        return min(max(bisect_right(self.knots, time) - 1, 0), len(self.knots) - 2)

    def numbers_at(self, times: np.ndarray) -> Sequence[Any]:
        """`numbers` at times of shape (n,): each a number, or of a track an array of that shape."""
        if not self.varies:
            return self.numbers
        knots = np.array(self.knots)
        intervals = np.clip(np.searchsorted(knots, times, side="right") - 1, 0, len(knots) - 2)
        since = np.asarray(times - knots[intervals])[:, None]
        # Coefficients at each time, shape (n, 4, 8).
        c = self.cubics[intervals]
        values = c[:, 0] + since * (c[:, 1] + since * (c[:, 2] + since * c[:, 3]))
        return list(values.T)

    def gradient_at(self, time: float) -> np.ndarray:
        """The gradient at a time, shape (3, 3)."""
        if not self.varies:
            return np.array(self.gradient)
        values = [float(number[0]) for number in self.numbers_at(np.array([time]))]
        h1, h2, h3, s11, s22, s23, s31, s12 = values
        strain = np.array([[s11, s12, s31], [s12, s22, s23], [s31, s23, 0.0]])
        rotation = np.array([[0.0, -h3, h2], [h3, 0.0, -h1], [-h2, h1, 0.0]])
        return strain - np.eye(3) * (s11 + s22) / 3 + rotation

    @cached_property
    def numbers(self) -> tuple[float, ...]:
        """Half the vorticity h₁, h₂, h₃ and the strain S₁₁ - S₃₃, S₂₂ - S₃₃, S₂₃, S₃₁, S₁₂, as fields take them.

        A track has its numbers at t = 0.
        """
        if self.varies:
            return tuple(float(number[0]) for number in self.numbers_at(np.zeros(1)))
        return tuple(flow_numbers(np.array(self.gradient)).tolist())

    @cached_property
    def rate(self) -> float:
        """Half the gradient's Frobenius norm: about how fast the flow turns bodies, in rad per unit of time.

        It is ½ in simple shear. A track has the largest rate at its knots.
        """
        matrices = np.array(self.gradients or (self.gradient,))
        return 0.5 * float(np.max(np.linalg.norm(matrices, axis=(1, 2))))


def _listed(given: Any) -> list[Any]:
    """The items of a sequence; ValueError for anything else."""
    # Messages here and below show the first 60 characters of what was given.
    try:
        return list(given)
    except TypeError:
        raise ValueError(f"flow.track: got {given!r:.60}, expected a sequence") from None


def _checked_knots(times: Any) -> tuple[float, ...]:
    """Times of a track in Python's numbers; raises ValueError unless they are finite and increase."""
    knots = _listed(times)
    for knot in knots:
        require_numbers("flow.track", knot)
    knots = tuple(map(float, knots))
    if len(knots) < 2:
        raise ValueError(f"flow.track: got {len(knots)} times, expected two at least")
    for before, after in pairwise(knots):
        if not (isfinite(before) and isfinite(after) and after > before):
            raise ValueError(
                f"flow.track: got t = {after!r} after {before!r}, expected finite times that increase"
            )
    gaps = [after - before for before, after in pairwise(knots)]
    for index, (gap, next_gap) in enumerate(pairwise(gaps)):
        if min(gap, next_gap) < _LEAST_GAP_RATIO * max(gap, next_gap):
            raise ValueError(
                f"flow.track: got the gaps {gap:.3g} and {next_gap:.3g} on both sides of "
                f"t = {knots[index + 1]!r}, expected none below {_LEAST_GAP_RATIO:g} of the other"
            )
    return knots


def checked_gradient(name: str, given: Any) -> Matrix:
    """A gradient in Python's numbers; raises ValueError, which begins with `name`, unless it is one (`Flow`)."""
    try:
        rows = [list(row) for row in given]
    except TypeError:
        rows = []
    if [len(row) for row in rows] != [3, 3, 3]:
        got = " ".join(repr(given).split())
        raise ValueError(f"{name}: got {got:.60}, expected three rows of three numbers")
    for row in rows:
        require_numbers(name, row, 3)
    (a11, a12, a13), (a21, a22, a23), (a31, a32, a33) = [[float(a) for a in row] for row in rows]
    matrix = ((a11, a12, a13), (a21, a22, a23), (a31, a32, a33))
    entries = [entry for row in matrix for entry in row]
    wrong = [entry for entry in entries if not (isfinite(entry) and abs(entry) <= _LARGEST_ENTRY)]
    if wrong:
        raise ValueError(
            f"{name}: got {wrong[0]}, expected finite numbers of at most {_LARGEST_ENTRY:g}"
        )
    trace = a11 + a22 + a33
    norm = sqrt(sum(entry * entry for entry in entries))
    if abs(trace) > _TRACE_ROUNDING * norm:
        raise ValueError(
            f"{name}: got the trace {trace:.3g}, expected 0 to {_TRACE_ROUNDING:g} of the norm, {norm:.3g}: "
            "subtract a third of it from the diagonal"
        )
    return matrix


def flow_numbers(gradient: np.ndarray) -> np.ndarray:
    """`Flow.numbers`, shape (..., 8), of gradients, shape (..., 3, 3)."""
    a = np.moveaxis(gradient, (-2, -1), (0, 1))
    return np.stack(
        [
            0.5 * (a[2, 1] - a[1, 2]),
            0.5 * (a[0, 2] - a[2, 0]),
            0.5 * (a[1, 0] - a[0, 1]),
            a[0, 0] - a[2, 2],
            a[1, 1] - a[2, 2],
            0.5 * (a[1, 2] + a[2, 1]),
            0.5 * (a[2, 0] + a[0, 2]),
            0.5 * (a[0, 1] + a[1, 0]),
        ],
        axis=-1,
    )


def shares(ellipsoid: Ellipsoid) -> tuple[float, ...]:
    """Shares b²/(b²+c²), c²/(b²+c²), and cyclic, of Jeffery's angular velocity (`jw1`–`jw3`)."""
    a2, b2, c2 = (length * length for length in ellipsoid.scaled_axes)
    return (
        b2 / (b2 + c2),
        c2 / (b2 + c2),
        c2 / (c2 + a2),
        a2 / (c2 + a2),
        a2 / (a2 + b2),
        b2 / (a2 + b2),
    )


def gyration(ellipsoid: Ellipsoid) -> Triple:
    """(I₂ - I₃)/I₁ = (c² - b²)/(b² + c²) and cyclic (`eulg`)."""
    a, b, c = ellipsoid.scaled_axes
    gyro1 = (c - b) * (c + b) / (b * b + c * c)
    gyro2 = (a - c) * (a + c) / (c * c + a * a)
    gyro3 = (b - a) * (b + a) / (a * a + b * b)
    return gyro1, gyro2, gyro3


def jeffery_angular_velocity(ops: Operations) -> Callable:
    """Jeffery's angular velocity in body axes from x = (t₁₁, t₂₁, t₃₁) and y = (t₁₂, t₂₂, t₃₂) (`jw1`–`jw3`)."""

    # s is what `shares` gives.
    def spin(x, y, s):
        return (
            s[0] * y[1] * x[2] - s[1] * y[2] * x[1],
            s[2] * y[2] * x[0] - s[3] * y[0] * x[2],
            s[4] * y[0] * x[1] - s[5] * y[1] * x[0],
        )

    return spin


def jeffery_in_any_flow(ops: Operations) -> Callable:
    """Jeffery's angular velocity in body axes, in any linear flow.

    The compiled function takes multiples x, y, z of the columns of t_ij and the scale that makes
    columns of them. It also takes `gyration`, (c² - b²)/(b² + c²) and cyclic, and the flow's numbers.
    In body axes, h' is half the vorticity, and S' = t S tᵀ is the strain rate. The first component is
    ω₁J = h'₁ + S'₂₃ (b² - c²)/(b² + c²). With the gradient G in body axes this is
    (b² G₃₂ - c² G₂₃)/(b² + c²).
    """

    def spin(x, y, z, scale, g, f):
        h1, h2, h3, s11, s22, s23, s31, s12 = f
        # S times the second and the third body axis.
        u1 = s11 * x[1] + s12 * y[1] + s31 * z[1]
        u2 = s12 * x[1] + s22 * y[1] + s23 * z[1]
        u3 = s31 * x[1] + s23 * y[1]
        v1 = s11 * x[2] + s12 * y[2] + s31 * z[2]
        v2 = s12 * x[2] + s22 * y[2] + s23 * z[2]
        v3 = s31 * x[2] + s23 * y[2]
        strain23 = x[1] * v1 + y[1] * v2 + z[1] * v3
        strain31 = x[0] * v1 + y[0] * v2 + z[0] * v3
        strain12 = x[0] * u1 + y[0] * u2 + z[0] * u3
        # The sums in parentheses do not wait for `scale`: it is a quotient, which takes a processor long.
        square = scale * scale
        return (
            scale * (h1 * x[0] + h2 * y[0] + h3 * z[0]) - g[0] * square * strain23,
            scale * (h1 * x[1] + h2 * y[1] + h3 * z[1]) - g[1] * square * strain31,
            scale * (h1 * x[2] + h2 * y[2] + h3 * z[2]) - g[2] * square * strain12,
        )

    return spin


def jeffery_spin(
    ellipsoid: Ellipsoid, rotation: np.ndarray, numbers: Sequence[Any] | None = None
) -> np.ndarray:
    """Jeffery's angular velocity in body axes, shape (n, 3), of matrices t_ij, shape (n, 3, 3).

    `numbers` are the flow's, each a number or one per matrix; by default it is simple shear.
    """
    x, y, z = (rotation[:, :, column].T for column in range(3))
    if numbers is None:
        return np.stack(jeffery_angular_velocity(ARRAYS)(x, y, shares(ellipsoid)), axis=1)
    return np.stack(jeffery_in_any_flow(ARRAYS)(x, y, z, 1.0, gyration(ellipsoid), numbers), axis=1)


def dissipation(
    ellipsoid: Ellipsoid,
    rotation: np.ndarray,
    angular_velocity: np.ndarray,
    numbers: Sequence[Any] | None = None,
) -> np.ndarray:
    """St dE/dt = -8π Σ X_j (ω_j - ω_jJ) ω_j (`vispow`), shape (n,), positive where the flow drives the body.

    `rotation` are matrices t_ij, shape (n, 3, 3), `angular_velocity` is in body axes, shape (n, 3), and
    `numbers` are the flow's as in `jeffery_spin`. The power is in units of E times the shear rate.
    """
    driven = torque(ellipsoid, rotation, angular_velocity, numbers)
    return np.sum(driven * angular_velocity, axis=1)


def torque(
    ellipsoid: Ellipsoid,
    rotation: np.ndarray,
    angular_velocity: np.ndarray,
    numbers: Sequence[Any] | None = None,
) -> np.ndarray:
    """St times the viscous torque in body axes, -8π X_j (ω_j - ω_jJ), shape (n, 3), of the same arguments."""
    return (
        8
        * pi
        * np.array(ellipsoid.resistance)
        * (jeffery_spin(ellipsoid, rotation, numbers) - angular_velocity)
    )
