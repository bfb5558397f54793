"""Section "The Jeffery top" (St = 0): Poincaré sections, with regular and chaotic orbits told apart by an exponent."""

from dataclasses import dataclass
from math import pi

import numpy as np
from matplotlib.figure import Figure

from polhode.harness.paper.drawing import BLACK, BLUE, VERMILLION, label, panels
from polhode.harness.paper.item import Data, Grid, Item, Number, Verdict, Word
from polhode.harness.paper.planes import columns
from polhode.harness.paper.runs import share_interval
from polhode.models.jeffery import field as jeffery_field
from polhode.models.motion import jeffery_angular_velocity, shares
from polhode.models.operations import Field, Operations, numpy_operations
from polhode.models.problem import Problem
from polhode.models.rotation import matrix_from_quaternion, quaternion_from_euler
from polhode.models.shape import Ellipsoid
from polhode.solvers.solve import solve

TOLERANCE = 1e-12
# ψ of the starts next to the saddle.
BESIDE = 1.57


class Dual:
    """A number and its derivative along a direction: one field gives its own tangent equations."""

    __array_ufunc__ = None

    def __init__(self, value: object, slope: object) -> None:
        self.value, self.slope = value, slope

    def __add__(self, other: object) -> "Dual":
        value, slope = _parts(other)
        return Dual(self.value + value, self.slope + slope)

    __radd__ = __add__

    def __neg__(self) -> "Dual":
        return Dual(-self.value, -self.slope)  # pyright: ignore[reportOperatorIssue]

    def __sub__(self, other: object) -> "Dual":
        value, slope = _parts(other)
        return Dual(self.value - value, self.slope - slope)

    def __mul__(self, other: object) -> "Dual":
        value, slope = _parts(other)
        return Dual(self.value * value, self.value * slope + self.slope * value)

    __rmul__ = __mul__

    def __rtruediv__(self, other: object) -> "Dual":
        value = 1.0 / self.value  # pyright: ignore[reportOperatorIssue]
        return Dual(value, -value * value * self.slope) * other


def _parts(number: object) -> tuple:
    return (number.value, number.slope) if isinstance(number, Dual) else (number, 0.0)


def tangent_field(ops: Operations) -> Field:
    """Jeffery's equations with one tangent vector of unit length and the logarithm of its stretching.

    State (q, u, s): u' = Ju - (u·Ju)u, s' = u·Ju with the Jacobian J of `jeffery`; all components stay of order one.
    """
    base = jeffery_field(ops)

    def rhs(y, p):  # noqa: ANN001, ANN202
        rates = base([Dual(y[i], y[4 + i]) for i in range(4)], [Dual(p[i], 0.0) for i in range(6)])
        push = [rate.slope for rate in rates]
        along = push[0] * y[4] + push[1] * y[5] + push[2] * y[6] + push[3] * y[7]
        turned = [push[i] - along * y[4 + i] for i in range(4)]
        return *(rate.value for rate in rates), *turned, along

    return rhs


def section_points(ellipsoid: Ellipsoid, times: np.ndarray, orientation: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """θ and ψ in rad where φ = nπ, from quaternions, shape (n, 4), at times of shape (n,), by cubic interpolation.

    φ = nπ is where the flow component t₃₁ of z' vanishes; ψ is given from -π/2 to π/2, its symmetry taken out.
    """
    q0, q1, q2, q3 = orientation.T
    height = q1 * q3 + q0 * q2
    before = np.flatnonzero(height[:-1] * height[1:] < 0)
    step = (times[before + 1] - times[before])[:, None]
    values, slopes = zip(*(_with_rates(ellipsoid, orientation[index]) for index in (before, before + 1)), strict=True)

    def at(place: np.ndarray, row: int | slice, column: int) -> np.ndarray:
        u = place[:, None]
        ends = [array[:, row, column].reshape(len(u), -1) for array in (*values, *slopes)]
        value = (1 + 2 * u) * (1 - u) ** 2 * ends[0] + u * (1 - u) ** 2 * step * ends[2]
        return value + u * u * (3 - 2 * u) * ends[1] + u * u * (u - 1) * step * ends[3]

    place = height[before] / (height[before] - height[before + 1])
    for _ in range(4):
        shift, nudge = at(place, 2, 0)[:, 0], at(place + 1e-6, 2, 0)[:, 0]
        place = np.clip(place - 1e-6 * shift / (nudge - shift), 0.0, 1.0)
    vorticity = at(place, slice(None), 2)
    theta = np.arccos(np.clip(vorticity[:, 2] / np.linalg.norm(vorticity, axis=1), -1, 1))
    psi = np.arctan2(vorticity[:, 0], vorticity[:, 1])
    return theta, (psi + pi / 2) % pi - pi / 2


def _with_rates(ellipsoid: Ellipsoid, orientation: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """t_ij and its rates, shape (n, 3, 3): each column c of t_ij, a space axis in body axes, obeys c' = c × ω."""
    rotation = matrix_from_quaternion(orientation)
    jeffery = jeffery_angular_velocity(numpy_operations())
    omega = np.stack(jeffery(rotation[:, :, 0].T, rotation[:, :, 1].T, shares(ellipsoid)), axis=1)
    return rotation, np.cross(rotation, omega[:, :, None], axis=1)


def chaos_border(turns: float) -> float:
    """Stretching, as a logarithm, above which an orbit of so many half turns counts as chaotic.

    Neighbours of a regular orbit part linearly in time, so that their stretching grows like the logarithm of the turns.
    """
    return 3 * float(np.log(turns))


@dataclass(frozen=True)
class Sections:
    """Poincaré sections of one ellipsoid.

    Parameters
    ----------
    semi_axes : tuple of 3 float
        Along x', y', z': z' is the longest axis of a prolate-like body and the shortest of an oblate-like one, so that
        the saddles lie at θ = π/2, ψ = ±π/2 for all of them.
    sections : int
        Half turns to follow, about.
    chaotic : tuple of 2 float
        Range for the share of chaotic orbits.
    earned : Word
        What the claim earns.
    close : tuple of 2 float
        Half width in θ and ψ, in rad, of the magnified view of the saddle.
    """

    semi_axes: tuple[float, float, float]
    sections: int
    chaotic: tuple[float, float]
    earned: Word
    close: tuple[float, float]

    @property
    def ellipsoid(self) -> Ellipsoid:
        """The body."""
        return Ellipsoid(self.semi_axes)

    @property
    def half_turn(self) -> float:
        """Half a Jeffery period of the longest and the shortest axis, the slowest turn."""
        kappa = max(self.semi_axes) / min(self.semi_axes)
        return pi * (kappa + 1 / kappa)

    def starts(self, grid: Grid) -> list[tuple[float, float]]:
        """θ and ψ at φ = 0: uniform over the section's area element, and a row next to the saddle."""
        generator = np.random.default_rng(7)
        count = grid.of(72, 8)
        theta = np.arccos(generator.uniform(-1.0, 1.0, count))
        psi = generator.uniform(-pi / 2, pi / 2, count)
        near = [(pi / 2 + offset, BESIDE) for offset in (1e-3, 5e-3, 2e-2)[: grid.of(3, 1)]]
        return [*zip(theta.tolist(), psi.tolist(), strict=True), *near]

    def compute(self, grid: Grid) -> Data:
        """Section points and stretching of every start."""
        turns = grid.of(self.sections, self.sections // 6)
        duration = turns * self.half_turn
        parts, rows = [], []
        for number, (theta, psi) in enumerate(self.starts(grid)):
            times, states = self._orbit(theta, psi, duration)
            found = section_points(self.ellipsoid, times, states[:, :4])
            parts += [(number, *point) for point in zip(*found, strict=True)]
            rows.append((number, theta, psi, states[-1, 8], states[-1, 8] / turns))
        orbits = columns("orbit theta psi stretch exponent", rows)
        thinned = parts[:: max(1, len(parts) // grid.of(9000, 2000))]
        points = columns("orbit theta psi", thinned)
        return {
            "": {name: np.round(column, 5) for name, column in points.items()},
            "orbits": {**orbits, "chaotic": (orbits["stretch"] > chaos_border(turns)).astype(float)},
            "settings": {"duration": np.array([duration]), "turns": np.array([float(turns)])},
        }

    def _orbit(self, theta: float, psi: float, duration: float) -> tuple[np.ndarray, np.ndarray]:
        times = np.linspace(0.0, duration, int(duration / STEP) + 2)
        start = (*quaternion_from_euler((theta, 0.0, psi)), 0.5, -0.5, 0.5, -0.5, 0.0)
        problem = Problem("jeffery-tangent", tangent_field, start, duration, shares(self.ellipsoid))
        solution = solve(problem, "taylor", TOLERANCE, times)
        if not solution.success:
            raise RuntimeError(f"the tangent run ended with {solution.status}")
        return times, solution.states

    def figure(self, data: Data) -> Figure:
        """The section, and the neighbourhood of the saddle magnified."""
        figure, axes = panels(1, 2, 4.2, 3.6)
        chaotic = dict(zip(data["orbits"]["orbit"], data["orbits"]["chaotic"] > 0, strict=True))
        wild = np.array([chaotic[number] for number in data[""]["orbit"]])
        for own in axes:
            for chosen, color, text in ((~wild, BLUE, "regular"), (wild, VERMILLION, "chaotic")):
                own.plot(
                    data[""]["psi"][chosen],
                    data[""]["theta"][chosen],
                    linestyle="none",
                    marker=".",
                    markersize=1.2,
                    color=color,
                    label=text,
                    rasterized=True,
                )
            label(own, "$\\psi$, rad", "$\\theta$, rad")
        axes[0].set(xlim=(-pi / 2, pi / 2), ylim=(0, pi))
        axes[0].plot([-pi / 2, pi / 2], [pi / 2, pi / 2], "x", color=BLACK, clip_on=False)
        figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=2, markerscale=5)
        width, height = self.close
        axes[1].set(xlim=(pi / 2 - width, pi / 2), ylim=(pi / 2 - height, pi / 2 + height), title="at the saddle")
        return figure

    def verdict(self, data: Data) -> Verdict:
        """Share of chaotic orbits, and the exponents of either kind."""
        orbits = data["orbits"]
        sampled = orbits["psi"] != BESIDE
        chaotic = orbits["chaotic"] > 0
        count, total = int(np.sum(chaotic & sampled)), int(np.sum(sampled))
        low, high = share_interval(count, total)
        area = 1 / np.sin(orbits["theta"][sampled])
        by_area = float(np.sum(area[chaotic[sampled]]) / np.sum(area))
        exponents = orbits["exponent"]
        regular = float(np.median(exponents[~chaotic])) if np.any(~chaotic) else 0.0
        wild = float(np.median(exponents[chaotic])) if np.any(chaotic) else 0.0
        turns = float(data["settings"]["turns"][0])
        limit = chaos_border(turns) / turns
        numbers = (
            Number("share of chaotic orbits, isotropic starts", count / total, *self.chaotic, "", (low, high)),
            Number("the same, starts uniform in (θ, ψ)", by_area),
            Number("median exponent of the chaotic orbits, per half turn", wild, low=limit if count else 0.0),
            Number("the same of the regular ones", regular, high=limit),
            Number("chaotic share of starts next to the saddle", float(np.mean(chaotic[~sampled]))),
        )
        sentence = (
            f"{count} of {total} orbits from isotropic starts are chaotic"
            + (f", with a median exponent of {wild:.2g} per half turn" if count else "")
            + f" (regular ones: {regular:.1g}); {int(np.sum(chaotic & ~sampled))} of {int(np.sum(~sampled))} that "
            "start within 0.02 rad of the saddle are."
        )
        return Verdict(self.earned, sentence, numbers)

    def caption(self, data: Data) -> str:
        """What the figure shows."""
        axes = ", ".join(f"{length:.4g}" for length in self.semi_axes)
        return (
            f"Section φ = nπ of the inertialess ellipsoid with semi-axes ({axes}) along x', y', z', "
            f"{len(data['orbits']['orbit'])} orbits over {data['settings']['duration'][0]:.3g} inverse shear rates; ψ "
            "modulo π; crosses: saddles, one of them magnified on the right."
        )


# Sampling step, in inverse shear rates, of the orbits.
STEP = 0.2

SLENDER = Sections((1 / 20, 1 / 10, 1.0), 240, (0.2, 0.75), Word.SHARPENED, (0.8, 0.8))
FAT_PROLATE = Sections((1 / 3, 1.2 / 3, 1.0), 400, (0.0, 0.1), Word.SHARPENED, (0.3, 0.3))
THIN_OBLATE = Sections((1.0, 1 / 2, 1 / 20), 240, (0.1, 0.5), Word.CORRECTED, (0.8, 0.8))
FAT_OBLATE = Sections((1.0, 2 / 2.1, 1 / 2.1), 400, (0.0, 0.1), Word.SHARPENED, (0.3, 0.3))


def _item(name: str, title: str, claim: str, sections: Sections) -> Item:
    return Item(name, title, claim, sections.compute, sections.figure, sections.verdict, sections.caption)


ITEMS = (
    _item(
        "poincare-slender",
        "Poincaré section, slender prolate ellipsoid",
        "For b/a = 1/10, c/a = 1/20 chaotic trajectories are dominant.",
        SLENDER,
    ),
    _item(
        "poincare-fat-prolate",
        "Poincaré section, fat prolate ellipsoid",
        "For b/a = 1.2/3, c/a = 1/3 chaos is confined to thin layers along the separatrices of the saddles.",
        FAT_PROLATE,
    ),
    _item(
        "poincare-flat",
        "Poincaré section, thin oblate ellipsoid",
        "For b/a = 1/2, c/a = 1/20 chaotic trajectories are dominant.",
        THIN_OBLATE,
    ),
    _item(
        "poincare-fat-oblate",
        "Poincaré section, fat oblate ellipsoid",
        "For b/a = 2/2.1, c/a = 1/2.1 chaos is confined to thin layers along the separatrices of the saddles.",
        FAT_OBLATE,
    ),
)
