"""The page of the main job: table, figures, verdict, all from the records."""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from polhode.harness.analysis.frames import by_scene, by_stokes, frame, where, write_runs
from polhode.harness.analysis.winners import TARGETS, TIE, cheapest
from polhode.harness.common.files import write_file
from polhode.harness.common.machine import header
from polhode.harness.common.store import Record, export
from polhode.harness.common.text import duration, markdown, short
from polhode.harness.pages.figures.profiles import profile_lines
from polhode.harness.pages.figures.work_precision import save, work_precision_panels
from polhode.harness.pages.tables import bullets, fill, table
from polhode.harness.pages.verdict import averaged_costs, verdict
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
UNCERTAINTIES = {
    "scene": "{scene_name}",
    "St": "{stokes:short}",
    "slow": "{slow_uncertainty:error}",
    "orientation, rad": "{orientation_uncertainty:error}",
}


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
    text = fill(
        "bench",
        header=header(study.title, command, records),
        verdict=bullets([*verdict(runs), *averaged_costs(runs)] or [NOTHING]),
        tie=100 * (TIE - 1),
        scenes=scenes,
        profiles=profile_lines(runs, folder),
        described=table(_scenes(runs), {name: f"{{{name}}}" for name in SCENES}, left=len(SCENES)),
        samples=study.samples,
        uncertainties=table(known.reset_index().to_dict("records"), UNCERTAINTIES),
    )
    write_file(folder / "README.md", text)
    return folder / "README.md"


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
