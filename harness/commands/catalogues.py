"""`polhode forms` and `polhode solvers`: the catalogues."""

import json

import click

from polhode.harness.common.text import on_terminal


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
    if as_json:
        click.echo(json.dumps(rows))
        return
    lines = [line for row in rows for line in ([row["name"], row["summary"]], ["", f"for {row['valid_for']}"])]
    click.echo(on_terminal(["name", "what, and for which scenes"], lines))


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
    if as_json:
        click.echo(json.dumps(rows))
        return
    lines = [[row["name"], row["summary"], row["why_not"] or "available"] for row in rows]
    click.echo(on_terminal(["name", "summary", "state"], lines))
