"""The tests under one Python, with the oldest versions of what polhode needs, or the newest."""

import re
import subprocess
from pathlib import Path

from versions.tools import (
    BUILD,
    HERE,
    ROOT,
    SHOWN,
    SMOKE,
    Found,
    answers_of,
    bare_environment,
    full_version,
    interpreter,
    uv,
    versions_in,
)

# How uv resolves each end.
ENDS = {"oldest": "lowest-direct", "newest": "highest"}
# Seconds in which the tests run, and in which the steps of `smoke.py` are taken: many times what they take.
TEST_LIMIT = 7200.0
STEPS_LIMIT = 1800.0
MISSING = "no such Python here"
# What the tests need beside polhode.
TOOLS = (
    "build",
    "hypothesis",
    "import-linter",
    "mpmath",
    "pip",
    "pytest",
    "pytest-benchmark",
    "pytest-xdist",
    "setuptools>=77",
    "xarray",
)
ALL = "all but the slow ones"


def resolved(version: str, end: str) -> Path:
    """The file of versions for a Python at an end, resolved anew."""
    file = HERE / f"{end}-{version}.txt"
    words = ["pip", "compile", "--quiet", "--no-header", "--no-annotate"]
    words += ["--only-binary", ":all:", "--resolution", ENDS[end], "--python-version", version]
    words += ["--extra", "site", "--extra", "dask", "--output-file", str(file), "pyproject.toml"]
    uv(*words)
    return file


def environment(python: str, version: str, end: str) -> Path:
    """The interpreter of a new environment with these versions."""
    there = bare_environment(python, BUILD / f"{end}-{version}")
    words = ["pip", "install", "--quiet", "--python", there, "--only-binary", ":all:"]
    uv(*words, "--constraint", resolved(version, end), "--editable", ".[dask,site]", *TOOLS)
    return there


def tested(there: Path, end: str, selection: list[str]) -> str:
    """The last line of the tests' output that says how many passed or failed; the exit code if none does."""
    # Old libraries call what newer ones beside them have renamed: Matplotlib 3.9 in pyparsing 3.3.
    allowed = ["-W", "ignore::DeprecationWarning"] if end == "oldest" else []
    words = ["-m", "pytest", "-m", "not slow", "--numprocesses", "2", "--dist", "worksteal"]
    log = there.parents[1] / "pytest.log"
    with log.open("w", encoding="utf-8") as output:
        done = subprocess.run(
            [str(there), *words, "--no-header", "--tb=short", *allowed, *selection],
            cwd=ROOT,
            stdout=output,
            stderr=subprocess.STDOUT,
            timeout=TEST_LIMIT,
            check=False,
        )
    counts = re.findall(r"^.*\d+ (?:passed|failed|error).*$", log.read_text("utf-8"), re.MULTILINE)
    return counts[-1].strip("= ") if counts else f"exit code {done.returncode}"


def smoked(there: Path) -> tuple[str, str]:
    """How many steps of `smoke.py` give numbers, and what is wrong; a step that is refused is not wrong."""
    done = subprocess.run(
        [str(there), SMOKE],
        cwd=BUILD,
        capture_output=True,
        text=True,
        timeout=STEPS_LIMIT,
        check=False,
    )
    answers = answers_of(done.stdout)
    wrong = [f"{step}: {answer['fault']}" for step, answer in answers.items() if "fault" in answer]
    if not answers:
        wrong = [done.stderr[-500:]]
    works = sum("numbers" in answer for answer in answers.values())
    return f"{works} of {len(answers)}", "; ".join(wrong)


def one(version: str, end: str, selection: list[str]) -> Found:
    """What ran under a Python at an end of the versions; `selection` are further arguments of pytest."""
    python = interpreter(version)
    if python is None:
        return {"tests": MISSING}
    try:
        there = environment(python, version, end)
        steps, wrong = smoked(there)
        tests = tested(there, end, selection)
    except RuntimeError as error:
        return {"tests": "could not be installed", "why": str(error)}
    except subprocess.TimeoutExpired:
        return {"tests": f"not done in {TEST_LIMIT:.0f} s"}
    versions = versions_in(there)
    shown = {name: versions.get(name, "–") for name in SHOWN}
    ran = " ".join(word for word in selection if not word.startswith("-")) or ALL
    found = {
        "python": full_version(there),
        "tests": tests,
        "selection": ran,
        "steps": steps,
        **shown,
    }
    return {**found, "why": wrong} if wrong else found


def passed(found: Found) -> bool:
    """Whether tests ran and none failed, and each step answers."""
    if "why" in found:
        return False
    return "passed" in found["tests"] and not re.search("failed|error", found["tests"])
