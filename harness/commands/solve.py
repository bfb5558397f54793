"""`polhode solve`: one scene, written as CSV."""

from pathlib import Path
from typing import TYPE_CHECKING

import click
from click.core import ParameterSource

from polhode.harness.cli import BadInput, RunFailed, bad_input
from polhode.harness.commands import completers as completion

if TYPE_CHECKING:
    from polhode.harness.common.files import PartialFile
    from polhode.harness.common.progress import Progress
    from polhode.harness.picking.choice import Choice
    from polhode.models.form import Form
    from polhode.models.problem import Problem
    from polhode.models.scene import Scene
    from polhode.solvers.contract import Record, Solver

# A CSV file of more rows would hold gigabytes.
MOST_SAMPLES = 10_000_000


@click.command(epilog="Example: polhode solve paper --samples 501 --out paper.csv")
@click.argument("scene", shell_complete=completion.scenes)
@click.option(
    "--form",
    "form_name",
    shell_complete=completion.forms,
    help="Form of the equations (`polhode forms`); by default what fits the scene.",
)
@click.option(
    "--solver",
    "solver_name",
    shell_complete=completion.solvers,
    help="Solver (`polhode solvers`); by default what fits the scene.",
)
@click.option("--tolerance", type=float, help="The solver's tolerance, from 1e-16 to 1; by default what meets --error.")
@click.option("--error", type=float, default=1e-6, show_default=True, help="Error wanted, where no tolerance is given.")
@click.option(
    "--want",
    type=click.Choice(["slow", "orientation"]),
    default="slow",
    show_default=True,
    help="What that error is of: L and E, over I_max, or the orientation, in rad.",
)
@click.option("--samples", type=int, default=201, show_default=True, help="Equispaced times, start and end included.")
@click.option(
    "--out", type=click.Path(path_type=Path), required=True, help="CSV file to write; - or /dev/stdout to print."
)
@click.option("--quiet", is_flag=True, help="No progress and no notes.")
def solve(
    scene: str,
    form_name: str | None,
    solver_name: str | None,
    tolerance: float | None,
    error: float,
    want: str,
    samples: int,
    out: Path,
    quiet: bool,
) -> None:
    """Solve SCENE and write t, t2, L, E and the rotation matrix at equispaced times.

    Until it is complete the file is called FILE.partial; a run that fails or is interrupted leaves that behind. A form
    or solver that is not expected to meet the error runs all the same, and a note on standard error says why.
    """
    from polhode.harness.common.files import PartialFile
    from polhode.harness.common.progress import Progress
    from polhode.harness.common.text import duration
    from polhode.harness.picking.choice import check_tolerance, choose
    from polhode.harness.studies.scenes import find_scene
    from polhode.models.catalogue import form as find_form
    from polhode.solvers.catalogue import solver as find_solver

    if not 2 <= samples <= MOST_SAMPLES:
        raise BadInput(f"--samples: got {samples}, expected a number from 2 to {MOST_SAMPLES}")
    with Progress(quiet) as progress:
        with bad_input():
            target = PartialFile(out)
            what = find_scene(scene)
            # What is plainly wrong is refused before anything is tried.
            if tolerance is not None and tolerance > 0:
                check_tolerance(tolerance)
            if form_name is not None:
                find_form(form_name).check(what)
            if solver_name is not None:
                find_solver(solver_name)
            progress.begin("choosing")
            choice = choose(what, form_name, solver_name, tolerance, error, want, samples)
            form = find_form(choice.form)
            problem = form.problem(what)
            method = find_solver(choice.solver)
            if not method.available:
                raise BadInput(f"--solver: {method.why_not}")
            method.check(problem)
            target.open()
        if not quiet:
            click.echo(f"{choice.form} by {choice.solver} at tolerance {choice.tolerance:g}", err=True)
            for note in [*_notes(choice, tolerance), *_empty(form, what)]:
                click.echo(f"note: {note}", err=True)
        seconds = _write(what, form, problem, method, choice.tolerance, samples, target, progress)
    if not quiet and target.atomic:
        click.echo(f"{out}: {samples} rows, solved in {duration(seconds)}", err=True)


def _notes(choice: "Choice", tolerance: float | None) -> list[str]:
    """What the user should know of what is run: that the error will not be met, or has no say."""
    asked = click.get_current_context().get_parameter_source("error") is not ParameterSource.DEFAULT
    ruled = "the --tolerance given governs the run: --error is only for choosing one"
    return [ruled] * (asked and tolerance is not None) + [choice.note] * bool(choice.note)


def _empty(form: "Form", scene: "Scene") -> list[str]:
    """What of the rotation matrix the form does not know, and who does."""
    known = form.known_axes(scene)
    if len(known) == 3:
        return []
    what = "the symmetry axis alone" if known else "no orientation"
    empty = ", ".join(f"R{row}1 to R{row}3" for row in (1, 2, 3) if row - 1 not in known)
    return [f"{form.name} knows {what}: {empty} stay empty; --form quaternion gives all"]


def _write(
    scene: "Scene",
    form: "Form",
    problem: "Problem",
    method: "Solver",
    tolerance: float,
    samples: int,
    target: "PartialFile",
    progress: "Progress",
) -> float:
    """Solve and write; the seconds that the solver took.

    Raises
    ------
    RunFailed
        If the run fails or is interrupted, or the disk is full; finished rows are written.
    """
    import numpy as np

    from polhode.harness.common.observables_csv import write_header, write_rows
    from polhode.solvers.solve import Interrupted
    from polhode.solvers.solve import solve as run

    def watch(record: "Record") -> None:
        progress.begin(f"solving by {method.name}", lambda: record.reached / problem.end)

    progress.begin("compiling")
    how, times = "", np.linspace(0.0, problem.end, samples)
    try:
        with target as file:
            write_header(file)
            try:
                solution = run(problem, method, tolerance, times, watch=watch)
            except Interrupted as interruption:
                solution, how = interruption.solution, "interrupted"
            reached = solution.times * problem.time_unit
            progress.begin("writing")
            write_rows(file, scene, reached, form.observe(scene, solution.states), progress.advance)
            if how or not solution.success:
                rows = f"{len(reached)} of {samples} rows are in {target.partial}"
                raise RunFailed(f"{how or solution.status}: {rows}. {solution.message}".strip())
    except OSError as full:
        raise RunFailed(f"{target.path}: {full.strerror or full}, expected room for {samples} rows") from None
    return solution.seconds
