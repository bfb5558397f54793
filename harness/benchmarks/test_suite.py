"""The benchmark suite: every form and solver across St and tolerance, as pytest-benchmark cases.

Run by ``pytest --pyargs polhode.harness.benchmarks``; docs/benchmarks.md says with which options.
Errors, work and status are in `extra_info`; `polhode compare` reads the JSON. A row without a time is
skipped with its reason, as its run failed or did not meet the requested error; it stays in the JSON.
"""

import json
from typing import Any

import pytest

from polhode.harness.benchmarks.cases import Method, Options, Row, Suite
from polhode.harness.benchmarks.plugin import Failed, failed_runs, options_of, plain_columns
from polhode.harness.common.timing import Patience, sentinel
from polhode.solvers.contract import Status

# A case is timed at least once, and repeated as long as the two limits below allow it.
# Timed runs at most. An estimate: the least of ten is seldom disturbed.
_MAX_ROUNDS = 10
# Wall time of the timed runs together, in seconds, about; a longer run is timed once. An estimate: the suite has
# hundreds of rows.
_ROUNDS_SECONDS = 0.1
# A shorter run, in seconds, is slow when the processor's caches hold something else: another run
# goes before it. An estimate.
_SHORT_SECONDS = 0.01
# Slow moments of the machine are waited out before every row, for this share of the suite's time at
# most, an estimate. The sentinel, a fixed piece of arithmetic, shows them.
_PATIENCE = Patience(sentinel, share=0.1)
_SUITE = pytest.StashKey[Suite]()


def suite_of(config: pytest.Config) -> Suite:
    """The suite that the options ask for."""
    if _SUITE not in config.stash:
        config.stash[_SUITE] = Suite(Options(**options_of(config)))
    return config.stash[_SUITE]


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """One test per row; its parameters may group the table: ``--benchmark-group-by=group,param:form``."""
    try:
        rows = suite_of(metafunc.config).rows()
    except ValueError as error:
        raise pytest.UsageError(f"polhode: {error}") from None
    plain_columns(metafunc.config)
    names = ("scene", "stokes", "form", "solver", "tolerance", "error")
    values = [(*row.method, row.tolerance, row.error) for row in rows]
    metafunc.parametrize(names, values, ids=[row.name for row in rows])


@pytest.fixture(scope="session")
def references(request: pytest.FixtureRequest) -> None:
    """Compute the references of all selected rows before the first one is timed."""
    names = ("scene", "stokes", "form", "solver")
    methods: dict[Method, None] = {}
    for item in request.session.items:
        if isinstance(item, pytest.Function) and "references" in item.fixturenames:
            values: Any = tuple(item.callspec.params[name] for name in names)
            methods[values] = None
    suite_of(request.config).make_references(methods)


@pytest.mark.usefixtures("references")
def test_solve(
    request: pytest.FixtureRequest,
    benchmark: Any,
    scene: str,
    stokes: float,
    form: str,
    solver: str,
    tolerance: float | None,
    error: float | None,
) -> None:
    """Time the runs of one row; a failure is data."""
    row = Row((scene, stokes, form, solver), tolerance, error)
    case, record, reason = suite_of(request.config).choose(row)
    benchmark.group = row.group
    # The same wherever the suite was found, so that `pytest-benchmark compare` matches its files.
    benchmark.fullname = f"polhode.harness.benchmarks::{request.node.name}"
    # Plain numbers: the plug-in writes NumPy's as strings.
    info = {"key": case.key, "case": case.content, "result": record}
    benchmark.extra_info |= json.loads(json.dumps(info, default=float))
    benchmark.extra_info["want"] = suite_of(request.config).options.want
    benchmark.extra_info["sentinel_seconds"] = _PATIENCE.steady()
    failed = failed_runs(request.config)
    if reason:
        failed.append(Failed.of(benchmark, reason))
        pytest.skip(reason)
    # Time of the run that gave error and work: it counted calls, so that it is slower than the runs timed here.
    seconds = record["counted_seconds"]

    def ready() -> None:
        if seconds < _SHORT_SECONDS:
            case.solve()

    # The first run was within the limit: a repeat runs to its end.
    statuses = []

    def run() -> None:
        statuses.append(case.solve(max_seconds=float("inf")).status)

    rounds = max(1, min(_MAX_ROUNDS, int(_ROUNDS_SECONDS / seconds)))
    # An untimed run goes before them: the one above counted calls, this one does not.
    benchmark.pedantic(run, setup=ready, rounds=rounds, iterations=1, warmup_rounds=1)
    assert set(statuses) == {Status.REACHED_END}
    # pytest-codspeed's fixture has none.
    stats = getattr(benchmark, "stats", None)
    if stats is not None:
        benchmark.extra_info["seconds_runs"] = [float(seconds) for seconds in stats.stats.data]
