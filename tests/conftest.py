"""What every test needs."""

import gc
import os
import signal
import sys
import tempfile

# A shell that starts the tests in the background makes them deaf to Ctrl-C, and with them every process they start.
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
