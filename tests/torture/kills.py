"""Kills at random moments, taken up again: the end is what an undisturbed run leaves, but for times."""

import json
import os
import resource
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from random import Random
from typing import Any

from commandline import STUDY

from polhode.harness.common.store import Store
from torture.fuzz import SWEEP

# Fields of records that differ from run to run.
TIMES = (
    *("date", "seconds", "seconds_spread", "seconds_runs", "prepare_seconds", "counted_seconds"),
    *("sentinel_seconds", "disturbed"),
)
# A study with a solver of heyoka, which keeps compiled code on disk, and a sweep of many small tasks: kills
# hit both at work.
BRIEF = STUDY.replace("[1e-4, 1e-6, 1e-8]", "[1e-4, 1e-6]").replace("cyrk-vern8", "taylor")
MANY = SWEEP.replace("particles = 4", "particles = 60\nblock = 5")
# Processes that outlive their parent by this, in seconds, are orphans. An estimate.
GONE = 5.0
# Most kills in a row before a command is let come to its end: by estimate.
MOST_KILLS = 4
# A kill falls within this multiple of the time of an undisturbed run: a few come after the end.
KILLED_WITHIN = 1.1
# Exponents of ten of the largest file that a full disk takes, in bytes: from less than a line of a table to
# some hundred kB.
ROOM = (2.0, 5.5)


def _stored(folder: Path) -> Any:
    """The records in the store of a folder by their key, but for times."""
    (path,) = folder.glob("*.sqlite")
    with Store(path) as store:
        return {
            record["key"]: json.dumps(
                {name: value for name, value in record.items() if name not in TIMES}
            )
            for record in store
        }


def _tables(folder: Path) -> Any:
    """The content of the CSV files by name."""
    return {path.name: path.read_bytes() for path in sorted(folder.rglob("*.csv"))}


def _pages(folder: Path) -> Any:
    """The content of the site's pages by name, but for the opening page, which has the date."""
    return {
        path.name: path.read_bytes()
        for path in sorted(folder.rglob("*.html"))
        if path.name != "index.html"
    }


@dataclass(frozen=True)
class Job:
    """A command that writes into `o`, what of it is compared, and how Python runs it."""

    words: tuple[str, ...]
    outcome: Callable[[Path], Any]
    program: tuple[str, ...] = ("-m", "polhode")


JOBS = {
    "bench": Job(("bench", "study.toml", "--quiet", "--resume"), _stored),
    "regimes": Job(("regimes", "study.toml", "--quiet", "--resume"), _stored),
    "sweep": Job(("sweep", "sweep.toml", "--quiet", "--resume", "--workers", "2"), _stored),
    "paper": Job(("paper", "euler-top", "symmetric-top", "--quick", "--quiet"), _tables),
    "report": Job(("report", "--reports", "reports", "--quiet"), _pages),
}


@contextmanager
def running(
    job: Job, folder: Path, room: int = resource.RLIM_INFINITY
) -> Iterator[subprocess.Popen[bytes]]:
    """The command in a process of its own, in a folder; its standard error goes into the file `stderr` there.

    No file that it writes may become larger than `room`, in bytes.
    """
    environment = {**os.environ, "POLHODE_CACHE": str(folder / "cache")}
    words = [sys.executable, "-P", *job.program, *job.words, "--out", "o"]

    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (room, room))

    with (
        (folder / "stderr").open("wb") as said,
        subprocess.Popen(
            words,
            cwd=folder,
            env=environment,
            stdout=subprocess.DEVNULL,
            stderr=said,
            preexec_fn=limit,
        ) as process,
    ):
        yield process


def orphans(folder: Path) -> list[int]:
    """Ids of the processes that still work for this folder: they have its cache in their environment."""
    mark = f"POLHODE_CACHE={folder / 'cache'}".encode()
    processes = []
    for path in Path("/proc").glob("[0-9]*/environ"):
        try:
            if mark in path.read_bytes().split(b"\0"):
                processes.append(int(path.parent.name))
        except OSError:
            # It has ended, or belongs to another user.
            continue
    return processes


def killed(seed: int, count: int, folder: Path, jobs: tuple[str, ...] = tuple(JOBS)) -> list[str]:
    """Complaints about so many kills, the commands in turn."""
    random = Random(seed)
    complaints = []
    for number, name in enumerate(jobs):
        job = JOBS[name]
        # Shares differ by one at most, and add up to `count`.
        share = (count + number) // len(jobs)
        before = len(complaints)
        print(f"  {name}: {share} kills", end="", flush=True)
        _afresh(folder)
        began = time.monotonic()
        complaints += _finished(job, folder, f"{name}: undisturbed")
        usual = time.monotonic() - began
        undisturbed = job.outcome(folder / "o")
        while share > 0:
            _afresh(folder)
            for _ in range(min(share, random.randint(1, MOST_KILLS))):
                share -= 1
                with running(job, folder) as process:
                    time.sleep(random.uniform(0.0, KILLED_WITHIN * usual))
                    # Two kills of three cannot be caught.
                    process.send_signal(
                        random.choice((signal.SIGKILL, signal.SIGKILL, signal.SIGTERM))
                    )
                until = time.monotonic() + GONE
                while (left := orphans(folder)) and time.monotonic() < until:
                    time.sleep(0.05)
                complaints += [f"{name}: processes {left} outlive it"] * bool(left)
            complaints += _finished(job, folder, f"{name}: taken up")
            if job.outcome(folder / "o") != undisturbed:
                complaints.append(f"{name}: other results than those of an undisturbed run")
        print(f", {len(complaints) - before} complaints", flush=True)
    return complaints


def filled(seed: int, count: int, folder: Path, jobs: tuple[str, ...] = tuple(JOBS)) -> list[str]:
    """Complaints about so many runs of each command with no room for larger files, as on a full disk, each taken up."""
    random = Random(seed)
    complaints = []
    for name in jobs:
        job = JOBS[name]
        before = len(complaints)
        print(f"  {name}: {count} full disks", end="", flush=True)
        _afresh(folder)
        complaints += _finished(job, folder, f"{name}: undisturbed")
        undisturbed = job.outcome(folder / "o")
        for _ in range(count):
            _afresh(folder)
            room = int(10 ** random.uniform(*ROOM))
            with running(job, folder, room) as process:
                code = process.wait()
            said = _said(folder)
            # Caches that cannot be written are named beside it.
            lines = [line for line in said.splitlines() if not line.endswith("anew")]
            if code not in (0, 1) or len(lines) > 1 or "Traceback" in said:
                complaints.append(
                    f"{name} with room for {room} bytes: exit code {code}: {said[-300:]}"
                )
            complaints += _finished(job, folder, f"{name}: taken up")
            if job.outcome(folder / "o") != undisturbed:
                complaints.append(f"{name}: after room for {room} bytes other results")
        print(f", {len(complaints) - before} complaints", flush=True)
    return complaints


def _afresh(folder: Path) -> None:
    """Write the files that the commands read, and remove what they write, but for caches."""
    shutil.rmtree(folder / "o", ignore_errors=True)
    (folder / "study.toml").write_text(BRIEF, encoding="utf-8")
    (folder / "sweep.toml").write_text(MANY, encoding="utf-8")
    (folder / "reports" / "small").mkdir(parents=True, exist_ok=True)
    (folder / "reports" / "small" / "README.md").write_text("# Small\n\nText.\n", encoding="utf-8")


def _said(folder: Path) -> str:
    """What the last command wrote on standard error."""
    return (folder / "stderr").read_text(encoding="utf-8", errors="replace")


def _finished(job: Job, folder: Path, what: str) -> list[str]:
    """Run the command to its end; a complaint, which begins with `what`, if it fails."""
    with running(job, folder) as process:
        code = process.wait()
    return [] if code == 0 else [f"{what}: exit code {code}: {_said(folder).strip()[-300:]}"]


def raced(folder: Path, cold: int = 10) -> list[str]:
    """Complaints about two runs on one store at once, two on one file, and so many cold processes on one cache.

    `cold` is an estimate: with ten, several compile the same at once.
    """
    (folder / "study.toml").write_text(BRIEF, encoding="utf-8")
    bench = JOBS["bench"]
    complaints = []
    with running(bench, folder) as one, running(bench, folder) as other:
        codes = one.wait(), other.wait()
    shared = _stored(folder / "o")
    complaints += _finished(bench, folder, "alone")
    if codes != (0, 0) or shared != _stored(folder / "o"):
        complaints.append(f"two runs on one store: exit codes {codes}")
    shutil.rmtree(folder / "cache", ignore_errors=True)
    solve = Job(("solve", "paper", "--samples", "300", "--quiet", "--no-estimate"), _tables)
    processes = []
    for number in range(cold):
        # The first two write one file.
        out = "same.csv" if number < 2 else f"{number}.csv"
        words = [sys.executable, "-P", *solve.program, *solve.words, "--out", out]
        environment = {**os.environ, "POLHODE_CACHE": str(folder / "cache")}
        processes.append(
            subprocess.Popen(words, cwd=folder, env=environment, stderr=subprocess.PIPE, text=True)
        )
    said = [process.communicate()[1] for process in processes]
    if any(process.returncode for process in processes) or any(said):
        complaints.append(f"{cold} cold processes: {said}")
    if len({path.read_bytes() for path in folder.glob("*.csv")}) != 1:
        complaints.append("the same scene solved at once, other results")
    return complaints
