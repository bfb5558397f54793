"""`polhode shape`, `scenes`, `forms`, `solvers` and `schema`: what there is; `draw`: a picture of the particle."""

import json
import sys
from collections.abc import Mapping, Sequence
from math import inf
from pathlib import Path
from shutil import get_terminal_size
from textwrap import indent
from typing import Any

import click

from polhode.harness.cli import BadInput, RunFailed, bad_input, command
from polhode.harness.commands import setup
from polhode.harness.commands._study_options import as_json, to_json
from polhode.harness.common.progress import Progress
from polhode.harness.common.text import aligned, fitting, on_terminal, scientific, short

# Stands before the summary of a scene on a line of its own, where the terminal is narrow.
_INDENT = 4 * " "
# Endings of pictures.
_FORMATS = (".png", ".svg", ".pdf")
# Rotations up to the last moment that is drawn, at most. An estimate: the run takes seconds.
_MAX_DRAWN_ROTATIONS = 1e5
# Dots per inch of a drawing. An estimate: a frame of 1.75 inches (`harness.pages.figures.motion`) is then 280
# pixels wide.
_DOTS_PER_INCH = 160
# Error of the orientation that is drawn, in rad: it moves a tip by less than a pixel.
_DRAWN_ERROR = 1e-3
# Moments that are drawn: by default, and at most. Estimates: 24 frames make a picture of 42 inches.
_FRAMES = 6
_MAX_FRAMES = 24


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
    click.echo(to_json(content) if as_json else _shape_page(content))


# Rows of the table by attribute of `Ellipsoid`: title and unit.
_SHAPE_ROWS = {
    "semi_axes": ("semi-axis", "as given"),
    "inertia": ("inertia I", "ρ l⁵"),
    "resistance": ("resistance X", "8π μ l³"),
}
_SYMBOLS = (
    "ρ is the particle's density, μ the fluid's viscosity, l the longest semi-axis. --json prints all "
    "digits.\nSt* = St I/(8π X) about the symmetry axis of a spheroid."
)


def _shape_page(content: Mapping[str, Any]) -> str:
    """Properties of a shape by body axis, in six digits."""
    rows = []
    for name, (title, unit) in _SHAPE_ROWS.items():
        rows.append([title, *(f"{value:.6g}" for value in content[name]), unit])
    ratio = content["stokes_star_per_stokes"]
    star = "" if ratio is None else f", St*/St = {ratio:.6g}"
    table = on_terminal(["", "x'", "y'", "z'", "unit"], rows)
    return f"{table}\n\nkind: {content['kind']}{star}\n{fitting(_SYMBOLS)}"


@command()
@click.argument("scene", required=False, shell_complete=setup.scene_names)
@as_json
def scenes(scene: str | None, as_json: bool) -> None:
    """List the built-in scenes; with SCENE, print it as a scene file, to start one of your own from."""
    from polhode.harness.common.scene_words import scene_named, written_slow_time
    from polhode.models.scenes import SCENES

    if scene is not None:
        from polhode.models.files.scene_file import scene_table

        with bad_input():
            table = scene_table(scene_named(scene))
        if as_json:
            click.echo(to_json(table))
        else:
            # The text ends in a newline already.
            click.echo(scene_text(table, written_slow_time(scene)), nl=False)
        return
    rows = []
    for name, scene_there in SCENES.items():
        facts = scene_there.scene
        semi_axes = facts.ellipsoid.semi_axes
        row = {"name": name, "semi_axes": semi_axes, "stokes": facts.stokes, "time": facts.time}
        rows.append({**row, "summary": scene_there.summary})
    click.echo(to_json(rows) if as_json else _scene_list(rows))


def _scene_list(rows: Sequence[Mapping[str, Any]]) -> str:
    """Scenes, one a line; with the summary on a line of its own where a terminal is narrow."""
    header = ["name", "semi-axes", "St", "time"]
    lines = []
    for row in rows:
        # Ten digits, an estimate: all that a scene gives, and no rounding.
        axes = " : ".join(f"{axis:.10g}" for axis in row["semi_axes"])
        lines.append([row["name"], axes, short(row["stokes"]), short(row["time"])])
    summaries = [row["summary"] for row in rows]
    wide = aligned(
        [*header, "summary"], [[*line, text] for line, text in zip(lines, summaries, strict=True)]
    )
    columns = get_terminal_size().columns
    units = "Semi-axes along x', y', z'; time in inverse shear rates."
    if not sys.stdout.isatty() or _widest(wide) <= columns:
        return f"{wide}\n\n{units}"
    head, *narrow = aligned(header, lines).splitlines()
    parts = [head]
    for line, text in zip(narrow, summaries, strict=True):
        parts += [line, indent(fitting(text, width=columns - len(_INDENT)), _INDENT)]
    return "\n".join([*parts, "", units])


def _widest(text: str) -> int:
    """The length of the longest line."""
    return max(map(len, text.splitlines()))


def scene_text(table: dict[str, Any], slow_time: float | None = None) -> str:
    """A scene file with the contents of `polhode.models.files.scene_file.scene_table`, and what its keys mean.

    It gives the duration as `slow_time`, that is t/St, if that is given; else as `time`.
    """
    from polhode.harness.pages.tables import templates

    stokes = table["stokes"]
    time_over_stokes = table["time"] / stokes if 0 < stokes < inf else None
    template = templates(Path(__file__).parent).get_template("scene_file.md")
    return template.render(table, slow_time=slow_time, time_over_stokes=time_over_stokes)


@command()
@as_json
def forms(as_json: bool) -> None:
    """List the forms of the equations, and the scenes for which each is valid."""
    from polhode.models.catalogue import FORMS, form

    rows = []
    lines = []
    for name in FORMS:
        equations = form(name)
        # Every form is available: the keys stand here since the rows of solvers have them.
        rows.append(
            {
                "name": name,
                "summary": equations.summary,
                "available": True,
                "why_not": None,
                "valid_for": equations.valid_for,
            }
        )
        lines += [[name, equations.summary], ["", f"for {equations.valid_for}"]]
    click.echo(
        to_json(rows) if as_json else on_terminal(["name", "what, and for which scenes"], lines)
    )


@command()
@as_json
def solvers(as_json: bool) -> None:
    """List the solvers, the forms each accepts, and what is missing."""
    from polhode.harness.common.wheels import why_missing
    from polhode.solvers.catalogue import SOLVERS, solver

    names = ("name", "summary", "available", "why_not", "accepts")
    rows = []
    lines = []
    for method in map(solver, SOLVERS):
        row = {name: getattr(method, name) for name in names}
        row["why_not"] = why_missing(row["why_not"], method.package)
        rows.append(row)
        lines.append([row["name"], row["summary"], row["why_not"] or method.note or "available"])
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
    "--frames",
    type=click.IntRange(2, _MAX_FRAMES),
    default=_FRAMES,
    help="Moments, first and last included.",
)
def draw(scene: str, out: Path, until: float | None, frames: int) -> None:
    """Draw the particle of SCENE at equispaced moments, between arrows of the flow."""
    from dataclasses import replace

    from polhode.harness.answers.rules import simplest
    from polhode.harness.api import solve
    from polhode.harness.common.files import PartialFile
    from polhode.harness.common.scene_words import scene_named
    from polhode.harness.pages.figures.motion import off_plane, tumbling
    from polhode.harness.references.rotations import rotations
    from polhode.models.scene import SlowStart

    if out.suffix not in _FORMATS:
        raise BadInput(
            f"--out: got {out.name!r}, expected a name that ends in {', '.join(_FORMATS)}"
        )
    with bad_input(), Progress() as progress:
        progress.begin("solving")
        scene_shown = scene_named(scene)
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
            shown, form=simplest(shown), error=_DRAWN_ERROR, want="orientation", samples=frames
        )
        if not solution.success:
            raise RunFailed(f"{solution.form} by {solution.solver}: {solution.status}")
        with PartialFile(out, binary=True) as file:
            tumbling(solution).savefig(file, format=out.suffix[1:], dpi=_DOTS_PER_INCH)
    flow = solution.scene.flow
    if flow is not None and off_plane(flow, solution.times):
        words = (
            "the arrows show the flow at z = 0; its gradient along z (A13, A23, A33) is not drawn"
        )
        click.echo(f"note: {words}", err=True)
    click.echo(f"{out}")
