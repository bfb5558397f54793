"""Shell completion of scenes, forms and solvers."""

import click
from click.shell_completion import CompletionItem


def scenes(context: click.Context, parameter: click.Parameter, typed: str) -> list[CompletionItem]:
    """Built-in scenes with what is hard about them; scene files where none begins so."""
    from polhode.models.scenes import SCENES

    found = [CompletionItem(name, help=each.summary) for name, each in SCENES.items() if name.startswith(typed)]
    return found or [CompletionItem(typed, type="file")]


def forms(context: click.Context, parameter: click.Parameter, typed: str) -> list[CompletionItem]:
    """Forms of the catalogue."""
    from polhode.models.catalogue import FORMS, form

    return [CompletionItem(name, help=form(name).summary) for name in FORMS if name.startswith(typed)]


def solvers(context: click.Context, parameter: click.Parameter, typed: str) -> list[CompletionItem]:
    """Solvers of the catalogue."""
    from polhode.solvers.catalogue import SOLVERS, solver

    return [CompletionItem(name, help=solver(name).summary) for name in SOLVERS if name.startswith(typed)]
