"""Dask's own scheduler and workers, as processes on the loopback.

The caller ends the processes, also if `contact` raises: at the end of a `with`, or by `kill`.
"""

import json
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

from commandline import importing


class _Process(subprocess.Popen):
    """A process that is killed at the end of a `with`, where Popen would wait for its end."""

    def __exit__(self, *error: Any) -> None:
        self.kill()
        super().__exit__(*error)


def dask_scheduler(folder: Path) -> subprocess.Popen:
    """Start a scheduler, which leaves its address in the folder."""
    return _start(folder, "scheduler", "--host", "127.0.0.1", "--port", "0")


def dask_worker(folder: Path) -> subprocess.Popen:
    """Start a worker of the folder's scheduler; it waits until the scheduler has left its address.

    It has four threads: by Dask's default a worker has one per core, so that polhode must run in
    several threads of a process. The number is fixed, so that tests can count on it.
    """
    # A nanny is a second process, which would start the worker anew when a test kills it.
    return _start(folder, "worker", "--nthreads", "4", "--no-nanny")


def _start(folder: Path, role: str, *words: str) -> subprocess.Popen:
    """Start Dask's "scheduler" or "worker" in the folder, with further words of its command line."""
    # The scheduler writes this file; a worker started before waits until it is there.
    shared = ("--scheduler-file", "contact.json", "--no-dashboard")
    # Workers import the tests' functions from this folder. The cache is not that of the test run:
    # what other tests have compiled would be there, and these workers are to compile it themselves.
    environment = {**importing(Path(__file__).parent), "POLHODE_CACHE": str(folder / "cache")}
    command = [sys.executable, "-m", f"distributed.cli.dask_{role}", *words, *shared]
    return _Process(command, env=environment, cwd=folder, stderr=subprocess.DEVNULL)


def contact(folder: Path, seconds: float = 60) -> str:
    """Address of the scheduler that was started in the folder; waits at most so many seconds for it.

    Then it raises a TimeoutError. A scheduler takes a few seconds to start; a minute leaves room
    for a busy machine.
    """
    path = folder / "contact.json"
    end = time.monotonic() + seconds
    # The file is empty for a moment before the address is in it.
    while not (path.exists() and path.read_text()):
        if time.monotonic() > end:
            raise TimeoutError(f"{path}: no scheduler has left its address there in {seconds} s")
        # Seldom enough to leave the processor to the scheduler, and far less than its start takes.
        time.sleep(0.05)
    return json.loads(path.read_text())["address"]
