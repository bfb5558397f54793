"""Beyond the paper: the order in 1/St of averaging's error, with and without a crossing of L² = 2EI₂."""

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from polhode.harness.common.fits import mean_interval, power_law
from polhode.harness.paper.claims import Facts
from polhode.harness.paper.drawing import BLUE, SKY, VERMILLION, draw_broken, draw_law, label, logarithmic, panels
from polhode.harness.paper.item import Data, Grid, Parts, Table
from polhode.harness.paper.runs import averaged_run, full_run
from polhode.harness.paper.tables import columns, groups, root_mean_squares
from polhode.models.free_top.torque_free import TorqueFree
from polhode.models.scene import BodyStart, EulerStart, Scene
from polhode.models.scenes import PAPER_ELLIPSOID
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


def compute_order(grid: Grid) -> Data:
    """Largest slow error of the averaged form by side, start and St."""
    generator = np.random.default_rng(11)
    slow_times = np.linspace(0.0, ORDER_TIME, 3001)
    numbers = np.geomspace(1e4, grid.of(3e6, 3e5), grid.of(6, 4)).tolist()
    rows = []
    for side, (name, count) in enumerate(zip(SIDES, grid.of((16, 64), (4, 8)), strict=True)):
        for index in range(count):
            start = random_start(generator, name)
            averaged = averaged_run(Scene(ELLIPSOID, 1.0, start, ORDER_TIME), slow_times, solver=FAST).slow
            if side and not _crosses(averaged):
                raise RuntimeError(f"start {index} does not cross L² = 2EI₂ by t₂ = {ORDER_TIME:g}")
            for stokes in numbers:
                full = full_run(Scene(ELLIPSOID, stokes, start, stokes * ORDER_TIME), stokes * slow_times, solver=FAST)
                rows.append((side, index, stokes, np.max(np.abs(full.slow - averaged))))
    return {"": columns("side start stokes error", rows)}


def _crosses(slow: np.ndarray) -> bool:
    """Whether a run that starts with L² < 2EI₂ ends with L² > 2EI₂."""
    middle = sorted(ELLIPSOID.inertia)[1] / max(ELLIPSOID.inertia)
    return bool(np.sum(slow[-1, :3] ** 2) > 2 * slow[-1, 3] * middle)


def figure_order(data: Data) -> Figure:
    """Errors against St, without and with a crossing: every start thin, their root mean square thick."""
    figure, axes = panels(1, 2, 3.8, 3.1, sharey=True)
    for own, (side, part) in zip(axes, groups(data[""], "side"), strict=True):
        draw_broken(own, part, "stokes", "error", "start", color=SKY, linewidth=0.5, label="single starts")
        stokes, mean = root_mean_squares(part, "stokes", "error")
        own.plot(stokes, mean, "o-", color=BLUE, markersize=4, linewidth=2.0, label="root mean square")
        draw_law(own, stokes, mean[0] * (stokes[-1] / stokes[0]) ** -1, -1)
        bound = np.log(stokes) / np.sqrt(stokes)
        own.plot(stokes, bound * mean[-1] / bound[-1], "--", color=VERMILLION, label=r"$\mathrm{St}^{-1/2}\,\ln\,$St")
        title = ("no crossing of $L^2 = 2EI_2$", "crossing $L^2 = 2EI_2$")[int(side)]
        logarithmic(label(own, "Stokes number St", "largest slow error$/I_{max}$", title)).legend()
    return figure


def _start_exponents(part: Table) -> np.ndarray:
    """Exponents of all starts, from the asymptotic St on."""
    large = {name: column[part["stokes"] >= ASYMPTOTIC] for name, column in part.items()}
    return np.array([power_law(run["stokes"], run["error"])[0] for _, run in groups(large, "start")])


def _local_exponents(part: Table) -> np.ndarray:
    """Mean over starts of the exponents between neighbouring St, and its 95 % interval, shape (n - 1, 3)."""
    runs = (np.diff(np.log([run["stokes"], run["error"]])) for _, run in groups(part, "start"))
    return np.array([mean_interval(column) for column in np.transpose([errors / steps for steps, errors in runs])])


def facts_order(data: Data) -> Facts:
    """Exponents without and with a crossing, over the range of St and at its end."""
    facts: dict[str, Any] = {"asymptotic": ASYMPTOTIC, "time": ORDER_TIME}
    for name, (_, part) in zip(("free", "crossed"), groups(data[""], "side"), strict=True):
        exponents, local = _start_exponents(part), _local_exponents(part)
        mean, *interval = mean_interval(exponents)
        facts |= {name: mean, f"{name}_95": tuple(interval), f"local_{name}": local[:, 0]}
        facts |= {f"upsilon_{name}": 1 + mean, f"upsilon_{name}_95": tuple(1 + end for end in interval)}
        facts |= {
            f"starts_{name}": len(exponents),
            f"last_{name}": local[-1, 0],
            f"last_{name}_95": tuple(local[-1, 1:]),
        }
        if name == "free":
            facts |= {"single": exponents.max(), "inverse": int(np.sum(np.abs(exponents + 1) < 0.05))}
        else:
            stokes, error = root_mean_squares(part, "stokes", "error")
            over = error / (np.log(stokes) / np.sqrt(stokes))
            facts |= {"bounded": over[-1] / over[0], "first": stokes[0], "last": stokes[-1]}
    return facts


ORDER = Parts(compute_order, figure_order, facts_order)
