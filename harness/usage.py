"""What the command line says about arguments it cannot take: one line with the value and what was expected."""

import re

import click

from polhode.models.registry import hint

_REWORDED = (
    (r"(.+) is not a valid float( range)?\.", r"got \1, expected a number"),
    (r"(.+) is not a valid integer( range)?\.", r"got \1, expected a whole number"),
    (r"(.+) is not one of (.+)\.", r"got \1, expected one of \2"),
    (r"(.+) is not in the range (\S+)<=x<=(\S+)\.", r"got \1, expected a number from \2 to \3"),
    (r"(.+) is not in the range x>=(\S+)\.", r"got \1, expected at least \2"),
    (r"(.+) is not in the range x>(\S+)\.", r"got \1, expected more than \2"),
    (r"(.+) is not in the range (.+)\.", r"got \1, expected a number in the range \2"),
    (r"Directory (.+) is a file\.", r"got \1, expected a folder"),
    (r"File (.+) is a directory\.", r"got \1, a folder, expected a file"),
)


def complaint(error: click.ClickException) -> str:
    """The line for an error of the command line, without the command's name."""
    message = " ".join(error.format_message().split())
    if not isinstance(error, click.UsageError) or error.ctx is None:
        return message
    if isinstance(error, click.BadParameter) and not isinstance(error, click.MissingParameter):
        return _value(error)
    message = message[:1].lower() + message[1:].removesuffix(".")
    command = error.ctx.command
    if isinstance(error, click.NoSuchOption):
        options = [name for parameter in command.get_params(error.ctx) for name in parameter.opts if name[:1] == "-"]
        near = hint(error.option_name, options)
        return f"no such option {error.option_name!r}, expected one of {', '.join(options)}{near}"
    if isinstance(command, click.Group):
        names = command.list_commands(error.ctx)
        typed = re.search(r"'(.*)'", message)
        near = hint(typed[1], names) if typed else "; see polhode --help"
        return f"{message}, expected one of {', '.join(names)}{near}"
    usage = " ".join(command.get_usage(error.ctx).split()).removeprefix("Usage: ")
    return f"{message}, expected: {usage}"


def _value(error: click.BadParameter) -> str:
    hint = error.param.get_error_hint(error.ctx) if error.param else "value"  # pyright: ignore[reportArgumentType]
    for pattern, reworded in _REWORDED:
        text, changes = re.subn(pattern, reworded, error.message)
        if changes:
            return f"{hint.strip(chr(39))}: {text}"
    return f"{hint.strip(chr(39))}: {error.message}"
