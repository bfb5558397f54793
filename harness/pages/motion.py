"""Plots of one motion: functions that draw on Matplotlib axes and return them."""

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from polhode.harness.api import SceneSolution

# Okabe and Ito's palette, safe for colour-blind readers.
COLOURS = {"Lx": "#E69F00", "Ly": "#56B4E9", "Lz": "#0072B2", "E": "#D55E00"}


def slow_variables(
    axes: "Axes", solution: "SceneSolution", *, names: tuple[str, ...] = ("Lx", "Ly", "Lz", "E")
) -> "Axes":
    """Draw L and E over I_max against slow time t₂, or against time where there is no slow time.

    Parameters
    ----------
    axes : matplotlib.axes.Axes
    solution : SceneSolution
    names : tuple of str
        Some of Lx, Ly, Lz, E.
    """
    frame = solution.frame()
    slow = 0 < solution.scene.stokes < np.inf
    for name in names:
        axes.plot(
            frame["t2" if slow else "t"],
            frame[name] / max(solution.scene.ellipsoid.inertia),
            color=COLOURS[name],
            linewidth=1.1,
            label=f"${name[0]}_{name[1]}$" if len(name) > 1 else f"${name}$",
        )
    axes.set_xlabel("slow time $t_2 = t/\\mathrm{St}$" if slow else "time, in inverse shear rates")
    axes.set_ylabel("L and E over $I_{max}$")
    axes.grid(True, linewidth=0.4, alpha=0.5)
    return axes


def energy_plane(axes: "Axes", solution: "SceneSolution") -> "Axes":
    """Draw E against L_z, both over I_max, between the parabolas E = L²/2I of the extreme moments of inertia.

    A motion with L along the vorticity stays between them; where L_x and L_y are large it lies above the lower one.
    """
    inertia = solution.scene.ellipsoid.inertia
    size = max(inertia)
    momentum, energy = solution.angular_momentum[:, 2] / size, solution.energy / size
    axes.plot(momentum, energy, color=COLOURS["Lz"], linewidth=0.9)
    axes.plot(momentum[:1], energy[:1], marker="o", color=COLOURS["Lz"], linestyle="none", label="start")
    low, high = axes.get_xlim()
    grid = np.linspace(min(low, 0.0), max(high, 0.0), 201)
    for moment, dash in ((min(inertia), "--"), (max(inertia), ":")):
        axes.plot(grid, grid**2 / 2 * size / moment, color="0.5", linewidth=0.8, linestyle=dash)
    axes.set_ylim(0, 1.1 * float(np.max(energy)))
    axes.set_xlabel("$L_z/I_{max}$")
    axes.set_ylabel("$E/I_{max}$")
    return axes
