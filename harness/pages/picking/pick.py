"""The pages of `pick`: how it did on scenes held out, beside other rules, and what stated errors are worth; CSVs."""

from collections import Counter
from collections.abc import Iterable
from math import inf
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from polhode.harness.calibration.evaluation import CHEAP, FACTOR, MEETS, PREDICTED, Evaluation
from polhode.harness.calibration.selection import CUTOFF, PENALTY, PICK, pays_from, scores, write_aslib
from polhode.harness.calibration.stated import judged
from polhode.harness.common.files import write_file
from polhode.harness.common.text import duration, markdown
from polhode.harness.pages.figures.work_precision import save
from polhode.harness.picking.laws import Laws
from polhode.harness.picking.second_look import BOUNDED, LEAST, SHARE

COLOURS = {"short": "#0072B2", "long": "#D55E00"}
SCORES = {"scenes": "d", "par10": ".2f", "solved": ".1%", "within": ".1%", "above": ".1%", "gap_closed": ".3f"}
SCORES_HEADER = ["stratum", "way", "scenes", "PAR10", "solved", "within 1.5", "above 5", "gap closed"]


def write_pages(folder: Path, laws: Laws, evaluation: Evaluation, command: str) -> Path:
    """Write the page, its figures and its tables into a folder and return the page's path."""
    folder.mkdir(parents=True, exist_ok=True)
    tables = {"laws": _law_frame(laws), "scenes": evaluation.scenes, "runs": evaluation.runs, "ways": evaluation.ways}
    for name, table in tables.items():
        if table is not None:
            write_file(folder / f"{name}.csv", table.to_csv(index=False, float_format="%.4g"), summed=True)
    if evaluation.ways is not None:
        write_aslib(folder / "aslib", evaluation.questions, evaluation.ways)
    _write_figures(folder, evaluation)
    page = folder / "README.md"
    write_file(page, "\n".join(_lines(laws, evaluation, command)))
    return page


def summary(evaluation: Evaluation) -> list[str]:
    """The evaluation in sentences, each with its target."""
    count, shares = len(evaluation.scenes), evaluation.shares
    refused = sum(scene["refusal"] != "" for scene in evaluation.scenes.to_dict("records"))
    lines = [
        f"The first choice met the error on {shares['met']:.1%} of {count} held-out scenes (target: {MEETS:.1%}).",
        f"It cost at most {FACTOR:g} times the best measured choice on {shares['cheap']:.1%} (target: {CHEAP:.0%}); "
        f"the dearest one cost {evaluation.scenes['factor'].max():.2g} times the best (target: 5).",
        f"The cost laws predicted {shares['predicted']:.1%} of {len(evaluation.runs)} held-out times "
        f"within a factor {FACTOR:g} (target: {PREDICTED:.0%}) after correcting for the machine's speed; "
        f"{shares['predicted as timed']:.1%} as timed.",
        f"The slow error stayed below the upper end of its interval in {shares['bounded']:.1%} of the runs "
        "(target: 97.5%).",
    ]
    if evaluation.ways is not None:
        table: Any = scores(evaluation.ways)
        gaps = [f"{row.gap_closed:.3f} ({row.stratum})" for row in table[table["way"] == PICK].itertuples()]
        lines.append(
            f"It closes {', '.join(gaps)} of the gap from the single best way to the virtual best (target: 0.95)."
        )
    if refused:
        lines.append(
            f"{refused} requests were refused as not attainable; they count as met if no measured run met them."
        )
    if evaluation.left_out:
        lines.append(f"Other scenes were drawn instead of some: {_counted(evaluation.left_out.values())}.")
    return lines


def _counted(reasons: Iterable[str]) -> str:
    return "; ".join(f"{count} × {reason}" for reason, count in Counter(reasons).most_common())


def _lines(laws: Laws, evaluation: Evaluation, command: str) -> list[str]:
    source = laws.source
    missed = [f"- {each['scene']}: {each['miss']}." for each in evaluation.scenes.to_dict("records") if each["miss"]]
    return [
        "# How good `pick` is on scenes that it has not seen",
        "",
        f"Made by `{command}`. Do not edit: the next run overwrites this page.",
        "",
        *(f"- {sentence}" for sentence in summary(evaluation)),
        "",
        *_selection(evaluation),
        "## Misses",
        "",
        *(missed or ["None."]),
        "",
        "## Each scene, each run",
        "",
        "![Error and cost of the first choice on each held-out scene](choices.png)",
        "",
        "![Measured over predicted times and errors of the held-out runs](predicted.png)",
        "",
        f"The laws were fitted on {source['records']} runs of {source['scenes']} random scenes, on "
        f"{source.get('machine', {}).get('processor', 'an unnamed processor')}; these scenes are from other seeds. The "
        "best measured choice is the cheapest of all runs that met the error: compiled solvers on every form that "
        "accepts the scene, at tolerances by tens, and the first choice itself, except combinations that cannot win. "
        "The five cheapest and the first choice were then timed once more, in turns; these times are compared. "
        "A fixed piece of arithmetic, timed before every batch of runs, measures the machine's speed.",
        "",
        "[scenes.csv](scenes.csv) holds a row for each scene, [runs.csv](runs.csv) for each run that the laws "
        "predicted, [ways.csv](ways.csv) for each way of each scene, [laws.csv](laws.csv) the laws' parameters with "
        "95 % intervals (`harness/picking/laws.py` says what each means).",
        "",
    ]


def _selection(evaluation: Evaluation) -> list[str]:
    """`pick` beside the virtual best, the single best and simple rules, per stratum."""
    if evaluation.ways is None:
        return []
    rows = [
        [row["stratum"], row["way"], *(format(row[name], style) for name, style in SCORES.items())]
        for row in scores(evaluation.ways).to_dict("records")
    ]
    scenes: Any = evaluation.scenes
    pays = pays_from(scenes, evaluation.ways)
    from_which = f"for runs that take the single best {duration(pays)} or more" if pays < inf else "for no run here"
    return [
        "## Against the best, the single best and simple rules",
        "",
        markdown(SCORES_HEADER, rows, right=range(2, 8)),
        "Times over that of the virtual best, the quickest way measured that met the error on a scene; a way that "
        f"missed it, or took more than {CUTOFF:g} times as long, counts {PENALTY * CUTOFF:g} (PAR10). The single best "
        "is the form, solver and power of ten from the error to the tolerance with the least PAR10; the gap closed is "
        "0 for it and 1 for the virtual best. [aslib/](aslib/) holds the scenario in ASlib's format.",
        "",
        f"Asking `pick` takes {duration(scenes['pick_seconds'].median())} in the median, with everything compiled. "
        f"That pays {from_which}.",
        "",
    ]


def _law_frame(laws: Laws) -> pd.DataFrame:
    rows = []
    for law in laws.methods.values():
        for kind, one in {"cost": law.cost, **law.errors}.items():
            for name, (low, high) in one.intervals.items():
                rows.append((law.form, law.solver, kind, one.records, name, getattr(one, name), low, high))
    return pd.DataFrame(rows, columns=["form", "solver", "law", "runs", "parameter", "value", "low", "high"])


def _write_figures(folder: Path, evaluation: Evaluation) -> None:
    """Write `choices.png`, a point for each scene, and `predicted.png`, one for each run, into a folder."""
    import matplotlib.pyplot as plt

    scenes: Any = evaluation.scenes
    figure, axes = plt.subplots(figsize=(8.0, 4.2))
    for stratum, mine in scenes.groupby("stratum"):
        shown = mine[(mine["factor"] < inf) & (mine["error"] > 0)]
        axes.loglog(shown["error"] / shown["error_asked"], shown["factor"], "o", color=COLOURS[stratum], label=stratum)
    axes.axvline(1.0, color="0.3", linewidth=0.8)
    axes.axhline(FACTOR, color="0.3", linewidth=0.8, linestyle=":")
    axes.set(title="First choices: error met left of the line, near the best below the dots")
    axes.set(xlabel="error over the one asked for", ylabel="time over the best measured")
    axes.legend(frameon=False, title="stratum")
    figure.tight_layout()
    save(figure, folder, "choices")

    runs: Any = evaluation.runs
    figure, (left, right) = plt.subplots(1, 2, figsize=(8.0, 4.0))
    panels = (left, "seconds", "seconds_at_usual_pace", "s", FACTOR), (right, "slow_error", "slow_error", "I_max", 10.0)
    for axes, what, measured, unit, band in panels:
        known = runs[(runs[measured] > 0) & (runs[f"{what}_predicted"] > 0)]
        predicted, ratio = known[f"{what}_predicted"], known[measured] / known[f"{what}_predicted"]
        axes.loglog(predicted, ratio, ".", markersize=2, alpha=0.4, color="#0072B2", rasterized=True)
        for line, style in ((1.0, "-"), (band, ":"), (1 / band, ":")):
            axes.axhline(line, color="0.2", linewidth=0.9, linestyle=style)
        within = np.mean(np.abs(np.log(ratio)) <= np.log(band)) if len(ratio) else 1.0
        name = "times" if what == "seconds" else "slow errors"
        axes.set(title=f"{within:.0%} of {name} within {band:g} ×")
        axes.set(xlabel=f"predicted, {unit}", ylabel="measured over predicted")
    figure.tight_layout()
    save(figure, folder, "predicted")


def write_stated(folder: Path, runs: pd.DataFrame, command: str) -> Path:
    """Write the page of the errors that `solve` states, and its table."""
    write_file(folder / "stated.csv", runs.to_csv(index=False, float_format="%.4g"), summed=True)
    rows = []
    for (stratum, solver), mine in [
        *(((stratum, "all"), mine) for stratum, mine in runs.groupby("stratum")),
        *((("both", solver), mine) for solver, mine in runs.groupby("solver")),
    ]:
        found = judged(mine)
        shares = [f"{found[name]:.1%}" for name in ("stated", "bounded", "cheap")]
        rows.append([stratum, solver, found["runs"], *shares, f"{found['factor']:.2g}"])
    header = ["stratum", "solver", "runs", "stated", "bounded", "in time", "stated over true, median"]
    lines = [
        "# The error that `solve` states",
        "",
        f"Made by `{command}`. Do not edit: the next run overwrites this page.",
        "",
        *(f"- {sentence}" for sentence in stated_summary(runs)),
        "",
        "Each run is a random scene by a random form, solver and tolerance, with a certified reference. Others "
        f"were left out: {_counted(runs.attrs['left_out']) or 'none'}. *In time*: the second look took no more than "
        "its share of the run, or than it may on a short one. Every run is in [stated.csv](stated.csv).",
        "",
        markdown(header, rows, right=range(2, 7)),
    ]
    page = folder / "stated.md"
    write_file(page, "\n".join(lines))
    return page


def stated_summary(runs: pd.DataFrame) -> list[str]:
    """What the errors stated are worth, in sentences."""
    found = judged(runs)
    return [
        f"The error stated bounds the true one in {found['bounded']:.1%} of {found['runs']} runs (target: "
        f"{BOUNDED:.1%}); {found['stated']:.1%} state one.",
        f"It is {found['factor']:.2g} times the true error in the median (target: at most 10).",
        f"The second look takes at most {SHARE:.0%} of the run, or {duration(LEAST)}, in {found['cheap']:.1%}.",
    ]
