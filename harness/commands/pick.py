"""`polhode pick`: what to run for a scene, and what it will cost."""

import json
from dataclasses import asdict
from shlex import quote
from typing import TYPE_CHECKING

import click

from polhode.harness.cli import BadInput, bad_input, command
from polhode.harness.commands import setup
from polhode.harness.commands._study_options import as_json
from polhode.harness.common.text import duration, fitting, in_full, on_terminal, scientific, short
from polhode.solvers.catalogue import SOLVERS

if TYPE_CHECKING:
    from polhode.harness.picking.recommendation import Recommendation

# Ways shown unless all are asked for.
FEW = 8


@command()
@click.argument("scene", shell_complete=setup.scene_names)
@click.option("--error", type=float, default=1e-6, help="Largest error allowed along the run.")
@click.option("--want", default="slow", metavar="slow|orientation", help="L and E over I_max, or orientation in rad.")
@click.option("--samples", type=int, default=201, help="Equispaced times of the output.")
@click.option("--why", is_flag=True, help="Show why this way is the first, and why other forms will not do.")
@click.option("--all", "everything", is_flag=True, help="Show all ways, and why each other one will not do.")
@as_json
def pick(scene: str, error: float, want: str, samples: int, why: bool, everything: bool, as_json: bool) -> None:
    """Rank the ways to run SCENE: form, solver and tolerance, with predicted error, time and their 95 % intervals."""
    if want == "statistics":
        raise BadInput("--want: got 'statistics', expected 'slow' or 'orientation': one run has no statistics")
    from polhode.harness.common.progress import Progress

    with bad_input(), Progress() as progress:
        progress.begin("trial runs at loose tolerances")
        from polhode.harness import api
        from polhode.harness.calibration.scenes import SAMPLES

        found = api.pick(scene, error, want, samples)
    if samples > max(SAMPLES):
        measured = f"laws were fitted to runs of {min(SAMPLES)} to {max(SAMPLES)} samples"
        click.echo(f"note: the {measured}; times for {samples} are extrapolated", err=True)
    if as_json:
        names = ("want", "error", "ranking", "excluded")
        click.echo(json.dumps({name: value for name, value in asdict(found).items() if name in names}))
        return
    click.echo(pick_page(found, everything, why))
    options = f"--error {in_full(error)} --want {want} --samples {samples}"
    click.echo(fitting(f"\nTo run the first: polhode solve {quote(scene)} {options} --out FILE.csv"))


def pick_page(found: "Recommendation", everything: bool, why: bool = False) -> str:
    """What `polhode pick` prints of a recommendation: what to run, the ways, and if asked why."""
    header = ["form", "solver", "tolerance", "error below", "time", "95 % interval", "first run", ""]
    shown = found.ranking if everything else found.ranking[:FEW]
    rows = [
        [
            row.form,
            row.solver,
            short(row.tolerance),
            scientific(row.error.high),
            duration(row.seconds.predicted),
            f"{duration(row.seconds.low)} … {duration(row.seconds.high)}",
            duration(row.first_run_seconds),
            "tied" if row.tied else "",
        ]
        for row in shown
    ]
    notes = _notes(found, len(shown), why or everything)
    # The first run, and then the interval, are what a narrow terminal goes without.
    parts = [fitting(found.summary), on_terminal(header, rows, spare=(5, 6)), *filter(None, [fitting(notes)])]
    header = ["excluded", "solvers", "why"] if everything else ["excluded", "why"]
    if (why or everything) and (excluded := _why(found, everything)):
        parts.append(on_terminal(header, excluded))
    return "\n\n".join(parts)


def _notes(found: "Recommendation", shown: int, why: bool) -> str:
    """What the table does not say of itself."""
    first = found.ranking[0]
    notes = []
    if why:
        size = f"{found.rotations:.3g} rotations and {found.damping_times:.3g} damping times"
        notes.append(f"the run is of {size}\n{first.form} by {first.solver}: {first.reason}")
    if first.tied:
        notes.append("tied: its 95 % interval of time overlaps with the first one's, so that either may be the faster")
    if more := len(found.ranking) - shown:
        notes.append(f"{more} more {'way' if more == 1 else 'ways'}, not cheaper: --all")
    return "\n".join(notes)


def _why(found: "Recommendation", everything: bool) -> list[list[str]]:
    """Excluded methods, those of one form and one reason in one row; else forms that will not do at all, and why."""
    groups: dict[tuple[str, str], list[str]] = {}
    for each in found.excluded:
        groups.setdefault((each.form, each.reason), []).append(each.solver)
    if everything:
        return [
            [form, "all" if len(solvers) == len(SOLVERS) else ", ".join(solvers), reason]
            for (form, reason), solvers in groups.items()
        ]
    ranked = {row.form for row in found.ranking}
    # The reason that most solvers share.
    shared = {form: reason for (form, reason), _ in sorted(groups.items(), key=lambda group: len(group[1]))}
    return [[form, reason] for form, reason in shared.items() if form not in ranked]
