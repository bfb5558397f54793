"""Numbers of items of the paper's reproduction, drawn by lot, from the vector equation.

The lot: ``random.Random(20261126).sample(names, 20)`` of the 42 items that the report had on that day. Nineteen of the
twenty are computed here; `tests/models/misprints/test_averages.py` has the other one, `averages-ellipsoid`.

Nothing of the project is imported. Settings of the items (bodies, starts, St, durations, fits) are typed here again;
their reasons stand beside them in `harness/paper/sections`. The method's own numbers (tolerances, steps, samples,
brackets of roots) are estimates: `tests/harness/paper/test_recomputed.py` requires the digits that the pages write.

    python tests/oracle/paper_items/recompute.py [ITEM…]

writes `numbers.json` beside this file, by item and by what the report calls the number. Without a name all items run.
"""

import csv
import json
import sys
import time
from pathlib import Path

import numba
import numpy as np
from scipy.integrate import cumulative_trapezoid, quad, solve_ivp
from scipy.integrate._ivp import dop853_coefficients as dop
from scipy.optimize import brentq, minimize_scalar
from vector_equation import (
    Body,
    Run,
    aligned,
    averaged,
    averaged_rates,
    free_rates,
    rows,
    rows_of,
    spin_of,
    turn,
)

HERE = Path(__file__).parent
REPORT = HERE.parents[2] / "reports" / "paper"
# Semi-axes of the paper's ellipsoid.
PAPER = (1.0, 0.8, 0.5)


def spheroid(kappa):
    """The body whose symmetry axis z' is κ times as long as the others."""
    return Body((1.0, 1.0, kappa))


def graded(end, points):
    """Times from 0 to the end, dense at first; the power is the report's."""
    return end * np.linspace(0, 1, points) ** 2.5


def slope(x, y):
    """Exponent of the power law through the points, by least squares."""
    return float(np.polyfit(np.log(x), np.log(y), 1)[0])


# --- a spinning spheroid ---------------------------------------------------------------------------------------------


def spin_drift():
    """Growth of a tilt of spheroids that spin about the vorticity, by St."""
    kappas = (0.3, 0.5, 2.0, 4.0)
    bodies = {kappa: spheroid(kappa) for kappa in kappas}

    def growth(kappa, stokes):
        """Largest real part of the equations linearized about spinning at -1/2, in (p_x, p_y, L_x, L_y)."""
        body = bodies[kappa]
        equatorial, axial = body.inertia[0], body.inertia[2]
        damping = 8 * np.pi * body.resistance[0] / stokes
        anisotropy = (kappa**2 - 1) / (kappa**2 + 1)
        spin = -axial / 2
        matrix = np.zeros((4, 4))
        # ṗ = L × p / I_e; L̇ = -(8πY/St) (ω - Ω_J) across the axis, to first order in p and L.
        matrix[0, 3], matrix[0, 1] = 1 / equatorial, -spin / equatorial
        matrix[1, 2], matrix[1, 0] = -1 / equatorial, spin / equatorial
        for row, column, flow in ((2, 0, anisotropy / 2 - 0.5), (3, 1, -anisotropy / 2 - 0.5)):
            matrix[row, row] = -damping / equatorial
            matrix[row, column] = damping * (spin / equatorial - flow)
        return float(np.linalg.eigvals(matrix).real.max())

    grid = np.geomspace(1e-4, 1e6, 61)
    curves = {kappa: np.array([growth(kappa, s) for s in grid]) for kappa in kappas}
    small, large = grid < 1e-2, grid > 1e5
    peaks = []
    for kappa in kappas:
        best = minimize_scalar(
            lambda x, kappa=kappa: -abs(growth(kappa, np.exp(x))),
            bounds=np.log([5, 3000]),
            method="bounded",
            options={"xatol": 1e-8},
        )
        peaks.append((float(np.exp(best.x)), -best.fun))
    followed = []
    for kappa, body in bodies.items():
        half = np.pi * (kappa + 1 / kappa)
        times = half * np.array([0.0, 2.0, 4.0])
        run = Run(body, 0.02, rows(1e-3, 0, 0), np.array([0, 0, -0.5]), times, 1e-10, "LSODA")
        tilt = np.linalg.norm(run.rotation[:, 2, :2], axis=1)
        followed.append(np.log(tilt[2] / tilt[1]) / (2 * half) / growth(kappa, 0.02) - 1)
    return {
        "exponent in St below St = 0.01, off 1, worst κ": max(
            abs(slope(grid[small], abs(c[small])) - 1) for c in curves.values()
        ),
        "share of κ with the sign of the claim at small St": float(
            np.mean([np.sign(c[0]) == np.sign(k - 1) for k, c in curves.items()])
        ),
        "the rate against a run in time, St = 0.02, relative, worst κ": float(
            np.max(np.abs(followed))
        ),
        "largest rate over the largest at the grid's points, least of all κ": min(
            peak[1] / max(abs(c)) for peak, c in zip(peaks, curves.values(), strict=True)
        ),
        "exponent above St = 1e5, off -1, worst κ": max(
            abs(slope(grid[large], abs(c[large])) + 1) for c in curves.values()
        ),
        "rate × St at St = 1e6 over the printed eigenvalues', less one, worst κ": max(
            abs(growth(k, 1e6) / (1e4 * growth(k, 1e10)) - 1) for k in kappas
        ),
        "largest size at St": [peak[0] for peak in peaks],
    }


# --- the Jeffery top -------------------------------------------------------------------------------------------------

# DOP853 of fixed step; C would be needed for rates that depend on time.
STAGES = dop.N_STAGES
A, B, C = dop.A[:STAGES, :STAGES], dop.B, dop.C[:STAGES]


@numba.njit
def jeffery_rates(axes, t, out):
    """Rates of the nine entries of a rotation matrix, row by row, of a body without inertia."""
    w = np.empty(3)
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        a, b = axes[j] ** 2, axes[k] ** 2
        w[i] = (a * t[3 * k] * t[3 * j + 1] - b * t[3 * j] * t[3 * k + 1]) / (a + b)
    x = w[0] * t[0] + w[1] * t[3] + w[2] * t[6]
    y = w[0] * t[1] + w[1] * t[4] + w[2] * t[7]
    z = w[0] * t[2] + w[1] * t[5] + w[2] * t[8]
    for i in range(3):
        a, b, c = t[3 * i], t[3 * i + 1], t[3 * i + 2]
        out[3 * i], out[3 * i + 1], out[3 * i + 2] = y * c - z * b, z * a - x * c, x * b - y * a


@numba.njit
def step(axes, t, h, stages, a, b):
    """A step of length h of the explicit Runge-Kutta method (a, b), in place; `stages` is room for its rates."""
    trial = np.empty(9)
    for s in range(len(b)):
        for n in range(9):
            total = 0.0
            for r in range(s):
                if a[s, r] != 0.0:
                    total += a[s, r] * stages[r, n]
            trial[n] = t[n] + h * total
        jeffery_rates(axes, trial, stages[s])
    for n in range(9):
        total = 0.0
        for s in range(len(b)):
            total += b[s] * stages[s, n]
        t[n] += h * total


@numba.njit
def parting(axes, start, beside, turns, half_turn, steps, size, a, b):
    """Logarithm of the factor by which two neighbours part over so many half turns.

    After each of them, of so many steps, they are brought back to the distance `size`.
    """
    stages = np.zeros((len(b), 9))
    first, second = start.copy(), beside.copy()
    h = half_turn / steps
    total = 0.0
    for _ in range(turns):
        for _ in range(steps):
            step(axes, first, h, stages, a, b)
            step(axes, second, h, stages, a, b)
        apart = np.sqrt(np.sum((second - first) ** 2))
        total += np.log(apart / size)
        second = first + (second - first) * (size / apart)
    return total


def chaos(axes, turns, name):
    """Share of chaotic orbits of the item's own starts, and the median exponents, after some half turns.

    The table of the item's orbits has their starts, and their kind: 0 for orientations uniform on SO(3), 1 for
    starts on the section, 2 for starts next to the saddle.
    """
    axes = np.array(axes) / max(axes)
    kappa = max(axes) / min(axes)
    # Half a turn of a spheroid of that ratio in a Jeffery orbit.
    half_turn = np.pi * (kappa + 1 / kappa)
    with open(REPORT / "limits" / f"{name}-orbits.csv", encoding="utf-8") as file:
        table = list(csv.DictReader(file))
    # Distance of the neighbours, far above rounding and small for rates that are linear: an estimate.
    size = 1e-7
    parted, kinds = [], []
    for row in table:
        angles = [float(row[key]) for key in ("theta", "phi", "psi")]
        start = rows(*angles).ravel()
        # The neighbour is turned a little about the body's axis (1, 1, 1).
        aside = np.empty(9)
        turn(start, np.ones(3), aside)
        beside = start + aside * (size / np.linalg.norm(aside))
        steps = int(np.ceil(half_turn / 0.4))
        parted.append(parting(axes, start, beside, turns, half_turn, steps, size, A, B))
        kinds.append(float(row["kind"]))
    parted, kinds = np.array(parted), np.array(kinds)
    # Chaotic, as the report has it (`chaos_border` in harness/paper/jeffery_top.py): neighbours of a
    # regular orbit part about linearly, by log(turns).
    wild = parted > 3 * np.log(turns)
    theirs = np.array([float(row["chaotic"]) for row in table]) > 0
    found = {
        "share of chaotic orbits, starts uniform on SO(3)": float(wild[kinds == 0].mean()),
        "the same of starts on the section: φ = 0, cos θ and ψ uniform": float(
            wild[kinds == 1].mean()
        ),
        "chaotic share of starts next to the saddle": float(wild[kinds == 2].mean()),
        "median exponent of the regular orbits, per half turn": float(
            np.median(parted[~wild]) / turns
        ),
        "orbits that are judged otherwise": int(np.sum(wild != theirs)),
        "orbits": len(table),
    }
    # The report gives this median from as many orbits on.
    if np.sum(wild) >= 30:
        found["median exponent of the chaotic orbits, per half turn"] = float(
            np.median(parted[wild]) / turns
        )
    return found


WIDTH = "width of the layer at ψ = 0 over 800 half turns"


def saddle_exponent(axes):
    """Exponent of the map over half a turn at the saddle: z' in the plane of the flow, x' along the vorticity."""
    body = Body(axes)

    def advanced(tilt):
        start = rows(np.pi / 2, 0.0, np.pi / 2 - tilt).ravel()

        def section(_, y, axes):
            return y[6]

        run = solve_ivp(
            free_rates,
            (0, 30),
            start,
            "DOP853",
            args=(body.axes,),
            rtol=1e-12,
            atol=1e-13,
            events=section,
        )
        after = run.t_events[0] > 0.5
        t = run.y_events[0][after][0].reshape(3, 3)
        return abs(np.arctan2(abs(t[0, 2]), abs(t[1, 2])) - np.pi / 2)

    return float(np.arccosh(advanced(1e-4) / 1e-4))


@numba.njit
def both_ways(axes, start, turns, half_turn, steps, a, b):
    """Whether an orbit librates and circulates, at some time, from its section points z'·x = 0.

    It librates if θ - π/2 changes its sign from one point to the next, and circulates if ψ, modulo π, jumps.
    """
    stages = np.zeros((len(b), 9))
    here, old, trial, later = start.copy(), start.copy(), start.copy(), start.copy()
    h = half_turn / steps
    librates, circulates = False, False
    theta_before, psi_before, count = 0.0, 0.0, 0
    for n in range(turns * steps):
        old[:] = here
        step(axes, here, h, stages, a, b)
        # The start is on the section itself.
        if n == 0 or old[6] * here[6] > 0:
            continue
        share = old[6] / (old[6] - here[6])
        for _ in range(4):
            trial[:] = old
            step(axes, trial, h * share, stages, a, b)
            later[:] = trial
            step(axes, later, 1e-6, stages, a, b)
            share -= trial[6] / ((later[6] - trial[6]) / 1e-6) / h
            share = min(max(share, 0.0), 1.0)
        theta = np.arccos(min(1.0, max(-1.0, trial[8]))) - np.pi / 2
        psi = (np.arctan2(trial[2], trial[5]) + np.pi / 2) % np.pi - np.pi / 2
        if count > 0:
            librates = librates or theta * theta_before < 0
            circulates = circulates or abs(psi - psi_before) > 2.0
        theta_before, psi_before, count = theta, psi, count + 1
    return librates, circulates


def ways_of(axes, offset):
    """Whether the orbit from ψ = 0 and this θ - π/2, in rad, librates and circulates within 800 half turns."""
    axes = np.array(axes) / max(axes)
    kappa = max(axes) / min(axes)
    half_turn = np.pi * (kappa + 1 / kappa)
    steps = int(np.ceil(half_turn / 0.1))
    start = rows(np.pi / 2 + offset, 0.0, 1e-9).ravel()
    return both_ways(axes, start, 800, half_turn, steps, A, B)


def layer_width(axes, low, high, count):
    """Length, in rad, of the starts between two θ - π/2 whose orbits do both, by `count` equispaced starts."""
    offsets = low + (high - low) * (np.arange(count) + 0.5) / count
    found = [all(ways_of(axes, offset)) for offset in offsets]
    return float(np.mean(found) * (high - low))


def sharp_width(axes, low, high):
    """Where libration becomes circulation, halved until an orbit does both: the width that is left, in rad.

    The search ends below 1e-14, some 50 roundings of θ.
    """
    while high - low > 1e-14:
        middle = (low + high) / 2
        librates, circulates = ways_of(axes, middle)
        if librates and circulates:
            return high - low
        low, high = (low, middle) if circulates else (middle, high)
    return high - low


def flat():
    return chaos((1.0, 0.5, 0.05), 120, "poincare-flat")


def slender():
    return chaos((0.05, 0.1, 1.0), 120, "poincare-slender")


def fat_prolate():
    name = "exponent of the saddle itself, per half turn"
    body = (1 / 3, 1.2 / 3, 1.0)
    return {
        **chaos(body, 400, "poincare-fat-prolate"),
        name: saddle_exponent(body),
        WIDTH: layer_width(body, 0.7832, 0.7839, 900),
    }


def fat_oblate():
    name = "exponent of the saddle itself, per half turn"
    body = (1.0, 2 / 2.1, 1 / 2.1)
    return {
        **chaos(body, 400, "poincare-fat-oblate"),
        name: saddle_exponent(body),
        WIDTH: sharp_width(body, 0.2, 0.35),
    }


# --- averaged trajectories -------------------------------------------------------------------------------------------


def energy_at(body, momentum, share):
    """E over I_max at an L over I_max: from the least, of share 0, to the largest possible, of share 1."""
    ratio = body.inertia.max() / body.inertia.min()
    return momentum**2 / 2 * (1 + share * (ratio - 1))


def pinch_ratio(body, momentum, share):
    """Slow time from L_z > 0 to the pinch point over L_z/(4π min X).

    The run ends at L_z = 1e-5; the rest goes at the rate there.
    """

    def met(_, y):
        return y[2] - 1e-5

    met.terminal = True
    start = (0.0, 0.0, momentum, energy_at(body, momentum, share))
    run = averaged(body, start, np.array([0.0, 2.0]), 1e-8, met)
    end = run.t_events[0][0]
    state = run.y_events[0][0]
    end += state[2] / -averaged_rates(body, state)[2]
    return end / (momentum * body.largest / (4 * np.pi * body.resistance.min()))


# The stable node of the averaged equations: L and E over I_max of the axis of most inertia along the vorticity, at
# the angular velocity -1/2.
NODE = np.array([0.0, 0.0, -0.5, 0.125])


def plane(body, shares, near, edge_time, momenta_on_edge, distance):
    """Averaged runs with L along the vorticity, from L_z = -1.1 and `near`, and from 1.1.

    Returns the share of those with L_z < 0 that reach the node, the largest `distance` from the saddle at
    `edge_time` of starts on the upper parabola, and the longest time to the pinch point (`pinch_ratio`).
    """
    reached = []
    for momentum in (-1.1, near):
        for share in shares:
            start = (0.0, 0.0, momentum, energy_at(body, momentum, share))
            end = averaged(body, start, np.array([0.0, 1.0]), 1e-8).y[:, -1]
            reached.append(np.abs(end - NODE).max() < 1e-2)
    pinches = [pinch_ratio(body, 1.1, share) for share in shares]
    # On the upper parabola the body turns about its axis of least inertia, along the vorticity: then
    # L̇_z = -8πX/I (L_z + I/2), which any rounding of E would leave, since the saddle repels.
    axis = int(np.argmin(body.inertia))
    moment = body.inertia[axis] / body.largest
    edges = []
    for start in momenta_on_edge:
        momentum = -moment / 2 + (start + moment / 2) * np.exp(-body.damping[axis] * edge_time)
        edges.append(distance((0.0, 0.0, momentum, momentum**2 / (2 * moment))))
    return float(np.mean(reached)), max(edges), max(pinches)


def spheroid_plane():
    """The plane of L_z and E of a prolate spheroid."""
    body = spheroid(2.0)
    saddle = -body.inertia.min() / body.inertia.max() / 2
    times = graded(1.0, 2001)
    # The report follows the edge to the last of its own times up to 0.16.
    last = times[times <= 0.16][-1]
    shares = (0.001, 0.05, 0.15, 0.3, 0.5, 0.7, 0.85, 0.95, 0.999)
    found = plane(body, shares, -0.06, last, (-1.1, -0.06), lambda end: abs(end[2] - saddle))
    names = (
        "share of the 18 starts with L_z < 0 that reach the node",
        "distance from the saddle where starts on the upper parabola end",
        "slow time to the pinch point from L_z > 0, over L_z/(4π min X), longest",
    )
    return dict(zip(names, found, strict=True))


def local_misfits(point):
    """How far the local trajectory through the point is off the averaged one, in the plane of L_z and E.

    First the largest while |L'| is below 2e-3, then the one at y = 0.5.
    """
    if point.side < 0:
        shift, arrival = arriving(point, 0.8, -0.4, 0.2)
        times = arrival * (1 - np.linspace(1.0, 0.003, 4000) ** 2)
        states = point.follow(0.8, shift, times[-1], times).y
    else:
        begin = point.local_time(BESIDE)
        times = 0.2 * np.linspace(0.003, 1.0, 4000) ** 2
        states = leaving(point, np.concatenate([[begin], times]))
    curve = np.array([point.state(*state)[2:] for state in states.T])
    sides = np.diff(curve, axis=0)
    gaps, shifts = [], []
    for y in np.geomspace(1e-6, 0.5, 41):
        shift = point.local_shift(y)
        offset = point.state(y, shift)[2:] - curve[:-1]
        share = np.sum(offset * sides, axis=1) / np.sum(sides**2, axis=1)
        foot = offset - np.clip(share, 0, 1)[:, None] * sides
        gaps.append(np.sqrt(np.sum(foot**2, axis=1)).min())
        shifts.append(abs(shift))
    gaps = np.array(gaps)
    return gaps[np.array(shifts) < 2e-3].max(), gaps[-1]


def ellipsoid_plane():
    """The same plane of the paper's ellipsoid, and the local solution beside averaged trajectories in it."""
    body = Body(PAPER)
    saddle = -body.inertia.min() / body.inertia.max() / 2
    times = graded(1.0, 2001)
    last = times[times <= 0.25][-1]
    shares = (0.001, 0.1, 0.2, 0.35, 0.5, 0.65, 0.8, 0.95, 0.999)
    found = plane(
        body,
        shares,
        -0.08,
        last,
        (-1.1,),
        lambda end: float(np.hypot(end[2] - saddle, end[3] + saddle / 4)),
    )
    names = (
        "share of the 18 starts with L_z < 0 that reach the node",
        "distance from the saddle where a start on the upper parabola ends",
        "slow time to the pinch point from L_z > 0, over L_z/(4π min X), longest",
    )
    before, after = (local_misfits(MiddleAxis(side)) for side in (-1, 1))
    return {
        **dict(zip(names, found, strict=True)),
        "local against averaged critical trajectory, before the point": before[0],
        "the same after the point": after[0],
        "the same at the end of the local one, y = 0.5, worse side": max(before[1], after[1]),
    }


def beyond(path, first, last):
    """Farthest that points of a path lie outside the polygon of two others; each has shape (n, 2)."""
    ring = np.concatenate([first, last[::-1]])
    closed = np.concatenate([ring, ring[:1]])
    a, b = closed[:-1], closed[1:]
    worst = 0.0
    for point in path:
        x, y = point
        crosses = (a[:, 1] > y) != (b[:, 1] > y)
        with np.errstate(divide="ignore", invalid="ignore"):
            where = a[:, 0] + (y - a[:, 1]) / (b[:, 1] - a[:, 1]) * (b[:, 0] - a[:, 0])
        if np.sum(crosses & (x < where)) % 2 == 0:
            side = b - a
            share = np.sum((point - a) * side, axis=1) / np.maximum(np.sum(side**2, axis=1), 1e-300)
            foot = a + np.clip(share, 0, 1)[:, None] * side
            worst = max(worst, np.min(np.linalg.norm(point - foot, axis=1)))
    return worst


def projections():
    """Averaged paths of a spheroid from L of five azimuths: whether each lies between those of 0° and 90°."""
    body = spheroid(2.0)
    times = graded(1.0, 1201)
    reached, worst = [], [0.0, 0.0]
    for energy in (2 / 9, 0.305, 0.472):
        for cosine in (-0.95, -0.5, 0.1, 0.6, 0.95):
            paths = {}
            for azimuth in (0.0, 15.0, 45.0, 75.0, 90.0):
                sine = np.sqrt(1 - cosine**2)
                angle = np.radians(azimuth)
                direction = np.array([sine * np.sin(angle), sine * np.cos(angle), cosine])
                slow = averaged(body, (*(direction * 2 / 3), energy), times, 1e-9).y.T
                reached.append(np.abs(slow[-1] - NODE).max() < 1e-2)
                across = np.hypot(slow[:, 0], slow[:, 1])
                paths[azimuth] = (slow[:, [2, 3]], np.column_stack([slow[:, 2], across]))
            for azimuth in (15.0, 45.0, 75.0):
                for n in range(2):
                    worst[n] = max(
                        worst[n], beyond(paths[azimuth][n], paths[0.0][n], paths[90.0][n])
                    )
    names = (
        "share of the 75 starts that reach the node",
        "farthest that a path lies outside the limiting ones in the L_z–E plane",
        "the same in the plane of L_z and L_xy",
    )
    return dict(zip(names, (float(np.mean(reached)), *worst), strict=True))


def ellipsoid_space():
    """Averaged runs of the paper's ellipsoid that start with L_x = 0 or L_y = 0: whether that stays, and their ends."""
    body = Body(PAPER)
    grown, away = [], []
    for zero in (1, 0):
        start = np.array([0.0, 0.0, -0.2, energy_at(body, 1.0, 0.7)])
        start[1 - zero] = np.sqrt(1 - 0.04)
        slow = averaged(body, start, graded(1.0, 401), 1e-9).y.T
        grown.append(np.abs(slow[:, zero]).max())
        away.append(np.abs(slow[-1] - NODE).max())
    return {
        "largest |L_x| or |L_y| that starts at zero": float(max(grown)),
        "distance from the node at the end": float(max(away)),
    }


def collapse():
    """L_z of four spheroids of one St* = I_a St/(8π X_c), over t/St*."""
    star, kappas = 2.071, (0.3, 0.5, 2.0, 3.33)
    rates, late, frequencies = [], {}, {}
    for kappa in kappas:
        body = spheroid(kappa)
        stokes = star * 8 * np.pi * body.resistance[2] / body.inertia[2]
        momentum, energy = -body.largest, 0.6 * body.largest
        # cos θ from L² and E of a body whose axis stands at θ from L.
        ia, ie = body.inertia[2], body.inertia[0]
        cosine2 = (2 * energy / momentum**2 - 1 / ie) / (1 / ia - 1 / ie)
        # Of the two angles the obtuse one is taken.
        theta = np.arccos(-np.sqrt(cosine2))
        rotation, spin = aligned(body, -1.0, theta)
        axis = int(np.argmax(body.inertia))
        decay = 8 * np.pi * body.resistance[axis] / body.inertia[axis]
        rates.append((decay, decay * star / stokes))
        scaled = np.linspace(0, 12, 401)
        run = Run(body, stokes, rotation, spin, star * scaled, 1e-11)
        lz = run.slow[:, 2]
        late[kappa] = lz[scaled >= 6]
        if kappa > 1:
            fine = np.linspace(3 * star, 12 * star, 40001)
            dense = Run(body, stokes, rotation, spin, np.concatenate([[0.0], fine]), 1e-11)
            z = dense.slow[1:, 2]
            peaks = np.flatnonzero((z[1:-1] > z[:-2]) & (z[1:-1] > z[2:])) + 1
            frequencies[kappa] = 2 * np.pi * (len(peaks) - 1) / (fine[peaks[-1]] - fine[peaks[0]])
    rates = np.array(rates)
    spread = rates.max(axis=0) / rates.min(axis=0)
    waves = {kappa: np.abs(values + 0.5).max() for kappa, values in late.items()}
    return {
        "largest over smallest relaxation rate of L_z at the node, per St*": spread[1],
        "the same per St": spread[0],
        "oscillation of L_z after t/St* = 6, prolate": min(waves[2.0], waves[3.33]),
        "difference of the two prolate curves there": float(np.abs(late[2.0] - late[3.33]).max()),
        "oscillation there, oblate": max(waves[0.3], waves[0.5]),
        "frequency of that oscillation, κ = 2": frequencies[2.0],
        "frequency of that oscillation, κ = 3.33": frequencies[3.33],
    }


# --- passage of the separatrix ---------------------------------------------------------------------------------------


class MiddleAxis:
    """The paper's ellipsoid near the rotation about its middle axis along the vorticity, L_x = L_y = 0.

    y is 1 - m, where m is the parameter of the polhode's elliptic functions, on one side of L² = 2EI₂ (+1: L²
    above it). L' is L_z/I_max + I₂/(2 I_max). The local solution: dy/dt = G/ln(16/y), dL'/dt = -D L' - P/ln(16/y),
    where G, D and P are `growth`, `decay` and `push`.
    """

    def __init__(self, side):
        self.body = Body(PAPER)
        order = np.argsort(self.body.inertia)
        self.moments = self.body.inertia[order] / self.body.largest
        i1, i2, i3 = self.body.inertia[order]
        x1, x2, x3 = self.body.resistance[order]
        self.growth = side * 32 * np.pi / i2 * (x1 * (i2 - i1) / i1 + x3 * (i3 - i2) / i3)
        self.decay = 8 * np.pi * x2 / i2
        push = 8 * np.pi * (x3 - x1) * (i3 - i2) * (i2 - i1) / (i2 * (i3 - i1))
        self.push = push / self.body.largest
        i1, i2, i3 = self.moments
        self.near, self.far = (i3, i1) if side > 0 else (i1, i3)
        self.side = side

    def complement(self, slow):
        """The y of slow variables."""
        i2 = self.moments[1]
        square, twice = slow[2] ** 2, 2 * slow[3]
        scale = (self.near - self.far) / (self.near - i2)
        return scale * (square - twice * i2) / (square - twice * self.far)

    def state(self, y, shift):
        """Slow variables at y and L'."""
        i2 = self.moments[1]
        momentum = shift - i2 / 2
        share = y * (self.near - i2) / (self.near - self.far)
        twice = momentum**2 * (1 - share) / (i2 - share * self.far)
        return np.array([0, 0, momentum, twice / 2])

    def rates(self, y, shift):
        """Averaged rates of y and L' by the chain rule."""
        i2 = self.moments[1]
        slow = self.state(y, shift)
        change = averaged_rates(self.body, slow)
        square, twice = slow[2] ** 2, 2 * slow[3]
        d_square, d_twice = 2 * slow[2] * change[2], 2 * change[3]
        above, below = square - twice * i2, square - twice * self.far
        d_above, d_below = d_square - i2 * d_twice, d_square - self.far * d_twice
        scale = (self.near - self.far) / (self.near - i2)
        return scale * (d_above * below - above * d_below) / below**2, change[2]

    def local_time(self, y):
        """Time since the point, negative before it: G t = y ln(16/y) + y."""
        return y * (np.log(16 / y) + 1) / self.growth if y > 0 else 0.0

    def local_y(self, time):
        """The inverse of `local_time`."""
        return brentq(lambda y: self.local_time(y) - time, 0.0, 0.9, xtol=1e-17, rtol=1e-14)

    def local_shift(self, y):
        """L' on the trajectory through the point, from dL'/dy = -(D L' ln(16/y) + P)/G."""
        here = self.local_time(y)

        def pushed(s):
            return np.exp(self.decay * (self.local_time(s) - here))

        return -self.push / self.growth * quad(pushed, 0.0, y, epsabs=0, epsrel=1e-12)[0]

    def follow(self, y, shift, end, times=None, until=None):
        """Averaged run in y and L' from a start, as `solve_ivp` returns it; `until` is the y at which to stop."""

        def rates(_, state):
            # The integrator may try a step beyond the point.
            return self.rates(max(state[0], 1e-13), state[1])

        def met(_, state):
            return state[0] - until

        met.terminal = True
        return solve_ivp(
            rates,
            (0.0, end),
            [y, shift],
            "DOP853",
            t_eval=times,
            rtol=1e-10,
            atol=[1e-13, 1e-12],
            events=met if until is not None else None,
        )


# y next to the singular point where averaged runs start, or stop: the local solution does the rest.
BESIDE = 1e-7


def arriving(point, y, low=-0.02, high=0.02):
    """L' at y on the trajectory that meets the point, and the time that it takes."""

    def run(shift):
        found = point.follow(y, shift, 0.4, until=BESIDE)
        return found.t_events[0][0], found.y_events[0][0][1]

    wanted = point.local_shift(BESIDE)
    shift = brentq(lambda value: run(value)[1] - wanted, low, high, xtol=1e-11)
    return shift, run(shift)[0] - point.local_time(BESIDE)


def leaving(point, times):
    """y and L' at times after the point."""
    begin = point.local_time(BESIDE)
    found = point.follow(BESIDE, point.local_shift(BESIDE), times[-1] - begin, times - begin)
    return found.y


def singular_point():
    """Slow times to and from the singular point by the averaged equations, and the local solution's."""
    before, after = MiddleAxis(-1), MiddleAxis(1)
    local = after.local_time(0.1)
    worst, slowest = 0.0, np.inf
    for point in (before, after):
        for y in np.geomspace(1e-8, 0.3, 40):
            rate = point.rates(y, point.local_shift(y))[0]
            if y <= 1e-3:
                worst = max(worst, abs(point.growth / np.log(16 / y) / rate - 1))
            if y < 1.1e-8:
                slowest = min(slowest, abs(rate))
    shift, arrival = arriving(before, 0.1)
    gone = after.follow(BESIDE, after.local_shift(BESIDE), 0.02, until=0.1).t_events[0][0]
    off = np.zeros(2)
    for point in (before, after):
        times = local * np.linspace(1, 0, 401)[:-1]
        if point is before:
            states = point.follow(0.1, shift, arrival - times[-1], arrival - times).y
            times = -times
        else:
            times = times[::-1]
            states = leaving(point, times)
        y = [point.local_y(time) for time in times]
        shifts = [point.local_shift(value) for value in y]
        off = np.maximum(off, np.abs(states - [y, shifts]).max(axis=1))
    return {
        "local over averaged rate of y, worst, y ≤ 0.001": worst,
        "slow time from y = 0.1 to the singular point": arrival,
        "slow time from the singular point to y = 0.1": gone + after.local_time(BESIDE),
        "local against averaged y along the passage": off[0],
        "local against averaged L_z' along the passage": off[1],
        "rate of y at y = 1e-8, smaller side": slowest,
        "local solution's time": local,
    }


# --- full against averaged -------------------------------------------------------------------------------------------


def ellipsoid_slow_2():
    """Error of the averaged equations along a run of the paper's ellipsoid, at nine St."""
    body = Body(PAPER)
    angles, rates = (1.57, 0.0, np.pi / 2), (0.0, -0.61, 0.0003)
    rotation, spin = rows(*angles), spin_of(angles, rates)
    momentum = rotation.T @ (body.inertia * spin)
    start = np.array([*momentum, np.sum(body.inertia * spin**2) / 2]) / body.largest
    end = 1.2
    slow_times = np.linspace(0, end, 4801)
    mean = averaged(body, start, slow_times, 1e-10).y.T
    change = np.ptp(mean, axis=0).max()
    errors, ends = {}, {}
    # The averaged and the full run at St = 100 at every eighth time, as they are drawn.
    drawn = slice(None, None, 8)
    for stokes in (100.0, 150.0, 500.0, 1e3, 2e3, 5e3, 1e4, 2e4, 5e4):
        run = Run(body, stokes, rotation, spin, stokes * slow_times, 1e-11)
        errors[stokes] = np.abs(run.slow - mean).max()
        ends[stokes] = np.abs(run.slow[-481:].mean(axis=0) - NODE).max()
        if stokes == 100.0:
            difference = np.abs((run.slow - mean)[drawn].mean(axis=0)).max()
    large = np.array([s for s in errors if s >= 5e3])
    return {
        "exponent of the error of L and E in St, St ≥ 5000": slope(
            large, [errors[s] for s in large]
        ),
        "error × St at St = 50000": errors[5e4] * 5e4,
        "error at St = 100, over the largest change of a slow variable": errors[100.0] / change,
        "mean difference over the run, St = 100": difference,
        "distance of the averaged end from the node": np.abs(mean[-481:].mean(axis=0) - NODE).max(),
        "the same of the mean full end, St ≥ 500": max(v for s, v in ends.items() if s >= 500),
        "errors": errors,
        "change": change,
    }


def first_order():
    """Error of L_z by the averaged equations, with the first-order correction as printed, and corrected."""
    kappa, lz0, theta, phi, end = 2.0, -0.9, 0.9, 0.6, 0.04
    body = spheroid(kappa)
    rotation, spin = aligned(body, lz0, theta, phi)
    momentum = rotation.T @ (body.inertia * spin)
    start = np.array([*momentum, np.sum(body.inertia * spin**2) / 2]) / body.largest
    ie, ia, yc = body.inertia[0], body.inertia[2], body.resistance[0]
    times = np.linspace(0, end, 4001)
    anisotropy = (kappa**2 - 1) / (kappa**2 + 1)

    def spin_squared(slow):
        """h² = cos² of the angle of the axis from L, from L² and E."""
        square = np.sum(slow[..., :3] ** 2, axis=-1)
        ratio = body.largest
        return (2 * slow[..., 3] / square / ratio - 1 / ie) / (1 / ia - 1 / ie)

    def oscillation(momentum, slow, stokes, phase):
        """L_z⁽¹⁾/St of `lzsfod2` over I_max at the frequency `momentum`, L_z/I_max, and a phase; I_max is I_e here."""
        size = 2 * np.pi * yc * anisotropy / ie
        return -size * (1 - spin_squared(slow)) / momentum * np.sin(2 * phase) / stokes

    def rates(_, state):
        """Averaged rates of L and E, and of the phase in slow time."""
        return np.append(averaged_rates(body, state[:4]), state[2])

    def corrected(stokes):
        """The averaged run from a shifted L_z, the spin about the axis kept, and its oscillation added."""
        shift = oscillation(start[2], start, stokes, phi)
        axial = np.sqrt(spin_squared(start)) * start[2]
        moved = start.copy()
        moved[2] -= shift
        moved[3] = (axial**2 * (1 / ia - 1 / ie) + moved[2] ** 2 / ie) * body.largest / 2
        run = solve_ivp(
            rates, (0, end), [*moved, 0.0], "DOP853", t_eval=times, rtol=1e-13, atol=1e-15
        )
        slow, phase = run.y[:4].T, run.y[4]
        return slow[:, 2] + oscillation(slow[:, 2], slow, stokes, stokes * phase + phi)

    errors = {"averaged": [], "printed": [], "corrected": []}
    grid = np.geomspace(1e2, 1e5, 13)
    plain = averaged(body, start, times, 1e-12).y.T
    area = cumulative_trapezoid(plain[:, 2], times, initial=0.0)
    # The trapezoid rule's leading error is removed by the slopes at the ends (Euler and Maclaurin).
    slope_ends = np.gradient(plain[:, 2], times, edge_order=2)
    area -= (times[1] ** 2) / 12 * (slope_ends - slope_ends[0])
    for stokes in grid:
        full = Run(body, stokes, rotation, spin, stokes * times, 1e-13).slow[:, 2]
        errors["averaged"].append(np.abs(plain[:, 2] - full).max())
        errors["corrected"].append(np.abs(corrected(stokes) - full).max())
        mean = np.concatenate([plain[:1, 2], area[1:] / times[1:]])
        printed = oscillation(mean, plain, stokes, stokes * area + phi)
        errors["printed"].append(np.abs(plain[:, 2] + printed - full).max())
    large = grid >= 900
    ratio = np.array(errors["averaged"]) / np.array(errors["printed"])
    return {
        "averaged error over that as printed, smallest": float(ratio.min()),
        "order of the averaged error": slope(grid[large], np.array(errors["averaged"])[large]),
        "order in St of the corrected error": slope(
            grid[large], np.array(errors["corrected"])[large]
        ),
        "corrected error × St², largest St": errors["corrected"][-1] * grid[-1] ** 2,
        "order with the correction as printed": slope(
            grid[large], np.array(errors["printed"])[large]
        ),
    }


# --- from rest -------------------------------------------------------------------------------------------------------


def at_rest(axes, angles, stokes, times, tolerance=1e-12):
    """A full run from rest at Euler angles in rad."""
    return Run(Body(axes), stokes, rows(*angles), np.zeros(3), times, tolerance)


def maxima(times, values):
    """Times of the maxima of values at equispaced times, by a parabola through three points."""
    n = np.flatnonzero((values[1:-1] > values[:-2]) & (values[1:-1] >= values[2:])) + 1
    low, middle, high = values[n - 1], values[n], values[n + 1]
    return times[n] + (times[1] - times[0]) * 0.5 * (low - high) / (low - 2 * middle + high)


def rest_needle():
    """A needle from rest: when its turns change from those of the Jeffery orbit to those of the free top."""
    axes, angles, stokes, end = (1.0, 1.0, 10.0), (0.10472, 5.4978, 0.0), 1e3, 600.0
    times = np.linspace(0, end, 300001)
    run = at_rest(axes, angles, stokes, times)
    body = run.body
    z = run.rotation[:, 2, 2]
    peaks = maxima(times, z)
    durations = np.diff(peaks)
    place = int(np.argmax(durations < np.sqrt(durations[0] * durations[-1])))
    change = peaks[place]
    free = solve_ivp(
        free_rates,
        (0, 2 * np.pi * 10.1),
        rows(*angles).ravel(),
        "DOP853",
        args=(body.axes,),
        rtol=1e-11,
        atol=1e-12,
        t_eval=np.linspace(0, 2 * np.pi * 10.1, 40001),
    )
    jeffery_turns = np.diff(maxima(free.t, free.y[8]))
    jeffery_turn = jeffery_turns[0] if len(jeffery_turns) else np.nan
    flow = np.empty_like(run.spin)
    square = body.axes**2
    t = run.rotation
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        flow[:, i] = (square[j] * t[:, k, 0] * t[:, j, 1] - square[k] * t[:, j, 0] * t[:, k, 1]) / (
            square[j] + square[k]
        )
    viscous = np.linalg.norm(8 * np.pi * body.resistance / stokes * (run.spin - flow), axis=1)
    gyroscopic = np.linalg.norm(np.cross(run.spin, body.inertia * run.spin), axis=1)
    later = times >= change
    whole = np.log(durations[0] / durations[-1])
    return {
        "time at which the turns change": change,
        "the same over √St": change / np.sqrt(stokes),
        "share of the whole change of duration, in its logarithm, in one turn": float(
            np.log(durations[place - 1] / durations[place]) / whole
        ),
        "time of the first turn over that of the Jeffery orbit": durations[0] / jeffery_turn,
        "time of the last turn over that of the free top at -1/2, 4π": durations[-1] / (4 * np.pi),
        "|z| of the axis at the end, largest": float(np.abs(z[times >= 0.95 * end]).max()),
        "share of the time after the change in which the viscous term is the larger": float(
            np.mean((viscous > gyroscopic)[later])
        ),
    }


def transient(axes, angles):
    """Starts from rest at seven St: the first radian, the first wiggle of the torque, the speed at t = √St."""
    numbers = (50.0, 500.0, 5e3, 5e4, 5e5, 5e6, 5e7)
    scaled = np.linspace(0, 6, 12001)
    turned, wiggle, speed = [], [], []
    for stokes in numbers:
        run = at_rest(axes, angles, stokes, scaled * np.sqrt(stokes))
        size = np.linalg.norm(run.spin, axis=1)
        angle = cumulative_trapezoid(size, run.times, initial=0.0)
        turned.append(np.interp(1.0, angle, scaled))
        speed.append(np.interp(1.0, scaled, size))
        # The torque along the vorticity itself, not a difference of L_z.
        body, t, square = run.body, run.rotation, run.body.axes**2
        torque = np.zeros(len(scaled))
        for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
            flow = (square[j] * t[:, k, 0] * t[:, j, 1] - square[k] * t[:, j, 0] * t[:, k, 1]) / (
                square[j] + square[k]
            )
            torque -= 8 * np.pi * body.resistance[i] / stokes * (run.spin[:, i] - flow) * t[:, i, 2]
        tops = np.flatnonzero((torque[1:-1] > torque[:-2]) & (torque[1:-1] >= torque[2:])) + 1
        for top in tops:
            # Prominence: how far the torque falls on either side before it is larger again.
            left = torque[:top][::-1]
            higher = np.flatnonzero(left > torque[top])
            left = left[: higher[0]] if len(higher) else left
            right = torque[top + 1 :]
            higher = np.flatnonzero(right > torque[top])
            right = right[: higher[0]] if len(higher) else right
            prominence = torque[top] - max(left.min(), right.min())
            # The least prominence that the report counts.
            if prominence >= 0.02 * np.abs(torque).max():
                wiggle.append(
                    float(maxima(scaled[top - 1 : top + 2], torque[top - 1 : top + 2])[0])
                )
                break
    numbers, turned, wiggle = np.array(numbers), np.array(turned), np.array(wiggle)
    large = numbers >= 5e5
    root = np.sqrt(numbers)
    shown = numbers <= 5e5
    return {
        "exponent in St of the time of the first radian, St ≥ 500000": slope(
            numbers[large], (turned * root)[large]
        ),
        "exponent of the time of the first wiggle": slope(numbers[large], (wiggle * root)[large]),
        "exponent of the angular velocity at t = √St": slope(
            numbers[large], np.array(speed)[large]
        ),
        "time of the first radian over √St, largest St": turned[-1],
        "time of the first wiggle over √St, largest St": wiggle[-1],
        "latest over earliest first radian, over √St, from St = 50 to 500000": turned[shown].max()
        / turned[shown].min(),
        "latest over earliest first wiggle, over √St, from St = 50 to 500000": wiggle[shown].max()
        / wiggle[shown].min(),
    }


def transient_spheroid():
    return transient((1.0, 1.0, 2.0), (0.314, 0.52, 0.0))


def transient_ellipsoid():
    return transient((3.0, 2.0, 1.0), (0.314, 0.52, 1.05))


def rest_short():
    """A spheroid from rest up to t = √St: the path of its axis beside its Jeffery orbit."""
    axes, angles = (1.0, 1.0, 2.0), (0.78539, 2.35619, 0.0)
    lengths = {}
    for stokes in (1e6, 1e7, 1e8):
        run = at_rest(axes, angles, stokes, np.linspace(0, 1, 8001) * np.sqrt(stokes))
        path = run.rotation[:, 2]
        lengths[stokes] = np.linalg.norm(np.diff(path, axis=0), axis=1).sum()
    body = Body(axes)
    end = 2 * np.pi * 2.5
    free = solve_ivp(
        free_rates,
        (0, end),
        rows(*angles).ravel(),
        "DOP853",
        args=(body.axes,),
        rtol=1e-11,
        atol=1e-12,
        t_eval=np.linspace(0, end, 4001),
    )
    orbit = free.y[6:9].T
    gaps = np.array([np.linalg.norm(orbit - point, axis=1).min() for point in path[::4]])
    along = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(path[::4], axis=0), axis=1))])
    turn = np.linalg.norm(np.diff(orbit, axis=0), axis=1).sum()
    return {
        "path length at St = 1e8": lengths[1e8],
        "its relative change from St = 1e7": lengths[1e8] / lengths[1e7] - 1,
        "path length at St = 1e6 over that at 1e8, less one": lengths[1e6] / lengths[1e8] - 1,
        "largest distance from the Jeffery orbit at St = 1e8": gaps.max(),
        "path until it is 0.1 rad off, over the length of the orbit": np.interp(
            0.1, gaps[: gaps.argmax()], along[: gaps.argmax()]
        )
        / turn,
    }


# --- frequencies, rates ----------------------------------------------------------------------------------------------


def plane_waves():
    """Swings of E of bodies that start with L along z: their frequency and irregularity."""
    bodies = [(1.0, 1.0, 2.0), (1.0, 1.0, 3.33)]
    bodies += [(1.0, b, c) for b in (0.55, 0.75, 0.95) for c in (0.5, 0.3)]
    frequency, scatter = [], []
    for axes in bodies:
        body = Body(axes)
        rotation, spin = aligned(body, -0.7, 0.9)
        times = np.linspace(0, 50.0, 40001)
        energy = Run(body, 1e3, rotation, spin, times).slow[:, 3]
        tops, feet = maxima(times, energy), maxima(times, -energy)
        turning = np.sort(np.concatenate([tops, feet]))
        frequency.append(np.pi / np.mean(np.diff(turning)))
        place = np.rint(turning / (times[1] - times[0])).astype(int)
        swings = np.abs(np.diff(energy[place]))
        scatter.append(np.median(np.abs(np.log(swings[2:] / swings[:-2]))))
    columns = np.reshape(frequency[2:], (3, 2))
    bodies = np.array(scatter[2:])
    return {
        "frequency of κ = 3.33 over that of 2": frequency[1] / frequency[0],
        "frequency at the foot over that at the top of a column of ellipsoids, smaller": float(
            (columns[2] / columns[0]).min()
        ),
        "irregularity of the bodies between over the near-spheroids', medians": float(
            np.median(bodies[2:4]) / np.median(bodies[[0, 1, 4, 5]])
        ),
    }


DECAY_BODIES = (
    (2.0, 1.0, 1.0),
    (1.0, 1.0, 0.5),
    (1.0, 0.8, 0.5),
    (1.0, 0.55, 0.3),
    (1.0, 0.95, 0.5),
)


def fitted(times, values):
    """Exponential rate of values of one sign, by least squares."""
    return float(np.polyfit(times, np.log(np.abs(values)), 1)[0])


def linear_rate(body, rest, mode, step):
    """Rate of a mode at the stable rotation `rest`, from the averaged rates at a finite step from there.

    Modes 0 to 3: L_x, L_y, L_z, and the wobble 2EI₃ - L².
    """
    moment = body.inertia[2] / body.largest
    moved = rest.copy()
    if mode < 3:
        moved[mode] += step
        moved[3] = np.sum(moved[:3] ** 2) / (2 * moment) * (1 + 1e-14)
        return averaged_rates(body, moved)[mode] / step
    moved[3] *= 1 + step
    change = averaged_rates(body, moved)
    wobble = 2 * moved[3] * moment - moved[2] ** 2
    return (2 * change[3] * moment - 2 * moved[2] * change[2]) / wobble


def extrapolated(body, rest, mode):
    """The limit of `linear_rate` for a step of zero, from the cubic through four steps (Neville)."""
    steps = 2e-3 * 0.5 ** np.arange(4)
    values = [linear_rate(body, rest, mode, step) for step in steps]
    for level in range(1, len(steps)):
        values = [
            (steps[n] * values[n + 1] - steps[n + level] * values[n])
            / (steps[n] - steps[n + level])
            for n in range(len(values) - 1)
        ]
    return values[0]


def decay_rates():
    """Rates of full runs at St = 1e5 beside those of the averaged equations, linearized."""
    off = []
    for axes in DECAY_BODIES:
        body = Body(axes)
        moment = body.inertia[2] / body.largest
        rest = np.array([0.0, 0.0, -moment / 2, moment / 8])
        odd = np.isclose(body.inertia[1], body.inertia[2], rtol=1e-12)
        for mode in range(4):
            rate = extrapolated(body, rest, mode)
            # Of a spheroid that tumbles the report follows half of the wobble's.
            rate *= 0.5 if mode == 3 and odd else 1.0
            end = 1.5 / abs(rate)
            slow = np.linspace(0, end, 4001)
            if mode == 3:
                rotation, spin = aligned(body, -moment / 2, 0.03)
            else:
                tilt, azimuth = ((0.03, np.pi / 2), (0.03, 0.0), (0.0, 0.0))[mode]
                rotation = rows(tilt, azimuth, 0.3)
                spin = np.array([0.0, 0.0, -0.5 - (0.03 if mode == 2 else 0.0)])
            run = Run(body, 1e5, rotation, spin, 1e5 * slow, 1e-12)
            values = run.slow[:, mode] + (moment / 2 if mode == 2 else 0.0)
            if mode == 3:
                values = 2 * run.slow[:, 3] * moment - np.sum(run.slow[:, :3] ** 2, axis=1)
            found = fitted(slow, values) * (0.5 if mode == 3 and odd else 1.0)
            off.append(abs(found / rate - 1))
    large, turned = [], []
    for kappa in (0.5, 2.0):
        body = spheroid(kappa)
        slow = np.linspace(0, 2 / min(body.damping), 401)
        spin = 1e3 * np.array([0.48, 0.0, 0.64]) / body.inertia * body.largest
        run = Run(body, 1e4, rows_of((0.5, 0.5, 0.1, 0.7)), spin, 1e4 * slow, 1e-11)
        axial = np.einsum("ni,ni->n", run.momentum, run.rotation[:, 2]) ** 2
        square = np.sum(run.momentum**2, axis=1)
        for values, axis in ((axial, 2), (square - axial, 0)):
            large.append(abs(fitted(slow, values) / (-2 * body.damping[axis]) - 1))
        cosine = run.momentum @ run.momentum[0] / np.sqrt(square * square[0])
        turned.append(np.degrees(np.arccos(np.clip(cosine, -1, 1)).max()))
    return {
        "measured over printed rate, less one, worst of 20": max(off),
        "decay from large L, measured over printed rate, less one, worst": max(large),
        "angle by which L turns meanwhile": max(turned),
    }


ITEMS = {
    "decay-rates": decay_rates,
    "spin-drift": spin_drift,
    "poincare-slender": slender,
    "poincare-fat-prolate": fat_prolate,
    "poincare-flat": flat,
    "poincare-fat-oblate": fat_oblate,
    "spheroid-plane": spheroid_plane,
    "spheroid-projections": projections,
    "spheroid-collapse": collapse,
    "singular-point": singular_point,
    "ellipsoid-slow-2": ellipsoid_slow_2,
    "ellipsoid-plane": ellipsoid_plane,
    "ellipsoid-space": ellipsoid_space,
    "rest-needle": rest_needle,
    "rest-transient-spheroid": transient_spheroid,
    "rest-transient-ellipsoid": transient_ellipsoid,
    "rest-short-spheroid": rest_short,
    "plane-waves": plane_waves,
    "first-order": first_order,
}


def main(names):
    """Compute the items named, or all, print their numbers and write them."""
    path = HERE / "numbers.json"
    for name in names or ITEMS:
        began = time.process_time()
        numbers = ITEMS[name]()
        # Others may have written meanwhile.
        found = json.loads(path.read_text()) if path.exists() else {}
        found[name] = numbers
        print(f"{name}: {time.process_time() - began:.0f} s", flush=True)
        for what, value in found[name].items():
            print(f"    {what}: {value}", flush=True)
        path.write_text(json.dumps(found, indent=1, ensure_ascii=False, default=float) + "\n")


if __name__ == "__main__":
    main(sys.argv[1:])
