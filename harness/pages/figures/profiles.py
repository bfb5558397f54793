"""Robust or fast: performance profiles, and the share of all targets reached within a time.

A problem is a scene, a Stokes number and an error to be reached. Profiles: E. D. Dolan and J. J. Moré, Benchmarking
optimization software with performance profiles, Math. Program. 91 (2002); shares within a time: N. Hansen et al.,
COCO, Optim. Methods Softw. 36 (2021).
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from polhode.harness.analysis.frames import by_scene, by_stokes
from polhode.harness.analysis.pareto import MAP_TARGETS as TARGETS, cost, front, methods
from polhode.harness.pages.figures.style import looks
from polhode.harness.pages.figures.work_precision import name_lines, save
from polhode.harness.pages.tables import fill

# Factors over the fastest shown, and the one that the sentence is about.
LARGEST_FACTOR, NEAR = 1000.0, 2.0
# Methods that the figure names, those that are fast and sure; the others are grey.
NAMED = 7


def times(table: pd.DataFrame, error: str = "slow_error") -> pd.DataFrame:
    """Seconds to each error, NaN without: a row for each problem that somebody solves, a column for each method."""
    rows = []
    for _, own in by_scene(table):
        for _, runs in by_stokes(own):
            fronts = [(method.label, front(each, error)) for method, each in methods(runs)]
            for target in TARGETS:
                row: dict[str, float] = {}
                for label, points in fronts:
                    row[label] = float(np.fmin(row.get(label, np.nan), cost(points, target)))
                rows.append(row)
    return pd.DataFrame(rows).dropna(how="all")


def profile_lines(
    table: pd.DataFrame, folder: Path, name: str = "profiles", title: str = "Robust or fast"
) -> list[str]:
    """Save the figure into a folder; what a page says about it, nothing where nobody solves anything."""
    found = times(table)
    if found.empty:
        return []
    save(profiles(found), folder, name)
    return [fill("profiles", of=name, title=title, sentence=sentence(found), first=TARGETS[0], last=TARGETS[-1])]


def sentence(found: pd.DataFrame) -> str:
    """Who is seldom far from the fastest, and who gets there most often."""
    ratios = found.div(found.min(axis=1), axis=0)
    near, reached = (ratios <= NEAR).mean(), found.notna().mean()
    first, surest = str(near.idxmax()), str(reached.idxmax())
    slow = np.nanquantile(ratios[surest].to_numpy(float), 0.9)
    shares = {"near": near[first], "reached": reached[surest], "factor": NEAR, "slow": slow}
    return fill("profiles-sentence", count=len(found), first=first, surest=surest, **shares)


def profiles(found: pd.DataFrame) -> Figure:
    """The share of problems solved within a factor of the fastest, and within a time."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(9.8, 4.0), sharey=True)
    ratios = found.div(found.min(axis=1), axis=0)
    fastest, longest = (float(end) for end in (np.nanmin(found.to_numpy(float)), np.nanmax(found.to_numpy(float))))
    near = (ratios <= NEAR).mean() + found.notna().mean()
    named = set(near.sort_values(ascending=False).index[:NAMED])
    for name, look in looks(map(str, found)).items():
        for axes, values, end in ((left, ratios[name], LARGEST_FACTOR), (right, found[name], longest * 1.1)):
            points = np.sort(values.dropna().to_numpy(float))
            points = points[points <= end]
            shares = np.arange(1, len(points) + 1) / len(found)
            points, shares = np.append(points, end), np.append(shares, shares[-1] if len(shares) else 0.0)
            style = {} if name in named else {"alpha": 0.5, "zorder": 1}
            axes.step(points, shares, where="post", color=look.colour, linewidth=1.6, label=name, **style)
    left.set(xlim=(1, LARGEST_FACTOR), ylim=(0, 1.02))
    right.set_xlim(fastest / 1.1, longest * 1.1)
    for axes, label in ((left, "time over that of the fastest"), (right, "wall time of a warm run, s")):
        axes.set_xscale("log")
        axes.set_xlabel(label, fontsize=11)
        axes.grid(True, linewidth=0.4, alpha=0.5)
    left.set_ylabel("share of the problems solved", fontsize=11)
    figure.subplots_adjust(left=0.07, right=0.8, bottom=0.14, top=0.97, wspace=0.74)
    for axes in (left, right):
        name_lines(axes)
    return figure
