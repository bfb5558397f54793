"""Libraries taken away: processes to which one is not installed, and what every command is to answer there."""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

from commandline import STUDY

# A folder whose `sitecustomize.py` hides what the variable WITHOUT names from a process, and from those that
# it starts.
HIDING = Path(__file__).with_name("without")
# Import name of each library and the package that brings it.
LIBRARIES = {
    "CyRK": "cyrk",
    "heyoka": "heyoka",
    "sksundae": "scikit-sundae",
    "llvmlite": "llvmlite",
    "pandas": "pandas",
    "matplotlib": "matplotlib",
    "PIL": "pillow",
    "scipy": "scipy",
    "sphinx": "sphinx",
}
# The extra that brings a library.
EXTRAS = {"matplotlib": "figures", "PIL": "figures", "sphinx": "site"}
# Libraries that every command which writes a page needs.
PAGES = frozenset({"pandas", "matplotlib", "PIL", "scipy"})
# Commands, and the libraries that each cannot do without. They run in this order: some of the long ones
# read what others wrote.
QUICK_COMMANDS: dict[tuple[str, ...], frozenset[str]] = {
    ("--help",): frozenset(),
    ("--version",): frozenset(),
    ("forms",): frozenset(),
    ("scenes", "paper"): frozenset(),
    ("schema", "sweep"): frozenset(),
    ("shape", "1", "0.8", "0.5"): frozenset(),
    ("solvers",): frozenset(),
    (
        "solve",
        "paper",
        "--form",
        "quaternion",
        "--tolerance",
        "1e-6",
        "--samples",
        "5",
    ): frozenset(),
}
LONG_COMMANDS: dict[tuple[str, ...], frozenset[str]] = {
    ("solve", "paper", "--samples", "5"): frozenset(),
    ("pick", "paper"): frozenset(),
    ("draw", "paper", "--out", "a.png"): frozenset({"matplotlib", "PIL"}),
    ("bench", "study.toml", "--quick", "--quiet", "--out", "bench"): PAGES,
    ("export", "bench/store.sqlite", "a.csv"): frozenset(),
    (
        "bench",
        "--problems",
        "--scene",
        "rigid-body",
        "--quick",
        "--quiet",
        "--out",
        "problems",
    ): PAGES,
    ("regimes", "study.toml", "--quick", "--quiet", "--out", "regimes"): PAGES,
    ("sweep", "sweep.toml", "--workers", "0", "--quiet", "--out", "sweep"): PAGES,
    ("paper", "euler-top", "--quick", "--quiet", "--out", "paper"): PAGES,
    (
        "accuracy",
        "--quick",
        "--seconds",
        "20",
        "--workers",
        "0",
        "--quiet",
        "--out",
        "accuracy",
    ): PAGES,
    ("accuracy", "--order", "2", "--quick", "--quiet", "--out", "second"): PAGES,
    ("accuracy", "--order", "hybrid", "--quick", "--quiet", "--out", "hybrid"): PAGES,
    ("equal-error", "--quick", "--quiet", "--out", "equal"): PAGES | {"llvmlite"},
    ("throughput", "--out", "throughput"): PAGES | {"llvmlite", "heyoka"},
    ("report", "--reports", "bench", "--out", "site", "--quiet"): PAGES | {"sphinx"},
    ("doctor",): frozenset(),
}
# A small sweep of two shapes that ends in a moment; its numbers are made up.
SWEEP = """\
name = "small"
title = "A small sweep"
shapes = [[1.0, 1.0, 2.0], [1.0, 0.8, 0.5]]
stokes = 200.0
time = 6.0
particles = 4
samples = 11
snapshots = 3
bins = 8
start.motion = "fluid"
"""
# A program that runs commands one after another in one process, and prints their `Answer`s as JSON.
_SEVERAL = """
import contextlib, io, json, sys
from polhode.harness.cli import main
answers = []
for words in json.loads(sys.argv[1]):
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            main(words)
        except SystemExit as end:
            code = end.code
    answers.append((code, out.getvalue(), err.getvalue()))
print(json.dumps(answers))
"""


class Answer(NamedTuple):
    """What a command answers: its exit code, standard output and standard error."""

    code: int
    out: str
    err: str


def python(
    library: str, folder: Path, *words: str, seconds: float = 600.0, narrow: bool = False
) -> subprocess.CompletedProcess[str]:
    """Run Python in a folder, without a library, as if it were not installed.

    Parameters
    ----------
    library
        Import name of a library of `LIBRARIES`; several are joined by +.
    folder
        Where it runs.
    words
        Words of its command line.
    seconds
        Limit of time, far more than any command takes; then subprocess.TimeoutExpired is raised.
    narrow
        Whether long double is double there.
    """
    path = os.pathsep.join([str(HIDING), *filter(None, [os.environ.get("PYTHONPATH")])])
    names = [f"{name},{LIBRARIES[name]}" for name in library.split("+")]
    hidden = {"PYTHONPATH": path, "WITHOUT": ",".join(names)}
    if narrow:
        # What is cached here was computed in extended precision.
        hidden |= {"NARROW": "1", "POLHODE_CACHE": str(folder / "narrow")}
    return subprocess.run(
        [sys.executable, "-P", *words],
        cwd=folder,
        env={**os.environ, **hidden},
        capture_output=True,
        text=True,
        timeout=seconds,
        check=False,
    )


def answers(library: str, folder: Path, commands: list[tuple[str, ...]]) -> list[Answer]:
    """What commands answer without a library, all in one process; AssertionError if that fails."""
    written(folder)
    done = python(library, folder, "-c", _SEVERAL, json.dumps(commands))
    if done.returncode:
        raise AssertionError(done.stderr)
    return [Answer(*answer) for answer in json.loads(done.stdout)]


def written(folder: Path) -> None:
    """Write the files that the commands read."""
    (folder / "study.toml").write_text(STUDY, encoding="utf-8")
    (folder / "sweep.toml").write_text(SWEEP, encoding="utf-8")


def not_installed(library: str) -> str:
    """How a line ends that says that a library is missing, and which command installs it."""
    if library in EXTRAS:
        return f"{library} is not installed: pip install 'polhode[{EXTRAS[library]}]'"
    return f"{LIBRARIES[library]} is not installed: pip install {LIBRARIES[library]}"


def complaint(answer: Answer, library: str, *, refused: bool) -> str:
    """What is wrong with an answer without a library; empty if nothing is.

    A command works, unless it is to be refused: then it says in one line what is missing, before any work.
    """
    code, out, err = answer
    if "Traceback" in out + err:
        return f"traceback: {err[-300:]}"
    if not refused:
        return "" if code == 0 else f"exit code {code}: {err[-300:]}"
    lines = err.splitlines()
    if code != 1 or out or len(lines) != 1 or not lines[0].endswith(not_installed(library)):
        return f"exit code {code}, expected 1 and a line on {library}: {out[-100:]}{err[-300:]}"
    return ""
