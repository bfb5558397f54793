"""`polhode doctor`: versions, adapters, caches, and whether the machine is steady."""

import json
from dataclasses import asdict
from typing import TYPE_CHECKING

import click

from polhode.harness.common.text import aligned, duration

if TYPE_CHECKING:
    from polhode.harness.commands.diagnosis import Diagnosis


@click.command(epilog="Example: polhode doctor --json")
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def doctor(as_json: bool) -> None:
    """Tell versions, solvers that can be run, caches, and whether times measured now would mean anything."""
    from polhode.harness.commands.diagnosis import examine

    found = examine()
    if as_json:
        click.echo(json.dumps({**asdict(found), "advice": found.advice}, default=str))
    else:
        click.echo(_page(found))


def _page(found: "Diagnosis") -> str:
    steadiness = found.steadiness
    adapters = [
        [
            row["name"],
            f"{row['package']} {row['version'] or ''}".strip(),
            _good("ready") if row["available"] else _bad("missing"),
        ]
        for row in found.adapters
    ]
    caches = [
        [cache.name, str(cache.folder), f"{cache.files} files, {cache.size / 1e6:.1f} MB"] for cache in found.caches
    ]
    load = "unknown" if steadiness.load is None else f"{steadiness.load:.2f} waiting per core"
    verdict = _good("steady") if steadiness.steady else _bad("unsteady")
    parts = [
        aligned(["machine", ""], [[name, value] for name, value in found.machine.items()]),
        aligned(["package", "version"], [[name, value] for name, value in found.versions.items()]),
        aligned(["solver", "library", ""], adapters),
        aligned(["cache", "folder", ""], [*caches, ["cost laws", found.laws, ""]]),
        f"times: {verdict}; sentinel {duration(steadiness.seconds)}, median {steadiness.ratio:.2f} × that; load {load}",
        *(["\n".join(["What to do:", *(f"- {line}" for line in found.advice)])] if found.advice else []),
    ]
    return "\n\n".join(parts)


def _good(word: str) -> str:
    return click.style(word, fg="green")


def _bad(word: str) -> str:
    return click.style(word, fg="red", bold=True)
