"""`polhode pick`: what to run for a scene, and what it will cost."""

import json
from dataclasses import asdict
from typing import TYPE_CHECKING

import click

from polhode.harness import completion
from polhode.harness.cli import BadInput, bad_input

if TYPE_CHECKING:
    from polhode.harness.pick import Recommendation


@click.command(epilog="Example: polhode pick paper --error 1e-6 --want slow")
@click.argument("scene", shell_complete=completion.scenes)
@click.option("--error", type=float, default=1e-6, show_default=True, help="Largest error allowed along the run.")
@click.option(
    "--want",
    default="slow",
    show_default=True,
    metavar="slow|orientation",
    help="L and E, their error over I_max, or the orientation, its error in rad.",
)
@click.option("--samples", type=int, default=201, show_default=True, help="Equispaced times of the output.")
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def pick(scene: str, error: float, want: str, samples: int, as_json: bool) -> None:
    """Rank the ways to run SCENE: form, solver and tolerance, with predicted error and time and their 95 % intervals.

    A loose run, of milliseconds, tells how many rotations there are and how they magnify errors; laws fitted on
    measurements tell the rest. `polhode solve SCENE --error E --want W` runs the first row.
    """
    if want == "statistics":
        raise BadInput("--want: got 'statistics', expected 'slow' or 'orientation': one run has no statistics")
    if samples < 2:
        raise BadInput(f"--samples: got {samples}, expected at least 2")
    with bad_input():
        from polhode.harness.pick import pick as recommend
        from polhode.harness.scenes import find_scene

        found = recommend(find_scene(scene), error, want, samples)
    if as_json:
        names = ("want", "error", "ranking", "excluded")
        click.echo(json.dumps({name: value for name, value in asdict(found).items() if name in names}))
        return
    click.echo(_page(found))


def _page(found: "Recommendation") -> str:
    from polhode.harness.text import aligned, duration, scientific

    header = ["form", "solver", "tolerance", "error", "95 % interval", "time", "95 % interval", "first run", ""]
    rows = [
        [
            row.form,
            row.solver,
            f"{row.tolerance:g}",
            scientific(row.error.predicted),
            f"{scientific(row.error.low)} … {scientific(row.error.high)}",
            duration(row.seconds.predicted),
            f"{duration(row.seconds.low)} … {duration(row.seconds.high)}",
            duration(row.first_run_seconds),
            row.reason,
        ]
        for row in found.ranking
    ]
    title = (
        f"{found.want} error at most {found.error:g}; "
        f"{found.rotations:.3g} rotations, {found.damping_times:.3g} damping times"
    )
    return "\n".join([title, "", aligned(header, rows), "", "Excluded:", aligned(["form", "solvers", ""], _why(found))])


def _why(found: "Recommendation") -> list[list[str]]:
    """Excluded methods, those of one form and one reason in one row."""
    from polhode.solvers.catalogue import SOLVERS

    groups: dict[tuple[str, str], list[str]] = {}
    for each in found.excluded:
        groups.setdefault((each.form, each.reason), []).append(each.solver)
    return [
        [form, "all" if len(solvers) == len(SOLVERS) else ", ".join(solvers), reason]
        for (form, reason), solvers in groups.items()
    ]
