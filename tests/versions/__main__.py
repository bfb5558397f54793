"""The tests under each Python that is found, with the oldest versions of what polhode needs and with the newest.

`python -m versions` in the folder `tests`; names of Pythons and of ends leave out the others:
`python -m versions 3.12 oldest`. First, what would be installed on other platforms is resolved;
`python -m versions platforms` does that alone. Versions are resolved by uv from wheels alone, and
written beside this file; what ran is written into `docs/versions.md`. Exit code 1 if tests fail, or
a platform has no wheels.
"""

import json
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).parents[2]
HERE = Path(__file__).parent
PYTHONS = ("3.11", "3.12", "3.13", "3.14")
# How uv resolves each end.
ENDS = {"oldest": "lowest-direct", "newest": "highest"}
# Shown in the table.
SHOWN = ("numpy", "scipy", "pandas", "llvmlite", "cyrk", "heyoka", "scikit-sundae")
# Platforms by uv's names.
PLATFORMS = {
    "Linux, x86-64": "x86_64-manylinux_2_28",
    "Linux, ARM": "aarch64-manylinux_2_28",
    "macOS, ARM": "aarch64-apple-darwin",
    "macOS, x86-64": "x86_64-apple-darwin",
    "Windows, x86-64": "x86_64-pc-windows-msvc",
}
# Seconds in which an environment is made, and in which the tests run.
SETUP_LIMIT = 900.0
TEST_LIMIT = 3600.0
MISSING = "no such Python here"
RESULTS = HERE / "results.json"
PAGE = ROOT / "docs" / "versions.md"
HEAD = """\
# Versions

`make test-versions` runs the tests under each Python from 3.11 to 3.14 that it finds, with the oldest versions that
`pyproject.toml` admits and that have wheels for it, and with the newest. This is what ran last:

"""
NOTHING = "nothing yet but Python 3.11 with the versions of `constraints.txt` (`make test`).\n"
ELSEWHERE = """
## Platforms

What `pip install polhode` brings on each platform for Python 3.11, by its wheels; a dash is a library that has none
there. polhode works without these libraries, and `polhode solvers` names the solvers that are missing. Only Linux on
x86-64 is tested.

"""


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


def ran(*words: str | Path, seconds: float) -> str:
    """Standard output and error of a command in the checkout; RuntimeError with its end if it fails."""
    done = subprocess.run(
        [str(word) for word in words],
        cwd=ROOT,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=seconds,
        check=False,
    )
    if done.returncode:
        raise RuntimeError(done.stdout[-2000:])
    return done.stdout


def resolved(version: str, end: str) -> Path:
    """The file of versions for a Python at an end, resolved anew."""
    file = HERE / f"{end}-{version}.txt"
    words = ["pip", "compile", "--quiet", "--no-header", "--no-annotate"]
    words += ["--only-binary", ":all:", "--resolution", ENDS[end], "--python-version", version]
    words += ["--extra", "site", "--extra", "dask", "--output-file", str(file), "pyproject.toml"]
    ran(sys.executable, "-m", "uv", *words, seconds=SETUP_LIMIT)
    return file


def environment(python: str, version: str, end: str) -> Path:
    """The interpreter of a new environment with these versions."""
    folder = ROOT / "build" / "versions" / f"{end}-{version}"
    shutil.rmtree(folder, ignore_errors=True)
    ran(python, "-m", "venv", folder, seconds=SETUP_LIMIT)
    there = folder / "bin" / "python"
    constraint = resolved(version, end)
    words = ["install", "--quiet", "--only-binary", ":all:", "--constraint", constraint]
    tools = ["pytest", "pytest-benchmark", "pytest-xdist", "hypothesis", "mpmath", "build"]
    tools += ["setuptools>=77", "xarray", "import-linter"]
    ran(there, "-m", "pip", *words, "-e", ".[dask,site]", *tools, seconds=SETUP_LIMIT)
    return there


def tested(there: Path) -> str:
    """The last line of the tests' output: how many passed and failed."""
    words = ["-m", "pytest", "-m", "not slow", "--numprocesses", "2", "--dist", "worksteal"]
    done = subprocess.run(
        [str(there), *words, "--no-header", "--tb=short"],
        cwd=ROOT,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=TEST_LIMIT,
        check=False,
    )
    (there.parents[1] / "pytest.log").write_text(done.stdout, encoding="utf-8")
    lines = [line for line in done.stdout.splitlines() if re.search(r"\d+ (passed|error)", line)]
    return lines[-1].strip("= ") if lines else f"exit code {done.returncode}"


def one(version: str, end: str) -> dict[str, str]:
    """What ran under a Python at an end."""
    python = interpreter(version)
    if python is None:
        return {"tests": MISSING}
    try:
        there = environment(python, version, end)
    except (RuntimeError, subprocess.TimeoutExpired) as error:
        return {"tests": "could not be installed", "why": str(error)}
    packages = json.loads(ran(there, "-m", "pip", "list", "--format", "json", seconds=SETUP_LIMIT))
    versions = {package["name"].lower(): package["version"] for package in packages}
    full = ran(there, "-c", "import platform; print(platform.python_version())", seconds=60.0)
    shown = {name: versions.get(name, "–") for name in SHOWN}
    return {"python": full.strip(), "tests": tested(there), **shown}


def on_platform(platform: str) -> dict[str, str]:
    """The versions that a platform gets."""
    words = ["pip", "compile", "--quiet", "--no-header", "--no-annotate"]
    words += ["--only-binary", ":all:", "--python-version", PYTHONS[0]]
    words += ["--python-platform", PLATFORMS[platform], "pyproject.toml"]
    try:
        found = ran(sys.executable, "-m", "uv", *words, seconds=SETUP_LIMIT)
    except RuntimeError as error:
        return {"why": str(error)}
    return dict(line.split("==") for line in found.splitlines() if "==" in line)


def table(head: list[str], rows: list[list[str]]) -> str:
    """A table of Markdown."""
    lines = [head, ["---"] * len(head), *rows]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def page(results: dict[str, dict[str, str]]) -> str:
    """The page of what ran."""
    rows = []
    for version in PYTHONS:
        for end in ENDS:
            found = results.get(f"{version} {end}")
            if found is None:
                continue
            tests = re.sub(r" in .*", "", found["tests"])
            rows.append([found.get("python", version), end, tests])
            rows[-1] += [found.get(name, "–") for name in SHOWN]
    text = HEAD + (table(["Python", "versions", "tests", *SHOWN], rows) if rows else NOTHING)
    rows = []
    for platform in PLATFORMS:
        found = results.get(platform, {})
        rows.append([platform, *(found.get(name, "–") for name in SHOWN)])
    return text + ELSEWHERE + table(["platform", *SHOWN], rows)


def main() -> int:
    """Run what is asked for, and write the page; 1 if tests fail."""
    asked = sys.argv[1:]
    versions = [name for name in PYTHONS if name in asked] or PYTHONS
    ends = [name for name in ENDS if name in asked] or [*ENDS]
    results = json.loads(RESULTS.read_text(encoding="utf-8")) if RESULTS.is_file() else {}
    failed = 0

    def note(name: str, found: dict[str, str], words: str) -> None:
        results[name] = found
        print(f"{name}: {words}", found.get("why", ""), flush=True)
        RESULTS.write_text(json.dumps(results, indent=1, sort_keys=True) + "\n", encoding="utf-8")
        PAGE.write_text(page(results), encoding="utf-8")

    for platform in PLATFORMS:
        found = on_platform(platform)
        failed += "why" in found
        note(platform, found, "no wheels" if "why" in found else "resolved")
    if asked == ["platforms"]:
        return int(failed > 0)
    for version in versions:
        for end in ends:
            began = time.monotonic()
            found = one(version, end)
            passed = "passed" in found["tests"] and not re.search("failed|error", found["tests"])
            failed += not (passed or found["tests"] == MISSING)
            seconds = time.monotonic() - began
            note(f"{version} {end}", found, f"{found['tests']}, {seconds:.0f} s in all")
    return int(failed > 0)


if __name__ == "__main__":
    sys.exit(main())
