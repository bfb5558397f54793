"""Second-order averaged triaxial ellipsoid on one side of L² = 2EI₂: tables of its field.

They are computed once per shape and side, and cached on disk. `docs/second-order.md` has in section 4
the functions and the layout of `parameters`, in section 7 the resonances and kicks.
"""

from dataclasses import dataclass
from functools import cached_property
from math import pi, sqrt

import numpy as np
from numpy.polynomial.chebyshev import chebder

from polhode.models.files import cached
from polhode.models.once import once
from polhode.models.operations import ARRAYS
from polhode.models.second_order.averages import MODES, averages
from polhode.models.second_order.field import (
    COEFFICIENTS,
    NODES,
    POLE,
    POLES,
    SECOND_ORDER,
    averaged_rates,
    polynomials,
    regular,
)
from polhode.models.second_order.polhodes import SidedBody
from polhode.models.shape import Ellipsoid

Array = np.ndarray

# Version of the numbers of a table, in the key under which they are cached: it is raised when they change.
_VERSION = 3
# Tables reach from a² = 0 to this a²: 1 - x = 0.0025. An estimate: nearer to L² = 2EI₂ the full equations
# take over, and a longer table would need more nodes.
MAX_A2 = 6.0
# Angles of the Chebyshev points, in rad, and the a² there.
_ANGLES = pi * (np.arange(NODES) + 0.5) / NODES
_POINTS = 0.5 * MAX_A2 * (1 + np.cos(_ANGLES))
# Powers of I_max that each coefficient carries when L is measured in it: they follow from the powers of l that stand
# beside it in `averages`.
_SCALES = dict.fromkeys(COEFFICIENTS, 3) | dict.fromkeys(("f2", "g2", "r1", "r2", "ea", "eb"), 1)
_SCALES |= {"f0": 0, "g0": 0, "a1": 2, "b1": 2, "p1": 2, "p2": 2, "nu1": -1, "nu2": -1}
# The functions of second order among all.
_SECOND = slice(COEFFICIENTS.index("a1"), COEFFICIENTS.index("nu1"))
# Modes of a smaller share of the torque are no resonances. An estimate: their kicks are as much smaller.
_FAINT = 1e-8
# Keeps the logarithm of a strength of 0 away.
_NO_STRENGTH = 1e-30
# Resonances are searched between these values of t, which is -1 at a² = 0 and 1 at `MAX_A2`: somewhat
# beyond the table, where they still have a part in its functions. An estimate: poles of resonances
# farther away are left to the series.
_SEARCHED = (-1.1, 1.2)
# Points of that search: resonances of one mode closer than 0.02 in a² would be missed. An estimate.
_SEARCH_POINTS = 400
# Step in t of the differences of Newton's method. An estimate: the slopes err by the square of the step, and by
# rounding over the step.
_NEWTON_STEP = 1e-5
# Steps of Newton's method. An estimate: the straight line between two points of the search is off by
# some 1e-5, and each step squares that.
_NEWTON_STEPS = 2
# Numbers of a resonance, a row of `Table.resonances`.
_RESONANCE = 6
# Columns of `Table.poles` behind a² and dD/da²: residues of second and of first order.
_OF_SECOND_ORDER = slice(2, 2 + len(SECOND_ORDER))
_OF_FIRST_ORDER = slice(2 + len(SECOND_ORDER), POLE)
# Averages at a divisor below this share of ν₂ weigh less in the table. An estimate: next to a pole the
# difference of two large numbers is rounding.
_NEAR = 0.02
# The fit has this many terms fewer than nodes, as some nodes weigh little. An estimate: with as many
# terms as nodes it would follow the rounding of those.
_SPARE = 6
# Singular values of the fit below this share of the largest one count as 0: they are rounding.
_LEAST_SINGULAR = 1e-15
# Nearer to a permanent axis polhodes are taken for this a²; it moves the body by 1e-12 rad.
FLOOR = 1e-24
# Distance in a² from a pole at which the averages tell its residues. An estimate: farther away what is
# smooth has a part in them, nearer the rounding of the divisor.
_POLE_DISTANCE = 5e-4
# Least distance in time from a kick.
_TINY = 1e-300
# The a² of rows without a pole: far beyond the table.
_FAR = 1e3
# Square of the width in a² within which poles end where the size of second order is estimated: a
# width of 0.1. An estimate: a smaller one raises the size next to resonances.
_POLE_WIDTH_SQUARED = 0.01
# Least and largest half length of a resonance's full segment, in widths √(1/(St |dD/dt₂|)) of it, D being
# the divisor; by trial on random starts, which reports/hybrid does not use.
_WIDTHS = (4.0, 40.0)


@dataclass(frozen=True)
class Table:
    """One side's functions of a², 0 <= a² <= MAX_A2."""

    series: Array  # Chebyshev coefficients, a row per function, in the order of `COEFFICIENTS`; y' as (a²)'/a²
    poles: Array  # a row per pole: its a², dD/da² over l, residues of second and of first order of the functions
    resonances: Array  # a row per resonance: k₁, k₂, a², dD/da² over l, |P_k| of L' at l = 0 and its gain per l

    @cached_property
    def turning(self) -> Array:
        """Chebyshev coefficients of ν₁, ν₂, dν₁/da² and dν₂/da²."""
        rises = 2 / MAX_A2 * chebder(self.series[-2:], axis=1)
        return np.concatenate([self.series[-2:], np.pad(rises, ((0, 0), (0, 1)))])


@dataclass(frozen=True, eq=False)
class Kick:
    """A resonance that a path passes, or a jump of `Path.crossings`; it changes L by `size`, over I_max.

    Times are slow times, and D is the divisor of the mode, times |L|.
    """

    time: float
    size: float
    mode: tuple[int, int]  # (k₁, k₂)
    width: float  # √(1/(St |dD/dt₂|)): in this time the phase turns by half a radian from the resonance on
    # Its change of (|L|, E), over I_max, complex: the real part belongs to the phase that occurs.
    along: Array
    bend: float  # by how much the mode changes dD/dt₂, over that
    drift: float  # change of a² in its width

    def half_width(self, budget: float) -> float:
        """Half length of the full segment at whose ends about the budget is missed.

        The budget is an error of L and E, over I_max.
        """
        # Each term of `missed` gives the number of widths at which it falls to the budget, the
        # second one to half of it.
        least, largest = _WIDTHS
        share = self.size / budget
        by_bend = (share * self.bend) ** (1 / 3)
        by_tail = sqrt(2 * share * (1.5 * self.bend**2 + self.drift))
        return self.width * min(largest, max(least, by_bend, by_tail))

    def missed(self, times: Array) -> Array:
        """Largest part of the change that the transformation misses at times outside a full segment.

        `docs/second-order.md`, section 7, has the formula, in numbers of widths.
        """
        closeness = np.minimum(1, self.width / np.maximum(np.abs(times - self.time), _TINY))
        return self.size * closeness**2 * (self.bend * closeness + 1.5 * self.bend**2 + self.drift)


def level(a2: Array) -> Array:
    """y = ln(x/(1 - x)) of a²."""
    return np.log(np.expm1(a2))


@once()
def table(ellipsoid: Ellipsoid, longest: bool) -> Table:
    """Table of one side, around the longest semi-axis or around the shortest; cached on disk."""
    key = f"second order {_VERSION} {ellipsoid.scaled_axes} {longest}"
    numbers = cached.load(key)
    if numbers is None:
        computed = made(side_of(ellipsoid, longest))
        arrays = computed.series, computed.poles, computed.resonances
        cached.save(key, np.concatenate([array.ravel() for array in arrays]))
        return computed
    parts = np.split(numbers, np.cumsum([len(COEFFICIENTS) * NODES, POLES * POLE]))
    lengths = (NODES, POLE, _RESONANCE)
    return Table(*(part.reshape(-1, n) for part, n in zip(parts, lengths, strict=True)))


def made(side: SidedBody) -> Table:
    """The table of a side, not cached."""
    functions, _, strengths = averages(side, level(_POINTS))
    for name in ("g0", "g2", "b1", "b2"):
        functions[name] = functions[name] * per_square(_POINTS)
    series = series_of(np.stack([functions[name] for name in COEFFICIENTS]))
    resonances = _resonances(series[-2:], _POINTS, strengths)
    poles = _poles(side, resonances)
    values = np.stack([functions[name] for name in SECOND_ORDER])
    # Without the poles the functions are smooth, but for rounding next to the poles.
    for pole in poles:
        twice, once = regular(_POINTS - pole[0], 0 * _POINTS)
        values -= np.outer(pole[_OF_SECOND_ORDER], twice) + np.outer(pole[_OF_FIRST_ORDER], once)
    weight = np.ones(NODES)
    for k1, k2 in resonances[:, :2]:
        square = ((k1 * functions["nu1"] + k2 * functions["nu2"]) / (_NEAR * functions["nu2"])) ** 2
        weight *= square / (1 + square)
    series[_SECOND] = _fitted(values, weight)
    # The poles of the largest residues, then rows without a pole: their a² lies far off, their residues
    # are 0, and `parameters` divides by their slope of 1.
    chosen = np.zeros((POLES, POLE))
    chosen[:, :2] = _FAR, 1
    largest = poles[np.argsort(-np.abs(poles[:, 2:]).max(axis=1, initial=0))][:POLES]
    chosen[: len(largest)] = largest
    inside = (resonances[:, 2] > 0) & (resonances[:, 2] < MAX_A2)
    return Table(series, chosen, resonances[inside])


def _resonances(rates: Array, points: Array, strengths: Array) -> Array:
    """Resonances, rows as in `Table`, in and somewhat beyond the table."""
    # t is the variable of the Chebyshev series, from -1 at a² = 0 to 1 at `MAX_A2`. Divisors change
    # sign between two of these points, and two steps of Newton's method refine each root.
    t = np.linspace(*_SEARCHED, _SEARCH_POINTS)
    nu = evaluated(rates, t)
    rows = []
    for k1, k2 in _modes():
        divisor = k1 * nu[0] + k2 * nu[1]
        combined = (k1 * rates[0] + k2 * rates[1])[None]
        for i in np.flatnonzero(divisor[1:] * divisor[:-1] < 0):
            # The first guess is the root of a straight line.
            root = t[i] - divisor[i] * (t[i + 1] - t[i]) / (divisor[i + 1] - divisor[i])
            slope = (divisor[i + 1] - divisor[i]) / (t[i + 1] - t[i])
            for _ in range(_NEWTON_STEPS):
                around = root + np.array([-_NEWTON_STEP, 0, _NEWTON_STEP])
                below, middle, above = evaluated(combined, around)[0]
                slope = (above - below) / (2 * _NEWTON_STEP)
                root -= middle / slope
            a2 = 0.5 * MAX_A2 * (1 + root)
            # From `averages`, at points of falling a²: strength at l = 0, its gain per l, and the
            # strength of all modes. They change by powers of ten: their logarithms change evenly.
            logs = np.log(strengths[::-1, -k1 - 1, k2 - 1].T + _NO_STRENGTH)
            still, gain, most = (np.exp(np.interp(a2, points[::-1], column)) for column in logs)
            if still + gain > _FAINT * most:
                rows.append((k1, k2, a2, slope * 2 / MAX_A2, still, gain))
    return np.array(rows).reshape(-1, _RESONANCE)


def _modes() -> list[tuple[int, int]]:
    """Modes (k₁, k₂) of opposite signs that may resonate; k₁ + k₂ is even."""
    modes = list[tuple[int, int]]()
    for k2 in (1, 2, 3):
        modes += [(-k1, k2) for k1 in range(1, MODES + 1) if (k1 + k2) % 2 == 0]
    return modes


def _poles(side: SidedBody, resonances: Array) -> Array:
    """Poles of the averages of second order at resonances, rows as in `Table`."""
    # Modes that are multiples of each other meet their resonance at one a², and make one pole there.
    # A pole next to a² = 0 has no place below it where averages could be taken, and is left out.
    isolated: list[list[float]] = []
    for a2, slope in resonances[resonances[:, 2] > 2 * _POLE_DISTANCE, 2:4].tolist():
        if all(abs(a2 - pole) >= _POLE_DISTANCE for pole, _ in isolated):
            isolated.append([a2, slope])
    places = np.array(isolated).reshape(-1, 2)
    beside = np.concatenate([places[:, 0] - _POLE_DISTANCE, places[:, 0] + _POLE_DISTANCE])
    functions = averages(side, level(beside))[0] if isolated else {}
    values = list[Array]()
    for name in SECOND_ORDER if isolated else ():
        scale = per_square(beside) if name[0] == "b" else 1.0
        values.append(functions[name] * scale)
    # At ±δ from its pole, δ being `_POLE_DISTANCE`, a function is r₂/δ² ± r₁/δ: half the sum and half
    # the difference tell both.
    below, above = np.array(values).reshape(len(SECOND_ORDER), 2, -1).swapaxes(0, 1)
    return np.column_stack(
        [
            places,
            0.5 * _POLE_DISTANCE**2 * (above + below).T,
            0.5 * _POLE_DISTANCE * (above - below).T,
        ]
    )


def _fitted(values: Array, weight: Array) -> Array:
    """Chebyshev series, shape (k, NODES), of values at the Chebyshev points, by their weights."""
    terms = NODES - _SPARE
    basis = weight[:, None] * np.cos(np.outer(_ANGLES, np.arange(terms)))
    series = np.zeros((len(values), NODES))
    series[:, :terms] = np.linalg.lstsq(basis, (weight * values).T, rcond=_LEAST_SINGULAR)[0].T
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
    # Functions over St: all of second order, and e_α, e_β, as the angles are St σ.
    over = {*SECOND_ORDER, "ea", "eb"}
    factors = np.array(
        [(torque_factor if name in over else 1.0) / unit ** _SCALES[name] for name in COEFFICIENTS]
    )
    places, slopes, residues = np.split(averaged.poles, [1, 2], axis=1)
    poles = np.hstack(
        [places, torque_factor / (unit * slopes), residues * np.tile(factors[_SECOND], 2)]
    )
    return (
        0.5 * MAX_A2,
        2 / MAX_A2,
        *(factors[:, None] * averaged.series).ravel().tolist(),
        *poles.ravel().tolist(),
    )


def series_of(values: Array) -> Array:
    """Chebyshev coefficients of functions from values at the Chebyshev points, both (k, NODES)."""
    series = 2 / NODES * values @ np.cos(np.outer(_ANGLES, np.arange(NODES)))
    series[:, 0] /= 2
    return series


def second(averaged: Table, unit: float, slow: Array, a2: Array, steep: Array) -> Array:
    """St times the larger one of |L'| and |E'| of second order, for (L, E), shape (m, 4), all over I_max.

    `unit` is I_max, `steep` is dh/d ln a²; the result, a² and `steep` have shape (m,).
    """
    values = evaluated(averaged.series[_SECOND], 2 * a2 / MAX_A2 - 1)
    # Poles end at one width here, whatever St is; kicks count resonances apart.
    twice, once = regular(a2 - averaged.poles[:, :1], _POLE_WIDTH_SQUARED)
    values += (
        averaged.poles[:, _OF_SECOND_ORDER].T @ twice + averaged.poles[:, _OF_FIRST_ORDER].T @ once
    )
    values = values / np.array([unit ** _SCALES[name] for name in SECOND_ORDER])[:, None]
    momentum = slow[:, :3]
    energy = slow[:, 3]
    size = np.linalg.norm(momentum, axis=1)
    n = (momentum / size[:, None]).T
    first = [np.zeros(len(size))] * 2
    rates = averaged_rates(ARRAYS)
    # Rates of second order alone: the functions are a1, a2; b1, b2; p1 to p6.
    growth, rise, *across = rates(
        size, n, (*first, *values[:2]), (*first, *values[2:4]), first, values[4:]
    )
    # E' of E = ½ l² h: 2E l'/l + ½ l² h', with h' of `rise`, (a²)'/a², times dh/d ln a².
    moved = np.linalg.norm(growth[:, None] * momentum + np.stack(across, axis=1), axis=1)
    return np.maximum(moved, np.abs(2 * growth * energy + 0.5 * unit * size**2 * steep * rise))
