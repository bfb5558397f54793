"""Section "Triaxial ellipsoids": the singular fixed point, slow variables in time, the L_z–E plane, projections."""

from math import sqrt

import numpy as np

from polhode.harness.paper import planes
from polhode.harness.paper.item import Computed, Grid, Table
from polhode.harness.paper.runs import bisected, full_run, graded, slow_run, slow_scene, spheroid
from polhode.harness.paper.sections import slow_motion
from polhode.harness.paper.sections.planes import plane_tables
from polhode.harness.paper.tables import by, path
from polhode.models.forms.averaged import Averaged
from polhode.models.operations import FLOAT
from polhode.models.scene import Scene
from polhode.models.scenes import PAPER_ELLIPSOID, SPHEROID_START
from polhode.models.shape import Ellipsoid
from polhode.models.theory.separatrix import Separatrix, Side

ELLIPSOID = Ellipsoid(PAPER_ELLIPSOID)
# The largest moment of inertia, and the middle one over it.
UNIT = max(ELLIPSOID.inertia)
MIDDLE = sorted(ELLIPSOID.inertia)[1] / UNIT
SIDES: tuple[Side, Side] = ("long", "short")
# Complementary parameter y = μ'δ where local and averaged solution are compared.
NEAR = 1e-3
# Largest y of the passage.
FAR = 0.1
# St at which the irregularity of the oscillation is measured.
IRREGULAR = 500.0
# Errors after L² = 2EI₂ over those before, up to which passing it has little effect.
LITTLE = 2.0


def complement_of(slow: np.ndarray, side: Side) -> np.ndarray:
    """y = 1 - m of slow variables over I_max, shape (n, 4)."""
    i1, i2, i3 = np.array(sorted(ELLIPSOID.inertia)) / UNIT
    near, far = (i3, i1) if side == "short" else (i1, i3)
    momentum2, energy2 = np.sum(slow[:, :3] ** 2, axis=1), 2 * slow[:, 3]
    return (near - far) * (momentum2 - energy2 * i2) / ((near - i2) * (momentum2 - energy2 * far))


def state_of(local: Separatrix, complement: float, shift: float) -> list[float]:
    """Slow variables over I_max at y and L_z'."""
    return (np.array(local.slow_state(complement, shift)) / UNIT).tolist()


def _averaged_rates(local: Separatrix, complement: float, shift: float) -> tuple[float, float]:
    """Rates of y and L_z'/I_max by the averaged equations, at L_x = L_y = 0."""
    state = state_of(local, complement, shift)
    problem = Averaged().problem(slow_scene(ELLIPSOID, state, 1.0))
    rates = np.array(problem.field(FLOAT)(problem.start, problem.parameters))
    step = 1e-6 * complement / max(1e-30, float(np.max(np.abs(rates))))
    moved = [complement_of((state + sign * step * rates)[None], local.side)[0] for sign in (1, -1)]
    return float(moved[0] - moved[1]) / (2 * step), float(rates[2])


def critical_before(complement: float, points: int) -> tuple[np.ndarray, np.ndarray]:
    """The averaged trajectory that meets the singular point, from a value of y on the long side.

    Found by bisection of L_z' at the start: those that start with more pass the point with more.
    Returns slow times up to the point and slow variables over I_max, shape (n, 4).
    """
    local = Separatrix(ELLIPSOID, "long")
    times = np.linspace(0.0, 0.3 if complement > 0.3 else -1.2 * local.time(complement), points)

    def from_start(shift: float) -> tuple[np.ndarray, float]:
        """As far as it stays on the long side, and L_z'/I_max where it leaves it."""
        slow = slow_run(ELLIPSOID, state_of(local, complement, shift), times).slow
        beyond = complement_of(slow, "long") <= 0
        last = int(np.argmax(beyond)) if beyond.any() else len(slow)
        return slow[:last], float(slow[min(last, len(slow) - 1), 2] + MIDDLE / 2)

    met = bisected(lambda shift: from_start(shift)[1] <= 0, -1.5 * UNIT, 0.3 * UNIT, 45)
    found, _ = from_start(met)
    return times[: len(found)], found


def critical_after(slow_times: np.ndarray) -> np.ndarray:
    """The averaged trajectory that leaves the singular point, shape (n, 4), at times after it; the first is 0."""
    local, beside = Separatrix(ELLIPSOID, "short"), 1e-9
    return slow_run(ELLIPSOID, state_of(local, beside, local.critical(beside)), slow_times).slow


def compute_singular(grid: Grid) -> Computed:
    """Rates near the singular point, local and averaged; the critical trajectory on either side."""
    for number, side in enumerate(SIDES):
        local = Separatrix(ELLIPSOID, side)
        for complement in np.geomspace(1e-8, 0.3, grid.of(40, 14)).tolist():
            shift = local.critical(complement)
            growth, push = local.rates(complement, shift)
            exact = _averaged_rates(local, complement, shift)
            rates = {
                "local_y": growth,
                "averaged_y": exact[0],
                "local_shift": push / UNIT,
                "averaged_shift": exact[1],
            }
            yield "rates", {"side": number, "y": complement, "shift": shift / UNIT, **rates}
        yield "trajectory", {"side": number, **_passage(local, grid.of(401, 101))}


def _passage(local: Separatrix, points: int) -> dict[str, np.ndarray]:
    """y and L_z' against time to or from the singular point: critical trajectories, local and averaged."""
    if local.side == "long":
        times, slow = critical_before(FAR, points)
        times = times - times[-1]
    else:
        times = np.linspace(0.0, local.time(FAR), points)
        slow = critical_after(times)
    inside = np.abs(times) <= abs(local.time(FAR))
    times, slow = times[inside], slow[inside]
    complement = np.array([local.complement(float(time)) for time in times])
    return {
        "t2": times,
        "local_y": complement,
        "averaged_y": complement_of(slow, local.side),
        "local_shift": np.array([local.critical(value) for value in complement.tolist()]) / UNIT,
        "averaged_shift": slow[:, 2] + MIDDLE / 2,
    }


class FirstStart(slow_motion.SlowMotion):
    """The paper's first start, with what it says of the oscillation and of passing L² = 2EI₂."""

    def compute(self, grid: Grid) -> Computed:
        """Also how irregularly L_z swings, beside the paper's first spheroid, at one St."""
        yield from super().compute(grid)
        times = np.linspace(0.0, IRREGULAR * 0.1, 20001)
        for body, start in ((self.ellipsoid, self.start), (spheroid(2.0), SPHEROID_START)):
            momentum = full_run(Scene(body, IRREGULAR, start, times[-1]), times).slow[:, 2]
            yield "scatter", {"swings": _scatter(momentum)}


def _scatter(values: np.ndarray) -> float:
    """Median of the logarithm, up to its sign, of the ratio of a swing to the next in the same direction."""
    turning = np.flatnonzero(np.diff(np.sign(np.diff(values)))) + 1
    swings = np.abs(np.diff(values[turning]))
    return float(np.median(np.abs(np.log(swings[2:] / swings[:-2]))))


# Where local and averaged critical trajectory are compared: L_z over I_max around the singular
# point.
CLOSE = 2e-3
ON_EDGE = 0.25
# Half sizes of the magnified view of the singular point, over I_max.
WINDOW = 0.004, 0.0016


def compute_plane(grid: Grid) -> Computed:
    """Slow trajectories, and the critical one: local and averaged, before and after the singular point."""
    shares = (0.001, 0.1, 0.2, 0.35, 0.5, 0.65, 0.8, 0.95, 0.999)
    starts = [
        (momentum, share) for momentum in (-1.1, -0.08, 1.1) for share in shares[:: grid.of(1, 4)]
    ]
    yield from plane_tables(ELLIPSOID, [*starts, (-1.1, 1.0)], grid.of(2001, 601), ON_EDGE, _kept)
    for number, side in enumerate(SIDES):
        local = Separatrix(ELLIPSOID, side)
        states = np.array(
            [state_of(local, y, local.critical(y)) for y in np.geomspace(1e-6, 0.5, 41).tolist()]
        )
        yield "critical", {"kind": 0, "side": number, "Lz": states[:, 2], "E": states[:, 3]}
    _, before = critical_before(0.8, 2001)
    for number, slow in enumerate((before[::2], critical_after(graded(0.5, 401)))):
        yield "critical", {"kind": 1, "side": number, "Lz": slow[:, 2], "E": slow[:, 3]}


def _kept(slow: np.ndarray) -> np.ndarray:
    """Indices of points at even steps, and of all in the magnified view of the singular point, or next to it."""
    inside = np.abs(slow[:, 2:] - planes.fixed_point(ELLIPSOID, "singular")) < 1.2 * np.array(
        WINDOW
    )
    return np.union1d(planes.plane_steps(slow, 250), np.flatnonzero(np.all(inside, axis=1)))


def misfits(critical: Table, side: float) -> tuple[float, float]:
    """How far the local critical trajectory is off the averaged one near the singular point, and at its end."""
    kinds = by(by(critical, "side")[side], "kind")
    local, averaged = kinds[0.0], kinds[1.0]
    gaps = np.min(np.hypot(local.Lz[:, None] - averaged.Lz, local.E[:, None] - averaged.E), axis=1)
    return np.max(gaps[np.abs(local.Lz + MIDDLE / 2) < CLOSE]), gaps[-1]


def compute_space(grid: Grid) -> Computed:
    """One slow trajectory with L_x = 0 throughout and one with L_y = 0."""
    slow_times = graded(1.0, grid.of(401, 101))
    for zero in (1, 0):
        slow = np.array([0.0, 0.0, -0.2, planes.energy_at(ELLIPSOID, 1.0, 0.7)])
        slow[1 - zero] = sqrt(1 - 0.2**2)
        yield "", path(zero, slow_times, slow_run(ELLIPSOID, slow.tolist(), slow_times).slow)
