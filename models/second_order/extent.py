"""How large the near-identity transformation of a triaxial ellipsoid is, over the torus, per shape and side.

It is linear in the coefficients c of `polhode.models.second_order.swing`: the mean of its square is
a quadratic form in them, whose matrix depends on a alone.
"""

from math import pi

import numpy as np

from polhode.models.files import kept
from polhode.models.once import once
from polhode.models.second_order import swing
from polhode.models.second_order.swing import DEPTHS as EVERY, Place, series_for
from polhode.models.shape import Ellipsoid

Array = np.ndarray

# Changes whenever the numbers do, beside those of the series.
_VERSION = 1
# The values of a.
DEPTHS = EVERY[::2]
# All c that are 1, then those of k > 0 that are i.
_UNITS = np.concatenate([np.eye(6), 1j * np.eye(6)[:3]])
# Polhode phases that means are taken over.
_PHASES = pi / 4 * (np.arange(4) + 0.25)
# A mean over turns about L keeps products of c of the same k: |c₀|², |c₁|², |c₂|², the real and the
# imaginary part of c₁c₂*, and those of c₃, c₄ and c₅. Of each, two pairs of units that give it, and
# their shares.
_PAIRS = [0, 1, 2, 1, 7, 3, 4, 5, 3, 3, 4], [0, 1, 2, 2, 2, 3, 4, 5, 4, 5, 5]
_OTHERS = [6, 7, 8, 7, 1, 3, 4, 5, 3, 3, 4], [6, 7, 8, 8, 8, 3, 4, 5, 4, 5, 5]
_SHARES = np.array(
    [[0.5, 0.5, 0.5, 1, 1, 0.5, 0.5, 0.5, 1, 1, 1], [0.5, 0.5, 0.5, 1, -1, 0.5, 0.5, 0.5, 1, 1, 1]]
)
# 1/St at which they are taken.
_SLIGHT = 1e-12


def extent(ellipsoid: Ellipsoid, longest: bool, momentum: Array, a2: Array) -> Array:
    """Size of the transformation times St at each L, shape (m, 3), and a²: √2 times the root mean square."""
    size = np.linalg.norm(momentum, axis=1)
    a = np.sqrt(a2)
    # Along L the flow's x and y are n_x and n_y, so that across it xy* is -n_x n_y - i n_z.
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
    at = np.clip(np.searchsorted(DEPTHS, a), 1, len(DEPTHS) - 1)
    share = np.clip((a - DEPTHS[at - 1]) / (DEPTHS[at] - DEPTHS[at - 1]), 0, 1)
    squares = squares_for(ellipsoid, longest)
    squares = (1 - share) * squares[:, at - 1] + share * squares[:, at]
    return np.sqrt(2 * np.sum(squares * np.array(products), axis=0)) / size**2


@once()
def squares_for(ellipsoid: Ellipsoid, longest: bool) -> Array:
    """Factors of products of `_PAIRS` at the nodes of the series, at |L| = 1: the mean over turns; kept on disk."""
    key = f"extent of the swing {_VERSION} {swing.VERSION} {ellipsoid.scaled_axes} {longest}"
    found = kept.load(key)
    if found is None:
        kept.save(key, found := squares_of(series_for(ellipsoid, longest)))
    squares = found.reshape(len(DEPTHS), len(_UNITS), len(_UNITS))
    return (squares[:, *_PAIRS] * _SHARES[0] + squares[:, *_OTHERS] * _SHARES[1]).T


def squares_of(series: swing.Series) -> Array:
    """The same from the series of a side, single resonances left out."""
    a2, alpha = (
        np.repeat(each.ravel(), len(_UNITS))
        for each in np.meshgrid(DEPTHS**2, _PHASES, indexing="ij")
    )
    place = Place(series, a2, alpha, series.side.normal(-np.expm1(-a2), np.exp(-a2), alpha))
    units = np.tile(_UNITS, (len(DEPTHS) * len(_PHASES), 1))
    moved = place.moved(units, np.ones(len(a2)), _SLIGHT) / _SLIGHT
    moved = moved.reshape(len(DEPTHS), len(_PHASES), len(_UNITS), -1)
    squares = np.einsum("napk,naqk->npq", moved, moved) / len(_PHASES)
    sizes = np.trace(squares, axis1=1, axis2=2)
    padded = np.concatenate([sizes[:1], sizes, sizes[-1:]])
    usual = np.median([padded[:-2], sizes, padded[2:]], axis=0)
    return squares * np.minimum(1, usual / sizes)[:, None, None]
