"""Beyond the paper: what a crossing of L² = 2EI₂ leaves behind, against the jump of adiabatic invariants."""

import numpy as np
from matplotlib.figure import Figure
from scipy import stats

from polhode.harness.common.fits import power_law
from polhode.harness.paper.claims import Facts
from polhode.harness.paper.drawing import AVERAGED, BLUE, GREEN, VERMILLION, draw_law, label, logarithmic, panels
from polhode.harness.paper.item import Data, Grid, Parts, Table
from polhode.harness.paper.runs import averaged_run, full_run
from polhode.harness.paper.sections.beyond.averaging_order import ELLIPSOID, FAST, same_slow_start
from polhode.harness.paper.tables import SLOW, groups, stacked
from polhode.models.scene import Scene
from polhode.models.scenes import PAPER_START

SLOW_TIME = 0.08
# Slow times before and after the crossing from which deviations are taken: means, to take the regular oscillation out.
BEFORE, AFTER = (-0.03, -0.02), (0.015, 0.025)
# Largest St at which resonances are taken not to matter.
MIDDLE = 3e5
SPREAD = np.pi / np.sqrt(12)
"""Standard deviation of ln(2 sin πξ), ξ uniform; its mean is 0."""


def law(values: np.ndarray) -> np.ndarray:
    """Distribution function of -ln(2 sin πξ), ξ uniform, in units of its standard deviation."""
    return 1 - 2 / np.pi * np.arcsin(np.exp(-np.maximum(SPREAD * values, -np.log(2))) / 2)


def fitted_level(count: int) -> float:
    """5 % level of the distance from the law of so many of its own values, their mean and deviation fitted."""
    values = -np.log(2 * np.sin(np.pi * np.random.default_rng(31).uniform(size=(4000, count))))
    values = np.sort((values - values.mean(axis=1, keepdims=True)) / values.std(axis=1, keepdims=True))
    steps = np.arange(count + 1) / count
    distances = np.maximum(steps[1:] - law(values), law(values) - steps[:-1]).max(axis=1)
    return float(np.quantile(distances, 0.95))


def compute_jumps(grid: Grid) -> Data:
    """Deviations of full runs from the averaged one, before and after the crossing, over starts with the same L, E."""
    generator = np.random.default_rng(29)
    slow_times = np.linspace(0.0, SLOW_TIME, 2001)
    averaged = averaged_run(Scene(ELLIPSOID, 1.0, PAPER_START, SLOW_TIME), slow_times).slow
    i2 = sorted(ELLIPSOID.inertia)[1] / max(ELLIPSOID.inertia)
    crossing = slow_times[np.argmax(np.sum(averaged[:, :3] ** 2, axis=1) > 2 * averaged[:, 3] * i2)]
    starts = [same_slow_start(PAPER_START, generator) for _ in range(grid.of(128, 64))]
    parts = []
    for stokes in grid.of((1e4, 3e4, 1e5, 3e5, 1e6), (1e4, 3e4, 3e5, 1e6)):
        scenes = [Scene(ELLIPSOID, stokes, start, stokes * SLOW_TIME) for start in starts]
        off = np.array([full_run(own, stokes * slow_times, 1e-11, solver=FAST).slow - averaged for own in scenes])
        for after, (low, high) in enumerate((BEFORE, AFTER)):
            near = (slow_times > crossing + low) & (slow_times < crossing + high)
            mean = off[:, near].mean(axis=1)
            parts.append(({"stokes": stokes, "after": after}, dict(zip(SLOW, mean.T, strict=True))))
    return {"": stacked(parts)}


def _scatter(part: Table) -> tuple[float, float, np.ndarray]:
    """Standard deviation of the deviations, its share along the main direction, and their components in units of it.

    The direction points to where the law has its tail.
    """
    values = np.stack([part[name] for name in SLOW], axis=1)
    values = values - values.mean(axis=0)
    _, sizes, directions = np.linalg.svd(values, full_matrices=False)
    along = values @ directions[0]
    along = along * np.sign(stats.skew(along)) / along.std()
    return float(np.sqrt(np.mean(np.sum(values**2, axis=1)))), float(sizes[0] ** 2 / np.sum(sizes**2)), along


def _by_stokes(data: Data, after: float) -> dict[float, tuple[float, float, np.ndarray]]:
    chosen = dict(groups(data[""], "after"))[after]
    return {stokes: _scatter(part) for stokes, part in groups(chosen, "stokes")}


def figure_jumps(data: Data) -> Figure:
    """Distribution at the smallest St; scatter against St."""
    figure, (left, right) = panels(1, 2, 3.8, 3.1)
    after, before = _by_stokes(data, 1.0), _by_stokes(data, 0.0)
    first = np.sort(next(iter(after.values()))[2])
    left.step(
        first, (np.arange(len(first)) + 0.5) / len(first), where="mid", color=BLUE, linewidth=2.0, label="measured"
    )
    grid = np.linspace(-2.0, 5.0, 401)
    left.plot(grid, law(grid), color=VERMILLION, label=r"$-\ln(2\,\sin\,\pi\xi)$")
    left.plot(grid, stats.norm.cdf(grid), color=AVERAGED, linestyle=":", label="normal")
    label(left, "deviation over its standard deviation", "share of starts below", f"St = {min(after):g}").legend()
    stokes = np.array(list(after))
    for color, name, found in ((BLUE, "after the crossing", after), (GREEN, "before it", before)):
        right.plot(stokes, [one[0] for one in found.values()], "o-", color=color, label=name)
    draw_law(right, stokes, after[min(after)][0] * stokes[0] / stokes[-1], -1)
    logarithmic(label(right, "Stokes number St", "scatter of the deviation$/I_{max}$")).legend()
    return figure


def facts_jumps(data: Data) -> Facts:
    """Distances of the distribution from the law and from a normal one, and how the scatter falls."""
    after, before = _by_stokes(data, 1.0), _by_stokes(data, 0.0)
    stokes, scatter = np.array(list(after)), np.array([found[0] for found in after.values()])
    first, along = min(after), after[min(after)][2]
    regular = stokes <= MIDDLE
    tail = -np.log(2 * np.sin(np.pi * (np.arange(100_000) + 0.5) / 100_000))
    return {
        "first": first,
        "middle": stokes[regular][-1],
        "last": stokes[-1],
        "stokes": stokes,
        "count": len(along),
        "share": after[first][1],
        "shares": [found[1] for found in after.values()],
        "distance": stats.kstest(along, law).statistic,
        "normal": stats.kstest(along, "norm").statistic,
        "critical": stats.kstwo.isf(0.05, len(along)),
        "fitted": fitted_level(len(along)),
        "skew": stats.skew(along),
        "law_skew": stats.skew(tail),
        "scaled": scatter * stokes,
        "exponent": power_law(stokes[regular], scatter[regular])[0],
        "last_exponent": power_law(stokes[stokes >= MIDDLE], scatter[stokes >= MIDDLE])[0],
        "ratio": scatter[0] / before[first][0],
    }


JUMPS = Parts(compute_jumps, figure_jumps, facts_jumps)
