"""The shape of the particle: semi-axes, moments of inertia, rotational resistance.

Labels such as `gove` stand in the paper's LaTeX source (`docs/misprints.md`).
"""

from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from math import isfinite, pi, sqrt
from numbers import Real
from typing import Any, Literal

Kind = Literal["sphere", "prolate", "oblate", "triaxial"]
Triple = tuple[float, float, float]

# Least ratio of the shortest semi-axis to the longest. Below it the moments of inertia lose digits to
# underflow: they are of fourth order in the semi-axes, down to 1e-280 here.
_LEAST_RATIO = 1e-70
# Distances from the mean, relative to it, below which the series of `carlson_rd` holds to double
# precision: the first terms left out are of eighth degree, 2e-21 here.
_CARLSON_SPREAD = 1 / 400


def require_numbers(name: str, given: Any, count: int = 0) -> None:
    """Raise ValueError unless these are `count` real numbers of double precision or, without a count, one number."""
    with suppress(OverflowError, TypeError, LookupError):
        # By index, as they are read later on: sets have no index, and iterators are read once.
        numbers = [given[i] for i in range(len(given))] if count else [given]
        if len(numbers) == max(1, count) and all(map(_is_number, numbers)):
            return
    expected = f"{count} numbers" if count else "a number"
    raise ValueError(f"{name}: got {given!r:.60}, expected {expected} of double precision")


def _is_number(given: Any) -> bool:
    """Whether it is a real number; OverflowError if double precision does not hold it."""
    if isinstance(given, float):
        return True
    # An int is found among numbers.Real by its slower way.
    if isinstance(given, bool) or not isinstance(given, (int, Real)):
        return False
    float(given)
    return True


@dataclass(frozen=True)
class Ellipsoid:
    """An ellipsoid with semi-axes a, b, c along its body axes x', y', z', in any order.

    Lengths are scaled by the longest semi-axis, so that inertia and resistance
    depend on the shape alone.

    Parameters
    ----------
    semi_axes : tuple of 3 float
        Lengths along x', y', z' in any common unit; finite and positive.

    Raises
    ------
    ValueError
        If a semi-axis is not a finite positive number, or the shortest too short beside the
        longest.
    """

    semi_axes: Triple

    def __post_init__(self) -> None:
        require_numbers("semi_axes", self.semi_axes, 3)
        for length in self.semi_axes:
            if not (isfinite(length) and length > 0):
                raise ValueError(f"semi_axes: got {length}, expected finite positive numbers")
        ratio = min(self.semi_axes) / max(self.semi_axes)
        if ratio < _LEAST_RATIO:
            expected = f"shortest / longest of at least {_LEAST_RATIO:g}"
            raise ValueError(f"semi_axes: got {[*map(float, self.semi_axes)]}, expected {expected}")

    @cached_property
    def scaled_axes(self) -> Triple:
        """Semi-axes in units of the longest one, in body order."""
        longest = max(self.semi_axes)
        a, b, c = (length / longest for length in self.semi_axes)
        return a, b, c

    @cached_property
    def order(self) -> tuple[int, int, int]:
        """Body axes (0, 1, 2) from the longest to the shortest, that is from the smallest inertia to the largest."""
        i, j, k = sorted(range(3), key=lambda axis: -self.semi_axes[axis])
        return i, j, k

    @cached_property
    def symmetry_axis(self) -> int | None:
        """Body axis (0, 1, 2) about which a spheroid is symmetric; None for spheres and triaxial ellipsoids."""
        a, b, c = self.scaled_axes
        equal = (b == c, c == a, a == b)
        return equal.index(True) if sum(equal) == 1 else None

    @cached_property
    def kind(self) -> Kind:
        """Which symmetry the shape has, by exact comparison of the scaled semi-axes."""
        if len(set(self.scaled_axes)) == 1:
            return "sphere"
        if (axis := self.symmetry_axis) is None:
            return "triaxial"
        return "prolate" if self.scaled_axes[axis] > self.scaled_axes[axis - 1] else "oblate"

    @cached_property
    def inertia(self) -> Triple:
        """Moments of inertia I_1 = (4π/15) abc (b² + c²) / l⁵ and cyclic; l is the longest semi-axis (`gove`)."""
        a, b, c = self.scaled_axes
        scale = 4 * pi / 15 * a * b * c
        return scale * (b * b + c * c), scale * (c * c + a * a), scale * (a * a + b * b)

    @cached_property
    def resistance(self) -> Triple:
        """Resistances X_1 = (2/3) abc (b² + c²) / (l³ (b²β₂ + c²β₃)) and cyclic; 1 for a sphere (`gove`).

        The β_i = abc ∫ dt / ((l_i² + t) Δ) = (2/3) abc R_D(l_j², l_k², l_i²) are Carlson's
        symmetric integrals (DLMF 19.16.5), free of cancellation for every shape.
        """
        a2, b2, c2 = (length * length for length in self.scaled_axes)
        beta1 = carlson_rd(b2, c2, a2)
        beta2 = carlson_rd(c2, a2, b2)
        beta3 = carlson_rd(a2, b2, c2)
        return (
            (b2 + c2) / (b2 * beta2 + c2 * beta3),
            (c2 + a2) / (c2 * beta3 + a2 * beta1),
            (a2 + b2) / (a2 * beta1 + b2 * beta2),
        )

    @cached_property
    def damping(self) -> Triple:
        """Damping rates 8πX_i/I_i of the body angular velocity, in units of (shear rate)/St."""
        d1, d2, d3 = (8 * pi * x / i for x, i in zip(self.resistance, self.inertia, strict=True))
        return d1, d2, d3

    @property
    def stokes_star_per_stokes(self) -> float | None:
        """Effective Stokes number over St, I_a/(8πX_c), of a spheroid or sphere; None for a triaxial ellipsoid."""
        if self.kind == "triaxial":
            return None
        return 1 / self.damping[self.symmetry_axis or 0]


def carlson_rd(x: float, y: float, z: float) -> float:
    """Carlson's R_D(x, y, z) of positive numbers, to some 1e-15; SciPy's takes 0.1 s to import."""
    # Duplication brings the arguments together, then a series in their distances serves (DLMF
    # 19.26.20, 19.36.2).
    mean = (x + y + 3 * z) / 5
    distance_x = mean - x
    distance_y = mean - y
    spread = max(abs(mean - x), abs(mean - y), abs(mean - z))
    # `share` is 4^-n after n duplications, and divides the distances from the mean.
    total = 0.0
    share = 1.0
    while share * spread > _CARLSON_SPREAD * mean:
        root_x = sqrt(x)
        root_y = sqrt(y)
        root_z = sqrt(z)
        shift = root_x * root_y + root_z * (root_x + root_y)
        total += share / (root_z * (z + shift))
        x = (x + shift) / 4
        y = (y + shift) / 4
        z = (z + shift) / 4
        mean = (mean + shift) / 4
        share = share / 4
    # Relative distances of x and y, u and v, and of z, w, which counts three times; e2 to e5 are the
    # elementary symmetric functions of (u, v, w, w, w).
    u = share * distance_x / mean
    v = share * distance_y / mean
    uv = u * v
    w = -(u + v) / 3
    e2 = uv - 6 * w * w
    e3 = (3 * uv - 8 * w * w) * w
    e4 = 3 * (uv - w * w) * w * w
    e5 = uv * w * w * w
    # By rising degree, up to the seventh.
    series = (
        1,
        -3 * e2 / 14,
        e3 / 6,
        9 * e2 * e2 / 88,
        -3 * e4 / 22,
        -9 * e2 * e3 / 52,
        3 * e5 / 26,
        -(e2**3) / 16,
        3 * e3 * e3 / 40,
        3 * e2 * e4 / 20,
        45 * e2 * e2 * e3 / 272,
        -9 * (e3 * e4 + e2 * e5) / 68,
    )
    return 3 * total + share * sum(series) / (mean * sqrt(mean))
