"""The page of `pick`: how it did on scenes held out, by the time of the best run; its tables and its figure.

`pick` ranks methods for a scene; `polhode.harness.answers.heldout` measures its first choice and all others. In
the tables `factor` is the ratio of the time of the first choice to the time of the best run. `met` says
whether the first choice met the requested error, or `pick` refused an error that no run met. A stratum has
the scenes whose best runs take times of one range (`heldout.STRATA`). `judged` gives each stratum a row:
`near` is the share of the first choices that met the error within `heldout.NEAR` times the best run,
`farthest` the largest factor.
"""

import re
from collections.abc import Sequence
from math import inf, nan
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from polhode.harness.analysis.frames import read_csv
from polhode.harness.answers import heldout
from polhode.harness.answers.heldout import Evaluation, break_even, judged
from polhode.harness.common.files import write_file
from polhode.harness.common.fits import wilson
from polhode.harness.common.machine import here, made_lines, provenance
from polhode.harness.pages.figures.style import (
    INK,
    caption,
    key,
    measured,
    panels,
    percent_axis,
    ramp,
    repeats_vary,
    save,
)
from polhode.harness.pages.stated import reasons
from polhode.harness.pages.tables import fill, lines_of

# Left end of the axis of errors over the one allowed. Smaller ones meet it by far: the figure leaves
# them out, so that there is room for those near 1. Chosen by eye.
_LEAST_ERROR_RATIO = 1e-4
# Times over the best, named on the axis: as many as stand beside each other without touching.
_TICKS = (1, 1.5, 3, 5, 10, 20, 50)
_FIGURE_HEIGHT = 2.9  # Inches; chosen by eye.


def write_page(folder: Path, evaluation: Evaluation, command: str) -> Path:
    """Write the page, its figure and its tables into a folder and return the page's path."""
    for name in ("scenes", "runs"):
        text = getattr(evaluation, name).to_csv(index=False, float_format="%.4g")
        write_file(folder / f"{name}.csv", text, summed=True)
    return _write(folder, evaluation, provenance(command, [here()]))


def _write(folder: Path, evaluation: Evaluation, made: Sequence[str]) -> Path:
    """Write the page and its figure; `made` says how the evaluation was made."""
    processor = measured(made) or "an unknown machine"
    factors = evaluation.scenes["factor"].replace(inf, nan).dropna()
    low, middle, high = (f"{factors.quantile(quarter):.3g}" for quarter in (0.25, 0.5, 0.75))
    vary = _repeats(evaluation.scenes)
    note = (
        f"{len(evaluation.scenes)} scenes held out; the best run is the quickest measured that met the "
        f"error, of tolerances by tens. Times: warm runs on {processor}; the best run and the first "
        f"choice in turns, the fastest of {heldout.FINALIST_REPEATS} (runs of "
        f"{heldout.TIMED_ONCE_FROM:g} s or more: one); {vary}. Spread over scenes: "
        f"quartiles of the time over that of the best run are {low}, {middle} and {high}."
    )
    save(_figure(evaluation.scenes, note), folder, "choices")
    rows: Any = evaluation.scenes.to_dict("records")
    missed = [row for row in rows if not (row["met"] and not row["factor"] > heldout.NEAR)]
    page = fill(
        "pick",
        made=made,
        summary=summary(evaluation.scenes),
        rows=judged(evaluation.scenes),
        repeats=vary,
        limits=heldout,
        missed=missed,
        left_out=reasons(evaluation.left_out.values()),
    )
    return write_file(folder / "README.md", page)


def _repeats(scenes: Any) -> str:
    """By how much the repeats of first choices and best runs differ, or that it was not kept."""
    vary = ""
    if "seconds_spread" in scenes:
        both = [scenes[["seconds", "seconds_spread"]]]
        # If the first choice is the best run, its repeats count once.
        others = scenes[scenes["choice"] != scenes["best"]]
        both.append(
            others[["best_seconds", "best_seconds_spread"]].set_axis(
                both[0].columns, axis="columns"
            )
        )
        timed = pd.concat(both)
        vary = repeats_vary(timed["seconds"], timed["seconds_spread"])
    return f"the repeats {vary}" if vary else "the spread of repeats was not kept"


def rewrite_page(folder: Path) -> Path:
    """Write page and figure anew from the tables in a folder; how they were made and what was left out stay.

    Raises ValueError if there is no page.
    """
    made = made_lines(folder / "README.md")
    page = (folder / "README.md").read_text(encoding="utf-8")
    left_out_words = re.search(r"Scenes without a reference were left out: (.*?)\.\n", page)
    scenes, runs = (read_csv(folder / f"{name}.csv") for name in ("scenes", "runs"))
    for column in ("refusal", "best"):
        scenes[column] = scenes[column].astype(object).where(scenes[column].notna(), "")
    # The page gives a count for each reason (`reasons`): made-up keys, all different, stand for the scenes.
    left_out = {}
    for counted_reason in left_out_words[1].split("; ") if left_out_words else ():
        count, _, reason = counted_reason.partition(" × ")
        left_out |= {f"{reason} {place}": reason for place in range(int(count))}
    return _write(folder, Evaluation(scenes, runs, left_out), made)


def summary(scenes: Any) -> list[str]:
    """The evaluation in sentences, each with its target.

    `scenes` is the table of `Evaluation`. Its columns `asking`, `seconds` and `plain` are in seconds:
    asking `pick`, its first choice, and plain practice (`polhode.harness.answers.timed`), which may have
    no answer.
    """
    timed = scenes.dropna(subset=["plain", "seconds"])
    spent = timed["asking"] + timed["seconds"]
    ratios = spent / timed["plain"]
    pays_from = break_even(scenes)
    longer = ratios[timed["best_seconds"] >= pays_from]
    quicker = int((longer < 1.0).sum())
    strata = judged(scenes)
    return lines_of(
        "pick-summary",
        limits=heldout,
        total=spent.sum() / timed["plain"].sum(),
        median=float(ratios.median()),
        plain=len(timed),
        count=len(scenes),
        met=int(scenes["met"].sum()),
        strata=[row for row in strata if row["stratum"] in heldout.STRATA],
        break_even=pays_from,
        quicker=quicker,
        longer=len(longer),
        share=wilson(quicker, len(longer)),
    )


def reached(scenes: Any) -> bool:
    """Whether the first choices reach the targets of `heldout` in each stratum: near the best, and none far from it.

    The target of asking does not count: `summary` names it.
    """
    rows = [row for row in judged(scenes) if row["stratum"] in heldout.STRATA]
    return all(row["near"] >= heldout.SHARE_NEAR and row["farthest"] <= heldout.FAR for row in rows)


def _figure(scenes: Any, note: str = "") -> Figure:
    """Shares of scenes by time over the best and by error over the one allowed, by the best run's time."""
    figure, grid = panels(1, 2, _FIGURE_HEIGHT, sharey=True)
    left, right = grid[0]
    groups = list(scenes.groupby(scenes["best_seconds"].map(heldout.stratum), sort=False))
    groups.sort(key=lambda group: group[1]["best_seconds"].min())
    handles = []
    # The quickest group is the darkest. There are three shades at least: one or two groups are dark.
    for (name, group), shade in zip(groups, ramp(max(3, len(groups)))[::-1], strict=False):
        error_ratios = group["error"] / group["error_requested"]
        for axes, ratios, limit in (
            (left, group["factor"], heldout.NEAR),
            (right, error_ratios, 1.0),
        ):
            # A scene without a ratio counts among the scenes: its line ends below 100 %.
            values = np.sort(ratios[(ratios > 0) & (ratios < inf)].to_numpy(float))
            share = np.arange(1, len(values) + 1) / len(group)
            axes.step(values, share, where="post", color=shade, linewidth=1.8)
            missed = values > limit
            # Circles at the edge of the panel stand out whole, and move nothing.
            style = {"marker": "o", "markersize": 6, "fillstyle": "none", "linewidth": 0}
            style |= {"clip_on": False, "in_layout": False}
            axes.plot(values[missed], share[missed], color=INK, zorder=3, **style)
        label = f"best run {name} ({len(group)} scenes)"
        handles.append(Line2D([], [], color=shade, linewidth=2, label=label))
    handles.append(
        Line2D(
            [], [], marker="o", fillstyle="none", color=INK, linewidth=0, label="beyond the line"
        )
    )
    left.axvline(heldout.NEAR, color=INK, linewidth=1.0)
    right.axvline(1.0, color=INK, linewidth=1.0)
    left.set(xscale="log", xlabel="time over that of the best run", ylabel="share of the scenes")
    percent_axis(left)
    largest = float(scenes["factor"].replace(inf, nan).max())
    # Up to 1.5 times the largest ratio, by eye; to 2 at least, so that 1 has a neighbour.
    ticks = [tick for tick in _TICKS if tick <= max(2, 1.5 * largest)]
    left.set_xticks(ticks, map(str, ticks))
    left.minorticks_off()
    right.set(xscale="log", xlabel="error over the one allowed")
    right.set_xlim(left=max(right.get_xlim()[0], _LEAST_ERROR_RATIO))
    key(figure, handles, 2)
    caption(figure, note)
    return figure
