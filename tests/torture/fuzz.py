"""Hostile scenes, studies, sweeps and command lines, each in a forked process: answered soon, in a line.

A run that is named on standard error, with its form and solver, has been answered: how long it then
takes was asked for.
"""

import os
import re
import resource
import shutil
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules
from random import Random

from commandline import SCENE, STUDY

from polhode.harness import commands
from polhode.harness.cli import main

SWEEP = """\
name = "small"
title = "A small sweep"
shapes = [[1.0, 1.0, 2.0]]
stokes = 200.0
time = 6.0
particles = 4
samples = 11
snapshots = 3
bins = 8
start.motion = "fluid"
"""
NUMBERS = (
    *(
        "0",
        "-0.0",
        "-1",
        "nan",
        "inf",
        "-inf",
        "1e308",
        "-1e308",
        "5e-324",
        "1e400",
        "1e155",
        "1e-200",
        "1e12",
    ),
    *(
        "99999999999999999999",
        "0x10",
        "1_000",
        "true",
        "''",
        "'x'",
        "[]",
        "{}",
        "1979-05-27",
        "1e30",
        "6",
        "360.0",
    ),
)
SIGNS = (
    "\0",
    "\x1b[31m",
    "\ufeff",
    "\u202e",
    "é",
    "\ud800",
    "=",
    "[",
    "]]",
    '"""',
    "\r",
    "#",
    "\n\n[shape]\n",
)
WORDS = (
    "--",
    "-",
    "",
    "paper",
    "top",
    "quaternion",
    "taylor",
    "averaged",
    "os:path",
    "../x",
    "~",
    "a\\nb",
)
OPTIONS = (
    "--form",
    "--solver",
    "--tolerance",
    "--error",
    "--want",
    "--samples",
    "--out",
    "--quiet",
    "-v",
    "--json",
)
SECONDS, ENOUGH = 10.0, 2.5
# Bytes of memory that an answer may take beside those with which its process begins, and a quarter
# of the addresses that its process may use: an estimate.
ROOM = 2**30
NUMBER = re.compile(r"(?<![\w.])[-+]?\d[\d._]*(?:e[-+]?\d+)?")
ANSWERED = re.compile(
    r"^\S+ by \S+ (at|from) tolerance|^note: it (is expected to take|has)", re.MULTILINE
)


def mutated(text: str, random: Random) -> str:
    """A file's text with one to three things in it spoiled."""
    for _ in range(random.randint(1, 3)):
        lines = text.split("\n")
        kind, at = random.randrange(7), random.randrange(len(lines))
        if kind <= 2 and (found := list(NUMBER.finditer(text))):
            one = random.choice(found)
            text = text[: one.start()] + random.choice(NUMBERS) + text[one.end() :]
        elif kind == 3:
            text = "\n".join(lines[:at] + lines[at + 1 :])
        elif kind == 4:
            text = "\n".join([*lines[:at], random.choice(lines), *lines[at:]])
        elif kind == 5:
            place = random.randrange(len(text) + 1)
            text = text[:place] + random.choice(SIGNS) + text[place:]
        else:
            text = (
                text[: random.randrange(len(text) + 1)]
                if random.random() < 0.3
                else text.swapcase()
            )
    return text


def inputs(random: Random) -> Iterator[tuple[str, list[str]]]:
    """Contents of the file `x.toml`, and a command line."""
    while True:
        kind = random.randrange(6)
        if kind <= 2:
            extra = [
                random.choice(OPTIONS + WORDS + NUMBERS)
                for _ in range(random.choice((0, 0, 1, 2, 4)))
            ]
            command = random.choice(("solve", "solve", "scenes", "pick", "shape"))
            yield mutated(SCENE.replace("0.5\n", "0.01\n", 1), random), [command, "x.toml", *extra]
        elif kind == 3:
            # Read and checked as ever; then no scene is left.
            yield mutated(STUDY, random), ["bench", "x.toml", "--scene", "nothing"]
        elif kind == 4:
            yield (
                mutated(SWEEP, random),
                ["sweep", "x.toml", "--workers", "0", "--quiet", "--out", "o"],
            )
        else:
            some = random.choice(
                ("export", "compare", "report", "paper", "bench", "scenes", "solve", "pick")
            )
            more = {
                "export": ["x.toml", "o.csv"],
                "compare": ["x.jsonl", "x.toml"],
                "paper": ["nothing"],
            }
            yield (
                mutated(SCENE, random),
                [some, *more.get(some, ["x.toml", "--scene", random.choice(WORDS)])],
            )


def fuzzed(seed: int, count: int, folder: Path) -> list[str]:
    """Complaints about that many inputs."""
    complaints = []
    for number, (text, words) in zip(range(count), inputs(Random(seed)), strict=False):
        place = Path(tempfile.mkdtemp(dir=folder))
        content = text.encode("utf-8", "surrogatepass")
        for name in ("x.toml", "x.jsonl"):
            (place / name).write_bytes(content)
        if complaint := answered(words, place):
            kept = folder / f"fuzz-{seed}-{number}.toml"
            kept.write_bytes(content)
            complaints.append(f"{complaint}: polhode {' '.join(map(repr, words))} with {kept}")
        shutil.rmtree(place)
    return complaints


def answered(
    words: list[str], place: Path, seconds: float = SECONDS, announced: re.Pattern[str] = ANSWERED
) -> str:
    """What is wrong with the answer to a command line in a folder; empty if nothing is.

    It may take that many seconds of the processor, unless standard error has announced a run.
    """
    sys.stdout.flush()
    # A forked process begins with the memory of this one, which pytest may have filled before.
    inherited = _resident()
    child = os.fork()
    if child == 0:
        _run(words, place)
    worked, last = 0.0, time.monotonic()
    while True:
        ended, status, used = os.wait4(child, os.WNOHANG)
        if ended:
            break
        spent, ready = _spent(child)
        # Who waits for the processor is not late; who waits for anything else is.
        if ready or spent > worked:
            worked, last = spent, time.monotonic()
        if spent > seconds or time.monotonic() - last > seconds:
            break
        if spent > ENOUGH and announced.search(_said(place)):
            break
        time.sleep(0.005)
    late = not ended
    if late:
        os.kill(child, 9)
        _, status, used = os.wait4(child, 0)
    said = _said(place)
    running = announced.search(said) or (place / "o" / "store.sqlite").exists()
    code = os.waitstatus_to_exitcode(status)
    lines = [line for line in said.splitlines() if not line.startswith("note: ")]
    if "Traceback" in said:
        return f"traceback {lines[-1]}"
    if late:
        return "" if running else "no answer"
    taken = used.ru_maxrss * 1024 - inherited
    if taken > ROOM:
        return f"{taken >> 20} MB"
    if code == 2 and (len(lines) != 1 or not lines[0].isprintable()):
        return f"{len(lines)} lines"
    return "" if code in (0, 1, 2) else f"exit code {code}"


def _resident() -> int:
    """Bytes of this process that lie in memory."""
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return pages * resource.getpagesize()


def _said(place: Path) -> str:
    with suppress(FileNotFoundError):
        return (place / "stderr").read_text(encoding="utf-8", errors="replace")
    return ""


def _spent(child: int) -> tuple[float, bool]:
    """Processor time of a process, in seconds, which a busy machine leaves as it is, and whether it wants more."""
    state, *numbers = (
        Path(f"/proc/{child}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
    )
    return sum(map(float, numbers[10:12])) / os.sysconf("SC_CLK_TCK"), state == "R"


def _run(words: list[str], place: Path) -> None:
    """The command in this process, for good."""
    code = 99
    try:
        os.chdir(place)
        for stream, name in ((1, "stdout"), (2, "stderr")):
            os.dup2(os.open(name, os.O_WRONLY | os.O_CREAT), stream)
        sys.stdout, sys.stderr = os.fdopen(1, "w"), os.fdopen(2, "w")
        resource.setrlimit(resource.RLIMIT_AS, (4 * ROOM, 4 * ROOM))
        main(words)
    except SystemExit as end:
        code = int(end.code or 0)
    except BaseException:
        import traceback

        traceback.print_exc()
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)


def warm() -> None:
    """Import and compile, in this process, what the forked ones need."""
    for each in iter_modules(commands.__path__):
        import_module(f"{commands.__name__}.{each.name}")
    for module in ("api", "ensembles.sweep", "studies.study", "studies.runner", "answers.pick"):
        import_module(f"polhode.harness.{module}")
    import_module("polhode").solve("paper", samples=3)
