"""`polhode shape`, `scenes`, `forms`, `solvers` and `schema`: what there is; `draw`: a picture of the particle."""

import json
from pathlib import Path
from typing import Any

import click

from polhode.harness.cli import BadInput, RunFailed, bad_input, command
from polhode.harness.commands import setup
from polhode.harness.commands._study_options import as_json, to_json
from polhode.harness.common.progress import Progress
from polhode.harness.common.text import fitting, on_terminal, scientific, short

# Endings of pictures.
_FORMATS = (".png", ".svg", ".pdf")
# Rotations up to the last moment, at most: a run of seconds.
_MAX_DRAWN_ROTATIONS = 1e5


# Negative numbers are values here, to be refused as such.
@command(context_settings={"ignore_unknown_options": True})
@click.argument("semi_axes", nargs=-1, type=float, metavar="A B C")
@as_json
def shape(semi_axes: tuple[float, ...], as_json: bool) -> None:
    """Print inertia, resistance and kind of the ellipsoid with semi-axes A, B, C, in any unit and order."""
    from polhode.models.shape import Ellipsoid

    if len(semi_axes) != 3:
        raise BadInput(f"A B C: got {len(semi_axes)} numbers, expected 3")
    a, b, c = semi_axes
    with bad_input():
        ellipsoid = Ellipsoid((a, b, c))
    names = ("semi_axes", "inertia", "resistance", "kind", "stokes_star_per_stokes")
    content = {name: getattr(ellipsoid, name) for name in names}
    lines = [f"{name:24}{_text(value)}" for name, value in content.items()]
    click.echo(to_json(content) if as_json else "\n".join([*lines, "", fitting(_UNITS)]))


_UNITS = (
    "Inertia in units of ρ l⁵, resistance of 8π μ l³, with density ρ of the particle, viscosity μ of the fluid, the "
    "longest semi-axis l.\nSt* = St I/(8π X) about the symmetry axis of a spheroid."
)


def _text(value: object) -> str:
    if isinstance(value, tuple):
        return "  ".join(map(_text, value))
    if isinstance(value, float):
        return f"{value:.15g}"
    return "–" if value is None else str(value)


@command()
@click.argument("scene", required=False, shell_complete=setup.scene_names)
@as_json
def scenes(scene: str | None, as_json: bool) -> None:
    """List the built-in scenes; with SCENE, print it as a scene file, to start one of your own from."""
    from polhode.models.scenes import SCENES, find_scene

    if scene is not None:
        from polhode.models.files.scene_file import scene_table

        with bad_input():
            table = scene_table(find_scene(scene))
        click.echo(to_json(table) if as_json else scene_text(table), nl=as_json)
        return
    rows = [{"name": name, "summary": scene.summary} for name, scene in SCENES.items()]
    click.echo(
        to_json(rows)
        if as_json
        else on_terminal(["name", "summary"], [[*row.values()] for row in rows])
    )


def scene_text(table: dict[str, Any]) -> str:
    """A scene file with the contents of `polhode.models.files.scene_file.scene_table`, and what its keys mean."""
    from polhode.harness.pages.tables import templates

    return templates(Path(__file__).parent).get_template("scene_file.md").render(table)


@command()
@as_json
def forms(as_json: bool) -> None:
    """List the forms of the equations, and the scenes for which each is valid."""
    from polhode.models.catalogue import FORMS, form

    all_forms = {name: form(name) for name in FORMS}
    rows = [
        {
            "name": name,
            "summary": one.summary,
            "available": True,
            "why_not": None,
            "valid_for": one.valid_for,
        }
        for name, one in all_forms.items()
    ]
    lines = []
    for name, one in all_forms.items():
        lines += [[name, one.summary], ["", f"for {one.valid_for}"]]
    click.echo(
        to_json(rows) if as_json else on_terminal(["name", "what, and for which scenes"], lines)
    )


@command()
@as_json
def solvers(as_json: bool) -> None:
    """List the solvers, the forms each accepts, and what is missing."""
    from polhode.solvers.catalogue import SOLVERS, solver

    names = ("name", "summary", "available", "why_not", "accepts")
    rows = [{name: getattr(solver(solver_name), name) for name in names} for solver_name in SOLVERS]
    lines = [
        [row["name"], row["summary"], row["why_not"] or solver(row["name"]).note or "available"]
        for row in rows
    ]
    click.echo(to_json(rows) if as_json else on_terminal(["name", "summary", "state"], lines))


@command()
@click.argument("kind", type=click.Choice(["scene", "study", "sweep"]))
def schema(kind: str) -> None:
    """Print the JSON Schema of scene, study or sweep files, by which editors complete and check them."""
    from polhode.harness.ensembles.sweep import SweepTable
    from polhode.harness.studies.study import StudyTable
    from polhode.models.files.scene_file import SceneTable

    json_schema = {"scene": SceneTable, "study": StudyTable, "sweep": SweepTable}[
        kind
    ].model_json_schema()
    dialect = {"$schema": "https://json-schema.org/draft/2020-12/schema"}
    click.echo(json.dumps(dialect | json_schema | {"title": f"polhode {kind} file"}, indent=2))


@command(needs=("matplotlib",))
@click.argument("scene", shell_complete=setup.scene_names)
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    required=True,
    help="Picture to write: PNG, SVG or PDF.",
)
@click.option("--until", type=float, help="Last time shown; by default that of one rotation.")
@click.option(
    "--frames", type=click.IntRange(2, 24), default=6, help="Moments, first and last included."
)
def draw(scene: str, out: Path, until: float | None, frames: int) -> None:
    """Draw the particle of SCENE at equispaced moments, between arrows of the flow."""
    from dataclasses import replace

    from polhode.harness.answers.rules import simplest
    from polhode.harness.api import solve
    from polhode.harness.common.files import PartialFile
    from polhode.harness.pages.figures.motion import tumbling
    from polhode.harness.references.rotations import rotations
    from polhode.models.scene import SlowStart
    from polhode.models.scenes import find_scene

    if out.suffix not in _FORMATS:
        raise BadInput(
            f"--out: got {out.name!r}, expected a name that ends in {', '.join(_FORMATS)}"
        )
    with bad_input(), Progress() as progress:
        progress.begin("solving")
        scene_shown = find_scene(scene)
        alone = "a start by L and E alone" if isinstance(scene_shown.start, SlowStart) else ""
        if unseen := "a sphere" if scene_shown.ellipsoid.kind == "sphere" else alone:
            raise ValueError(
                f"SCENE: got {scene!r}, {unseen}, expected a particle with an orientation to be seen"
            )
        if until is not None and not until > 0:
            raise ValueError(f"--until: got {until:g}, expected a positive time")
        shown = replace(
            scene_shown,
            time=scene_shown.time / max(1.0, rotations(scene_shown)) if until is None else until,
        )
        if until and (count := rotations(shown)) > _MAX_DRAWN_ROTATIONS:
            got = f"got {short(until)}, {scientific(count)} rotations"
            raise ValueError(
                f"--until: {got}, expected at most {short(_MAX_DRAWN_ROTATIONS)} of them"
            )
        solution = solve(
            shown, form=simplest(shown), error=1e-3, want="orientation", samples=frames
        )
        if not solution.success:
            raise RunFailed(f"{solution.form} by {solution.solver}: {solution.status}")
        with PartialFile(out, binary=True) as file:
            tumbling(solution).savefig(file, format=out.suffix[1:], dpi=160)
    click.echo(f"{out}")
