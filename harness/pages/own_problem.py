"""The page and the figures of a work-precision study of one's own problem.

A `study` is a `polhode.harness.work_precision.WorkPrecision`, its `frame` has a row for each solver and
tolerance. A study `over` parameters has a further study for each point: a value of each parameter.
Its `frame` has the rows of them all, with a column for each parameter. `studies` lists these points with
their studies; without parameters it has the study itself, at a point without values.
"""

from collections.abc import Sequence
from datetime import UTC, datetime
from operator import itemgetter
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from polhode.harness.analysis.equal_error import STUDY_TARGETS, over_table, seconds_to
from polhode.harness.analysis.frames import rows_of, where
from polhode.harness.common.files import write_file
from polhode.harness.common.machine import provenance, surroundings_of
from polhode.harness.common.text import duration, in_two_digits, markdown, scientific, short
from polhode.harness.pages.figures.style import looks, measured, save
from polhode.harness.pages.figures.work_precision import (
    NO_RESULT,
    conditions,
    panels,
    work_precision,
)
from polhode.harness.pages.tables import folded
from polhode.solvers.contract import Status

# The error of the figure of times over a parameter, between the loose and tight ones of `STUDY_TARGETS`,
# which the tables have. A choice.
_DRAWN_ERROR = 1e-6
# Points of the titles of figures, by eye, and from a title down to its panel: room for the hollow markers
# of runs without a result.
_TITLE = 11
_TITLE_DISTANCE = 15
# The figure of times over a parameter, with its legend at the right: inches, and points of its letters.
# Chosen by eye.
_OVER_SIZE = (8, 4.5)
_LEGEND_LETTERS = 8
# Values of a parameter that span more than this factor are drawn on a logarithmic axis. A choice.
_LOGARITHMIC_FROM = 10


def title(study: Any) -> str:
    """Problem and tolerances, as a figure names them."""
    loosest = max(study.tolerances)
    tightest = min(study.tolerances)
    span = f"{loosest:g}" if loosest == tightest else f"{loosest:g} to {tightest:g}"
    return f"{study.name}, rtol {span}"


def _as_scenes(frame: pd.DataFrame) -> pd.DataFrame:
    """The frame with the columns that runs of scenes have, as the figures read them; its form has no name."""
    names = {"error": "slow_error", "uncertainty": "slow_uncertainty"}
    return frame.rename(columns=names).assign(form="")


def draw(axes: Axes, frame: pd.DataFrame, study: Any) -> Axes:
    """Draw wall time against error of a study's rows on `axes`, which are returned."""
    work_precision(axes, _as_scenes(frame))
    _name_failures(axes)
    axes.xaxis.set_inverted(True)
    kind = "relative" if study.relative else "absolute"
    words = {"max": "largest", "final": "final", "L2": "root mean square"}[study.error]
    axes.set(
        xlabel=f"{words} {kind} error; more accurate to the right",
        ylabel="wall time of a warm run, s",
    )
    axes.set_title(title(study), fontsize=_TITLE, loc="left", pad=_TITLE_DISTANCE)
    return axes


def _name_failures(axes: Axes) -> None:
    """Let a legend name the hollow marker of each solver that has runs without a result, once.

    A legend leaves out labels that begin with "_", as the labels of all hollow markers do.
    """
    named = set()
    for line in axes.get_lines():
        label = str(line.get_label())
        if label.endswith(NO_RESULT) and label not in named:
            named.add(label)
            line.set_label(label.removeprefix("_"))


def draw_over(axes: Axes, frame: pd.DataFrame, study: Any, target: float) -> Axes:
    """Draw the time of every solver to the error `target` against the study's parameter; returns `axes`.

    Raises
    ------
    ValueError
        The study is over several parameters.
    """
    name, *more_parameters = study.over
    if more_parameters:
        raise ValueError(f"over: got {', '.join(study.over)}, expected one parameter to draw along")
    table = over_table(frame, name, target)
    for solver, look in looks(table.columns).items():
        style: dict[str, Any] = {"color": look.colour, "marker": look.marker, "markersize": 5}
        axes.plot(table.index.to_numpy(float), table[solver].to_numpy(float), label=solver, **style)
    values = table.index.to_numpy(float)
    logarithmic = (
        len(values) > 1 and (values > 0).all() and values.max() > _LOGARITHMIC_FROM * values.min()
    )
    axes.set(xscale="log" if logarithmic else "linear", yscale="log", xlabel=name)
    axes.set_ylabel(f"wall time to an error of {target:g}, s")
    axes.grid(True, which="major", linewidth=0.4, alpha=0.5)
    words = f"{title(study)}, over {name}"
    axes.set_title(words, fontsize=_TITLE, loc="left", pad=_TITLE_DISTANCE)
    return axes


def panels_of(groups: Sequence[tuple[str, pd.DataFrame]], note: str = "") -> Figure:
    """A figure with one panel for each title and frame, and one key; `note` stands below."""
    drawn = [(words, _as_scenes(frame)) for words, frame in groups]
    return panels(drawn, "slow_error", "error", alike=False, note=note)


def write_page(study: Any, folder: Path, command: str) -> Path:
    """Write page, figures, `runs.csv` and `runs.json` into a folder; return the page's path."""
    folder.mkdir(parents=True, exist_ok=True)
    study.to_csv(folder / "runs.csv")
    study.to_json(folder / "runs.json")
    settings = study.settings()
    frame = study.frame
    record = surroundings_of(settings)
    record["date"] = datetime.now(UTC).isoformat()
    made = provenance(command or "WorkPrecision.write", [record])
    note = conditions(frame, measured(made))
    lines = [f"# {title(study)}", ""]
    if study.over:
        lines += _over_lines(study, frame, folder, note)
    else:
        lines += [*_fastest(frame), ""]
        if frame["seconds"].notna().any():
            figure = panels_of([(title(study), frame)], note)
            save(figure, folder, "work-precision")
            lines += ["![Work and precision](work-precision.png)", ""]
    lines += ["## Every run", "", *_runs(frame, list(study.over)), ""]
    tolerances = ", ".join(f"{tolerance:g}" for tolerance in study.tolerances)
    how = [
        f"- Relative tolerances: {tolerances}.",
        f"- Absolute tolerance: {settings['atol']}.",
        f"- Error: {settings['error']}, at {study.samples} times.",
    ]
    for point, point_study in study.studies:
        values = ", ".join(f"{name} = {value:g}: " for name, value in point.items())
        how.append(f"- Reference: {values}{_source(point_study)}.")
    lines += [folded([*how, "", *made])]
    return write_file(folder / "README.md", "\n".join(lines) + "\n")


def _source(study: Any) -> str:
    """The source of a study's reference, and its uncertainty if that is known."""
    settings = study.settings()
    uncertainty = study.frame["uncertainty"].dropna()
    if uncertainty.empty:
        return str(settings["reference"])
    return f"{settings['reference']}; uncertainty {short(float(uncertainty.iloc[0]))}"


def _over_lines(study: Any, frame: pd.DataFrame, folder: Path, note: str) -> list[str]:
    """Lines of the page of a study over parameters; saves its figures.

    One figure has a panel for each point. Times over a single parameter have a figure and tables too.
    """
    lines = []
    if len(study.over) == 1:
        (name,) = study.over
        for target in STUDY_TARGETS:
            table = over_table(frame, name, target)
            if table.dropna(how="all").empty:
                continue
            lines += ["", f"## Time to an error of {short(target)}", ""]
            rows = []
            for value, row in zip(table.index, table.to_numpy(float), strict=True):
                rows.append([f"{value:g}", *map(_time, row)])
            lines += [markdown([name, *table.columns], rows)]
        figure = plt.figure(figsize=_OVER_SIZE)
        axes = draw_over(figure.gca(), frame, study, _DRAWN_ERROR)
        # Beside the panel, a hundredth of its width away.
        axes.legend(fontsize=_LEGEND_LETTERS, loc="upper left", bbox_to_anchor=(1.01, 1))
        figure.tight_layout()
        save(figure, folder, "over")
        lines += ["", "![Time over the parameter](over.png)"]
    groups = [(title(point_study), point_study.frame) for _, point_study in study.studies]
    save(panels_of(groups, note), folder, "work-precision")
    return [*lines, "", "![Work and precision](work-precision.png)", ""]


def _time(seconds: float) -> str:
    """A time in words, or a dash where the solver does not reach the error."""
    return duration(seconds) if np.isfinite(seconds) else "–"


def _fastest(frame: pd.DataFrame) -> list[str]:
    """A table of who is the fastest at each error, and the next one; a sentence where nobody reaches any."""
    rows = []
    for target in STUDY_TARGETS:
        ranked = sorted(seconds_to(frame, target).items(), key=itemgetter(1))
        if not ranked:
            continue
        solver, seconds = ranked[0]
        second = "–"
        if len(ranked) > 1:
            next_solver, next_seconds = ranked[1]
            second = f"{next_solver}, {in_two_digits(next_seconds / seconds)} × as long"
        rows.append([short(target), solver, duration(seconds), second])
    if not rows:
        return ["No solver reaches an error that the reference knows."]
    return [markdown(["error", "fastest", "time", "next"], rows)]


def _runs(frame: pd.DataFrame, over: list[str]) -> list[str]:
    """A table of all runs, and the reasons of failures; `over` names the parameters of the study."""
    head = [*over, "solver", "rtol", "status", "error", "time", "compilation", "right-hand sides"]
    rows = []
    for row in rows_of(frame):
        error = "–" if row["error"] is None else scientific(row["error"])
        if row["error"] is not None and not row["known"]:
            error += " (not known)"
        times = (
            "–" if row[name] is None else duration(row[name])
            for name in ("seconds", "compile_seconds")
        )
        calls = "–" if row["rhs_calls"] is None else str(int(row["rhs_calls"]))
        values = [f"{row[name]:g}" for name in over]
        run = [str(row["solver"]), f"{row['tolerance']:g}", str(row["status"]), error]
        rows.append([*values, *run, *times, calls])
    return [markdown(head, rows), *_reasons(frame)]


def _reasons(frame: pd.DataFrame) -> list[str]:
    """Why runs failed, each reason once."""
    failed = where(frame, frame["status"] != Status.REACHED_END)
    # By reason the tolerances at which it stopped a run.
    reasons: dict[str, list[str]] = {}
    for row in rows_of(failed):
        reason = f"{row['solver']}, {row['status']}: {row['message']}"
        reasons.setdefault(reason, []).append(f"{row['tolerance']:g}")
    if not reasons:
        return []
    lines = (f"- {reason} (rtol {', '.join(rtols)})" for reason, rtols in reasons.items())
    return ["", "## What failed", "", *lines]
