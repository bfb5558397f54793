"""`polhode bench`: the main job, cost against accuracy as St grows."""

from pathlib import Path

import click

from polhode.harness.cli import bad_input
from polhode.harness.commands.study_filters import filter_options, filtered
from polhode.harness.commands.study_filters import words as filter_words
from polhode.harness.commands.study_store import open_store, running_into


@click.command(epilog="Example: polhode bench --quick --out look")
@click.argument("study_file", metavar="[STUDY.toml]", required=False, type=click.Path(path_type=Path))
@click.option(
    "--out", type=click.Path(path_type=Path), help="Folder; by default reports/NAME, with the filters' words."
)
@click.option("--quick", is_flag=True, help="Fewer tolerances and short time limits: a look, not a result.")
@click.option("--resume", is_flag=True, help="Take up an interrupted run instead of starting afresh.")
@filter_options
@click.option("--quiet", is_flag=True, help="No progress.")
def bench(
    study_file: Path | None, out: Path | None, quick: bool, resume: bool, quiet: bool, **filters: tuple[str, ...]
) -> None:
    """Run a work-precision study and write its page, figures and records.

    The page tells which run is the cheapest, or, of a study of several scenes that does not say otherwise, who gets
    through.

    Without a study file: the paper's triaxial ellipsoid at St = 1e2 to 1e5, by every solver, with the averaged form,
    and a spheroid with the first and the second order of averaging.
    The main job also fits the costs that `polhode pick` predicts to this machine.

    An interrupted run keeps its finished cases in FOLDER/store.sqlite and goes on with --resume; a run that starts
    afresh moves them to FOLDER/previous.sqlite.
    """
    from polhode.harness.analysis import outcomes
    from polhode.harness.calibration.fit import refit
    from polhode.harness.pages import bench as bench_page
    from polhode.harness.picking.laws import load_laws, own_laws_path
    from polhode.harness.studies.runner import Runner
    from polhode.harness.studies.study import quick_study, read_study

    with bad_input():
        study = filtered(read_study(study_file), filters)
        study = quick_study(study) if quick else study
        folder = out or Path("reports") / study.name
    store = open_store(folder, resume)
    with running_into(store):
        records = Runner(store, quiet).run(study)
    words = [
        "polhode bench",
        *([str(study_file)] if study_file else []),
        *(["--quick"] if quick else []),
        *filter_words(filters),
    ]
    make = bench_page.write_page if study.page == "costs" else outcomes.write_page
    page = make(study, records, folder, " ".join(words))
    if study_file is None and not quick and not any(filters.values()):
        refit(load_laws(), records).save(own_laws_path())
    click.echo(f"{page}")
