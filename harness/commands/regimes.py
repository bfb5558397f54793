"""`polhode regimes`: the map of who wins over St and error."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from polhode.harness.cli import bad_input
from polhode.harness.commands.study_filters import filter_options, filtered
from polhode.harness.commands.study_filters import words as filter_words
from polhode.harness.commands.study_store import open_store, running_into

if TYPE_CHECKING:
    from polhode.harness.common.store import Store
    from polhode.harness.studies.study import Study


@click.command(epilog="Example: polhode regimes --quick --out look")
@click.argument("study_file", metavar="[STUDY.toml]", required=False, type=click.Path(path_type=Path))
@click.option(
    "--out", type=click.Path(path_type=Path), help="Folder; by default reports/NAME, with the filters' words."
)
@click.option("--quick", is_flag=True, help="Fewer tolerances, short time limits, St from 0.1 to 1e4: a look.")
@click.option("--resume", is_flag=True, help="Take up an interrupted run; a finished one is drawn again.")
@filter_options
@click.option("--quiet", is_flag=True, help="No progress.")
def regimes(
    study_file: Path | None, out: Path | None, quick: bool, resume: bool, quiet: bool, **filters: tuple[str, ...]
) -> None:
    """Measure and draw who wins over St and error: one map for the full solution, one for the slow variables.

    The whole study is some 3600 runs and takes about half an hour: references, then every run up to five times.
    Finished cases are kept in FOLDER/store.sqlite; --resume measures those that it lacks, which is all of them in an
    empty folder, and draws the map. --quick, --scene, --form and --solver make it shorter.
    """
    from polhode.harness.analysis.regime_map import Parts
    from polhode.harness.pages.regimes import write_page
    from polhode.harness.studies.runner import Runner
    from polhode.harness.studies.study import quick_study, read_study

    with bad_input():
        study = filtered(read_study(study_file, "regimes"), filters)
        if quick:
            some = tuple((name, scene) for name, scene in study.scenes if 0.1 <= scene.stokes <= 1e4)
            study = replace(quick_study(study), scenes=some or study.scenes)
        folder = out or Path("reports") / study.name
    store = open_store(folder, resume)
    with running_into(store):
        if not quiet:
            click.echo(ahead(study, store), err=True)
        records = Runner(store, quiet).run(Parts(study))
    words = ["polhode regimes", *([str(study_file)] if study_file else []), *(["--quick"] if quick else [])]
    click.echo(f"{write_page(study, records, folder, ' '.join([*words, *filter_words(filters)]))}")


def ahead(study: "Study", store: "Store") -> str:
    """How much of a study is left to be measured."""
    from polhode.harness.analysis.regime_map import Parts

    known = store.keys()
    cases = [case.key in known for batch in Parts(study).batches() for case in batch]
    return f"{store.path} holds {sum(cases)} of {len(cases)} cases, {len(cases) - sum(cases)} are measured now"
