"""Plots of one motion: functions that draw on Matplotlib axes and return them.

Points of a picture are three numbers: right, up and towards the eye, in units of the longest
semi-axis. Looks and sizes without a reason are chosen by eye.
"""

from math import cos, sin

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

from polhode.harness.solution import SceneSolution
from polhode.models.flow import Flow
from polhode.models.observables import completed

# Colours of the slow variables: told apart by colour-blind readers, with a contrast of 3 or more on white.
SLOW_COLOURS = {"Lx": "#B87A00", "Ly": "#3D8BC4", "Lz": "#0A3A63", "E": "#B0255C"}
# The view is the one of the page of motions, `harness/site/motion.js`.
TURN = 0.45  # Rad: round the gradient axis.
TILT = 0.3  # Rad: then down on it.
_LIGHT = np.array([-0.5, 0.6, 0.62])  # Direction to the light: right, up, towards the eye.
# Strengths of the light from everywhere and of the light from `_LIGHT`; both are chosen by eye.
_LIGHT_FROM_EVERYWHERE = 0.35
_LIGHT_FROM_ONE_SIDE = 0.75
# Faces of the body's surface along a meridian and along a parallel: 5 degrees each, smooth at its size.
_PARALLELS = 36
_MERIDIANS = 72
# Share of the faces along a meridian that the coloured caps take at each end of the longest axis, rounded up.
_CAP = 0.14
# Colours of the surface, as shares of red, green and blue: the halves show the spin, the caps the axis.
_ONE_HALF = (0.47, 0.65, 0.80)
_OTHER_HALF = (0.63, 0.76, 0.88)
_CAPS = (0.84, 0.37, 0.0)
_INK = "#5b6470"
_SIDE = 1.75  # Inches of the picture of a body, which is a square.
# Arrows of the flow stand on two lines at this x, between these y: beside a body, which reaches 1. In units
# of the longest semi-axis, as lengths of arrows are for a velocity of 1.
_ARROWS_AT = 1.25
_ARROWS_TO = 1.2
_ARROWS = 7  # On either line.
_ARROW_LENGTH = 0.38
# The gradient of simple shear, shape (3, 3).
_SHEAR = np.array(Flow.shear().gradient)


def slow_variables(
    axes: Axes, solution: SceneSolution, *, names: tuple[str, ...] = ("Lx", "Ly", "Lz", "E")
) -> Axes:
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
        label = f"${name[0]}_{name[1]}$" if len(name) > 1 else f"${name}$"
        values = frame[name] / max(solution.scene.ellipsoid.inertia)
        axes.plot(
            frame["t2" if slow else "t"],
            values,
            color=SLOW_COLOURS[name],
            linewidth=1.1,
            label=label,
        )
    time = "slow time $t_2 = t/\\mathrm{St}$" if slow else "time, in inverse shear rates"
    axes.set(xlabel=time, ylabel="L and E over $I_{max}$")
    axes.grid(True, linewidth=0.4, alpha=0.5)
    return axes


def tumbling(solution: SceneSolution) -> Figure:
    """One picture for each sample of a solution that knows the orientation, from left to right.

    Between arrows of the flow at that time stands the body; the title has the time in inverse shear rates.
    """
    count = len(solution.times)
    drawing, row = plt.subplots(1, count, figsize=(_SIDE * count, _SIDE), squeeze=False)
    ellipsoid = solution.scene.ellipsoid
    semi_axes = np.array(ellipsoid.semi_axes) / max(ellipsoid.semi_axes)
    # A form may know the symmetry axis of a spheroid alone.
    full_rotations = completed(ellipsoid, solution.rotation)
    flow = solution.scene.flow or Flow.shear()
    for axes, time, rotation in zip(
        row[0],
        solution.times,
        solution.rotation if full_rotations is None else full_rotations,
        strict=True,
    ):
        body(axes, semi_axes, rotation, flow.gradient_at(float(time)))
        axes.set_title(f"$t$ = {time:.3g}", fontsize=9, color=_INK, y=0.0)
    drawing.subplots_adjust(left=0, right=1, bottom=0.02, top=1, wspace=0)
    return drawing


def off_plane(flow: Flow, times: np.ndarray) -> bool:
    """Whether the gradient along z, of which `body` draws nothing, differs from zero at one of the times."""
    return any(np.any(np.asarray(flow.gradient_at(float(time)))[:, 2]) for time in times)


def body(
    axes: Axes, semi_axes: np.ndarray, rotation: np.ndarray, gradient: np.ndarray = _SHEAR
) -> Axes:
    """Draw an ellipsoid between arrows of the flow of a gradient.

    Parameters
    ----------
    axes : matplotlib.axes.Axes
    semi_axes : array of shape (3,)
        Over the longest one.
    rotation : array of shape (3, 3)
        Its rows are the body's axes in space.
    gradient : array of shape (3, 3)
        Velocities are the gradient times the place; by default that of simple shear.
    """
    # Parallels and meridians lie about the longest axis. `roll` brings the third component of `unit`, along
    # the poles, to the place of that axis.
    pole = int(np.argmax(semi_axes))
    polar, around = np.meshgrid(
        np.linspace(0, np.pi, _PARALLELS + 1), np.linspace(0, 2 * np.pi, _MERIDIANS + 1)
    )
    unit = np.stack(
        [np.sin(polar) * np.cos(around), np.sin(polar) * np.sin(around), np.cos(polar)], axis=-1
    )
    unit = np.roll(unit, pole + 1, axis=-1)
    corners = _project((unit * semi_axes) @ rotation)
    # The normal of x²/a² + y²/b² + z²/c² = 1 goes along (x/a², y/b², z/c²), and `unit` is (x/a, y/b, z/c).
    normals = _project((unit / semi_axes) @ rotation)
    faces = _faces(corners)
    normal = _faces(normals).sum(axis=1)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    # Each face lies between two meridians and two parallels.
    meridian, parallel = np.indices((_MERIDIANS, _PARALLELS)).reshape(2, -1)
    cap = np.minimum(parallel, _PARALLELS - 1 - parallel) < _CAP * _PARALLELS
    halves = np.where(meridian[:, None] < _MERIDIANS // 2, _ONE_HALF, _OTHER_HALF)
    tint = np.where(cap[:, None], _CAPS, halves)
    light = _LIGHT_FROM_EVERYWHERE + _LIGHT_FROM_ONE_SIDE * np.maximum(0, normal @ _LIGHT)
    shade = np.minimum(1, tint * light[:, None])
    faces_viewer = normal[:, 2] > 0
    _draw_flow(axes, gradient)
    # Edges in the face's own colour close the gaps between faces.
    look = {"facecolors": shade[faces_viewer], "edgecolors": shade[faces_viewer], "linewidths": 0.3}
    axes.add_collection(PolyCollection(list(faces[faces_viewer][:, :, :2]), **look))
    # The body reaches 1, the lines of arrows 1.25, and the arrows of shear 0.46 beyond them.
    axes.set(xlim=(-1.75, 1.75), ylim=(-1.6, 1.6), aspect="equal")
    axes.axis("off")
    return axes


def _draw_flow(axes: Axes, gradient: np.ndarray) -> None:
    """Draw arrows of the velocity of a flow along two lines beside the body."""
    for x in (-_ARROWS_AT, _ARROWS_AT):
        ends = _project(np.array([[x, -_ARROWS_AT, 0], [x, _ARROWS_AT, 0]]))
        axes.plot(ends[:, 0], ends[:, 1], color=_INK, linewidth=0.6, alpha=0.5)
        for y in np.linspace(-_ARROWS_TO, _ARROWS_TO, _ARROWS):
            place = np.array([x, y, 0.0])
            tail, tip = _project(np.array([place, place + _ARROW_LENGTH * (gradient @ place)]))
            style = {
                "arrowstyle": "->",
                "color": _INK,
                "lw": 0.7,
                "alpha": 0.6,
                "shrinkA": 0,
                "shrinkB": 0,
            }
            axes.annotate("", tip[:2], tail[:2], arrowprops=style)


def _faces(points: np.ndarray) -> np.ndarray:
    """Corners of every face of the mesh, shape (faces, 4, 3), of its points, (meridians, parallels, 3)."""
    first = slice(None, -1)
    later = slice(1, None)
    corners = [
        points[i, j] for i, j in ((first, first), (first, later), (later, later), (later, first))
    ]
    return np.stack(corners, axis=2).reshape(-1, 4, 3)


def _project(points: np.ndarray) -> np.ndarray:
    """Points in space, shape (…, 3), as right, up and towards the eye: y is up before the eye looks down."""
    x, y, z = np.moveaxis(points, -1, 0)
    right = cos(TURN) * x - sin(TURN) * z
    depth = sin(TURN) * x + cos(TURN) * z
    return np.stack(
        [right, cos(TILT) * y - sin(TILT) * depth, sin(TILT) * y + cos(TILT) * depth], axis=-1
    )
