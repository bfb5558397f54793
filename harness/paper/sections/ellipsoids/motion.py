"""Section "Triaxial ellipsoids" in time: slow variables of the paper's two starts, and the singular fixed point."""

import numpy as np

from polhode.harness.paper.item import Computed, Grid
from polhode.harness.paper.runs import full_run, slow_run, slow_scene, spheroid
from polhode.harness.paper.sections import slow_motion
from polhode.harness.paper.tables import columns, stacked
from polhode.models.forms.averaged import Averaged
from polhode.models.operations import FLOAT
from polhode.models.scene import Scene
from polhode.models.scenes import PAPER_ELLIPSOID, SPHEROID_START
from polhode.models.shape import Ellipsoid
from polhode.models.theory.separatrix import Separatrix, Side

ELLIPSOID = Ellipsoid(PAPER_ELLIPSOID)
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
    i1, i2, i3 = np.array(sorted(ELLIPSOID.inertia)) / max(ELLIPSOID.inertia)
    near, far = (i3, i1) if side == "short" else (i1, i3)
    momentum2, energy2 = np.sum(slow[:, :3] ** 2, axis=1), 2 * slow[:, 3]
    return (near - far) * (momentum2 - energy2 * i2) / ((near - i2) * (momentum2 - energy2 * far))


def _averaged_rates(local: Separatrix, complement: float, shift: float) -> tuple[float, float]:
    """Rates of y and L_z'/I_max by the averaged equations, at L_x = L_y = 0."""
    unit = max(ELLIPSOID.inertia)
    state = np.array(local.slow_state(complement, shift)) / unit
    problem = Averaged().problem(slow_scene(ELLIPSOID, state.tolist(), 1.0))
    rates = np.array(problem.field(FLOAT)(problem.start, problem.parameters))
    step = 1e-6 * complement / max(1e-30, float(np.max(np.abs(rates))))
    moved = [complement_of((state + sign * step * rates)[None], local.side)[0] for sign in (1, -1)]
    return float(moved[0] - moved[1]) / (2 * step), float(rates[2])


def critical_before(complement: float, points: int) -> tuple[np.ndarray, np.ndarray]:
    """The averaged trajectory that meets the singular point, from a value of y on the long side.

    Found by bisection of L_z' at the start: those that start with more pass the point with more. Returns slow times up
    to the point and slow variables over I_max, shape (n, 4).
    """
    local, unit = Separatrix(ELLIPSOID, "long"), max(ELLIPSOID.inertia)
    times = np.linspace(0.0, 0.3 if complement > 0.3 else -1.2 * local.time(complement), points)
    low, high = -1.5 * unit, 0.3 * unit
    for _ in range(45):
        middle = (low + high) / 2
        _, passed = _long_side(local.slow_state(complement, middle), times)
        low, high = (low, middle) if passed > 0 else (middle, high)
    found, _ = _long_side(local.slow_state(complement, (low + high) / 2), times)
    return times[: len(found)], found


def _long_side(state: tuple[float, ...], times: np.ndarray) -> tuple[np.ndarray, float]:
    """Averaged trajectory as far as it stays on the long side, and L_z'/I_max where it leaves it."""
    unit = max(ELLIPSOID.inertia)
    slow = slow_run(ELLIPSOID, (np.array(state) / unit).tolist(), times).slow
    complement = complement_of(slow, "long")
    last = int(np.argmax(complement <= 0)) if np.any(complement <= 0) else len(slow)
    middle = sorted(ELLIPSOID.inertia)[1] / (2 * unit)
    return slow[:last], float(slow[min(last, len(slow) - 1), 2] + middle)


def critical_after(slow_times: np.ndarray) -> np.ndarray:
    """The averaged trajectory that leaves the singular point, shape (n, 4), at times after it; the first is 0."""
    local, beside = Separatrix(ELLIPSOID, "short"), 1e-9
    state = np.array(local.slow_state(beside, local.critical(beside))) / max(ELLIPSOID.inertia)
    return slow_run(ELLIPSOID, state.tolist(), slow_times).slow


def compute_singular(grid: Grid) -> Computed:
    """Rates near the singular point, local and averaged; the critical trajectory on either side."""
    unit = max(ELLIPSOID.inertia)
    rows, parts = [], []
    for number, side in enumerate(SIDES):
        local = Separatrix(ELLIPSOID, side)
        for complement in np.geomspace(1e-8, 0.3, grid.of(40, 14)).tolist():
            shift = local.critical(complement)
            growth, push = local.rates(complement, shift)
            exact = _averaged_rates(local, complement, shift)
            rows.append((number, complement, shift / unit, growth, exact[0], push / unit, exact[1]))
        parts.append(_passage(local, number, grid.of(401, 101)))
    names = "side y shift local_y averaged_y local_shift averaged_shift"
    return {"rates": columns(names, rows), "trajectory": stacked(parts)}


def _passage(local: Separatrix, number: int, points: int) -> tuple[dict, dict]:
    """y and L_z' against time to or from the singular point: critical trajectories, local and averaged."""
    unit = max(ELLIPSOID.inertia)
    if local.side == "long":
        times, slow = critical_before(FAR, points)
        times = times - times[-1]
    else:
        times = np.linspace(0.0, local.time(FAR), points)
        slow = critical_after(times)
    inside = np.abs(times) <= abs(local.time(FAR))
    times, slow = times[inside], slow[inside]
    complement = np.array([local.complement(float(time)) for time in times])
    found = {
        "t2": times,
        "local_y": complement,
        "averaged_y": complement_of(slow, local.side),
        "local_shift": np.array([local.critical(value) for value in complement.tolist()]) / unit,
        "averaged_shift": slow[:, 2] + sorted(ELLIPSOID.inertia)[1] / (2 * unit),
    }
    return {"side": number}, found


class FirstStart(slow_motion.SlowMotion):
    """The paper's first start, with what it says of the oscillation and of passing L² = 2EI₂."""

    def compute(self, grid: Grid) -> Computed:
        """Also how irregularly L_z swings, beside the paper's first spheroid, at one St."""
        rows = []
        for body, start, slow_time in ((self.ellipsoid, self.start, 0.1), (spheroid(2.0), SPHEROID_START, 0.1)):
            times = np.linspace(0.0, IRREGULAR * slow_time, 20001)
            momentum = full_run(Scene(body, IRREGULAR, start, times[-1]), times).slow[:, 2]
            rows.append((_scatter(momentum),))
        return {**super().compute(grid), "scatter": columns("swings", rows)}


def _scatter(values: np.ndarray) -> float:
    """Median of the logarithm, up to its sign, of the ratio of a swing to the next in the same direction."""
    turning = np.flatnonzero(np.diff(np.sign(np.diff(values)))) + 1
    swings = np.abs(np.diff(values[turning]))
    return float(np.median(np.abs(np.log(swings[2:] / swings[:-2]))))
