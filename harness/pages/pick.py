"""The page of `pick`: how it did on scenes held out, by the time of the best run; its tables and its figure."""

from collections import Counter
from math import inf
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np

from polhode.harness.answers import heldout
from polhode.harness.answers.heldout import Evaluation, break_even, judged
from polhode.harness.common.files import write_file
from polhode.harness.common.machine import machine
from polhode.harness.pages.figures.work_precision import save
from polhode.harness.pages.tables import fill, lines_of

# Times over the best, named on the axis.
_TICKS = (1, 1.5, 2, 3, 5, 10, 20, 50)
_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7")


def write_page(folder: Path, evaluation: Evaluation, command: str) -> Path:
    """Write the page, its figure and its tables into a folder and return the page's path."""
    for name in ("scenes", "runs"):
        text = getattr(evaluation, name).to_csv(index=False, float_format="%.4g")
        write_file(folder / f"{name}.csv", text, summed=True)
    _write_figure(folder, evaluation.scenes)
    rows: Any = evaluation.scenes.to_dict("records")
    missed = [row for row in rows if not (row["met"] and not row["factor"] > heldout.NEAR)]
    left_out = Counter(evaluation.left_out.values()).most_common()
    page = fill(
        "pick",
        command=command,
        summary=summary(evaluation.scenes),
        rows=judged(evaluation.scenes),
        limits=heldout,
        missed=missed,
        left_out="; ".join(f"{count} × {reason}" for reason, count in left_out),
        processor=machine()["processor"],
    )
    return write_file(folder / "README.md", page)


def summary(scenes: Any) -> list[str]:
    """The evaluation in sentences, each with its target."""
    timed = scenes.dropna(subset=["plain", "seconds"])
    strata = judged(scenes)
    return lines_of(
        "pick-summary",
        limits=heldout,
        total=(timed["asking"] + timed["seconds"]).sum() / timed["plain"].sum(),
        plain=len(timed),
        count=len(scenes),
        met=int(scenes["met"].sum()),
        strata=[row for row in strata if row["stratum"] in heldout.STRATA],
        break_even=break_even(scenes),
    )


def reached(scenes: Any) -> bool:
    """Whether first choices are as near the best, in each stratum, as they are to be."""
    rows = [row for row in judged(scenes) if row["stratum"] in heldout.STRATA]
    return all(row["near"] >= heldout.SHARE_NEAR and row["farthest"] <= heldout.FAR for row in rows)


def _write_figure(folder: Path, scenes: Any) -> None:
    """Write `choices.png`: shares of scenes by time over the best, and by error over the one requested."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(8.0, 3.6))
    groups = scenes.groupby(scenes["best_seconds"].map(heldout.stratum), sort=False)
    for (name, mine), colour in zip(groups, _COLOURS, strict=False):
        for axes, values in (
            (left, mine["factor"]),
            (right, mine["error"] / mine["error_requested"]),
        ):
            values = np.sort(values[(values > 0) & (values < inf)])
            if len(values):
                share = np.arange(1, len(values) + 1) / len(mine)
                label = f"{name} ({len(mine)})"
                axes.step(values, share, where="post", color=colour, label=label)
    left.axvline(heldout.NEAR, color="0.3", linewidth=0.8, linestyle=":")
    right.axvline(1.0, color="0.3", linewidth=0.8)
    left.set(xscale="log", xlabel="time over the best measured", ylabel="share of scenes")
    left.set_xticks(_TICKS, map(str, _TICKS))
    left.minorticks_off()
    right.set(xscale="log", xlabel="error over the one requested")
    left.legend(frameon=False, title="best run", fontsize="small")
    figure.tight_layout()
    save(figure, folder, "choices")
