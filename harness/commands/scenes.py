"""`polhode scenes`: the built-in scenes, and scene files to start from."""

import json
from typing import Any

import click

from polhode.harness.cli import bad_input
from polhode.harness.commands import completers as completion


@click.command(epilog="Example: polhode scenes paper > mine.toml")
@click.argument("scene", required=False, shell_complete=completion.scenes)
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def scenes(scene: str | None, as_json: bool) -> None:
    """List the built-in scenes; with SCENE, print it as a scene file, to start one of your own from."""
    from polhode.harness.common.text import aligned
    from polhode.harness.studies.scenes import find_scene
    from polhode.models.scene_file import scene_table
    from polhode.models.scenes import SCENES

    if scene is not None:
        with bad_input():
            table = scene_table(find_scene(scene))
        click.echo(json.dumps(table) if as_json else scene_text(table), nl=as_json)
    elif as_json:
        click.echo(json.dumps([{"name": name, "summary": each.summary} for name, each in SCENES.items()]))
    else:
        click.echo(aligned(["name", "summary"], [[name, each.summary] for name, each in SCENES.items()]))


def scene_text(table: dict[str, Any]) -> str:
    """A scene file with the contents of `polhode.models.scene_file.scene_table`, and what its keys mean."""
    lines = [
        f"stokes = {table['stokes']!r}  # St, from 0 to inf",
        f"time = {table['time']!r}  # in inverse shear rates; or: slow_time = t/St",
        "[shape]",
        f"semi_axes = {table['shape']['semi_axes']}  # along x', y', z', any unit",
        "[start]",
        *(f"{name} = {value}  # {_MEANINGS[name]}" for name, value in table["start"].items()),
    ]
    return "\n".join(lines) + "\n"


_MEANINGS = {
    "euler_angles": "θ, φ, ψ in rad",
    "euler_rates": "in shear rates; or: at_rest = true",
    "quaternion": "turns the body from the space axes to its place; real part first",
    "angular_velocity": "along the body axes, in shear rates; or: at_rest = true",
    "angular_momentum": "L_x, L_y, L_z without St; averaged forms alone",
    "energy": "E without St",
}
