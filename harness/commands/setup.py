"""`polhode export`, `compare`, `report`: what was measured; `doctor`, `completion`: what polhode needs to work here."""

import json
import os
import sys
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import Any

import click
from click.shell_completion import CompletionItem, get_completion_class

from polhode.harness.cli import BadInput, RunFailed, bad_input, command
from polhode.harness.commands._study_options import FOLDER, as_json, loading, quiet, to_json
from polhode.harness.common.progress import Progress, Steps
from polhode.harness.common.text import aligned, duration, fitting, on_terminal
from polhode.models.registry import imported

_REPORTS = Path("reports")
_HERE = Path(__file__).parent
_ABOVE_ONE = click.FloatRange(min=1.0, min_open=True)
# Seconds over which the sentinel (`polhode.harness.common.timing`) is watched. An estimate: it
# then takes some hundreds of times, so that one interruption does not decide.
_WATCH_SECONDS = 1.0
# A machine is fit for timing up to these values. Estimates: larger ones pass more machines, and less is to be
# made of their times.
_MAX_STEADY_RATIO = 1.05  # Median over minimum of the sentinel's times.
_MAX_LOAD_PER_CORE = 0.5  # Processes that run or wait for a processor, for each core.
# Factors beyond which `compare` calls a change a regression. Estimates: a smaller factor in time tells of a busy
# machine more often, and errors differ by some factor wherever a method takes other steps.
_SLOWER = 1.5
_LESS_ACCURATE = 3.0


def scene_names(
    context: click.Context, parameter: click.Parameter, typed: str
) -> list[CompletionItem]:
    """Built-in scenes with what is hard about them; scene files where none begins so."""
    from polhode.models.scenes import SCENES

    completions = [
        CompletionItem(name, help=scene.summary)
        for name, scene in SCENES.items()
        if name.startswith(typed)
    ]
    return completions or [CompletionItem(typed, type="file")]


def _names_in(
    catalogue: str, context: click.Context, parameter: click.Parameter, typed: str
) -> list[CompletionItem]:
    """Names of a catalogue that begin with what was typed, each with its summary, for a shell's Tab.

    `catalogue` is MODULE:NAME, imported only now: the commands start without it.
    """
    entries = imported(catalogue)
    return [
        CompletionItem(name, help=entries.find(name).summary)
        for name in entries
        if name.startswith(typed)
    ]


form_names = partial(_names_in, "polhode.models.catalogue:FORMS")
solver_names = partial(_names_in, "polhode.solvers.catalogue:SOLVERS")


@command()
@click.argument("shell", type=click.Choice(["bash", "zsh", "fish"]), metavar="SHELL")
def completion(shell: str) -> None:
    """Print the script that makes SHELL complete commands, options, scenes, forms and solvers by Tab."""
    from polhode.harness.cli import polhode

    script = get_completion_class(shell)
    assert script is not None
    # Click's name of the variable by which a shell asks the command for completions.
    click.echo(script(polhode, {}, "polhode", "_POLHODE_COMPLETE").source())


@command()
@as_json
def doctor(as_json: bool) -> None:
    """Show versions, solvers that can be run, caches, and whether times measured now would mean anything."""
    with Progress().begin("running polhode solve paper in a fresh process"):
        state = examine()
    click.echo(to_json(state, default=str) if as_json else _page(state))


def examine() -> dict[str, Any]:
    """All that `polhode doctor` shows; takes `_WATCH_SECONDS` and a cold start."""
    from polhode.harness.common.machine import machine, versions
    from polhode.harness.common.wheels import why_missing
    from polhode.harness.pages.tables import templates
    from polhode.models.files.cached import cache_folder
    from polhode.models.libraries import version_of
    from polhode.solvers.catalogue import SOLVERS, solver

    keys = ("name", "package", "available", "why_not")
    adapters = [{key: getattr(method, key) for key in keys} for method in map(solver, SOLVERS)]
    for row in adapters:
        row["why_not"] = why_missing(row["why_not"], row["package"])
        row["version"] = version_of(row["package"]) if row["available"] else None
    caches = {
        "references": cache_folder(part="references"),
        "compiled integrators": cache_folder("heyoka"),
    }
    state: dict[str, Any] = {
        "machine": machine(),
        "versions": versions(),
        "adapters": adapters,
        "caches": [look(name, folder) for name, folder in caches.items()],
        "cold_start": cold_start(),
        "steadiness": watch_sentinel(_WATCH_SECONDS),
    }
    advice = (
        templates(_HERE).get_template("advice.md").render(state, steady=steady(state["steadiness"]))
    )
    return state | {"advice": advice.splitlines()}


def look(name: str, folder: Path) -> dict[str, Any]:
    """Content of a cache: number of files and their size in bytes.

    A folder that does not exist yet counts as writable if it could be made.
    """
    sizes = [path.stat().st_size for path in folder.rglob("*") if path.is_file()]
    above = next((path for path in (folder, *folder.parents) if path.exists()), Path("/"))
    writable = above.is_dir() and os.access(above, os.W_OK)
    return {
        "name": name,
        "folder": folder,
        "files": len(sizes),
        "size": sum(sizes),
        "writable": writable,
    }


def cold_start() -> dict[str, float]:
    """Seconds that `polhode solve paper` takes in a process of its own, by kind of work, and "in all"."""
    import subprocess

    began = perf_counter()
    # By -P the working folder is not searched for modules.
    done = subprocess.run(
        [sys.executable, "-P", "-c", _COLD], capture_output=True, text=True, check=False
    )
    return json.loads(done.stdout or "{}") | {"in all": perf_counter() - began}


# The program of a cold start: a process of its own solves a scene, so that nothing is imported or
# compiled before. It prints the seconds of each kind of work.
_COLD = """
import json, os
from contextlib import suppress
from polhode.harness.cli import main
from polhode.models.spent import SPENT
with suppress(SystemExit):
    main(["solve", "paper", "--quiet", "--out", os.devnull])
print(json.dumps(SPENT.seconds))
"""


def watch_sentinel(seconds: float) -> dict[str, float | None]:
    """The sentinel's times over some seconds: `seconds`, the least; `ratio`, median over least; `load` per core.

    The load is None where the system does not tell it.
    """
    from statistics import median

    from polhode.harness.common.timing import sentinel

    times = [sentinel()]
    until = perf_counter() + seconds
    while perf_counter() < until:
        times.append(sentinel())
    try:
        # The mean over the last minute, of the three that the system gives.
        load = os.getloadavg()[0] / (os.cpu_count() or 1)
    except OSError:
        load = None
    return {"seconds": min(times), "ratio": median(times) / min(times), "load": load}


def steady(steadiness: dict[str, float | None]) -> bool:
    """Whether times measured now mean something, by what `watch_sentinel` returned."""
    ratio = steadiness["ratio"] or 1.0
    load = steadiness["load"] or 0.0
    return ratio <= _MAX_STEADY_RATIO and load <= _MAX_LOAD_PER_CORE


def _page(state: dict[str, Any]) -> str:
    """The page of `polhode doctor`, of what `examine` found."""
    from polhode.harness.pages.tables import templates

    def mark(good: bool, yes: str, no: str) -> str:
        return click.style(yes if good else no, fg="green" if good else "red", bold=not good)

    solvers = [
        [
            row["name"],
            f"{row['package']} {row['version'] or ''}".strip(),
            mark(row["available"], "ready", "missing"),
        ]
        for row in state["adapters"]
    ]
    caches = [
        [cache["name"], cache["folder"], f"{cache['files']} files, {cache['size'] / 1e6:.1f} MB"]
        for cache in state["caches"]
    ]
    cold_start = [(work, duration(seconds)) for work, seconds in state["cold_start"].items()]
    verdict = mark(steady(state["steadiness"]), "steady", "unsteady")
    rows = {"solvers": solvers, "caches": caches, "cold_start": cold_start, "verdict": verdict}
    page = templates(_HERE).get_template("doctor.md")
    return page.render(state | rows, columns=on_terminal, fitting=fitting).rstrip()


@command()
@click.argument("store", type=click.Path(path_type=Path))
@click.argument("out", type=click.Path(path_type=Path))
@click.option("--asv", is_flag=True, help="JSON of the benchmark suite into a folder of asv's.")
def export(store: Path, out: Path, asv: bool) -> None:
    """Write the records of STORE to OUT, as CSV or JSON Lines (.csv, .jsonl, .jsonl.gz)."""
    from polhode.harness.common.store import Store, export as write

    if asv:
        from polhode.harness.analysis.asv import write_asv

        with bad_input():
            click.echo(f"{write_asv(store, out)}")
        return
    if not store.is_file() or store.stat().st_size == 0:
        raise BadInput(f"{store}: no such store, expected a file of `polhode bench`")
    with bad_input(), Store(store) as opened, Progress().begin(f"writing {out}"):
        write(opened, out)


@command(needs=("pandas",))
@click.argument("before", type=click.Path(path_type=Path))
@click.argument("after", type=click.Path(path_type=Path))
@click.option(
    "--slower", type=_ABOVE_ONE, default=_SLOWER, help="Factor in time that is a regression."
)
@click.option(
    "--less-accurate",
    type=_ABOVE_ONE,
    default=_LESS_ACCURATE,
    help="The same for the errors.",
)
@as_json
def compare(before: Path, after: Path, slower: float, less_accurate: float, as_json: bool) -> None:
    """Compare two saved runs; fail if a case of AFTER is slower or less accurate than in BEFORE, or failed."""
    from polhode.harness.analysis.comparison import compare as compare_runs, read_runs
    from polhode.harness.analysis.frames import rows_of

    with bad_input(), Progress().begin("reading"):
        tables = read_runs(before), read_runs(after)
    comparison = compare_runs(*tables, slower=slower, less_accurate=less_accurate)
    if comparison.shared == 0:
        raise BadInput(f"{after}: got no case that {before} has, expected some")
    worse = rows_of(comparison.regressions)
    if as_json:
        shown = ("shared", "only_before", "only_after", "drift", "same_machine")
        click.echo(
            to_json({name: getattr(comparison, name) for name in shown} | {"regressions": worse})
        )
    else:
        which = "the" if comparison.same_machine else "the other"
        pace = f"{which} machine takes {comparison.drift:.2f} times as long"
        click.echo(
            f"{comparison.shared} cases compared, {comparison.only_before} gone, {comparison.only_after} new; {pace}"
        )
    if worse and not as_json:
        header = ["scene_name", "stokes", "form", "solver", "tolerance", "what", "before", "after"]
        rows = []
        for row in worse:
            values = [row[name] for name in header]
            rows.append([f"{v:.3g}" if isinstance(v, float) else v for v in values])
        click.echo(aligned(["scene", "St", *header[2:]], rows))
    if worse:
        raise RunFailed(f"regressions: {len(worse)} in {comparison.shared} cases")


@command(
    needs=("sphinx", "furo", "myst_parser", "latex2mathml", "matplotlib", "PIL", "pandas", "scipy")
)
@click.option(
    "--reports", type=FOLDER, default=_REPORTS, help="Folder of the other commands' pages."
)
@click.option("--out", type=FOLDER, help="Folder; by default REPORTS/site.")
@click.option(
    "--scene", multiple=True, shell_complete=scene_names, help="Show its motion too; repeatable."
)
@quiet
def report(reports: Path, out: Path | None, scene: tuple[str, ...], quiet: bool) -> None:
    """Write one web site: the documentation, what to run, costs, every page of the reports, motions."""
    with loading(quiet):
        from polhode.harness.common.scene_words import scene_named
        from polhode.harness.site.build import build

    with bad_input():
        if reports != _REPORTS and not reports.is_dir():
            raise ValueError(f"--reports: got {str(reports)!r}, expected an existing folder")
        user_scenes = {name: scene_named(name) for name in scene}
        with Steps("report", None, "pages", quiet) as progress:

            def say(title: str) -> None:
                progress.detail(title)
                progress.advance()

            page = build(reports, out or reports / "site", user_scenes, say)
    click.echo(f"{page}")
