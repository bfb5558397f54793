"""`polhode sweep` and `throughput`: ensembles over a grid of shapes and Stokes numbers, and what they cost."""

import json
import os
from functools import partial
from pathlib import Path
from typing import Any

import click

from polhode.harness.cli import BadInput, RunFailed, bad_input, command
from polhode.harness.commands._study_options import FOLDER, as_json, out_folder, quiet, stored


@command()
@click.argument("file", metavar="[SWEEP.toml]", required=False, type=click.Path(path_type=Path))
@click.option("--out", type=FOLDER, help="Folder; by default reports/NAME.")
@click.option("--workers", type=click.IntRange(min=0), help="Processes; by default one per core, 0 for this one alone.")
@click.option("--dask", help="Address of a Dask scheduler that runs the tasks instead.")
@click.option("--resume", is_flag=True, help="Take up an interrupted run, or join one that is under way.")
@as_json
@quiet
def sweep(
    file: Path | None, out: Path | None, workers: int | None, dask: str | None, resume: bool, as_json: bool, quiet: bool
) -> None:
    """Run ensembles of particles over a grid of shapes and Stokes numbers and write their statistics."""
    from polhode.harness.ensembles.sweep import read_sweep, run_sweep

    with bad_input():
        what = read_sweep(file)
        folder = out or Path("reports") / what.name
        path = folder / "store.sqlite"
        if path.exists() and not resume:
            raise BadInput(f"{path}: exists, expected --resume to go on with it, or another --out")
        engine = _engine(workers, dask)
    with stored(folder, resume=True, what="tasks") as store:
        tally = run_sweep(what, store, engine, quiet=quiet, spread=resume)
        if tally.failed:
            raise RunFailed(f"{tally.failed} of {what.size} tasks failed, --resume tries again: {tally.message}")
        # Slow to import, and not needed until all is done.
        from polhode.harness.pages.ensembles import write_results

        page, ensembles = write_results(what, store, folder)
    click.echo(json.dumps(ensembles) if as_json else f"{page}")


@command()
@out_folder("reports/sweep")
def throughput(out: Path) -> None:
    """Measure what ensembles cost on this machine: particles per second, engines, memory."""
    from polhode.harness.ensembles.throughput import measure
    from polhode.harness.pages.ensembles import write_page

    with bad_input():
        out.mkdir(parents=True, exist_ok=True)
    click.echo(f"{write_page(measure(), out)}")


def _engine(workers: int | None, address: str | None) -> Any:
    from polhode.harness.ensembles.engines import check_dask, dask, processes, serial

    if address is not None:
        if workers is not None:
            raise BadInput(f"--workers: got {workers} with --dask, expected one of them")
        check_dask(address)
        return partial(dask, address)
    if workers == 0:
        return serial
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return partial(processes, workers or cores)
