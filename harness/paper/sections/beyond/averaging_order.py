"""Beyond the paper: the order in 1/St of averaging's error, with and without a crossing of L² = 2EI₂."""

from math import sqrt

import numpy as np
from matplotlib.figure import Figure

from polhode.harness.common.fits import mean_interval, power_law
from polhode.harness.common.text import in_two_digits
from polhode.harness.paper.drawing import CYCLE, draw_groups, draw_law, label, logarithmic, panels
from polhode.harness.paper.item import Data, Grid, Item, Number, Table, Verdict, Word
from polhode.harness.paper.runs import averaged_run, full_run
from polhode.harness.paper.tables import columns, groups
from polhode.models.free_top.torque_free import TorqueFree
from polhode.models.scene import BodyStart, Scene
from polhode.models.scenes import PAPER_ELLIPSOID
from polhode.models.shape import Ellipsoid

ELLIPSOID = Ellipsoid(PAPER_ELLIPSOID)
SIDES = ("short", "long")
ORDER_TIME = 0.1
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


def same_slow_start(start: BodyStart, generator: np.random.Generator) -> BodyStart:
    """Another start with the same L and E: the free top at a random time."""
    top = TorqueFree(ELLIPSOID.inertia, start.quaternion, start.angular_velocity)
    quaternion, omega = top.at([generator.uniform(50.0, 500.0)])
    return BodyStart(tuple(quaternion[0].tolist()), tuple(omega[0].tolist()))


def compute_order(grid: Grid) -> Data:
    """Largest slow error of the averaged form, root mean square over fast phases, by start, side and St."""
    generator = np.random.default_rng(11)
    slow_times = np.linspace(0.0, ORDER_TIME, 3001)
    numbers = np.geomspace(1e4, grid.of(3e6, 3e5), grid.of(6, 4)).tolist()
    rows = []
    for side, name in enumerate(SIDES):
        for index in range(grid.of(8, 3)):
            start = random_start(generator, name)
            averaged = averaged_run(Scene(ELLIPSOID, 1.0, start, ORDER_TIME), slow_times).slow
            if side and not _crosses(averaged):
                raise RuntimeError(f"start {index} does not cross L² = 2EI₂ by t₂ = {ORDER_TIME:g}")
            starts = [same_slow_start(start, generator) for _ in range(grid.of(3, 2))]
            for stokes in numbers:
                scenes = [Scene(ELLIPSOID, stokes, own, stokes * ORDER_TIME) for own in starts]
                errors = [np.max(np.abs(full_run(scene, stokes * slow_times).slow - averaged)) for scene in scenes]
                rows.append((side, index, stokes, sqrt(np.mean(np.square(errors)))))
    return {"": columns("side start stokes error", rows)}


def _crosses(slow: np.ndarray) -> bool:
    """Whether a run that starts with L² < 2EI₂ ends with L² > 2EI₂."""
    middle = sorted(ELLIPSOID.inertia)[1] / max(ELLIPSOID.inertia)
    return bool(np.sum(slow[-1, :3] ** 2) > 2 * slow[-1, 3] * middle)


def figure_order(data: Data) -> Figure:
    """Errors against St, without and with a crossing."""
    figure, axes = panels(1, 2, 3.8, 3.1, sharey=True)
    for own, (side, part) in zip(axes, groups(data[""], "side"), strict=True):
        line = {"marker": "o", "markersize": 2.5, "linewidth": 0.8}
        draw_groups(own, part, "start", "stokes error", colors=CYCLE * 2, **line)
        fit = float(np.mean(_start_exponents(part)))
        stokes = np.unique(part["stokes"])
        middle = np.array([np.exp(np.log(part["error"][part["stokes"] == number]).mean()) for number in stokes])
        for slope, line, text in (
            (-1, ":", "slope -1"),
            (-0.5, "-.", "slope -1/2"),
            (fit, "--", f"mean fit, {fit:.2f}"),
        ):
            draw_law(own, stokes, 2 * middle[-1], slope, line, label=text)
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


def verdict_order(data: Data) -> Verdict:
    """Exponents without and with a crossing, over the range of St and at its end."""
    local = {side: _local_exponents(part) for side, part in groups(data[""], "side")}
    last, low, high = local[1.0][-1].tolist()
    alone, crossing = (_start_exponents(part) for _, part in groups(data[""], "side"))
    (free, *free_range), (crossed, *crossed_range) = mean_interval(alone), mean_interval(crossing)
    single, inverse = float(alone.max()), int(np.sum(np.abs(alone + 1) < 0.05))
    count = len(np.unique(data[""]["start"]))
    return Verdict(
        Word.MEASURED,
        f"From St = {in_two_digits(ASYMPTOTIC)} on the largest error falls like St^({free:.3f}) without and "
        f"St^({crossed:.3f}) with a crossing: υ = {1 + free:.3f} ({1 + free_range[0]:.3f} … {1 + free_range[1]:.3f}) "
        f"and {1 + crossed:.3f} ({1 + crossed_range[0]:.3f} … {1 + crossed_range[1]:.3f}) at 95 % over starts, in this "
        "range of St. With a crossing the exponent still changes: from neighbouring St it is "
        f"{', '.join(f'{value:.2f}' for value in local[1.0][:, 0])}, as for a/St + b/St^½, and at the end υ = "
        f"{1 + last:.3f} ({1 + low:.3f} … {1 + high:.3f}). Without a crossing {inverse} of {len(alone)} starts fall "
        f"like 1/St to 0.05 in the exponent, but others, which meet low resonances, do not (the slowest like "
        f"St^({single:.2f})).",
        f"Largest slow error of the averaged form up to t₂ = {ORDER_TIME:g}, root mean square over starts of the same "
        f"L and E; {count} random starts with |ω| = 0.8 on either side.",
        Number("exponent without a crossing", free, -1.1, -0.8, "", (free_range[0], free_range[1])),
        Number("exponent with a crossing", crossed, -1.1, -0.45, "", (crossed_range[0], crossed_range[1])),
        Number("exponent with a crossing between the two largest St", last, -1.1, -0.3, "", (low, high)),
        Number("slowest fall of a single start, without", single, high=-0.2),
        Number("υ = 1 + exponent, without", 1 + free),
        Number("υ = 1 + exponent, with", 1 + crossed),
    )


ORDER = Item(
    "averaging-order",
    "Order of averaging's error, with and without a crossing",
    "The paper expects an error of O(St^(-1+υ)), 0 < υ < 1, from resonances, and leaves υ open.",
    compute_order,
    figure_order,
    verdict_order,
)
