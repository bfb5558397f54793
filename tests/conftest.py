"""What every test needs."""

import os
import signal

# A shell that starts the tests in the background makes them deaf to Ctrl-C, and with them every process they start.
signal.signal(signal.SIGINT, signal.default_int_handler)
# Processes that the tests start are not workers of this run.
for _name in [name for name in os.environ if name.startswith("PYTEST_XDIST")]:
    del os.environ[_name]
