"""What every test needs."""

import gc
import os
import signal
import sys
import tempfile
from collections.abc import Iterator
from functools import partial
from time import process_time

import pytest

# A shell that starts the tests in the background makes them deaf to Ctrl-C, and with them every
# process they start.
signal.signal(signal.SIGINT, signal.default_int_handler)
# Processes that the tests start are not workers of this run.
for _name in [name for name in os.environ if name.startswith("PYTEST_XDIST")]:
    del os.environ[_name]
# The processes that tests start would compile every module anew.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False
# What a user has fitted or cached decides nothing here; the workers of one run share a cache.
if "POLHODE_CACHE" not in os.environ:
    _cache = tempfile.TemporaryDirectory(prefix="polhode-tests-", ignore_cleanup_errors=True)
    os.environ["POLHODE_CACHE"] = _cache.name


def pytest_collection_finish() -> None:
    """Leave all that is imported and collected by now out of every later search for garbage."""
    gc.collect()
    gc.freeze()


# Modules that read the clock for limits of time and for what runs have spent.
CLOCKS = ("solvers.contract", "solvers.solve", "solvers.segments", "models.spent")
# How many times slower than the processor's time the clock of `swift_machine` runs. An estimate: limits
# leave ten times as much, and a run without end still meets them.
SLOWER = 10


@pytest.fixture
def processor_clock(monkeypatch: pytest.MonkeyPatch) -> None:
    """Limits of time are those of this process alone, whatever else the machine does."""
    for name in CLOCKS:
        monkeypatch.setattr(f"polhode.{name}.perf_counter", process_time)


@pytest.fixture
def swift_machine(monkeypatch: pytest.MonkeyPatch) -> None:
    """As on a machine far faster, with nothing beside this process: limits of time stop no run that is meant."""
    for name in CLOCKS:
        monkeypatch.setattr(f"polhode.{name}.perf_counter", lambda: process_time() / SLOWER)


@pytest.fixture(scope="module")
def quickly_compiled() -> Iterator[None]:
    """Leave out LLVM's optimisation of Taylor's method, which takes nine tenths of the compilation.

    The equations, orders and steps are those of any run. A step takes twice as long; in double precision the
    last digit may be another one. It is not for tests of times, or of the bits of several processes.
    """
    try:
        from polhode.solvers.compile import load_heyoka
        from polhode.solvers.taylor import forget_integrators

        heyoka = load_heyoka()
    except ImportError:
        yield
        return

    with pytest.MonkeyPatch.context() as patch:
        for name in ("taylor_adaptive", "taylor_adaptive_batch"):
            patch.setattr(heyoka, name, partial(getattr(heyoka, name), opt_level=0))
        yield
    # Tests of other modules compile as users do.
    forget_integrators()
