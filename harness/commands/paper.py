"""`polhode paper`: every figure and table of the paper from this code, with a verdict on each claim."""

import json
from functools import partial
from pathlib import Path

import click

from polhode.harness.cli import RunFailed, bad_input
from polhode.harness.commands._study_options import out_folder, quiet


@click.command(epilog="Example: polhode paper period-change spheroids")
@click.argument("names", metavar="[ITEM…]", nargs=-1)
@out_folder("reports/paper")
@click.option("--force", is_flag=True, help="Compute again even what is there.")
@click.option("--redraw", is_flag=True, help="Draw from the data that are there, whatever code made them.")
@click.option("--quick", is_flag=True, help="Coarse grids: a look, not a result.")
@click.option("--list", "listed", is_flag=True, help="Print the items and stop.")
@click.option("--json", "as_json", is_flag=True, help="With --list: print JSON.")
@quiet
def paper(
    names: tuple[str, ...], out: Path, force: bool, redraw: bool, quick: bool, listed: bool, as_json: bool, quiet: bool
) -> None:
    """Regenerate the paper's figures and tables: all of them, or the ITEMs (or sections) named.

    Each item states what the paper claims, what is computed, and the number that confirms, sharpens or corrects it.
    Data that today's code has made before are kept, so that an interrupted run goes on where it stopped.
    """
    from polhode.harness.paper.claims import find_items, section_of
    from polhode.harness.paper.engine import run
    from polhode.harness.paper.item import Grid

    with bad_input():
        items = find_items(names)
        if force and redraw:
            raise ValueError("--force computes anew and --redraw does not, expected one of them")
        if as_json and not listed:
            raise ValueError("--json: got it without --list, expected both: the results stand in the folder's files")
    if listed:
        rows = [{"name": item.name, "section": section_of(item).name, "title": item.title} for item in items]
        click.echo(json.dumps(rows) if as_json else "\n".join(f"{row['name']:28}{row['title']}" for row in rows))
        return
    report = (lambda _: None) if quiet else partial(click.echo, err=True)
    with bad_input():
        out.mkdir(parents=True, exist_ok=True)
    failed = run(items, out, report, grid=Grid.REDUCED if quick else Grid.FULL, force=force, redraw=redraw)
    if failed:
        raise RunFailed(f"failed: {', '.join(failed)}")
    click.echo(f"{out / 'README.md'}")
