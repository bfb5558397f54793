"""`polhode accuracy`: how far the averaged equations are from the full ones, as St grows."""

from pathlib import Path

import click

from polhode.harness.cli import RunFailed, bad_input


@click.command(epilog="Example: polhode accuracy --quick --out look")
@click.option("--out", type=click.Path(path_type=Path), default=Path("reports/accuracy"), show_default=True)
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
@click.option("--quick", is_flag=True, help="St up to 1000 alone: a look, not a result.")
@click.option("--page-only", is_flag=True, help="Measure nothing: write the page anew from the data in --out.")
@click.option("--quiet", is_flag=True, help="No progress.")
def accuracy(out: Path, as_json: bool, quick: bool, page_only: bool, quiet: bool) -> None:
    """Measure the averaged forms' errors in L_x, L_y, L_z and E against certified full solutions.

    For every case of the paper: model error and solver error, the fitted order in 1/St, and the St from which on an
    averaged form meets a given error. Writes a page with figure and data into the folder --out.
    """
    import json

    from polhode.harness.averaging.data import read_data
    from polhode.harness.averaging.measure import measure_all
    from polhode.harness.pages import averaging as page
    from polhode.harness.references.reference import ReferenceFailedError

    with bad_input():
        if page_only and quick:
            raise ValueError("--quick: got --page-only too, expected one of them")
        read = read_data(out) if page_only else None
        out.mkdir(parents=True, exist_ok=True)
    try:
        rows, absent = read or measure_all(quick=quick, quiet=quiet)
    except ReferenceFailedError as error:
        raise RunFailed(str(error)) from None
    written = page.write_page(rows, out, " ".join(["polhode accuracy", *(["--quick"] if quick else [])]), absent)
    click.echo(json.dumps(page.as_json(rows, absent)) if as_json else page.as_text(rows, absent))
    click.echo(f"{written}", err=True)
