"""The options that limit a study to a part of it."""

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from polhode.harness.studies.study import Study

Filters = Mapping[str, tuple[str, ...]]
KINDS = {
    "scenes": ("--scene", "Only this scene of the study; may be given several times."),
    "tags": ("--tag", "Only scenes with this tag; may be given several times."),
    "forms": ("--form", "Only this form; may be given several times."),
    "solvers": ("--solver", "Only this solver; may be given several times."),
}


def filter_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add --scene, --tag, --form and --solver; the command receives them as `scenes`, `tags`, `forms`, `solvers`."""
    for name, (option, text) in reversed(KINDS.items()):
        command = click.option(option, name, multiple=True, help=text)(command)
    return command


def filtered(study: "Study", filters: Filters) -> "Study":
    """The part of a study that is wanted, under a name of its own; all of it where nothing is said.

    Raises
    ------
    ValueError
        If nothing is left.
    """
    from dataclasses import replace

    from polhode.harness.studies.filters import chosen

    values = [value for kind in KINDS for value in filters[kind]]
    return replace(chosen(study, **filters), name="-".join([study.name, *values])) if values else study


def words(filters: Filters) -> list[str]:
    """The options as they were given."""
    return [f"{option} {value}" for kind, (option, _) in KINDS.items() for value in filters[kind]]
