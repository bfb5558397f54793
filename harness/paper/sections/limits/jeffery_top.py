"""Section "The Jeffery top" (St = 0): Poincaré sections, with regular and chaotic orbits told apart by an exponent."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import pi

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from polhode.harness.common.text import in_two_digits
from polhode.harness.paper.drawing import BLACK, BLUE, VERMILLION, label, panels
from polhode.harness.paper.item import Columns, Computed, Data, Grid, Table
from polhode.harness.paper.sections.limits import poincare
from polhode.harness.paper.tables import columns
from polhode.models.shape import Ellipsoid

# Where a start lies: uniform over the section's area element; next to the saddle; about the separatrix, at ψ = 0.
ISOTROPIC, BESIDE, ABOUT = 0.0, 1.0, 2.0
# Distances from the separatrix, over its own from θ = π/2, of the starts about it.
STEPS_OFF = (-16e-4, -9e-4, -4e-4, -1e-4, 0.0, 1e-4, 4e-4, 9e-4, 16e-4)
# Width, in rad, that rounding alone gives a separatrix.
ROUNDING = 1e-12


@dataclass(frozen=True)
class Sections:
    """Poincaré sections of one ellipsoid.

    Its z' is the longest axis of a prolate-like body and the shortest of an oblate-like one, so that the saddles lie at
    θ = π/2, ψ = ±π/2 for all of them.
    """

    ellipsoid: Ellipsoid
    sections: int  # half turns to follow, about
    close: tuple[float, float]  # half width in θ and ψ, in rad, of the magnified view of the saddle
    layered: bool = False  # look for the layer of chaos along the separatrix

    def starts(self, grid: Grid, layers: Sequence[tuple[float, float]]) -> list[tuple[float, float, float]]:
        """Kind, θ and ψ at φ = 0."""
        generator = np.random.default_rng(7)
        count = grid.of(72, 16)
        theta = np.arccos(generator.uniform(-1.0, 1.0, count))
        psi = generator.uniform(-pi / 2, pi / 2, count)
        found = [(ISOTROPIC, *pair) for pair in zip(theta.tolist(), psi.tolist(), strict=True)]
        found += [(BESIDE, pi / 2 + offset, 1.57) for offset in (1e-3, 5e-3, 2e-2)[: grid.of(3, 1)]]
        if layers:
            librating, circulating = layers[-1]
            middle, width = (librating + circulating) / 2, circulating - librating
            # An orbit on a sharp separatrix would only rest at the saddle.
            steps = [step for step in STEPS_OFF[:: grid.of(1, 2)] if step != 0 or width > ROUNDING]
            found += [(ABOUT, pi / 2 + middle * (1 + step), 1e-9) for step in steps]
        return found

    def compute(self, grid: Grid) -> Computed:
        """Section points and stretching of every start; the width of the layer of chaos."""
        body = self.ellipsoid
        turns = grid.of(self.sections, self.sections // 6)
        duration = turns * poincare.half_turn(body)
        counts = grid.of((200, 800), (100,)) if self.layered else ()
        layers = [poincare.measure_layer(body, count) for count in counts]
        parts, close, rows = [], [], []
        for number, (kind, theta, psi) in enumerate(self.starts(grid, layers)):
            found, stretch = poincare.stretched_orbit(body, theta, psi, duration)
            points = [(number, *point) for point in zip(*found, strict=True)]
            parts += points if kind != ABOUT else []
            close += [point for point in points if self._is_close(*point[1:])]
            rows.append((number, kind, theta, psi, stretch, stretch / turns))
        orbits = columns("orbit kind theta psi stretch exponent", rows)
        tables: dict[str, Columns] = {
            "": _thinned(parts, grid.of(9000, 2000)),
            "close": _thinned(close, grid.of(6000, 1000)),
            "orbits": {**orbits, "chaotic": (orbits["stretch"] > poincare.chaos_border(turns)).astype(float)},
            "settings": {"duration": np.array([duration]), "turns": np.array([float(turns)])},
        }
        if layers:
            rows = [(count, low, high, high - low) for count, (low, high) in zip(counts, layers, strict=True)]
            tables["layer"] = columns("turns librating circulating width", rows)
            tables["saddle"] = {"growth": np.array([poincare.saddle_growth(body)])}
        return tables

    def _is_close(self, theta: float, psi: float) -> bool:
        return abs(theta - pi / 2) <= self.close[1] and pi / 2 - psi <= self.close[0]

    def figure(self, data: Data) -> Figure:
        """The section, and the neighbourhood of the saddle magnified."""
        figure, axes = panels(1, 2, 4.2, 3.6)
        for own, name, size in zip(axes, ("", "close"), (1.2, 1.8), strict=True):
            _draw_points(own, data[name], data["orbits"], size)
        axes[0].set(xlim=(-pi / 2, pi / 2), ylim=(0, pi))
        axes[0].plot([-pi / 2, pi / 2], [pi / 2, pi / 2], "x", color=BLACK, clip_on=False)
        figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=2, markerscale=5)
        width, height = self.close
        axes[1].set(xlim=(pi / 2 - width, pi / 2), ylim=(pi / 2 - height, pi / 2 + height), title="at the saddle")
        axes[1].locator_params(axis="x", nbins=6)
        return figure


def on_layer(place: float, width: float, turns: float, growth: float) -> str:
    """What is said of the layer of chaos, where one is looked for."""
    if width > ROUNDING:
        return (
            " Between orbits that librate and orbits that circulate lies a layer of chaos at least "
            f"{width:.1g} rad wide, {place:.3f} rad from the plane θ = π/2 at ψ = 0 ({turns:g} half turns)."
        )
    return (
        f" A layer of chaos, if there is one, is thinner than {ROUNDING:g} rad: at ψ = 0 libration changes to "
        f"circulation at {place:.3f} rad from θ = π/2 within {in_two_digits(abs(width))} rad, which is rounding, "
        f"over {turns:g} half turns. The saddle repels by no more than {growth:.2g} per half turn, and a "
        "separatrix splits by what is exponentially small in the inverse of that."
    )


def beside_a_half(interval: tuple[float, float]) -> str:
    """Whether a share, known to within the interval, is most of all, about half, or the lesser part."""
    low, high = interval
    if high < 0.2:
        return ""
    return ", the lesser part" if high < 0.5 else ", the greater part" if low > 0.5 else ", about half"


def _thinned(points: list[tuple], count: int) -> Columns:
    """At most about so many of the points."""
    table = columns("orbit theta psi", points[:: max(1, len(points) // count)])
    return {name: np.round(column, 6) for name, column in table.items()}


def _draw_points(axes: Axes, points: Table, orbits: Table, size: float) -> None:
    chaotic = dict(zip(orbits.orbit, orbits.chaotic > 0, strict=True))
    wild = np.array([chaotic[number] for number in points.orbit])
    for chosen, color, text in ((~wild, BLUE, "regular"), (wild, VERMILLION, "chaotic")):
        style = {"linestyle": "none", "marker": ".", "markersize": size, "color": color, "rasterized": True}
        axes.plot(points.psi[chosen], points.theta[chosen], label=text if chosen.any() else None, **style)
    label(axes, "$\\psi$, rad", "$\\theta$, rad")
