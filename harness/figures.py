"""Figures: functions that draw on Matplotlib axes and return them."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import pandas as pd

from polhode.harness.tables import where
from polhode.models.catalogue import form as find_form
from polhode.solvers.catalogue import solver as find_solver

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Okabe and Ito's palette, safe for colour-blind readers: a colour tells the library, and whether the method is
# implicit; a marker tells the method.
EXPLICIT = {"heyoka": "#000000", "CyRK": "#0072B2", "SciPy": "#D55E00", "SUNDIALS": "#009E73", "closed form": "#999999"}
IMPLICIT = {**EXPLICIT, "CyRK": "#56B4E9", "SciPy": "#E69F00"}
AVERAGED = "#CC79A7"
# Runs beyond this error have failed, whatever their status; they stay in the table.
LARGEST_ERROR = 10.0
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "<")


def library_of(solver: str) -> str:
    """Library of a catalogue name, as figures call it."""
    if solver.startswith("cyrk-"):
        return "CyRK"
    if solver == "ida" or solver.startswith("cvode-"):
        return "SUNDIALS"
    return {"taylor": "heyoka", "exact": "closed form"}.get(solver, "SciPy")


def work_precision(axes: "Axes", runs: pd.DataFrame, error: str = "slow_error") -> "Axes":
    """Draw cost against error of all runs of one scene; averaged forms by their cheapest runs and their model error.

    Parameters
    ----------
    axes : matplotlib.axes.Axes
    runs : DataFrame
        Records of one scene (`polhode.harness.tables.frame`).
    error : str
        Column to draw along x.
    """
    done = where(runs, runs["seconds"].notna() & runs[error].notna())
    counts: dict[str, int] = {}
    for solver in dict.fromkeys(runs["solver"]):
        library = library_of(solver)
        marker = MARKERS[counts.get(library, 0) % len(MARKERS)]
        counts[library] = counts.get(library, 0) + 1
        for form in dict.fromkeys(done["form"]):
            own = where(done, (done["solver"] == solver) & (done["form"] == form))
            if own.empty or find_form(form).averaged:
                continue
            x, y = own[error].to_numpy(float), own["seconds"].to_numpy(float)
            color = (IMPLICIT if find_solver(solver).implicit else EXPLICIT)[library]
            axes.plot(x, y, marker=marker, markersize=4.5, linewidth=1.1, color=color, label=solver)
    for form in dict.fromkeys(done["form"]):
        if find_form(form).averaged:
            _averaged(axes, where(done, done["form"] == form), form, error)
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.grid(True, which="major", linewidth=0.4, alpha=0.5)
    return axes


def _averaged(axes: "Axes", runs: pd.DataFrame, form: str, error: str) -> None:
    front = pareto_front(runs, error)
    x, y = front[error].to_numpy(float), front["seconds"].to_numpy(float)
    axes.plot(x, y, marker="*", markersize=9, linewidth=0, color=AVERAGED, label=f"{form} form, cheapest runs")
    model = runs[error.replace("_error", "").join(["model_", "_error"])].dropna()
    if not model.empty:
        label = f"{form} form, model error"
        axes.axvline(float(model.iloc[0]), color=AVERAGED, linewidth=1.0, linestyle=":", label=label)


def pareto_front(runs: pd.DataFrame, error: str = "slow_error") -> pd.DataFrame:
    """The runs that no other run beats in both time and error, from the fastest to the most accurate."""
    ordered = runs.sort_values(by=["seconds", error])
    return where(ordered, ordered[error].astype(float).cummin().diff().fillna(-1.0) < 0)


def mark_too_slow(axes: "Axes", runs: pd.DataFrame) -> None:
    """List at the top of the axes the methods of which some runs were stopped, with the tolerance from which on."""
    stopped = where(runs, runs["status"].isin(["time_limit", "step_limit"]))
    names = [
        f"{solver} {stopped.loc[stopped['solver'] == solver, 'tolerance'].max():.0e}"
        for solver in dict.fromkeys(stopped["solver"])
    ]
    if names:
        lines = [",  ".join(names[i : i + 4]) for i in range(0, len(names), 4)]
        text = "stopped at the time limit, from this tolerance on:\n" + "\n".join(lines)
        axes.text(0.02, 0.98, text, transform=axes.transAxes, va="top", ha="left", fontsize=6, color="0.35")


def work_precision_panels(records: pd.DataFrame, error: str, label: str) -> "Figure":
    """One panel of `work_precision` per St, with a common legend."""
    import matplotlib.pyplot as plt

    groups = list(records.groupby("stokes", sort=True))
    columns = 2 if len(groups) > 1 else 1
    lines = -(-len(groups) // columns)
    figure, grid = plt.subplots(
        lines, columns, figsize=(5.2 * columns + 2.0, 3.9 * lines), sharex=True, sharey=True, squeeze=False
    )
    for axes, (stokes, runs) in zip(grid.flat, groups, strict=False):
        work_precision(axes, runs, error)
        mark_too_slow(axes, runs)
        axes.set_title(f"St = {stokes:g}", fontsize=10)
    for axes in grid.flat[len(groups) :]:
        axes.set_visible(False)
    values = records[error].dropna().to_numpy(float)
    values = values[(values > 0) & (values < LARGEST_ERROR)]
    if values.size:
        grid[0, 0].set_xlim(values.max() * 3, values.min() / 3)
        grid[0, 0].set_ylim(top=10 * records["seconds"].dropna().to_numpy(float).max())
    for axes in grid[-1]:
        axes.set_xlabel(f"{label}; more accurate to the right")
    for axes in grid[:, 0]:
        axes.set_ylabel("wall time of a warm run, s")
    entries = {
        name: handle for axes in grid.flat for handle, name in zip(*axes.get_legend_handles_labels(), strict=True)
    }
    figure.legend(
        list(entries.values()), list(entries), loc="center left", bbox_to_anchor=(0.815, 0.5), frameon=False, fontsize=8
    )
    figure.tight_layout(rect=(0, 0, 0.815, 1))
    return figure


def save(figure: "Figure", folder: Path, name: str, formats: Sequence[str] = ("png",)) -> None:
    """Save a figure and close it."""
    import matplotlib.pyplot as plt

    for ending in formats:
        figure.savefig(folder / f"{name}.{ending}", dpi=150)
    plt.close(figure)
