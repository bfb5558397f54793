"""The limits St = 0 and ∞: Poincaré sections of the Jeffery top, chaos at its saddle, and Euler tops in closed form."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import acosh, inf, log, pi

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from polhode.harness.paper.item import Computed, Grid, Table
from polhode.harness.paper.runs import bisected, full_run, run_form
from polhode.harness.references.chaos import tangent_integrator
from polhode.models.catalogue import form as find_form
from polhode.models.flow import jeffery_spin, shares
from polhode.models.forms.jeffery import field as jeffery_field
from polhode.models.free_top.torque_free import TorqueFree
from polhode.models.rotation import matrix_from_quaternion, quaternion_from_euler
from polhode.models.scene import EulerStart, Scene
from polhode.models.shape import Ellipsoid
from polhode.solvers.compile import load_heyoka

# Sampling step, in inverse shear rates, of the orbits.
STEP = 0.2
# The tangent is brought back to unit length after so many steps.
PIECE = 100
TANGENT = (0.5, -0.5, 0.5, -0.5)
# Beside ψ = 0, which some orbits never leave.
PSI = 1e-9
# Where ends of a layer are looked for, in rad from θ = π/2, with halvings down to the last digit.
SEARCHED = 0.0, 1.2, 52
# Distance, in rad, from the saddle at which its growth is measured.
TINY = 1e-4
# Where a start lies: uniform over the section's area element; next to the saddle; about the
# separatrix, at ψ = 0.
ISOTROPIC, BESIDE, ABOUT = 0.0, 1.0, 2.0
# Distances from the separatrix, over its own from θ = π/2, of the starts about it.
STEPS_OFF = (-16e-4, -9e-4, -4e-4, -1e-4, 0.0, 1e-4, 4e-4, 9e-4, 16e-4)
# Width, in rad, that rounding alone gives a separatrix.
ROUNDING = 1e-12


def section_points(
    ellipsoid: Ellipsoid, times: np.ndarray, orientation: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """θ and ψ in rad where φ = nπ, from quaternions, shape (n, 4), at times of shape (n,), by cubic interpolation."""
    # φ = nπ is where the flow component t₃₁ of z' vanishes; ψ is given from -π/2 to π/2, its
    # symmetry taken out.
    rotation = matrix_from_quaternion(orientation)
    # Each column c of t_ij, a space axis in body axes, obeys c' = c × ω.
    rates = np.cross(rotation, jeffery_spin(ellipsoid, rotation)[:, :, None], axis=1)
    crossings = CubicHermiteSpline(times, rotation[:, 2, 0], rates[:, 2, 0]).roots(
        extrapolate=False
    )
    # The start, where φ = 0, is not one of them.
    crossings = crossings[crossings > times[1] / 2]
    vorticity = CubicHermiteSpline(times, rotation[:, :, 2], rates[:, :, 2])(crossings)
    theta = np.arccos(np.clip(vorticity[:, 2] / np.linalg.norm(vorticity, axis=1), -1, 1))
    psi = np.arctan2(vorticity[:, 0], vorticity[:, 1])
    return theta, (psi + pi / 2) % pi - pi / 2


def chaos_border(turns: float) -> float:
    """Logarithm of the stretching above which an orbit is chaotic: of a regular one it grows like that of the turns."""
    return 3 * float(np.log(turns))


def half_turn(ellipsoid: Ellipsoid) -> float:
    """Half a Jeffery period of the longest and the shortest axis, the slowest turn, in inverse shear rates."""
    kappa = max(ellipsoid.semi_axes) / min(ellipsoid.semi_axes)
    return pi * (kappa + 1 / kappa)


def stretched_orbit(
    ellipsoid: Ellipsoid, theta: float, psi: float, duration: float
) -> tuple[tuple[np.ndarray, np.ndarray], float]:
    """Section points, θ and ψ, of the orbit from φ = 0, and the logarithm of the stretching of a tangent vector."""
    integrator = tangent_integrator(jeffery_field, 4, 6)
    times = np.linspace(0.0, duration, int(duration / STEP) + 2)
    integrator.time = 0.0
    integrator.state[:] = [*quaternion_from_euler((theta, 0.0, psi)), *TANGENT]
    integrator.pars[:] = shares(ellipsoid)
    orientation, stretch = [integrator.state[None, :4].copy()], 0.0
    for first in range(0, len(times) - 1, PIECE):
        outcome, *_, states = integrator.propagate_grid(times[first : first + PIECE + 1])
        if outcome != load_heyoka().taylor_outcome.time_limit:
            raise RuntimeError(f"the run of an orbit and its tangent ended with {outcome}")
        orientation.append(states[1:, :4])
        length = float(np.linalg.norm(integrator.state[4:]))
        integrator.state[4:] /= length
        stretch += log(length)
    return section_points(ellipsoid, times, np.concatenate(orientation)), stretch


def orbit(
    ellipsoid: Ellipsoid, theta: float, psi: float, duration: float
) -> tuple[np.ndarray, np.ndarray]:
    """The same section points alone, as precisely as double precision allows."""
    times = np.linspace(0.0, duration, int(duration / (2 * STEP)) + 2)
    scene = Scene(ellipsoid, 0.0, EulerStart((theta, 0.0, psi)), duration)
    return section_points(ellipsoid, times, full_run(scene, times, 1e-15).states)


def measure_layer(ellipsoid: Ellipsoid, turns: int) -> tuple[float, float]:
    """Ends of pure libration and of pure circulation along θ at ψ = 0, which all orbits cross: θ - π/2 in rad."""
    # The first is the larger one while orbits next to a sharp separatrix have not yet left the
    # saddle. The edge of a layer may be frayed, so that the width is a lower bound.
    duration = turns * half_turn(ellipsoid)

    def circulates(offset: float) -> bool:
        _, psi = orbit(ellipsoid, pi / 2 + offset, PSI, duration)
        return bool(np.any(np.abs(np.diff(psi)) > 2))

    def librates(offset: float) -> bool:
        theta, _ = orbit(ellipsoid, pi / 2 + offset, PSI, duration)
        return bool(np.any((theta[1:] - pi / 2) * (theta[:-1] - pi / 2) < 0))

    return bisected(lambda offset: not circulates(offset), *SEARCHED), bisected(librates, *SEARCHED)


def saddle_growth(ellipsoid: Ellipsoid) -> float:
    """Exponent of the saddle (π/2, π/2) of the section, per half turn."""
    # The map next to it has determinant one and, by the reversal φ → -φ, equal diagonal elements
    # cosh λ.
    _, psi = orbit(ellipsoid, pi / 2, pi / 2 - TINY, 1.5 * half_turn(ellipsoid))
    return acosh((pi / 2 - abs(psi[0])) / TINY)


@dataclass(frozen=True)
class Sections:
    """Poincaré sections of one ellipsoid; z' is its odd axis, so that the saddles lie at θ = π/2, ψ = ±π/2."""

    ellipsoid: Ellipsoid
    sections: int  # half turns to follow, about
    close: tuple[float, float]  # half width in θ and ψ, in rad, of the magnified view of the saddle
    layered: bool = False  # look for the layer of chaos along the separatrix

    def starts(
        self, grid: Grid, layers: Sequence[tuple[float, float]]
    ) -> list[tuple[float, float, float]]:
        """Kind, θ and ψ at φ = 0."""
        generator = np.random.default_rng(7)
        count = grid.of(72, 16)
        theta = np.arccos(generator.uniform(-1.0, 1.0, count))
        psi = generator.uniform(-pi / 2, pi / 2, count)
        found = [(ISOTROPIC, *pair) for pair in zip(theta.tolist(), psi.tolist(), strict=True)]
        found += [(BESIDE, pi / 2 + offset, 1.57) for offset in (1e-3, 5e-3, 2e-2)[: grid.of(3, 1)]]
        if layers:
            librating, circulating = layers[-1]
            middle, width = (librating + circulating) / 2, circulating - librating
            # An orbit on a sharp separatrix would only rest at the saddle.
            steps = [step for step in STEPS_OFF[:: grid.of(1, 2)] if step != 0 or width > ROUNDING]
            found += [(ABOUT, pi / 2 + middle * (1 + step), PSI) for step in steps]
        return found

    def compute(self, grid: Grid) -> Computed:
        """Section points and stretching of every start; the width of the layer of chaos."""
        body = self.ellipsoid
        turns = grid.of(self.sections, self.sections // 6)
        duration = turns * half_turn(body)
        counts = grid.of((200, 800), (100,)) if self.layered else ()
        layers = [measure_layer(body, count) for count in counts]
        parts, close, orbits = [], [], []
        width, height = self.close
        for number, (kind, theta, psi) in enumerate(self.starts(grid, layers)):
            found, stretch = stretched_orbit(body, theta, psi, duration)
            points = [(number, *point) for point in zip(*found, strict=True)]
            parts += points if kind != ABOUT else []
            close += [
                row for row in points if abs(row[1] - pi / 2) <= height and pi / 2 - row[2] <= width
            ]
            start = {"orbit": number, "kind": kind, "theta": theta, "psi": psi}
            chaotic = float(stretch > chaos_border(turns))
            orbits.append(
                {**start, "stretch": stretch, "exponent": stretch / turns, "chaotic": chaotic}
            )
        yield "", _thinned(parts, grid.of(9000, 2000))
        yield "close", _thinned(close, grid.of(6000, 1000))
        yield from (("orbits", row) for row in orbits)
        yield "settings", {"duration": duration, "turns": turns}
        for count, (low, high) in zip(counts, layers, strict=True):
            yield (
                "layer",
                {"turns": count, "librating": low, "circulating": high, "width": high - low},
            )
        if layers:
            yield "saddle", {"growth": saddle_growth(body)}


def beside_a_half(interval: tuple[float, float]) -> str:
    """Whether a share, known to within the interval, is most of all, about half, or the lesser part."""
    low, high = interval
    if high < 0.2:
        return ""
    return (
        ", the lesser part" if high < 0.5 else ", the greater part" if low > 0.5 else ", about half"
    )


def _thinned(points: list[tuple], count: int) -> dict[str, np.ndarray]:
    """At most about so many of the points."""
    table = np.round(points[:: max(1, len(points) // count)], 6)
    return dict(zip(("orbit", "theta", "psi"), table.T, strict=True))


START = EulerStart((1.05, 0.0, 0.0), (2.5, 15.0, 4.0))
TIME = 12.0
# Turns of the precession in which the path must not close. The nutation has half the period of the
# polhode.
TURNS = 12


@dataclass(frozen=True)
class Top:
    """A top of one shape from the paper's start."""

    ellipsoid: Ellipsoid

    def compute(self, grid: Grid) -> Computed:
        """Path of z', in the closed form, and the closed form against integration."""
        times = np.linspace(0.0, TIME, grid.of(2401, 601))
        scene = Scene(self.ellipsoid, inf, START, TIME)
        exact, integrated = (
            run_form(find_form("euler-top"), scene, times, 1e-14, solver=solver).observables
            for solver in ("exact", "taylor")
        )
        axis = exact.rotation[:, 2]
        size = float(np.linalg.norm(exact.angular_momentum[0]))
        nutation = np.arccos(axis @ exact.angular_momentum[0] / size)
        top = TorqueFree(self.ellipsoid.inertia, START.quaternion, START.angular_velocity)
        difference = np.max(np.abs(exact.rotation - integrated.rotation))
        drift = np.max(np.abs(exact.slow - exact.slow[0])) / np.max(np.abs(exact.slow[0]))
        yield (
            "",
            {"t": times, "x": axis[:, 0], "y": axis[:, 1], "z": axis[:, 2], "nutation": nutation},
        )
        periods = {"period": top.period, "precession_period": top.precession_period}
        yield "numbers", {**periods, "difference": difference, "drift": drift, "momentum": size}


def measured_period(path: Table) -> float:
    """Time in which z' goes once about L."""
    axis = np.column_stack([path.x, path.y, path.z])
    normal = np.cross(axis[0] - axis[len(axis) // 5], axis[0] - axis[len(axis) // 3])
    normal /= np.linalg.norm(normal)
    across = axis - np.outer(axis @ normal, normal)
    first = across[0] / np.linalg.norm(across[0])
    azimuth = np.unwrap(np.arctan2(across @ np.cross(normal, first), across @ first))
    return path.t[-1] * 2 * pi / abs(azimuth[-1] - azimuth[0])
