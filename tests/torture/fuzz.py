"""Hostile scenes, studies, sweeps and command lines, each in a forked process: answered soon, in a line.

A run that is named on standard error, with its form and solver, has been answered: how long it then
takes was asked for.
"""

import os
import re
import resource
import shutil
import signal
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

# A small sweep that ends in a moment; its numbers are made up.
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
# What stands for a number in a file or on a command line: usual numbers, numbers out of range or hard to
# read, and things that are no numbers.
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
# What is inserted anywhere in a file: control characters, signs of other scripts, pieces of TOML.
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
# Words and options that are added to a command line, right ones and wrong ones.
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
# Seconds of the processor within which a command answers, unless it has announced a run; and seconds after
# which a run that was announced is stopped, as it has answered. Estimates, with room for a busy machine.
SECONDS = 10.0
ENOUGH = 2.5
# Bytes of memory that an answer may take beside those with which its process begins, and a quarter
# of the addresses that its process may use: an estimate.
ROOM = 2**30
# A number in a file.
NUMBER = re.compile(r"(?<![\w.])[-+]?\d[\d._]*(?:e[-+]?\d+)?")
# What `solve` says of a run that it has begun.
ANSWERED = re.compile(
    r"^\S+ by \S+ (at|from) tolerance|^note: it (is expected to take|has)", re.MULTILINE
)


def mutated(text: str, random: Random) -> str:
    """A file's text with one to three things in it spoiled.

    In three cases of seven another number is set, else a line is left out or copied elsewhere, a sign inserted,
    the text cut off, or its letters' case changed. A text without numbers is cut off or changed in case.
    """
    for _ in range(random.randint(1, 3)):
        lines = text.split("\n")
        kind = random.randrange(7)
        at = random.randrange(len(lines))
        if kind <= 2 and (numbers := list(NUMBER.finditer(text))):
            number = random.choice(numbers)
            text = text[: number.start()] + random.choice(NUMBERS) + text[number.end() :]
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
    """Without end: contents of the file `x.toml`, and a command line.

    Half of them are scenes; a study, a sweep and other commands have a sixth each.
    """
    while True:
        kind = random.randrange(6)
        if kind <= 2:
            # Often no further words; numbers of choices here and below are estimates.
            extra = [
                random.choice(OPTIONS + WORDS + NUMBERS)
                for _ in range(random.choice((0, 0, 1, 2, 4)))
            ]
            command = random.choice(("solve", "solve", "scenes", "pick", "shape"))
            # The scene's slow time of 0.5 becomes 0.01: a run takes a moment.
            short_scene = SCENE.replace("0.5\n", "0.01\n", 1)
            yield mutated(short_scene, random), [command, "x.toml", *extra]
        elif kind == 3:
            # Read and checked as ever; then no scene is left.
            yield mutated(STUDY, random), ["bench", "x.toml", "--scene", "nothing"]
        elif kind == 4:
            yield (
                mutated(SWEEP, random),
                ["sweep", "x.toml", "--workers", "0", "--quiet", "--out", "o"],
            )
        else:
            # Each gets a file that is not of its kind, or a name or an option that it does not know.
            command = random.choice(
                ("export", "compare", "report", "paper", "bench", "scenes", "solve", "pick")
            )
            arguments = {
                "export": ["x.toml", "o.csv"],
                "compare": ["x.jsonl", "x.toml"],
                "paper": ["nothing"],
            }
            text = mutated(SCENE, random)
            by_default = ["x.toml", "--scene", random.choice(WORDS)]
            yield text, [command, *arguments.get(command, by_default)]


def fuzzed(seed: int, count: int, folder: Path) -> list[str]:
    """Complaints about that many inputs; the folder keeps the files of those complained about."""
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

    Parameters
    ----------
    words
        Words of the command line.
    place
        Folder in which it runs; standard output and standard error go into files there.
    seconds
        Seconds of the processor that it may take, and in which it may do nothing, unless it has announced a
        run.
    announced
        What standard error says of a run that is announced.
    """
    sys.stdout.flush()
    # A forked process begins with the memory of this one, which pytest may have filled before.
    inherited = _resident()
    child = os.fork()
    if child == 0:
        _run(words, place)
    # Seconds of the processor that it had used, and the time, when it last worked or wanted to.
    worked = 0.0
    last = time.monotonic()
    while True:
        ended, status, used = os.wait4(child, os.WNOHANG)
        if ended:
            break
        spent, ready = _spent(child)
        # Who waits for the processor is not late; who waits for anything else is.
        if ready or spent > worked:
            worked = spent
            last = time.monotonic()
        if spent > seconds or time.monotonic() - last > seconds:
            break
        if spent > ENOUGH and announced.search(_said(place)):
            break
        time.sleep(0.005)
    late = not ended
    if late:
        os.kill(child, signal.SIGKILL)
        _, status, used = os.wait4(child, 0)
    said = _said(place)
    running = announced.search(said) or (place / "o" / "store.sqlite").exists()
    code = os.waitstatus_to_exitcode(status)
    lines = [line for line in said.splitlines() if not line.startswith("note: ")]
    if "Traceback" in said:
        return f"traceback {lines[-1]}"
    if late:
        return "" if running else "no answer"
    # Linux counts the largest resident memory in units of 1024 bytes.
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
    """What a command has written on standard error so far."""
    with suppress(FileNotFoundError):
        return (place / "stderr").read_text(encoding="utf-8", errors="replace")
    return ""


def _spent(child: int) -> tuple[float, bool]:
    """Processor time of a process, in seconds, which a busy machine leaves as it is, and whether it wants more."""
    # After the command's name in brackets: the state, and numbers, among them the ticks of the processor
    # in user and in kernel mode (proc(5), fields 3, 14 and 15).
    state, *numbers = (
        Path(f"/proc/{child}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
    )
    user_ticks, kernel_ticks = map(float, numbers[10:12])
    return (user_ticks + kernel_ticks) / os.sysconf("SC_CLK_TCK"), state == "R"


def _run(words: list[str], place: Path) -> None:
    """Run the command in this process, and end it."""
    # No command exits with this code: it stands for an exception.
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
    for found_module in iter_modules(commands.__path__):
        import_module(f"{commands.__name__}.{found_module.name}")
    for module in ("api", "ensembles.sweep", "studies.study", "studies.runner", "answers.pick"):
        import_module(f"polhode.harness.{module}")
    import_module("polhode").solve("paper", samples=3)
