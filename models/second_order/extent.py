"""Size of the near-identity transformation of a triaxial ellipsoid, a mean over the torus.

It is linear in the coefficients c of `polhode.models.second_order.swing`: the mean of its square is
a quadratic form in them, whose matrix depends on a alone.
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
# Values of a at which means are taken: every other node of the series.
_DEPTHS = DEPTHS[::2]
# Unit coefficients: c is 1 for one tensor, then i for one tensor of k > 0.
_UNITS = np.concatenate([np.eye(6), 1j * np.eye(6)[:3]])
# Polhode phases, in rad, over which means are taken.
_PHASES = pi / 4 * (np.arange(4) + 0.25)
# Means over turns about L keep products of c of one k alone. Each product multiplies a sum over two
# pairs of unit coefficients; numbers below 6 are c = 1 of a tensor, 6, 7 and 8 are c = i of the
# first three:
#
#     product       |c₀|² |c₁|² |c₂|² Re c₁c₂* Im c₁c₂* c₃²  c₄²  c₅²  c₃c₄ c₃c₅ c₄c₅
#     first pair     0,0   1,1   2,2    1,2      7,2    3,3  4,4  5,5  3,4  3,5  4,5
#     second pair    6,6   7,7   8,8    7,8      1,8    3,3  4,4  5,5  3,4  3,5  4,5
#     shares         ½ ½   ½ ½   ½ ½    1 1      1 -1   ½ ½  ½ ½  ½ ½  1 1  1 1  1 1
_PAIRS = [0, 1, 2, 1, 7, 3, 4, 5, 3, 3, 4], [0, 1, 2, 2, 2, 3, 4, 5, 4, 5, 5]
_SECOND_PAIRS = [6, 7, 8, 7, 1, 3, 4, 5, 3, 3, 4], [6, 7, 8, 8, 8, 3, 4, 5, 4, 5, 5]
_SHARES = np.array(
    [[0.5, 0.5, 0.5, 1, 1, 0.5, 0.5, 0.5, 1, 1, 1], [0.5, 0.5, 0.5, 1, -1, 0.5, 0.5, 0.5, 1, 1, 1]]
)
# 1/St at which means are taken: the transformation is linear in it there.
_SLIGHT = 1e-12


def extent(ellipsoid: Ellipsoid, longest: bool, momentum: Array, a2: Array) -> Array:
    """Size of the transformation times St at each L, shape (m, 3), and a²: √2 times its rms."""
    size = np.linalg.norm(momentum, axis=1)
    a = np.sqrt(a2)
    # The products in the order of `_PAIRS`. Along L the flow's x and y are n_x and n_y, so that across
    # it xy* is -n_x n_y - i n_z.
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
    at = np.clip(np.searchsorted(_DEPTHS, a), 1, len(_DEPTHS) - 1)
    share = np.clip((a - _DEPTHS[at - 1]) / (_DEPTHS[at] - _DEPTHS[at - 1]), 0, 1)
    squares = squares_for(ellipsoid, longest)
    squares = (1 - share) * squares[:, at - 1] + share * squares[:, at]
    return np.sqrt(2 * np.sum(squares * np.array(products), axis=0)) / size**2


@once()
def squares_for(ellipsoid: Ellipsoid, longest: bool) -> Array:
    """Factors of the products at each of `_DEPTHS` at |L| = 1, means over turns; cached on disk."""
    key = f"extent of the swing {_VERSION} {swing.VERSION} {ellipsoid.scaled_axes} {longest}"
    numbers = cached.load(key)
    if numbers is None:
        numbers = squares_of(series_for(ellipsoid, longest))
        cached.save(key, numbers)
    squares = numbers.reshape(len(_DEPTHS), len(_UNITS), len(_UNITS))
    return (squares[:, *_PAIRS] * _SHARES[0] + squares[:, *_SECOND_PAIRS] * _SHARES[1]).T


def squares_of(series: swing.Series) -> Array:
    """The same from the series of a side, single resonances left out."""
    a2, alpha = (
        np.repeat(grid.ravel(), len(_UNITS))
        for grid in np.meshgrid(_DEPTHS**2, _PHASES, indexing="ij")
    )
    place = Place(series, a2, alpha, series.side.normal(-np.expm1(-a2), np.exp(-a2), alpha))
    units = np.tile(_UNITS, (len(_DEPTHS) * len(_PHASES), 1))
    moved = place.moved(units, np.ones(len(a2)), _SLIGHT) / _SLIGHT
    moved = moved.reshape(len(_DEPTHS), len(_PHASES), len(_UNITS), -1)
    squares = np.einsum("napk,naqk->npq", moved, moved) / len(_PHASES)
    sizes = np.trace(squares, axis1=1, axis2=2)
    padded = np.concatenate([sizes[:1], sizes, sizes[-1:]])
    usual = np.median([padded[:-2], sizes, padded[2:]], axis=0)
    return squares * np.minimum(1, usual / sizes)[:, None, None]
