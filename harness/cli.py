"""The command line: `polhode COMMAND …`."""

import errno
import os
import signal
import sys
import threading
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import wraps
from importlib import import_module
from pathlib import Path
from types import FrameType
from typing import Any, NamedTuple

import click

from polhode.harness.common.near_files import file_hint
from polhode.harness.common.streams import forget_output, prepare_streams
from polhode.models.libraries import MissingLibraryError, how_to_install, missing_library, need
from polhode.models.registry import Question, hint


class Words(NamedTuple):
    """A command: its name, its module in `harness.commands`, and its texts."""

    name: str
    module: str
    summary: str
    example: str
    more: str  # after the first line of its help


def _words(section: str) -> Words:
    """A command from its section of `words.md`: heading "name (module)", summary, example, more."""
    head, summary, example, *more = section.strip().split("\n\n")
    name, module = head.rstrip(")").split(" (")
    return Words(name, module, summary, example, "\n\n".join(more))


# Plain text that is split here: the libraries that read other formats take longer than all else
# before `polhode --help`.
_TEXT = Path(__file__).with_name("commands").joinpath("words.md").read_text(encoding="utf-8")
# `# ` begins a group of commands, `## ` a command; the text before the first group is skipped.
_GROUPS = (group.split("\n## ") for group in _TEXT.split("\n# ")[1:])
# Commands by the heading under which `polhode --help` lists them, and by name.
GROUPS = {
    title.strip(): {words.name: words for words in map(_words, group)} for title, *group in _GROUPS
}
COMMANDS: dict[str, Words] = {}
for _group in GROUPS.values():
    COMMANDS.update(_group)
# Today's names of commands by their names in version 0.1, which 0.2 understands too.
FORMER = {"heldout": "validate", "footing": "equal-error"}


class BadInput(click.ClickException):
    """Bad input: one line with the value and what was expected, exit code 2."""

    exit_code = 2


class RunFailed(click.ClickException):
    """A run failed: one line that says how, exit code 1."""

    exit_code = 1


# A message about a file ends with what was expected, by errno.
_EXPECTED = {
    errno.ENOENT: ", expected an existing one",
    errno.EISDIR: ", expected a file",
    errno.ENOTDIR: ", expected a folder above it",
    errno.EEXIST: ", expected a folder",
    errno.EACCES: ", expected one that you may read and write",
    errno.EPERM: ", expected one that you may read and write",
    errno.EROFS: ", expected a place that can be written",
}
# A full disk says nothing against the input: it is reported as a failed run.
_FULL = (errno.ENOSPC, errno.EFBIG, errno.EDQUOT)


@contextmanager
def bad_input() -> Iterator[None]:
    """Turn what a caller's values raise into `BadInput`; a full disk stays what it is."""
    try:
        yield
    except OSError as error:
        if error.errno in _FULL:
            raise
        where = f"{error.filename}: " if error.filename else ""
        expected = _EXPECTED.get(error.errno or 0, "")
        if error.errno == errno.ENOENT and error.filename:
            expected = file_hint(str(error.filename)) + expected
        reason = str(error.strerror or error)
        raise BadInput(where + (reason if "expected" in reason else reason + expected)) from None
    except ValueError as error:
        raise BadInput(str(error)) from None


def command(
    *, needs: Sequence[str] = (), **how: Any
) -> Callable[[Callable[..., None]], click.Command]:
    """A decorator: the function becomes the command of its name, with the texts of `words.md`.

    The command is refused if one of the libraries that it needs is missing; `how` goes to click.
    """

    def as_command(function: Callable[..., None]) -> click.Command:
        words = COMMANDS[function.__name__.replace("_", "-")]
        text = f"{function.__doc__}\n\n{words.more}"

        @wraps(function)
        def checked(*values: Any, **options: Any) -> None:
            need(words.name, *needs)
            function(*values, **options)

        return click.command(
            words.name, cls=_Command, help=text, epilog=f"Example: {words.example}", **how
        )(checked)

    return as_command


class _Command(click.Command):
    """A command whose complaints say how it is called."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """As click's; a complaint knows its command."""
        try:
            return super().parse_args(ctx, args)
        except click.UsageError as error:
            # Click's parser leaves out which command it was.
            error.ctx = error.ctx or ctx
            raise


class _Commands(click.Group):
    """Commands that are imported when they are called, so that `polhode --help` stays fast."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Names of all commands, none of which is imported."""
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """The command of a name, imported now; None if there is none."""
        if cmd_name not in COMMANDS:
            return None
        module = import_module(f"polhode.harness.commands.{COMMANDS[cmd_name].module}")
        return getattr(module, cmd_name.replace("-", "_"))

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[Any, click.Command | None, list[str]]:
        """Name, command and its arguments, by a former name too; BadInput for an unknown name."""
        # Parsing is resilient while a shell completes a line by Tab: then nothing is said.
        name = FORMER.get(args[0], args[0])
        if name != args[0] and not ctx.resilient_parsing:
            click.echo(
                f"note: {args[0]!r} is now {name!r}; the former name goes with the next version",
                err=True,
            )
        if name not in COMMANDS and not ctx.resilient_parsing:
            raise BadInput(
                f"no such command {name!r}{hint(name, COMMANDS)}, expected one of {', '.join(COMMANDS)}"
            )
        return super().resolve_command(ctx, [name, *args[1:]])

    def invoke(self, ctx: click.Context) -> object:
        """Run the command; a missing library and Ctrl-C become RunFailed."""
        try:
            return super().invoke(ctx)
        except MissingLibraryError as error:
            raise RunFailed(str(error)) from None
        except (KeyboardInterrupt, ImportError, SystemError) as error:
            if library := missing_library(error):
                raise RunFailed(how_to_install(library)) from None
            # Libraries whose import Ctrl-C interrupts raise errors of their own.
            if not isinstance(error.__cause__ or error.__context__ or error, KeyboardInterrupt):
                raise
            # Click would print a blank line before it raises Abort, which `main` takes too.
            raise RunFailed("interrupted") from None

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """List the commands in their groups."""
        for title, group in GROUPS.items():
            with formatter.section(title):
                formatter.write_dl([(words.name, words.summary) for words in group.values()])


@click.group(cls=_Commands, no_args_is_help=False, context_settings={"show_default": True})
@click.version_option(package_name="polhode")
def polhode() -> None:
    """Which equations and which solver for a massive ellipsoid in shear flow.

    A SCENE is a scene file (TOML) or the name of a built-in scene. Every command has --help with an
    example.
    """
    if os.environ.get("NO_COLOR"):
        click.get_current_context().color = False


def complaint(error: click.ClickException) -> str:
    """One line about what the command line cannot take: the command, click's words, and what was expected."""
    message = " ".join(error.format_message().split())
    # A terminal would obey control characters, such as those in a file's content: `ascii` writes them as
    # escapes, between quotes that are cut off.
    message = "".join(
        character if character.isprintable() else ascii(character)[1:-1] for character in message
    )
    if not isinstance(error, click.UsageError) or error.ctx is None:
        return f"polhode: {message}"
    command = error.ctx.command
    message = message.removesuffix(".")
    if not isinstance(error, click.BadParameter) or isinstance(error, click.MissingParameter):
        # Click may end with "Did you mean …?".
        message += " expected: " if message.endswith("?") else ", expected: "
        message += " ".join(command.get_usage(error.ctx).split()).removeprefix("Usage: ")
    if isinstance(command, click.Group):
        message += f" ({error.ctx.command_path} --help lists the commands)"
    return f"{error.ctx.command_path}: {message}"


def _terminated(number: int, frame: FrameType | None) -> None:
    """Do as after Ctrl-C, so that finished rows and records are kept, and processes ended."""
    if callable(signal.getsignal(signal.SIGINT)):
        signal.raise_signal(signal.SIGINT)
    else:
        # A shell that started this in the background made it deaf to Ctrl-C.
        raise KeyboardInterrupt


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line and exit: 0 on success, 2 on bad input, 1 if a run failed; SIGTERM acts as Ctrl-C.

    The code is 1 too if standard output is closed or full before all is written; files of --out are
    whole.
    """
    prepare_streams()
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGTERM, _terminated)
    # Extreme input overflows, which NumPy warns of: the run's status says so already.
    warnings.filterwarnings("ignore", category=RuntimeWarning)
    # A `Question` warns of input that is legal, and surely not meant.
    warnings.filterwarnings("always", category=Question)
    warnings.showwarning = lambda message, *where, **more: click.echo(f"note: {message}", err=True)
    # The code of all that is caught below, but for bad input.
    code = 1
    said = ""
    try:
        # Click returns the exit code where a command ends early, as by --help, else what the command
        # returns: None.
        result = polhode.main(args=arguments, prog_name="polhode", standalone_mode=False)
        code = result if isinstance(result, int) else 0
        sys.stdout.flush()
    except click.ClickException as error:
        code = error.exit_code
        said = complaint(error)
    except (KeyboardInterrupt, click.Abort):
        said = "polhode: interrupted"
    except BrokenPipeError:
        # The reader of the pipe has closed it, as `head` does.
        forget_output()
    except MemoryError:
        said = "polhode: out of memory, expected a smaller problem: fewer samples, a shorter time"
    except OSError as error:
        # A disk is full, or standard output is closed; `bad_input` has turned all else into bad input.
        where = error.filename or "standard output"
        reason = "closed" if error.errno == errno.EBADF else error.strerror or error
        said = f"polhode: {where}: {reason}, expected a place to write and room for it"
        forget_output()
    with suppress(OSError):
        if said:
            click.echo(said, err=True)
    sys.exit(code)
