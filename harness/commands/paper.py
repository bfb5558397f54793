"""`polhode paper` and `accuracy`: each claim of the paper with a verdict, and how far averaging is from the truth."""

import json
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

import click

from polhode.harness.cli import RunFailed, bad_input, command
from polhode.harness.commands._study_options import FOLDER, as_json, out_folder, quiet

# Again in `averaging.second_order` and `averaging.hybrid`, so that `--help` needs no numerics.
PARTS = {"1": (), "2": ("orders", "resonances", "cost"), "hybrid": ("errors", "speed")}
FOLDERS = {"1": Path("reports/accuracy"), "2": Path("reports/second-order"), "hybrid": Path("reports/hybrid")}


@command()
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
    """Regenerate the paper's figures and tables: all of them, or the ITEMs (or sections) named."""
    from polhode.harness.paper.claims import find_items, section_of
    from polhode.harness.paper.item import Grid
    from polhode.harness.paper.pages import run

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


@command()
@click.option(
    "--order",
    type=click.Choice(list(FOLDERS)),
    default="1",
    help="1: both orders in the paper's cases. 2: second order beyond them, through resonances, and its cost. "
    "hybrid: second order with windows of the full equations, on random starts.",
)
@click.option("--out", type=FOLDER, help="Folder; by default reports/accuracy, second-order or hybrid.")
@as_json
@click.option("--quick", is_flag=True, help="St up to 1000 or a few cases alone: a look, not a result.")
@click.option("--part", type=click.Choice([*PARTS["2"], *PARTS["hybrid"]]), help="Measure that alone anew.")
@click.option("--page-only", is_flag=True, help="Measure nothing: write the page anew from the data in --out.")
@quiet
def accuracy(
    order: str, out: Path | None, as_json: bool, quick: bool, part: str | None, page_only: bool, quiet: bool
) -> None:
    """Measure the averaged forms' errors in L_x, L_y, L_z and E against full solutions."""
    from polhode.harness.averaging import hybrid as hybrid_study
    from polhode.harness.averaging.data import PaperStudy, SecondOrderStudy, read_study
    from polhode.harness.averaging.measure import measure_all
    from polhode.harness.averaging.second_order import measure_study
    from polhode.harness.common.files import dumps
    from polhode.harness.pages.averaging import first_order, hybrid, second_order
    from polhode.harness.references.reference import ReferenceFailedError

    pages: dict[str, Any] = {"1": first_order, "2": second_order, "hybrid": hybrid}
    kinds: dict[str, Any] = {"1": PaperStudy, "2": SecondOrderStudy, "hybrid": hybrid_study.Study}
    page, out = pages[order], out or FOLDERS[order]
    with bad_input():
        if quick + bool(part) + page_only > 1:
            raise ValueError("--quick, --part, --page-only: got several of them, expected one")
        if part and part not in PARTS[order]:
            fitting = next(each for each, parts in PARTS.items() if part in parts)
            raise ValueError(f"--part: got --order {order}, expected --order {fitting} for {part!r}")
        found: Any = read_study(kinds[order], out) if part or page_only else None
        out.mkdir(parents=True, exist_ok=True)
    try:
        if order == "1" and not page_only:
            found = measure_all(quick=quick, quiet=quiet)
        elif not page_only:
            measure: Any = measure_study if order == "2" else hybrid_study.measure
            found = measure(found, part or "", quick=quick, quiet=quiet)
    except ReferenceFailedError as error:
        raise RunFailed(str(error)) from None
    page.write_page(found, out, "polhode accuracy" + f" --order {order}" * (order != "1") + " --quick" * quick)
    if as_json:
        click.echo(dumps(page.as_json(found) if order == "1" else asdict(found)))
    else:
        click.echo(page.as_text(found) if order == "1" else "\n".join(page.findings(found)))
    click.echo(str(out / "README.md"), err=True)
