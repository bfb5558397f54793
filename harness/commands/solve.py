"""`polhode solve`: one scene, as a table on the terminal or as CSV."""

import sys
from contextlib import nullcontext
from importlib.util import find_spec
from pathlib import Path
from time import process_time
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from polhode.harness import DEFAULT_ERROR, DEFAULT_SAMPLES
from polhode.harness.cli import RunFailed, bad_input, command
from polhode.harness.commands import setup
from polhode.harness.commands.show import scene_text
from polhode.harness.common.files import PartialFile, dumps, write_file
from polhode.harness.common.progress import Progress, expectation
from polhode.harness.common.text import aligned, duration, fitting, short
from polhode.models.catalogue import form as find_form
from polhode.models.spent import SPENT, spent_on

if TYPE_CHECKING:
    from polhode.harness.api import Plan
    from polhode.harness.solution import SceneSolution
    from polhode.solvers.contract import Record

# Rows of the table on the terminal, spread over the run. An estimate: with the words below they fit on a
# terminal of 24 lines.
_SHOWN_ROWS = 11
# Its columns are the CSV's first ones: the orientation is for files.
_SHOWN_COLUMNS = ["t", "t2", "Lx", "Ly", "Lz", "E"]
_WANTS = click.Choice(["slow", "orientation"])
_FILE = click.Path(path_type=Path)


@command()
@click.argument("scene", shell_complete=setup.scene_names)
@click.option(
    "--form",
    shell_complete=setup.form_names,
    help="Of `polhode forms`; by default what fits the scene.",
)
@click.option(
    "--solver",
    shell_complete=setup.solver_names,
    help="Of `polhode solvers`; by default what fits.",
)
@click.option(
    "--tolerance",
    type=float,
    help="The solver's tolerance, from 1e-16 to 1; by default what meets --error.",
)
@click.option(
    "--error",
    type=float,
    default=DEFAULT_ERROR,
    help="Error to meet, where no tolerance is given; exit code 1 if it is not confirmed.",
)
@click.option(
    "--want",
    type=_WANTS,
    default="slow",
    help="What it is of: L and E over I_max, or orientation, in rad.",
)
@click.option(
    "--samples", type=int, default=DEFAULT_SAMPLES, help="Equispaced times, start and end included."
)
@click.option(
    "--out",
    type=_FILE,
    help="CSV or .parquet file, - for standard output; by default a short table.",
)
@click.option("--omega", is_flag=True, help="The angular velocity in space axes too: wx, wy, wz.")
@click.option("--restart", type=_FILE, help="Scene file to write that goes on from the end.")
@click.option(
    "--estimate/--no-estimate", default=True, help="Confirm the run by a second one, for its error."
)
@click.option("--quiet", is_flag=True, help="No progress and no notes.")
@click.option("-v", "--verbose", is_flag=True, help="Say where the time went, on standard error.")
def solve(
    scene: str,
    out: Path | None,
    omega: bool,
    restart: Path | None,
    quiet: bool,
    verbose: bool,
    **options: Any,
) -> None:
    """Solve SCENE and write t, t2, L, E and the rotation matrix at equispaced times."""

    def say(words: str) -> None:
        if not quiet:
            click.echo(fitting(words, sys.stderr), err=True)

    # The processor time so far went into imports.
    SPENT.seconds["import"] = process_time()
    with Progress(quiet) as progress:
        with bad_input():
            target = PartialFile(out, binary=_as_parquet(out)) if out else None
            beside = (
                target.path.with_name(target.path.name + ".json")
                if target and target.atomic
                else None
            )
            for path in filter(None, (beside, restart)):
                # Raises OSError now if the file cannot stand there.
                PartialFile(path)
            _keep_apart(Path(scene), out, beside, restart)
            progress.begin("choosing")
            with spent_on("import"):
                from polhode.harness.api import plan

            planned = plan(scene, **options)
            _check_track(planned, restart)
            if target:
                target.open()
        if verbose:
            # After all else, of a run that failed too.
            click.get_current_context().call_on_close(_say_times)
        at = "at" if options["tolerance"] else "from"
        say(
            f"{planned.form.name} by {planned.solver.name} {at} tolerance {short(planned.tolerance)}"
        )
        if options["tolerance"] and _given("error"):
            say("note: the --tolerance given governs the run: --error is only for choosing one")
        solution = _run(planned, target, beside, progress, omega)
    if restart:
        with bad_input():
            from polhode.models.files.scene_file import scene_table

            write_file(restart, scene_text(scene_table(solution.restart())))
    with spent_on("output"):
        if not target and restart != Path("-"):
            click.echo(_table(solution))
        if planned.requested:
            method = f"{solution.form} by {solution.solver}"
            say(f"{method} at tolerance {short(solution.tolerance)}")
        if target and target.atomic:
            say(f"{out}: {len(planned.times)} rows, solved in {duration(solution.seconds)}")
        for note in [*solution.segments_in_words(), *_empty(planned, solution)]:
            say(f"note: {note}")
        if planned.estimate:
            say(f"error: {solution.error.words()}")
            if solution.error.advice:
                say(f"note: {solution.error.advice}")
    if solution.error.advice and _given("error"):
        raise RunFailed(f"error: {short(options['error'])} is not confirmed; the rows are complete")


def _check_track(planned: "Plan", restart: Path | None) -> None:
    """ValueError unless a track goes on for another run, where `--restart` writes that."""
    # A track is a flow that changes along the way. The run that goes on lasts as long as this one.
    flow = planned.scene.flow
    end = 2 * planned.scene.time
    if restart and flow is not None and not flow.covers(end):
        last = flow.knots[-1]
        raise ValueError(f"--restart: got a track to t = {last:g}, expected one to t = {end:g}")


def _keep_apart(scene: Path, out: Path | None, beside: Path | None, restart: Path | None) -> None:
    """ValueError where a file that is written is another one too."""
    if restart and out and restart.resolve() in (out.resolve(), beside and beside.resolve()):
        raise ValueError(
            f"--restart: got {restart}, expected another file than {out} and {out}.json"
        )
    for option, file in (("--restart", restart), ("--out", out)):
        if file and scene.is_file() and file.resolve() == scene.resolve():
            raise ValueError(f"{option}: got {file}, expected another file than the scene's")


def _say_times() -> None:
    """Write the seconds of each kind of work, and of all, to standard error."""
    rows = [(work, duration(seconds)) for work, seconds in SPENT.seconds.items()]
    click.echo(
        aligned(["time", ""], [*rows, ("in all", duration(sum(SPENT.seconds.values())))]), err=True
    )


def _given(option: str) -> bool:
    """Whether the user gave an option."""
    source = click.get_current_context().get_parameter_source(option)
    return source is not ParameterSource.DEFAULT


def _empty(planned: "Plan", solution: "SceneSolution") -> list[str]:
    """Which columns stay empty, and what would fill them."""
    form = solution.equations
    known_axes = form.known_axes(planned.scene)
    if len(known_axes) == 3:
        return []
    words = "the symmetry axis alone" if known_axes else "no orientation"
    empty = ", ".join(f"R{row}1 to R{row}3" for row in (1, 2, 3) if row - 1 not in known_axes)
    full = "; --form quaternion gives all" * find_form("quaternion").takes(planned.scene)
    return [f"{form.name} knows {words}: {empty} stay empty{full}"]


def _as_parquet(out: Path) -> bool:
    """Whether the file is Parquet; ValueError where nothing can write that, or the ending promises another format."""
    endings = (".csv", ".txt", ".dat", ".parquet")
    if out.suffix not in (*endings, ""):
        raise ValueError(
            f"--out: got {str(out)!r}, expected a name ending in {', '.join(endings)}, or without ending"
        )
    if out.suffix == ".parquet" and find_spec("pyarrow") is None:
        raise ValueError(
            f"--out: got {out}, expected pyarrow installed (pip install pyarrow), or a .csv file"
        )
    return out.suffix == ".parquet"


def _run(
    planned: "Plan",
    target: PartialFile | None,
    beside: Path | None,
    progress: Progress,
    omega: bool,
) -> "SceneSolution":
    """Solve, and write what is finished.

    RunFailed if the run fails or is interrupted, the error cannot be attained, or the disk is full.
    `beside` is the JSON file that says where the rows come from.
    """
    from polhode.harness.answers.request import NotAttainableError
    from polhode.harness.solution import write_csv
    from polhode.solvers.solve import Interrupted

    def watch(record: "Record") -> None:
        # A segment may count time in a unit of its own, `record.unit`.
        end = record.unit * float(record.times[-1])
        last = float(planned.times[-1])

        def share() -> float:
            return record.reached / end

        def note(seconds: float) -> str:
            words = expectation(share(), seconds)
            if end < last:
                # The segments that follow may take any time.
                words = f"it has come to t = {record.reached:.3g} of {last:.3g}"
            return f"{words}; Ctrl-C keeps what is finished" if words else ""

        progress.begin(f"solving by {planned.solver.name}", share, note)

    progress.begin("compiling")
    try:
        with target or nullcontext() as file:
            try:
                solution = planned.run(watch)
            except Interrupted as interruption:
                # A run that is interrupted while it is confirmed has all rows: it lacks its error alone.
                solution = planned.observed(interruption.solution)
            progress.begin("writing")
            if file:
                with spent_on("output"):
                    if "b" in file.mode:
                        solution.frame(omega).to_parquet(file)
                    else:
                        write_csv(file, solution.table(omega), progress.advance)
            if not solution.success:
                where = f"in {target.partial}" if target else "finished"
                rows = f"{len(solution.times)} of {len(planned.times)} rows are {where}"
                why = "; ".join(filter(None, (solution.message, _remedy(planned, solution))))
                raise RunFailed(f"{solution.status}: {rows}. {why}".strip())
        if beside:
            write_file(beside, dumps(solution.provenance()) + "\n")
    except NotAttainableError as error:
        raise RunFailed(str(error)) from None
    except BrokenPipeError:
        # The reader of the pipe has closed it: no failure of the disk.
        raise
    except OSError as full:
        place = full.filename or (target.path if target else "-")
        raise RunFailed(
            f"{place}: {full.strerror or full}, expected room for {len(planned.times)} rows"
        ) from None
    return solution


def _remedy(planned: "Plan", solution: "SceneSolution") -> str:
    """Advice on a failure at a tolerance that was given with neither form nor solver."""
    from polhode.harness.answers.rules import first_tolerance

    stopped = str(solution.status) == "interrupted"
    if stopped or planned.requested or _given("form") or _given("solver"):
        return ""
    tighter = first_tolerance(planned.scene, planned.methods[0], DEFAULT_ERROR, "slow")
    return f"do: --tolerance {short(tighter)}" if tighter < planned.tolerance else ""


def _table(solution: "SceneSolution") -> str:
    """Some of the rows for the terminal, the first and the last among them, and where the others are."""
    import numpy as np

    table = solution.table()[:, : len(_SHOWN_COLUMNS)]
    places = np.linspace(0, len(table) - 1, min(_SHOWN_ROWS, len(table))).round().astype(int)
    rows = []
    for t, t2, *slow in table[places].tolist():
        rows.append([_cell(t), _cell(t2), *(_cell(value, " ") for value in slow)])
    rate = "shear rate γ̇" if solution.scene.flow is None else "reference rate γ̇"
    largest = max(solution.scene.ellipsoid.inertia)
    units = (
        f"Units: t in 1/γ̇, L in ρ l⁵ γ̇, E in ρ l⁵ γ̇², with the {rate}, the particle's density ρ and "
        f"its longest semi-axis l; t2 = t/St. I_max = {largest:.6g} ρ l⁵."
    )
    note = f"{len(rows)} of {len(table)} rows; --out FILE.csv writes all, in full and with the rotation matrix"
    return f"{aligned(_SHOWN_COLUMNS, rows)}\n\n{fitting(units)}\n{fitting(note)}"


def _cell(value: float, sign: str = "") -> str:
    """A number of the table at six digits, `sign` before a positive one; a dash for NaN."""
    return f"{sign}–" if value != value else f"{value:{sign}.6g}"
