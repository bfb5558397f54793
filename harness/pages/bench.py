"""The page of the main job: table, figures, who wins in sentences, all from the records."""

from collections.abc import Iterable, Sequence
from functools import partial
from itertools import groupby
from pathlib import Path
from typing import Any

import pandas as pd

from polhode.harness.analysis import pareto
from polhode.harness.analysis.frames import by_scene, by_stokes, frame, where, write_runs
from polhode.harness.common.files import write_file
from polhode.harness.common.machine import provenance
from polhode.harness.common.store import Record, write_records
from polhode.harness.common.text import duration, markdown, short
from polhode.harness.pages.figures.style import measured, save
from polhode.harness.pages.figures.work_precision import (
    TARGETS as PROFILE_TARGETS,
    conditions,
    profile_lines,
    times,
    work_precision_panels,
)
from polhode.harness.pages.tables import fill, lines_of
from polhode.harness.studies.study import Study

# By the name of their file: error, and label of its axis.
_FIGURES = {
    "slow": ("slow_error", "error of L and E over $I_{max}$"),
    "orientation": ("orientation_error", "orientation error, rad"),
}
# Columns of the table of distances. "reached" counts the St and errors that a method meets, "won" those
# at which it is the fastest. The last three are of its time over the time of the fastest.
_DISTANCES = ("method", "reached", "won", "least", "median", "largest")
# Ties that a cell of the table of winners names; of more it gives the number. A choice: two keep the
# table's columns about as wide as a winner's own words.
_MAX_NAMED_TIES = 2
# Columns of the table of scenes: heading, and column of the runs.
_SCENES = {
    "scene": "scene_name",
    "semi-axes": "scene.shape.semi_axes",
    "St": "stokes",
    "t": "scene.time",
    "samples": "samples",
    "forms": "form",
}
# The verdict where no run has a time, and where no averaged form was run.
_NOTHING = "No run gave a result: how each ended stands in runs.csv."
_FULL_ALONE = "No form measured averages: the tables show the cheapest runs of the full equations."
# Averaging begins to pay somewhere between two measured St. If they lie further apart than this factor,
# the verdict says that no St between them was measured. Studies have an St in each decade: 1e-9 is far
# above the rounding of their quotient, 1e-16.
_LARGEST_STOKES_STEP = 10.0 * (1 + 1e-9)


def write_page(study: Study, records: Sequence[Record], folder: Path, command: str) -> Path:
    """Write the page, its figures and its data into a folder and return the page's path."""
    runs = frame(records)
    write_runs(runs, folder)
    write_records(records, folder)
    # By scene and St the uncertainty of the reference, which all runs there share.
    uncertainties = (
        where(runs, runs["slow_uncertainty"].notna())
        .groupby(["scene_name", "stokes"], sort=False)
        .first()
    )
    made = provenance(command, records)
    machine = measured(made)
    groups = runs.groupby("scene_name", sort=False)
    described = []
    for _, scene_runs in groups:
        described.append([_listed(scene_runs[column]) for column in _SCENES.values()])
    page = fill(
        "bench",
        title=study.title,
        made=made,
        verdict=[*verdict(runs), *averaged_costs(runs)]
        or [_FULL_ALONE if len(runs["seconds"].dropna()) else _NOTHING],
        # In percent of the fastest time.
        tie=100 * (pareto.TIE - 1),
        # `by_scene` calls a single scene "": headings leave the name out, figures take it from the runs.
        scenes=[
            (scene, _figures(scene_runs, scene, i, folder, machine))
            for i, (scene, scene_runs) in enumerate(by_scene(runs))
        ],
        profiles=profile_lines(runs, folder, note=conditions(runs, machine)),
        distances=[
            (scene, markdown([*_DISTANCES], rows, right=range(1, len(_DISTANCES))))
            for scene, scene_runs in by_scene(runs)
            if (rows := distances(scene_runs))
        ],
        errors=f"{short(PROFILE_TARGETS[0])} to {short(PROFILE_TARGETS[-1])}",
        described=markdown([*_SCENES], described),
        samples=study.samples,
        uncertainties=uncertainties.reset_index().to_dict("records"),
    )
    return write_file(folder / "README.md", page)


def distances(runs: pd.DataFrame) -> list[list[str]]:
    """How far each method of a scene is from the fastest one, the nearest first: rows of `_DISTANCES`.

    A method counts at the errors that it reaches, of those that some method reaches. One that reaches none
    has dashes in place of the factors.
    """
    seconds = times(runs)
    if seconds.empty:
        return []
    ratios = seconds.div(seconds.min(axis=1), axis=0)
    reached = ratios.notna().sum()
    rows = []
    for method in ratios.median().sort_values(kind="stable").index:
        factors: Any = ratios[method].dropna()
        least_median_largest = 3 * ["–"]
        if len(factors):
            least_median_largest = [
                _factor(float(factors.quantile(share))) for share in (0.0, 0.5, 1.0)
            ]
        won = int((factors == 1.0).sum())
        of_all = f"{reached[method]} of {len(ratios)}"
        rows.append([str(method), of_all, str(won), *least_median_largest])
    return rows


def _factor(value: float) -> str:
    """A ratio in three digits."""
    return short(float(f"{value:.3g}"))


def _figures(
    runs: pd.DataFrame, scene: str, place: int, folder: Path, machine: str
) -> list[dict[str, str]]:
    """Save the figures of one scene, the `place`-th of the page; what `texts/bench.md` says of each.

    `name` is "slow" or "orientation", `label` is for the error's axis, `file` the stem of the picture,
    `winners` the table of the cheapest runs. An error that no run has gets no figure.
    """
    figures = []
    for name, (error, label) in _FIGURES.items():
        if len(runs[error].dropna()):
            # The figures of the first scene have plain names.
            file = f"{name}-{scene}" if place else name
            note = conditions(runs, machine)
            named = scene or str(runs["scene_name"].iloc[0])
            drawing = work_precision_panels(runs, error, label, scene=named, note=note)
            save(drawing, folder, file)
            groups = by_stokes(runs)
            rows = []
            for target in pareto.TARGETS:
                best = [_winner(stokes_runs, target, error) for _, stokes_runs in groups]
                rows.append([short(target), *best])
            winners = markdown(["error", *(f"St = {short(stokes)}" for stokes, _ in groups)], rows)
            figures.append({"name": name, "label": label, "file": file, "winners": winners})
    return figures


def _listed(values: Iterable[Any]) -> str:
    """The different values in words, in their order; a list of numbers stands as a : b : c."""
    texts = (
        " : ".join(map(short, value)) if isinstance(value, list) else value for value in values
    )
    return ", ".join(
        dict.fromkeys(text if isinstance(text, str) else short(text) for text in texts)
    )


def _winner(runs: pd.DataFrame, target: float, error: str) -> str:
    """The cheapest run to an error at one St, and ties, in words.

    "unknown" stands for an error that the reference does not resolve, "none" for one that no run meets.
    """
    if target <= pareto.limit_of(runs, error):
        return "unknown"
    winner = pareto.cheapest(runs, target, error)
    if winner is None:
        return "none"
    best, tied_methods = winner
    form = best["form"]
    names = [
        method.solver if method.form == form else f"{method.form} by {method.solver}"
        for method in tied_methods
    ]
    unnamed = len(names) - _MAX_NAMED_TIES
    more = f" and {unnamed} more" if unnamed > 0 else ""
    tied = f" = {', '.join(names[:_MAX_NAMED_TIES])}{more}" if names else ""
    return (
        f"{form}, {best['solver']}, {short(best['tolerance'])}: {duration(best['seconds'])}{tied}"
    )


def when_averaged_wins(records: pd.DataFrame, target: float) -> str | None:
    """From which measured St on an averaged form is the cheapest to an error of L and E, in words.

    None if another form is the cheapest at the largest St.
    """
    start = pareto.averaged_wins_from(records, target)
    if start is None:
        return None
    numbers = [stokes for stokes, _ in by_stokes(records)]
    return fill("bench-from", start=start, numbers=numbers, gap=_LARGEST_STOKES_STEP)


def verdict(records: pd.DataFrame, targets: Sequence[float] = pareto.TARGETS) -> list[str]:
    """The St and errors of L and E at which averaged forms win, in sentences, scene by scene.

    Neighbouring errors with the same answer share a sentence.
    """
    wins = []
    for scene, runs in by_scene(records):
        if pareto.averaged_forms(runs):
            wins += [
                (scene, words, [*targets_in_words])
                for words, targets_in_words in groupby(targets, partial(when_averaged_wins, runs))
            ]
    return lines_of("bench-verdict", wins=wins)


def averaged_costs(records: pd.DataFrame) -> list[str]:
    """How little an averaged form's cost depends on St, scene by scene, in sentences."""
    scene_costs = []
    for scene, runs in by_scene(records):
        names = pareto.averaged_forms(runs)
        for name in names:
            change = pareto.cost_over_stokes(runs, name)
            if change:
                scene_costs.append((scene, name, change))
    return lines_of("bench-costs", costs=scene_costs)
