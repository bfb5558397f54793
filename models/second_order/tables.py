"""Second-order averaged triaxial ellipsoid on one side of L² = 2EI₂: tables of its field."""

from dataclasses import dataclass
from functools import cached_property
from math import pi, sqrt

import numpy as np
from numpy.polynomial.chebyshev import chebder

from polhode.models.files import kept
from polhode.models.once import once
from polhode.models.operations import ARRAYS
from polhode.models.second_order.averages import MODES, averages
from polhode.models.second_order.field import (
    NAMES,
    NODES,
    POLE,
    POLES,
    SECOND,
    averaged_rates,
    polynomials,
    regular,
)
from polhode.models.second_order.polhodes import SidedBody
from polhode.models.shape import Ellipsoid

Array = np.ndarray

# Changes whenever the numbers of a table do.
_VERSION = 3
# Tables reach from a² = 0 to here: 1 - x = 0.0025.
MOST = 6.0
_ANGLES = pi * (np.arange(NODES) + 0.5) / NODES
_POINTS = 0.5 * MOST * (1 + np.cos(_ANGLES))
# Powers of I_max that each coefficient carries when L is measured in it.
_SCALES = dict.fromkeys(NAMES, 3) | dict.fromkeys(("f2", "g2", "r1", "r2", "ea", "eb"), 1)
_SCALES |= {"f0": 0, "g0": 0, "a1": 2, "b1": 2, "p1": 2, "p2": 2, "nu1": -1, "nu2": -1}
# Where the functions of second order stand among all.
_SECOND = slice(NAMES.index("a1"), NAMES.index("nu1"))
# Modes of a smaller share of the torque are no resonances.
_FAINT = 1e-8
# Averages at a divisor below this share of ν₂ weigh less in the table; so many terms fewer than
# nodes fit the others.
_NEAR = 0.02
_SPARE = 6
# Nearer to a permanent axis polhodes are taken for this a²; it moves the body by 1e-12 rad.
FLOOR = 1e-24
# Distance in a² at which the poles of the averages are found, and the a² of those that are none.
_BESIDE = 5e-4
_FAR = 1e3
# Of resonances, the least and the largest half width of a window, in √(|dD/dt|/St) of the divisor.
_WIDTHS = (4.0, 40.0)


@dataclass(frozen=True)
class Table:
    """One side's functions of a², 0 <= a² <= MOST."""

    series: (
        Array  # Chebyshev coefficients, a row per function, in the order of `NAMES`; y' as (a²)'/a²
    )
    poles: Array  # a row per pole: its a², dD/da² over l, residues of second and of first order of the functions
    resonances: Array  # a row per resonance: k₁, k₂, a², dD/da² over l, |P_k| of L' at l = 0 and its gain per l

    @cached_property
    def turning(self) -> Array:
        """Chebyshev coefficients of ν₁, ν₂, dν₁/da² and dν₂/da²."""
        rises = 2 / MOST * chebder(self.series[-2:], axis=1)
        return np.concatenate([self.series[-2:], np.pad(rises, ((0, 0), (0, 1)))])


@dataclass(frozen=True, eq=False)
class Kick:
    """What a resonance gives L, over I_max."""

    time: float
    size: float
    mode: tuple[int, int]
    width: float  # time that the phase takes to turn by a radian there
    along: Array  # what it gives (|L|, E), over I_max, complex: the part of the phase that happens to be is real
    bend: float  # by how much the mode changes dD/dt, over that
    drift: float  # change of a² in its width

    def window(self, budget: float) -> float:
        """Half width of the window at whose ends about the budget is missed."""
        least, largest = _WIDTHS
        share = self.size / budget
        wanted = (share * self.bend) ** (1 / 3), sqrt(2 * share * (1.5 * self.bend**2 + self.drift))
        return self.width * min(largest, max(least, *wanted))

    def missed(self, times: Array) -> Array:
        """What the transformation misses of it at times outside a window, at most."""
        near = np.minimum(1, self.width / np.maximum(np.abs(times - self.time), 1e-300))
        return self.size * near**2 * (self.bend * near + 1.5 * self.bend**2 + self.drift)


def level(a2: Array) -> Array:
    """y = ln(x/(1 - x)) of a²."""
    return np.log(np.expm1(a2))


@once()
def table(ellipsoid: Ellipsoid, longest: bool) -> Table:
    """Table of one side: that around the longest semi-axis, or that around the shortest; kept on disk."""
    key = f"second order {_VERSION} {ellipsoid.scaled_axes} {longest}"
    numbers = kept.load(key)
    if numbers is None:
        found = made(side_of(ellipsoid, longest))
        arrays = found.series, found.poles, found.resonances
        kept.save(key, np.concatenate([each.ravel() for each in arrays]))
        return found
    parts = np.split(numbers, np.cumsum([len(NAMES) * NODES, POLES * POLE]))
    return Table(*(each.reshape(-1, n) for each, n in zip(parts, (NODES, POLE, 6), strict=True)))


def made(side: SidedBody) -> Table:
    """The table of a side, not kept."""
    found, _, strengths = averages(side, level(_POINTS))
    for name in ("g0", "g2", "b1", "b2"):
        found[name] = found[name] * per_square(_POINTS)
    series = series_of(np.stack([found[name] for name in NAMES]))
    resonances = _resonances(series[-2:], _POINTS, strengths)
    poles = _poles(side, resonances)
    values = np.stack([found[name] for name in SECOND])
    for pole in poles:
        twice, once = regular(_POINTS - pole[0], 0 * _POINTS)
        values -= np.outer(pole[2 : 2 + len(SECOND)], twice) + np.outer(
            pole[2 + len(SECOND) :], once
        )
    weight = np.ones(NODES)
    for k1, k2 in resonances[:, :2]:
        square = ((k1 * found["nu1"] + k2 * found["nu2"]) / (_NEAR * found["nu2"])) ** 2
        weight *= square / (1 + square)
    series[_SECOND] = _fitted(values, weight)
    chosen = np.zeros((POLES, POLE))
    chosen[:, :2] = _FAR, 1
    largest = poles[np.argsort(-np.abs(poles[:, 2:]).max(axis=1, initial=0))][:POLES]
    chosen[: len(largest)] = largest
    inside = (resonances[:, 2] > 0) & (resonances[:, 2] < MOST)
    return Table(series, chosen, resonances[inside])


def _resonances(rates: Array, points: Array, strengths: Array) -> Array:
    """Resonances, rows as in `Table`, in and somewhat beyond the table."""
    t = np.linspace(-1.1, 1.2, 400)
    nu = evaluated(rates, t)
    rows = []
    for k1, k2 in (
        (-k1, k2) for k2 in (1, 2, 3) for k1 in range(1, MODES + 1) if (k1 + k2) % 2 == 0
    ):
        divisor = k1 * nu[0] + k2 * nu[1]
        combined = (k1 * rates[0] + k2 * rates[1])[None]
        for i in np.flatnonzero(divisor[1:] * divisor[:-1] < 0):
            root = t[i] - divisor[i] * (t[i + 1] - t[i]) / (divisor[i + 1] - divisor[i])
            slope = (divisor[i + 1] - divisor[i]) / (t[i + 1] - t[i])
            for _ in range(2):
                below, here, above = evaluated(combined, root + np.array([-1e-5, 0, 1e-5]))[0]
                slope = (above - below) / 2e-5
                root -= here / slope
            a2 = 0.5 * MOST * (1 + root)
            logs = np.log(strengths[::-1, -k1 - 1, k2 - 1].T + 1e-30)
            still, gain, most = (np.exp(np.interp(a2, points[::-1], each)) for each in logs)
            if still + gain > _FAINT * most:
                rows.append((k1, k2, a2, slope * 2 / MOST, still, gain))
    return np.array(rows).reshape(-1, 6)


def _poles(side: SidedBody, resonances: Array) -> Array:
    """Poles of the averages of second order at resonances, rows as in `Table`."""
    known: list[list[float]] = []
    for a2, slope in resonances[resonances[:, 2] > 2 * _BESIDE, 2:4].tolist():
        if all(abs(a2 - other) >= _BESIDE for other, _ in known):
            known.append([a2, slope])
    places = np.array(known).reshape(-1, 2)
    beside = np.concatenate([places[:, 0] - _BESIDE, places[:, 0] + _BESIDE])
    found = averages(side, level(beside))[0] if known else {}
    values = [
        found[name] * (per_square(beside) if name[0] == "b" else 1.0) for name in SECOND if known
    ]
    below, above = np.array(values).reshape(len(SECOND), 2, -1).swapaxes(0, 1)
    return np.column_stack(
        [places, 0.5 * _BESIDE**2 * (above + below).T, 0.5 * _BESIDE * (above - below).T]
    )


def _fitted(values: Array, weight: Array) -> Array:
    """Chebyshev series, shape (k, NODES), of functions at the Chebyshev points, some of which weigh little."""
    terms = NODES - _SPARE
    basis = weight[:, None] * np.cos(np.outer(_ANGLES, np.arange(terms)))
    series = np.zeros((len(values), NODES))
    series[:, :terms] = np.linalg.lstsq(basis, (weight * values).T, rcond=1e-15)[0].T
    return series


def evaluated(series: Array, t: Array) -> Array:
    """Chebyshev series, shape (k, n), at t, shape (m,), as an array of shape (k, m)."""
    return series @ np.array(polynomials(t, series.shape[1]))


def per_square(a2: Array) -> Array:
    """(a²)'/a² over y'."""
    return -np.expm1(-a2) / a2


def side_of(ellipsoid: Ellipsoid, longest: bool) -> SidedBody:
    """The side around the longest or the shortest semi-axis."""
    axis = ellipsoid.order[0 if longest else 2]
    return SidedBody.of(ellipsoid, np.eye(3)[axis])


@once()
def parameters(ellipsoid: Ellipsoid, torque_factor: float, longest: bool) -> tuple[float, ...]:
    """Parameters p of `field` on one side."""
    averaged = table(ellipsoid, longest)
    unit = max(ellipsoid.inertia)
    over = {*SECOND, "ea", "eb"}
    factors = np.array(
        [(torque_factor if name in over else 1.0) / unit ** _SCALES[name] for name in NAMES]
    )
    places, slopes, residues = np.split(averaged.poles, [1, 2], axis=1)
    poles = np.hstack(
        [places, torque_factor / (unit * slopes), residues * np.tile(factors[_SECOND], 2)]
    )
    return (
        0.5 * MOST,
        2 / MOST,
        *(factors[:, None] * averaged.series).ravel().tolist(),
        *poles.ravel().tolist(),
    )


def series_of(values: Array) -> Array:
    """Chebyshev coefficients, shape (k, NODES), of functions given at the Chebyshev points, shape (k, NODES)."""
    series = 2 / NODES * values @ np.cos(np.outer(_ANGLES, np.arange(NODES)))
    series[:, 0] /= 2
    return series


def second(found: Table, unit: float, slow: Array, a2: Array, steep: Array) -> Array:
    """The larger one of |L'| and |E'| of second order, for (L, E), all over I_max; `steep` is how h follows ln a²."""
    values = evaluated(found.series[_SECOND], 2 * a2 / MOST - 1)
    twice, once = regular(a2 - found.poles[:, :1], 1e-2)
    values += (
        found.poles[:, 2 : 2 + len(SECOND)].T @ twice + found.poles[:, 2 + len(SECOND) :].T @ once
    )
    values = values / np.array([unit ** _SCALES[name] for name in SECOND])[:, None]
    momentum = slow[:, :3]
    energy = slow[:, 3]
    size = np.linalg.norm(momentum, axis=1)
    n = (momentum / size[:, None]).T
    first = [np.zeros(len(size))] * 2
    rates = averaged_rates(ARRAYS)
    growth, rise, *across = rates(
        size, n, (*first, *values[:2]), (*first, *values[2:4]), first, values[4:]
    )
    moved = np.linalg.norm(growth[:, None] * momentum + np.stack(across, axis=1), axis=1)
    return np.maximum(moved, np.abs(2 * growth * energy + 0.5 * unit * size**2 * steep * rise))
