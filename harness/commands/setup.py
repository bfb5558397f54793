"""`polhode doctor` and `completion`: whether polhode can work here, and what Tab offers."""

import json
import os
import subprocess
import sys
from pathlib import Path
from time import perf_counter
from typing import Any

import click
from click.shell_completion import CompletionItem, get_completion_class

from polhode.harness.cli import command
from polhode.harness.common.text import duration, fitting, on_terminal

# Seconds over which the sentinel is watched.
WATCH = 1.0
# On a machine fit for timing its median exceeds its minimum by less than this factor, and fewer processes than this
# wait for each core.
STEADY, BUSY = 1.05, 0.5


def scene_names(context: click.Context, parameter: click.Parameter, typed: str) -> list[CompletionItem]:
    """Built-in scenes with what is hard about them; scene files where none begins so."""
    from polhode.models.scenes import SCENES

    found = [CompletionItem(name, help=each.summary) for name, each in SCENES.items() if name.startswith(typed)]
    return found or [CompletionItem(typed, type="file")]


def form_names(context: click.Context, parameter: click.Parameter, typed: str) -> list[CompletionItem]:
    """Forms of the catalogue."""
    from polhode.models.catalogue import FORMS, form

    return [CompletionItem(name, help=form(name).summary) for name in FORMS if name.startswith(typed)]


def solver_names(context: click.Context, parameter: click.Parameter, typed: str) -> list[CompletionItem]:
    """Solvers of the catalogue."""
    from polhode.solvers.catalogue import SOLVERS, solver

    return [CompletionItem(name, help=solver(name).summary) for name in SOLVERS if name.startswith(typed)]


@command()
@click.argument("shell", type=click.Choice(["bash", "zsh", "fish"]), metavar="SHELL")
def completion(shell: str) -> None:
    """Print the script that makes SHELL complete commands, options, scenes, forms and solvers by Tab."""
    from polhode.harness.cli import polhode

    found = get_completion_class(shell)
    assert found is not None
    click.echo(found(polhode, {}, "polhode", "_POLHODE_COMPLETE").source())


@command()
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def doctor(as_json: bool) -> None:
    """Show versions, solvers that can be run, caches, and whether times measured now would mean anything."""
    found = examine()
    click.echo(json.dumps(found, default=str) if as_json else _page(found))


def examine() -> dict[str, Any]:
    """All that `polhode doctor` shows; takes a little longer than `WATCH` seconds."""
    from importlib.metadata import version

    from polhode.harness.common.machine import machine, versions
    from polhode.solvers.catalogue import SOLVERS, solver
    from polhode.solvers.compile import cache_folder

    keys = ("name", "package", "available", "why_not")
    adapters = [{key: getattr(method, key) for key in keys} for method in map(solver, SOLVERS)]
    for row in adapters:
        row["version"] = version(row["package"]) if row["available"] else None
    caches = [look("references", cache_folder() / "references"), look("compiled integrators", cache_folder("heyoka"))]
    cold, steadiness = cold_start(), watch_sentinel(WATCH)
    advice = [f"{row['name']}: {row['why_not']}" for row in adapters if not row["available"]]
    advice += [
        f"{cache['folder']}: cannot be written, so that {cache['name']} are made anew every time: "
        "set POLHODE_CACHE to a folder of yours"
        for cache in caches
        if not cache["writable"]
    ]
    if not steady(steadiness):
        advice.append("times measured now are noisy: stop other work, then look again (errors and counts are fine)")
    return {
        "machine": machine(),
        "versions": versions(),
        "adapters": adapters,
        "caches": caches,
        "laws": _laws(),
        "cold_start": cold,
        "steadiness": steadiness,
        "advice": advice,
    }


def _laws() -> str:
    """Whose cost laws `pick` uses: laws of another version are passed over, unreadable ones are named."""
    from polhode.harness.common.files import read_file
    from polhode.harness.picking.laws import OtherSchemaError, own_laws_path, parse_laws

    own = own_laws_path()
    if not own.is_file():
        return "those of the package"
    try:
        source = parse_laws(read_file(own).decode()).source
    except OtherSchemaError:
        return f"those of the package; passed over, since of another version: {own}"
    except (OSError, ValueError) as error:
        return f"cannot be read ({error}), remove them to use those of the package: {own}"
    if "refitted" in source:
        return f"times rescaled by {source['refitted']} runs of this machine: {own}"
    return f"fitted on this machine: {own}"


def look(name: str, folder: Path) -> dict[str, Any]:
    """What a cache holds; a folder that does not exist yet counts as writable if it could be made."""
    sizes = [path.stat().st_size for path in folder.rglob("*") if path.is_file()]
    above = next((path for path in (folder, *folder.parents) if path.exists()), Path("/"))
    writable = above.is_dir() and os.access(above, os.W_OK)
    return {"name": name, "folder": folder, "files": len(sizes), "size": sum(sizes), "writable": writable}


def cold_start() -> dict[str, float]:
    """Seconds that `polhode solve paper` takes in a process of its own, by piece of work."""
    began = perf_counter()
    done = subprocess.run([sys.executable, "-P", "-c", _COLD], capture_output=True, text=True, check=False)
    return json.loads(done.stdout or "{}") | {"in all": perf_counter() - began}


_COLD = """
import json, os
from contextlib import suppress
from polhode.harness.cli import main
from polhode.models.spent import SPENT
with suppress(SystemExit):
    main(["solve", "paper", "--quiet", "--out", os.devnull])
print(json.dumps(SPENT))
"""


def watch_sentinel(seconds: float) -> dict[str, float | None]:
    """A fixed piece of arithmetic, repeated for some seconds: its minimum, median over minimum, load per core."""
    from statistics import median

    from polhode.harness.common.timing import sentinel

    times, until = [sentinel()], perf_counter() + seconds
    while perf_counter() < until:
        times.append(sentinel())
    try:
        load = os.getloadavg()[0] / (os.cpu_count() or 1)
    except OSError:
        load = None
    return {"seconds": min(times), "ratio": median(times) / min(times), "load": load}


def steady(steadiness: dict[str, float | None]) -> bool:
    """Whether times measured now mean something."""
    return (steadiness["ratio"] or 1.0) <= STEADY and (steadiness["load"] or 0.0) <= BUSY


def _page(found: dict[str, Any]) -> str:
    states = {True: click.style("ready", fg="green"), False: click.style("missing", fg="red", bold=True)}
    adapters = [
        [row["name"], f"{row['package']} {row['version'] or ''}".strip(), states[row["available"]]]
        for row in found["adapters"]
    ]
    caches = [
        [cache["name"], str(cache["folder"]), f"{cache['files']} files, {cache['size'] / 1e6:.1f} MB"]
        for cache in found["caches"]
    ]
    steadiness, load = found["steadiness"], found["steadiness"]["load"]
    waiting = "unknown" if load is None else f"{load:.2f} waiting per core"
    good = steady(steadiness)
    verdict = click.style("steady" if good else "unsteady", fg="green" if good else "red", bold=not good)
    seconds = duration(steadiness["seconds"])
    parts = [
        on_terminal(["machine", ""], [*found["machine"].items()]),
        on_terminal(["package", "version"], [*found["versions"].items()]),
        on_terminal(["solver", "library", ""], adapters),
        on_terminal(["cache", "folder", ""], [*caches, ["cost laws", found["laws"], ""]]),
        on_terminal(
            ["polhode solve paper", ""], [(work, duration(each)) for work, each in found["cold_start"].items()]
        ),
        f"times: {verdict}; sentinel {seconds}, median {steadiness['ratio']:.2f} × that; load {waiting}",
        *([fitting("\n".join(["What to do:", *(f"- {line}" for line in found["advice"])]))] if found["advice"] else []),
    ]
    return "\n\n".join(parts)
