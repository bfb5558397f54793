"""Common parts of commands: options, the store that measurements go into, and the line that was typed."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields, replace
from functools import partial, wraps
from itertools import chain
from pathlib import Path
from shlex import join
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from polhode.harness.cli import BadInput, RunFailed, bad_input
from polhode.harness.common.files import dumps
from polhode.harness.common.progress import Progress

if TYPE_CHECKING:
    from polhode.harness.common.store import Store
    from polhode.harness.studies.study import Study

# Options that choose a part of a study, by argument of `Study.part`: name and help.
_KINDS = {
    "scenes": ("--scene", "Only this scene of the study; may be given several times."),
    "tags": ("--tag", "Only scenes with this tag; may be given several times."),
    "forms": ("--form", "Only this form; may be given several times."),
    "solvers": ("--solver", "Only this solver; may be given several times."),
}
# Share of disturbed times above which earlier results are not replaced. An estimate: half of it asks for a
# quieter machine, twice of it lets every fifth time be too long.
_MAX_DISTURBED_SHARE = 0.1
# The share is of this number of runs at least, an estimate: chance rules fewer. With a share of 0.1, five
# may be disturbed.
FEW_TIMED_RUNS = 50
# Options that change nothing in what is measured: `command_line` leaves them out.
_NOT_MEASURED = ("out", "resume", "quiet", "as_json", "page_only", "disturbed")
quick = click.option(
    "--quick",
    is_flag=True,
    help="Few tolerances, short limits: a look, by default in FOLDER-quick.",
)
resume = click.option(
    "--resume", is_flag=True, help="Take up an interrupted run instead of starting afresh."
)
disturbed = click.option(
    "--disturbed", is_flag=True, help="Replace earlier results by times that were disturbed too."
)
quiet = click.option("--quiet", is_flag=True, help="No progress.")
workers = click.option(
    "--workers",
    type=click.IntRange(min=0),
    help="Processes; by default one per core, 0 for this one alone.",
)
page_only = click.option(
    "--page-only",
    is_flag=True,
    help="Measure nothing: write the page anew from the data in the folder.",
)
as_json = click.option("--json", "as_json", is_flag=True, help="Print JSON.")
to_json = partial(dumps, sort_keys=False)
FOLDER = click.Path(path_type=Path, file_okay=False)


def out_folder(default: str) -> Callable[..., Any]:
    """The option --out, a folder."""

    def folder(context: click.Context, _: click.Parameter, path: Path | None) -> Path:
        return path or usual(default, context.params.get("quick", False))

    return click.option(
        "--out", type=FOLDER, callback=folder, help=f"Folder; by default {default}."
    )


def usual(folder: str, quick: bool) -> Path:
    """The folder of a command; for a quick look one beside it, so that a look replaces no result."""
    return Path(folder + "-quick" * quick)


@dataclass(frozen=True)
class StudyRequest:
    """Options of a command that runs a study, as their help says."""

    study_file: Path | None
    out: Path | None
    quick: bool
    resume: bool
    quiet: bool
    disturbed: bool
    filters: dict[str, tuple[str, ...]]  # the values of each option of `_KINDS`, by its key there

    def study(self, default: str = "bench") -> "Study":
        """The requested part of the study, under a name of its own; raises ValueError if nothing is left.

        `default` names the study that is read where no file is given.
        """
        from polhode.harness.studies.study import read_study

        study = read_study(self.study_file, default)
        values = [*chain.from_iterable(self.filters[kind] for kind in _KINDS)]
        part = study.part(**self.filters) if values else study
        name = "-".join([study.name, *values, *["quick"] * self.quick])
        return replace(part.quick() if self.quick else part, name=name)


def study_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add [STUDY.toml], --out, --quick, --resume, --quiet, --disturbed, and --scene and so on, as `StudyRequest`."""

    @wraps(command)
    def with_request(**options: Any) -> Any:
        filters = {kind: options.pop(kind) for kind in _KINDS}
        settings = {
            field.name: options.pop(field.name)
            for field in fields(StudyRequest)
            if field.name in options
        }
        return command(StudyRequest(**settings, filters=filters), **options)

    decorated: Callable[..., Any] = with_request
    # Help lists options in the reverse order of their decorators.
    for name, (flag, text) in reversed(_KINDS.items()):
        decorated = click.option(flag, name, multiple=True, help=text)(decorated)
    out = click.option(
        "--out", type=FOLDER, help="Folder; by default reports/NAME, with the filters' words."
    )
    file = click.argument(
        "study_file",
        metavar="[STUDY.toml|FILE.py:NAME]",
        required=False,
        type=click.Path(path_type=Path),
    )
    for option in (disturbed, quiet, resume, quick, out, file):
        decorated = option(decorated)
    return decorated


def steady(records: Sequence[Mapping[str, Any]], page: Path, anyway: bool) -> None:
    """Say so if other work disturbed too many times of the records.

    Raises RunFailed if `page` stands there already and was measured on this machine. With `anyway`, the option
    --disturbed, the times are taken all the same.
    """
    from polhode.harness.common.machine import machine
    from polhode.harness.common.text import percent
    from polhode.harness.common.timing import disturbance

    count, judged = disturbance(records)
    if anyway or count <= _MAX_DISTURBED_SHARE * max(judged, FEW_TIMED_RUNS):
        return
    most = percent(_MAX_DISTURBED_SHARE)
    disturbed = f"other work disturbed {count} of {judged} timed runs, expected at most {most}"
    again = "run it anew on a quiet machine"
    # Times of another machine say nothing of this one.
    if page.exists() and str(machine()["processor"]) in page.read_text(encoding="utf-8"):
        raise RunFailed(
            f"{page}: stays as it is, for {disturbed}; {again}, or take them with --resume --disturbed"
        )
    click.echo(f"note: {disturbed}; {again}, if times matter", err=True)


def command_line() -> str:
    """The command as it was given, without the options that change nothing in what is measured."""
    context = click.get_current_context()
    words = context.command_path.split()
    for parameter in context.command.params:
        name = parameter.name or ""
        if name in _NOT_MEASURED or context.get_parameter_source(name) is ParameterSource.DEFAULT:
            continue
        value = context.params[name]
        option = parameter.opts[:1] if isinstance(parameter, click.Option) else []
        for item in value if isinstance(value, tuple) else [value]:
            words += option if item is True else [*option, str(item)]
    return join(words)


@contextmanager
def stored(
    folder: Path, resume: bool, name: str = "store", what: str = "cases"
) -> Iterator["Store"]:
    """FOLDER/NAME.sqlite, made with its folder, open; a run that starts afresh moves the last one's aside.

    Errors in opening it become BadInput or RunFailed, errors in the block RunFailed, in one line. `what` names
    there what is finished.
    """
    from polhode.harness.common.store import DamagedStoreError, Store, set_aside
    from polhode.harness.common.worker import KilledFromOutsideError

    path = folder / f"{name}.sqlite"
    previous = "previous" if name == "store" else f"previous-{name}"
    with bad_input():
        folder.mkdir(parents=True, exist_ok=True)
        if not resume and path.exists():
            set_aside(path, folder / f"{previous}.sqlite")
        try:
            store = Store(path)
        except DamagedStoreError as error:
            raise BadInput(f"{error}, expected one of an earlier run or none") from None
        except OSError as error:
            raise RunFailed(f"{error}; --resume goes on") from None
    goes_on = f"finished {what} are in {path}, --resume goes on"
    with store:
        try:
            yield store
        except KeyboardInterrupt:
            raise RunFailed(f"interrupted: {goes_on}") from None
        except (OSError, KilledFromOutsideError) as error:
            raise RunFailed(f"{error}; {goes_on}") from None
        except ValueError as error:
            raise RunFailed(str(error)) from None


def loading(quiet: bool) -> Progress:
    """Progress shown while libraries are loaded, which takes seconds from a slow disk."""
    return Progress(quiet).begin("loading")
