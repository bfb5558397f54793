"""pytest plug-in: options and table of the benchmark suite, and the fixture `work_precision`.

pytest loads it whenever it starts. So at the top it imports pytest and the standard library alone.
"""

from argparse import ArgumentTypeError
from collections import Counter
from collections.abc import Callable, Generator
from dataclasses import asdict, dataclass
from importlib import import_module
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from polhode.harness.benchmarks.measured import Measure

# Columns of the suite's table unless `--benchmark-columns` names others.
_COLUMNS = ["min", "median", "rounds"]
# Lines under the suite's table.
_LEGEND = (
    "  tol: tolerance; error: {error}, < where the reference resolves no smaller one.",
    "  *: no other run in the table is both as fast and as accurate; min is what counts.",
)
# Choices of `--polhode-want`, with their words in the legend.
_ERRORS = {"slow": "of L and E over I_max", "orientation": "of the orientation, in rad"}


@dataclass(frozen=True)
class Failed:
    """A row without a time, as it stands in the JSON, beside the benchmarks."""

    name: str
    fullname: str
    group: str
    param: str | None
    params: dict[str, Any] | None
    reason: str
    extra_info: dict[str, Any]

    @classmethod
    def of(cls, benchmark: Any, reason: str) -> "Failed":
        """The row of a pytest-benchmark fixture that timed nothing, and why."""
        names = ("name", "fullname", "group", "param", "params", "extra_info")
        return cls(**{name: getattr(benchmark, name) for name in names}, reason=reason)


# Key of the failed rows in pytest's config: it is there once a row of the suite has run.
_FAILED = pytest.StashKey[list[Failed]]()


def failed_runs(config: pytest.Config) -> list[Failed]:
    """Rows without a time, to which the suite adds; from the first call on the config holds a list of them."""
    return config.stash.setdefault(_FAILED, [])


_FOLDER = Path(__file__).parent


class _Suite(pytest.Module):
    """The suite under the name that it is installed by; in a checkout its folders are named otherwise."""

    def _getobj(self) -> Any:
        return import_module("polhode.harness.benchmarks.test_suite")


def pytest_collect_directory(path: Path, parent: pytest.Collector) -> pytest.Collector | None:
    """Collect the suite's folder and those around it without importing them as packages.

    In a checkout they would be imported as `harness` and `harness.benchmarks`, beside the same modules
    under the names that they are installed by.
    """
    if _FOLDER.is_relative_to(path) and (path / "__init__.py").is_file():
        return pytest.Dir.from_parent(parent, path=path)
    return None


def pytest_pycollect_makemodule(
    module_path: Path, parent: pytest.Collector
) -> pytest.Module | None:
    """Import the suite by its own name."""
    if module_path == _FOLDER / "test_suite.py":
        return _Suite.from_parent(parent, path=module_path)
    return None


def _words(text: str) -> list[str]:
    """Names of an option, separated by commas."""
    words = [word.strip() for word in text.split(",")]
    if not all(words):
        raise ArgumentTypeError(f"got {text!r}, expected names separated by commas")
    return words


def _stokes(text: str) -> list[float]:
    """St of an option, separated by commas: 0 and inf are among those allowed."""
    return _numbers(text, "numbers from 0 on", lambda number: number >= 0)


def _errors(text: str) -> list[float]:
    """Requested errors of an option, separated by commas."""
    return _numbers(text, "positive numbers", lambda number: isfinite(number) and number > 0)


def _numbers(text: str, expected: str, valid: Callable[[float], bool]) -> list[float]:
    """Valid numbers, separated by commas; ArgumentTypeError, which says what was expected, by others."""
    try:
        numbers = [float(word) for word in text.split(",")]
    except ValueError:
        numbers = []
    if not numbers or not all(valid(number) for number in numbers):
        raise ArgumentTypeError(f"got {text!r}, expected {expected} separated by commas")
    return numbers


def pytest_addoption(parser: pytest.Parser) -> None:
    """Options of the suite and of `work_precision`."""
    group = parser.getgroup("polhode", "polhode: forms and solvers under pytest-benchmark")
    add = group.addoption
    add("--polhode-quick", action="store_true", help="A look: few St and tolerances, short runs.")
    add("--polhode-stokes", type=_stokes, metavar="1e2,1e4", help="St instead of the suite's.")
    add("--polhode-forms", type=_words, metavar="NAMES", help="Forms instead of the suite's.")
    add("--polhode-solvers", type=_words, metavar="NAMES", help="These solvers alone.")
    add(
        "--polhode-errors",
        type=_errors,
        metavar="1e-3,1e-6",
        help="One table per error: every method at the loosest tolerance that meets it.",
    )
    add(
        "--polhode-want",
        choices=tuple(_ERRORS),
        default="slow",
        help="Which error the table shows: of L and E (slow), or of the orientation.",
    )
    add(
        "--polhode-update-counts",
        action="store_true",
        help="Store the counts of work of the tests that ask `work_precision` for them.",
    )
    for option in ("--with-form", "--with-solver"):
        help_text = "Add one from outside to the suite; repeatable."
        add(option, action="append", default=[], metavar="MODULE:CLASS", help=help_text)


def options_of(config: pytest.Config) -> dict[str, Any]:
    """The suite's options by the names of `cases.Options`."""
    option: Any = config.getoption
    options: dict[str, Any] = {}
    for name in ("stokes", "forms", "solvers", "errors"):
        options[name] = tuple(option(f"polhode_{name}") or ())
    options["with_forms"] = tuple(option("with_form"))
    options["with_solvers"] = tuple(option("with_solver"))
    options["want"] = option("polhode_want")
    options["quick"] = option("polhode_quick")
    return options


def plain_columns(config: pytest.Config) -> None:
    """Show few columns of pytest-benchmark's unless its own option names some; the suite asks for it."""
    session = getattr(config, "_benchmarksession", None)
    if session is not None and not config.getoption("benchmark_columns", None):
        session.columns = _COLUMNS


@pytest.hookimpl(optionalhook=True, wrapper=True)
def pytest_benchmark_group_stats() -> Generator[None, Any, Any]:
    """Name the rows of each table by form, solver, tolerance and error."""
    groups = yield
    from polhode.harness.benchmarks.table import name_rows

    for _, rows in groups:
        name_rows(rows)
    return groups


@pytest.hookimpl(optionalhook=True)
def pytest_benchmark_update_json(config: pytest.Config, output_json: dict[str, Any]) -> None:
    """Add the rows without a time, machine and versions, where rows of the suite ran."""
    if _FAILED not in config.stash:
        return
    from polhode.harness.common.machine import surroundings

    failed = [asdict(run) for run in failed_runs(config)]
    output_json["polhode"] = {**surroundings(), "failed": failed}


# Last, so that the legend stands below pytest-benchmark's table.
@pytest.hookimpl(trylast=True)
def pytest_terminal_summary(
    terminalreporter: pytest.TerminalReporter, config: pytest.Config
) -> None:
    """Say what the rows' names mean, and count the runs without a time."""
    if _FAILED not in config.stash:
        return
    for line in _LEGEND:
        terminalreporter.write_line(
            line.format(error=_ERRORS[str(config.getoption("polhode_want"))])
        )
    failed = failed_runs(config)
    if failed:
        # A reason is a status, and after a colon the solver's own words. Each such row is a skipped test.
        counts = Counter(run.reason.partition(":")[0] for run in failed).most_common()
        words = ", ".join(f"{count} {status}" for status, count in counts)
        terminalreporter.write_line(f"  Without a time: {words}; -rs says why.")


@pytest.fixture
def work_precision(request: pytest.FixtureRequest, benchmark: Any) -> "Measure":
    """Run, time and judge a problem: ``work_precision(problem, "cyrk-vern8", 1e-8).error < 1e-6``."""
    from polhode.harness.benchmarks.measured import Measure

    return Measure(request, benchmark)
