"""`polhode forms` and `polhode solvers`: the catalogues."""

import json

import click

from polhode.harness.text import aligned


@click.command(epilog="Example: polhode forms --json")
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def forms(as_json: bool) -> None:
    """List the forms of the equations, and the scenes for which each is valid."""
    from polhode.models.catalogue import FORMS, form

    rows = [
        {
            "name": name,
            "summary": form(name).summary,
            "available": True,
            "why_not": None,
            "valid_for": form(name).valid_for,
        }
        for name in FORMS
    ]
    _print(rows, ["name", "summary", "valid_for"], as_json)


@click.command(epilog="Example: polhode solvers --json")
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def solvers(as_json: bool) -> None:
    """List the solvers, the forms each accepts, and what is missing."""
    from polhode.solvers.catalogue import SOLVERS, solver

    rows = [
        {
            "name": name,
            "summary": solver(name).summary,
            "available": solver(name).available,
            "why_not": solver(name).why_not,
            "accepts": solver(name).accepts,
        }
        for name in SOLVERS
    ]
    for row in rows:
        row["state"] = row["why_not"] or "available"
    _print(rows, ["name", "summary", "state"], as_json)


def _print(rows: list[dict[str, object]], columns: list[str], as_json: bool) -> None:
    if as_json:
        click.echo(json.dumps([{key: value for key, value in row.items() if key != "state"} for row in rows]))
    else:
        click.echo(aligned(columns, [[row[column] for column in columns] for row in rows]))
