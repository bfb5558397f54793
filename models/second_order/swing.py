"""The near-identity transformation at a place on the torus, from series per shape and side.

`docs/second-order.md`, section 5, has the mathematics and the tables below. With e₊ = (1, -i, 0) the
flow's tensor x⊗y in the frame of L is a sum of `_BASIS` tensors with harmonics e^(-ikβ) and
coefficients c. Tensors of k > 0 come with their conjugates; the drag is one more tensor, c = l. The
rates that a tensor makes are Fourier series in α. Their coefficients, real or imaginary, are
Chebyshev series in a, regular down to a = 0. The division by k₁ν₁ + k₂ν₂ follows at each place. S
is the least rotation in the frame of L: β = -χ there. `polhode.models.second_order.torus` has the
same generator over all phases at once.
"""

from bisect import bisect_left
from dataclasses import dataclass
from functools import cached_property
from math import pi, sqrt
from typing import Any, NamedTuple

import numpy as np

from polhode.models.files import cached
from polhode.models.libraries import IMPORTS
from polhode.models.once import once
from polhode.models.second_order.field import polynomials
from polhode.models.second_order.polhodes import Polhodes, SidedBody
from polhode.models.second_order.spheroid import Triple, cross
from polhode.models.second_order.tables import MAX_A2, level, side_of
from polhode.models.second_order.torus import carried, least_rotation, polhode_rates, turned
from polhode.models.shape import Ellipsoid

Array = np.ndarray

# Version of the numbers of a series, in the key under which they are cached: it is raised when they
# change.
VERSION = 4
# Chebyshev nodes in a, from 0 to the end of the tables. This number and the next two are estimates. A test
# compares the transformation with that of `Torus` on three bodies (tests/models/second_order/test_swing.py). It
# allows 1e-9 of it near a principal axis, and 1e-4 for a² from 3 to 5; the largest differences were 4e-12 and 2e-6.
# Beyond a² = 5, up to `MAX_A2`, nothing is compared.
_NODES = 40
# Polhode phases at each node.
_PHASES = 96
# Fourier terms of the rates in α.
_TERMS = 25
# Angles of the nodes, in rad, shape (NODES,): a rises with the index.
_ANGLES = pi * (_NODES - 0.5 - np.arange(_NODES)) / _NODES
# Values of a at the nodes, shape (NODES,).
DEPTHS = 0.5 * sqrt(MAX_A2) * (1 + np.cos(_ANGLES))
# Terms of the rates are left out below this share of the largest one, times St: the transformation is
# over St, so that they are rounding of the pose.
_FAINT = 1e-14
# Least and largest of these shares, whatever St is. The least is an estimate: a smaller one adds terms below the
# errors of the series (`_NODES`). The largest is the error of an output, over the transformation, that
# docs/second-order.md allows.
LEAST_FAINT = 1e-11
MOST_FAINT = 1e-6
# Share of the largest below which terms of χ and of the change of n per y are left out. χ is a part of
# the pose itself, not over St, so that this share is near rounding. An estimate.
_ROUNDING = 1e-12
# Change of a divisor over its square up to which four terms of its asymptotic series do: the first one
# left out is 945 u⁴ at most, 1e-5 of the sum. An estimate: only modes near a resonance come near that bound, and
# all others keep the 1e-6 that docs/second-order.md allows.
_MAX_ASYMPTOTIC = 0.01
# Added where a divisor may be 0, to keep 1/0 away.
_TINY = 1e-100
# Divisor of the mean k = 0, so large that the mean has no part in the transformation.
_DIVISOR_OF_MEAN = 1e100
# An allocator (glibc) that has once freed 2 MB, which are these floats, keeps smaller blocks for later
# arrays. New pages for them would cost as much as the arithmetic on them.
np.empty(1 << 18)

# e₊ and e₃ in the frame of L.
_E = np.array([1, -1j, 0])
_Z = np.array([0, 0, 1])
# Two tensors of k = 0: one symmetric about L, and a turn about L.
_LEVEL = np.diag([0.5, 0.5, -1])
_TURN = np.array([[0, 0.5, 0], [-0.5, 0, 0], [0, 0, 0]])
# The tensors of the flow, shape (5, 3, 3); the drag is the sixth. They suffice, since x and y are orthogonal: x⊗y
# has no trace.
_BASIS = np.array([np.outer(_E, _E), np.outer(_E, _Z), np.outer(_Z, _E), _LEVEL, _TURN])
# k of each tensor and of the drag: a turn of the body by β multiplies a tensor by e^(-ikβ).
_K_OF_TENSORS = (2, 1, 1, 0, 0, 0)
_TENSOR_TURN = 4
_TENSOR_DRAG = 5
# The rates of which tensors make parts: a y', a α', L₃' and L₁' + iL₂'.
_RATE_Y, _RATE_ALPHA, _RATE_ALONG, _RATE_ACROSS = range(4)


class _Part(NamedTuple):
    """The part of a rate that one tensor makes: a Fourier series in α times e^(ik₂β) and c or c*."""

    rate: int
    tensor: int
    conjugate: bool  # whether it belongs to c*, not to c
    k2: int

    @property
    def unit(self) -> complex:
        """1 or i: whether the Fourier coefficients are real or imaginary.

        This follows from what a polhode's reflection α → -α does to each tensor. `_amplitudes` drops the other half;
        a factor that were wrong would drop a whole series, which the comparison with `Torus` would show.
        """
        of_the_body = self.tensor in (_TENSOR_TURN, _TENSOR_DRAG)
        return 1j if of_the_body == (self.rate == _RATE_ALPHA) else 1

    @property
    def factor(self) -> complex:
        """Factor of the part in its rate.

        The rates of y, α and L₃ are real, and doubling stands for the conjugates of k > 0.
        """
        doubled = self.rate != _RATE_ACROSS and _K_OF_TENSORS[self.tensor] > 0
        return (2 if doubled else 1) * self.unit


# The parts by rate and tensor, and their harmonics k₂:
#
#     rate \ tensor        0   1   2   3   4   5      k₂
#     a y'                 0   1   2   3   4   5      -2  -1  -1   0   0   0
#     a α'                 6   7   8   9  10  11      -2  -1  -1   0   0   0
#     L₃'                 12  13  14  15  16  17      -2  -1  -1   0   0   0
#     L₁' + iL₂', of c    18  19  20  21  22  23      -1   0   0   1   1   1
#     L₁' + iL₂', of c*   24  25  26                   3   2   2
#
# The rate of β + tα with t = (h - ν₂)/ν₁ vanishes, so that β needs no part.
def _parts() -> list[_Part]:
    parts = []
    for rate in (_RATE_Y, _RATE_ALPHA, _RATE_ALONG):
        for tensor, k in enumerate(_K_OF_TENSORS):
            parts.append(_Part(rate, tensor, False, -k))
    for tensor, k in enumerate(_K_OF_TENSORS):
        parts.append(_Part(_RATE_ACROSS, tensor, False, 1 - k))
    for tensor, k in enumerate(_K_OF_TENSORS):
        if k > 0:
            parts.append(_Part(_RATE_ACROSS, tensor, True, 1 + k))
    return parts


_PARTS = _parts()
# Parts of y', of L₃' and of L₁' + iL₂'.
_Y = slice(0, 6)
_ALONG = slice(12, 18)
_ACROSS = slice(18, 27)
# k₂, 1 or i, and the index of c of each part, shape (27,); the conjugates of c stand behind the six.
_K2 = np.array([part.k2 for part in _PARTS])
_UNIT = np.array([part.unit for part in _PARTS])
_COEFFICIENT_OF_PART = np.array(
    [part.tensor + len(_K_OF_TENSORS) * part.conjugate for part in _PARTS]
)
# The harmonics k₂ of parts.
_HARMONICS = np.arange(-2, 4)


# The orders k₁ of the terms (rows) of each harmonic k₂ (columns), the smallest first: k₁ + k₂ is
# even, and -k₂ has the orders of k₂ with the other sign.
#
#     k₂   -2   -1    0    1    2    3
#           0    1    0   -1    0   -1
#           2   -1   -2    1   -2    1
#          -2    3    2   -3    2   -3
#           4   -3   -4    3   -4    3
#                      …
def _orders(k2: int) -> list[int]:
    orders = [2 * term - (_TERMS - 1) + k2 % 2 for term in range(_TERMS)]
    orders.sort(key=abs)
    return [-k1 for k1 in orders] if k2 < 0 else orders


# Shape (TERMS, 6).
_ORDERS = np.stack([_orders(k2) for k2 in _HARMONICS.tolist()], axis=1)
# Harmonics k₂ >= 0 alone are summed: from k₁, k₂ to -k₁, -k₂ a mode's 1/D becomes its conjugate
# with the other sign, its 1/D² the conjugate alone. Shape (TERMS, 4).
_SUMMED = _ORDERS[:, 2:].copy()
# (k₁, k₂) of these, shape (2, TERMS * 4).
_SUMMED_MODES = np.stack(np.broadcast_arrays(_SUMMED, _HARMONICS[2:])).reshape(2, -1).astype(float)
# Columns of the products: 1/D of k₂ = 0, 1, 2, 3, then 1/D² of k₂ = 0, 1, 2.
_OVER_ONCE = 4
_OVER_TWICE = 3
_COLUMNS = _OVER_ONCE + _OVER_TWICE


# The summands of U. Each part is multiplied with seven columns and summed over k₁; the product of a
# part and a column has the number in this table:
#
#              1/D                    1/D²
#     k₂        0    1    2    3       0    1    2
#     part 0    0    1    2    3       4    5    6
#     part 1    7    8    9   10      11   12   13
#                          …
#
# A part uses the column |k₂| over D, and the parts of y' and L₃' a column over D², too. With p such
# a product the summand is the part's factor times c times
#
# - -i p over D, or i p* if k₂ < 0;
# - p over D², or p* if k₂ < 0.
#
# As factors are real or imaginary, the real and the imaginary part of a summand are each a number
# times the real or the imaginary part of p.
class _Summands(NamedTuple):
    """How the sums are taken from the products, which are floats: real and imaginary part by turns."""

    places: Array  # index of the real and of the imaginary part of each summand in the products
    factors: Array  # what these are multiplied with
    sources: Array  # index of the c of each summand
    # First summand of each kind: y', α', L₃' and L₁' + iL₂' over D, y' and L₃' over D².
    kinds: list[int]


def _summands() -> _Summands:
    places = []
    factors = []
    sources = []
    kinds = []
    kind = None
    for squared in (False, True):
        for number, part in enumerate(_PARTS):
            if squared and part.rate not in (_RATE_Y, _RATE_ALONG):
                continue
            if kind != (squared, part.rate):
                kind = squared, part.rate
                kinds.append(len(sources))
            column = _OVER_ONCE * squared + abs(part.k2)
            product = _COLUMNS * number + column
            of_real, of_imaginary = _factors(part, squared)
            # One of the two factors is real, the other imaginary. If the factor of Re p is real, the
            # summand's real part comes from Re p and its imaginary part from Im p, else crosswise.
            place_of_real = 2 * product
            place_of_imaginary = 2 * product + 1
            if of_real.imag == 0:
                places += [place_of_real, place_of_imaginary]
                factors += [of_real.real, of_imaginary.imag]
            else:
                places += [place_of_imaginary, place_of_real]
                factors += [of_imaginary.real, of_real.imag]
            sources.append(_COEFFICIENT_OF_PART[number])
    return _Summands(np.array(places), np.array(factors), np.array(sources), kinds)


def _factors(part: _Part, squared: bool) -> tuple[complex, complex]:
    """Factors of the product's real and imaginary part in a part's summand over D or D²."""
    mirrored = part.k2 < 0
    over_divisor = 1j if mirrored else -1j
    of_real = part.factor * (1 if squared else over_divisor)
    return of_real, of_real * (-1j if mirrored else 1j)


_SUMMANDS = _summands()
# Place of the sums of L₁' + iL₂' among the kinds of sums, in the order of `_Summands.kinds`.
_SUM_ACROSS = 3
# `Series.shape` has the functions χ, y₁, y₂ and y₃ of α: the first and the third are sums of sines,
# the others of cosines. These are their places among cos and sin of each, one after another.
_SINE_OR_COSINE = [1, 2, 5, 6]


def coefficients(q: Array, size: Array) -> Array:
    """The tensors' c, shape (m, 6), from frames Q, shape (m, 3, 3), and |L|, shape (m,).

    The first two rows of Q are the flow's directions x and y in the frame of L.
    """
    x1, x2, x3, y1, y2, y3 = _columns(q[:, :2].reshape(-1, 6))
    x = x1 + 1j * x2
    y = y1 + 1j * y2
    level = x * y.conjugate()
    c = x * y / 4, x * y3 / 2, x3 * y / 2, level.real, -level.imag, _columns(size)
    return np.array(c, complex).reshape(6, -1).T


def frame(n: Array, first: Array, turn: Array) -> Array:
    """Q, shape (m, 3, 3), of columns e₁, n × e₁ and n, turned about n by `turn`, in rad.

    `n` and `first` have shape (m, 3). e₁ is the part of `first` across n, at unit length.
    """
    first = first - np.sum(n * first, axis=1)[:, None] * n
    first = first / np.linalg.norm(first, axis=1)[:, None]
    cos = np.cos(turn)[:, None]
    sin = np.sin(turn)[:, None]
    second = np.array(cross(tuple(n.T), tuple(first.T))).T
    return np.array([(cos * first + sin * second).T, (cos * second - sin * first).T, n.T]).T


def frame_of(momentum: Array) -> Array:
    """Frames Q of L alone, shape (m, 3, 3): e₁ is the part across L of the space axis that is farthest from L."""
    n = momentum / np.linalg.norm(momentum, axis=1)[:, None]
    return frame(n, np.eye(3)[np.argmin(np.abs(n), axis=1)], np.zeros(1))


@dataclass(frozen=True, eq=False)
class Series:
    """Chebyshev coefficients in a, NODES of each."""

    side: SidedBody
    rates: Array  # of TERMS × parts, those that are imaginary over i
    shape: Array  # of χ and the change of n per y: factors of sin kα or cos kα, of k × 4
    frequencies: Array  # ν₁, ν₂ and their derivatives with respect to y


@once()
def series_for(ellipsoid: Ellipsoid, longest: bool) -> Series:
    """The series of one side, around the longest semi-axis or around the shortest; cached on disk."""
    side = side_of(ellipsoid, longest)
    key = f"swing {VERSION} {ellipsoid.scaled_axes} {longest}"
    numbers = cached.load(key)
    if numbers is None:
        series = series_of(side)
        cached.save(key, np.concatenate([series.rates, series.shape, series.frequencies], axis=1))
        return series
    parts = np.split(numbers.reshape(_NODES, -1), [_TERMS * len(_PARTS), -4], axis=1)
    return Series(side, *(np.ascontiguousarray(part) for part in parts))


def series_of(side: SidedBody) -> Series:
    """The series of a side."""
    p = Polhodes(side, level(DEPTHS**2), np.zeros(_NODES), _PHASES)
    frequencies = np.stack([p.rate, p.precession, p.per_y.rate, p.per_y.precession], axis=-1)
    # Chebyshev coefficients from the values at the nodes, shape (NODES, NODES).
    weights = 2 / _NODES * np.cos(np.outer(np.arange(_NODES), _ANGLES))
    weights[0] /= 2
    values = _amplitudes(side, p), _shape(p), frequencies
    return Series(side, *(weights @ array.reshape(_NODES, -1) for array in values))


def _amplitudes(side: SidedBody, p: Polhodes) -> Array:
    """Fourier coefficients of the parts at the nodes, those that are imaginary over i, shape (NODES, TERMS, 27)."""
    spectrum = np.fft.fft(np.stack(_values_of_parts(side, p)), axis=-1, norm="forward")
    orders = _ORDERS.T[_K2 - _HARMONICS[0]][:, None] % _PHASES
    picked = np.take_along_axis(spectrum, orders, axis=-1).T
    return (picked / _UNIT).real.swapaxes(0, 1)


def _values_of_parts(side: SidedBody, p: Polhodes) -> list[Array]:
    """The parts at the nodes and phases, shape (NODES, PHASES) each, at |L| = 1."""
    z = p.z
    z_per_phase = p.per_phase
    z_per_y = p.per_y.z
    # Each tensor in body axes, turned there with S at β = 0; then the torque of each, and of the drag.
    body = carried(z, p.lead)
    tensors = np.einsum("naik,jil,nalm->jnakm", body, _BASIS, body, optimize=True)
    flows = np.stack(turned(side, lambda k, j: tensors[..., k, j]), axis=-1)
    tau = side.drag * np.concatenate([flows, (-side.inverse_inertia * z)[None]])
    rate_y, rate_a = polhode_rates(
        1.0,
        p.slope[:, None],
        _triple(p.excess[:, None] * z),
        (_triple(z_per_phase), _triple(z_per_y)),
        _triple(tau),
    )
    lx, ly, lz = np.moveaxis(np.einsum("naik,jnak->jnai", body, tau), -1, 0)
    scale = DEPTHS[:, None]
    rates = scale * rate_y, scale * rate_a, lz, lx + 1j * ly
    of_conjugates = lx.conj() + 1j * ly.conj()
    return [
        of_conjugates[part.tensor] if part.conjugate else rates[part.rate][part.tensor]
        for part in _PARTS
    ]


def _shape(p: Polhodes) -> Array:
    """Factors of sin kα in χ and y₂, of cos kα in y₁ and y₃, y being ∂z/∂y; shape (NODES, k, 4)."""
    functions = np.stack([p.lead, *np.moveaxis(p.per_y.z, -1, 0)])
    waves = np.fft.fft(functions, axis=-1, norm="forward")
    # Modes k > 0 stand for -k, too.
    waves = waves[..., : _PHASES // 2] * np.where(np.arange(_PHASES // 2) > 0, 2, 1)
    return np.stack([-waves[0].imag, waves[1].real, -waves[2].imag, waves[3].real], axis=-1)


def _triple(vectors: Array) -> Triple:
    """The components of vectors, shape (..., 3)."""
    return tuple(np.moveaxis(vectors, -1, 0))


def tails(x: Array, q: Array) -> tuple[Array, Array]:
    """Finite complex values in place of 1/x² and 1/x, where a divisor x changes by q in a radian.

    x, q and both results have one shape.
    """
    # The integral of the mode from long before its resonance, or behind the resonance to long after
    # it, and the integral of that integral: near the resonance by Faddeeva's function, elsewhere by
    # its asymptotic series in q/x².
    with IMPORTS:
        from scipy.special import wofz

    # The series are sums of (2j - 1)!! (-iu)^j, that is 1, 1, 3, 15, …, times 1/x, and of (2j + 1)!!
    # (-iu)^j times 1/x², with u = q/x². The first four terms make real parts and imaginary ones. They
    # are close enough up to |u| = `_MAX_ASYMPTOTIC`; beyond it they are replaced, so that any u does where
    # |q| > x².
    square = 1 / np.maximum(x * x, np.abs(q) + _TINY)
    u = q * square
    once = np.empty(x.shape, complex)
    twice = np.empty(x.shape, complex)
    u2 = u * u
    over = x * square
    once.real = over * (1 - 3 * u2)
    once.imag = over * u * (15 * u2 - 1)
    twice.real = square * (1 - 15 * u2)
    twice.imag = square * u * (105 * u2 - 3)
    close = u2 > _MAX_ASYMPTOTIC**2
    if close.any():
        x = x[close]
        q = q[close]
        root = np.sqrt(-0.5j * q)
        sign = np.where(x * q > 0, -1, 1)
        z = -sign * x / (2 * root)
        faddeeva = sqrt(pi) * wofz(z)
        once[close] = sign * 0.5j / root * faddeeva
        twice[close] = -0.5 / root**2 * (1 + 1j * z * faddeeva)
    return twice, once


@dataclass(frozen=True)
class Place:
    """Places of m bodies on the torus."""

    series: Series
    a2: Array  # a², shape (m,)
    alpha: Array  # α in rad, shape (m,)
    z: Array  # n in the permuted body axes of `series.side`, shape (m, 3)

    @cached_property
    def body(self) -> Array:
        """S, shape (m, 3, 3), in the frame where it is the least rotation."""
        return least_rotation(self.z)

    @cached_property
    def shape(self) -> Array:
        """χ and the change of n per y, in the permuted body axes, shape (m, 4)."""
        count = self._needed("shape", _PHASES // 2, _ROUNDING)
        amplitudes = (
            (self._levels @ self.series.shape[:, : 4 * count]).reshape(-1, count, 4).swapaxes(1, 2)
        )
        waves = _powers(self.alpha, count).view(float).reshape(-1, count, 2)
        return (amplitudes @ waves).reshape(-1, 8)[:, _SINE_OR_COSINE]

    def swing(self, q: Array, size: Array, torque_factor: float) -> tuple[Array, Array]:
        """Changes of L and turns of R, in rad, in space, in frames Q, shape (m, 3, 3), at |L|, shape (m,)."""
        added = q @ self.moved(coefficients(q, size), size, torque_factor)
        return added[..., 0], added[..., 1]

    def moved(self, c: Array, size: Array, torque_factor: float) -> Array:
        """The same in the frame of L, shape (m, 3, 2), of the tensors' c."""
        series = self.series
        m = len(size)
        nu = self._levels @ series.frequencies
        a = _columns(np.sqrt(self.a2))
        size = _columns(size)
        kinds = self._sums(nu, c, a * size**2, torque_factor)
        # ν₁, ν₂ and their derivatives with respect to y; then the six kinds of sums: `drawn` sums y' over D²,
        # `growth` sums L₃' over D². The sums hold c, but else belong to |L| = 1: U of L is 1/l times as large,
        # U of y and of the angles 1/l².
        nu1, nu2, rise1, rise2 = _columns(nu)
        u_y, u_a, u_l, _, drawn, growth = _columns(np.real(kinds))
        across = _columns(kinds)[_SUM_ACROSS] / size
        z1, z2, z3 = _columns(self.z)
        _, y1, y2, y3 = _columns(self.shape)
        i1, i2, i3 = series.side.inverse_inertia.tolist()
        drawn = drawn / a
        u_y = u_y / a
        # Over ν₁, as Euler's equations give ν₁ ∂z/∂α.
        u_a = (u_a / a - nu1 * growth - rise1 * drawn) / nu1
        h = i1 * z1 * z1 + i2 * z2 * z2 + i3 * z3 * z3
        # The turn about n: U of β + tα with t = (h - ν₂)/ν₁, which is driven through the rates alone.
        u_b = -h * growth - (rise2 + (h - nu2) / nu1 * rise1) * drawn
        # The change of n in the body, then the same as S, the least rotation, carries it across L.
        dz1 = u_a * (i3 - i2) * z2 * z3 + u_y * y1
        dz2 = u_a * (i1 - i3) * z3 * z1 + u_y * y2
        least = (z1 * dz1 + z2 * dz2) / (1 + z3) + u_a * (i2 - i1) * z1 * z2 + u_y * y3
        x = dz1 - z1 * least
        y = dz2 - z2 * least
        # R turns so that n moves in the body by (x, y), and in space with L: as in `Torus.ambient`.
        changes = across.real, across.imag, u_l / size
        turns = (y / size - across.imag) / size, (across.real - x / size) / size, u_b / size**2
        return (torque_factor * np.array([changes, turns])).reshape(2, 3, m).T

    def _sums(self, nu: Array, c: Array, scale: Any, torque_factor: float) -> Array:
        """Sums of the summands of each kind, shape (m, 6).

        `nu` are the frequencies as `Series` has them, `scale` is al².
        """
        products = self._products(nu, c, scale, torque_factor)
        places, factors, sources, first = _SUMMANDS
        summands = (np.take(products, places, axis=1) * factors).view(complex)
        # As β is -χ, each c is multiplied by exp(ikχ), and what is across L by exp(-iχ) besides.
        c = c.copy()
        ahead = np.exp(1j * self.shape[:, :1])
        c[:, :3] *= ahead
        c[:, :1] *= ahead
        summands *= np.concatenate([c, c.conj()], axis=1)[:, sources]
        kinds = np.add.reduceat(summands, first, axis=1)
        kinds[:, _SUM_ACROSS : _SUM_ACROSS + 1] *= ahead.conj()
        return kinds

    def _products(self, nu: Array, c: Array, scale: Any, torque_factor: float) -> Array:
        """Products of parts and columns, shape (m, 2 · 27 · 7): real and imaginary part by turns."""
        m = len(c)
        terms = self._needed(
            "rates", _TERMS, min(MOST_FAINT, max(LEAST_FAINT, _FAINT / torque_factor))
        )
        amplitudes = self._levels @ self.series.rates[:, : len(_PARTS) * terms]
        amplitudes = amplitudes.reshape(m, terms, -1)
        # How fast y grows in the mean, by the turn and the drag, which moves the divisors. Term 0 is
        # the mean, and the parts of y' have the numbers of the tensors. Tensor 3 has k = 0 as well, but imaginary
        # coefficients: its mean is 0.
        means = slice(_TENSOR_TURN, _TENSOR_DRAG + 1)
        spun, dragged = _columns(np.real(c[:, means]) * amplitudes[:, 0, means])
        rise = torque_factor * (spun + dragged) / scale

        # Over D and D², shape (m, 4 · terms), the first of which is the mean.
        orders = _SUMMED_MODES[:, : _OVER_ONCE * terms]
        divisor = nu[:, :2] @ orders
        divisor[:, 0] = _DIVISOR_OF_MEAN
        twice, once = tails(divisor, np.reshape(rise, (-1, 1)) * (nu[:, 2:] @ orders))
        # exp(ik₁α), shape (m, terms, 4). Behind the powers from 0 to `terms` stand those from -terms to
        # -1, where negative indices find them.
        waves = _powers(self.alpha, terms + 1)
        waves = np.concatenate([waves, waves[:, :0:-1].conj()], axis=1)[:, _SUMMED[:terms]]
        over = np.empty((m, terms, _COLUMNS), complex)
        np.multiply(once.reshape(waves.shape), waves, out=over[..., :_OVER_ONCE])
        np.multiply(
            twice.reshape(waves.shape)[..., :_OVER_TWICE],
            waves[..., :_OVER_TWICE],
            out=over[..., _OVER_ONCE:],
        )
        return (amplitudes.swapaxes(1, 2) @ over.view(float)).reshape(m, -1)

    @cached_property
    def _levels(self) -> Array:
        return _levels(self.a2)

    def _needed(self, name: str, terms: int, faint: float) -> int:
        """How many of the terms of the series of a name matter up to the largest a."""
        node = bisect_left(DEPTHS, float(self.a2.max()) ** 0.5)
        return _needed(self.series, name, terms, faint)[min(_NODES - 1, node)]


@once()
def _needed(series: Series, name: str, terms: int, faint: float) -> list[int]:
    """The same at each node's a: those up to the last one above a share of the largest."""
    sizes = (
        np.abs(_levels(DEPTHS**2) @ getattr(series, name)).reshape(_NODES, terms, -1).max(axis=2)
    )
    return [int(np.flatnonzero(row > faint * row.max())[-1]) + 1 for row in sizes]


def _levels(a2: Array) -> Array:
    """Chebyshev polynomials in a, shape (m, NODES)."""
    (t,) = _columns((2 * np.sqrt(a2 / MAX_A2) - 1)[:, None])
    return np.array(polynomials(t, _NODES)).reshape(_NODES, -1).T


def _powers(angle: Array, count: int) -> Array:
    """Powers of exp(i angle) from 0 on, shape (m, count)."""
    powers = np.exp(1j * angle)[:, None].repeat(count, axis=1)
    powers[:, 0] = 1
    return np.multiply.accumulate(powers, axis=1)


def modes_at(
    series: Series, momentum: Array, a2: Array, k1: Array, k2: Array
) -> tuple[Array, Array, Array]:
    """Modes P exp i(k₁α + k₂β) + c.c. of the rates in slow time.

    One mode, k₂ > 0, for each L, shape (m, 3), and a²: |P| of L', then P* of l' and of y', shape
    (m,) each.
    """
    size = np.linalg.norm(momentum, axis=1)
    many = np.arange(len(a2))
    c = coefficients(frame_of(momentum), size)
    factors = np.concatenate([c, c.conj()], axis=1)[:, _COEFFICIENT_OF_PART] * _UNIT
    factors = factors[:, None] * (_levels(a2) @ series.rates).reshape(len(a2), _TERMS, -1)

    # The coefficient of a rate at the mode, or, with the sign -1, at (-k₁, -k₂), whose conjugate the mode
    # has in a real rate. `row` and `column` are the mode's place in `_ORDERS`; parts with another k₂, and
    # modes that stand nowhere there, count 0.
    def mode(parts: slice, sign: int) -> Array:
        column = np.clip(sign * k2 - _HARMONICS[0], 0, len(_HARMONICS) - 1)
        row = np.argmax(_ORDERS[:, column] == sign * k1, axis=0)
        counts = (_ORDERS[row, column] == sign * k1)[:, None] & (_K2[parts] == sign * k2[:, None])
        return np.sum(np.where(counts, factors[many, row, parts], 0), axis=1)

    # With L₁' + iL₂' of f e^(iψ) + b e^(-iψ), P of L₁' is (f + b*)/2 and P of L₂' is (f - b*)/2i: their
    # squares have the sum (|f|² + |b|²)/2.
    forward = mode(_ACROSS, 1)
    backward = mode(_ACROSS, -1)
    along = mode(_ALONG, -1)
    rise = mode(_Y, -1) / (np.sqrt(a2) * size)
    return (
        np.sqrt((np.abs(forward) ** 2 + np.abs(backward) ** 2) / 2 + np.abs(along) ** 2),
        along,
        rise,
    )


def _columns(rows: Array) -> Any:
    """Columns of an array; of a single row they are Python's numbers, which cost a tenth of arrays of one."""
    return rows[0].tolist() if len(rows) == 1 else rows.T
