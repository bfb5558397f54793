"""`polhode bench`: the main job, cost against accuracy as St grows."""

from pathlib import Path

import click

from polhode.harness.cli import bad_input


@click.command(epilog="Example: polhode bench --quick --out /tmp/bench")
@click.argument("study_file", metavar="[STUDY.toml]", required=False, type=click.Path(path_type=Path))
@click.option("--out", type=click.Path(path_type=Path, file_okay=False), help="Folder; by default reports/NAME.")
@click.option("--quick", is_flag=True, help="Fewer tolerances and short time limits: a look, not a result.")
@click.option("--resume", is_flag=True, help="Take up an interrupted run instead of starting afresh.")
@click.option("--quiet", is_flag=True, help="No progress.")
def bench(study_file: Path | None, out: Path | None, quick: bool, resume: bool, quiet: bool) -> None:
    """Run a work-precision study and write its page, figures and records.

    Without a study file: the paper's triaxial ellipsoid at St = 1e2 to 1e5, by every solver, with the averaged form.
    An interrupted run keeps its finished cases in FOLDER/store.sqlite and goes on with --resume.
    """
    from polhode.harness.bench_page import write_page
    from polhode.harness.run import Runner
    from polhode.harness.store import DamagedStoreError, Store
    from polhode.harness.study import quick_study, read_study

    with bad_input():
        study = read_study(study_file)
        study = quick_study(study) if quick else study
        folder = out or Path("reports") / study.name
        folder.mkdir(parents=True, exist_ok=True)
        path = folder / "store.sqlite"
        if not resume:
            for leftover in folder.glob("store.sqlite*"):
                leftover.unlink()
    try:
        with Store(path) as store:
            records = Runner(store, quiet).run(study)
    except DamagedStoreError as error:
        raise click.ClickException(str(error)) from None
    words = ["polhode bench", *([str(study_file)] if study_file else []), *(["--quick"] if quick else [])]
    page = write_page(study, records, folder, " ".join(words))
    click.echo(f"{page}")
