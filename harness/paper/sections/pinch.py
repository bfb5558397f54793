"""Full and slow trajectories of spheroids at the pinch point L = 0.

A run that starts with L along the vorticity and L_z > 0 slows down. It passes L = 0 on its way to the
node at L_z < 0. In the averaged equations L = 0 is singular: there the aligned trajectory ends.
The item measures how near full runs come to it, by their smallest |L| against St. The theory of its
exponent stands in `growth_exponent` and `pinch_exponent`. Spheroids have the aspect ratio κ, the
moments I_a about their symmetry axis and I_e across it, and the resistances X_c and Y_c.

In figures, heights of panels are in inches, and widths of lines and sizes of marks and letters in
points. They and the limits of axes are chosen by eye.

Ends of the ranges for which a verdict holds are estimates where their reasons do not give them.
"""

from dataclasses import dataclass
from math import pi, sqrt
from typing import Any, ClassVar

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.optimize import brentq

from polhode.harness.common.text import short
from polhode.harness.pages.figures.style import square_decades
from polhode.harness.paper.drawing import (
    CYCLE,
    RUNS,
    draw_power,
    key_above,
    key_of,
    panels,
    run_name,
)
from polhode.harness.paper.item import (
    Computed,
    Data,
    Experiment,
    Grid,
    Number,
    Range,
    Table,
    Verdict,
    Word,
)
from polhode.harness.paper.plane_drawing import draw_frame
from polhode.harness.paper.planes import aligned_scene
from polhode.harness.paper.runs import (
    Run,
    averaged_run,
    full_run,
    run_form,
    slow_run_to_pinch,
    spheroid,
)
from polhode.harness.paper.tables import (
    Estimate,
    by,
    exponent,
    groups,
    joined,
    path,
    root_mean_squares,
    worst,
)
from polhode.models.catalogue import form as find_form
from polhode.models.forms.spheroid import Spheroid
from polhode.models.scene import BodyStart, Scene

# Runs of the planes. The paper names κ; the start and the times are estimates.
_KAPPA = 2.0  # Aspect ratio.
_MOMENTUM = 0.4  # L_z/I_max at the start.
_THETA = 0.3  # Rad: angle between the symmetry axis and L at the start.
_TILT = 0.2  # Rad: tilt of L in the second plane.
_SHOWN_STOKES = (1e3, 1e4, 1e5)  # St of the full runs that are drawn.
# Slow time to which runs of the planes are followed; the aligned averaged one ends at the pinch point. For every κ
# the pinch point is looked for up to it.
_SLOW_TIME = 0.12
# Half sizes along L_z and E of the magnified view, over I_max: by eye.
_CLOSE = (0.045, 0.0024)
# Aspect ratios below and above that at which the paper's St^-1/2 ceases to hold (`widest`).
_WIDTH_KAPPAS = (1.2, 2.0, 3.0)
# The smallest |L| is looked for from twice this L_z, over I_max, before the crossing to as far after
# it, at large St (`_least_momentum`). An estimate, which no run's smallest |L| reaches.
_WINDOW = 0.05
# St at which a run of `hybrid`, which follows the neighbourhood by the full equations, is compared
# with a full run. An estimate: a full run at a larger one takes seconds.
_COMPARED_STOKES = 1e7
# Line widths of the trajectories by St, in points. The averaged one, St = ∞, lies on top.
_WIDTHS = {np.inf: 0.6, 1e3: 1.9, 1e4: 1.4, 1e5: 1.0}


@dataclass(frozen=True)
class Pinch(Experiment):
    """How full and slow trajectories pass the pinch point, and how wide its neighbourhood is."""

    seconds: ClassVar[float] = 3.0

    def compute(self, grid: Grid) -> Computed:
        """Paths past the pinch point, and the smallest |L| of full runs against St.

        The numbers of rows, of azimuths and of St, and the range of St, are estimates.

        Tables "aligned" and "tilted" have paths, named by their St, ∞ for the averaged one. "end"
        has the slow time at which the aligned averaged run ends. "crossing" has the smallest
        |L|/I_max by κ, St and azimuth φ₀ of the start, "compared" the same by `hybrid` and by a
        full run.
        """
        slow_times = np.linspace(0.0, _SLOW_TIME, grid.of(1201, 601))
        ends, pinch = _slow_to_pinch(_KAPPA, slow_times)
        yield "aligned", path(np.inf, ends.times, ends.slow)
        yield "tilted", path(np.inf, slow_times, averaged_run(_tilted_scene(1.0), slow_times).slow)
        for stokes in _SHOWN_STOKES:
            scenes = {"aligned": _scene(_KAPPA, stokes), "tilted": _tilted_scene(stokes)}
            for table, scene in scenes.items():
                yield table, path(stokes, slow_times, full_run(scene, stokes * slow_times).slow)
        yield "end", {"t2": pinch}
        count = grid.of(8, 2)
        # Azimuths of the start over half a circle. By the quarter of a step no two are mirror
        # images, φ and π - φ, and none is 0.
        phases = ((np.arange(count) + 0.25) * pi / count).tolist()
        for kappa in _WIDTH_KAPPAS:
            _, met_at = _slow_to_pinch(kappa, slow_times)
            for stokes in np.geomspace(1e4, 1e9, grid.of(11, 6)).tolist():
                least = [_least_momentum(kappa, stokes, phi, met_at) for phi in phases]
                yield "crossing", {"kappa": kappa, "stokes": stokes, "phi": phases, "least": least}
            start = (kappa, _COMPARED_STOKES, phases[0], met_at)
            hybrid = _least_momentum(*start, form="hybrid")
            full = _least_momentum(*start, form="spheroid-axis")
            yield "compared", {"kappa": kappa, "hybrid": hybrid, "full": full}

    def judge(self, data: Data) -> Verdict:
        """How the smallest |L| scales with St, and what the aligned and the tilted runs do."""
        crossing = data["crossing"]
        largest = crossing.stokes.max()
        curves = by(crossing, "kappa")
        first = _WIDTH_KAPPAS[0]
        # Without their intervals: the exponents still change over a decade.
        last = {
            kappa: float(local_exponent(rows, largest / 10, largest))
            for kappa, rows in curves.items()
        }
        whole = local_exponent(curves[first], 1e4, largest)
        return Verdict(
            Word.CORRECTED,
            self._sentence(data, last, whole),
            self._caption(data),
            self._numbers(data, last),
        )

    def _numbers(self, data: Data, last: dict[float, float]) -> list[Number]:
        """Exponents by κ over the last decade of St, and what the runs at the pinch point do."""
        compared = data["compared"]
        largest = data["crossing"].stokes.max()
        first = _WIDTH_KAPPAS[0]
        shown = max(_SHOWN_STOKES)
        turned = by(data["tilted"], "path")
        agreement = worst(turned[shown].Lz - turned[np.inf].Lz)
        passed = [
            rows.Lz[-1] for stokes, rows in groups(data["aligned"], "path") if stokes < np.inf
        ]
        end = float(data["end"].t2[0])
        body = spheroid(_KAPPA)
        unit = _MOMENTUM * max(body.inertia) / (4 * pi)
        slowest = Range(
            unit / max(body.resistance),
            unit / min(body.resistance),
            "L_z/(4πX), for an X between the body's smallest and largest",
        )
        numbers = [
            Number(
                f"exponent of the smallest |L| up to St = {short(largest)}, κ = {first:g}",
                last[first],
                Range(pinch_exponent(first), -0.5, "theory: between amplification and the paper's"),
            )
        ]
        for kappa in _WIDTH_KAPPAS[1:]:
            expected = Range.near(
                pinch_exponent(kappa), 0.05, "theory: amplification of what the oscillation leaves"
            )
            name = f"exponent of the smallest |L| up to St = {short(largest)}, κ = {kappa:g}"
            numbers.append(Number(name, last[kappa], expected))
        numbers += [
            Number(
                f"`hybrid` against the full run, smallest |L|, St = {short(_COMPARED_STOKES)}, "
                "worst κ, relative",
                worst(compared.hybrid / compared.full - 1),
                Range.at_most(2e-2, "far below what a change of St by a half decade makes"),
            ),
            Number(
                "slow time at which the aligned averaged run ends",
                end,
                slowest,
            ),
            Number(
                "last L_z of the full runs, largest",
                max(passed),
                Range(-0.5, -0.3, "the claim: they cross, and go on to the node at -1/2"),
                "I_max",
            ),
            Number(
                f"averaged against full L_z with L_y ≠ 0, St = {short(shown)}",
                agreement,
                Range.at_most(0.02, "the claim: they agree throughout"),
                "I_max",
            ),
        ]
        return numbers

    def _sentence(self, data: Data, last: dict[float, float], whole: Estimate) -> str:
        """The finding in words."""
        crossing = data["crossing"]
        largest = short(crossing.stokes.max())
        curves = by(crossing, "kappa")
        first = _WIDTH_KAPPAS[0]
        slender = _WIDTH_KAPPAS[1:]
        shown = max(_SHOWN_STOKES)
        turned = by(data["tilted"], "path")
        agreement = worst(turned[shown].Lz - turned[np.inf].Lz)
        decades = "; ".join(
            f"{_decade_exponents(rows)} for κ = {kappa:g}" for kappa, rows in curves.items()
        )
        low, high = whole.interval
        return (
            "Runs of the form `hybrid` pass at |L| ∝ "
            f"St^({joined([last[kappa] for kappa in slender], '.3f')}) for κ = {joined(slender)}, "
            f"from a tenth of St = {largest} to it: on the way the slow equations amplify the "
            "small L_y that the fast oscillation leaves, so that the neighbourhood is "
            f"St^({joined(map(pinch_exponent, slender), '.3f')}) wide by theory, wider than "
            f"St^-1/2 for κ > {widest():.3f}. For κ = {first:g} it is |L| ∝ St^({last[first]:.3f}) "
            f"over that decade and St^({whole:.3f}) from St = 1e4 on (95 % of the fit: {low:.3f} … "
            f"{high:.3f}; the same {len(np.unique(crossing.phi))} azimuths at each St, whose "
            f"choice is not counted), between St^({pinch_exponent(first):.3f}), to which this "
            "amplification alone would lead, and the paper's bound. By decades from St = 1e4 the "
            f"exponents are {decades}. The slow trajectory does not grind to a halt: it runs into "
            "the pinch point at a finite speed and ends there at "
            f"t₂ = {data['end'].t2[0]:.3g}. With a small L_y it passes, and agrees with the full "
            f"run to {agreement:.1g} I_max at St = {short(shown)}."
        )

    def _caption(self, data: Data) -> str:
        """The caption of the figure."""
        azimuths = len(np.unique(data["crossing"].phi))
        return (
            f"κ = {_KAPPA:g} from L_z = {_MOMENTUM:g} I_e, θ₀ = {_THETA:g}. Above: L along the "
            f"vorticity; below left: L turned by {_TILT:.2g} rad; below right: smallest |L| of runs "
            f"with L along the vorticity (dots: {azimuths} azimuths φ₀, lines: their root mean "
            "square, dotted: predicted exponents)."
        )

    def draw(self, data: Data) -> Figure:
        """The planes, and the smallest |L| against St."""
        figure, axes = panels(2, 2, 2.9)
        _draw_runs(axes[0], data["aligned"])
        axes[0].set(title="$L_x = L_y = 0$ at the start", ylim=(0.0, 0.16))
        key_above(figure, axes[0])
        _draw_runs(axes[1], data["aligned"])
        width, height = _CLOSE
        title = "the same at the pinch point"
        axes[1].set(title=title, xlim=(-width, width), ylim=(0.0, 2 * height))
        _draw_runs(axes[2], data["tilted"])
        axes[2].set(title=r"$L_y \neq 0$ at the start", ylim=(0.0, 0.16))
        for color, (kappa, rows) in zip(CYCLE, groups(data["crossing"], "kappa"), strict=False):
            style: dict[str, Any] = {"marker": ".", "linestyle": "none", "markersize": 2}
            axes[3].plot(rows.stokes, rows.least, color=color, **style)
            stokes, mean = root_mean_squares(rows, "stokes", "least")
            axes[3].plot(stokes, mean, color=color, label=rf"$\kappa$ = {kappa:g}")
            draw_power(axes[3], stokes, mean[-1], pinch_exponent(kappa))
        axes[3].set(
            xlabel="Stokes number St",
            ylabel="smallest $|L|/I_{max}$",
            xscale="log",
            yscale="log",
        )
        square_decades(axes[3], fill=True)
        key_of(axes[3])
        return figure


def _decade_exponents(rows: Table) -> str:
    """Exponents of the smallest |L| by decades of St from 1e4 to 1e8; `judge` has the last decade."""
    exponents = [local_exponent(rows, 10.0**n, 10.0 ** (n + 1)) for n in range(4, 8)]
    return joined(exponents, ".2f")


def _draw_runs(axes: Axes, table: Table) -> None:
    """Trajectories in the plane of L_z and E."""
    draw_frame(axes, spheroid(_KAPPA), -0.55, 0.4)
    for color, (stokes, rows) in zip(RUNS, groups(table, "path"), strict=False):
        order = 5 if np.isinf(stokes) else 3
        style: dict[str, Any] = {"color": color, "linewidth": _WIDTHS[stokes], "zorder": order}
        axes.plot(rows.Lz, rows.E, label=run_name(stokes), **style)


def _scene(kappa: float, stokes: float, phi: float = 0.0, slow_time: float = _SLOW_TIME) -> Scene:
    """Start of a spheroid with L along the vorticity, L_z = `_MOMENTUM` and θ = `_THETA`."""
    return aligned_scene(spheroid(kappa), stokes, _MOMENTUM, _THETA, slow_time, phi)


def _tilted_scene(stokes: float) -> Scene:
    """The same start turned about the flow axis, so that L gets a component along the gradient."""
    aligned = _scene(_KAPPA, stokes)
    # The product of quaternions (c, s, 0, 0) q: a turn by `_TILT` about x.
    q0, q1, q2, q3 = aligned.start.quaternion  # pyright: ignore[reportAttributeAccessIssue]
    c = np.cos(_TILT / 2)
    s = np.sin(_TILT / 2)
    turned = (c * q0 - s * q1, c * q1 + s * q0, c * q2 - s * q3, c * q3 + s * q2)
    return Scene(
        aligned.ellipsoid, stokes, BodyStart(turned, aligned.angular_velocity), aligned.time
    )


def _slow_to_pinch(kappa: float, slow_times: np.ndarray) -> tuple[Run, float]:
    """The averaged run, L_x = L_y = 0 exactly, up to the pinch point, and the slow time of that."""
    body = spheroid(kappa)
    momentum, energy = _scene(kappa, 1.0).initial.slow[0, 2:] / max(body.inertia)
    return slow_run_to_pinch(body, (0.0, 0.0, momentum, energy), slow_times)


def _least_momentum(
    kappa: float, stokes: float, phi: float, slow_time: float, form: str = "hybrid"
) -> float:
    """Smallest |L|/I_max of a run that starts with L along the vorticity.

    The averaged run meets the pinch point at `slow_time`. The smallest |L| is looked for from two
    half windows before it to two after it.
    """
    # The half window is `_WINDOW` of L_z/I_max at the mean speed, or ten times the paper's St^-1/2
    # if that is more. At the most two reach back to the start of the run: 1.998 leaves it out, as
    # times have to increase.
    speed = _MOMENTUM / slow_time
    half = min(0.5 * slow_time, max(_WINDOW, 10 / sqrt(stokes)) / speed)
    # The number of rows, 16001, and the tolerance, 1e-10, are estimates. They suffice, as |L|² lies on
    # a parabola between rows, and the numbers are judged to 2 %.
    times = np.concatenate([[0.0], stokes * (slow_time + half * np.linspace(-1.998, 2.0, 16001))])
    run = run_form(find_form(form), _scene(kappa, stokes, phi, times[-1] / stokes), times, 1e-10)
    squares = np.sum(run.slow[:, :3] ** 2, axis=1)
    # L moves on a straight line where |L| is smallest, so that |L|² lies on a parabola. Its vertex,
    # between samples, is the smallest value.
    place = int(np.argmin(squares))
    # The first row is the start, the second one begins the window.
    if not 1 < place < len(squares) - 1:
        raise ValueError(
            f"the smallest |L| lies at an end of the window: κ = {kappa}, St = {stokes:g}"
        )
    before, least, after = squares[place - 1 : place + 2]
    return sqrt(max(0.0, least - (after - before) ** 2 / (8 * (before - 2 * least + after))))


def growth_exponent(kappa: float) -> float:
    """Exponent e of a prolate spheroid: a small L_y grows like L_z^e on the way to the pinch point.

    e is negative, so that L_y grows while L_z falls to 0.
    """
    # There h = cos θ_LO → 1, with θ_LO the angle between the axis and L, as Y_c > X_c, and dL_z/dt₂ →
    # -4πX_c. By the averaged rate of L_y, `lysmain`, e = (X_c + Y_c I_a/I_e - 2Y_c)/X_c.
    body = spheroid(kappa)
    axial = body.resistance[2]
    equatorial = body.resistance[0]
    return (axial + equatorial * Spheroid.of(body).inertia_ratio - 2 * equatorial) / axial


def pinch_exponent(kappa: float) -> float:
    """Exponent in St of the smallest |L| of a prolate spheroid on its way past the pinch point."""
    # The remainder of the O(1/St) oscillation in L_y reaches L_z when L_z^(1 - e) is of order 1/St.
    return -1 / (1 - growth_exponent(kappa))


def local_exponent(rows: Table, low: float, high: float) -> Estimate:
    """Exponent in St of the smallest |L|, as its root mean square over azimuths, between two St."""
    stokes, mean = root_mean_squares(rows, "stokes", "least")
    # A percent of room: the St of the table may differ from the ends by rounding.
    chosen = (stokes >= 0.99 * low) & (stokes <= 1.01 * high)
    return exponent(stokes[chosen], mean[chosen])


def widest() -> float:
    """The aspect ratio κ at which `pinch_exponent` is -1/2: the growth exponent is -1 there."""
    # κ = 1.1 is below it and κ = 3 above it.
    return float(brentq(lambda kappa: growth_exponent(kappa) + 1, 1.1, 3.0))  # pyright: ignore[reportArgumentType]
