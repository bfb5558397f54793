"""What tests of the command line share: the installed script, a scene, a study."""

import inspect
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from click.testing import CliRunner

# The installed command, beside this Python.
SCRIPT = str(Path(sys.executable).with_name("polhode"))
# The scene file of the manual: St = 1000, a triaxial ellipsoid.
SCENE = """\
stokes = 1000.0
slow_time = 0.5
[shape]
semi_axes = [1.0, 0.8, 0.5]
[start]
euler_angles = [1.0471975511965976, 0.5235987755982988, 0.0]
euler_rates  = [1.0, 1.0, -1.0]
"""
# Two solvers at three tolerances on one scene at two Stokes numbers, since pages and filters group
# runs by St. It takes seconds, not minutes: runs are short (t = 1 and 2, by `slow_time`), have few
# rows (`samples`), and one that hangs is stopped after `max_seconds`. Its numbers are made up.
STUDY = """\
name = "small"
title = "A small study"
samples = 11
max_seconds = 5.0
tolerances = [1e-4, 1e-6, 1e-8]
forms = ["quaternion"]
solvers = ["cyrk-vern8", "cyrk-dop853"]
[[scenes]]
name = "paper"
stokes = [50.0, 100.0]
slow_time = 0.02
shape.semi_axes = [1.0, 0.8, 0.5]
start.euler_angles = [1.0471975511965976, 0.5235987755982988, 0.0]
start.euler_rates = [1.0, 1.0, -1.0]
"""


def importing(folder: Path) -> dict[str, str]:
    """Environment of processes that import from a folder too, and polhode from where this one has it."""
    return {
        **os.environ,
        "PYTHONPATH": os.pathsep.join([str(folder), *filter(None, [os.environ.get("PYTHONPATH")])]),
    }


def runner() -> CliRunner:
    """Calls commands in this process, with standard output and standard error apart."""
    if "mix_stderr" in inspect.signature(CliRunner).parameters:
        # Click before 8.2 mixes them unless told otherwise.
        return CliRunner(mix_stderr=False)
    return CliRunner()


Run = Callable[..., subprocess.CompletedProcess[str]]
"""What the fixtures `polhode` and `here` give: a function of the words of a command line."""


@contextmanager
def small_disk(folder: Path, size: str) -> Iterator[Path]:
    """A disk of that size, as "300k", at the folder, which must not be there yet.

    Without the right to mount one the test is skipped.
    """
    folder.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", str(folder)]
    if os.geteuid() != 0 or subprocess.run(mount, capture_output=True, check=False).returncode:
        pytest.skip("a small disk needs the right to mount one")
    try:
        yield folder
    finally:
        # Lazily: where a test fails, a process or a store may still have a file open there, and
        # `umount` alone would refuse. The disk leaves the tree now, and its memory goes with the
        # last open file.
        subprocess.run(["umount", "-l", str(folder)], check=True)
