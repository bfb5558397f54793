"""Section "Limiting cases": the Jeffery top's sections, and the Euler top's trajectories in closed form."""

from dataclasses import dataclass
from math import inf, pi

import numpy as np

from polhode.harness.paper.item import Computed, Grid, Table
from polhode.harness.paper.runs import run_form
from polhode.models.catalogue import form as find_form
from polhode.models.free_top.torque_free import TorqueFree
from polhode.models.scene import EulerStart, Scene
from polhode.models.shape import Ellipsoid

START = EulerStart((1.05, 0.0, 0.0), (2.5, 15.0, 4.0))
TIME = 12.0
# Turns of the precession in which the path must not close. The nutation has half the period of the polhode.
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
        yield "", {"t": times, "x": axis[:, 0], "y": axis[:, 1], "z": axis[:, 2], "nutation": nutation}
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
