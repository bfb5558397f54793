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
from polhode.harness.pages.tables import table
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
    write_file(folder / "README.md", "\n".join(_lines(study, runs, records, scenes, folder, command)))
    return folder / "README.md"


def _lines(
    study: Study, runs: pd.DataFrame, records: Sequence[Record], scenes: Sequence[str], folder: Path, command: str
) -> list[str]:
    return [
        *header(study.title, command, records),
        "## Verdict",
        "",
        *(f"- {sentence}" for sentence in [*verdict(runs), *averaged_costs(runs)] or [NOTHING]),
        "",
        "The tables below show the cheapest run that meets an error: form, solver, tolerance and time, then = and the "
        f"methods within {100 * (TIE - 1):.0f} % of it. Every run: [runs.csv](runs.csv), in full "
        "[records.jsonl](records.jsonl).",
        "",
        *scenes,
        *profile_lines(runs, folder),
        *_scenes(runs),
        f"Times are the minimum of up to five warm runs in interleaved order, over {study.samples} samples; errors are "
        "maxima along the run. *unknown*: at or below what the reference resolves; *none*: no run measured gets there.",
        "",
        _uncertainties(runs),
    ]


def _scenes(runs: pd.DataFrame) -> list[str]:
    """Semi-axes, St, duration, samples and forms of each scene."""
    rows = [
        {name: _listed(own[column]) for name, column in SCENES.items()}
        for _, own in runs.groupby("scene_name", sort=False)
    ]
    return [
        "## The scenes",
        "",
        table(rows, {name: f"{{{name}}}" for name in SCENES}, left=len(SCENES)),
        "Semi-axes along the body's axes x', y', z', in any common unit; t in inverse shear rates, one for "
        "each St; starts stand in the study's file, or in what `polhode scenes NAME` prints.",
        "",
    ]


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
    names = [method.label for method in winner.tied]
    more = f" and {len(names) - SHOWN} more" if len(names) > SHOWN else ""
    tied = f" = {', '.join(names[:SHOWN])}{more}" if names else ""
    return f"{best['form']}, {best['solver']}, {short(best['tolerance'])}: {duration(best['seconds'])}{tied}"


def _uncertainties(runs: pd.DataFrame) -> str:
    known = where(runs, runs["slow_uncertainty"].notna()).groupby(["scene_name", "stokes"], sort=False).first()
    text = "Uncertainty of the references (long double Taylor runs; not less than what half an ulp in the start makes):"
    return f"{text}\n\n{table(known.reset_index().to_dict('records'), UNCERTAINTIES)}"
