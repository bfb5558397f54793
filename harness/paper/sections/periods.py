"""Spheroids at finite St: the period of tumbling, the drift of spinning ones, and planar flows that stop them."""

from functools import partial
from itertools import product
from math import pi

import numpy as np
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicHermiteSpline

from polhode.harness.paper.item import Computed, Grid, Table
from polhode.harness.paper.runs import bisected, full_run, run_form, spheroid
from polhode.models.catalogue import form as find_form
from polhode.models.forms.spheroid_axis import field
from polhode.models.forms.tumbling import Tumbling
from polhode.models.rotation import quaternion_from_euler
from polhode.models.scene import BodyStart, Scene
from polhode.models.theory.fixed_points import eigenvalues
from polhode.models.theory.tumbling_period import tumbling_period, weak_inertia_period_change
from polhode.solvers.compile import exact_jacobian

KAPPAS = (2.0, 4.0, 8.0, 16.0)
# Aspect ratios and Stokes numbers, from Jeffery's limit to the fall of the period, of runs in time.
INTEGRATED = (
    (2.0, 0.1),
    (2.0, 1.0),
    (2.0, 10.0),
    (2.0, 100.0),
    (4.0, 1.0),
    (4.0, 100.0),
    (8.0, 200.0),
    (16.0, 1e3),
)
# A tumbler turns about an equatorial axis.
AXIS = 0


def _periods(stokes: np.ndarray) -> Computed:
    for kappa, number in product(KAPPAS, stokes.tolist()):
        period, jeffery = (tumbling_period(spheroid(kappa), own, AXIS) for own in (number, 0.0))
        change = period - jeffery
        yield (
            "",
            {
                "kappa": kappa,
                "stokes": number,
                "period": period,
                "jeffery": jeffery,
                "change": change,
            },
        )


def compute_change(grid: Grid) -> Computed:
    """Change of the period at small St, and the printed law."""
    for table, row in _periods(np.geomspace(1e-2, 1e4, grid.of(121, 25))):
        yield (
            table,
            {
                **row,
                "printed": weak_inertia_period_change(spheroid(row["kappa"]), row["stokes"], AXIS),
            },
        )


def validity(part: Table) -> float:
    """St at which the law is 10 % off."""
    error = np.abs(part.change / part.printed - 1)
    last = int(np.argmax(error > 0.1))
    return float(np.exp(np.interp(0.1, error[: last + 1], np.log(part.stokes[: last + 1]))))


def compute_period(grid: Grid) -> Computed:
    """Period at all St, and by integration in time at some."""
    yield from _periods(np.geomspace(1e-3, 1e6, grid.of(73, 19)))
    for kappa, number in grid.of(INTEGRATED, INTEGRATED[1:4:2]):
        period = _integrated_period(kappa, number)
        difference = period / tumbling_period(spheroid(kappa), number, AXIS) - 1
        yield (
            "integrated",
            {"kappa": kappa, "stokes": number, "period": period, "difference": difference},
        )


def _integrated_period(kappa: float, stokes: float) -> float:
    """Time of one turn by integration in time, after the transient."""
    ellipsoid = spheroid(kappa)
    settled = 40 * stokes / ellipsoid.damping[AXIS]
    scene = Scene(
        ellipsoid, stokes, BodyStart((0.5, 0.5, 0.5, 0.5), (0.0, -0.5, 0.0)), settled + 60 * kappa
    )
    times = np.concatenate([[0.0], np.arange(settled, scene.time, 0.01)])
    states = run_form(Tumbling(), scene, times, 1e-14).states
    angle, rate = np.unwrap(states[1:, 0]), states[1:, 1]
    goals = angle[0] - 2 * pi * np.arange(1, 1 + int((angle[0] - angle[-1]) / (2 * pi)))
    passed = [
        CubicHermiteSpline(times[1:], angle - goal, rate).roots(extrapolate=False)[0]
        for goal in goals
    ]
    return float(np.mean(np.diff(passed)))


DRIFTING = (0.3, 0.5, 2.0, 4.0)
# Components of L and of the axis across the vorticity in the state of `spheroid-axis`.
ACROSS = [0, 1, 3, 4]
# St and κ at which the growth is also taken from a run in time, and the tilt it starts with.
FOLLOWED, TILT = 0.02, 1e-3


def spinning(kappa: float, stokes: float, tilt: float, time: float) -> Scene:
    """A spheroid that spins about its axis along the vorticity, but for a tilt."""
    return Scene(
        spheroid(kappa),
        stokes,
        BodyStart(quaternion_from_euler((tilt, 0.0, 0.0)), (0.0, 0.0, -0.5)),
        time,
    )


def growth(kappa: float, stokes: float) -> float:
    """Rate at which the tilt of the axis grows, per inverse shear rate: the largest of the linearized equations'."""
    problem = find_form("spheroid-axis").problem(spinning(kappa, stokes, 0.0, 1.0))
    matrix = exact_jacobian(field, 6, 6)(np.array(problem.start), np.array(problem.parameters))
    return float(np.linalg.eigvals(matrix[np.ix_(ACROSS, ACROSS)]).real.max())


def followed(kappa: float, stokes: float) -> float:
    """The same from a run: the tilt half a Jeffery period after half a period, when the start is forgotten."""
    half = pi * (kappa + 1 / kappa)
    times = half * np.array([0.0, 2.0, 4.0])
    axis = full_run(spinning(kappa, stokes, TILT, times[-1]), times).observables.rotation[:, 2, :2]
    return float(np.log(np.linalg.norm(axis[2]) / np.linalg.norm(axis[1])) / (2 * half))


def compute_drift(grid: Grid) -> Computed:
    """Growth at all St; at one small St from a run too."""
    numbers = np.geomspace(1e-4, 1e6, grid.of(61, 21)).tolist()
    for kappa in DRIFTING:
        yield (
            "",
            {
                "kappa": kappa,
                "stokes": numbers,
                "growth": [growth(kappa, stokes) for stokes in numbers],
            },
        )
        yield (
            "runs",
            {
                "kappa": kappa,
                "growth": growth(kappa, FOLLOWED),
                "followed": followed(kappa, FOLLOWED),
            },
        )


def printed_growth(kappa: float) -> float:
    """Rate × St at large St by the printed eigenvalues: of L, or of the tilt, half the fourth."""
    rates = eigenvalues(spheroid(kappa), 2)
    return max(*rates[:2], rates[3] / 2)


PLANAR = (0.5, 2.0, 4.0)
PLANAR_STOKES = (0.0, 1.0, 10.0, 100.0)


def turns(kappa: float, stokes: float, alpha: float) -> bool:
    """Whether an axis in the plane of the flow u = y x̂ + αx ŷ goes on turning; with inertia it starts at full speed."""
    # Without inertia its rate is (α - 1)/2 + Λ(1 + α)/2 cos 2χ; with it, it relaxes to this rate.
    body = spheroid(kappa)
    slope = (kappa**2 - 1) / (kappa**2 + 1) * (1 + alpha) / 2

    def jeffery(angle: float) -> float:
        return (alpha - 1) / 2 + slope * np.cos(2 * angle)

    if stokes == 0:
        return abs(slope) < (1 - alpha) / 2
    damping = body.damping[0] / stokes

    def rates(_: float, state: np.ndarray) -> tuple[float, float]:
        return state[1], damping * (jeffery(state[0]) - state[1])

    def stops(_: float, state: np.ndarray) -> float:
        return state[1]

    stops.terminal = True  # pyright: ignore[reportFunctionMemberAccess]
    end, start = 60 / damping + 300, (0.0, (alpha - 1) / 2 - abs(slope))
    return solve_ivp(rates, (0.0, end), start, "DOP853", rtol=1e-8, events=stops).status == 0


def compute_planar(grid: Grid) -> Computed:
    """The α above which turning ends, by bisection."""
    for kappa, stokes in product(PLANAR, PLANAR_STOKES):
        halvings = 50 if stokes == 0 else grid.of(14, 9)
        threshold = bisected(partial(turns, kappa, stokes), 0.0, 1.0, halvings)
        yield (
            "",
            {
                "kappa": kappa,
                "stokes": stokes,
                "threshold": threshold,
                "printed": min(kappa, 1 / kappa) ** 2,
            },
        )
