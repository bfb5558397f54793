"""The page and the figures of a work-precision study of one's own problem.

A `study` is a `polhode.harness.work_precision.WorkPrecision`, its `frame` a row for each solver and
tolerance. A study `over` a parameter has a further study for each value of it.
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

# The error of the figure of times over a parameter.
_DRAWN_ERROR = 1e-6


def title(study: Any) -> str:
    """Problem and tolerances, as a figure names them."""
    loosest = max(study.tolerances)
    tightest = min(study.tolerances)
    span = f"{loosest:g}" if loosest == tightest else f"{loosest:g} to {tightest:g}"
    return f"{study.name}, rtol {span}"


def _as_scenes(frame: pd.DataFrame) -> pd.DataFrame:
    """The frame with the columns that runs of scenes have, as the figures read them."""
    names = {"error": "slow_error", "uncertainty": "slow_uncertainty"}
    return frame.rename(columns=names).assign(form="")


def draw(axes: Axes, frame: pd.DataFrame, study: Any) -> Axes:
    """Wall time against error of a study's rows."""
    work_precision(axes, _as_scenes(frame))
    _name_failures(axes)
    axes.xaxis.set_inverted(True)
    kind = "relative" if study.relative else "absolute"
    words = {"max": "largest", "final": "final", "L2": "root mean square"}[study.error]
    axes.set(
        xlabel=f"{words} {kind} error; more accurate to the right",
        ylabel="wall time of a warm run, s",
    )
    axes.set_title(title(study), fontsize=11, loc="left", pad=15)
    return axes


def _name_failures(axes: Axes) -> None:
    """Give a legend the hollow marker of each solver that has runs without a result, once."""
    named = set()
    for line in axes.get_lines():
        label = str(line.get_label())
        if label.endswith(NO_RESULT) and label not in named:
            named.add(label)
            line.set_label(label.removeprefix("_"))


def draw_over(axes: Axes, frame: pd.DataFrame, study: Any, target: float) -> Axes:
    """The time of every solver to an error, against the study's parameter."""
    name, *more_parameters = study.over
    if more_parameters:
        raise ValueError(f"over: got {', '.join(study.over)}, expected one parameter to draw along")
    table = over_table(frame, name, target)
    for solver, look in looks(table.columns).items():
        style: dict[str, Any] = {"color": look.colour, "marker": look.marker, "markersize": 5}
        axes.plot(table.index.to_numpy(float), table[solver].to_numpy(float), label=solver, **style)
    values = table.index.to_numpy(float)
    spread = len(values) > 1 and (values > 0).all() and values.max() > 10 * values.min()
    axes.set(xscale="log" if spread else "linear", yscale="log", xlabel=name)
    axes.set_ylabel(f"wall time to an error of {target:g}, s")
    axes.grid(True, which="major", linewidth=0.4, alpha=0.5)
    axes.set_title(f"{title(study)}, over {name}", fontsize=11, loc="left", pad=15)
    return axes


def panels_of(groups: Sequence[tuple[str, pd.DataFrame]], note: str = "") -> Figure:
    """One panel for each title and frame, with one key; `note` stands below."""
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
    how = [f"- Relative tolerances: {', '.join(f'{one:g}' for one in study.tolerances)}."]
    how += [f"- Absolute tolerance: {settings['atol']}."]
    how += [f"- Error: {settings['error']}, at {study.samples} times."]
    for point, one in study.studies:
        values = ", ".join(f"{name} = {value:g}: " for name, value in point.items())
        how += [f"- Reference: {values}{_source(one)}."]
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
    """Lines of the page of a study over parameters, whose figures are saved: a panel for each point.

    Times over one parameter are drawn and tabulated too.
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
        figure = plt.figure(figsize=(8, 4.5))
        axes = draw_over(figure.gca(), frame, study, _DRAWN_ERROR)
        axes.legend(fontsize=8, loc="upper left", bbox_to_anchor=(1.01, 1))
        figure.tight_layout()
        save(figure, folder, "over")
        lines += ["", "![Time over the parameter](over.png)"]
    groups = [(title(one), one.frame) for _, one in study.studies]
    save(panels_of(groups, note), folder, "work-precision")
    return [*lines, "", "![Work and precision](work-precision.png)", ""]


def _time(seconds: float) -> str:
    """A time in words, or a dash where the solver does not reach the error."""
    return duration(seconds) if np.isfinite(seconds) else "–"


def _fastest(frame: pd.DataFrame) -> list[str]:
    """Who is the fastest at each error, and the next one."""
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
        doubtful = row["error"] is not None and not row["known"]
        status = str(row["status"])
        times = (
            "–" if row[name] is None else duration(row[name])
            for name in ("seconds", "compile_seconds")
        )
        values = [f"{row[name]:g}" for name in over]
        calls = "–" if row["rhs_calls"] is None else str(int(row["rhs_calls"]))
        error += " (not known)" if doubtful else ""
        values += [str(row["solver"]), f"{row['tolerance']:g}", status, error]
        rows.append([*values, *times, calls])
    return [markdown(head, rows), *_reasons(frame)]


def _reasons(frame: pd.DataFrame) -> list[str]:
    """Why runs failed, each reason once."""
    failed = where(frame, frame["status"] != Status.REACHED_END)
    reasons: dict[str, list[str]] = {}
    for row in rows_of(failed):
        reason = f"{row['solver']}, {row['status']}: {row['message']}"
        reasons.setdefault(reason, []).append(f"{row['tolerance']:g}")
    if not reasons:
        return []
    lines = (f"- {reason} (rtol {', '.join(at)})" for reason, at in reasons.items())
    return ["", "## What failed", "", *lines]
