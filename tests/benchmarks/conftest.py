"""The benchmark suite's clock: what five minutes do not hold is left out, and says so."""

from time import perf_counter

import pytest

# Seconds for all cases; the last one may take some more.
BUDGET = 285.0


@pytest.fixture(scope="session")
def suite_began() -> float:
    """When the first case began."""
    return perf_counter()


@pytest.fixture
def time_left(suite_began: float) -> None:
    """Skip a case that comes too late."""
    if perf_counter() - suite_began > BUDGET:
        pytest.skip(f"more than {BUDGET:g} s have passed")


def pytest_benchmark_update_machine_info(config: pytest.Config, machine_info: dict) -> None:
    """The harness's own description of machine and versions, beside the plugin's."""
    from polhode.harness.common.machine import machine, versions

    machine_info["polhode"] = {"machine": machine(), "versions": versions()}


def pytest_addoption(parser: pytest.Parser) -> None:
    """Forms and solvers from outside."""
    for option in ("--with-form", "--with-solver"):
        parser.addoption(
            option,
            action="append",
            default=[],
            metavar="MODULE:CLASS",
            help="one from outside, too",
        )
