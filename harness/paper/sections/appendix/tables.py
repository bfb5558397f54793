"""The appendix's tables of averages over the Euler top: every entry as printed, and as it should be."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import permutations, product

import numpy as np

Formula = Callable[[np.ndarray, np.ndarray], float | np.ndarray]
LETTERS = "xyz"
ROWS = tuple(permutations(range(3)))


@dataclass(frozen=True)
class Entry:
    """An entry of a table: a mean over the motion, and formulas for it.

    The mean is one of rotations t_ij in space axes and u = t_ij,LO in axes aligned with L, both of shape (n, 3, 3); the
    formulas are functions of L̂ = α_i3 and ⟨z_i²⟩, both of shape (3,). A general formula stands for many means and
    gives an array of them.
    """

    name: str
    mean: Formula
    printed: Formula
    corrected: Formula

    def deviations(self, t: np.ndarray, u: np.ndarray, n: np.ndarray, z: np.ndarray) -> tuple[float, float]:
        """Largest deviation of the printed and of the corrected formula from the mean."""
        found = self.mean(t, u)
        printed, corrected = (float(np.max(np.abs(found - own(n, z)))) for own in (self.printed, self.corrected))
        return printed, corrected


def right(words: str, formula: Formula) -> Entry:
    """An entry that holds as printed; x'1 x'2 y'3 are components t_11, t_21, t_32, without a stroke in axes along L."""
    return Entry(f"⟨{words}⟩", _mean(words), formula, formula)


def _mean(words: str) -> Formula:
    factors = [(LETTERS.index(word[0]), int(word[-1]) - 1, "'" in word) for word in words.split()]

    def mean(t: np.ndarray, u: np.ndarray) -> float:
        values = [(t if space else u)[:, row, column] for column, row, space in factors]
        return float(np.mean(np.prod(values, axis=0)))

    return mean


def sign_of(i: int, j: int, k: int) -> float:
    """ε_ijk."""
    return (i - j) * (j - k) * (k - i) / 2


def ellipsoid_entries() -> list[Entry]:
    """Entries and general formulas of the ellipsoid's table, in its order."""
    return [*_second_aligned(), *_third_aligned(), *_third_mixed(), *_third_space(), *_second_space()]


def _zero(n: np.ndarray, z: np.ndarray) -> float:
    return 0.0


def _second_aligned() -> Iterator[Entry]:
    """⟨z_k²⟩ itself by `pz`, the squares of x_k and y_k, and the mixed products."""
    for k in range(3):
        yield right(f"z{k + 1} z{k + 1}", lambda n, z, k=k: z[k])
        for letter in "xy":
            yield right(f"{letter}{k + 1} {letter}{k + 1}", lambda n, z, k=k: (1 - z[k]) / 2)
        for first, second in ("xy", "xz", "yz"):
            yield right(f"{first}{k + 1} {second}{k + 1}", _zero)

    def formula(n: np.ndarray, z: np.ndarray) -> np.ndarray:
        return np.stack([np.diag([(1 - own) / 2, (1 - own) / 2, own]) for own in z])

    yield Entry("general ⟨t_ki,LO t_kj,LO⟩", lambda t, u: np.einsum("pki,pkj->kij", u, u) / len(u), formula, formula)


VANISHING = (
    "xxz xzx zxx yyz yzy zyy",
    "xxy xyx yxx yyx yxy xyy",
    "zzx zxz xzz zzy zyz yzz",
    "xxx yyy zzz",
)
# Letters of rows 1, 2, 3; sign; number of the mean square, of which half is printed.
ENCLOSED = (("zxy", 1, 1), ("zyx", -1, 1), ("yzx", 1, 2), ("xzy", -1, 2), ("xyz", 1, 3), ("yxz", -1, 3))


def _third_aligned() -> Iterator[Entry]:
    """The general formula, for different rows, is printed with δ_i3, which picks ⟨z₃²⟩ always, in place of δ_l3."""
    for letters in " ".join(VANISHING).split():
        yield right(_in_rows(letters), _zero)
    for letters, sign, number in ENCLOSED:
        yield right(_in_rows(letters), lambda n, z, s=sign, i=number - 1: s * z[i] / 2)
    columns = tuple(product(range(3), repeat=3))

    def mean(t: np.ndarray, u: np.ndarray) -> np.ndarray:
        return np.array([[np.mean(u[:, i, a] * u[:, j, b] * u[:, k, c]) for a, b, c in columns] for i, j, k in ROWS])

    def formula(z: np.ndarray, *, by_column: bool) -> np.ndarray:
        def one(rows: tuple[int, ...], chosen: tuple[int, ...]) -> float:
            third = chosen if by_column else rows
            picked = sum(z[row] for row, index in zip(rows, third, strict=True) if index == 2)
            return sign_of(*rows) * sign_of(*chosen) * picked / 2

        return np.array([[one(rows, chosen) for chosen in columns] for rows in ROWS])

    yield Entry(
        "general ⟨t_il,LO t_jm,LO t_kn,LO⟩",
        mean,
        lambda n, z: formula(z, by_column=False),
        lambda n, z: formula(z, by_column=True),
    )


def _in_rows(letters: str) -> str:
    return " ".join(f"{letter}{row}" for row, letter in enumerate(letters, start=1))


def _third_mixed() -> Iterator[Entry]:
    """⟨z_i x'_j y'_k⟩ and the general formula: printed without the factor α₃₃/2."""
    for i, j, k in ROWS:
        words, sign = f"z{i + 1} x'{j + 1} y'{k + 1}", sign_of(i, j, k)
        yield Entry(
            f"⟨{words}⟩",
            _mean(words),
            lambda n, z, i=i, s=sign: s * z[i],
            lambda n, z, i=i, s=sign: s * n[2] / 2 * z[i],
        )
    signs = np.array([sign_of(*rows) for rows in ROWS])
    first = [rows[0] for rows in ROWS]

    def mean(t: np.ndarray, u: np.ndarray) -> np.ndarray:
        return np.array([np.mean(u[:, i, 2] * t[:, j, 0] * t[:, k, 1]) for i, j, k in ROWS])

    yield Entry(
        "general ⟨t_i3,LO t_j1 t_k2⟩",
        mean,
        lambda n, z: signs * z[first],
        lambda n, z: signs * z[first] * n[2] / 2,
    )


# Words; index l of α_l3 α_33; numbers of the mean squares whose difference is halved.
ACROSS = (
    ("x'1 x'2 y'3", 1, 1, 2), ("x'2 x'3 y'1", 1, 2, 3), ("x'3 x'1 y'2", 1, 3, 1),
    ("y'1 x'3 y'2", 2, 2, 1), ("y'2 x'1 y'3", 2, 3, 2), ("y'3 x'2 y'1", 2, 1, 3),
)  # fmt: skip
# Words; sign; numbers of the mean squares that go with α₁₃², α₂₃², α₃₃².
ALONG = (
    ("z'1 x'2 y'3", 1, (2, 3, 1)), ("z'2 x'3 y'1", 1, (3, 1, 2)), ("z'3 x'1 y'2", 1, (1, 2, 3)),
    ("z'1 x'3 y'2", -1, (3, 2, 1)), ("z'2 x'1 y'3", -1, (1, 3, 2)), ("z'3 x'2 y'1", -1, (2, 1, 3)),
)  # fmt: skip


def _third_space() -> Iterator[Entry]:
    """The general formula is printed with α_l3 in place of its square for l = 3."""
    for words, column, plus, minus in ACROSS:
        yield right(words, lambda n, z, c=column, p=plus, m=minus: n[c - 1] * n[2] * (z[p - 1] - z[m - 1]) / 2)
    for words, sign, order in ALONG:
        yield right(words, lambda n, z, s=sign, o=order: s * sum(n[a] ** 2 * z[o[a] - 1] for a in range(3)) / 2)

    def mean(t: np.ndarray, u: np.ndarray) -> np.ndarray:
        return np.array([[np.mean(t[:, i, a] * t[:, j, 0] * t[:, k, 1]) for a in range(3)] for i, j, k in ROWS])

    def formula(n: np.ndarray, z: np.ndarray, power: int) -> np.ndarray:
        def one(i: int, j: int, k: int) -> list[float]:
            along = n[0] ** power * z[j] + n[1] ** power * z[k] + n[2] ** power * z[i]
            half = sign_of(i, j, k) / 2
            return [half * n[0] * n[2] * (z[i] - z[j]), half * n[1] * n[2] * (z[i] - z[k]), half * along]

        return np.array([one(*rows) for rows in ROWS])

    yield Entry("general ⟨t_il t_j1 t_k2⟩", mean, lambda n, z: formula(n, z, 1), lambda n, z: formula(n, z, 2))


def _second_space() -> Iterator[Entry]:
    for row in range(3):
        for a, b in ((1, 2), (0, 2), (0, 1), (0, 0), (1, 1), (2, 2)):
            yield right(
                f"{LETTERS[a]}'{row + 1} {LETTERS[b]}'{row + 1}",
                lambda n, z, i=row, a=a, b=b: n[a] * n[b] * (3 * z[i] - 1) / 2 + (a == b) * (1 - z[i]) / 2,
            )

    def formula(n: np.ndarray, z: np.ndarray) -> np.ndarray:
        return np.stack([np.outer(n, n) * (3 * own - 1) / 2 + np.eye(3) * (1 - own) / 2 for own in z])

    yield Entry("general ⟨t_il t_im⟩", lambda t, u: np.einsum("pil,pim->ilm", t, t) / len(t), formula, formula)


def spheroid_entries() -> list[Entry]:
    """The eight entries of the spheroid's table; ``t`` holds p̂ = (sin θ sin φ, -sin θ cos φ, cos θ), z is h²."""

    def mixed(i: int, j: int) -> Formula:
        return lambda n, z: n[i] * n[j] * (z[0] - (1 - z[0]) / 2)

    def square(i: int, j: int) -> Formula:
        """Printed form of ⟨p_i²⟩ with L_j the other component across the vorticity."""
        return lambda n, z: (
            n[i] ** 2 * z[0] + (n[j] ** 2 + n[i] ** 2 * n[2] ** 2) * (1 - z[0]) / (2 * (n[0] ** 2 + n[1] ** 2))
        )

    def entry(name: str, mean: Callable[[np.ndarray], np.ndarray], formula: Formula) -> Entry:
        return Entry(name, lambda t, u: float(np.mean(mean(t))), formula, formula)

    return [
        entry("⟨cos θ⟩", lambda p: p[2], lambda n, z: n[2] * z[0] ** 0.5),
        entry(
            "⟨cos² θ⟩",
            lambda p: p[2] ** 2,
            lambda n, z: n[2] ** 2 * z[0] + (n[0] ** 2 + n[1] ** 2) * (1 - z[0]) / 2,
        ),
        entry("⟨sin θ sin φ⟩", lambda p: p[0], lambda n, z: n[0] * z[0] ** 0.5),
        entry("⟨sin θ cos φ⟩", lambda p: -p[1], lambda n, z: -n[1] * z[0] ** 0.5),
        entry("⟨sin² θ sin² φ⟩", lambda p: p[0] ** 2, square(0, 1)),
        entry("⟨sin² θ cos² φ⟩", lambda p: p[1] ** 2, square(1, 0)),
        entry("⟨sin θ cos φ cos θ⟩", lambda p: -p[1] * p[2], lambda n, z: -mixed(1, 2)(n, z)),
        entry("⟨sin θ sin φ cos θ⟩", lambda p: p[0] * p[2], mixed(0, 2)),
    ]
