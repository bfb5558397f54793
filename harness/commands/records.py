"""`polhode export`, `compare` and `report`: what to do with what was measured."""

from pathlib import Path

import click

from polhode.harness.cli import BadInput, RunFailed, bad_input, command
from polhode.harness.commands import setup
from polhode.harness.commands._study_options import FOLDER, as_json, quiet

REPORTS = Path("reports")
ABOVE_ONE = click.FloatRange(min=1.0, min_open=True)


@command()
@click.argument("store", type=click.Path(path_type=Path))
@click.argument("out", type=click.Path(path_type=Path))
def export(store: Path, out: Path) -> None:
    """Write the records of STORE to OUT, as CSV or JSON Lines by its ending."""
    from polhode.harness.common.store import Store, export as write

    if not store.is_file() or store.stat().st_size == 0:
        raise BadInput(f"{store}: no such store, expected a file of `polhode bench`")
    with bad_input(), Store(store) as opened:
        write(opened, out)


@command()
@click.argument("before", type=click.Path(path_type=Path))
@click.argument("after", type=click.Path(path_type=Path))
@click.option("--slower", type=ABOVE_ONE, default=1.5, help="Factor in time that is a regression.")
@click.option("--less-accurate", type=ABOVE_ONE, default=3.0, help="The same for the errors.")
@as_json
def compare(before: Path, after: Path, slower: float, less_accurate: float, as_json: bool) -> None:
    """Compare two saved runs; fail if a case of AFTER is slower or less accurate than in BEFORE, or failed."""
    from polhode.harness.analysis.comparison import compare as compare_runs, read_runs
    from polhode.harness.common.plain_json import dumps
    from polhode.harness.common.text import aligned

    with bad_input():
        tables = read_runs(before), read_runs(after)
    found = compare_runs(*tables, slower=slower, less_accurate=less_accurate)
    if found.shared == 0:
        raise BadInput(f"{after}: got no case that {before} has, expected some")
    worse = found.regressions.astype(object).where(found.regressions.notna(), None).to_dict("records")
    if as_json:
        numbers = {"shared": found.shared, "only_before": found.only_before, "only_after": found.only_after}
        click.echo(dumps({**numbers, "drift": found.drift, "same_machine": found.same_machine, "regressions": worse}))
    else:
        pace = f"the machine takes {found.drift:.2f} times as long"
        pace = pace if found.same_machine else "another machine or Python: times as they are"
        click.echo(f"{found.shared} cases compared, {found.only_before} gone, {found.only_after} new; {pace}")
    if worse and not as_json:
        header = ["scene_name", "stokes", "form", "solver", "tolerance", "what", "before", "after"]
        rows = [[f"{row[name]:.3g}" if isinstance(row[name], float) else row[name] for name in header] for row in worse]
        click.echo(aligned(["scene", "St", *header[2:]], rows))
    if worse:
        raise RunFailed(f"regressions: {len(worse)} in {found.shared} cases")


@command()
@click.option("--reports", type=FOLDER, default=REPORTS, help="Folder of the other commands' pages.")
@click.option("--out", type=FOLDER, help="Folder; by default REPORTS/site.")
@click.option("--scene", multiple=True, shell_complete=setup.scene_names, help="Show its motion too; repeatable.")
@quiet
def report(reports: Path, out: Path | None, scene: tuple[str, ...], quiet: bool) -> None:
    """Write a web site of all that was found: verdict, costs, every page of the reports, motions."""
    from tqdm import tqdm

    from polhode.harness.site.build import build
    from polhode.models.scenes import find_scene

    with bad_input():
        if reports != REPORTS and not reports.is_dir():
            raise ValueError(f"--reports: got {str(reports)!r}, expected an existing folder")
        own = {name: find_scene(name) for name in scene}
        with tqdm(disable=quiet or None, unit="page", desc="report", leave=False) as progress:

            def say(what: str) -> None:
                progress.set_postfix_str(what)
                progress.update()

            page = build(reports, out or reports / "site", own, say)
    click.echo(f"{page}")
