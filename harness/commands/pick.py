"""`polhode pick`: what to run for a scene, and what it will cost; `validate`: how good that is."""

from dataclasses import asdict
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING

import click

from polhode.harness import DEFAULT_ERROR, DEFAULT_SAMPLES
from polhode.harness.cli import RunFailed, bad_input, command
from polhode.harness.commands import setup
from polhode.harness.commands._study_options import (
    as_json,
    command_line,
    loading,
    out_folder,
    page_only,
    quiet,
    resume,
    stored,
    to_json,
)
from polhode.harness.common.text import (
    cells,
    command_on_terminal,
    duration,
    fitting,
    on_terminal,
    short,
)
from polhode.solvers.catalogue import SOLVERS

if TYPE_CHECKING:
    from polhode.harness.answers.recommendation import Recommendation

# Rows shown unless --all is given. An estimate: with the words around them they fit on a terminal of 24 lines.
FEW = 8
# Columns by title: the fields of `recommendation.RankedRun`, and their formats (`harness.common.text.cells`).
_ROWS = {
    "form": "{form}",
    "solver": "{solver}",
    "tolerance": "{tolerance:short}",
    "error below": "{error.high:error}",
    "time": "{seconds.predicted:time}",
    "interval": "{seconds.low:time} … {seconds.high:time}",
    "first run": "{first_run_seconds:time}",
}
# The seed of the held-out scenes, unless --seed gives another. Any seed would do that no fit was made with.
_HELD_OUT_SEED = 4001
# Held-out scenes unless --scenes gives another number. An estimate: a share of them is then known to 3.5 %
# at most, one standard deviation; half as many make that 5 %.
_HELD_OUT_SCENES = 200


@command()
@click.argument("scene", shell_complete=setup.scene_names)
@click.option(
    "--error", type=float, default=DEFAULT_ERROR, help="Largest error allowed along the run."
)
@click.option(
    "--want",
    default="slow",
    metavar="slow|orientation",
    help="L and E over I_max, or orientation in rad.",
)
@click.option(
    "--samples", type=int, default=DEFAULT_SAMPLES, help="Equispaced times of the output."
)
@click.option(
    "--form", help="Race this form too, by every solver.", shell_complete=setup.form_names
)
@click.option(
    "--solver", help="Race this solver too, on every form.", shell_complete=setup.solver_names
)
@click.option(
    "--why", is_flag=True, help="Show why this run is the first, and why other forms will not do."
)
@click.option(
    "--all",
    "everything",
    is_flag=True,
    help="Race every method, show all rows, and why others will not do.",
)
@as_json
@quiet
def pick(
    scene: str,
    error: float,
    want: str,
    samples: int,
    form: str | None,
    solver: str | None,
    why: bool,
    everything: bool,
    as_json: bool,
    quiet: bool,
) -> None:
    """Rank runs of SCENE: form, solver and tolerance, with predicted error, time and their intervals."""
    from polhode.harness.common.progress import Progress

    with bad_input(), Progress(quiet) as progress:
        progress.begin("racing methods on the scene", note=_racing)
        from polhode.harness import api

        recommendation = api.pick(
            scene, error, want, samples, form=form, solver=solver, everything=everything
        )
    if as_json:
        rows = {"ranking": recommendation.ranking, "excluded": recommendation.excluded}
        lists = {name: [*map(asdict, methods)] for name, methods in rows.items()}
        click.echo(to_json({"want": recommendation.want, "error": recommendation.error, **lists}))
        return
    click.echo(pick_page(recommendation, everything, why))
    first = recommendation.ranking[0]
    method = ["--form", quote(first.form), "--solver", quote(first.solver)]
    settings = ["--tolerance", short(first.tolerance), "--samples", str(samples)]
    words = ["polhode", "solve", quote(scene), *method, *settings]
    click.echo(f"\nTo run the first:\n{command_on_terminal([*words, '--out', 'FILE.csv'])}")


def _racing(seconds: float) -> str:
    """Words of the progress line after `seconds` of the race."""
    return f"methods have raced on the scene for {duration(seconds)}"


def pick_page(recommendation: "Recommendation", everything: bool, why: bool = False) -> str:
    """The page of `polhode pick` on a recommendation: what to run, the rows, and the reasons if `why`."""
    shown = recommendation.ranking if everything else recommendation.ranking[:FEW]
    rows = [
        [*texts, "tied" * row.tied] for texts, row in zip(cells(shown, _ROWS), shown, strict=True)
    ]
    notes = _notes(recommendation, len(shown), why or everything)
    # A narrow terminal goes without the interval of the time.
    interval = list(_ROWS).index("interval")
    parts = [
        fitting(recommendation.summary),
        on_terminal([*_ROWS, ""], rows, spare=(interval,)),
        *filter(None, [fitting(notes)]),
    ]
    header = ["excluded", "solvers", "why"] if everything else ["excluded", "why"]
    if (why or everything) and (excluded := _why(recommendation, everything)):
        parts.append(on_terminal(header, excluded))
    return "\n\n".join(parts)


def _notes(recommendation: "Recommendation", shown: int, why: bool) -> str:
    """Notes below the table, one a line; `shown` is the number of its rows."""
    from polhode.harness.answers.race import TIED

    first = recommendation.ranking[0]
    notes = []
    if why:
        size = f"{recommendation.rotations:.3g} rotations and {recommendation.damping_times:.3g} damping times"
        notes.append(f"the run is of {size}\n{first.form} by {first.solver}: {first.reason}")
    if first.tied:
        notes.append(
            f"tied: within {TIED:g} times the first one's time, so that either may be the faster"
        )
    if more := len(recommendation.ranking) - shown:
        notes.append(f"{more} more {'row' if more == 1 else 'rows'}, not cheaper: --all")
    return "\n".join(notes)


def _why(recommendation: "Recommendation", everything: bool) -> list[list[str]]:
    """Rows of the table of excluded methods.

    With `everything`: form, solvers and reason, a row for each form and reason. Else form and reason, for the
    forms alone that no row of the ranking has.
    """
    groups: dict[tuple[str, str], list[str]] = {}
    for row in recommendation.excluded:
        groups.setdefault((row.form, row.reason), []).append(row.solver)
    if everything:
        return [
            [form, "all" if len(solvers) == len(SOLVERS) else ", ".join(solvers), reason]
            for (form, reason), solvers in groups.items()
        ]
    ranked = {row.form for row in recommendation.ranking}
    # The reason that most solvers share: it comes last, and replaces the others of its form.
    shared = {
        form: reason
        for (form, reason), _ in sorted(groups.items(), key=lambda group: len(group[1]))
    }
    return [[form, reason] for form, reason in shared.items() if form not in ranked]


@command(needs=("pandas", "matplotlib"))
@out_folder("reports/pick")
@click.option(
    "--scenes", type=click.IntRange(min=1), default=_HELD_OUT_SCENES, help="Held-out scenes."
)
@click.option(
    "--seed", type=click.IntRange(min=0), default=_HELD_OUT_SEED, help="What they are drawn from."
)
@click.option(
    "--errors",
    type=click.IntRange(min=0),
    default=0,
    help="Scenes of each sort whose stated errors are held against references instead.",
)
@click.option(
    "--time",
    "times",
    type=click.IntRange(min=0),
    default=0,
    help="Scenes on which `solve` is timed against plain practice instead.",
)
@click.option(
    "--load",
    type=click.IntRange(min=0),
    default=0,
    help="With --time: other processes that keep the processors busy.",
)
@click.option(
    "--ablation",
    is_flag=True,
    help="Leave out each part of the race in turn instead, and compare the choices.",
)
@click.option(
    "--fit",
    is_flag=True,
    help="With --errors: fit the factors of the statements, first tolerances and steps anew.",
)
@page_only
@resume
@quiet
def validate(
    out: Path,
    scenes: int,
    seed: int,
    errors: int,
    times: int,
    load: int,
    ablation: bool,
    fit: bool,
    page_only: bool,
    resume: bool,
    quiet: bool,
) -> None:
    """Ask `pick` about scenes held out, measure them, print how good it was, and write the page."""
    if page_only:
        from polhode.harness.pages.pick import rewrite_page

        with bad_input():
            if errors or times or ablation or fit:
                raise ValueError(
                    "--page-only: got --errors, --time, --ablation or --fit, expected none of them"
                )
            click.echo(f"{rewrite_page(out)}")
        return
    if errors:
        _validate_errors(out, errors, seed, fit, resume, quiet)
        return
    if times:
        _validate_times(out, times, seed, load, quiet)
        return
    if ablation:
        _validate_parts(out, scenes, seed, resume, quiet)
        return
    with loading(quiet):
        from polhode.harness.answers.heldout import evaluate
        from polhode.harness.pages.pick import reached, summary, write_page

    with stored(out, resume, "heldout") as store:
        evaluation = evaluate(store, seed, scenes, quiet)
    if evaluation.scenes.empty:
        raise RunFailed("no scene has a reference")
    page = write_page(out, evaluation, command_line())
    click.echo("\n".join([*summary(evaluation.scenes), str(page)]))
    # `polhode.harness.answers.heldout` sets the targets, in each range of the best run's time.
    if not reached(evaluation.scenes):
        raise RunFailed("pick: fewer first choices than expected are near the best run")


def _validate_times(out: Path, scenes: int, seed: int, load: int, quiet: bool) -> None:
    """Time `solve` against what a careful user does without it, and write the page.

    `load` is the number of other processes that keep the processors busy meanwhile.
    """
    from polhode.harness import api
    from polhode.harness.answers.timed import TIMED_ROWS, busy, study
    from polhode.harness.pages.answer_time import write_page
    from polhode.models.observables import Observables
    from polhode.models.scene import Scene

    def ask(scene: Scene, error: float, want: str) -> tuple[Observables | None, float | None, str]:
        """The motion and the bound on its error, None where there is none, and the method or a refusal."""
        try:
            solution = api.solve(scene, error=error, want=want, samples=TIMED_ROWS)
        except ValueError as refusal:
            return None, None, str(refusal)
        stated = solution.error.of(want)
        method = f"{solution.form} by {solution.solver} at {solution.tolerance:g}"
        return solution.observables if solution.success else None, stated and stated.high, method

    with busy(load):
        timings = list(study(ask, seed, scenes, quiet))
    page = write_page(out, timings, command_line(), load)
    click.echo(f"{page.read_text(encoding='utf-8')}\n{page}")


def _validate_parts(out: Path, scenes: int, seed: int, resume: bool, quiet: bool) -> None:
    """Race without each part in turn, and write the page."""
    from polhode.harness.answers.ablation import study
    from polhode.harness.pages.ablation import write_page

    with stored(out, resume, "ablation") as store:
        rows = study(store, seed, scenes, quiet)
    if not rows:
        raise RunFailed("no scene has a reference")
    page = write_page(out, rows, command_line())
    click.echo(f"{page.read_text(encoding='utf-8')}\n{page}")


def _validate_errors(
    out: Path, scenes: int, seed: int, fit: bool, resume: bool, quiet: bool
) -> None:
    """Count how many stated errors hold, by kind of confirmation, or fit their factors.

    `scenes` is the number of scenes of each sort, which `polhode.harness.answers.coverage` draws.
    """
    from polhode.harness.answers.coverage import fitted, save, study
    from polhode.harness.pages.stated import write_page

    with stored(out, resume, "errors", "runs") as store:
        rows = study(store, seed, scenes, quiet)
    if fit:
        save(fitted(rows), command_line())
        click.echo("The numbers are fitted: count how they hold on runs of another seed.")
        return
    page = write_page(out, rows, command_line())
    click.echo(f"{page.read_text(encoding='utf-8')}\n{page}")
