"""Section "Triaxial ellipsoids" in three dimensions: slow trajectories with L_x = 0 or L_y = 0."""

from math import sqrt

import numpy as np
from matplotlib.figure import Figure

from polhode.harness.paper.drawing import BLACK, BLUE, BOUND, NODE, panels
from polhode.harness.paper.item import Data, Grid, Item, Number, Verdict, Word
from polhode.harness.paper.planes import distance_from_node, energy_at, place_of
from polhode.harness.paper.runs import graded, slow_run
from polhode.harness.paper.sections.ellipsoids.motion import ELLIPSOID
from polhode.harness.paper.tables import SLOW, groups, path_table
from polhode.models.theory.fixed_points import fixed_points


def compute_space(grid: Grid) -> Data:
    """One slow trajectory with L_x = 0 throughout and one with L_y = 0, and the fixed points."""
    slow_times = graded(1.0, grid.of(401, 101))
    paths = []
    for zero in (1, 0):
        slow = np.array([0.0, 0.0, -0.2, energy_at(ELLIPSOID, 1.0, 0.7)])
        slow[1 - zero] = sqrt(1 - 0.2**2)
        paths.append((zero, slow_times, slow_run(ELLIPSOID, slow.tolist(), slow_times).slow))
    return {"": path_table(paths)}


def figure_space(data: Data) -> Figure:
    """Two three-dimensional views with their projections."""
    figure, axes = panels(1, 2, 4.4, 3.5, subplot_kw={"projection": "3d"})
    for own, (zero, part) in zip(axes, groups(data[""], "path"), strict=True):
        name = "Lx" if zero == 1 else "Ly"
        u, v = np.meshgrid(np.linspace(0.0, 1.0, 16), np.linspace(-0.6, 0.6, 16))
        own.plot_wireframe(u, v, (u**2 + v**2) / 2, color=BOUND, linewidth=0.4)
        across, along, energy = part[name], part["Lz"], part["E"]
        own.plot(across, along, energy, color=BLUE, linewidth=1.6)
        bound, wall = (across**2 + along**2) / 2, np.full_like(energy, 0.6)
        for projection in ((across, along, bound), (0 * across, along, energy), (across, wall, energy)):
            own.plot(*projection, color=BLACK, linewidth=0.8)
        for point in fixed_points(ELLIPSOID):
            own.scatter(0.0, *place_of(ELLIPSOID, point), color=NODE, edgecolor=BLACK, s=25)
        own.set(xlabel=f"$L_{name[1]}/I_{{max}}$", ylabel="$L_z/I_{max}$", zlabel="$E/I_{max}$", ylim=(-0.6, 0.6))
        own.set_title(f"$L_{'xy'[int(zero)]} = 0$", y=1.0)
        own.view_init(22, 35)
        own.set_box_aspect((1, 1, 0.8), zoom=1.0)
    return figure


def verdict_space(data: Data) -> Verdict:
    """The subspaces are invariant; the trajectories end at the node."""
    paths = dict(groups(data[""], "path"))
    kept = [float(np.max(np.abs(part[SLOW[int(zero)]]))) for zero, part in paths.items()]
    last = np.array([[part[name][-1] for name in SLOW] for part in paths.values()])
    ends = distance_from_node(ELLIPSOID, last)
    numbers = (
        Number("largest |L_x| or |L_y| that starts at zero", max(kept), high=1e-14, unit="I_max"),
        Number("distance from the node at the end", float(ends.max()), high=1e-3, unit="I_max"),
    )
    sentence = (
        "A component L_x or L_y that is zero stays zero. The (L_x, L_z, E) space belongs to L_y = 0 and the other one "
        "to L_x = 0: the paper's text names them the other way round."
    )
    caption = (
        "Slow trajectories of (1, 0.8, 0.5) (blue) in the invariant subspaces L_y = 0 and L_x = 0, with projections "
        "(black) on the bounding surfaces, the paraboloid L² = 2EI₃ among them, and the fixed points."
    )
    return Verdict(Word.CORRECTED, sentence, numbers, caption)


ITEM = Item(
    "ellipsoid-space",
    "Projections on three dimensions",
    "If L_x or L_y is zero at the start it is zero for all times; starts with L_x = 0 move in (L_x, L_z, E), "
    "those with L_y = 0 in (L_y, L_z, E).",
    compute_space,
    figure_space,
    verdict_space,
)
