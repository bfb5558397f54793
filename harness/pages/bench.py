"""The page of the main job: table, figures, who wins in sentences, all from the records."""

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from polhode.harness.analysis.frames import by_scene, by_stokes, frame, where, write_runs
from polhode.harness.analysis.pareto import (
    TARGETS,
    TIE,
    averaged_forms,
    averaged_wins_from,
    cheapest,
    costs_over_stokes,
)
from polhode.harness.common.store import Record, export
from polhode.harness.common.text import duration, markdown, short
from polhode.harness.pages.figures.profiles import profile_lines
from polhode.harness.pages.figures.work_precision import save, work_precision_panels
from polhode.harness.pages.tables import bullets, table, write
from polhode.harness.references.uncertainty import least_known, uncertainty_of
from polhode.harness.studies.study import Study

# By the name of their file: error, and label of its axis.
FIGURES = {
    "slow": ("slow_error", "slow error over $I_{max}$"),
    "orientation": ("orientation_error", "orientation error, rad"),
}
# Ties named in a cell.
SHOWN = 2
# Columns of the table of scenes, and of that of uncertainties.
SCENES = {
    "scene": "scene_name",
    "semi-axes": "scene.shape.semi_axes",
    "St": "stokes",
    "t": "scene.time",
    "samples": "samples",
    "forms": "form",
}
NOTHING = "No run gave a result: how each ended stands in runs.csv."
# St further apart than this leave open where between them averaging begins to pay.
GAP = 10.0 * (1 + 1e-9)


def write_page(study: Study, records: Sequence[Record], folder: Path, command: str) -> Path:
    """Write the page, its figures and its data into a folder and return the page's path."""
    runs = frame(records)
    folder.mkdir(parents=True, exist_ok=True)
    export(list(records), folder / "records.jsonl")
    write_runs(runs, folder)
    scenes = []
    for i, (scene, own) in enumerate(by_scene(runs)):
        scenes += [f"## The cheapest{f': {scene}' if scene else ''}", ""]
        before = f"{scene}: " if scene else ""
        for name, (error, label) in FIGURES.items():
            if len(own[error].dropna()):
                # The figures of the first scene have plain names.
                file = f"{name}-{scene}" if i else name
                save(work_precision_panels(own, error, before + label), folder, file)
                scenes += [f"By {label.replace('$I_{max}$', 'I_max')}:", "", _winners(own, error)]
                scenes += [f"![{before}Wall time against {name} error, one panel per St]({file}.png)", ""]
    known = where(runs, runs["slow_uncertainty"].notna()).groupby(["scene_name", "stokes"], sort=False).first()
    return write(
        folder / "README.md",
        "bench",
        study.title,
        command,
        records,
        verdict=bullets([*verdict(runs), *averaged_costs(runs)] or [NOTHING]),
        tie=100 * (TIE - 1),
        scenes=scenes,
        profiles=profile_lines(runs, folder),
        described=table(_scenes(runs), {name: f"{{{name}}}" for name in SCENES}, left=len(SCENES)),
        samples=study.samples,
        uncertainties=table(known.reset_index().to_dict("records"), "bench-uncertainties"),
    )


def _scenes(runs: pd.DataFrame) -> list[dict[str, str]]:
    """Semi-axes, St, duration, samples and forms of each scene."""
    groups = [own for _, own in runs.groupby("scene_name", sort=False)]
    return [{name: _listed(own[column]) for name, column in SCENES.items()} for own in groups]


def _listed(values: Iterable[Any]) -> str:
    """Different values in their order, of lists each as a : b : c."""
    texts = (" : ".join(map(short, each)) if isinstance(each, list) else each for each in values)
    return ", ".join(dict.fromkeys(each if isinstance(each, str) else short(each) for each in texts))


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
    form = best["form"]
    names = [each.solver if each.form == form else f"{each.form} by {each.solver}" for each in winner.tied]
    more = f" and {len(names) - SHOWN} more" if len(names) > SHOWN else ""
    tied = f" = {', '.join(names[:SHOWN])}{more}" if names else ""
    return f"{form}, {best['solver']}, {short(best['tolerance'])}: {duration(best['seconds'])}{tied}"


def when_averaged_wins(records: pd.DataFrame, target: float) -> str | None:
    """At which of the St measured an averaged form is the cheapest, in words; None if it is not at the largest."""
    start = averaged_wins_from(records, target)
    if start is None:
        return None
    numbers = [stokes for stokes, _ in by_stokes(records)]
    onwards = f"from St = {short(start)} on" if start < numbers[-1] else f"at St = {short(start)}"
    if len(numbers) == 1:
        return f"{onwards}, the only one measured"
    if start == numbers[0]:
        return f"{onwards}, the smallest measured"
    before = numbers[numbers.index(start) - 1]
    if start > GAP * before:
        return f"{onwards}, not at {short(before)} (no St between measured)"
    return onwards if start < numbers[-1] else f"{onwards}, the largest measured"


def verdict(records: pd.DataFrame, targets: Sequence[float] = TARGETS) -> list[str]:
    """Where averaged forms win, in sentences, scene by scene."""
    return _each_scene(records, lambda runs: _averaged_or_not(runs, targets))


def averaged_costs(records: pd.DataFrame) -> list[str]:
    """How little an averaged form's cost depends on St, scene by scene."""
    return _each_scene(records, _costs_over_stokes)


def _each_scene(records: pd.DataFrame, lines: Callable[[pd.DataFrame], list[str]]) -> list[str]:
    return [f"{scene}: {line}" if scene else line for scene, runs in by_scene(records) for line in lines(runs)]


def _averaged_or_not(records: pd.DataFrame, targets: Sequence[float]) -> list[str]:
    if not averaged_forms(records):
        return []
    found = {short(target): when_averaged_wins(records, target) for target in targets}
    said = "For a slow error of {} an averaged form is the cheapest {}."
    lines = [said.format(target, words) for target, words in found.items() if words]
    never = ", ".join(target for target, words in found.items() if words is None)
    nowhere = f"For a slow error of {never} no averaged form is the cheapest at the largest St measured."
    return [*lines, nowhere] if never else lines


def _costs_over_stokes(records: pd.DataFrame) -> list[str]:
    lines = []
    for name in averaged_forms(records):
        found = costs_over_stokes(records, name)
        if found is not None:
            first, last, (low, middle, high) = found
            lines.append(
                f"The {name} form at St = {short(last)} costs {middle:.2f} times what it costs at St = {short(first)} "
                f"(median over solvers and tolerances; nine in ten lie between {low:.2f} and {high:.2f})."
            )
    return lines
