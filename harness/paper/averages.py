"""The appendix's tables of averages over the Euler top, entry by entry against brute force."""

from collections.abc import Callable
from math import pi

import numpy as np
from matplotlib.figure import Figure

from polhode.harness.paper.drawing import BLUE, VERMILLION, label, logarithmic, panels
from polhode.harness.paper.item import Data, Grid, Item, Number, Verdict, Word
from polhode.models.averaged import mean_squares
from polhode.models.operations import FLOAT
from polhode.models.rotation import matrix_from_quaternion
from polhode.models.scenes import PAPER_ELLIPSOID
from polhode.models.shape import Ellipsoid
from polhode.models.torque_free import TorqueFree

Entry = Callable[..., float]
ROUNDING = 1e-11


def frame(momentum: np.ndarray) -> np.ndarray:
    """α_ij: columns are the axes aligned with L, the third one along it, in space components (`fodij`)."""
    third = momentum / np.linalg.norm(momentum)
    first = np.array([third[1], -third[0], 0.0]) / np.hypot(third[0], third[1])
    return np.stack([first, np.cross(third, first), third], axis=1)


def ensemble(ellipsoid: Ellipsoid, momentum: np.ndarray, omega: np.ndarray, nodes: int) -> np.ndarray:
    """Rotations t_ij, shape (n, 3, 3), over one period T of the Euler top and all angles of precession about L.

    Every motion of period T is left out of the precession by hand: at each phase of the polhode the body is turned
    about L by equal angles, so that the plain mean is the mean over T and T' of the paper, in space axes.
    """
    w1, w2, w3 = omega.tolist()
    top = TorqueFree(ellipsoid.inertia, (1.0, 0.0, 0.0, 0.0), (w1, w2, w3))
    times = top.period * np.arange(nodes) / nodes
    quaternion, _ = top.at(times)
    body = matrix_from_quaternion(quaternion)
    start = np.array(ellipsoid.inertia) * omega
    aligned = body @ frame(start)
    angles = 2 * pi * np.arange(8) / 8
    c, s, zero = np.cos(angles), np.sin(angles), np.zeros(8)
    turns = np.stack([np.stack([c, s, zero], 1), np.stack([-s, c, zero], 1), np.stack([zero, zero, zero + 1], 1)], 1)
    return np.einsum("nij,pjk,lk->npil", aligned, turns, frame(momentum)).reshape(-1, 3, 3)


def spheroid_entries() -> dict[str, tuple[Entry, Entry]]:
    """Entries of the spheroid's table: as a mean of p̂ = (x, y, z), and as printed from (L̂, h²); all are right."""

    def mixed(i: int, j: int) -> Entry:
        return lambda n, h2: n[i] * n[j] * (h2 - (1 - h2) / 2)

    def square(i: int, j: int) -> Entry:
        """Printed form of ⟨p_i²⟩ with L_j the other component across the vorticity."""
        return lambda n, h2: (
            n[i] ** 2 * h2 + (n[j] ** 2 + n[i] ** 2 * n[2] ** 2) * (1 - h2) / (2 * (n[0] ** 2 + n[1] ** 2))
        )

    def cosine_square(n: np.ndarray, h2: float) -> float:
        return n[2] ** 2 * h2 + (n[0] ** 2 + n[1] ** 2) * (1 - h2) / 2

    return {
        "⟨cos θ⟩": (lambda p: p[2], lambda n, h2: n[2] * h2**0.5),
        "⟨cos² θ⟩": (lambda p: p[2] ** 2, cosine_square),
        "⟨sin θ sin φ⟩": (lambda p: p[0], lambda n, h2: n[0] * h2**0.5),
        "⟨sin θ cos φ⟩": (lambda p: -p[1], lambda n, h2: -n[1] * h2**0.5),
        "⟨sin² θ sin² φ⟩": (lambda p: p[0] ** 2, square(0, 1)),
        "⟨sin² θ cos² φ⟩": (lambda p: p[1] ** 2, square(1, 0)),
        "⟨sin θ cos φ cos θ⟩": (lambda p: -p[1] * p[2], lambda n, h2: -mixed(1, 2)(n, h2)),
        "⟨sin θ sin φ cos θ⟩": (lambda p: p[0] * p[2], mixed(0, 2)),
    }


def compute_spheroid(grid: Grid) -> Data:
    """Largest deviation of every printed entry from the mean over the precession, over random L and cones."""
    generator = np.random.default_rng(3)
    angle = 2 * pi * np.arange(16) / 16
    worst = dict.fromkeys(spheroid_entries(), 0.0)
    for _ in range(grid.of(200, 40)):
        direction = generator.normal(size=3)
        direction /= np.linalg.norm(direction)
        h = generator.uniform(0.05, 0.95)
        g = np.sqrt(1 - h * h)
        axis = frame(direction) @ np.stack([g * np.sin(angle), -g * np.cos(angle), np.full(16, h)])
        for name, (mean_of, printed) in spheroid_entries().items():
            worst[name] = max(worst[name], abs(float(np.mean(mean_of(axis))) - printed(direction, h * h)))
    deviation = np.array(list(worst.values()))
    return {"": {"entry": np.array(list(worst)), "printed": deviation, "corrected": deviation}}


def _cyclic() -> list[tuple[int, int, int]]:
    return [(0, 1, 2), (1, 2, 0), (2, 0, 1), (1, 0, 2), (2, 1, 0), (0, 2, 1)]


def _sign(i: int, j: int, k: int) -> float:
    return (i - j) * (j - k) * (k - i) / 2


def ellipsoid_entries() -> list[tuple[str, Callable, Callable, Callable]]:
    """Entries of the ellipsoid's table: name, mean, printed, corrected.

    The mean is taken of t = t_ij (space axes) and u = t_ij,LO (axes aligned with L); formulas get n = L̂ and ⟨z_i²⟩.
    """
    rows: list[tuple[str, Callable, Callable, Callable]] = []
    for i in range(3):
        rows.append((f"⟨z{i + 1}²⟩", lambda t, u, i=i: u[:, i, 2] ** 2, lambda n, z, i=i: z[i], lambda n, z, i=i: z[i]))
        rows += [
            _second_aligned(i),
            *(_second_space(i, *pair) for pair in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))),
        ]
    for i, j, k in _cyclic():
        rows += [_third_aligned(i, j, k), _third_mixed(i, j, k), *(_third_space(axis, i, j, k) for axis in range(3))]
    return rows


def _second_aligned(i: int) -> tuple[str, Callable, Callable, Callable]:
    def value(n: np.ndarray, z: np.ndarray) -> float:
        return (1 - z[i]) / 2

    return f"⟨x{i + 1}²⟩", lambda t, u: u[:, i, 0] ** 2, value, value


def _second_space(i: int, a: int, b: int) -> tuple[str, Callable, Callable, Callable]:
    def value(n: np.ndarray, z: np.ndarray) -> float:
        return n[a] * n[b] * (3 * z[i] - 1) / 2 + (a == b) * (1 - z[i]) / 2

    name = f"⟨{'xyz'[a]}'{i + 1} {'xyz'[b]}'{i + 1}⟩"
    return name, lambda t, u: t[:, i, a] * t[:, i, b], value, value


def _third_aligned(i: int, j: int, k: int) -> tuple[str, Callable, Callable, Callable]:
    """⟨z_i x_j y_k⟩: the general formula printed puts the mean square of the axis numbered 3 instead of axis i."""
    sign = _sign(i, j, k)
    return (
        f"⟨z{i + 1} x{j + 1} y{k + 1}⟩, general formula",
        lambda t, u: u[:, i, 2] * u[:, j, 0] * u[:, k, 1],
        lambda n, z: sign / 2 * z[2],
        lambda n, z: sign / 2 * z[i],
    )


def _third_mixed(i: int, j: int, k: int) -> tuple[str, Callable, Callable, Callable]:
    """⟨z_i x'_j y'_k⟩: printed without the factor α₃₃/2."""
    sign = _sign(i, j, k)
    return (
        f"⟨z{i + 1} x'{j + 1} y'{k + 1}⟩",
        lambda t, u: u[:, i, 2] * t[:, j, 0] * t[:, k, 1],
        lambda n, z: sign * z[i],
        lambda n, z: sign * n[2] / 2 * z[i],
    )


def _third_space(axis: int, i: int, j: int, k: int) -> tuple[str, Callable, Callable, Callable]:
    """⟨t_il x'_j y'_k⟩: for l = 3 the general formula printed lacks the squares of α."""
    sign = _sign(i, j, k)
    name = f"⟨{'xyz'[axis]}'{i + 1} x'{j + 1} y'{k + 1}⟩"

    def mean(t: np.ndarray, u: np.ndarray) -> np.ndarray:
        return t[:, i, axis] * t[:, j, 0] * t[:, k, 1]

    if axis == 2:

        def printed(n: np.ndarray, z: np.ndarray) -> float:
            return sign / 2 * (n[0] * z[j] + n[1] * z[k] + n[2] * z[i])

        def corrected(n: np.ndarray, z: np.ndarray) -> float:
            return sign / 2 * (n[0] ** 2 * z[j] + n[1] ** 2 * z[k] + n[2] ** 2 * z[i])

        return f"{name}, general formula", mean, printed, corrected

    def value(n: np.ndarray, z: np.ndarray) -> float:
        return sign / 2 * n[axis] * n[2] * (z[i] - z[j if axis == 0 else k])

    return name, mean, value, value


def compute_ellipsoid(grid: Grid) -> Data:
    """Largest deviation of every entry, printed and corrected, from the brute-force mean, over random states."""
    generator = np.random.default_rng(5)
    ellipsoid = Ellipsoid(PAPER_ELLIPSOID)
    rows = ellipsoid_entries()
    worst = np.zeros((len(rows), 2))
    means = mean_squares(FLOAT)
    for _ in range(grid.of(24, 6)):
        omega, direction = generator.normal(size=3), generator.normal(size=3)
        direction /= np.linalg.norm(direction)
        size2 = float(np.sum((ellipsoid.inertia * omega) ** 2))
        t = ensemble(ellipsoid, direction, omega, grid.of(256, 256))
        u = t @ frame(direction)
        z = np.array(means(size2, float(np.sum(ellipsoid.inertia * omega**2)), *ellipsoid.inertia))
        for index, (_, mean, printed, corrected) in enumerate(rows):
            found = float(np.mean(mean(t, u)))
            errors = abs(found - printed(direction, z)), abs(found - corrected(direction, z))
            worst[index] = np.maximum(worst[index], errors)
    names = np.array([name for name, *_ in rows])
    return {"": {"entry": names, "printed": worst[:, 0], "corrected": worst[:, 1]}}


def figure_averages(data: Data) -> Figure:
    """Deviation of every entry."""
    table = data[""]
    count = len(table["entry"])
    figure, (axes,) = panels(1, 1, 6.4, 1.2 + 0.135 * count)
    place = np.arange(count)[::-1]
    floor = 1e-17
    axes.plot(np.maximum(table["corrected"], floor), place, "o", color=BLUE, markersize=4, label="corrected")
    axes.plot(np.maximum(table["printed"], floor), place, "x", color=VERMILLION, markersize=5, label="printed")
    axes.set_yticks(place, table["entry"].tolist(), fontsize=6 if count > 12 else 8)
    logarithmic(label(axes, "largest deviation from the brute-force average", "entry"), "x")
    axes.set_xlim(floor, 10)
    axes.legend(loc="lower center")
    return figure


def verdict_averages(data: Data) -> Verdict:
    """How many printed entries hold, and that all corrected ones do."""
    table = data[""]
    wrong = table["printed"] > ROUNDING
    count = len(wrong)
    largest = float(table["corrected"].max())
    expected = 0 if count < 12 else int(sum(_misprinted(name) for name in table["entry"]))
    numbers = (
        Number(f"largest deviation of the {count} entries, corrected", largest, high=ROUNDING),
        Number.near("printed entries that deviate", float(wrong.sum()), expected, 0),
    )
    if not wrong.any():
        return Verdict(Word.CONFIRMED, f"All {count} entries agree with the average to {largest:.0e}.", numbers)
    sentence = (
        f"{count - int(wrong.sum())} of {count} entries hold as printed, {int(wrong.sum())} do not: the mixed third "
        "moments, which lack α₃₃/2, and the general formulas of the third moments, which do not agree with the entries "
        f"below them. Corrected, all agree to {largest:.0e}."
    )
    return Verdict(Word.CORRECTED, sentence, numbers)


def _misprinted(name: str) -> bool:
    mixed = name.startswith("⟨z") and "'" in name and not name.startswith("⟨z'")
    general = name.endswith("general formula") and not name.startswith("⟨z3")
    return mixed or general


def caption_averages(data: Data) -> str:
    """What the figure shows."""
    return "Entries of the table of averages: largest deviation from the brute-force average over random states."


ITEMS = (
    Item(
        "averages-spheroid",
        "Table of averages, spheroid",
        "Eight averages over the precession of the symmetric top.",
        compute_spheroid,
        figure_averages,
        verdict_averages,
        caption_averages,
    ),
    Item(
        "averages-ellipsoid",
        "Table of averages, ellipsoid",
        "Second and third moments of the rotation matrix over the Euler top.",
        compute_ellipsoid,
        figure_averages,
        verdict_averages,
        caption_averages,
    ),
)
