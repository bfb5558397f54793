"""The pose on the torus and the generator of the near-identity transformation there, from series per shape and side.

With ε = (1, -i, 0) the flow's tensor x⊗y in the frame of L is a sum of `BASIS` tensors with harmonics e^(-ikβ) and
coefficients c, each but those of k = 0 with its conjugate; the drag is one more, c = l. Of each the rates are Fourier
series in α, whose coefficients are Chebyshev series in a, regular down to a = 0. They are divided by k₁ν₁ + k₂ν₂ when
they are wanted. `polhode.models.second_order.torus` has the same generator over all phases at once.
"""

from dataclasses import dataclass
from functools import cached_property, lru_cache
from math import pi, sqrt

import numpy as np
from numpy.polynomial.chebyshev import chebvander

from polhode.models.files import kept
from polhode.models.second_order.polhodes import Polhodes, SidedBody
from polhode.models.second_order.torus import least_rotation
from polhode.models.shape import Ellipsoid

Array = np.ndarray

# Changes whenever the numbers of a series do.
VERSION = 2
# Largest depth a² = -ln(1 - x), Chebyshev nodes in a up to there, polhode phases at them, Fourier terms kept.
MOST, NODES, PHASES, TERMS = 6.0, 40, 96, 25
_E, _Z = np.array([1, -1j, 0]), np.array([0, 0, 1])
_LEVEL, _TURN = np.diag([0.5, 0.5, -1]), np.array([[0, 0.5, 0], [-0.5, 0, 0], [0, 0, 0]])
BASIS = np.array([np.outer(_E, _E), np.outer(_E, _Z), np.outer(_Z, _E), _LEVEL, _TURN])
# k of each tensor and of the drag, and how often it counts.
TURNS = np.array([2, 1, 1, 0, 0, 0])
TWICE = np.where(TURNS > 0, 2, 1)
# What has rates: a y, a α, β + tα with t = (h - ν₂)/ν₁, L₃; L₁ + iL₂ of a tensor and of its conjugate.
RATES = 6
# Harmonic k₂ of each rate and tensor, and the orders k₁ kept there: k₁ + k₂ is even.
K2 = np.stack([-TURNS] * 4 + [1 - TURNS, 1 + TURNS])
HARMONICS = np.arange(-2, 4)
ORDERS = 2 * np.arange(TERMS)[:, None] - (TERMS - 1) + HARMONICS % 2
ORDERS = np.take_along_axis(ORDERS, np.argsort(np.abs(ORDERS), axis=0, kind="stable"), axis=0)
# Terms are left out below this share of the largest times St: over St they are rounding. Bounds of that share.
FAINT, LEAST_FAINT, MOST_FAINT = 1e-14, 1e-11, 1e-6
# Change of a divisor over its square above which it matters, and above which the asymptotic series does not hold.
BENT, CLOSE = 1e-5, 0.01


@dataclass(frozen=True)
class Swing:
    """Slow states on a side, m of them, and what the transformation does to them.

    Changes of L and turns of R are in the frame of L, over 1/St.
    """

    series: "Series"
    a2: Array
    alpha: Array
    beta: Array
    size: Array
    flow: Array  # the flow's directions x and y in the frame of L, shape (m, 3) each
    gradient: Array
    torque_factor: float

    @cached_property
    def body(self) -> tuple[Array, Array]:
        """S, shape (m, 3, 3), and n in body axes, shape (m, 3)."""
        polhode = Polhodes(self.series.side, np.log(np.expm1(self.a2)), self.alpha, 1)
        z = polhode.z[:, 0]
        turn = self.beta + self._shape[:, 0]
        cos, sin = np.cos(turn)[:, None], np.sin(turn)[:, None]
        least = least_rotation(z)
        rows = cos * least[:, 0] - sin * least[:, 1], sin * least[:, 0] + cos * least[:, 1], least[:, 2]
        return np.stack(rows, axis=1), z

    @cached_property
    def _shape(self) -> Array:
        return self.series.shape_at(self.a2, self.alpha)

    @cached_property
    def generator(self) -> tuple[Array, Array]:
        """Changes of L and turns of R, shape (m, 3) each."""
        m, size, a, i = len(self.a2), self.size, np.sqrt(self.a2), self.series.side.inverse_inertia
        terms, width = self.series.needed(a.max(), FAINT / self.torque_factor), RATES * len(TURNS)
        levels = _levels(self.a2)
        found = levels @ self.series.rates[:, : 2 * terms * width]
        found = found.view(complex).reshape(m, terms, RATES, len(TURNS))
        nu1, nu2, rise1, rise2 = (levels @ self.series.frequencies).T
        c = self._coefficients
        rise = np.real((c * found[:, 0, 0])[:, TURNS == 0].sum(axis=1)) / (a * size**2)

        wide, orders = (slice(None), None, None), ORDERS[:terms]
        divisor = orders * nu1[wide] + HARMONICS * nu2[wide]
        change = orders * rise1[wide] + HARMONICS * rise2[wide]
        twice, once = tails(divisor, (self.torque_factor * rise)[wide] * change)
        turns = powers(self.alpha, int(orders.max()))
        waves = np.concatenate([turns[:, :0:-1].conj(), turns], axis=1)[:, orders + turns.shape[1] - 1]
        waves *= np.exp(1j * HARMONICS * self.beta[:, None])[:, None]
        # The mean has no part in the generator.
        waves[:, 0, HARMONICS == 0] = 0
        once, twice = -1j * once * waves, twice * waves
        scalar, across, other = (harmonics - HARMONICS[0] for harmonics in K2[3:])
        firsts = np.einsum("mnrj,mnj->mrj", found[:, :, :4], once[:, :, scalar])
        seconds = np.einsum("mnrj,mnj->mrj", found[:, :, ::3][:, :, :2], twice[:, :, scalar])
        firsts, seconds = ((c[:, None] * TWICE * each).sum(axis=2).real for each in (firsts, seconds))
        moved = np.einsum("mnj,mnj->mj", found[:, :, 4], once[:, :, across]) * c
        moved += np.einsum("mnj,mnj->mj", found[:, :, 5], once[:, :, other]) * np.where(TURNS > 0, c.conj(), 0)
        across = moved.sum(axis=1) / size

        rotation, z = self.body
        drawn, growth, u_y = seconds[:, 0] / a, seconds[:, 1], firsts[:, 0] / a
        u_a = firsts[:, 1] / a - nu1 * growth - rise1 * drawn
        h = np.sum(i * z * z, axis=1)
        u_b = firsts[:, 2] - h * growth - (rise2 + (h - nu2) / nu1 * rise1) * drawn
        turn = np.cross((u_a / nu1)[:, None] * np.cross(z, i * z) + u_y[:, None] * self._shape[:, 2:], z)
        turn = np.einsum("mij,mj->mi", rotation, turn + (u_b + u_y * self._shape[:, 1])[:, None] * z)
        change_l = np.stack([across.real, across.imag, firsts[:, 3] / size], axis=1)
        tilt = np.stack([-across.imag, across.real, 0 * size], axis=1) / size[:, None]
        return change_l, turn / (size**2)[:, None] + tilt

    @property
    def _coefficients(self) -> Array:
        return coefficients(self.flow, self.gradient, self.size)


@dataclass(frozen=True)
class Series:
    """Chebyshev coefficients in a, NODES of each: real and imaginary parts behind each other."""

    side: SidedBody
    rates: Array  # of TERMS × RATES × tensors
    shape: Array  # of χ, turn and change of n per y: Fourier coefficients of real functions, from k₁ = 0 on
    frequencies: Array  # ν₁, ν₂ and their derivatives with respect to y

    @cached_property
    def _sizes(self) -> Array:
        """Of the rates, over the largest: that of each term at each node's a."""
        found = (_levels(_nodes()[1] ** 2) @ self.rates).view(complex).reshape(NODES, TERMS, -1)
        sizes = np.abs(found).max(axis=2)
        return sizes / sizes.max(axis=1)[:, None]

    def needed(self, a: float, faint: float) -> int:
        """Terms that matter up to a, fainter ones left out."""
        beyond = max(0, int(np.sum(_nodes()[1] >= a)) - 1)
        return int(np.flatnonzero(self._sizes[beyond] > min(MOST_FAINT, max(LEAST_FAINT, faint)))[-1]) + 1

    def shape_at(self, a2: Array, alpha: Array) -> Array:
        """χ, the turn of S about n per y and the change of n per y, shape (m, 5)."""
        found = (_levels(a2) @ self.shape).view(complex).reshape(len(a2), 5, -1)
        waves = powers(alpha, found.shape[2] - 1)
        return np.matmul(found, waves[:, :, None])[..., 0].real


def tails(x: Array, q: Array) -> tuple[Array, Array]:
    """What stands for 1/x² and 1/x of a divisor x that changes by q while the phase turns by a radian.

    The integral of the mode from long before its resonance, behind it to long after, and the integral of that: their
    asymptotic series in q/x² or, near the resonance, what these belong to, Faddeeva's function.
    """
    from scipy.special import wofz

    over = np.divide(1, x, out=np.zeros_like(x), where=x != 0)
    bent = np.where(x == 0, np.inf, np.abs(q) * over**2)
    once, twice = over.astype(complex), (over**2).astype(complex)
    some = (bent > BENT) & (q != 0)
    u = -1j * (q * over**2)[some]
    once[some] *= 1 + u * (1 + u * (3 + u * 15))
    twice[some] *= 1 + u * (3 + u * (15 + u * 105))
    close = some & (bent > CLOSE)
    root, sign = np.sqrt(-0.5j * q[close]), np.where(x[close] * q[close] > 0, -1, 1)
    z = -sign * x[close] / (2 * root)
    found = wofz(z)
    once[close] = sign * 0.5j * sqrt(pi) / root * found
    twice[close] = -0.5 / root**2 * (1 + 1j * sqrt(pi) * z * found)
    return twice, once


def powers(alpha: Array, most: int) -> Array:
    """exp(ikα) for k = 0 … `most`, shape (m, most + 1)."""
    found = np.tile(np.exp(1j * alpha)[:, None], (1, most + 1))
    found[:, 0] = 1
    return np.multiply.accumulate(found, axis=1)


def _levels(a2: Array) -> Array:
    return chebvander(2 * np.sqrt(a2 / MOST) - 1, NODES - 1)


def coefficients(flow: Array, gradient: Array, size: Array) -> Array:
    """The tensors' c, shape (m, 6), from the flow's directions in the frame of L, shape (m, 3) each, and |L|."""
    x, y = (each[:, 0] + 1j * each[:, 1] for each in (flow, gradient))
    level = x * y.conj()
    up, down = x * gradient[:, 2] / 2, flow[:, 2] * y / 2
    return np.stack([x * y / 4, up, down, level.real, -level.imag, size], axis=1)


def frame(momentum: Array, first: Array) -> Array:
    """Q, shape (m, 3, 3): columns e₁, n × e₁, n."""
    n = momentum / np.linalg.norm(momentum, axis=1)[:, None]
    first = first - np.sum(n * first, axis=1)[:, None] * n
    first = first / np.linalg.norm(first, axis=1)[:, None]
    return np.stack([first, np.cross(n, first), n], axis=-1)


def frame_of(momentum: Array) -> Array:
    """Frames Q of L alone, shape (m, 3, 3)."""
    return frame(momentum, np.eye(3)[np.argmin(np.abs(momentum), axis=1)])


def modes_at(series: "Series", momentum: Array, a2: Array, k1: Array, k2: Array) -> tuple[Array, Array, Array]:
    """Modes P exp i(k₁α + k₂β) + c.c. of the rates in slow time, one for each L, shape (m, 3), and a²; k₂ > 0.

    |P| of L', then P* of l' and of y', shape (m,) each.
    """
    size = np.linalg.norm(momentum, axis=1)
    q, many = frame_of(momentum), np.arange(len(a2))
    c = coefficients(q[:, 0], q[:, 1], size)
    found = (_levels(a2) @ series.rates).view(complex).reshape(len(a2), TERMS, RATES, len(TURNS))

    def part(rate: int, sign: int, factors: Array) -> Array:
        column = np.clip(sign * k2 - HARMONICS[0], 0, len(HARMONICS) - 1)
        row = np.argmax(ORDERS[:, column] == sign * k1, axis=0)
        counts = (ORDERS[row, column] == sign * k1)[:, None] & (K2[rate] == sign * k2[:, None])
        return np.sum(np.where(counts, factors * found[many, row, rate], 0), axis=1)

    flat, other = (part(4, sign, c) + part(5, sign, np.where(TURNS > 0, c.conj(), 0)) for sign in (1, -1))
    along, rise = part(3, -1, c), part(0, -1, c) / (np.sqrt(a2) * size)
    return np.sqrt((np.abs(flat) ** 2 + np.abs(other) ** 2) / 2 + np.abs(along) ** 2), along, rise


def swing_at(
    series: Series, momentum: Array, q: Array, a2: Array, alpha: Array, beta: Array, torque_factor: float
) -> Swing:
    """States with L, shape (m, 3), in frames Q, shape (m, 3, 3)."""
    return Swing(series, a2, alpha, beta, np.linalg.norm(momentum, axis=1), q[:, 0], q[:, 1], torque_factor)


def _nodes() -> tuple[Array, Array]:
    """Angles of the Chebyshev nodes, and their a, from the largest on."""
    angles = np.pi * (np.arange(NODES) + 0.5) / NODES
    return angles, 0.5 * np.sqrt(MOST) * (1 + np.cos(angles))


@lru_cache(maxsize=64)
def series_for(ellipsoid: Ellipsoid, longest: bool) -> Series:
    """The series of one side: that around the longest semi-axis, or that around the shortest; kept on disk."""
    axis = ellipsoid.order[0 if longest else 2]
    side, key = SidedBody.of(ellipsoid, np.eye(3)[axis]), f"swing {VERSION} {ellipsoid.scaled_axes} {longest}"
    numbers = kept.load(key)
    if numbers is None:
        found = series_of(side)
        kept.save(key, np.concatenate([found.rates, found.shape, found.frequencies], axis=1))
        return found
    rows = numbers.reshape(NODES, -1)
    parts = np.split(rows, [2 * TERMS * RATES * len(TURNS), -4], axis=1)
    return Series(side, *(np.ascontiguousarray(each) for each in parts))


def series_of(side: SidedBody) -> Series:
    """The series of a side."""
    angles, a = _nodes()
    p = Polhodes(side, np.log(np.expm1(a * a)), np.zeros(NODES), PHASES)
    z, dz, yz = p.z, p.along, p.beside.z
    least = least_rotation(z)
    cos, sin = np.cos(p.lead)[..., None], np.sin(p.lead)[..., None]
    rows = cos * least[..., 0, :] - sin * least[..., 1, :], sin * least[..., 0, :] + cos * least[..., 1, :]
    body = np.stack([*rows, least[..., 2, :]], axis=-2)
    tensors = np.einsum("naik,jil,nalm->jnakm", body, BASIS, body, optimize=True)
    flows = turned(side, tensors)
    tau = side.drag * np.concatenate([flows, (-side.inverse_inertia * z)[None]])
    rate_y = 2 / p.slope[:, None] * np.sum(p.beyond[:, None] * z * tau, axis=-1)
    rate_a = (np.sum(tau * dz, axis=-1) - rate_y * np.sum(yz * dz, axis=-1)) / np.sum(dz * dz, axis=-1)
    beside = p.beside.lead + (z[..., 0] * yz[..., 1] - z[..., 1] * yz[..., 0]) / (1 + z[..., 2])
    lx, ly, lz = np.moveaxis(np.einsum("naik,jnak->jnai", body, tau), -1, 0)
    scale = a[:, None]
    rates = np.stack([scale * rate_y, scale * rate_a, -rate_y * beside, lz, lx + 1j * ly, lx.conj() + 1j * ly.conj()])
    spectrum = np.fft.fft(rates, axis=-1, norm="forward")
    orders = ORDERS.T[K2 - HARMONICS[0]][:, :, None] % PHASES
    picked = np.transpose(np.take_along_axis(spectrum, orders, axis=-1), (2, 3, 0, 1))
    shape = np.fft.fft(np.stack([p.lead, beside, *np.moveaxis(yz, -1, 0)]), axis=-1, norm="forward")
    shape = shape[..., : PHASES // 2] * np.where(np.arange(PHASES // 2) > 0, 2, 1)
    frequencies = np.stack([p.rate, p.precession, p.beside.rate, p.beside.precession])
    weights = 2 / NODES * np.cos(np.outer(np.arange(NODES), angles))
    weights[0] /= 2

    def chebyshev(values: Array) -> Array:
        return (weights @ values.reshape(NODES, -1)).view(float)

    shape = np.moveaxis(shape, 0, 1)
    return Series(side, chebyshev(picked), chebyshev(shape), weights @ frequencies.T)


def turned(side: SidedBody, tensor: Array) -> Array:
    """`turning` of a tensor x⊗y in body axes, shape (..., 3, 3)."""
    s = side.squares
    pairs = ((1, 2), (2, 0), (0, 1))
    return np.stack([(s[j] * tensor[..., k, j] - s[k] * tensor[..., j, k]) / (s[j] + s[k]) for j, k in pairs], axis=-1)
