"""`polhode draw`: the tumbling particle as a picture."""

from pathlib import Path

import click

from polhode.harness.cli import BadInput, RunFailed, bad_input
from polhode.harness.commands import setup

FORMATS = (".png", ".svg", ".pdf")


@click.command(epilog="Example: polhode draw paper --until 12 --out tumbling.png")
@click.argument("scene", shell_complete=setup.scene_names)
@click.option("--out", type=click.Path(path_type=Path), required=True, help="Picture to write: PNG, SVG or PDF.")
@click.option("--until", type=float, help="Last time shown; by default that of one rotation.")
@click.option("--frames", type=click.IntRange(2, 24), default=6, help="Moments, first and last included.")
def draw(scene: str, out: Path, until: float | None, frames: int) -> None:
    """Draw the particle of SCENE at equispaced moments, between arrows of the flow."""
    from dataclasses import replace

    from polhode.harness.api import solve
    from polhode.harness.common.files import PartialFile
    from polhode.harness.pages.figures.particle import tumbling
    from polhode.harness.picking.choice import simplest
    from polhode.harness.references.rotations import rotations
    from polhode.harness.studies.scenes import find_scene

    if out.suffix not in FORMATS:
        raise BadInput(f"--out: got {out.name!r}, expected a name that ends in {', '.join(FORMATS)}")
    with bad_input():
        found = find_scene(scene)
        if found.ellipsoid.kind == "sphere":
            raise ValueError(f"SCENE: got {scene!r}, a sphere, expected a particle with an orientation to be seen")
        if until is None:
            until = found.time / max(1.0, rotations(found))
        shown = replace(found, time=until)
        solution = solve(shown, form=simplest(shown, "orientation")[0], error=1e-3, want="orientation", samples=frames)
        if not solution.success:
            raise RunFailed(f"{solution.form} by {solution.solver}: {solution.status}")
        with PartialFile(out, binary=True) as file:
            tumbling(solution).savefig(file, format=out.suffix[1:], dpi=160)
    click.echo(f"{out}")
