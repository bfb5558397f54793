"""Beyond the paper: averaging's error with and without a crossing of L² = 2EI₂, endings next to the saddle, basins."""

from itertools import product
from math import pi, sqrt
from typing import NamedTuple

import numpy as np
from scipy import optimize, stats

from polhode.harness.paper.item import Computed, Grid, Table
from polhode.harness.paper.planes import distance_from_node, energy_at
from polhode.harness.paper.runs import averaged_run, full_run, graded, slow_run
from polhode.harness.paper.tables import SLOW, Estimate, exponent, groups, mean, share
from polhode.models.free_top.torque_free import TorqueFree
from polhode.models.rotation import quaternion_from_euler
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
# Starts lie between these shares of the way from the lower to the upper bound of L²/2E on their
# side; those of the long side are close to L² = 2EI₂ and cross it soon.
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
    numbers = [*np.geomspace(1e4, grid.of(3e6, 3e5), grid.of(6, 4)).tolist(), *grid.of((1e7,), ())]
    for side, (name, count) in enumerate(zip(SIDES, grid.of((16, 64), (4, 8)), strict=True)):
        for index in range(count):
            start = random_start(generator, name)
            averaged = averaged_run(
                Scene(ELLIPSOID, 1.0, start, ORDER_TIME), slow_times, solver=FAST
            ).slow
            if side and not above_middle(averaged)[-1]:
                raise RuntimeError(f"start {index} does not cross L² = 2EI₂ by t₂ = {ORDER_TIME:g}")
            for stokes in numbers:
                full = full_run(
                    Scene(ELLIPSOID, stokes, start, stokes * ORDER_TIME),
                    stokes * slow_times,
                    solver=FAST,
                )
                error = np.max(np.abs(full.slow - averaged))
                yield "", {"side": side, "start": index, "stokes": stokes, "error": error}


def above_middle(slow: np.ndarray) -> np.ndarray:
    """Where L² > 2EI₂, shape (n,)."""
    middle = sorted(ELLIPSOID.inertia)[1] / max(ELLIPSOID.inertia)
    return np.sum(slow[:, :3] ** 2, axis=1) > 2 * slow[:, 3] * middle


def start_exponents(part: Table) -> np.ndarray:
    """Exponents of all starts, from the asymptotic St on."""
    return np.array(
        [
            exponent(run.stokes, run.error)
            for _, run in groups(part[part.stokes >= ASYMPTOTIC], "start")
        ]
    )


def typical_errors(part: Table) -> np.ndarray:
    """Geometric mean of the error over starts, at each St."""
    return np.array([np.exp(np.mean(np.log(own.error))) for _, own in groups(part, "stokes")])


def two_laws(stokes: np.ndarray, errors: np.ndarray) -> tuple[float, float]:
    """a and b of errors ((a/St)² + b²/St)^½: a jump and a scattering that add up as independent ones do."""
    laws = np.stack([stokes**-2, 1 / stokes], axis=1) / errors[:, None] ** 2
    jump, scattering = np.sqrt(optimize.nnls(laws, np.ones(len(stokes)))[0]).tolist()
    return jump, scattering


def local_exponents(part: Table) -> list[Estimate]:
    """Mean over starts of the exponents between neighbouring St."""
    runs = (np.diff(np.log([run.stokes, run.error])) for _, run in groups(part, "start"))
    return [mean(column) for column in np.transpose([errors / steps for steps, errors in runs])]


SLOW_TIME = 0.08
# Slow times before and after the crossing from which deviations are taken: means, to take the
# regular oscillation out.
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
    values = np.sort(
        (values - values.mean(axis=1, keepdims=True)) / values.std(axis=1, keepdims=True)
    )
    steps = np.arange(count + 1) / count
    distances = np.maximum(steps[1:] - law(values), law(values) - steps[:-1]).max(axis=1)
    return float(np.quantile(distances, 0.95))


def compute_jumps(grid: Grid) -> Computed:
    """Deviations of full runs from the averaged one, before and after the crossing, over starts with the same L, E."""
    generator = np.random.default_rng(29)
    slow_times = np.linspace(0.0, SLOW_TIME, 2001)
    averaged = averaged_run(Scene(ELLIPSOID, 1.0, PAPER_START, SLOW_TIME), slow_times).slow
    crossing = slow_times[np.argmax(above_middle(averaged))]
    starts = [same_slow_start(PAPER_START, generator) for _ in range(grid.of(128, 48))]
    for stokes in grid.of((1e4, 3e4, 1e5, 3e5, 1e6), (1e4, 3e4, 3e5, 1e6)):
        scenes = [Scene(ELLIPSOID, stokes, start, stokes * SLOW_TIME) for start in starts]
        off = np.array(
            [
                full_run(own, stokes * slow_times, 1e-11, solver=FAST).slow - averaged
                for own in scenes
            ]
        )
        for after, (low, high) in enumerate((BEFORE, AFTER)):
            near = (slow_times > crossing + low) & (slow_times < crossing + high)
            means = dict(zip(SLOW, off[:, near].mean(axis=1).T, strict=True))
            yield "", {"stokes": stokes, "after": after, **means}


class Scatter(NamedTuple):
    """How deviations scatter."""

    size: float  # standard deviation
    share: float  # of the variance, along the main direction
    along: np.ndarray  # components along it, which points to where the law has its tail, in units of their deviation


def scatter(part: Table) -> Scatter:
    """Of deviations in L and E."""
    values = np.stack([part[name] for name in SLOW], axis=1)
    values = values - values.mean(axis=0)
    _, sizes, directions = np.linalg.svd(values, full_matrices=False)
    along = values @ directions[0]
    along = along * np.sign(stats.skew(along)) / along.std()
    return Scatter(
        np.sqrt(np.mean(np.sum(values**2, axis=1))), sizes[0] ** 2 / np.sum(sizes**2), along
    )


ENDING_TIME = 1.5
# Of the figure of arrivals.
TICKS = [0.2, 0.5, 1.0], ["0.2", "0.5", "1"]
ARRIVED = 0.06
ENDING_STOKES = (3e2, 5e2, 1e3, 3e3, 1e4)
# How near to the saddle the starts are: standard deviation of their tilts, in rad, and of their
# angular velocities.
NEAR = (3e-2, 3e-3, 3e-4)


def saddle_start(generator: np.random.Generator, near: float) -> BodyStart:
    """Longest axis along the vorticity and ω = -½ along it, both but for about `near`."""
    theta, phi, psi = pi / 2, generator.uniform(0, 2 * pi), generator.choice([-pi / 2, pi / 2])
    tilt = generator.normal(scale=near, size=2)
    quaternion = quaternion_from_euler((theta + tilt[0], phi, psi + tilt[1]))
    noise = generator.normal(scale=near, size=3)
    sign = -np.sign(psi)
    return BodyStart(quaternion, (0.5 * sign + noise[0], noise[1], noise[2]))


def compute_endings(grid: Grid) -> Computed:
    """Arrival at the node from next to the saddle: averaged, and full at several St, with the end of z'."""
    generator = np.random.default_rng(23)
    slow_times = np.linspace(0.0, ENDING_TIME, 1501)
    for near, index in product(NEAR, range(grid.of(24, 6))):
        start = saddle_start(generator, near)
        averaged = averaged_run(
            Scene(ELLIPSOID, 1.0, start, ENDING_TIME), slow_times, solver=FAST
        ).slow
        expected = _arrival(slow_times, averaged)
        for stokes in ENDING_STOKES[:: grid.of(1, 2)]:
            for phase, own in enumerate((start, same_slow_start(start, generator))):
                run = full_run(
                    Scene(ELLIPSOID, stokes, own, stokes * ENDING_TIME), stokes * slow_times
                )
                case = {
                    "near": near,
                    "start": index,
                    "stokes": stokes,
                    "phase": phase,
                    "averaged": expected,
                }
                up = float(run.observables.rotation[-1, 2, 2] > 0)
                yield "", {**case, "full": _arrival(slow_times, run.slow), "up": up}


def _arrival(slow_times: np.ndarray, slow: np.ndarray, near: float = ARRIVED) -> float:
    """Slow time from which on L and E stay close to the node; the end if they do not."""
    away = np.flatnonzero(distance_from_node(ELLIPSOID, slow) > near)
    return float(slow_times[min(int(away[-1]) + 1, len(slow_times) - 1)]) if len(away) else 0.0


def late(table: Table) -> dict[float, Estimate]:
    """Share of arrivals that are late or early, by St."""
    return {
        n: share(np.abs(own.full - own.averaged) > 0.2 * own.averaged)
        for n, own in groups(table, "stokes")
    }


BASIN_STOKES, BASIN_TIME = 1e3, 0.6
NEAR_NODE = 0.02


def compute_basins(grid: Grid) -> Computed:
    """Transient times of the averaged equations from |L| = I_max/2; ends of z' over starts at one St."""
    slow_times = graded(2.0, 1201)
    size, side = grid.of(41, 9), grid.of(64, 10)
    for cosine, height in product(
        np.linspace(-0.999, 0.999, size).tolist(), np.linspace(0.002, 0.998, size).tolist()
    ):
        sine = sqrt((1 - cosine**2) / 2)
        slow = (0.5 * sine, 0.5 * sine, 0.5 * cosine, energy_at(ELLIPSOID, 0.5, height))
        arrival = _arrival(
            slow_times, slow_run(ELLIPSOID, slow, slow_times, solver=FAST).slow, NEAR_NODE
        )
        yield "transients", {"cosine": cosine, "share": height, "t2": arrival}
    times, steps = np.array([0.0, BASIN_STOKES * BASIN_TIME]), np.arange(side) + 0.5
    for theta, psi in product((steps * pi / side).tolist(), (steps * 2 * pi / side - pi).tolist()):
        start = EulerStart((theta, PAPER_START.angles[1], psi), PAPER_START.rates)
        run = full_run(Scene(ELLIPSOID, BASIN_STOKES, start, times[-1]), times, 1e-9)
        yield "ends", {"theta": theta, "psi": psi, "z": run.observables.rotation[-1, 2, 2]}


def map_of(table: Table, names: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Coordinates of a table's rows, the second running fastest, and its values, shape (first, second)."""
    first, second, values = (table[name] for name in names.split())
    return np.unique(first), np.unique(second), values.reshape(len(np.unique(first)), -1)
