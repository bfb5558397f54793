"""`polhode shape`: inertia, resistance and kind of an ellipsoid."""

import json

import click

from polhode.harness.cli import bad_input


@click.command(
    epilog="Example: polhode shape 1 0.8 0.5",
    # Negative numbers are values here, to be refused as such.
    context_settings={"ignore_unknown_options": True},
)
@click.argument("semi_axes", nargs=3, type=float, metavar="A B C")
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def shape(semi_axes: tuple[float, float, float], as_json: bool) -> None:
    """Print inertia, resistance and kind of the ellipsoid with semi-axes A, B, C, in any unit and order."""
    from polhode.models.shape import Ellipsoid

    with bad_input():
        ellipsoid = Ellipsoid(semi_axes)
    content = {
        "semi_axes": list(ellipsoid.semi_axes),
        "inertia": list(ellipsoid.inertia),
        "resistance": list(ellipsoid.resistance),
        "kind": ellipsoid.kind,
        "stokes_star_per_stokes": ellipsoid.stokes_star_per_stokes,
    }
    if as_json:
        click.echo(json.dumps(content))
        return
    for name, value in content.items():
        text = "  ".join(f"{number:.15g}" for number in value) if isinstance(value, list) else value
        click.echo(f"{name:24}{text}")
