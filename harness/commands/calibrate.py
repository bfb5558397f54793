"""`polhode calibrate` and `polhode validate`: the laws behind `pick`, and how good it is."""

from pathlib import Path

import click

from polhode.harness.cli import BadInput, RunFailed, bad_input, command
from polhode.harness.commands._study_options import out_folder, quiet, resume, stored
from polhode.models.catalogue import FORMS
from polhode.solvers.catalogue import SOLVERS


@command()
@out_folder("reports/pick")
@click.option("--to", type=click.Path(path_type=Path, dir_okay=False), help="File of laws; by default this user's.")
@click.option("--scenes", type=click.IntRange(min=3), default=110, help="Training scenes.")
@click.option("--add", is_flag=True, help="Measure only what the file's laws lack, and keep them.")
@click.option("--anew", multiple=True, metavar="NAME", help="A form or solver that has changed: measured again.")
@click.option("--first-runs", "firsts", is_flag=True, help="Measure first runs alone, and keep all else in the file.")
@resume
@quiet
def calibrate(
    out: Path, to: Path | None, scenes: int, add: bool, anew: tuple[str, ...], firsts: bool, resume: bool, quiet: bool
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
    if unjudged := len({record["scene_name"] for record in records if "reference_failed" in record}):
        click.echo(f"{unjudged} scenes have times alone, without a reference")


@command()
@out_folder("reports/pick")
@click.option("--scenes", type=click.IntRange(min=1), default=16, help="Held-out scenes of a seed.")
@click.option("--seed", type=click.IntRange(min=0), default=1765, help="What they are drawn from.")
@click.option("--seeds", type=click.IntRange(min=1), default=3, help="So many seeds from it on.")
@click.option("--errors", type=click.IntRange(min=0), default=0, help="Runs whose stated errors are tested instead.")
@resume
@quiet
def validate(out: Path, scenes: int, seed: int, seeds: int, errors: int, resume: bool, quiet: bool) -> None:
    """Ask `pick` about scenes that no law was fitted on, measure them, print how good it was, and write the page."""
    from polhode.harness.calibration.heldout import evaluate
    from polhode.harness.calibration.stated import stated
    from polhode.harness.pages.picking.pick import stated_summary, summary, write_pages, write_stated
    from polhode.harness.picking.laws import load_laws

    if errors:
        with stored(out, resume, "stated") as store:
            found = stated(store, seed, errors, quiet)
        page = write_stated(out, found, f"polhode validate --errors {errors} --seed {seed}")
        click.echo("\n".join([*stated_summary(found), str(page)]))
        return
    with bad_input():
        known = load_laws()
    with stored(out, resume, "heldout") as store:
        evaluation = evaluate(store, known, scenes, quiet, seed, seeds)
    page = write_pages(out, known, evaluation, f"polhode validate --scenes {scenes} --seed {seed} --seeds {seeds}")
    for sentence in summary(evaluation):
        click.echo(sentence)
    click.echo(str(page))
    if not evaluation.reached:
        raise RunFailed("pick did not reach what it promises")
