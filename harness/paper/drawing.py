"""How the figures of the reproduction look: one style, one palette, panels with labels and units."""

import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from cycler import cycler
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from PIL import Image

from polhode.harness.common.files import write_file
from polhode.harness.pages.figures.style import few_colours, power
from polhode.harness.paper.item import Table
from polhode.harness.paper.tables import groups

# Okabe and Ito's palette, safe for colour-blind readers.
BLACK, ORANGE, SKY, GREEN, BLUE, VERMILLION, PURPLE, YELLOW = (
    "#000000", "#E69F00", "#56B4E9", "#009E73", "#0072B2", "#D55E00", "#CC79A7", "#F0E442",
)  # fmt: skip
CYCLE = (BLUE, ORANGE, GREEN, VERMILLION, PURPLE, SKY, BLACK)
# Of full runs at several St, in turn; the planes, which have three at most, keep green for a line of their own.
RUNS = (BLUE, ORANGE, VERMILLION, GREEN)
AVERAGED = BLACK
BOUND = "0.55"
NODE = PURPLE
FORMATS = ("png", "svg")
RESOLUTION = 150
STYLE: dict[Any, Any] = tomllib.loads(Path(__file__).with_name("drawing.toml").read_text("utf-8"))


@contextmanager
def style() -> Iterator[None]:
    """Matplotlib with the settings of the reproduction, whatever the user's own are."""
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update({**STYLE, "axes.prop_cycle": cycler(color=CYCLE)})  # pyright: ignore
        yield


def panels(rows: int, columns: int, width: float = 3.5, height: float = 2.7, **options: Any) -> tuple[Figure, list]:
    """A figure of equal panels, and its axes in reading order."""
    figure = Figure(figsize=(width * columns, height * rows), layout="constrained")
    grid = figure.subplots(rows, columns, squeeze=False, **options)
    return figure, list(grid.flat)


def label(axes: Axes, x: str, y: str, title: str = "", log: str = "", **limits: Any) -> Axes:
    """Label axes, whose units belong into the labels; those named in `log` are logarithmic, with powers of ten."""
    axes.set(xlabel=x, ylabel=y, title=title, **{f"{side}scale": "log" for side in log}, **limits)
    return axes


def common_legend(figure: Figure, axes: Axes, columns: int = 4) -> None:
    """One legend below all panels, from the entries of one of them."""
    handles, names = axes.get_legend_handles_labels()
    figure.legend(handles, names, loc="outside lower center", ncols=columns)


def legend_in(empty: Axes, axes: Axes) -> None:
    """Fill empty axes with the legend of others."""
    empty.axis("off")
    empty.legend(*axes.get_legend_handles_labels(), loc="center")


def unit_sphere(axes: Axes) -> Axes:
    """Prepare three-dimensional axes for paths on the unit sphere."""
    u, v = np.meshgrid(np.linspace(0, 2 * np.pi, 25), np.linspace(0, np.pi, 13))
    axes.computed_zorder = False  # pyright: ignore[reportAttributeAccessIssue]
    axes.plot_wireframe(  # pyright: ignore[reportAttributeAccessIssue]
        np.cos(u) * np.sin(v), np.sin(u) * np.sin(v), np.cos(v), color="0.85", linewidth=0.4, zorder=0
    )
    axes.set_box_aspect((1, 1, 1))  # pyright: ignore[reportArgumentType]
    axes.set(xlabel="flow $x$", ylabel="gradient $y$", zlabel="vorticity $z$", xticks=(-1, 0, 1), yticks=(-1, 0, 1))
    axes.set_zticks((-1, 0, 1))  # pyright: ignore[reportAttributeAccessIssue]
    axes.grid(visible=False)
    return axes


def draw_on_sphere(axes: Axes, path: Table, **style: Any) -> None:
    """Draw a path with columns x, y, z."""
    axes.plot(*(path[name] for name in "xyz"), **style)


def styled_runs(
    table: Table, key: str, widths: tuple[float, float] = (1.4, 0.7)
) -> Iterator[tuple[dict[str, Any], Table]]:
    """Line style and rows of every run by St, ∞ for the averaged one, on top; widths of averaged and full runs."""
    full = 0
    for stokes, part in groups(table, key):
        if np.isinf(stokes):
            yield {"color": AVERAGED, "label": "averaged", "linewidth": widths[0], "zorder": 5}, part
        else:
            label_ = f"full, St = {power(stokes)}"
            yield {"color": RUNS[full], "label": label_, "linewidth": widths[1], "zorder": 3 + 0.1 * full}, part
            full += 1


def draw_broken(axes: Axes, table: Table, x: str, y: str, key: str = "path", **style: Any) -> None:
    """Draw the paths of a table as one line with gaps, so that they share one entry of the legend."""
    parts = [(part[x], part[y]) for _, part in groups(table, key)]
    gap = np.array([np.nan])
    columns = [np.concatenate([piece for part in parts for piece in (part[side], gap)]) for side in (0, 1)]
    axes.plot(*columns, **style)


def draw_law(axes: Axes, x: np.ndarray, y: float, slope: float, line: str = ":", **style: Any) -> None:
    """Draw a power law that has the value y at the last of the points x; its exponent stands in the legend."""
    chosen = {"color": BLACK, "linestyle": line, "label": f"slope {slope:.3g}", **style}
    axes.plot(x, y * (x / x[-1]) ** slope, **chosen)


def save(figure: Figure, folder: Path, name: str) -> None:
    """Save a figure; the same figure gives the same files. Few colours keep the PNG small."""
    for ending in FORMATS:
        drawn = BytesIO()
        metadata = {"Date": None} if ending == "svg" else {"Software": None}
        figure.savefig(drawn, format=ending, dpi=RESOLUTION, metadata=metadata)
        if ending == "png":
            with Image.open(drawn) as image:
                drawn = BytesIO()
                few_colours(image.convert("RGB")).save(drawn, "png", optimize=True)
        write_file(folder / f"{name}.{ending}", drawn.getvalue())
