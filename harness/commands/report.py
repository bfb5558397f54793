"""`polhode report`: everything found so far as one offline web site."""

from pathlib import Path

import click

from polhode.harness.cli import bad_input
from polhode.harness.commands import setup
from polhode.harness.commands._study_options import FOLDER, quiet

REPORTS = Path("reports")


@click.command(epilog="Example: polhode report --scene ice.toml")
@click.option("--reports", type=FOLDER, default=REPORTS, help="Folder of the other commands' pages.")
@click.option("--out", type=FOLDER, help="Folder; by default REPORTS/site.")
@click.option(
    "--scene",
    "scenes",
    multiple=True,
    metavar="SCENE",
    shell_complete=setup.scene_names,
    help="Show the motion of this scene too; repeatable.",
)
@quiet
def report(reports: Path, out: Path | None, scenes: tuple[str, ...], quiet: bool) -> None:
    """Write a web site of all that was found: verdict, costs, every page of the reports, motions.

    It shows what `bench`, `regimes`, `accuracy`, `validate`, `paper`, `equal-error` and `bench
    harness/studies/hard_cases.toml` left in the folder --reports. The pages need no server and no network. The opening
    page names what is not there yet, with the command that makes it.
    """
    from tqdm import tqdm

    from polhode.harness.site.build import build
    from polhode.harness.studies.scenes import find_scene

    with bad_input():
        if reports != REPORTS and not reports.is_dir():
            raise ValueError(f"--reports: got {str(reports)!r}, expected an existing folder")
        own = {name: find_scene(name) for name in scenes}
        with tqdm(disable=quiet or None, unit="page", desc="report", leave=False) as progress:

            def say(what: str) -> None:
                progress.set_postfix_str(what)
                progress.update()

            page = build(reports, out or reports / "site", own, say)
    click.echo(f"{page}")
