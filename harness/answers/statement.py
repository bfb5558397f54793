"""The error that a run states: its difference from a second run, times a factor of its kind.

Both runs are compared at `INNER` times of their own, so that the statement holds for the solution
and does not depend on the rows that the user asks for.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from math import pi
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from polhode.harness.answers.fitted import factors
from polhode.harness.answers.interval import Interval
from polhode.harness.answers.request import EPS
from polhode.harness.common.text import in_two_digits, scientific
from polhode.harness.references.errors import orientation_difference
from polhode.models.former import Former
from polhode.models.observables import Observables
from polhode.models.shape import Ellipsoid

Array = np.ndarray

# The factors of statements are fitted with the numbers below as they are: if one of them changes, the fit must be
# made anew (`polhode validate --errors N --fit`).

# Share of the runs whose error stays below the upper end, as `polhode validate` counts; the fit asks
# for a little more (`coverage._FITTED_ABOVE`).
_BOUNDED = 0.975
# Times at which two runs are compared, as shares of the run in `INNER`, shape (137,): equispaced ones,
# and ones that grow from the start on by a constant ratio, since what damping leaves of an error lies
# there. The numbers are estimates: with more times a run of few steps takes longer to compare.
_EQUISPACED = 96
_GROWING = 40
# The first of the latter, as a share of the run: the shortest damping time of a very stiff one.
_FIRST = 1e-5
INNER = np.unique(
    np.concatenate([np.linspace(0, 1, _EQUISPACED + 1), np.geomspace(_FIRST, 1, _GROWING + 1)])
)
# Rounding of a run in eps of its largest L and E or of π. In splitting and averaging, errors of L and
# E add up at random, as this power of the rotations. Errors of the phase follow them for ever longer.
# The power lies between ½, of independent roundings, and 1, of those in one direction: an estimate.
_ROUNDING = 2.0
_ROUNDING_GROWTH = 0.7
# Compared times on either side of one whose largest difference stands for that time: differences
# pass through zero. An estimate: with fewer, errors between two rows would be stated too small where they
# oscillate slowly.
_NEIGHBOURS = 6
# An error, or a difference, of 0 counts as this, so that quotients and logarithms stay finite.
NO_ERROR = 1e-99
# No time has less than this share of the largest statement of the run: fits do not reach further.
_LEAST_SHARE = 0.1


class Difference(NamedTuple):
    """Differences of two runs at the compared times: of L and E over I_max, and of the orientation in rad."""

    slow: Array
    orientation: Array | None

    @property
    def largest(self) -> dict[str, float]:
        """The largest ones, by what they are of."""
        maxima = {"slow": float(self.slow.max())}
        if self.orientation is not None:
            maxima["orientation"] = float(self.orientation.max())
        return maxima

    @property
    def credited(self) -> dict[str, float]:
        """The largest ones that a statement rests on, by what they are of.

        Errors of L and E turn the body: an orientation that agrees better than they do agrees by chance.
        """
        maxima = self.largest
        if "orientation" in maxima:
            maxima["orientation"] = max(maxima.values())
        return maxima


def difference(ellipsoid: Ellipsoid, a: Observables, b: Observables) -> Difference:
    """Differences of observables at the same n times, arrays of shape (n,)."""
    momentum = np.abs(a.angular_momentum - b.angular_momentum).max(axis=1)
    slow = np.maximum(momentum, np.abs(a.energy - b.energy)) / max(ellipsoid.inertia)
    slow[np.isnan(slow)] = np.inf
    return Difference(slow, orientation_difference(ellipsoid, a.rotation, b.rotation))


class Along(NamedTuple):
    """Upper ends of the error at the rows: of L and E over I_max, of the orientation in rad; None if unknown."""

    slow: Array | None
    orientation: Array | None


@dataclass(frozen=True)
class RunError:
    """Estimated error of one run; None where it is not known or there is none.

    `kind` says what confirms the run. It is `"tighter"` if the run is the tighter one of two that
    met an error. It is `"looser"`, `"sharper"` or `"unlike"` for a second run beside one at a given
    tolerance. It is `"estimate"` for an estimate of the theory of averaging, `"closed form"` for an
    exact solution, and None where nothing confirms the run.
    """

    slow: Interval | None  # of L and E over I_max
    orientation: Interval | None  # in rad
    note: str  # what the estimate rests on, or why there is none
    kind: str | None = None
    share: float = _BOUNDED  # of the runs, whose error stays below the upper end
    seconds: float = 0.0  # what the confirmation cost, compilation left out
    advice: str = ""  # what to do about a requested error that was missed; empty if none was
    largest_lz: float = 0.0  # the whole run's largest |L_z| over I_max; 0 where it is not known
    axis: bool = False  # whether the orientation is that of a spheroid's symmetry axis
    family: str = ""  # of methods, whose factors it has
    # Differences from the second run at the compared times.
    difference: Difference | None = field(default=None, repr=False, compare=False)
    # Shares of the run at which the rows lie.
    rows: Array = field(default_factory=lambda: INNER, repr=False, compare=False)

    wanted = Former("of")

    def of(self, want: str) -> Interval | None:
        """The error of L and E (`slow`) or of the `orientation`."""
        return self.slow if want == "slow" else self.orientation

    def at(self, rows: Array) -> "RunError":
        """The same for other rows, at these shares of the run."""
        return replace(self, rows=rows)

    @property
    def along(self) -> Along:
        """The upper ends at the rows, shape (n,); between two compared times they are interpolated."""
        ends = []
        for want in ("slow", "orientation"):
            interval = self.of(want)
            values = getattr(self.difference, want, None)
            if interval is None or values is None:
                ends.append(None)
            else:
                ends.append(interval.high * np.interp(self.rows, INNER, _shape(values)))
        return Along(*ends)

    def words(self) -> str:
        """The errors in a line; L and E also as a share of the run's largest |L_z|, if smaller."""
        parts = []
        if self.slow:
            smaller = 0 < self.slow.high <= self.largest_lz
            share = in_two_digits(100 * self.slow.high / self.largest_lz) if smaller else ""
            of_lz = f", {share} % of the largest |L_z|" if share else ""
            parts.append(f"L and E within {scientific(self.slow.high)} of I_max{of_lz}")
        if self.orientation:
            of = "symmetry axis" if self.axis else "orientation"
            parts.append(f"{of} within {scientific(self.orientation.high)} rad")
        if not parts:
            return f"not known: {self.note}"
        return f"{'; '.join(parts)} (estimated; {100 * self.share:g} % of like runs)"

    def summary(self) -> dict[str, Any]:
        """Its contents in a file, as plain data."""
        left_out = ("difference", "rows")
        contents = {name: value for name, value in vars(self).items() if name not in left_out}
        for want in ("slow", "orientation"):
            interval = contents[want]
            contents[want] = interval and vars(interval)
        return contents


UNKNOWN = RunError(None, None, "not estimated")


def stated(
    ellipsoid: Ellipsoid,
    kind: str,
    family: str,
    apart: Difference,
    observables: Observables,
    turns: float,
    least: float,
    note: str,
    rounded: Mapping[str, float] = MappingProxyType({}),
) -> RunError:
    """State the error of a run whose observables at the compared times differ so from a second one's.

    The upper end is factor × max(difference, least) + rounding; the kind and family set the factor. The
    differences of a closed form are its rounding already (`of_rounding`): nothing is added to them.

    Parameters
    ----------
    ellipsoid : Ellipsoid
    kind, family : str
        Kind of confirmation, and family of methods, as `fitted.factors` has them.
    apart : Difference
        The differences at the compared times.
    observables : Observables
        Of the run, at the compared times.
    turns : float
        Rotations of the run.
    least : float
        A difference below which two runs agree by luck.
    note : str
        What the statement rests on.
    rounded : mapping
        The rounding that steps add up, in eps, by what the error is of; none of what it does not name.

    Raises
    ------
    KeyError
        If no factors are fitted for the kind and family.
    """
    momentum = np.abs(observables.angular_momentum).max(axis=0)
    size = float(max(momentum.max(), np.abs(observables.energy).max())) / max(ellipsoid.inertia)
    ends: dict[str, Interval | None] = {"slow": None, "orientation": None}
    # Rounding in eps that rotations add up.
    turned = _ROUNDING * (1 + turns) ** _ROUNDING_GROWTH if kind != "closed form" else 0.0
    # The phase adds up what rounding makes of L and E, so its rounding has a factor of the rotations more.
    units = {"slow": size, "orientation": pi * (1 + turns)}
    if apart.orientation is not None:
        # No two orientations are further apart than π, whatever an estimate makes of them.
        largest_angle = pi / factors()[kind][family]["orientation"].high
        apart = apart._replace(orientation=np.minimum(largest_angle, apart.orientation))
    for want, largest in apart.credited.items():
        factor = factors()[kind][family][want]
        rounding = EPS * units[want] * (turned + rounded.get(want, 0.0))
        high = factor.high * max(largest, least) + rounding
        if want == "orientation":
            high = min(pi, high)
        ends[want] = Interval(factor.middle * largest, factor.low * largest, high)
    return RunError(
        ends["slow"],
        ends["orientation"],
        note,
        kind,
        largest_lz=float(momentum[2]) / max(ellipsoid.inertia),
        axis=ellipsoid.symmetry_axis is not None,
        family=family,
        difference=apart,
    )


def of_rounding(
    ellipsoid: Ellipsoid, observables: Observables, turns: float, flow_rate: float
) -> Difference:
    """Rounding errors of a closed form, in units that factors multiply.

    The phase's grow with the rotations. So do errors of L and E where these follow the phase, as of a body without
    inertia in a flow that turns it at `flow_rate`. They are sums of terms of that size, which may cancel. Else
    `flow_rate` is 0.
    """
    momentum = np.abs(observables.angular_momentum).max()
    size = float(max(momentum, np.abs(observables.energy).max())) / max(ellipsoid.inertia)
    unit = np.full(len(observables.energy), EPS)
    slow = max(size, flow_rate) * unit * (1 + turns if flow_rate else 1)
    if ellipsoid.kind == "sphere":
        return Difference(slow, None)
    return Difference(slow, pi * unit * (1 + turns))


def _shape(values: Array) -> Array:
    """The largest of neighbouring differences over the largest of all, and no less than a share of it."""
    largest = values.max()
    if not 0 < largest < np.inf:
        return np.ones_like(values)
    # Row i of `windows` holds the values from i - _NEIGHBOURS to i + _NEIGHBOURS.
    padded = np.pad(values, _NEIGHBOURS, mode="edge")
    windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * _NEIGHBOURS + 1)
    return np.maximum(windows.max(axis=1) / largest, _LEAST_SHARE)
