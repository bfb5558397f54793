"""`polhode completion`: what makes a shell complete commands, scenes, forms and solvers."""

import click


@click.command(epilog='Example: polhode completion bash; eval "$(polhode completion bash)"')
@click.argument("shell", type=click.Choice(["bash", "zsh", "fish"]))
def completion(shell: str) -> None:
    """Print the script that makes SHELL complete commands, options, scenes, forms and solvers by Tab.

    Put eval "$(polhode completion bash)" into ~/.bashrc, the same with zsh into ~/.zshrc, or for fish: polhode
    completion fish > ~/.config/fish/completions/polhode.fish
    """
    from click.shell_completion import get_completion_class

    from polhode.harness.cli import polhode

    found = get_completion_class(shell)
    assert found is not None
    click.echo(found(polhode, {}, "polhode", "_POLHODE_COMPLETE").source())
