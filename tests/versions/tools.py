"""What the commands of this folder share: Pythons, environments, and where results lie."""

import json
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]
HERE = Path(__file__).parent
# Environments, roots and logs; git ignores them.
BUILD = ROOT / "build" / "versions"
# The program that takes polhode's steps on a machine.
SMOKE = HERE / "smoke.py"
# Pythons that polhode supports, the oldest first.
PYTHONS = ("3.11", "3.12", "3.13", "3.14")
# Libraries whose versions the tables show.
SHOWN = ("numpy", "scipy", "pandas", "llvmlite", "cyrk", "heyoka", "scikit-sundae")
# Seconds in which an environment is made, and in which a command answers that only tells its version.
SETUP_LIMIT = 900.0
VERSION_LIMIT = 60.0
RESULTS = HERE / "results.json"
# Letters of what a failed command said that its error repeats: the last ones name the reason.
SAID_LETTERS = 2000

Found = dict[str, str]
"""What a job found, in words, by the name of a column of the page; "why" says what is wrong."""


def interpreter(version: str) -> str | None:
    """The command of a Python; None if there is none."""
    candidates = [shutil.which(f"python{version}")]
    candidates += map(str, Path.home().glob(f".pyenv/versions/{version}.*/bin/python{version}"))
    for candidate in filter(None, candidates):
        # pyenv puts a command on the path for each Python it has, chosen or not.
        done = subprocess.run([candidate, "-c", ""], capture_output=True, check=False)
        if done.returncode == 0:
            return candidate
    return None


def ran(*words: str | Path, seconds: float, environment: dict[str, str] | None = None) -> str:
    """What a command in the checkout prints; RuntimeError with the end of all it said if it fails."""
    done = subprocess.run(
        [str(word) for word in words],
        cwd=ROOT,
        env=environment,
        capture_output=True,
        text=True,
        timeout=seconds,
        check=False,
    )
    if done.returncode:
        raise RuntimeError((done.stdout + done.stderr)[-SAID_LETTERS:])
    return done.stdout


def uv(*words: str | Path) -> str:
    """What uv prints."""
    return ran(sys.executable, "-m", "uv", *words, seconds=SETUP_LIMIT)


def bare_environment(python: str, folder: Path) -> Path:
    """The interpreter of a new environment without packages."""
    shutil.rmtree(folder, ignore_errors=True)
    ran(python, "-m", "venv", "--without-pip", folder, seconds=SETUP_LIMIT)
    return folder / "bin" / "python"


def versions_in(there: Path) -> Found:
    """Versions of the packages of an environment, by their names in small letters; `there` is its interpreter."""
    packages = json.loads(uv("pip", "list", "--format", "json", "--python", there))
    return {package["name"].lower(): package["version"] for package in packages}


def full_version(there: Path | str) -> str:
    """Version of a Python, such as 3.12.1."""
    words = "import platform; print(platform.python_version())"
    return ran(there, "-c", words, seconds=VERSION_LIMIT).strip()


def answers_of(output: str) -> dict[str, dict]:
    """Steps of `smoke.py` by name, from what it printed."""
    lines = [json.loads(line) for line in output.splitlines() if line.startswith("{")]
    return {line.pop("step"): line for line in lines}
