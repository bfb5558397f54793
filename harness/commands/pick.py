"""`polhode pick`: what to run for a scene, and what it will cost; `calibrate` and `validate`: the laws behind it."""

from dataclasses import asdict
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING

import click

from polhode.harness import DEFAULT_SAMPLES
from polhode.harness.calibration import HELD_OUT_SEED, TRAINING_SCENES
from polhode.harness.cli import BadInput, RunFailed, bad_input, command
from polhode.harness.commands import setup
from polhode.harness.commands._study_options import (
    as_json,
    out_folder,
    quiet,
    resume,
    stored,
    to_json,
)
from polhode.harness.common.text import cells, fitting, markdown, on_terminal, short
from polhode.models.catalogue import FORMS
from polhode.solvers.catalogue import SOLVERS

if TYPE_CHECKING:
    from polhode.harness.picking.recommendation import Recommendation

# Ways shown unless all are asked for, and their columns.
FEW = 8
WAYS = {
    "form": "{form}",
    "solver": "{solver}",
    "tolerance": "{tolerance:short}",
    "error below": "{error.high:error}",
}
WAYS |= {
    "time": "{seconds.predicted:time}",
    "95 % interval": "{seconds.low:time} … {seconds.high:time}",
}
WAYS |= {"first run": "{first_run_seconds:time}"}


@command()
@click.argument("scene", shell_complete=setup.scene_names)
@click.option("--error", type=float, default=1e-6, help="Largest error allowed along the run.")
@click.option(
    "--want",
    default="slow",
    metavar="slow|orientation",
    help="L and E over I_max, or orientation in rad.",
)
@click.option(
    "--samples", type=int, default=DEFAULT_SAMPLES, help="Equispaced times of the output."
)
@click.option(
    "--why", is_flag=True, help="Show why this way is the first, and why other forms will not do."
)
@click.option(
    "--all", "everything", is_flag=True, help="Show all ways, and why each other one will not do."
)
@as_json
def pick(
    scene: str, error: float, want: str, samples: int, why: bool, everything: bool, as_json: bool
) -> None:
    """Rank the ways to run SCENE: form, solver and tolerance, with predicted error, time and their 95 % intervals."""
    from polhode.harness.common.progress import Progress

    with bad_input(), Progress() as progress:
        progress.begin("trial runs at loose tolerances")
        from polhode.harness import api
        from polhode.harness.calibration.scenes import SAMPLES

        found = api.pick(scene, error, want, samples)
    if samples > max(SAMPLES):
        measured = f"laws were fitted to runs of {min(SAMPLES)} to {max(SAMPLES)} samples"
        click.echo(f"note: the {measured}; times for {samples} are extrapolated", err=True)
    if as_json:
        if found.outside:
            click.echo(f"note: {found.outside}", err=True)
        names = ("want", "error", "ranking", "excluded")
        click.echo(to_json({name: value for name, value in asdict(found).items() if name in names}))
        return
    click.echo(pick_page(found, everything, why))
    first = found.ranking[0]
    options = f"--form {first.form} --solver {first.solver} --tolerance {short(first.tolerance)}"
    click.echo(
        fitting(
            f"\nTo run the first: polhode solve {quote(scene)} {options} --samples {samples} --out FILE.csv"
        )
    )


def pick_page(found: "Recommendation", everything: bool, why: bool = False) -> str:
    """What `polhode pick` prints of a recommendation: what to run, the ways, and if asked why."""
    shown = found.ranking if everything else found.ranking[:FEW]
    rows = [
        [*texts, "tied" * row.tied] for texts, row in zip(cells(shown, WAYS), shown, strict=True)
    ]
    notes = _notes(found, len(shown), why or everything)
    # The first run, and then the interval, are what a narrow terminal goes without.
    parts = [
        fitting(found.summary),
        on_terminal([*WAYS, ""], rows, spare=(5, 6)),
        *filter(None, [fitting(notes)]),
    ]
    header = ["excluded", "solvers", "why"] if everything else ["excluded", "why"]
    if (why or everything) and (excluded := _why(found, everything)):
        parts.append(on_terminal(header, excluded))
    return "\n\n".join(parts)


def _notes(found: "Recommendation", shown: int, why: bool) -> str:
    """What the table does not say of itself."""
    first = found.ranking[0]
    notes = []
    if why:
        size = f"{found.rotations:.3g} rotations and {found.damping_times:.3g} damping times"
        notes.append(f"the run is of {size}\n{first.form} by {first.solver}: {first.reason}")
    if first.tied:
        notes.append(
            "tied: its 95 % interval of time overlaps with the first one's, so that either may be the faster"
        )
    if more := len(found.ranking) - shown:
        notes.append(f"{more} more {'way' if more == 1 else 'ways'}, not cheaper: --all")
    return "\n".join(notes)


def _why(found: "Recommendation", everything: bool) -> list[list[str]]:
    """Excluded methods, those of one form and one reason in one row; else forms that will not do at all, and why."""
    groups: dict[tuple[str, str], list[str]] = {}
    for each in found.excluded:
        groups.setdefault((each.form, each.reason), []).append(each.solver)
    if everything:
        return [
            [form, "all" if len(solvers) == len(SOLVERS) else ", ".join(solvers), reason]
            for (form, reason), solvers in groups.items()
        ]
    ranked = {row.form for row in found.ranking}
    # The reason that most solvers share.
    shared = {
        form: reason
        for (form, reason), _ in sorted(groups.items(), key=lambda group: len(group[1]))
    }
    return [[form, reason] for form, reason in shared.items() if form not in ranked]


@command()
@out_folder("reports/pick")
@click.option(
    "--to",
    type=click.Path(path_type=Path, dir_okay=False),
    help="File of laws; by default this user's.",
)
@click.option(
    "--scenes", type=click.IntRange(min=3), default=TRAINING_SCENES, help="Training scenes."
)
@click.option("--add", is_flag=True, help="Measure only what the file's laws lack, and keep them.")
@click.option(
    "--anew",
    multiple=True,
    metavar="NAME",
    help="A form or solver that has changed: measured again.",
)
@click.option(
    "--first-runs",
    "firsts",
    is_flag=True,
    help="Measure first runs alone, and keep all else in the file.",
)
@resume
@quiet
def calibrate(
    out: Path,
    to: Path | None,
    scenes: int,
    add: bool,
    anew: tuple[str, ...],
    firsts: bool,
    resume: bool,
    quiet: bool,
) -> None:
    """Measure the training scenes on this machine, half an hour, and fit the laws behind `polhode pick`."""
    from polhode.harness.calibration.fit import fit_laws, with_first_runs
    from polhode.harness.calibration.training import train, without
    from polhode.harness.common.machine import machine, versions
    from polhode.harness.picking.laws import own_laws_path, read_laws

    if unknown := [name for name in anew if name not in FORMS and name not in SOLVERS]:
        raise BadInput(f"--anew: got {unknown[0]!r}, expected the name of a form or solver")
    path = to or own_laws_path()
    if firsts:
        with bad_input():
            known = read_laws(path)
        with_first_runs(known).save(path)
        click.echo(f"{path}: first runs of {len(known.methods)} methods")
        return
    with bad_input():
        path.parent.mkdir(parents=True, exist_ok=True)
        base = read_laws(path) if add else None
    with stored(out, resume, "training") as store:
        base = without(store, base, anew)
        records = train(store, scenes, quiet, base)
    fitted = fit_laws(records, {"machine": machine(), "versions": versions()}, base)
    fitted.save(path)
    click.echo(f"{path}: laws of {len(fitted.methods)} methods from {len(records)} runs")
    if unjudged := len(
        {record["scene_name"] for record in records if "reference_failed" in record}
    ):
        click.echo(f"{unjudged} scenes have times alone, without a reference")


@command()
@out_folder("reports/pick")
@click.option("--scenes", type=click.IntRange(min=1), default=16, help="Held-out scenes of a seed.")
@click.option(
    "--seed", type=click.IntRange(min=0), default=HELD_OUT_SEED, help="What they are drawn from."
)
@click.option("--seeds", type=click.IntRange(min=1), default=3, help="So many seeds from it on.")
@click.option(
    "--errors",
    type=click.IntRange(min=0),
    default=0,
    help="Scenes of each sort whose stated errors are held against references instead.",
)
@click.option("--fit", is_flag=True, help="With --errors: fit the factors of the statements anew.")
@resume
@quiet
def validate(
    out: Path,
    scenes: int,
    seed: int,
    seeds: int,
    errors: int,
    fit: bool,
    resume: bool,
    quiet: bool,
) -> None:
    """Ask `pick` about scenes that no law was fitted on, measure them, print how good it was, and write the page."""
    if errors:
        _validate_errors(out, errors, seed, fit, resume, quiet)
        return
    from polhode.harness.calibration.heldout import evaluate
    from polhode.harness.pages.pick import summary, write_pages
    from polhode.harness.picking.laws import load_laws

    with bad_input():
        known = load_laws()
    with stored(out, resume, "heldout") as store:
        evaluation = evaluate(store, known, scenes, quiet, seed, seeds)
    page = write_pages(
        out, known, evaluation, f"polhode validate --scenes {scenes} --seed {seed} --seeds {seeds}"
    )
    click.echo("\n".join([*summary(evaluation), str(page)]))
    if not evaluation.reached:
        raise RunFailed("pick did not reach what it promises")


def _validate_errors(
    out: Path, scenes: int, seed: int, fit: bool, resume: bool, quiet: bool
) -> None:
    """Count how many stated errors hold, by kind of confirmation, or fit their factors."""
    from polhode.harness.answers.coverage import counted, fitted, save, study, unstated
    from polhode.harness.common.files import write_file

    with stored(out, resume, "errors", "runs") as store:
        rows = study(store, seed, scenes, quiet, certified=not fit)
    command = f"polhode validate --errors {scenes} --seed {seed}"
    if fit:
        save(fitted(rows), f"{command} --fit")
    cells_of = [
        [
            count.kind,
            count.family,
            count.want,
            count.runs,
            count.missed,
            f"{count.bound:.1%}",
            f"{count.factor:.2g}",
        ]
        for count in counted(rows)
    ]
    header = ["kind", "family", "of", "runs", "missed", "share missed below", "over true, median"]
    silent, judged = unstated(rows)
    head = f"# Errors stated\n\nMade by `{command}`. {silent} of {judged} runs state no error.\n\n"
    page = write_file(out / "errors.md", head + markdown(header, cells_of, (3, 4, 5, 6)))
    click.echo(f"{markdown(header, cells_of, (3, 4, 5, 6))}{page}")
