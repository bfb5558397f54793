"""The limits St = 0 and ∞: Poincaré sections and chaos of the Jeffery top, and Euler tops.

The Jeffery top is an ellipsoid without inertia, St = 0. The Euler top is one without flow, St = ∞.
The items are the paper's figures `slender_prolate`, `fat_prolate`, `flat_oblate`, `fat_oblate`,
`euler_top_nutation` and `symmetric_top_nutation`. `polhode.harness.paper.jeffery_top` computes orbits
of the Jeffery top. `polhode.models.free_top` has the Euler top's closed form.

In figures, heights of panels are in inches, and widths of lines and sizes of marks and letters in
points. They and the limits of axes are chosen by eye.

Ends of the ranges for which a verdict holds are estimates where their reasons do not give them.
"""

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil, inf, pi
from typing import Any, ClassVar

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from polhode.harness.common.text import in_two_digits, percent
from polhode.harness.pages.figures.style import BLUE, VERMILLION
from polhode.harness.paper.drawing import BLACK, key_above, panels, unit_sphere
from polhode.harness.paper.item import (
    Computed,
    Data,
    Experiment,
    Grid,
    Item,
    Number,
    Range,
    Section,
    Table,
    Verdict,
    Word,
)
from polhode.harness.paper.jeffery_top import (
    PSI,
    chaos_border,
    half_turn,
    measure_layer,
    orbits_across,
    saddle_growth,
    section_points,
    stretching,
)
from polhode.harness.paper.runs import axes_of, run_form
from polhode.harness.paper.tables import Estimate, joined, median, share
from polhode.models.catalogue import form as find_form
from polhode.models.free_top.torque_free import TorqueFree
from polhode.models.scene import EulerStart, Scene
from polhode.models.shape import Ellipsoid, Triple

# Kinds of starts. They are numbers since columns of tables are read as numbers.
_ISOTROPIC = 0.0  # Orientation uniform on SO(3).
# φ = 0, with cos θ and ψ uniform. The share of chaotic orbits may differ from the share in the first
# kind: the motion in shear flow does not keep orientations uniform.
_ON_SECTION = 1.0
_BESIDE = 2.0  # Next to the saddle.
_ABOUT = 3.0  # About the separatrix, at ψ = 0.
# Starts next to the saddle, by estimate: at the saddle itself an orbit would rest.
_BESIDE_PSI = 1.57  # ψ in rad: 8e-4 from the saddle at π/2.
_BESIDE_OFFSETS = (1e-3, 5e-3, 2e-2)  # Rad: distances from the saddle along θ.
# Starts about the separatrix: their distances from it along θ, over the separatrix' own distance
# from θ = π/2. They grow like squares, so that starts are densest next to the separatrix. The one
# layer of chaos that is measured (reports/paper/limits.md) is 1e-4 rad wide at 0.78 rad: the
# steps of 1e-4 lie within about its width, the largest ones some ten widths off.
_STEPS_OFF = (-16e-4, -9e-4, -4e-4, -1e-4, 0.0, 1e-4, 4e-4, 9e-4, 16e-4)
# A start of the last kind that lies nearer than this, in rad, to the middle of the layer has step 0.
# Tables have eight digits, which blur θ by up to 5e-8. The next step, of 1e-4 of the
# separatrix' 0.78 rad, lies 8e-5 rad off.
_IN_THE_MIDDLE = 1e-6
# Width, in rad, up to which rounding alone may give a separatrix a layer. An estimate, some 500
# times the width of 2e-15 that is measured where there is none
# (reports/paper/limits/poincare-fat-oblate-layer.csv).
_ROUNDING = 1e-12
# Orbits that start across a layer: some 200 of them lie in it, which gives its width to 15 %.
_ACROSS = 1000
# Half of their window over the layer's width by the search for its ends. The edges are frayed, so
# that the layer reaches beyond these ends; the factor is an estimate. Were it too small, orbits at
# the window's ends would still be chaotic, and the width would come out too small.
_WINDOW = 2.5
# Chaotic orbits from which on the median of their exponents is given: with fewer, its interval at
# 95 % would be wide. An estimate.
_FEW = 30
_SEA = Range(0.5, 1.0, "the claim: a sea of chaos surrounds the saddle")
# Points of a section that are drawn at most: more make its files large and show no more. By eye.
_MOST_DRAWN = 5000
# Share of chaotic orbits up to which chaos counts as confined to thin layers. The paper gives no
# number: an estimate.
_THIN_SHARE = 0.05
# Starts with φ = 0, which are drawn: by eye, enough to fill the section.
_ON_SECTION_STARTS = 72
_REDUCED_STARTS = 16  # Of either random kind on the reduced grid.
# Half turns over which a layer is measured: the more, the wider it shows itself. Two counts show by
# how much; they are estimates.
_LAYER_HALF_TURNS = (200, 800)
# About how many points of a section are kept, of all of it and of the magnified view (`_thinned`).
# They are more than are drawn, for those who take the data. Estimates.
_POINTS_KEPT = 9000
_CLOSE_POINTS_KEPT = 6000


@dataclass(frozen=True)
class Start:
    """Start of an orbit: a kind, and Euler angles in rad."""

    kind: float
    theta: float
    psi: float
    phi: float = 0.0


def _angles_of(start: Start) -> Triple:
    """Euler angles (θ, φ, ψ) of a start, in rad."""
    return start.theta, start.phi, start.psi


def _random_starts(generator: np.random.Generator, kind: float, count: int) -> list[Start]:
    """Starts with cos θ and ψ uniform, and φ too if they are isotropic, else 0.

    ψ is drawn from half a turn: a half turn about z' leaves the ellipsoid unchanged, so that the
    other half holds the same orbits.
    """
    thetas = np.arccos(generator.uniform(-1.0, 1.0, count)).tolist()
    psis = generator.uniform(-pi / 2, pi / 2, count).tolist()
    # Drawn also where they are not used: either kind takes equally many numbers of the generator.
    phis = generator.uniform(0.0, 2 * pi, count).tolist()
    starts = []
    for theta, psi, phi in zip(thetas, psis, phis, strict=True):
        starts.append(Start(kind, theta, psi, phi if kind == _ISOTROPIC else 0.0))
    return starts


def _starts_about(layer: tuple[float, float], steps: Sequence[float]) -> list[Start]:
    """Starts at steps, as of `_STEPS_OFF`, from the middle of a layer with these ends, at ψ = 0."""
    librating, circulating = layer
    middle = (librating + circulating) / 2
    if circulating - librating <= _ROUNDING:
        # An orbit on a sharp separatrix would only rest at the saddle.
        steps = [step for step in steps if step != 0]
    return [Start(_ABOUT, pi / 2 + middle * (1 + step), PSI) for step in steps]


@dataclass(frozen=True)
class _Sections(Experiment):
    """Poincaré sections of one ellipsoid, with its saddles at θ = π/2, ψ = ±π/2.

    There x' lies along the vorticity. A saddle is the rotation about the shortest axis for a
    prolate-like body and about the longest one for an oblate-like body (docs/misprints.md). x' must
    be that axis: so z' is the longest axis of the first and the shortest of the second.

    The section is φ = nπ: θ and ψ are recorded whenever z' lies in the plane of φ = 0. An orbit
    librates if z' passes θ = π/2 from one section point to the next, and circulates if ψ goes
    through ±π/2. The separatrix of the saddles parts both kinds. A half turn is the time of
    `jeffery_top.half_turn`, half a Jeffery period. Counts called "turns" are of half turns. An orbit
    is chaotic if its tangent was stretched beyond `chaos_border`.

    Tables:

    - "orbits": a row for each start with its kind, exponent and whether it is chaotic.
    - "growth": the number of chaotic isotropic starts after some counts of half turns.
    - "" and "close": the points of the section and of the magnified view.
    - "layer": the ends of the layer of chaos, `librating` and `circulating`, as θ - π/2 in rad at
      ψ = 0 (`jeffery_top.measure_layer`).
    - "across": the starts across the layer (`jeffery_top.orbits_across`).
    - "saddle": the exponent of the saddle per half turn.
    - "settings": the duration of the orbits, in inverse shear rates, and in half turns, `turns`.
    """

    # An estimate for the longest of the figures, which decides no more than which one starts first.
    seconds: ClassVar[float] = 40.0
    ellipsoid: Ellipsoid
    half_turns: int  # How long to follow: about so many section points for each orbit.
    # The magnified view, in rad: its width in ψ, up to the saddle at π/2, and half its height in θ.
    close: tuple[float, float]
    isotropic: int  # Starts of random orientation.
    layered: bool = False  # Whether to look for the layer of chaos along the separatrix.

    def starts(self, grid: Grid, layers: Sequence[tuple[float, float]]) -> list[Start]:
        """Starts of all kinds, the random ones from a fixed seed.

        `layers` has the ends of the layer of chaos for each number of half turns, the largest one
        last. Without any there are no starts about the separatrix.
        """
        # Any seed would do.
        generator = np.random.default_rng(7)
        starts = _random_starts(generator, _ISOTROPIC, grid.of(self.isotropic, _REDUCED_STARTS))
        count = grid.of(_ON_SECTION_STARTS, _REDUCED_STARTS)
        starts += _random_starts(generator, _ON_SECTION, count)
        offsets = grid.of(_BESIDE_OFFSETS, _BESIDE_OFFSETS[:1])
        starts += [Start(_BESIDE, pi / 2 + offset, _BESIDE_PSI) for offset in offsets]
        if layers:
            starts += _starts_about(layers[-1], grid.of(_STEPS_OFF, _STEPS_OFF[::2]))
        return starts

    def compute(self, grid: Grid) -> Computed:
        """Stretching of every start, section points of those on the section, the layer of chaos."""
        half_turns = grid.of(self.half_turns, self.half_turns // 6)
        duration = half_turns * half_turn(self.ellipsoid)
        layer_half_turns = grid.of(_LAYER_HALF_TURNS, (100,)) if self.layered else ()
        layers = [measure_layer(self.ellipsoid, count) for count in layer_half_turns]
        starts = self.starts(grid, layers)
        yield from self._stretching(starts, half_turns)
        yield from self._points(grid, starts, duration)
        yield "settings", {"duration": duration, "turns": half_turns}
        if layers:
            yield from self._layer(grid, layer_half_turns, layers)

    def _stretching(self, starts: Sequence[Start], half_turns: int) -> Computed:
        """Tables "growth" and "orbits": the stretching of every start, and whether that is chaos."""
        # The share of chaotic orbits after fewer half turns shows whether it still changes.
        counts = [half_turns // 4, half_turns // 2, half_turns]
        angles = [_angles_of(start) for start in starts]
        # Logarithms of the stretching, and whether that is chaos: shape (starts, 3), by `counts`.
        logarithms = stretching(self.ellipsoid, angles, counts)
        chaotic = logarithms > [chaos_border(count) for count in counts]
        kinds = np.array([start.kind for start in starts])
        isotropic = kinds == _ISOTROPIC
        for place, count in enumerate(counts):
            chaotic_count = np.sum(chaotic[isotropic, place])
            row = {"turns": count, "chaotic": chaotic_count, "orbits": np.sum(isotropic)}
            yield "growth", row
        columns = dict(zip(("theta", "phi", "psi"), np.transpose(angles), strict=True))
        rows = {"orbit": np.arange(len(starts)), "kind": kinds, **columns}
        exponents = logarithms[:, -1] / half_turns
        yield "orbits", {**rows, "exponent": exponents, "chaotic": chaotic[:, -1].astype(float)}

    def _layer(
        self, grid: Grid, half_turns: Sequence[int], layers: Sequence[tuple[float, float]]
    ) -> Computed:
        """Tables "layer", "saddle" and, for a layer wider than rounding, "across".

        `layers` has the ends of the layer by number of half turns. "across" is made from a width of
        `_ROUNDING` / `_WINDOW` on, and `ThinLayers.judge` reads it from `_ROUNDING` on: it is there
        whenever it is read.
        """
        for count, (low, high) in zip(half_turns, layers, strict=True):
            ends = {"librating": low, "circulating": high}
            yield "layer", {"turns": count, **ends, "width": high - low}
        yield "saddle", {"growth": saddle_growth(self.ellipsoid)}
        low, high = layers[-1]
        half_window = _WINDOW * (high - low)
        if half_window > _ROUNDING:
            middle = (low + high) / 2
            window = (middle - half_window, middle + half_window)
            count = grid.of(_ACROSS, 32)
            yield "across", orbits_across(self.ellipsoid, half_turns[-1], window, count)

    def _points(self, grid: Grid, starts: Sequence[Start], duration: float) -> Computed:
        """Tables "" and "close": section points of the starts on the section, and those close to a saddle."""
        # Numbers of the starts that are drawn.
        drawn = [number for number, start in enumerate(starts) if start.kind != _ISOTROPIC]
        angles = [_angles_of(starts[number]) for number in drawn]
        paths = section_points(self.ellipsoid, angles, duration)
        width, height = self.close
        whole = []
        close = []
        for number, (theta, psi) in zip(drawn, paths, strict=True):
            points = np.column_stack([np.full(len(theta), number), theta, psi])
            # The picture of the whole section is too coarse for orbits about the separatrix.
            if starts[number].kind != _ABOUT:
                whole.append(points)
            # ψ is at most π/2: the frame has the saddle on its right edge.
            in_frame = (np.abs(theta - pi / 2) <= height) & (pi / 2 - psi <= width)
            close.append(points[in_frame])
        yield "", _thinned(np.concatenate(whole), grid.of(_POINTS_KEPT, 2000))
        yield "close", _thinned(np.concatenate(close), grid.of(_CLOSE_POINTS_KEPT, 1000))

    @abstractmethod
    def judge(self, data: Data) -> Verdict:
        """Compare the chaos that was found with the claim."""

    def draw(self, data: Data) -> Figure:
        """The section, and one saddle magnified; chaotic orbits stand out."""
        orbits = data["orbits"]
        chaotic_orbits = orbits.orbit[orbits.chaotic > 0]
        figure, (whole, saddle) = panels(1, 2, 2.9)
        # Sizes of points, in typographic points, by eye: the magnified view has fewer of them.
        _draw_section(whole, data[""], chaotic_orbits, 1.2)
        _draw_section(saddle, data["close"], chaotic_orbits, 1.8)
        whole.set(xlim=(-pi / 2, pi / 2), ylim=(0, pi))
        whole.plot([-pi / 2, pi / 2], [pi / 2, pi / 2], "x", color=BLACK, clip_on=False)
        width, height = self.close
        saddle.set(
            xlim=(pi / 2 - width, pi / 2),
            ylim=(pi / 2 - height, pi / 2 + height),
            title="at the saddle",
        )
        # At most 6 intervals between ticks, by eye, so that their labels stay apart.
        saddle.locator_params(axis="x", nbins=6)
        # Points as small as in the panels would not show their colours in the key.
        key_above(figure, whole, markerscale=5)
        return figure

    def caption(self, data: Data) -> str:
        """The caption of the figure."""
        orbits = data["orbits"]
        about = ", with more orbits about its separatrix" if self.layered else ""
        drawn = np.sum((orbits.kind == _ON_SECTION) | (orbits.kind == _BESIDE))
        return (
            "Section φ = nπ of the inertialess ellipsoid with semi-axes "
            f"{axes_of(self.ellipsoid)} along x', y', z', {drawn} orbits that start on it "
            f"over {data['settings'].duration[0]:.3g} inverse shear rates; ψ modulo π; crosses: "
            f"saddles, one of them magnified on the right{about}."
        )


def _draw_section(axes: Axes, table: Table, chaotic_orbits: np.ndarray, size: float) -> None:
    """Draw points of a section, `_MOST_DRAWN` at most; chaotic orbits stand out.

    `size` is in typographic points.
    """
    drawn = table[:: ceil(len(table) / _MOST_DRAWN)]
    chaotic = np.isin(drawn.orbit, chaotic_orbits)
    # As pixels in SVG too, where thousands of marks would make large files.
    style: dict[str, Any] = {
        "linestyle": "none",
        "marker": ".",
        "markersize": size,
        "rasterized": True,
    }
    regular = drawn[~chaotic]
    axes.plot(regular.psi, regular.theta, color=BLUE, label="regular", **style)
    if chaotic.any():
        irregular = drawn[chaotic]
        axes.plot(irregular.psi, irregular.theta, color=VERMILLION, label="chaotic", **style)
    axes.set(xlabel=r"$\psi$, rad", ylabel=r"$\theta$, rad")


@dataclass(frozen=True)
class Chaos:
    """How many of a section's orbits are chaotic, and how fast neighbours of an orbit part from it.

    Exponents are logarithms of the stretching over the number of half turns.
    """

    # Whether each orbit is chaotic, shape (n,) with n starts of the kind.
    isotropic: np.ndarray  # Uniform on SO(3).
    on_section: np.ndarray  # φ = 0, cos θ and ψ uniform.
    beside: np.ndarray  # Next to the saddle.
    share: Estimate  # Share of chaotic orbits among the isotropic ones.
    # Median exponents of the orbits of all kinds, per half turn; None where few are chaotic.
    chaotic_exponent: Estimate | None
    regular_exponent: Estimate
    chaotic_count: int  # Chaotic orbits of all kinds.

    @classmethod
    def of(cls, data: Data) -> "Chaos":
        """The chaos that an item's tables show."""
        orbits = data["orbits"]
        chaotic = orbits.chaotic > 0
        isotropic = chaotic[orbits.kind == _ISOTROPIC]
        count = int(np.sum(chaotic))
        return cls(
            isotropic=isotropic,
            on_section=chaotic[orbits.kind == _ON_SECTION],
            beside=chaotic[orbits.kind == _BESIDE],
            share=share(isotropic),
            chaotic_exponent=median(orbits.exponent[chaotic]) if count >= _FEW else None,
            regular_exponent=median(orbits.exponent[~chaotic]),
            chaotic_count=count,
        )

    def sentence(self) -> str:
        """Shares and exponents in words."""
        exponents = f"{self.regular_exponent:.2g} of the regular ones"
        if self.chaotic_exponent is not None:
            exponents = f"{self.chaotic_exponent:.2g} of the chaotic ones, {exponents}"
        chaotic = percent(self.share) if self.share > 0 else "none"
        return (
            f"Of {len(self.isotropic)} orbits from orientations that are uniform on SO(3) "
            f"{chaotic} are chaotic (median exponent per half turn, all starts: {exponents}); of "
            f"{len(self.beside)} that start within {max(_BESIDE_OFFSETS):g} rad of the saddle "
            f"{np.sum(self.beside)} are."
        )

    def numbers(self, expected: Range | None, beside: Range | None = None) -> list[Number]:
        """The share of chaotic orbits and the numbers that support it.

        `expected` is the range of the share over all orientations, `beside` the range of the share
        next to the saddle; without a range a number informs only.
        """
        low, high = self.share.interval
        numbers = [
            Number(
                "share of chaotic orbits, starts uniform on SO(3)",
                float(self.share),
                expected,
                interval=(low, high),
                measure=f"{len(self.isotropic)} random orientations",
            ),
            Number(
                "the same of starts on the section: φ = 0, cos θ and ψ uniform",
                float(np.mean(self.on_section)),
                interval=share(self.on_section).interval,
                measure=f"{len(self.on_section)} random starts",
            ),
            Number(
                "median exponent of the regular orbits, per half turn",
                self.regular_exponent,
                interval=self.regular_exponent.interval,
            ),
            Number(
                "chaotic share of starts next to the saddle",
                float(np.mean(self.beside)),
                beside,
                measure=f"{len(self.beside)} chosen starts",
            ),
        ]
        exponent = self.chaotic_exponent
        if exponent is not None:
            name = "median exponent of the chaotic orbits, per half turn"
            measure = f"{self.chaotic_count} orbits of all starts"
            numbers.append(Number(name, exponent, interval=exponent.interval, measure=measure))
        return numbers


@dataclass(frozen=True)
class DominantChaos(_Sections):
    """Whether more than half of the orientations are chaotic: what "dominant" is taken as."""

    def judge(self, data: Data) -> Verdict:
        """By the interval of the share at 95 %: above one half, below, or both sides of it."""
        chaos = Chaos.of(data)
        low, high = chaos.share.interval
        expected = None
        if low > 0.5:
            word = Word.CONFIRMED
            words = "the greater part"
            expected = Range(0.5, 1.0, "the claim: dominant is more than half")
        elif high < 0.5:
            word = Word.CORRECTED
            words = "the lesser part"
            expected = Range(0.0, 0.5, "against the claim: dominant is more than half")
        else:
            word = Word.UNDECIDED
            words = "about half"
        growth = data["growth"]
        shares = joined(growth.chaotic / growth.orbits, ".2f")
        sentence = (
            f"{chaos.sentence()} The share depends on the measure; dominant is taken as more than "
            f"half of all orientations: it is {words}. After {joined(growth.turns)} half turns the "
            f"share is {shares}: an orbit that shows its chaos later counts as regular, so that the "
            "share is a lower bound."
        )
        return Verdict(word, sentence, self.caption(data), chaos.numbers(expected, _SEA))


@dataclass(frozen=True)
class ThinLayers(_Sections):
    """Whether chaos is confined to a thin layer along the separatrix of the saddles."""

    def judge(self, data: Data) -> Verdict:
        """A layer that is wider than rounding shows itself; one that is not may be absent."""
        chaos = Chaos.of(data)
        layer = data["layer"]
        # The last row has the most half turns.
        width = float(layer.width[-1])
        interval = None
        turns = layer.turns[-1]
        growth = float(data["saddle"].growth[0])
        resolved = width > _ROUNDING
        if resolved:
            width, interval = _frayed_width(data["across"])
            # Estimates, about a factor of ten on either side of the 1.1e-4 rad that is measured.
            expected = Range(1e-5, 1e-3, "wider than rounding by far, and thin beside the section")
            words = self._resolved(data, width, chaos)
        else:
            expected = Range.near(0.0, _ROUNDING, "the width that rounding gives a separatrix")
            words = self._unresolved(data, chaos)
        if width < -_ROUNDING:
            # `measure_layer` gives a negative width then. It lies outside the expected range, so
            # that the verdict is not confirmed.
            words = (
                f"Over {turns:g} half turns orbits next to the separatrix have not yet left the "
                "saddle: whether there is a layer is not measured."
            )
        numbers = chaos.numbers(Range(0.0, _THIN_SHARE, "up to this share a layer counts as thin"))
        name = f"width of the layer at ψ = 0 over {turns:g} half turns"
        measure = (
            ""
            if interval is None
            else f"starts that librate and circulate, of {len(data['across'])}"
        )
        numbers.append(
            Number(
                name, width, expected, "rad", interval=interval, measure=measure, floor=_ROUNDING
            )
        )
        positive = Range(0.0, 1.0, "a saddle repels, a weak one by less than e per half turn")
        numbers.append(Number("exponent of the saddle itself, per half turn", growth, positive))
        word = Word.SHARPENED if resolved else Word.UNDECIDED
        return Verdict(word, f"{chaos.sentence()} {words}", self.caption(data), numbers)

    def _unresolved(self, data: Data, chaos: Chaos) -> str:
        """Words about a layer that rounding would hide."""
        layer = data["layer"]
        evidence = "As no orbit is chaotic, there may be none."
        if chaos.chaotic_count:
            evidence = f"Yet orbits are chaotic: {chaos.chaotic_count} of all starts."
        growth = float(data["saddle"].growth[0])
        return (
            f"A layer of chaos, if there is one, is thinner than {_ROUNDING:g} rad: at ψ = 0 "
            f"libration changes to circulation at {layer.librating[-1]:.3f} rad from θ = π/2 within "
            f"what rounding leaves, over {layer.turns[-1]:g} half turns. "
            f"The saddle repels by no more than {growth:.2g} per half turn, and a separatrix "
            f"splits by what is exponentially small in the inverse of that. {evidence}"
        )

    def _resolved(self, data: Data, width: float, chaos: Chaos) -> str:
        """Words about a layer that is wider than rounding, `width` in rad."""
        orbits = data["orbits"]
        layer = data["layer"]
        middle = (layer.librating[-1] + layer.circulating[-1]) / 2
        offset = np.abs(orbits.theta - pi / 2 - middle)
        beside_layer = (orbits.kind == _ABOUT) & (offset > _IN_THE_MIDDLE)
        chaotic = int(np.sum(orbits.chaotic[beside_layer] > 0))
        nearest = f"{offset[beside_layer].min():.1g}"
        farthest = f"{offset[beside_layer].max():.1g}"
        return (
            "Between orbits that librate and orbits that circulate lies a layer of chaos with frayed "
            f"edges, {layer.librating[-1]:.3f} rad from the plane θ = π/2 at ψ = 0: orbits that do "
            f"both within {layer.turns[-1]:g} half turns start from {in_two_digits(width)} rad in all. "
            f"It is thin there: of {np.sum(beside_layer)} orbits that start from {nearest} to "
            f"{farthest} rad beside its middle {chaotic or 'none'} {'is' if chaotic < 2 else 'are'} "
            "chaotic. The share of random orientations alone would not show it: it may be up to "
            f"{chaos.share.interval[1]:.2g} at 95 %."
        )


def _frayed_width(across: Table) -> tuple[float, tuple[float, float]]:
    """Length, in rad, of the starts that both librate and circulate, and its interval at 95 %.

    `across` is the table of `jeffery_top.orbits_across`.
    """
    mixed = share((across.librates > 0) & (across.circulates > 0))
    # Starts are the middles of equal parts of the window: it is one part longer than from the first
    # start to the last.
    window = len(across) * (across.offset[-1] - across.offset[0]) / (len(across) - 1)
    low, high = mixed.interval
    return float(mixed) * window, (low * window, high * window)


def _thinned(points: np.ndarray, count: int) -> dict[str, np.ndarray]:
    """Every k-th point, about `count` of them, as columns.

    `points` has the orbit's number, θ and ψ in rad, shape (n, 3).
    """
    # A figure shows no more than six decimals, and the files are smaller.
    table = np.round(points[:: max(1, len(points) // count)], 6)
    return dict(zip(("orbit", "theta", "psi"), table.T, strict=True))


# The start of the paper's figures of tops: Euler angles in rad, and their rates in shear rates.
_TOP_START = EulerStart((1.05, 0.0, 0.0), (2.5, 15.0, 4.0))
# Duration, in inverse shear rates, of the tops' paths: 26 to 28 turns of the precession, by eye
# enough to show the band. The paper gives none.
_TOP_TIME = 12.0
# Turns of the precession in which the path must not close, by estimate. In more turns any path
# comes close to closing: in the 27 that are shown, T'/T comes within 2e-4 of a fraction.
_TURNS = 12


@dataclass(frozen=True)
class _Top(Experiment):
    """A top of one shape from the paper's start."""

    ellipsoid: Ellipsoid

    def compute(self, grid: Grid) -> Computed:
        """Path of z', in the closed form, and the closed form against integration."""
        # 200 rows in an inverse shear rate, some 90 in each turn of the precession.
        times = np.linspace(0.0, _TOP_TIME, grid.of(2401, 601))
        scene = Scene(self.ellipsoid, inf, _TOP_START, _TOP_TIME)
        form = find_form("euler-top")
        # The tolerance, 1e-14, is about as tight as double precision allows; the closed form has no
        # use for one.
        exact = run_form(form, scene, times, 1e-14, solver="exact").observables
        integrated = run_form(form, scene, times, 1e-14, solver="taylor").observables
        axis = exact.rotation[:, 2]
        size = float(np.linalg.norm(exact.angular_momentum[0]))
        nutation = np.arccos(axis @ exact.angular_momentum[0] / size)
        inertia = self.ellipsoid.inertia
        top = TorqueFree(inertia, _TOP_START.quaternion, _TOP_START.angular_velocity)
        difference = np.max(np.abs(exact.rotation - integrated.rotation))
        drift = np.max(np.abs(exact.slow - exact.slow[0])) / np.max(np.abs(exact.slow[0]))
        path = {"x": axis[:, 0], "y": axis[:, 1], "z": axis[:, 2]}
        yield "", {"t": times, **path, "nutation": nutation}
        periods = {"period": top.period, "precession_period": top.precession_period}
        yield "numbers", {**periods, "difference": difference, "drift": drift, "momentum": size}

    @abstractmethod
    def judge(self, data: Data) -> Verdict:
        """Compare the path with the claim."""

    def draw(self, data: Data) -> Figure:
        """The path of z' on the unit sphere."""
        path = data[""]
        figure, (axes,) = panels(1, 1, 4.6, spatial=[0])
        unit_sphere(axes)
        # Thin lines, so that turns that lie close to each other stay apart.
        axes.plot(path.x, path.y, path.z, color=BLUE, linewidth=0.6)
        # The dot's size, in typographic points, by eye; above the lines.
        style: dict[str, Any] = {"marker": "o", "color": VERMILLION, "markersize": 5, "zorder": 5}
        axes.plot(path.x[:1], path.y[:1], path.z[:1], **style)
        return figure

    def caption(self) -> str:
        """The caption of the figure."""
        start = joined((*_TOP_START.angles, *_TOP_START.rates))
        return (
            f"Path of z' on the unit sphere for {_TOP_TIME:g} inverse shear rates from "
            f"(θ, φ, ψ, θ̇, φ̇, ψ̇) = ({start}) at St = ∞, in closed form; the dot is the start."
        )

    def checks(self, data: Data) -> list[Number]:
        """The closed form against an integration."""
        numbers = data["numbers"]
        # Both bounds are estimates, far above the 5e-14 and 3e-16 that are measured and far below
        # what a figure shows.
        return [
            Number(
                "closed form against integration, largest |Δt_ij|",
                numbers.difference[0],
                Range.at_most(1e-10, "the integration's error over some 27 turns"),
            ),
            Number(
                "drift of L and E, relative",
                numbers.drift[0],
                Range.at_most(1e-12, "rounding: both are conserved"),
            ),
        ]


@dataclass(frozen=True)
class GeneralTop(_Top):
    """A top of three unequal axes."""

    def judge(self, data: Data) -> Verdict:
        """That the path does not close within `_TURNS` turns of the precession."""
        table = data[""]
        numbers = data["numbers"]
        least = np.degrees(table.nutation.min())
        most = np.degrees(table.nutation.max())
        ratio = numbers.precession_period[0] / numbers.period[0]
        denominators = np.arange(1, 2 * _TURNS + 1)
        # The nutation has half the period of the polhode, T/2. So the path closes after n turns of
        # the precession if nT' is a multiple of T/2, that is if T'/T is a fraction with the
        # denominator 2n. Odd denominators are tried too, which asks for more.
        distance = np.min(np.abs(ratio - np.rint(ratio * denominators) / denominators))
        return Verdict(
            Word.SHARPENED,
            f"The axis nutates between {least:.1f}° and {most:.1f}° from L with T = "
            f"{numbers.period[0]:.5g} and precesses with T' = {numbers.precession_period[0]:.5g}; "
            f"T'/T = {ratio:.5f} is {distance:.1g} from the nearest fraction with a denominator up "
            f"to {2 * _TURNS}: as the nutation repeats itself after T/2, the path does not close "
            f"within {_TURNS} turns of the precession.",
            self.caption(),
            [
                Number(
                    "width of the band of nutation",
                    most - least,
                    Range(1.0, 90.0, "a band, and no circle"),
                    "degrees",
                ),
                Number("precession period T' over polhode period T", ratio),
                Number(
                    "distance of T'/T from the nearest fraction with a denominator up to "
                    f"{2 * _TURNS}",
                    distance,
                    Range(1e-3, 0.5, "far above the digits of the two periods"),
                ),
                *self.checks(data),
            ],
        )


@dataclass(frozen=True)
class SymmetricTop(_Top):
    """A top with a symmetry axis."""

    def judge(self, data: Data) -> Verdict:
        """That the axis describes a circle with the printed period."""
        table = data[""]
        measured = measured_period(table)
        printed = 2 * pi * self.ellipsoid.inertia[0] / data["numbers"].momentum[0]
        return Verdict(
            Word.CONFIRMED,
            f"The axis describes a circle {np.degrees(table.nutation.mean()):.1f}° from L, once in "
            f"{measured:.5g} = 2πI_e/L.",
            self.caption(),
            [
                Number(
                    "variation of the nutation angle",
                    np.ptp(table.nutation),
                    # The nutation is computed in double precision; its table rounds it to steps of
                    # 1e-7 rad. The bound is an estimate, ten of these.
                    Range.at_most(1e-6, "far above the eight digits of the table"),
                    "rad",
                ),
                Number(
                    "relative difference of the measured period from 2πI_e/L",
                    abs(measured / printed - 1),
                    Range.at_most(1e-6, "the digits of the table"),
                ),
                *self.checks(data),
            ],
        )


def measured_period(path: Table) -> float:
    """Time in which z' goes once about L, from a table with the columns t, x, y, z.

    The path is a circle: three of its points give its normal, and the azimuth about it grows
    evenly.
    """
    axis = np.column_stack([path.x, path.y, path.z])
    # Any three different points give the normal. These are the first one, and those after a fifth and a
    # third of the path.
    second = axis[len(axis) // 5]
    third = axis[len(axis) // 3]
    normal = np.cross(axis[0] - second, axis[0] - third)
    normal /= np.linalg.norm(normal)
    # The parts of the axes in the plane of the circle, where `first` and `beside` are unit vectors.
    across = axis - np.outer(axis @ normal, normal)
    first = across[0] / np.linalg.norm(across[0])
    beside = np.cross(normal, first)
    azimuth = np.unwrap(np.arctan2(across @ beside, across @ first))
    return path.t[-1] * 2 * pi / abs(azimuth[-1] - azimuth[0])


# z' is the longest axis of the first two bodies and the shortest of the next two. Chaos is claimed to
# dominate for slender and flat bodies. Their 2000 isotropic starts narrow the interval of the share to
# ±0.02. They have 120 half turns, the last half of which changes the share by 0.01 at most. For the
# bodies whose chaos is claimed to be thin, 400 orbits without a chaotic one bound the share by 0.01.
# They are followed for 400 half turns, an estimate. The slowest of the chaotic orbits of the fat
# prolate body has the exponent 0.054: n half turns stretch it by 0.054 n, which passes the border,
# 3 log n, after about 320. Magnified views are chosen by eye.
LIMITS_SECTION = Section(
    "limits",
    "Limiting cases: the Jeffery and the Euler top",
    (
        Item(
            "poincare-slender",
            "Poincaré section, slender prolate ellipsoid",
            "slender_prolate",
            "For b/a = 1/10, c/a = 1/20 chaotic trajectories are dominant.",
            DominantChaos(
                Ellipsoid((1 / 20, 1 / 10, 1.0)), half_turns=120, close=(0.8, 0.8), isotropic=2000
            ),
        ),
        Item(
            "poincare-fat-prolate",
            "Poincaré section, fat prolate ellipsoid",
            "fat_prolate",
            "For b/a = 1.2/3, c/a = 1/3 chaos is confined to thin layers along the separatrices of "
            "the saddles.",
            ThinLayers(
                Ellipsoid((1 / 3, 1.2 / 3, 1.0)),
                half_turns=400,
                close=(0.06, 0.06),
                isotropic=400,
                layered=True,
            ),
        ),
        Item(
            "poincare-flat",
            "Poincaré section, thin oblate ellipsoid",
            "flat_oblate",
            "For b/a = 1/2, c/a = 1/20 chaotic trajectories are dominant.",
            DominantChaos(
                Ellipsoid((1.0, 1 / 2, 1 / 20)), half_turns=120, close=(0.8, 0.8), isotropic=2000
            ),
        ),
        Item(
            "poincare-fat-oblate",
            "Poincaré section, fat oblate ellipsoid",
            "fat_oblate",
            "For b/a = 2/2.1, c/a = 1/2.1 chaos is confined to thin layers along the separatrices "
            "of the saddles.",
            ThinLayers(
                Ellipsoid((1.0, 2 / 2.1, 1 / 2.1)),
                half_turns=400,
                close=(0.06, 0.03),
                isotropic=400,
                layered=True,
            ),
        ),
        Item(
            "euler-top",
            "Trajectory of a general Euler top",
            "euler_top_nutation",
            "Nutation and precession of (1, 2, 2.3) have incommensurate periods: the orientation "
            "vector fills a band.",
            GeneralTop(Ellipsoid((1.0, 2.0, 2.3))),
        ),
        Item(
            "symmetric-top",
            "Trajectory of a symmetric Euler top",
            "symmetric_top_nutation",
            "The axis of κ = 2.3 describes a circle about L with the period 2πI_e/L.",
            SymmetricTop(Ellipsoid((1.0, 1.0, 2.3))),
        ),
    ),
)
