"""The appendices: the tables of averages, entry by entry against brute force, and the first-order correction."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, partial
from importlib.resources import files
from itertools import permutations, product
from math import pi
from typing import Any

import numpy as np
from scipy.integrate import cumulative_simpson

from polhode.harness.paper.item import Computed, Grid
from polhode.harness.paper.planes import aligned_scene
from polhode.harness.paper.runs import averaged_run, full_run, run_form, spheroid
from polhode.models.files.toml_file import read_toml
from polhode.models.forms.averaged import mean_squares
from polhode.models.forms.spheroid import Spheroid
from polhode.models.free_top.torque_free import TorqueFree
from polhode.models.operations import FLOAT
from polhode.models.rotation import matrix_from_euler, matrix_from_quaternion
from polhode.models.scenes import PAPER_ELLIPSOID
from polhode.models.shape import Ellipsoid
from polhode.models.theory.spheroid_correction import CorrectedSpheroid

ROUNDING = 1e-11
# The general formula of the mixed third moments.
MIXED = "⟨t_i3,LO t_j1 t_k2⟩"


def frame(momentum: np.ndarray) -> np.ndarray:
    """α_ij: columns are the axes aligned with L, the third one along it, in space components (`fodij`)."""
    third = momentum / np.linalg.norm(momentum)
    first = np.array([third[1], -third[0], 0.0]) / np.hypot(third[0], third[1])
    return np.stack([first, np.cross(third, first), third], axis=1)


def ensemble(
    ellipsoid: Ellipsoid, momentum: np.ndarray, omega: np.ndarray, nodes: int
) -> np.ndarray:
    """Rotations t_ij, shape (n, 3, 3), at equal times of a period T of the Euler top and equal angles of precession."""
    w1, w2, w3 = omega.tolist()
    top = TorqueFree(ellipsoid.inertia, (1.0, 0.0, 0.0, 0.0), (w1, w2, w3))
    quaternion, _ = top.at(top.period * np.arange(nodes) / nodes)
    body = matrix_from_quaternion(quaternion)
    aligned = body @ frame(np.array(ellipsoid.inertia) * omega)
    turns = matrix_from_euler(np.outer(2 * pi * np.arange(8) / 8, (0, 1, 0)))
    return np.einsum("nij,pjk,lk->npil", aligned, turns, frame(momentum)).reshape(-1, 3, 3)


def compute_spheroid(grid: Grid) -> Computed:
    """Largest deviation of every printed entry from the mean over the precession, over random L and cones."""
    generator = np.random.default_rng(3)
    angle = 2 * pi * np.arange(16) / 16
    entries, worst = spheroid_entries(), 0.0
    for _ in range(grid.of(200, 40)):
        direction = generator.normal(size=3)
        direction /= np.linalg.norm(direction)
        h = generator.uniform(0.05, 0.95)
        g = np.sqrt(1 - h * h)
        axis = frame(direction) @ np.stack([g * np.sin(angle), -g * np.cos(angle), np.full(16, h)])
        worst = np.maximum(
            worst, [entry.deviations(axis, axis, direction, np.array([h * h])) for entry in entries]
        )
    yield "", _deviations(entries, worst)


def compute_ellipsoid(grid: Grid) -> Computed:
    """Largest deviation of every entry, printed and corrected, from the brute-force mean, over random states."""
    generator = np.random.default_rng(5)
    ellipsoid = Ellipsoid(PAPER_ELLIPSOID)
    entries, worst = ellipsoid_entries(), 0.0
    means = mean_squares(FLOAT)
    for _ in range(grid.of(24, 6)):
        omega, direction = generator.normal(size=3), generator.normal(size=3)
        direction /= np.linalg.norm(direction)
        size2 = float(np.sum((ellipsoid.inertia * omega) ** 2))
        t = ensemble(ellipsoid, direction, omega, 256)
        u = t @ frame(direction)
        z = np.array(means(size2, float(np.sum(ellipsoid.inertia * omega**2)), *ellipsoid.inertia))
        worst = np.maximum(worst, [entry.deviations(t, u, direction, z) for entry in entries])
    yield "", _deviations(entries, worst)


def _deviations(entries: Sequence["Entry"], worst: Any) -> dict[str, Any]:
    return {
        "entry": [entry.name for entry in entries],
        "printed": worst[:, 0],
        "corrected": worst[:, 1],
    }


# The first-order correction: κ, L_z over I_e at the start, θ₀, φ₀, and the slow time followed.
KAPPA, MOMENTUM, THETA, PHI, SLOW_TIME = 2.0, -0.9, 0.9, 0.6, 0.04
SHOWN = 200.0


def compute_first_order(grid: Grid) -> Computed:
    """L_z in full, averaged and corrected at one St; the largest error against St."""
    yield "", {"t2": np.linspace(0.0, SLOW_TIME, 401), **_first_order(SHOWN, 401)}
    for stokes in np.geomspace(1e2, 1e5, grid.of(13, 4)).tolist():
        runs = _first_order(stokes, grid.of(4001, 1001))
        full = runs.pop("full")
        yield (
            "errors",
            {"stokes": stokes, **{name: np.max(np.abs(own - full)) for name, own in runs.items()}},
        )


def _first_order(stokes: float, points: int) -> dict[str, np.ndarray]:
    """L_z/I_e of the full and the averaged run, with the correction as printed, and corrected."""
    shape = Spheroid.of(spheroid(KAPPA))
    scene = aligned_scene(spheroid(KAPPA), stokes, MOMENTUM, THETA, SLOW_TIME, PHI)
    slow_times = np.linspace(0.0, SLOW_TIME, points)
    averaged = averaged_run(scene, slow_times)
    lz, spin = averaged.states[:, 2], averaged.states[:, 3]
    phase = cumulative_simpson(lz, x=slow_times, initial=0.0)
    mean = np.concatenate([lz[:1], phase[1:] / slow_times[1:]])
    amplitude = (
        shape.equatorial_damping
        * shape.anisotropy
        * (1 - (shape.inertia_ratio * spin / lz) ** 2)
        / 4
    )
    return {
        "full": full_run(scene, stokes * slow_times).slow[:, 2],
        "averaged": averaged.slow[:, 2],
        "printed": lz - amplitude / mean * np.sin(2 * (stokes * phase + PHI)) / stokes,
        "corrected": run_form(CorrectedSpheroid(), scene, slow_times, 1e-13).slow[:, 2],
    }


LETTERS = "xyz"
# Of different rows, and of any columns, for the general formulas.
ROWS, COLUMNS = tuple(permutations(range(3))), tuple(product(range(3), repeat=3))


def value_of(text: str, **arrays: np.ndarray) -> float | np.ndarray:
    """An expression over arrays, and over their components, n1 to n3 of n."""
    parts = {
        f"{name}{i}": own
        for name, array in arrays.items()
        for i, own in enumerate(array[:3], start=1)
    }
    return eval(text, globals() | arrays | parts)


@dataclass(frozen=True)
class Entry:
    """A mean over rotations t_ij and u = t_ij,LO, shape (n, 3, 3), and formulas for it in n = α_i3 and z = ⟨z_i²⟩."""

    name: str
    mean: Callable[[np.ndarray, np.ndarray], float | np.ndarray]
    printed: str
    corrected: str

    def deviations(self, t: np.ndarray, u: np.ndarray, n: np.ndarray, z: np.ndarray) -> list[float]:
        """Largest deviation of the printed and of the corrected formula from the mean."""
        found = self.mean(t, u)
        return [
            float(np.max(np.abs(found - value_of(text, n=n, z=z))))
            for text in (self.printed, self.corrected)
        ]


@cache
def rows() -> dict[str, Any]:
    """Entries by group, and the general formulas."""
    return read_toml(files("polhode.harness.paper.sections") / "appendix" / "entries.toml", dict)


def mean_of(words: str) -> Callable[[np.ndarray, np.ndarray], float]:
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
    found = []
    for group, general in rows()["general"].items():
        for words, printed, *corrected in rows()[group]:
            found.append(Entry(f"⟨{words}⟩", mean_of(words), printed, *(corrected or [printed])))
        printed, mean = general["printed"], partial(value_of, general["mean"])
        corrected = general.get("corrected", printed)
        found.append(
            Entry(
                f"general ⟨{general['words']}⟩",
                lambda t, u, of=mean: of(t=t, u=u),
                printed,
                corrected,
            )
        )
    return found


def spheroid_entries() -> list[Entry]:
    """The eight entries of the spheroid's table; ``t`` holds p̂, z is h²."""
    return [
        Entry(
            f"⟨{words}⟩", lambda t, u, of=mean: float(np.mean(value_of(of, p=t))), printed, printed
        )
        for words, mean, printed in rows()["spheroid"]
    ]
