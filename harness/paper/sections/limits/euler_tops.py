"""Section "Limiting cases": the Jeffery top's sections, and the Euler top's trajectories in closed form."""

from math import inf, pi

import numpy as np
from matplotlib.figure import Figure

from polhode.harness.paper.drawing import BLUE, VERMILLION, draw_on_sphere, panels, unit_sphere
from polhode.harness.paper.item import Data, Grid, Item, Number, Section, Verdict, Word
from polhode.harness.paper.runs import run_form
from polhode.harness.paper.sections.limits.jeffery_top import ITEMS
from polhode.harness.paper.tables import columns
from polhode.models.catalogue import form as find_form
from polhode.models.free_top.torque_free import TorqueFree
from polhode.models.scene import EulerStart, Scene
from polhode.models.shape import Ellipsoid

START = EulerStart((1.05, 0.0, 0.0), (2.5, 15.0, 4.0))
TIME = 12.0
CAPTION = (
    f"Path of z' on the unit sphere for {TIME:g} inverse shear rates from (θ, φ, ψ, θ̇, φ̇, ψ̇) = "
    "(1.05, 0, 0, 2.5, 15, 4) at St = ∞, in closed form; the dot is the start."
)
GENERAL, SYMMETRIC = Ellipsoid((1.0, 2.0, 2.3)), Ellipsoid((1.0, 1.0, 2.3))


def compute_top(ellipsoid: Ellipsoid, grid: Grid) -> Data:
    """Path of z', in the closed form, and the closed form against integration."""
    times = np.linspace(0.0, TIME, grid.of(2401, 601))
    scene = Scene(ellipsoid, inf, START, TIME)
    exact, integrated = (
        run_form(find_form("euler-top"), scene, times, 1e-14, solver=solver).observables
        for solver in ("exact", "taylor")
    )
    axis = exact.rotation[:, 2]
    size = float(np.linalg.norm(exact.angular_momentum[0]))
    nutation = np.arccos(axis @ exact.angular_momentum[0] / size)
    top = TorqueFree(ellipsoid.inertia, START.quaternion, START.angular_velocity)
    difference = np.max(np.abs(exact.rotation - integrated.rotation))
    drift = np.max(np.abs(exact.slow - exact.slow[0])) / np.max(np.abs(exact.slow[0]))
    return {
        "": {"t": times, "x": axis[:, 0], "y": axis[:, 1], "z": axis[:, 2], "nutation": nutation},
        "numbers": columns(
            "period precession_period difference drift momentum",
            [(top.period, top.precession_period, difference, drift, size)],
        ),
    }


def figure_top(data: Data) -> Figure:
    """Path of z' on the unit sphere."""
    figure, (axes,) = panels(1, 1, 4.4, 4.2, subplot_kw={"projection": "3d"})
    unit_sphere(axes)
    draw_on_sphere(axes, data[""], color=BLUE, linewidth=0.6)
    start = {name: column[:1] for name, column in data[""].items()}
    draw_on_sphere(axes, start, marker="o", color=VERMILLION, markersize=5, zorder=5)
    return figure


def verdict_general(data: Data) -> Verdict:
    """Nutation between two bounds, periods without a common one."""
    numbers, table = data["numbers"], data[""]
    ratio = float(numbers["precession_period"][0] / numbers["period"][0])
    denominators = np.arange(1, 13)
    distance = float(np.min(np.abs(ratio - np.rint(ratio * denominators) / denominators)))
    band = np.degrees([table["nutation"].min(), table["nutation"].max()])
    return Verdict(
        Word.CONFIRMED,
        f"The axis nutates between {band[0]:.1f}° and {band[1]:.1f}° from L with T = {numbers['period'][0]:.5g} and "
        f"precesses with T' = {numbers['precession_period'][0]:.5g}; T'/T = {ratio:.5f} is no simple fraction, so that "
        "the band fills.",
        CAPTION,
        Number("width of the band of nutation", float(band[1] - band[0]), low=1.0, unit="degrees"),
        Number("precession period T' over polhode period T", ratio, 0.01, 100.0),
        Number("distance of T'/T from the nearest fraction with a denominator up to 12", distance, low=1e-5),
        Number("closed form against integration, largest |Δt_ij|", float(numbers["difference"][0]), high=1e-10),
        Number("drift of L and E, relative", float(numbers["drift"][0]), high=1e-12),
    )


def verdict_symmetric(data: Data) -> Verdict:
    """No nutation, T' = 2πI_e/L."""
    numbers, nutation = data["numbers"], data[""]["nutation"]
    angle = float(np.degrees(nutation.mean()))
    azimuth = _azimuth(data)
    turns = float((azimuth[-1] - azimuth[0]) / (2 * pi))
    period = float(data[""]["t"][-1] / abs(turns))
    expected = 2 * pi * SYMMETRIC.inertia[0] / float(numbers["momentum"][0])
    return Verdict(
        Word.CONFIRMED,
        f"The axis describes a circle {angle:.1f}° from L, once in {period:.5g} = 2πI_e/L.",
        CAPTION,
        Number("variation of the nutation angle", float(np.ptp(nutation)), high=1e-6, unit="rad"),
        Number("relative difference of the measured period from 2πI_e/L", abs(period / expected - 1), high=1e-6),
        Number("closed form against integration, largest |Δt_ij|", float(numbers["difference"][0]), high=1e-10),
    )


def _azimuth(data: Data) -> np.ndarray:
    """Unwrapped angle of z' about L."""
    table = data[""]
    axis = np.column_stack([table["x"], table["y"], table["z"]])
    normal = np.cross(axis[0] - axis[len(axis) // 5], axis[0] - axis[len(axis) // 3])
    normal /= np.linalg.norm(normal)
    across = axis - np.outer(axis @ normal, normal)
    first = across[0] / np.linalg.norm(across[0])
    return np.unwrap(np.arctan2(across @ np.cross(normal, first), across @ first))


SECTION = Section(
    "limits",
    "Limiting cases: the Jeffery and the Euler top",
    (
        *ITEMS,
        Item(
            "euler-top",
            "Trajectory of a general Euler top",
            "Nutation and precession of (1, 2, 2.3) have incommensurate periods: the orientation vector fills a band.",
            lambda grid: compute_top(GENERAL, grid),
            figure_top,
            verdict_general,
        ),
        Item(
            "symmetric-top",
            "Trajectory of a symmetric Euler top",
            "The axis of κ = 2.3 describes a circle about L with the period 2πI_e/L.",
            lambda grid: compute_top(SYMMETRIC, grid),
            figure_top,
            verdict_symmetric,
        ),
    ),
)
