"""Section "Spheroids" in the L_z–E plane: slow trajectories, and full ones beside them."""

from functools import partial

import numpy as np
from matplotlib.figure import Figure

from polhode.harness.paper.drawing import panels
from polhode.harness.paper.item import Data, Grid, Item, Number, Section, Verdict, Word
from polhode.harness.paper.planes import draw_frame, draw_paths, fixed_point, name_lines, name_points, plane_steps
from polhode.harness.paper.runs import spheroid
from polhode.harness.paper.sections.planes import Planes, end_numbers, plane_tables
from polhode.harness.paper.sections.spheroids.motion import ITEMS
from polhode.harness.paper.sections.spheroids.pinch import ITEM as PINCH
from polhode.harness.paper.sections.spheroids.projections import ITEMS as PROJECTIONS
from polhode.harness.paper.tables import groups

PROLATE = spheroid(2.0)
ON_EDGE = 0.16
PLANES = Planes(
    "κ",
    {kappa: spheroid(kappa) for kappa in (2.0, 3.33, 0.5, 0.3)},
    201,
    (
        ("difference of κ = 3.33 over that of 2, St = 1000", ((3.33, 2.0),), 1.2),
        ("difference of κ = 0.3 over that of 0.5, St = 1000", ((0.3, 0.5),), 1.0),
    ),
)


def compute_plane(grid: Grid) -> Data:
    """Slow trajectories from both edges of the plane, and from close to the pinch point."""
    shares = (0.001, 0.05, 0.15, 0.3, 0.5, 0.7, 0.85, 0.95, 0.999)
    starts = [(momentum, share) for momentum in (-1.1, -0.06, 1.1) for share in shares[:: grid.of(1, 4)]]
    starts += [(-1.1, 1.0), (-0.06, 1.0)]
    return plane_tables(PROLATE, starts, grid.of(2001, 601), ON_EDGE, partial(plane_steps, count=150))


def figure_plane(data: Data) -> Figure:
    """The plane with all its trajectories."""
    figure, (axes,) = panels(1, 1, 6.0, 4.2)
    draw_frame(axes, PROLATE, -1.0, 1.0)
    draw_paths(axes, data[""], (0.6, 0.2))
    axes.set_ylim(0.0, 0.8)
    name_points(axes, {"stable node": "stable node (tumbling)", "saddle": "saddle (spinning)"})
    name_lines(axes, PROLATE, "$L_z^2 = 2EI_a$ and $L_z^2 = 2EI_e$")
    axes.legend(loc="upper center")
    return figure


def verdict_plane(data: Data) -> Verdict:
    """Where the trajectories end."""
    reached, pinch = end_numbers(data["ends"])
    on_edge = data["ends"]["share"] == 1.0
    last = [part["Lz"][-1] for number, part in groups(data[""], "path") if on_edge[int(number)]]
    from_saddle = float(np.max(np.abs(np.array(last) - fixed_point(PROLATE, "saddle")[0])))
    count = len(np.unique(data[""]["path"]))
    return Verdict(
        Word.CORRECTED,
        "Every start with L_z < 0 off the upper parabola reaches the node, those on it reach the saddle. Starts with "
        f"L_z > 0 meet the pinch point in a finite slow time, at most {pinch.value:.2g} of the bound L_z/(4π min X). "
        "The saddle lies at (I_a/I_e)(-1/2, 1/8); the caption prints the node's place for it.",
        f"L_z–E plane of a prolate spheroid, κ = 2, with {count} slow trajectories of L_x = L_y = 0; I_max = I_e.",
        reached,
        Number("distance from the saddle where starts on the upper parabola end", from_saddle, high=2e-3, unit="I_max"),
        pinch,
    )


SECTION = Section(
    "spheroids",
    "Spheroids at large St",
    (
        *ITEMS[:2],
        Item(
            "spheroid-plane",
            "The L_z–E plane of a spheroid",
            "With L_x = L_y = 0 and L_z < 0 almost all slow trajectories converge to the tumbling node of κ = 2; the "
            "upper parabola is the stable manifold of the saddle, which the caption puts at (-1/2, 1/8); from L_z > 0 "
            "they grind to a halt at the pinch point.",
            compute_plane,
            figure_plane,
            verdict_plane,
        ),
        PINCH,
        Item.of(
            PLANES,
            "spheroid-planes",
            "Full and slow trajectories of four spheroids",
            "For a given St the deviation from the slow trajectories decreases as κ approaches one, and with growing "
            "St; κ = 3.33 at St = 1000 shows the largest oscillations.",
        ),
        ITEMS[2],
        *PROJECTIONS,
    ),
)
