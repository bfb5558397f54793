"""Tasks for engines to run: functions of a module, so that they can be sent anywhere."""

import os
import signal
import time
from dataclasses import dataclass
from pathlib import Path

from polhode import models


@dataclass(frozen=True)
class Job:
    """A task with a key, a duration in seconds, and a folder in which it leaves a mark."""

    number: int
    seconds: float = 0.0
    folder: Path | None = None

    @property
    def key(self) -> str:
        return f"job-{self.number}"


def square(job: Job) -> int:
    """Sleep as long as the job says; leave a mark with the own process id if it has a folder."""
    time.sleep(job.seconds)
    if job.folder is not None:
        with (job.folder / job.key).open("a") as file:
            file.write(f"{os.getpid()}\n")
    return job.number**2


def home(job: Job) -> str | None:
    """Where polhode is imported from."""
    return models.__file__


def hold(job: Job) -> None:
    """Leave a mark with the own process id, then sleep."""
    assert job.folder is not None
    # Whoever waits for the mark finds it whole: it gets its name once it is written.
    mark = job.folder / "begun"
    mark.write_text(str(os.getpid()))
    mark.rename(job.folder / job.key)
    time.sleep(job.seconds)


def spin(job: Job) -> int:
    """Use the processor until as many seconds have passed as the job says."""
    end = time.perf_counter() + job.seconds
    while time.perf_counter() < end:
        pass
    return job.number


def meet(job: Job, seconds: float = 60.0) -> int:
    """Wait until the other job of a pair has begun too, at most so many seconds.

    Pairs are 0 and 1, 2 and 3, and so on. A minute leaves room for a worker that starts on a busy machine.
    """
    assert job.folder is not None
    (job.folder / job.key).touch()
    end = time.monotonic() + seconds
    while not (job.folder / f"job-{job.number ^ 1}").exists():
        assert time.monotonic() < end, "alone"
        time.sleep(0.005)
    return job.number


def die_once(job: Job) -> int:
    """Kill the own process on the first attempt at every third job."""
    assert job.folder is not None
    mark = job.folder / job.key
    if job.number % 3 == 0 and not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return job.number**2


def die_always(job: Job) -> int:
    """Kill the own process at each attempt at job 1."""
    if job.number == 1:
        os.kill(os.getpid(), signal.SIGKILL)
    return job.number**2


def refuse_odd(job: Job) -> int:
    """Raise on odd jobs."""
    if job.number % 2:
        raise ValueError(f"job {job.number} is odd")
    return job.number**2
