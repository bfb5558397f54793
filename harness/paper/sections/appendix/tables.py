"""The appendix's tables of averages over the Euler top: every entry as printed and as it should be (`entries.toml`)."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, partial
from importlib.resources import files
from itertools import permutations, product

import numpy as np

from polhode.models.files.toml_file import read_toml

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


@cache
def _rows() -> dict[str, list[list[str]]]:
    return read_toml(files("polhode.harness.paper.sections") / "appendix" / "entries.toml", dict)


def _formula(text: str, *letters: str) -> Formula:
    """An expression in the components of two vectors: n1 to n3 and z1 to z3, by default."""
    code = compile(text, text, "eval")

    def formula(*vectors: np.ndarray) -> float | np.ndarray:
        named = zip(letters or "nz", vectors, strict=False)
        return eval(code, {f"{letter}{i}": own for letter, vector in named for i, own in enumerate(vector, start=1)})

    return formula


def mean_of(words: str) -> Formula:
    """The mean of a product; x'1 x'2 y'3 are components t_11, t_21, t_32, without a stroke in axes along L."""
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
    return [entry for group, general in _general().items() for entry in (*_single(group), general)]


def _single(group: str) -> list[Entry]:
    return [
        Entry(f"⟨{words}⟩", mean_of(words), _formula(printed), _formula(corrected[0] if corrected else printed))
        for words, printed, *corrected in _rows()[group]
    ]


def spheroid_entries() -> list[Entry]:
    """The eight entries of the spheroid's table; ``t`` holds p̂, z is h²."""

    def entry(words: str, mean: str, formula: str) -> Entry:
        product_, printed = _formula(mean, "p"), _formula(formula)
        return Entry(f"⟨{words}⟩", lambda t, u: float(np.mean(product_(t, u))), printed, printed)

    return [entry(*row) for row in _rows()["spheroid"]]


def _general() -> dict[str, Entry]:
    """The general formula of each group."""
    signs = np.array([sign_of(*rows) for rows in ROWS])
    first = [rows[0] for rows in ROWS]
    columns = tuple(product(range(3), repeat=3))

    def aligned(n: np.ndarray, z: np.ndarray) -> np.ndarray:
        return np.stack([np.diag([(1 - own) / 2, (1 - own) / 2, own]) for own in z])

    def space(n: np.ndarray, z: np.ndarray) -> np.ndarray:
        return np.stack([np.outer(n, n) * (3 * own - 1) / 2 + np.eye(3) * (1 - own) / 2 for own in z])

    def third_mean(t: np.ndarray, u: np.ndarray) -> np.ndarray:
        return np.array([[np.mean(u[:, i, a] * u[:, j, b] * u[:, k, c]) for a, b, c in columns] for i, j, k in ROWS])

    def third(n: np.ndarray, z: np.ndarray, *, by_column: bool) -> np.ndarray:
        """For different rows; printed with δ_i3, which picks ⟨z₃²⟩ always, in place of δ_l3."""

        def one(rows: tuple[int, ...], chosen: tuple[int, ...]) -> float:
            third = chosen if by_column else rows
            picked = sum(z[row] for row, index in zip(rows, third, strict=True) if index == 2)
            return sign_of(*rows) * sign_of(*chosen) * picked / 2

        return np.array([[one(rows, chosen) for chosen in columns] for rows in ROWS])

    def mixed_mean(t: np.ndarray, u: np.ndarray) -> np.ndarray:
        return np.array([np.mean(u[:, i, 2] * t[:, j, 0] * t[:, k, 1]) for i, j, k in ROWS])

    def space_mean(t: np.ndarray, u: np.ndarray) -> np.ndarray:
        return np.array([[np.mean(t[:, i, a] * t[:, j, 0] * t[:, k, 1]) for a in range(3)] for i, j, k in ROWS])

    def third_space(n: np.ndarray, z: np.ndarray, power: int) -> np.ndarray:
        """Printed with α_l3 in place of its square for l = 3."""

        def one(i: int, j: int, k: int) -> list[float]:
            along = n[0] ** power * z[j] + n[1] ** power * z[k] + n[2] ** power * z[i]
            half = sign_of(i, j, k) / 2
            return [half * n[0] * n[2] * (z[i] - z[j]), half * n[1] * n[2] * (z[i] - z[k]), half * along]

        return np.array([one(*rows) for rows in ROWS])

    def mixed(n: np.ndarray, z: np.ndarray) -> np.ndarray:
        return signs * z[first]

    def second_mean(pairs: str, which: int) -> Formula:
        return lambda *tu: np.einsum(pairs, tu[which], tu[which]) / len(tu[which])

    def general(words: str, mean: Formula, printed: Formula, corrected: Formula) -> Entry:
        return Entry(f"general ⟨{words}⟩", mean, printed, corrected)

    row, column = partial(third, by_column=False), partial(third, by_column=True)
    plain, square = partial(third_space, power=1), partial(third_space, power=2)
    return {
        "second_aligned": general("t_ki,LO t_kj,LO", second_mean("pki,pkj->kij", 1), aligned, aligned),
        "third_aligned": general("t_il,LO t_jm,LO t_kn,LO", third_mean, row, column),
        "third_mixed": general("t_i3,LO t_j1 t_k2", mixed_mean, mixed, lambda n, z: mixed(n, z) * n[2] / 2),
        "third_space": general("t_il t_j1 t_k2", space_mean, plain, square),
        "second_space": general("t_il t_im", second_mean("pil,pim->ilm", 0), space, space),
    }
