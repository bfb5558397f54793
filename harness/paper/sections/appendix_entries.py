"""The appendices' tables of averages, in their order: means, and the formulas printed for them.

A mean is over rotations of the free top. Row i of a rotation matrix has the components of body axis
i: `t` in space axes, `u` in axes of which the third one is along L (t_ij,LO in the paper). A
formula is a function of n and z. n is L/|L| in space axes, (α₁₃, α₂₃, α₃₃) in the paper. z has the
mean squares (⟨z₁²⟩, ⟨z₂²⟩, ⟨z₃²⟩), where z_i is the component of body axis i along L. In names of
entries, x'1 x'2 y'3 are the components t_11, t_21, t_32. Without a stroke they are components in
axes along L, u_11, u_21, u_32.

The formulas are written entry by entry as the paper prints them, so that each can be compared with
it. Some stand twice, once as an entry and once in a general formula: the paper prints both.
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
# Indices of the general formulas, from 0: three different rows, and any three columns.
_ROWS = tuple(permutations(range(3)))
_COLUMN_TRIPLES = tuple(product(range(3), repeat=3))
# The general formula of the mixed third moments: one component along L, two in space axes.
MIXED = "⟨t_i3,LO t_j1 t_k2⟩"


@dataclass(frozen=True)
class Entry:
    """A mean, the formula that is printed for it and, where that is wrong, the right one."""

    name: str
    mean: Mean
    printed: Formula
    corrected: Formula | None = None

    def deviations(self, t: np.ndarray, u: np.ndarray, n: np.ndarray, z: np.ndarray) -> list[float]:
        """Largest deviation of the printed and of the corrected formula from the mean.

        Without a corrected formula the printed one counts as both. `t` and `u` have shape
        (m, 3, 3), `n` and `z` shape (3,). `spheroid_entries` has other arguments.
        """
        mean = self.mean(t, u)
        formulas = (self.printed, self.corrected or self.printed)
        return [float(np.max(np.abs(mean - formula(n, z)))) for formula in formulas]


def sign_of(i: int, j: int, k: int) -> float:
    """ε_ijk, for indices from 0 to 2: 1 for even permutations of (0, 1, 2), -1 for odd ones, else 0."""
    return (i - j) * (j - k) * (k - i) / 2


def _zero(n: np.ndarray, z: np.ndarray) -> float:
    """The formula of the moments that vanish."""
    return 0.0


def _moment(words: str, printed: Formula, corrected: Formula | None = None) -> Entry:
    """An entry for the mean of a product of components, each a word such as x1 or z'3.

    The letter is the component, the number the body axis, and a stroke means space axes.
    """
    # Each factor: column and row of the matrix, and whether this is t, in space axes, or u.
    factors = [(_LETTERS.index(word[0]), int(word[-1]) - 1, "'" in word) for word in words.split()]

    def mean(t: np.ndarray, u: np.ndarray) -> float:
        values = [(t if space else u)[:, row, column] for column, row, space in factors]
        return float(np.mean(np.prod(values, axis=0)))

    return Entry(f"⟨{words}⟩", mean, printed, corrected)


def _mean(value: Callable[[np.ndarray], np.ndarray], axis: np.ndarray) -> float:
    """The mean of a function of the symmetry axis p over the m values `axis`, shape (3, m)."""
    return float(np.mean(value(axis)))


def spheroid_entries() -> list[Entry]:
    """The eight entries of the spheroid's table.

    Here `t` holds the symmetry axis p = (sin θ sin φ, -sin θ cos φ, cos θ) in space axes, shape
    (3, m). `u` is not used. z is (h²,), shape (1,), and h is the cosine of the angle between p and L,
    taken as positive. 1 - h² is h̄² in the paper. n may not be along the vorticity: two formulas
    divide by n₁² + n₂².
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
    """The 81 entries and five general formulas of the ellipsoid's table, in its order."""
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
    """Names of the mixed third moments, without their general formula."""
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
    """Third moments in axes along L: 27, one body axis and one component in each factor.

    All vanish but the last six.
    """
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
    """Third moments in space axes, with the three body axes in one factor each."""
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


# The general formulas: a function for the mean, and one or two for the formula, with all moments at
# once in arrays of equal shape. Third moments have a row for each of `_ROWS`, the body axes
# (i, j, k) of the three factors. The other dimensions are the components.


def _mean_second_aligned(t: np.ndarray, u: np.ndarray) -> np.ndarray:
    """⟨u_ki u_kj⟩, shape (3, 3, 3): by body axis k, i and j."""
    return np.einsum("pki,pkj->kij", u, u) / len(u)


def _second_aligned_formula(n: np.ndarray, z: np.ndarray) -> np.ndarray:
    """The formula for these, as printed: z along L, and half of 1 - z along each other axis."""
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
    """The formula for these as printed, ε_ijk ε_abc/2 times a sum of δ and z."""
    signs = np.outer(
        [sign_of(*rows) for rows in _ROWS], [sign_of(*columns) for columns in _COLUMN_TRIPLES]
    )
    # The sum is printed as δ_i3 ⟨z_i²⟩ + δ_j3 ⟨z_j²⟩ + δ_k3 ⟨z_k²⟩. One of i, j, k is 3, so that this
    # is always ⟨z₃²⟩.
    return signs * z[2] / 2


def _third_aligned_corrected(n: np.ndarray, z: np.ndarray) -> np.ndarray:
    """The same with δ of the components: the factor along L is the one whose z counts."""
    moments = np.empty((len(_ROWS), len(_COLUMN_TRIPLES)))
    for row, rows in enumerate(_ROWS):
        for column, columns in enumerate(_COLUMN_TRIPLES):
            # z of the body axis whose component is the third one, that along L.
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
    """The formula for these as printed: ε_ijk z_i.

    The paper has ε_ijk beside the mean instead, and the square of ε_ijk beside z_i.
    """
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
    """The formula for these. For l = 3 it weights the three z by n² rightly, and by n as printed."""
    moments = np.empty((len(_ROWS), 3))
    for row, (i, j, k) in enumerate(_ROWS):
        first = n[0] * n[2] * (z[i] - z[j])
        second = n[1] * n[2] * (z[i] - z[k])
        third = weights[0] * z[j] + weights[1] * z[k] + weights[2] * z[i]
        # For l = 1, 2 and 3.
        moments[row] = sign_of(i, j, k) / 2 * np.array([first, second, third])
    return moments


def _third_space_printed(n: np.ndarray, z: np.ndarray) -> np.ndarray:
    """The formula as printed, with α₁₃, α₂₃ and α₃₃ for l = 3."""
    return _third_space(n, z, n)


def _third_space_corrected(n: np.ndarray, z: np.ndarray) -> np.ndarray:
    """The same with their squares."""
    return _third_space(n, z, n**2)


_GENERAL_THIRD_SPACE = Entry(
    "general ⟨t_il t_j1 t_k2⟩", _mean_third_space, _third_space_printed, _third_space_corrected
)


def _mean_second_space(t: np.ndarray, u: np.ndarray) -> np.ndarray:
    """⟨t_il t_im⟩, shape (3, 3, 3): by body axis i, l and m."""
    return np.einsum("pil,pim->ilm", t, t) / len(t)


def _second_space_formula(n: np.ndarray, z: np.ndarray) -> np.ndarray:
    """The formula for these, as printed: n_l n_m (3z_i - 1)/2 + δ_lm (1 - z_i)/2."""
    return np.stack(
        [np.outer(n, n) * (3 * square - 1) / 2 + np.eye(3) * (1 - square) / 2 for square in z]
    )


_GENERAL_SECOND_SPACE = Entry("general ⟨t_il t_im⟩", _mean_second_space, _second_space_formula)
