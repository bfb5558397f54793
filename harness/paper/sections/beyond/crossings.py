"""Beyond the paper: the order of averaging's error with and without a crossing of L² = 2EI₂, and what that leaves."""

from typing import NamedTuple

import numpy as np
from scipy import stats

from polhode.harness.paper.item import Computed, Grid, Table
from polhode.harness.paper.runs import averaged_run, full_run
from polhode.harness.paper.tables import SLOW, Estimate, exponent, groups, mean, root_mean_squares
from polhode.models.free_top.torque_free import TorqueFree
from polhode.models.scene import BodyStart, EulerStart, Scene
from polhode.models.scenes import PAPER_ELLIPSOID, PAPER_START
from polhode.models.shape import Ellipsoid

ELLIPSOID = Ellipsoid(PAPER_ELLIPSOID)
SIDES = ("short", "long")
ORDER_TIME = 0.1
# Faster than Taylor series over so many turns; it does not stop at a graze of L² = 2EI₂ either.
FAST = "cyrk-vern8"
# Smallest St of the fits of the order.
ASYMPTOTIC = 9e4
# Starts lie between these shares of the way from the lower to the upper bound of L²/2E on their side; those of the
# long side are close to L² = 2EI₂ and cross it soon.
SHARES = {"short": (0.2, 0.8), "long": (0.6, 0.9)}


def random_start(generator: np.random.Generator, side: str) -> BodyStart:
    """Random orientation, |ω| about 0.8, on one side of L² = 2EI₂, clear of it and of the permanent rotations."""
    inertia = np.array(ELLIPSOID.inertia)
    i1, i2, i3 = np.sort(inertia)
    low, high = (i2, i3) if side == "short" else (i1, i2)
    least, most = SHARES[side]
    while True:
        omega = generator.normal(size=3)
        omega *= 0.8 / np.linalg.norm(omega)
        ratio = np.sum((inertia * omega) ** 2) / np.sum(inertia * omega**2)
        if least < (ratio - low) / (high - low) < most:
            q = generator.normal(size=4)
            return BodyStart(tuple((q / np.linalg.norm(q)).tolist()), tuple(omega.tolist()))


def same_slow_start(start: BodyStart | EulerStart, generator: np.random.Generator) -> BodyStart:
    """Another start with the same L and E: the free top at a random time."""
    top = TorqueFree(ELLIPSOID.inertia, start.quaternion, start.angular_velocity)
    quaternion, omega = top.at([generator.uniform(50.0, 500.0)])
    return BodyStart(tuple(quaternion[0].tolist()), tuple(omega[0].tolist()))


def compute_order(grid: Grid) -> Computed:
    """Largest slow error of the averaged form by side, start and St."""
    generator = np.random.default_rng(11)
    slow_times = np.linspace(0.0, ORDER_TIME, 3001)
    numbers = np.geomspace(1e4, grid.of(3e6, 3e5), grid.of(6, 4)).tolist()
    for side, (name, count) in enumerate(zip(SIDES, grid.of((16, 64), (4, 8)), strict=True)):
        for index in range(count):
            start = random_start(generator, name)
            averaged = averaged_run(Scene(ELLIPSOID, 1.0, start, ORDER_TIME), slow_times, solver=FAST).slow
            if side and not above_middle(averaged)[-1]:
                raise RuntimeError(f"start {index} does not cross L² = 2EI₂ by t₂ = {ORDER_TIME:g}")
            for stokes in numbers:
                full = full_run(Scene(ELLIPSOID, stokes, start, stokes * ORDER_TIME), stokes * slow_times, solver=FAST)
                yield (
                    "",
                    {"side": side, "start": index, "stokes": stokes, "error": np.max(np.abs(full.slow - averaged))},
                )


def above_middle(slow: np.ndarray) -> np.ndarray:
    """Where L² > 2EI₂, shape (n,)."""
    middle = sorted(ELLIPSOID.inertia)[1] / max(ELLIPSOID.inertia)
    return np.sum(slow[:, :3] ** 2, axis=1) > 2 * slow[:, 3] * middle


def start_exponents(part: Table) -> np.ndarray:
    """Exponents of all starts, from the asymptotic St on."""
    return np.array([exponent(run.stokes, run.error) for _, run in groups(part[part.stokes >= ASYMPTOTIC], "start")])


def local_exponents(part: Table) -> list[Estimate]:
    """Mean over starts of the exponents between neighbouring St."""
    runs = (np.diff(np.log([run.stokes, run.error])) for _, run in groups(part, "start"))
    return [mean(column) for column in np.transpose([errors / steps for steps, errors in runs])]


def growth(part: Table) -> float:
    """How the root mean square over starts, over St^-½ ln St, changes from the first to the last St."""
    stokes, error = root_mean_squares(part, "stokes", "error")
    over = error / (np.log(stokes) / np.sqrt(stokes))
    return over[-1] / over[0]


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


def compute_jumps(grid: Grid) -> Computed:
    """Deviations of full runs from the averaged one, before and after the crossing, over starts with the same L, E."""
    generator = np.random.default_rng(29)
    slow_times = np.linspace(0.0, SLOW_TIME, 2001)
    averaged = averaged_run(Scene(ELLIPSOID, 1.0, PAPER_START, SLOW_TIME), slow_times).slow
    crossing = slow_times[np.argmax(above_middle(averaged))]
    starts = [same_slow_start(PAPER_START, generator) for _ in range(grid.of(128, 64))]
    for stokes in grid.of((1e4, 3e4, 1e5, 3e5, 1e6), (1e4, 3e4, 3e5, 1e6)):
        scenes = [Scene(ELLIPSOID, stokes, start, stokes * SLOW_TIME) for start in starts]
        off = np.array([full_run(own, stokes * slow_times, 1e-11, solver=FAST).slow - averaged for own in scenes])
        for after, (low, high) in enumerate((BEFORE, AFTER)):
            near = (slow_times > crossing + low) & (slow_times < crossing + high)
            means = dict(zip(SLOW, off[:, near].mean(axis=1).T, strict=True))
            yield "", {"stokes": stokes, "after": after, **means}


class Scatter(NamedTuple):
    """How deviations scatter."""

    size: float  # standard deviation
    share: float  # of the variance, along the main direction
    along: np.ndarray  # components along it, which points to where the law has its tail, in units of their deviation


def _scatter(part: Table) -> Scatter:
    values = np.stack([part[name] for name in SLOW], axis=1)
    values = values - values.mean(axis=0)
    _, sizes, directions = np.linalg.svd(values, full_matrices=False)
    along = values @ directions[0]
    along = along * np.sign(stats.skew(along)) / along.std()
    return Scatter(np.sqrt(np.mean(np.sum(values**2, axis=1))), sizes[0] ** 2 / np.sum(sizes**2), along)


def by_stokes(table: Table, after: float) -> dict[float, Scatter]:
    """Of the deviations before (0) or after (1) the crossing."""
    return {stokes: _scatter(part) for stokes, part in groups(table[table.after == after], "stokes")}
