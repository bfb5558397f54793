"""The page of the main job: table, figures, verdict, all from the records."""

import json
from collections.abc import Iterable, Sequence
from math import isfinite
from pathlib import Path
from typing import Any

import pandas as pd

from polhode.harness.analysis.frames import by_scene, by_stokes, frame, where
from polhode.harness.analysis.winners import TARGETS, cheapest
from polhode.harness.common.files import write_file
from polhode.harness.common.machine import header
from polhode.harness.common.store import Record, export
from polhode.harness.common.text import bracketed, duration, markdown, scientific, short
from polhode.harness.pages.figures.work_precision import save, work_precision_panels
from polhode.harness.pages.verdict import averaged_costs, ties, verdict
from polhode.harness.references.uncertainty import BRACKETS, least_known, uncertainty_of
from polhode.harness.studies.study import Study
from polhode.models.files.scene_file import parse_scene, scene_table
from polhode.models.scene import Scene
from polhode.solvers.contract import Status

# By the name of their file: error, and label of its axis.
FIGURES = {
    "slow": ("slow_error", "slow error over $I_{max}$"),
    "orientation": ("orientation_error", "orientation error, rad"),
}
# Keys of a scene file's start, as the page calls them.
START = {
    "euler_angles": "(θ, φ, ψ) = {}",
    "euler_rates": "at the rates {}",
    "quaternion": "quaternion {}",
    "angular_velocity": "angular velocity {} in the body",
    "angular_momentum": "angular momentum {}",
    "energy": "energy {}",
}
# Preparing an integrator that was compiled before takes less than this, in seconds.
COMPILED = 0.02


def write_page(study: Study, records: Sequence[Record], folder: Path, command: str) -> Path:
    """Write the page, its figures and its data into a folder and return the page's path."""
    table = frame(records)
    folder.mkdir(parents=True, exist_ok=True)
    export(list(records), folder / "records.jsonl")
    pictures = []
    for i, (scene, runs) in enumerate(by_scene(table)):
        before = f"{scene}: " if scene else ""
        for name, (error, label) in FIGURES.items():
            if len(runs[error].dropna()):
                # The figures of the first scene have plain names.
                file = f"{name}-{scene}" if i else name
                save(work_precision_panels(runs, error, before + label), folder, file)
                pictures += [f"![{before}Wall time against {name} error, one panel per St]({file}.png)", ""]
    write_file(folder / "README.md", "\n".join(_lines(study, table, records, pictures, command)))
    return folder / "README.md"


def _lines(
    study: Study, table: pd.DataFrame, records: Sequence[Record], pictures: Sequence[str], command: str
) -> list[str]:
    return [
        *header(study.title, command, records),
        *_scenes(records),
        "## Verdict",
        "",
        *(f"- {sentence}" for sentence in [*verdict(table), *averaged_costs(table)]),
        "",
        *(line for scene, runs in by_scene(table) for line in _best(scene, runs)),
        "## Cost against error",
        "",
        *pictures,
        "## Every run",
        "",
        f"Times are the minimum of up to five warm runs in interleaved order, over {study.samples} samples; "
        "*first* is compilation, where it happened in this case; errors are maxima along the run; the slow error of an "
        "averaged form is split into solver error and model error; *RHS* counts every call of the vector field. "
        f"{BRACKETS}",
        "",
        *(line for scene, runs in by_scene(table) for line in _every_run(scene, runs)),
        _uncertainties(table),
    ]


def _scenes(records: Sequence[Record]) -> list[str]:
    """Semi-axes, start, St, duration, samples and forms of each scene."""
    groups: dict[tuple[str, str], list[tuple[Record, Scene]]] = {}
    for record in records:
        scene = parse_scene(record["scene"])
        content = scene_table(scene)
        body = json.dumps([content["shape"], content["start"]], sort_keys=True)
        groups.setdefault((record["scene_name"], body), []).append((record, scene))
    header = ["scene", "semi-axes", "start", "St", "duration", "samples", "forms"]
    return [
        "## The scenes",
        "",
        markdown(header, [*map(_scene_row, groups.values())]),
        "Semi-axes along the body's axes x', y', z', in any common unit; angles in rad; rates in units of the shear "
        "rate, times t in inverse shear rates; t₂ = t/St.",
        "",
    ]


def _scene_row(runs: Sequence[tuple[Record, Scene]]) -> list[str]:
    records, scenes = zip(*runs, strict=True)
    content = scene_table(scenes[0])
    start = ", ".join(
        words.format(_numbers(content["start"][key])) for key, words in START.items() if key in content["start"]
    )
    forms = dict.fromkeys(record["form"] for record in records)
    return [
        records[0]["scene_name"],
        _numbers(content["shape"]["semi_axes"]),
        start,
        _listed(scene.stokes for scene in scenes),
        _durations(scenes),
        _listed(record["samples"] for record in records),
        ", ".join(forms),
    ]


def _durations(scenes: Sequence[Scene]) -> str:
    """Slow time, if all scenes have one in common, and time."""
    slow = {short(scene.slow_time) for scene in scenes}
    time = f"t = {_listed(scene.time for scene in scenes)}"
    common = len(slow) == 1 and all(isfinite(scene.slow_time) and scene.slow_time > 0 for scene in scenes)
    return f"t₂ = {slow.pop()}, {time}" if common else time


def _numbers(values: float | Sequence[float]) -> str:
    return short(values) if isinstance(values, float | int) else f"({', '.join(map(short, values))})"


def _listed(values: Iterable[float]) -> str:
    """Different values in growing order."""
    return ", ".join(map(short, sorted(set(values))))


def _best(scene: str, runs: pd.DataFrame) -> list[str]:
    """Who is the cheapest at each error."""
    return [
        *([f"### The cheapest: {scene}", ""] if scene else []),
        "The cheapest run that meets a slow error (form, solver, tolerance: time; methods within 15 % of it):",
        "",
        _winners(runs, "slow_error"),
        "The same for the orientation error, in rad:",
        "",
        _winners(runs, "orientation_error"),
    ]


def _winners(table: pd.DataFrame, error: str) -> str:
    groups = by_stokes(table)
    rows = [[short(target), *(_winner(runs, target, error) for _, runs in groups)] for target in TARGETS]
    return markdown(["error", *(f"St = {short(stokes)}" for stokes, _ in groups)], rows)


def _winner(runs: pd.DataFrame, target: float, error: str) -> str:
    uncertainty = runs[uncertainty_of(error)].dropna()
    if len(uncertainty) and target <= least_known(float(uncertainty.iloc[0])):
        return "unknown: the reference cannot tell"
    winner = cheapest(runs, target, error)
    if winner is None:
        return "none"
    best = winner.row.to_dict()
    tied = f" (tied: {ties(winner)})" if winner.tied else ""
    return f"{best['form']}, {best['solver']}, {short(best['tolerance'])}: {duration(best['seconds'])}{tied}"


def _every_run(scene: str, table: pd.DataFrame) -> list[str]:
    columns = ["form", "solver", "tolerance", "slow error", "of which solver", "of which model", "orientation"]
    columns += ["time", "spread", "first", "RHS", "steps", "status"]
    lines = []
    for stokes, runs in by_stokes(table):
        rows = [_row(run) for run in runs.to_dict("records")]
        heading = f"### {f'{scene}, ' if scene else ''}St = {short(stokes)}"
        lines += [heading, "", markdown(columns, rows, right=range(2, 12))]
    return lines


def _row(run: dict) -> list[str]:
    status = str(run["status"]).replace("_", " ")
    first = 0.0 if pd.isna(run["prepare_seconds"]) else run["prepare_seconds"]
    averaged = not pd.isna(run["model_slow_error"]) and run["model_slow_error"] > 0
    return [
        run["form"],
        run["solver"],
        short(run["tolerance"]),
        error_of(run, "slow"),
        scientific(run["solver_slow_error"]) if averaged else "",
        scientific(run["model_slow_error"]) if averaged else "",
        error_of(run, "orientation"),
        duration(run["seconds"]),
        duration(run["seconds_spread"]),
        duration(first) if first > COMPILED else "",
        whole(run["work.rhs_calls"]),
        whole(run["work.steps"]),
        status + (", inferred" if run["inferred"] else "") if status != Status.REACHED_END.replace("_", " ") else "",
    ]


def error_of(run: dict, want: str) -> str:
    """An error in figures, in brackets where it is not known."""
    error = run[f"{want}_error"]
    return scientific(error) if pd.isna(error) else bracketed(error, bool(run[f"{want}_known"]))


def whole(value: Any) -> str:
    """A count; a dash where the library keeps none."""
    return "–" if pd.isna(value) else str(int(value))


def _uncertainties(table: pd.DataFrame) -> str:
    rows = []
    for scene, runs in by_scene(where(table, table["slow_uncertainty"].notna())):
        for stokes, own in by_stokes(runs):
            first = own.iloc[0]
            numbers = scientific(first["slow_uncertainty"]), scientific(first["orientation_uncertainty"])
            rows.append([*([scene] if scene else []), short(stokes), *numbers])
    text = "Uncertainty of the references (long double Taylor runs; not less than what half an ulp in the start makes):"
    columns = [*(["scene"] if rows and len(rows[0]) == 4 else []), "St", "slow", "orientation, rad"]
    return f"{text}\n\n{markdown(columns, rows)}"
