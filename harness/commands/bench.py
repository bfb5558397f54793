"""Commands that measure.

They are `polhode bench`, `regimes`, `equal-error`, `accuracy`, `paper`, `sweep`, `throughput` and
`flows`.
"""

import os
from dataclasses import asdict, replace
from functools import partial
from importlib import import_module
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

import click

from polhode.harness.cli import BadInput, RunFailed, bad_input, command
from polhode.harness.commands import _study_options as options
from polhode.harness.commands._study_options import (
    StudyRequest,
    command_line,
    loading,
    steady,
    stored,
    to_json,
)
from polhode.harness.common.files import make_folder

if TYPE_CHECKING:
    from polhode.harness.common.store import Store
    from polhode.harness.studies.study import Study

# Libraries that pages need: their absence is reported before anything is measured. Commands that compile or
# measure by certain libraries name these beside: llvmlite, and heyoka for its integrator of many particles and
# of linear flows.
_PAGE_LIBRARIES = ("matplotlib", "PIL", "pandas", "scipy")
# Module of `polhode.harness.pages` that writes a study's page, by the study's `page`
# (`polhode.harness.studies.study.Page`).
_PAGES = {
    "costs": "bench",
    "outcomes": "outcomes",
    "known-stokes": "known_stokes",
    "stiff": "stiff",
}
# Parts of `accuracy`, for --part, by order: repeated from `averaging.second_order` and `averaging.hybrid`, so
# that `--help` needs no numerics. A test compares them.
ACCURACY_PARTS = {"all": (), "2": ("orders", "resonances", "cost"), "hybrid": ("errors", "speed")}
# Folder of the page of each order, unless --out names one.
_FOLDERS = {"all": "reports/accuracy", "2": "reports/second-order", "hybrid": "reports/hybrid"}
# St between which the quick map of regimes lies: beyond, single runs take long. Estimates: a wider range
# only takes more time.
_LEAST_QUICK_STOKES = 0.1
_LARGEST_QUICK_STOKES = 1e4
# Seconds for which calls of each solver are repeated, by `solve` and of the bare library. Estimates: the
# fastest of many calls counts.
_CALL_SECONDS = 2.0
_QUICK_CALL_SECONDS = 0.2
# Width, in characters, of the names in `polhode paper --list`: the longest has 24, and a gap follows.
_NAME_COLUMNS = 28
# Seconds that a run of the user's problem may take with --quick, for a look that takes little time; an estimate.
_QUICK_SECONDS = 1.0


@command(needs=_PAGE_LIBRARIES)
@options.study_options
@click.option(
    "--problems", is_flag=True, help="The classical test problems instead; --scene is one of them."
)
@options.page_only
def bench(request: StudyRequest, problems: bool, page_only: bool) -> None:
    """Run a work-precision study and write its page, figures and records."""
    if problems:
        _problems(request, page_only)
        return
    # The argument is a study file, or FILE.py:NAME.
    if ".py:" in str(request.study_file or ""):
        _own_problem(request, page_only)
        return
    with bad_input(), loading(request.quiet):
        from polhode.harness.analysis.frames import NEEDED, frame, of_runs
        from polhode.harness.common.store import read_export, record_file
        from polhode.harness.studies.runner import Runner

        study = request.study()
        write_page = import_module(f"polhode.harness.pages.{_PAGES[study.page]}").write_page
    folder = request.out or Path("reports") / study.name
    if page_only:
        with bad_input():
            path = record_file(folder)
            records = list(read_export(path))
            # Raises ValueError if the records do not come from a study.
            of_runs(frame(records, NEEDED), path)
        click.echo(f"{write_page(study, records, folder, command_line())}")
        return
    # A form or solver outside polhode is named `module:class`.
    if outside := [name for name in (*study.forms, *study.solvers) if ":" in name]:
        click.echo(f"note: the study runs code of {', '.join(outside)}", err=True)
    with stored(folder, request.resume) as store:
        records = Runner(store, request.quiet).run(study)
    steady(records, folder / "README.md", request.disturbed)
    page = write_page(study, records, folder, command_line())
    click.echo(f"{page}")


def _problems(request: StudyRequest, page_only: bool) -> None:
    """Measure the classical test problems (`polhode.models.problems.catalogue`), and write their page."""
    with loading(request.quiet):
        from polhode.harness.pages.problems import rewrite_page, write_page
        from polhode.harness.work_precision import pairs_of, run_problems

    if request.study_file or request.filters["forms"] or request.filters["tags"]:
        raise BadInput(
            "--problems: got a study, --form or --tag, expected --scene and --solver at most"
        )
    folder = request.out or options.usual("reports/problems", request.quick)
    if page_only:
        with bad_input():
            click.echo(f"{rewrite_page(folder)}")
        return
    problems = request.filters["scenes"]
    solvers = request.filters["solvers"]
    with bad_input():
        # A name that does not exist is refused before anything is measured.
        pairs_of(problems, solvers)
    with stored(folder, request.resume) as store:
        rows = run_problems(store, problems, solvers, quick=request.quick, quiet=request.quiet)
    click.echo(f"{write_page(rows, folder, command_line())}")


def _own_problem(request: StudyRequest, page_only: bool) -> None:
    """Measure ``FILE.py:NAME``, a Problem or a WorkPrecision of the user's own, and write its page.

    A WorkPrecision keeps its own settings: --solver and --quick change a Problem's alone. For both, --quick
    chooses the folder.
    """
    with loading(request.quiet):
        from polhode.harness.work_precision import QUICK_TOLERANCES, WorkPrecision
        from polhode.models.problem import Problem

    location = str(request.study_file)
    filters = request.filters
    if page_only or request.resume or any(filters[kind] for kind in ("scenes", "tags", "forms")):
        raise BadInput(
            f"{location}: got --page-only, --resume or filters, expected --solver at most"
        )
    with bad_input():
        study = _object_in(location)
        if isinstance(study, Problem):
            settings = (
                {"tolerances": QUICK_TOLERANCES, "max_seconds": _QUICK_SECONDS}
                if request.quick
                else {}
            )
            solvers = list(filters["solvers"]) or None
            study = WorkPrecision(study, solvers, quiet=request.quiet, **settings)
        elif not isinstance(study, WorkPrecision):
            # The first 60 characters, an estimate, tell what it is.
            raise ValueError(
                f"{location}: got {study!r:.60}, expected a Problem or a WorkPrecision"
            )
        folder = request.out or options.usual(f"reports/{study.name}", request.quick)
        make_folder(folder)
        page = study.write(folder, command_line())
    click.echo(f"{page}")


def _object_in(location: str) -> Any:
    """The object that ``FILE.py:NAME`` names, for which the file is run; ValueError, in one line, if there is none."""
    import sys
    from importlib.util import module_from_spec, spec_from_file_location

    path, _, name = location.rpartition(":")
    file = Path(path)
    if not file.is_file():
        raise ValueError(f"{path}: no such file, expected FILE.py:NAME")
    spec = spec_from_file_location(file.stem, file)
    if spec is None or spec.loader is None:
        raise ValueError(f"{path}: got no module of Python, expected FILE.py:NAME")
    # The file may import modules beside it, and worker processes find its functions by the module's name.
    sys.path.insert(0, str(file.resolve().parent))
    module = sys.modules[file.stem] = module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        words = " ".join(str(error).split())
        raise ValueError(f"{path}: {type(error).__name__}: {words}") from error
    if not hasattr(module, name):
        raise ValueError(f"{path}: got no {name!r}, expected the name of a Problem in it")
    return getattr(module, name)


@command(needs=_PAGE_LIBRARIES)
@options.page_only
@options.study_options
def regimes(request: StudyRequest, page_only: bool) -> None:
    """Measure and draw who wins over St and error: one map for the full solution, one for the slow variables."""
    with bad_input(), loading(request.quiet):
        from polhode.harness.analysis.regime_map import LONGEST_SLOW_TIME
        from polhode.harness.pages.regimes import rewrite_page, write_page
        from polhode.harness.studies.runner import Runner

        # Over more slow time averaged equations do not run.
        study = replace(request.study("regimes"), longest_slow_time=LONGEST_SLOW_TIME)
        # `request.study` has cut tolerances and time limits; here scenes are left out too.
        if request.quick:
            quick_scenes = tuple(
                (name, scene)
                for name, scene in study.scenes
                if _LEAST_QUICK_STOKES <= scene.stokes <= _LARGEST_QUICK_STOKES
            )
            # A --scene beyond them stays.
            study = replace(study, scenes=quick_scenes or study.scenes)
    folder = request.out or Path("reports") / study.name
    if page_only:
        with bad_input():
            click.echo(f"{rewrite_page(study, folder)}")
        return
    with stored(folder, request.resume) as store:
        if not request.quiet:
            click.echo(ahead(study, store), err=True)
        records = Runner(store, request.quiet).run(study)
    steady(records, folder / "README.md", request.disturbed)
    click.echo(f"{write_page(study, records, folder, command_line())}")


def ahead(study: "Study", store: "Store") -> str:
    """How much of a study is left to be measured, in words: cases whose key the store does not hold."""
    measured_keys = store.keys()
    total = 0
    stored_cases = 0
    for batch in study.batches():
        total += len(batch)
        stored_cases += sum(case.key in measured_keys for case in batch)
    left = total - stored_cases
    return f"{store.path} holds {stored_cases} of {total} cases, {left} are measured now"


@command(needs=(*_PAGE_LIBRARIES, "llvmlite"))
@options.out_folder("reports/solvers")
@options.quick
@options.resume
@options.quiet
@options.page_only
def equal_error(out: Path, quick: bool, resume: bool, quiet: bool, page_only: bool) -> None:
    """Compare all solvers at equal error, with every back end, and with the bare library calls."""
    with loading(quiet):
        from polhode.harness.pages.equal_error import Measured, rewrite_pages, write_page
        from polhode.harness.studies.cost import (
            first_runs,
            measure,
            paper_problem,
            rhs_seconds,
            startup_seconds,
        )
        from polhode.harness.studies.runner import Runner
        from polhode.harness.studies.study import read_study
        from polhode.solvers.contract import Backend

    if page_only:
        with bad_input():
            click.echo(f"{rewrite_pages(out, command_line())}")
        return
    # `measure` and `first_runs` take one problem. The studies by name, which the package has, each fill the field of
    # `Measured` that is called so.
    problem = paper_problem()
    records = {}
    with stored(out, resume) as store:
        seconds = _QUICK_CALL_SECONDS if quick else _CALL_SECONDS
        overheads = measure(problem, seconds=seconds, quiet=quiet)
        firsts = first_runs(problem, [one.solver for one in overheads], quiet)
        for name in ("solvers", "spheroid", "backends"):
            study = read_study(None, name)
            records[name] = Runner(store, quiet).run(study.quick() if quick else study)
    costs = {name: rhs_seconds(problem, name) for name in get_args(Backend)}
    measured = Measured(
        **records,
        overheads=overheads,
        first_runs=firsts,
        rhs_costs=costs,
        startup=startup_seconds(),
    )
    click.echo(f"{write_page(measured, out, command_line())}")


@command(needs=_PAGE_LIBRARIES)
@click.argument("names", metavar="[ITEM…]", nargs=-1)
@options.out_folder("reports/paper")
@click.option("--force", is_flag=True, help="Compute again even what is there.")
@click.option(
    "--redraw", is_flag=True, help="Draw from the data that are there, whatever code made them."
)
@click.option("--svg", is_flag=True, help="Draw the figures as SVG beside PNG.")
@click.option("--quick", is_flag=True, help="Coarse grids: a look, by default in FOLDER-quick.")
@click.option("--list", "listed", is_flag=True, help="Print the items and stop.")
@click.option("--json", "as_json", is_flag=True, help="With --list: print JSON.")
@options.quiet
def paper(
    names: tuple[str, ...],
    out: Path,
    force: bool,
    redraw: bool,
    svg: bool,
    quick: bool,
    listed: bool,
    as_json: bool,
    quiet: bool,
) -> None:
    """Regenerate the paper's figures and tables: all of them, or the ITEMs (or sections) named."""
    report = (lambda _: None) if quiet or listed else partial(click.echo, err=True)
    with bad_input(), loading(quiet):
        from polhode.harness.paper.claims import find_items, section_of
        from polhode.harness.paper.item import Grid
        from polhode.harness.paper.reproduction import run

        items = find_items(names)
        if force and redraw:
            raise ValueError("--force computes anew and --redraw does not, expected one of them")
        if as_json and not listed:
            raise ValueError(
                "--json: got it without --list, expected both: the results stand in the folder's files"
            )
    if listed:
        rows = [
            {"name": item.name, "section": section_of(item).name, "title": item.title}
            for item in items
        ]
        click.echo(
            to_json(rows)
            if as_json
            else "\n".join(f"{row['name']:{_NAME_COLUMNS}}{row['title']}" for row in rows)
        )
        return
    with bad_input():
        make_folder(out)
    grid = Grid.REDUCED if quick else Grid.FULL
    processes = min(len(items), _cores())
    failed = run(
        items,
        out,
        report,
        grid=grid,
        force=force,
        redraw=redraw,
        svg=svg,
        processes=processes,
    )
    if failed:
        raise RunFailed(f"failed: {', '.join(failed)}")
    click.echo(f"{out / 'README.md'}")


@command(needs=_PAGE_LIBRARIES)
@click.option(
    "--order",
    type=click.Choice(list(_FOLDERS)),
    default="all",
    help="What is measured of averaging: all forms over random bodies, or one alone in more depth.",
)
@click.option(
    "--out",
    type=options.FOLDER,
    help="Folder; by default reports/accuracy, second-order or hybrid.",
)
@options.as_json
@click.option(
    "--quick",
    is_flag=True,
    help="Few bodies at few St, or a few cases: a look, by default in FOLDER-quick.",
)
@click.option(
    "--part",
    type=click.Choice([*ACCURACY_PARTS["2"], *ACCURACY_PARTS["hybrid"]]),
    help="Measure that alone anew.",
)
@options.page_only
@click.option("--resume", is_flag=True, help="Keep the bodies that are measured; measure the rest.")
@click.option(
    "--seconds",
    type=click.FloatRange(min=0),
    help="Begin with no further body after this time; --resume goes on.",
)
@click.option(
    "--references",
    type=click.IntRange(min=1),
    help="Measure only so many references, those that take the least time.",
)
@options.workers
@click.option(
    "--restate",
    is_flag=True,
    help="Keep all errors; make anew what solve states of the runs.",
)
@click.option(
    "--fit", is_flag=True, help="Let solve, pick and sweeps use the laws that the data show."
)
@options.quiet
def accuracy(
    order: str,
    out: Path | None,
    as_json: bool,
    quick: bool,
    part: str | None,
    page_only: bool,
    quiet: bool,
    **how: Any,
) -> None:
    """Measure the averaged forms' errors against full solutions, over random bodies and starts."""
    out = out or options.usual(_FOLDERS[order], quick)
    with bad_input():
        if quick + bool(part) + page_only + how["restate"] > 1:
            raise ValueError(
                "--quick, --part, --page-only, --restate: got several of them, expected one"
            )
        for name in ("seconds", "references"):
            if how["restate"] and how[name] is not None:
                raise ValueError(f"--{name}: got it with --restate, which makes no references")
        if part and part not in ACCURACY_PARTS[order]:
            fitting = next(
                fitting_order for fitting_order, parts in ACCURACY_PARTS.items() if part in parts
            )
            raise ValueError(
                f"--part: got --order {order}, expected --order {fitting} for {part!r}"
            )
        for name, value in how.items():
            # Numbers may be 0, which equals False.
            if order != "all" and value is not None and value is not False:
                raise ValueError(f"--{name}: got it with --order {order}, expected --order all")
    if order == "all":
        _random_bodies(out, as_json, quick, page_only, quiet, **how)
    else:
        _one_form(order, out, as_json, quick, part, page_only, quiet)


def _random_bodies(
    out: Path,
    as_json: bool,
    quick: bool,
    page_only: bool,
    quiet: bool,
    resume: bool,
    seconds: float | None,
    references: int | None,
    workers: int | None,
    restate: bool,
    fit: bool,
) -> None:
    """Measure all averaged forms over random bodies, write the page and print its numbers.

    With `resume` the tables in `out` are kept and added to, with `restate` only their statements are made anew;
    `fit` writes the laws that `solve` reads.
    """
    with loading(quiet):
        from polhode.harness.averaging import random_study, restated
        from polhode.harness.averaging.laws import write_laws
        from polhode.harness.pages.averaging import random_bodies

    with bad_input():
        old = None
        if page_only or restate or (resume and (out / "references.csv").exists()):
            old = random_study.read_data(out)
        make_folder(out)
    data = old
    if restate and old:
        with stored(out, resume, "restated", "statements") as store:
            try:
                data = restated.restate(store, old, _engine(workers, None), quiet=quiet)
            except RuntimeError as error:
                raise RunFailed(f"{error}; --resume goes on") from None
    elif not page_only:
        # Cheap references come first, so that --references and --seconds leave out the long ones.
        todo = random_study.tasks(random_study.QUICK_BODIES) if quick else random_study.whole()
        todo = todo[:references]
        workers = _cores() if workers is None else workers
        with stored(out, resume, what="bodies") as store:
            data = random_study.run(
                store,
                todo,
                old,
                workers=workers,
                seconds=inf if seconds is None else seconds,
                quiet=quiet,
            )
        if data.references.empty:
            raise RunFailed("--seconds: no body was finished, expected more time")
    assert data is not None
    # The study grows over several commands: the page names the one that makes all of it.
    laws = random_bodies.write_page(data, out, "polhode accuracy" + " --quick" * quick)
    if fit:
        write_laws(laws)
    click.echo(to_json(random_bodies.as_json(data)) if as_json else random_bodies.as_text(data))
    click.echo(str(out / "README.md"), err=True)


def _one_form(
    order: str,
    out: Path,
    as_json: bool,
    quick: bool,
    part: str | None,
    page_only: bool,
    quiet: bool,
) -> None:
    """Measure second order, or `hybrid`, in more depth, write the page and print its findings.

    With `part` the other parts come from the earlier study in `out`.
    """
    from polhode.harness.averaging.data import SecondOrderStudy, read_study
    from polhode.harness.averaging.hybrid import Study as HybridStudy, measure as measure_hybrid
    from polhode.harness.averaging.second_order import measure_study
    from polhode.harness.pages.averaging import hybrid, second_order
    from polhode.harness.references.reference import ReferenceFailedError

    page: Any = {"2": second_order, "hybrid": hybrid}[order]
    measure: Any = {"2": measure_study, "hybrid": measure_hybrid}[order]
    kind: Any = {"2": SecondOrderStudy, "hybrid": HybridStudy}[order]
    with bad_input():
        results: Any = read_study(kind, out) if part or page_only else None
        make_folder(out)
    try:
        results = results if page_only else measure(results, part or "", quick=quick, quiet=quiet)
    except ReferenceFailedError as error:
        raise RunFailed(str(error)) from None
    page.write_page(results, out, f"polhode accuracy --order {order}" + " --quick" * quick)
    click.echo(to_json(asdict(results)) if as_json else "\n".join(page.findings(results)))
    click.echo(str(out / "README.md"), err=True)


@command(needs=_PAGE_LIBRARIES)
@click.argument("file", metavar="[SWEEP.toml]", required=False, type=click.Path(path_type=Path))
@click.option("--out", type=options.FOLDER, help="Folder; by default reports/NAME.")
@options.workers
@click.option("--dask", help="Address of a Dask scheduler that runs the tasks instead.")
@click.option(
    "--resume", is_flag=True, help="Take up an interrupted run, or join one that is under way."
)
@options.page_only
@options.as_json
@options.quiet
def sweep(
    file: Path | None,
    out: Path | None,
    workers: int | None,
    dask: str | None,
    resume: bool,
    page_only: bool,
    as_json: bool,
    quiet: bool,
) -> None:
    """Run ensembles of particles over a grid of shapes and Stokes numbers and write their statistics."""
    from polhode.harness.ensembles.sweep import read_sweep, run_sweep

    with bad_input():
        sweep_plan = read_sweep(file)
        folder = out or Path("reports") / sweep_plan.name
        if page_only:
            from polhode.harness.pages.ensembles import redraw

            click.echo(f"{redraw(sweep_plan, folder)}")
            return
        path = folder / "store.sqlite"
        if path.exists() and not resume:
            raise BadInput(f"{path}: exists, expected --resume to go on with it, or another --out")
        engine = _engine(workers, dask)
    # Whether to go on was settled above, so that no store is moved aside here: others may be at work on it.
    with stored(folder, resume=True, what="tasks") as store:
        # With --resume in random order, as other runs may take tasks from the same store.
        tally = run_sweep(sweep_plan, store, engine, quiet=quiet, spread=resume)
        if tally.failed:
            raise RunFailed(
                f"{tally.failed} of {sweep_plan.size} tasks failed, --resume tries again: "
                f"{tally.message}"
            )
        # Slow to import, and not needed until all is done.
        from polhode.harness.pages.ensembles import write_results

        page, ensembles = write_results(sweep_plan, store, folder, command_line())
    click.echo(to_json(ensembles) if as_json else f"{page}")


@command(needs=(*_PAGE_LIBRARIES, "llvmlite", "heyoka"))
@options.out_folder("reports/sweep")
@options.page_only
@options.quiet
def throughput(out: Path, page_only: bool, quiet: bool) -> None:
    """Measure what ensembles cost on this machine: particles per second, engines, memory."""
    with loading(quiet):
        from polhode.harness.ensembles.throughput import measure
        from polhode.harness.pages.ensembles import read_throughput, write_page

    with bad_input():
        make_folder(out)
        if page_only:
            click.echo(f"{write_page(read_throughput(out), out)}")
            return
    click.echo(f"{write_page(measure(quiet), out)}")


@command(needs=(*_PAGE_LIBRARIES, "llvmlite", "heyoka"))
@options.out_folder("reports/flows")
@options.quick
@options.page_only
@options.quiet
def flows(out: Path, quick: bool, page_only: bool, quiet: bool) -> None:
    """Measure scenes in linear flows other than shear: cost, closed orbits, tracks, stated errors."""
    with loading(quiet):
        from polhode.harness.common.machine import here
        from polhode.harness.flows.measure import measure_all
        from polhode.harness.pages.flows import write_page, write_tables

    with bad_input():
        make_folder(out)
        if not page_only:
            write_tables(measure_all(quick=quick, quiet=quiet), here(), out)
        page = write_page(out, "polhode flows" + " --quick" * quick)
    click.echo(f"{page}")


def _cores() -> int:
    """Cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _engine(workers: int | None, address: str | None) -> Any:
    """The engine that runs the tasks of a sweep: this process, processes, or a Dask cluster at an address.

    Raises BadInput for both, ValueError if no scheduler answers.
    """
    from polhode.harness.ensembles.engines import check_dask, dask, processes, serial

    if address is not None:
        if workers is not None:
            raise BadInput(f"--workers: got {workers} with --dask, expected one of them")
        check_dask(address)
        return partial(dask, address)
    if workers == 0:
        return serial
    return partial(processes, workers or _cores())
