"""The command line: `polhode COMMAND …`."""

import errno
import signal
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
from types import FrameType

import click

COMMANDS = {
    "shape": "polhode.harness.commands.shape:shape",
    "solve": "polhode.harness.commands.solve:solve",
    "pick": "polhode.harness.commands.pick:pick",
    "scenes": "polhode.harness.commands.scenes:scenes",
    "forms": "polhode.harness.commands.catalogues:forms",
    "solvers": "polhode.harness.commands.catalogues:solvers",
    "bench": "polhode.harness.commands.bench:bench",
    "footing": "polhode.harness.commands.footing:footing",
    "compare": "polhode.harness.commands.compare:compare",
    "export": "polhode.harness.commands.export:export",
    "paper": "polhode.harness.commands.paper:paper",
    "accuracy": "polhode.harness.commands.accuracy:accuracy",
    "report": "polhode.harness.commands.report:report",
    "doctor": "polhode.harness.commands.doctor:doctor",
    "completion": "polhode.harness.commands.completion:completion",
    "laws": "polhode.harness.commands.laws:laws",
    "heldout": "polhode.harness.commands.laws:heldout",
    "regimes": "polhode.harness.commands.regimes:regimes",
    "sweep": "polhode.harness.commands.sweep:sweep",
}


class BadInput(click.ClickException):
    """Bad input: one line with the value and what was expected, exit code 2."""

    exit_code = 2


class RunFailed(click.ClickException):
    """A run failed: one line that says how, exit code 1."""

    exit_code = 1


_EXPECTED = {
    errno.ENOENT: ", expected an existing one",
    errno.EISDIR: ", expected a file",
    errno.ENOTDIR: ", expected a folder above it",
    errno.EEXIST: ", expected a folder",
    errno.EACCES: ", expected one that you may read and write",
    errno.EPERM: ", expected one that you may read and write",
    errno.EROFS: ", expected a place that can be written",
}


@contextmanager
def bad_input() -> Iterator[None]:
    """Turn what a caller's values raise into `BadInput`."""
    try:
        yield
    except OSError as error:
        where = f"{error.filename}: " if error.filename else ""
        expected = _EXPECTED.get(error.errno or 0, "")
        reason = str(error.strerror or error)
        raise BadInput(where + (reason if "expected" in reason else reason + expected)) from None
    except ValueError as error:
        raise BadInput(str(error)) from None


class _Commands(click.Group):
    """Commands that are imported when they are called, so that `polhode --help` stays fast."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        target = COMMANDS.get(cmd_name)
        if target is None:
            return None
        module, _, attribute = target.partition(":")
        return getattr(import_module(module), attribute)

    def invoke(self, ctx: click.Context) -> object:
        try:
            return super().invoke(ctx)
        except click.UsageError as error:
            name = ctx.invoked_subcommand
            command = self.get_command(ctx, name) if name else None
            # The parser's own complaints do not say which command they are about.
            if error.ctx is None and command is not None:
                error.ctx = click.Context(command, info_name=name, parent=ctx)
            raise
        except KeyboardInterrupt:
            raise RunFailed("interrupted") from None

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Commands"):
            formatter.write_dl([(name, SUMMARIES[name]) for name in COMMANDS])


SUMMARIES = {
    "shape": "inertia, resistance and kind of an ellipsoid",
    "solve": "solve one scene and write its observables",
    "pick": "what to run for a scene, and what it will cost",
    "scenes": "the built-in scenes, and scene files to start from",
    "forms": "the forms of the equations",
    "solvers": "the solvers, and what is missing",
    "bench": "the main job: cost against accuracy",
    "footing": "every solver at equal error, and what solve itself costs",
    "compare": "two saved runs, and what got worse",
    "export": "a store as CSV or JSON Lines",
    "paper": "the paper's figures and tables, each with a verdict",
    "accuracy": "the averaged equations against the full ones",
    "report": "everything found so far as one offline web site",
    "doctor": "versions, libraries, caches, and whether the machine is steady",
    "completion": "make the shell complete commands, scenes, forms and solvers",
    "laws": "measure and fit what pick goes by",
    "heldout": "how good pick is, on scenes held out",
    "regimes": "the map of who wins, over St and error",
    "sweep": "ensembles of many particles, on one machine or many",
}


@click.group(cls=_Commands, no_args_is_help=False)
@click.version_option(package_name="polhode")
def polhode() -> None:
    """Which equations and which solver for a massive ellipsoid in shear flow.

    A SCENE is a scene file (TOML) or the name of a built-in scene. Every command has --help with an example.
    """


def _terminated(number: int, frame: FrameType | None) -> None:
    """Do as after Ctrl-C, so that finished rows and records are kept, and processes ended."""
    if callable(signal.getsignal(signal.SIGINT)):
        signal.raise_signal(signal.SIGINT)
    else:
        # A shell that started this in the background made it deaf to Ctrl-C.
        raise KeyboardInterrupt


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line and exit: 0 on success, 2 on bad input, 1 when a run failed.

    Termination (SIGTERM) is met as Ctrl-C is.
    """
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGTERM, _terminated)
    try:
        result = polhode.main(args=arguments, prog_name="polhode", standalone_mode=False)
        code = result if isinstance(result, int) else 0
    except click.ClickException as error:
        from polhode.harness.usage import complaint

        command = error.ctx.command_path if isinstance(error, click.UsageError) and error.ctx else "polhode"
        click.echo(f"{command}: {complaint(error)}", err=True)
        code = error.exit_code
    except (KeyboardInterrupt, click.Abort):
        click.echo("polhode: interrupted", err=True)
        code = 1
    except BrokenPipeError:
        code = 0
    sys.exit(code)
