"""Size of the near-identity transformation of a triaxial ellipsoid, a mean over the torus.

`docs/second-order.md`, section 8, has it as ρ. The transformation is linear in the coefficients c₀
… c₅ of `polhode.models.second_order.swing`: the mean of its square is a quadratic form in them,
whose matrix depends on a alone. The matrices come from the transformation of unit coefficients,
once for each shape and side. At a place, a few products of c's are put in.
"""

from math import pi

import numpy as np

from polhode.models.files import cached
from polhode.models.once import once
from polhode.models.second_order import swing
from polhode.models.second_order.swing import DEPTHS, Place, series_for
from polhode.models.shape import Ellipsoid

Array = np.ndarray

# Changes whenever the numbers below do; `swing.VERSION` stands for the series.
_VERSION = 1
# Values of a at which means are taken, shape (20,): every other node of the series. Between them a
# linear interpolation is near enough: the size is an estimate, and a test allows it 5 %.
_DEPTHS = DEPTHS[::2]
# Unit coefficients, shape (9, 6): each row has a single c that is not 0. In rows 0 to 5 it is 1, of
# tensor 0 to 5. In rows 6 to 8 it is i, of the tensors 0 to 2, whose k > 0 makes their c complex.
_UNITS = np.concatenate([np.eye(6), 1j * np.eye(6)[:3]])
# Polhode phases α, in rad, over which means are taken. Products that the mean over turns keeps have
# the period π in α, as k₁ + k₂ is even. The first phase is a quarter of a spacing, so that the four
# are as good as eight for a product that is even in α.
_PHASES = pi / 4 * (np.arange(4) + 0.25)
# A turn about L by β multiplies c of a tensor by e^(-ikβ). The mean over all turns therefore keeps
# only the products of two c's that have the same k. Each of these products multiplies a sum of two
# entries of the matrix of `squares_of`. An entry is named by the rows p, q of `_UNITS` that it
# belongs to; shares are the factors of the two entries:
#
#     product       |c₀|² |c₁|² |c₂|² Re c₁c₂* Im c₁c₂* c₃²  c₄²  c₅²  c₃c₄ c₃c₅ c₄c₅
#     first pair     0,0   1,1   2,2    1,2      7,2    3,3  4,4  5,5  3,4  3,5  4,5
#     second pair    6,6   7,7   8,8    7,8      1,8    3,3  4,4  5,5  3,4  3,5  4,5
#     shares         ½ ½   ½ ½   ½ ½    1 1      1 -1   ½ ½  ½ ½  ½ ½  1 1  1 1  1 1
#
# For |c₀|² it is the mean of the squares for c₀ = 1 and c₀ = i. For two different c's it is twice
# the mean, as p, q and q, p both belong to it. Real c's, from c₃ on, have one entry, taken twice.
_PAIRS = [0, 1, 2, 1, 7, 3, 4, 5, 3, 3, 4], [0, 1, 2, 2, 2, 3, 4, 5, 4, 5, 5]
_SECOND_PAIRS = [6, 7, 8, 7, 1, 3, 4, 5, 3, 3, 4], [6, 7, 8, 8, 8, 3, 4, 5, 4, 5, 5]
_SHARES = np.array(
    [[0.5, 0.5, 0.5, 1, 1, 0.5, 0.5, 0.5, 1, 1, 1], [0.5, 0.5, 0.5, 1, -1, 0.5, 0.5, 0.5, 1, 1, 1]]
)
# 1/St at which means are taken: so small that the transformation is linear in it. Only next to a
# resonance would a finite 1/St limit it.
_SLIGHT = 1e-12


def extent(ellipsoid: Ellipsoid, longest: bool, momentum: Array, a2: Array) -> Array:
    """Size of the transformation times St, shape (m,), at each L, shape (m, 3), and a², shape (m,).

    It is √2 times the root mean square, over the torus, of the relative change of L and the turn of
    R in rad, both together: the amplitude, if it were one wave.
    """
    size = np.linalg.norm(momentum, axis=1)
    a = np.sqrt(a2)
    # The products of c's in the order of `_PAIRS`, from the table of c in `docs/second-order.md`,
    # section 5. With n = L/|L|, the flow's directions x and y have the components x₃ = n_x and y₃ =
    # n_y along L. So |x̂|² = 1 - n_x², |ŷ|² = 1 - n_y², and x̂ŷ* = -n_x n_y - i n_z.
    x, y, z = momentum.T / size
    xx = x * x
    yy = y * y
    xy = -x * y
    products = (
        (1 - xx) * (1 - yy) / 16,
        (1 - xx) * yy / 4,
        xx * (1 - yy) / 4,
        -xy * xy / 4,
        xy * z / 4,
    )
    products = *products, xy * xy, z * z, size * size, xy * z, xy * size, z * size
    # Linear interpolation between the values of a at `at` - 1 and `at`.
    at = np.clip(np.searchsorted(_DEPTHS, a), 1, len(_DEPTHS) - 1)
    share = np.clip((a - _DEPTHS[at - 1]) / (_DEPTHS[at] - _DEPTHS[at - 1]), 0, 1)
    squares = squares_for(ellipsoid, longest)
    squares = (1 - share) * squares[:, at - 1] + share * squares[:, at]
    # The factors belong to |L| = 1. A torque acts for a time like 1/|L| before its sign changes,
    # and changes L by a share of |L|.
    return np.sqrt(2 * np.sum(squares * np.array(products), axis=0)) / size**2


@once()
def squares_for(ellipsoid: Ellipsoid, longest: bool) -> Array:
    """Factors of the 11 products, shape (11, 20), at each of `_DEPTHS` at |L| = 1.

    They are means over turns about L. The matrices of `squares_of` are cached on disk.
    """
    key = f"extent of the swing {_VERSION} {swing.VERSION} {ellipsoid.scaled_axes} {longest}"
    numbers = cached.load(key)
    if numbers is None:
        numbers = squares_of(series_for(ellipsoid, longest))
        cached.save(key, numbers)
    squares = numbers.reshape(len(_DEPTHS), len(_UNITS), len(_UNITS))
    return (squares[:, *_PAIRS] * _SHARES[0] + squares[:, *_SECOND_PAIRS] * _SHARES[1]).T


def squares_of(series: swing.Series) -> Array:
    """Matrices at each of `_DEPTHS` at |L| = 1, shape (20, 9, 9), from the series of a side.

    Entry p, q is the mean over `_PHASES` of the scalar product of the changes by rows p and q of
    `_UNITS`. A change has six numbers, three for L and three for R.
    """
    a2, alpha = (
        np.repeat(grid.ravel(), len(_UNITS))
        for grid in np.meshgrid(_DEPTHS**2, _PHASES, indexing="ij")
    )
    place = Place(series, a2, alpha, series.side.normal(-np.expm1(-a2), np.exp(-a2), alpha))
    units = np.tile(_UNITS, (len(_DEPTHS) * len(_PHASES), 1))
    moved = place.moved(units, np.ones(len(a2)), _SLIGHT) / _SLIGHT
    moved = moved.reshape(len(_DEPTHS), len(_PHASES), len(_UNITS), -1)
    squares = np.einsum("napk,naqk->npq", moved, moved) / len(_PHASES)
    # A resonance next to a single value of a makes a peak there, which would stand for all a up to
    # the next values. Kicks count resonances apart, so that the peak is cut down to the median of
    # three neighbours.
    sizes = np.trace(squares, axis1=1, axis2=2)
    padded = np.concatenate([sizes[:1], sizes, sizes[-1:]])
    usual = np.median([padded[:-2], sizes, padded[2:]], axis=0)
    return squares * np.minimum(1, usual / sizes)[:, None, None]
