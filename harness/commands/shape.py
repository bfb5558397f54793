"""`polhode shape`: inertia, resistance and kind of an ellipsoid."""

import json

import click

from polhode.harness.cli import BadInput, bad_input


@click.command(
    epilog="Example: polhode shape 1 0.8 0.5",
    # Negative numbers are values here, to be refused as such.
    context_settings={"ignore_unknown_options": True},
)
@click.argument("semi_axes", nargs=-1, type=float, metavar="A B C")
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def shape(semi_axes: tuple[float, ...], as_json: bool) -> None:
    """Print inertia, resistance and kind of the ellipsoid with semi-axes A, B, C, in any unit and order."""
    from polhode.models.shape import Ellipsoid

    if len(semi_axes) != 3:
        raise BadInput(f"A B C: got {len(semi_axes)} numbers, expected 3")
    a, b, c = semi_axes
    with bad_input():
        ellipsoid = Ellipsoid((a, b, c))
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
        click.echo(f"{name:24}{_text(value)}")
    click.echo(f"\n{_UNITS}")


_UNITS = (
    "Inertia in units of ρ l⁵, resistance of 8π μ l³, with density ρ of the particle, viscosity μ of the fluid and\n"
    "the longest semi-axis l. St* = St I/(8π X) about the symmetry axis of a spheroid."
)


def _text(value: object) -> str:
    if isinstance(value, list):
        return "  ".join(map(_text, value))
    return "–" if value is None else f"{value:.15g}" if isinstance(value, float) else str(value)
