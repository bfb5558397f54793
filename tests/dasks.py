"""Dask's own scheduler and workers, as processes on the loopback."""

import json
import subprocess
import sys
import time
from pathlib import Path

from commandline import importing


def dask_scheduler(folder: Path) -> subprocess.Popen:
    """Start a scheduler, which leaves its address in the folder."""
    return _start(folder, "scheduler", "--host", "127.0.0.1", "--port", "0")


def dask_worker(folder: Path) -> subprocess.Popen:
    """Start a worker of the folder's scheduler. It has four threads: by Dask's default it has several too."""
    return _start(folder, "worker", "--nthreads", "4", "--no-nanny")


def _start(folder: Path, role: str, *words: str) -> subprocess.Popen:
    """Start Dask's "scheduler" or "worker" in the folder, with further words of its command line."""
    shared = ("--scheduler-file", "contact.json", "--no-dashboard")
    environment = {**importing(Path(__file__).parent), "POLHODE_CACHE": str(folder / "cache")}
    command = [sys.executable, "-m", f"distributed.cli.dask_{role}", *words, *shared]
    return subprocess.Popen(command, env=environment, cwd=folder, stderr=subprocess.DEVNULL)


def contact(folder: Path, seconds: float = 60) -> str:
    """Address of the scheduler that was started in the folder; waits at most so many seconds for it.

    A scheduler takes a few seconds to start; a minute leaves room for a busy machine.
    """
    path = folder / "contact.json"
    end = time.monotonic() + seconds
    while not (path.exists() and path.read_text()) and time.monotonic() < end:
        time.sleep(0.05)
    return json.loads(path.read_text())["address"]
