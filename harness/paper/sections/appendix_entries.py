"""The appendices' tables of averages, in their order: means over rotations, and the formulas printed for them.

A formula is a function of n and z: n = L/|L| in space axes, and z = (⟨z₁²⟩, ⟨z₂²⟩, ⟨z₃²⟩) has the
mean squares of z_i, the component of body axis i along L. In names of entries, x'1 x'2 y'3 are the
components t_11, t_21, t_32; without a stroke they are components in axes along L.
`polhode.harness.paper.sections.appendix` compares the formulas with the means.
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import permutations, product

import numpy as np

Value = float | np.ndarray
Mean = Callable[[np.ndarray, np.ndarray], Value]
"""The mean over rotations t_ij in space axes and u_ij in axes along L, shape (n, 3, 3) each."""
Formula = Callable[[np.ndarray, np.ndarray], Value]
"""A formula's value from n and z, shape (3,) each."""

_LETTERS = "xyz"
# Indices of the general formulas: three different rows, and any three columns.
_ROWS = tuple(permutations(range(3)))
_COLUMN_TRIPLES = tuple(product(range(3), repeat=3))
# The general formula of the mixed third moments.
MIXED = "⟨t_i3,LO t_j1 t_k2⟩"


@dataclass(frozen=True)
class Entry:
    """A mean, the formula that is printed for it and, where that is wrong, the right one."""

    name: str
    mean: Mean
    printed: Formula
    corrected: Formula | None = None

    def deviations(self, t: np.ndarray, u: np.ndarray, n: np.ndarray, z: np.ndarray) -> list[float]:
        """Largest deviation of the printed and of the corrected formula from the mean."""
        mean = self.mean(t, u)
        formulas = (self.printed, self.corrected or self.printed)
        return [float(np.max(np.abs(mean - formula(n, z)))) for formula in formulas]


def sign_of(i: int, j: int, k: int) -> float:
    """ε_ijk: 1 for even permutations of (0, 1, 2), -1 for odd ones, else 0."""
    return (i - j) * (j - k) * (k - i) / 2


def _zero(n: np.ndarray, z: np.ndarray) -> float:
    """The formula of the moments that vanish."""
    return 0.0


def _moment(words: str, printed: Formula, corrected: Formula | None = None) -> Entry:
    """An entry for the mean of a product of components, each a word such as x1 or z'3.

    The letter is the axis, the number the body axis, and a stroke means space axes.
    """
    # By word: column and row of the matrix, and whether it is t, in space axes, or u.
    factors = [(_LETTERS.index(word[0]), int(word[-1]) - 1, "'" in word) for word in words.split()]

    def mean(t: np.ndarray, u: np.ndarray) -> float:
        values = [(t if space else u)[:, row, column] for column, row, space in factors]
        return float(np.mean(np.prod(values, axis=0)))

    return Entry(f"⟨{words}⟩", mean, printed, corrected)


def _mean(value: Callable[[np.ndarray], np.ndarray], axis: np.ndarray) -> float:
    """The mean of a function of the axis p, shape (3, n)."""
    return float(np.mean(value(axis)))


def spheroid_entries() -> list[Entry]:
    """The eight entries of the spheroid's table.

    Here `t` holds the symmetry axis p = (sin θ sin φ, -sin θ cos φ, cos θ), shape (3, n), `u` is
    not used, and z is (h²,). h is the cosine of the angle between p and L.
    """
    return [
        Entry("cos θ", lambda t, u: _mean(lambda p: p[2], t), lambda n, z: n[2] * z[0] ** 0.5),
        Entry(
            "cos² θ",
            lambda t, u: _mean(lambda p: p[2] ** 2, t),
            lambda n, z: n[2] ** 2 * z[0] + (n[0] ** 2 + n[1] ** 2) * (1 - z[0]) / 2,
        ),
        Entry(
            "sin θ sin φ", lambda t, u: _mean(lambda p: p[0], t), lambda n, z: n[0] * z[0] ** 0.5
        ),
        Entry(
            "sin θ cos φ", lambda t, u: _mean(lambda p: -p[1], t), lambda n, z: -n[1] * z[0] ** 0.5
        ),
        Entry(
            "sin² θ sin² φ",
            lambda t, u: _mean(lambda p: p[0] ** 2, t),
            lambda n, z: (
                n[0] ** 2 * z[0]
                + (n[1] ** 2 + n[0] ** 2 * n[2] ** 2) * (1 - z[0]) / (2 * (n[0] ** 2 + n[1] ** 2))
            ),
        ),
        Entry(
            "sin² θ cos² φ",
            lambda t, u: _mean(lambda p: p[1] ** 2, t),
            lambda n, z: (
                n[1] ** 2 * z[0]
                + (n[0] ** 2 + n[1] ** 2 * n[2] ** 2) * (1 - z[0]) / (2 * (n[0] ** 2 + n[1] ** 2))
            ),
        ),
        Entry(
            "sin θ cos φ cos θ",
            lambda t, u: _mean(lambda p: -p[1] * p[2], t),
            lambda n, z: -(n[1] * n[2] * (z[0] - (1 - z[0]) / 2)),
        ),
        Entry(
            "sin θ sin φ cos θ",
            lambda t, u: _mean(lambda p: p[0] * p[2], t),
            lambda n, z: n[0] * n[2] * (z[0] - (1 - z[0]) / 2),
        ),
    ]


def ellipsoid_entries() -> list[Entry]:
    """Entries and general formulas of the ellipsoid's table, in its order."""
    return [
        *_second_aligned_entries(),
        _GENERAL_SECOND_ALIGNED,
        *_third_aligned_entries(),
        _GENERAL_THIRD_ALIGNED,
        *_third_mixed_entries(),
        _GENERAL_THIRD_MIXED,
        *_third_space_entries(),
        _GENERAL_THIRD_SPACE,
        *_second_space_entries(),
        _GENERAL_SECOND_SPACE,
    ]


def mixed_names() -> list[str]:
    """Names of the mixed third moments."""
    return [entry.name for entry in _third_mixed_entries()]


def _second_aligned_entries() -> list[Entry]:
    """Second moments in axes along L."""
    return [
        _moment("z1 z1", lambda n, z: z[0]),
        _moment("x1 x1", lambda n, z: (1 - z[0]) / 2),
        _moment("y1 y1", lambda n, z: (1 - z[0]) / 2),
        _moment("x1 y1", _zero),
        _moment("x1 z1", _zero),
        _moment("y1 z1", _zero),
        _moment("z2 z2", lambda n, z: z[1]),
        _moment("x2 x2", lambda n, z: (1 - z[1]) / 2),
        _moment("y2 y2", lambda n, z: (1 - z[1]) / 2),
        _moment("x2 y2", _zero),
        _moment("x2 z2", _zero),
        _moment("y2 z2", _zero),
        _moment("z3 z3", lambda n, z: z[2]),
        _moment("x3 x3", lambda n, z: (1 - z[2]) / 2),
        _moment("y3 y3", lambda n, z: (1 - z[2]) / 2),
        _moment("x3 y3", _zero),
        _moment("x3 z3", _zero),
        _moment("y3 z3", _zero),
    ]


def _third_aligned_entries() -> list[Entry]:
    """Third moments in axes along L."""
    return [
        _moment("x1 x2 z3", _zero),
        _moment("x1 z2 x3", _zero),
        _moment("z1 x2 x3", _zero),
        _moment("y1 y2 z3", _zero),
        _moment("y1 z2 y3", _zero),
        _moment("z1 y2 y3", _zero),
        _moment("x1 x2 y3", _zero),
        _moment("x1 y2 x3", _zero),
        _moment("y1 x2 x3", _zero),
        _moment("y1 y2 x3", _zero),
        _moment("y1 x2 y3", _zero),
        _moment("x1 y2 y3", _zero),
        _moment("z1 z2 x3", _zero),
        _moment("z1 x2 z3", _zero),
        _moment("x1 z2 z3", _zero),
        _moment("z1 z2 y3", _zero),
        _moment("z1 y2 z3", _zero),
        _moment("y1 z2 z3", _zero),
        _moment("x1 x2 x3", _zero),
        _moment("y1 y2 y3", _zero),
        _moment("z1 z2 z3", _zero),
        _moment("z1 x2 y3", lambda n, z: z[0] / 2),
        _moment("z1 y2 x3", lambda n, z: -z[0] / 2),
        _moment("y1 z2 x3", lambda n, z: z[1] / 2),
        _moment("x1 z2 y3", lambda n, z: -z[1] / 2),
        _moment("x1 y2 z3", lambda n, z: z[2] / 2),
        _moment("y1 x2 z3", lambda n, z: -z[2] / 2),
    ]


def _third_mixed_entries() -> list[Entry]:
    """Third moments of one component along L and two in space; printed without the factor α₃₃/2."""
    return [
        _moment("z1 x'2 y'3", lambda n, z: z[0], lambda n, z: n[2] / 2 * z[0]),
        _moment("z1 x'3 y'2", lambda n, z: -z[0], lambda n, z: -n[2] / 2 * z[0]),
        _moment("z2 x'1 y'3", lambda n, z: -z[1], lambda n, z: -n[2] / 2 * z[1]),
        _moment("z2 x'3 y'1", lambda n, z: z[1], lambda n, z: n[2] / 2 * z[1]),
        _moment("z3 x'1 y'2", lambda n, z: z[2], lambda n, z: n[2] / 2 * z[2]),
        _moment("z3 x'2 y'1", lambda n, z: -z[2], lambda n, z: -n[2] / 2 * z[2]),
    ]


def _third_space_entries() -> list[Entry]:
    """Third moments in space axes."""
    return [
        _moment("x'1 x'2 y'3", lambda n, z: n[0] * n[2] * (z[0] - z[1]) / 2),
        _moment("x'2 x'3 y'1", lambda n, z: n[0] * n[2] * (z[1] - z[2]) / 2),
        _moment("x'3 x'1 y'2", lambda n, z: n[0] * n[2] * (z[2] - z[0]) / 2),
        _moment("y'1 x'3 y'2", lambda n, z: n[1] * n[2] * (z[1] - z[0]) / 2),
        _moment("y'2 x'1 y'3", lambda n, z: n[1] * n[2] * (z[2] - z[1]) / 2),
        _moment("y'3 x'2 y'1", lambda n, z: n[1] * n[2] * (z[0] - z[2]) / 2),
        _moment(
            "z'1 x'2 y'3", lambda n, z: (n[0] ** 2 * z[1] + n[1] ** 2 * z[2] + n[2] ** 2 * z[0]) / 2
        ),
        _moment(
            "z'2 x'3 y'1", lambda n, z: (n[0] ** 2 * z[2] + n[1] ** 2 * z[0] + n[2] ** 2 * z[1]) / 2
        ),
        _moment(
            "z'3 x'1 y'2", lambda n, z: (n[0] ** 2 * z[0] + n[1] ** 2 * z[1] + n[2] ** 2 * z[2]) / 2
        ),
        _moment(
            "z'1 x'3 y'2",
            lambda n, z: -(n[0] ** 2 * z[2] + n[1] ** 2 * z[1] + n[2] ** 2 * z[0]) / 2,
        ),
        _moment(
            "z'2 x'1 y'3",
            lambda n, z: -(n[0] ** 2 * z[0] + n[1] ** 2 * z[2] + n[2] ** 2 * z[1]) / 2,
        ),
        _moment(
            "z'3 x'2 y'1",
            lambda n, z: -(n[0] ** 2 * z[1] + n[1] ** 2 * z[0] + n[2] ** 2 * z[2]) / 2,
        ),
    ]


def _second_space_entries() -> list[Entry]:
    """Second moments in space axes."""
    return [
        _moment("y'1 z'1", lambda n, z: n[1] * n[2] * (3 * z[0] - 1) / 2),
        _moment("x'1 z'1", lambda n, z: n[0] * n[2] * (3 * z[0] - 1) / 2),
        _moment("x'1 y'1", lambda n, z: n[0] * n[1] * (3 * z[0] - 1) / 2),
        _moment("x'1 x'1", lambda n, z: n[0] * n[0] * (3 * z[0] - 1) / 2 + (1 - z[0]) / 2),
        _moment("y'1 y'1", lambda n, z: n[1] * n[1] * (3 * z[0] - 1) / 2 + (1 - z[0]) / 2),
        _moment("z'1 z'1", lambda n, z: n[2] * n[2] * (3 * z[0] - 1) / 2 + (1 - z[0]) / 2),
        _moment("y'2 z'2", lambda n, z: n[1] * n[2] * (3 * z[1] - 1) / 2),
        _moment("x'2 z'2", lambda n, z: n[0] * n[2] * (3 * z[1] - 1) / 2),
        _moment("x'2 y'2", lambda n, z: n[0] * n[1] * (3 * z[1] - 1) / 2),
        _moment("x'2 x'2", lambda n, z: n[0] * n[0] * (3 * z[1] - 1) / 2 + (1 - z[1]) / 2),
        _moment("y'2 y'2", lambda n, z: n[1] * n[1] * (3 * z[1] - 1) / 2 + (1 - z[1]) / 2),
        _moment("z'2 z'2", lambda n, z: n[2] * n[2] * (3 * z[1] - 1) / 2 + (1 - z[1]) / 2),
        _moment("y'3 z'3", lambda n, z: n[1] * n[2] * (3 * z[2] - 1) / 2),
        _moment("x'3 z'3", lambda n, z: n[0] * n[2] * (3 * z[2] - 1) / 2),
        _moment("x'3 y'3", lambda n, z: n[0] * n[1] * (3 * z[2] - 1) / 2),
        _moment("x'3 x'3", lambda n, z: n[0] * n[0] * (3 * z[2] - 1) / 2 + (1 - z[2]) / 2),
        _moment("y'3 y'3", lambda n, z: n[1] * n[1] * (3 * z[2] - 1) / 2 + (1 - z[2]) / 2),
        _moment("z'3 z'3", lambda n, z: n[2] * n[2] * (3 * z[2] - 1) / 2 + (1 - z[2]) / 2),
    ]


# The general formulas: a function for the mean, of shape (n, 3, 3) rotations, and one or two for
# the formula, all moments at once in an array of equal shape. Third moments have a row for each of
# `_ROWS`, the body axes (i, j, k) of the three factors, and a column for each choice of the other
# axes.


def _mean_second_aligned(t: np.ndarray, u: np.ndarray) -> np.ndarray:
    """⟨u_ki u_kj⟩, shape (3, 3, 3): by body axis k, i and j."""
    return np.einsum("pki,pkj->kij", u, u) / len(u)


def _second_aligned_formula(n: np.ndarray, z: np.ndarray) -> np.ndarray:
    return np.stack([np.diag([(1 - square) / 2, (1 - square) / 2, square]) for square in z])


_GENERAL_SECOND_ALIGNED = Entry(
    "general ⟨t_ki,LO t_kj,LO⟩", _mean_second_aligned, _second_aligned_formula
)


def _mean_third_aligned(t: np.ndarray, u: np.ndarray) -> np.ndarray:
    """⟨u_ia u_jb u_kc⟩, shape (6, 27): by (i, j, k) and (a, b, c)."""
    moments = np.empty((len(_ROWS), len(_COLUMN_TRIPLES)))
    for row, (i, j, k) in enumerate(_ROWS):
        for column, (a, b, c) in enumerate(_COLUMN_TRIPLES):
            moments[row, column] = np.mean(u[:, i, a] * u[:, j, b] * u[:, k, c])
    return moments


def _third_aligned_printed(n: np.ndarray, z: np.ndarray) -> np.ndarray:
    signs = np.outer(
        [sign_of(*rows) for rows in _ROWS], [sign_of(*columns) for columns in _COLUMN_TRIPLES]
    )
    # As printed with δ_i3, which picks ⟨z₃²⟩ always.
    return signs * z[2] / 2


def _third_aligned_corrected(n: np.ndarray, z: np.ndarray) -> np.ndarray:
    moments = np.empty((len(_ROWS), len(_COLUMN_TRIPLES)))
    for row, rows in enumerate(_ROWS):
        for column, columns in enumerate(_COLUMN_TRIPLES):
            # With δ_l3: the row whose column is the third.
            along = sum(z[i] for i, place in zip(rows, columns, strict=True) if place == 2)
            moments[row, column] = sign_of(*rows) * sign_of(*columns) * along / 2
    return moments


_GENERAL_THIRD_ALIGNED = Entry(
    "general ⟨t_il,LO t_jm,LO t_kn,LO⟩",
    _mean_third_aligned,
    _third_aligned_printed,
    _third_aligned_corrected,
)


def _mean_third_mixed(t: np.ndarray, u: np.ndarray) -> np.ndarray:
    """⟨u_i3 t_j1 t_k2⟩, shape (6,): by (i, j, k)."""
    return np.array([np.mean(u[:, i, 2] * t[:, j, 0] * t[:, k, 1]) for i, j, k in _ROWS])


def _third_mixed_printed(n: np.ndarray, z: np.ndarray) -> np.ndarray:
    return np.array([sign_of(i, j, k) * z[i] for i, j, k in _ROWS])


def _third_mixed_corrected(n: np.ndarray, z: np.ndarray) -> np.ndarray:
    """The same with the factor α₃₃/2 = n_z/2 that is missing."""
    return _third_mixed_printed(n, z) * n[2] / 2


_GENERAL_THIRD_MIXED = Entry(
    f"general {MIXED}", _mean_third_mixed, _third_mixed_printed, _third_mixed_corrected
)


def _mean_third_space(t: np.ndarray, u: np.ndarray) -> np.ndarray:
    """⟨t_il t_j1 t_k2⟩, shape (6, 3): by (i, j, k) and l."""
    moments = np.empty((len(_ROWS), 3))
    for row, (i, j, k) in enumerate(_ROWS):
        for column in range(3):
            moments[row, column] = np.mean(t[:, i, column] * t[:, j, 0] * t[:, k, 1])
    return moments


def _third_space(n: np.ndarray, z: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """The formula for these; `weights` of the three z for l = 3 are n² by right, and n as printed."""
    moments = np.empty((len(_ROWS), 3))
    for row, (i, j, k) in enumerate(_ROWS):
        first = n[0] * n[2] * (z[i] - z[j])
        second = n[1] * n[2] * (z[i] - z[k])
        third = weights[0] * z[j] + weights[1] * z[k] + weights[2] * z[i]
        moments[row] = sign_of(i, j, k) / 2 * np.array([first, second, third])
    return moments


def _third_space_printed(n: np.ndarray, z: np.ndarray) -> np.ndarray:
    # As printed with α_l3 in place of its square for l = 3.
    return _third_space(n, z, n)


def _third_space_corrected(n: np.ndarray, z: np.ndarray) -> np.ndarray:
    return _third_space(n, z, n**2)


_GENERAL_THIRD_SPACE = Entry(
    "general ⟨t_il t_j1 t_k2⟩", _mean_third_space, _third_space_printed, _third_space_corrected
)


def _mean_second_space(t: np.ndarray, u: np.ndarray) -> np.ndarray:
    """⟨t_il t_im⟩, shape (3, 3, 3): by body axis i, l and m."""
    return np.einsum("pil,pim->ilm", t, t) / len(t)


def _second_space_formula(n: np.ndarray, z: np.ndarray) -> np.ndarray:
    return np.stack(
        [np.outer(n, n) * (3 * square - 1) / 2 + np.eye(3) * (1 - square) / 2 for square in z]
    )


_GENERAL_SECOND_SPACE = Entry("general ⟨t_il t_im⟩", _mean_second_space, _second_space_formula)
