"""Plots of one motion: functions that draw on Matplotlib axes and return them."""

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from polhode.harness.solution import SceneSolution

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
