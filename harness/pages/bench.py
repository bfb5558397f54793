"""The page of the main job: table, figures, verdict, all from the records."""

import json
from collections.abc import Iterable, Sequence
from math import isfinite
from pathlib import Path

import pandas as pd

from polhode.harness.analysis.frames import by_scene, by_stokes, frame, where, write_runs
from polhode.harness.analysis.winners import TARGETS, TIE, cheapest
from polhode.harness.common.files import write_file
from polhode.harness.common.machine import header
from polhode.harness.common.store import Record, export
from polhode.harness.common.text import duration, markdown, scientific, short
from polhode.harness.pages.figures.profiles import profile_lines
from polhode.harness.pages.figures.work_precision import save, work_precision_panels
from polhode.harness.pages.verdict import averaged_costs, verdict
from polhode.harness.references.uncertainty import least_known, uncertainty_of
from polhode.harness.studies.study import Study
from polhode.models.files.scene_file import parse_scene, scene_table
from polhode.models.scene import Scene

# By the name of their file: error, and label of its axis.
FIGURES = {
    "slow": ("slow_error", "slow error over $I_{max}$"),
    "orientation": ("orientation_error", "orientation error, rad"),
}
# Ties named in a cell.
SHOWN = 2
# Keys of a scene file's start, as the page calls them.
START = {
    "euler_angles": "(θ, φ, ψ) = {}",
    "euler_rates": "at the rates {}",
    "quaternion": "quaternion {}",
    "angular_velocity": "angular velocity {} in the body",
    "angular_momentum": "angular momentum {}",
    "energy": "energy {}",
}


def write_page(study: Study, records: Sequence[Record], folder: Path, command: str) -> Path:
    """Write the page, its figures and its data into a folder and return the page's path."""
    table = frame(records)
    folder.mkdir(parents=True, exist_ok=True)
    export(list(records), folder / "records.jsonl")
    write_runs(table, folder)
    scenes = []
    for i, (scene, runs) in enumerate(by_scene(table)):
        scenes += [f"## The cheapest{f': {scene}' if scene else ''}", ""]
        before = f"{scene}: " if scene else ""
        for name, (error, label) in FIGURES.items():
            if len(runs[error].dropna()):
                # The figures of the first scene have plain names.
                file = f"{name}-{scene}" if i else name
                save(work_precision_panels(runs, error, before + label), folder, file)
                scenes += [f"By {label.replace('$I_{max}$', 'I_max')}:", "", _winners(runs, error)]
                scenes += [f"![{before}Wall time against {name} error, one panel per St]({file}.png)", ""]
    write_file(folder / "README.md", "\n".join(_lines(study, table, records, scenes, folder, command)))
    return folder / "README.md"


def _lines(
    study: Study, table: pd.DataFrame, records: Sequence[Record], scenes: Sequence[str], folder: Path, command: str
) -> list[str]:
    return [
        *header(study.title, command, records),
        "## Verdict",
        "",
        *(f"- {sentence}" for sentence in [*verdict(table), *averaged_costs(table)]),
        "",
        "The tables below show the cheapest run that meets an error: form, solver, tolerance and time, then = and the "
        f"methods within {100 * (TIE - 1):.0f} % of it. Every run: [runs.csv](runs.csv), in full "
        "[records.jsonl](records.jsonl).",
        "",
        *scenes,
        *profile_lines(table, folder),
        *_scenes(records),
        f"Times are the minimum of up to five warm runs in interleaved order, over {study.samples} samples; errors are "
        "maxima along the run. *unknown*: at or below what the reference resolves; *none*: no run measured gets there.",
        "",
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


def _winners(table: pd.DataFrame, error: str) -> str:
    groups = by_stokes(table)
    rows = [[short(target), *(_winner(runs, target, error) for _, runs in groups)] for target in TARGETS]
    return markdown(["error", *(f"St = {short(stokes)}" for stokes, _ in groups)], rows)


def _winner(runs: pd.DataFrame, target: float, error: str) -> str:
    uncertainty = runs[uncertainty_of(error)].dropna()
    if len(uncertainty) and target <= least_known(float(uncertainty.iloc[0])):
        return "unknown"
    winner = cheapest(runs, target, error)
    if winner is None:
        return "none"
    best = winner.row.to_dict()
    names = [method.label for method in winner.tied]
    more = f" and {len(names) - SHOWN} more" if len(names) > SHOWN else ""
    tied = f" = {', '.join(names[:SHOWN])}{more}" if names else ""
    return f"{best['form']}, {best['solver']}, {short(best['tolerance'])}: {duration(best['seconds'])}{tied}"


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
