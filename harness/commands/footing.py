"""`polhode footing`: every solver on equal footing."""

from pathlib import Path

import click

from polhode.harness.commands.study_store import open_store, running_into


@click.command(epilog="Example: polhode footing --out look --quick")
@click.option("--out", type=click.Path(path_type=Path), default=Path("reports/solvers"), show_default=True)
@click.option("--quick", is_flag=True, help="Fewer tolerances and short time limits: a look, not a result.")
@click.option("--resume", is_flag=True, help="Take up an interrupted run instead of starting afresh.")
@click.option("--quiet", is_flag=True, help="No progress.")
def footing(out: Path, quick: bool, resume: bool, quiet: bool) -> None:
    """Compare all solvers at equal error, with every back end, and with the bare library calls.

    About ten minutes; an interrupted run goes on with --resume.
    """
    from polhode.harness.pages.footing import Measured, rhs_costs, write_page
    from polhode.harness.studies.first_runs import first_runs
    from polhode.harness.studies.overhead import measure, paper_problem
    from polhode.harness.studies.runner import Runner
    from polhode.harness.studies.study import quick_study, read_study

    store = open_store(out, resume)
    problem = paper_problem()
    overheads = measure(problem, seconds=0.2 if quick else 2.0)
    firsts = first_runs(problem, [one.solver for one in overheads])
    found = {}
    with running_into(store):
        for name in ("solvers", "spheroid", "backends"):
            study = read_study(None, name)
            found[name] = Runner(store, quiet).run(quick_study(study) if quick else study)
    measured = Measured(**found, overheads=overheads, first_runs=firsts, rhs_costs=rhs_costs(problem))
    page = write_page(measured, out, f"polhode footing{' --quick' if quick else ''}")
    click.echo(f"{page}")
