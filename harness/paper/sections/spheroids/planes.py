"""Slow motion of a spheroid: the L_z–E plane, L–E planes, and projections for finite L_x and L_y."""

from functools import partial
from itertools import product
from math import sqrt

import numpy as np
from matplotlib.figure import Figure

from polhode.harness.paper import planes
from polhode.harness.paper.drawing import BLACK, BOUND, CYCLE, common_legend, draw_broken, label, panels
from polhode.harness.paper.item import Computed, Data, Grid
from polhode.harness.paper.runs import graded, slow_run, spheroid
from polhode.harness.paper.sections.planes import plane_tables
from polhode.harness.paper.tables import groups
from polhode.models.theory.fixed_points import fixed_points

PROLATE = spheroid(2.0)
RATIOS = (0.1, 1.0, 10.0)


def compute_l_planes(grid: Grid) -> Computed:
    """Slow trajectories with L_x = 0 or L_y = 0 and several ratios of L_xy to L_z, of either sign."""
    slow_times = graded(1.0, 1201)
    shares = grid.of((0.05, 0.3, 0.6, 0.9), (0.3, 0.9))
    for path, (zero, ratio, sign, share) in enumerate(product((0, 1), RATIOS, (-1.0, 1.0), shares)):
        start = np.array([0.0, 0.0, sign / sqrt(1 + ratio**2), planes.energy_at(PROLATE, 1.0, share)])
        start[1 - zero] = ratio / sqrt(1 + ratio**2)
        slow = slow_run(PROLATE, start.tolist(), slow_times).slow
        momentum, labels = np.linalg.norm(slow[:, :3], axis=1), {"zero": zero, "ratio": sign * ratio}
        yield "", {**labels, "path": path, **_thinned({"L": momentum, "E": slow[:, 3]})}
        distance = planes.distance_from_node(PROLATE, slow[-1])
        yield "ends", {**labels, "share": share, "distance": distance, "smallest": momentum.min()}


def figure_l_planes(data: Data) -> Figure:
    """L–E planes, E as its share between the bounds: L_x = 0 beside L_y = 0, starts with L_z < 0 over L_z > 0."""
    figure, axes = panels(2, 2, 3.9, 2.6)
    most = max(PROLATE.inertia) / min(PROLATE.inertia)
    both = ((zero, part, sign) for sign in (-1.0, 1.0) for zero, part in groups(data[""], "zero"))
    for own, (zero, part, sign) in zip(axes, both, strict=True):
        for color, wanted in zip(CYCLE, RATIOS, strict=False):
            chosen = part[part.ratio == sign * wanted]
            # E as its share between the bounds.
            chosen.E = (2 * chosen.E / chosen.L**2 - 1) / (most - 1)
            draw_broken(own, chosen, "L", "E", color=color, linewidth=1.1, label=f"$L_{{xy}}/|L_z|$ = {wanted:g}")
            starts = [[path.L[0], path.E[0]] for _, path in groups(chosen, "path")]
            own.plot(*np.transpose(starts), "o", color=color, markersize=3)
        for point in fixed_points(PROLATE):
            along, energy = planes.place_of(PROLATE, point)
            planes.draw_point(own, point.stability, (abs(along), (2 * energy / along**2 - 1) / (most - 1)))
        own.set(xlim=(0.0, 1.02), ylim=(-0.05, 1.05))
        title = f"$L_{'xy'[int(zero)]} = 0$, from $L_z {'<>'[sign > 0]} 0$"
        label(own, "$|L|/I_{max}$", "E, share between bounds", title)
    planes.name_points(axes[0], {"stable node": "stable node", "saddle": "saddle"})
    common_legend(figure, axes[0], 3)
    return figure


def _thinned(values: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """A path at even steps, so that few points draw it smoothly."""
    index = planes.even_steps(np.stack(list(values.values()), axis=1), 90)
    return {name: column[index] for name, column in values.items()}


ENERGIES = (2 / 9, 0.305, 0.472)
MOMENTUM = 2 / 3
AZIMUTHS = (0.0, 45.0, 90.0)


def compute_projections(grid: Grid) -> Computed:
    """Slow trajectories from |L| = 2I_e/3, three energies, all directions of L."""
    slow_times = graded(1.0, 1201)
    for number, (energy, cosine) in enumerate(product(ENERGIES, grid.of((-0.95, -0.5, 0.1, 0.6, 0.95), (-0.6, 0.6)))):
        found = []
        for path, azimuth in enumerate(AZIMUTHS, start=len(AZIMUTHS) * number):
            sine, angle = sqrt(1 - cosine**2), np.radians(azimuth)
            direction = np.array([sine * np.sin(angle), sine * np.cos(angle), cosine]) * MOMENTUM
            slow = slow_run(PROLATE, (*direction, energy), slow_times).slow
            found.append(np.linalg.norm(slow[:, :2], axis=1))
            values = {"Lz": slow[:, 2], "Lxy": found[-1], "E": slow[:, 3]}
            yield "", {"E0": energy, "azimuth": azimuth, "path": path, **_thinned(values)}
            distance = planes.distance_from_node(PROLATE, slow[-1])
            yield "ends", {"E0": energy, "cosine": cosine, "azimuth": azimuth, "distance": distance}
        low, middle, high = found
        outside = np.maximum(np.minimum(low, high) - middle, middle - np.maximum(low, high))
        # Up to rounding.
        share = np.mean(outside <= 1e-9)
        yield "between", {"E0": energy, "cosine": cosine, "share": share, "outside": outside.max()}


def figure_projections(data: Data) -> Figure:
    """Three rows: L_z–E and L_z–L_xy."""
    figure, axes = panels(3, 2, 3.9, 2.4)
    for row, (energy, part) in enumerate(groups(data[""], "E0")):
        left, right = axes[2 * row], axes[2 * row + 1]
        momentum = np.linspace(-0.7, 0.7, 101)
        left.plot(momentum, momentum**2 / 2, color=BOUND, linewidth=0.8)
        for color, (azimuth, own) in zip((CYCLE[0], BLACK, CYCLE[1]), groups(part, "azimuth"), strict=True):
            text = {0.0: "$L_{x0} = 0$", 45.0: "$L_{x0} = L_{y0}$", 90.0: "$L_{y0} = 0$"}[azimuth]
            for axes_, name in ((left, "E"), (right, "Lxy")):
                draw_broken(axes_, own, "Lz", name, color=color, linewidth=0.8, label=text)
        momentum_, energy_ = planes.fixed_point(PROLATE, "stable node")
        planes.draw_point(left, "stable node", (momentum_, energy_))
        planes.draw_point(right, "stable node", (momentum_, 0.0))
        left.set_ylim(0.0, 1.1 * energy)
        label(left, "$L_z/I_{max}$", "$E/I_{max}$", f"$E_0/I_e$ = {energy:.3f}")
        label(right, "$L_z/I_{max}$", r"$\sqrt{L_x^2+L_y^2}/I_{max}$")
    planes.name_points(axes[0], {"stable node": "stable node"})
    common_legend(figure, axes[0])
    return figure


ON_EDGE = 0.16


def compute_plane(grid: Grid) -> Computed:
    """Slow trajectories from both edges of the plane, and from close to the pinch point."""
    shares = (0.001, 0.05, 0.15, 0.3, 0.5, 0.7, 0.85, 0.95, 0.999)
    starts = [(momentum, share) for momentum in (-1.1, -0.06, 1.1) for share in shares[:: grid.of(1, 4)]]
    starts += [(-1.1, 1.0), (-0.06, 1.0)]
    return plane_tables(PROLATE, starts, grid.of(2001, 601), ON_EDGE, partial(planes.plane_steps, count=150))


def figure_plane(data: Data) -> Figure:
    """The plane with all its trajectories."""
    figure, (axes,) = panels(1, 1, 6.0, 4.2)
    planes.draw_frame(axes, PROLATE, -1.0, 1.0)
    planes.draw_paths(axes, data[""], (0.6, 0.2))
    axes.set_ylim(0.0, 0.8)
    planes.name_points(axes, {"stable node": "stable node (tumbling)", "saddle": "saddle (spinning)"})
    planes.name_lines(axes, PROLATE, "$L_z^2 = 2EI_a$ and $L_z^2 = 2EI_e$")
    axes.legend(loc="upper center")
    return figure
