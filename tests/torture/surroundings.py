"""Surroundings that a program does not choose: libraries that are missing, foreign cache folders, closed streams."""

import os
import subprocess
import sys
from pathlib import Path

from hidden import (
    LIBRARIES,
    LONG_COMMANDS,
    QUICK_COMMANDS,
    Answer,
    complaint,
    not_installed,
    python,
    written,
)

# Seconds in which a command ends: far more than any of them takes. If one does not, subprocess.TimeoutExpired
# is raised.
_LIMIT = 900.0
# Seconds after which a study that runs without a library is stopped: by then it has named the library.
_STUDY_SECONDS = 30.0
# The id of a user that is not this one.
_SOMEBODY = 12345
_SOLVE = ("solve", "paper", "--solver", "taylor", "--samples", "5", "--quiet", "--out", "a.csv")
_BENCH = ("bench", "study.toml", "--quick", "--quiet", "--out", "bench")
_SWEEP = ("sweep", "sweep.toml", "--workers", "2", "--quiet", "--out", "sweep")
# What a shell does with the streams of a command: it closes them, lets them be full, or reads no further
# than one byte.
_REDIRECTIONS = (
    ">&-",
    "2>&-",
    ">&- 2>&-",
    "<&- >&- 2>&-",
    ">/dev/full",
    "2>/dev/full",
    "| head -c 1 >/dev/null",
)


def without(folder: Path) -> list[str]:
    """Complaints about every command without each library: it works, or names it before any work."""
    complaints = []
    for library in LIBRARIES:
        place = folder / library
        place.mkdir()
        written(place)
        for words, needs in (QUICK_COMMANDS | LONG_COMMANDS).items():
            if words[0] == "export" and library in LONG_COMMANDS[_BENCH]:
                # There is no store to export.
                continue
            try:
                done = python(library, place, "-m", "polhode", *words, seconds=_STUDY_SECONDS)
            except subprocess.TimeoutExpired:
                # What is missing is named before any work; by now the command is at work.
                continue
            answer = Answer(done.returncode, done.stdout, done.stderr)
            text = complaint(answer, library, refused=library in needs)
            if text and not (text.startswith("exit code 1") and not_installed(library) in text):
                complaints.append(f"without {library}: {' '.join(words)}: {text}")
    return complaints


def foreign(folder: Path) -> list[str]:
    """Complaints about commands whose cache folder somebody else may write: they do without, and say so once."""
    complaints = []
    written(folder)
    # Rights of the folder, and its owner; None is this user.
    for mode, owner in ((0o777, None), (0o770, None), (0o1777, None), (0o700, _SOMEBODY)):
        if owner is not None and os.geteuid() != 0:
            continue
        cache = folder / f"cache-{mode:o}-{owner}"
        cache.mkdir()
        cache.chmod(mode)
        if owner is not None:
            os.chown(cache, owner, owner)
        for words in (_SOLVE, (*_BENCH[:-1], f"bench-{cache.name}")):
            done = subprocess.run(
                [sys.executable, "-P", "-m", "polhode", *words],
                cwd=folder,
                env={**os.environ, "POLHODE_CACHE": str(cache)},
                capture_output=True,
                text=True,
                timeout=_LIMIT,
                check=False,
            )
            lines = [line for line in done.stderr.splitlines() if "not used as a cache" in line]
            if done.returncode or len(lines) != 1 or list(cache.iterdir()):
                complaints.append(
                    f"{cache.name}: {words[0]}: {done.returncode}: {done.stderr[-300:]}"
                )
    return complaints


def closed(folder: Path) -> list[str]:
    """Complaints about commands with closed or full streams: exit code 0 or 1, no traceback, all files there."""
    complaints = []
    commands = {_SOLVE: "a.csv", _BENCH: "bench/README.md", _SWEEP: "sweep/README.md"}
    for words, made in commands.items():
        for number, redirection in enumerate(_REDIRECTIONS):
            place = folder / f"{words[0]}-{number}"
            place.mkdir()
            written(place)
            done = subprocess.run(
                [
                    "sh",
                    "-c",
                    f'"$@" {redirection}',
                    "sh",
                    sys.executable,
                    "-P",
                    "-m",
                    "polhode",
                    *words,
                ],
                cwd=place,
                capture_output=True,
                text=True,
                timeout=_LIMIT,
                check=False,
            )
            if (
                done.returncode not in (0, 1)
                or "Traceback" in done.stdout + done.stderr
                or not (place / made).is_file()
            ):
                complaints.append(
                    f"{' '.join(words)} {redirection}: {done.returncode}: {done.stderr[-300:]}"
                )
    return complaints
