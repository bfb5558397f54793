"""`polhode export`: a store as CSV or JSON Lines."""

from pathlib import Path

import click

from polhode.harness.cli import bad_input


@click.command(epilog="Example: polhode export reports/bench/store.sqlite bench.csv")
@click.argument("store", type=click.Path(path_type=Path))
@click.argument("out", type=click.Path(path_type=Path))
def export(store: Path, out: Path) -> None:
    """Write the records of STORE to OUT, as CSV or JSON Lines by its ending.

    Numbers that JSON has no sign for are the words "Infinity", "-Infinity" and "NaN"; nested results are JSON in CSV's
    cells. The file is called OUT.partial until it is complete.
    """
    from polhode.harness.cli import BadInput
    from polhode.harness.common.store import DamagedStoreError, Store
    from polhode.harness.common.store import export as write

    if not store.is_file() or store.stat().st_size == 0:
        raise BadInput(f"{store}: no such store, expected a file of `polhode bench`")
    with bad_input():
        try:
            with Store(store) as opened:
                write(opened.records(), out)
        except DamagedStoreError as error:
            raise BadInput(str(error)) from None
